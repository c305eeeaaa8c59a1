"""Mesh files of every format: the awkward cases, the same twice over, and files as accidents leave them."""

import os
import resource
import subprocess
import sys
import time

import numpy as np
import pytest
from builders.model_files import FILES, HOUSE, HOUSE_AREA, glb, gltf, gltf_parts, obj
from builders.mutated import mutated
from builders.places import SHARED
from viewcell.data.errors import InputError
from viewcell.data.readers import read
from viewcell.data.scene import Role, Scene

CASES = SHARED / "cases" / "readers"
shared = pytest.mark.skipif(not CASES.is_dir(), reason="no shared cases folder beside the checkout")


def boxes(scene: Scene) -> dict[str, tuple]:
    """Box of each object by name, metres, in the model's own place."""
    bounds = scene.object_bounds() * scene.grid_m + scene.origin
    return {
        placed.name: tuple(map(tuple, np.round(box, 6).tolist()))
        for placed, box in zip(scene.objects, bounds, strict=True)
    }


def area(scene: Scene) -> float:
    corners = scene.triangles()[0] * scene.grid_m
    return float(
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    )


def close(found: dict, expected: dict, slack: float) -> bool:
    return found.keys() == expected.keys() and all(
        np.abs(np.subtract(found[name], expected[name])).max() <= slack for name in expected
    )


def clear(scene: Scene) -> list[str]:
    return [placed.name for placed in scene.objects if placed.role is Role.TRANSPARENT]


PLAIN = """gltf_plain gltf_quant_n8 gltf_quant_n16 gltf_quant_i16 gltf_sparse_base gltf_sparse_zero gltf_fanmix
gltf_mode5 gltf_mode6 gltf_percent gltf_nopos gltf_scenes gltf_matrices gltf_unindexed""".split()


@shared
@pytest.mark.parametrize("name", PLAIN)
def test_awkward_gltf_is_the_house(name):
    scene = read(CASES / f"{name}.gltf")
    assert close(boxes(scene), HOUSE, 0.002)
    assert area(scene) == pytest.approx(HOUSE_AREA, abs=0.1)
    lost = {"gltf_nopos": ["empty"], "gltf_scenes": ["junk scene0", "junk orphan"]}.get(name, [])
    assert [one["what"] for one in scene.skipped] == lost


@shared
def test_instances_and_mirrors_of_gltf():
    found = boxes(read(CASES / "gltf_instancing.gltf"))
    for number, name in enumerate(("box a", "box b", "box c"), start=1):
        assert close({"x": found.pop(f"boxes #{number}")}, {"x": HOUSE[name]}, 0.002)
    assert close(found, {name: box for name, box in HOUSE.items() if name[:3] != "box"}, 0.002)
    mirrored = {name: ((8 - high[0], *low[1:]), (8 - low[0], *high[1:])) for name, (low, high) in HOUSE.items()}
    assert close(boxes(read(CASES / "gltf_negative.gltf")), mirrored, 0.002)


@shared
def test_duplicate_names_of_gltf_are_told_apart_and_noted():
    scene = read(CASES / "gltf_duplicates.gltf")
    names = [placed.name for placed in scene.objects]
    assert names[:4] == ["node 0", "Part", "Part #2", "Mesh"] and len(set(names)) == 12
    assert [note["what"] for note in scene.notes] == ["Part", "Mesh"]


@shared
def test_materials_of_one_gltf_mesh_are_objects():
    scene = read(CASES / "gltf_twoprims.gltf")
    assert [placed.name for placed in scene.objects] == ["House: Brick", "House: Pane"]
    assert clear(scene) == ["House: Pane"] and area(scene) == pytest.approx(372.1, abs=0.01)


NAMED = {
    "gltf_unknown_required.gltf": "EXT_made_up_geometry",
    "gltf_draco_one.gltf": "KHR_draco_mesh_compression",
    "gltf_draco.glb": "KHR_draco_mesh_compression",
    "gltf_meshopt.gltf": "EXT_meshopt_compression",
    "gltf_meshopt.glb": "EXT_meshopt_compression",
}


