"""What Embree is asked: the first opaque triangle of a sightline, against the exact test."""

import numpy as np
import pytest
from builders import random_buildings
from viewcell.kernels.launch import CPU, Device
from viewcell.solvers.visibility.finder import RUN, Finder
from viewcell.verify.exact.sightline import Sight, Sightlines


def asked(seed, count, threads=1):
    triangles, owners = random_buildings.clutter(seed)
    opaque = owners % 3 > 0
    rng = np.random.default_rng(seed)
    origins, ends = np.round(rng.uniform(-200, 1200, (2, count, 3)) * 1024) / 1024
    return (
        triangles,
        owners,
        opaque,
        origins,
        ends,
        Finder(triangles, owners, opaque, Device(threads=threads)).first(origins, ends),
    )


@pytest.mark.parametrize("seed", range(3))
def test_clear_is_what_is_clear_but_for_rounding(seed):
    triangles, owners, opaque, origins, ends, first = asked(seed, 4000)
    truth = Sightlines(triangles[opaque], owners[opaque]).check(origins, ends) == Sight.CLEAR
    assert 400 < truth.sum() < 3600 and (truth == (first < 0)).mean() > 0.999
    assert opaque[first[first >= 0]].all()


def test_the_first_triangle_has_none_before_it():
    triangles, owners, _, origins, ends, first = asked(7, 500)
    hit = np.flatnonzero(first >= 0)
    a, b, c = triangles[first[hit]].astype(float).transpose(1, 0, 2)
    normal, way = np.cross(b - a, c - a), ends[hit] - origins[hit]
    reach = ((a - origins[hit]) * normal).sum(axis=1) / (way * normal).sum(axis=1)
    assert ((reach > 0) & (reach < 1)).all()
    before = Sightlines(triangles[owners % 3 > 0]).check(origins[hit], origins[hit] + 0.999 * reach[:, None] * way)
    assert (before == Sight.CLEAR).mean() > 0.99


def test_threads_and_runs_change_nothing():
    one, two = (asked(2, 3 * RUN + 5, threads)[-1] for threads in (1, 2))
    np.testing.assert_array_equal(one, two)


def test_without_triangles_everything_is_clear():
    none = Finder(np.zeros((0, 3, 3), np.int32), np.zeros(0, int), np.zeros(0, bool), CPU)
    assert (none.first(np.zeros((2, 3)), np.ones((2, 3))) == -1).all()
    assert none.may_be_clear(np.arange(2), np.zeros((2, 3)), np.ones((2, 3))).all()
    assert none.wanted(np.arange(2), np.zeros(2, bool)).all()
