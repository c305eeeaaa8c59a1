"""Blockers: large flat rectangles that no sightline between live cells can cross.

On the plane x_i = k a sightline that stays in live cells can pass only through the open cross-section of a cell or
through a portal on the plane, and nowhere through an opaque rectangle. Everything else is blocked: opaque faces, the
inside of solids, dead cells. Merging all of it on one plane before cutting it into *maximal, overlapping* rectangles is
what makes single blockers strong: a wall's face has a gap where another wall joins it, the blocked region has none.
"""

from dataclasses import dataclass

import numpy as np

from .graph import OTHER_AXES, CellGraph, flat_boxes
from .opaque import NO_PLANES, OpaquePlanes
from .rasters import Rasters


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


def strong_blockers(blockers: Blockers, least: float) -> Blockers:
    """Those of some axial rectangles that are nowhere narrower than so many grid steps."""
    wide = np.sort(blockers.boxes[:, 1] - blockers.boxes[:, 0], axis=1)[:, 1] >= least
    return Blockers(blockers.boxes[wide], blockers.axis[wide])


def find_blockers(graph: CellGraph, opaque: OpaquePlanes | None = None) -> Blockers:
    """Blockers of every plane that holds a cell face or an opaque rectangle; each opaque piece lies in one or more.

    Args:
        graph: cells and portals.
        opaque: opaque rectangles, on cell faces or not; None for a bare graph, whose faces say it all.
    """
    opaque = opaque or NO_PLANES
    index = opaque.index
    axes, planes, lots = [], [], []
    for axis in range(3):
        ks = np.unique(np.concatenate([graph.cells[:, :, axis].ravel(), opaque.boxes[axis][:, 0, axis]]))
        low = np.argsort(graph.cells[:, 0, axis], kind="stable")
        starts = graph.cells[low, 0, axis]
        for k in ks.tolist():
            # Cells are few on a plane; the sorted lows cut the candidates to those that begin at or before it.
            near = low[: np.searchsorted(starts, k, side="right")]
            near = near[graph.cells[near, 1, axis] >= k]
            lots.append(_on_plane(graph, axis, k, near, index.rectangles(axis, k)))
            axes.append(axis)
            planes.append(k)
    axes, planes = np.array(axes, np.int32), np.array(planes, np.int32)
    plane, rectangles = _largest(lots)
    return Blockers(flat_boxes(rectangles, axes[plane], planes[plane]), axes[plane])


def _on_plane(
    graph: CellGraph, axis: int, k: int, near: np.ndarray, opaque: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rectangles of a plane, each (n, 2, 2): opaque ones in reach of live cells, gaps, and faces of cells."""
    uv = OTHER_AXES[axis]
    cells = graph.cells[near]
    faces = cells[(cells[:, 0, axis] == k) | (cells[:, 1, axis] == k)][:, :, uv]
    through = cells[(cells[:, 0, axis] < k) & (cells[:, 1, axis] > k)][:, :, uv]
    on_plane = (graph.portal_axis == axis) & (graph.portals[:, 0, axis] == k)
    gaps = np.concatenate([through, graph.portals[on_plane][:, :, uv]])
    everything = np.concatenate([faces, gaps])
    if not len(everything):
        return everything, everything, everything
    # What lies beyond the live cells is blocked anyway, and clipping keeps the raster inside them.
    opaque = np.clip(opaque, everything.min(axis=(0, 1)), everything.max(axis=(0, 1)))
    return opaque[(opaque[:, 1] > opaque[:, 0]).all(axis=1)], gaps, faces


def _largest(lots: list[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Maximal blocked rectangles of each plane that hold something opaque in reach of live cells.

    Args:
        lots: of each plane, as from `_on_plane`.

    Returns:
        Plane of each, ascending, and corners, shape (n, 2, 2), int32.
    """
    kinds = []
    for kind in range(3):
        owner = np.repeat(np.arange(len(lots)), [len(lot[kind]) for lot in lots])
        kinds.append((owner, np.concatenate([np.zeros((0, 2, 2), np.int64), *(lot[kind] for lot in lots)])))
    points = [[(np.repeat(owner, 2), part[:, :, c].ravel()) for owner, part in kinds] for c in (0, 1)]
    owners, found = [np.zeros(0, np.int64)], [np.zeros((0, 2, 2), np.int32)]
    for first, rasters in Rasters.of(points, len(lots)).lots():
        painted = []
        for owner, part in kinds:
            a, b = np.searchsorted(owner, [first, first + len(rasters)])
            painted.append(rasters.paint(owner[a:b] - first, part[a:b]))
        solid, open_, faces = painted
        blocked = (rasters.area > 0) & (solid | ~open_)
        # A wall inside a solid hides nothing that the solid's faces do not.
        owner, rectangles = rasters.maximal(blocked, (faces & blocked) | (solid & open_))
        owners.append(owner + first)
        found.append(rectangles)
    return np.concatenate(owners), np.concatenate(found)
