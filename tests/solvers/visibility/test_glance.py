"""What a look around shows is seen, by the exact test, and depends on nothing but the view cell."""

import numpy as np
import pytest
from builders import random_solids
from viewcell.data.plans import Plans
from viewcell.data.prepared import PreparedModel
from viewcell.data.rows import Rows
from viewcell.data.scene import Role
from viewcell.kernels.launch import CPU, Device
from viewcell.solvers.visibility.aim import Sights
from viewcell.solvers.visibility.glance import SECOND, glance, look_around
from viewcell.verify.exact.sightline import Sight, Sightlines


@pytest.fixture(scope="module")
def model():
    """A closed box with a chest, a pane and a post in it, and a tower outside."""
    shell = [([0, 0, z], [8, 6, z + 0.2]) for z in (-0.2, 3)]
    shell += [([-0.2, -0.2, 0], [0, 6.2, 3]), ([8, -0.2, 0], [8.2, 6.2, 3])]
    shell += [([0, -0.2, 0], [8, 0, 3]), ([0, 6, 0], [8, 6.2, 3])]
    things = [([6, 4, 0], [7, 5, 1]), ([4, 1, 0], [4.05, 5, 3]), ([3, 3, 0], [3.3, 3.3, 3]), ([20, 0, 0], [22, 2, 9])]
    roles = [Role.OCCLUDER] * 6 + [Role.DETAIL, Role.TRANSPARENT, Role.DETAIL, Role.OCCLUDER]
    meshes = [random_solids.box(*corners) for corners in shell + things]
    return PreparedModel(random_solids.scene_of_meshes(meshes, roles))


def sights(model, device=CPU, plans=None):
    # In the room, in the room and the post, and in the tower.
    cells = np.array([[[0.5, 0.5, 0.5], [2, 2, 2]], [[2.5, 2.5, 0.5], [3.5, 3.5, 2]], [[20.2, 0.2, 1], [21, 1, 2]]])
    steps = np.round(cells / model.scene.grid_m).astype(np.int32)
    return Sights.of(model, steps, 3, device, *([plans(steps)] if plans else []))


def test_what_is_met_is_seen(model):
    view = sights(model)
    rows = Rows.join([look_around(view, np.arange(3), number) for number in range(8)]).order().once()
    # All of the room but the pane, which no ray meets; nothing from inside the tower.
    check(view, rows, [(cell, thing) for cell in (0, 1) for thing in (0, 1, 2, 3, 4, 5, 6, 8)])


def test_what_is_aimed_at_is_seen_if_nothing_is_before_it(model):
    """The pane as well; and the same whichever view cells are asked about together, in any order."""
    view = sights(model)
    rows = glance(view, np.array([2, 0, 1]), SECOND)
    check(view, rows, [(cell, thing) for cell in (0, 1) for thing in range(9)])
    alone = glance(view, np.array([1]), SECOND)
    assert (rows.origin[9:] == alone.origin).all() and (rows.end[9:] == alone.end).all()


def check(view, rows, expected):
    """The pairs, ordered, each with a witness that the exact test allows."""
    assert list(zip(rows.source.tolist(), rows.target.tolist(), strict=True)) == expected and rows.seen.all()
    model = view.model
    triangles, owners = model.scene.triangles()
    for row in range(len(rows)):
        box, own = view.cells[rows.source[row]], owners == rows.target[row]
        assert ((rows.origin[row] > box[0]) & (rows.origin[row] < box[1])).all()
        start, beyond = rows.origin[[row]], rows.origin[[row]] + 1.001 * (rows.end[[row]] - rows.origin[[row]])
        assert Sightlines(triangles[~own & (owners != 7)]).check(start, rows.end[[row]]) == Sight.CLEAR
        assert Sightlines(triangles[own]).check(start, beyond) != Sight.CLEAR
    assert view.outside(rows.source, rows.origin).all()


def test_cells_threads_and_company_change_nothing(model):
    whole = look_around(sights(model), np.arange(3), 2)
    alone = [look_around(sights(model, Device(threads=2)), np.array([cell]), 2) for cell in range(3)]
    for name in ("source", "target", "origin", "end"):
        parts = np.concatenate([getattr(rows, name) for rows in alone])
        np.testing.assert_array_equal(getattr(whole, name), parts, err_msg=name)


def test_each_look_shoots_other_rays(model):
    first, second = (look_around(sights(model), np.arange(2), number) for number in (0, 1))
    assert not (first.origin[:8] == second.origin[:8]).any()


def test_eyes_are_inside_the_plan_of_a_prism(model):
    def half(cells):
        low, high = cells[0, :, :2]
        corners = np.array([[low, [high[0], low[1]], [low[0] + 9, high[1]], [low[0], high[1]]]])
        return Plans(np.array([0]), corners.astype(np.int32))

    rows = look_around(sights(model, plans=half), np.array([0]), 0)
    cell = sights(model).cells[0].astype(float)
    share = (rows.origin[:, :2] - cell[0, :2]) / (cell[1, :2] - cell[0, :2])
    assert len(rows) > 4 and (share.sum(axis=1) < 1.1).all()
