"""Many rasters at once, against each alone, cell by cell."""

import numpy as np
import pytest
from builders.planes import inside_rectangles, raster
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data import rasters as module
from viewcell.data.rasters import Rasters, decompose


def random_rasters(rng, count=7):
    """Rasters, and a mask of each, some empty, all in one flat table as well."""
    sides = [rng.integers(1, 9, 2) for _ in range(count)]
    lines = [[np.cumsum(rng.integers(1, 5, n + 1)) - 9 for n in side] for side in sides]
    points = [[(np.full(len(part[c]), k), rng.permutation(part[c])) for k, part in enumerate(lines)] for c in (0, 1)]
    # A raster in the middle and the last one have no lines.
    points = [[(k + (k >= 3), at) for k, at in lots] for lots in points]
    masks = [rng.random(side) < rng.random() for side in sides]
    empty = np.zeros((0, 0), bool)
    masks.insert(3, empty)
    lines.insert(3, [np.zeros(0, int)] * 2)
    padded = [np.pad(mask, (0, 1)).ravel() if mask.size else mask.ravel() for mask in (*masks, empty)]
    return Rasters.of(points, count + 2), np.concatenate(padded), [*lines, [np.zeros(0, int)] * 2], [*masks, empty]


def held(rectangles, us, vs):
    """How many rectangles hold each raster cell."""
    return inside_rectangles(rectangles, raster(us, vs)[0]).reshape(len(us) - 1, len(vs) - 1)


@given(st.integers(0, 2**32))
def test_tiles_hold_every_cell_once_and_largest_ones_cannot_grow(seed):
    rasters, flat, lines, masks = random_rasters(np.random.default_rng(seed))
    tiled, tiles = rasters.tile(flat)
    large, largest = rasters.maximal(flat, flat)
    for k, ((us, vs), mask) in enumerate(zip(lines, masks, strict=True)):
        if not mask.size:
            assert not (tiled == k).any() and not (large == k).any()
            continue
        np.testing.assert_array_equal(held(tiles[tiled == k], us, vs), mask)
        mine = largest[large == k]
        np.testing.assert_array_equal(held(mine, us, vs) > 0, mask)
        for rectangle in mine:
            (i0, i1), (j0, j1) = (np.searchsorted(at, rectangle[:, c]) for c, at in ((0, us), (1, vs)))
            assert mask[i0:i1, j0:j1].all()
            beside = [mask[max(i0 - 1, 0) : i0, j0:j1], mask[i1 : i1 + 1, j0:j1]]
            beside += [mask[i0:i1, max(j0 - 1, 0) : j0], mask[i0:i1, j1 : j1 + 1]]
            assert not any(part.size and part.all() for part in beside)


def test_rasters_of_the_same_cells_in_a_row_are_alike_only_if_rows_are_as_long():
    """Two tables of 24 nodes, 4 by 6 and 6 by 4, true at the same nodes."""
    lines = [[(np.zeros(n, int), np.arange(n)), (np.ones(10 - n, int), np.arange(10 - n))] for n in (4, 6)]
    rasters, mask = Rasters.of(lines, 2), np.zeros(48, bool)
    for node in (0, 1, 2, 6):
        mask[[node, 24 + node]] = True
    known = {}
    owner, rectangles = rasters.maximal(mask, mask, known)
    wide, tall = ([[0, 0], [1, 3]], [[0, 0], [2, 1]]), ([[0, 0], [1, 3]], [[0, 2], [2, 3]])
    for k, wanted in enumerate((wide, tall)):
        assert sorted(rectangles[owner == k].tolist()) == sorted(wanted)
    assert len(known) == 2


@given(st.integers(0, 2**32))
def test_rectangles_that_are_known_are_those_that_are_found(seed):
    """Of rasters with the same cells, of which as much is wanted or less."""
    rng = np.random.default_rng(seed)
    rasters, flat, _, _ = random_rasters(rng)
    some = flat & (rng.random(len(flat)) < 0.3)
    known = {}
    for wanted in (flat.copy(), some, flat.copy()):
        alone = [found.tolist() for found in rasters.maximal(flat, wanted)]
        assert [found.tolist() for found in rasters.maximal(flat, wanted, known)] == alone


