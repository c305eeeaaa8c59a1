"""Range cells: lengths are those of the shortest ways through portals, from below, and none is left out."""

import heapq

import numpy as np
import pytest
from builders.random_buildings import SIZE, STEP, random_graph
from builders.small_house import small_graph
from viewcell.data.graph import CellGraph
from viewcell.solvers.walk import range_cells
from viewcell.solvers.walk.range_cells import RangeCells, box_distances

M = 1 / 64


def holders(graph, eye):
    inside = ((graph.cells[:, 0] * M <= eye) & (eye <= graph.cells[:, 1] * M)).all(axis=1)
    return np.flatnonzero(inside)


def plain(graph, eye, held):
    """Length to the first portal of each cell, by a queue and plain loops."""

    def apart(a, b):
        gap = [max(0.0, a[0][k] - b[1][k], b[0][k] - a[1][k]) for k in range(3)]
        return sum(g * g for g in gap) ** 0.5

    boxes = (graph.portals * M).tolist()
    doors = [[p for p in range(graph.portal_count) if c in graph.portal_cells[p]] for c in range(graph.cell_count)]
    point = [list(eye), list(eye)]
    queue = [(apart(point, boxes[p]), p) for c in held for p in doors[c]]
    heapq.heapify(queue)
    best = {}
    while queue:
        length, portal = heapq.heappop(queue)
        if portal in best:
            continue
        best[portal] = length
        for cell in graph.portal_cells[portal].tolist():
            for other in doors[cell]:
                if other not in best:
                    heapq.heappush(queue, (length + apart(boxes[portal], boxes[other]), other))
    out = np.full(graph.cell_count, np.inf)
    out[held] = 0.0
    for portal, length in best.items():
        for cell in graph.portal_cells[portal].tolist():
            out[cell] = min(out[cell], length)
    return out


def test_vectors():
    """An eye in the hall, 3 m from its door: the doorway at 3 m, the room behind it a wall's depth more."""
    graph = small_graph()
    ways = RangeCells(graph, M)
    eye = np.array([37.0, 10.0, 10.0])
    cells, length = ways.near(eye, np.array([0]), 100.0)
    found = dict(zip(cells.tolist(), length.tolist(), strict=True))
    assert found[0] == 0 and found[1] == 3 and found[2] == 7
    assert list(length) == sorted(length)
    # Only so far: what is as far as that still counts.
    assert ways.near(eye, np.array([0]), 3.0)[0].tolist() == [0, 1]
    assert ways.near(eye, np.array([0]), 2.99)[0].tolist() == [0]
    # In a doorway's plane, held by both.
    assert set(ways.near(np.array([40.0, 10, 10]), np.array([0, 1]), 0.0)[0].tolist()) == {0, 1}


@pytest.mark.parametrize("seed", range(4))
def test_the_shortest_ways_of_random_buildings(seed):
    graph, _ = random_graph(seed, walls=5)
    rng, ways = np.random.default_rng(seed), RangeCells(graph, M)
    for _ in range(10):
        eye = rng.uniform(0, SIZE * STEP, 3) * M
        held = holders(graph, eye)
        wanted = plain(graph, eye, held)
        reach = float(rng.uniform(0, 2 * SIZE * STEP * M))
        cells, length = ways.near(eye, held, reach)
        assert np.array_equal(np.sort(cells), np.flatnonzero(wanted <= reach))
        np.testing.assert_allclose(length, wanted[cells], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("most", [1, 2, 4])
def test_cells_with_many_portals_are_reached_no_later(most, monkeypatch):
    """Groups of portals stand for them: lengths fall, never below 0, and never rise."""
    graph, _ = random_graph(2, walls=5)
    monkeypatch.setattr(range_cells, "PORTALS_MOST", most)
    rng, ways, shorter = np.random.default_rng(2), RangeCells(graph, M), 0
    for _ in range(10):
        eye = rng.uniform(0, SIZE * STEP, 3) * M
        held = holders(graph, eye)
        wanted = plain(graph, eye, held)
        cells, length = ways.near(eye, held, 1e6)
        assert set(np.flatnonzero(np.isfinite(wanted)).tolist()) <= set(cells.tolist())
        assert (length >= 0).all() and (length <= wanted[cells] + 1e-9).all()
        shorter += int((length < wanted[cells] - 1e-9).sum())
    assert shorter > 0


def test_never_longer_than_a_walk():
    """A walk through middles of portals takes at least as long as is said, for every cell on it."""
    graph, _ = random_graph(5, walls=5)
    rng, ways = np.random.default_rng(5), RangeCells(graph, M)
    starts, entries = graph.adjacency()
    for _ in range(20):
        cell = int(rng.integers(graph.cell_count))
        eye = graph.cells[cell].mean(axis=0) * M
        cells, length = ways.near(eye, holders(graph, eye), np.inf)
        least = dict(zip(cells.tolist(), length.tolist(), strict=True))
        at, gone = eye, 0.0
        for _ in range(8):
            if starts[cell] == starts[cell + 1]:
                break
            portal, cell = entries[rng.integers(starts[cell], starts[cell + 1])].tolist()
            middle = graph.portals[portal].mean(axis=0) * M
            gone, at = gone + float(np.linalg.norm(middle - at)), middle
            assert least[cell] <= gone + 1e-9


def test_without_portals_and_outside_of_all_cells_it_is_bee_lines():
    graph = small_graph()
    bare = RangeCells(graph.with_portals(np.zeros(0, int)), M)
    eye = np.array([37.0, 10, 10])
    wanted = box_distances(graph.cells * M, np.stack([eye, eye]))
    for ways, held in ((bare, np.array([0])), (RangeCells(graph, M), np.zeros(0, int))):
        cells, length = ways.near(eye, held, 20.0)
        assert set(cells.tolist()) == set(np.flatnonzero(wanted <= 20).tolist())
        np.testing.assert_allclose(length, wanted[cells])


def test_two_portals_between_the_same_cells_count_once_each():
    graph = small_graph()
    twice = CellGraph(
        graph.cells,
        graph.inhabitable,
        graph.cell_names,
        np.concatenate([graph.portal_cells, graph.portal_cells[:1]]),
        np.append(graph.portal_axis, graph.portal_axis[:1]),
        np.concatenate([graph.portals, graph.portals[:1]]),
    )
    eye = np.array([30.0, 10, 10])
    for cells in zip(
        RangeCells(graph, M).near(eye, np.array([0]), 99),
        RangeCells(twice, M).near(eye, np.array([0]), 99),
        strict=True,
    ):
        np.testing.assert_array_equal(*cells)
