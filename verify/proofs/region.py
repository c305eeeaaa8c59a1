"""Checking a proof of "no point of the cell sees the target" without the solver that found it.

A segment that leaves a convex cell does so through one face, so each face has a tree over (a, b): a part of the face
and the part of the target beyond its plane. `split` cuts a or b by a plane. `branch` names an occluder that has a and
b on opposite sides: a line from a to b misses it only by passing outside one of its edges, one child an edge.

`leaf` contradicts: side(p, t, edge) is affine in p and in t, so if a nonnegative combination of the chosen edges' sides
is <= 0 for every pair of corners, no line from a to b passes outside all of them. `corner` contradicts by edges along
u, v, w that meet in one point: with d = t - p, det(d, v, w) side_u + det(d, w, u) side_v + det(d, u, v) side_w is 0, so
three determinants of one sign forbid that all sides are positive.

Sets of lines of measure zero, those in cutting planes or through borders, are left out: lines that pass outside closed
occluders form an open set.
"""

from collections.abc import Sequence
from fractions import Fraction

from ..arithmetic import clip, cross, dot, minus, rational

__all__ = ["holds"]

Points = Sequence[Sequence[Fraction]]


def side(p: Sequence[Fraction], t: Sequence[Fraction], edge: Points) -> Fraction:
    """Positive if the edge runs counter-clockwise about the line from p to t, zero if they meet."""
    return dot(minus(t, p), cross(minus(edge[0], p), minus(edge[1], p)))


def plane(polygon: Points) -> tuple[list[Fraction], Fraction]:
    """(n, c) of a polygon: n . x = c, n as long as twice its area and counter-clockwise about it."""
    o = polygon[0] if polygon else [Fraction(0)] * 3
    parts = [cross(minus(u, o), minus(v, o)) for u, v in zip(polygon, [*polygon[1:], o], strict=False)]
    n = [sum(column) for column in zip(*parts, strict=True)] or [Fraction(0)] * 3
    return n, dot(n, o)


def holds(cell: Sequence[Points], target: Points, occluders: Sequence[Points], trees: Sequence[tuple]) -> bool:
    """Whether the trees prove that all segments from inside the cell to the target, but a null set, meet an occluder.

    Args:
        cell: the faces of a convex polytope, either way round.
        target: a planar convex polygon.
        occluders: planar convex polygons; those in the target's plane prove nothing.
        trees: one per face, of ("split", 0 for a or 1 for b, normal, offset, below, above), ("branch", occluder,
            children in the order of its edges), ("leaf", weights of the edges chosen on the way) and None for nothing.
    """
    faces, inside, walls = [rational(face) for face in cell], rational(target), [rational(o) for o in occluders]
    corners = [corner for face in faces for corner in face]
    centre, proved = [sum(c) / len(corners) for c in zip(*corners, strict=True)], len(trees) == len(faces)
    for face, tree in zip(faces, trees, strict=False):
        n, c = plane(face)
        n, c = (n, c) if dot(n, centre) < c else ([-x for x in n], -c)
        beyond = clip(rational(target), n, c) if any(dot(n, t) > c for t in target) else []
        proved = proved and _hidden(face, beyond, [], walls, tree)
        inside = clip(inside, [-x for x in n], -c)
    return proved and not any(plane(inside)[0])


def _hidden(a: Points, b: Points, edges: list[Points], walls: Sequence[Points], tree: tuple | None) -> bool:
    if not any(plane(a)[0]) or not any(plane(b)[0]):
        return True
    kind, *rest = tree or ("none",)
    if kind == "split":
        which, n, c, *children = rest
        for sign, child in zip((-1, 1), children, strict=True):
            piece = clip((a, b)[which], [sign * Fraction(x) for x in n], sign * Fraction(c))
            if not _hidden(*((piece, b) if which == 0 else (a, piece)), edges, walls, child):
                return False
        return True
    if kind == "branch":
        wall, children = walls[rest[0]], rest[1]
        n, c = plane(wall)
        before, behind = [dot(n, p) - c for p in a], [dot(n, t) - c for t in b]
        chosen = [*zip(wall, [*wall[1:], wall[0]], strict=True)]
        if max(before) <= 0 <= min(behind) and max(behind) > 0:
            chosen = [edge[::-1] for edge in chosen]
        elif not (min(before) >= 0 >= max(behind) and min(behind) < 0):
            return False
        both = zip(chosen, children, strict=True)
        return len(children) == len(wall) and all(_hidden(a, b, [*edges, e], walls, child) for e, child in both)
    if kind == "corner":
        chosen = [edges[k] for k in rest]
        along = [minus(v, u) for u, v in chosen]
        normals = [cross(along[i - 2], along[i - 1]) for i in range(3)]
        weights = [dot(n, minus(t, p)) for n in normals for p in a for t in b]
        meet = all(side(*chosen[i - 1], chosen[i]) == 0 for i in range(3)) and dot(along[0], normals[0]) != 0
        return meet and (min(weights) >= 0 or max(weights) <= 0)
    if kind != "leaf" or len(rest[0]) != len(edges) or min(rest[0], default=0) < 0 or not any(rest[0]):
        return False
    chosen = [(weight, edge) for weight, edge in zip(rest[0], edges, strict=True) if weight]
    return all(sum(weight * side(p, t, edge) for weight, edge in chosen) <= 0 for p in a for t in b)
