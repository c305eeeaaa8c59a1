"""Policies: each in the order that its paper gives."""

import numpy as np
import pytest
from builders.small_house import small_graph
from viewcell.solvers.walk.policies import NEAR_SHARE, POLICIES, SHARE, Now, Stock, first_of_each
from viewcell.solvers.walk.set_items import Balls, Motion, SetItems, Shelves

M = 1 / 1024
ROOMS = np.array([0, 2, 4, 5])
# Two objects in each room, the first with two levels: items 2 k and 2 k + 1 are its finest and coarsest.
OBJECTS = 8
STARTS = np.cumsum([0, *[2, 1] * 4])
ITEMS = np.arange(12)
SIZES = np.tile([300, 100, 100], 4)
NONE = np.zeros(12, bool)


def stock(capacity=10_000, limits=0):
    graph = small_graph()
    shelves = Shelves.of(STARTS, ITEMS, SIZES, SIZES // 10)
    # Each room sees its own objects and those of the next one.
    members = [[0, 1, 2, 3], [2, 3, 4, 5], [4, 5, 6, 7], [6, 7]]
    starts = np.cumsum([0, *map(len, members)])
    sets = SetItems.of(shelves, starts, np.concatenate(members), np.full(starts[-1], limits))
    middle = np.repeat(graph.cells[ROOMS].mean(axis=1) * M, 2, axis=0)
    boxes = np.stack([middle - 0.1, middle + 0.1], axis=1)
    motion, second = Motion(2.0, 180.0, 1.0), shelves.steps == 0
    return Stock(shelves, sets, Balls.around(boxes), graph, ROOMS, M, 0.6, motion, capacity, second)


def now(room=0, rows=(0, 1), seconds=(0.0, 0.5), shown=(0,), wanted=(0,), velocity=(1.4, 0, 0), forward=(1.0, 0, 0)):
    eye = small_graph().cells[ROOMS[room]].mean(axis=0) * M if room is not None else np.zeros(3)
    holders = np.array([] if room is None else [room], int)
    vectors = (np.array(one, float) for one in (eye, forward, velocity))
    shown, wanted = np.array(shown, int), np.array(wanted, int)
    urgent = stock().urgent(shown, wanted, np.full(len(shown), 50.0))
    return Now(*vectors, holders, np.array(rows), np.array(seconds), shown, wanted, urgent)


def test_coarse_first():
    policy = POLICIES["coarse-first"](stock())
    found = policy.ahead(now(), NONE)
    # What is shown, its coarsest level first; then coarsest levels as they come into view, then finer ones.
    assert found[:2].tolist() == [1, 0] and sorted(found.tolist()) == list(range(9))
    rest = found[2:]
    assert set(rest[:5].tolist()) == {2, 4, 5, 7, 8} and set(rest[5:].tolist()) == {3, 6}
    # Objects of the room ahead come before those of the one behind it.
    assert list(rest).index(4) < list(rest).index(7)
    cut = POLICIES["coarse-first"](stock(capacity=1000)).ahead(now(), NONE)
    assert SIZES[cut].sum() <= SHARE * 1000 and found[: len(cut)].tolist() == cut.tolist() and len(cut) == 7
    # From doorways only what is shown, and what can be reached.
    assert set(POLICIES["coarse-first"](stock()).ahead(now(None, (3,), (0.2,)), NONE).tolist()) == {0, 1, 9, 10, 11}


def test_what_is_held_needs_no_order_but_may_be_cut_off():
    policy, held = POLICIES["coarse-first"](stock()), np.isin(ITEMS, [2, 3, 4, 5, 7])
    whole, found = policy.ahead(now(), NONE).tolist(), policy.ahead(now(), held).tolist()
    absent = [item for item in whole if item in (0, 1) or not held[item]]
    assert found[: len(absent)] == absent and sorted(found) == sorted(whole)
    small = POLICIES["coarse-first"](stock(capacity=1000))
    assert sorted(small.ahead(now(), held)) == sorted(small.ahead(now(), NONE))


def test_turning_comes_before_walking():
    """Of two objects as near the one in view comes first."""
    policy = POLICIES["coarse-first"](stock())
    back = policy.ahead(now(room=1, rows=(0, 2), seconds=(0.5, 0.5), shown=(), wanted=(), forward=(-1.0, 0, 0)), NONE)
    front = policy.ahead(now(room=1, rows=(0, 2), seconds=(0.5, 0.5), shown=(), wanted=()), NONE)
    coarse = [1, 2, 7, 8]
    assert [i for i in back if i in coarse][:2] == [1, 2] and [i for i in front if i in coarse][:2] == [7, 8]


def test_as_published_takes_whole_cells_until_the_memory_is_claimed():
    kind = POLICIES["as-published"]
    assert not kind.bounded and sorted(kind(stock()).ahead(now(), NONE).tolist()) == list(range(9))
    # The first cell alone is more than there is: it comes whole, the next one not.
    found = kind(stock(capacity=500)).ahead(now(), NONE)
    assert sorted(found.tolist()) == list(range(6)) and SIZES[found].sum() > 500
    steps = Shelves.of(STARTS, ITEMS, SIZES, SIZES).steps[found]
    assert (np.diff(steps) >= 0).all()
    assert found[0] == 1


def test_vlod_holds_the_cell_and_its_neighbours_at_their_own_levels():
    policy = POLICIES["vlod"](stock(limits=0))
    # Room 2 is next to room 0, room 4 is not; the eye's own cell comes first.
    found = policy.ahead(now(0), NONE)
    assert found.tolist() == [0, 2, 3, 5, 6, 8]
    # In the doorway nothing is known, and nothing changes; nor while the eye stays.
    assert policy.ahead(now(None), NONE) is found and policy.ahead(now(0, forward=(-1.0, 0, 0)), NONE) is found
    assert set(policy.ahead(now(1), NONE).tolist()) == {0, 2, 3, 5, 6, 8, 9, 11}
    assert POLICIES["vlod"](stock(capacity=450)).ahead(now(0), NONE).tolist() == [0, 2]


def test_mmr_goes_along_the_path_or_in_a_spiral():
    policy = POLICIES["mmr"](stock())
    fast = policy.ahead(now(1), NONE)
    # Coarsest levels of the cell, then what does; of cells behind nothing.
    assert fast[:3].tolist() == [4, 5, 7] and not {1, 2} & set(fast.tolist()) and {9, 10, 11} < set(fast.tolist())
    slow = policy.ahead(now(1, velocity=(0.1, 0, 0)), NONE)
    assert {1, 2, 10, 11} < set(slow.tolist())
    assert policy.ahead(now(None), NONE) is slow


def test_mmr_keeps_its_queue_until_the_view_has_turned_by_30_degrees():
    policy = POLICIES["mmr"](stock())
    at = [(np.cos(a), np.sin(a), 0.0) for a in np.radians([0, 25, 50, 81])]
    queues = [policy.ahead(now(1, forward=forward), NONE) for forward in at]
    assert queues[0] is queues[1] is queues[2] and queues[3] is not queues[2]


def test_mmr_has_two_caches():
    small = POLICIES["mmr"](stock(capacity=1400)).ahead(now(1), NONE)
    steps = Shelves.of(STARTS, ITEMS, SIZES, SIZES).steps[small]
    assert SIZES[small[steps > 0]].sum() <= NEAR_SHARE * 1400 < SIZES[small[steps > 0]].sum() + 300
    assert SIZES[small[steps == 0]].sum() <= (1 - NEAR_SHARE) * 1400


@pytest.mark.parametrize("name", POLICIES)
def test_each_item_once(name):
    found = POLICIES[name](stock()).ahead(now(2, (2, 3), (0.0, 0.1), shown=(4, 5, 6), wanted=(6, 8, 10)), NONE)
    assert len(np.unique(found)) == len(found) > 0
    assert first_of_each(np.array([3, 1, 3, 2, 1])).tolist() == [3, 1, 2]
