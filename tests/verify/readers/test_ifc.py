from dataclasses import replace

import numpy as np
import pytest
from builders.awkward import IFC_CASES, IFC_MODELS, ifc_case
from builders.step_house import house, told_house
from viewcell.data.readers import read
from viewcell.data.scene import NamedStorey, Scene
from viewcell.verify.readers.ifc import differences_ifc

REFUSED = {"cut": {}, "noproject": {}, "stray": {}}
CASES = sorted(path.stem for path in IFC_CASES.glob("*.ifc") if path.stem not in REFUSED)
# Files that take more than a few seconds.
QUICK = ("3rooms_Heater_AirTerminal_Table_with_SB.ifc",)


@pytest.mark.parametrize("name", CASES)
def test_cases_are_read_as_a_second_reader_finds_them(name):
    assert differences_ifc(read(ifc_case(name)), ifc_case(name)) == []


MODELS = [
    pytest.param(path, id=path.stem, marks=() if path.name in QUICK else pytest.mark.slow)
    for path in sorted(IFC_MODELS.rglob("*.ifc"))
]


@pytest.mark.parametrize("path", MODELS)
def test_models_are_read_as_a_second_reader_finds_them(path):
    assert differences_ifc(read(path), path) == []


@pytest.fixture
def pair(tmp_path):
    path = house().write(tmp_path / "a.ifc")
    scene = read(path)
    assert differences_ifc(scene, path) == []
    return scene, path


def with_objects(scene: Scene, objects: list) -> Scene:
    return replace(scene, objects=objects)


def moved(transform: np.ndarray, by: float) -> np.ndarray:
    transform = transform.copy()
    transform[0, 3] += by
    return transform


def test_a_lost_object_is_named(pair):
    scene, path = pair
    (line,) = differences_ifc(with_objects(scene, scene.objects[1:]), path)
    assert scene.objects[0].guid in line and "found 0 objects" in line


def test_an_object_too_many_is_named(pair):
    scene, path = pair
    (line,) = differences_ifc(with_objects(scene, [*scene.objects, scene.objects[1]]), path)
    assert scene.objects[1].guid in line and "found 2 objects" in line


def test_a_moved_object_is_named(pair):
    scene, path = pair
    away = replace(scene.objects[0], transform=moved(scene.objects[0].transform, 0.1))
    (line,) = differences_ifc(with_objects(scene, [away, *scene.objects[1:]]), path)
    assert scene.objects[0].guid in line and "box" in line


def test_a_lost_triangle_is_named(pair):
    scene, path = pair
    first = scene.objects[0].definition_id
    mesh = scene.definitions[first].lods[0]
    less = replace(scene.definitions[first], lods=(replace(mesh, faces=mesh.faces[:-1]),))
    definitions = [less if i == first else shape for i, shape in enumerate(scene.definitions)]
    (line,) = differences_ifc(replace(scene, definitions=definitions), path)
    assert scene.objects[0].guid in line and "area" in line


def test_a_lost_and_a_moved_room_are_named(pair):
    scene, path = pair
    (line,) = differences_ifc(replace(scene, spaces=[]), path)
    assert line.startswith("room 'room'")
    assert len(differences_ifc(replace(scene, objects=scene.objects[1:], spaces=[]), path)) == 2
    (room,) = scene.spaces
    (line,) = differences_ifc(replace(scene, spaces=[replace(room, vertices=room.vertices + 1)]), path)
    assert "box" in line


@pytest.mark.parametrize("schema", ["IFC2X3", "IFC4"])
def test_words_that_differ_are_named(schema, tmp_path):
    path = told_house(schema).write(tmp_path / "a.ifc")
    scene = read(path)
    assert differences_ifc(scene, path) == []
    for place, one in enumerate(scene.objects):
        others = scene.objects[:place] + scene.objects[place + 1 :]
        moved_up = NamedStorey(one.storey.name, 7.0) if one.storey else NamedStorey("cellar")
        for changed in (replace(one, storey=moved_up), replace(one, materials=("cheese",))):
            (line,) = differences_ifc(with_objects(scene, [*others, changed]), path)
            assert line.startswith(f"{one.guid!r}: expected")
    (room,) = scene.spaces
    (line,) = differences_ifc(replace(scene, spaces=[replace(room, long_name="Stube")]), path)
    assert line.startswith(f"room {room.guid!r}: expected the names 'room' and 'Stube ")
    (line,) = differences_ifc(replace(scene, spaces=[replace(room, storey=None)]), path)
    assert "found the names" in line and line.endswith("no storey")