@shared
@pytest.mark.parametrize("name", NAMED)
def test_what_cannot_be_unpacked_is_named_in_one_line(name):
    with pytest.raises(InputError, match=NAMED[name]) as error:
        read(CASES / name)
    assert "\n" not in str(error.value)


GLASS = """gltf_glass_transmission.gltf gltf_glass_blend.gltf gltf_glass_specgloss.gltf obj_mtl.obj obj_mtl_two.obj
obj_quoted.obj obj_back.obj obj_case.obj obj_lastlib.obj obj_mapd.obj obj_tf.obj obj_bom_mtl.obj obj_dTr_alike.obj
obj_glas.obj obj_glas_klar.obj obj_door.obj obj_frontdoor.obj""".split()


@shared
@pytest.mark.parametrize("name", GLASS)
def test_glass_and_doors_are_transparent(name):
    scene = read(CASES / name)
    (pane,) = clear(scene)
    assert pane == {"obj_door.obj": "Front door", "obj_frontdoor.obj": "FrontDoor"}.get(name, "pane")
    assert len(scene.objects) == 13 and not scene.skipped
    assert next(placed.why for placed in scene.objects if placed.name == pane)


@shared
@pytest.mark.parametrize("name", ["house.obj", "obj_bom_v.obj"])
def test_plain_obj_is_the_house(name):
    assert boxes(read(CASES / name)) == HOUSE


@shared
@pytest.mark.parametrize("number", range(6))
def test_concave_polygons_are_not_filled(number):
    corners = read(CASES / f"ply_concave{number}.ply").triangles()[0] * 2.0**-10
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.abs(normals[:, 2]).sum() / 2 == pytest.approx(48)


# Area, and how many triangles.
OTHERS = {
    "ply_triquad.ply": (80, 12),
    "ply_triquad_ascii.ply": (80, 12),
    "ply_be.ply": (HOUSE_AREA, 144),
    "ply_strips.ply": (5, 10),
    "stl_trailing.stl": (HOUSE_AREA, 144),
    "stl_solid.stl": (HOUSE_AREA, 144),
    "stl_badcount.stl": (HOUSE_AREA, 144),
    "house_mirrored.obj": (HOUSE_AREA, 144),
}


@shared
@pytest.mark.parametrize("name", OTHERS)
def test_other_files_are_whole(name):
    scene = read(CASES / name)
    assert (area(scene), len(scene.triangles()[0])) == (pytest.approx(OTHERS[name][0]), OTHERS[name][1])
    assert len(scene.notes) == (name in ("stl_trailing.stl", "stl_badcount.stl"))


@shared
@pytest.mark.parametrize("name", ["disc500.obj", "disc1000.obj", "comb1000.obj"])
def test_polygons_of_a_thousand_corners_take_no_time(name):
    """Ear clipping by hand took 37 to 70 seconds; the limit is generous, but far below that."""
    start = time.process_time()
    read(CASES / name)
    assert time.process_time() - start < 10


TELL = """
import sys, numpy as np
from viewcell.data.readers import read
for path in sys.argv[1:]:
    scene = read(path)
    print(scene.sha256, scene.object_bounds().tolist(), scene.skipped, scene.notes)
    print([(i, o.name, o.kind, str(o.role), o.definition_id) for i, o in enumerate(scene.objects)])
"""


