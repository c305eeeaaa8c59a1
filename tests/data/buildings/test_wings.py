"""Offices joined end to end: frames, foyers without a gap, and sight from one wing into the next."""

import numpy as np
import pytest
from builders.closed import assert_closed, assert_rooms_are_clear, assert_sealed, assert_solid
from viewcell.data.buildings.furnish import turned
from viewcell.data.buildings.office import make_office
from viewcell.data.buildings.plans import office_plan
from viewcell.data.buildings.shell import OUTER_WALL_M, Shell
from viewcell.data.buildings.wings import join_wings
from viewcell.data.errors import InputError
from viewcell.data.scene import Role
from viewcell.workbench.bake.run import bake


def test_frames_by_hand():
    (first, second), (joint,) = join_wings((10.0, 4.0), 2, 90.0, np.eye(4), gap=2.0)
    np.testing.assert_array_equal(first, np.eye(4))
    # Turned left: the nearest corners are the north-east one of the first wing, the north-west one of the second.
    near = np.array([10.0, 4.0]) + 2.0 * np.sqrt(0.5)
    np.testing.assert_allclose((second @ [0, 4, 0, 1])[:2], near, atol=1e-12)
    np.testing.assert_allclose(second[:2, 0], [0, 1], atol=1e-12)
    outline = [[10, 4], near, (second @ [0, 0, 0, 1])[:2], [10, 0]]
    np.testing.assert_allclose(joint.corners(), outline, atol=1e-12)
    # To the right it is the mirror image.
    (_, right), (mirrored,) = join_wings((10.0, 4.0), 2, -90.0, np.eye(4), gap=2.0)
    np.testing.assert_allclose(mirrored.corners(), np.array(outline) * [1, -1] + [0, 4], atol=1e-12)
    np.testing.assert_allclose(right[:2, 0], [0, -1], atol=1e-12)


@pytest.mark.parametrize(
    ("wings", "angle_deg", "floors"),
    [(2, 30.0, 1), (3, 30.0, 2), (2, -75.0, 1), (3, 17.3, 1), (2, 0.0, 2), (2, 120, 1)],
)
def test_a_foyer_closes_the_gap(wings, angle_deg, floors):
    scene = make_office(
        floors=floors, rooms_per_side=1, furnished=False, yaw_deg=3.0, wings=wings, wing_angle_deg=angle_deg
    )
    for shape in scene.definitions:
        assert_closed(shape.lods[0])
    foyers = [space for space in scene.spaces if "foyer" in space.name]
    corridors = [space for space in scene.spaces if "corridor" in space.name]
    assert len(foyers) == floors * (wings - 1) and len(corridors) == floors * wings
    assert len({placed.name for placed in scene.objects}) == len(scene.objects)
    assert_sealed(scene, foyers + corridors)
    assert_rooms_are_clear(scene, [space for space in scene.spaces if "stair" not in space.name])


@pytest.mark.parametrize("angle_deg", [30.0, -75.0, 17.3, 0.0, 120.0])
def test_a_foyer_leaves_no_slit(angle_deg):
    """Its parts and a wing are rounded in different frames, so that they must reach into each other."""
    rng = np.random.default_rng(0)
    scene = make_office(floors=1, rooms_per_side=1, furnished=False, yaw_deg=3.0, wings=2, wing_angle_deg=angle_deg)
    size = Shell(office_plan(1, 1), rng).footprint()
    (joint,) = join_wings(size, 2, angle_deg, turned(np.zeros(3), np.radians(3.0)))[1]
    walls = np.array([[0.002, OUTER_WALL_M - 0.002], joint.depth - np.array([OUTER_WALL_M - 0.002, 0.002])])
    points = []
    for end in (0, 1):
        depths = rng.uniform(*walls[rng.integers(2, size=2000)].T)
        x = joint.gap * end + (2 * end - 1) * depths * joint.slope + rng.uniform(-0.0015, 0.0015, 2000)
        y = -depths if angle_deg >= 0 else depths
        points.append(np.column_stack([x, y, rng.uniform(0.01, 3.15, 2000), np.ones(2000)]))
        # Slab and roof, over the whole end.
        depths = rng.uniform(0.002, joint.depth - 0.05, 2000)
        x = joint.gap * end + (2 * end - 1) * depths * joint.slope + rng.uniform(-0.001, 0.001, 2000)
        y = -depths if angle_deg >= 0 else depths
        points.append(np.column_stack([x, y, rng.uniform(-0.3, -0.01, 2000), np.ones(2000)]))
    assert_solid(scene, (np.concatenate(points) @ joint.frame.T)[:, :3])


