"""Vectors of integers or fractions, exactly: the algebra that twins and checkers of proofs share.

Nothing here decides anything about visibility, so sharing it joins no twin with what it checks.
"""

from collections.abc import Sequence
from fractions import Fraction
from itertools import product

import numpy as np

Vector = Sequence[int | Fraction]


def as_integers(*points: np.ndarray) -> tuple[list[list[int]], int]:
    """The points times the smallest power of two that makes all their float64 coordinates integers, and that power."""
    ratios = [[float(c).as_integer_ratio() for c in point] for point in points]
    scale = max(bottom for point in ratios for _, bottom in point)
    return [[top * (scale // bottom) for top, bottom in point] for point in ratios], scale


def fractions(point: Sequence[float]) -> list[Fraction]:
    """The coordinates as fractions; floats are taken at their exact value."""
    # A Fraction of NumPy's integers would keep them, and overflow.
    return [Fraction(c) for c in (point.tolist() if isinstance(point, np.ndarray) else point)]


def rational(points: Sequence[Sequence[float]]) -> list[list[Fraction]]:
    """`fractions` of each point."""
    return [fractions(point) for point in points]


def box_corners(box: Sequence[Vector]) -> list[list[Fraction]]:
    """The eight corners of (low, high)."""
    return [[Fraction(box[side][i]) for i, side in enumerate(pick)] for pick in product((0, 1), repeat=3)]


def minus(a: Vector, b: Vector) -> list[int | Fraction]:
    """Difference a - b."""
    return [x - y for x, y in zip(a, b, strict=True)]


def along(a: Vector, s: int | Fraction, b: Vector) -> list[int | Fraction]:
    """The point a + s b."""
    return [x + s * y for x, y in zip(a, b, strict=True)]


def cross(a: Vector, b: Vector) -> list[int | Fraction]:
    """Cross product."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a: Vector, b: Vector) -> int | Fraction:
    """Scalar product."""
    return sum(x * y for x, y in zip(a, b, strict=True))


def sign(value: int | Fraction) -> int:
    """-1, 0 or 1."""
    return (value > 0) - (value < 0)


def clip(polygon: Sequence[Vector], m: Vector, c: int | Fraction = 0) -> list[Vector]:
    """The part of a convex polygon with m . q >= c."""
    out = []
    for a, b in zip(polygon, [*polygon[1:], *polygon[:1]], strict=True):
        here, there = dot(m, a) - c, dot(m, b) - c
        if here >= 0:
            out.append(a)
        if here * there < 0:
            out.append(along(a, Fraction(here, here - there), minus(b, a)))
    return out
