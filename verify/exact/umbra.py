"""Umbras in rationals, written from the mathematics and not from the kernel. Twin of `kernels/umbra.py`.

Outlines are planar, convex and run either way round; cells are boxes with inside; all coordinates are rational. n is
the outline's normal, turned away from the cell, h(x) = n . x - d the scaled depth beyond its plane (negative in the
cell), and u_e(x) = t_e . (x - a_e) the scaled distance from edge e, a_e to b_e, inwards.

With rho_e = min over the cell's corners p of u_e(p) / -h(p), the umbra is h >= 0 and m_e . x >= c_e for all e, where
m_e = t_e + rho_e n and c_e = m_e . a_e. For x is hidden from p iff the crossing of p x with the plane is inside each
edge, u_e(p) h(x) - u_e(x) h(p) >= 0, and a ratio of affine functions is least at a corner of the box.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import combinations

from ..arithmetic import Vector, along, box_corners, cross, dot, minus, rational

__all__ = ["Occluder", "hides", "lowest_height", "occluder", "recession", "supporting_planes", "umbra", "winds"]


@dataclass(frozen=True)
class Occluder:
    """A cell and a planar convex outline in front of it: the outline counter-clockwise about `normal`.

    Attributes:
        cell: the eight corners.
        outline: corners in order, counter-clockwise about the normal.
        normal: away from the cell, not of unit length.
        offset: normal . x of the outline's plane.
        straddles: the cell reaches to both sides of the plane; it has no umbra.
    """

    cell: list[list[Fraction]]
    outline: list[list[Fraction]]
    normal: list[Fraction]
    offset: Fraction
    straddles: bool

    def depth(self, x: Vector) -> Fraction:
        """Scaled depth h(x) beyond the plane."""
        return dot(self.normal, x) - self.offset

    @cached_property
    def planes(self) -> list[tuple[list[Fraction], Fraction]] | None:
        """`supporting_planes` of it."""
        return supporting_planes(self)

    def edges(self) -> list[tuple[list[Fraction], list[Fraction]]]:
        """A point a_e of each edge and its inward in-plane normal t_e = n x (b_e - a_e)."""
        pairs = zip(self.outline, self.outline[1:] + self.outline[:1], strict=True)
        return [(a, cross(self.normal, minus(b, a))) for a, b in pairs]


def occluder(cell: Sequence[Vector], outline: Sequence[Vector]) -> Occluder:
    """The outline turned to face away from the cell.

    Raises:
        ValueError: it is not planar.
    """
    corners, points = rational(outline), box_corners(cell)
    normal = [Fraction(0)] * 3
    for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
        normal = along(normal, Fraction(1), cross(minus(a, corners[0]), minus(b, corners[0])))
    offset = dot(normal, corners[0])
    if any(dot(normal, c) != offset for c in corners):
        raise ValueError(f"expected a planar outline, found {outline}")
    heights = [dot(normal, p) - offset for p in points]
    if max(heights) > 0 and min(heights) < 0:
        return Occluder(points, corners, normal, offset, True)
    if max(heights) > 0:
        return Occluder(points, corners[::-1], [-c for c in normal], -offset, False)
    return Occluder(points, corners, normal, offset, False)


def recession(o: Occluder) -> list[Fraction | None]:
    """rho_e |t_e| / |n| of each edge: min u_e(p) / |h(p)| over the cell's corners; None for minus infinity.

    A corner on the plane bounds nothing if it is on the inner side of the edge, and leaves no umbra if it is not.
    """
    out: list[Fraction | None] = []
    for a, t in o.edges():
        ratios = []
        for p in o.cell:
            inside, height = dot(t, minus(p, a)), o.depth(p)
            if height == 0 and inside < 0:
                ratios = None
                break
            if height < 0:
                ratios.append(inside / -height)
        out.append(None if ratios is None else min(ratios))
    return out


def supporting_planes(o: Occluder) -> list[tuple[list[Fraction], Fraction]] | None:
    """(m_e, c_e) with the umbra { h >= 0, m_e . x >= c_e }; None if it is empty."""
    if o.straddles:
        return None
    planes = []
    for (a, t), rho in zip(o.edges(), recession(o), strict=True):
        if rho is None:
            return None
        m = along(t, rho, o.normal)
        planes.append((m, dot(m, a)))
    return planes


def umbra(o: Occluder, x: Vector) -> bool:
    """Whether x lies in the closed polyhedron of the supporting planes, on the plane of the outline or beyond."""
    return o.planes is not None and o.depth(x) >= 0 and all(dot(m, x) >= c for m, c in o.planes)


def hides(o: Occluder, x: Vector) -> bool:
    """Whether the segment from each corner of the cell to x crosses the outline: the definition, without planes."""
    if o.straddles or o.depth(x) < 0:
        return False
    for p in o.cell:
        before, behind = -o.depth(p), o.depth(x)
        crossings = [p, x] if before == behind == 0 else [along(p, before / (before + behind), minus(x, p))]
        if any(dot(t, minus(y, a)) < 0 for y in crossings for a, t in o.edges()):
            return False
    return True


def winds(cell: Sequence[Vector], outline: Sequence[Vector], x: Vector) -> bool:
    """Whether every line from a cell's corner to x has every edge of the outline, flat or bent, on the same side."""
    points, corners = box_corners(cell), rational(outline)
    pairs = list(zip(corners, corners[1:] + corners[:1], strict=True))
    sides = [dot(minus(x, p), cross(minus(a, p), minus(b, p))) for p in points for a, b in pairs]
    return min(sides) >= 0 or max(sides) <= 0


def lowest_height(o: Occluder) -> Fraction | None:
    """Least h(x) within the supporting half-spaces, by trying all triples of planes; None if there is no least.

    It is bounded iff n is a combination of the m_e with no negative weight, of three of them then (Caratheodory).
    """
    planes = o.planes or []
    bounded, least = False, None
    for triple in combinations(planes, 3):
        rows = [m for m, _ in triple]
        volume = dot(rows[0], cross(rows[1], rows[2]))
        if volume == 0:
            continue
        normals = [cross(rows[1], rows[2]), cross(rows[2], rows[0]), cross(rows[0], rows[1])]
        bounded |= all(dot(o.normal, k) / volume >= 0 for k in normals)
        point = [sum(c * k[i] for (_, c), k in zip(triple, normals, strict=True)) / volume for i in range(3)]
        if all(dot(m, point) >= c for m, c in planes) and (least is None or o.depth(point) < least):
            least = o.depth(point)
    return least if bounded else None
