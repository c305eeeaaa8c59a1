"""The exported house with balls of three levels: shared, mirrored, and one with a shape of its own at one level."""

import numpy as np
import trimesh
from viewcell.data.scene import Definition, Instance, Mesh, Role

from builders.exported_house import exported_scene

# Places [m] in the file's frame, the first two in rooms.
BALLS = ([1.5, 1.0, 0.5], [5.0, 1.0, 0.5], [3.2, 0.6, 0.7])


def ball(level, error_m, radius=0.25):
    """A sphere as an item has it: float32 vertices."""
    sphere = trimesh.creation.icosphere(subdivisions=level, radius=radius)
    vertices = np.asarray(sphere.vertices, np.float32).astype(float)
    return Mesh(vertices, np.asarray(sphere.faces, np.int32), error_m)


def packed_scene():
    scene = exported_scene()
    levels = tuple(ball(2 - lod, error_m) for lod, error_m in enumerate((0.0, 1e-5, 2e-5)))
    scene.definitions.append(Definition("ball", levels))
    first = len(scene.objects)
    for number, place in enumerate(BALLS):
        transform = np.diag([1.0, 1.0, -1.0 if number == 1 else 1.0, 1.0])
        transform[:3, 3] = place
        definition_id = len(scene.definitions) - 1
        scene.objects.append(Instance(f"ball {number}", "IfcFurniture", definition_id, transform, Role.DETAIL))
    return scene.with_own_geometry(first, {1: ball(1, 1.5e-5, 0.2495)})
