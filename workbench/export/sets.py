"""What is potentially visible from each view cell, in the model's own frame: what every export says."""

from dataclasses import dataclass

import numpy as np

from ...data.errors import InputError
from ...data.plans import box_corners
from ...data.ragged import starts_of
from ...data.scene import Scene, turned
from ...data.store.bake_folder import BakeFolder
from ...data.verdict import Verdict


@dataclass(frozen=True)
class ViewSets:
    """Inhabitable view cells, the smallest first, and their potentially visible sets.

    A view cell is the upright prism over its plan. Each set holds for every eye in its cell, so that of several cells
    that hold an eye any will do; the first that does is the smallest, as of `Bake.cell_at`.

    Attributes:
        cells: ids in the bake, shape (n,), int64.
        plans: x, y of four corners, counter-clockwise, in the model's own metres, shape (n, 4, 2), float64.
        heights: z of bottom and top in the model's own metres, shape (n, 2), float64.
        starts: objects of row r are objects[starts[r]:starts[r + 1]], shape (n + 1,), int64.
        objects: ids, ascending in each row, visible or unknown: all that may be seen, int64.
        unknown: which of them no witness shows, bool.
        object_count: of the model.
    """

    cells: np.ndarray
    plans: np.ndarray
    heights: np.ndarray
    starts: np.ndarray
    objects: np.ndarray
    unknown: np.ndarray
    object_count: int

    def of(self, row: int) -> np.ndarray:
        """Objects that may be visible from the cell in a row."""
        return self.objects[self.starts[row] : self.starts[row + 1]]


def model_of(bake: BakeFolder) -> Scene:
    """The bake's model.

    Raises:
        InputError: the bake is of a bare cell graph, without objects.
    """
    if bake.scene is None:
        raise InputError(f"{bake.folder}: expected a bake of a model, found one of cells and portals without objects")
    return bake.scene


def placement(bake: BakeFolder) -> np.ndarray:
    """What takes the bake's frame to the model's own [m], Z up, shape (4, 4), float64."""
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = turned(np.eye(3), bake.yaw_deg).T, bake.origin
    return out


def view_sets(bake: BakeFolder) -> ViewSets:
    """The view cells of a bake with what may be visible from them.

    Raises:
        InputError: the bake is of a bare cell graph, without objects.
    """
    scene, graph = model_of(bake), bake.graph
    cells = np.flatnonzero(graph.inhabitable)
    boxes = graph.cells[cells].astype(np.float64)
    cells = cells[np.argsort((boxes[:, 1] - boxes[:, 0]).prod(axis=1), kind="stable")]
    corners = box_corners(graph.cells)
    corners[graph.plans.rows] = graph.plans.corners
    # The frame is turned about the vertical only: heights take the origin alone.
    flat = np.zeros((len(cells), 4, 3))
    flat[:, :, :2] = corners[cells] * bake.grid_m
    heights = graph.cells[cells, :, 2] * bake.grid_m + bake.origin[2]

    table = bake.cell_to_object
    rank = np.full(graph.cell_count, -1)
    rank[cells] = np.arange(len(cells))
    row, target = rank[table["cell_id"].to_numpy()], table["object_id"].to_numpy().astype(np.int64)
    order = np.lexsort((target, row))
    unknown = np.array(table["verdict"].to_pylist(), object) == Verdict.UNKNOWN.word
    return ViewSets(
        cells,
        bake.in_model(flat)[:, :, :2],
        heights,
        starts_of(np.bincount(row, minlength=len(cells))),
        target[order],
        unknown[order],
        len(scene.objects),
    )
