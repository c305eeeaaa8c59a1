"""Opaque axial rectangles of a model, exactly, on the integer grid.

Per plane, all axial triangles are turned to one orientation, so the winding number of a point is the number of
triangles that cover it, whatever overlaps, doubles or T-junctions there are. Shared edges cancel; the rest is rastered
on its own compressed coordinates. A raster cell that an oblique outline crosses is dropped: the result is a subset of
the true surface, so nothing is ever called blocked that is not. What cuts cells may leave out more (`carve_area`): the
axial boxes around small oblique parts of upright outlines, such as arches, whose openings then are rectangles.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from .graph import OTHER_AXES

# An oblique outline is followed by a staircase: at most this many steps per edge, none shorter than OBLIQUE_STEP grid
# steps.
OBLIQUE_STEPS = 12
OBLIQUE_STEP = 64
# What comes within so many grid steps of an edge that was rounded to the grid is not called covered.
ROUNDED_REACH = 2
# The box around an oblique part that is carved out is no larger than so many times what it may lose.
CARVED_BOX = 4


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
    found = _Found()
    for axis, k, edges in _outlines(triangles):
        found.add(axis, k, edge_rectangles(edges, oblique_steps))
    return found.planes()


def carved_planes(triangles: np.ndarray, carve_area: float) -> tuple[OpaquePlanes, OpaquePlanes]:
    """As `opaque_planes`, and the same with oblique details of upright planes carved out; levels are never carved.

    Args:
        triangles: as of `opaque_planes`.
        carve_area: as of `edge_rectangles`.
    """
    plain, carved = _Found(), _Found()
    for axis, k, edges in _outlines(triangles):
        part = edge_rectangles(edges)
        plain.add(axis, k, part)
        if axis < 2 and (edges[:, 0] != edges[:, 1]).all(axis=1).any():
            part = edge_rectangles(edges, carve_area=carve_area)
        carved.add(axis, k, part)
    return plain.planes(), carved.planes()


def _outlines(triangles: np.ndarray) -> Iterator[tuple[int, int, np.ndarray]]:
    """Axis, coordinate and outline of every plane that holds axial triangles, ordered."""
    for axis in range(3):
        chosen = triangles[np.ptp(triangles[:, :, axis], axis=1) == 0]
        planes = np.unique(chosen[:, 0, axis])
        order = np.argsort(chosen[:, 0, axis], kind="stable")
        ends = np.searchsorted(chosen[order, 0, axis], planes, side="right")
        for k, begin, end in zip(planes.tolist(), np.append(0, ends)[:-1], ends, strict=True):
            yield axis, k, _outline(chosen[order[begin:end]][:, :, OTHER_AXES[axis]].astype(np.int64))


class _Found:
    """Rectangles of planes, on the way."""

    def __init__(self) -> None:
        self._boxes = [[np.zeros((0, 2, 3), np.int32)] for _ in range(3)]
        self._kept, self._lost = 0.0, 0.0

    def add(self, axis: int, k: int, part: tuple[np.ndarray, float, float]) -> None:
        """Take what `edge_rectangles` has found on a plane."""
        rectangles, kept, lost = part
        boxes = np.full((len(rectangles), 2, 3), k, np.int32)
        boxes[:, :, OTHER_AXES[axis]] = rectangles
        self._boxes[axis].append(boxes)
        self._kept, self._lost = self._kept + kept, self._lost + lost

    def planes(self) -> OpaquePlanes:
        """All of them."""
        return OpaquePlanes([np.concatenate(parts) for parts in self._boxes], self._kept + self._lost, self._lost)


def plane_rectangles(
    triangles: np.ndarray, oblique_steps: int = OBLIQUE_STEPS, carve_area: float = 0.0
) -> tuple[np.ndarray, float, float]:
    """Disjoint rectangles inside the union of triangles of one plane.

    Args:
        triangles: corners (u, v) [grid steps], shape (m, 3, 2), int32, any orientation.
        oblique_steps: as in `opaque_planes`.
        carve_area: as in `edge_rectangles`.

    Returns:
        Rectangles, shape (n, 2, 2), int32 (low, high corner); their area; the area dropped along oblique outlines.
    """
    return edge_rectangles(_outline(triangles.astype(np.int64)), oblique_steps, carve_area=carve_area)


def edge_rectangles(
    edges: np.ndarray,
    oblique_steps: int = OBLIQUE_STEPS,
    *,
    rounded: np.ndarray | None = None,
    anywhere: bool = False,
    carve_area: float = 0.0,
) -> tuple[np.ndarray, float, float]:
    """Disjoint rectangles inside closed outlines.

    Args:
        edges: directed edges (from, to) x (u, v) [grid steps], shape (m, 2, 2), int64; as many leave a point as reach
            it.
        oblique_steps: as in `opaque_planes`.
        rounded: edges that may be off by half a step; what comes within ROUNDED_REACH of them is left out. By default
            none; shape (m,), bool.
        anywhere: inside is where the winding number is not 0; otherwise where it is positive.
        carve_area: oblique parts of the outlines are left out with the boxes around them where that loses no more than
            this area [squared grid steps] in each; 0 for none.

    Returns:
        As `plane_rectangles`.
    """
    oblique = (edges[:, 0] != edges[:, 1]).all(axis=1)
    doubtful = edges[rounded] if rounded is not None else edges[:0]
    us, vs = (
        np.unique(np.concatenate([_breaks(edges, oblique, c, oblique_steps), *_beside(doubtful[:, :, c].ravel())]))
        for c in (0, 1)
    )
    winding = np.zeros((len(us), len(vs)), np.int64)
    steep = edges[~oblique & (edges[:, 0, 0] == edges[:, 1, 0])]
    columns = np.searchsorted(us, steep[:, 0, 0])
    # A point right of an edge that rises has it on its right-hand side: outlines are counter-clockwise, so -1.
    np.add.at(winding, (columns, np.searchsorted(vs, steep[:, 0, 1])), -1)
    np.add.at(winding, (columns, np.searchsorted(vs, steep[:, 1, 1])), 1)
    winding = winding.cumsum(axis=1)
    crossed = np.zeros((len(us) - 1, len(vs) - 1), bool)
    for a, b in edges[oblique]:
        _add_oblique(a, b, us, vs, winding, crossed)
    for a, b in doubtful:
        _mark_near(a, b, us, vs, crossed)
    winding = winding.cumsum(axis=0)[:-1, :-1]
    covered = winding != 0 if anywhere else winding > 0
    size = np.outer(np.diff(us), np.diff(vs)).astype(float)
    if carve_area and oblique.any():
        for window in _carved(edges[oblique], us, vs, carve_area):
            # Where nothing is open, as on the floor under a pillar, there is no opening to make a rectangle of.
            if (size * covered)[window].sum() <= carve_area and (~covered & ~crossed)[window].any():
                crossed[window] = True
    kept = covered & ~crossed
    lost = float(size[crossed & covered].sum())
    return decompose(kept, us, vs), float(size[kept].sum()), lost


def _outline(triangles: np.ndarray) -> np.ndarray:
    """Directed edges (m, 2, 2) left after opposite ones cancelled; every triangle turned counter-clockwise."""
    # Doubles go first: beside a partner that is single, a doubled triangle would leave their oblique edge standing.
    order = np.lexsort((triangles[:, :, 1], triangles[:, :, 0]), axis=1)
    triangles = np.unique(np.take_along_axis(triangles, order[:, :, None], axis=1), axis=0)
    a, b = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    clockwise = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] < 0
    triangles = np.where(clockwise[:, None, None], triangles[:, ::-1], triangles)
    edges = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 4)
    turned = edges[:, [2, 3, 0, 1]]
    upward = (edges[:, :2] < turned[:, :2])[:, 0] | ((edges[:, 0] == turned[:, 0]) & (edges[:, 1] < turned[:, 1]))
    keys, where = np.unique(np.where(upward[:, None], edges, turned), axis=0, return_inverse=True)
    count = np.zeros(len(keys), np.int64)
    np.add.at(count, where.ravel(), np.where(upward, 1, -1))
    forward = np.repeat(keys, np.maximum(count, 0), axis=0)
    backward = np.repeat(keys[:, [2, 3, 0, 1]], np.maximum(-count, 0), axis=0)
    return np.concatenate([forward, backward]).reshape(-1, 2, 2)


def _breaks(edges: np.ndarray, oblique: np.ndarray, c: int, most: int) -> np.ndarray:
    """Raster coordinates: every end, and steps along oblique edges."""
    extra = []
    for a, b in edges[oblique][:, :, c]:
        steps = int(min(most, abs(b - a) // OBLIQUE_STEP))
        if steps > 1:
            extra.append(np.linspace(a, b, steps + 1)[1:-1].astype(np.int64))
    return np.unique(np.concatenate([edges[:, :, c].ravel(), *extra]))


def _beside(coordinates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Raster lines that keep what is lost beside a rounded edge thin: as far as `_mark_near` marks across it."""
    return coordinates - 2 * ROUNDED_REACH, coordinates + 2 * ROUNDED_REACH


