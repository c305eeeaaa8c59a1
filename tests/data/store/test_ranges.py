"""Ranges: all items, no gap that is too large, the most wanted first; and reading them from a file."""

import os
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.errors import InputError
from viewcell.data.store.ranges import FileSource, Range, ReadFailed, items_in, ranges_of

SIZES = np.array([16, 32, 16, 64, 16, 16])
OFFSETS = np.append(0, np.cumsum(SIZES)[:-1])


@pytest.mark.parametrize(
    ("items", "gap", "expected"),
    [
        ([], 0, []),
        ([2], 0, [(48, 16, (2,), 0)]),
        ([2, 1], 0, [(16, 48, (1, 2), 0)]),
        # The most wanted item's range comes first.
        ([5, 0], 0, [(144, 16, (5,), 0), (0, 16, (0,), 0)]),
        ([0, 2], 31, [(0, 16, (0,), 0), (48, 16, (2,), 0)]),
        ([0, 2], 32, [(0, 64, (0, 2), 32)]),
        ([4, 0, 1, 5], 0, [(128, 32, (4, 5), 0), (0, 48, (0, 1), 0)]),
    ],
)
def test_vectors(items, gap, expected):
    found = ranges_of(np.array(items, int), OFFSETS, SIZES, gap)
    assert [(one.first, one.size, one.items, one.waste) for one in found] == expected


@given(st.permutations(range(12)), st.integers(0, 12), st.integers(0, 200), st.lists(st.integers(1, 60), min_size=12))
def test_every_item_once_and_gaps_no_larger(order, count, gap, sizes):
    sizes = np.array(sizes[:12])
    offsets = np.append(0, np.cumsum(sizes)[:-1])
    items = np.array(order[:count], int)
    found = ranges_of(items, offsets, sizes, gap)
    assert sorted(item for one in found for item in one.items) == sorted(items.tolist())
    for one in found:
        own = np.array(one.items)
        assert one.first == offsets[own[0]] and one.first + one.size == offsets[own[-1]] + sizes[own[-1]]
        between = offsets[own[1:]] - (offsets + sizes)[own[:-1]]
        assert (between <= gap).all() and one.waste == between.sum()
    lying = sorted(found, key=lambda one: one.first)
    assert all(b.first - a.first - a.size > gap for a, b in pairwise(lying))
    ranks = [min(list(items).index(item) for item in one.items) for one in found]
    assert ranks == sorted(ranks)


def test_files_give_items_and_say_what_is_cut_short(tmp_path):
    path = tmp_path / "geometry.bin"
    data = os.urandom(160)
    path.write_bytes(data)
    source = FileSource(path)
    wanted = ranges_of(np.array([0, 3]), OFFSETS, SIZES, 1000)
    source.expect(wanted)
    found = items_in(wanted[0], source.read(wanted[0]), OFFSETS, SIZES)
    assert found == {0: data[:16], 3: data[64:128]}
    path.write_bytes(data[:100])
    with pytest.raises(ReadFailed, match="expected 128 bytes at 0, found 28 fewer"):
        source.read(Range(0, 128, (0,), 0))
    source.close()
    with pytest.raises(InputError, match="expected a file of items"):
        FileSource(tmp_path / "none.bin")
