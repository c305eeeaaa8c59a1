"""Aiming on the device, against the exact check of what it finds."""

import numpy as np
import pytest
from builders import random_buildings
from viewcell.kernels.aim import launch_aim
from viewcell.kernels.launch import CPU, Device
from viewcell.kernels.sightline import device_triangles
from viewcell.verify.exact.sightline import Sight, Sightlines

NOBODY = -1
LIMIT = 2**24


def crumbs(seed, count=100, size=400):
    """Tetrahedra of a step or two, with their owners."""
    rng = np.random.default_rng(seed)
    parts = []
    while len(parts) < count:
        corners = rng.integers(0, size, 3) + rng.integers(0, 4, (4, 3))
        if np.linalg.det((corners[1:] - corners[0]).astype(float)):
            parts.append(random_buildings.tetrahedron(corners))
    return np.concatenate(parts).astype(np.int32), np.repeat(np.arange(count), 4).astype(np.int32)


def aimed(seed, at_objects, device=CPU, far=False, tiny=False, guide=None):
    """Aim from boxes at boxes, or at objects: the work and what was found."""
    triangles, owners = crumbs(seed) if tiny else random_buildings.clutter(seed)
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
        device_triangles(triangles, owners), sources, boxes, hints,
        np.column_stack([objects, ranges]),        np.arange(1500), np.arange(1500) % 2 == 0, tries=20, device=device,
        guide=guide and guide(triangles, owners),
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


class Everything:
    """A guide that holds all sightlines for clear, and wants no odd row after the first draws."""

    def __init__(self, *_):
        self.asked = 0

    def may_be_clear(self, rows, origins, ends):
        self.asked += 1
        return np.ones(len(rows), bool)

    def wanted(self, rows, found):
        assert not found[rows].any()
        return rows % 2 == 0


class Nothing(Everything):
    """A guide that holds none for clear."""

    def may_be_clear(self, rows, origins, ends):
        return np.zeros(len(rows), bool)


@pytest.mark.parametrize("at_objects", [False, True])
def test_a_guide_spares_work_and_decides_nothing(at_objects):
    """What it holds for clear is confirmed; what it no longer wants, or holds for blocked, is given up."""
    free, guided, none = (aimed(5, at_objects, guide=guide)[-1] for guide in (None, Everything, Nothing))
    even = np.arange(1500) % 2 == 0
    np.testing.assert_array_equal(guided[0][even], free[0][even])
    assert 0 < guided[0][~even].sum() < free[0][~even].sum() and not none[0].any()
    for got, wanted in zip(guided[1:], free[1:], strict=True):
        np.testing.assert_array_equal(got[guided[0]], wanted[guided[0]])


def test_sightlines_end_in_the_part_that_is_aimed_at():
    """However little of an object its box holds: a wall of two triangles, and crumbs of a thousand."""
    rng = np.random.default_rng(3)
    wall = random_buildings.box_triangles(np.array([0, 0, 0]), np.array([100_000, 100, 100_000]))
    parts = [
        wall,
        *(random_buildings.tetrahedron(p + rng.integers(0, 9, (4, 3))) for p in rng.integers(0, 9999, (300, 3))),
    ]
    crumb = np.concatenate(parts[1:]) + np.array([0, -30_000, 0])
    crumb = crumb[np.linalg.norm(np.cross(crumb[:, 1] - crumb[:, 0], crumb[:, 2] - crumb[:, 0]), axis=1) > 0]
    triangles = np.concatenate([wall, crumb]).astype(np.int32)
    owners = np.repeat([0, 1], [len(wall), len(crumb)])
    picked = crumb[rng.integers(0, len(crumb), 200)]
    spots = rng.integers(0, 99_000, (200, 3)) * [1, 0, 1]
    boxes = np.concatenate(
        [
            np.stack([spots, spots + np.array([50, 100, 50])], axis=1),
            np.stack([picked.min(axis=1), picked.max(axis=1)], axis=1),
        ]
    ).astype(np.int32)
    sources = np.tile(np.array([[0, -60_000, 0], [50_000, -55_000, 50_000]], np.int32), (400, 1, 1))
    objects = np.repeat([[0, 0, len(wall)], [1, len(wall), len(triangles)]], 200, axis=0)
    hints = np.stack([sources.mean(axis=1), boxes.mean(axis=1)], axis=1)
    for tries, least in ((1, 0.9), (8, 0.99)):
        found, _, ends = launch_aim(
            device_triangles(triangles, owners), sources, boxes, hints,
            objects, np.arange(400), np.arange(400) % 2, tries=tries, boxed=True,
        )  # fmt: skip
        assert found[:200].mean() > least and found[200:].mean() > 0.5
    # Rounded to the grid of witnesses.
    assert ((ends > boxes[:, 0] - 0.01) & (ends < boxes[:, 1] + 0.01))[found].all()
    nowhere = boxes + np.array([0, 200_000, 0], np.int32)
    hints = np.zeros((400, 2, 3))
    found, *_ = launch_aim(
        device_triangles(triangles, owners), sources, nowhere, hints, objects, *np.zeros((2, 400), int),
        tries=8, boxed=True,
    )  # fmt: skip
    assert not found.any()
