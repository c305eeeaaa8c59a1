"""Bytes from nothing to what the eye sees: counted by hand."""

import numpy as np
import pytest
from viewcell.workbench.walk.arrival import Arrivals, oracle_bytes, policy_bytes
from viewcell.workbench.walk.memory import Layout

SIZES = np.array([100, 50, 10, 400])


class Fixed:
    """A policy that wants items in one order; object k has the levels 2 k (fine) and 2 k + 1 (coarse)."""

    def __init__(self, items):
        self.items = np.array(items)
        self.stock = self
        self.shelves = self
        self.table = np.array([[0, 1], [3, 2]])

    def ahead(self, now, held):
        return self.items


class Eye:
    shown, wanted, urgent = np.array([0, 1]), np.array([0, 2]), np.zeros(0, int)


class Hurried(Eye):
    urgent = np.array([2])


LAYOUT = Layout(np.array([0, 100, 150, 160]), SIZES, True)


def test_an_oracle_reads_what_is_visible_the_most_pixels_a_byte_first():
    # 60 of 100 pixels in 10 bytes, 39 in 100, 1 in 50; the hidden one never.
    assert oracle_bytes(np.array([39, 1, 60, 0]), SIZES).tolist() == [110, 160]
    assert oracle_bytes(np.zeros(4, int), SIZES).tolist() == [0, 0]


@pytest.mark.parametrize(
    ("items", "pixels", "expected"),
    [
        # The coarse level of the first object is not what it is to be drawn at.
        ([1, 2, 0], [99, 1], [160, 160]),
        ([1, 0, 2], [99, 1], [150, 160]),
        # A finer level does, too.
        ([3, 0], [50, 50], [500, 500]),
        # What shows no pixel need not come.
        ([2, 0], [0, 7], [10, 10]),
        # What is never asked for never comes.
        ([2], [1, 99], [10, np.inf]),
        ([2], [50, 50], [np.inf, np.inf]),
        ([2], [0, 0], [0, 0]),
    ],
)
def test_items_are_counted_in_their_order(items, pixels, expected):
    asked, _ = policy_bytes(Fixed(items), Eye, np.array(pixels), LAYOUT, 0, 10**6)
    assert asked.tolist() == expected


def test_ranges_count_what_lies_between():
    pixels = np.array([50, 50])
    # Items 0 and 2 in one range over item 1; apart if the gap is too large, or if one of them is shown now.
    assert policy_bytes(Fixed([0, 2]), Eye, pixels, LAYOUT, 50, 10**6)[1].tolist() == [160, 160]
    assert policy_bytes(Fixed([0, 2]), Eye, pixels, LAYOUT, 49, 10**6)[1].tolist() == [110, 110]
    assert policy_bytes(Fixed([0, 2]), Hurried, np.array([0, 50]), LAYOUT, 50, 10**6)[1].tolist() == [10, 10]
    assert policy_bytes(Fixed([0, 2]), Eye, np.array([0, 50]), LAYOUT, 50, 10**6)[1].tolist() == [160, 160]


def test_ratios():
    found = Arrivals("a", np.array([[20.0, np.inf], [0, 0]]), np.zeros((2, 2)), np.array([[10.0, 10], [0, 0]]))
    assert found.ratios.tolist() == [[2, np.inf], [1, 1]]
