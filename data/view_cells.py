"""View cells that are not rooms: boxes from a table, or an octree over the space where a person may be.

Source: Chhugani et al. 2005, section 4 (octree cells, refined while what they see is too much). Beyond the paper they
are also refined where much of what they may see is unknown. View cells may overlap each other and solids: only points
outside every solid count as eyes.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv

from .errors import InputError
from .graph import CellGraph
from .opaque import OpaquePlanes
from .scene import GRID_LIMIT, Scene
from .solids import closed_elements, dead_cells
from .store.graph_folder import CELL_COLUMNS, inhabitable_column, numbers, optional_column
from .store.scene_folder import one_line, read_table

# An eye is at most this far above the floor that it walks on.
EYE_M = 2.0
CELLS_MOST = 1_000_000
# View cells may stand this far outside the model's box: in the street before a house.
AROUND_M = 10.0


def as_graph(cells: np.ndarray, names: np.ndarray | None = None, inhabitable: np.ndarray | None = None) -> CellGraph:
    """View cells as a graph without portals, all inhabitable unless told otherwise."""
    count = len(cells)
    return CellGraph(
        cells.astype(np.int32),
        np.ones(count, bool) if inhabitable is None else inhabitable,
        np.full(count, "", object) if names is None else names,
        np.zeros((0, 2), np.int32),
        np.zeros(0, np.int8),
        np.zeros((0, 2, 3), np.int32),
    )


@dataclass(frozen=True)
class ViewCells:
    """View cells and what their table calls them.

    Attributes:
        graph: a graph without portals.
        ids: of each cell, shape (cells,), int64 or str.
    """

    graph: CellGraph
    ids: np.ndarray


def write_view_cells(boxes: np.ndarray, scene: Scene, path: str | Path) -> None:
    """Boxes [grid steps], shape (n, 2, 3), as a table in the model's own metres, which `read_view_cells` gives back."""
    rows = boxes.reshape(-1, 6) * scene.grid_m + np.tile(scene.origin, 2)
    lines = [",".join(f"{value:.10f}" for value in row) for row in rows]
    Path(path).write_text("\n".join(["min_x,min_y,min_z,max_x,max_y,max_z", *lines]) + "\n", encoding="utf-8")


def read_view_cells(path: str | Path, scene: Scene) -> CellGraph:
    """View cells of a table, Parquet or CSV: min_x ... max_z, and if they are there cell_id, inhabitable and name.

    Args:
        path: metres in the model's own place (Z up, before recentring).
        scene: the model.

    Returns:
        A graph without portals. Boxes are snapped outwards, so that every eye in the given box is in the cell.

    Raises:
        InputError: the table is unreadable, a box has no volume, or one lies more than AROUND_M outside the model.
    """
    view = view_cells(read_rows(path), scene, str(path))
    if view.ids.dtype != np.int64:
        raise InputError(f"{path}: expected numbers as cell_id, found {view.ids[0]!r}")
    order = np.argsort(view.ids)
    if not np.array_equal(view.ids[order], np.arange(len(order))):
        ends = f"{view.ids.min()} to {view.ids.max()}"
        raise InputError(f"{path}: expected cell_id 0 to {len(order) - 1}, each once, found {ends}")
    graph = view.graph
    return as_graph(graph.cells[order], graph.cell_names[order], graph.inhabitable[order])


