"""What `inspect` says of models with one fault each, in text and JSON, and its picture."""

import json
from dataclasses import replace

import pytest
from builders import random_solids
from viewcell.data import readers
from viewcell.data.buildings.arcade import make_arcade
from viewcell.data.buildings.office import make_office
from viewcell.data.errors import InputError
from viewcell.data.store.scene_folder import write_scene
from viewcell.workbench.cli import main
from viewcell.workbench.inspect.run import inspect
from viewcell.workbench.inspect.words import WIDTH

from .test_cells import two_rooms


@pytest.fixture(scope="module")
def office():
    return inspect(make_office(floors=1, rooms_per_side=2))


def test_an_office_fits_one_screen(office):
    lines = office.text().splitlines()
    assert office.ok and len(lines) <= 45 and max(map(len, lines)) <= WIDTH
    assert "second reader" not in office.text()
    assert len(office.scene.spaces) == len(office.json()["rooms"])
    assert any(line.startswith("bake") and "about" in line for line in lines)


def test_json_is_json(office):
    found = json.loads(json.dumps(office.json()))
    assert found["ok"] and sum(row["count"] for row in found["objects"]) == len(office.scene.objects)
    assert found["cells"]["inhabitable"] > 0 and found["directions"]["axial"] > 0.5


def test_a_fault_has_its_price_and_its_cure():
    scene = two_rooms()
    found = inspect(scene, estimate=False)
    (crack,) = [warning for warning in found.warnings if "crack" in warning.what]
    assert "16 mm by 4.0 m" in crack.what and "--seal" in crack.do and crack.costs
    assert "not tried" in found.text() and crack.do.split()[0] in found.text()


def test_how_faces_stand_is_told():
    """The arcade's are as the paper's; one wall of another scene misses its axis by two steps."""
    arcade = inspect(make_arcade(furnished=False), estimate=False)
    assert "118 non-axial" in arcade.text() and "9 non-axial elements in 9 clusters" in " ".join(arcade.text().split())
    assert arcade.json()["faces"]["counts"][1:] == (0, 118)
    house = two_rooms()
    house.definitions[6].lods[0].vertices[4:, 1] += (
        2 * house.grid_m * (house.definitions[6].lods[0].vertices[4:, 0] > 4)
    )
    found = inspect(house, estimate=False)
    assert "% 1 to 3 grid steps off" in found.text() and found.json()["faces"]["walls_m2"][1] > 0


def test_what_lies_far_away_is_named():
    scene = two_rooms()
    far = random_solids.scene_of_meshes([random_solids.box([4000, 4000, 0], [4001, 4001, 1])])
    far.objects[0] = replace(far.objects[0], name="survey point", definition_id=len(scene.definitions))
    scene.definitions += far.definitions
    scene.objects += far.objects
    (stray,) = [warning for warning in inspect(scene, estimate=False).warnings if "far from" in warning.what]
    assert "survey point" in stray.what and "--leave-out" in stray.do


def moved(scene):
    scene.origin[0] += 1.0
    return scene


def test_what_lies_on_its_side_is_told(tmp_path):
    box = random_solids.box([0, 0, 0], [20, 6, 30])
    (tmp_path / "side.obj").write_bytes(box.export(file_type="obj").encode())
    for up, told in ((None, True), ("y", False)):
        found = inspect(tmp_path / "side.obj", estimate=False, up=up)
        assert any("--up y" in warning.do for warning in found.warnings) == told


def test_the_second_reader_is_heard(tmp_path, monkeypatch, capsys):
    (tmp_path / "box.obj").write_bytes(random_solids.box([0, 0, 0], [4, 4, 4]).export(file_type="obj").encode())
    arguments = ["inspect", str(tmp_path / "box.obj"), "--referee", "--no-estimate", "--unit", "foot"]
    assert main(arguments) == 0 and "agrees" in capsys.readouterr().out
    # The first reader goes wrong by a metre.
    read = readers.read
    monkeypatch.setattr(readers, "read", lambda *path, **options: moved(read(*path, **options)))
    assert main(arguments) == 1
    assert "1 difference" in (said := capsys.readouterr().out) and "not fit to bake" in said


def test_the_command(tmp_path, capsys):
    write_scene(two_rooms(), tmp_path / "rooms.scene")
    picture = tmp_path / "plan.png"
    assert main(["inspect", str(tmp_path / "rooms.scene"), "--no-estimate", "--picture", str(picture)]) == 0
    assert "fit to bake, but" in capsys.readouterr().out and picture.read_bytes()[:4] == b"\x89PNG"
    assert main(["inspect", str(tmp_path / "rooms.scene"), "--no-estimate", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["result"]["cracks"][0]["rooms"]


@pytest.mark.parametrize(
    ("arguments", "said"), [(["--picture", "a.pdf"], ".png or .svg"), (["--referee"], "second time")]
)
def test_what_cannot_be_done_is_one_line(arguments, said, tmp_path, capsys):
    write_scene(two_rooms(), tmp_path / "rooms.scene")
    assert main(["inspect", str(tmp_path / "rooms.scene"), "--no-estimate", *arguments]) == 2
    printed = capsys.readouterr()
    assert said in printed.err and printed.err.count("\n") == 1 and not printed.out


def test_a_scene_has_no_second_reader():
    with pytest.raises(InputError, match="second time"):
        inspect(two_rooms(), referee=True, estimate=False)
