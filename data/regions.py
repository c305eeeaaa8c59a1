"""Opaque regions of axial planes: true opaque surface on the plane, and the sections of closed elements it cuts.

A sightline that starts outside every solid and passes the plane inside a region has met opaque surface by then: either
the surface on the plane, or that of a closed element whose inside it has reached. Cutting *all* closed elements fills
the gaps that walls leave in each other's faces and merges what a model keeps apart, so one region is as strong as the
wall that a person sees. Open, inverted or doubled meshes give no section; they lose occlusion, never safety.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from .blockers import Blockers, maximal_rectangles, paint
from .graph import OTHER_AXES
from .opaque import OpaquePlanes, edge_rectangles

# Regions and pieces of furniture below this hide little and would fill the hierarchy.
LEAST_M2 = 0.5
# An element thinner than this is also cut through its middle, which serves cells that touch its face.
THIN_M = 0.6
# A closed element with oblique faces is cut only where it is so large: its sections break into many rectangles.
ROUND_M2 = 2.0
# Steps of the staircase along an oblique outline of a section.
SECTION_STEPS = 4
# Steps along an outline on a level: slabs of turned wings reach to the middle of the walls on them.
LEVEL_STEPS = 24
# Normals that rise, or lean off an axis, by less than this do not count.
UPRIGHT = 1e-3
# An oblique section of more triangles than this is left out: it costs more than it hides.
SECTION_TRIANGLES = 200


@dataclass
class Regions:
    """Connected regions, each on a raster of its own distinct coordinates.

    Attributes:
        axis: the axis each is perpendicular to, shape (regions,), int32.
        plane: coordinate on that axis [grid steps], shape (regions,), int32.
        places: where each region's u, v and table begin in the three arrays below, shape (regions + 1, 3), int64.
        u: ascending raster coordinates on the lower of the other two axes, all regions one after another, int32.
        v: likewise on the higher one.
        open_before: uncovered raster cells before (i, j), a summed-area table of len(u) x len(v) per region, int32.
        boxes: rectangles inside the regions, overlapping, none able to grow [grid steps], shape (boxes, 2, 3), int32.
        region: region of each rectangle, shape (boxes,), int32.
    """

    axis: np.ndarray
    plane: np.ndarray
    places: np.ndarray
    u: np.ndarray
    v: np.ndarray
    open_before: np.ndarray
    boxes: np.ndarray
    region: np.ndarray

    @property
    def blockers(self) -> Blockers:
        """The rectangles as a target search wants them."""
        return Blockers(self.boxes, self.axis[self.region])


def find_regions(
    opaque: OpaquePlanes, occluders: list[np.ndarray], details: list[np.ndarray], grid_m: float
) -> Regions:
    """Regions of every plane that holds enough opaque surface, or the middle of a thin or oblique closed element.

    Args:
        opaque: opaque rectangles.
        occluders: triangles (m, 3, 3) of each closed element that is cut, int32.
        details: likewise of closed elements that are cut only if they are boxes and large enough.
        grid_m: grid step [m].
    """
    least = LEAST_M2 / grid_m**2
    elements = _Sections(occluders, details, least, ROUND_M2 / grid_m**2)
    index = opaque.index
    found = []
    for axis in range(3):
        uv = OTHER_AXES[axis]
        extent = (opaque.boxes[axis][:, 1] - opaque.boxes[axis][:, 0]).astype(float)[:, uv]
        planes, place = np.unique(opaque.boxes[axis][:, 0, axis], return_inverse=True)
        area = np.bincount(place, extent.prod(axis=1), minlength=len(planes))
        middles = elements.middles(axis, round(THIN_M / grid_m))
        for k in np.unique(np.concatenate([planes[area >= least], middles])):
            rectangles = np.concatenate([index.rectangles(axis, int(k)), elements.rectangles(axis, int(k))])
            for region in _plane_regions(rectangles, least):
                found.append((axis, int(k), *region))
    return _pack(found)


def _plane_regions(rectangles: np.ndarray, least: float) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Connected parts of a union of rectangles: u, v, covered raster cells, and maximal rectangles of each."""
    if not len(rectangles):
        return []
    us, vs = np.unique(rectangles[:, :, 0]), np.unique(rectangles[:, :, 1])
    covered = paint(rectangles, us, vs)
    labels, _ = ndimage.label(covered)
    found = []
    for label, window in enumerate(ndimage.find_objects(labels), start=1):
        own = labels[window] == label
        u = us[window[0].start : window[0].stop + 1]
        v = vs[window[1].start : window[1].stop + 1]
        if (own * np.outer(np.diff(u), np.diff(v)).astype(float)).sum() < least:
            continue
        # Raster lines that separate equal rows belong to other regions of the plane.
        rows = np.concatenate([[True], (own[1:] != own[:-1]).any(axis=1), [True]])
        columns = np.concatenate([[True], (own[:, 1:] != own[:, :-1]).any(axis=0), [True]])
        own = own[rows[:-1]][:, columns[:-1]]
        u, v = u[rows], v[columns]
        whole = own.shape == (1, 1)
        rectangles = np.stack([u, v], axis=1)[None] if whole else maximal_rectangles(own, own, u, v)
        found.append((u, v, own, rectangles.astype(np.int32)))
    return found


