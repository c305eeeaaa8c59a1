"""Cell-to-object visibility of blocks of source cells of a cell-and-portal graph.

An object is potentially visible if some cell that is not hidden holds a part of it whose box, clipped to that cell by
the object's triangles, a sightline can reach. Source: Funkhouser et al. 1996, section 3.2; the clipped boxes are
sharper.
"""

from collections.abc import Callable

import numpy as np

from ...data.incidence import Incidence
from ...data.ragged import places_of
from ...data.rows import Rows
from ...data.verdict import Verdict
from .aim import AIM_ROUNDS, FIRST_TRIES, middles
from .cells import CellModel
from .search import open_pieces, search_rounds, segments


def object_rows(
    model: CellModel,
    incidence: Incidence,
    reached: Rows,
    aim_rounds: tuple[int, ...] = AIM_ROUNDS,
    handed_on: Callable[[Rows], np.ndarray] | None = None,
) -> Rows:
    """Every object that is not proved hidden from the sources of `reached`, ordered.

    Args:
        model: graph and sights.
        incidence: of the objects with its cells.
        reached: cells that are not proved hidden.
        aim_rounds: sightlines shot at each part that could not be hidden, round by round.
        handed_on: which cells, of all, are searched again anyhow, as far as the rows tell; shape (cells,), bool. The
            last and longest round is left to that search, which hides first and shoots at fewer parts.

    Returns:
        Reached pairs. A pair that is left out is hidden, exactly.
    """
    sights, cells = model.sights, model.graph.cells
    sizes = np.diff(incidence.starts)[reached.target]
    parts = places_of(incidence.starts[reached.target], sizes)
    part_source, objects = np.repeat(reached.source, sizes), len(sights.ranges)
    keys, pair_of = np.unique(part_source * objects + incidence.object_id[parts], return_inverse=True)
    rows = Rows.unseen(*np.divmod(keys, objects))
    home = cells[rows.source]
    sights.aim(rows, np.arange(len(keys)), home, middles(home, home), rows.target, FIRST_TRIES, 0)
    potential, hints, kept_parts, hint_pair = _prove(model, incidence, rows, parts, part_source, pair_of)
    for number, tries in enumerate(aim_rounds):
        todo = np.flatnonzero(~rows.seen[hint_pair])
        if handed_on is not None and number == len(aim_rounds) - 1:
            todo = todo[~handed_on(rows.take(potential | rows.seen))[rows.source[hint_pair[todo]]]]
        at = kept_parts[todo]
        sights.aim(rows, hint_pair[todo], incidence.boxes[at], hints[todo], at, tries, number + 1)
    return rows.take(potential | rows.seen)


def _prove(
    model: CellModel,
    incidence: Incidence,
    rows: Rows,
    parts: np.ndarray,
    part_source: np.ndarray,
    pair_of: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Try to hide the parts of the pairs that are not seen, a few at a time, until some of a pair are not hidden.

    Returns:
        Which pairs stay potential, bool; and of every part that could not be hidden the ends of a line to it, shape
        (n, 2, 3), its row in the incidence, and its pair.
    """
    order = np.argsort(pair_of, kind="stable")
    starts = np.searchsorted(pair_of[order], np.arange(len(rows) + 1))
    pairs = np.flatnonzero(~rows.seen)

    def prove(_: np.ndarray, piece: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _prove_parts(model, incidence, parts[order[piece]], part_source[order[piece]])

    _, piece, hints = open_pieces(starts[pairs], starts[pairs + 1], prove)
    place = order[piece]
    potential = np.zeros(len(rows), bool)
    potential[pair_of[place]] = True
    return potential, hints, parts[place], pair_of[place]


def _prove_parts(
    model: CellModel, incidence: Incidence, parts: np.ndarray, source: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Which parts could not be hidden from the cell of their row, as rows, and a line to each, shape (n, 2, 3)."""
    cells, part_boxes = model.graph.cells, incidence.boxes[parts]
    own = incidence.cell[parts] == source
    todo = np.flatnonzero(~own)
    boxes = np.concatenate([cells, part_boxes[todo]])
    work = np.column_stack([source[todo], len(cells) + np.arange(len(todo)), np.ones(len(todo), int)])
    answers = search_rounds(model.tree, boxes, work, model.device)
    hints = middles(cells[source], part_boxes)
    lined = np.flatnonzero(answers.verdict == Verdict.VISIBLE)
    at = todo[lined]
    hints[at] = np.stack(segments(answers, lined, cells[source[at]], part_boxes[at]), axis=1)
    left = np.ones(len(parts), bool)
    left[todo[answers.verdict == Verdict.HIDDEN]] = False
    left = np.flatnonzero(left)
    return left, hints[left]
