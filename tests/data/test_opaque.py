"""Opaque rectangles of whole models: planes, and what is carved out of them."""

import numpy as np
from builders.planes import ROUND, pierced
from viewcell.data.graph import OTHER_AXES
from viewcell.data.opaque import carved_planes, opaque_planes


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
