"""Which objects are alike: only a shift may be between them."""

import numpy as np
from viewcell.data.shapes import first_alike, shape_key

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
