"""A budget: something sound for every view cell first, from coarse to fine."""

import numpy as np
import pytest
import viewcell
from builders.clocks import Clock, lots_take
from viewcell.data import rasters
from viewcell.data.buildings.office import make_office
from viewcell.data.prepared import PreparedModel
from viewcell.solvers.visibility.aim import Targets
from viewcell.solvers.visibility.portal_engine import PortalEngine
from viewcell.solvers.visibility.view_cell_engine import ViewCellEngine
from viewcell.workbench.bake import budget


@pytest.fixture(scope="module")
def office():
    return make_office(floors=1, rooms_per_side=3)


@pytest.fixture(scope="module")
def whole(office, tmp_path_factory):
    return viewcell.bake(office, tmp_path_factory.mktemp("whole") / "office.bake")


@pytest.fixture
def slow(monkeypatch):
    """Hiding from one cell as a bake does takes most of a budget of 100 s; occluders take no time."""
    return Clock(monkeypatch, {False: 60.0, True: 60.0})


def kept(bake):
    return bake.potential_objects[bake.graph.inhabitable]


def seen(bake):
    table, found = bake.cell_to_object, np.zeros_like(bake.potential_objects)
    rows = np.array(table["verdict"].to_pylist()) == "visible"
    found[table["cell_id"].to_numpy()[rows], table["object_id"].to_numpy()[rows]] = True
    return found[bake.graph.inhabitable]


def test_every_cell_has_a_set_where_only_one_block_is_hidden(office, whole, tmp_path, slow):
    made = viewcell.bake(office, tmp_path / "a", budget_s=100.0, threads=1)
    assert slow.calls == [False] and made.manifest["budget"]["phase"] == "hiding"
    assert (kept(made) >= seen(whole)).all() and made.verify(rays=100_000).ok
    assert kept(whole).sum() <= kept(made).sum() < 1.3 * kept(whole).sum() < kept(made).size
    assert (kept(made).sum(axis=1) < kept(made).shape[1]).all()


def test_groups_alone_hide_something(office, whole, tmp_path, slow, monkeypatch):
    """There is time for a few groups and for nothing else: all cells of one keep the same but those asked alone."""
    groups, left = [], PortalEngine.coarse

    def timed(engine, cells, group):
        slow.now += 10.0 * len(np.unique(group))
        groups.append((cells, group))
        return left(engine, cells, group)

    monkeypatch.setattr(PortalEngine, "coarse", timed)
    monkeypatch.setattr(PortalEngine, "narrow", lambda engine, rows, step: slow.wait(1e6) or rows)
    made = viewcell.bake(office, tmp_path / "a", budget_s=150.0, threads=1)
    alone = np.concatenate([cells for cells, group in groups if group.max() + 1 == len(group)])
    together = [(cells, group) for cells, group in groups if group.max() + 1 < len(group)]
    assert together and kept(whole).sum() < kept(made).sum() < kept(made).size
    for cells, group in together:
        for mine in range(group.max() + 1):
            assert len(np.unique(made.potential_objects[np.setdiff1d(cells[group == mine], alone)], axis=0)) <= 1
    assert (kept(made) >= seen(whole)).all()


def test_occluders_are_not_asked_where_they_are_slow(office, tmp_path, slow, monkeypatch):
    """A step takes longer than hiding from a cell: a few cells are tried, and no more."""
    asked, narrow = [], PortalEngine.narrow

    def timed(engine, rows, step):
        slow.now += 3.0 * len(np.unique(rows.source))
        asked.append((step, len(np.unique(rows.source))))
        return narrow(engine, rows, step)

    slow.seconds |= {False: 6.0, True: 6.0}
    monkeypatch.setattr(PortalEngine, "narrow", timed)
    made = viewcell.bake(office, tmp_path / "a", budget_s=80.0, threads=1)
    assert len(asked) == 2 and asked[0] == asked[1] and slow.calls.count(False) >= 2
    assert asked[0][1] < kept(made).shape[0] / 2


def test_what_engines_cannot_group_is_kept(office, whole, tmp_path, slow):
    """Portals alone say nothing of groups."""
    made = viewcell.bake(office, tmp_path / "a", method="portals", budget_s=100.0, threads=1)
    assert kept(made).sum(axis=1).max() == kept(made).shape[1]
    assert (kept(made) >= seen(whole)).all()


def test_with_time_nothing_is_asked_about_pieces(office, tmp_path, monkeypatch):
    """Whole objects take little beside all else."""
    asked, narrow = [], PortalEngine.narrow
    monkeypatch.setattr(PortalEngine, "narrow", lambda *a: asked.append(a[2]) or narrow(*a))
    assert viewcell.bake(office, tmp_path / "a", budget_s=600.0).manifest["budget_spent"] is False
    assert set(asked) == {0}