def test_two_processes_read_the_same(tmp_path):
    paths = [tmp_path / name for name in FILES]
    for path in paths:
        path.write_bytes(FILES[path.name]())
    if CASES.is_dir():
        paths += [*sorted(CASES.glob("gltf_[!dmu]*.gltf")), CASES / "gltf_duplicates.gltf", CASES / "obj_mtl_two.obj"]
    said = [
        subprocess.run(
            [sys.executable, "-c", TELL, *map(str, paths)],
            env=os.environ | {"PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    ]
    assert said[0] == said[1] and len(said[0].splitlines()) == 2 * len(paths)


@pytest.mark.parametrize("name", FILES)
def test_every_format_is_the_house(tmp_path, name):
    (tmp_path / name).write_bytes(FILES[name]())
    scene = read(tmp_path / name)
    assert area(scene) == pytest.approx(HOUSE_AREA, abs=0.1)
    assert not scene.notes and not scene.skipped
    if len(scene.objects) > 1:
        # Draco keeps 16 bits of the largest extent of each box.
        assert close(boxes(scene), HOUSE, 0.002)


def test_a_path_decides_nothing_but_the_reader(tmp_path):
    """A binary file under the other name, and a suffix in capitals."""
    (tmp_path / "a.GLTF").write_bytes(glb(*gltf_parts()))
    (tmp_path / "b.GLB").write_bytes(gltf(*gltf_parts()))
    assert boxes(read(tmp_path / "a.GLTF")) == boxes(read(tmp_path / "b.GLB"))


def test_many_names_of_several_objects_are_noted_together(tmp_path):
    body = "".join(f"o part {k}\nusemtl {m}\nf 1 2 3\n" for k in range(30) for m in "ab")
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 4 0 0\nv 0 4 0\n" + body)
    scene = read(tmp_path / "a.obj")
    assert len({placed.name for placed in scene.objects}) == 60
    assert [note["what"] for note in scene.notes][19:] == ["part 19", "10 more names"]


def test_names_that_look_told_apart_stay_apart(tmp_path):
    body = "".join(f"o {name}\nusemtl {m}\nf 1 2 3\n" for name, m in (("a", 1), ("a", 2), ("a #2", 1), ("a", 3)))
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 4 0 0\nv 0 4 0\n" + body)
    assert [placed.name for placed in read(tmp_path / "a.obj").objects] == ["a", "a #3", "a #2", "a #4"]


def test_parts_are_left_out_as_asked(tmp_path):
    (tmp_path / "a.obj").write_bytes(obj())
    scene = read(tmp_path / "a.obj", leave_out="^BOX")
    assert len(scene.objects) == 9
    assert scene.skipped == [{"what": f"box {x}", "why": "Mesh: left out as asked"} for x in "abc"]


def test_sources_of_maps_are_refused_with_the_way_on(tmp_path):
    (tmp_path / "a.map").write_text("{}")
    with pytest.raises(InputError, match=r"compile it with qbsp.*\.bsp"):
        read(tmp_path / "a.map")


@pytest.fixture
def little_memory():
    """Four gigabytes more than now: what asks for more, for a count that was flipped, fails."""
    before = resource.getrlimit(resource.RLIMIT_AS)
    with open("/proc/self/statm") as file:
        now = int(file.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (now + (4 << 30), before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)


def survive(path, content: bytes, seeds: range) -> None:
    """Read mutated files: a scene, or one line."""
    for seed in seeds:
        path.write_bytes(mutated(content, seed))
        try:
            scene = read(path)
        except InputError as error:
            assert "\n" not in str(error) and "expected" in str(error) and "found" in str(error), seed
        else:
            assert isinstance(scene, Scene) and len(scene.triangles()[0]), seed


@pytest.mark.skipif(sys.platform != "linux", reason="memory is limited by way of Linux")
@pytest.mark.parametrize("name", FILES)
def test_mutated_files_are_a_scene_or_one_line(tmp_path, name, little_memory):
    survive(tmp_path / name, FILES[name](), range(25))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory is limited by way of Linux")
@pytest.mark.parametrize("name", FILES)
def test_many_mutated_files_are_a_scene_or_one_line(tmp_path, name, little_memory):
    survive(tmp_path / name, FILES[name](), range(25, 500))
