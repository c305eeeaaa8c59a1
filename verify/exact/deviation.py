"""Deviation of one triangle mesh from another, in rationals: bounds on the squared distance that nothing can round.

One direction is max over a in A of min over b in B of |a - b|**2. A point and a triangle are nearest at a corner, on an
edge or inside, so the least of seven candidates is their distance. A triangle of A is within the distance of its
farthest corner from any one triangle of B, because the distance to a convex set is convex; its corners and its centroid
show what the distance is at least. The piece with the greatest bound is quartered, again and again.
"""

import heapq
from collections.abc import Sequence
from fractions import Fraction
from itertools import count

from ..arithmetic import along, dot, minus

Point = tuple[Fraction, Fraction, Fraction]
Triangle = tuple[Point, Point, Point]


def squared_distance(p: Point, triangle: Triangle) -> Fraction:
    """Squared distance of a point from a closed triangle, which may be a segment or a point."""
    candidates = list(triangle)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        start, edge = triangle[a], minus(triangle[b], triangle[a])
        size = dot(edge, edge)
        if size and 0 < dot(minus(p, start), edge) < size:
            candidates.append(along(start, dot(minus(p, start), edge) / size, edge))
    corner, u, v = triangle[0], minus(triangle[1], triangle[0]), minus(triangle[2], triangle[0])
    # p - corner = s u + t v + (across): the normal equations, by Cramer's rule.
    uu, uv, vv = dot(u, u), dot(u, v), dot(v, v)
    pu, pv = dot(minus(p, corner), u), dot(minus(p, corner), v)
    gram = uu * vv - uv * uv
    if gram:
        s, t = (pu * vv - pv * uv) / gram, (pv * uu - pu * uv) / gram
        if s > 0 and t > 0 and s + t < 1:
            candidates.append(along(along(corner, s, u), t, v))
    return min(dot(minus(p, q), minus(p, q)) for q in candidates)


def deviation_squared(a: Sequence[Triangle], b: Sequence[Triangle], pieces: int) -> tuple[Fraction, Fraction]:
    """Bounds on the square of the greatest distance from surface a to surface b, exact.

    Args:
        a: triangles with rational coordinates, at least one.
        b: likewise.
        pieces: times that a piece may be quartered; more is tighter.

    Returns:
        lower <= truth <= upper; equal where a corner or a centroid is farthest and `pieces` sufficed to see it.
    """
    order = count()
    lower = Fraction(0)
    queue: list[tuple[Fraction, int, Triangle]] = []

    def add(piece: Triangle, above: Fraction | None) -> Fraction:
        square = [[squared_distance(v, other) for v in (*piece, _centroid(piece))] for other in b]
        upper = min(max(row[:3]) for row in square)
        if above is not None:
            upper = min(upper, above)
        heapq.heappush(queue, (-upper, next(order), piece))
        return max(min(column) for column in zip(*square, strict=True))

    for triangle in a:
        lower = max(lower, add(triangle, None))
    for _ in range(pieces):
        if -queue[0][0] <= lower:
            break
        upper, _, piece = heapq.heappop(queue)
        for quarter in _quarters(piece):
            lower = max(lower, add(quarter, -upper))
    return lower, max(lower, -queue[0][0])


def _centroid(piece: Triangle) -> Point:
    return tuple(sum(column) / Fraction(3) for column in zip(*piece, strict=True))


def _quarters(piece: Triangle) -> list[Triangle]:
    a, b, c = piece
    ab, bc, ca = (tuple((x + y) / 2 for x, y in zip(p, q, strict=True)) for p, q in ((a, b), (b, c), (c, a)))
    return [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
