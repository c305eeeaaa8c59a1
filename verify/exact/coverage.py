"""Conservative cube maps in rationals: which pixels a polygon covers wholly, and how deep.

Twin of `kernels/coverage.py`; shares nothing with it. A polygon covers a pixel when the rays through the pixel's four
corners all meet it. Pixels and faces are numbered as in `kernels.coverage.CubeMaps.depth`.
"""

from collections.abc import Sequence
from fractions import Fraction
from itertools import product

import numpy as np

from ...data.errors import InputError
from ..arithmetic import cross, dot, fractions, minus

__all__ = ["cover_polygon", "direction"]

Point = Sequence[Fraction]
# Depth of each pixel, by row; None where the pixel is open, or not touched.
Image = list[list[Fraction | None]]


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
