"""Walls that stand nearly along an axis: opaque rectangles of axial planes inside them.

Exporters write walls a few grid steps off the axes. Their faces lie in no axial plane, but an axial plane between two
opposite faces runs inside the wall wherever the wall is thicker than it is askew, and a section there is an exact axial
occluder: no vertex has to be moved.
"""

from itertools import pairwise

import numpy as np

from .graph import flat_boxes
from .opaque import OpaquePlanes
from .sections import over, section_rectangles

# Faces that lean no more than this off an axial plane [degrees].
MOST_DEG = 5.0
# Beside such walls, what reaches no further into a cell than this cuts nothing [grid steps]: reveals of doors stick out
# of the wall's cells by what it is askew.
SLIVER = 64
# Rectangles and faces below this cut nothing.
LEAST_M2 = 1.0


def find_sections(elements: list[np.ndarray], grid_m: float) -> list[np.ndarray]:
    """Sections of walls that stand nearly along an axis.

    Args:
        elements: triangles of each closed opaque element [grid steps], shape (m, 3, 3), int32.
        grid_m: grid step [m].

    Returns:
        Flat boxes of each axis, shape (n, 2, 3), int32.
    """
    least = LEAST_M2 / grid_m**2
    boxes: list[list[np.ndarray]] = [[np.zeros((0, 2, 3), np.int32)] for _ in range(3)]
    for triangles in elements:
        for axis in (0, 1):
            for plane in _between_faces(triangles, axis, least):
                boxes[axis].append(_section(triangles, axis, plane, least))
    return [np.concatenate(parts) for parts in boxes]


def with_sections(planes: OpaquePlanes, sections: list[np.ndarray]) -> OpaquePlanes:
    """Opaque planes of axial faces, and sections of walls; the very same planes if there are none."""
    if not any(len(part) for part in sections):
        return planes
    joined = [np.concatenate(parts) for parts in zip(planes.boxes, sections, strict=True)]
    ordered = [part[np.argsort(part[:, 0, axis], kind="stable")] for axis, part in enumerate(joined)]
    return OpaquePlanes(ordered, planes.axial_area, planes.lost_area, SLIVER)


def _between_faces(triangles: np.ndarray, axis: int, least: float) -> list[int]:
    """Planes between opposite faces of an element that are nearly, but not exactly, perpendicular to an axis."""
    edges = (triangles[:, 1:] - triangles[:, :1]).astype(float)
    normals = np.cross(edges[:, 0], edges[:, 1])
    size = np.linalg.norm(normals, axis=1)
    across = np.abs(np.delete(normals, axis, axis=1)).max(axis=1)
    near = (across > 0) & (across <= np.tan(np.radians(MOST_DEG)) * np.abs(normals[:, axis])) & (size > 0)
    if size[near].sum() / 2 < least:
        return []
    low, high = triangles[near, :, axis].min(axis=1), triangles[near, :, axis].max(axis=1)
    outward, area = np.sign(normals[near, axis]), size[near] / 2
    order = np.argsort(low, kind="stable")
    faces: list[list[float]] = []
    for row in order.tolist():
        # Triangles that face one way and reach over the same coordinates are one face.
        if faces and faces[-1][3] == outward[row] and low[row] <= faces[-1][1]:
            faces[-1][1] = max(faces[-1][1], high[row])
            faces[-1][2] += area[row]
        else:
            faces.append([low[row], high[row], area[row], outward[row]])
    planes = []
    for first, second in pairwise(faces):
        # From a face that looks down the axis to one that looks up it, the solid lies between.
        inside = first[3] < 0 < second[3] and first[1] + 1 < second[0]
        if inside and min(first[2], second[2]) >= least:
            # Just inside either face, so that what a door leaves open in the wall stays in the wall's own cells.
            planes += sorted({int(first[1]) + 1, int(second[0]) - 1})
    return planes


def _section(triangles: np.ndarray, axis: int, plane: int, least: float) -> np.ndarray:
    """Flat boxes inside the section of an element, shape (n, 2, 3), int32; none if it is small."""
    _, rectangles = section_rectangles([over(triangles, axis, plane)])
    area = (rectangles[:, 1] - rectangles[:, 0]).prod(axis=1).sum()
    boxes = flat_boxes(rectangles, axis, np.full(len(rectangles), plane, np.int32))
    return boxes if area >= least else boxes[:0]