def _carved(edges: np.ndarray, us: np.ndarray, vs: np.ndarray, carve_area: float) -> list[tuple[slice, slice]]:
    """Windows of the raster: the box around each connected run of oblique edges, if it is not too large.

    Source: Lei and Ouhyoung, "Carving", section 4.1: the carving volume is the box around the edges of a cluster.
    """
    points, ends = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
    low, high = ends.reshape(-1, 2).T
    count, run = connected_components(coo_matrix((np.ones(len(low)), (low, high)), (len(points),) * 2), directed=False)
    boxes = np.stack([np.full((count, 2), points.max()), np.full((count, 2), points.min())], axis=1)
    np.minimum.at(boxes[:, 0], run, points)
    np.maximum.at(boxes[:, 1], run, points)
    boxes = boxes[np.prod((boxes[:, 1] - boxes[:, 0]).astype(float), axis=1) <= CARVED_BOX * carve_area]
    u, v = np.searchsorted(us, boxes[:, :, 0]), np.searchsorted(vs, boxes[:, :, 1])
    return [(slice(*a), slice(*b)) for a, b in zip(u.tolist(), v.tolist(), strict=True)]


def _mark_near(a: np.ndarray, b: np.ndarray, us: np.ndarray, vs: np.ndarray, crossed: np.ndarray) -> None:
    """Mark the raster cells that come within ROUNDED_REACH of the edge ab."""
    if abs(int(b[0]) - int(a[0])) > abs(int(b[1]) - int(a[1])):
        _mark_near(a[::-1], b[::-1], vs, us, crossed.T)
        return
    low, high = (a, b) if a[1] <= b[1] else (b, a)
    slope = (high[0] - low[0]) / max(high[1] - low[1], 1)
    first = max(int(np.searchsorted(vs, low[1] - ROUNDED_REACH, side="right")) - 1, 0)
    last = min(int(np.searchsorted(vs, high[1] + ROUNDED_REACH)), len(vs) - 1)
    # The slope is at most 1: reaching further along v moves the edge no further along u.
    at = low[0] + (np.clip(vs[first : last + 1], low[1], high[1]) - low[1]) * slope
    starts = np.searchsorted(us, np.minimum(at[:-1], at[1:]) - 2 * ROUNDED_REACH, side="right") - 1
    stops = np.searchsorted(us, np.maximum(at[:-1], at[1:]) + 2 * ROUNDED_REACH)
    for row, start, stop in zip(range(first, last), np.maximum(starts, 0).tolist(), stops.tolist(), strict=True):
        crossed[start:stop, row] = True


