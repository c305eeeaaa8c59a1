"""vLOD's scheme: its code as the appendix has it, boundaries, changes, and the sampled tour."""

from itertools import product

import numpy as np
import pytest
from builders.small_house import small_graph
from viewcell.data.graph import CellGraph
from viewcell.solvers.tour import count_runs
from viewcell.workbench.bench import published
from viewcell.workbench.bench.published import (
    Sets,
    boundaries,
    changes,
    sampled_order,
    two_bit_bytes,
    two_bit_code,
)

CODES = {
    1: "11",
    2: "10",
    3: "110",
    4: "100",
    5: "1011",
    6: "1100",
    7: "11011",
    8: "1000",
    9: "10011",
    10: "1010",
    13: "110011",
    15: "110110",
}


@pytest.mark.parametrize("number", CODES)
def test_numbers_are_coded_by_the_rules_of_the_appendix(number):
    assert two_bit_code(number) == CODES[number]


def test_no_two_short_sequences_have_one_code():
    seen = {}
    for length in (1, 2, 3):
        for numbers in product(range(1, 16), repeat=length):
            bits = "11".join(map(two_bit_code, numbers))
            assert seen.setdefault(bits, numbers) == numbers


def test_sets_take_whole_bytes():
    # {0 ... 6}: offset 1, seven of them: 11 11 11011, nine bits; {4}: 1011 11 11, eight.
    assert two_bit_bytes(Sets.of_rows([np.arange(7)], 9)) == 2
    assert two_bit_bytes(Sets.of_rows([np.array([4])], 9)) == 1
    assert two_bit_bytes(Sets.of_rows([np.array([4]), np.arange(0), np.arange(7)], 9)) == 3
    # {0, 2}: 1, 1, offset 2 from the id before, 1.
    assert two_bit_bytes(Sets.of_rows([np.array([0, 2])], 9)) == -(-len("11111111101111") // 8)


def test_boundaries_lead_through_doorways():
    """Rooms 0, 2, 4 in a row and 5 beside 4, through doorways 1, 3 and 6."""
    graph = small_graph()
    cells = np.flatnonzero(graph.inhabitable)
    assert cells[boundaries(graph, cells)].tolist() == [[0, 2], [2, 4], [4, 5]]
    assert boundaries(graph, np.arange(graph.cell_count)).tolist() == sorted(map(sorted, graph.portal_cells.tolist()))


def test_without_portals_boundaries_are_faces():
    corners = np.array([[x, y, 0] for x in (0, 4) for y in (0, 4)])
    boxes = np.stack([corners, corners + 4], axis=1).astype(np.int32)
    none = np.zeros((0, 2), np.int32)
    graph = CellGraph(
        boxes, np.ones(4, bool), np.array([""] * 4), none, np.zeros(0, np.int8), np.zeros((0, 2, 3), np.int32)
    )
    assert boundaries(graph, np.arange(4)).tolist() == [[0, 1], [0, 2], [1, 3], [2, 3]]


def test_changes_are_what_comes_and_what_goes():
    sets = Sets.of_rows([np.array([0, 1, 5]), np.array([1, 2]), np.arange(0)], 6)
    comes, goes = changes(sets, np.array([[0, 1], [1, 2]]))
    assert [comes.of(0).tolist(), comes.of(1).tolist()] == [[2], []]
    assert [goes.of(0).tolist(), goes.of(1).tolist()] == [[0, 5], [1, 2]]


def test_sets_in_another_order():
    sets = Sets.of_rows([np.array([0, 2]), np.array([1])], 3)
    turned = sets.ordered(np.array([2, 0, 1]))
    assert [turned.of(0).tolist(), turned.of(1).tolist()] == [[0, 1], [2]]


def test_the_sampled_tour_has_each_object_once_and_saves_runs(monkeypatch):
    rng = np.random.default_rng(0)
    at, eyes = rng.random(400), rng.random(60)
    sets = Sets.of_rows([np.flatnonzero(np.abs(at - eye) < 0.1) for eye in eyes], 400)
    order = sampled_order(sets)
    assert sorted(order.tolist()) == list(range(400)) and np.array_equal(order, sampled_order(sets))
    assert count_runs(sets.starts, sets.members, order) < 0.2 * count_runs(
        sets.starts, sets.members, np.random.default_rng(1).permutation(400)
    )
    monkeypatch.setattr(published, "MOST_COLUMNS", 3)
    assert sampled_order(sets) is None