def _pack(found: list[tuple]) -> Regions:
    axis = np.array([part[0] for part in found], np.int32)
    plane = np.array([part[1] for part in found], np.int32)
    sizes = np.array([[len(u), len(v), len(u) * len(v)] for _, _, u, v, _, _ in found], np.int64).reshape(-1, 3)
    places = np.concatenate([np.zeros((1, 3), np.int64), np.cumsum(sizes, axis=0)])
    tables = []
    for _, _, u, v, covered, _ in found:
        table = np.zeros((len(u), len(v)), np.int32)
        table[1:, 1:] = (~covered).cumsum(axis=0).cumsum(axis=1)
        tables.append(table.ravel())
    boxes = [np.zeros((0, 2, 3), np.int32)]
    for part_axis, k, _, _, _, rectangles in found:
        flat = np.full((len(rectangles), 2, 3), k, np.int32)
        flat[:, :, OTHER_AXES[part_axis]] = rectangles
        boxes.append(flat)
    joined = np.concatenate(boxes)
    empty = np.zeros(0, np.int32)
    return Regions(
        axis,
        plane,
        places,
        np.concatenate([empty, *(part[2] for part in found)]).astype(np.int32),
        np.concatenate([empty, *(part[3] for part in found)]).astype(np.int32),
        np.concatenate([empty, *tables]).astype(np.int32),
        joined,
        np.repeat(np.arange(len(found), dtype=np.int32), [len(part[5]) for part in found]),
    )


class _Sections:
    """Sections of closed elements, each computed once where the element is a prism along the axis."""

    def __init__(
        self, occluders: list[np.ndarray], details: list[np.ndarray], least: float, least_round: float
    ) -> None:
        self._triangles = occluders + [
            triangles
            for triangles in details
            if _is_box(triangles) and np.sort(np.ptp(triangles, axis=(0, 1)).astype(float))[1:].prod() >= least
        ]
        self._boxes = np.array([[t.min(axis=(0, 1)), t.max(axis=(0, 1))] for t in self._triangles], np.int64)
        self._boxes = self._boxes.reshape(-1, 2, 3)
        self._solid_box = np.array([_is_box(t) for t in self._triangles], bool)
        self._least = least
        size = (self._boxes[:, 1] - self._boxes[:, 0]).astype(float)
        faces = np.stack([size[:, OTHER_AXES[axis]].prod(axis=1) for axis in range(3)], axis=1)
        straight = np.array([((_normals(t) != 0).sum(axis=1) == 1).all() for t in self._triangles], bool)
        self._large = (faces >= least_round) | straight[:, None]
        # What stands at an angle is cut along its own faces (data/curtains.py); along the axes it gives staircases.
        oblique = np.array([_stands_oblique(t) for t in self._triangles], bool)
        self._large[oblique, :2] = False
        self._large[:, 2] &= ~oblique | (size[:, 2] < size[:, :2].min(axis=1))
        self._middle = self._boxes.sum(axis=1) // 2
        self._heights: dict[tuple[int, int], np.ndarray] = {}
        self._cut: dict[tuple[int, int, int], tuple[np.ndarray, bool]] = {}
        self._known: dict[tuple[int, int, int], np.ndarray] = {}

    def middles(self, axis: int, thin: int) -> np.ndarray:
        """Planes through the middle of thin elements and of those that are no boxes."""
        size = (self._boxes[:, 1] - self._boxes[:, 0]).astype(float)
        wanted = (size[:, OTHER_AXES[axis]].prod(axis=1) >= self._least) & (size[:, axis] > 1)
        wanted &= np.where(self._solid_box, size[:, axis] <= thin, self._large[:, axis])
        return np.unique(self._middle[wanted, axis])

    def rectangles(self, axis: int, k: int) -> np.ndarray:
        """Rectangles inside the sections just below and just above a plane, shape (n, 2, 2), int64."""
        uv = OTHER_AXES[axis]
        near = (self._boxes[:, 0, axis] <= k) & (self._boxes[:, 1, axis] >= k)
        simple = near & self._solid_box
        found = [self._boxes[simple][:, :, uv]]
        for element in np.flatnonzero(near & ~self._solid_box & self._large[:, axis]):
            low, high = self._boxes[element, :, axis]
            if low < k:
                found.append(self._section(int(element), axis, k, below=True))
            if k < high:
                found.append(self._section(int(element), axis, k, below=False))
        return np.concatenate(found)

    def _section(self, element: int, axis: int, k: int, *, below: bool) -> np.ndarray:
        """Section just below or just above plane k."""
        heights = self._vertex_heights(element, axis)
        # What is cut, and whether it is a prism there, changes only where the element has a vertex.
        upper = int(heights[np.searchsorted(heights, k, "left" if below else "right")])
        key = (element, axis, upper)
        if key in self._known:
            return self._known[key]
        if key not in self._cut:
            triangles = self._triangles[element]
            above = triangles[:, :, axis] >= upper
            cut = triangles[above.any(axis=1) & ~above.all(axis=1)]
            if len(cut) > SECTION_TRIANGLES:
                self._known[key] = np.zeros((0, 2, 2), np.int64)
                return self._known[key]
            self._cut[key] = cut, bool((_normals(cut)[:, axis] == 0).all())
        cut, prism = self._cut[key]
        if not (prism or k == self._middle[element, axis]):
            return np.zeros((0, 2, 2), np.int64)
        found = section_rectangles(cut, axis, k, below=below)
        # Between two heights of vertices a prism has one section: walls are cut by hundreds of planes.
        if prism:
            self._known[key] = found
        return found

    def _vertex_heights(self, element: int, axis: int) -> np.ndarray:
        """Coordinates of an element's vertices along an axis, ascending."""
        if (element, axis) not in self._heights:
            self._heights[element, axis] = np.unique(self._triangles[element][:, :, axis])
        return self._heights[element, axis]


