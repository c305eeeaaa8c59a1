"""Shrunk occluders: what they hide from the projection point is in the exact umbra, and their size is as exact."""

from fractions import Fraction

import numpy as np
import pytest
from builders import outlines
from builders.outlines import LIMIT, area_of, at_the_border, bent_scenes, outline_table, random_scene
from viewcell.data.patches import find_patches
from viewcell.kernels.launch import Device
from viewcell.kernels.shrink import launch_shrink
from viewcell.kernels.umbra import launch_umbra
from viewcell.verify.arithmetic import along, dot, minus, rational
from viewcell.verify.exact.shrink import shrunk
from viewcell.verify.exact.umbra import umbra, winds


def polygons_of(polygons):
    return [polygons.corners[a:b] for a, b in zip(polygons.starts[:-1], polygons.starts[1:], strict=True)]


def random_point_before(rng, cell, exact):
    """A projection point: inside the cell, or somewhere else in front of the plane; in sixteenths of a grid step."""
    middle, spread = cell.mean(axis=0), np.ptp(cell, axis=0)
    reach = rng.choice([0.4, 0.4, 3.0])
    point = np.round((middle + rng.uniform(-reach, reach, 3) * spread) * 16) / 16
    height = -exact.depth(rational([point])[0])
    return point if height > 0 and height * height > dot(exact.normal, exact.normal) else middle


def check_shrunk(seed, scenes, limited, shrink=True, far=False):
    """Points behind shrunk occluders against the exact umbra; returns how many points were in it and how many not."""
    rng, inside, outside = np.random.default_rng(seed), 0, 0
    for _ in range(scenes):
        cell, outline, exact = random_scene(rng)
        if far:
            cell, outline, exact = at_the_border(rng, cell, outline)
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
        for place in range(3 if len(corners) else 0):
            # Inside, and at a corner.
            weights = rng.dirichlet(np.full(len(corners), 0.3)) if place else np.eye(len(corners))[-1]
            q = rational([weights @ corners])[0]
            share = Fraction(rng.uniform(0.02, 0.999))
            s = share * Fraction(depth / height) if limited else Fraction(float(rng.choice([0.1, 3.0, 500.0]))) * share
            truth = umbra(exact, along(q, s, minus(q, v)))
            inside, outside = inside + truth, outside + (not truth)
    return inside, outside


@pytest.mark.parametrize("limited", [False, True])
def test_what_a_shrunk_occluder_hides_is_in_the_umbra(limited):
    inside, outside = check_shrunk(5, 150, limited)
    assert outside == 0 and inside > 80


@pytest.mark.parametrize("limited", [False, True])
def test_what_a_shrunk_occluder_hides_at_the_border_of_the_grid_is_in_the_umbra(limited):
    inside, outside = check_shrunk(12, 100, limited, far=True)
    assert outside == 0 and inside > 60


def point_close_before(rng, outline, exact):
    """A projection point next to a corner of the outline, so that what it sees past it goes off at a flat angle."""
    corner = outline[rng.integers(0, len(outline))]
    inwards, normal = outline.mean(axis=0) - corner, np.array([float(c) for c in exact.normal])
    inwards, normal = (way / np.linalg.norm(way) for way in (inwards, normal))
    return corner + inwards * rng.choice([0.03, 0.3, 3.0]) - normal * rng.choice([0.03, 0.3, 3.0])


def check_shrunk_far_away(seed, scenes):
    """Corners of shrunk occluders, and what lies behind them at the other end of the grid; returns how many."""
    rng, found = np.random.default_rng(seed), 0
    for _ in range(scenes):
        cell, outline, exact = at_the_border(rng, *random_scene(rng)[:2])
        point = point_close_before(rng, outline, exact)
        umbras = launch_umbra(cell[None], outline_table([outline]), [[0, 0]])
        v, (polygon,) = rational([point])[0], polygons_of(launch_shrink(umbras, [0], [point]))
        for q in rational(polygon):
            way = minus(q, v)
            for s in (1, LIMIT / max(abs(c) for c in way)):
                assert umbra(exact, along(q, s, way)), "wrong-hidden"
            found += 1
    return found


def test_what_a_shrunk_occluder_hides_far_away_is_in_the_umbra():
    assert check_shrunk_far_away(16, 150) > 60


@pytest.mark.slow
@pytest.mark.parametrize("limited", [False, True])
def test_what_a_shrunk_occluder_hides_is_in_the_umbra_many(limited):
    for far in (False, True):
        inside, outside = check_shrunk(6, 3000, limited, far=far)
        assert outside == 0 and inside > 2000


def test_an_unshrunk_occluder_hides_more_than_the_umbra():
    inside, outside = check_shrunk(7, 60, False, shrink=False)
    assert outside > inside


def check_bent(seed, scenes):
    """Points behind shrunk bent occluders: each line from the cell to them has the outline wound round it."""
    rng, found = np.random.default_rng(seed), 0
    for _ in range(scenes):
        triangles, size = outlines.random_disc(rng)
        patches = find_patches(triangles, np.zeros(len(triangles)), least_area=1.0, most_corners=12, cos_limit=0.2)
        if len(patches.area) != 1:
            continue
        away = patches.normal[0] * rng.choice([-1, 1])
        low = np.round(triangles.mean(axis=(0, 1)) - away * size * rng.uniform(0.5, 4)).astype(int)
        cell = np.stack([low, low + rng.integers(1, 2 + size, 3)])
        umbras = launch_umbra(cell[None], patches, [[0, 0]])
        corners = launch_shrink(umbras, [0], [cell.mean(axis=0)]).corners
        for corner in corners:
            for s in (0.001, 1.0, 40.0):
                x = corner + s * (corner - cell.mean(axis=0))
                assert winds(cell.tolist(), patches.corners.tolist(), rational([x])[0]), "wrong-hidden"
                found += 1
    return found


def test_what_a_shrunk_bent_occluder_hides_is_wound_round():
    assert check_bent(13, 60) > 150
    for bent, cell in bent_scenes():
        umbras = launch_umbra(cell[None], bent, [[0, 0]])
        corners = launch_shrink(umbras, [0], [cell.mean(axis=0)]).corners
        assert len(corners)
        for x in rational(corners + (corners - cell.mean(axis=0))):
            assert winds(cell.tolist(), bent.corners.tolist(), x), "wrong-hidden"


@pytest.mark.slow
def test_what_a_shrunk_bent_occluder_hides_is_wound_round_many():
    assert check_bent(14, 3000) > 5000


def test_from_behind_nothing_is_left_of_an_occluder():
    """Seen from within the umbra it would hide what lies before it."""
    rng, empty = np.random.default_rng(15), 0
    for _ in range(40):
        # Smaller than the cell, so that the umbra comes to a point.
        u, v = rng.integers(4, 20, 2)
        outline = [[30, -u, -v], [30, u, -v], [30, u, v], [30, -u, v]]
        cell = np.array([[-rng.integers(50, 90), *-rng.integers(20, 60, 2)], [0, *rng.integers(20, 60, 2)]])
        umbras = launch_umbra(cell[None], outline_table([outline]), [[0, 0]])
        points = rng.uniform([30.05, -4, -4], [33, 4, 4], (20, 3))
        points = points[umbras.contains(0, points)]
        assert len(launch_shrink(umbras, np.zeros(len(points), int), points).corners) == 0
        empty += len(points)
    assert empty > 100


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
