"""View cells in a table: Parquet or CSV with min_x ... max_z, read, snapped to the grid, and written."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv

from ..errors import InputError
from ..graph import CellGraph
from ..plans import NO_PLANS, Plans, are_convex, box_corners, come_last, plan_bounds, turned_plan
from ..scene import GRID_LIMIT, Scene, turned
from ..view_cells import as_graph
from .graph_folder import CELL_COLUMNS, inhabitable_column, numbers, optional_column
from .scene_folder import one_line, read_table

# View cells may stand this far outside the model's box: in the street before a house.
AROUND_M = 10.0
# Beyond this, float64 does not tell a whole number from the next.
WHOLE_FLOATS = 2**53
# How far corners of plans off the grid are moved to keep a plan in, or around, the given one [grid steps].
TWO_STEPS = 2.0


@dataclass(frozen=True)
class ViewCells:
    """View cells and what their table calls them.

    Attributes:
        graph: a graph without portals.
        ids: of each cell, shape (cells,), int64 or str.
        planned: cells whose table gives them a plan, shape (cells,), bool.
    """

    graph: CellGraph
    ids: np.ndarray
    planned: np.ndarray


def write_view_cells(boxes: np.ndarray, scene: Scene, path: str | Path) -> None:
    """Boxes [grid steps], shape (n, 2, 3), as a table in the model's own metres, which `read_view_cells` gives back.

    Raises:
        InputError: the scene is a model that was turned back, in whose own frame these are no boxes.
    """
    if scene.yaw_deg:
        raise InputError(f"{path}: expected a model along its own axes, found one turned by {scene.yaw_deg:g} degrees")
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
    plans = graph.plans.take(order, len(order))
    if not come_last(plans.rows, len(order)):
        raise InputError(f"{path}: expected the highest cell_id for cells with a plan, found one below others")
    return as_graph(graph.cells[order], graph.cell_names[order], graph.inhabitable[order], plans)


def view_cells(
    table: pa.Table,
    scene: Scene,
    where: str,
    *,
    placement: tuple[np.ndarray, float] | None = None,
    inwards: bool = False,
) -> ViewCells:
    """View cells of a table, in its order, with ids of any kind; columns and errors as of `read_view_cells`.

    Args:
        table: min_x ... max_z [m].
        scene: the model.
        where: what to call the table in errors.
        placement: origin [m] and yaw [degrees] of the table's frame in the model's own; 0 and 0 by default. Boxes of
            a frame that is turned against the scene's become prisms.
        inwards: snap so that every eye in the cell is in the given box, instead of the other way round.
    """
    require_columns_once(table, where)
    missing = [name for name in CELL_COLUMNS[1:] if name not in table.column_names]
    if missing:
        raise InputError(f"{where}: expected the column {missing[0]!r}, found {', '.join(table.column_names)}")
    if not table.num_rows:
        raise InputError(f"{where}: expected at least one view cell, found an empty table")
    boxes = numbers(table, CELL_COLUMNS[1:], Path(where)).reshape(-1, 2, 3)
    origin, yaw_deg = placement or (np.zeros(3), 0.0)
    ids = _cell_ids(table, where)
    prisms = _corners(table, boxes, where)
    planned = np.isin(np.arange(len(boxes)), list(prisms))
    if yaw_deg == scene.yaw_deg:
        # The same frame, possibly from another place in it.
        shift = turned(scene.origin - origin, -yaw_deg)
        boxes = boxes - shift
        prisms = {row: corners - shift[:2] for row, corners in prisms.items()}
    else:
        # Boxes of another frame stand at an angle in this one.
        every = dict(enumerate(box_corners(boxes))) | prisms
        prisms = {row: _moved(corners, origin, yaw_deg, scene) for row, corners in every.items()}
        boxes = boxes - np.array([0.0, 0.0, 1.0]) * (scene.origin - origin)
        for row, corners in prisms.items():
            boxes[row, :, :2] = plan_bounds(corners)
    steps = boxes / scene.grid_m
    if np.abs(steps).max() > GRID_LIMIT:
        raise InputError(
            f"{where}: expected view cells near the model, found a coordinate of {np.abs(boxes).max():g} m"
        )
    down, up = (np.ceil, np.floor) if inwards else (np.floor, np.ceil)
    cells = np.stack([down(steps[:, 0]), up(steps[:, 1])], axis=1).astype(np.int64)
    plans = _plans(prisms, cells, scene.grid_m, inwards, where)
    flat = np.flatnonzero(((boxes[:, 1] <= boxes[:, 0]) | (cells[:, 1] <= cells[:, 0])).any(axis=1))
    if len(flat):
        raise InputError(f"{where}: expected view cells with min below max, found cell {ids[flat[0]]} without volume")
    low, high = scene.bounds() + np.array([[-1], [1]]) * round(AROUND_M / scene.grid_m)
    away = np.flatnonzero((cells[:, 0] >= high).any(axis=1) | (cells[:, 1] <= low).any(axis=1))
    if len(away):
        raise InputError(
            f"{where}: expected view cells within {AROUND_M:g} m of the model, found cell {ids[away[0]]} outside"
        )
    graph = as_graph(cells, optional_column(table, "name", ""), inhabitable_column(table, where), plans)
    return ViewCells(graph, ids, planned)


def _corners(table: pa.Table, boxes: np.ndarray, where: str) -> dict[int, np.ndarray]:
    """Corners of the prisms of a table by row [m], each of shape (4, 2).

    Raises:
        InputError: a plan is not four corners, counter-clockwise and convex.
    """
    found = {}
    for row, plan in enumerate(optional_column(table, "plan", None)):
        if plan is None or not len(plan):
            continue
        corners = np.array(plan, float) if len(plan) == 8 else np.zeros(8)
        corners = corners.reshape(4, 2)
        if not are_convex(corners):
            raise InputError(f"{where}: expected plans of four corners, convex and counter-clockwise, found {plan}")
        found[row] = corners
    return found


def _moved(corners: np.ndarray, origin: np.ndarray, yaw_deg: float, scene: Scene) -> np.ndarray:
    """Plan corners of a table's frame in the scene's [m]."""
    return turned_plan(turned_plan(corners, yaw_deg) + origin[:2] - scene.origin[:2], -scene.yaw_deg)


def _plans(prisms: dict[int, np.ndarray], cells: np.ndarray, grid_m: float, inwards: bool, where: str) -> Plans:
    """Plans of view cells on the grid; the boxes of those cells are put around them, in place.

    Args:
        prisms: corners by row [m].
        cells: all boxes [grid steps], shape (n, 2, 3), int64.
        grid_m: grid step [m].
        inwards: round so that the plan lies in the given one, instead of the other way round.
        where: what to call the table in errors.
    """
    rows = np.array(sorted(prisms), np.int64)
    if not len(rows):
        return NO_PLANS
    if not come_last(rows, len(cells)):
        raise InputError(f"{where}: expected cells with a plan after all others, found one before row {rows[0] + 1}")
    corners = np.array([prisms[row] for row in rows.tolist()]) / grid_m
    exact = (corners == np.round(corners)).all(axis=(1, 2))
    # A corner that moves two steps towards the middle, or away from it, moves both its sides by more than rounding.
    away = corners - corners.mean(axis=1, keepdims=True)
    length = np.maximum(np.linalg.norm(away, axis=2, keepdims=True), 1e-9)
    moved = corners + away / length * (-TWO_STEPS if inwards else TWO_STEPS)
    corners = np.round(np.where(exact[:, None, None], corners, moved)).astype(np.int64)
    cells[rows, :, :2] = plan_bounds(corners)
    return Plans(rows, corners.astype(np.int32))


def _cell_ids(table: pa.Table, where: str) -> np.ndarray:
    """Ids of a table's rows, each once: the column cell_id, or places."""
    if "cell_id" not in table.column_names:
        return np.arange(table.num_rows)
    column = table["cell_id"]
    if pa.types.is_dictionary(column.type):
        column = column.cast(column.type.value_type)
    if (pa.types.is_string(column.type) or pa.types.is_large_string(column.type)) and not column.null_count:
        ids = np.array(column.to_pylist(), object)
    elif pa.types.is_integer(column.type) and not column.null_count:
        # Not by way of float64, which has no odd numbers above 2**53.
        ids = np.array(column.to_pylist(), object)
        if max(ids, default=0) > np.iinfo(np.int64).max:
            raise InputError(f"{where}: expected cell_id below 2**63, found {max(ids)}")
        ids = ids.astype(np.int64)
    else:
        values = numbers(table, ("cell_id",), Path(where))[:, 0]
        odd = (values != np.floor(values)) | (np.abs(values) > WHOLE_FLOATS)
        if odd.any():
            raise InputError(f"{where}: expected whole numbers or names as cell_id, found {values[odd][0]:.17g}")
        ids = values.astype(np.int64)
    values, times = np.unique(ids, return_counts=True)
    if (times > 1).any():
        raise InputError(f"{where}: expected each cell_id once, found {values[times > 1][0]} {times.max()} times")
    return ids


def require_columns_once(table: pa.Table, where: str) -> None:
    """Raise where two columns share a name.

    Raises:
        InputError: they do.
    """
    twice = [name for name, times in Counter(table.column_names).items() if times > 1]
    if twice:
        raise InputError(f"{where}: expected each column once, found {twice[0]!r} more than once")


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
