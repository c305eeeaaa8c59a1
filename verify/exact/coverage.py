"""Conservative cube maps in rationals: which pixels a polygon covers wholly, which a box touches, and how deep.

Twin of `kernels/coverage.py` and `kernels/occludee.py`; shares nothing with them. A polygon covers a pixel when the
rays through the pixel's four corners all meet it; a box is clipped, face by face, to the pixel's cone. Pixels and faces
are numbered as in `kernels.coverage.CubeMaps.depth`.
"""

from collections.abc import Sequence
from fractions import Fraction
from itertools import product

import numpy as np

from ...data.errors import InputError
from ..arithmetic import cross, dot, minus

Point = Sequence[Fraction]
# Depth of each pixel, by row; None where the pixel is open, or not touched.
Image = list[list[Fraction | None]]


def fractions(point: Sequence[float]) -> list[Fraction]:
    """The coordinates as they are."""
    return [Fraction(float(c)) for c in point]


def direction(face: int, row: int, pixel: int, size: int) -> list[Fraction]:
    """Direction of depth 1 towards the low corner of a pixel; row and pixel may be `size`, the far border."""
    out = [Fraction(0)] * 3
    axis = face // 2
    out[axis] = Fraction(-1 if face % 2 else 1)
    out[(axis + 1) % 3] = Fraction(2 * pixel - size, size)
    out[(axis + 2) % 3] = Fraction(2 * row - size, size)
    return out


def cover_polygon(viewpoint: np.ndarray, polygon: np.ndarray, face: int, size: int) -> Image:
    """Farthest depth of the polygon in the pixels whose whole closed squares it covers.

    Args:
        viewpoint: 3 float64, off the polygon's plane.
        polygon: corners of a convex polygon, exactly planar, shape (n, 3).
        face: 0 to 5.
        size: pixels on the face's side.

    Raises:
        InputError: the polygon is not planar.
    """
    eye = fractions(viewpoint)
    corners = [fractions(corner) for corner in polygon]
    normal = next(
        n for n in (cross(minus(b, corners[0]), minus(c, corners[0])) for b in corners for c in corners) if any(n)
    )
    if any(dot(normal, minus(c, corners[0])) for c in corners):
        raise InputError("polygon: expected corners in one plane, found one off it")
    depths = [
        [_depth(eye, corners, normal, direction(face, j, i, size)) for i in range(size + 1)] for j in range(size + 1)
    ]
    return [
        [_farthest([depths[j + b][i + a] for a, b in product((0, 1), repeat=2)]) for i in range(size)]
        for j in range(size)
    ]


def _farthest(depths: list[Fraction | None]) -> Fraction | None:
    return None if None in depths else max(depths)


def _depth(eye: Point, corners: list[Point], normal: Point, towards: Point) -> Fraction | None:
    """Where the ray eye + t * towards, t > 0, meets the closed convex polygon."""
    slope, ahead = dot(normal, towards), dot(normal, minus(corners[0], eye))
    if slope == 0 or ahead * slope <= 0:
        return None
    t = ahead / slope
    hit = [e + t * d for e, d in zip(eye, towards, strict=True)]
    drop = max(range(3), key=lambda axis: abs(normal[axis]))
    x, y = (drop + 1) % 3, (drop + 2) % 3
    turns = [
        (b[x] - a[x]) * (hit[y] - a[y]) - (b[y] - a[y]) * (hit[x] - a[x])
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True)
    ]
    return t if min(turns) >= 0 or max(turns) <= 0 else None


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
            side = _clip(side, plane)
        depths += [corner[face // 2] * (-1 if face % 2 else 1) for corner in side]
    return min(depths, default=None)


def _clip(polygon: list[Point], normal: Point) -> list[Point]:
    """Part of a convex polygon with normal . x >= 0."""
    out = []
    for p, q in zip(polygon, polygon[1:] + polygon[:1], strict=True):
        at, to = dot(normal, p), dot(normal, q)
        if at >= 0:
            out.append(p)
        if (at < 0 < to) or (to < 0 < at):
            t = at / (at - to)
            out.append([x + t * (y - x) for x, y in zip(p, q, strict=True)])
    return out


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
