"""Meshes of depth images: every texel where it is said to be, told in rationals from the mesh as it is stored."""

from fractions import Fraction

import numpy as np
import pytest
from builders.depth_images import image
from hypothesis import given, settings
from hypothesis import strategies as st
from viewcell.data.errors import InputError
from viewcell.solvers.depth_meshes import mesh as module
from viewcell.solvers.depth_meshes.mesh import depth_mesh


def offsets(found, parallax, shown):
    """In rationals: how far each texel that shows something is off, by every triangle that holds it."""
    worst, held = Fraction(0), np.zeros(shown.shape, bool)
    corners = [[tuple(map(int, found.pixels[v])) for v in triangle] for triangle in found.triangles]
    heights = [[Fraction(float(found.parallax[v])) for v in triangle] for triangle in found.triangles]
    touched = np.zeros(len(corners), bool)
    for number, ((a, b, c), own) in enumerate(zip(corners, heights, strict=True)):
        whole = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        assert whole != 0
        for y in range(min(a[1], b[1], c[1]), max(a[1], b[1], c[1]) + 1):
            for x in range(min(a[0], b[0], c[0]), max(a[0], b[0], c[0]) + 1):
                parts = [
                    Fraction((q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]), whole)
                    for p, q in ((b, c), (c, a), (a, b))
                ]
                if min(parts) >= 0 and shown[y, x]:
                    held[y, x] = touched[number] = True
                    drawn = sum(part * height for part, height in zip(parts, own, strict=True))
                    worst = max(worst, abs(drawn - Fraction(float(parallax[y, x]))))
    return worst, held, touched


@settings(max_examples=25)
@given(st.integers(0, 10**6), st.sampled_from([0.05, 0.5, 3.0]))
def test_no_texel_is_farther_off_than_it_says(seed, error):
    parallax, shown = image(seed)
    found = depth_mesh(parallax, shown, error)
    worst, held, touched = offsets(found, parallax, shown)
    assert held[shown].all(), "every texel lies on the mesh"
    assert touched.all(), "no triangle is there for nothing"
    assert worst <= Fraction(found.error) and found.error <= error * (1 + 1e-5)
    assert found.error <= float(worst) * (1 + 1e-9) + 1e-9


def test_free_heights_cost_nothing():
    """A box before the sky is two triangles; before a wall it has a cliff around it."""
    shown = np.zeros((64, 64), bool)
    shown[20:40, 10:50] = True
    alone = depth_mesh(np.where(shown, 30.0, 0.0), shown, 0.1)
    before = depth_mesh(np.where(shown, 30.0, 1.0), np.ones((64, 64), bool), 0.1)
    assert len(alone.triangles) == 2 < len(before.triangles) and alone.error < 1e-6


def test_in_parts_as_in_one(monkeypatch):
    parallax, shown = image(3)
    whole = depth_mesh(parallax, shown, 0.1)
    monkeypatch.setattr(module, "PIXELS", 50)
    parts = depth_mesh(parallax, shown, 0.1)
    assert all(np.array_equal(a, b) for a, b in zip(whole.arrays(), parts.arrays(), strict=True))
    assert whole.error == parts.error


def test_a_triangle_that_lacks_a_texel_proves_nothing():
    parallax, shown = np.ones((8, 8)), np.ones((8, 8), bool)
    found = depth_mesh(parallax, shown, 0.1)
    pixels, heights = found.pixels.astype(int), found.parallax.astype(float)
    less = module._measure(pixels, heights, found.triangles.astype(int)[1:], parallax, shown)
    assert less[1] == np.inf


def test_nothing_shown_needs_no_mesh_and_bad_input_is_one_line():
    parallax = np.ones((8, 8))
    assert len(depth_mesh(parallax, np.zeros((8, 8), bool), 1.0).triangles) == 0
    for bad, expected in (
        ((parallax[0], parallax[0] > 0, 1.0), "parallax: expected an image"),
        ((np.ones((1, 8)), np.ones((1, 8), bool), 1.0), "parallax: expected an image"),
        ((np.full((8, 8), np.nan), parallax > 0, 1.0), "parallax: expected finite"),
        ((parallax, parallax > 0, 0.0), "error: expected texels above 0"),
    ):
        with pytest.raises(InputError, match=expected):
            depth_mesh(*bad)


def test_no_more_triangles_than_asked_for():
    parallax, shown = image(5)
    whole, few = depth_mesh(parallax, shown, 0.1), depth_mesh(parallax, shown, 0.1, most=12)
    assert len(few.triangles) <= 13 < len(whole.triangles) and few.error > whole.error
    worst, held, _ = offsets(few, parallax, shown)
    assert held[shown].all() and worst <= Fraction(few.error)
