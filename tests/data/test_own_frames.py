"""Frames of wings: their rectangles lie in solids of the model, their boxes around objects and view cells."""

import numpy as np
import pytest
import trimesh
from builders import random_solids, turned_house
from viewcell.data.own_frames import find_own_frames
from viewcell.data.plans import NO_PLANS, Plans
from viewcell.data.prepared import PreparedModel
from viewcell.data.scene import GRID_M

YAWS = (3.0, 17.0, 30.0, 44.9, 61.3, 88.0)


def plan(yaw_deg, low, high):
    """Corners of a rectangle [m] that is turned about the origin, on the grid."""
    turn = np.exp(1j * np.radians(yaw_deg))
    corners = [complex(x, y) * turn for x, y in ((low[0], low[1]), (high[0], low[1]), high, (low[0], high[1]))]
    return np.round(np.array([(c.real, c.imag) for c in corners]) / GRID_M).astype(np.int32)


def as_cells(corners):
    """Boxes from floor to 2 m around plans, and the plans."""
    corners = np.array(corners).reshape(-1, 4, 2)
    boxes = np.zeros((len(corners), 2, 3), np.int32)
    boxes[:, 0, :2], boxes[:, 1, :2] = corners.min(axis=1), corners.max(axis=1)
    boxes[:, 1, 2] = round(2 / GRID_M)
    return boxes, Plans(np.arange(len(corners)), corners)


def are_inside(points, triangles):
    """Whether all points have more or fewer than none of a closed surface's triangles above them, with their signs."""
    above = np.zeros(len(points), int)
    for p, q, r in triangles.astype(float):
        sides = [(b - a)[0] * (points - a)[:, 1] - (b - a)[1] * (points - a)[:, 0] for a, b in ((p, q), (q, r), (r, p))]
        over = (np.min(sides, axis=0) > 0) | (np.max(sides, axis=0) < 0)
        normal = np.cross(q - p, r - p)
        if normal[2]:
            height = p[2] - (points - p)[:, :2] @ normal[:2] / normal[2]
            above += np.where(over & (height > points[:, 2]), np.sign(normal[2]).astype(int), 0)
    return (above != 0).all()


def in_model(points, yaw_deg):
    """Points of a frame in the model's own, by complex numbers."""
    plane = (points[:, 0] + 1j * points[:, 1]) * np.exp(1j * np.radians(yaw_deg))
    return np.column_stack([plane.real, plane.imag, points[:, 2]])


def walls_at(yaw_deg, seed):
    """Walls, slabs, and things that are turned otherwise."""
    random = np.random.default_rng(seed)
    meshes = [random_solids.box([0, 0, 0], [5, 0.25, 3]), random_solids.box([4.75, 0.25, 0], [5, 4, 3])]
    meshes += [random_solids.box([-0.5, -0.5, -0.3], [6, 5, 0])]
    for mesh in meshes:
        turned_house.upright(mesh, yaw_deg)
    meshes += [random_solids.placed(trimesh.creation.box(random.uniform(0.3, 2.0, 3)), random) for _ in range(3)]
    meshes += [turned_house.upright(random_solids.box([1, 2, 0], [3, 2.3, 2]), yaw_deg + 0.1 * random.random())]
    return random_solids.scene_of_meshes(meshes)


