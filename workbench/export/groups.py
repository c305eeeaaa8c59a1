"""Objects that are potentially visible from the same view cells, and go together."""

from dataclasses import dataclass

import numpy as np

from ...data.ragged import starts_of
from ...data.scene import Scene
from .sets import ViewSets


@dataclass(frozen=True)
class Groups:
    """Objects by the view cells that may see them.

    Attributes:
        objects: ids of each group, ascending.
        boxes: around each group [grid steps], a step wider than its snapped vertices, shape (groups, 2, 3), int64.
        of_cells: groups that each row of the sets may see, ascending.
    """

    objects: list[np.ndarray]
    boxes: np.ndarray
    of_cells: list[list[int]]


def group_objects(scene: Scene, sets: ViewSets, rows: np.ndarray) -> Groups:
    """Groups of the objects that have faces.

    Args:
        scene: the model.
        sets: what may be visible.
        rows: of the sets, of view cells that count.
    """
    seen_by = [[] for _ in range(sets.object_count)]
    for place, row in enumerate(rows):
        for target in sets.of(row).tolist():
            seen_by[target].append(place)
    found: dict[tuple[int, ...], list[int]] = {}
    for number, placed in enumerate(scene.objects):
        if len(scene.definitions[placed.definition_id].lods[0].faces):
            found.setdefault(tuple(seen_by[number]), []).append(number)
    of_cells: list[list[int]] = [[] for _ in rows]
    for group, cells in enumerate(found):
        for place in cells:
            of_cells[place].append(group)
    objects = [np.array(members, np.int64) for members in found.values()]
    return Groups(objects, _boxes(scene, objects), of_cells)


def _boxes(scene: Scene, objects: list[np.ndarray]) -> np.ndarray:
    corners = [
        [vertices.min(axis=0) - 1, vertices.max(axis=0) + 1] for vertices in map(scene.world_vertices, _flat(objects))
    ]
    starts = starts_of([len(members) for members in objects])[:-1]
    corners = np.array(corners, np.int64).reshape(-1, 2, 3)
    if not len(objects):
        return corners
    low, high = np.minimum.reduceat(corners[:, 0], starts), np.maximum.reduceat(corners[:, 1], starts)
    return np.stack([low, high], axis=1)


def _flat(objects: list[np.ndarray]) -> list[int]:
    return [number for members in objects for number in members.tolist()]
