"""The bake folder: columns as published, the same after reading, contradictions told in one line."""

import json
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from builders import small_house
from viewcell.data.errors import InputError
from viewcell.data.rows import Rows
from viewcell.data.store.bake_folder import BakeFolder, read_bake, write_bake

GRID_M = 2.0**-10
WITNESS = ["origin_x", "origin_y", "origin_z", "direction_x", "direction_y", "direction_z"]
COLUMNS = {
    "meshes": ["definition_id", "lod", "error_m", "vertices", "faces", "colour_starts", "colours"],
    "objects": [
        *("object_id", "name", "kind", "definition_id", "transform", "opaque", "role", "guid"),
        *("min_x", "min_y", "min_z", "max_x", "max_y", "max_z"),
        *("storey", "elevation_m", "materials"),
    ],
    "cells": ["cell_id", "min_x", "min_y", "min_z", "max_x", "max_y", "max_z", "inhabitable", "name"],
    "portals": ["portal_id", "cell_a", "cell_b", "axis", "coordinate", "min_u", "max_u", "min_v", "max_v"],
    "cell_to_cell": ["cell_id", "reached_cell_id", "verdict", "portals", *WITNESS],
    "cell_to_object": ["cell_id", "object_id", "verdict", *WITNESS],
}


def rows_of(targets, portals):
    """Rows of cell 0 and cell 2: seen, unknown, seen."""
    rows = Rows.unseen(np.array([0, 0, 2]), np.array(targets))
    origin = np.array([[1.5, 2.25, 1023.0], [0, 0, 0], [-7.125, 2.0, 3.0]])
    end = origin + np.array([[0.5, -3.0, 2**-10], [0, 0, 0], [100.0, 4.0, 5.0]])
    rows.show(np.array([0, 2]), origin[[0, 2]], end[[0, 2]])
    return rows.with_portals(np.array([2, 0, 1]), np.array([0, 1, 4])) if portals else rows


def made(folder):
    scene, graph = small_house.small_scene(), small_house.small_graph()
    counts = {"objects": len(scene.objects), "cells": graph.cell_count}
    manifest = {"format": 1, "kind": "bake", "viewcell": "0", "grid_m": GRID_M, "origin": [1.0, 2.0, 3.0]}
    manifest |= {"unit": "metre", "source": "small house", "sha256": "", "skipped": []}
    manifest |= {"settings": {}, "counts": counts, "seconds": {}, "complete": True}
    rows = rows_of([0, 2, 4], True), rows_of([3, 1, 17], False)
    write_bake(folder, lambda: manifest, scene, graph, rows, GRID_M)
    return read_bake(folder), scene, graph


def test_columns_are_those_of_format_1(tmp_path):
    made(tmp_path / "house")
    for name, columns in COLUMNS.items():
        assert pq.read_schema(tmp_path / "house" / f"{name}.parquet").names == columns, name
    assert {path.name for path in (tmp_path / "house").iterdir()} == {
        *(f"{n}.parquet" for n in COLUMNS),
        "manifest.json",
    }


def test_what_was_written_is_read(tmp_path):
    _, scene, graph = made(tmp_path / "house")
    bake = read_bake(tmp_path / "house")
    for name in ("cells", "inhabitable", "portal_cells", "portal_axis", "portals"):
        np.testing.assert_array_equal(getattr(bake.graph, name), getattr(graph, name), err_msg=name)
    assert bake.graph.cell_names.tolist() == graph.cell_names.tolist()
    np.testing.assert_array_equal(bake.origin, [1, 2, 3])
    for got, wanted in zip(bake.scene.triangles(), scene.triangles(), strict=True):
        np.testing.assert_array_equal(got, wanted)
    assert [(o.name, o.kind, o.role) for o in bake.scene.objects] == [(o.name, o.kind, o.role) for o in scene.objects]
    rows = rows_of([0, 2, 4], True)
    table = bake.cell_to_cell
    assert table["verdict"].to_pylist() == ["visible", "unknown", "visible"]
    assert table["portals"].to_pylist() == [[0, 1], [], [4]]
    witness = np.array([table[name].to_numpy() for name in WITNESS]).T
    assert np.isnan(witness[1]).all() and table["origin_x"].null_count == 1
    # Exact: origin and origin + direction in grid steps are the points that were checked.
    np.testing.assert_array_equal(witness[[0, 2], :3] / GRID_M, rows.origin[[0, 2]])
    np.testing.assert_array_equal((witness[:, :3] + witness[:, 3:])[[0, 2]] / GRID_M, rows.end[[0, 2]])


