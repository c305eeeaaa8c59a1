import os
import subprocess
import sys
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
import pytest
from builders.awkward import GBXML_MODELS, boxes
from builders.gbxml_house import OPENINGS, SIDES, gbxml
from builders.mutated import mutated
from viewcell.data.errors import InputError
from viewcell.data.readers import read
from viewcell.data.scene import NamedStorey, Role, Scene


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def area(scene: Scene, guid: str) -> float:
    (placed,) = (placed for placed in scene.objects if placed.guid == guid)
    corners = (mesh := scene.definitions[placed.definition_id].lods[0]).vertices[mesh.faces]
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2


def refused(path: Path, **how) -> str:
    with pytest.raises(InputError) as error:
        read(path, **how)
    assert "\n" not in str(error.value) and str(path) in str(error.value)
    return str(error.value)


def test_a_room_has_its_surfaces_windows_and_doors(tmp_path):
    scene = read(write(tmp_path / "a.xml", gbxml()))
    roles = {placed.guid: (placed.name, placed.kind, placed.role) for placed in scene.objects}
    assert roles.keys() == {*SIDES, "window", "door"}
    assert roles["south"] == ("the south", "ExteriorWall", Role.OCCLUDER)
    assert roles["shade"][2] is Role.DETAIL
    assert roles["window"][2] is roles["door"][2] is Role.TRANSPARENT
    areas = {key: area(scene, key) for key in ("south", "north", "window", "door", "floor")}
    assert areas == pytest.approx({"south": 10 - 1 - 1.8, "north": 8, "window": 1, "door": 1.8, "floor": 12}, abs=0.01)
    assert (len(scene.openings), scene.skipped, scene.notes, scene.unit) == (3, [], [], "metre")
    closed = {placed.guid: placed.role for placed in read(tmp_path / "a.xml", doors="closed").objects}
    assert closed["door"] is Role.OCCLUDER and closed["window"] is Role.TRANSPARENT


@pytest.mark.parametrize("shell", [True, False])
def test_a_space_is_the_volume_of_its_shell_or_of_what_bounds_it(tmp_path, shell):
    scene = read(write(tmp_path / "a.xml", gbxml(shell=shell)))
    (room,) = scene.spaces
    assert room.name == "kitchen"
    corners = room.vertices[room.faces]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert volume == pytest.approx(4 * 3 * 2.5)


def test_a_space_that_nothing_bounds_is_listed(tmp_path):
    text = gbxml(shell=False).replace('spaceIdRef="s1"', 'spaceIdRef="s2"')
    scene = read(write(tmp_path / "a.xml", text))
    assert scene.spaces == [] and "'kitchen'" in scene.skipped[0]["what"] and scene.lost_rooms
    assert any("'s2'" in note["what"] for note in scene.notes)


def test_a_wall_between_two_spaces_bounds_both_from_its_sides(tmp_path):
    """Of the second space its back is the outside."""
    text = gbxml(shell=False).replace(
        '<AdjacentSpaceId spaceIdRef="s1"/>', '<AdjacentSpaceId spaceIdRef="s0"/><AdjacentSpaceId spaceIdRef="s1"/>'
    )
    (room,) = read(write(tmp_path / "a.xml", text)).spaces
    corners = room.vertices[room.faces]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert volume == pytest.approx(-4 * 3 * 2.5)


UNITS = {
    "Feet": 0.3048,
    "Inches": 0.0254,
    "Centimeters": 0.01,
    "Millimeters": 0.001,
    "Yards": 0.9144,
    "Miles": 1609.344,
}


@pytest.mark.parametrize("unit", UNITS)
def test_units_are_metres(tmp_path, unit):
    scene = read(
        write(tmp_path / "a.xml", gbxml(unit=f'lengthUnit="{unit}"')),
        grid_m=2.0**-14 if unit[0] != "M" else 0.001 if unit == "Miles" else 2.0**-16,
    )
    np.testing.assert_allclose(
        np.ptp(boxes(scene)["the south"], axis=0), np.array([4, 0, 2.5]) * UNITS[unit], atol=2e-3
    )


