"""A bare cell graph: a folder with `cells.parquet` and `portals.parquet`, checked before anything is built on it."""

from pathlib import Path

import numpy as np
import pyarrow as pa

from ..errors import InputError
from ..graph import OTHER_AXES, CellGraph
from ..plans import NO_PLANS, Plans, are_convex, come_last, plan_bounds
from ..scene import GRID_LIMIT, GRID_M
from .scene_folder import read_table

CELL_COLUMNS = ("cell_id", "min_x", "min_y", "min_z", "max_x", "max_y", "max_z")
PLAN_TYPE = pa.list_(pa.float64())
PORTAL_COLUMNS = ("portal_id", "cell_a", "cell_b", "axis", "coordinate", "min_u", "max_u", "min_v", "max_v")


def numbers(table: pa.Table, names: tuple[str, ...], path: Path) -> np.ndarray:
    """Columns as finite float64, shape (rows, columns).

    Raises:
        InputError: a value is null, not a number, or not finite.
    """
    try:
        out = np.column_stack([table[name].to_numpy().astype(np.float64) for name in names])
    except (ValueError, TypeError, pa.ArrowException):
        raise InputError(f"{path}: expected numbers in {', '.join(names)}, found another type") from None
    bad = ~np.isfinite(out)
    if bad.any():
        row, column = np.argwhere(bad)[0]
        raise InputError(f"{path}: expected finite numbers, found {out[row, column]} in {names[column]} of row {row}")
    return out.reshape(table.num_rows, len(names))


def read_graph(
    folder: Path, grid_m: float = GRID_M, *, disjoint: bool = True, portals: str = "portals"
) -> tuple[CellGraph, float]:
    """The graph of a folder, snapped to the grid, and the largest displacement by snapping [m].

    Args:
        folder: with cells.parquet and portals.parquet.
        grid_m: grid step [m].
        disjoint: refuse cells that overlap; view cells may.
        portals: name of their table.

    Raises:
        InputError: the tables are unreadable or contradict each other or themselves.
    """
    cells_path, portals_path = Path(folder) / "cells.parquet", Path(folder) / f"{portals}.parquet"
    table = read_table(cells_path, CELL_COLUMNS)
    if table.num_rows == 0:
        raise InputError(f"{cells_path}: expected at least one cell, found an empty table")
    ids = numbers(table, ("cell_id",), cells_path)[:, 0].astype(np.int64)
    if not np.array_equal(np.sort(ids), np.arange(len(ids))):
        raise InputError(
            f"{cells_path}: expected cell_id 0 to {len(ids) - 1}, each once, found {ids.min()} to {ids.max()}"
        )
    metres = numbers(table, CELL_COLUMNS[1:], cells_path).reshape(-1, 2, 3)[np.argsort(ids)]
    cells, moved = _snap(metres, grid_m, cells_path)
    order = np.argsort(ids)
    inhabitable = inhabitable_column(table, cells_path)[order]
    names = optional_column(table, "name", "")[order]
    rows = read_table(portals_path, PORTAL_COLUMNS)
    ends = numbers(rows, ("cell_a", "cell_b", "axis"), portals_path).astype(np.int64)
    flat = numbers(rows, PORTAL_COLUMNS[4:], portals_path)
    _check_ids(ends, len(ids), portals_path)
    boxes, portals_moved = _snap(_portal_boxes(ends[:, 2], flat), grid_m, portals_path)
    plans = _plans(table, cells, grid_m, cells_path, order)
    axis = ends[:, 2].astype(np.int8)
    graph = CellGraph(cells, inhabitable, names, ends[:, :2].astype(np.int32), axis, boxes, plans)
    check_graph(graph, str(folder), disjoint=disjoint)
    return graph, max(moved, portals_moved)


def plan_column(corners: np.ndarray, planned: np.ndarray, grid_m: float) -> pa.Array:
    """The column `plan`: x, y of four corners [m], counter-clockwise; null where a box is all there is.

    Args:
        corners: [grid steps], shape (n, 4, 2), int.
        planned: rows that have a plan, shape (n,), bool.
        grid_m: grid step [m].
    """
    metres = corners.reshape(len(corners), -1) * grid_m
    return pa.array([row if some else None for row, some in zip(metres.tolist(), planned, strict=True)], PLAN_TYPE)


def _plans(table: pa.Table, cells: np.ndarray, grid_m: float, path: Path, order: np.ndarray) -> Plans:
    """Plans of the cells of a table, which come last.

    Raises:
        InputError: one is not four corners of a convex plan, counter-clockwise, that touches its box on every side; or
            a cell without a plan follows one that has it.
    """
    column = optional_column(table, "plan", None)[order]
    rows = np.array([n for n, plan in enumerate(column) if plan is not None], np.int64)
    if not len(rows):
        return NO_PLANS
    if not come_last(rows, len(cells)):
        raise InputError(f"{path}: expected cells with a plan after all others, found one before cell {rows[0] + 1}")
    try:
        metres = np.array(list(column[rows]), float).reshape(-1, 4, 2)
    except (ValueError, TypeError):
        raise InputError(f"{path}: expected plans of four corners, found another number of coordinates") from None
    corners = np.round(metres / grid_m).astype(np.int64)
    around = plan_bounds(corners)
    bad = np.flatnonzero(~are_convex(corners) | (around != cells[rows][:, :, :2]).any(axis=(1, 2)))
    if len(bad):
        raise InputError(
            f"{path}: expected convex plans, counter-clockwise, that touch their box on every side, "
            f"found another in cell {rows[bad[0]]}"
        )
    return Plans(rows, corners.astype(np.int32))


