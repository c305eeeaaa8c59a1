"""A budget: something sound for every view cell first, from coarse to fine."""

import numpy as np
import pytest
import viewcell
from builders.clocks import Clock
from viewcell.data.buildings.office import make_office
from viewcell.solvers.visibility.portal_engine import PortalEngine
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
    """Time ends after them: what one cell of a group keeps, all others of it keep."""
    hide, groups = budget._Coarse._hide, []

    def first_only(self, group, rate, worth):
        if not groups:
            hide(self, group, rate, worth)
            for mine in range(group.max() + 1):
                assert len(np.unique(self.kept[group == mine], axis=0)) == 1
        groups.append(group)

    monkeypatch.setattr(budget, "GROUP", 3)
    monkeypatch.setattr(budget._Coarse, "_hide", first_only)
    made = viewcell.bake(office, tmp_path / "a", budget_s=100.0, threads=1)
    assert 1 < groups[0].max() + 1 < len(groups[0])
    assert (kept(made) >= seen(whole)).all()
    assert kept(whole).sum() < kept(made).sum() < kept(made).size


def test_occluders_are_not_asked_where_they_are_slow(office, tmp_path, slow, monkeypatch):
    """An ask takes longer than hiding from a cell, whether of a group or of a cell: a few are tried, and no more."""
    asked, coarse = [], PortalEngine.coarse

    def timed(engine, cells, group, known):
        slow.now += 4.0 * len(cells)
        asked.append(len(cells))
        return coarse(engine, cells, group, known)

    slow.seconds |= {False: 6.0, True: 6.0}
    monkeypatch.setattr(PortalEngine, "coarse", timed)
    monkeypatch.setattr(budget, "GROUP", 3)
    made = viewcell.bake(office, tmp_path / "a", budget_s=50.0, threads=1)
    assert len(asked) == 3 and slow.calls.count(False) >= 2
    assert kept(made).sum(axis=1).max() == kept(made).shape[1]


def test_what_engines_cannot_group_is_kept(office, whole, tmp_path, slow):
    """Portals alone say nothing of groups."""
    made = viewcell.bake(office, tmp_path / "a", method="portals", budget_s=100.0, threads=1)
    assert kept(made).sum(axis=1).max() == kept(made).shape[1]
    assert (kept(made) >= seen(whole)).all()


def test_an_engine_with_time_asks_no_groups(office, tmp_path, monkeypatch):
    asked, coarse = [], PortalEngine.coarse
    monkeypatch.setattr(PortalEngine, "coarse", lambda *a: asked.append(a[1:3]) or coarse(*a))
    assert viewcell.bake(office, tmp_path / "a", budget_s=600.0).manifest["budget_spent"] is False
    assert [(len(cells), len(group)) for cells, group in asked] == [(1, 1)]


def test_the_first_pieces_are_small():
    blocks = [(0, np.arange(24)), (1, np.arange(24, 48)), (2, np.arange(48, 51))]
    pieces = budget._pieces(blocks, 2)
    assert [(number, len(cells)) for number, cells in pieces] == [(0, 4), (1, 4), (0, 20), (1, 20), (2, 3)]
    assert sorted(np.concatenate([cells for _, cells in pieces])) == list(range(51))
