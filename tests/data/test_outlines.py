"""What outlines cover, against a brute raster of the triangles, exact in integers."""

import numpy as np
import pytest
from builders.planes import ROUND, arched, axial_triangles, covered, inside_rectangles, pierced, raster
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.outlines import Outlines, cover, outline, tiles


def plane_rectangles(triangles, carve_area=0.0):
    """Disjoint rectangles inside triangles of one plane; their area; what is dropped along oblique outlines."""
    outlines = outline(triangles, np.zeros(len(triangles), np.int64), 1)
    (part,) = cover(outlines, carve=np.array([carve_area]))
    return part.rasters.tile(part.kept)[1], part.areas(part.kept)[0], part.areas(part.lost)[0]


@given(st.integers(0, 2**32), st.integers(1, 7))
def test_axial_outlines_are_kept_exactly_or_what_is_lost_is_told(seed, count):
    triangles = axial_triangles(np.random.default_rng(seed), count)
    rectangles, area, lost = plane_rectangles(triangles)
    us, vs = (np.unique(triangles[:, :, c]).astype(np.int64) for c in (0, 1))
    doubled, sizes = raster(us, vs)
    truth = covered(2 * triangles, doubled)
    inside = inside_rectangles(rectangles, doubled)
    # Diagonals of two rectangles that lie on one line are oblique outlines if they do not cancel: something is lost
    # then, and said to be.
    assert (inside <= truth).all()
    if lost == 0:
        np.testing.assert_array_equal(inside, truth.astype(int))
        assert area == sizes[truth].sum()
    assert area == np.prod((rectangles[:, 1] - rectangles[:, 0]).astype(np.int64), axis=1).sum()


@given(st.integers(0, 2**32), st.integers(1, 5), st.sampled_from([20, 3000]))
def test_oblique_outlines_are_never_exceeded(seed, count, size):
    """Every output rectangle lies in the union of the triangles: at its corners and on a raster inside it."""
    rng = np.random.default_rng(seed)
    triangles = rng.integers(0, size, (count, 3, 2)).astype(np.int32)
    a, b = (triangles[:, k] - triangles[:, 0] for k in (1, 2))
    triangles = triangles[a[:, 0] * b[:, 1] != a[:, 1] * b[:, 0]]
    if rng.random() < 0.5:
        triangles = np.concatenate([triangles, axial_triangles(rng, 2, size)])
    if not len(triangles):
        return
    rectangles, area, _ = plane_rectangles(triangles)
    shares = np.stack(np.meshgrid(range(9), range(9), indexing="ij"), axis=-1).reshape(-1, 2)
    low, high = rectangles[:, 0].astype(np.int64), rectangles[:, 1].astype(np.int64)
    points = (8 * low[:, None] + shares * (high - low)[:, None]).reshape(-1, 2)
    assert covered(8 * triangles, points).all()
    assert area == np.prod(high - low, axis=1).sum()
    middles = low + high
    assert (inside_rectangles(rectangles, middles) == 1).all()


def test_an_oblique_edge_drops_nothing_beyond_its_ends():
    """Beside the corner where the axial edge begins lies a raster cell that is as wide as the rest of the wall."""
    hole = np.array([(1000, 1000), (2000, 1000), (2000, 2000), (1500, 2500), (1000, 2000)])
    rectangles, _, _ = plane_rectangles(pierced(hole))
    beside = np.array([[2 * 2001, 2 * 2001], [2 * 999, 2 * 2001], [2 * 1500, 2 * 2501]])
    assert inside_rectangles(rectangles, beside).tolist() == [1, 1, 1]


def test_most_of_a_gable_is_kept():
    gable = np.array([[[0, 0], [8192, 0], [4096, 4096]]], np.int32)
    _, kept, _ = plane_rectangles(gable)
    assert 0.8 * 8192 * 4096 / 2 < kept < 8192 * 4096 / 2


def test_a_hole_stays_open():
    """A square ring of eight triangles, and the same with its hole covered by a triangle pair turned the other way."""
    outer, inner = [(0, 0), (30, 0), (30, 30), (0, 30)], [(10, 10), (20, 10), (20, 20), (10, 20)]
    ring = []
    for n in range(4):
        a, b, c, d = outer[n], outer[n - 3], inner[n - 3], inner[n]
        ring += [(a, b, c), (a, c, d)]
    rectangles, area, _ = plane_rectangles(np.array(ring, np.int32))
    assert area == 800 and inside_rectangles(rectangles, np.array([[30, 30]]))[0] == 0
    plug = [(inner[0], inner[2], inner[1]), (inner[0], inner[3], inner[2])]
    assert plane_rectangles(np.array(ring + plug, np.int32))[1] == 900


def test_a_doubled_triangle_changes_nothing():
    quad = np.array([[(0, 0), (90, 0), (90, 60)], [(0, 0), (90, 60), (0, 60)]], np.int32)
    for extra in (quad[:1], quad[:1, ::-1], quad[1:, [1, 2, 0]]):
        _, area, lost = plane_rectangles(np.concatenate([quad, extra]))
        assert (area, lost) == (90 * 60, 0)


