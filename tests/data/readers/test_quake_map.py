"""Compiled Quake maps as models."""

import numpy as np
import pytest
from builders.model_files import HOUSE, bsp
from viewcell.data.errors import InputError
from viewcell.data.readers import read
from viewcell.data.scene import Role
from viewcell.data.store.scene_folder import write_scene
from viewcell.workbench.cli import main

VERSIONS = [29, 30, b"BSP2", b"2PSB"]
ONE = {"a": ((0, 0, 0), (4, 4, 3))}


def written(path, *args, **options):
    path.write_bytes(bsp(*args, **options))
    return path


@pytest.mark.parametrize("version", VERSIONS)
def test_faces_of_every_version(tmp_path, version):
    textures = {name: name for name in HOUSE}
    scene = read(written(tmp_path / "a.bsp", textures=textures, version=version))
    bounds = scene.object_bounds() * scene.grid_m + scene.origin
    found = {placed.name: tuple(map(tuple, box.tolist())) for placed, box in zip(scene.objects, bounds, strict=True)}
    assert found == HOUSE  # 32 units are a metre
    assert scene.unit == "0.03125 metre"


def test_units_may_be_told(tmp_path):
    scene = read(written(tmp_path / "a.bsp"), unit="inch")
    extent = np.ptp(scene.bounds(), axis=0) * scene.grid_m
    np.testing.assert_allclose(extent, np.array([8.5, 4.5, 3.5]) * 32 * 0.0254, atol=2 * scene.grid_m)


NAMES = {
    "city2_1": Role.OCCLUDER,
    "sky4": Role.TRANSPARENT,
    "*water0": Role.TRANSPARENT,
    "!lava": Role.TRANSPARENT,
    "{grate": Role.TRANSPARENT,
    "rock_slime": Role.TRANSPARENT,
    "glass01": Role.TRANSPARENT,
    "whisky": Role.OCCLUDER,
    "clip": None,
    "trigger": None,
    "*slimeskip": None,
}


def test_textures_say_what_is_seen_through(tmp_path):
    rows = {name: ((9 * k, 0, 0), (9 * k + 4, 4, 3)) for k, name in enumerate(NAMES)}
    scene = read(written(tmp_path / "a.bsp", [rows], {name: name for name in NAMES}))
    assert {placed.name: placed.role for placed in scene.objects} == {
        name: role for name, role in NAMES.items() if role is not None
    }
    assert {one["what"] for one in scene.skipped} == {name for name, role in NAMES.items() if role is None}


def test_brushes_of_entities_are_objects(tmp_path):
    kinds = ["func_door", "func_wall", "trigger_once", "func_plat"]
    rows = [ONE] + [{str(k): ((9 * k, 0, 0), (9 * k + 4, 4, 3))} for k in range(1, 5)]
    path = written(tmp_path / "a.bsp", rows, entities=kinds)
    roles = {placed.name: placed.role for placed in read(path).objects}
    assert roles == {
        "wall": "occluder",
        "func_door *1: wall": "transparent",
        "func_wall *2: wall": "occluder",
        "func_plat *4: wall": "transparent",
    }
    assert [one["what"] for one in read(path).skipped] == ["trigger_once *3"]
    closed = {placed.name: placed.role for placed in read(path, doors="closed").objects}
    assert closed["func_door *1: wall"] == "occluder" and closed["func_plat *4: wall"] == "transparent"


def test_entities_move_their_brushes(tmp_path):
    rows = [ONE, {"b": ((0, 0, 0), (1, 1, 3))}]
    scene = read(written(tmp_path / "a.bsp", rows, entities=["func_wall"], origins={1: "320 0 -64"}))
    boxes = scene.object_bounds() * scene.grid_m + scene.origin
    assert boxes.tolist() == [[[0, 0, 0], [4, 4, 3]], [[10, 0, -2], [11, 1, 1]]]
    odd = read(written(tmp_path / "a.bsp", rows, entities=["func_wall"], origins={1: "here"}))
    assert np.ptp(odd.bounds(), axis=0)[0] * odd.grid_m == 4


@pytest.mark.parametrize("cut", [3, 60, 2000, -1])
def test_files_that_end_early_are_one_line(tmp_path, cut):
    (tmp_path / "a.bsp").write_bytes(bsp()[:cut])
    with pytest.raises(InputError) as error:
        read(tmp_path / "a.bsp")
    assert "\n" not in str(error.value)


def test_a_map_is_baked_and_its_bake_is_sound(tmp_path):
    path, out = written(tmp_path / "a.bsp", textures={name: name for name in HOUSE}), tmp_path / "a.bake"
    assert main(["bake", str(path), "--out", str(out), "--no-progress"]) == 0
    checked = ["check", str(path), "--cells", str(out), "--pvs", str(out), "--rays", "20000"]
    assert main(checked) == 0


def test_a_map_is_a_scene_folder_too(tmp_path):
    scene = read(written(tmp_path / "a.bsp"))
    write_scene(scene, tmp_path / "a.scene")
    assert np.array_equal(read(tmp_path / "a.scene").triangles()[0], scene.triangles()[0])
