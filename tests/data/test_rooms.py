"""Rooms and their cells, and what is seen from rooms, against plain recounts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.graph import CellGraph
from viewcell.data.plans import NO_PLANS, Plans
from viewcell.data.room_cells import find_room_points
from viewcell.data.rooms import RoomCells, join_rooms, rooms_from_rooms, seen_from_rooms
from viewcell.data.rows import Rows
from viewcell.data.scene import GRID_M, Scene, Space
from viewcell.data.verdict import Verdict

METRE = round(1 / GRID_M)
ROOMS, CELLS, TARGETS = 4, 6, 5
FACES = [(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4), (1, 2, 6), (1, 6, 5)]
FACES += [(2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7)]


def room(name, low, high):
    """A box from (x, y, z) to (x, y, z) [m]."""
    ends = list(zip(low, high, strict=True))
    plan = [(0, 0), (1, 0), (1, 1), (0, 1)]
    corners = [[ends[0][i], ends[1][j], ends[2][k]] for k in (0, 1) for i, j in plan]
    return Space(name, np.array(corners, float), np.array(FACES, np.int32))


def graph_of(boxes, names, inhabitable=True, plans=NO_PLANS):
    """Cells [m] without portals."""
    count = len(boxes)
    cells = np.array(boxes, float).reshape(count, 2, 3) * METRE
    mask = np.broadcast_to(inhabitable, count).copy()
    none = np.zeros((0, 2), np.int32)
    flat = np.zeros(0, np.int8), np.zeros((0, 2, 3), np.int32)
    return CellGraph(cells.astype(np.int32), mask, np.array(names, object), none, *flat, plans)


def rooms_of(scene, graph, **options):
    """As `join_rooms`, without solids."""
    return join_rooms(scene, graph, find_room_points(scene, []), **options)


def cells_by_room(rooms):
    return [rooms.of(number).tolist() for number in range(rooms.count)]


HALL, BELOW, OTHER = (
    room("Flur", (0, 0, 0), (4, 3, 3)),
    room("Flur", (0, 0, -3), (4, 3, 0)),
    room("A, B", (4, 0, 0), (8, 3, 3)),
)
BOXES = [
    [[0, 0, 0], [4, 3, 3]],
    [[0, 0, -3], [4, 3, 0]],
    [[4, 0, 0], [8, 3, 2]],
    [[4, 0, 2], [8, 3, 3]],
    [[3, 0, 0], [5, 3, 3]],
    [[0, 0, 0], [4, 3, 3]],
]
NAMES = ["Flur", "Flur", "A, B", "A, B", "Flur, A, B", "Flur"]


def test_cells_belong_to_the_rooms_that_they_are_called_after_and_hold_a_part_of():
    """Two rooms of one name, one above the other; a comma in a name; one cell in two rooms; one nobody stands in."""
    graph = graph_of(BOXES, NAMES, [True] * 5 + [False])
    rooms = rooms_of(Scene([], [], [HALL, BELOW, OTHER, room("B", (0, 0, 0), (4, 3, 3))]), graph)
    # "B" is a part of the name "A, B" only by its letters: its place tells.
    assert cells_by_room(rooms) == [[0, 4], [1], [2, 3, 4], [4]]
    assert rooms.claims_rooms.all() and rooms.covered[:3].tolist() == [1, 1, 1] and 0.2 < rooms.covered[3] < 0.3


def test_cells_without_rooms_in_their_names_belong_by_their_place():
    graph = graph_of([*BOXES, [[9, 0, 0], [12, 3, 3]]], ["x"] * 7)
    rooms = rooms_of(Scene([], [], [HALL, OTHER]), graph, named=False, claims=False)
    assert cells_by_room(rooms) == [[0, 4, 5], [2, 3, 4]] and not rooms.claims_rooms.any()
    # A room's own corner is enough, and a sliver of a cell that holds none of the cell's own samples.
    graph = graph_of([[[3.8, 2.8, 0], [40, 30, 3]]], [""])
    assert cells_by_room(rooms_of(Scene([], [], [HALL]), graph, named=False)) == [[0]]


def test_a_room_with_a_cell_at_an_angle_claims_nothing_of_rooms():
    diamond = np.array([[[2, 0], [4, 1.5], [2, 3], [0, 1.5]]]) * METRE
    plans = Plans(np.array([1]), diamond.astype(np.int32))
    graph = graph_of([[[0, 0, -3], [4, 3, 0]], [[0, 0, 0], [4, 3, 3]]], ["Flur", "Flur"], plans=plans)
    rooms = rooms_of(Scene([], [], [HALL, BELOW, OTHER]), graph)
    assert cells_by_room(rooms) == [[1], [0], []] and rooms.claims_rooms.tolist() == [False, True, False]
    # A diamond is half of its box.
    assert rooms.covered[0] == pytest.approx(0.5, abs=0.03) and rooms.covered[2] == 0


PAIRS = st.dictionaries(
    st.tuples(st.integers(0, CELLS - 1), st.integers(0, TARGETS - 1)),
    st.sampled_from([Verdict.VISIBLE, Verdict.UNKNOWN]),
)
SEEN = st.dictionaries(
    st.tuples(st.integers(0, CELLS - 1), st.integers(0, CELLS - 1)),
    st.sampled_from([Verdict.VISIBLE, Verdict.UNKNOWN]),
)
JOINS = st.lists(st.sets(st.integers(0, CELLS - 1), max_size=3), min_size=ROOMS, max_size=ROOMS)


def rows_of(pairs):
    ends = np.array(list(pairs), np.int64).reshape(-1, 2)
    rows = Rows.unseen(ends[:, 0], ends[:, 1])
    rows.verdict[:] = list(pairs.values())
    return rows


def joined(join, claims):
    starts = np.cumsum([0, *map(len, join)])
    cells = np.array([cell for own in join for cell in sorted(own)], np.int64)
    return RoomCells(starts, cells, np.ones(len(join)), np.array(claims, bool))


def listed(found):
    """Pairs as a dictionary, and that they come in order and once."""
    room, target, verdict = (column.tolist() for column in found)
    ends = list(zip(room, target, strict=True))
    assert ends == sorted(set(ends))
    return dict(zip(ends, verdict, strict=True))


def better(verdicts):
    return Verdict.VISIBLE if Verdict.VISIBLE in verdicts else Verdict.UNKNOWN


@given(JOINS, PAIRS)
def test_a_room_sees_what_its_cells_see(join, pairs):
    found = listed(seen_from_rooms(joined(join, [True] * ROOMS), rows_of(pairs)))
    for number, own in enumerate(join):
        for target in range(TARGETS):
            verdicts = [pairs[cell, target] for cell in own if (cell, target) in pairs]
            assert found.get((number, target)) == (better(verdicts) if verdicts else None)


@given(JOINS, st.none() | SEEN, st.lists(st.booleans(), min_size=ROOMS, max_size=ROOMS))
def test_rooms_reach_each_other_by_their_cells(join, pairs, claims):
    """What no cell shows is hidden only between rooms that both claim it."""
    found = listed(rooms_from_rooms(joined(join, claims), None if pairs is None else rows_of(pairs)))
    for here, own in enumerate(join):
        for there, others in enumerate(join):
            verdicts = [(pairs or {}).get((a, b)) for a in own for b in others]
            verdicts = [verdict for verdict in verdicts if verdict is not None]
            if here == there and own:
                verdicts.append(Verdict.VISIBLE)
            if not (claims[here] and claims[there]):
                verdicts.append(Verdict.UNKNOWN)
            assert found.get((here, there)) == (better(verdicts) if verdicts else None)