@pytest.mark.parametrize("made_in_time", [True, False])
def test_what_takes_long_to_prepare_is_made_where_there_is_time(office, tmp_path, monkeypatch, made_in_time):
    """Else strong rectangles hide, and the budget ends with that."""
    Clock(monkeypatch, {False: 5.0, True: 5.0}, ViewCellEngine)
    monkeypatch.setattr(
        PreparedModel, "make_curtains", lambda model, seconds: seconds > (20.0 if made_in_time else 30.0)
    )
    table = tmp_path / "cells.csv"
    table.write_text("min_x,min_y,min_z,max_x,max_y,max_z\n1,1,0.3,2,2,1.3\n3,2.5,0.4,4.5,3.5,1.6\n")
    settings = {"method": "occluders", "cells": str(table)}
    short = viewcell.bake(office, tmp_path / "a", budget_s=100.0, threads=1, **settings)
    assert ("budget" in short.manifest) is not made_in_time
    full = viewcell.bake(office, tmp_path / "b", **settings)
    assert (short.potential_objects >= seen(full)).all()
    assert full.potential_objects.sum() <= short.potential_objects.sum() < 0.7 * short.potential_objects.size


def test_the_first_pieces_are_small():
    blocks = [(0, np.arange(24)), (1, np.arange(24, 48)), (2, np.arange(48, 51))]
    pieces = budget._pieces(blocks, 2)
    assert [(number, len(cells)) for number, cells in pieces] == [(0, 4), (1, 4), (0, 20), (1, 20), (2, 3)]
    assert sorted(np.concatenate([cells for _, cells in pieces])) == list(range(51))


TABLE = "min_x,min_y,min_z,max_x,max_y,max_z\n1,1,0.3,2,2,1.3\n3,2.5,0.4,4.5,3.5,1.6\n"


@pytest.fixture
def from_cells(office, tmp_path):
    """Bakes the office from two view cells, by occluders."""
    table = tmp_path / "cells.csv"
    table.write_text(TABLE)
    return lambda name, **run: viewcell.bake(office, tmp_path / name, method="occluders", cells=str(table), **run)


@pytest.mark.parametrize("lots", [0, 60])
def test_preparing_ends_early_and_every_set_is_sound(from_cells, monkeypatch, lots):
    """With no regions nothing is culled; with some, some is."""
    full = from_cells("full")
    monkeypatch.setattr(rasters, "LOT", 64)
    lots_take(monkeypatch, 50.0 / lots if lots else 200.0)
    made = from_cells("short", budget_s=100.0)
    assert made.manifest["budget"]["phase"] == "preparing" and made.manifest["budget_spent"]
    assert "ended early, while all that hides was prepared" in made.manifest["warnings"][-1]
    assert (kept(made) >= kept(full)).all() and made.verify(rays=100_000).ok
    assert kept(made).all() == (lots == 0)


def test_a_short_preparation_does_not_pass_for_a_bake(from_cells, monkeypatch):
    """The same command with more time gives what it would have given at once."""
    full = from_cells("full")
    with monkeypatch.context() as patch:
        patch.setattr(
            PreparedModel, "make_plainest", lambda model, seconds, make=PreparedModel.make_plainest: make(model, -1.0)
        )
        assert kept(from_cells("again", budget_s=100.0)).all()
    made = from_cells("again")
    assert not made.manifest["budget_spent"] and (kept(made) == kept(full)).all() and (seen(made) == seen(full)).all()


def test_without_time_for_triangles_nothing_is_seen_and_much_is_hidden(from_cells, monkeypatch):
    """What sightlines are tested against is left out where it takes too long: no eyes then, either."""
    full = from_cells("full")
    monkeypatch.setattr(Targets, "make", lambda targets, seconds=np.inf: False)
    made = from_cells("short", budget_s=100.0)
    assert made.manifest["budget"]["phase"] == "preparing" and made.manifest["kept"]["eye"] is None
    assert not seen(made).any() and (kept(made) >= kept(full)).all() and not kept(made).all()


def test_preparing_takes_half_of_a_budget_and_of_the_rest_a_quarter(monkeypatch):
    told, clock = [], iter([0.0, 30.0])
    monkeypatch.setattr(budget, "time", type("stopped", (), {"perf_counter": lambda: next(clock)}))
    engine = type("engine", (), {"begin": told.append, "look": told.append})
    budget.prepare_within(engine, 100.0)
    assert told == [50.0, 17.5]
