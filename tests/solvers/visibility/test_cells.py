"""Cell-to-cell rows: what is hidden is, witnesses are witnesses, and both sides of a pair agree."""

import numpy as np
import pytest
from builders import random_buildings, small_house
from viewcell.data.blockers import find_blockers
from viewcell.data.prepared import PreparedModel
from viewcell.data.scene import OPAQUE
from viewcell.data.verdict import Verdict
from viewcell.kernels.launch import CPU
from viewcell.solvers.visibility import cells as cell_search
from viewcell.solvers.visibility.aim import Sights
from viewcell.solvers.visibility.cells import (
    CellModel,
    accept,
    cell_rows,
    certified_pairs,
    join_cell_rows,
    search_outwards,
    search_pairs,
    strictly_inside,
)
from viewcell.solvers.visibility.graph_engine import GraphEngine
from viewcell.solvers.visibility.ledger import Ledger
from viewcell.verify.exact.sightline import Sight, Sightlines


@pytest.fixture(scope="module")
def house():
    """The small house as a cell model, and its exactly known sets."""
    scene, graph = small_house.small_scene(), small_house.small_graph()
    model = PreparedModel(scene)
    sights = Sights.of(model, graph.cells, 0, CPU)
    return CellModel(graph, model.blockers(graph), sights), scene


@pytest.fixture(scope="module")
def truth(tmp_path_factory):
    return small_house.small_house(tmp_path_factory.mktemp("house")).potential_cells


def test_reached_cells_are_those_of_the_exact_search(house, truth):
    model, scene = house
    sources = np.flatnonzero(model.graph.inhabitable)
    rows = cell_rows(model, sources)
    found = np.zeros_like(truth)
    found[rows.source, rows.target] = True
    np.testing.assert_array_equal(found, truth)
    assert (np.diff(rows.source * 100 + rows.target) > 0).all(), "ordered, each pair once"
    # The pane of glass stops no sightline; walls and desk stop every other.
    clear = Sightlines(*scene.triangles(*OPAQUE)).check(rows.origin[rows.seen], rows.end[rows.seen])
    assert rows.seen.all() and (clear == Sight.CLEAR).all()
    assert strictly_inside(rows.origin, model.graph.cells[rows.source]).all()
    assert strictly_inside(rows.end, model.graph.cells[rows.target]).all()


@pytest.mark.parametrize("seed", range(6))
def test_what_outwards_leaves_out_is_hidden(seed):
    """In any order of the sources; what is asked about gets the same answers as alone."""
    graph, _ = random_buildings.random_graph(seed, walls=6)
    model = CellModel(graph, find_blockers(graph))
    sources = np.arange(graph.cell_count)[::-3]
    pairs, answers = search_outwards(model, sources)
    every = np.array([(s, t) for s in sources for t in range(graph.cell_count) if s != t])
    whole = search_pairs(model, every, None)
    place = {pair: n for n, pair in enumerate(map(tuple, pairs.tolist()))}
    at = np.array([place.get(pair, -1) for pair in map(tuple, every.tolist())])
    assert at[at >= 0].tolist() == list(range(len(pairs))), "ordered as the sources are, each pair once"
    assert (whole.verdict[at < 0] == Verdict.HIDDEN).all() and (at < 0).mean() > 0.05
    for name in ("verdict", "octant", "line", "offset"):
        np.testing.assert_array_equal(getattr(whole, name)[at >= 0], getattr(answers, name))


def test_outwards_asks_beside_what_is_not_hidden(house, monkeypatch):
    """What is not decided leads on: every cell of the house is joined to every other one."""
    model, _ = house

    def undecided(model, pairs, ledger):
        answers = search_pairs(model, pairs, ledger)
        answers.verdict[:] = Verdict.UNKNOWN
        return answers

    monkeypatch.setattr(cell_search, "search_pairs", undecided)
    pairs, _ = search_outwards(model, np.arange(2))
    assert len(pairs) == 2 * (model.graph.cell_count - 1)


def test_nobody_reaches_nothing(house):
    """A block may hold only view cells that stand at an angle, which others look from."""
    assert len(cell_rows(house[0], np.zeros(0, int))) == 0


def test_without_aim_the_same_is_hidden(house):
    model, _ = house
    sources = np.flatnonzero(model.graph.inhabitable)
    aimed, quick = cell_rows(model, sources), cell_rows(model, sources, ())
    np.testing.assert_array_equal(quick.source, aimed.source)
    np.testing.assert_array_equal(quick.target, aimed.target)
    assert not (quick.seen & ~aimed.seen).any()


def test_certificates_hide_no_more_and_name_every_pair(house):
    model, _ = house
    sources = np.flatnonzero(model.graph.inhabitable)
    ledger = Ledger()
    certified, plain = cell_rows(model, sources, (), ledger), cell_rows(model, sources, ())
    pairs, more = (set(zip(rows.source.tolist(), rows.target.tolist(), strict=True)) for rows in (plain, certified))
    assert pairs <= more
    proofs = ledger.close(np.zeros(0, bool))
    count = model.graph.cell_count
    for source, target in {(s, t) for s in sources.tolist() for t in range(count)} - more:
        box = model.graph.cells[target]
        mine = proofs.boxes[proofs.cell == source]
        assert ((mine[:, 0] <= box[0]).all(axis=1) & (mine[:, 1] >= box[1]).all(axis=1)).any(), (source, target)


