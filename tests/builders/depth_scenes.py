"""Boxes around a view cell of two metres in the middle, some near, some far."""

import numpy as np
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
