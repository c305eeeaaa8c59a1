"""Which objects are alike: only a shift may be between them."""

import numpy as np
from viewcell.data.shapes import copies, extents, first_alike, mostly_copies, shape_key, shared_corners

WEDGE = np.array([[[0, 0, 0], [7, 0, 0], [0, 5, 0]], [[0, 0, 0], [0, 5, 0], [0, 0, 3]]], np.int32)


def test_what_is_shifted_is_alike_and_nothing_else():
    parts = [
        WEDGE,
        WEDGE + np.int32([9, -4, 2**20]),
        # Turned, a step larger, and in another order.
        WEDGE[:, :, [1, 0, 2]],
        WEDGE + np.eye(3, dtype=np.int32)[0] * (WEDGE > 6),
        WEDGE[::-1],
        WEDGE[::-1] - np.int32([1, 1, 1]),
        WEDGE[:0],
        WEDGE[:1],
        WEDGE[:0],
    ]
    starts = np.concatenate([[0], np.cumsum([len(part) for part in parts])])
    found = first_alike(np.concatenate(parts), starts)
    assert found.tolist() == [0, 0, 2, 3, 4, 4, 6, 7, 8]
    assert first_alike(np.zeros((0, 3, 3), np.int32), np.zeros(1, np.int64)).tolist() == []


def test_the_key_tells_corners_of_triangles_apart():
    assert shape_key(WEDGE) != shape_key(np.roll(WEDGE, 1, axis=1))


def test_shared_corners_are_those_of_every_triangle():
    """Many of one shape, a few of another, some of nothing; and a model without copies."""
    rng = np.random.default_rng(0)
    one, two = (rng.integers(-3, 4, (count, 3, 3)).astype(np.int32) for count in (200, 30))
    parts = [shape + rng.integers(-99, 99, 3).astype(np.int32) for shape in [one, two, one, one[:0], two, one] * 4]
    triangles, starts = np.concatenate(parts), np.concatenate([[0], np.cumsum([len(part) for part in parts])])
    models = first_alike(triangles, starts)
    assert mostly_copies(starts, models)
    points, places = shared_corners(triangles, starts, models)
    assert (points[places] == triangles).all() and len(points) < 2 * len(triangles) and places.dtype == np.int32
    assert [len(members) for _, members in copies(starts, models)] == [12, 8]
    own = np.arange(len(models))
    assert not mostly_copies(starts, own)
    points, places = shared_corners(triangles, starts, own)
    assert (points[places] == triangles).all()
    assert list(copies(np.zeros(3, int), np.arange(2))) == [] and not mostly_copies(np.zeros(1, int), own[:0])


def test_extents_are_sides_of_boxes():
    triangles = np.random.default_rng(1).integers(-(2**24), 2**24, (50, 3, 3)).astype(np.int32)
    np.testing.assert_array_equal(extents(triangles), np.ptp(triangles.astype(np.int64), axis=1))
    assert extents(triangles[:0]).shape == (0, 3)
