"""The second reader of compiled maps: nothing found on sound files, planted faults named."""

import struct

import numpy as np
import pytest
from builders.model_files import HOUSE, bsp
from builders.planted import SAID, planted
from viewcell.data.readers import read
from viewcell.verify.readers.bsp import found_in_bsp
from viewcell.verify.readers.referee import differences

VERSIONS = [29, 30, b"BSP2", b"2PSB"]
ONE = {"a": ((0, 0, 0), (4, 4, 3))}
KINDS = ["func_door", "func_wall", "trigger_once", "func_plat", "FUNC_LADDER", "func_noclip", ""]
ROWS = [ONE] + [{str(k): ((9 * k, 0, 0), (9 * k + 4, 4, 3))} for k in range(1, len(KINDS) + 1)]
TEXTURES = (
    "city2_1", "sky4", "*water0", "!lava", "{grate", "glass01", "whisky", "clip", "trigger", "AAATrigger", "*slimeskip",
    "a_skip", "a-skip", "skipped", "hintskip", "clip2", "triggers", "SKIP", "",
)  # fmt: skip


def written(path, *args, **options):
    path.write_bytes(bsp(*args, **options))
    return path


@pytest.mark.parametrize("version", VERSIONS)
def test_both_readers_agree_on_every_version(tmp_path, version):
    path = written(tmp_path / "a.bsp", textures={name: name for name in HOUSE}, version=version)
    found = found_in_bsp(path)
    assert {one.key: tuple(map(tuple, one.box.tolist())) for one in found} == HOUSE
    assert sum(one.area for one in found) == 367.5
    assert differences(read(path), found) == []


def test_both_readers_agree_on_entities(tmp_path):
    places = {1: "320 0 -64", 2: "here", 4: "1 2", 7: " 8 8  8"}
    path = written(tmp_path / "a.bsp", ROWS, entities=KINDS, origins=places)
    names = [one.key for one in found_in_bsp(path)]
    assert names == ["wall", "func_door *1: wall", "func_wall *2: wall", "func_plat *4: wall", "no class *7: wall"]
    assert differences(read(path), found_in_bsp(path)) == []


def test_a_model_that_no_entity_claims(tmp_path):
    path = written(tmp_path / "a.bsp", ROWS, entities=KINDS[:1])
    assert [one.key for one in found_in_bsp(path)][2] == "no entity *2: wall"
    assert differences(read(path), found_in_bsp(path)) == []


def test_both_readers_agree_on_what_is_drawn(tmp_path):
    boxes = {f"box {k}": ((2 * k, 0, 0), (2 * k + 1, 1, 1)) for k in range(len(TEXTURES))}
    names = dict(zip(boxes, TEXTURES, strict=True))
    path = written(tmp_path / "a.bsp", [boxes, {"box 0": boxes["box 0"]}], textures=names, entities=["func_wall"])
    found = [one.key for one in found_in_bsp(path)]
    assert "clip2" in found and "a-skip" in found and "a_skip" not in found and "SKIP" not in found
    assert differences(read(path), found_in_bsp(path)) == []


def test_textures_that_are_not_in_the_file(tmp_path):
    path = written(tmp_path / "a.bsp", textures={name: name for name in HOUSE})
    content = bytearray(path.read_bytes())
    at, _ = struct.unpack_from("<2i", content, 4 + 8 * 2)
    struct.pack_into("<i", content, at + 4 + 4 * 3, -1)
    path.write_bytes(content)
    assert "texture 3" in [one.key for one in found_in_bsp(path)]
    assert differences(read(path), found_in_bsp(path)) == []


def test_units_and_axes_are_the_first_readers(tmp_path):
    path = written(tmp_path / "a.bsp")
    assert differences(read(path, unit="inch", up="y"), found_in_bsp(path, 0.0254, "y")) == []
    assert len(differences(read(path, unit="inch"), found_in_bsp(path))) == 1


@pytest.mark.parametrize("fault", SAID)
def test_planted_faults_are_named(tmp_path, fault):
    path = written(tmp_path / "a.bsp", ROWS, entities=KINDS, origins={1: "320 0 -64"})
    (line,) = differences(planted(read(path), 1)[fault], found_in_bsp(path))
    assert line.startswith(f"'func_door *1: wall': {SAID[fault]}")


def test_an_origin_that_is_not_read_is_named(tmp_path):
    path = written(tmp_path / "a.bsp", ROWS, entities=KINDS)
    still = read(path)
    written(path, ROWS, entities=KINDS, origins={1: "320 0 -64"})
    (line,) = differences(still, found_in_bsp(path))
    assert line.startswith("'func_door *1: wall': expected the box (19, 0, -2) to (23, 4, 1), found (9, 0, 0)")


def test_polygons_stay_whole(tmp_path):
    path = written(tmp_path / "a.bsp", [{"a": ((0, 0, 0), (1, 2, 3))}])
    (one,) = found_in_bsp(path)
    assert one.area == 22 and np.array_equal(one.box, [[0, 0, 0], [1, 2, 3]])
