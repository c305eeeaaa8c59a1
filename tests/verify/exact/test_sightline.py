"""Exact sightlines and solids, against rational oracles that solve for the crossing point."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from builders.places import SHARED
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.errors import InputError
from viewcell.data.readers import read
from viewcell.verify.exact.boxtree import BoxTree
from viewcell.verify.exact.sightline import Sight, Sightlines, closed_objects
from viewcell.verify.rays.embree import embree_scene

OCTANTS = list(product((1, -1), repeat=3))
UNIT = np.array([[0, 0, 0], [8, 0, 0], [0, 8, 0]])
CORNERS = np.array(list(product((0, 1), repeat=3)))
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
CUBE = np.array([face for a, b, c, d in SIDES for face in ((a, b, c), (a, c, d))])


def cube(low, size):
    return (CORNERS * size + np.array(low))[CUBE]


def rational_kind(origin, end, triangle):
    """By solving o + t (e - o) = a + u (b - a) + v (c - a) with Cramer's rule; None where they are parallel."""
    o, e = [Fraction(float(x)) for x in origin], [Fraction(float(x)) for x in end]
    a, b, c = ([Fraction(int(x)) for x in corner] for corner in triangle)
    columns = [[x - y for x, y in zip(p, q, strict=True)] for p, q in ((o, e), (b, a), (c, a), (o, a))]

    def det(x, y, z):
        return sum(x[i] * (y[(i + 1) % 3] * z[(i + 2) % 3] - y[(i + 2) % 3] * z[(i + 1) % 3]) for i in range(3))

    base = det(*columns[:3])
    if base == 0:
        return None
    t, u, v = (det(*[columns[3] if k == slot else columns[k] for k in range(3)]) / base for slot in range(3))
    if not 0 < t < 1 or min(u, v) < 0 or u + v > 1:
        return Sight.CLEAR
    return Sight.GRAZE if 0 in (u, v) or u + v == 1 else Sight.BLOCKED


@pytest.mark.parametrize(
    ("origin", "end", "expected"),
    [
        ((1, 1, 1), (1, 1, -1), Sight.BLOCKED),
        ((1, 1, 1), (1, 1, 0), Sight.CLEAR),
        ((1, 1, 0), (1, 1, 5), Sight.CLEAR),
        ((1, 1, 1), (1, 1, -1e-300), Sight.BLOCKED),
        ((1, 1, 1), (1, 1, 1e-300), Sight.CLEAR),
        ((4, 4, 1), (4, 4, -1), Sight.GRAZE),
        ((0, 0, 1), (0, 0, -1), Sight.GRAZE),
        ((0, 3, 1), (0, 3, -1), Sight.GRAZE),
        ((np.nextafter(4, 9), 4, 1), (np.nextafter(4, 9), 4, -1), Sight.CLEAR),
        ((np.nextafter(4, 0), 4, 1), (np.nextafter(4, 0), 4, -1), Sight.BLOCKED),
        ((5e-324, 1, 1), (5e-324, 1, -1), Sight.BLOCKED),
        ((-5e-324, 1, 1), (-5e-324, 1, -1), Sight.CLEAR),
        ((-1, 1, 0), (9, 1, 0), Sight.GRAZE),
        ((-1, -1, 0), (9, -1, 0), Sight.CLEAR),
        ((-1, 0, 0), (0, 0, 0), Sight.CLEAR),
        ((-1, 0, 0), (1, 0, 0), Sight.GRAZE),
        ((1, 1, 1e300), (1, 1, -1e300), Sight.BLOCKED),
        ((20, 20, 1e300), (20, 20, -1e300), Sight.CLEAR),
        ((9, 9, 1), (9, 9, -1), Sight.CLEAR),
    ],
)
def test_one_triangle(origin, end, expected):
    for corners in (UNIT, UNIT[::-1], UNIT[[1, 2, 0]]):
        found = Sightlines(corners[None]).check(np.array([origin, end], float), np.array([end, origin], float))
        assert found.tolist() == [expected, expected]


def test_crossing_a_shared_edge_is_a_graze():
    square = np.array([[[0, 0, 0], [8, 0, 0], [8, 8, 0]], [[0, 0, 0], [8, 8, 0], [0, 8, 0]]])
    assert Sightlines(square).check(np.array([[4.0, 4, 2]]), np.array([[4.0, 4, -2]])).tolist() == [Sight.GRAZE]


