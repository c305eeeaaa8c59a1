"""Errors of depth meshes on images: never more than the closed form says, whatever eye looks where."""

import numpy as np
import pytest
from viewcell.data.camera import Screen
from viewcell.solvers.depth_meshes.parallax import EyeRange


def angles(a, b):
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))


@pytest.mark.parametrize("near", [1.05, 1.5, 4.0])
def test_no_eye_sees_a_point_farther_off(near):
    rng, count, eyes = np.random.default_rng(0), 200_000, EyeRange(1.0, near, 256.0)
    eye = rng.normal(size=(count, 3))
    eye /= np.linalg.norm(eye, axis=1)[:, None]
    way = np.column_stack([rng.uniform(-1, 1, (count, 2)), np.ones(count)])
    # Points and places drawn for them beyond the cull box, the nearest most often.
    depths = near / rng.uniform(0.01, 1, (2, count)) ** rng.uniform(0, 1, (2, count))
    true, drawn = eyes.parallax(1 / depths)
    off = angles(way * depths[0, :, None] - eye, way * depths[1, :, None] - eye) * eyes.focal
    bound = np.array([eyes.worst(error) for error in np.abs(true - drawn)])
    assert (off <= bound).all()
    # It is met by eyes so far aside of the way to what is nearest.
    cosine = 2 / near / (1 + 1 / near**2)
    eye = np.array([np.sqrt(1 - cosine**2), 0, cosine])
    point = np.array([0, 0, near])
    aside = angles((point - eye)[None], (point * 1.00001 - eye)[None])[0] * eyes.focal
    bound = eyes.worst(float(eyes.parallax(np.array(1 / near - 1 / (near * 1.00001)))))
    assert 0.99 * bound < aside <= bound


def test_half_the_way_to_a_corner_is_half_as_far_off():
    """The bound of an eye at o is that of a cell whose corners are as far: linear in |o|, and better."""
    whole, half = EyeRange(2.0, 4.0, 256.0), EyeRange(1.0, 4.0, 256.0)
    inverse = np.array([0.2, 0.21])
    errors = [abs(np.diff(one.parallax(inverse))[0]) for one in (whole, half)]
    assert errors[1] == pytest.approx(errors[0] / 2) and half.worst(errors[1]) < whole.worst(errors[0]) / 2
    assert whole.parallax(np.zeros(1))[0] == 0 and whole.worst(0.0) == 0


def test_pixels_of_a_screen():
    eyes, screen = EyeRange(1.0, 4.0, 256.0), Screen(640, 480, 60.0)
    for error in (0.0, 0.1, 1.0, 30.0):
        angle = eyes.worst(error) / eyes.focal
        # Turned by as much, a direction moves on the screen by no more, wherever on it.
        place = np.linspace(0, np.hypot(320, 240), 200)
        moved = screen.focal * np.tan(np.arctan(place / screen.focal) + angle) - place
        assert moved.max() <= eyes.on_screen(error, screen) + 1e-12
        assert moved.max() == pytest.approx(eyes.on_screen(error, screen), rel=1e-9, abs=1e-9)
    assert eyes.on_screen(1e6, screen) == np.inf
