"""Confirming and aiming of sightlines on the device, against the exact check."""

import numpy as np
import pytest
from builders import random_buildings
from viewcell.kernels.launch import CPU, Device
from viewcell.kernels.sightline import aim_targets, device_triangles, launch_aim, launch_confirm
from viewcell.verify.exact.sightline import Sight, Sightlines

NOBODY = -1
LIMIT = 2**24


def spread(triangles, rng):
    """Triangles as large as the grid, or as they are and at its border."""
    if rng.random() < 0.5:
        return (triangles - triangles.min()) * (2 * LIMIT // np.ptp(triangles)) - LIMIT
    return triangles + rng.choice([-1, 1], 3) * (LIMIT - np.abs(triangles).max())


def clutter(seed, count=30, size=1000):
    """Triangles of boxes and tetrahedra with their owners."""
    rng = np.random.default_rng(seed)
    parts = [random_buildings.tetrahedron(rng.integers(0, size, (4, 3))) for _ in range(count // 2)]
    parts += [
        random_buildings.box_triangles(low, low + rng.integers(5, 200, 3))
        for low in rng.integers(0, size, (count // 2, 3))
    ]
    owners = np.repeat(np.arange(len(parts)), [len(part) for part in parts]).astype(np.int32)
    return np.concatenate(parts).astype(np.int32), owners


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
    triangles, owners = clutter(seed)
    rng = np.random.default_rng(seed)
    scene, exact = device_triangles(triangles, owners), Sightlines(triangles, owners)
    random = rng.uniform(0, 1000, (2, 3000, 3))
    for near, (origins, ends) in ((True, edge_segments(triangles, rng, 3000)), (False, random)):
        got = launch_confirm(scene, origins, ends, np.full(3000, NOBODY))
        truth = exact.check(origins, ends) == Sight.CLEAR
        # An end that lies on a triangle is clear in the exact test, whose segments are open, and blocked here.
        assert not (got & ~truth).any(), "confirmed, but a triangle is in the way"
        assert truth.sum() > 100 and (got & truth).sum() > (0.5 if near else 0.999) * truth.sum()


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
        triangles, owners = clutter(seed)
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
    triangles, owners = clutter(9)
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


def crumbs(seed, count=100, size=400):
    """Tetrahedra of a step or two, with their owners."""
    rng = np.random.default_rng(seed)
    parts = []
    while len(parts) < count:
        corners = rng.integers(0, size, 3) + rng.integers(0, 4, (4, 3))
        if np.linalg.det((corners[1:] - corners[0]).astype(float)):
            parts.append(random_buildings.tetrahedron(corners))
    return np.concatenate(parts).astype(np.int32), np.repeat(np.arange(count), 4).astype(np.int32)


def aimed(seed, at_objects, device=CPU, far=False, tiny=False):
    """Aim from boxes at boxes, or at objects: the work and what was found."""
    triangles, owners = crumbs(seed) if tiny else clutter(seed)
    rng = np.random.default_rng(seed)
    away = (LIMIT - triangles.max()) * np.array([1, -1, 1]) if far else 0
    triangles = (triangles + away).astype(np.int32)
    low, size = away + rng.integers(0, 390 if tiny else 900, (2, 1500, 3)), (1, 3) if tiny else (10, 100)
    sources, boxes = (np.stack([x, x + rng.integers(*size, x.shape)], axis=1).astype(np.int32) for x in low)
    hints = np.stack([sources.mean(axis=1), boxes.mean(axis=1)], axis=1)
    starts = np.searchsorted(owners, np.arange(owners.max() + 2))
    objects = rng.integers(0, owners.max() + 1, 1500) if at_objects else np.full(1500, NOBODY)
    ranges = np.column_stack([starts[objects], starts[objects + 1]]) if at_objects else np.zeros((1500, 2), int)
    found = launch_aim(
        device_triangles(triangles, owners), aim_targets(triangles), sources, boxes, hints,
        np.column_stack([objects, ranges]),        np.arange(1500), np.arange(1500) % 2 == 0, tries=20, device=device,
    )  # fmt: skip
    return triangles, owners, sources, boxes, objects, found


PLACES = {"near": {}, "far": {"far": True}, "tiny": {"tiny": True}, "tiny and far": {"tiny": True, "far": True}}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("seed", range(3))
def test_aimed_sightlines_are_clear_and_start_and_end_where_they_should(seed, place):
    triangles, owners, sources, boxes, _, (found, origins, ends) = aimed(seed, at_objects=False, **PLACES[place])
    assert 100 < found.sum() <= 1500
    for points, limits in ((origins, sources), (ends, boxes)):
        # A witness starts and ends inside.
        assert ((points > limits[:, 0]) & (points < limits[:, 1]))[found].all()
        np.testing.assert_array_equal(points[found] * 1024, np.round(points[found] * 1024))
    assert (Sightlines(triangles, owners).check(origins[found], ends[found]) == Sight.CLEAR).all()


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("seed", range(3))
def test_sightlines_aimed_at_objects_end_on_them(seed, place):
    triangles, owners, sources, _, objects, (found, origins, ends) = aimed(seed, at_objects=True, **PLACES[place])
    assert 100 < found.sum() <= 1500
    assert ((origins > sources[:, 0]) & (origins < sources[:, 1]))[found].all()
    for owner in np.unique(objects[found]):
        rows = found & (objects == owner)
        mine = owners == owner
        rest = Sightlines(triangles[~mine], owners[~mine])
        assert (rest.check(origins[rows], ends[rows]) == Sight.CLEAR).all()
        # Prolonged a little, the sightline meets the object.
        further = origins[rows] + (ends[rows] - origins[rows]) * 1.0005
        assert (Sightlines(triangles[mine], owners[mine]).check(origins[rows], further) != Sight.CLEAR).all()


@pytest.mark.parametrize("at_objects", [False, True])
def test_threads_change_nothing(at_objects):
    one, two = (aimed(4, at_objects, Device(threads=threads))[-1] for threads in (1, 2))
    for got, wanted in zip(two, one, strict=True):
        np.testing.assert_array_equal(got, wanted)
