"""The yaw of walls, and models that are turned: read as if they were not."""

from functools import cache

import numpy as np
import pytest
import trimesh
from builders import random_solids
from viewcell.data.buildings.glb import write_glb
from viewcell.data.buildings.office import make_office
from viewcell.data.frame import in_frame, wall_yaw
from viewcell.data.prepared import PreparedModel
from viewcell.data.readers import read
from viewcell.data.scene import boxes_around, turned
from viewcell.data.store.scene_folder import read_scene, write_scene
from viewcell.workbench.bake.run import bake
from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.check.run import check
from viewcell.workbench.cli import main
from viewcell.workbench.inspect.run import inspect
from viewcell.workbench.summary import summary

WALL = np.array([[0, 0, 0], [4, 0, 0], [4, 0, 3], [0, 0, 3]], float)
FACES = np.array([[0, 1, 2], [0, 2, 3]])


def wall(angle_deg, length=1.0):
    return turned(WALL * [length, 1, 1], angle_deg)


@pytest.mark.parametrize(
    ("angle_deg", "yaw_deg"),
    [(0, 0), (30, 30), (-30, -30), (60, -30), (90, 0), (200, 20), (1e-5, 0), (0.002, 0.002), (89.9995, -0.0005)],
)
def test_walls_stand_as_they_are_turned(angle_deg, yaw_deg):
    assert wall_yaw([(wall(angle_deg), FACES)]) == pytest.approx(yaw_deg, abs=1e-6)


def test_the_larger_area_counts_and_not_the_mean():
    assert wall_yaw([(wall(10, 3.0), FACES), (wall(100), FACES), (wall(0), FACES)]) == pytest.approx(10)
    houses = [(wall(0, 57), FACES), (wall(0.0084, 17), FACES), (wall(0.0177, 21), FACES)]
    assert wall_yaw(houses) == 0.0
    # Where directions begin again.
    assert wall_yaw([(wall(-0.0004), FACES), (wall(0.0004), FACES), (wall(20, 1.5), FACES)]) == pytest.approx(
        0, abs=1e-6
    )


def test_of_as_many_at_each_angle_those_along_the_axes_count():
    """The walls of a hexagon, and none by a digit more than the others."""
    for rounded in (-1e-12, 0.0, 1e-12):
        walls = [(wall(angle, 1.0 + rounded * (angle % 90 == 30)), FACES) for angle in range(0, 360, 60)]
        assert wall_yaw(walls) == 0.0
    assert wall_yaw([(wall(angle), FACES) for angle in (20, 80, 140)]) == pytest.approx(-10)


@pytest.mark.parametrize("off", [-1e-9, 0.0, 1e-9])
def test_a_digit_does_not_decide_for_a_quarter_turn(off):
    assert wall_yaw([(wall(45.0 + off), FACES)]) == 45.0


def test_floors_stand_nowhere():
    assert wall_yaw([(WALL[:, [0, 2, 1]], FACES)]) == 0.0 and wall_yaw([]) == 0.0


def house(path, yaw_deg=0.0, away=(0.0, 0.0, 0.0)):
    """Two rooms, a doorway between them, a chest in each; as an OBJ file, turned and moved."""
    boxes = {
        "floor": ([0, 0, -0.25], [8, 4, 0]), "roof": ([0, 0, 3], [8, 4, 3.25]),
        "south": ([0, -0.25, 0], [8, 0, 3]), "north": ([0, 4, 0], [8, 4.25, 3]),
        "west": ([-0.25, -0.25, -0.25], [0, 4.25, 3.25]), "east": ([8, -0.25, -0.25], [8.25, 4.25, 3.25]),
        "mid low": ([3.75, 0, 0], [4, 0.5, 3]), "mid high": ([3.75, 1.5, 0], [4, 4, 3]),
        "lintel": ([3.75, 0.5, 2], [4, 1.5, 3]),
        "chest a": ([0.5, 3, 0], [1, 3.5, 1]), "chest b": ([4.5, 3, 0], [5, 3.5, 1]),
    }  # fmt: skip
    lines, base = [], 1
    for name, (low, high) in boxes.items():
        mesh = random_solids.box(low, high)
        points = turned(np.array(mesh.vertices), yaw_deg) + away
        lines += [f"o {name}", *(f"v {x:.9f} {y:.9f} {z:.9f}" for x, y, z in points)]
        lines += ["f " + " ".join(str(base + i) for i in face) for face in mesh.faces]
        base += len(points)
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("away", [(0, 0, 0), (500_000, -2_600_000, 12)])
@pytest.mark.parametrize("yaw_deg", [17.0, 45.0, -30.0, 84.0])
def test_a_turned_house_is_baked_as_one_on_the_axes(yaw_deg, away, tmp_path):
    model = house(tmp_path / "turned.obj", yaw_deg, away)
    made = bake(model, tmp_path / "turned", threads=1)
    # Turned back by 45 degrees at most: what is left are quarters.
    back = made.manifest["yaw_deg"]
    quarters = round((yaw_deg - back) / 90.0)
    assert abs(back) < 45.001 and back == pytest.approx(yaw_deg - 90.0 * quarters, abs=1e-5)
    plain = bake(house(tmp_path / "plain.obj", 90.0 * quarters), tmp_path / "plain", threads=1)
    assert plain.manifest["yaw_deg"] == 0.0 and made.manifest["counts"] == plain.manifest["counts"]
    assert made.potential_objects.sum() == plain.potential_objects.sum()
    assert made.potential_cells.sum() == plain.potential_cells.sum()
    assert f"turned back by {back:g} degrees" in summary(made)
    # Its own claims stand, judged by the file.
    assert check(model, made.folder, made.folder, rays=20_000).ok
    again = bake(model, tmp_path / "turned", threads=1)
    assert again.folder == made.folder and again.manifest == made.manifest


