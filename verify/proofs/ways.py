"""Nodes of line trees: the ways to miss a blocker, or to meet an end's plan, each as rows (i, j, a, b).

A row says that a line crosses x_i = a before x_j = b. All boxes, plans and blockers are mirrored for an octant of
directions whose components are all positive; a line then passes right of the plan point (x, y) iff it crosses x first.
What the ways of data/store/certificates.py are is written down here once more, without what made them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor

from ...data.curtains import RISING
from ...data.store.certificates import FENCES, FIRST_FENCE, FIRST_MISS, PARTING
from ..arithmetic import minus

Box = list[list[int]]
Row = tuple[int, int, int, int]
Corners = list[list[int]]


@dataclass(frozen=True)
class Blocker:
    """A rectangle of an axial plane: the axis, and its flat box. Or a curtain: RISING or FALLING, and its box."""

    axis: int
    box: Box


@dataclass(frozen=True)
class End:
    """Cell or box of a proof.

    Attributes:
        box: low and high corner [grid steps].
        plan: corners, convex, of the prism in the box that is meant; None for all of the box.
    """

    box: Box
    plan: Corners | None = None

    def mirrored(self, octant: int) -> "End":
        """After the axes were mirrored on which the octant is negative."""
        flip = [octant >> i & 1 for i in range(3)]
        box = [[-self.box[1 - side][i] if flip[i] else self.box[side][i] for i in range(3)] for side in (0, 1)]
        plan = self.plan and [[-c if off else c for c, off in zip(p, flip, strict=False)] for p in self.plan]
        return End(box, plan)

    @property
    def corners(self) -> Corners:
        """Of the plan."""
        (x, y, _), (u, v, _) = self.box
        return self.plan or [[x, y], [u, y], [u, v], [x, v]]


def ways_of(
    node: int, order: list[int], s: End, t: End, closed: bool, octant: int, blockers: dict[int, Blocker]
) -> list[list[Row]]:
    """Rows of every way of a node; every line that is not excluded takes one.

    Args:
        node: id of a blocker, or FIRST_MISS and which end's plan is missed on which side.
        order: of the sides of a rectangle.
        s: mirrored source.
        t: mirrored target.
        closed: whether a blocker on the target's near face leaves it in sight.
        octant: mirrored.
        blockers: by id, as they are in the model.
    """
    if FIRST_MISS <= node < FIRST_MISS + 4:
        return _plan_ways((s, t)[(node - FIRST_MISS) // 2].corners, (node - FIRST_MISS) % 2 == 0)
    if FIRST_FENCE <= node < FIRST_MISS:
        return _fence_ways(node - FIRST_FENCE, s, t)
    blocker = blockers[node]
    low, high = End(blocker.box).mirrored(octant).box
    if blocker.axis < RISING:
        return _rectangle_ways(blocker.axis, low, high, order, s.box, t.box, closed)
    rising = (blocker.axis == RISING) == (octant & 1 == octant >> 1 & 1)
    return _curtain_ways(low, high, rising, s, t, closed)


def partings(s: End, t: End) -> dict[int, list[int]]:
    """Cuts g . w < 0 of the edges of plans that part source and target, by tag.

    A sightline from one side of such an edge to the other has n . d > 0, where n is its normal towards the target and
    d = (1 / w_x, 1 / w_y): so -(n_y w_x + n_x w_y) < 0.
    """
    cuts = {}
    for first, own, other in ((0, s, t), (4, t, s)):
        for k in range(4 if own.plan else 0):
            a, b = own.corners[k], own.corners[(k + 1) % 4]
            # Which side the plan itself is on: mirroring may have turned it round.
            side = max((_turn(a, b, p) for p in own.corners), key=abs)
            if all(_turn(a, b, p) * side <= 0 for p in other.corners):
                x, y = minus(b, a)
                # Away from the own plan.
                n = (y, -x) if side > 0 else (-y, x)
                cuts[PARTING + 8 * (first + k)] = [c if first else -c for c in (n[1], n[0])] + [0]
    return cuts


def _rectangle_ways(
    k: int, low: list[int], high: list[int], order: list[int], s: Box, t: Box, closed: bool
) -> list[list[Row]]:
    """Ways to miss a rectangle on plane x_k = c."""
    c, others = low[k], [(k + 1) % 3, (k + 2) % 3]
    if sorted(order) != [0, 1, 2, 3]:
        raise LookupError("a side is missing")
    beyond = []
    for side in order:
        u = others[side // 2]
        # Below the low edge at the plane: the plane comes before the edge. Above the high edge: after it.
        beyond.append((u, k, high[u], c) if side % 2 else (k, u, c, low[u]))
    ways = [[*((j, i, b, a) for i, j, a, b in beyond[:n]), beyond[n]] for n in range(4)]
    if c > t[0][k] or (closed and c == t[0][k]):
        ways.append([(i, k, t[0][i], c) for i in others])
    if c < s[1][k]:
        ways.append([(k, i, c, s[1][i]) for i in others])
    return ways


def _past(point: list[int], right: bool) -> Row:
    """The row "right of a plan point", or left of it."""
    x, y = point
    return (0, 1, x, y) if right else (1, 0, y, x)


def _curtain_ways(low: list[int], high: list[int], rising: bool, s: End, t: End, closed: bool) -> list[list[Row]]:
    """Ways to miss the upright rectangle over a diagonal of a plan box.

    Where the line crosses the diagonal it has entered the plan box and not left it: `x, y` are planes that it has
    crossed by then, `u, v` are planes that it has yet to cross.
    """
    (x, y, z), (u, v, top) = low, high
    a, b = [x, y if rising else v], [u, v if rising else y]
    ways = [[_past(a, right), _past(b, right)] for right in (False, True)]
    for a_on_left in (True, False) if rising else (True,):
        crossing = [_past(a, a_on_left), _past(b, not a_on_left)]
        ways.append([*crossing, (0, 2, x, z), (1, 2, y, z)])
        ways.append([*crossing, (2, 0, top, u), (2, 1, top, v)])
        # What lies ahead of such a line is on the left of ab where a is on the left hand.
        ahead = [_turn(a, b, corner) * (1 if a_on_left else -1) for corner in t.corners]
        behind = [_turn(a, b, corner) * (-1 if a_on_left else 1) for corner in s.corners]
        first, last = t.box[0], s.box[1]
        if not (min(ahead) >= 0 and (not closed or ahead.count(0) <= 1)) and first[0] <= u and first[1] <= v:
            ways.append([*crossing, (0, 1, first[0], v), (1, 0, first[1], u), (2, 0, first[2], u), (2, 1, first[2], v)])
        if min(behind) < 0 and last[0] >= x and last[1] >= y:
            ways.append([*crossing, (1, 0, y, last[0]), (0, 1, x, last[1]), (0, 2, x, last[2]), (1, 2, y, last[2])])
    return ways


def _turn(a: list[int], b: list[int], p: list[int]) -> int:
    """Positive where p lies left of ab."""
    (x, y), (u, v) = minus(b, a), minus(p, a)
    return x * v - y * u


def _plan_ways(corners: Corners, right: bool) -> list[list[Row]]:
    """Ways of a line to meet a plan that it would pass on the other side: right of some corner, or left of some."""

    def beats(p: list[int], q: list[int]) -> bool:
        # Every line that passes q on this side passes p.
        return p[0] <= q[0] and p[1] >= q[1] if right else p[0] >= q[0] and p[1] <= q[1]

    kept = _unbeaten(corners, beats)
    return [[*(_past(p, not right) for p in kept[:n]), _past(kept[n], right)] for n in range(len(kept))]


def _fence_ways(number: int, s: End, t: End) -> list[list[Row]]:
    """Ways past a piece of a side of a prism's plan: left of it, right of it, or through it.

    A sightline out of the prism has been in it by then, and so has come up to its lower end; one into it is in it from
    then on, and so has not left its upper end.
    """
    side, piece = divmod(number, FENCES)
    edge, entry = divmod(side, 2)
    end = (s, t)[edge // 4]
    if end.plan is None:
        raise LookupError("a prism is missing")
    a, b = end.plan[edge % 4], end.plan[(edge + 1) % 4]
    parts = 1 << ((piece + 1).bit_length() - 1)
    place = piece + 1 - parts
    if place + 2 > parts:
        raise LookupError("a piece is missing")
    points = [[u + Fraction((v - u) * (place + step), parts) for u, v in zip(a, b, strict=True)] for step in (0, 2)]
    # Out of the prism: from where it lies. On the left hand is the end that the side, with the prism on its left,
    # leads to.
    inside = max((_turn(a, b, p) for p in end.plan), key=abs)
    right, left = points if (inside > 0) != bool(entry) else points[::-1]
    left, right = [ceil(left[0]), floor(left[1])], [floor(right[0]), ceil(right[1])]
    (x, u), (y, v) = ((floor(min(c)), ceil(max(c))) for c in zip(*points, strict=True))
    low, high = end.box[0][2], end.box[1][2]
    through = [(0, 2, x, high), (1, 2, y, high)] if entry else [(2, 0, low, u), (2, 1, low, v)]
    return [
        [_past(left, False)],
        [_past(left, True), _past(right, True)],
        [_past(left, True), _past(right, False), *through],
    ]


def _unbeaten(corners: Corners, beats: Callable[[list[int], list[int]], bool]) -> Corners:
    """Corners that no other one beats, in order; of equal ones the first."""
    return [
        q
        for n, q in enumerate(corners)
        if not any(beats(p, q) and (p != q or m < n) for m, p in enumerate(corners) if m != n)
    ]