@given(st.integers(0, 2**32))
def test_sums_runs_and_marks_are_those_of_each_raster(seed):
    rng = np.random.default_rng(seed)
    rasters, flat, _, masks = random_rasters(rng)
    values = rng.integers(-3, 4, len(flat))
    for axis in (0, 1):
        sums, (first, last) = rasters.sum_along(values, axis), rasters.runs(flat, axis)
        owner, line, begin, end = rasters.strips(flat, axis)
        np.testing.assert_array_equal(rasters.mark(axis, owner, line, begin, end), flat)
        for k, mask in enumerate(masks):
            if not mask.size:
                continue
            shape = mask.shape[0] + 1, mask.shape[1] + 1
            mine = slice(rasters.nodes[k], rasters.nodes[k + 1])
            np.testing.assert_array_equal(sums[mine].reshape(shape), values[mine].reshape(shape).cumsum(axis=axis))
            for (i, j), true in np.ndenumerate(mask):
                row = mask[i] if axis == 1 else mask[:, j]
                place = j if axis == 1 else i
                if true:
                    low = place - np.append(row[:place][::-1], False).argmin()
                    high = place + np.append(row[place:], False).argmin()
                    node = rasters.nodes[k] + i * shape[1] + j
                    assert (first[node], last[node]) == (low, high)


@given(st.integers(0, 2**32))
def test_painting_is_the_union_of_rectangles(seed):
    rng = np.random.default_rng(seed)
    rasters, _, lines, masks = random_rasters(rng)
    owner, rectangles = [], []
    for k, (us, vs) in enumerate(lines):
        for _ in range(rng.integers(0, 4) if len(us) else 0):
            rectangles.append(np.column_stack([np.sort(rng.choice(at, 2, replace=False)) for at in (us, vs)]))
            owner.append(k)
    owner, rectangles = np.array(owner, int), np.array(rectangles, int).reshape(-1, 2, 2)
    painted = rasters.paint(owner, rectangles)
    for k, ((us, vs), mask) in enumerate(zip(lines, masks, strict=True)):
        if mask.size:
            table = painted[rasters.nodes[k] : rasters.nodes[k + 1]].reshape(len(us), len(vs))
            np.testing.assert_array_equal(table[:-1, :-1], held(rectangles[owner == k], us, vs) > 0)
            assert not table[-1].any() and not table[:, -1].any()


@pytest.mark.parametrize("lot", [1, 40, 10**6])
def test_lots_are_all_rasters_in_order(monkeypatch, lot):
    monkeypatch.setattr(module, "LOT", lot)
    rasters, flat, _, _ = random_rasters(np.random.default_rng(3), 20)
    seen, tiles = 0, []
    for first, part in rasters.lots():
        assert first == seen
        seen += len(part)
        mine = slice(rasters.nodes[first], rasters.nodes[first + len(part)])
        owner, found = part.tile(flat[mine])
        tiles.append(np.column_stack([owner + first, found.reshape(-1, 4)]))
        np.testing.assert_array_equal(part.area, rasters.area[mine])
    assert seen == len(rasters) == 22
    owner, found = rasters.tile(flat)
    np.testing.assert_array_equal(np.concatenate(tiles), np.column_stack([owner, found.reshape(-1, 4)]))


@pytest.mark.parametrize("seed", range(20))
def test_decompose_tiles_the_mask(seed):
    rng = np.random.default_rng(seed)
    mask = rng.random((rng.integers(1, 9), rng.integers(1, 9))) < rng.random()
    us, vs = (np.cumsum(rng.integers(1, 5, n + 1)) for n in mask.shape)
    doubled, _ = raster(us, vs)
    np.testing.assert_array_equal(inside_rectangles(decompose(mask, us, vs), doubled), mask.ravel().astype(int))
