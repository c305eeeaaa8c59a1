"""Which pixels of a cube map a box touches, and whether what covers them is nearer, in rationals.

Twin of `kernels/occludee.py`; shares nothing with it. A box is clipped, face by face, to each pixel's cone.
"""

from collections.abc import Sequence
from fractions import Fraction
from itertools import product

import numpy as np

from ..arithmetic import clip, cross, dot, fractions, minus
from .coverage import Image, Point, cover_polygon, direction


def touched_pixels(viewpoint: np.ndarray, box: np.ndarray, face: int, size: int) -> Image:
    """Nearest depth of the closed box in the pixels that it touches; viewpoint outside the box, box (2, 3)."""
    eye, low, high = fractions(viewpoint), fractions(box[0]), fractions(box[1])
    low, high = minus(low, eye), minus(high, eye)
    sides = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for k in (low[axis], high[axis]):
            side = []
            for a, b in ((low, low), (high, low), (high, high), (low, high)):
                corner = [k] * 3
                corner[u], corner[v] = a[u], b[v]
                side.append(corner)
            sides.append(side)
    return [[_nearest(sides, face, row, pixel, size) for pixel in range(size)] for row in range(size)]


def _nearest(sides: list[list[Point]], face: int, row: int, pixel: int, size: int) -> Fraction | None:
    """Least depth of the box's sides in a pixel's cone; the point nearest to the cone's apex is on one of them."""
    a, b, c, d = (direction(face, row + j, pixel + i, size) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
    middle = [sum(x) for x in zip(a, b, c, d, strict=True)]
    planes = [cross(p, q) for p, q in ((a, b), (b, c), (c, d), (d, a))]
    planes = [m if dot(m, middle) > 0 else [-x for x in m] for m in planes]
    depths = []
    for side in sides:
        for plane in planes:
            side = clip(side, plane)
        depths += [corner[face // 2] * (-1 if face % 2 else 1) for corner in side]
    return min(depths, default=None)


def covers_box(viewpoint: np.ndarray, polygons: Sequence[np.ndarray], box: np.ndarray, size: int) -> bool:
    """Whether each pixel that the box touches is wholly covered by a polygon nearer than the box in that pixel."""
    if all(low <= eye <= high for low, eye, high in zip(*map(fractions, (box[0], viewpoint, box[1])), strict=True)):
        return False
    for face in range(6):
        touched = touched_pixels(viewpoint, box, face, size)
        if all(depth is None for row in touched for depth in row):
            continue
        images = [cover_polygon(viewpoint, polygon, face, size) for polygon in polygons]
        for row, pixel in product(range(size), repeat=2):
            found = [image[row][pixel] for image in images if image[row][pixel] is not None]
            if touched[row][pixel] is not None and not (found and min(found) < touched[row][pixel]):
                return False
    return True
