"""Bounds of clipped triangles: as the float64 reference to the last bit, and never less than in rationals."""

import numpy as np
import pytest
from viewcell.data.incidence import clip_rows
from viewcell.kernels.clip import launch_clip
from viewcell.kernels.launch import Device
from viewcell.verify.exact.clip import bounds_of, clipped

LIMIT = 2**24


def lists(seed, size, count=400):
    """Triangles and boxes that overlap, touch, hold each other or lie apart, some flat; lists of each length."""
    rng = np.random.default_rng(seed)
    coarse = max(1, size // 8)
    triangles = rng.integers(-size, size, (count, 3, 3))
    triangles[::3] = triangles[::3] // coarse * coarse
    triangles[1::7, :, 2] = triangles[1::7, :1, 2]
    low = rng.integers(-size, size, (count, 3))
    low[::2] = low[::2] // coarse * coarse
    boxes = np.stack([low, np.minimum(low + rng.integers(0, size, (count, 3)), size)], axis=1)
    begin = rng.integers(0, count, count)
    ranges = np.column_stack([begin, np.minimum(begin + rng.integers(0, 6, count), count)])
    return triangles.astype(np.int32), ranges, boxes.astype(np.int32)


@pytest.mark.parametrize("size", [3, 40, 5000, LIMIT])
def test_as_the_reference_to_the_last_bit(size):
    triangles, ranges, boxes = lists(size, size)
    found = launch_clip(triangles, ranges, boxes)
    np.testing.assert_array_equal(found, clip_rows(triangles, ranges, boxes))
    empty = (found[:, 0] > found[:, 1]).any(axis=1)
    assert 40 < empty.sum() < 390 and empty[ranges[:, 0] == ranges[:, 1]].all()


@pytest.mark.parametrize("size", [3, 40, 5000])
def test_holds_what_is_left_in_rationals(size):
    triangles, ranges, boxes = lists(size + 1, size)
    for row, (low, high) in enumerate(launch_clip(triangles, ranges, boxes)[:150]):
        left = [clipped(t, *boxes[row]) for t in triangles[slice(*ranges[row])]]
        points = [point for polygon in left if len(polygon) > 2 for point in polygon]
        if not points:
            assert (low > high).any()
            continue
        least, most = bounds_of(points)
        for i in range(3):
            assert least[i] - 2 < low[i] <= least[i] and most[i] <= high[i] < most[i] + 2


def test_threads_change_nothing():
    work = lists(9, 300, 3000)
    np.testing.assert_array_equal(*(launch_clip(*work, device=Device(threads=threads)) for threads in (1, 2)))


def test_nothing_asked_nothing_found():
    assert launch_clip(np.zeros((0, 3, 3)), np.zeros((0, 2)), np.zeros((0, 2, 3))).shape == (0, 2, 3)
