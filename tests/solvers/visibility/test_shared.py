"""Witnesses that serve other view cells: each is one by the exact test, and none of what is known changes."""

import numpy as np
import pytest
from builders import random_solids
from viewcell.data.plans import Plans
from viewcell.data.prepared import PreparedModel
from viewcell.data.rows import Rows
from viewcell.data.scene import GRID_M
from viewcell.kernels.launch import CPU
from viewcell.solvers.visibility.aim import Sights
from viewcell.solvers.visibility.shared import _span, share_sightlines
from viewcell.verify.exact.sightline import Sight, Sightlines

# A wall with two sides of a corridor along x; the object at its end, and a screen behind the start.
TARGET, SCREEN = ([20, 0, 0], [21, 2, 2]), ([1, -5, 0], [1.1, 0.5, 3])
CELLS = np.array(
    [
        [[8, 0.1, 0.5], [9, 1.9, 1.5]],  # sees the target
        [[12, 0.1, 0.5], [13, 1.9, 1.5]],  # on the way
        [[4, 0.1, 0.5], [5, 1.9, 1.5]],  # behind, clear
        [[-3, -2, 0.5], [-2, 0.4, 1.5]],  # behind the screen
        [[8, 30, 0.5], [9, 31, 1.5]],  # beside
    ]
)


@pytest.fixture(scope="module")
def model():
    return PreparedModel(random_solids.scene_of_meshes([random_solids.box(*TARGET), random_solids.box(*SCREEN)]))


def steps(metres):
    return np.round(np.asarray(metres, float) / GRID_M)


def known(model, origin, end, cells=CELLS, plans=None):
    cells = steps(cells).astype(np.int32)
    sights = Sights.of(model, cells, 0, CPU, *([plans] if plans else []))
    rows = Rows.unseen(np.arange(len(cells)), np.zeros(len(cells), int))
    rows.show(np.array([0]), steps(origin)[None], steps(end)[None])
    return sights, rows


def test_cells_on_the_line_and_behind_its_start_are_served(model):
    sights, rows = known(model, [8.5, 1.0, 1.0], [20, 1.0, 1.1])
    before = rows.origin[0].copy(), rows.end[0].copy()
    share_sightlines(sights, rows)
    assert rows.seen.tolist() == [True, True, True, False, False]
    assert (rows.origin[0] == before[0]).all() and (rows.end[0] == before[1]).all()
    triangles, owners = model.scene.triangles()
    exact = Sightlines(triangles[owners != 0])
    for row in (1, 2):
        box = steps(CELLS[row])
        assert (rows.origin[row] > box[0]).all() and (rows.origin[row] < box[1]).all()
        assert (rows.origin[row] * 1024 % 1 == 0).all() and (rows.end[row] == before[1]).all()
    assert (exact.check(rows.origin[1:3], rows.end[1:3]) == Sight.CLEAR).all()


def test_a_line_through_something_serves_nobody_behind(model):
    """From the cell behind the screen the line crosses it; without the screen it would serve."""
    origin, end = [8.5, 0.2, 1.0], [20, 0.2, 1.0]
    sights, rows = known(model, origin, end)
    share_sightlines(sights, rows)
    assert not rows.seen[3] and rows.seen[2]
    free = PreparedModel(random_solids.scene_of_meshes([random_solids.box(*TARGET)]))
    sights, rows = known(free, origin, end)
    share_sightlines(sights, rows)
    assert rows.seen.tolist() == [True, True, True, True, False]


def test_eyes_are_outside_solids_and_inside_plans(model):
    sights, rows = known(
        model, [8.5, 1.0, 1.0], [20, 1.0, 1.1], np.array([CELLS[0], [[20.2, 0.1, 0.5], [20.9, 1.9, 1.5]]])
    )
    share_sightlines(sights, rows)
    assert rows.seen.tolist() == [True, False]
    # The line passes the box of this cell, and not its plan.
    box = steps(CELLS[2])
    plan = np.array(
        [[box[0, 0], box[0, 1]], [box[1, 0], box[0, 1]], [box[1, 0], box[0, 1] + 200], [box[0, 0], box[0, 1] + 200]]
    )
    sights, rows = known(
        model, [8.5, 1.0, 1.0], [20, 1.0, 1.1], CELLS[[0, 2]], Plans(np.array([1]), plan[None].astype(np.int32))
    )
    share_sightlines(sights, rows)
    assert rows.seen.tolist() == [True, False]


def test_where_lines_are_inside_boxes():
    boxes = np.array([[[0, 0, 0], [2, 2, 2]]] * 4, float)
    origin = np.array([[-2, 1, 1], [1, 1, 1], [-2, 2, 1], [6, 1, 1]], float)
    way = np.array([[8, 0, 0], [4, 0, 0], [8, 0, 0], [4, 0, 0]], float)
    begin, end = _span(boxes, origin, way).T
    assert begin[0] == 0.25 and end[0] == 0.5
    assert begin[1] == -0.25 and end[1] == 0.25
    assert begin[2] >= end[2]
    assert begin[3] == -1.5 and end[3] == -1.0


def test_nothing_known_nothing_shared(model):
    sights, rows = known(model, [8.5, 1.0, 1.0], [20, 1.0, 1.1])
    none = rows.take(~rows.seen)
    share_sightlines(sights, none)
    assert not none.seen.any()
    share_sightlines(sights, rows.take(rows.seen))
    share_sightlines(sights, rows.take(np.zeros(0, int)))
