import numpy as np
import pytest
from builders.closed import assert_closed, assert_rooms_are_clear, assert_sealed, assert_solid
from viewcell.data.buildings.rotunda import make_rotunda
from viewcell.data.errors import InputError
from viewcell.data.scene import Role
from viewcell.data.solids import winding_numbers
from viewcell.data.store.scene_folder import read_scene, write_scene


@pytest.mark.parametrize("sides", [3, 4, 6, 7, 24, 64])
def test_any_number_of_sides(sides):
    scene = make_rotunda(sides=sides)
    for shape in scene.definitions:
        if len(shape.lods) == 1:
            assert_closed(shape.lods[0])
    names = [space.name for space in scene.spaces]
    assert len(names) == len(set(names)) == sides + 2 and {"corridor", "court", "1 hall"} <= set(names)
    assert len({placed.name for placed in scene.objects}) == len(scene.objects)
    walls = [placed for placed in scene.objects if placed.kind == "IfcWall"]
    assert len(walls) == 4 * sides and len(scene.definitions) < 50


@pytest.mark.parametrize(("sides", "seed"), [(3, 0), (6, 0), (6, 1), (24, 2)])
def test_rooms_are_clear_and_closed(sides, seed):
    scene = make_rotunda(sides=sides, seed=seed, furnished=False)
    rooms = scene.spaces if sides < 24 else scene.spaces[::4]
    assert_rooms_are_clear(scene, rooms)
    # The court is open to the sky.
    assert_sealed(scene, [space for space in rooms if space.name != "court"])


@pytest.mark.parametrize("sides", [3, 6, 7, 24])
def test_walls_leave_no_slit_where_they_meet(sides):
    """Each is rounded in a frame of its own."""
    rng = np.random.default_rng(0)
    scene = make_rotunda(sides=sides, furnished=False)
    room = max(5.0, np.ceil(2.0 / np.tan(np.pi / sides) * 32) / 32)
    secant, slope, half = 1 / np.cos(np.pi / sides), np.tan(np.pi / sides), 0.125
    # On the planes through the corners, in the walls of the court, the corridor and the outside.
    bands = np.array([[room - 2.75, room - 2.5], [room - 0.25, room], [room + 4.75, room + 4.75 + 10 / 32]]) * secant
    along = rng.uniform(*(bands + np.array([0.003, -0.003]))[rng.integers(3, size=4000)].T)
    corners = np.column_stack([along, rng.uniform(-0.0015, 0.0015, 4000), rng.uniform(0.01, 3.15, 4000)])
    # And where a partition begins and ends, over its width, on both sides of the face that it meets.
    across = rng.uniform(-half + 0.002, half - 0.002, 4000)
    faces = np.array([room * secant, (room + 4.75) * secant])[rng.integers(2, size=4000)] - np.abs(across) * slope
    ends = np.column_stack([faces + rng.uniform(-0.0015, 0.0015, 4000), across, rng.uniform(2.2, 3.15, 4000)])
    points = np.concatenate([corners, ends])
    turn = (rng.integers(sides, size=len(points)) + 0.5) * 2 * np.pi / sides
    x = np.cos(turn) * points[:, 0] - np.sin(turn) * points[:, 1]
    y = np.sin(turn) * points[:, 0] + np.cos(turn) * points[:, 1]
    assert_solid(scene, np.column_stack([x, y, points[:, 2]]))


def test_every_room_has_a_door_to_the_corridor():
    scene = make_rotunda(sides=6, furnished=False)
    boxes = {space.name: space.vertices[space.faces] for space in scene.spaces}
    reached = set()
    for low, high in scene.openings[scene.openings[:, 0, 2] == 0.0]:
        middle, reach = (low + high) / 2 * [1, 1, 0] + [0, 0, 1], 0.4
        turn = np.arctan2(middle[1], middle[0])
        ways = [middle + sign * reach * np.array([np.cos(turn), np.sin(turn), 0]) for sign in (1, -1)]
        beside = {name for name, faces in boxes.items() if (winding_numbers(np.array(ways), faces) > 0.5).any()}
        reached |= beside if "corridor" in beside else set()
    assert reached >= {space.name for space in scene.spaces}


def test_furniture_stands_in_its_room_and_is_turned_with_it():
    scene = make_rotunda(sides=6)
    rooms = {space.name: space.vertices[space.faces] for space in scene.spaces}
    used = set()
    for number, placed in enumerate(scene.objects):
        if placed.role is Role.DETAIL and placed.kind != "IfcDiscreteAccessory":
            points = scene.world_vertices(number) * scene.grid_m
            middle = points.mean(axis=0)[None]
            inside = [name for name, faces in rooms.items() if winding_numbers(middle, faces)[0] > 0.5]
            assert len(inside) == 1, placed.name
            used |= set(inside)
            if placed.name.startswith(("desk", "shelf")):
                side = int(inside[0].split()[0]) - 1
                angle = np.degrees(np.arctan2(placed.transform[1, 0], placed.transform[0, 0])) - 60.0 * side
                assert angle / 90.0 == pytest.approx(round(angle / 90.0), abs=1e-9)
    assert used == set(rooms) - {"corridor"}


def test_same_arguments_same_rotunda(tmp_path):
    scene, again, other = (make_rotunda(sides=5, seed=seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(scene.triangles()[0], again.triangles()[0])
    assert [p.name for p in scene.objects] != [p.name for p in other.objects]
    write_scene(scene, tmp_path / "r.scene")
    np.testing.assert_array_equal(read_scene(tmp_path / "r.scene").triangles()[0], scene.triangles()[0])


@pytest.mark.parametrize("options", [{"sides": 2}, {"sides": 65}, {"seed": -1}])
def test_unusable_arguments(options):
    with pytest.raises(InputError, match=f"{next(iter(options))}: expected .* found"):
        make_rotunda(**options)
