"""Sightlines that serve more view cells than the one they were found from.

What is seen from a point is seen from every point of the sightline, and often from behind its start. So the witnesses
of an object are tried from each cell that their lines cross and that has none. Source of the idea, rays that serve
every view cell they cross: Bittner et al. 2009, "Adaptive global visibility sampling", section 4.
"""

import numpy as np

from ...data.ragged import places_of
from ...data.rows import Rows
from ...kernels.sightline import launch_confirm
from .aim import Sights
from .search import on_witness_grid

# Witnesses of an object that are tried, evenly spread over its cells, and pairs with one that are looked at together.
LINES, CHUNK = 64, 1 << 20
# Lines tried for a pair, those that begin nearest to its cell first, from a point so far along what the cell has of
# them, as shares from the end that is away from the object.
TRIES, SHARES = 6, (0.9, 0.5, 0.1)
# What was found serves once more.
ROUNDS = 2


def share_sightlines(sights: Sights, rows: Rows) -> None:
    """Show unknown pairs by witnesses of the same object from other view cells, in place.

    Args:
        sights: the model and the view cells.
        rows: cells and objects of all view cells.
    """
    for _ in range(ROUNDS):
        before = int(rows.seen.sum())
        pair, line, span = _crossings(sights.cells, rows)
        # The least that a line has to be prolonged by comes first.
        ahead = np.maximum(-span[:, 1], 0.0)
        order = np.lexsort((line, ahead, pair))
        pair, line, span = pair[order], line[order], span[order]
        rank = np.arange(len(pair)) - np.searchsorted(pair, pair)
        for number in range(TRIES):
            for share in SHARES:
                todo = np.flatnonzero((rank == number) & ~rows.seen[pair])
                _try(sights, rows, pair[todo], line[todo], span[todo], share)
        if int(rows.seen.sum()) == before:
            return


def _crossings(cells: np.ndarray, rows: Rows) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unknown pairs, and witnesses of their object whose lines cross their cell.

    Returns:
        Rows of both, shape (n,), and where the line enters and leaves the cell, as multiples of the witness from its
        start, below 1, shape (n, 2).
    """
    seen = np.flatnonzero(rows.seen)
    seen = seen[np.lexsort((rows.source[seen], rows.target[seen]))]
    objects, first, count = np.unique(rows.target[seen], return_index=True, return_counts=True)
    unknown = np.flatnonzero(~rows.seen)
    at = np.searchsorted(objects, rows.target[unknown]).clip(max=max(0, len(objects) - 1))
    known = objects[at] == rows.target[unknown] if len(objects) else np.zeros(len(unknown), bool)
    unknown, at = unknown[known], at[known]
    sizes = np.minimum(count[at], LINES)
    found = [(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2)))]
    ends = np.cumsum(sizes)
    begin = 0
    while begin < len(unknown):
        last = max(begin + 1, int(np.searchsorted(ends, ends[begin] - sizes[begin] + CHUNK, side="right")))
        part = slice(begin, last)
        pair = np.repeat(unknown[part], sizes[part])
        place = places_of(np.zeros(last - begin, int), sizes[part])
        # Evenly spread where an object has more.
        step = np.repeat(count[at[part]] / sizes[part], sizes[part])
        line = seen[np.repeat(first[at[part]], sizes[part]) + (place * step).astype(int)]
        span = _span(cells[rows.source[pair]], rows.origin[line], rows.end[line] - rows.origin[line])
        crossed = span[:, 0] < span[:, 1]
        found.append((pair[crossed], line[crossed], span[crossed]))
        begin = last
    return tuple(np.concatenate(column) for column in zip(*found, strict=True))


def _span(boxes: np.ndarray, origin: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Where lines origin + t way are inside boxes, before t = 1: from and to, shape (n, 2); nowhere if from >= to."""
    with np.errstate(divide="ignore", invalid="ignore"):
        times = (boxes - origin[:, None]) / way[:, None]
    low, high = np.nanmin(times, axis=1), np.nanmax(times, axis=1)
    # A line along a face of the box, or beside it: no number tells.
    flat = way == 0
    beside = (flat & ((origin <= boxes[:, 0]) | (origin >= boxes[:, 1]))).any(axis=1)
    low, high = np.where(flat, -np.inf, low), np.where(flat, np.inf, high)
    begin, end = low.max(axis=1), np.minimum(high.min(axis=1), 1.0)
    return np.column_stack([begin, np.where(beside, begin, end)])


def _try(sights: Sights, rows: Rows, pair: np.ndarray, line: np.ndarray, span: np.ndarray, share: float) -> None:
    """Show pairs by lines of others that begin in their own cell."""
    if not len(pair):
        return
    time = span[:, 0] + share * (span[:, 1] - span[:, 0])
    end = rows.end[line]
    origin = on_witness_grid(rows.origin[line] + time[:, None] * (end - rows.origin[line]))
    box = sights.cells[rows.source[pair]]
    inside = ((origin > box[:, 0]) & (origin < box[:, 1])).all(axis=1)
    pair, origin, end = pair[inside], origin[inside], end[inside]
    target = rows.target[pair]
    options = {"ranges": sights.ranges[target], "device": sights.device}
    good = np.flatnonzero(launch_confirm(sights.triangles, origin, end, target, **options))
    good = good[sights.outside(rows.source[pair[good]], origin[good])]
    rows.show(pair[good], origin[good], end[good])
