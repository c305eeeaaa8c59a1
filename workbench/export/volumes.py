"""What a tileset is made of: volumes for eyes, and what is shown in each."""

from dataclasses import dataclass

import numpy as np

from ...data.store.bake_folder import BakeFolder
from .groups import Groups, group_objects
from .outside import boxes_outside
from .sets import placement, view_sets

# How far from the model an eye may be [grid steps]; 16,000 km on a grid of a millimetre.
REACH = 2**34


@dataclass(frozen=True)
class TiledBake:
    """What a tileset is made of, in the bake's frame [grid steps].

    Attributes:
        bake: it all comes from.
        cells: ids of the view cells that are boxes.
        volumes: where each cell's objects are shown, a step wider than the cell, shape (n, 2, 3), int64.
        outside: where everything is shown, shape (m, 2, 3), int64; together they fill space.
        groups: objects by cells that may see them.
        place: the bake's frame to the model's own, shape (4, 4), float64.
        tilted: number of view cells that are prisms, in which everything is shown.
    """

    bake: BakeFolder
    cells: np.ndarray
    volumes: np.ndarray
    outside: np.ndarray
    groups: Groups
    place: np.ndarray
    tilted: int


def tiled(bake: BakeFolder) -> TiledBake:
    """What the tileset of a bake is made of.

    Raises:
        InputError: the bake is of a bare cell graph.
    """
    sets, graph = view_sets(bake), bake.graph
    rows = np.flatnonzero(sets.cells < graph.tile_count)
    cells = sets.cells[rows]
    boxes = graph.cells[cells].astype(np.int64)
    # A step wider, as viewers round: on a border both neighbours show theirs, and nowhere nothing is shown.
    wider = np.array([[-1] * 3, [1] * 3])
    outside = boxes_outside(boxes, np.array([[-REACH] * 3, [REACH] * 3]))
    groups = group_objects(bake.scene, sets, rows)
    return TiledBake(bake, cells, boxes + wider, outside + wider, groups, placement(bake), len(sets.cells) - len(cells))