def test_a_point_is_found_again_in_the_model(tmp_path):
    away = np.array([100.0, 200.0, 3.0])
    scene = read(house(tmp_path / "a.obj", 17.0, away), yaw="auto")
    chest = next(i for i, placed in enumerate(scene.objects) if placed.name == "chest a")
    middle = scene.object_bounds()[chest].mean(axis=0) * scene.grid_m
    np.testing.assert_allclose(scene.in_model(middle), turned(np.array([0.75, 3.25, 0.5]), 17.0) + away, atol=1e-3)
    write_scene(scene, tmp_path / "s.scene")
    assert read_scene(tmp_path / "s.scene").yaw_deg == scene.yaw_deg == pytest.approx(17.0)


def test_a_house_on_the_axes_is_not_touched(tmp_path):
    path = house(tmp_path / "a.obj")
    plain, auto = read(path), read(path, yaw="auto")
    for a, b in zip(plain.triangles(), auto.triangles(), strict=True):
        np.testing.assert_array_equal(a, b)
    assert plain.notes == auto.notes and auto.yaw_deg == 0.0


@pytest.mark.parametrize(("yaw", "form"), [("0", 1), ("5", 2)])
def test_boxes_of_the_model_are_prisms_in_a_turned_bake(yaw, form, tmp_path):
    """The box lies in the prism, what is claimed of one holds for the other, and eyes in it judge either frame."""
    path, table = house(tmp_path / "a.obj", 17.0), tmp_path / "cells.csv"
    table.write_text("min_x,min_y,min_z,max_x,max_y,max_z\n0.2,1.5,0.5,0.6,1.9,1\n")
    made = bake(path, tmp_path / "b", settings=Settings(cells=str(table)), threads=1)
    assert made.manifest["yaw_deg"] == 17.0 and made.manifest["format"] == 2
    (plan,) = made.graph.plans.corners * made.grid_m
    x, y, _ = made.in_model(np.column_stack([plan, np.zeros(4)])).T
    assert x.min() <= 0.2 and x.max() >= 0.6 and y.min() <= 1.5 and y.max() >= 1.9
    np.testing.assert_allclose(made.in_bake(made.in_model(plan_at := np.array([[1.0, 2.0, 3.0]]))), plan_at, atol=1e-12)
    plain = bake(path, tmp_path / "c", settings=Settings(cells=str(table), yaw=yaw), threads=1)
    assert plain.manifest["yaw_deg"] == float(yaw) and plain.manifest["format"] == form
    assert set(plain.seen(0)) <= set(made.potential(0)) and set(made.seen(0)) <= set(plain.potential(0))
    for claim in (made, plain):
        assert check(path, claim.folder, table, rays=20_000).ok
        assert check(path, claim.folder, claim.folder, rays=20_000).ok


@pytest.mark.parametrize("yaw", ["north", "inf", "400"])
def test_what_is_no_angle_is_one_line(yaw, tmp_path, capsys):
    assert main(["bake", str(house(tmp_path / "a.obj")), "--out", str(tmp_path / "b"), "--yaw", yaw]) == 2
    assert "yaw: expected auto or degrees" in capsys.readouterr().err and not (tmp_path / "b").exists()


def test_a_given_yaw_is_taken(tmp_path):
    scene = read(house(tmp_path / "a.obj", 17.0), yaw=-73.0)
    assert scene.yaw_deg == -73.0 and PreparedModel(scene).planes.axial_area > 0
    corner = trimesh.bounds.corners(scene.object_bounds()[0] * scene.grid_m)
    assert np.ptp(corner, axis=0)[:2] == pytest.approx([4.0, 8.0], abs=2e-3)


def pairs(made):
    """What a bake says of each pair, by ids."""
    objects, cells = made.cell_to_object, made.cell_to_cell
    return [
        list(zip(*(table[name].to_pylist() for name in names), strict=True))
        for table, names in (
            (objects, ("cell_id", "object_id", "verdict")),
            (cells, ("cell_id", "reached_cell_id", "verdict")),
        )
    ]


