"""Reading display databases: what is not whole or not consistent is refused in one line."""

import json
import re
import shutil

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from builders.packed_house import packed_scene
from viewcell.data.errors import InputError
from viewcell.data.runs import encode
from viewcell.data.store.walk_folder import FORMAT, file_digest, read_walk
from viewcell.workbench.bake.run import bake
from viewcell.workbench.pack.run import pack


@pytest.fixture(scope="module")
def packed(tmp_path_factory):
    return pack(bake(packed_scene(), tmp_path_factory.mktemp("walk") / "house.bake", lods=True, threads=1)).folder


@pytest.fixture
def folder(packed, tmp_path):
    shutil.copytree(packed, tmp_path / "a.walk")
    return tmp_path / "a.walk"


def change_manifest(folder, **changes):
    manifest = json.loads((folder / "manifest.json").read_text()) | changes
    (folder / "manifest.json").write_text(json.dumps({k: v for k, v in manifest.items() if v is not None}))


def resign(folder):
    """Give every file the checksum that it has now."""
    files = json.loads((folder / "manifest.json").read_text())["files"]
    told = {name: {"bytes": (folder / name).stat().st_size, "sha256": file_digest(folder / name)} for name in files}
    change_manifest(folder, files=told)


def change_table(folder, table, column, values):
    path = folder / f"{table}.parquet"
    old = pq.read_table(path)
    at = old.column_names.index(column)
    pq.write_table(old.set_column(at, column, pa.array(values, old.schema.field(column).type)), path)
    resign(folder)


def column(folder, table, name):
    return pq.read_table(folder / f"{table}.parquet")[name].to_pylist()


def flip(path, at=-100):
    data = bytearray(path.read_bytes())
    data[at] ^= 1
    path.write_bytes(data)


BROKEN = {
    "expected a walk folder's manifest": lambda f: (f / "manifest.json").unlink(),
    "expected kind 'walk', found 'scene'": lambda f: change_manifest(f, kind="scene"),
    f"expected format {FORMAT}, found 9": lambda f: change_manifest(f, format=9),
    "expected the key 'bake'": lambda f: change_manifest(f, bake=None),
    "expected a checksum of objects.parquet": lambda f: change_manifest(f, files={}),
    "geometry.bin: expected .* it was cut short": lambda f: (f / "geometry.bin").write_bytes(b"1"),
    "geometry.bin: expected the checksum": lambda f: flip(f / "geometry.bin"),
    "sets.parquet: expected the checksum": lambda f: flip(f / "sets.parquet"),
    "cells.parquet: expected a file": lambda f: (f / "cells.parquet").unlink(),
    "sets.parquet: potential: runs: expected numbers": lambda f: change_table(
        f, "sets", "potential", [b"\x80" for _ in column(f, "sets", "potential")]
    ),
    "sets.parquet: unknown: runs: expected ids below": lambda f: change_table(
        f, "sets", "unknown", [b"\xff\x7f\x00" for _ in column(f, "sets", "unknown")]
    ),
    "sets.parquet: cells: runs: expected a gap": lambda f: change_table(
        f, "sets", "cells", [b"\x00" for _ in column(f, "sets", "cells")]
    ),
    "limits of levels, found ": lambda f: change_table(
        f, "cell_items", "limits", [row[1:] for row in column(f, "cell_items", "limits")]
    ),
    "expected levels that there are": lambda f: change_table(
        f, "cell_items", "limits", [b"\xff" * len(row) for row in column(f, "cell_items", "limits")]
    ),
    "found it beyond": lambda f: change_table(
        f, "items", "offset", [10**9 for _ in column(f, "items", "offset")]
    ),
    "expected items below": lambda f: change_table(
        f, "objects", "items", [[999] * len(row) for row in column(f, "objects", "items")]
    ),
    "expected a readable display database": lambda f: change_manifest(f, files=7),
    "expected a readable": lambda f: change_manifest(f, origin="here"),
    "expected the column 'items'": lambda f: (
        pq.write_table(pq.read_table(f / "objects.parquet").drop_columns(["items"]), f / "objects.parquet"),
        resign(f),
    ),
}  # fmt: skip


@pytest.mark.parametrize("words", BROKEN)
def test_broken_folders_are_refused_in_one_line(words, folder):
    BROKEN[words](folder)
    with pytest.raises(InputError) as error:
        read_walk(folder)
    assert re.search(words, str(error.value)) and "\n" not in str(error.value)
    assert ("readable" in str(error.value)) == ("readable" in words)


def test_every_byte_counts(packed, folder):
    """Whatever byte of whatever file is altered, it is seen."""
    rng = np.random.default_rng(0)
    for path in sorted(packed.iterdir()):
        for at in rng.integers(0, path.stat().st_size, 3).tolist() if path.name != "manifest.json" else []:
            flip(folder / path.name, at)
            with pytest.raises(InputError, match=path.name):
                read_walk(folder)
            flip(folder / path.name, at)
    read_walk(folder)


def test_items_are_read_as_they_were(packed):
    walk = read_walk(packed)
    scene = bake_of(packed)
    for display in range(walk.objects.num_rows):
        placed = scene.objects[walk.objects["object_id"][display].as_py()]
        starts, items = walk.object_items
        for item, mesh in zip(
            items[starts[display] : starts[display + 1]], scene.definitions[placed.definition_id].lods, strict=True
        ):
            found = walk.mesh(int(item))
            assert np.array_equal(found.vertices, mesh.vertices) and np.array_equal(found.faces, mesh.faces)
            assert found.error_m == mesh.error_m
            assert (found.colours is None) == (mesh.colours is None)
            assert found.colours is None or np.array_equal(found.colours, mesh.colours)
    with pytest.raises(InputError, match="expected an item below"):
        walk.mesh(walk.items.num_rows)
    with pytest.raises(InputError, match="expected an item below"):
        walk.mesh(-1)


def bake_of(packed):
    from viewcell.data.store.bake_folder import read_bake

    return read_bake(packed.with_name("house.bake")).scene


def test_a_file_that_is_cut_after_it_was_opened(folder):
    walk = read_walk(folder)
    _ = walk.items
    (folder / "geometry.bin").write_bytes(b"12345")
    with pytest.raises(InputError, match=r"geometry\.bin: expected \d+ bytes from 0 on, found 5"):
        walk.mesh(0)


def test_rows_of_view_cells(packed):
    walk = read_walk(packed)
    cells = walk.sets["cell_id"].to_pylist()
    assert [walk.row_of(cell) for cell in cells] == list(range(len(cells)))
    for wrong in (-1, max(cells) + 1, next(c for c in range(max(cells)) if c not in cells)):
        with pytest.raises(InputError, match=f"expected a view cell, found {wrong}"):
            walk.row_of(wrong)


def test_a_bake_that_is_gone_is_no_fault(folder):
    assert read_walk(folder).stale() == ""


def test_codes_are_those_of_the_sets(packed):
    walk = read_walk(packed)
    assert encode(*walk.potential.ids()) == walk.sets["potential"].to_pylist()
    rows = range(len(walk.unknown))
    assert all(set(walk.unknown.of(row)) <= set(walk.potential.of(row)) for row in rows)