def view_cells(
    table: pa.Table, scene: Scene, where: str, *, origin: np.ndarray | None = None, inwards: bool = False
) -> ViewCells:
    """View cells of a table, in its order, with ids of any kind; columns and errors as of `read_view_cells`.

    Args:
        table: min_x ... max_z [m].
        scene: the model.
        where: what to call the table in errors.
        origin: of the table's coordinates in the model's own place [m]; 0 by default.
        inwards: snap so that every eye in the cell is in the given box, instead of the other way round.
    """
    missing = [name for name in CELL_COLUMNS[1:] if name not in table.column_names]
    if missing:
        raise InputError(f"{where}: expected the column {missing[0]!r}, found {', '.join(table.column_names)}")
    if not table.num_rows:
        raise InputError(f"{where}: expected at least one view cell, found an empty table")
    boxes = numbers(table, CELL_COLUMNS[1:], Path(where)).reshape(-1, 2, 3)
    shift = scene.origin if origin is None else scene.origin - origin
    steps = (boxes - shift) / scene.grid_m
    if np.abs(steps).max() > GRID_LIMIT:
        raise InputError(
            f"{where}: expected view cells near the model, found a coordinate of {np.abs(boxes).max():g} m"
        )
    down, up = (np.ceil, np.floor) if inwards else (np.floor, np.ceil)
    cells = np.stack([down(steps[:, 0]), up(steps[:, 1])], axis=1).astype(np.int64)
    ids = _cell_ids(table, where)
    flat = np.flatnonzero(((boxes[:, 1] <= boxes[:, 0]) | (cells[:, 1] <= cells[:, 0])).any(axis=1))
    if len(flat):
        raise InputError(f"{where}: expected view cells with min below max, found cell {ids[flat[0]]} without volume")
    low, high = model_bounds(scene) + np.array([[-1], [1]]) * round(AROUND_M / scene.grid_m)
    away = np.flatnonzero((cells[:, 0] >= high).any(axis=1) | (cells[:, 1] <= low).any(axis=1))
    if len(away):
        raise InputError(
            f"{where}: expected view cells within {AROUND_M:g} m of the model, found cell {ids[away[0]]} outside"
        )
    return ViewCells(as_graph(cells, optional_column(table, "name", ""), inhabitable_column(table, where)), ids)


def _cell_ids(table: pa.Table, where: str) -> np.ndarray:
    """Ids of a table's rows, each once: the column cell_id, or places."""
    if "cell_id" not in table.column_names:
        return np.arange(table.num_rows)
    column = table["cell_id"]
    if pa.types.is_string(column.type) and not column.null_count:
        ids = np.array(column.to_pylist(), object)
    else:
        ids = numbers(table, ("cell_id",), Path(where))[:, 0].astype(np.int64)
    values, times = np.unique(ids, return_counts=True)
    if (times > 1).any():
        raise InputError(f"{where}: expected each cell_id once, found {values[times > 1][0]} {times.max()} times")
    return ids


def read_rows(path: str | Path) -> pa.Table:
    """A table, Parquet or, by the name's ending, CSV.

    Raises:
        InputError: it is missing or unreadable.
    """
    path = Path(path)
    if path.suffix.lower() != ".csv":
        return read_table(path, ())
    try:
        return pyarrow.csv.read_csv(path)
    except (OSError, pa.ArrowException) as error:
        raise InputError(f"{path}: expected a CSV table, found {one_line(error)}") from None


def model_bounds(scene: Scene) -> np.ndarray:
    """Low and high corner of all triangles [grid steps], shape (2, 3), int64."""
    triangles, _ = scene.triangles()
    return np.array([triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))], np.int64)


def octree_roots(scene: Scene, size_m: float) -> np.ndarray:
    """Cubes over the named rooms, or over the whole model where it names none [grid steps], shape (n, 2, 3), int32.

    Raises:
        InputError: the size is not positive, or gives more cells than CELLS_MOST.
    """
    if not (np.isfinite(size_m) and size_m > 0):
        raise InputError(f"cell size: expected metres above 0, found {size_m}")
    step = max(1, round(size_m / scene.grid_m))
    low, high = model_bounds(scene)
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


def walkable(cells: np.ndarray, scene: Scene, opaque: OpaquePlanes) -> np.ndarray:
    """Cells that may hold the eye of somebody who walks, shape (n,), bool.

    Some opaque surface that faces up or down lies under part of the cell, at most EYE_M below its top, and the cell is
    not wholly inside a closed element.
    """
    floors = opaque.boxes[2]
    reach = round(EYE_M / scene.grid_m)
    order = np.argsort(floors[:, 0, 2], kind="stable")
    floors = floors[order]
    heights = floors[:, 0, 2]
    held = np.zeros(len(cells), bool)
    for row, (low, high) in enumerate(cells.astype(np.int64)):
        near = floors[np.searchsorted(heights, low[2] - reach) : np.searchsorted(heights, high[2])]
        held[row] = ((near[:, 0, :2] < high[:2]) & (near[:, 1, :2] > low[:2])).all(axis=1).any()
    rows = np.flatnonzero(held)
    held[rows[dead_cells(cells[rows], closed_elements(scene))]] = False
    return held
