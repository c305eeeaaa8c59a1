"""Checking a proof of "no point of the cell sees the target" in the plane without the solver that found it.

As in `region_certificate`, with two simplifications. A line misses a segment exactly if both ends lie on its left or
both on its right, so `branch` has two children of two points each. And side(p, t, x), the turn from line p t to x,
needs no occluder between a and b: occluders are clipped to what lies beyond the edge a and on a's side of the target.
"""

from collections.abc import Sequence
from fractions import Fraction

__all__ = ["holds_2d"]

Point = Sequence[Fraction]
Segment = Sequence[Point]


def turn(p: Point, t: Point, x: Point) -> Fraction:
    """Positive if x lies to the left of the line from p to t."""
    return (t[0] - p[0]) * (x[1] - p[1]) - (t[1] - p[1]) * (x[0] - p[0])


def clip(segment: Segment, line: Segment, sign: int) -> list[Point]:
    """The closed part of a segment to the left of a line, or to the right if the sign is -1; empty, or two ends."""
    if not segment:
        return []
    here, there = (sign * turn(*line, x) for x in segment)
    if max(here, there) < 0:
        return []
    (a, b), share = segment, here / (here - there) if here != there else 0
    cut = [x + share * (y - x) for x, y in zip(a, b, strict=True)]
    return [a if here >= 0 else cut, b if there >= 0 else cut]


def holds_2d(cell: Sequence[Point], target: Segment, occluders: Sequence[Segment], trees: Sequence[tuple]) -> bool:
    """Whether the trees prove that all segments from inside the cell to the target, but a null set, meet an occluder.

    Args:
        cell: corners of a convex polygon, counter-clockwise.
        target: its two ends.
        occluders: segments; those in the target's line prove nothing.
        trees: a pair an edge of the cell, for its parts to the right and to the left of the target, of ("branch",
            occluder, left, right), ("leaf", weights of the points chosen on the way) and None for nothing.
    """
    cell, target = [[[Fraction(c) for c in x] for x in points] for points in (cell, target)]
    walls = [[[Fraction(c) for c in x] for x in o] for o in occluders]
    walls = [wall if any(turn(*target, x) for x in wall) else [] for wall in walls]
    inside, proved = target, len(trees) == len(cell)
    for edge, pair in zip(zip(cell, [*cell[1:], cell[0]], strict=True), trees, strict=False):
        beyond, inside = clip(target, edge, -1), clip(inside, edge, 1)
        for sign, tree in zip((-1, 1), pair, strict=True):
            a = clip(edge, target, sign)
            if a and a[0] != a[1] and beyond and min(turn(*edge, x) for x in beyond) < 0 and beyond[0] != beyond[1]:
                parts = [clip(clip(wall, edge, -1), target, sign) for wall in walls]
                proved = proved and _hidden(a, beyond, [], parts, tree)
    return proved and (not inside or inside[0] == inside[1])


def _hidden(a: Segment, b: Segment, points: list, walls: Sequence[Segment], tree: tuple | None) -> bool:
    kind, *rest = tree or ("none",)
    if kind == "branch":
        wall, *children = walls[rest[0]], *rest[1:]
        if not wall or len(children) != 2:
            return False
        both = zip((1, -1), children, strict=True)
        return all(_hidden(a, b, [*points, *((sign, x) for x in wall)], walls, child) for sign, child in both)
    if kind != "leaf" or len(rest[0]) != len(points) or min(rest[0], default=0) < 0 or not any(rest[0]):
        return False
    chosen = [(weight * sign, x) for weight, (sign, x) in zip(rest[0], points, strict=True)]
    return all(sum(weight * turn(p, t, x) for weight, x in chosen) <= 0 for p in a for t in b)