@pytest.mark.parametrize("yaw", YAWS)
def test_rectangles_lie_in_solids(yaw):
    """With a quarter of a step around them: at random points of each, and at its corners."""
    scene = walls_at(yaw, seed=int(yaw))
    model = PreparedModel(scene)
    (frame,) = find_own_frames(scene, model.large_closed, *as_cells([plan(yaw, (1, 1), (3, 2))]))
    assert abs(frame.yaw_deg - yaw) < 0.02
    random, axes = np.random.default_rng(0), set()
    for box, axis in zip(frame.walls.boxes.astype(float), frame.walls.axis.tolist(), strict=True):
        axes.add(axis)
        corners = [[box[i, 0], box[j, 1], box[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
        points = np.concatenate([random.uniform(box[0], box[1], (12, 3)), corners])
        # What lies in its plane counts on one side of it, and levels are exact.
        middle = box.mean(axis=0)
        points = points + 0.24 * np.sign(points - middle) * [1, 1, 0]
        sides = [-1e-3, 1e-3] if axis == 2 else [0.0]
        lifted = [points + np.array([0, 0, side]) for side in sides]
        if axis != 2:
            inner = np.clip(points[:, 2], box[0, 2] + 1e-3, box[1, 2] - 1e-3)
            lifted = [np.column_stack([points[:, :2], inner])]
        held = [
            any(are_inside(in_model(some, frame.yaw_deg), triangles) for _, triangles in model.closed)
            for some in lifted
        ]
        assert any(held), (yaw, axis, box.tolist())
    assert axes == {0, 1, 2}


@pytest.mark.parametrize("yaw", YAWS)
def test_boxes_are_rounded_outwards(yaw):
    scene = walls_at(yaw, seed=1)
    cells, plans = as_cells([plan(yaw, (1, 1), (3, 2)), plan(yaw, (-2, 1), (3, 4))])
    (frame,) = find_own_frames(scene, [], cells, plans)
    assert sorted(frame.cells.tolist()) == [0, 1]
    for cell, box in zip(frame.cells, frame.boxes, strict=True):
        corners = in_model(np.column_stack([plans.corners[cell], np.zeros(4)]), -frame.yaw_deg)[:, :2]
        assert (corners >= box[0, :2]).all() and (corners <= box[1, :2]).all()
        assert (np.ptp(box[:, :2], axis=0) <= np.ptp(corners, axis=0) + 2).all()
    triangles, owners = scene.triangles()
    random, found = np.random.default_rng(2), frame.occludees
    for triangle, owner in zip(triangles, owners, strict=True):
        points = random.dirichlet(np.ones(3), 8) @ triangle
        points = in_model(np.concatenate([points, triangle]), -frame.yaw_deg)
        own = found.pieces[found.starts[owner] : found.starts[owner + 1]]
        assert (
            ((points[:, None] >= own[:, 0] - 1e-6) & (points[:, None] <= own[:, 1] + 1e-6))
            .all(axis=2)
            .any(axis=1)
            .all()
        )
        low, high = found.bounds[owner]
        assert (points >= low - 1e-6).all() and (points <= high + 1e-6).all()


def test_each_direction_has_its_frame():
    scene = random_solids.scene_of_meshes(
        [turned_house.upright(random_solids.box([0, 0, 0], [5, 0.25, 3]), yaw) for yaw in (10.0, 40.0)]
    )
    lozenge = np.array([[0, 0], [3000, 0], [4500, 1500], [1500, 1500]])
    plans = [plan(40, (0, 0), (3, 1)), plan(10, (0, 0), (2, 1)), lozenge, plan(10, (2, 0), (4, 1))]
    found = find_own_frames(scene, [], *as_cells(plans))
    assert {round(f.yaw_deg, 1): sorted(f.cells.tolist()) for f in found} == {40.0: [0], 10.0: [1, 3]}


def test_plans_along_the_axes_need_none():
    scene = walls_at(17.0, seed=0)
    along = np.array([[0, 0], [3000, 0], [3000, 2000], [0, 2000]])
    (frame,) = find_own_frames(scene, [], *as_cells([along, plan(17.0, (1, 1), (3, 2))]))
    assert frame.cells.tolist() == [1]


def test_without_plans_there_are_no_frames():
    scene = walls_at(17.0, seed=0)
    assert find_own_frames(scene, [], np.zeros((1, 2, 3), np.int32), NO_PLANS) == []


def test_a_model_that_leaves_the_grid_in_the_frame_has_none():
    far = random_solids.box([-16_000, -16_000, 0], [16_000, 16_000, 1])
    scene = random_solids.scene_of_meshes([far])
    assert find_own_frames(scene, [], *as_cells([plan(45.0, (0, 0), (3, 2))])) == []
