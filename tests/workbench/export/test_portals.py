"""Cells and portals of a bake as a portal file, and the judgement of what another tool makes of it."""

import numpy as np
import pytest
from viewcell.data.store.quake import axial_graph, read_prt
from viewcell.workbench.baked import load
from viewcell.workbench.cli import main


@pytest.fixture
def baked(graph, tmp_path, capsys):
    out = tmp_path / "rooms.bake"
    assert main(["bake", str(graph), "--out", str(out), "--no-progress"]) == 0
    capsys.readouterr()
    return out


def test_an_exported_graph_has_the_same_portals(baked, tmp_path, capsys):
    path = tmp_path / "rooms.prt"
    assert main(["export", str(baked), "--prt", str(path)]) == 0
    assert "1 unit = 0.03125 m" in capsys.readouterr().out
    graph, back = load(baked).graph, axial_graph(read_prt(path), "rooms")
    assert np.array_equal(back.portals, graph.portals)
    assert np.array_equal(back.portal_cells, graph.portal_cells)


def test_sets_for_an_exported_graph_are_judged(baked, tmp_path, capsys):
    path, sets = tmp_path / "rooms.prt", tmp_path / "sets.npy"
    assert main(["export", str(baked), "--prt", str(path)]) == 0
    whole = load(baked).potential_cells
    np.save(sets, whole)
    asked = ["check", str(path), "--pvs", str(sets), "--no-progress"]
    assert main(asked) == 0
    pair = np.argwhere(whole & ~np.eye(len(whole), dtype=bool))[0]
    whole[tuple(pair)] = False
    np.save(sets, whole)
    assert main(asked) == 1


def test_what_cannot_be_exported_is_told_in_one_line(baked, tmp_path, capsys):
    assert main(["export", str(baked), "--prt", str(tmp_path / "no" / "rooms.prt")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert main(["export", str(tmp_path), "--prt", str(tmp_path / "rooms.prt")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not list(tmp_path.glob("*.prt"))


def test_prisms_are_no_leaves(house, tmp_path):
    """They come last, have no portals, and overlap the cells that are leaves."""
    path = load(house.folder).export("prt", tmp_path / "house.prt")
    assert read_prt(path).leaf_count == house.graph.tile_count
