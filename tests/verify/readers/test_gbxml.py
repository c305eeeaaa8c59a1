from dataclasses import replace

import pytest
from builders.awkward import GBXML_MODELS
from builders.gbxml_house import OPENINGS, gbxml
from viewcell.data.readers import read
from viewcell.data.scene import NamedStorey
from viewcell.verify.readers.gbxml import differences_gbxml

MODELS = [
    pytest.param(path, id=path.stem, marks=pytest.mark.slow if path.suffix == ".zip" else ())
    for kind in ("*.xml", "*.zip")
    for path in sorted(GBXML_MODELS.rglob(kind))
]


@pytest.mark.parametrize("path", MODELS)
def test_models_are_read_as_a_second_reader_finds_them(path):
    assert differences_gbxml(read(path), path) == []


@pytest.mark.parametrize("unit", ["Meters", "Feet", "Inches"])
def test_a_small_file_is_read_as_a_second_reader_finds_it(tmp_path, unit):
    path = tmp_path / "a.xml"
    path.write_text(gbxml(unit=f'lengthUnit="{unit}"'))
    assert differences_gbxml(read(path), path) == []


def test_openings_that_overlap_and_reach_beyond_count_once(tmp_path):
    path = tmp_path / "a.xml"
    wide = [(3, 0, 1), (5, 0, 1), (5, 0, 3), (3, 0, 3)]
    path.write_text(gbxml(openings=OPENINGS | {"wide": ("south", "FixedWindow", wide)}))
    assert differences_gbxml(read(path), path) == []


def test_openings_that_cut_off_an_end_of_their_wall(tmp_path):
    path = tmp_path / "a.xml"
    end = [(3, 0, -1), (5, 0, -1), (5, 0, 3), (3, 0, 3)]
    path.write_text(gbxml(openings={"end": ("south", "FixedWindow", end)}))
    assert differences_gbxml(read(path), path) == []


def test_faults_are_named(tmp_path):
    path = tmp_path / "a.xml"
    path.write_text(gbxml())
    scene = read(path)
    keys = [placed.guid for placed in scene.objects]
    (line,) = differences_gbxml(replace(scene, objects=scene.objects[1:]), path)
    assert repr(keys[0]) in line
    (line,) = differences_gbxml(replace(scene, objects=[*scene.objects, scene.objects[2]]), path)
    assert repr(keys[2]) in line
    (line,) = differences_gbxml(replace(scene, spaces=[]), path)
    assert "kitchen" in line
    south = scene.objects[keys.index("south")].definition_id
    mesh = scene.definitions[south].lods[0]
    definitions = list(scene.definitions)
    definitions[south] = replace(definitions[south], lods=(replace(mesh, faces=mesh.faces[:-1]),))
    (line,) = differences_gbxml(replace(scene, definitions=definitions), path)
    assert "'south'" in line


def test_words_that_differ_are_named(tmp_path):
    path = tmp_path / "a.xml"
    path.write_text(gbxml(unit='lengthUnit="Feet"', told=True).replace("<Level>low</Level>", ""))
    scene = read(path)
    assert differences_gbxml(scene, path) == []
    first, *others = scene.objects
    for changed in (replace(first, storey=None), replace(first, materials=("brick",))):
        (line,) = differences_gbxml(replace(scene, objects=[changed, *others]), path)
        assert line.startswith(f"{first.guid!r}: expected") and "Ground" in line
    (room,) = scene.spaces
    for changed in (replace(room, storey=NamedStorey("Ground", 0.0)), replace(room, long_name="x")):
        (line,) = differences_gbxml(replace(scene, spaces=[changed]), path)
        assert line.startswith("room 's1': expected the names 'kitchen' and ''")
