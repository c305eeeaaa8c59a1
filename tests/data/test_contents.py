"""Closed contents of cells, and the cells that hold a point, against plain loops."""

from dataclasses import replace

import numpy as np
from builders.random_buildings import SIZE, STEP, random_graph
from viewcell.data import contents as module
from viewcell.data.contents import cells_holding, contents
from viewcell.data.plans import Plans


def lists(starts, values):
    return [part.tolist() for part in np.split(values, starts[1:-1])]


def test_contents_touch(monkeypatch):
    graph, _ = random_graph(0)
    rng = np.random.default_rng(0)
    low = rng.integers(0, SIZE, (60, 3)) * STEP
    boxes = np.stack([low, low + rng.integers(-1, 3, (60, 3)) * STEP], axis=1)
    wanted = [
        [
            k
            for k, (a, b) in enumerate(boxes.tolist())
            if all(x <= h and y >= w and x <= y for x, y, w, h in zip(a, b, *cell, strict=True))
        ]
        for cell in graph.cells.tolist()
    ]
    assert sum(map(len, wanted)) > 50
    assert lists(*contents(graph.cells, boxes)) == wanted
    monkeypatch.setattr(module, "PAIRS", 100)
    assert lists(*contents(graph.cells, boxes)) == wanted


def test_points_on_faces_are_held_by_both_sides():
    graph, _ = random_graph(0)
    points = np.concatenate([graph.portals.mean(axis=1), graph.cells.mean(axis=1), [[-1.0, 5, 5]]])
    found = lists(*cells_holding(graph, points))
    for portal, sides in enumerate(graph.portal_cells.tolist()):
        assert set(sides) <= set(found[portal])
    assert found[graph.portal_count : -1] == [[k] for k in range(graph.cell_count)]
    assert found[-1] == []


def test_without_portals_inhabitable_cells_and_prisms():
    graph, _ = random_graph(0)
    bare = graph.with_portals(np.zeros(0, int))
    bare.inhabitable[::2] = False
    found = lists(*cells_holding(bare, graph.cells.mean(axis=1)))
    assert found == [[k] if k % 2 else [] for k in range(graph.cell_count)]
    # A prism over everything that stands in the last cell's place; its corners are outside it.
    side = SIZE * STEP
    box, half = [[0, 0, 0], [side] * 3], side // 2
    plan = Plans(np.array([1]), np.array([[[side, half], [half, side], [0, half], [half, 0]]], np.int32))
    prisms = replace(
        bare,
        cells=np.array([box, box], np.int32),
        inhabitable=np.array([False, True]),
        cell_names=bare.cell_names[:2],
        plans=plan,
    )
    assert lists(*cells_holding(prisms, np.array([[half, half, 9.0], [9.0, 9, 9]]))) == [[1], []]
