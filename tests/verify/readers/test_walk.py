"""The second reader of display databases, which must find what is wrong in one."""

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from builders.packed_house import packed_scene
from viewcell.data.store.walk_folder import WalkFolder
from viewcell.verify.readers.walk import differences, read_code
from viewcell.workbench.bake.run import bake
from viewcell.workbench.pack.run import pack


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return bake(packed_scene(), tmp_path_factory.mktemp("walk") / "house.bake", lods=True, threads=1)


def test_codes_are_read_as_they_are_described():
    assert read_code(bytes.fromhex("c801 03 c301 00".replace(" ", ""))) == {200, 201, 202, 203, 400}
    assert read_code(b"") == set() and read_code(b"\x00\x02\x03\x01\x0a\x00") == {0, 1, 2, 7, 8, 20}


def change(walk: WalkFolder, table: str, column: str, values: list) -> None:
    path = walk.folder / f"{table}.parquet"
    old = pq.read_table(path)
    at = old.column_names.index(column)
    pq.write_table(old.set_column(at, column, pa.array(values, old.schema.field(column).type)), path)


def swapped(values):
    return [values[1], values[0], *values[2:]]


SPOILT = {
    "another potential set": ("sets", "potential", lambda codes: [code[:-2] for code in codes]),
    "another unknown set": ("sets", "unknown", lambda codes: [code + b"\x00\x00" for code in codes]),
    "another set of cells": ("sets", "cells", lambda codes: [b"" for _ in codes]),
    "other limits of levels": ("cell_items", "limits", lambda rows: [b"\x01" + row[1:] for row in rows]),
    "not each once": ("objects", "object_id", lambda ids: [ids[1], *ids[1:]]),
    "another box": ("objects", "min_x", lambda xs: [None if x is None else x - 1 for x in xs]),
    "other triangles": ("items", "offset", swapped),
    "other colours": ("items", "colours", lambda rows: [[c ^ 1 for c in row] for row in rows]),
    "another number of levels": ("objects", "items", lambda rows: [row * 2 for row in rows]),
}


@pytest.mark.parametrize("fault", SPOILT)
def test_faults_are_found(fault, made, tmp_path):
    walk = pack(made, tmp_path / "house.walk")
    assert differences(walk.folder, made) == []
    table, column, spoil = SPOILT[fault]
    values = pq.read_table(walk.folder / f"{table}.parquet")[column].to_pylist()
    change(walk, table, column, spoil(values))
    assert any(fault in line for line in differences(walk.folder, made))
