import hashlib
from collections import Counter

import numpy as np
import pytest
import trimesh
from builders.closed import assert_closed
from scipy.spatial import cKDTree
from viewcell.data.buildings.furniture import FURNITURE
from viewcell.data.buildings.glb import write_glb
from viewcell.data.buildings.office import make_office
from viewcell.data.buildings.shapes import Ball, Box, Cylinder, pierced_block
from viewcell.data.buildings.statistics import LevelStatistic, level_statistics
from viewcell.data.errors import InputError
from viewcell.data.readers import read
from viewcell.data.scene import Definition, Instance, Mesh, Role, Scene, turned
from viewcell.data.store.scene_folder import read_scene, write_scene

# Funkhouser et al. 1996, Table 1: objects and polygons of each level.
TABLE_1 = {
    "Low": (14478, 240149),
    "MedLow": (3954, 256895),
    "Medium": (2497, 476957),
    "MedHigh": (949, 728978),
    "High": (437, 514813),
    "All": (14478, 1418807),
}


@pytest.fixture(scope="module")
def office() -> Scene:
    return make_office()


def test_default_size(office):
    kinds = Counter(placed.kind for placed in office.objects)
    assert 50 <= len(office.spaces) <= 70
    assert 1500 <= len(office.objects) <= 2500
    assert kinds["IfcSlab"] == 3 and kinds["IfcStair"] == 2 and kinds["IfcRoof"] == 1
    assert kinds["IfcDoor"] >= 50 and kinds["IfcWindow"] >= 50
    assert len(office.openings) >= kinds["IfcDoor"] + kinds["IfcWindow"]
    assert office.definitions[-1].lods and len(office.definitions) < 100


def test_same_arguments_same_scene(office):
    again = make_office()
    assert [x.name for x in again.objects] == [x.name for x in office.objects]
    np.testing.assert_array_equal(again.triangles()[0], office.triangles()[0])
    other = make_office(seed=1)
    assert (
        other.triangles()[0].shape != office.triangles()[0].shape
        or (other.triangles()[0] != office.triangles()[0]).any()
    )


@pytest.mark.parametrize(
    ("options", "digest"),
    [
        ({}, "b33718e16b688891175f413d0edf894d"),
        ({"floors": 2, "rooms_per_side": 2, "seed": 3}, "8fb661f83b81f3a8855a29450059b616"),
        ({"floors": 1, "rooms_per_side": 1, "furnished": False}, "cc40dbae444ed6ee18493826134ae360"),
    ],
)
def test_offices_of_earlier_versions_are_made_again(options, digest):
    """Published numbers are about them. Turned by 0 degrees and in one wing they are the same."""
    scene = make_office(**options, yaw_deg=0.0, wings=1)
    names = repr([placed.name for placed in scene.objects])
    found = hashlib.sha256(scene.triangles()[0].tobytes() + names.encode()).hexdigest()
    assert found.startswith(digest) and "yaw" not in scene.source


@pytest.mark.parametrize("yaw_deg", [17.0, -30.0, 90.0])
def test_a_turned_office_is_the_office_turned(yaw_deg):
    plain, scene = (make_office(floors=1, rooms_per_side=1, yaw_deg=yaw) for yaw in (0.0, yaw_deg))
    for number in range(0, len(plain.objects), 7):
        found, stood = (model.world_vertices(number) * model.grid_m for model in (scene, plain))
        np.testing.assert_allclose(found, turned(stood, yaw_deg), atol=2e-3)
    for room, stood in zip(scene.spaces, plain.spaces, strict=True):
        np.testing.assert_allclose(room.vertices, turned(stood.vertices, yaw_deg), atol=1e-12)
    assert len(scene.openings) == len(plain.openings)


@pytest.mark.parametrize(("floors", "rooms"), [(1, 1), (1, 5), (4, 2)])
def test_other_sizes(floors, rooms):
    scene = make_office(floors=floors, rooms_per_side=rooms, furnished=False)
    assert len(scene.spaces) == floors * (2 * rooms + 4)
    assert not scene.object_mask(Role.DETAIL).any()
    heights = scene.object_bounds()[:, 1, 2] * scene.grid_m
    assert heights.max() == floors * 3.5


def test_building_is_axial_closed_and_exact(office):
    shell = office.object_mask(Role.OCCLUDER, Role.TRANSPARENT)
    for object_id in np.flatnonzero(shell):
        world = office.world_vertices(object_id) * office.grid_m
        place = office.objects[object_id]
        mesh = office.definitions[place.definition_id].lods[0]
        np.testing.assert_array_equal(world, mesh.vertices + place.transform[:3, 3])
        finest = 64 if place.role is Role.TRANSPARENT else 32
        np.testing.assert_array_equal(world * finest, np.round(world * finest))
    triangles, owners = office.triangles()
    flat = (triangles[shell[owners]].max(axis=1) == triangles[shell[owners]].min(axis=1)).sum(axis=1)
    assert (flat == 1).all()
    for definition_id in {office.objects[i].definition_id for i in np.flatnonzero(shell)}:
        assert_closed(office.definitions[definition_id].lods[0])


