"""Tables of rooms in a bake folder: what a room is called, which view cells it has, and what is seen from it."""

from pathlib import Path

import numpy as np
import pyarrow as pa

from ..errors import InputError
from ..rooms import RoomCells, rooms_from_rooms, seen_from_rooms
from ..rows import Rows
from ..scene import Space
from ..verdict import Verdict
from .scene_folder import read_table
from .scene_tables import rooms_table

ROOMS = ("room_id", "name", "long_name", "guid", "storey", "elevation_m", "covered", "claims_rooms", "cells")
ROOM_TO_OBJECT = ("room_id", "object_id", "verdict")
ROOM_TO_ROOM = ("room_id", "reached_room_id", "verdict")
TABLES = {"rooms": ROOMS, "room_to_object": ROOM_TO_OBJECT, "room_to_room": ROOM_TO_ROOM}
INTEGERS = ("room_id", "object_id", "reached_room_id")
OF_KIND = {
    "covered": pa.float64(),
    "elevation_m": pa.float64(),
    "claims_rooms": pa.bool_(),
    "cells": pa.list_(pa.int32()),
}


def room_tables(spaces: list[Space], rooms: RoomCells, rows: tuple[Rows | None, Rows]) -> dict[str, pa.Table]:
    """The tables of a bake's rooms, by name.

    Args:
        spaces: the model's rooms.
        rooms: their cells.
        rows: what cells see: of cells, None where nothing is claimed of them, and of objects.
    """
    cells = pa.ListArray.from_arrays(pa.array(rooms.starts.astype(np.int32)), pa.array(rooms.cells.astype(np.int32)))
    named = rooms_table(spaces)
    for name, column in (("covered", rooms.covered), ("claims_rooms", rooms.claims_rooms), ("cells", cells)):
        named = named.append_column(name, pa.array(column) if isinstance(column, np.ndarray) else column)
    cell_rows, object_rows = rows
    return {
        "rooms": named,
        "room_to_object": _pairs(ROOM_TO_OBJECT, *seen_from_rooms(rooms, object_rows)),
        "room_to_room": _pairs(ROOM_TO_ROOM, *rooms_from_rooms(rooms, cell_rows)),
    }


def verdict_column(verdicts: np.ndarray) -> pa.Array:
    """Words of an array of verdicts, as tables of a bake have them."""
    words = [verdict.word for verdict in Verdict]
    return pa.DictionaryArray.from_arrays(pa.array(verdicts.astype(np.int8)), words).cast(pa.string())


def words_of_cells(rooms: pa.Table | None, names: np.ndarray) -> list[str]:
    """Rooms of each cell in a line, such as "A101 Foyer, Level 1"; the cell's own name where it has no room.

    Args:
        rooms: with the columns of rooms.parquet; None where there are none.
        names: of all cells, shape (cells,), str.
    """
    found: dict[int, list[str]] = {}
    for room in [] if rooms is None else rooms.to_pylist():
        for cell in room["cells"]:
            found.setdefault(cell, []).append(_room_words(room))
    return [" ".join("; ".join(found.get(cell, [str(name)])).split()) for cell, name in enumerate(names)]


def _room_words(room: dict) -> str:
    """A room's names, each once, and its storey."""
    called = " ".join(dict.fromkeys(filter(None, (room["name"], room["long_name"]))))
    return f"{called}, {room['storey']}" if room["storey"] else called


def _pairs(columns: tuple[str, ...], room: np.ndarray, target: np.ndarray, verdict: np.ndarray) -> pa.Table:
    words = verdict_column(verdict)
    values = pa.array(room.astype(np.int32)), pa.array(target.astype(np.int32)), words
    return pa.table(dict(zip(columns, values, strict=True)))


def read_room_table(folder: Path, name: str) -> pa.Table:
    """One of the three tables; without rows in a bake of a model without rooms, and in older ones, which have none.

    Raises:
        InputError: it is unreadable, or lacks a column.
    """
    path = folder / f"{name}.parquet"
    if path.exists():
        return read_table(path, TABLES[name])
    kinds = {column: pa.int32() if column in INTEGERS else OF_KIND.get(column, pa.string()) for column in TABLES[name]}
    return pa.table({column: pa.array([], kind) for column, kind in kinds.items()})


def check_rooms(folder: Path, tables: dict[str, pa.Table], inhabitable: np.ndarray, objects: int) -> None:
    """Every id in the tables of rooms names a row of its own table, and cells of rooms are inhabitable.

    Args:
        folder: named in errors.
        tables: the three, by name.
        inhabitable: of the bake's cells, shape (cells,), bool.
        objects: number of objects.

    Raises:
        InputError: one does not.
    """
    count = tables["rooms"].num_rows
    if tables["rooms"]["room_id"].to_pylist() != list(range(count)):
        raise InputError(f"{folder / 'rooms.parquet'}: expected room_id from 0 to {count - 1} in order, found others")
    limits = {"room_id": count, "reached_room_id": count, "object_id": objects, "cells": len(inhabitable)}
    for name, table in tables.items():
        for column in (column for column in table.column_names if column in limits):
            values = table[column].combine_chunks()
            ids = (values.flatten() if column == "cells" else values).to_numpy(zero_copy_only=False)
            wrong = ids[(ids < 0) | (ids >= limits[column])]
            if len(wrong):
                wanted = f"{column} from 0 to {limits[column] - 1}"
                raise InputError(f"{folder / f'{name}.parquet'}: expected {wanted}, found {wrong[0]}")
            if column == "cells" and not inhabitable[ids].all():
                wrong = ids[~inhabitable[ids]][0]
                raise InputError(f"{folder / 'rooms.parquet'}: expected inhabitable cells only, found cell {wrong}")