@pytest.mark.parametrize("hole", [arched(1500, 750), ROUND, [(500, 500), (3000, 500), (3500, 1000), (3000, 1500)]])
def test_what_is_carved_leaves_a_rectangle_open(hole):
    """Four rectangles about the box of the hole: no more is left out than that box, and no less."""
    hole = np.array(hole)
    triangles = pierced(hole)
    rectangles, area, lost = plane_rectangles(triangles, carve_area=2**21)
    low, high = hole.min(axis=0).astype(int), hole.max(axis=0).astype(int)
    assert len(rectangles) == 4 and area == 4096**2 - (high - low).prod()
    assert area + lost == sum(plane_rectangles(triangles)[1:])
    assert not ((rectangles[:, 0] < high).all(axis=1) & (rectangles[:, 1] > low).all(axis=1)).any()
    assert len(plane_rectangles(triangles)[0]) > 12


@pytest.mark.parametrize(
    ("hole", "carve_area"),
    [(arched(1500, 750), 1000), ([(500, 500), (2500, 500), (2500, 1500), (500, 2500)], 600_000)],
)
def test_a_part_that_would_lose_much_keeps_its_staircase(hole, carve_area):
    """The box around the arch is too large; that of the slanted edge is not, but half of it is opaque."""
    triangles = pierced(hole)
    rectangles, area, lost = plane_rectangles(triangles, carve_area=carve_area)
    whole = plane_rectangles(triangles)
    np.testing.assert_array_equal(rectangles, whole[0])
    assert (area, lost) == whole[1:]


def test_under_a_pillar_nothing_is_carved():
    """A round pillar's foot lies on a floor that covers it all."""
    square = np.array([[(0, 0), (4096, 0), (4096, 4096)], [(0, 0), (4096, 4096), (0, 4096)]], np.int32)
    fan = [(ROUND[0], ROUND[k], ROUND[k + 1]) for k in range(1, len(ROUND) - 1)]
    triangles = np.concatenate([square, np.array(fan).astype(np.int32)])
    assert plane_rectangles(triangles, carve_area=2**22)[1] == plane_rectangles(triangles)[1] > 0.9 * 4096**2


@given(st.integers(0, 2**32), st.integers(1, 5), st.sampled_from([20, 3000]), st.sampled_from([100, 2**20]))
def test_what_is_carved_is_less_than_what_is_opaque(seed, count, size, carve_area):
    rng = np.random.default_rng(seed)
    triangles = np.concatenate([rng.integers(0, size, (count, 3, 2)).astype(np.int32), axial_triangles(rng, 2, size)])
    a, b = (triangles[:, k] - triangles[:, 0] for k in (1, 2))
    triangles = triangles[a[:, 0] * b[:, 1] != a[:, 1] * b[:, 0]]
    carved, area, lost = plane_rectangles(triangles, carve_area=carve_area)
    whole, kept, dropped = plane_rectangles(triangles)
    assert area <= kept and area + lost == kept + dropped
    # Middles of the raster that both are made of lie in no rectangle of the one without lying in one of the other.
    us, vs = (np.unique(np.concatenate([r[:, :, c].ravel() for r in (carved, whole)])).astype(np.int64) for c in (0, 1))
    doubled, _ = raster(us, vs)
    assert (inside_rectangles(carved, doubled) <= inside_rectangles(whole, doubled)).all()


@given(st.integers(0, 2**32), st.sampled_from([20, 3000]))
def test_many_outlines_are_covered_as_each_alone(seed, size):
    """Beside others, in lots or alone, none of them changes; some edges are rounded."""
    rng = np.random.default_rng(seed)
    lists = [rng.integers(0, size, (rng.integers(1, 5), 3, 2)) for _ in range(6)]
    lists = [np.concatenate([part, axial_triangles(rng, 1, size)]) for part in lists]
    owner = np.repeat(np.arange(8), [0, *(len(part) for part in lists), 0])
    outlines = outline(np.concatenate(lists), owner, 8)
    rounded = rng.random(len(outlines.edges)) < 0.2
    outlines = Outlines(outlines.edges, outlines.owner, 8, rounded)
    steps, anywhere = rng.integers(1, 20, 8), bool(rng.integers(0, 2))
    owners, found = tiles(outlines, steps, anywhere=anywhere)
    for number in range(8):
        _, expected = tiles(outlines.part(number, number + 1), int(steps[number]), anywhere=anywhere)
        np.testing.assert_array_equal(found[owners == number], expected)


@given(st.integers(0, 2**32), st.sampled_from([20, 400]))
def test_what_comes_near_a_rounded_edge_is_left_out(seed, size):
    """Corners and middles of rectangles are further than half a step off every rounded edge; in whole numbers."""
    rng = np.random.default_rng(seed)
    triangles = rng.integers(0, size, (2, 3, 2))
    outlines = outline(triangles, np.zeros(2, np.int64), 1)
    rounded = rng.random(len(outlines.edges)) < 0.5
    _, found = tiles(Outlines(outlines.edges, outlines.owner, 1, rounded), anywhere=True)
    found = found.astype(np.int64)
    points = np.concatenate([2 * found[:, 0], 2 * found[:, 1], found.sum(axis=1)])
    for a, b in 2 * outlines.edges[rounded]:
        way, off = b - a, points - a
        across = np.abs(way[0] * off[:, 1] - way[1] * off[:, 0])
        beside = ((off @ way) >= 0) & ((off @ way) <= way @ way)
        # Doubled coordinates: half a step is 1.
        assert (across[beside] ** 2 > way @ way).all()