@pytest.fixture(scope="module")
def plain_pairs(tmp_path_factory):
    """Pairs of a bake of an office on the axes, which is made once for all angles."""

    @cache
    def of(**size):
        made = bake(make_office(**size), tmp_path_factory.mktemp("plain") / "plain", threads=1)
        assert made.manifest["yaw_deg"] == 0.0
        return pairs(made)

    return of


def assert_baked_alike(plain_pairs, tmp_path, yaw_deg, **size):
    scene = make_office(yaw_deg=yaw_deg, **size)
    write_scene(scene, tmp_path / "turned.scene")
    made = bake(tmp_path / "turned.scene", tmp_path / "turned", threads=1)
    assert made.manifest["yaw_deg"] == yaw_deg
    assert pairs(made) == plain_pairs(**size)
    # A scene is taken as its folder is: the bake is up to date.
    assert bake(scene, tmp_path / "turned", threads=1).manifest == made.manifest


@pytest.mark.parametrize("yaw_deg", [17.0, 45.0])
def test_a_turned_office_is_baked_as_one_on_the_axes(yaw_deg, plain_pairs, tmp_path):
    """Without furniture; the default office, with it, is among the slow tests."""
    assert_baked_alike(plain_pairs, tmp_path, yaw_deg, floors=2, rooms_per_side=1, furnished=False)


def test_claims_about_a_turned_scene_are_judged_in_the_frame_of_its_bake(tmp_path):
    scene = read(house(tmp_path / "a.obj", 17.0))
    write_scene(scene, tmp_path / "a.scene")
    made = bake(tmp_path / "a.scene", tmp_path / "a", threads=1)
    assert made.manifest["yaw_deg"] == pytest.approx(17.0)
    for model in (scene, tmp_path / "a.scene", made.folder):
        assert check(model, made.folder, made.folder, rays=5_000).ok


@pytest.mark.slow
@pytest.mark.parametrize("yaw_deg", [5.0, 17.0, 30.0, 45.0])
def test_the_default_office_turned_is_baked_as_one_on_the_axes(yaw_deg, plain_pairs, tmp_path):
    assert_baked_alike(plain_pairs, tmp_path, yaw_deg)


def test_scenes_are_turned_as_files_are(tmp_path):
    plain, scene = make_office(floors=1, rooms_per_side=1), make_office(floors=1, rooms_per_side=1, yaw_deg=17.0)
    back = in_frame(scene, "auto")
    np.testing.assert_array_equal(back.triangles()[0], plain.triangles()[0])
    assert back.yaw_deg == 17.0 and "17 degrees" in back.notes[-1]["why"] and scene.notes == []
    for room, stood in zip(back.spaces, plain.spaces, strict=True):
        np.testing.assert_allclose(room.vertices, stood.vertices, atol=1e-9)
    # Boxes around turned boxes: none is lost, and none grows by more than its own width.
    assert (back.openings[:, 0] <= plain.openings[:, 0] + 1e-9).all()
    assert (back.openings[:, 1] >= plain.openings[:, 1] - 1e-9).all()
    size = np.diff(plain.openings, axis=1)[:, 0, :2]
    assert (np.diff(back.openings, axis=1)[:, 0, :2] <= size.sum(axis=1, keepdims=True) + 1e-9).all()
    # What is turned already is not turned again, and a given angle is the whole angle.
    assert in_frame(back, "auto") is back and in_frame(back, 17.0) is back and in_frame(scene, 0.0) is scene
    write_scene(back, tmp_path / "back.scene")
    assert read(tmp_path / "back.scene", yaw=17.0).yaw_deg == 17.0
    np.testing.assert_allclose(read(tmp_path / "back.scene", yaw=27.0).objects[5].transform[:2, 0], turned(
        scene.objects[5].transform[:3, 0], -27.0)[:2], atol=1e-12)  # fmt: skip
    assert inspect(scene, estimate=False).scene.yaw_deg == 17.0


def test_a_box_around_a_turned_box():
    quarter = np.eye(4)
    quarter[:3, :3] = turned(np.eye(3), 90.0).T
    quarter[:3, 3] = 10, 0, 0
    found = boxes_around(np.array([[[1.0, 2, 3], [4, 6, 8]]]), quarter)
    np.testing.assert_allclose(found, [[[4.0, 1, 3], [8, 4, 8]]], atol=1e-12)


def test_a_turned_office_as_a_file_is_baked_as_one_on_the_axes(tmp_path):
    for name, yaw_deg in (("plain", 0.0), ("turned", 17.0)):
        scene = make_office(floors=1, rooms_per_side=1, furnished=False, yaw_deg=yaw_deg)
        write_glb(scene, tmp_path / f"{name}.glb")
    plain, made = (bake(tmp_path / f"{name}.glb", tmp_path / name, threads=1) for name in ("plain", "turned"))
    assert made.manifest["yaw_deg"] == pytest.approx(17.0, abs=1e-5)
    assert made.manifest["counts"]["cells"] == plain.manifest["counts"]["cells"]
    assert made.potential_objects.sum() == plain.potential_objects.sum()
