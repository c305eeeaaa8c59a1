"""Tables of rooms: what was written is read, older bakes have none, contradictions are told in one line."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from builders import small_house
from viewcell.data.errors import InputError
from viewcell.data.rooms import RoomCells
from viewcell.data.rows import Rows
from viewcell.data.scene import NamedStorey, Space
from viewcell.data.store.bake_folder import read_bake, write_bake
from viewcell.data.store.room_tables import room_tables

GRID_M = 2.0**-10
COLUMNS = {
    "rooms": "room_id name long_name guid storey elevation_m covered claims_rooms cells".split(),
    "room_to_object": ["room_id", "object_id", "verdict"],
    "room_to_room": ["room_id", "reached_room_id", "verdict"],
}
NONE = np.zeros((0, 3))
SPACES = [
    Space("A101", NONE, NONE, "Foyer", "0BTB", NamedStorey("Level 1", 3.1)),
    Space("store", NONE, NONE, "store", "", NamedStorey("roof")),
    Space("void", NONE, NONE),
]


def made(folder):
    """The small house; its first room has cells 0 and 2, the second cells 2 and 5, the third none."""
    scene, graph = small_house.small_scene(), small_house.small_graph()
    manifest = {"format": 1, "kind": "bake", "viewcell": "0", "grid_m": GRID_M, "origin": [0.0, 0.0, 0.0]}
    counts = {"objects": len(scene.objects), "cells": graph.cell_count}
    manifest |= {"skipped": [], "settings": {}, "counts": counts, "seconds": {}, "complete": True}
    rows = Rows.unseen(np.array([0, 2, 5]), np.array([0, 2, 5])), Rows.unseen(np.array([0, 2, 4]), np.array([3, 3, 7]))
    rows[0].verdict[:] = 1
    cells = rows[0].with_portals(np.zeros(3, int), np.zeros(0, np.int32)), rows[1]
    rooms = RoomCells(np.array([0, 2, 4, 4]), np.array([0, 2, 2, 5]), np.array([1, 0.9, 0]), np.array([1, 1, 0], bool))
    write_bake(folder, lambda: manifest, scene, graph, cells, GRID_M, room_tables(SPACES, rooms, cells))
    return read_bake(folder)


def test_what_was_written_is_read(tmp_path):
    bake = made(tmp_path / "house")
    for name, columns in COLUMNS.items():
        assert pq.read_schema(tmp_path / "house" / f"{name}.parquet").names == columns
    assert [tuple(row.values())[1:] for row in bake.rooms.to_pylist()] == [
        ("A101", "Foyer", "0BTB", "Level 1", 3.1, 1.0, True, [0, 2]),
        ("store", "store", None, "roof", None, 0.9, True, [2, 5]),
        ("void", None, None, None, None, 0.0, False, []),
    ]
    assert bake.room_to_object.to_pylist() == [
        {"room_id": 0, "object_id": 3, "verdict": "unknown"},
        {"room_id": 1, "object_id": 3, "verdict": "unknown"},
    ]
    # Cell 2 is in both; nothing is claimed of the room without cells.
    reached = {tuple(row.values()) for row in bake.room_to_room.to_pylist()}
    shown = {(a, b, "visible") for a in (0, 1) for b in (0, 1)}
    assert reached == shown | {(a, b, "unknown") for a, b in ((0, 2), (1, 2), (2, 0), (2, 1), (2, 2))}


def test_cells_are_called_by_their_rooms(tmp_path):
    words = made(tmp_path / "house").rooms_of_cells
    assert words == ["A101 Foyer, Level 1", "", "A101 Foyer, Level 1; store, roof", "", "study", "store, roof", ""]


def test_older_bakes_have_no_rooms(tmp_path):
    made(tmp_path / "house")
    objects = pq.read_table(tmp_path / "house" / "objects.parquet")
    pq.write_table(objects.drop_columns(["storey", "elevation_m", "materials"]), tmp_path / "house" / "objects.parquet")
    for name in COLUMNS:
        (tmp_path / "house" / f"{name}.parquet").unlink()
    bake = read_bake(tmp_path / "house")
    for name, columns in COLUMNS.items():
        assert getattr(bake, name).column_names == columns and not getattr(bake, name).num_rows
    assert bake.rooms_of_cells[0] == "hall" and {(o.storey, o.materials) for o in bake.scene.objects} == {(None, ())}


def change(folder, name, column, values):
    path = folder / f"{name}.parquet"
    old = pq.read_table(path)
    values = pa.array(values, old[column].type)
    pq.write_table(old.set_column(old.column_names.index(column), column, values), path)


@pytest.mark.parametrize(
    ("name", "column", "values", "message"),
    [
        ("rooms", "room_id", [0, 2, 1], "room_id from 0 to 2 in order"),
        ("rooms", "cells", [[0], [7], []], "cells from 0 to 6, found 7"),
        ("rooms", "cells", [[0], [1], []], "inhabitable cells only, found cell 1"),
        ("room_to_object", "room_id", [0, 3], "room_id from 0 to 2, found 3"),
        ("room_to_object", "object_id", [-1, 0], r"object_id from 0 to 18, found -1"),
        ("room_to_room", "reached_room_id", [9] * 9, "reached_room_id from 0 to 2, found 9"),
    ],
)
def test_contradictions_are_one_line(name, column, values, message, tmp_path):
    made(tmp_path / "house")
    change(tmp_path / "house", name, column, values)
    with pytest.raises(InputError, match=message) as told:
        read_bake(tmp_path / "house")
    assert f"{name}.parquet" in str(told.value) and "\n" not in str(told.value)


def test_a_damaged_table_is_one_line(tmp_path):
    made(tmp_path / "house")
    (tmp_path / "house" / "rooms.parquet").write_bytes(b"PAR1")
    with pytest.raises(InputError, match=r"rooms.parquet: expected a Parquet table"):
        read_bake(tmp_path / "house")
    pq.write_table(pa.table({"room_id": [0]}), tmp_path / "house" / "rooms.parquet")
    with pytest.raises(InputError, match=r"rooms.parquet: expected the column 'name'"):
        read_bake(tmp_path / "house")