@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 3, 2**18]))
def test_agrees_with_cramers_rule(seed, scale):
    """Integer points make every tie; a last-place nudge breaks it in float64 alone."""
    rng = np.random.default_rng(seed)
    triangles = rng.integers(-4, 5, (12, 3, 3)) * scale + (scale > 3) * 2**23
    edges = triangles[:, 1:] - triangles[:, :1]
    triangles = triangles[np.cross(edges[:, 0], edges[:, 1]).any(axis=1)]
    points = (rng.integers(-5, 6, (2, 8, 3)) * scale + (scale > 3) * 2**23).astype(float)
    nudge = rng.integers(-1, 2, points.shape)
    points = np.where(nudge == 0, points, np.nextafter(points, nudge * 1e30))
    segments, ids, kinds = Sightlines(triangles).hits(*points)
    found = {(s, t): k for s, t, k in zip(segments.tolist(), ids.tolist(), kinds.tolist(), strict=True)}
    for s, t in product(range(8), range(len(triangles))):
        expected = rational_kind(points[0, s], points[1, s], triangles[t])
        if expected is not None:
            assert found.get((s, t), 0) == expected, (points[:, s].tolist(), triangles[t].tolist())


@given(st.integers(0, 2**32 - 1), st.sampled_from([5e-324, 1.4e-162, 1e-150, 1e-60]))
def test_tiny_segments_about_a_corner_agree_with_cramers_rule(seed, scale):
    """Products of their coordinates are lost below the least float64, or keep a few bits."""
    rng = np.random.default_rng(seed)
    triangles = rng.integers(-4, 5, (12, 3, 3))
    triangles[:, 0] = 0
    triangles = triangles[np.cross(triangles[:, 1], triangles[:, 2]).any(axis=1)]
    points = rng.integers(-9, 10, (2, 8, 3)) * scale
    found = np.zeros((8, len(triangles)), int)
    segments, ids, kinds = Sightlines(triangles).hits(*points)
    found[segments, ids] = kinds
    for s, t in product(range(8), range(len(triangles))):
        expected = rational_kind(points[0, s], points[1, s], triangles[t])
        if expected is not None:
            assert found[s, t] == expected, (points[:, s].tolist(), triangles[t].tolist())


def test_many_triangles_agree_with_each_alone():
    rng = np.random.default_rng(5)
    centres = rng.integers(-3000, 3000, (700, 1, 3))
    triangles = centres + rng.integers(-200, 200, (700, 3, 3))
    origins, ends = rng.uniform(-3500, 3500, (2, 300, 3))
    ends[:100, :2] = origins[:100, :2]
    verdicts = Sightlines(triangles).check(origins, ends)
    alone = np.max([Sightlines(t[None]).check(origins, ends) for t in triangles], axis=0)
    assert (verdicts == alone).all()
    assert 20 < np.count_nonzero(verdicts) < 250


def test_closed_objects_alone_have_an_inside():
    solid, hollow = cube((0, 0, 0), 10), cube((20, 0, 0), 10)[:-1]
    triangles = np.concatenate([solid, hollow, cube((5, 5, 5), 10)])
    owners = np.repeat([3, 4, 9], [12, 11, 12])
    assert closed_objects(triangles, owners).tolist() == [3, 9]
    points = [(1, 1, 1), (5, 5, 5), (0, 0, 0), (5, 5, 0), (25, 5, 5), (-1, 5, 5), (7, 7, 7), (0, 3, 4), (12, 12, 16)]
    expected = [False, False, False, False, True, True, False, False, True]
    assert Sightlines(triangles, owners).outside_solids(np.array(points, float)).tolist() == expected


def test_a_solid_turned_inside_out_cancels_no_other():
    """Each object is taken alone: in both is inside."""
    lines = Sightlines(np.concatenate([cube((0, 0, 0), 10), cube((5, 5, 5), 10)[:, ::-1]]), np.repeat([0, 1], 12))
    points = [(1, 1, 1), (7, 7, 7), (12, 12, 12), (4, 11, 11)]
    assert lines.outside_solids(np.array(points, float)).tolist() == [False, False, False, True]


def test_two_halves_of_different_objects_are_not_a_solid():
    triangles = cube((0, 0, 0), 10)
    assert closed_objects(triangles, np.repeat([0, 1], 6)).tolist() == []


@given(st.integers(0, 2**32 - 1))
def test_inside_of_a_cube_is_its_inside(seed):
    rng = np.random.default_rng(seed)
    low, size = rng.integers(-20, 20, 3), int(rng.integers(1, 12))
    axes = rng.permutation(3)
    lines = Sightlines(cube(low, size)[:, :, axes])
    points = rng.integers(-22, 34, (60, 3)) / rng.choice([1, 2, 3])
    points[:30] = (rng.integers(0, 3, (30, 3)) * size / 2 + low)[:, axes]
    moved = points + rng.integers(-1, 2, points.shape) * np.spacing(np.abs(points) + 1)
    for p in (points, moved):
        expected = ((p < low[axes]) | (p > (low + size)[axes])).any(axis=1)
        assert (lines.outside_solids(p) == expected).all()


