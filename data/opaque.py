"""Opaque axial rectangles of a model, exactly, on the integer grid.

Per plane, all axial triangles are turned to one orientation, so the winding number of a point is the number of
triangles that cover it, whatever overlaps, doubles or T-junctions there are. Shared edges cancel; what the rest covers
(data/outlines.py) is a subset of the true surface, so nothing is ever called blocked that is not. What cuts cells may
leave out more (`carve_area`): the axial boxes around small oblique parts of upright outlines, such as arches, whose
openings then are rectangles.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .apart import taken_apart
from .graph import OTHER_AXES, flat_boxes
from .outlines import OBLIQUE_STEPS, Covered, Outlines, cover, outline
from .patience import ask
from .shapes import extents


class PlaneIndex:
    """Opaque rectangles of each plane, looked up by axis and coordinate."""

    def __init__(self, boxes_by_axis: list[np.ndarray]) -> None:
        self._planes: dict[tuple[int, int], np.ndarray] = {}
        for axis, boxes in enumerate(boxes_by_axis):
            if not len(boxes):
                continue
            planes, starts = np.unique(boxes[:, 0, axis], return_index=True)
            for k, part in zip(planes, np.split(boxes, starts[1:]), strict=True):
                self._planes[axis, int(k)] = part[:, :, OTHER_AXES[axis]].astype(np.int64)

    def rectangles(self, axis: int, k: int) -> np.ndarray:
        """Opaque rectangles of a plane, shape (n, 2, 2), int64."""
        return self._planes.get((axis, k), np.zeros((0, 2, 2), np.int64))

    def is_open(self, face: tuple[int, ...]) -> bool:
        """Whether nothing opaque overlaps the face (axis, side, plane, u low, u high, v low, v high)."""
        axis, _, k, u0, u1, v0, v1 = face
        r = self._planes.get((axis, k))
        if r is None:
            return True
        hit = (r[:, 0, 0] < u1) & (r[:, 1, 0] > u0) & (r[:, 0, 1] < v1) & (r[:, 1, 1] > v0)
        return not hit.any()


@dataclass
class OpaquePlanes:
    """Disjoint opaque rectangles by axis.

    Attributes:
        boxes: for each axis, flat boxes [grid steps], shape (n, 2, 3), int32, sorted by plane.
        axial_area: opaque area on axial triangles, squared grid steps (overlaps counted once).
        lost_area: part of it dropped along oblique outlines.
        sliver: rectangles that reach no further into a cell than this need not cut it [grid steps].
    """

    boxes: list[np.ndarray]
    axial_area: float
    lost_area: float
    sliver: int = 0

    @cached_property
    def index(self) -> PlaneIndex:
        """The rectangles of each plane."""
        return PlaneIndex(self.boxes)


NO_PLANES = OpaquePlanes([np.zeros((0, 2, 3), np.int32)] * 3, 0.0, 0.0)


def opaque_planes(triangles: np.ndarray, oblique_steps: int = OBLIQUE_STEPS) -> OpaquePlanes:
    """Opaque rectangles of the axial triangles among `triangles`.

    Args:
        triangles: of opaque objects [grid steps], shape (m, 3, 3), int32.
        oblique_steps: most steps of the staircase along an oblique outline; 1 for none.
    """
    outlines, planes = _outlines(triangles)
    return _opaque(planes, *_covered(cover(outlines, oblique_steps), len(planes)))


def carved_planes(triangles: np.ndarray, carve_area: float) -> tuple[OpaquePlanes, OpaquePlanes]:
    """As `opaque_planes`, and the same with oblique details of upright planes carved out; levels are never carved.

    Args:
        triangles: as of `opaque_planes`.
        carve_area: as of `cover`, of every plane.
    """
    outlines, planes = _outlines(triangles)
    owner, rectangles, areas = _covered(cover(outlines), len(planes))
    plain = _opaque(planes, owner, rectangles, areas)
    detailed = np.zeros(len(planes), bool)
    detailed[outlines.owner[outlines.oblique]] = True
    detailed &= planes[:, 0] < 2
    if not detailed.any():
        return plain, plain
    numbers = np.flatnonzero(detailed)
    carve = np.full(len(numbers), carve_area)
    other, carved, areas[numbers] = _covered(cover(outlines.only(detailed), carve=carve), len(numbers))
    keep = ~detailed[owner]
    owner, rectangles = np.concatenate([owner[keep], numbers[other]]), np.concatenate([rectangles[keep], carved])
    order = np.argsort(owner, kind="stable")
    return plain, _opaque(planes, owner[order], rectangles[order], areas)


def _outlines(triangles: np.ndarray) -> tuple[Outlines, np.ndarray]:
    """Outlines of every plane that holds axial triangles, and its axis and coordinate, shape (planes, 2), ordered.

    Planes of much that lies apart are there several times.
    """
    corners, planes = [np.zeros((0, 3, 2), np.int64)], [np.zeros((0, 2), np.int64)]
    flat = extents(triangles) == 0
    for axis in range(3):
        chosen = triangles[flat[:, axis]]
        corners.append(chosen[:, :, OTHER_AXES[axis]].astype(np.int64))
        planes.append(np.column_stack([np.full(len(chosen), axis), chosen[:, 0, axis]]))
    ask()
    distinct, owner = np.unique(np.concatenate(planes), axis=0, return_inverse=True)
    flat = np.concatenate(corners)
    part, plane = taken_apart(owner.ravel(), np.stack([flat.min(axis=1), flat.max(axis=1)], axis=1), len(distinct))
    ask()
    return outline(flat, part, len(plane)), distinct[plane]


def _covered(parts: Iterable[Covered], count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Outline of each rectangle, ascending; rectangles (n, 2, 2); area kept and lost of each outline, (count, 2)."""
    owners, found = [np.zeros(0, np.int64)], [np.zeros((0, 2, 2), np.int32)]
    areas = np.zeros((count, 2))
    for part in parts:
        owner, rectangles = part.rasters.tile(part.kept)
        owners.append(owner + part.first)
        found.append(rectangles)
        mine = slice(part.first, part.first + len(part.rasters))
        areas[mine] = np.column_stack([part.areas(part.kept), part.areas(part.lost)])
    return np.concatenate(owners), np.concatenate(found), areas


def _opaque(planes: np.ndarray, owner: np.ndarray, rectangles: np.ndarray, areas: np.ndarray) -> OpaquePlanes:
    """Rectangles of planes (axis, coordinate) as flat boxes."""
    found = []
    for axis in range(3):
        mine = planes[owner, 0] == axis
        found.append(flat_boxes(rectangles[mine], axis, planes[owner[mine], 1].astype(np.int32)))
    return OpaquePlanes(found, float(areas.sum()), float(areas[:, 1].sum()))
