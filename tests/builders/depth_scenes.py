"""Boxes around a view cell of two metres in the middle, some near, some far."""

import numpy as np
import trimesh
from viewcell.data.scene import Definition, Instance, Mesh, Role, Scene

from builders.small_house import FACES, UNIT_BOX

CELL = np.array([[-1024, -1024, -1024], [1024, 1024, 1024]])
CULL_BOX = 8 * 1024


def boxes_scene(boxes, roles=None) -> Scene:
    """Closed boxes [m], shape (n, 2, 3)."""
    shapes, objects = [], []
    for number, (low, high) in enumerate(np.asarray(boxes, float)):
        shapes.append(Definition(f"box {number}", (Mesh(low + UNIT_BOX * (high - low), FACES),)))
        role = Role.DETAIL if roles is None else roles[number]
        objects.append(Instance(f"box {number}", "IfcBuildingElementProxy", number, np.eye(4), role))
    return Scene(shapes, objects)


def around(rng, count=30) -> np.ndarray:
    """Boxes of up to 3 m, within 30 m."""
    middles = rng.uniform(-25, 25, (count, 3))
    sizes = rng.uniform(0.2, 3, (count, 3))
    return np.stack([middles - sizes, middles + sizes], axis=1).round(2)


def balls_scene(rng, count=40, spread=25.0) -> Scene:
    """Balls of up to 2 m with four levels each, within so many metres, none about the middle."""
    levels = [trimesh.creation.icosphere(subdivisions=3 - k) for k in range(4)]
    errors = [0.0, 0.02, 0.08, 0.3]
    middles = rng.uniform(-spread, spread, (count, 3))
    middles *= np.maximum(1, 4 / np.linalg.norm(middles, axis=1))[:, None]
    shapes, objects = [], []
    for number, (middle, size) in enumerate(zip(middles, rng.uniform(0.2, 2, count), strict=True)):
        lods = tuple(
            Mesh(
                (middle + size * ball.vertices).astype(np.float32).astype(float),
                ball.faces.astype(np.int32),
                size * error,
            )
            for ball, error in zip(levels, errors, strict=True)
        )
        shapes.append(Definition(f"ball {number}", lods))
        objects.append(Instance(f"ball {number}", "IfcBuildingElementProxy", number, np.eye(4), Role.DETAIL))
    return Scene(shapes, objects)