def test_groups_of_cells_are_asked_about_first(house):
    model, _ = house
    ledger = Ledger()
    pairs = certified_pairs(model, np.array([0]), ledger)
    assert (pairs[:, 0] == 0).all() and 0 not in pairs[:, 1]
    assert len(pairs) + 1 < model.graph.cell_count or not len(ledger.close(np.zeros(0, bool)).cell)


@pytest.mark.parametrize(
    ("origin", "end", "held"),
    [
        ((2000, 600, 500), (2700, 600, 500), True),
        ((2560, 600, 500), (2700, 600, 500), False),
        ((2000, 600, 500), (2560, 600, 500), False),
        ((2000, 1800, 500), (2700, 1800, 500), False),
        ((2000, 320, 500), (2700, 320, 500), False),
    ],
    ids=["through the door", "from the cell's face", "to the cell's face", "through the wall", "along the door's side"],
)
def test_what_is_a_witness(house, origin, end, held):
    """From the hall, cell 0, to the doorway, cell 1."""
    model, _ = house
    ends = np.array([origin], float), np.array([end], float)
    assert accept(model, np.array([0]), np.array([1]), *ends).tolist() == [held]


def test_a_witness_starts_outside_solids():
    """A desk stands in room 2: an eye inside it sees nothing."""
    scene, graph = small_house.small_scene(), small_house.small_graph()
    model = PreparedModel(scene)
    cell = CellModel(graph, model.blockers(graph), Sights.of(model, graph.cells, 0, CPU))
    in_desk, beside = np.array([[63, 35, 4]]) * 64.0, np.array([[63, 28, 4]]) * 64.0
    to = np.array([[63, 20, 4]]) * 64.0
    assert accept(
        cell, np.array([2, 2]), np.array([2, 2]), np.concatenate([in_desk, beside]), np.repeat(to, 2, 0)
    ).tolist() == [False, True]


def test_a_witness_that_would_start_in_a_solid_is_not_borrowed(house):
    """Followed back, a line must be a witness too: of two rows, one seen, the other end lies in the desk."""
    model, _ = house
    rows = cell_rows(model, np.array([2, 4]), ())
    there = np.flatnonzero((rows.source == 4) & (rows.target == 2))[0]
    back = np.flatnonzero((rows.source == 2) & (rows.target == 4))[0]
    for end, borrowed in ((np.array([63, 35, 4]) * 64.0, False), (np.array([63, 28, 4]) * 64.0, True)):
        rows.verdict[back] = Verdict.UNKNOWN
        rows.show(np.array([there]), rows.origin[[there]], end[None])
        joined = join_cell_rows(model, [rows])
        at = np.flatnonzero((joined.source == 2) & (joined.target == 4))[0]
        assert joined.seen[at] == borrowed


def test_joined_rows_are_symmetric():
    """What one side hides is hidden from the other too, and one witness serves both sides."""
    graph, _ = random_buildings.random_graph(0, walls=4)
    engine = GraphEngine(graph)
    part = engine.visible(np.arange(graph.cell_count)).cells
    pairs = np.column_stack([part.source, part.target])
    others = np.flatnonzero((part.source != part.target) & part.seen)
    hidden, unseen = pairs[others[0]].tolist(), pairs[others[-1]].tolist()
    row = int(others[-1])
    part.verdict[row] = Verdict.UNKNOWN
    keep = ~(pairs == hidden).all(axis=1)
    rows = join_cell_rows(engine.model, [part.take(keep)])
    joined = list(zip(rows.source.tolist(), rows.target.tolist(), strict=True))
    assert tuple(hidden) not in joined and tuple(hidden[::-1]) not in joined
    assert len(joined) == len(pairs) - 2
    place, back = joined.index(tuple(unseen)), int(np.flatnonzero((pairs == unseen[::-1]).all(axis=1))[0])
    assert rows.seen[place]
    np.testing.assert_array_equal(rows.origin[place], part.end[back])
    np.testing.assert_array_equal(rows.end[place], part.origin[back])
    portals = rows.portals[rows.portal_starts[place] : rows.portal_starts[place + 1]]
    assert (graph.portal_cells[portals[0]] == unseen[0]).any() and (graph.portal_cells[portals[-1]] == unseen[1]).any()


def test_a_witness_that_is_lost_on_the_way_back_is_not_borrowed(monkeypatch):
    """Rounding may let a line through a corner of a portal one way and not the other."""
    graph, _ = random_buildings.random_graph(0, walls=4)
    engine, trace = GraphEngine(graph), cell_search.launch_trace
    part = engine.visible(np.arange(graph.cell_count)).cells
    row = np.flatnonzero((part.source != part.target) & part.seen)[-1]
    part.verdict[row] = Verdict.UNKNOWN

    def lost(*arguments, record=True, **options):
        reached, *portals = trace(*arguments, record=record, **options)
        return reached if record else np.full_like(reached, -1), *portals

    monkeypatch.setattr(cell_search, "launch_trace", lost)
    rows = join_cell_rows(engine.model, [part])
    at = np.flatnonzero((rows.source == part.source[row]) & (rows.target == part.target[row]))
    assert not rows.seen[at].any() and rows.seen.sum() == part.seen.sum()
