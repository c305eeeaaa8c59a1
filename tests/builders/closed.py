"""True of any building: shapes are closed and look outwards, and nothing shows from its rooms to the sky."""

from collections import Counter

import numpy as np
import trimesh
from viewcell.data.scene import Role
from viewcell.data.solids import SolidIndex, closed_elements, winding_numbers


def assert_closed(mesh):
    """Every edge has one face on each side, and the faces look outwards."""
    edges = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    there = Counter(map(tuple, edges.tolist()))
    assert set(there.values()) == {1}
    assert all((b, a) in there for a, b in there)
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0


def points_in(space, rng, count):
    """Random points in a room, a few millimetres off its walls, which are rounded [m]."""
    corners = space.vertices[space.faces]
    low, high = space.vertices.min(axis=0), space.vertices.max(axis=0)
    points = rng.uniform(low, high, (4 * count, 3))
    for step in 0.003 * np.vstack([np.zeros(3), np.eye(3), -np.eye(3)]):
        points = points[winding_numbers(points + step, corners) > 0.5][:count]
    return points


def assert_sealed(scene, rooms, rays=600, seed=0):
    """With doors and windows shut, no ray leaves a room for the sky, not even past corners of walls and slabs."""
    rng = np.random.default_rng(seed)
    triangles, owners = scene.triangles()
    mesh = trimesh.Trimesh(
        triangles.reshape(-1, 3) * scene.grid_m, np.arange(3 * len(triangles)).reshape(-1, 3), process=False
    )
    shell = scene.object_mask(Role.OCCLUDER)[owners]
    corners = np.unique(triangles[shell].reshape(-1, 3), axis=0) * scene.grid_m
    for space in rooms:
        eyes = points_in(space, rng, rays)
        near = corners[np.linalg.norm(corners - eyes.mean(axis=0), axis=1).argsort()[:200]]
        ends = near[rng.integers(len(near), size=len(eyes))] + rng.uniform(-0.003, 0.003, (len(eyes), 3))
        for directions in (ends - eyes, rng.normal(size=eyes.shape)):
            out = ~mesh.ray.intersects_any(eyes, directions)
            assert not out.any(), f"{space.name}: {eyes[out][0]} sees the sky towards {directions[out][0]}"


def assert_solid(scene, points):
    """Each of the points [m] lies in a solid: joints between walls leave no slit."""
    points = np.asarray(points) / scene.grid_m
    box = np.array([[points.min(axis=0), points.max(axis=0)]])
    outside = SolidIndex(box, closed_elements(scene)).outside(points, 0)
    assert not outside.any(), (
        f"{outside.sum()} of {len(points)} lie in no solid, such as {points[outside][0] * scene.grid_m}"
    )


def assert_rooms_are_clear(scene, rooms, seed=0):
    """No point of a room lies in a solid."""
    rng = np.random.default_rng(seed)
    solids = closed_elements(scene)
    for space in rooms:
        points = points_in(space, rng, 200) / scene.grid_m
        assert len(points) > 20
        box = np.array([[points.min(axis=0), points.max(axis=0)]])
        assert SolidIndex(box, solids).outside(points, 0).all(), space.name
