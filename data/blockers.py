"""Blockers: large flat rectangles that no sightline between live cells can cross.

On the plane x_i = k a sightline that stays in live cells can pass only through the open cross-section of a cell or
through a portal on the plane, and nowhere through an opaque rectangle. Everything else is blocked: opaque faces, the
inside of solids, dead cells. Merging all of it on one plane before cutting it into *maximal, overlapping* rectangles is
what makes single blockers strong: a wall's face has a gap where another wall joins it, the blocked region has none.
"""

from dataclasses import dataclass

import numpy as np

from .graph import OTHER_AXES, CellGraph
from .opaque import NO_PLANES, OpaquePlanes


@dataclass
class Blockers:
    """Rectangles that block.

    Attributes:
        boxes: flat boxes, or boxes of curtains [grid steps], shape (blockers, 2, 3), int32.
        axis: the axis each is perpendicular to, or the kind of curtain (data/curtains.py), shape (blockers,), int32.
    """

    boxes: np.ndarray
    axis: np.ndarray


def join_blockers(parts: list[Blockers]) -> Blockers:
    """All of some blockers, in order."""
    boxes = np.concatenate([part.boxes for part in parts])
    return Blockers(boxes, np.concatenate([part.axis for part in parts]))


def find_blockers(graph: CellGraph, opaque: OpaquePlanes | None = None) -> Blockers:
    """Blockers of every plane that holds a cell face or an opaque rectangle; each opaque piece lies in one or more.

    Args:
        graph: cells and portals.
        opaque: opaque rectangles, on cell faces or not; None for a bare graph, whose faces say it all.
    """
    opaque = opaque or NO_PLANES
    pieces, axes = [], []
    index = opaque.index
    for axis in range(3):
        planes = np.unique(np.concatenate([graph.cells[:, :, axis].ravel(), opaque.boxes[axis][:, 0, axis]]))
        low = np.argsort(graph.cells[:, 0, axis], kind="stable")
        starts = graph.cells[low, 0, axis]
        for k in planes:
            # Cells are few on a plane; the sorted lows cut the candidates to those that begin at or before it.
            near = low[: np.searchsorted(starts, k, side="right")]
            near = near[graph.cells[near, 1, axis] >= k]
            rectangles = _plane_blockers(graph, axis, int(k), near, index.rectangles(axis, int(k)))
            if len(rectangles):
                u, v = OTHER_AXES[axis]
                boxes = np.full((len(rectangles), 2, 3), k, np.int32)
                boxes[:, :, u], boxes[:, :, v] = rectangles[:, :, 0], rectangles[:, :, 1]
                pieces.append(boxes)
                axes.append(np.full(len(boxes), axis, np.int32))
    boxes = np.concatenate(pieces) if pieces else np.zeros((0, 2, 3), np.int32)
    axis_of = np.concatenate(axes) if axes else np.zeros(0, np.int32)
    return Blockers(boxes, axis_of)


def _plane_blockers(graph: CellGraph, axis: int, k: int, near: np.ndarray, opaque: np.ndarray) -> np.ndarray:
    """Maximal blocked rectangles of one plane that hold something opaque in reach of live cells; (n, 2, 2), int32."""
    uv = OTHER_AXES[axis]
    cells = graph.cells[near]
    faces = cells[(cells[:, 0, axis] == k) | (cells[:, 1, axis] == k)][:, :, uv]
    through = cells[(cells[:, 0, axis] < k) & (cells[:, 1, axis] > k)][:, :, uv]
    on_plane = (graph.portal_axis == axis) & (graph.portals[:, 0, axis] == k)
    gaps = np.concatenate([through, graph.portals[on_plane][:, :, uv]])
    everything = np.concatenate([faces, gaps])
    if not len(everything):
        return np.zeros((0, 2, 2), np.int32)
    # What lies beyond the live cells is blocked anyway, and clipping keeps the raster inside them.
    opaque = np.clip(opaque, everything.min(axis=(0, 1)), everything.max(axis=(0, 1)))
    opaque = opaque[(opaque[:, 1] > opaque[:, 0]).all(axis=1)]
    everything = np.concatenate([everything, opaque])
    us, vs = np.unique(everything[:, :, 0]), np.unique(everything[:, :, 1])
    solid, open_ = paint(opaque, us, vs), paint(gaps, us, vs)
    blocked = solid | ~open_
    # A wall inside a solid hides nothing that the solid's faces do not.
    wanted = (paint(faces, us, vs) & blocked) | (solid & open_)
    return maximal_rectangles(blocked, wanted, us, vs)


def paint(rectangles: np.ndarray, us: np.ndarray, vs: np.ndarray) -> np.ndarray:
    """Raster cells covered by any of the rectangles (n, 2, 2), whose corners are all in us and vs; bool."""
    heights = np.zeros((len(us), len(vs)), np.int32)
    u = np.searchsorted(us, rectangles[:, :, 0])
    v = np.searchsorted(vs, rectangles[:, :, 1])
    for i, j, sign in ((0, 0, 1), (0, 1, -1), (1, 0, -1), (1, 1, 1)):
        np.add.at(heights, (u[:, i], v[:, j]), sign)
    return heights.cumsum(axis=0).cumsum(axis=1)[:-1, :-1] > 0


def maximal_rectangles(blocked: np.ndarray, wanted: np.ndarray, us: np.ndarray, vs: np.ndarray) -> np.ndarray:
    """Rectangles inside `blocked` that cannot grow and together cover `wanted`; shape (n, 2, 2), int32."""
    found: set[tuple[int, int, int, int]] = set()
    left = wanted.copy()
    while left.any():
        i, j = divmod(int(left.argmax()), left.shape[1])
        for first in (0, 1):
            u0, u1, v0, v1 = grow(blocked, i, j, first)
            left[u0:u1, v0:v1] = False
            found.add((u0, u1, v0, v1))
    if not found:
        return np.zeros((0, 2, 2), np.int32)
    u0, u1, v0, v1 = np.array(sorted(found)).T
    return np.stack([np.stack([us[u0], vs[v0]], axis=1), np.stack([us[u1], vs[v1]], axis=1)], axis=1).astype(np.int32)


def grow(blocked: np.ndarray, i: int, j: int, first: int) -> tuple[int, int, int, int]:
    """Grow raster cell (i, j) inside `blocked`, along axis `first` before the other: u0, u1, v0, v1 (past the end)."""
    if first == 1:
        v0, v1, u0, u1 = grow(blocked.T, j, i, 0)
        return u0, u1, v0, v1
    u0, u1 = _run(blocked[:, j], i)
    v0, v1 = _run(blocked[u0:u1].all(axis=0), j)
    return u0, u1, v0, v1


def _run(row: np.ndarray, i: int) -> tuple[int, int]:
    """The run of true values around i: first and past-the-last index."""
    ahead, behind = row[i:], row[i::-1]
    last, first = int(ahead.argmin()), int(behind.argmin())
    # The least of all true values is the first of them.
    return (0 if behind[first] else i - first + 1), (len(row) if ahead[last] else i + last)