def _add_oblique(
    a: np.ndarray,
    b: np.ndarray,
    us: np.ndarray,
    vs: np.ndarray,
    winding: np.ndarray,
    crossed: np.ndarray,
) -> None:
    """Count one oblique edge into the winding differences and mark the raster cells that it may cross."""
    sign = -1 if b[1] > a[1] else 1
    low, high = (a, b) if a[1] < b[1] else (b, a)
    rows = np.arange(np.searchsorted(vs, low[1]), np.searchsorted(vs, high[1]))
    slope = (high[0] - low[0]) / (high[1] - low[1])

    def at(v: np.ndarray) -> np.ndarray:
        return low[0] + (v - low[1]) * slope

    # Half a step of padding covers the float64 rounding of `at` many times over and only ever drops cells. Beyond its
    # own ends, where the next raster cell may be as wide as the wall, the edge never reaches.
    ends = np.sort(np.stack([at(vs[rows]), at(vs[rows + 1])]), axis=0) + np.array([[-0.5], [0.5]])
    ends = np.clip(ends, min(a[0], b[0]), max(a[0], b[0]))
    first = np.maximum(np.searchsorted(us, ends[0], side="right") - 1, 0)
    last = np.minimum(np.searchsorted(us, ends[1]), len(us) - 1)
    for row, start, stop in zip(rows, first, last, strict=True):
        crossed[start:stop, row] = True
        # Cells left of `stop` in this row are either crossed (dropped) or left of the edge.
        winding[min(stop, len(us) - 1), row] += sign


def decompose(mask: np.ndarray, us: np.ndarray, vs: np.ndarray) -> np.ndarray:
    """Disjoint rectangles that tile the true raster cells, merged along rows or along columns, whichever is fewer.

    Args:
        mask: shape (len(us) - 1, len(vs) - 1), bool.
        us: ascending coordinates of the raster.
        vs: likewise.

    Returns:
        Low and high corners, shape (n, 2, 2), int32.
    """
    if not mask.any():
        return np.zeros((0, 2, 2), np.int32)
    along, across = _strips(mask), _strips(mask.T)[:, [2, 3, 0, 1]]
    u0, u1, v0, v1 = (along if len(along) <= len(across) else across).T
    return np.stack([np.stack([us[u0], vs[v0]], axis=1), np.stack([us[u1], vs[v1]], axis=1)], axis=1).astype(np.int32)


def _strips(mask: np.ndarray) -> np.ndarray:
    """Runs along the second axis, equal runs of consecutive rows merged: rows (i0, i1, j0, j1), past-the-end."""
    padded = np.zeros((mask.shape[0], mask.shape[1] + 2), np.int8)
    padded[:, 1:-1] = mask
    change = np.diff(padded, axis=1)
    i, j0 = np.nonzero(change == 1)
    j1 = np.nonzero(change == -1)[1]
    order = np.lexsort((i, j1, j0))
    i, j0, j1 = i[order], j0[order], j1[order]
    new = np.ones(len(i), bool)
    new[1:] = (np.diff(i) != 1) | (np.diff(j0) != 0) | (np.diff(j1) != 0)
    starts = np.flatnonzero(new)
    ends = np.append(starts[1:], len(i)) - 1
    return np.column_stack([i[starts], i[ends] + 1, j0[starts], j1[starts]])
