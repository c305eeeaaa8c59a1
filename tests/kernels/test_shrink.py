"""Shrunk occluders: what they hide from the projection point is in the exact umbra, and their size is as exact."""

from fractions import Fraction

import numpy as np
import pytest
from builders.outlines import area_of, outline_table, random_scene
from viewcell.kernels.launch import Device
from viewcell.kernels.shrink import launch_shrink
from viewcell.kernels.umbra import launch_umbra
from viewcell.verify.arithmetic import along, dot, minus, rational
from viewcell.verify.exact.shrink import shrunk
from viewcell.verify.exact.umbra import umbra


def polygons_of(polygons):
    return [polygons.corners[a:b] for a, b in zip(polygons.starts[:-1], polygons.starts[1:], strict=True)]


def random_point_before(rng, cell, exact):
    """A projection point: inside the cell, or somewhere else in front of the plane; in sixteenths of a grid step."""
    middle, spread = cell.mean(axis=0), np.ptp(cell, axis=0)
    reach = rng.choice([0.4, 0.4, 3.0])
    point = np.round((middle + rng.uniform(-reach, reach, 3) * spread) * 16) / 16
    height = -exact.depth(rational([point])[0])
    return point if height > 0 and height * height > dot(exact.normal, exact.normal) else middle


def check_shrunk(seed, scenes, limited, shrink=True):
    """Points behind shrunk occluders against the exact umbra; returns how many points were in it and how many not."""
    rng, inside, outside = np.random.default_rng(seed), 0, 0
    for _ in range(scenes):
        cell, outline, exact = random_scene(rng)
        point = random_point_before(rng, cell, exact)
        v = rational([point])[0]
        unit = float(dot(exact.normal, exact.normal)) ** 0.5
        height = float(-exact.depth(v)) / unit
        depth = height * rng.uniform(0.05, 4) if limited else np.inf
        umbras = launch_umbra(cell[None], outline_table([outline]), [[0, 0]])
        corners = polygons_of(launch_shrink(umbras, [0], [point], [depth]))[0] if shrink else outline
        if shrink:
            wanted = shrunk(exact, v, Fraction(depth * unit) if limited else None)
            share = area_of(corners) / area_of(outline) if len(corners) else 0.0
            assert share == pytest.approx(area_of(wanted) / area_of(outline) if len(wanted) > 2 else 0.0, abs=1e-2)
        for _ in range(3 if len(corners) else 0):
            q = rational([rng.dirichlet(np.full(len(corners), 0.3)) @ corners])[0]
            share = Fraction(rng.uniform(0.02, 0.999))
            s = share * Fraction(depth / height) if limited else Fraction(float(rng.choice([0.1, 3.0, 500.0]))) * share
            truth = umbra(exact, along(q, s, minus(q, v)))
            inside, outside = inside + truth, outside + (not truth)
    return inside, outside


@pytest.mark.parametrize("limited", [False, True])
def test_what_a_shrunk_occluder_hides_is_in_the_umbra(limited):
    inside, outside = check_shrunk(5, 150, limited)
    assert outside == 0 and inside > 100


@pytest.mark.slow
@pytest.mark.parametrize("limited", [False, True])
def test_what_a_shrunk_occluder_hides_is_in_the_umbra_many(limited):
    inside, outside = check_shrunk(6, 6000, limited)
    assert outside == 0 and inside > 4000


def test_an_unshrunk_occluder_hides_more_than_the_umbra():
    inside, outside = check_shrunk(7, 60, False, shrink=False)
    assert outside > inside


def test_a_point_behind_the_outline_leaves_nothing():
    table = outline_table([[[30, 2, 3], [30, 9, 3], [30, 9, 8]]])
    flat = launch_umbra([[[0, 0, 0], [1, 1, 1]]], table, [[0, 0]])
    before, behind = launch_shrink(flat, [0, 0], [[0.5, 0.5, 0.5], [31.0, 5, 5]]).starts[1:]
    assert before == behind > 0


def test_threads_change_nothing():
    rng = np.random.default_rng(10)
    scenes = [random_scene(rng)[:2] for _ in range(40)]
    boxes, table = np.array([cell for cell, _ in scenes]), outline_table([outline for _, outline in scenes])
    pairs = np.stack(np.meshgrid(np.arange(40), np.arange(40)), axis=-1).reshape(-1, 2)
    umbras, points = launch_umbra(boxes, table, pairs), boxes[pairs[:, 0]].mean(axis=1)
    one, two = (
        launch_shrink(umbras, np.arange(len(pairs)), points, device=Device(threads=threads)) for threads in (1, 2)
    )
    np.testing.assert_array_equal(one.corners, two.corners)
    np.testing.assert_array_equal(one.starts, two.starts)
