"""From-region visibility in the plane, in rationals: does anything inside a convex cell see anything of a segment?

As in `region_exact`, for an edge a of the cell and the part b of the target beyond it. Lines of the plane are vectors
p x t of three homogeneous coordinates with no condition on them: if a lies on one side of the target, every nonnegative
combination of the four lines between the ends of a and b is a line that crosses a and b. So the matrix game is exact,
occluders are branched on (both ends to the left, or both to the right), and the answer is never UNKNOWN.
"""

import itertools
from collections.abc import Sequence
from fractions import Fraction
from math import gcd, lcm
from typing import NoReturn

from ...data.errors import InputError
from ...data.verdict import Verdict
from .matrix_game import play
from .region import Point, Rational, RegionAnswer

__all__ = ["cell_corners", "region_visible_2d"]

# A point x, y, w > 0, or a line whose product with a point is positive to its left.
Homogeneous = tuple[int, int, int]
Segment = list[Homogeneous]


class _Seen(Exception):
    """A line was found that crosses the edge, then the target, and no occluder between."""


def region_visible_2d(
    cell: Sequence[Sequence[Rational]],
    target: Sequence[Sequence[Rational]],
    occluders: Sequence[Sequence[Sequence[Rational]]],
) -> RegionAnswer:
    """Whether a segment from inside the cell to inside the target misses all occluders.

    Args:
        cell: (low, high) of a box, or the corners of a convex polygon either way round; with inside.
        target: two different points.
        occluders: closed segments. One in the target's own line hides nothing of it.

    Returns:
        VISIBLE with a rational segment, or HIDDEN with a certificate, see `region_certificate_2d.holds_2d`; never
        wrong. What is seen only along ends of occluders is HIDDEN.

    Raises:
        InputError: the cell is not convex with inside, or a segment has no length.
    """
    corners = [_homogeneous(corner) for corner in cell_corners(cell)]
    ends, *walls = ([_homogeneous(x) for x in _segment(s, k)] for k, s in enumerate([target, *occluders]))
    search = _Search(corners, ends, walls)
    try:
        trees = search.certificate()
    except _Seen as seen:
        return RegionAnswer(Verdict.VISIBLE, *search.witness(*seen.args), nodes=search.nodes)
    return RegionAnswer(Verdict.HIDDEN, certificate=trees, nodes=search.nodes)


def cell_corners(cell: Sequence[Sequence[Rational]]) -> list[Point]:
    """Corners of a box or convex polygon, counter-clockwise.

    Raises:
        InputError: it is not convex, or has no inside.
    """
    corners = _points(cell, "cell")
    if len(corners) == 2:
        (x, y), (u, v) = corners
        corners = [[x, y], [u, y], [u, v], [x, v]] if x < u and y < v else []
    for ring in (corners, corners[::-1]):
        edges = [*zip(ring, ring[1:] + ring[:1], strict=True)]
        turns = [(b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) for a, b in edges for c in ring]
        if len(ring) > 2 and min(turns) >= 0 and max(turns) > 0 and all(a != b for a, b in edges):
            return ring
    raise InputError(f"cell: expected low < high, or a convex polygon with inside; found {cell}")


def _points(points: Sequence[Sequence[Rational]], name: str) -> list[Point]:
    try:
        out = [[Fraction(c) for c in point] for point in points]
    except (ValueError, OverflowError, TypeError):
        out = []
    if not out or any(len(point) != 2 for point in out):
        raise InputError(f"{name}: expected points x, y of rational coordinates; found {points}")
    return out


def _segment(points: Sequence[Sequence[Rational]], number: int) -> list[Point]:
    name = f"occluder {number - 1}" if number else "target"
    ends = _points(points, name)
    if len(ends) != 2 or ends[0] == ends[1]:
        raise InputError(f"{name}: expected two different points; found {points}")
    return ends


def _homogeneous(point: Point) -> Homogeneous:
    w = lcm(*(c.denominator for c in point))
    return (*(int(c * w) for c in point), w)


def _cartesian(p: Homogeneous) -> Point:
    return [Fraction(c, p[2]) for c in p[:2]]


def _cross(p: Homogeneous, q: Homogeneous) -> Homogeneous:
    """The line from p to q, or the point where two lines meet."""
    return p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]


def _dot(line: Homogeneous, point: Homogeneous) -> int:
    return line[0] * point[0] + line[1] * point[1] + line[2] * point[2]