def solids_around(scene: Scene, points: np.ndarray) -> np.ndarray:
    """How many occluders each point lies in, by crossings of the upward ray with horizontal faces."""
    triangles, owners = scene.triangles()
    keep = scene.object_mask(Role.OCCLUDER)[owners]
    corners, owners = triangles[keep] * scene.grid_m, owners[keep]
    level = (corners[:, :, 2].max(axis=1) == corners[:, :, 2].min(axis=1)).nonzero()[0]
    corners, owners = corners[level], owners[level]
    count = np.zeros(len(points), int)
    for i, point in enumerate(points):
        flat = corners[:, :, :2] - point[:2]
        there = flat[:, [1, 2, 0]]
        signs = np.sign(flat[:, :, 0] * there[:, :, 1] - flat[:, :, 1] * there[:, :, 0])
        hit = (np.abs(signs.sum(axis=1)) == 3) & (corners[:, 0, 2] > point[2])
        count[i] = (np.bincount(owners[hit]) % 2).sum() if hit.any() else 0
    return count


def test_solids_do_not_overlap_and_rooms_are_clear(office):
    rng = np.random.default_rng(0)
    bounds = office.object_bounds()[office.object_mask(Role.OCCLUDER)] * office.grid_m
    anywhere = rng.uniform(bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0), (1500, 3))
    # Aimed at joints: corners of walls, moved by less than a wall.
    joints = bounds[rng.integers(len(bounds), size=1500), rng.integers(2, size=1500)] + rng.uniform(
        -0.2, 0.2, (1500, 3)
    )
    assert solids_around(office, np.concatenate([anywhere, joints])).max() == 1
    rooms = [space for space in office.spaces if "stair" not in space.name]
    inside = [rng.uniform(room.vertices.min(axis=0), room.vertices.max(axis=0), (10, 3)) for room in rooms]
    assert solids_around(office, np.concatenate(inside)).max() == 0


@pytest.mark.parametrize("like", [None, "soda-hall"])
def test_every_room_can_be_reached_through_openings(like):
    scene = make_office(like=like, furnished=False)
    boxes = np.array([[s.vertices.min(axis=0), s.vertices.max(axis=0)] for s in scene.spaces])
    group = np.arange(len(boxes) + 1)  # the last is outdoors
    for low, high in scene.openings:
        touched = ((boxes[:, 0] <= high + 1e-9) & (boxes[:, 1] >= low - 1e-9)).all(axis=1).nonzero()[0].tolist()
        assert 1 <= len(touched) <= 2
        joined = {group[i] for i in (touched if len(touched) == 2 else [*touched, -1])}
        # A window lets nobody through.
        if low[2] % 3.5 == 0 or high[2] % 3.5 == 0:
            group[np.isin(group, list(joined))] = min(joined)
    assert len(set(group.tolist())) == 1


def test_stairs_climb_through_their_void(office):
    stairs = [i for i, placed in enumerate(office.objects) if placed.kind == "IfcStair"]
    for floor, object_id in enumerate(stairs):
        low, high = office.object_bounds()[object_id] * office.grid_m
        assert (low[2], high[2]) == (floor * 3.5, (floor + 1) * 3.5)
        tops = np.unique(office.world_vertices(object_id)[:, 2]) * office.grid_m
        assert np.diff(tops).max() <= 0.25
        void = [box for box in office.openings if box[1, 2] == high[2] and box[0, 2] == high[2] - 10 / 32]
        assert any((box[0, :2] <= low[:2]).all() and (box[1, :2] >= high[:2]).all() for box in void)


def test_furniture_stands_in_rooms(office):
    boxes = np.array([[s.vertices.min(axis=0), s.vertices.max(axis=0)] for s in office.spaces])
    for placed, (low, high) in zip(office.objects, office.object_bounds() * office.grid_m, strict=True):
        if placed.role is Role.DETAIL and placed.kind != "IfcDiscreteAccessory":
            inside = ((boxes[:, 0] <= low + 0.002) & (boxes[:, 1] >= high - 0.002)).all(axis=1)
            assert inside.sum() == 1, placed.name


def test_doors_and_glass_are_transparent(office):
    roles = {(placed.kind, placed.role) for placed in office.objects}
    clear = {kind for kind, role in roles if role is Role.TRANSPARENT}
    assert clear == {"IfcDoor", "IfcWindow"}
    assert {kind for kind, role in roles if role is Role.OCCLUDER} == {"IfcWall", "IfcSlab", "IfcStair", "IfcRoof"}


@pytest.mark.parametrize("seed", [0, 7])
def test_soda_hall_has_the_published_statistics(seed):
    scene = make_office(like="soda-hall", seed=seed)
    rows = {row.level: row for row in level_statistics(scene)}
    assert rows.keys() == TABLE_1.keys()
    for level, (objects, polygons) in TABLE_1.items():
        assert rows[level].objects == objects
        assert rows[level].polygons == pytest.approx(polygons, rel=0.05), level
    rooms = Counter(space.name.split()[1] for space in scene.spaces)
    assert rooms["office"] > 100 and rooms["lab"] == 12 and rooms["classroom"] == 6
    assert len({space.name[0] for space in scene.spaces}) == 7