def test_no_unit_is_noted_and_an_unknown_one_refused(tmp_path):
    assert read(write(tmp_path / "a.xml", gbxml(unit=""))).notes[0]["what"] == "lengthUnit"
    assert "'Cubits'" in refused(write(tmp_path / "a.xml", gbxml(unit='lengthUnit="Cubits"')))
    assert "states its own" in refused(write(tmp_path / "a.xml", gbxml()), unit="feet")


@pytest.mark.parametrize("space", ['xmlns="http://other.org"', ""])
def test_any_namespace_will_do(tmp_path, space):
    text = gbxml().replace('xmlns="http://www.gbxml.org/schema"', space)
    assert len(read(write(tmp_path / "a.gbxml", text)).objects) == 9


def test_air_is_no_object(tmp_path):
    sides = SIDES | {"south": ("Air", SIDES["south"][1])}
    scene = read(write(tmp_path / "a.xml", gbxml(sides)))
    assert "south" not in {placed.guid for placed in scene.objects}
    assert "window" in {placed.guid for placed in scene.objects} and len(scene.spaces) == 1


def test_names_say_glass(tmp_path):
    text = gbxml().replace("<Name>the south</Name>", "<CADObjectId>Curtain Wall: Glass [1]</CADObjectId>")
    (south,) = (placed for placed in read(write(tmp_path / "a.xml", text)).objects if placed.guid == "south")
    assert south.role is Role.TRANSPARENT and "Glass" in south.why


def test_parts_are_left_out_as_asked(tmp_path):
    scene = read(write(tmp_path / "a.xml", gbxml()), leave_out="shade|the window")
    assert {placed.guid for placed in scene.objects} == {*SIDES, "door"} - {"shade"}
    assert [lost["what"] for lost in scene.skipped] == ["the window", "the shade"]
    assert area(scene, "south") == pytest.approx(10 - 1 - 1.8, abs=0.01)


def test_a_window_that_is_all_of_its_wall_leaves_none(tmp_path):
    openings = {"window": ("south", "FixedWindow", SIDES["south"][1])}
    scene = read(write(tmp_path / "a.xml", gbxml(openings=openings)))
    assert {placed.guid for placed in scene.objects} == {*SIDES, "window"} - {"south"}


FAULTS = {
    "an unknown type of surface": (('surfaceType="Shade"', 'surfaceType="Shad"'), 0, "'Shad'"),
    "an unknown type of opening": (('"FixedWindow"', '"OpeningWindow"'), 0, "'OpeningWindow'"),
    "an id twice": (('id="west"', 'id="east"'), 0, "several surfaces"),
    "a corner off the plane": (
        (
            "<Coordinate>4</Coordinate><Coordinate>-2</Coordinate><Coordinate>2.5<",
            "<Coordinate>4</Coordinate><Coordinate>-2</Coordinate><Coordinate>3<",
        ),
        0,
        "off its plane",
    ),
    "an opening off its wall": (
        ("<Coordinate>0</Coordinate><Coordinate>1<", "<Coordinate>0.5</Coordinate><Coordinate>1<"),
        0,
        "off",
    ),
    "a point with two coordinates": (
        ("<Coordinate>0</Coordinate><Coordinate>-2</Coordinate>", "<Coordinate>-2</Coordinate>"),
        1,
        "three",
    ),
    "no number": (("<Coordinate>-2</Coordinate>", "<Coordinate>two</Coordinate>"), 1, "float"),
    "no finite number": (("<Coordinate>-2</Coordinate>", "<Coordinate>1e999</Coordinate>"), 1, "metres"),
    "no area": (("<Coordinate>-1</Coordinate>", "<Coordinate>-2</Coordinate>"), 1, "area"),
}


@pytest.mark.parametrize("what", FAULTS)
def test_faults_are_listed_and_the_rest_is_read(tmp_path, what):
    (old, new), lost, word = FAULTS[what]
    assert old in gbxml()
    scene = read(write(tmp_path / "a.xml", gbxml().replace(old, new)))
    assert len(scene.objects) == 9 - lost
    assert any(word in line["why"] for line in (scene.skipped if lost else scene.notes))


def test_unknown_kinds_of_opening_hide_nothing(tmp_path):
    text = gbxml().replace('"NonSlidingDoor"', '"Porthole"')
    (door,) = (
        placed for placed in read(write(tmp_path / "a.xml", text), doors="closed").objects if placed.guid == "door"
    )
    assert door.role is Role.TRANSPARENT


