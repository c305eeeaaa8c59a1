"""Going down a hierarchy, and keeping proofs: nothing is lost on the way; no proof stays of what may be seen."""

import numpy as np
import pytest
from builders.blocker_scenes import blockers_of
from viewcell.data.hierarchy import build_levels
from viewcell.data.verdict import Verdict
from viewcell.kernels.blockers import blocker_tree
from viewcell.kernels.launch import CPU
from viewcell.kernels.line_tree import LineTrees, launch_line_trees
from viewcell.kernels.shaft import ShaftAnswers
from viewcell.kernels.target import launch_target_search
from viewcell.solvers.visibility import ledger as ledgers
from viewcell.solvers.visibility.ledger import Ledger, apart, descend
from viewcell.verify.proofs.line_tree import Blocker, hides
from viewcell.verify.proofs.ways import End

CELL = np.array([[[0, 0, 0], [4, 4, 4]]], np.int32)


def random_boxes(random, count):
    low = random.integers(-20, 40, (count, 3))
    boxes = np.stack([low, low + random.integers(0, 9, (count, 3))], axis=1).astype(np.int32)
    return boxes


@pytest.mark.parametrize("count", [1, 2, 7, 40])
def test_what_is_left_is_what_no_box_around_it_hides(count):
    """Against a look at all nodes around each item; hidden is whatever lies beyond a plane."""
    random = np.random.default_rng(count)
    items = random_boxes(random, count)
    cells = np.concatenate([CELL, CELL + 8])
    levels, order = build_levels(items)
    asked = []

    def hide(source, boxes):
        asked.append((source, boxes))
        return boxes[:, 0, 0] > 10 + 4 * source

    source, found = descend(cells, np.array([0, 1]), levels, order, 3, hide)
    wanted = []
    for cell in (0, 1):
        for place, item in enumerate(order):
            if item < 0:
                continue
            chain = [
                levels[level][place >> (len(levels) - 1 - level)]
                for level in range(min(3, len(levels) - 1), len(levels))
            ]
            meets = [not len(apart(cells[[cell]], box[None])) for box in chain]
            if all(meet or box[0, 0] <= 10 + 4 * cell for meet, box in zip(meets, chain, strict=True)):
                wanted.append((cell, int(item)))
    assert list(zip(source.tolist(), found.tolist(), strict=True)) == sorted(wanted)
    # Nothing that meets the view cell is ever asked about, and no empty node.
    assert all(len(apart(cells[s], boxes)) == len(s) and (boxes[:, 0] <= boxes[:, 1]).all() for s, boxes in asked)


@pytest.mark.parametrize("hidden_share", [0.0, 0.1, 0.9])
def test_haste_leaves_what_patience_does_and_asks_about_less_where_little_is_hidden(hidden_share):
    """Items in a row, hidden beyond a plane: also where an item alone, and no node, is hidden."""
    random = np.random.default_rng(3)
    items = random_boxes(random, 300)
    items[:, :, 0] = np.arange(300)[:, None] + [0, 1]
    cells = np.concatenate([CELL - 100, CELL - 200])
    levels, order = build_levels(items)
    edges = 301 - hidden_share * np.array([300, 200])
    asked = {}

    def descent(haste):
        def hide(source, boxes):
            asked[haste] = asked.get(haste, 0) + len(boxes)
            return boxes[:, 0, 0] >= edges[source]

        return descend(cells, np.array([0, 1]), levels, order, 3, hide, haste=haste)

    (source, found), (others, wanted) = descent(True), descent(False)
    assert (source == others).all() and (found == wanted).all()
    assert len(found) == sum((items[:, 0, 0] < edge).sum() for edge in edges)
    # All items once, or as without haste, where one proof serves for many.
    assert asked[True] < 0.6 * asked[False] if hidden_share == 0 else asked[True] <= 1.1 * asked[False]