def test_level_statistics_by_hand():
    def shape(*counts):
        return Definition("x", tuple(Mesh(np.zeros((3, 3)), np.zeros((n, 3), np.int32)) for n in counts))

    objects = [Instance("", "", i, np.eye(4), Role.DETAIL) for i in (0, 0, 1)]
    assert level_statistics(Scene([shape(5), shape(9, 2)], objects)) == [
        LevelStatistic("Low", 3, 12, 2, 4.0, 5),
        LevelStatistic("MedLow", 1, 9, 9, 9.0, 9),
        LevelStatistic("All", 3, 19, 5, 19 / 3, 9),
    ]
    assert level_statistics(Scene([], [])) == [LevelStatistic("All", 0, 0, 0, 0.0, 0)]


@pytest.mark.parametrize("piece", FURNITURE, ids=lambda piece: piece.name)
def test_levels_get_finer_and_stay_within_their_bound(piece):
    levels = piece.definition().lods
    counts = [len(mesh.faces) for mesh in levels]
    assert counts == sorted(counts, reverse=True) and len(set(counts)) == len(counts)
    errors = [mesh.error_m for mesh in levels]
    assert errors[0] == 0 and errors == sorted(errors)
    clouds = [trimesh.sample.sample_surface(trimesh.Trimesh(m.vertices, m.faces), 8000, seed=1)[0] for m in levels]
    for cloud, error in zip(clouds[1:], errors[1:], strict=True):
        away = max(cKDTree(cloud).query(clouds[0])[0].max(), cKDTree(clouds[0]).query(cloud)[0].max())
        assert away <= error + 0.05  # 0.05: gaps between the samples


@pytest.mark.parametrize(
    ("shape", "sides", "triangles", "volume"),
    [
        (Box((0, 0, 0), (1, 2, 3)), 1, 12, 6.0),
        (Cylinder((1, 1, 0), 0.5, 2.0), 64, 252, np.pi / 2),
        (Ball((1, 1, 5), 0.5), 64, 64 * 62, np.pi / 6),
    ],
)
def test_shapes_are_closed_and_fill_their_volume(shape, sides, triangles, volume):
    mesh = shape.mesh(sides)
    assert_closed(mesh)
    assert len(mesh.faces) == triangles
    assert trimesh.Trimesh(mesh.vertices, mesh.faces).volume == pytest.approx(volume, rel=0.01)


def test_pierced_block_is_closed_without_the_holes():
    holes = [np.array([[1, -1, 0], [2, 9, 2.0]]), np.array([[3, 0, 1], [4, 1, 2.0]])]
    mesh = pierced_block(np.zeros(3), np.array([5, 1, 3.0]), holes)
    assert_closed(mesh)
    assert trimesh.Trimesh(mesh.vertices, mesh.faces).volume == pytest.approx(15 - 2 - 1)


def test_office_survives_a_scene_folder(office, tmp_path):
    write_scene(office, tmp_path / "office.scene")
    again = read_scene(tmp_path / "office.scene")
    np.testing.assert_array_equal(again.triangles()[0], office.triangles()[0])
    assert level_statistics(again) == level_statistics(office)


def test_office_survives_a_glb(office, tmp_path):
    write_glb(office, tmp_path / "office.glb")
    again = read(tmp_path / "office.glb")
    assert len(again.triangles()[0]) == len(office.triangles()[0])
    found = {int(placed.name.split("|")[0]): i for i, placed in enumerate(again.objects)}
    shift = (office.origin - again.origin) / office.grid_m
    bounds, expected = again.object_bounds(), office.object_bounds() + shift.astype(int)
    for object_id, placed in enumerate(office.objects):
        twin = again.objects[found[object_id]]
        assert (twin.kind, twin.role) == (placed.kind, placed.role)
        assert np.abs(bounds[found[object_id]] - expected[object_id]).max() <= 1
    closed = read(tmp_path / "office.glb", doors="closed")
    assert {x.role for x in closed.objects if x.kind == "IfcDoor"} == {Role.OCCLUDER}
    assert {x.role for x in closed.objects if x.kind == "IfcWindow"} == {Role.TRANSPARENT}


def test_glb_that_cannot_be_written_is_one_clear_line(office, tmp_path):
    with pytest.raises(InputError, match="expected to be able to write"):
        write_glb(office, tmp_path / "nowhere" / "office.glb")
    with pytest.raises(InputError, match="found an empty scene"):
        write_glb(Scene([], []), tmp_path / "office.glb")


@pytest.mark.parametrize(
    "options",
    [
        {"floors": 0},
        {"floors": 101},
        {"rooms_per_side": 0},
        {"rooms_per_side": 501},
        {"seed": -1},
        {"like": "versailles"},
    ],
)
def test_unusable_arguments(options):
    with pytest.raises(InputError, match=f"{next(iter(options))}: expected .* found") as error:
        make_office(**options)
    assert "\n" not in str(error.value)
