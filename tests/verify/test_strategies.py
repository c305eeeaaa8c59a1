"""Examples for users' tests: valid, near a coincidence, short to read."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import find, given, settings
from hypothesis import strategies as st
from viewcell.data.scene import GRID_M, Role
from viewcell.data.solids import SolidIndex, closed_elements, is_closed, winding_numbers
from viewcell.data.store.graph_folder import check_graph
from viewcell.data.verdict import Verdict
from viewcell.verify import strategies
from viewcell.verify.exact.region import region_visible
from viewcell.verify.exact.select import best_by_table
from viewcell.verify.exact.stab import stab
from viewcell.verify.strategies import WALL, Building, Door, buildings, knapsacks, occluded_pairs, portal_sequences

NAMES = {name: getattr(strategies, name) for name in ("PortalSequence", "OccludedPair", "Knapsack", "Building", "Door")}


TURNS = (0.0, 17.0, 45.0, -30.0)


@given(st.one_of(portal_sequences(), occluded_pairs(), knapsacks(), buildings(storeys=2, yaw=TURNS, wings=3)))
def test_examples_can_be_pasted(example):
    text = repr(example)
    assert eval(text, dict(NAMES)) == example
    assert len(text) < 4000


@given(portal_sequences())
def test_portal_sequences_are_boxes(sequence):
    boxes = sequence.array()
    assert (boxes[:, 0] <= boxes[:, 1]).all() and len(boxes) >= 2 and np.abs(boxes).max() < 2**24


@given(occluded_pairs())
def test_occluded_pairs_are_valid(pair):
    assert (np.array(pair.cell[0]) < pair.cell[1]).all()
    for polygon in (pair.target, *pair.occluders):
        corners = np.array(polygon)
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[1])
        assert normal.any() and not ((corners - corners[0]) @ normal).any()


@pytest.mark.parametrize(
    ("strategy", "answer"),
    [
        (portal_sequences(), lambda s: (stab(s.array(), s.signs).verdict, stab(s.array(), s.signs).graze)),
        (occluded_pairs(), lambda p: region_visible(p.cell, p.target, p.occluders).verdict),
    ],
)
def test_both_answers_are_common(strategy, answer):
    found = []

    @settings(max_examples=60, database=None, derandomize=True)
    @given(strategy)
    def collect(example):
        found.append(answer(example))

    collect()
    shares = [found.count(value) / len(found) for value in set(found)]
    assert len(shares) >= 2 and min(shares) > 0.02


def test_joint_occlusion_is_found_and_shrinks():
    """Two polygons that hide together what neither hides alone."""

    def jointly(pair):
        def hidden(occluders):
            return region_visible(pair.cell, pair.target, occluders).verdict is Verdict.HIDDEN

        return len(pair.occluders) > 1 and hidden(pair.occluders) and not any(hidden([o]) for o in pair.occluders)

    options = settings(max_examples=2_000, database=None, derandomize=True)
    pair = find(occluded_pairs(), jointly, settings=options)
    assert len(pair.occluders) == 2 and len(repr(pair)) < 400


@pytest.mark.parametrize("shared", [2, 0])
def test_walls_come_in_pieces_that_meet_or_leave_a_slit(shared):
    def pieces(pair):
        return any(
            (a[0][0], a[0][2], a[3][2]) == (b[0][0], b[0][2], b[3][2])
            and len(set(a) & set(b)) == shared
            and b[0][1] - a[1][1] == (shared == 0)
            for a in pair.occluders
            for b in pair.occluders
            if a != b
        )

    assert find(occluded_pairs(), pieces, settings=settings(max_examples=2_000, database=None, derandomize=True))


@given(knapsacks())
def test_knapsacks_are_accepted(sack):
    best = best_by_table(sack.benefits, sack.costs, sack.budget)
    least = sum(min(costs) for costs in sack.costs)
    assert (best is None) == (least > sack.budget)


@given(buildings(storeys=2))
def test_buildings_are_solid(building):
    scene = building.scene
    low, high = np.array(building.solids).transpose(1, 0, 2)
    assert (low < high).all()
    # Pieces of walls touch but do not overlap, and no piece reaches into a room.
    both = (low[:, None] < high[None]).all(axis=2) & (high[:, None] > low[None]).all(axis=2)
    assert both.sum() == len(low)
    for space in scene.spaces:
        box = space.vertices[0] * 1024, space.vertices[-1] * 1024
        assert not ((low < box[1]).all(axis=1) & (high > box[0]).all(axis=1)).any()
    triangles, owners = scene.triangles()
    assert all(is_closed(triangles[owners == k]) for k in range(0, len(scene.objects), 7))
    # What is not solid, furniture apart, is room, doorway or outside.
    size = np.array(building.rooms) * strategies.MODULE + WALL
    volume = (high - low).prod(axis=1).sum() + sum((box[1] - box[0]).prod() for box in building.graph().cells)
    assert volume == size.prod()
    check_graph(building.graph(), "building")


@given(buildings(columns=2, yaw=TURNS, wings=3))
def test_wings_and_turned_buildings_are_whole(building):
    scene, rooms = building.scene, int(np.prod(building.rooms))
    triangles, owners = scene.triangles()
    assert all(is_closed(triangles[owners == k]) for k in range(len(scene.objects) - 1, 0, -5))
    assert len(scene.spaces) == rooms * building.wings + building.wings - 1
    table = building.view_cells
    boxes = np.array([[table[f"{end}_{axis}"] for axis in "xyz"] for end in ("min", "max")]).transpose(2, 0, 1)
    assert len(boxes) == rooms * building.wings and (boxes[:, 0] < boxes[:, 1]).all()
    # Each view cell lies in its room, corners included.
    wide = [space for space in scene.spaces if "room" in space.name]
    for box, space in zip(boxes, wide, strict=True):
        inner = (box - box.mean(axis=0)) * 0.99 + box.mean(axis=0)
        corners = inner[strategies.CORNERS, np.arange(3)]
        assert (winding_numbers(corners, space.vertices[space.faces]) > 0.5).all()
    if building.wings > 1:
        low, high = scene.object_bounds().min(axis=0)[0], scene.object_bounds().max(axis=0)[1]
        assert np.linalg.norm((high - low)[:2]) > np.linalg.norm(building.rooms[:2]) * strategies.MODULE


def test_a_building_on_the_axes_is_made_of_its_boxes():
    building = Building((2, 1, 1), (Door((0, 0, 0), 0, (0, 0), (100, 500)),), (((70, 70, 70), (90, 100, 80)),))
    boxes = building.scene.object_bounds()
    np.testing.assert_array_equal(boxes, np.array([*building.solids, *building.furniture]))
    assert [placed.name for placed in building.scene.objects][-2:] == [
        f"wall {len(building.solids) - 1}",
        "furniture 0",
    ]
    assert building.view_cells["max_x"] == [960 / 1024, 1984 / 1024] and building.view_cells["cell_id"] == [0, 1]


def test_a_passage_leads_from_wing_to_wing():
    door = Door((0, 0, 0), 0, (0, 0), (400, 700))
    open_, shut = (Building((1, 1, 1), doors, wings=2, wing_angle_deg=30.0) for doors in ((door,), ()))
    # The first wing is open at its east end, the second at its west end; both are closed at the others.
    assert len(open_.solids) == len(shut.solids) + 2
    for number, hole in ((0, [[1.0, 0.3, 0.3]]), (1, [[0.0, 0.3, 0.3]])):
        frame = open_.frames[0][number]
        points = (np.array(hole) @ frame[:3, :3].T + frame[:3, 3]) / GRID_M
        for building, outside in ((open_, True), (shut, False)):
            solid = SolidIndex(np.array([[points[0], points[0]]]), closed_elements(building.scene))
            assert solid.outside(points, 0)[0] == outside
    names = [placed.name for placed in open_.scene.objects]
    assert {name.split()[0] for name in names} == {"A", "B", "slab", "inner", "outer", "roof"}


def test_a_door_that_does_not_line_up_by_a_step():
    building = Building((3, 1, 1), (Door((0, 0, 0), 0, (0, 0), (100, 500)), Door((1, 0, 0), 0, (101, 0), (200, 500))))
    graph = building.graph()
    assert graph.cell_count == 5 and graph.portal_count == 4 and graph.inhabitable.all()
    assert [placed.role for placed in building.scene.objects].count(Role.DETAIL) == 0
    assert len(building.view_cells["cell_id"]) == 3


def test_without_hypothesis_there_is_a_clear_word():
    code = "import sys; sys.modules['hypothesis'] = None; import viewcell.verify.strategies"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "pip install viewcell[test]" in done.stderr
