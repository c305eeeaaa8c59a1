"""Random scenes of closed solids in any position, some of them furniture."""

import numpy as np
import trimesh
from viewcell.data.patches import find_patches
from viewcell.data.prepared import PreparedModel
from viewcell.data.scene import GRID_M, Definition, Instance, Mesh, Role, Scene
from viewcell.kernels.shields import device_shields


def scene_of_meshes(meshes, roles=None):
    """A scene of trimesh meshes [m], one object each."""
    snapped = [(np.round(mesh.vertices / GRID_M) * GRID_M, mesh.faces.astype(np.int32)) for mesh in meshes]
    definitions = [Definition(f"d{i}", (Mesh(*mesh),)) for i, mesh in enumerate(snapped)]
    roles = roles or [Role.OCCLUDER] * len(meshes)
    objects = [Instance(f"o{i}", "Thing", i, np.eye(4), role) for i, role in enumerate(roles)]
    return Scene(definitions, objects)


def box(low, high):
    """An axial box [m]."""
    low, high = np.array(low, float), np.array(high, float)
    mesh = trimesh.creation.box(high - low)
    mesh.apply_translation((low + high) / 2)
    return mesh


def placed(mesh, random, spread=4.0):
    """A mesh turned and moved at random."""
    mesh = mesh.copy()
    mesh.apply_transform(trimesh.transformations.random_rotation_matrix(random.random(3)))
    mesh.apply_translation(random.uniform(0.0, spread, 3))
    return mesh


def random_solids(seed, axial=5, turned=3):
    """Axial boxes that touch and overlap, turned boxes, prisms, cylinders; some of them furniture."""
    random = np.random.default_rng(seed)
    meshes = []
    for _ in range(axial):
        low = random.integers(0, 12, 3) * 0.25
        meshes.append(box(low, low + random.integers(1, 12, 3) * 0.25))
    for _ in range(turned):
        kind = random.integers(3)
        if kind == 0:
            meshes.append(placed(trimesh.creation.box(random.uniform(0.2, 2.0, 3)), random))
        elif kind == 1:
            meshes.append(
                placed(trimesh.creation.cylinder(random.uniform(0.2, 0.8), random.uniform(0.5, 2.0), 8), random)
            )
        else:
            # A wall that is turned about the vertical: its top and bottom are axial.
            wall = trimesh.creation.box([random.uniform(1.0, 3.0), 0.2, 2.0])
            wall.apply_transform(trimesh.transformations.rotation_matrix(random.uniform(0, np.pi), [0, 0, 1]))
            wall.apply_translation(random.uniform(0.0, 4.0, 3))
            meshes.append(wall)
    roles = [Role.DETAIL if random.random() < 0.3 else Role.OCCLUDER for _ in meshes]
    return scene_of_meshes(meshes, roles)


def shields_of(scene):
    """Shields, regions and patches; patches however small."""
    regions, patches = PreparedModel(scene).regions, find_patches(*scene.triangles(), least_area=100.0)
    return device_shields(regions, patches), regions, patches
