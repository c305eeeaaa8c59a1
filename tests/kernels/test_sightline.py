"""Confirming of sightlines on the device, against the exact check."""

import numpy as np
import pytest
from builders import random_buildings
from viewcell.data.shapes import mostly_copies
from viewcell.kernels.sightline import device_triangles, launch_confirm
from viewcell.verify.exact.sightline import Sight, Sightlines

NOBODY = -1
LIMIT = 2**24


def spread(triangles, rng):
    """Triangles as large as the grid, or as they are and at its border."""
    if rng.random() < 0.5:
        return (triangles - triangles.min()) * (2 * LIMIT // np.ptp(triangles)) - LIMIT
    return triangles + rng.choice([-1, 1], 3) * (LIMIT - np.abs(triangles).max())


def edge_segments(triangles, rng, count):
    """Segments that pass a random edge or corner of a triangle within zero to two quanta, and some at random."""
    picked = triangles[rng.integers(0, len(triangles), count)].astype(float)
    share = rng.choice([0.0, 0.25, 0.5, 1.0], (count, 1))
    touched = picked[:, 0] + share * (picked[:, 1] - picked[:, 0]) + rng.integers(-2, 3, (count, 3)) / 1024
    away = rng.integers(-300, 300, (count, 3))
    away[::5, rng.integers(0, 3)] = 0
    return touched - away, touched + away * rng.integers(1, 3, (count, 1))


@pytest.mark.parametrize("seed", range(4))
def test_confirmed_is_never_wrong(seed):
    triangles, owners = random_buildings.clutter(seed)
    rng = np.random.default_rng(seed)
    scene, exact = device_triangles(triangles, owners), Sightlines(triangles, owners)
    random = rng.uniform(0, 1000, (2, 3000, 3))
    for near, (origins, ends) in ((True, edge_segments(triangles, rng, 3000)), (False, random)):
        got = launch_confirm(scene, origins, ends, np.full(3000, NOBODY))
        truth = exact.check(origins, ends) == Sight.CLEAR
        # An end that lies on a triangle is clear in the exact test, whose segments are open, and blocked here.
        assert not (got & ~truth).any(), "confirmed, but a triangle is in the way"
        assert truth.sum() > 100 and (got & truth).sum() > (0.5 if near else 0.999) * truth.sum()


def test_triangles_of_copies_are_those_of_each():
    """400 objects of each of three shapes, one of which has no triangles."""
    rng = np.random.default_rng(0)
    sizes, models = np.tile([7, 0, 5], 400), np.tile([0, 1, 2], 400)
    shapes = [rng.integers(-50, 50, (size, 3, 3)) for size in (7, 0, 5)]
    shifts = rng.integers(-5000, 5000, (len(sizes), 3))
    triangles = np.concatenate([shapes[k] + shift for k, shift in zip(models, shifts, strict=True)]).astype(np.int32)
    owners = np.repeat(np.arange(len(sizes)), sizes)
    assert mostly_copies(np.append(0, np.cumsum(sizes)), models)
    once, each = device_triangles(triangles, owners, models=models), device_triangles(triangles, owners)
    for name in ("a", "b", "c", "owner", "opaque", "running_area"):
        np.testing.assert_array_equal(getattr(once, name).numpy(), getattr(each, name).numpy())


def skimming(triangles, rng, count):
    """Segments between points of the grid whose lines meet an edge or a plane, or pass it by what quanta allow."""
    size = np.ptp(triangles, axis=(0, 1)).max()
    picked = triangles[rng.integers(0, len(triangles), count)].astype(float)
    a, b, c = picked.transpose(1, 0, 2)
    share = rng.choice([0.0, 0.25, 0.5, 1.0], (count, 1))
    touched = a + share * (b - a)
    # Along the plane of a triangle, and anywhere.
    along = np.where(rng.random((count, 1)) < 0.5, c - a + rng.choice([-1, 0, 1], (count, 1)) * (b - a), 0)
    way = np.where(along.any(axis=1, keepdims=True), along, rng.uniform(-size, size, (count, 3)))
    way = way * 2.0 ** rng.integers(-12, 1, (count, 1))
    ends = np.stack([touched - way, touched + rng.uniform(0.5, 2, (count, 1)) * way])
    # Half of them as a witness is, the others as near as float64 comes.
    coarse = np.round(ends * 1024) / 1024 + rng.integers(-2, 3, ends.shape) / 1024
    ends = np.where(rng.random((count, 1)) < 0.5, coarse, ends + rng.integers(-2, 3, ends.shape) * np.spacing(ends))
    inside = (np.abs(ends) <= LIMIT).all(axis=(0, 2))
    return ends[:, inside]


def check_skimming(seeds, count):
    """How many of the segments that are clear, to the last bit, are confirmed; none of the others may be."""
    found = clear = 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        triangles, owners = random_buildings.clutter(seed)
        triangles = spread(triangles, rng)
        origins, ends = skimming(triangles, rng, count)
        got = launch_confirm(device_triangles(triangles, owners), origins, ends, np.full(len(origins), NOBODY))
        truth = Sightlines(triangles, owners).check(origins, ends) == Sight.CLEAR
        assert not (got & ~truth).any(), f"seed {seed}: confirmed, but a triangle is in the way"
        found, clear = found + (got & truth).sum(), clear + truth.sum()
    return found, clear


def test_confirmed_is_never_wrong_at_the_border_of_the_grid():
    found, clear = check_skimming(range(20, 26), 2000)
    assert found > 0.5 * clear > 500


@pytest.mark.slow
def test_confirmed_is_never_wrong_at_the_border_of_the_grid_for_many():
    check_skimming(range(100, 300), 5000)


def test_a_segment_in_the_plane_of_a_triangle_is_not_clear_of_it():
    """No end of it is above the other side."""
    triangle = np.array([[[0, 0, 0], [1000, 0, 0], [0, 1000, 0]]], np.int32)
    for size in (1, LIMIT // 1000):
        scene = device_triangles(triangle * size, np.zeros(1, np.int32))
        origins, ends = size * np.array([[[-50.0, 100, 0], [100, 100, 0]], [[500, 100, 0], [200, 200, 0]]])
        assert not launch_confirm(scene, origins, ends, np.full(2, NOBODY)).any()


def test_the_target_itself_is_no_obstacle():
    triangles, owners = random_buildings.clutter(9)
    rng = np.random.default_rng(9)
    origins, ends = rng.uniform(0, 1000, (2, 2000, 3))
    scene = device_triangles(triangles, owners)
    excepted = rng.integers(0, owners.max() + 1, 2000)
    got = launch_confirm(scene, origins, ends, excepted)
    for owner in np.unique(excepted):
        rows = excepted == owner
        rest = Sightlines(triangles[owners != owner], owners[owners != owner])
        assert not (got[rows] & (rest.check(origins[rows], ends[rows]) != Sight.CLEAR)).any()
    assert got.sum() > launch_confirm(scene, origins, ends, np.full(2000, NOBODY)).sum()
