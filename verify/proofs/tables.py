"""Columns of certificate tables (data/store/certificates.py) as integers, and what is wrong with them."""

import numpy as np
import pyarrow as pa

from ...data.errors import InputError
from ...data.scene import GRID_LIMIT


def places_of(ids: np.ndarray, known: np.ndarray, where: object, column: str, *, once: bool = False) -> np.ndarray:
    """Place of each id among the known ones, shape (n,), int64.

    Raises:
        InputError: an id is not known or, with `once`, comes twice.
    """
    order = np.argsort(known, kind="stable")
    at = np.searchsorted(known[order], ids)
    lost = np.flatnonzero(known[order][np.minimum(at, len(known) - 1)] != ids) if len(known) else np.arange(len(ids))
    if len(lost):
        raise InputError(f"{where}: expected {column} of a row of its own table, found {ids[lost[0]]}")
    if once and len(np.unique(ids)) != len(ids):
        raise InputError(f"{where}: expected every {column} once, found one twice")
    return order[at]


def corners_of(table: pa.Table, columns: tuple[str, ...], grid_m: float, where: object) -> np.ndarray:
    """Columns of metres in grid steps, int64, shape (n, columns).

    Raises:
        InputError: as `steps_of`.
    """
    out = np.empty((table.num_rows, len(columns)), np.int64)
    for i, name in enumerate(columns):
        out[:, i] = steps_of(table[name].to_numpy(), grid_m, where)
    return out


def plans_of(table: pa.Table, grid_m: float, where: object) -> list[list[list[int]] | None]:
    """The column `plan` in grid steps: four corners for each row, None where there is none.

    Raises:
        InputError: as `steps_of`, or a plan is not convex and counter-clockwise.
    """
    if "plan" not in table.column_names:
        return [None] * table.num_rows
    plans: list[list[list[int]] | None] = []
    for row in table["plan"].to_pylist():
        if not row:
            plans.append(None)
            continue
        if len(row) != 8:
            raise InputError(f"{where}: expected a plan of four corners, found {len(row)} numbers")
        corners = steps_of(np.array(row, float), grid_m, where).reshape(4, 2).tolist()
        for k in range(4):
            (ax, ay), (bx, by), (cx, cy) = corners[k - 2], corners[k - 1], corners[k]
            if (bx - ax) * (cy - by) - (by - ay) * (cx - bx) <= 0:
                raise InputError(f"{where}: expected a convex plan, counter-clockwise, found {corners}")
        plans.append(corners)
    return plans


def steps_of(metres: np.ndarray, grid_m: float, where: object) -> np.ndarray:
    """Grid steps of coordinates that lie on the grid, int64.

    Raises:
        InputError: one does not, or is outside the grid's limits.
    """
    steps = np.round(metres / grid_m)
    wrong = ~((steps * grid_m == metres) & (np.abs(steps) <= GRID_LIMIT))
    if wrong.any():
        raise InputError(f"{where}: expected multiples of {grid_m} m within the grid, found {metres[wrong][0]}")
    return steps.astype(np.int64)


def box_text(corners: np.ndarray) -> str:
    """Corners as they are told."""
    return " - ".join(str(tuple(corner)) for corner in np.asarray(corners).tolist())
