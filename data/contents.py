"""Which cells hold a point, and which boxes reach into which cells: both closed, so that nothing falls between two."""

import numpy as np

from .graph import CellGraph
from .ragged import starts_of

# Pairs of a cell and a box, or a point, that are looked at together.
PAIRS = 4_000_000


def contents(cells: np.ndarray, boxes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Boxes that touch each cell; a wall between two cells belongs to both.

    Args:
        cells: shape (n, 2, 3), int; one with low above high touches nothing.
        boxes: low and high corners, shape (m, 2, 3), int; low above high for one that is nowhere.

    Returns:
        starts, shape (n + 1,), int64, and boxes: those of cell c are at starts[c]:starts[c + 1], ascending, int32.
    """
    some = np.flatnonzero((boxes[:, 0] <= boxes[:, 1]).all(axis=1))
    low, high = boxes[some, 0], boxes[some, 1]
    step = max(1, PAIRS // max(1, len(some)))
    sizes, found = [np.zeros(0, np.int64)], [np.zeros(0, np.int32)]
    for first in range(0, len(cells), step):
        part = cells[first : first + step, :, None]
        met = np.ones((len(part), len(some)), bool)
        for axis in range(3):
            met &= (low[:, axis] <= part[:, 1, :, axis]) & (high[:, axis] >= part[:, 0, :, axis])
        sizes.append(met.sum(axis=1))
        found.append(some[np.nonzero(met)[1]].astype(np.int32))
    return starts_of(np.concatenate(sizes)), np.concatenate(found)


def cells_holding(graph: CellGraph, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cells from which to look for what is seen from points.

    With portals these are the cells that tile space. Without, and where none of them holds a point, they are the
    inhabitable ones, those with plans included, for only of these a bake knows anything.

    Args:
        graph: cells in grid steps.
        points: [grid steps], shape (n, 3), float64.

    Returns:
        starts, shape (n + 1,), int64, and cells: those of point p are at starts[p]:starts[p + 1], ascending, int32. A
        point on a face is held by the cells of both sides.
    """
    point, cell = _holding(graph.cells, points)
    tiles = (cell < graph.tile_count) if graph.portal_count else np.zeros(len(cell), bool)
    if tiles.all():
        return starts_of(np.bincount(point, minlength=len(points))), cell.astype(np.int32)
    inside = np.zeros(len(points), bool)
    inside[point[tiles]] = True
    others = np.flatnonzero(~tiles & ~inside[point] & graph.inhabitable[cell])
    if len(others):
        others = others[graph.plans.hold(cell[others], points[point[others]], graph.cell_count)]
    kept = np.sort(np.concatenate([np.flatnonzero(tiles), others]))
    return starts_of(np.bincount(point[kept], minlength=len(points))), cell[kept].astype(np.int32)


def _holding(boxes: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Point and box of each pair in which the closed box holds the point, by point, then box."""
    step = max(1, PAIRS // max(1, len(boxes)))
    rows, found = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for first in range(0, len(points), step):
        part = points[first : first + step, None]
        held = np.ones((len(part), len(boxes)), bool)
        for axis in range(3):
            held &= (boxes[:, 0, axis] <= part[..., axis]) & (part[..., axis] <= boxes[:, 1, axis])
        row, box = np.nonzero(held)
        rows.append(first + row)
        found.append(box)
    return np.concatenate(rows), np.concatenate(found)
