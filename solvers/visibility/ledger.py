"""Keeping the certificates of what is hidden, and going down a hierarchy past what is."""

import time
from collections.abc import Callable

import numpy as np

from ...data.plans import NO_PLANS, Plans
from ...data.ragged import starts_of
from ...data.store.certificates import NO_PROOFS, Proofs, join_proofs
from ...data.verdict import Verdict
from ...kernels.blockers import BlockerTree
from ...kernels.launch import Device
from ...kernels.line_tree import launch_line_trees
from ...kernels.shaft import ShaftAnswers
from ...kernels.target import TargetAnswers


class Ledger:
    """Collects certificates; whoever keeps a ledger calls hidden only what has one."""

    def __init__(self) -> None:
        self._proofs: list[Proofs] = []
        self._pairs: list[np.ndarray] = []
        self._seconds = 0.0

    def add_lines(
        self,
        tree: BlockerTree,
        boxes: np.ndarray,
        rows: np.ndarray,
        answers: TargetAnswers,
        device: Device,
        pair: np.ndarray | None = None,
        plans: Plans | None = None,
    ) -> None:
        """Enter the line trees of what a search hid; what has none becomes UNKNOWN in the answers.

        Args:
            tree: blockers, as of `launch_target_search`.
            boxes: likewise.
            rows: likewise; the source of a row is a view cell, and a strict row is about a closed box.
            answers: of the search.
            device: likewise.
            pair: what each row's target is a piece of, -1 if it is whole, shape (n,); all whole by default.
            plans: as of `launch_target_search`.
        """
        start = time.perf_counter()
        hidden = np.flatnonzero(answers.verdict == Verdict.HIDDEN)
        trees = launch_line_trees(tree, boxes, rows[hidden], answers.nodes[hidden], plans=plans, device=device)
        written = np.diff(trees.starts) > 0
        answers.verdict[hidden[~written]] = Verdict.UNKNOWN
        hidden, starts = hidden[written], np.append(trees.starts[:-1][written], trees.starts[-1])
        none = np.zeros(len(hidden) + 1, np.int64)
        cell, target = rows[hidden, 0].astype(np.int64), boxes[rows[hidden, 1]].astype(np.int32)
        plan = (plans or NO_PLANS).filled(len(boxes), rows[hidden, 1])
        proofs = Proofs(cell, target, rows[hidden, 2] != 0, starts, trees.words, none, NO_PROOFS.leaves, plan)
        self._enter(proofs, pair if pair is None else pair[hidden])
        self._seconds += time.perf_counter() - start

    def add_shafts(
        self, cell: np.ndarray, boxes: np.ndarray, answers: ShaftAnswers, pair: np.ndarray | None = None
    ) -> None:
        """Enter the leaves of what the shaft test hid from view cells; `pair` as of `add_lines`."""
        hidden = np.flatnonzero(answers.verdict == Verdict.HIDDEN)
        starts = starts_of(answers.leaves[hidden])
        none, closed = np.zeros(len(hidden) + 1, np.int64), np.ones(len(hidden), bool)
        proofs = Proofs(
            cell[hidden].astype(np.int64),
            boxes[hidden],
            closed,
            none,
            NO_PROOFS.words,
            starts,
            answers.certificate,
            NO_PLANS.filled(len(boxes), hidden),
        )
        self._enter(proofs, pair if pair is None else pair[hidden])

    def _enter(self, proofs: Proofs, pair: np.ndarray | None) -> None:
        self._proofs.append(proofs)
        self._pairs.append(np.full(len(proofs.cell), -1) if pair is None else pair)

    def close(self, hidden: np.ndarray) -> Proofs:
        """All proofs, but none about pieces of a pair that stays visible elsewhere.

        Args:
            hidden: whether each pair that `add_lines` or `add_shafts` was given pieces of is hidden, shape (n,), bool.
        """
        proofs = join_proofs(self._proofs)
        pair = np.concatenate([np.zeros(0, int), *self._pairs])
        kept = proofs.take((pair < 0) | np.append(hidden, False)[pair])
        kept.seconds = self._seconds
        return kept


def descend(
    cells: np.ndarray,
    block: np.ndarray,
    levels: list[np.ndarray],
    items: np.ndarray,
    first_level: int,
    hide: Callable[[np.ndarray, np.ndarray], np.ndarray],
    clear: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None,
    *,
    haste: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Go down a hierarchy of items from view cells, and give up below every node that is hidden.

    Args:
        cells: all view cells [grid steps], shape (n, 2, 3), int32.
        block: view cells to look from, shape (m,), int.
        levels: node bounds of a hierarchy over the items, as of `build_levels`.
        items: item of each node of the last level, -1 for none.
        first_level: to start at: the root is visible from everywhere.
        hide: says of cells and boxes, row by row, which boxes are hidden.
        clear: says of them which boxes the cells do not meet; by default as `apart`.
        haste: where a view cell has few nodes of a level hidden, go on to its items: so many proofs are not made for
            nothing, and where there is a proof there are more.

    Returns:
        View cell and item of every pair that is left, ordered, int64: neither the item's box nor one around it, of
        those that were asked about, is hidden.
    """
    clear = clear or (lambda source, boxes: apart(cells[source], boxes))
    last = len(levels) - 1
    level = min(first_level, last)
    patient = np.ones(len(cells), bool)
    source = np.repeat(block, 2**level)
    node = np.tile(np.arange(2**level), len(block))
    while True:
        boxes = levels[level][node]
        present = (boxes[:, 0] <= boxes[:, 1]).all(axis=1)
        source, node, boxes = source[present], node[present], boxes[present]
        left = np.ones(len(node), bool)
        rows = np.flatnonzero(patient[source] | (level == last))
        rows = rows[clear(source[rows], boxes[rows])]
        left[rows] = ~hide(source[rows], boxes[rows])
        if level == last:
            break
        level += 1
        if haste:
            asked, hidden = (np.bincount(source[some], minlength=len(cells)) for some in (rows, rows[~left[rows]]))
            # A proof about a node saves all that is below it, and takes the longer the more that is.
            below = last - level
            patient &= (asked == 0) | (hidden * 2.0**below > asked * (1 + below / 2))
        source, node = source[left], node[left]
        source, node = np.repeat(source, 2), (2 * node[:, None] + [0, 1]).ravel()
    source, node = source[left], node[left]
    target = items[node].astype(np.int64)
    order = np.lexsort((target, source))
    return source[order].astype(np.int64), target[order]


def apart(cells: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Rows whose open cell does not meet the closed box, shape (n,), bool."""
    meet = (cells[:, 0] < boxes[:, 1]) & (cells[:, 1] > boxes[:, 0])
    # A flat box inside the cell has low == high, which lies strictly between the cell's sides.
    return ~(meet[:, 0] & meet[:, 1] & meet[:, 2])