LAUGHS = (
    "<!DOCTYPE a ["
    + '<!ENTITY x0 "ha">'
    + "".join(f'<!ENTITY x{i} "{f"&x{i - 1};" * 10}">' for i in range(1, 10))
    + "]>"
)


@pytest.mark.parametrize("head", [LAUGHS, '<!DOCTYPE a SYSTEM "file:///etc/passwd">', "<!DOCTYPE gbXML>"])
def test_entities_are_refused(tmp_path, head):
    text = gbxml(head=head).replace("the south", "&x9;" if head == LAUGHS else "a")
    assert "DOCTYPE" in refused(write(tmp_path / "a.xml", text))
    wide = tmp_path / "wide.xml"
    wide.write_bytes(text.replace('<?xml version="1.0"?>', "").encode("utf-16"))
    assert "DOCTYPE" in refused(wide)


@pytest.mark.parametrize("text", ["", "no XML", "<html/>", "<gbXML/>", gbxml()[:-20], gbxml({}, {})])
def test_what_is_no_gbxml_is_one_line(tmp_path, text):
    assert "expected" in refused(write(tmp_path / "a.xml", text))


def test_an_archive_is_read(tmp_path):
    with ZipFile(tmp_path / "a.zip", "w", ZIP_DEFLATED) as archive:
        archive.writestr("b.xml", gbxml())
    assert len(read(tmp_path / "a.zip").objects) == 9


SAME = """
import sys
from viewcell.data.readers import read
scene = read(sys.argv[1])
print(scene.sha256, [(o.name, o.guid, o.role.value) for o in scene.objects], scene.object_bounds().tolist())
print([s.vertices.tolist() for s in scene.spaces], scene.openings.tolist(), scene.skipped, scene.notes)
"""


def test_two_processes_read_the_same(tmp_path):
    text = gbxml(shell=False).replace('"s1"/>', '"s2"/><AdjacentSpaceId spaceIdRef="s3"/>', 1)
    path = write(tmp_path / "a.xml", text)
    command = [sys.executable, "-c", SAME, str(path)]
    first, second = (
        subprocess.run(command, env=os.environ | {"PYTHONHASHSEED": seed}, capture_output=True, check=True).stdout
        for seed in ("1", "2")
    )
    assert first == second and b"kitchen" not in first[:80]


COUNTS = {
    "bristol-clifton-downs-fixed": (750, 87, 0),
    "bristol-clifton-downs-broken": (756, 87, 3),
    "columbia": (742, 37, 0),
    "london-office": (568, 50, 0),
}


@pytest.mark.skipif(not GBXML_MODELS.exists(), reason=f"{GBXML_MODELS} is missing")
@pytest.mark.parametrize("name", COUNTS)
def test_models_are_read_whole(name):
    """The broken one with its three types that gbXML does not know."""
    (path,) = GBXML_MODELS.rglob(f"{name}.xml")
    scene = read(path)
    unknown = sum("does not know" in note["why"] for note in scene.notes)
    assert (len(scene.objects), len(scene.spaces), unknown) == COUNTS[name]
    assert not scene.lost_rooms


SEEDS = [*range(25), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(25, 500))]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_damaged_file_is_a_scene_or_one_line(tmp_path, seed):
    path = tmp_path / "a.xml"
    path.write_bytes(mutated(gbxml(openings=OPENINGS).encode(), seed))
    try:
        scene = read(path)
    except InputError as error:
        assert "\n" not in str(error)
    else:
        assert scene.objects


def test_storeys_and_materials_are_those_of_the_file(tmp_path):
    """Of a surface between two storeys none is said; a height that is no number is none."""
    path = tmp_path / "a.xml"
    path.write_text(gbxml(unit='lengthUnit="Feet"', told=True))
    scene = read(path)
    found = {placed.guid: (placed.storey, placed.materials) for placed in scene.objects}
    ground = NamedStorey("Ground", -1.5 * 0.3048)
    wall = ("brick & clay", "m2")
    sides = dict.fromkeys(("floor", "west", "east", "window", "door"), (ground, ()))
    assert found == sides | {
        "south": (ground, wall),
        "north": (ground, wall),
        "roof": (None, ()),
        "shade": (None, ("brick & clay",)),
    }
    assert [(room.name, room.guid, room.storey) for room in scene.spaces] == [("kitchen", "s1", ground)]
