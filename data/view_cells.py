"""View cells that are not rooms: an octree over the space where a person may be.

Source: Chhugani et al. 2005, section 4 (octree cells, refined while what they see is too much). Beyond the paper they
are also refined where much of what they may see is unknown. View cells may overlap each other and solids: only points
outside every solid count as eyes.
"""

import numpy as np

from .errors import InputError
from .graph import CellGraph
from .plans import NO_PLANS, Plans
from .prepared import PreparedModel
from .scene import Scene
from .solids import dead_cells

# An eye is at most this far above the floor that it walks on.
EYE_M = 2.0
CELLS_MOST = 1_000_000


def as_graph(
    cells: np.ndarray, names: np.ndarray | None = None, inhabitable: np.ndarray | None = None, plans: Plans = NO_PLANS
) -> CellGraph:
    """View cells as a graph without portals, all inhabitable unless told otherwise."""
    count = len(cells)
    return CellGraph(
        cells.astype(np.int32),
        np.ones(count, bool) if inhabitable is None else inhabitable,
        np.full(count, "", object) if names is None else names,
        np.zeros((0, 2), np.int32),
        np.zeros(0, np.int8),
        np.zeros((0, 2, 3), np.int32),
        plans,
    )


def octree_roots(scene: Scene, size_m: float) -> np.ndarray:
    """Cubes over the named rooms, or over the whole model where it names none [grid steps], shape (n, 2, 3), int32.

    Raises:
        InputError: the size is not positive, or gives more cells than CELLS_MOST.
    """
    if not (np.isfinite(size_m) and size_m > 0):
        raise InputError(f"cell size: expected metres above 0, found {size_m}")
    step = max(1, round(size_m / scene.grid_m))
    low, high = scene.bounds()
    spaces = [np.array([s.vertices.min(axis=0), s.vertices.max(axis=0)]) / scene.grid_m for s in scene.spaces]
    if not spaces:
        spaces = [np.array([low, high])]
    count = np.maximum(1, -(-(high - low) // step))
    if count.astype(float).prod() > CELLS_MOST:
        raise InputError(f"cell size: expected at most {CELLS_MOST:,} cells, found {size_m:g} m, which gives more")
    index = np.stack(np.meshgrid(*(np.arange(n) for n in count), indexing="ij"), axis=-1).reshape(-1, 3)
    cells = np.stack([low + index * step, low + (index + 1) * step], axis=1)
    wanted = np.zeros(len(cells), bool)
    for space in spaces:
        wanted |= (cells[:, 0] < np.ceil(space[1])).all(axis=1) & (cells[:, 1] > np.floor(space[0])).all(axis=1)
    return cells[wanted].astype(np.int32)


def octants(cells: np.ndarray) -> np.ndarray:
    """The eight children of each cell, in order, shape (8 n, 2, 3), int32."""
    middle = cells.sum(axis=1) // 2
    parts = np.stack([cells[:, 0], middle, cells[:, 1]], axis=1)
    which = (np.arange(8)[:, None] >> np.arange(3)) & 1
    children = np.empty((len(cells), 8, 2, 3), np.int32)
    for axis in range(3):
        children[:, :, 0, axis] = parts[:, which[:, axis], axis]
        children[:, :, 1, axis] = parts[:, which[:, axis] + 1, axis]
    return children.reshape(-1, 2, 3)


def walkable(cells: np.ndarray, model: PreparedModel) -> np.ndarray:
    """Cells that may hold the eye of somebody who walks, shape (n,), bool.

    Some opaque surface that faces up or down lies under part of the cell, at most EYE_M below its top, and the cell is
    not wholly inside a closed element.
    """
    floors = model.planes.boxes[2]
    reach = round(EYE_M / model.scene.grid_m)
    order = np.argsort(floors[:, 0, 2], kind="stable")
    floors = floors[order]
    heights = floors[:, 0, 2]
    held = np.zeros(len(cells), bool)
    for row, (low, high) in enumerate(cells.astype(np.int64)):
        near = floors[np.searchsorted(heights, low[2] - reach) : np.searchsorted(heights, high[2])]
        held[row] = ((near[:, 0, :2] < high[:2]) & (near[:, 1, :2] > low[:2])).all(axis=1).any()
    rows = np.flatnonzero(held)
    held[rows[dead_cells(cells[rows], model.closed)]] = False
    return held
