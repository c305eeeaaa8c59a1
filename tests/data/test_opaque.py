"""Opaque rectangles against a brute raster of the triangles, exact in integers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.buildings.prisms import prism
from viewcell.data.graph import OTHER_AXES
from viewcell.data.opaque import carved_planes, decompose, opaque_planes, plane_rectangles


def covered(triangles, points):
    """Whether each point lies in a closed triangle; integers throughout."""
    triangles, points = triangles.astype(np.int64), points.astype(np.int64)
    inside = np.zeros(len(points), bool)
    for triangle in triangles:
        turns = []
        for a, b in zip(triangle, np.roll(triangle, -1, axis=0), strict=True):
            turns.append(np.sign((b[0] - a[0]) * (points[:, 1] - a[1]) - (b[1] - a[1]) * (points[:, 0] - a[0])))
        inside |= (np.min(turns, axis=0) >= 0) | (np.max(turns, axis=0) <= 0)
    return inside


def raster(us, vs):
    """Doubled centres of a raster's cells, shape (cells, 2), and their areas."""
    centre = np.stack(np.meshgrid(us[1:] + us[:-1], vs[1:] + vs[:-1], indexing="ij"), axis=-1).reshape(-1, 2)
    return centre, np.outer(np.diff(us), np.diff(vs)).ravel()


def inside_rectangles(rectangles, doubled):
    """How many rectangles hold each point."""
    low, high = 2 * rectangles[:, 0].astype(np.int64), 2 * rectangles[:, 1].astype(np.int64)
    return ((doubled[:, None] > low) & (doubled[:, None] < high)).all(axis=2).sum(axis=1)


def pierced(hole, *, size=4096):
    """Triangles of a square with a hole, and the square's corners."""
    square = np.array([(0, 0), (size, 0), (size, size), (0, size)])
    mesh = prism(square, [np.array(hole)], 0.0, 1.0)
    flat = mesh.vertices[mesh.faces][(mesh.vertices[mesh.faces][:, :, 2] == 0).all(axis=1)]
    return flat[:, :, :2].astype(np.int32)


def axial_triangles(rng, count, size=20):
    """Overlapping rectangles, each cut along one diagonal or into a fan about a point of an edge, in any turn."""
    out = []
    for _ in range(count):
        u, v = (np.sort(rng.choice(size, 2, replace=False)) for _ in range(2))
        quad = [(u[0], v[0]), (u[1], v[0]), (u[1], v[1]), (u[0], v[1])]
        if rng.random() < 0.4 and u[1] - u[0] > 1:
            middle = (rng.integers(u[0] + 1, u[1]), v[0])
            fan = [quad[1], quad[2], quad[3], quad[0]]
            made = [(middle, fan[n], fan[n + 1]) for n in range(3)]
        else:
            turn = rng.integers(0, 2)
            made = [(quad[turn], quad[turn + 1], quad[turn + 2]), (quad[turn], quad[turn + 2], quad[turn - 1])]
        out += [triangle[:: rng.choice([-1, 1])] for triangle in made]
    return np.array(out, np.int32)


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


def test_planes_keep_axes_and_ignore_oblique_triangles():
    quad = np.array([(0, 0), (4, 0), (4, 6), (0, 0), (4, 6), (0, 6)]).reshape(2, 3, 2)
    triangles = []
    for axis in range(3):
        for k in (3, 9):
            flat = np.full((2, 3, 3), k)
            flat[:, :, OTHER_AXES[axis]] = quad
            triangles += [*flat, *flat[:, ::-1]]
    triangles.append([(0, 0, 0), (5, 1, 0), (0, 1, 5)])
    planes = opaque_planes(np.array(triangles, np.int32))
    assert planes.axial_area == 6 * 24 and planes.lost_area == 0
    for axis in range(3):
        u, v = OTHER_AXES[axis]
        np.testing.assert_array_equal(planes.boxes[axis][:, :, axis], [[3, 3], [9, 9]])
        np.testing.assert_array_equal(planes.boxes[axis][:, :, u], [[0, 4], [0, 4]])
        np.testing.assert_array_equal(planes.boxes[axis][:, :, v], [[0, 6], [0, 6]])


def test_no_triangles_no_rectangles():
    planes = opaque_planes(np.zeros((0, 3, 3), np.int32))
    assert [len(boxes) for boxes in planes.boxes] == [0, 0, 0] and planes.axial_area == 0


@pytest.mark.parametrize("seed", range(20))
def test_decompose_tiles_the_mask(seed):
    rng = np.random.default_rng(seed)
    mask = rng.random((rng.integers(1, 9), rng.integers(1, 9))) < rng.random()
    us, vs = (np.cumsum(rng.integers(1, 5, n + 1)) for n in mask.shape)
    doubled, _ = raster(us, vs)
    np.testing.assert_array_equal(inside_rectangles(decompose(mask, us, vs), doubled), mask.ravel().astype(int))


def arched(width, rise):
    """Corners of a window with a round top, whose curve takes the upper `rise`."""
    turn = np.linspace(0, np.pi, 13)
    top = np.round(np.column_stack([1000 + (np.cos(turn) + 1) * width / 2, 2000 + np.sin(turn) * rise]))
    return np.concatenate([[[1000, 500], [1000 + width, 500]], top])


ROUND = np.round(
    2000 + 800 * np.column_stack([f(np.linspace(0, 2 * np.pi, 24, endpoint=False)) for f in (np.cos, np.sin)])
)


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


def test_levels_are_never_carved():
    flat = pierced(ROUND)
    for axis in range(3):
        triangles = np.zeros((len(flat), 3, 3), np.int32)
        triangles[:, :, OTHER_AXES[axis]] = flat
        plain, carved = carved_planes(triangles, 2**20)
        assert (len(carved.boxes[axis]) == 4) == (axis < 2) and len(plain.boxes[axis]) > 4
        for mine, theirs in zip(plain.boxes, opaque_planes(triangles).boxes, strict=True):
            np.testing.assert_array_equal(mine, theirs)
        assert plain.axial_area == carved.axial_area == opaque_planes(triangles).axial_area
