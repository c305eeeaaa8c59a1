"""Bakes with levels of detail: no set changes, and every level does from where the bake says so."""

from dataclasses import replace

import numpy as np
import pytest
import viewcell
from viewcell.data.buildings.office import make_office
from viewcell.data.camera import Screen
from viewcell.data.errors import InputError
from viewcell.data.lod import object_errors
from viewcell.data.scene import GRID_M, Definition
from viewcell.data.store.bake_folder import CELL_LODS
from viewcell.data.store.scene_folder import write_scene
from viewcell.solvers.levels.pixel_error import PixelLimit
from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.cli import main


@pytest.fixture(scope="module")
def office():
    """A small office whose furniture has one level, and without what has most triangles: the lamp has enough."""
    scene = make_office(floors=1, rooms_per_side=1)
    count = [shape.name for shape in scene.definitions].index("lamp") + 1
    return replace(
        scene,
        definitions=[Definition(shape.name, shape.lods[:1]) for shape in scene.definitions[:count]],
        objects=[placed for placed in scene.objects if placed.definition_id < count],
    )


@pytest.fixture(scope="module")
def bakes(office, tmp_path_factory):
    folder = tmp_path_factory.mktemp("lods")
    settings = Settings(lods=True, image="320x200", pixels=2.0)
    plain = viewcell.bake(office, folder / "plain", settings=Settings())
    return plain, viewcell.bake(office, folder / "lods", settings=settings), settings


def test_levels_change_no_set(bakes):
    plain, made, _ = bakes
    assert made.cell_to_object.equals(plain.cell_to_object)
    assert made.cell_to_cell.equals(plain.cell_to_cell)
    assert plain.cell_lods.num_rows == 0 and plain.cell_lods.column_names == list(CELL_LODS)


def test_the_bake_holds_levels_and_where_they_do(bakes):
    _, made, settings = bakes
    scene, limit = made.scene, settings.pixel_limit
    assert limit == PixelLimit(2.0, Screen(320, 200, 60.0))
    assert any(len(shape.lods) > 2 for shape in scene.definitions)
    for key in ("pixels", "image", "fov_deg"):
        assert made.manifest["settings"][key] == getattr(settings, key)
    assert made.manifest["lod_notes"] == []
    rows = np.column_stack([made.cell_lods[name].to_numpy() for name in CELL_LODS])
    assert len(rows) and (rows[:, 2] > 0).all()
    errors, starts = object_errors(scene)
    cells, boxes = made.graph.cells * GRID_M, scene.object_bounds() * GRID_M
    for cell, item, level in rows:
        assert made.potential_objects[cell, item]
        error = errors[starts[item] : starts[item + 1]][level]
        apart = np.maximum(boxes[item, 0] - cells[cell, 1], cells[cell, 0] - boxes[item, 1])
        assert error <= limit.deviation_per_distance * np.linalg.norm(np.maximum(apart - error, 0))


def test_splitting_on_the_command_line(office, tmp_path, capsys):
    write_scene(office, tmp_path / "office.scene")
    asked = ["bake", str(tmp_path / "office.scene"), "--out", str(tmp_path / "out"), "--no-progress"]
    assert main([*asked, "--split", "--lods", "--image", "640x480", "--fov", "50", "--pixels", "3"]) == 0
    made = viewcell.load(tmp_path / "out")
    assert len(made.scene.objects) > len(office.objects)
    assert made.manifest["settings"]["image"] == "640x480" and made.manifest["settings"]["fov_deg"] == 50
    capsys.readouterr()
    for more, said in (
        (["--image", "640"], "image: expected WIDTHxHEIGHT in pixels, found '640'"),
        (["--fov", "180"], "fov: expected degrees between 0 and 180, found 180.0"),
        (["--pixels", "0"], "pixels: expected a number above 0, found 0.0"),
    ):
        assert main([*asked, *more]) == 2
        assert capsys.readouterr().err == f"viewcell: {said}\n"


def test_a_bare_graph_has_nothing_to_simplify(graph, tmp_path):
    for option in ("lods", "split"):
        with pytest.raises(InputError, match="expected a model to split or to simplify, found a bare graph"):
            viewcell.bake(graph, tmp_path / "out", settings=Settings(**{option: True}))
