"""Pieces of objects and the hierarchy over them: together they hold every triangle."""

import numpy as np
import pytest
import trimesh
from builders import random_solids
from viewcell.data.buildings.prisms import prism
from viewcell.data.occludees import find_occludees
from viewcell.data.scene import GRID_M, Scene


def alike(seed):
    """Long oblique objects, copies of them that are moved, and some of which one corner is moved."""
    random = np.random.default_rng(seed)
    meshes = []
    for _ in range(3):
        mesh = random_solids.placed(trimesh.creation.box(random.uniform(0.2, 6.0, 3)), random)
        for corner in (None, None, 0, 3, 7):
            copy = mesh.copy()
            if corner is not None:
                copy.vertices[corner] += random.uniform(-3, 3, 3)
            copy.apply_translation(random.integers(-9, 9, 3))
            meshes.append(copy)
    return random_solids.scene_of_meshes(meshes)


def chamfered(seed):
    """Oblique walls whose corners are cut by a few grid steps: one vertex there does not hold the other."""
    random = np.random.default_rng(seed)
    meshes = []
    for _ in range(8):
        corners = random.uniform(0.2, 6.0, 2) * [(-1, -1), (1, -1), (1, 1), (-1, 1)]
        ways = np.array([(1, 0), (0, 1), (-1, 0), (0, -1)])
        cut = random.integers(1, 5, (4, 1)) * GRID_M
        # The outline comes up to each corner along one side and leaves it along the next.
        plan = np.stack([corners - cut * np.roll(ways, 1, axis=0), corners + cut * ways], axis=1).reshape(-1, 2)
        angle = np.radians(random.uniform(5, 85))
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        meshes.append(prism(plan @ turn, [], 0.0, 2.0))
    return random_solids.scene_of_meshes(meshes)


MADE = {
    "mixed": lambda seed: random_solids.random_solids(seed, axial=4, turned=6),
    "alike": alike,
    "chamfered": chamfered,
}


@pytest.mark.parametrize("kind", list(MADE))
@pytest.mark.parametrize("seed", range(4))
def test_every_point_of_an_object_lies_in_a_piece_of_it(seed, kind):
    scene = MADE[kind](seed)
    random = np.random.default_rng(seed)
    found = find_occludees(scene)
    triangles, owners = scene.triangles()
    weights = random.dirichlet([1, 1, 1], (len(triangles), 40))
    weights[:, :3] = np.eye(3)
    points = np.einsum("mkc,mcx->mkx", weights, triangles.astype(float))
    for object_id in range(len(scene.objects)):
        rows = np.arange(found.starts[object_id], found.starts[object_id + 1])
        pieces, mine = found.pieces[rows], points[owners == object_id].reshape(-1, 3)
        inside = (mine[:, None] >= pieces[:, 0] - 1e-6) & (mine[:, None] <= pieces[:, 1] + 1e-6)
        inside = inside.all(axis=2)
        plans = dict(zip(found.plans.rows.tolist(), found.plans.corners.astype(float), strict=True))
        for column, row in enumerate(rows.tolist()):
            if row in plans:
                rest = mine[:, None, :2] - plans[row]
                along = np.roll(plans[row], -1, axis=0) - plans[row]
                turn = along[:, 0] * rest[:, :, 1] - along[:, 1] * rest[:, :, 0]
                inside[:, column] &= (turn >= -1e-6 * np.abs(along).sum(axis=1)).all(axis=1)
            else:
                assert (pieces[column, 0] >= found.bounds[object_id, 0]).all()
                assert (pieces[column, 1] <= found.bounds[object_id, 1]).all()
        assert inside.any(axis=1).all()


def test_an_oblique_wall_does_not_fill_its_box():
    wall = random_solids.box([0, 0, 0], [4, 0.1, 2])
    angle = np.pi / 4
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    wall.apply_transform(turn)
    found = find_occludees(random_solids.scene_of_meshes([wall]))
    size = (found.pieces[:, 1] - found.pieces[:, 0]).astype(float).prod(axis=1).sum()
    assert size < 0.4 * np.prod((found.bounds[0, 1] - found.bounds[0, 0]).astype(float))


def test_a_node_holds_its_children_and_every_object_has_one_leaf():
    scene = random_solids.random_solids(1, axial=9, turned=4)
    found = find_occludees(scene)
    assert sorted(found.objects[found.objects >= 0]) == list(range(len(scene.objects)))
    leaves = found.levels[-1][found.objects >= 0]
    np.testing.assert_array_equal(leaves, found.bounds[found.objects[found.objects >= 0]])
    for above, below in zip(found.levels[:-1], found.levels[1:], strict=True):
        families = below.reshape(-1, 2, 2, 3)
        np.testing.assert_array_equal(above[:, 0], families[:, :, 0].min(axis=1))
        np.testing.assert_array_equal(above[:, 1], families[:, :, 1].max(axis=1))


def test_objects_without_triangles_have_no_leaf():
    scene = random_solids.random_solids(2, axial=2, turned=0)
    empty = Scene(scene.definitions, scene.objects)
    empty.definitions[0].lods[0].faces.resize((0, 3), refcheck=False)
    found = find_occludees(empty)
    assert found.objects[found.objects >= 0].tolist() == [1]
    assert found.starts.tolist() == [0, 0, len(found.pieces)]