def test_the_first_wing_is_the_office_itself():
    alone, joined = (make_office(floors=1, rooms_per_side=2, wings=wings) for wings in (1, 2))
    first = {placed.name: i for i, placed in enumerate(joined.objects)}
    moved, lost = 0, []
    for number, placed in enumerate(alone.objects):
        other = first.get(f"A {placed.name}")
        if other is None:
            lost.append(placed.name)
            continue
        same = np.array_equal(alone.world_vertices(number).max(axis=0), joined.world_vertices(other).max(axis=0))
        moved += not same
    # The wall at the end of the corridor has a passage, where its window was.
    assert lost == ["window 1 of east wall 1.2"]
    assert moved == 0 and len(joined.spaces) == 2 * len(alone.spaces) + 1


@pytest.mark.parametrize("angle_deg", [30.0, pytest.param(-50.0, marks=pytest.mark.slow)])
def test_one_wing_is_seen_from_the_other(angle_deg, tmp_path):
    scene = make_office(floors=1, rooms_per_side=1, furnished=False, wings=2, wing_angle_deg=angle_deg)
    made = bake(scene, tmp_path / "wings", threads=1)
    table = made.cell_to_object
    columns = (table[name].to_pylist() for name in ("cell_id", "object_id", "verdict"))
    names = made.graph.cell_names
    seen = {
        (names[cell], scene.objects[k].name) for cell, k, verdict in zip(*columns, strict=True) if verdict == "visible"
    }
    for corridor, other in (("A 1.1 corridor", "B "), ("B 1.1 corridor", "A ")):
        across = [name for room, name in seen if room == corridor and name.startswith(other)]
        assert any("wall" in name for name in across)
        assert (corridor, "outer wall of A-B foyer 1") in seen


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"wings": 0}, "wings: expected 1 to 12, found 0"),
        ({"wings": 13}, "wings: expected 1 to 12, found 13"),
        ({"wings": 2, "wing_angle_deg": 121.0}, "wing_angle_deg: expected -120 to 120, found 121"),
        ({"wings": 2, "wing_angle_deg": float("nan")}, "wing_angle_deg: expected -120 to 120, found nan"),
        (
            {"wings": 8, "wing_angle_deg": 60.0},
            "expected wings that stand clear of each other, found wing A and wing G",
        ),
        ({"wings": 4, "wing_angle_deg": -120.0}, "expected wings that stand clear of each other, found"),
        ({"wings": 2, "like": "soda-hall"}, "wings: expected 1 beside like 'soda-hall', found 2"),
        ({"yaw_deg": float("inf")}, "yaw_deg: expected degrees up to 360, found inf"),
    ],
)
def test_wings_that_cannot_be_are_one_line(options, words):
    with pytest.raises(InputError) as error:
        make_office(**({"floors": 1, "rooms_per_side": 1} if "like" not in options else {}) | options)
    assert words in str(error.value) and "\n" not in str(error.value)


def test_doors_and_panes_of_all_wings_let_sight_pass():
    scene = make_office(floors=1, rooms_per_side=1, wings=2)
    clear = {placed.kind for placed in scene.objects if placed.role is Role.TRANSPARENT}
    assert clear == {"IfcDoor", "IfcWindow"}
    assert sum(placed.name.startswith("window of A-B foyer") for placed in scene.objects) == 1
