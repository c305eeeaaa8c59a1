"""Examples for users' tests: valid, near a coincidence, short to read."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import find, given, settings
from hypothesis import strategies as st
from viewcell.data.scene import Role
from viewcell.data.solids import is_closed
from viewcell.data.store.graph_folder import check_graph
from viewcell.data.verdict import Verdict
from viewcell.verify import strategies
from viewcell.verify.exact.region import region_visible
from viewcell.verify.exact.select import best_by_table
from viewcell.verify.exact.stab import stab
from viewcell.verify.strategies import WALL, Building, Door, buildings, knapsacks, occluded_pairs, portal_sequences

NAMES = {name: getattr(strategies, name) for name in ("PortalSequence", "OccludedPair", "Knapsack", "Building", "Door")}


@given(st.one_of(portal_sequences(), occluded_pairs(), knapsacks(), buildings(storeys=2)))
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
