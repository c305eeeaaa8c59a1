"""Every engine: blocks depend on nothing but themselves, a part survives a file, what is not reached stays unknown."""

from dataclasses import fields

import numpy as np
import pytest
from builders import small_house
from viewcell.data.prepared import PreparedModel
from viewcell.data.rows import Rows
from viewcell.data.store.blocks import read_block, write_block
from viewcell.data.verdict import Verdict
from viewcell.solvers.visibility import occluders
from viewcell.solvers.visibility.engine import Part, join_objects, unknown_rows
from viewcell.solvers.visibility.graph_engine import GraphEngine
from viewcell.solvers.visibility.portal_engine import PortalEngine
from viewcell.solvers.visibility.projection import VlodSettings
from viewcell.solvers.visibility.view_cell_engine import ViewCellEngine

CELLS = np.array([[[640, 640, 128], [1280, 1280, 640]], [[6144, 640, 128], [6784, 1280, 640]]], np.int32)
VLOD = VlodSettings(clusters=1, objective="centre", resolution=64)
ENGINES = {
    "graph": lambda model, graph: GraphEngine(graph),
    "graph, certified": lambda model, graph: GraphEngine(graph, certify=True),
    "portals": PortalEngine,
    "portals, both": lambda model, graph: PortalEngine(model, graph, method="both"),
    "portals, auto": lambda model, graph: PortalEngine(model, graph, method="auto"),
    "portals, certified": lambda model, graph: PortalEngine(model, graph, certify=True),
    "view cells": lambda model, graph: ViewCellEngine(model, CELLS),
    "view cells, certified": lambda model, graph: ViewCellEngine(model, CELLS, certify=True),
    "view cells, portals too": lambda model, graph: ViewCellEngine(model, CELLS, method="both", portal_graph=graph),
    "view cells, vlod": lambda model, graph: ViewCellEngine(model, CELLS, method="vlod", vlod=VLOD),
}


@pytest.fixture(scope="module")
def house():
    return PreparedModel(small_house.small_scene()), small_house.small_graph()


def sources_of(name, graph):
    return np.arange(len(CELLS)) if name.startswith("view cells") else np.flatnonzero(graph.inhabitable)


def assert_same(a, b):
    for field in fields(Rows):
        np.testing.assert_array_equal(getattr(a, field.name), getattr(b, field.name), err_msg=field.name)


def potential(rows):
    return set(zip(rows.source.tolist(), rows.target.tolist(), strict=True))


@pytest.mark.parametrize("name", ENGINES)
def test_blocks_are_joined_to_the_same_tables(name, house):
    engine = ENGINES[name](*house)
    engine.compile()
    sources = sources_of(name, house[1])
    one, many = (
        engine.join([engine.visible(sources)]),
        engine.join([engine.visible(sources[[k]]) for k in range(len(sources))]),
    )
    assert (one[0] is None) == (many[0] is None) == name.startswith("view cells")
    for whole, joined in zip(one, many, strict=True):
        if whole is not None:
            assert potential(whole) == potential(joined)
            # A graph's pairs may be found from either end, so a witness may be another one.
            if not name.startswith("graph"):
                assert_same(whole, joined)


@pytest.mark.parametrize("name", ENGINES)
def test_without_aim_the_same_is_hidden(name, house):
    engine = ENGINES[name](*house)
    sources = sources_of(name, house[1])
    aimed, quick = (engine.join([engine.visible(sources, aim=aim)]) for aim in (True, False))
    for more, fewer in zip(aimed, quick, strict=True):
        if more is not None:
            assert potential(more) == potential(fewer) and fewer.seen.sum() <= more.seen.sum()


@pytest.mark.parametrize("name", ENGINES)
def test_unknown_keeps_everything_and_claims_nothing(name, house):
    engine = ENGINES[name](*house)
    sources = sources_of(name, house[1])
    cells, objects = engine.join([engine.unknown(sources)])
    count = 0 if name.startswith("graph") else len(house[0].scene.objects)
    assert len(objects) == len(sources) * count and not objects.seen.any()
    assert (cells is None) == name.startswith("view cells")
    if cells is not None:
        assert len(cells) == len(sources) * house[1].cell_count and not cells.seen.any()


