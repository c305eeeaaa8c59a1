"""The cache: never above its size, what is looked ahead to stays, and what was needed longest ago goes first."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from viewcell.solvers.walk.cache import ABSENT, ASKED, RESIDENT, Cache

SIZES = np.array([10, 20, 30, 40, 50])


def take(cache, frame, wanted, most=1000):
    change = cache.change(frame, np.array(wanted, int), most)
    cache.arrive(change.read)
    return change.read.tolist(), change.released.tolist()


def test_vectors():
    cache = Cache(SIZES, 100)
    assert take(cache, 0, [3, 0, 1]) == ([3, 0, 1], []) and cache.used == 70
    # 30 more just fit.
    assert take(cache, 1, [2, 0]) == ([2], []) and cache.used == 100
    # Item 1 was looked ahead to last with 3, but behind it.
    assert take(cache, 2, [2, 0, 4]) == ([4], [1, 3]) and cache.used == 90
    # What is looked ahead to is not given up for what comes behind it.
    assert take(cache, 3, [2, 0, 4, 3]) == ([], []) and cache.used == 90
    # What was looked ahead to longest ago goes first.
    aged = Cache(SIZES, 70)
    assert [take(aged, frame, [frame])[1] for frame in range(3)] == [[], [], []]
    assert take(aged, 3, [3]) == ([3], [0, 1])
    # So much in a frame; the first one may be larger.
    assert take(Cache(SIZES, 100), 0, [1, 2, 0], 50)[0] == [1, 2]
    assert take(Cache(SIZES, 100), 0, [3, 2], 5)[0] == [3]
    assert take(Cache(SIZES, 100), 0, [3, 2], 0)[0] == []


def test_what_does_not_come_is_free_again():
    cache = Cache(SIZES, 100)
    cache.change(0, np.array([3, 4]), 1000)
    assert cache.used == 90 and cache.state.tolist() == [ABSENT, ABSENT, ABSENT, ASKED, ASKED]
    cache.forget(np.array([4]))
    cache.arrive(np.array([3]))
    assert cache.used == 40 and cache.state[3] == RESIDENT and cache.resident.sum() == 1
    # What is on its way is not given up.
    cache.change(1, np.array([4]), 1000)
    assert take(cache, 2, [2, 1])[1] == [3] and cache.state[4] == ASKED


def test_one_that_is_not_bounded_overflows_as_published():
    cache = Cache(SIZES, 100, bounded=False)
    assert take(cache, 0, [4, 3, 2]) == ([4, 3, 2], []) and cache.used == 120
    assert take(cache, 1, [0]) == ([0], [2]) and cache.used == 100


@given(
    st.lists(st.tuples(st.permutations(range(5)), st.integers(0, 5), st.integers(0, 160)), max_size=12),
    st.integers(1, 160),
)
def test_laws(frames, capacity):
    cache, last = Cache(SIZES, capacity), np.full(5, -1)
    for frame, (order, count, most) in enumerate(frames):
        wanted, before = np.array(order[:count], int), cache.resident.copy()
        change = cache.change(frame, wanted, most)
        assert cache.used <= capacity
        assert not np.isin(change.released, wanted).any() and before[change.released].all()
        assert np.isin(change.read, wanted).all() and not before[change.read].any()
        left = before & ~np.isin(np.arange(5), [*change.released, *wanted])
        # Who stays was needed no less recently than who goes.
        if len(change.released) and left.any():
            assert last[change.released].max() <= last[left].min()
        cache.arrive(change.read)
        last[wanted] = frame
        assert cache.used == SIZES[cache.resident].sum()
