"""Cells over walkways hold the eyes of all who walk, none far from a middle, and none stand where nobody goes."""

import numpy as np
import pytest
import trimesh
from builders import random_solids
from viewcell.data.errors import InputError
from viewcell.data.patience import OutOfTime, within
from viewcell.data.prepared import PreparedModel
from viewcell.data.scene import Mesh, Space
from viewcell.data.walkways import REACH_M, walkway_cells


def model_of(*boxes, turned=()):
    """A model of boxes [m], some of them with their faces turned inwards."""
    meshes = [random_solids.box(*box) for box in boxes]
    for k in turned:
        meshes[k].faces[:] = meshes[k].faces[:, ::-1]
    return PreparedModel(random_solids.scene_of_meshes(meshes))


SLAB = ([0, 0, -0.25], [8, 6, 0])


def boxes_of(model):
    """Cells [m]."""
    return walkway_cells(model) * model.scene.grid_m


def holding(cells, eye):
    return ((cells[:, 0] <= eye) & (eye <= cells[:, 1])).all(axis=1)


@pytest.mark.parametrize("turned", [(), (0,)])
def test_every_eye_on_a_floor_is_near_the_middle_of_a_cell(turned):
    cells = boxes_of(model_of(SLAB, turned=turned))
    assert np.linalg.norm(np.diff(cells, axis=1), axis=2).max() <= 2 * REACH_M
    rng = np.random.default_rng(0)
    for x, y in rng.uniform([0.2, 0.2], [7.8, 5.8], (200, 2)):
        held = holding(cells, [x, y, 1.6])
        assert held.any()
        assert np.linalg.norm(cells[held].mean(axis=1) - [x, y, 1.6], axis=1).min() <= REACH_M
    assert np.allclose(cells.mean(axis=1)[:, 2], 1.6, atol=2e-3)


def test_the_underside_of_a_slab_is_no_floor():
    """A room under a slab of 3 m: nobody walks inside it, or below the lowest floor."""
    assert np.allclose(boxes_of(model_of(([0, 0, -3], [8, 6, 0]))).mean(axis=1)[:, 2], 1.6, atol=2e-3)


def test_under_a_low_ceiling_nobody_walks():
    ceiling = ([0, 0, 1.8], [4, 6, 2.0])
    cells = boxes_of(model_of(SLAB, ceiling))
    assert not holding(cells, [2, 3, 1.6]).any() and holding(cells, [6, 3, 1.6]).any()
    assert holding(cells, [2, 3, 3.6]).any(), "on the ceiling one may"


def test_stairs_are_walked_and_tables_are_not():
    steps = [([2 + 0.3 * k, 0, 0], [2.3 + 0.3 * k, 1.2, 0.18 * (k + 1)]) for k in range(10)]
    table = ([4, 4, 0], [6, 6, 0.75])
    cells = boxes_of(model_of(SLAB, table, *steps))
    for k in range(10):
        assert holding(cells, [2.15 + 0.3 * k, 0.6, 0.18 * (k + 1) + 1.6]).any()
    assert not holding(cells, [5, 5, 2.35]).any()
    assert holding(cells, [3.5, 3.5, 1.6]).any()


def test_a_ramp_is_walked_and_a_steep_one_is_not():
    solids = []
    for y, height in ((0.0, 2.0), (3.0, 6.0)):
        hull = trimesh.convex.convex_hull(
            [[x, side, z] for x, z in ((8, 0), (12, 0), (12, 1)) for side in (y, y + 2)] * np.array([1, 1, height])
        )
        solids.append(Mesh(np.asarray(hull.vertices), np.asarray(hull.faces, np.int32), 0.0))
    model = PreparedModel(random_solids.scene_of_meshes([random_solids.box(*SLAB), *solids]))
    cells = boxes_of(model)
    assert holding(cells, [10.0, 1.0, 1.0 + 1.6]).any()
    assert not holding(cells, [10.0, 4.0, 3.0 + 1.6]).any()


def test_where_there_are_rooms_only_they_are_walked():
    model = model_of(SLAB)
    room = random_solids.box([0, 0, 0], [2.4, 6, 3])
    model.scene.spaces.append(Space("room", room.vertices, room.faces))
    cells = boxes_of(model)
    assert holding(cells, [1, 3, 1.6]).any() and not holding(cells, [6, 3, 1.6]).any()


def test_without_a_floor_it_says_so():
    with pytest.raises(InputError, match=r"expected a floor of at least 5 m2 with 1\.9 m above it, found none"):
        walkway_cells(model_of(([0, 0, 0], [1, 1, 1])))


def test_too_many_cells_are_refused(monkeypatch):
    monkeypatch.setattr("viewcell.data.walkways.CELLS_MOST", 10)
    with pytest.raises(InputError, match="expected at most 10 cells, found"):
        walkway_cells(model_of(SLAB))


def test_floors_are_looked_at_while_there_is_time():
    model = model_of(SLAB)
    assert len(walkway_cells(model))
    with within(0.0), pytest.raises(OutOfTime):
        walkway_cells(model)
