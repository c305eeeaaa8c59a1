"""Sets of targets by their pairs, against a matrix."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.pair_sets import PairSets

SHAPE = (5, 7)
PAIRS = st.lists(st.tuples(st.integers(0, SHAPE[0] - 1), st.integers(0, SHAPE[1] - 1)), max_size=30)
SOME = st.tuples(*(st.lists(st.booleans(), min_size=n, max_size=n) for n in (SHAPE[0], SHAPE[1], SHAPE[0])))


def made(pairs, some=None):
    """Sets, and the same as a matrix."""
    rows, targets = np.array(pairs, np.int64).reshape(-1, 2).T
    sets, matrix = PairSets.of((rows, targets), SHAPE), np.zeros(SHAPE, bool)
    matrix[rows, targets] = True
    if some:
        whole, shared, sharing = map(np.array, some)
        sets = replace(sets, whole=whole, shared=shared, sharing=sharing)
        matrix |= whole[:, None] | sharing[:, None] & shared
    return sets, matrix


@given(PAIRS, st.none() | SOME, st.lists(st.integers(0, SHAPE[0] - 1), max_size=6))
def test_as_a_matrix(pairs, some, rows):
    sets, matrix = made(pairs, some)
    rows = np.array(rows, int)
    assert sets.shape == matrix.shape
    assert np.array_equal(sets[np.arange(SHAPE[0])], matrix) and np.array_equal(sets[2], matrix[2])
    assert np.array_equal(sets[rows], matrix[rows])
    assert sets.sizes.tolist() == matrix.sum(axis=1).tolist()
    assert [[sets.has(a, b) for b in range(SHAPE[1])] for a in range(SHAPE[0])] == matrix.tolist()
    starts, members = sets.lists(rows)
    assert np.diff(starts).tolist() == matrix[rows].sum(axis=1).tolist()
    assert members.tolist() == np.nonzero(matrix[rows])[1].tolist()


def test_memory_is_for_what_is_potential():
    count = 10**6
    ids = np.arange(count)
    sets = PairSets.of((ids, ids[::-1]), (count, count))
    assert sets.has(3, count - 4) and not sets.has(3, 3)
    assert sum(part.nbytes for part in vars(sets).values() if isinstance(part, np.ndarray)) < 30 * count


@pytest.mark.parametrize("shape", [(0, 0), (3, 0)])
def test_nothing(shape):
    none = PairSets.of((np.zeros(0, int), np.zeros(0, int)), shape)
    assert none[np.arange(shape[0])].shape == shape and none.sizes.tolist() == [0] * shape[0]
