"""View cells over walkways: wherever somebody who walks may have their eyes, no eye far from a cell's middle.

Floors are what is nearly level, has room for a person above it, and hangs together by steps: so stairs and ramps belong
to the floors that they join, while tops of tables, which nobody steps on, are too small to be floors of their own.

Source: Aliaga et al. 1999, section 6 (virtual cells, placed by hand so that no eye on a walkway is farther than a metre
from the middle of one).
"""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from .errors import InputError
from .patience import ask
from .prepared import PreparedModel
from .ragged import lots, owners_of, places_of, starts_of
from .scene import OPAQUE

# Eyes are so far above the floor, and a person needs so much room over it.
EYE_M, HEADROOM_M = 1.6, 1.9
# A step is at most so high; floors are looked at in columns so wide, and are at least so large.
STEP_M, COLUMN_M, FLOOR_M2 = 0.4, 0.2, 5.0
# What is steeper nobody walks on.
STEEPEST = np.cos(np.radians(45))
# Surfaces closer than this over each other are one.
SAME_M = 0.02
# No corner of a cell is farther from its middle, as published.
REACH_M = 1.0
# Length, width and height of a cell, as parts of that; half its diagonal is 0.97 of it.
CELL = np.array([1.3, 1.3, 0.6])
# Columns that triangles are looked at in, together.
LOT = 2**21
CELLS_MOST = 1_000_000


def walkway_cells(model: PreparedModel, reach_m: float = REACH_M) -> np.ndarray:
    """Boxes that hold the eyes of all who walk on floors [grid steps], shape (n, 2, 3), int32.

    Args:
        model: it is walked in.
        reach_m: no corner of a cell is farther from its middle [m], > 0.

    Returns:
        Cells of one size, by their middles from below; they may overlap in height where floors are close to each other,
        as on stairs. Where the model names rooms, those that lie at least partly in one.

    Raises:
        InputError: there is no floor, or there are more than CELLS_MOST cells.
    """
    scene = model.scene
    columns, heights = _floors(model)
    size = np.maximum(2, np.round(CELL * reach_m / scene.grid_m)).astype(np.int64)
    column = _column(model)
    places = (2 * columns + 1) * column // (2 * size[:2])
    eyes = np.round(heights + EYE_M / scene.grid_m).astype(np.int64)
    stacks = _stacks(places, eyes, int(size[2]))
    low = stacks * np.append(size[:2], 1)
    cells = np.stack([low, low + size], axis=1)
    spaces = [np.array([s.vertices.min(axis=0), s.vertices.max(axis=0)]) / scene.grid_m for s in scene.spaces]
    if spaces:
        held = np.zeros(len(cells), bool)
        for space in spaces:
            held |= (cells[:, 0] < space[1]).all(axis=1) & (cells[:, 1] > space[0]).all(axis=1)
        cells = cells[held]
    if not len(cells):
        raise InputError(
            f"walkways: expected a floor of at least {FLOOR_M2:g} m2 with {HEADROOM_M:g} m above it, found none"
        )
    if len(cells) > CELLS_MOST:
        raise InputError(f"walkways: expected at most {CELLS_MOST:,} cells, found {len(cells):,}")
    return cells.astype(np.int32)


def _column(model: PreparedModel) -> int:
    """Width of a column [grid steps]."""
    return max(1, round(COLUMN_M / model.scene.grid_m))


def _floors(model: PreparedModel) -> tuple[np.ndarray, np.ndarray]:
    """Columns (n, 2), int64, and heights [grid steps] of points of floors that are large enough."""
    grid_m, column = model.scene.grid_m, _column(model)
    columns, heights, walked = _surfaces(model, column)
    # The next one over it is no lower than a person is tall.
    above = np.full(len(heights), np.inf)
    same = (columns[1:] == columns[:-1]).all(axis=1)
    above[:-1][same] = np.diff(heights)[same]
    free = walked & (above >= HEADROOM_M / grid_m)
    columns, heights = columns[free], heights[free]
    label = _joined(columns, heights, STEP_M / grid_m)
    large = np.bincount(label) * (column * grid_m) ** 2 >= FLOOR_M2
    return columns[large[label]], heights[large[label]]