def test_kept_shares_of_cells(tmp_path):
    """Cell 0 keeps two of the objects and cell 2 one; shares of triangles are of all triangles."""
    bake, scene, _ = made(tmp_path / "house")
    count = len(scene.objects)
    sizes = np.arange(count)
    bake.scene = SimpleNamespace(triangle_counts=sizes)
    objects, triangles = bake.kept()
    assert objects.tolist() == [2 / count, 0, 1 / count, 0, 0, 0, 0]
    assert triangles.tolist() == [(sizes[3] + sizes[1]) / sizes.sum(), 0, sizes[17] / sizes.sum(), 0, 0, 0, 0]


def test_potential_pairs(tmp_path):
    bake = made(tmp_path / "house")[0]
    assert isinstance(bake, BakeFolder)
    assert np.argwhere(bake.potential_cells).tolist() == [[0, 0], [0, 2], [2, 4]]
    assert np.argwhere(bake.potential_objects).tolist() == [[0, 1], [0, 3], [2, 17]]


def change_manifest(folder, **changes):
    path = folder / "manifest.json"
    manifest = json.loads(path.read_text()) | changes
    path.write_text(json.dumps({name: value for name, value in manifest.items() if value is not None}))


def change_ids(folder, table, column, value):
    path = folder / f"{table}.parquet"
    old = pq.read_table(path)
    ids = pa.array([value, *old[column].to_pylist()[1:]], old[column].type)
    pq.write_table(old.set_column(old.column_names.index(column), column, ids), path)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda folder: change_manifest(folder, format=3), "format"),
        (lambda folder: change_manifest(folder, complete=False), "complete"),
        (lambda folder: change_manifest(folder, kind="scene"), "bake"),
        (lambda folder: change_manifest(folder, grid_m=None), "expected the key 'grid_m', found none"),
        (lambda folder: (folder / "manifest.json").write_text("{"), "manifest.json"),
        (lambda folder: (folder / "manifest.json").unlink(), "manifest.json"),
        (lambda folder: (folder / "cell_to_cell.parquet").unlink(), "cell_to_cell.parquet"),
        (lambda folder: (folder / "cell_to_object.parquet").write_bytes(b"PAR1"), "cell_to_object.parquet"),
        (
            lambda folder: change_ids(folder, "cell_to_cell", "reached_cell_id", 7),
            "reached_cell_id from 0 to 6, found 7",
        ),
        (lambda folder: change_ids(folder, "cell_to_object", "object_id", -1), "found -1"),
        (lambda folder: change_ids(folder, "cell_to_object", "cell_id", 99), "cell_id from 0 to 6, found 99"),
    ],
)
def test_contradictions_are_one_line(spoil, message, tmp_path):
    made(tmp_path / "house")
    spoil(tmp_path / "house")
    with pytest.raises(InputError) as told:
        read_bake(tmp_path / "house")
    assert message in str(told.value) and "\n" not in str(told.value)


def test_a_source_that_is_not_inhabitable_is_refused(tmp_path):
    """A row of a cell in which nobody can stand contradicts the cells table."""
    made(tmp_path / "house")
    change_ids(tmp_path / "house", "cell_to_cell", "cell_id", 1)
    with pytest.raises(InputError, match="inhabitable"):
        read_bake(tmp_path / "house")


def test_a_failed_write_leaves_the_old_bake(tmp_path, monkeypatch):
    made(tmp_path / "house")
    before = {path.name: path.read_bytes() for path in (tmp_path / "house").iterdir()}

    def full(*_args, **_kwargs):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pq, "write_table", full)
    with pytest.raises(InputError, match="No space left"):
        made(tmp_path / "house")
    assert {path.name: path.read_bytes() for path in (tmp_path / "house").iterdir()} == before
    assert [path.name for path in tmp_path.iterdir()] == ["house"]
