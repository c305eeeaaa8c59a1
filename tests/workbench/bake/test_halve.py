"""Cells halved where their eyes see much more together than one of them does."""

import numpy as np
import pytest
import viewcell
from builders import corridors
from builders.random_buildings import box_triangles as box
from builders.random_buildings import scene_of
from viewcell.data.kept import mean_kept
from viewcell.data.prepared import PreparedModel
from viewcell.data.view_cells import as_graph
from viewcell.workbench.bake import cells as choosing
from viewcell.workbench.bake import halve
from viewcell.workbench.bake.halve import halved, halves
from viewcell.workbench.bake.settings import Settings

M = 1024
BAYS, DEEP = 8, 12


def corridor():
    """A corridor of 24 m along x, and deep bays beside it; what stands at a bay's end is seen from before it only."""
    parts = [(box((0, -100, 0), (3 * M * BAYS, 0, 3 * M)), "occluder")]
    for k in range(BAYS + 1):
        parts.append((box((3 * M * k - 50, 3 * M, 0), (3 * M * k + 50, 3 * M + DEEP * M, 3 * M)), "occluder"))
    for k in range(BAYS):
        for n in range(6):
            low = np.array([3 * M * k + 300 + 400 * n, 3 * M + DEEP * M - 300, 0])
            parts.append((box(low, low + np.array([390, 100, 3 * M])), "detail"))
    return PreparedModel(scene_of(parts))


CELLS = np.array([[[0, 0, 0], [3 * M * BAYS, 3 * M, 3 * M]], [[0, 20 * M, 0], [M, 21 * M, M]]], np.int32)
SOURCES = np.array([True, False])


def tiled(boxes, parents, cells):
    """Halves lie in their cell and fill it."""
    inside = (boxes[:, 0] >= cells[parents, 0]).all() and (boxes[:, 1] <= cells[parents, 1]).all()
    volumes = [np.prod(np.diff(part.astype(float), axis=1)[:, 0], axis=1) for part in (boxes, cells)]
    return inside and np.bincount(parents, volumes[0], minlength=len(cells)).tolist() == volumes[1].tolist()


def test_a_corridor_is_halved_along_its_length(monkeypatch):
    """As often as allowed; what is no source stays whole, ids stay in order."""
    monkeypatch.setattr(halve, "MOST", 3.0)
    boxes, parents = halved(corridor(), CELLS, SOURCES, 1.2)
    assert parents.tolist() == [0, 0, 0, 0, 1] and tiled(boxes, parents, CELLS)
    assert (boxes[:4, :, 1:] == CELLS[0, :, 1:]).all() and (np.diff(boxes[:4, 0, 0]) > 0).all()
    again, _ = halved(corridor(), CELLS, SOURCES, 1.2)
    assert (again == boxes).all()


@pytest.mark.parametrize("ratio", [1.2, 50.0])
def test_no_more_than_half_as_many_are_added_and_none_below_the_ratio(ratio):
    cells = np.array([CELLS[0], CELLS[0] + [0, 0, 3 * M], CELLS[1]], np.int32)
    boxes, parents = halved(corridor(), cells, np.array([True, True, False]), ratio)
    assert len(boxes) == (4 if ratio < 2 else 3) and tiled(boxes, parents, cells)


def test_where_most_is_gained_comes_first():
    """Of two corridors of which one is half as high, the higher one is halved, whichever comes first."""
    low = np.array([[0, 0, 0], [3 * M * BAYS, 3 * M, 3 * M // 2]], np.int32)
    high = np.array([[0, 0, 0], [3 * M * BAYS, 3 * M, 3 * M]], np.int32)
    for cells, place in (([low, high], 1), ([high, low], 0)):
        _, parents = halved(corridor(), np.array(cells), np.ones(2, bool), 1.2)
        assert np.bincount(parents).tolist() == ([1, 2] if place else [2, 1])


def test_no_half_is_narrower_than_a_metre(monkeypatch):
    monkeypatch.setattr(halve, "MOST", 1000.0)
    monkeypatch.setattr(halve, "GAIN", 0.0)
    boxes, parents = halved(corridor(), CELLS, SOURCES, 1.0)
    assert np.diff(boxes[parents == 0], axis=1).min() >= M and len(boxes) > 5


def test_where_everything_is_seen_from_everywhere_nothing_is_halved():
    scene = scene_of([(box((0, -100, 0), (3 * M * BAYS, 0, 3 * M)), "occluder")])
    assert len(halved(PreparedModel(scene), CELLS, SOURCES, 1.0)[0]) == 2


def test_halves_meet_in_the_middle():
    low, high = halves(np.array([[0, 0, 0], [7, 8, 9]]), 0)
    assert low.tolist() == [[0, 0, 0], [3, 8, 9]] and high.tolist() == [[3, 0, 0], [7, 8, 9]]


@pytest.mark.parametrize(("certify", "share"), [(False, 0.9), (True, 0.95)], ids=["False", "True"])
def test_a_refined_bake_keeps_less_and_is_as_true(certify, share, tmp_path):
    """Halves are called as their cell, see each other through the faces between them, and hide nothing that is seen.

    Walls are seen from farther away than furniture; certificates of a furnished office take long.
    """
    office = viewcell.make_office(floors=1, rooms_per_side=2, furnished=not certify)
    plain, refined = (
        viewcell.bake(office, tmp_path / f"{ratio}", settings=Settings(certify=certify, refine_kept=ratio))
        for ratio in (0.0, 1.5)
    )
    before, after = (mean_kept(bake.graph, bake.kept()[0]) for bake in (plain, refined))
    assert after < share * before
    counts = [int(bake.graph.inhabitable.sum()) for bake in (plain, refined)]
    assert counts[0] < counts[1] <= 1.5 * counts[0]
    result = refined.verify(rays=100_000)
    assert result.ok, result.table()
    assert set(refined.graph.cell_names) == set(plain.graph.cell_names)
    both = refined.potential_cells[:, refined.graph.inhabitable][refined.graph.inhabitable]
    assert (both == both.T).all()


def test_a_bare_graph_has_nothing_to_halve(tmp_path):
    with pytest.raises(viewcell.InputError, match="expected a model whose cells to cut, found a bare graph"):
        viewcell.bake(corridors.graph_folder("office", tmp_path), settings=Settings(refine_kept=2.0))


def test_a_leak_path_keeps_its_cells():
    """Ids move on by the halves before them."""
    cells, parents = np.array([[[0, 0, 0], [k + 1, 1, 1]] for k in range(5)], np.int32), np.array([0, 1, 1, 2, 3])
    graph = as_graph(cells[:4], np.array(list("abcd"), object), np.array([False, True, True, False]))
    made, notes = choosing._cut_graph(corridor(), graph, {"leak_cells": [3, 1], "dead_cells": 7}, cells, parents)
    assert notes == {"leak_cells": [4, 1], "dead_cells": 7}
    assert made.cell_names.tolist() == list("abbcd") and made.inhabitable.tolist() == [False, True, True, True, False]
