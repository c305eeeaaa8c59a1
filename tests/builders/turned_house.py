"""Two rooms at an angle with a door between them, furniture in each; not turned back, so that rooms have prisms."""

import numpy as np
import trimesh
from viewcell.data.scene import Role, Scene, Space
from viewcell.workbench.bake.run import bake
from viewcell.workbench.bake.settings import Settings

from builders import random_solids

YAW_DEG = 20.0
WALLS = [
    ([-0.4, -0.4, 0], [8.6, 0, 3]),
    ([-0.4, 4, 0], [8.6, 4.4, 3]),
    ([-0.4, 0, 0], [0, 4, 3]),
    ([8.2, 0, 0], [8.6, 4, 3]),
    # Between the rooms, beside and over the door.
    ([4, 0, 0], [4.2, 3, 3]),
    ([4, 3.8, 0], [4.2, 4, 3]),
    ([4, 3, 2.1], [4.2, 3.8, 3]),
    ([-0.4, -0.4, -0.2], [8.6, 4.4, 0]),
    ([-0.4, -0.4, 3], [8.6, 4.4, 3.2]),
]
# A chair in sight of the door, a chest beside the wall where no line through the door leads, another chest, and one
# outside, far behind an end wall.
THINGS = [([6, 3.2, 0], [6.5, 3.7, 0.9]), ([4.3, 0.1, 0], [4.6, 0.4, 0.5]), ([0.3, 0.3, 0], [0.8, 0.8, 0.5]),
          ([-7, 1.5, 1], [-6, 2.5, 2])]  # fmt: skip
ROOMS = [([0, 0, 0], [4, 4, 3]), ([4.2, 0, 0], [8.2, 4, 3])]


def upright(mesh, yaw_deg=YAW_DEG):
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(yaw_deg), [0, 0, 1]))
    return mesh


def turned_scene() -> Scene:
    meshes = [upright(random_solids.box(*corners)) for corners in WALLS + THINGS]
    roles = [Role.OCCLUDER] * len(WALLS) + [Role.DETAIL] * len(THINGS)
    scene = random_solids.scene_of_meshes(meshes, roles)
    for n, corners in enumerate(ROOMS):
        room = upright(random_solids.box(*corners))
        scene.spaces.append(Space(f"room {n}", np.array(room.vertices), np.array(room.faces, np.int32)))
    return scene


def turned_bake(folder, **options):
    return bake(turned_scene(), folder, settings=Settings(yaw="0", **options), threads=1)
