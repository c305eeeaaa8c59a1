"""Coarse steps: each hides part of what the next one hides, never anything visible."""

import numpy as np
import pytest
import trimesh
from builders import random_solids
from viewcell.data.blockers import Blockers, strong_blockers
from viewcell.data.buildings.office import make_office
from viewcell.data.prepared import PreparedModel
from viewcell.data.rows import Rows
from viewcell.kernels.launch import CPU
from viewcell.solvers.visibility import coarse
from viewcell.solvers.visibility.aim import Sights
from viewcell.solvers.visibility.coarse import WHOLLY, left_by_nodes, narrowed, steps_below
from viewcell.solvers.visibility.occluders import OccluderModel, seen_objects
from viewcell.solvers.visibility.view_cell_engine import ViewCellEngine
from viewcell.workbench.bench.scaling import cells_in_spaces


@pytest.fixture(scope="module")
def models():
    """Strong occluders of an office and all of them, from view cells of 1 m to 2 m."""
    scene = make_office(floors=2, rooms_per_side=3)
    cells = np.round(cells_in_spaces(scene, 24) / scene.grid_m).astype(np.int32)
    sights = Sights.of(PreparedModel(scene), cells, 0, CPU)
    return OccluderModel.of(sights, rough=True), OccluderModel.of(sights)


@pytest.fixture(scope="module")
def every(models):
    return np.arange(len(models[0].cells))


@pytest.fixture(scope="module")
def seen(models, every):
    """What is seen for certain."""
    rows, _ = seen_objects(models[1], every)
    return pairs(rows.take(rows.seen))


def pairs(rows):
    return set(zip(rows.source.tolist(), rows.target.tolist(), strict=True))


def test_every_step_hides_more_and_nothing_that_is_seen(models, every, seen):
    rows = left_by_nodes(models[0], every, every)
    everything, left = len(every) * len(models[0].occludees.bounds), [pairs(rows)]
    for step in range(len(steps_below(models[0]))):
        rows = narrowed(*models, rows, step)
        left.append(pairs(rows))
    assert left[0] > left[1] > left[2] > left[3] > seen
    assert len(left[0]) < 0.7 * everything and len(left[3]) < 1.3 * len(seen)


def test_a_group_keeps_what_any_of_its_cells_may_see(models, every, seen):
    group = every // 5
    rows = left_by_nodes(models[0], every[::-1], group[::-1])
    alone = pairs(left_by_nodes(models[0], every, every))
    together = pairs(rows)
    assert together > alone
    for mine in range(group.max() + 1):
        sets = [{target for source, target in together if source == cell} for cell in np.flatnonzero(group == mine)]
        assert all(found == sets[0] for found in sets)


def test_levels_between_hide_in_one_go_what_is_below(models, every, monkeypatch):
    """Level by level from the root, or the objects alone: the boxes of objects have the last word."""
    found = []
    for level, step in ((1, 1), (3, 2), (20, 1)):
        monkeypatch.setattr(coarse, "LEVEL", level)
        monkeypatch.setattr(coarse, "STEP", step)
        rows = left_by_nodes(models[0], every, every)
        for place in range(len(steps_below(models[0])) - 2):
            rows = narrowed(*models, rows, place)
        found.append(pairs(rows))
    assert len(found[0] ^ found[2]) <= 0.01 * len(found[2]) and len(found[1] ^ found[2]) <= 0.01 * len(found[2])


def test_what_is_seen_is_not_asked_about(models, every, monkeypatch):
    rows = left_by_nodes(models[0], every, every)
    rows.show(np.arange(len(rows)), rows.origin, rows.end)
    asked = []
    monkeypatch.setattr(
        coarse, "boxes_left", lambda model, source, boxes: asked.extend(source) or np.zeros(len(source), bool)
    )
    for step in range(len(steps_below(models[0])) - 1):
        assert pairs(narrowed(*models, rows, step)) == pairs(rows) and not asked


@pytest.fixture(scope="module")
def oblique():
    """A scene of a wall at an angle and a box behind it, a view cell before it, and sights."""
    wall, ball = random_solids.box([0, -9, -9], [0.5, 9, 9]), random_solids.box([9, -0.5, -0.5], [10, 0.5, 0.5])
    turn = trimesh.transformations.rotation_matrix(0.6, [0, 0, 1])
    eye = trimesh.transform_points([[-4.0, 0, 0]], turn)[0]
    scene = random_solids.scene_of_meshes([mesh.apply_transform(turn) for mesh in (wall, ball)])
    cells = np.round(np.array([[eye - 0.2, eye + 0.2]]) / scene.grid_m).astype(np.int32)
    return scene, cells, Sights.of(PreparedModel(scene), cells, 0, CPU)


def test_the_last_step_knows_oblique_walls(oblique, monkeypatch):
    """Strong rectangles do not hide what is behind the wall, all occluders do."""
    rough, whole = OccluderModel.of(oblique[2], rough=True), OccluderModel.of(oblique[2])
    both, last = Rows.unseen([0, 0], [0, 1]), steps_below(rough).index(WHOLLY)
    assert narrowed(rough, whole, both, last - 1).target.tolist() == [0, 1]
    asked, work = [], coarse.pieces_left
    monkeypatch.setattr(coarse, "pieces_left", lambda model, rows: asked.append(model) or work(model, rows))
    assert narrowed(rough, whole, both, last).target.tolist() == [0] and asked[0] is whole


def test_an_object_without_triangles_is_in_no_node():
    nothing = trimesh.Trimesh(np.zeros((0, 3)), np.zeros((0, 3), int))
    scene = random_solids.scene_of_meshes([random_solids.box([0, 0, 0], [1, 1, 1]), nothing])
    cells = np.array([[[4096, 4096, 4096], [5120, 5120, 5120]]], np.int32)
    model = OccluderModel.of(Sights.of(PreparedModel(scene), cells, 0, CPU), rough=True)
    assert left_by_nodes(model, np.array([0]), np.array([0])).target.tolist() == [0]
    assert narrowed(model, model, Rows.unseen([0, 0], [0, 1]), 0).target.tolist() == [0]


def test_strong_rectangles_are_nowhere_narrow():
    boxes = np.array([[[0, 0, 0], [0, 10, 30]], [[0, 0, 5], [9, 40, 5]], [[0, 0, 5], [20, 40, 5]]], np.int32)
    strong = strong_blockers(Blockers(boxes, np.array([0, 2, 2], np.int32)), 10)
    assert strong.boxes.tolist() == boxes[[0, 2]].tolist() and strong.axis.tolist() == [0, 2]


def test_an_engine_that_is_not_prepared_is_as_tight(oblique):
    """What takes long is made by whoever needs it first."""
    scene, cells, _ = oblique
    engine = ViewCellEngine(PreparedModel(scene), cells)
    assert not engine.prepare(0.0)
    assert engine.visible(np.array([0])).objects.target.tolist() == [0] and engine.prepare(0.0)