def _surfaces(model: PreparedModel, column: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Columns and heights of what is not upright, by columns and from below, and whether it may be walked on."""
    triangles, owners = model.scene.triangles(*OPAQUE)
    a, b = (np.diff(triangles.take((0, k), axis=1), axis=1)[:, 0].astype(np.float64) for k in (1, 2))
    normal = np.cross(a, b)
    # Twice what an element's faces enclose, by its own first corner: below 0 where they look inwards.
    base = triangles[np.searchsorted(owners, np.arange(len(model.scene.objects))).clip(max=len(owners) - 1), 0]
    volumes = ((triangles[:, 0] - base[owners]) * normal).sum(axis=1)
    outwards = np.zeros(len(model.scene.objects))
    closed = np.array([object_id for object_id, _ in model.closed], np.int64)
    outwards[closed] = np.sign(np.bincount(owners, volumes, len(outwards)))[closed]
    level = np.abs(normal[:, 2]) >= STEEPEST * np.linalg.norm(normal, axis=1)
    # The underside of a closed element is inside it; an open one may be turned either way.
    level &= outwards[owners] * normal[:, 2] >= 0
    flat = np.flatnonzero(normal[:, 2])
    ends = triangles[flat, :, :2].astype(np.int64)
    low = -(-(2 * ends.min(axis=1) - column) // (2 * column))
    extent = np.maximum((2 * ends.max(axis=1) - column) // (2 * column) - low + 1, 0)
    found = [(np.zeros((0, 2), np.int64), np.zeros(0, np.int64), np.zeros(0, bool))]
    for first, stop in lots(extent.prod(axis=1), LOT):
        ask()
        sizes = extent[first:stop].prod(axis=1)
        place, at = np.repeat(np.arange(first, stop), sizes), places_of(0, sizes)
        across = low.take(place, axis=0) + np.stack(np.divmod(at, extent[place, 1]), axis=1)
        own = flat[place]
        begin, to, other, up = (some.take(own, axis=0) for some in (triangles[:, 0], a, b, normal[:, 2]))
        spot = (across + 0.5) * column - begin[:, :2]
        u = (spot[:, 0] * other[:, 1] - spot[:, 1] * other[:, 0]) / up
        v = (to[:, 0] * spot[:, 1] - to[:, 1] * spot[:, 0]) / up
        held = (u >= 0) & (v >= 0) & (u + v <= 1)
        height = begin[held, 2] + u[held] * to[held, 2] + v[held] * other[held, 2]
        found.append((across[held], np.round(height).astype(np.int64), level[own[held]]))
    columns, heights, walked = (np.concatenate(part) for part in zip(*found, strict=True))
    return _once(columns, heights, walked, SAME_M / model.scene.grid_m)


def _once(
    columns: np.ndarray, heights: np.ndarray, walked: np.ndarray, same: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Surfaces of a column that are as good as one, once: the highest, walked on if any of them is."""
    # One number sorts faster than three.
    base = columns.min(axis=0, initial=0), heights.min(initial=0)
    wide, high = int(columns[:, 1].max(initial=0) - base[0][1]) + 1, int(heights.max(initial=0) - base[1]) + 1
    keys = ((columns[:, 0] - base[0][0]) * wide + columns[:, 1] - base[0][1]) * high + heights - base[1]
    order = np.argsort(keys, kind="stable")
    keys, columns, heights, walked = keys[order], columns.take(order, axis=0), heights[order], walked[order]
    last = np.ones(len(heights), bool)
    last[:-1] = (np.diff(keys // high) > 0) | (np.diff(heights) > same)
    begins = np.flatnonzero(np.append(True, last[:-1])[: len(last)])
    any_walked = np.logical_or.reduceat(walked, begins) if len(walked) else walked
    return columns[last], heights[last], any_walked


def _joined(columns: np.ndarray, heights: np.ndarray, step: float) -> np.ndarray:
    """Component of each point; those of columns beside each other hang together where a step leads over."""
    low = columns.min(axis=0, initial=0)
    width = int(columns[:, 1].max(initial=0) - low[1]) + 2
    keys = (columns[:, 0] - low[0]) * width + columns[:, 1] - low[1]
    used, starts = np.unique(keys, return_index=True)
    starts = np.append(starts, len(keys))
    ends = [np.zeros((2, 0), np.int64)]
    for beside in (1, width):
        place = np.searchsorted(used, used + beside)
        both = np.flatnonzero(used[np.minimum(place, len(used) - 1)] == used + beside)
        there = place[both]
        here_sizes, there_sizes = (starts[some + 1] - starts[some] for some in (both, there))
        pairs = owners_of(starts_of(here_sizes * there_sizes))
        at = places_of(0, here_sizes * there_sizes)
        a = starts[both[pairs]] + at // there_sizes[pairs]
        b = starts[there[pairs]] + at % there_sizes[pairs]
        near = np.abs(heights[a] - heights[b]) <= step
        ends.append(np.stack([a[near], b[near]]))
    a, b = np.concatenate(ends, axis=1)
    joins = coo_array((np.ones(len(a), bool), (a, b)), shape=(len(keys), len(keys)))
    return connected_components(joins, directed=False)[1]


def _stacks(places: np.ndarray, eyes: np.ndarray, height: int) -> np.ndarray:
    """Places, and low ends, of the fewest intervals that hold the eyes over each place, from below, shape (n, 3)."""
    rows, found = np.unique(np.column_stack([places, eyes]), axis=0), [np.zeros((0, 3), np.int64)]
    while len(rows):
        fresh = np.append(True, (rows[1:, :2] != rows[:-1, :2]).any(axis=1))
        begins = np.flatnonzero(fresh)
        lowest = rows[begins, 2]
        held = rows[:, 2] <= lowest[np.cumsum(fresh) - 1] + height
        highest = np.maximum.reduceat(np.where(held, rows[:, 2], rows[:, 2].min()), begins)
        found.append(np.column_stack([rows[begins, :2], (lowest + highest - height) // 2]))
        rows = rows[~held]
    stacks = np.concatenate(found)
    return stacks[np.lexsort((stacks[:, 0], stacks[:, 1], stacks[:, 2]))]