def _positive(point: Homogeneous) -> Homogeneous:
    """The same point with w > 0."""
    shared = gcd(*point) * (1 if point[2] > 0 else -1)
    return tuple(c // shared for c in point)


def _clip(segment: Segment, line: Homogeneous, sign: int) -> Segment:
    """The closed part with sign * line . x >= 0: two ends, the same if it is a point, or nothing."""
    heights = [sign * _dot(line, x) for x in segment]
    if not segment or max(heights) < 0:
        return []
    cut = None if min(heights) >= 0 else _positive(_cross(line, _cross(*segment)))
    return [x if height >= 0 else cut for x, height in zip(segment, heights, strict=True)]


class _Search:
    """The trees of one cell.

    Attributes:
        nodes: visited so far.
    """

    def __init__(self, corners: Segment, target: Segment, walls: list[Segment]):
        self.edges = [list(pair) for pair in zip(corners, corners[1:] + corners[:1], strict=True)]
        self.target, self.line, self.walls, self.nodes = target, _cross(*target), walls, 0

    def certificate(self) -> tuple:
        """A pair of trees per edge of the cell.

        Raises:
            _Seen: the target is visible along a segment from (origin) in direction (step) to (end).
        """
        inside = self.target
        for edge in self.edges:
            inside = _clip(inside, _cross(*edge), 1)
        if inside and inside[0] != inside[1]:
            self._see_within(inside)
        return tuple(tuple(self._edge(edge, sign) for sign in (-1, 1)) for edge in self.edges)

    def _see_within(self, inside: Segment) -> NoReturn:
        """Raise the segment to a part of the target that lies in the closed cell."""
        ends = [_cartesian(x) for x in inside]
        corners = [_cartesian(edge[0]) for edge in self.edges]
        middle = [sum(c) / len(corners) for c in zip(*corners, strict=True)]
        off = next(c for c, edge in zip(corners, self.edges, strict=True) if _dot(self.line, edge[0]))
        eye = (
            middle if _dot(self.line, _homogeneous(middle)) else [(x + y) / 2 for x, y in zip(middle, off, strict=True)]
        )
        for k in itertools.count(2):
            end = [x + (y - x) / k for x, y in zip(*ends, strict=True)]
            at = _homogeneous(end)
            # The line of each occluder holds at most one point of the target.
            if all(_dot(_cross(*wall), at) for wall in self._blocking()):
                raise _Seen(end, [x - y for x, y in zip(eye, end, strict=True)], end)

    def _blocking(self) -> list[Segment]:
        return [wall for wall in self.walls if any(_dot(self.line, x) for x in wall)]

    def _edge(self, edge: Segment, sign: int) -> tuple | None:
        """Tree of the part of an edge on one side of the target."""
        outward = _cross(*edge)
        a, b = _clip(edge, self.line, sign), _clip(self.target, outward, -1)
        if not (a and b) or a[0] == a[1] or b[0] == b[1] or not any(_dot(outward, x) for x in b):
            return None
        walls = {}
        for k, wall in enumerate(self.walls):
            part = _clip(_clip(wall, outward, -1), self.line, sign)
            if part and any(_dot(self.line, x) for x in wall):
                walls[k] = part
        lines = [_cross(p, t) for p in a for t in b]
        return self._proof((edge, lines), walls, [])

    def _proof(self, pair: tuple[Segment, list[Homogeneous]], walls: dict[int, Segment], points: Segment) -> tuple:
        """Tree that no line of the hull has all points on its left and misses all occluders.

        Args:
            pair: the edge, and the four lines between the ends of its part and of the target's.
            walls: parts of the occluders that a line meets between the two, those not yet chosen.
            points: chosen, times -1 where they are to be on the right.
        """
        self.nodes += 1
        edge, lines = pair
        rows, columns = play([[_dot(line, x) for line in lines] for x in points]) if points else (None, [1] * 4)
        if rows is not None:
            # Weights of points with w = 1.
            return "leaf", tuple(weight * abs(x[2]) for weight, x in zip(rows, points, strict=True))
        line = _inner(lines, columns, points)
        for k, wall in walls.items():
            sides = [_dot(line, x) for x in wall]
            if min(sides) <= 0 <= max(sides):
                others = {number: part for number, part in walls.items() if number != k}
                right = [tuple(-c for c in x) for x in wall]
                return "branch", k, *(self._proof(pair, others, [*points, *side]) for side in (wall, right))
        p, t = (_cartesian(_positive(_cross(line, other))) for other in (_cross(*edge), self.line))
        raise _Seen(p, [x - y for x, y in zip(p, t, strict=True)], t)

    def witness(self, origin: Point, step: Point, end: Point) -> tuple[Point, Point]:
        """A segment to the end from near the origin: all near enough are inside the cell and clear."""
        s = Fraction(1)
        while True:
            start = [x + s * y for x, y in zip(origin, step, strict=True)]
            at = _homogeneous(start)
            if all(_dot(_cross(*edge), at) > 0 for edge in self.edges) and self._clear(at, _homogeneous(end)):
                return start, end
            s /= 2

    def _clear(self, start: Homogeneous, end: Homogeneous) -> bool:
        """Whether the closed segment misses all occluders; one in the line of an occluder counts as met."""
        line = _cross(start, end)
        for wall in self._blocking():
            across, along = [_dot(line, x) for x in wall], [_dot(_cross(*wall), x) for x in (start, end)]
            if min(across) <= 0 <= max(across) and min(along) <= 0 <= max(along):
                return False
        return True


def _inner(lines: list[Homogeneous], weights: list[int], points: Segment) -> Homogeneous:
    """A line in the inside of the hull with all points on its left, near one that has."""
    while True:
        mixed = [weight + 1 for weight in weights]
        line = tuple(sum(w * x[i] for w, x in zip(mixed, lines, strict=True)) for i in range(3))
        if all(_dot(line, x) > 0 for x in points):
            shared = gcd(*line)
            return tuple(c // shared for c in line)
        weights = [16 * weight for weight in weights]