def _stands_oblique(triangles: np.ndarray) -> bool:
    """Whether most upright faces of an element are on neither plan axis."""
    normals = _normals(triangles).astype(float)
    size = np.linalg.norm(normals, axis=1)
    upright = np.abs(normals[:, 2]) <= UPRIGHT * size
    oblique = upright & (np.abs(normals[:, :2]).min(axis=1) > UPRIGHT * size)
    return bool(size[oblique].sum() > 0.5 * size[upright].sum())


def _is_box(triangles: np.ndarray) -> bool:
    """Whether a closed element is its own bounding box."""
    if len(triangles) != 12:
        return False
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    corners = np.unique(triangles.reshape(-1, 3), axis=0)
    if len(corners) != 8 or not ((corners == low) | (corners == high)).all():
        return False
    faces = np.ptp(triangles, axis=1) == 0
    return bool((faces.sum(axis=1) == 1).all() and (faces.sum(axis=0) == 4).all())


def _normals(triangles: np.ndarray) -> np.ndarray:
    a, b = (triangles[:, i].astype(np.int64) - triangles[:, 0] for i in (1, 2))
    return np.cross(a, b)


def section_rectangles(cut: np.ndarray, axis: int, k: int, *, below: bool) -> np.ndarray:
    """Rectangles inside the section of a closed surface just below or just above a plane.

    Args:
        cut: its triangles that reach over the plane [grid steps], shape (m, 3, 3), int32.
        axis: perpendicular to the plane.
        k: coordinate of the plane.
        below: which of the two sections.

    Returns:
        Shape (n, 2, 2), int64, disjoint, wholly inside the part of the plane with winding number not 0: crossings are
        rounded to the grid, and what comes within two steps of a rounded outline is left out.
    """
    heights = cut[:, :, axis].astype(np.int64)
    above = heights >= k if below else heights > k
    # The lone corner is the one on its own side; the two edges at it are cut.
    lone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
    rows = np.arange(len(cut))
    flat = cut[:, :, OTHER_AXES[axis]].astype(np.int64)
    ends, exact = [], []
    for step in (1, 2):
        other = (lone + step) % 3
        h0, h1 = heights[rows, lone], heights[rows, other]
        share = ((k - h0) / (h1 - h0))[:, None]
        # Both triangles of an edge must round to the same point: always from its upper end.
        p0, p1 = flat[rows, lone], flat[rows, other]
        share = np.where((h0 > h1)[:, None], share, 1 - share)
        top, bottom = np.where((h0 > h1)[:, None], p0, p1), np.where((h0 > h1)[:, None], p1, p0)
        ends.append(np.round(top + share * (bottom - top)).astype(np.int64))
        exact.append((top == bottom) | (share == 0) | (share == 1))
    forward = above[rows, lone]
    edges = np.stack(
        [np.where(forward[:, None], ends[0], ends[1]), np.where(forward[:, None], ends[1], ends[0])], axis=1
    )
    # An axial edge may be rounded along itself, but not across.
    both = exact[0] & exact[1]
    straight = (edges[:, 0] == edges[:, 1]) & both
    rounded = ~(straight.any(axis=1) | both.all(axis=1))
    kept = (edges[:, 0] != edges[:, 1]).any(axis=1)
    if not kept.any():
        return np.zeros((0, 2, 2), np.int64)
    steps = LEVEL_STEPS if axis == 2 else SECTION_STEPS
    rectangles, _, _ = edge_rectangles(edges[kept], steps, rounded=rounded[kept], anywhere=True)
    return rectangles.astype(np.int64)