@pytest.mark.parametrize(
    ("box", "meets"),
    [
        ([[1, 1, 1], [2, 2, 2]], True),
        ([[4, 0, 0], [9, 4, 4]], False),
        ([[-5, 0, 0], [0, 4, 4]], False),
        ([[2, 1, 1], [2, 3, 3]], True),
        ([[4, 1, 1], [4, 3, 3]], False),
        ([[2, 2, 2], [2, 2, 2]], True),
    ],
    ids=["inside", "beside", "before", "a plate inside", "a plate on the face", "a point inside"],
)
def test_an_open_cell_meets_a_closed_box(box, meets):
    assert apart(CELL, np.array([box])).tolist() == [not meets]


def searched(ledger, pair):
    """Two targets behind a wall and one beside it, entered as pieces of the pairs."""
    tree = blocker_tree(blockers_of([[[6, -40, -40], [6, 40, 20]]]))
    boxes = np.array([CELL[0], [[9, 0, 0], [10, 4, 4]], [[12, 1, 1], [13, 3, 3]], [[9, 0, 90], [10, 4, 99]]], np.int32)
    rows = np.array([[0, 1, 1], [0, 2, 1], [0, 3, 1]])
    answers = launch_target_search(tree, boxes, rows)
    ledger.add_lines(tree, boxes, rows, answers, CPU, None if pair is None else np.array(pair))
    return boxes, answers


def test_every_hidden_row_has_a_tree_that_holds():
    ledger = Ledger()
    boxes, answers = searched(ledger, None)
    assert answers.verdict.tolist() == [Verdict.HIDDEN, Verdict.HIDDEN, Verdict.VISIBLE]
    proofs = ledger.close(np.zeros(0, bool))
    assert proofs.cell.tolist() == [0, 0] and proofs.boxes.tolist() == boxes[1:3].tolist() and proofs.seconds > 0
    blockers = {0: Blocker(0, [[6, -40, -40], [6, 40, 20]])}
    for row in range(2):
        words = proofs.words[proofs.word_starts[row] : proofs.word_starts[row + 1]].tolist()
        assert hides(End(CELL[0].tolist()), End(boxes[1 + row].tolist()), True, words, blockers)


def test_what_has_no_tree_is_unknown(monkeypatch):
    """As of a search that could not be told: its tree has no words."""

    def second_has_none(*work, **options):
        trees = launch_line_trees(*work, **options)
        ends = [trees.starts[0], trees.starts[1], trees.starts[1]]
        return LineTrees(np.array(ends), trees.words[: ends[1]])

    monkeypatch.setattr(ledgers, "launch_line_trees", second_has_none)
    ledger = Ledger()
    boxes, answers = searched(ledger, None)
    assert answers.verdict.tolist() == [Verdict.HIDDEN, Verdict.UNKNOWN, Verdict.VISIBLE]
    assert ledger.close(np.zeros(0, bool)).boxes.tolist() == [boxes[1].tolist()]


def test_proofs_of_pieces_go_with_their_pair():
    for hidden, kept in (([True, True], 2), ([True, False], 1), ([False, True], 1), ([False, False], 0)):
        ledger = Ledger()
        searched(ledger, [0, 1, 1])
        assert len(ledger.close(np.array(hidden)).cell) == kept


def test_whole_targets_stay_whatever_becomes_of_the_pairs():
    ledger = Ledger()
    searched(ledger, [-1, 0, -1])
    assert ledger.close(np.array([False])).boxes.tolist() == [[[9, 0, 0], [10, 4, 4]]]


def test_shafts_are_kept_with_their_leaves():
    ledger = Ledger()
    boxes = np.array([[[9, 0, 0], [10, 4, 4]], [[9, 0, 5], [10, 4, 6]], [[12, 0, 0], [13, 4, 4]]], np.int32)
    verdict = np.array([Verdict.HIDDEN, Verdict.UNKNOWN, Verdict.HIDDEN], np.uint8)
    leaves = np.array([2, 0, 1])
    certificate = np.arange(39, dtype=np.int32).reshape(3, 13)
    answers = ShaftAnswers(verdict, np.zeros(3, int), leaves, np.zeros((3, 2, 3)), certificate, np.array([0, 2, 2, 3]))
    ledger.add_shafts(np.array([5, 6, 7]), boxes, answers, np.array([0, 1, 2]))
    proofs = ledger.close(np.array([False, True, True]))
    assert proofs.cell.tolist() == [7] and proofs.leaves.tolist() == certificate[2:].tolist()
