"""The tour against its exact twin, which tries all orders of a few columns and all steps of some."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.errors import InputError
from viewcell.kernels import tour as kernels
from viewcell.kernels.launch import CPU, Device
from viewcell.kernels.tour import SEGMENT, WORD, launch_near_columns, launch_tour, packed
from viewcell.verify.exact.tour import as_columns, least_runs, length, nearest, runs, shorter

DEVICES = [CPU, pytest.param(Device("cuda:0"), marks=pytest.mark.gpu)]
NONE = np.zeros(0, int)


def random_bits(rng, rows, columns, share=0.4):
    return rng.random((rows, columns)) < share


def columns_of(bits):
    return as_columns(["".join(map(str, row)) for row in bits.astype(int)])


def closed_tour(bits, near=None, jumps=NONE, device=CPU):
    near = launch_near_columns(bits, bits.shape[1], device) if near is None else near
    return launch_tour(bits, near, jumps, device).tolist()


@st.composite
def matrices(draw, most_rows=6, most_columns=9):
    """Bits behind a column of zeros."""
    rows, columns = draw(st.integers(1, most_rows)), draw(st.integers(1, most_columns))
    bits = draw(st.lists(st.booleans(), min_size=rows * columns, max_size=rows * columns))
    return np.column_stack([np.zeros(rows, bool), np.reshape(bits, (rows, columns))])


@given(matrices())
def test_the_tour_is_as_short_as_steps_make_it_and_close_to_the_best(bits):
    columns, order = columns_of(bits), closed_tour(bits)
    assert order[0] == 0 and sorted(order) == list(range(bits.shape[1]))
    assert shorter(columns, order, SEGMENT) is None
    least = least_runs(columns[1:])
    assert least <= length(columns, order) / 2 <= 1.5 * least


@given(matrices())
def test_runs_are_half_of_the_closed_tour(bits):
    order = closed_tour(bits)
    rows = ["".join(map(str, row)) for row in bits.astype(int)]
    assert 2 * runs(rows, order) == length(columns_of(bits), order)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("rows", [1, WORD - 1, WORD, WORD + 1, 3 * WORD])
def test_near_columns_are_those_of_the_twin(rows, device):
    bits = random_bits(np.random.default_rng(rows), rows, 40)
    bits[:, 7] = bits[:, 30]
    bits[:, 9] = ~bits[:, 8]
    assert launch_near_columns(bits, 12, device).tolist() == nearest(columns_of(bits), 12)


def test_fewer_others_than_are_asked_for():
    assert launch_near_columns(np.eye(3, dtype=bool), 4).tolist() == [[1, 2, -1, -1], [0, 2, -1, -1], [0, 1, -1, -1]]


def test_words_hold_every_bit():
    bits = random_bits(np.random.default_rng(1), 130, 20)
    words = packed(bits)
    assert words.shape == (20, 3) and (words >= 0).all()
    for row in range(130):
        assert np.array_equal(words[:, row // 63] >> row % 63 & 1 == 1, bits[row])


@pytest.mark.parametrize("device", DEVICES)
def test_larger_tours_leave_no_step(device):
    bits = random_bits(np.random.default_rng(2), 9, 40)
    bits[:, 0] = False
    assert shorter(columns_of(bits), closed_tour(bits, device=device), SEGMENT) is None


def intervals(rng, rows, columns):
    """Rows of one run each, columns then shuffled: as many runs as rows can be had."""
    ends = np.sort(rng.integers(1, columns, (rows, 2)), axis=1)
    bits = (np.arange(columns) >= ends[:, :1]) & (np.arange(columns) <= ends[:, 1:])
    return bits[:, np.append(0, 1 + rng.permutation(columns - 1))]


def test_runs_are_put_together_again():
    """With lists of 12, as it is used: random steps along a line are found again, but for a few."""
    bits = intervals(np.random.default_rng(3), 150, 400)
    near = launch_near_columns(bits, 12)
    columns = columns_of(bits)
    found = length(columns, closed_tour(bits, near)) / 2
    assert 150 <= found <= 1.1 * 150 < 0.05 * length(columns, range(400)) / 2


@pytest.mark.parametrize("looks", [1, 7, 10**6])
def test_it_does_not_matter_where_a_launch_ends(looks, monkeypatch):
    bits = random_bits(np.random.default_rng(4), 20, 60)
    whole = closed_tour(bits)
    monkeypatch.setattr(kernels, "LOOKS", looks)
    assert closed_tour(bits) == whole


def test_jumps_are_taken_where_lists_end():
    """Lists of one: two columns that are each other's nearest end it at once."""
    bits = np.zeros((8, 6), bool)
    for k, row in enumerate([[0, 1], [0, 1, 7], [2, 3], [2, 3, 7], [4, 5], [4, 5, 7]]):
        bits[row, k] = True
    near = launch_near_columns(bits, 1)
    for jumps in ([0, 2, 4, 1, 3, 5], [5, 4, 3, 2, 1, 0]):
        assert sorted(closed_tour(bits, near, np.array(jumps))) == list(range(6))
    lone = np.full((6, 1), -1)
    assert closed_tour(bits, lone, np.array([3, 0, 5, 1, 4, 2])) == [0, 3, 5, 1, 4, 2]


@pytest.mark.parametrize("count", range(6))
def test_a_few_columns(count):
    assert closed_tour(np.ones((2, count), bool)) in (list(range(count)), [0, *range(count - 1, 0, -1)][:count])
    assert len(closed_tour(np.zeros((0, count), bool))) == count


def test_refuses_lists_of_other_columns():
    bits = np.eye(3, dtype=bool)
    for near in ([[1], [2]], [[1], [2], [3]], [[1], [2], [-2]]):
        with pytest.raises(InputError, match="near: expected a row of columns below 3"):
            launch_tour(bits, np.array(near), NONE)
    with pytest.raises(InputError, match="jumps: expected each of 3 columns once"):
        launch_tour(bits, np.array([[1], [2], [0]]), np.array([0, 1, 1]))
