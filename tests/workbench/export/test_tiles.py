"""The tileset and its draft in glTF: what they show to an eye, inside and outside of view cells."""

import json

import numpy as np
import pytest
from builders import gltf_reader, tiles_reader
from viewcell.workbench.baked import load
from viewcell.workbench.cli import main
from viewcell.workbench.export.glb import model_as_glb


@pytest.fixture(scope="module")
def tiles(house, tmp_path_factory):
    return load(house.folder).export("3dtiles", tmp_path_factory.mktemp("tiles") / "house.tiles")


def eyes(bake):
    """(point, set that is to be shown) in each view cell and around the house, on borders of cells, and far away."""
    everything = {k for k, placed in enumerate(bake.scene.objects) if placed.name != "nothing"}
    graph, grid_m, random = bake.graph, bake.grid_m, np.random.default_rng(7)
    boxes = np.flatnonzero(graph.inhabitable & (np.arange(graph.cell_count) < graph.tile_count))
    for cell in boxes:
        low, high = graph.cells[cell].astype(float)
        for share in random.uniform(0.01, 0.99, (4, 3)):
            yield bake.in_model((low + share * (high - low)) * grid_m), set(bake.potential(int(cell)).tolist())
    # A box within a step of an eye shows its set, too.
    low, high = graph.cells.min(axis=(0, 1)) - 2000.0, graph.cells.max(axis=(0, 1)) + 2000.0
    far = np.array([[1e6, 5, 3], [-4e9, 2e9, 1e9]])
    for point in [*random.uniform(low, high, (150, 3)), *far]:
        beyond = np.maximum(graph.cells[boxes, 0] - point, point - graph.cells[boxes, 1]).max(axis=1, initial=-np.inf)
        if not len(boxes) or (beyond > 2).all():
            yield bake.in_model(point * grid_m), everything
    for cell in boxes:
        # On a face: never less than the cell's own.
        corner = graph.cells[cell, 0] * grid_m
        yield bake.in_model(corner), everything


def test_an_eye_is_shown_what_its_cell_may_see_and_outside_of_cells_everything(house, tiles):
    bake = load(house.folder)
    counts, less = 0, 0
    for point, wanted in eyes(bake):
        found = set(tiles_reader.shown_by_tiles(tiles, point)[0])
        assert found == wanted, point
        assert tiles_reader.shown_by_draft(tiles, point) == wanted, point
        counts, less = counts + 1, less + (len(wanted) < len(bake.scene.objects) - 1)
    assert counts > 100
    # In a bake of prisms alone everything is shown from everywhere.
    assert (less > 0) == (bake.graph.tile_count > 0 and bake.graph.inhabitable[: bake.graph.tile_count].any())


def test_contents_stand_where_the_model_does_and_inside_their_boxes(house, tiles):
    wanted = {node["extras"]["id"]: found for node, found, _ in gltf_reader.drawn(model_as_glb(house))}
    shown, matrix = tiles_reader.shown_by_tiles(tiles, house.in_model(np.array([1e5, 0, 0])))
    assert shown.keys() == {number for number, triangles in wanted.items() if len(triangles)}
    for number, (triangles, boxes) in shown.items():
        there = triangles @ matrix[:3, :3].T + matrix[:3, 3]
        assert np.abs(there - wanted[number]).max() < 1e-5
        assert all(tiles_reader.in_box(box, corner) for box in boxes for corner in triangles.reshape(-1, 3))


def test_shapes_are_written_once(house, tiles):
    used = {placed.definition_id for placed in house.scene.objects if placed.name not in ("nothing", "sheared")}
    sheared = next(k for k, placed in enumerate(house.scene.objects) if placed.name == "sheared")
    names = {f"{number}.bin" for number in used} | {f"object_{sheared}.bin"}
    assert {path.name for path in (tiles / "shapes").iterdir()} == names
    manifest = json.loads((tiles / "manifest.json").read_text())
    prisms = int(house.graph.inhabitable[house.graph.tile_count :].sum())
    assert manifest["counts"]["tilted_view_cells_where_all_is_shown"] == prisms


def test_only_a_tileset_is_replaced_and_files_of_others_stay(house, tmp_path, capsys):
    out = tmp_path / "house.tiles"
    asked = ["export", str(house.folder), "--3dtiles", str(out)]
    out.mkdir()
    (out / "notes.txt").write_text("mine")
    for more in ([], ["--overwrite"]):
        assert main(asked + more) == 2
        assert "found something else there" in capsys.readouterr().err
    (out / "notes.txt").unlink()
    assert main(asked) == 0
    (out / "notes.txt").write_text("mine")
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*")}
    assert main(asked) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*")} == before
    assert main([*asked, "--overwrite"]) == 0
    assert (out / "notes.txt").read_text() == "mine" and set(out.rglob("*")) == set(before)
