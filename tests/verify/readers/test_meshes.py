"""The second readers of meshes: nothing found on sound files, planted faults named."""

from dataclasses import replace

import numpy as np
import pytest
from builders.model_files import FILES, glb, gltf_parts
from builders.places import SHARED
from viewcell.data.errors import InputError
from viewcell.data.readers import read
from viewcell.data.scene import Definition, Mesh
from viewcell.verify.readers.meshes import found_in_mesh
from viewcell.verify.readers.referee import differences

CASES, SCENES = SHARED / "cases" / "readers", SHARED / "scenes" / "mesh"
KINDS = (".gltf", ".glb", ".obj", ".ply", ".stl", ".dxf", ".bsp")
SHARED_FILES = [path for path in sorted(CASES.glob("*.*")) if path.suffix in KINDS] if CASES.is_dir() else []
UPS = {"complex.obj": "y", "institute.obj": "y", "clinic_arch.obj": "y"}


def compared(path, up=None) -> list[str]:
    return differences(read(path, up=up), found_in_mesh(path, up=up))


@pytest.mark.parametrize("name", [name for name in FILES if name.endswith(KINDS)])
def test_both_readers_agree(tmp_path, name):
    (tmp_path / name).write_bytes(FILES[name]())
    assert compared(tmp_path / name) == []


@pytest.mark.skipif(not SHARED_FILES, reason="no shared cases folder beside the checkout")
@pytest.mark.parametrize("path", SHARED_FILES, ids=lambda path: path.name)
def test_both_readers_agree_on_shared_cases(path):
    try:
        assert compared(path) == []
    except InputError as error:
        assert path.name.startswith(("gltf_draco", "gltf_meshopt", "gltf_unknown", "turned.bsp")), error


@pytest.mark.skipif(not SCENES.is_dir(), reason="no shared scenes folder beside the checkout")
@pytest.mark.parametrize(
    "name",
    [
        "complex.obj",
        "institute.obj",
        "engel_house.obj",
        "room.glb",
        pytest.param("clinic_arch.obj", marks=pytest.mark.slow),
    ],
)
def test_both_readers_agree_on_shared_scenes(name):
    (path,) = SCENES.glob(f"*/{name}")
    assert compared(path, UPS.get(name)) == []


@pytest.mark.parametrize("mode", [4, 5, 6])
def test_both_readers_agree_on_strips_and_fans(tmp_path, mode):
    out, data = gltf_parts()
    for mesh in out["meshes"]:
        mesh["primitives"][0]["mode"] = mode
    (tmp_path / "a.glb").write_bytes(glb(out, data))
    assert compared(tmp_path / "a.glb") == []


def test_units_and_axes_are_the_first_readers(tmp_path):
    (tmp_path / "a.obj").write_bytes(FILES["quads.obj"]())
    scene = read(tmp_path / "a.obj", unit="foot", up="y")
    assert differences(scene, found_in_mesh(tmp_path / "a.obj", 0.3048, "y")) == []
    assert len(differences(scene, found_in_mesh(tmp_path / "a.obj", 0.3048, "z"))) == 12


@pytest.mark.parametrize("name", ["text.gltf", "quads.obj"])
def test_planted_faults_are_named(tmp_path, name):
    (tmp_path / name).write_bytes(FILES[name]())
    scene, found = read(tmp_path / name), found_in_mesh(tmp_path / name)

    def with_mesh(change) -> list[str]:
        shapes = list(scene.definitions)
        finest = shapes[2].lods[0]
        shapes[2] = Definition(shapes[2].name, (change(finest),))
        return differences(replace(scene, definitions=shapes), found)

    (line,) = with_mesh(lambda mesh: Mesh(mesh.vertices, mesh.faces[:-1]))
    assert line.startswith("'wall south': expected an area")
    (line,) = with_mesh(lambda mesh: Mesh(mesh.vertices * [1, 1, 1.5], mesh.faces))
    assert line.startswith("'wall south': expected the box")
    lost = replace(scene, objects=scene.objects[1:])
    assert differences(lost, found) == ["'floor': expected 1 object as a second reader finds, found 0 objects"]
    twice = replace(scene, objects=[*scene.objects, scene.objects[0]])
    assert differences(twice, found) == ["'floor': expected 1 object as a second reader finds, found 2 objects"]


def test_other_kinds_have_no_second_reader(tmp_path):
    assert found_in_mesh(tmp_path / "a.step") is None
    assert np.array_equal(found_in_mesh_box(tmp_path), [[0, 0, -0.25], [8, 4, 0]])


def found_in_mesh_box(tmp_path) -> np.ndarray:
    (tmp_path / "a.obj").write_bytes(FILES["quads.obj"]())
    return found_in_mesh(tmp_path / "a.obj")[0].box
