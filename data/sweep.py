"""Objects that move as visibility has them: the box that each sweeps stands for it, and hides nothing.

Whoever sees a moving object at some time sees a point in its box, and looks into the box through its surface, unless
the eye is in the box itself. So an object is potentially visible from a view cell that meets the box, or may see its
surface. It is never shown to be visible: a sightline that meets the box may miss the object at all times.
Source: Funkhouser et al. 1996, section 2.2, has objects that move, but says nothing of how they are precomputed.
"""

from dataclasses import replace
from itertools import product

import numpy as np

from .rows import Rows
from .scene import Definition, Instance, Mesh, Scene

# A box's faces, counter-clockwise from outside; corner k has bit a of k for the high side of axis a.
SIDES = ((0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6))
BOX_FACES = np.array([face for a, b, c, d in SIDES for face in ((a, b, c), (a, c, d))], np.int32)
# Snapping moves a vertex by half a step, evaluating a motion by far less.
MARGIN_STEPS = 1


def moving(scene: Scene) -> np.ndarray:
    """Objects that move, ascending, int64."""
    return np.array([i for i, placed in enumerate(scene.objects) if placed.animation is not None], np.int64)


def still(scene: Scene) -> Scene:
    """The scene in which boxes stand for what moves, under the same object_ids; itself if nothing does.

    Raises:
        InputError: a motion that does not stay within bounds.
    """
    ids = moving(scene)
    if not len(ids):
        return scene
    definitions, objects = [*scene.definitions], [*scene.objects]
    for object_id in ids.tolist():
        placed = objects[object_id]
        objects[object_id] = replace(placed, definition_id=len(definitions), transform=np.eye(4), animation=None)
        definitions.append(_swept(scene, placed, f"object {object_id} {placed.name!r}"))
    return replace(scene, definitions=definitions, objects=objects)


def _swept(scene: Scene, placed: Instance, where: str) -> Definition:
    """The box that holds all levels of an object at all times, on the grid."""
    shape = scene.definitions[placed.definition_id]
    vertices = np.concatenate([mesh.vertices for mesh in shape.lods])
    if not len(vertices):
        return Definition(shape.name, shape.lods[:1])
    low, high = placed.animation.swept_box(vertices, placed.transform, where) / scene.grid_m
    box = np.array([np.floor(low) - MARGIN_STEPS, np.ceil(high) + MARGIN_STEPS]) * scene.grid_m
    corners = np.array([[box[x, 0], box[y, 1], box[z, 2]] for z, y, x in product((0, 1), repeat=3)])
    return Definition(shape.name, (Mesh(corners, BOX_FACES),))


def with_moving(rows: Rows, scene: Scene, ids: np.ndarray, cells: np.ndarray, inhabitable: np.ndarray) -> Rows:
    """Rows of objects in which what moves is visible to nobody for certain, and unknown to all who may be in its box.

    Args:
        rows: of the scene in which boxes stand for what moves.
        scene: that one.
        ids: objects that move.
        cells: boxes around all cells [grid steps], shape (cells, 2, 3).
        inhabitable: cells that are view cells, shape (cells,), bool.
    """
    boxes = scene.object_bounds()[ids]
    meets = (cells[:, None, 0] <= boxes[None, :, 1]).all(axis=2) & (cells[:, None, 1] >= boxes[None, :, 0]).all(axis=2)
    cell, number = np.nonzero(meets & inhabitable[:, None])
    kept = rows.take(~np.isin(rows.target, ids))
    seen = rows.take(np.isin(rows.target, ids))
    every = Rows.unseen(np.append(seen.source, cell), np.append(seen.target, ids[number])).order().once()
    return Rows.join([kept, every]).order()
