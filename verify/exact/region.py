"""From-region visibility in rationals: does anything inside a convex cell see anything of a convex target?

A segment that leaves the cell is as good from its exit point p on a face, so all pairs (p, t) of a face a and the part
b of the target beyond its plane are searched. An occluder that has a and b on opposite sides is missed by the line p t
exactly if the line passes outside one of its edges, side(p, t, edge) > 0: branch on the edge; if a or b straddles its
plane, cut it there first. side is affine in p and in t, so on a x b it lies in the hull of its values at the pairs of
corners: a matrix game whose value is <= 0 refutes the chosen edges (Farkas' lemma in Pluecker space, where Haumont et
al. 2005, "A low dimensional framework for exact polygon-to-polygon occlusion queries", subtract polytopes). If its
value is positive, the strategy proposes a line; with p fixed all conditions are linear in t, which repairs it. Where no
line is found, a or b is halved.

Cells are open, occluders closed, the end lies inside the target: what is seen only along occluder borders, a set of
lines of measure zero, is HIDDEN. The search stops at its limit, UNKNOWN, where no piece around a line that grazes
several edges, however small, can be refuted. Three edges that meet in a point, as those of a box's corner, are refuted
without halving (`corner` in `region_certificate`).
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import gcd, lcm
from typing import NoReturn

import numpy as np

from ...data.errors import InputError
from ...data.verdict import Verdict
from ..arithmetic import along, cross, dot, minus
from .matrix_game import play

__all__ = ["RegionAnswer", "box_faces", "cell_faces", "region_visible", "segment_clear"]

Rational = int | float | Fraction
Point = list[Fraction]
# A point x, y, z, w > 0, or a plane h . x + h3 w = 0 with positive side h . x > 0.
Homogeneous = tuple[int, int, int, int]
Polygon = list[Homogeneous]
# Pluecker coordinates of a line, or dual ones of an edge: the side is their product.
Line = tuple[int, ...]
# A proposed line is repaired by moving its end, then its start, ...
REPAIRS = (1, 0, 1)
# Weights of proposals are rounded to so many bits: short numbers first, then points near borders.
ROUNDINGS = (8, 24, 60)
# Pieces are halved so often; all of them before any more often.
HALVINGS = (4, 8, 16, 32, 64)


@dataclass(frozen=True)
class RegionAnswer:
    """Answer to one from-region question.

    Attributes:
        verdict: VISIBLE, HIDDEN, or UNKNOWN at a limit of the search.
        start: of a witness segment, strictly inside the cell, exact; None unless VISIBLE.
        end: of it, in the relative interior of the target. The closed segment meets no occluder, those in the target's
            plane apart.
        certificate: one tuple of trees per face of the target, see `region_certificate.holds`; None unless HIDDEN.
        nodes: of the search.
    """

    verdict: Verdict
    start: Point | None = None
    end: Point | None = None
    certificate: tuple[tuple, ...] | None = None
    nodes: int = 0


class _Seen(Exception):
    """A segment was found, from (start) to (end)."""


class _Spent(Exception):
    """The limit of nodes or of halvings was reached."""


def box_faces(low: Sequence[Rational], high: Sequence[Rational]) -> list[list[list[Rational]]]:
    """The six faces of a box with inside."""
    faces = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for end in (low, high):
            face = []
            for x, y in ((low[u], low[v]), (high[u], low[v]), (high[u], high[v]), (low[u], high[v])):
                corner = [end[axis]] * 3
                corner[u], corner[v] = x, y
                face.append(corner)
            faces.append(face)
    return faces


def region_visible(
    cell: Sequence, target: Sequence, occluders: Sequence[Sequence[Sequence[Rational]]], nodes: int = 20_000
) -> RegionAnswer:
    """Whether a segment from inside the cell to inside the target misses all occluders.

    Args:
        cell: (low, high) of a box, or the faces of a convex polytope; with inside.
        target: a planar convex polygon, or faces, of which one is to be seen (of a convex polytope, say).
        occluders: planar convex polygons, closed. One in the target's own plane hides nothing of it.
        nodes: limit of the search; pieces of faces and target are halved 64 times at most besides.

    Returns:
        VISIBLE with a rational segment, HIDDEN with a certificate, never wrong; UNKNOWN only at a limit.

    Raises:
        InputError: a polygon is not planar and convex with area, or the cell is no convex polytope with inside.
    """
    faces = cell_faces(cell)
    targets = [target] if len(target) and np.ndim(target[0]) == 1 else target
    targets = [_polygon(points, f"target {k}") for k, points in enumerate(targets)]
    walls = [_polygon(points, f"occluder {k}") for k, points in enumerate(occluders)]
    search = _Search(faces, walls, nodes)
    certificate = []
    try:
        for points in targets:
            certificate.append(search.certificate(_homogeneous(points)))
    except _Seen as seen:
        start, end = seen.args
        return RegionAnswer(Verdict.VISIBLE, start, end, nodes=search.nodes)
    except _Spent:
        return RegionAnswer(Verdict.UNKNOWN, nodes=search.nodes)
    return RegionAnswer(Verdict.HIDDEN, certificate=tuple(certificate), nodes=search.nodes)


def cell_faces(cell: Sequence) -> list[list[Point]]:
    """The faces of a box or polytope, counter-clockwise seen from outside.

    Raises:
        InputError: as `region_visible`.
    """
    if len(cell) == 2:
        if not all(a < b for a, b in zip(*cell, strict=True)):
            raise InputError(f"cell: expected low < high on every axis; found {cell[0]}, {cell[1]}")
        cell = box_faces(*cell)
    faces = [_polygon(face, f"face {k} of the cell") for k, face in enumerate(cell)]
    corners = [point[:3] for point in _homogeneous([corner for face in faces for corner in face])]
    total, count = [sum(c) for c in zip(*corners, strict=True)], len(corners)
    out, edges, first = [], set(), 0
    for k, face in enumerate(faces):
        n, c = _plane(corners[first : first + len(face)])
        first += len(face)
        if dot(n, total) > c * count:
            n, c, face = [-x for x in n], -c, face[::-1]
        if dot(n, total) == c * count or any(dot(n, corner) > c for corner in corners):
            raise InputError(f"cell: expected a convex polytope with inside; its face {k} has corners on both sides")
        edges |= {(tuple(a), tuple(b)) for a, b in zip(face, face[1:] + face[:1], strict=True)}
        out.append(face)
    if len(out) < 4 or any((b, a) not in edges for a, b in edges):
        raise InputError(f"cell: expected faces that close a polytope; found an open edge or {len(out)} faces")
    return out


def segment_clear(start: Point, end: Point, wall: Sequence[Point]) -> bool:
    """Whether the closed segment certainly misses the closed polygon; not certain is a segment in its plane."""
    n, c = _plane(wall)
    before, behind = dot(n, start) - c, dot(n, end) - c
    if before * behind > 0:
        return True
    if before == behind:
        return False
    x = along(start, before / (before - behind), minus(end, start))
    return any(dot(n, cross(minus(b, a), minus(x, a))) < 0 for a, b in zip(wall, [*wall[1:], wall[0]], strict=True))


def _polygon(points: Sequence[Sequence[Rational]], name: str) -> list[Point]:
    try:
        corners = [[Fraction(c) for c in point] for point in points]
    except (ValueError, OverflowError, TypeError):
        raise InputError(f"{name}: expected rational coordinates; found {points}") from None
    if len(corners) < 3 or any(len(corner) != 3 for corner in corners):
        raise InputError(f"{name}: expected three or more corners x, y, z; found {points}")
    scaled = [point[:3] for point in _homogeneous(corners)]
    n, c = _plane(scaled)
    flat = any(n) and all(dot(n, corner) == c for corner in scaled)
    for a, b in zip(scaled, scaled[1:] + scaled[:1], strict=True):
        inwards = cross(n, minus(b, a))
        flat = flat and a != b and all(dot(inwards, x) >= dot(inwards, a) for x in scaled)
    if not flat:
        raise InputError(f"{name}: expected a planar convex polygon with area; found {points}")
    return corners


def _plane(corners: Sequence[Point]) -> tuple[Point, Fraction]:
    """(n, c) with n . x = c and n counter-clockwise about the polygon."""
    n = [0] * 3
    for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
        n = along(n, 1, cross(minus(a, corners[0]), minus(b, corners[0])))
    return n, dot(n, corners[0])


def _homogeneous(polygon: Sequence[Point]) -> Polygon:
    """The points with one common w."""
    w = lcm(*(c.denominator for point in polygon for c in point))
    return [(*(int(c * w) for c in point), w) for point in polygon]


def _cartesian(p: Homogeneous) -> Point:
    return [Fraction(c, p[3]) for c in p[:3]]


def _reduced(vector: Sequence[int]) -> tuple[int, ...]:
    shared = gcd(*vector)
    return tuple(c // shared for c in vector) if shared > 1 else tuple(vector)


def _integer_plane(n: Sequence[Fraction], c: Fraction) -> Homogeneous:
    scale = lcm(*(x.denominator for x in (*n, c)))
    return _reduced([*(int(x * scale) for x in n), int(-c * scale)])


def _at(h: Homogeneous, p: Homogeneous) -> int:
    return h[0] * p[0] + h[1] * p[1] + h[2] * p[2] + h[3] * p[3]


def _clip(polygon: Polygon, h: Homogeneous) -> Polygon:
    """The part with h >= 0; empty if it has no area."""
    heights = [_at(h, p) for p in polygon]
    if max(heights) <= 0:
        return []
    out = []
    for k, (p, here) in enumerate(zip(polygon, heights, strict=True)):
        q, there = polygon[k - 1], heights[k - 1]
        if (here < 0 < there) or (there < 0 < here):
            out.append(_reduced([abs(there) * x + abs(here) * y for x, y in zip(p, q, strict=True)]))
        if here >= 0:
            out.append(p)
    return out


def _line(p: Homogeneous, t: Homogeneous) -> Line:
    """Pluecker coordinates of the line from p to t."""
    return (
        p[0] * t[1] - p[1] * t[0],
        p[0] * t[2] - p[2] * t[0],
        p[0] * t[3] - p[3] * t[0],
        p[1] * t[2] - p[2] * t[1],
        p[1] * t[3] - p[3] * t[1],
        p[2] * t[3] - p[3] * t[2],
    )


def _dual(a: Homogeneous, b: Homogeneous) -> Line:
    """The edge from a to b as a functional of lines: positive where it runs counter-clockwise about the line."""
    m = _line(b, a)
    return m[5], -m[4], m[3], m[2], -m[1], m[0]


def _undual(edge: Line) -> Line:
    """Pluecker coordinates of the line of an edge, from its end to its start."""
    return edge[5], -edge[4], edge[3], edge[2], -edge[1], edge[0]


def _side(line: Line, edge: Line) -> int:
    return sum(map(int.__mul__, line, edge))


def _mix(polygon: Polygon, weights: Sequence[int], bits: int) -> Homogeneous:
    """A point inside the polygon: corners weighted by homogeneous weights, rounded to so many bits, none to zero."""
    real = [weight * p[3] for weight, p in zip(weights, polygon, strict=True)]
    total = sum(real)
    shares = [1 + (weight << bits) // total for weight in real]
    w = lcm(*(p[3] for p in polygon))
    scaled = [share * (w // p[3]) for share, p in zip(shares, polygon, strict=True)]
    return _reduced([sum(s * p[i] for s, p in zip(scaled, polygon, strict=True)) for i in range(4)])


class _Wall:
    """An occluder in homogeneous integers: its plane, its edges from corner to next corner, and w**2 as their scale."""

    def __init__(self, corners: Polygon):
        self.plane = _integer_plane(*_plane([_cartesian(p) for p in corners]))
        self.scale = corners[0][3] ** 2
        self.edges = [_dual(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]

    def blocks(self, p: Homogeneous, t: Homogeneous) -> bool:
        """Whether the closed segment meets the polygon, or lies in its plane."""
        before, behind = _at(self.plane, p), _at(self.plane, t)
        if (before > 0) == (behind > 0) and before and behind:
            return False
        line, turn = _line(p, t), 1 if before < behind else -1
        return before == behind == 0 or all(turn * _side(line, edge) >= 0 for edge in self.edges)

    def facing(self, a: Polygon, b: Polygon) -> int:
        """1 if all lines from a to b cross the plane along its normal, -1 if against it, else 0."""
        before, behind = [_at(self.plane, p) for p in a], [_at(self.plane, t) for t in b]
        if max(before) <= 0 <= min(behind) and max(behind) > 0:
            return 1
        return -1 if min(before) >= 0 >= max(behind) and min(behind) < 0 else 0


class _Search:
    """The trees of one cell, in homogeneous integers.

    Attributes:
        nodes: visited so far.
        target: plane of the target at work.
        walls: occluders not in that plane, by their numbers.
        halvings: allowed at present.
        complete: whether they have sufficed so far.
    """

    def __init__(self, faces: list[list[Point]], outlines: list[list[Point]], limit: int):
        self.cell, self.outlines = faces, outlines
        self.faces = [_homogeneous(face) for face in faces]
        self.outward = [_integer_plane(*_plane(face)) for face in faces]
        self.occluders = [_homogeneous(outline) for outline in outlines]
        self.limit, self.nodes, self.halvings, self.complete = limit, 0, 0, True
        self.target: Homogeneous = (0, 0, 0, 0)
        self.walls: dict[int, _Wall] = {}

    def certificate(self, target: Polygon) -> tuple:
        """Trees of all faces of the cell.

        Raises:
            _Seen: the target is visible along (start, end).
            _Spent: at a limit.
        """
        self.target = _integer_plane(*_plane([_cartesian(t) for t in target]))
        self.walls = {
            k: _Wall(corners) for k, corners in enumerate(self.occluders) if any(_at(self.target, c) for c in corners)
        }
        inside = target
        for h in self.outward:
            # A target in the plane of the face lies in the closed cell.
            if any(_at(h, t) for t in inside):
                inside = _clip(inside, tuple(-x for x in h))
        if inside:
            self._see_within(inside)
        beyond = [_clip(target, h) for h in self.outward]
        for self.halvings in HALVINGS:
            self.complete = True
            trees = tuple(self._face(a, b) for a, b in zip(self.faces, beyond, strict=True))
            if self.complete:
                return trees
        raise _Spent

    def _face(self, a: Polygon, b: Polygon) -> tuple | None:
        """Tree of a whole face; it is seen from one side of the target at a time."""
        heights = [_at(self.target, p) for p in a]
        if min(heights) < 0 < max(heights):
            return self._split(0, self.target, a, b, [], [], 0)
        return self._proof(a, b, [], [], 0)

    def _see_within(self, inside: Polygon) -> NoReturn:
        """Raise a segment to the part of the target that lies in the closed cell."""
        corners = [corner for face in self.cell for corner in face]
        eye = [sum(c) / len(corners) for c in zip(*corners, strict=True)]
        n, c = [Fraction(x) for x in self.target[:3]], -self.target[3]
        if dot(n, eye) == c:
            off = next(corner for corner in corners if dot(n, corner) != c)
            eye = along(eye, Fraction(1, 2), minus(off, eye))
        # A plane holds fewer of these points than the polygon has corners: they are the roots of a polynomial.
        points = (tuple(sum(k**i * p[x] for i, p in enumerate(inside)) for x in range(4)) for k in itertools.count(1))
        free = next(t for t in points if all(_at(wall.plane, t) for wall in self.walls.values()))
        end = _cartesian(free)
        self._see(end, minus(eye, end), end)

    def _see(self, origin: Point, step: Point, end: Point) -> NoReturn:
        """Raise a segment from near the origin to the end: all near enough are inside the cell and clear."""
        s = Fraction(1)
        while True:
            start = along(origin, s, step)
            inside = all(_at(h, p) < 0 for h in self.outward for p in _homogeneous([start]))
            if inside and all(segment_clear(start, end, self.outlines[k]) for k in self.walls):
                raise _Seen(start, end)
            s /= 2

    def _proof(self, a: Polygon, b: Polygon, edges: list[Line], walls: list[int], halved: int) -> tuple | None:
        """Tree that no line from a to b passes outside the edges and misses all occluders.

        Args:
            a: part of a face of the cell.
            b: part of the target beyond the face.
            edges: chosen so far.
            walls: the occluder of each.
            halved: how often a and b have been halved.
        """
        if not a or not b:
            return None
        self.nodes += 1
        if self.nodes > self.limit:
            raise _Spent
        refuted, p, t, passes = _propose(a, b, edges)
        if refuted:
            return "leaf", tuple(x * self.walls[k].scale for x, k in zip(refuted, walls, strict=True))
        corner = None if passes else _corner(a, b, edges)
        if corner:
            return "corner", *corner
        blockers = [k for k, wall in self.walls.items() if k not in walls and wall.blocks(p, t)]
        if not blockers:
            if passes:
                end = _cartesian(t)
                self._see(_cartesian(p), minus(_cartesian(p), end), end)
            if halved == self.halvings:
                self.complete = False
                return None
            return self._split(*_halving(a, b), a, b, edges, walls, halved + 1)
        facing = {k: self.walls[k].facing(a, b) for k in blockers}
        k = next((k for k in blockers if facing[k]), blockers[0])
        if facing[k]:
            # Outside an edge: the line runs clockwise about it where the outline runs counter-clockwise.
            chosen = [tuple(-facing[k] * x for x in edge) for edge in self.walls[k].edges]
            return "branch", k, tuple(self._proof(a, b, [*edges, edge], [*walls, k], halved) for edge in chosen)
        h = self.walls[k].plane
        heights = [_at(h, p) for p in a]
        return self._split(0 if min(heights) < 0 < max(heights) else 1, h, a, b, edges, walls, halved)

    def _split(self, which: int, h: Homogeneous, a: Polygon, b: Polygon, *path: object) -> tuple:
        """Tree of both parts of a or b."""
        parts = [_clip((a, b)[which], tuple(sign * x for x in h)) for sign in (-1, 1)]
        pairs = [(part, b) if which == 0 else (a, part) for part in parts]
        return ("split", which, h[:3], -h[3], *(self._proof(*pair, *path) for pair in pairs))


def _propose(a: Polygon, b: Polygon, edges: list[Line]) -> tuple[list[int] | None, Homogeneous, Homogeneous, bool]:
    """(weights that refute the edges or None, p, t, whether the line from p to t passes outside all edges)."""
    lines = [_line(p, t) for p in a for t in b]
    table = {k: row for k, edge in enumerate(edges) if min(row := [_side(line, edge) for line in lines]) <= 0}
    if not table:
        return None, _mix(a, [1] * len(a), 8), _mix(b, [1] * len(b), 8), True
    rows, columns = play([*table.values()])
    if rows is not None:
        weights = dict(zip(table, rows, strict=True))
        return [weights.get(k, 0) for k in range(len(edges))], a[0], b[0], False
    weights = [columns[k : k + len(b)] for k in range(0, len(columns), len(b))]
    at_a = [sum(w * t[3] for w, t in zip(row, b, strict=True)) for row in weights]
    at_b = [sum(w * p[3] for w, p in zip(column, a, strict=True)) for column in zip(*weights, strict=True)]
    open_edges = [edges[k] for k in table]
    pairs = [(_mix(a, at_a, bits), _mix(b, at_b, bits)) for bits in ROUNDINGS]
    for p, t in pairs:
        if _passes(p, t, open_edges):
            return None, p, t, True
    for p, t in pairs[-1::-2]:
        for which in REPAIRS:
            p, t, passes = _repaired(p, t, (a, b)[which], open_edges, which)
            if passes:
                return None, p, t, True
    return None, *pairs[0], False


def _corner(a: Polygon, b: Polygon, edges: list[Line]) -> tuple[int, int, int] | None:
    """Three edges on lines through one point, outside all of which no line from a to b passes."""
    steps = [[t[i] * p[3] - p[i] * t[3] for i in range(3)] for p in a for t in b]
    ways = [(e[3], -e[1], e[0]) for e in edges]
    meet = {(i, j) for i, j in itertools.combinations(range(len(edges)), 2) if _side(_undual(edges[i]), edges[j]) == 0}
    for i, j, k in itertools.combinations(range(len(edges)), 3):
        if {(i, j), (j, k), (i, k)} <= meet and dot(ways[i], cross(ways[j], ways[k])):
            normals = [cross(ways[x], ways[y]) for x, y in ((j, k), (k, i), (i, j))]
            weights = [dot(n, step) for n in normals for step in steps]
            if min(weights) >= 0 or max(weights) <= 0:
                return i, j, k
    return None


def _passes(p: Homogeneous, t: Homogeneous, edges: list[Line]) -> bool:
    line = _line(p, t)
    return all(_side(line, edge) > 0 for edge in edges)


def _repaired(p: Homogeneous, t: Homogeneous, polygon: Polygon, edges: list[Line], which: int) -> tuple:
    """(p, t, success): p, or t if `which` is 1, moved within its polygon so that the line passes outside all edges."""
    lines = [_line(p, q) if which else _line(q, t) for q in polygon]
    columns = play([[_side(line, edge) for line in lines] for edge in edges]).columns
    for bits in ROUNDINGS if columns else ():
        moved = _mix(polygon, columns, bits)
        pair = (p, moved) if which else (moved, t)
        if _passes(*pair, edges):
            return *pair, True
    return p, t, False


def _halving(a: Polygon, b: Polygon) -> tuple[int, Homogeneous]:
    """Which of the two is longer, and the axial plane near its middle."""
    longest = None
    for which, polygon in enumerate((a, b)):
        for axis in range(3):
            values = [Fraction(p[axis], p[3]) for p in polygon]
            if longest is None or max(values) - min(values) > longest[0]:
                longest = max(values) - min(values), which, axis, (max(values) + min(values)) / 2
    length, which, axis, middle = longest
    # A quarter of a power of two keeps the coordinates short.
    step = Fraction(2) ** (length.numerator.bit_length() - length.denominator.bit_length() - 3)
    return which, _integer_plane([Fraction(int(i == axis)) for i in range(3)], round(middle / step) * step)
