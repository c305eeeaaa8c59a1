"""Memory: the level that is there and nearest, what is asked for, and what becomes of what does not come."""

from types import SimpleNamespace

import numpy as np
import pytest
from viewcell.solvers.levels.benefit import NOTHING
from viewcell.solvers.walk.set_items import Shelves
from viewcell.workbench.walk.memory import FAILURES_MOST, GAP_BYTES, MISSING, Layout, Memory, gap_bytes, urgent_first
from viewcell.workbench.walk.reader import Arrival, Line

# Object 0 has the levels 0, 1, 2 and object 1 has 3.
SHELVES = Shelves.of(np.array([0, 3, 4]), np.arange(4), np.array([100, 100, 100, 100]), np.ones(4, int))


class Reader:
    """Gives what it is told to."""

    def __init__(self):
        self.asked, self.done, self.back = [], [], []

    def arrived(self, now):
        done, self.done = self.done, []
        return done

    def withdraw(self):
        back, self.back = self.back, []
        return back

    def ask(self, ranges, now):
        self.asked.append(ranges)


def memory(ahead, capacity=1000, most=1000, near_share=None):
    stock = SimpleNamespace(shelves=SHELVES, capacity=capacity, second=SHELVES.steps == 0)
    wanted = np.array(ahead, int)
    policy = SimpleNamespace(stock=stock, near_share=near_share, bounded=True, ahead=lambda now, held: wanted)
    layout = Layout(np.array([0, 100, 200, 300]), SHELVES.sizes, True)
    return Memory(policy, layout, Reader(), Line(1e6), most)


NOW = SimpleNamespace(shown=np.array([0, 1]), urgent=np.zeros(0, int))


@pytest.mark.parametrize(
    ("resident", "lods", "drawn", "skipped", "missing"),
    [
        ([0, 1, 2, 3], [1, 0], [1, 0], 0, 0),
        # The next coarser one that is there; then the next finer one.
        ([0, 2, 3], [1, 0], [2, 0], 1, 0),
        ([0, 3], [2, 0], [0, 0], 2, 0),
        ([0, 1, 3], [2, 0], [1, 0], 1, 0),
        ([2], [0, 0], [2, MISSING], 2, 1),
        ([], [0, 0], [MISSING, MISSING], 0, 2),
        # What is not to be drawn is not missing.
        ([], [NOTHING, 0], [NOTHING, MISSING], 0, 1),
        ([0, 3], [NOTHING, 0], [NOTHING, 0], 0, 0),
    ],
)
def test_the_best_level_that_is_there(resident, lods, drawn, skipped, missing):
    held = memory([])
    held.caches[0].change(0, np.array(resident, int), 1000)
    held.caches[0].arrive(np.array(resident, int))
    found = held.frame(1, NOW, np.array(lods), 0.0)
    assert found.drawn.tolist() == drawn and (found.skipped, found.missing) == (skipped, missing)
    assert found.resident.tolist() == resident


def test_bytes_come_and_go_and_what_was_drawn_stays_until_the_next_frame():
    held, none = memory([0, 1], capacity=200), np.array([0, 0])
    (wanted,) = held.frame(0, NOW, none, 0.0) and held._reader.asked[0]
    assert (wanted.first, wanted.size, wanted.items) == (0, 200, (0, 1)) and held.caches[0].used == 200
    held._reader.done = [Arrival(wanted, b"a" * 100 + b"b" * 100, "", 0.5)]
    found = held.frame(1, NOW, none, 0.1)
    assert held.held == {0: b"a" * 100, 1: b"b" * 100} and found.swap_s == 0.5 and found.reads == 0
    held.policy.ahead = lambda now, there: np.array([3, 0])
    found = held.frame(2, NOW, none, 0.2)
    assert found.read.tolist() == [3] and found.resident.tolist() == [0] and set(held.held) == {0, 1}
    held.frame(3, NOW, none, 0.3)
    assert set(held.held) == {0} and found.claimed == 200


def test_what_is_on_its_way_counts_and_what_is_withdrawn_is_asked_anew():
    held, lods = memory([0, 1, 2], most=200), np.array([0, 0])
    held.frame(0, NOW, lods, 0.0)
    (first,) = held._reader.asked[0]
    assert first.size == 200
    assert held.frame(1, NOW, lods, 0.1).reads == 0
    held._reader.back = [first]
    again = held.frame(2, NOW, lods, 0.2)
    assert again.read.tolist() == [0, 1] and held.caches[0].used == 200


def test_failures_are_counted_and_a_source_that_is_dead_is_left_alone():
    held, lods = memory([0], most=200), np.array([0, 0])
    for frame in range(FAILURES_MOST):
        found = held.frame(frame, NOW, lods, 0.0)
        assert found.reads == 1 and not held.given_up
        held._reader.done = [Arrival(held._reader.asked[-1][0], None, "gone", 0.1)]
    found = held.frame(9, NOW, lods, 0.0)
    assert found.reads == 0 and held.given_up and held.failures == {"gone": FAILURES_MOST} and held.caches[0].used == 0
    # One that comes between makes it alive.
    held = memory([0, 3], most=100)
    for frame, data in enumerate([None, None, b"x" * 100, None, None]):
        held.frame(frame, NOW, lods, 0.0)
        held._reader.done = [Arrival(held._reader.asked[-1][0], data, "gone", 0.1)]
    held.frame(9, NOW, lods, 0.0)
    assert not held.given_up and held.resident.tolist() == [True, False, False, False]


def test_two_caches_keep_to_their_shares():
    held = memory([2, 3, 0, 1], capacity=400, near_share=0.5)
    found = held.frame(0, NOW, np.array([0, 0]), 0.0)
    # Coarsest levels are items 2 and 3.
    assert [cache.capacity for cache in held.caches] == [200, 200]
    assert sorted(found.read.tolist()) == [0, 1, 2, 3] and [cache.used for cache in held.caches] == [200, 200]


def test_what_is_shown_comes_first_and_what_lies_between_comes_along():
    layout = Layout(np.arange(6) * 100, np.full(6, 100), True)

    def found(items, shown, gap):
        ranges = urgent_first(np.array(items, int), np.array(shown, int), layout, gap)
        return [(one.items, one.size, one.waste) for one in ranges]

    assert found([5, 0, 1, 2], [2, 5], 0) == [((5,), 100, 0), ((2,), 100, 0), ((0, 1), 200, 0)]
    assert found([0, 3, 1, 2], [0, 3], 200) == [((0, 1, 2, 3), 400, 0)]
    assert found([0, 4, 1, 5], [0, 4], 300) == [((0, 1, 4), 500, 200), ((5,), 100, 0)]
    assert found([0, 1], [], 0) == [((0, 1), 200, 0)] and found([], [3], 0) == []


def test_gaps_are_as_wide_as_what_comes_in_the_time_of_a_read():
    assert gap_bytes(Line(1e6)) == GAP_BYTES and gap_bytes(Line(25e6 / 8, 0.04)) == 125_000
