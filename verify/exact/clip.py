"""Triangles clipped to boxes, in rationals: the truth that kernels/clip.py is held against."""

from fractions import Fraction
from itertools import pairwise

import numpy as np


def clipped(triangle: np.ndarray, low: np.ndarray, high: np.ndarray) -> list[tuple[Fraction, ...]]:
    """Corners of the triangle clipped to the closed box, in rationals; a corner may be repeated."""
    polygon = [tuple(Fraction(int(c)) for c in corner) for corner in triangle]
    for axis in range(3):
        for sign, k in ((1, int(low[axis])), (-1, int(high[axis]))):
            edges = list(zip(polygon, polygon[1:] + polygon[:1], strict=True))
            polygon = []
            for p, q in edges:
                s, t = sign * (p[axis] - k), sign * (q[axis] - k)
                if s >= 0:
                    polygon.append(p)
                if s * t < 0:
                    polygon.append(tuple(a + (b - a) * s / (s - t) for a, b in zip(p, q, strict=True)))
    return polygon


def bounds_of(points: list[tuple[Fraction, ...]]) -> tuple[list[Fraction], list[Fraction]]:
    """Least and largest coordinates of points."""
    return [min(c) for c in zip(*points, strict=True)], [max(c) for c in zip(*points, strict=True)]


def has_area(polygon: list[tuple[Fraction, ...]]) -> bool:
    """Whether a polygon is more than a segment."""
    for p, q in pairwise(polygon[1:]):
        u, v = ([b - a for a, b in zip(polygon[0], end, strict=True)] for end in (p, q))
        if any(u[i] * v[i - 1] != u[i - 1] * v[i] for i in range(3)):
            return True
    return False
