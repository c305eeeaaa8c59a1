"""Engines that search little, find no witness or run out of room: they hide nothing more than one with all it needs."""

from dataclasses import replace

import numpy as np
import pytest
from builders import limits, random_buildings, random_solids, small_house
from viewcell.data.buildings.office import make_office
from viewcell.data.graph import CellGraph
from viewcell.data.prepared import PreparedModel
from viewcell.kernels.flood import launch_flood
from viewcell.solvers.visibility import cells as cell_search
from viewcell.solvers.visibility import graph_engine, occluders, search
from viewcell.solvers.visibility.aim import Sights
from viewcell.solvers.visibility.graph_engine import GraphEngine
from viewcell.solvers.visibility.portal_engine import PortalEngine
from viewcell.solvers.visibility.view_cell_engine import ViewCellEngine
from viewcell.workbench.bake.cells import model_sources
from viewcell.workbench.bake.manifest import Clock
from viewcell.workbench.bake.settings import Settings

ENGINES = {
    "graph": lambda model, graph, _: GraphEngine(graph),
    "graph, certified": lambda model, graph, _: GraphEngine(graph, certify=True),
    "portals": lambda model, graph, _: PortalEngine(model, graph),
    "portals, both": lambda model, graph, _: PortalEngine(model, graph, method="both"),
    "portals, certified": lambda model, graph, _: PortalEngine(model, graph, certify=True),
    "view cells": lambda model, _, cells: ViewCellEngine(model, cells),
    "view cells, certified": lambda model, _, cells: ViewCellEngine(model, cells, certify=True),
    "view cells, portals too": lambda model, graph, cells: ViewCellEngine(
        model, cells, method="both", portal_graph=graph
    ),
}


def random_boxes(random, low, high, count, size):
    corners = random.integers(low, high - size, (count, 3))
    return np.stack([corners, corners + random.integers(size // 4, size, (count, 3))], axis=1).astype(np.int32)


def scenes():
    random = np.random.default_rng(0)
    office = make_office(floors=1, rooms_per_side=2)
    for name, scene, size in (("house", small_house.small_scene(), 900), ("office", office, 1200)):
        model = PreparedModel(scene)
        corners = scene.triangles()[0]
        cells = random_boxes(random, corners.min(axis=(0, 1)), corners.max(axis=(0, 1)), 4, size)
        yield name, (model, model_sources(model, Settings(), Clock()).graph, cells)
    solids = random_solids.random_solids(2, axial=8, turned=12)
    yield "solids", (PreparedModel(solids), None, random_boxes(random, -500, 5000, 12, 1200))


@pytest.fixture(scope="module")
def models():
    return dict(scenes())


WORK = [
    (scene, engine)
    for scene in ("house", "office", "solids")
    for engine in ENGINES
    if scene != "solids" or engine in ("view cells", "view cells, certified")
]


def engine_of(work, models):
    return ENGINES[work[1]](*models[work[0]])


def told(engine):
    """Pairs of cells, and of cells and objects, that an engine does not hide; and how many it has no witness of."""
    graph = getattr(engine.model, "graph", None)
    sources = np.arange(len(engine.model.cells)) if graph is None else np.flatnonzero(graph.inhabitable)
    tables = [rows for rows in engine.join([engine.visible(sources)]) if rows is not None]
    pairs = [set(zip(rows.source.tolist(), rows.target.tolist(), strict=True)) for rows in tables]
    return pairs, sum(int((~rows.seen).sum()) for rows in tables)


@pytest.fixture(scope="module")
def known(models):
    return {work: told(engine_of(work, models)) for work in WORK}


@pytest.mark.parametrize("work", WORK, ids=", ".join)
def test_a_witness_is_not_what_keeps_from_hiding(work, known, models, monkeypatch):
    """Without any sightline shot the same is hidden: no proof is wrong that a witness has made good."""
    monkeypatch.setattr(Sights, "aim", lambda *_: None)
    pairs, _ = told(engine_of(work, models))
    assert pairs == known[work][0]


@pytest.mark.parametrize("cap", [1, 2, 5])
@pytest.mark.parametrize("work", WORK, ids=", ".join)
def test_few_lines_hide_nothing_more(work, cap, known, models, monkeypatch):
    for module, name, value in (
        (search, "CAPS", (1, cap)), (cell_search, "GROUP_CAP", cap), (occluders, "NODE_CAP", cap),
        (occluders, "PIECE_CAP", cap), (Sights, "aim", lambda *_: None),
    ):  # fmt: skip
        monkeypatch.setattr(module, name, value)
    monkeypatch.setattr(graph_engine, "launch_flood", lambda *a, **o: launch_flood(*a, **(o | {"cap": cap})))
    engine = engine_of(work, models)
    if "view cells" in work[1]:
        engine.prepare()
        engine.model = replace(engine.model, cap=cap)
    elif "portals" in work[1]:
        engine.__dict__["occluders"] = replace(engine.occluders, cap=cap)
    for few, many in zip(told(engine)[0], known[work][0], strict=True):
        assert few >= many


@pytest.fixture(scope="module")
def graphs():
    """Graphs and what the exact search reaches in them."""
    made = [random_buildings.random_graph(seed, walls=6)[0] for seed in range(6)]
    return [(graph, random_buildings.reached_matrix(graph)) for graph in made]


def hides_what_is_seen(graph: CellGraph, truth, **options):
    engine = GraphEngine(graph, **options)
    rows = engine.join([engine.visible(np.arange(graph.cell_count))])[0]
    found = np.zeros_like(truth)
    found[rows.source, rows.target] = True
    return (truth & ~found).any(), (~rows.seen).sum()


@pytest.mark.parametrize("certify", [False, True])
def test_lists_without_room_hide_nothing(certify, graphs):
    """Floods and searches that cannot decide: what is left open by both is unknown."""
    with limits.limited(LIST_CAPACITY=8, EDGE_CAPACITY=4, MAX_TRIALS=1):
        found = [hides_what_is_seen(graph, truth, certify=certify) for graph, truth in graphs]
    assert not any(wrong for wrong, _ in found) and sum(unknown for _, unknown in found) > 5


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_a_flood_that_ends_early_for_some_hides_nothing(share, graphs, monkeypatch):
    """Of the sources in turn: what their half of the octants reaches is not hidden because others are done."""
    spent = []

    def interrupted(*args, **options):
        found = launch_flood(*args, **options)
        random = np.random.default_rng(len(spent))
        # Those that are given up have found nothing, as if the cap had come first.
        given_up = random.random(len(found.complete)) < share * (len(spent) % 2)
        spent.append(given_up)
        kept = ~given_up[found.pairs[:, 0]]
        found.complete &= ~given_up
        found.pairs, found.line, found.offset = found.pairs[kept], found.line[kept], found.offset[kept]
        return found

    monkeypatch.setattr(graph_engine, "launch_flood", interrupted)
    assert not any(hides_what_is_seen(graph, truth)[0] for graph, truth in graphs)
    assert sum(part.sum() for part in spent) > 10
