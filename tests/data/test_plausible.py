"""Models in a wrong unit, or on their side, are noticed; buildings are not."""

import sys
from dataclasses import replace

import numpy as np
import pytest
import trimesh
import viewcell
from builders.places import SHARED
from viewcell import InputError
from viewcell.data.plausible import implausible
from viewcell.data.scene import Space
from viewcell.workbench.cli import main


def tower(storeys, height=3.0, side=12.0):
    """Slabs and four walls a storey, as one mesh [m]."""
    parts = []
    for level in range(storeys + 1):
        parts.append(trimesh.creation.box(bounds=[[0, 0, level * height - 0.2], [side, side, level * height]]))
    for level in range(storeys):
        low, high = level * height, (level + 1) * height - 0.2
        for a, b in (
            ((0, 0), (side, 0.2)),
            ((0, side - 0.2), (side, side)),
            ((0, 0), (0.2, side)),
            ((side - 0.2, 0), (side, side)),
        ):
            parts.append(trimesh.creation.box(bounds=[[*a, low], [*b, high]]))
    return parts


def written(folder, meshes, scale=1.0, names=()):
    """An OBJ file of meshes in a unit of 1 / scale m."""
    text, first = [], 1
    for number, mesh in enumerate(meshes):
        text.append(f"o {names[number] if number < len(names) else f'part{number}'}")
        text += [f"v {x} {y} {z}" for x, y, z in (mesh.vertices * scale).tolist()]
        text += [f"f {a + first} {b + first} {c + first}" for a, b, c in mesh.faces.tolist()]
        first += len(mesh.vertices)
    path = folder / "tower.obj"
    path.write_text("\n".join(text) + "\n")
    return path


@pytest.mark.parametrize(
    ("scale", "unit"),
    [(1.0, ""), (100.0, "centimetre"), (1000.0, "millimetre"), (1 / 0.0254, "inch"), (0.001, "kilometre")],
)
def test_storeys_tell_the_unit(scale, unit, tmp_path):
    path = written(tmp_path, tower(8), scale)
    found = implausible(viewcell.read(path, grid_m=2.0**-10 * max(scale, 1.0)))
    assert [fault.do for fault in found] == ([f"if its numbers are no metres: --unit {unit}"] if unit else [])
    if unit:
        assert "storeys are" in found[0].what and not implausible(viewcell.read(path, unit=unit))


def test_a_building_on_its_side_is_told(tmp_path):
    meshes = tower(1)
    for mesh in meshes:
        mesh.vertices = mesh.vertices[:, [0, 2, 1]] * [1, 1, -1]
    path = written(tmp_path, meshes)
    (fault,) = implausible(viewcell.read(path))
    assert fault.what == "it is lowest along y" and fault.do.endswith("--up y")
    assert not implausible(viewcell.read(path, up="y"))
    # A tower is highest along y; its doors say it.
    doors = [trimesh.creation.box(bounds=[[k, 0, 0], [k + 0.9, 2.1, 0.05]]) for k in range(1, 5)]
    standing = tower(8)
    for mesh in standing:
        mesh.vertices = mesh.vertices[:, [0, 2, 1]] * [1, 1, -1]
    path = written(tmp_path, doors + standing, names=[f"Door{k}" for k in range(4)])
    scene = viewcell.read(path)
    scene.objects[:4] = [replace(placed, kind="Door") for placed in scene.objects[:4]]
    (fault,) = implausible(scene)
    assert fault.what == "its doors are longest along y"


def test_rooms_and_doors_go_before_storeys(tmp_path):
    """The best evidence decides alone."""
    scene = viewcell.read(written(tmp_path, tower(8)))
    box = trimesh.creation.box(bounds=[[0, 0, 0], [5, 5, 100.0]])
    scene.spaces = [Space("hall", np.asarray(box.vertices), np.asarray(box.faces, np.int32))]
    (fault,) = implausible(scene)
    assert fault.what == "its rooms are 100 m high" and "--unit" in fault.do
    assert "the file says metre" in implausible(replace(scene, source="house.ifc"))[0].do
    assert not implausible(replace(scene, source=""))


@pytest.mark.slow
@pytest.mark.skipif(not (SHARED / "scenes").is_dir(), reason="shared scenes are not here")
@pytest.mark.parametrize("name", ["ifc/kit_edc_sb/KIT-EDC_with_SB.ifc"])
def test_real_buildings_are_plausible(name):
    assert not implausible(viewcell.read(SHARED / "scenes" / name))


def test_made_buildings_are_plausible():
    for scene in (viewcell.make_office(floors=1), viewcell.make_office(floors=2, rooms_per_side=2, wings=2)):
        assert not implausible(scene)


@pytest.mark.parametrize(
    ("command", "next_step"),
    [("bake", "workbench.bake.run.PreparedModel"), ("inspect", "workbench.inspect.run.PreparedModel")],
)
@pytest.mark.parametrize("bars", [False, True])
def test_it_is_said_before_hours_of_work(command, next_step, bars, tmp_path, monkeypatch, capsys):
    def begun(scene):
        raise InputError("the work begins")

    monkeypatch.setattr(f"viewcell.{next_step}", begun)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: bars, raising=False)
    assert main([command, str(written(tmp_path, tower(8, 0.4, 1.6)))]) == 2
    said = " ".join(capsys.readouterr().err.split())
    line = "warning: as it is read, its storeys are 0.2 m high; if its numbers are no metres: --unit "
    assert line in said and said.index(line) < said.index("viewcell: the work begins")


def test_bake_and_inspect_say_it(tmp_path, capsys):
    path = written(tmp_path, tower(8, 0.4, 1.6))
    assert main(["bake", str(path), "-o", str(tmp_path / "tower.bake")]) == 0
    assert (
        "warning: as it is read, its storeys are 0.2 m high; if its numbers are no metres: --unit "
        in capsys.readouterr().out
    )
    main(["inspect", str(path), "--no-estimate"])
    assert "as it is read, its storeys are 0.2 m high" in " ".join(capsys.readouterr().out.split())
