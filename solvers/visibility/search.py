"""Target searches in rounds, and the sightlines that they find."""

import numpy as np

from ...data.plans import NO_PLANS, Plans
from ...data.verdict import Verdict
from ...kernels.blockers import BlockerTree
from ...kernels.launch import Device
from ...kernels.target import TargetAnswers, launch_target_search

# Lines tried per pair, then again for what stayed undecided.
CAPS = (200, 20_000)


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
    sign = np.where((answers.octant[rows][:, None] >> np.arange(3)) & 1, -1.0, 1.0)

    def times(boxes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        ends = boxes.astype(float) * sign[:, None]
        ends = np.stack([ends.min(axis=1), ends.max(axis=1)], axis=1)
        low, high = w * ends[:, 0] - xi, w * ends[:, 1] - xi
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
