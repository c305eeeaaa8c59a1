"""Claims of any baker: which objects, or cells, may be visible from which view cells. What is not claimed is hidden.

A table has one row per pair, with the columns `cell_id` and `object_id` or `reached_cell_id`; names may stand for ids.
A bit matrix has one row per view cell, in the order of the cells' table.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from ..errors import InputError
from .scene_folder import one_line, read_manifest
from .view_cells import ViewCells, read_rows, require_columns_once

TARGETS = {"object": "object_id", "cell": "reached_cell_id"}
# What a column `verdict` may say, and whether the pair is in the potentially visible set.
VERDICTS = {"visible": True, "unknown": True, "potential": True, "hidden": False}


@dataclass
class Claims:
    """Potentially visible sets, as somebody claims them.

    Attributes:
        objects: shape (cells, objects), bool; None if nothing is claimed of objects.
        cells: shape (cells, cells), bool, each cell in its own set; None if nothing is claimed of cells.
        silent: cells with a plan that no claim of cells names, shape (cells,), bool: a bake speaks only of what
            objects are seen from these, so all their pairs stand in `cells` as claimed; None where `cells` is.
    """

    objects: np.ndarray | None = None
    cells: np.ndarray | None = None
    silent: np.ndarray | None = None


def read_claims(
    sources: Sequence[object],
    view: ViewCells,
    object_names: Sequence[str],
    targets: str | None = None,
    *,
    guids: Sequence[str] = (),
) -> Claims:
    """The claims of one or several tables.

    Args:
        sources: each a path (Parquet, CSV, .npy, or a bake folder), a table (of pyarrow, pandas, polars, or a dict of
            columns), or a matrix. Matrices: bool, or 0 and 1, shape (cells, targets); or uint8 with eight targets a
            byte, the first the highest bit (`numpy.packbits`), shape (cells, ceil(targets / 8)).
        view: the view cells, which claims name by id or by name.
        object_names: names of the model's objects; an object's id is its place.
        targets: "objects" or "cells": what the columns of a matrix stand for, where its shape leaves a doubt.
        guids: of the model's objects, which stand for them as names do; empty where an object has none.

    Raises:
        InputError: a table is unreadable or empty, a claim is made twice, or names a cell or an object that is not
            there, an ambiguous name, or a cell that is not inhabitable.
    """
    if targets not in (None, "objects", "cells"):
        raise InputError(f"targets: expected objects or cells, found {targets!r}")
    claims = Claims()
    for source in sources:
        for where, part in _open(source, view):
            if isinstance(part, np.ndarray):
                kind, matrix = _from_matrix(part, view, len(object_names), targets, where)
            else:
                kind, matrix = _from_table(part, view, [object_names, guids], where)
            if getattr(claims, kind) is not None:
                raise InputError(f"{where}: expected the claims of {kind} once, found them a second time")
            setattr(claims, kind, matrix)
    if claims.objects is None and claims.cells is None:
        raise InputError("pvs: expected claims of objects or of cells, found none")
    if claims.cells is not None:
        claims.silent = view.planned & ~claims.cells.any(axis=0) & ~claims.cells.any(axis=1)
        claims.cells[claims.silent], claims.cells[:, claims.silent] = True, True
        # A view cell sees itself; few bakers say so.
        np.fill_diagonal(claims.cells, True)
    return claims


def _open(source: object, view: ViewCells) -> list[tuple[str, pa.Table | np.ndarray]]:
    """What to call each table of a source, and the table."""
    if isinstance(source, np.ndarray):
        return [("pvs", source)]
    if not isinstance(source, str | Path):
        try:
            return [("pvs", pa.table(source))]
        except (TypeError, ValueError, AttributeError, pa.ArrowException) as error:
            raise InputError(f"pvs: expected a table or a matrix, found {one_line(error)}") from None
    path = Path(source)
    if path.is_dir():
        manifest = read_manifest(path, kind="bake")
        names = ["cell_to_object"] if manifest.get("counts", {}).get("objects") else []
        # A bake claims nothing of cells from those with a plan, and all of its view cells may be such.
        of_cells = "cell_to_cell" in manifest.get("claims", ["cell_to_cell"])
        names += ["cell_to_cell"] if of_cells and view.graph.inhabitable[~view.planned].any() else []
        return [(str(path / f"{name}.parquet"), read_rows(path / f"{name}.parquet")) for name in names]
    if path.suffix.lower() == ".npy":
        try:
            return [(str(path), np.load(path, allow_pickle=False))]
        except (OSError, ValueError, EOFError) as error:
            raise InputError(f"{path}: expected a NumPy matrix, found {one_line(error)}") from None
    return [(str(path), read_rows(path))]


def _from_matrix(
    matrix: np.ndarray, view: ViewCells, objects: int, targets: str | None, where: str
) -> tuple[str, np.ndarray]:
    """Which targets a matrix speaks of, and its bits."""
    cells = view.graph.cell_count
    if matrix.dtype != bool and not (np.issubdtype(matrix.dtype, np.integer)):
        raise InputError(f"{where}: expected a matrix of bits, found {matrix.dtype}")
    sizes = {"objects": objects, "cells": cells}
    whole = [name for name, size in sizes.items() if matrix.shape == (cells, size)]
    packed = [name for name, size in sizes.items() if matrix.shape == (cells, -(-size // 8))]
    packed = [] if matrix.dtype != np.uint8 else [name for name in packed if name not in whole]
    fits = [name for name in whole + packed if targets in (None, name) and sizes[name]]
    if len(fits) != 1:
        wanted = " or ".join(f"{cells} x {size} for {name}" for name, size in sizes.items() if size)
        found = " x ".join(map(str, matrix.shape)) or "a single number"
        doubt = ", which may be either: say which targets it has" if fits else ""
        raise InputError(f"{where}: expected a matrix of {wanted} (or an eighth as wide), found {found}{doubt}")
    kind = fits[0]
    if kind in packed:
        matrix = np.unpackbits(matrix, axis=1, count=sizes[kind]).view(bool)
    elif matrix.dtype != bool and not np.isin(matrix, (0, 1)).all():
        raise InputError(f"{where}: expected bits, found {matrix[(matrix != 0) & (matrix != 1)][0]}")
    if not matrix.any():
        raise InputError(f"{where}: expected at least one claim, found none")
    return kind, matrix.astype(bool)


def _from_table(
    table: pa.Table, view: ViewCells, object_names: Sequence[Sequence[str]], where: str
) -> tuple[str, np.ndarray]:
    """Which targets a table speaks of, and its pairs as bits."""
    require_columns_once(table, where)
    found = [kind for kind, column in TARGETS.items() if column in table.column_names]
    if "cell_id" not in table.column_names or len(found) != 1:
        columns = ", ".join(table.column_names) or "no column"
        raise InputError(f"{where}: expected the columns cell_id and object_id or reached_cell_id, found {columns}")
    if not table.num_rows:
        raise InputError(f"{where}: expected at least one claim, found an empty table")
    kind = found[0]
    object_count = len(object_names[0])
    if kind == "object" and not object_count:
        raise InputError(f"{where}: expected claims of cells for a model without objects, found claims of objects")
    cell_names = [str(name) for name in view.graph.cell_names]
    sources = _places(table["cell_id"], view.ids, [cell_names], "cell", where)
    if kind == "object":
        reached = _places(table["object_id"], np.arange(object_count), object_names, "object", where)
    else:
        reached = _places(table["reached_cell_id"], view.ids, [cell_names], "cell", where)
    count = object_count if kind == "object" else view.graph.cell_count
    keys = sources * count + reached
    values, times = np.unique(keys, return_counts=True)
    if (times > 1).any():
        one, two = np.flatnonzero(keys == values[times > 1][0])[:2]
        pair = f"cell {table['cell_id'][int(one)]}, {kind} {table[TARGETS[kind]][int(one)]}"
        raise InputError(f"{where}: expected each pair once, found {pair} in rows {one} and {two}")
    absent = ~view.graph.inhabitable[sources]
    if absent.any():
        raise InputError(
            f"{where}: expected rows of inhabitable cells only, found cell {table['cell_id'][int(absent.argmax())]}"
        )
    claimed = _claimed(table, where)
    if not claimed.any():
        raise InputError(f"{where}: expected at least one claim, found none")
    matrix = np.zeros((view.graph.cell_count, count), bool)
    matrix[sources[claimed], reached[claimed]] = True
    return f"{kind}s", matrix


def _claimed(table: pa.Table, where: str) -> np.ndarray:
    """Rows that put their pair into the set: all, unless a column `verdict` says hidden."""
    if "verdict" not in table.column_names:
        return np.ones(table.num_rows, bool)
    verdicts = [str(value).lower() for value in table["verdict"].to_pylist()]
    unknown = [value for value in verdicts if value not in VERDICTS]
    if unknown:
        raise InputError(f"{where}: expected a verdict of {', '.join(VERDICTS)}, found {unknown[0]!r}")
    return np.array([VERDICTS[value] for value in verdicts], bool)


def _places(
    column: pa.ChunkedArray, ids: np.ndarray, names: Sequence[Sequence[str]], what: str, where: str
) -> np.ndarray:
    """Places of what a column names, by id or by one of its names, shape (rows,), int64."""
    if pa.types.is_dictionary(column.type):
        column = column.cast(column.type.value_type)
    if column.null_count:
        row = column.to_pylist().index(None)
        raise InputError(f"{where}: expected {what} ids or names, found none in row {row}")
    is_text = pa.types.is_string(column.type) or pa.types.is_large_string(column.type)
    if not (is_text or pa.types.is_integer(column.type)):
        raise InputError(f"{where}: expected {what} ids or names, found {column.type}")
    known = {value: place for place, value in enumerate(ids.tolist())}
    values = column.to_pylist()
    if is_text:
        # A thing may bear one name twice.
        bearers = {(name, place) for some in names for place, name in enumerate(some) if name}
        uses = Counter(name for name, _ in bearers)
        named = {name: place for name, place in bearers if uses[name] == 1}
        # Ids that are text themselves come before names, numbers that are written as text come after them.
        known = named | known if ids.dtype == object else {str(value): place for value, place in known.items()} | named
        shared = next((value for value in values if value not in known and uses[value] > 1), None)
        if shared is not None:
            raise InputError(
                f"{where}: expected names that stand for one {what}, found {shared!r} for {uses[shared]}: use ids"
            )
    missing = next((value for value in values if value not in known), None)
    if missing is not None:
        raise InputError(f"{where}: expected {what}s of the {_owner(what)}, found {missing!r}")
    return np.array([known[value] for value in values], np.int64)


def _owner(what: str) -> str:
    return "model" if what == "object" else "table of cells"
