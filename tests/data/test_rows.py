"""The table of rows: what others have seen is taken over, and nothing else changes."""

import numpy as np
from viewcell.data.rows import Rows


def rows_of(pairs, seen=()):
    rows = Rows.unseen(*np.array(pairs, np.int64).reshape(-1, 2).T)
    chosen = np.array([k for k, pair in enumerate(pairs) if pair in seen], int)
    rows.show(chosen, np.repeat(chosen[:, None] + 0.5, 3, axis=1), np.repeat(chosen[:, None] + 100.0, 3, axis=1))
    return rows


def test_unknown_rows_adopt_what_others_have_seen():
    rows = rows_of([(0, 1), (0, 7), (2, 1), (5, 0)], seen={(0, 7)})
    known = [(0, 0), (0, 5), (0, 7), (1, 1), (2, 1), (9, 9)]
    others = rows_of(known, seen=set(known))
    rows.adopt(others)
    assert rows.seen.tolist() == [False, True, True, False]
    # The row that had a witness keeps it.
    assert rows.origin[1, 0] == 1.5 and rows.origin[2, 0] == 4.5 and rows.end[2, 0] == 104.0


def test_nothing_is_adopted_from_nobody_and_by_nobody():
    rows = rows_of([(0, 1)])
    rows.adopt(rows_of([]))
    assert not rows.seen.any()
    rows_of([]).adopt(rows_of([(0, 1)], seen={(0, 1)}))


def test_once_keeps_the_first_of_equal_pairs():
    pairs = [(0, 1), (0, 1), (0, 2), (1, 2), (1, 2), (2, 2)]
    rows = rows_of(pairs, seen=set(pairs)).once()
    assert list(zip(rows.source, rows.target, strict=True)) == [(0, 1), (0, 2), (1, 2), (2, 2)]
    assert rows.origin[:, 0].tolist() == [0.5, 2.5, 3.5, 5.5] and len(rows_of([]).once()) == 0


def test_ordered_rows_are_themselves():
    rows = rows_of([(0, 1), (0, 7), (2, 1), (2, 1)])
    assert rows.order() is rows
    other = rows_of([(0, 7), (0, 1), (2, 1)], seen={(0, 1)}).order()
    assert other.target.tolist() == [1, 7, 1] and other.seen.tolist() == [True, False, False]
    assert rows_of([(2, 1), (0, 3)]).order().source.tolist() == [0, 2]


def test_joined_rows_keep_their_lines():
    """Those of unknown pairs, too: they say where to aim."""
    rows = rows_of([(0, 1), (0, 7)], seen={(0, 7)})
    rows.origin[0], rows.end[0] = 3.0, 4.0
    joined = Rows.join([rows_of([(5, 5)]), rows, rows_of([]), rows_of([(6, 6)])])
    assert joined.source.tolist() == [5, 0, 0, 6] and joined.seen.tolist() == [False, False, True, False]
    assert joined.origin[:, 0].tolist() == [0.0, 3.0, 1.5, 0.0] and joined.end[:, 2].tolist() == [0.0, 4.0, 101.0, 0.0]