def optional_column(table: pa.Table, name: str, default: object) -> np.ndarray:
    """A column with nulls replaced, or the default in every row where there is none; dtype object."""
    if name in table.column_names:
        return np.array([default if value is None else value for value in table[name].to_pylist()], object)
    return np.full(table.num_rows, default, object)


def inhabitable_column(table: pa.Table, path: str | Path) -> np.ndarray:
    """Whether each cell may be an observer's: true where nothing is said, shape (rows,), bool.

    Raises:
        InputError: a value is neither true nor false.
    """
    values = optional_column(table, "inhabitable", True)
    bad = [value for value in values if value not in (True, False)]
    if bad:
        raise InputError(f"{path}: expected true or false as inhabitable, found {bad[0]!r}")
    return values.astype(bool)


def _snap(metres: np.ndarray, grid_m: float, path: Path) -> tuple[np.ndarray, float]:
    steps = np.round(metres / grid_m)
    if len(steps) and np.abs(steps).max() > GRID_LIMIT:
        raise InputError(
            f"{path}: expected coordinates within {GRID_LIMIT * grid_m:g} m, found {np.abs(metres).max():g} m"
        )
    moved = float(np.abs(metres - steps * grid_m).max()) if len(steps) else 0.0
    return steps.astype(np.int32), moved


def _check_ids(ends: np.ndarray, cell_count: int, path: Path) -> None:
    for column, name, limit in ((0, "cell_a", cell_count), (1, "cell_b", cell_count), (2, "axis", 3)):
        bad = np.flatnonzero((ends[:, column] < 0) | (ends[:, column] >= limit))
        if len(bad):
            raise InputError(
                f"{path}: expected {name} from 0 to {limit - 1}, found {ends[bad[0], column]} in row {bad[0]}"
            )


def _portal_boxes(axis: np.ndarray, flat: np.ndarray) -> np.ndarray:
    boxes = np.empty((len(axis), 2, 3))
    for a in range(3):
        u, v = OTHER_AXES[a]
        rows = axis == a
        boxes[rows, :, a] = flat[rows, :1]
        boxes[rows, :, u] = flat[rows, 1:3]
        boxes[rows, :, v] = flat[rows, 3:5]
    return boxes


def check_graph(graph: CellGraph, where: str, *, disjoint: bool = True) -> None:
    """Cells have volume and (if `disjoint`) do not overlap; each portal has area and lies on its cells' common face.

    Raises:
        InputError: something does not hold.
    """
    flat = np.flatnonzero((graph.cells[:, 1] <= graph.cells[:, 0]).any(axis=1))
    if len(flat):
        raise InputError(f"{where}: expected cells with min below max, found cell {flat[0]} without volume")
    pair = first_overlap(graph.tiles.cells) if disjoint else None
    if pair is not None:
        raise InputError(
            f"{where}: expected cells that do not overlap, found cells {pair[0]} and {pair[1]} overlapping"
        )
    rows = np.arange(graph.portal_count)
    low, high = graph.cells[graph.portal_cells[:, 0]], graph.cells[graph.portal_cells[:, 1]]
    axis = graph.portal_axis
    k = graph.portals[rows, 0, axis]
    thin = np.flatnonzero((graph.portals[:, 1] > graph.portals[:, 0]).sum(axis=1) != 2)
    if len(thin):
        raise InputError(f"{where}: expected portals with area, found portal {thin[0]} without")
    off = (low[rows, 1, axis] != k) | (high[rows, 0, axis] != k)
    for cell in (low, high):
        off |= (graph.portals[:, 0] < cell[:, 0]).any(axis=1) | (graph.portals[:, 1] > cell[:, 1]).any(axis=1)
    bad = np.flatnonzero(off)
    if len(bad):
        a, b = graph.portal_cells[bad[0]]
        raise InputError(
            f"{where}: expected each portal on the face that cell_a (low side) and cell_b share, "
            f"found portal {bad[0]} off the common face of cells {a} and {b}"
        )


def first_overlap(cells: np.ndarray) -> tuple[int, int] | None:
    """A pair of boxes that overlap with volume, or None; a sweep along the x axis."""
    order = np.argsort(cells[:, 0, 0], kind="stable")
    lows = cells[order, 0, 0]
    for place, cell in enumerate(order):
        stop = np.searchsorted(lows, cells[cell, 1, 0])
        near = order[place + 1 : stop]
        hit = (cells[near, 0, 1:] < cells[cell, 1, 1:]).all(axis=1) & (cells[near, 1, 1:] > cells[cell, 0, 1:]).all(
            axis=1
        )
        if hit.any():
            return int(cell), int(near[hit][0])
    return None