def test_oblique_solid():
    """A tetrahedron: inside means all four barycentric coordinates are positive."""
    corners = np.array([[0, 0, 0], [7, 1, 2], [1, 8, 3], [2, 3, 9]])
    triangles = corners[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]]
    points = np.array(list(product(range(-1, 10), repeat=3)), float)
    weights = np.linalg.solve((corners[1:] - corners[0]).T.astype(float), points.T)
    least = np.minimum(weights.min(axis=0), 1 - weights.sum(axis=0))
    sure = np.abs(least) > 1e-9
    assert (Sightlines(triangles).outside_solids(points)[sure] == (least < 0)[sure]).all()
    assert not Sightlines(triangles).outside_solids(corners.astype(float)).any()


def test_columns_through_edges_and_vertices():
    """The inside of an octahedron is |x| + |y| + |z| < 6; columns above integer points hit its ridges and its top."""
    tips = np.array([[6, 0, 0], [0, 6, 0], [0, 0, 6]])
    triangles = [tips * s if np.prod(s) > 0 else (tips * s)[::-1] for s in (np.array(o)[:, None] for o in OCTANTS)]
    points = np.array(list(product(range(-7, 8), repeat=3)), float)
    assert (Sightlines(np.array(triangles)).outside_solids(points) == (np.abs(points).sum(axis=1) > 6)).all()


def test_nothing_blocks_where_there_is_nothing():
    empty = Sightlines(np.zeros((0, 3, 3), np.int32))
    assert empty.check(np.zeros((2, 3)), np.ones((2, 3))).tolist() == [Sight.CLEAR] * 2
    assert empty.outside_solids(np.zeros((2, 3))).all()
    assert Sightlines(UNIT[None]).check(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)


@pytest.mark.slow
def test_agrees_with_embree_on_a_real_building():
    """Short of Embree's hit a sightline is clear, past it it is not; but for hits that robust mode misses."""
    model = SHARED / "scenes" / "mesh" / "ifc_clinic_arch" / "clinic_arch.obj"
    if not model.exists():
        pytest.skip("no shared scenes folder with the clinic")
    triangles = read(model).triangles()[0]
    rng = np.random.default_rng(11)
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    origins = rng.uniform(low, high, (50_000, 3)).astype(np.float32)
    directions = rng.normal(size=origins.shape)
    directions = (directions / np.linalg.norm(directions, axis=1, keepdims=True)).astype(np.float32)
    found = embree_scene(triangles).run(origins, directions, output=1)
    hit = (found["primID"] >= 0) & (found["tfar"] > 10)
    starts, reach = origins[hit].astype(float), found["tfar"][hit, None].astype(float)
    lines = Sightlines(triangles)
    short, past = (lines.check(starts, starts + directions[hit] * (reach + by)) for by in (-0.5, 0.5))
    assert hit.sum() > 20_000
    assert np.count_nonzero(short) < 1e-4 * len(starts)
    assert np.count_nonzero(past == Sight.CLEAR) < 1e-4 * len(starts)


@pytest.mark.parametrize(
    ("origins", "ends"),
    [(np.zeros((2, 2)), np.zeros((2, 2))), (np.zeros((2, 3)), np.zeros((3, 3))), (np.full((1, 3), np.nan),) * 2],
)
def test_bad_input_is_one_line(origins, ends):
    with pytest.raises(InputError, match=r"expected .* found [^\n]*$"):
        Sightlines(UNIT[None]).check(origins, ends)


def test_large_trees_hold_every_box():
    """Above 65,536 boxes neighbours are grouped; what a segment meets must not change."""
    rng = np.random.default_rng(8)
    low = rng.integers(-(2**20), 2**20, (70_000, 3))
    high = low + rng.integers(0, 20_000, low.shape)
    origins, ends = rng.uniform(-(2**20), 2**20, (2, 40, 3))
    segments, boxes = BoxTree(low, high).candidates(origins, ends)
    found = set(zip(segments.tolist(), boxes.tolist(), strict=True))
    for number, (origin, end) in enumerate(zip(origins, ends, strict=True)):
        first, last = (low - origin) / (end - origin), (high - origin) / (end - origin)
        enter, leave = np.minimum(first, last).max(axis=1), np.maximum(first, last).min(axis=1)
        met = np.flatnonzero((enter <= leave) & (leave >= 0) & (enter <= 1))
        assert {(number, int(box)) for box in met} <= found
    assert len(found) < 40 * 70_000 / 10
