import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.camera import Screen
from viewcell.data.errors import InputError
from viewcell.solvers.levels import pixel_error
from viewcell.solvers.levels.pixel_error import PixelLimit, pixel_levels

LIMIT = PixelLimit(1.5, Screen(320, 200, 75.0))
CELL = np.array([[[0.0, 0, 0], [2, 3, 1]]])
OBJECT = np.array([[[9.0, -1, 0], [11, 2, 4]]])


def level(errors, cells=CELL, bounds=OBJECT, limit=LIMIT):
    return int(pixel_levels(cells, bounds, np.array(errors), np.array([0, len(errors)]), np.array([[0, 0]]), limit)[0])


def largest_error(cells=CELL, bounds=OBJECT, limit=LIMIT):
    """Greatest deviation that is still allowed, by bisection."""
    low, high = 0.0, 10.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if level([0.0, middle], cells, bounds, limit) else (low, middle)
    return low


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def images(rays, axes, limit):
    """Pixels from the middle of the image, and whether the image shows them; rows of axes are right, up, forward."""
    width, height = limit.screen.width, limit.screen.height
    local = np.einsum("nij,nj->ni", axes, rays)
    focal = height / 2 / np.tan(np.radians(limit.screen.fov_deg) / 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = focal * local[:, :2] / local[:, 2:]
    return at, (local[:, 2] > 0) & (np.abs(at) <= np.array([width, height]) / 2).all(axis=1)


def displacements(error, count, seed, worst=False):
    """Pixels between a point that is shown and one within `error` of it, for random eyes, orientations and points.

    With `worst` the eye is as near as can be, the point in a corner of the image, its partner straight outwards.
    """
    rng = np.random.default_rng(seed)
    low, high = CELL[0]
    eyes = low + (high - low) * rng.random((count, 3))
    low, high = OBJECT[0]
    points = low + (high - low) * rng.random((count, 3))
    if worst:
        eyes[:], points[:] = (2, 1, 0.5), (9, 1, 0.5)
    rays = points - eyes
    width, height = LIMIT.screen.width, LIMIT.screen.height
    focal = height / 2 / np.tan(np.radians(LIMIT.screen.fov_deg) / 2)
    half = np.array([width, height]) / 2
    pixel = half * rng.uniform(-1, 1, (count, 2)) * rng.choice([0.5, 1.0], (count, 1))
    if worst:
        pixel[:] = half * (1 - 1e-9)
    # The camera that shows the point at that pixel: any one, turned about the ray.
    seen = unit(np.column_stack([pixel, np.full(count, focal)]))
    axes = np.stack([frame(a, b) for a, b in zip(seen, unit(rays), strict=True)])
    aside = unit(rng.normal(size=(count, 3)))
    if worst:
        outwards = seen[:, 2:] * seen - np.array([0.0, 0, 1])
        aside = unit(np.einsum("nji,nj->ni", axes, outwards))
        # On the tangent to the sphere of partners.
        sine = error / np.linalg.norm(rays, axis=1)[:, None]
        aside = aside * np.sqrt(1 - sine**2) - unit(rays) * sine
    partner = rays + aside * error
    at, shown = images(rays, axes, LIMIT)
    there, _ = images(partner, axes, LIMIT)
    depth = np.einsum("ni,ni->n", axes[:, 2], partner)
    assert (depth > 0).all()
    return np.linalg.norm(there - at, axis=1)[shown]


def frame(local, world):
    """A rotation, as rows right, up and forward, that shows the direction `world` at `local`."""

    def basis(first):
        second = unit(np.cross(first, [0.3, -0.5, 0.8]))
        return np.stack([first, second, np.cross(first, second)])

    return basis(local).T @ basis(world)


def test_no_sampled_displacement_exceeds_the_limit():
    error = largest_error()
    assert error > 0
    found = np.concatenate([displacements(error, 4000, 0), displacements(error, 5, 1, worst=True)])
    assert found.max() <= LIMIT.pixels


def test_the_limit_is_nearly_reached():
    # The box is grown by the deviation, so the surface is at least that much farther than reckoned with.
    assert displacements(largest_error(), 5, 1, worst=True).max() > 0.98 * LIMIT.pixels


@given(st.floats(0.01, 1.3), st.floats(0.001, 0.2), st.floats(-np.pi, np.pi), st.floats(0, 1))
def test_outwards_is_the_worst_direction(theta, b, turn, part):
    # The claim of the derivation: tan(theta + b) - tan(theta) bounds the displacement within a cone of half-angle b.
    if theta + b >= 1.5:
        return
    q = np.array([np.sin(theta), 0, np.cos(theta)])
    u, v = np.array([np.cos(theta), 0, -np.sin(theta)]), np.array([0, 1, 0])
    g = b * part
    r = np.cos(g) * q + np.sin(g) * (np.cos(turn) * u + np.sin(turn) * v)
    moved = np.linalg.norm(r[:2] / r[2] - q[:2] / q[2])
    assert moved <= (np.tan(theta + b) - np.tan(theta)) * (1 + 1e-9)


def test_the_middle_of_the_image_would_allow_too_much():
    # Error over distance times focal length, right in the image's middle, is short by the stretch in its corners.
    focal = 100 / np.tan(np.radians(75) / 2)
    naive = LIMIT.pixels / focal
    assert LIMIT.deviation_per_distance < 0.5 * naive


def test_levels_are_the_coarsest_that_do():
    error = largest_error()
    assert level([0.0, error / 4, error / 2, error * 0.999, error * 1.001]) == 3
    assert level([0.0, error / 4]) == 1
    assert level([0.0, error * 1.001]) == 0
    assert level([0.0]) == 0


def test_a_cell_that_meets_the_object_sees_the_finest_level():
    inside = np.array([[[9.5, 0, 1], [9.6, 1, 2]]])
    touching = np.array([[[0.0, 0, 0], [9, 3, 1]]])
    for cells in (inside, touching):
        assert level([0.0, 1e-9, 1.0], cells=cells) == 0
    assert level([0.0, 1e-7], cells=touching - np.array([1.0, 0, 0])) == 1


def test_the_box_grows_by_the_deviation():
    # At this distance the deviation is allowed only if the box is not grown by it.
    ratio = LIMIT.deviation_per_distance
    error = 7.0 * ratio
    assert level([0.0, error]) == 0
    assert level([0.0, error / (1 + ratio) * (1 - 1e-9)]) == 1


@given(st.floats(0.1, 100), st.integers(1, 4000), st.integers(1, 4000), st.floats(1, 170))
def test_more_pixels_or_fewer_of_them_allow_more(pixels, width, height, fov):
    ratio = PixelLimit(pixels, Screen(width, height, fov)).deviation_per_distance
    assert 0 < ratio < 1
    assert ratio <= PixelLimit(pixels * 1.5, Screen(width, height, fov)).deviation_per_distance
    assert ratio >= PixelLimit(pixels, Screen(width * 2, height, fov)).deviation_per_distance


def test_objects_have_levels_of_their_own():
    errors = np.array([0.0, 0.0, 1e-6, 0.0, 1e-6, 2e-6, 3e-6])
    found = pixel_levels(
        CELL, np.repeat(OBJECT, 3, axis=0), errors, np.array([0, 1, 3, 7]), np.array([[0, 0], [0, 1], [0, 2]]), LIMIT
    )
    assert found.tolist() == [0, 1, 3]


def test_pairs_in_chunks(monkeypatch):
    rng = np.random.default_rng(0)
    cells, bounds = (np.cumsum(rng.random((n, 2, 3)) * 9, axis=1) for n in (7, 11))
    counts = rng.integers(1, 5, 11)
    starts = np.concatenate([[0], np.cumsum(counts)])
    errors = np.concatenate([np.sort(rng.random(n) * 0.05) for n in counts])
    rows = np.array([(i, k) for i in range(7) for k in range(11)])
    whole = pixel_levels(cells, bounds, errors, starts, rows, LIMIT)
    alone = [pixel_levels(cells, bounds, errors, starts, row[None], LIMIT)[0] for row in rows]
    monkeypatch.setattr(pixel_error, "CHUNK", 5)
    assert (pixel_levels(cells, bounds, errors, starts, rows, LIMIT) == whole).all() and (alone == whole).all()
    assert (whole < counts[rows[:, 1]]).all() and (whole > 0).any()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"pixels": 0.0}, "pixels"),
        ({"pixels": np.nan}, "pixels"),
    ],
)
def test_bad_limits(change, said):
    with pytest.raises(InputError, match=said):
        PixelLimit(**change)


def test_bad_rows():
    with pytest.raises(InputError, match="rows"):
        pixel_levels(CELL, OBJECT, np.zeros(1), np.array([0, 1]), np.array([[0, 1]]), LIMIT)
    for starts in ([0, 2], [0, 1, 1], [0, 0, 1], [0]):
        with pytest.raises(InputError, match="starts"):
            pixel_levels(CELL, OBJECT, np.zeros(1), np.array(starts), np.array([[0, 0]]), LIMIT)
    with pytest.raises(InputError, match="starts"):
        pixel_levels(CELL, OBJECT, np.zeros(2), np.array([0, 1, 2]), np.array([[0, 0]]), LIMIT)
