"""Target searches in rounds, and the sightlines that they find."""

from collections.abc import Callable

import numpy as np

from ...data.plans import NO_PLANS, Plans
from ...data.ragged import places_of
from ...data.verdict import Verdict
from ...kernels.blockers import BlockerTree
from ...kernels.launch import Device
from ...kernels.target import TargetAnswers, launch_target_search

# Lines tried per pair, then again for what stayed undecided.
CAPS = (200, 20_000)
# An object with so many pieces that could not be hidden is not looked at further: they are enough to aim at.
OPEN_ENOUGH = 3


def search_rounds(tree: BlockerTree, boxes: np.ndarray, rows: np.ndarray, device: Device) -> TargetAnswers:
    """Target search with a small cap, then again with a larger one for the pairs that stayed undecided."""
    answers = launch_target_search(tree, boxes, rows, cap=CAPS[0], device=device)
    for cap in CAPS[1:]:
        again = np.flatnonzero(answers.verdict == Verdict.UNKNOWN)
        if len(again):
            better = launch_target_search(tree, boxes, rows[again], cap=cap, device=device)
            for name in TargetAnswers.__dataclass_fields__:
                column = getattr(answers, name).copy()
                column[again] = getattr(better, name)
                setattr(answers, name, column)
    return answers


def on_witness_grid(points: np.ndarray) -> np.ndarray:
    """Nearest points whose coordinates are multiples of 2**-10 grid steps, as ends of witnesses are."""
    return np.round(points * 1024.0) / 1024.0


def segments(
    answers: TargetAnswers, rows: np.ndarray, sources: np.ndarray, targets: np.ndarray, plans: Plans = NO_PLANS
) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the found lines: a quarter into the source and a quarter into the target box, on the witness grid.

    Args:
        answers: of a target search.
        rows: answers to take.
        sources: source box of each taken row [grid steps], shape (n, 2, 3).
        targets: likewise.
        plans: of sources that are prisms in their boxes.

    Returns:
        Origins and ends [grid steps], shape (n, 3), float64, multiples of 2**-10.
    """
    w, xi = answers.line[rows], answers.offset[rows]
    forward = (answers.octant[rows][:, None] >> np.arange(3)) & 1 == 0
    sign = np.where(forward, 1.0, -1.0)

    def times(boxes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # Mirrored where the octant is negative. Column by column: NumPy is many times slower along short axes.
        low, high = (np.where(forward, boxes[:, k], -boxes[:, 1 - k].astype(np.int64)) for k in (0, 1))
        low, high = w * low - xi, w * high - xi
        return np.maximum.reduce(low.T), np.minimum.reduce(high.T)

    def place(time: np.ndarray) -> np.ndarray:
        return on_witness_grid(sign * (time[:, None] + xi) / w)

    enter, leave = times(sources)
    # Inside the plan of a prism from the last of its sides that leads in to the first that leads out.
    corners, own = plans.corners.astype(float), plans.rows
    speed, at = sign[own] / w[own], (sign * xi / w)[own]
    for k in range(4 if len(own) else 0):
        along = corners[:, (k + 1) % 4] - corners[:, k]
        start = along[:, 0] * (at[:, 1] - corners[:, k, 1]) - along[:, 1] * (at[:, 0] - corners[:, k, 0])
        rate = along[:, 0] * speed[:, 1] - along[:, 1] * speed[:, 0]
        met = np.divide(-start, rate, out=np.zeros(len(own)), where=rate != 0)
        enter[own] = np.where(rate > 0, np.maximum(enter[own], met), enter[own])
        leave[own] = np.where(rate < 0, np.minimum(leave[own], met), leave[own])
    first, last = times(targets)
    return place(leave - 0.25 * (leave - enter)), place(first + 0.25 * (last - first))


def open_pieces(
    first: np.ndarray,
    last: np.ndarray,
    prove: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]],
    enough: int = OPEN_ENOUGH,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pieces of objects that cannot be hidden, looked at a few at a time until some of an object are known.

    Args:
        first: piece of each object to begin with, shape (n,), int.
        last: past its last one.
        prove: given objects and pieces, row by row, says which rows could not be hidden, and a line to each of those.
        enough: an object with so many pieces that could not be hidden is not looked at further.

    Returns:
        Object and piece of each that could not be hidden, and the ends of a line to it, shape (m, 2, 3). An object
        that is missing is hidden as a whole.
    """
    first, known, step = first.copy(), np.zeros(len(first), int), 1
    found = [(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2, 3)))]
    while len(active := np.flatnonzero((first < last) & (known < enough))):
        sizes = np.minimum(step, last[active] - first[active])
        at, piece = np.repeat(active, sizes), places_of(first[active], sizes)
        left, lines = prove(at, piece)
        found.append((at[left], piece[left], lines))
        np.add.at(known, at[left], 1)
        first[active] += sizes
        step *= 2
    return tuple(np.concatenate(column) for column in zip(*found, strict=True))
