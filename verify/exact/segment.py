"""Exact predicates on one segment, point and triangle, in Python integers: the referee of last resort."""

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from ..arithmetic import Vector, as_integers, cross, dot, minus, sign

MISS, GRAZE, BLOCKED = 0, 1, 2


def crossing_kind(origin: np.ndarray, end: np.ndarray, triangle: np.ndarray) -> int:
    """How the open segment meets the closed triangle: MISS, GRAZE or BLOCKED (through its inside).

    Args:
        origin: 3 float64 [grid steps].
        end: 3 float64.
        triangle: corners, shape (3, 3), integers, not degenerate.
    """
    (o, e), scale = as_integers(origin, end)
    a, b, c = ([int(x) * scale for x in corner] for corner in triangle)
    normal = cross(minus(b, a), minus(c, a))
    before, after = sign(dot(normal, minus(o, a))), sign(dot(normal, minus(e, a)))
    if before == 0 == after:
        return GRAZE if _meets_in_plane(o, e, (a, b, c), normal) else MISS
    if before * after >= 0:
        return MISS
    along = minus(e, o)
    turns = [sign(dot(along, cross(minus(u, o), minus(v, o)))) for u, v in ((a, b), (b, c), (c, a))]
    if 1 in turns and -1 in turns:
        return MISS
    return GRAZE if 0 in turns else BLOCKED


def crossing_time(origin: np.ndarray, end: np.ndarray, triangle: np.ndarray) -> Fraction:
    """Where the segment crosses the triangle's plane, 0 at the origin and 1 at the end; they must not be parallel."""
    (o, e), scale = as_integers(origin, end)
    a, b, c = ([int(x) * scale for x in corner] for corner in triangle)
    normal = cross(minus(b, a), minus(c, a))
    return Fraction(dot(normal, minus(a, o)), dot(normal, minus(e, o)))


def meets_flat_box(origin: np.ndarray, end: np.ndarray, boxes: np.ndarray) -> bool:
    """Whether the closed segment meets one of the closed flat boxes, shape (n, 2, 3); exact."""
    low, high = np.minimum(origin, end), np.maximum(origin, end)
    # Outside the segment's own box there is nothing to compute.
    near = ((boxes[:, 0] <= high) & (boxes[:, 1] >= low)).all(axis=1)
    start, way = (
        [Fraction(float(x)) for x in origin],
        [Fraction(float(b)) - Fraction(float(a)) for a, b in zip(origin, end, strict=True)],
    )
    for box in boxes[near].tolist():
        first, last = Fraction(0), Fraction(1)
        for x, d, a, b in zip(start, way, *box, strict=True):
            if d == 0:
                # The segment's box told so already.
                continue
            times = sorted([(a - x) / d, (b - x) / d])
            first, last = max(first, times[0]), min(last, times[1])
        if first <= last:
            return True
    return False


def column_crossing(point: np.ndarray, triangle: np.ndarray) -> tuple[int, bool]:
    """Signed crossing of the column above a point with a triangle, and whether the point lies on the triangle.

    The point is moved by (d, d*d, 0) for a d too small to matter, so the column meets no edge: crossings of a closed
    surface then add up to its winding number. The sign is that of the normal's z component.
    """
    (p,), scale = as_integers(point)
    corners = [[int(x) * scale for x in corner] for corner in triangle]
    a, b, c = corners
    normal = cross(minus(b, a), minus(c, a))
    height = dot(normal, minus(p, a))
    if height == 0 and _meets_in_plane(p, p, corners, normal):
        return 0, True
    turns = set()
    for u, v in ((a, b), (b, c), (c, a)):
        x, y = v[0] - u[0], v[1] - u[1]
        turns.add(sign(x * (p[1] - u[1]) - y * (p[0] - u[0])) or sign(-y) or sign(x))
    inside = turns == {sign(normal[2])} and normal[2] != 0
    return (sign(normal[2]) if inside and height * normal[2] < 0 else 0), False


def _meets_in_plane(o: Vector, e: Vector, corners: Sequence[Vector], normal: Vector) -> bool:
    """Whether the open segment o e (or the point o == e) in the triangle's plane meets the closed triangle."""
    drop = max(range(3), key=lambda axis: abs(normal[axis]))
    i, j = (drop + 1) % 3, (drop + 2) % 3
    first, last = Fraction(0), Fraction(1)
    for edge in range(3):
        u, v = corners[edge], corners[(edge + 1) % 3]
        here, there = (
            ((v[i] - u[i]) * (p[j] - u[j]) - (v[j] - u[j]) * (p[i] - u[i])) * sign(normal[drop]) for p in (o, e)
        )
        if here < 0 and there < 0:
            return False
        if here < 0 or there < 0:
            at = Fraction(here, here - there)
            first, last = (max(first, at), last) if here < 0 else (first, min(last, at))
    # The ends do not belong to the segment, unless it is a point.
    return first <= last and (list(o) == list(e) or (last > 0 and first < 1))
