from fractions import Fraction

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay
from viewcell.data.errors import InputError
from viewcell.kernels import deviation
from viewcell.kernels.deviation import launch_deviation
from viewcell.kernels.launch import Device
from viewcell.verify.exact.deviation import deviation_squared, squared_distance

RELATIVE, ABSOLUTE = 0.01, 2.0**-15
SQUARE = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], float)
coordinates = st.integers(-8, 8)
triangles = st.lists(st.tuples(*[st.tuples(*[coordinates] * 3)] * 3), min_size=1, max_size=4)


def exact(mesh):
    return [tuple(tuple(Fraction(x) for x in corner) for corner in triangle) for triangle in np.asarray(mesh).tolist()]


def assert_tight(found):
    assert (found.lower <= found.upper).all()
    assert (found.upper <= np.maximum(found.lower * (1 + RELATIVE), found.lower + ABSOLUTE) + 1e-9).all()


def box(size):
    mesh = trimesh.creation.box((2 * size,) * 3)
    return np.array(mesh.vertices)[mesh.faces]


def sampled(a, b, count, rng):
    """Distances from random points of a to b, by trimesh."""
    weights = rng.dirichlet((0.5, 0.5, 0.5), count)
    points = np.einsum("nk,nkc->nc", weights, a[rng.integers(0, len(a), count)])
    best = np.full(count, np.inf)
    for triangle in b:
        nearest = trimesh.triangles.closest_point(np.repeat(triangle[None], count, axis=0), points)
        best = np.minimum(best, np.linalg.norm(nearest - points, axis=1))
    return best


@pytest.mark.parametrize("shift", [0.0, 0.25, 3.0])
def test_parallel_squares_are_as_far_apart_as_their_planes(shift):
    found = launch_deviation(SQUARE, SQUARE + np.array([0, 0, shift]))
    assert (found.lower <= shift).all() and (shift <= found.upper).all()
    assert_tight(found)


def test_directions_are_told_apart():
    # A corner of the large box is nearest to one of the small box; a face of the small box is 1 from the large one's.
    found = launch_deviation(box(2.0), box(1.0))
    truth = np.array([np.sqrt(3), 1.0])
    assert (found.lower <= truth).all() and (truth <= found.upper).all()
    assert_tight(found)


def test_the_farthest_point_may_be_inside_a_triangle():
    # Two posts at the ends of a bar, a triangle without area: the bar's middle is farthest from both.
    bar = np.array([[[-1, 0, 0], [1, 0, 0], [0, 0, 0]]])
    posts = np.array([[[s, -1, 0], [s, 1, 0], [s, 0, -1]] for s in (-1.0, 1.0)])
    found = launch_deviation(bar, posts)
    assert found.lower[0] <= 1 <= found.upper[0]
    assert_tight(found)


def test_another_triangulation_of_a_surface_is_no_deviation():
    # Ridges of the distance to triangles of b lie along its edges; cuts that miss them need 10**6 pieces here.
    rng = np.random.default_rng(0)
    points = np.vstack([np.array([[0, 0], [1, 0], [0, 1], [1, 1]]), rng.random((60, 2))])
    fine = np.column_stack([points, np.zeros(64)])[Delaunay(points).simplices] * 30
    found = launch_deviation(SQUARE * 30, fine, relative=0.0, absolute=1e-6)
    assert found.upper.max() < 2e-6


@settings(max_examples=25)
@given(triangles, triangles)
def test_bounds_agree_with_the_exact_ones(a, b):
    found = launch_deviation(np.array(a, float), np.array(b, float))
    for k, (one, two) in enumerate(((a, b), (b, a))):
        lower, upper = deviation_squared(exact(one), exact(two), 12)
        assert Fraction(found.lower[k]) ** 2 <= upper
        assert lower <= Fraction(found.upper[k]) ** 2
    assert_tight(found)


@given(st.tuples(*[coordinates] * 3), triangles, st.integers(0, 20))
def test_distance_of_a_point_is_exact_but_for_rounding(point, mesh, thinner):
    # A triangle that is a point; thin triangles are where weights of a nearest point are badly rounded.
    mesh = np.array(mesh, float)
    mesh[:, 2] = mesh[:, 0] + (mesh[:, 1] - mesh[:, 0]) * 0.5 + (mesh[:, 2] - mesh[:, 0]) * 2.0**-thinner
    found = launch_deviation(np.array([[point] * 3], float), mesh)
    truth = min(squared_distance(tuple(map(Fraction, point)), triangle) for triangle in exact(mesh))
    assert Fraction(found.lower[0]) ** 2 <= truth <= Fraction(found.upper[0]) ** 2
    assert found.upper[0] - found.lower[0] < 1e-6


@pytest.mark.parametrize("seed", range(4))
def test_no_sampled_point_is_farther_than_the_bound(seed):
    rng = np.random.default_rng(seed)
    ball = trimesh.creation.icosphere(subdivisions=2)
    a = np.array(ball.vertices)[ball.faces]
    b = np.array(ball.vertices + rng.normal(0, 0.05, ball.vertices.shape))[ball.faces][:: 1 + seed]
    found = launch_deviation(a, b)
    for k, (one, two) in enumerate(((a, b), (b, a))):
        distances = sampled(one, two, 300, rng)
        assert distances.max() <= found.upper[k]
    assert_tight(found)


def test_threads_do_not_change_the_answer():
    ball, ring = trimesh.creation.icosphere(subdivisions=3), trimesh.creation.torus(1.0, 0.3)
    a, b = (np.array(x.vertices)[x.faces] for x in (ball, ring))
    once, again = (launch_deviation(a, b, device=Device(threads=n)) for n in (1, 3))
    assert (once.lower == again.lower).all() and (once.upper == again.upper).all()


def test_bounds_hold_when_the_search_is_cut_short(monkeypatch):
    posts = np.array([[[s, -1, 0], [s, 1, 0], [s, 0, -1]] for s in (-1.0, 1.0)])
    monkeypatch.setattr(deviation, "MAX_PIECES", 2)
    found = launch_deviation(SQUARE * 2 - 1, posts)
    assert found.upper[0] >= 1 >= found.lower[0]
    monkeypatch.setattr(deviation, "MAX_ROUNDS", 1)
    assert launch_deviation(SQUARE * 2 - 1, posts).upper[0] >= 1


def test_units_and_places_far_from_the_origin():
    far = np.array([2.0**13, -(2.0**13), 2.0**12])
    found = launch_deviation(SQUARE + far, SQUARE + far + np.array([0, 0, 0.25]))
    assert (found.lower <= 0.25).all() and (found.upper >= 0.25).all()
    assert_tight(found)


@pytest.mark.parametrize(
    ("a", "options", "said"),
    [
        (np.zeros((0, 3, 3)), {}, "a: expected triangles"),
        (np.zeros((2, 3)), {}, "a: expected triangles"),
        (np.full((1, 3, 3), np.nan), {}, "a: expected finite"),
        (SQUARE, {"absolute": 0.0}, "above 0"),
        (SQUARE, {"relative": -1.0}, "at least 0"),
    ],
)
def test_bad_input(a, options, said):
    with pytest.raises(InputError, match=said):
        launch_deviation(a, SQUARE, **options)
