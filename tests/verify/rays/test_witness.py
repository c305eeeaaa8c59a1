"""Witnesses of bare graphs: which portals a sightline passes, against a reading in rationals."""

from dataclasses import replace
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from builders import corridors
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.graph import OTHER_AXES
from viewcell.verify.rays.witness import REASONS, Witnesses, confirm_cells, passes_portals


def witnesses_of(cell, target, origin, end, portals):
    """One row."""
    points = [np.array([point], np.float64) for point in (origin, end)]
    return Witnesses(
        np.array([cell]), np.array([target]), *points, np.array(portals, np.int64), np.array([0, len(portals)])
    )


def passed(graph, cell, target, origin, end, portals):
    """As `passes_portals` says it, in rationals and one portal at a time."""
    o, e = ([Fraction(float(x)) for x in point] for point in (origin, end))
    worst = 1
    for number in portals:
        if not 0 <= number < graph.portal_count or cell not in graph.portal_cells[number]:
            return -1
        forward, k = graph.portal_cells[number, 0] == cell, int(graph.portal_axis[number])
        cell = graph.portal_cells[number, int(forward)]
        plane = int(graph.portals[number, 0, k])
        if not (o[k] < plane < e[k] if forward else o[k] > plane > e[k]):
            return -1
        t = (plane - o[k]) / (e[k] - o[k])
        for u in OTHER_AXES[k].tolist():
            at, (low, high) = o[u] + t * (e[u] - o[u]), graph.portals[number, :, u].tolist()
            worst = min(worst, -1 if not low <= at <= high else int(low < at < high))
    return worst if cell == target else -1


@st.composite
def walks(draw):
    """A graph of cells in a row along any axis, and a line near whose way the portals' edges lie; either may be wrong.

    Yields (graph, cell, target, origin, end, portals).
    """
    count, k = draw(st.integers(2, 4)), draw(st.integers(0, 2))
    far = draw(st.sampled_from([0, 0, 2**24 - 64]))
    shift = far * np.array(draw(st.tuples(*[st.sampled_from([1, -1])] * 3)))
    small = st.integers(-3, 3)
    start = np.array([draw(small) for _ in range(3)]) + shift
    speed = np.array([draw(small) for _ in range(3)])
    speed[k] = 8
    portals = np.zeros((count - 1, 2, 3), np.int32)
    for n in range(count - 1):
        touched = start + (n + 1) * speed
        portals[n] = (
            touched - [draw(st.integers(0, 3)) for _ in range(3)],
            touched + [draw(st.integers(0, 3)) for _ in range(3)],
        )
        portals[n, :, k] = touched[k]
    pairs = np.stack([np.arange(count - 1), np.arange(1, count)], axis=1).astype(np.int32)
    ends = (start + speed * Fraction(1, 2)).astype(float), (start + speed * (count - Fraction(1, 2))).astype(float)
    graph = corridors.corridor(count)
    graph = replace(graph, portals=portals, portal_axis=np.full(count - 1, k, np.int8), portal_cells=pairs)
    numbers, back = list(range(count - 1)), draw(st.booleans())
    cell, target, ends, numbers = (count - 1, 0, ends[::-1], numbers[::-1]) if back else (0, count - 1, ends, numbers)
    ends = [np.nextafter(end, end + np.array([draw(st.integers(-1, 1)) for _ in range(3)])) for end in ends]
    if draw(st.integers(0, 3)) == 0:
        place = draw(st.integers(0, count - 2))
        numbers[place : place + draw(st.integers(0, 1))] = draw(st.lists(st.integers(-1, count), max_size=1))
    if draw(st.integers(0, 9)) == 0:
        target = draw(st.integers(0, count - 1))
    return graph, cell, target, *ends, numbers


@given(walks())
def test_portals_are_passed_as_in_rationals(walk):
    graph, *witness = walk
    found = passes_portals(witnesses_of(*witness), graph, np.ones(1, bool))
    assert found.tolist() == [passed(*walk)]


def test_portals_are_passed_in_order_and_none_is_left_out():
    """Of all lists of portals of a straight corridor one leads from its first cell to its last, and one back."""
    graph = corridors.corridor(4)
    for way in (1, -1):
        cell, target, x = (0, 3, -96) if way > 0 else (3, 0, 96)
        for length in range(5):
            for portals in product(range(-1, 4), repeat=length):
                row = witnesses_of(cell, target, (x, 64, 64), (-x, 64, 64), list(portals))
                expected = 1 if portals == (0, 1, 2)[::way] else -1
                assert passes_portals(row, graph, np.ones(1, bool)).tolist() == [expected], portals


@pytest.mark.parametrize("step", [64, 2**22])
def test_a_witness_of_a_bare_graph_keeps_inside(step):
    """Strictly inside both cells and every portal: what only touches an edge is no witness."""
    graph = corridors.corridor(4, step)
    ulp = np.spacing(float(2 * step))

    def found(origin=(0, 0, 0), end=(0, 0, 0)):
        """Of the middle of cell 0 to the middle of cell 3 with its ends moved."""
        middles = [[x * step, 64, 64] for x in (-1.5, 1.5)]
        ends = [np.add(*pair) for pair in zip(middles, (origin, end), strict=True)]
        return REASONS[confirm_cells(witnesses_of(0, 3, *ends, [0, 1, 2]), graph, None)[0]]

    assert found() == "confirmed"
    for side in (-1, 1):
        assert found(origin=(side * step / 2, 0, 0)) == "starts outside its cell"
        assert found(end=(side * step / 2, 0, 0)) == "ends outside the reached cell"
        assert (
            found(origin=(side * (step / 2 - ulp), 0, 0)) == found(end=(side * (step / 2 - ulp), 0, 0)) == "confirmed"
        )
        assert found(end=(0, side * 64, 0)) == found(end=(0, 0, side * 64)) == "ends outside the reached cell"


def test_a_witness_along_an_edge_of_a_portal_is_refused():
    graph = corridors.corridor(3)
    graph.portals[:, 1, 1] = 96
    reasons = [
        REASONS[confirm_cells(witnesses_of(0, 2, (-32, y, 64), (96, y, 64), [0, 1]), graph, None)[0]]
        for y in (np.nextafter(96, 0), 96, np.nextafter(96, 200))
    ]
    assert reasons == ["confirmed", *["does not pass its portals in order"] * 2]