@pytest.mark.parametrize("name", ENGINES)
def test_nothing_that_another_engine_sees_is_hidden(name, house):
    """Witnesses were confirmed against all triangles, so whatever one engine saw no other may hide."""
    if name.startswith("graph"):
        pytest.skip("a bare graph has no objects")
    model, graph = house
    engine = ENGINES[name](model, graph)
    sources = sources_of(name, graph)
    _, objects = engine.join([engine.visible(sources)])
    witness = ViewCellEngine(model, CELLS if name.startswith("view cells") else graph.cells, seed=9)
    _, other = witness.join([witness.visible(sources)])
    assert potential(other.take(other.seen)) <= potential(objects)
    assert other.seen.sum() > 10


@pytest.mark.parametrize("name", ["portals, certified", "view cells, certified", "graph, certified"])
def test_a_certified_engine_names_occluders_for_its_proofs(name, house):
    engine = ENGINES[name](*house)
    part = engine.visible(sources_of(name, house[1]))
    blockers, regions, patches = engine.proof_occluders
    assert len(part.proofs.cell) and len(blockers.boxes)
    assert (regions is None) == (patches is None) == name.startswith("graph")
    leaves = part.proofs.leaves[:, 0]
    assert (leaves < (0 if regions is None else len(regions.axis))).all()


@pytest.mark.parametrize("name", ENGINES)
def test_a_part_survives_its_file(name, house, tmp_path):
    part = ENGINES[name](*house).visible(sources_of(name, house[1]))
    write_block(tmp_path / "0.arrow", part.arrays())
    again = Part.of_arrays(read_block(tmp_path / "0.arrow"))
    assert (again.cells is None) == (part.cells is None) and (again.proofs is None) == (part.proofs is None)
    for table in ("cells", "objects", "proofs"):
        one, two = getattr(part, table), getattr(again, table)
        for field in fields(one) if one is not None else ():
            before, after = getattr(one, field.name), getattr(two, field.name)
            np.testing.assert_array_equal(after, before, err_msg=f"{table}.{field.name}")
            assert np.asarray(after).dtype == np.asarray(before).dtype
    assert again.unknown_count == part.unknown_count


def test_unknown_pairs_are_counted():
    objects = unknown_rows(np.array([3, 5]), 4)
    assert objects.source.tolist() == [3] * 4 + [5] * 4 and objects.target.tolist() == [0, 1, 2, 3] * 2
    objects.show(np.array([1, 6]), np.zeros((2, 3)), np.ones((2, 3)))
    assert Part(None, objects).unknown_count == 6 and Part(objects, objects).unknown_count == 12


def test_relabelling_drops_what_has_no_place():
    objects = unknown_rows(np.array([0, 1, 2]), 2)
    part = Part(None, objects).relabelled(np.array([7, -1, 4]))
    assert part.objects.source.tolist() == [7, 7, 4, 4] and part.objects.target.tolist() == [0, 1, 0, 1]
    assert part.cells is None and part.proofs is None


def test_joined_objects_are_ordered():
    parts = [Part(None, unknown_rows(np.array([block]), 3).take(np.array([2, 0, 1]))) for block in (2, 0, 1)]
    rows = join_objects(parts)
    assert rows.source.tolist() == [0] * 3 + [1] * 3 + [2] * 3 and rows.target.tolist() == [0, 1, 2] * 3
    assert (rows.verdict == Verdict.UNKNOWN).all()


@pytest.mark.parametrize("certify", [False, True])
def test_regions_and_patches_are_copied_once(house, monkeypatch, certify):
    """What hides at once hides with curtains beside it, too."""
    made, copy = [], occluders.device_shields
    monkeypatch.setattr(occluders, "device_shields", lambda *args: made.append(args) or copy(*args))
    engine = ViewCellEngine(house[0], CELLS, certify=certify)
    assert engine.begin() and engine.prepare() and engine.prepare()
    assert len(made) == 1 and len(made[0][0].axis)
