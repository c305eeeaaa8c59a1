"""Fences: the sides of an upright prism, where a line has to be at the heights of the prism when it passes.

A line may meet the plan of a prism, and reach its heights, and yet miss it: it leaves the plan before it has come up
to the lower end. The time at which an oblique side is crossed is not linear; but within a piece of the side it lies
between the times of the piece's plan box. So past a piece of a side, out of the prism, the lower end is reached before
the box is left; into the prism, the box is entered before the upper end is left. Ways of a node about a piece: left of
it, right of it, and through it in that order. Pieces are a side, halves of it, quarters, ...; their ends, where they
are off the grid, are rounded so that "through" means through, and as that leaves gaps between them they overlap by
half.
"""

import warp as wp

from ..data.store import certificates
from .ends import Ends, append_order, append_past, plan_times
from .stab import vec6i

f64 = wp.float64

FIRST_FENCE = wp.constant(certificates.FIRST_FENCE)
# Lengths of pieces, and pieces of all lengths.
LENGTHS = wp.constant(7)
PIECES = wp.constant(certificates.FENCES)
FENCE_WAYS = wp.constant(3)
# Share of a time that floating point may be off by.
SLACK = wp.constant(wp.float64(1.0e-9))


@wp.struct
class Fence:
    """A piece of a side, mirrored.

    Attributes:
        a: corner that a line is right of if it passes right of the end on its left hand.
        b: likewise left of the other end.
        lo: low corner of the piece's plan box, rounded out.
        hi: high corner.
        height: lower end of the prism, or its upper end where the side leads into it.
        entry: whether it does.
    """

    a: wp.vec2d
    b: wp.vec2d
    lo: wp.vec2d
    hi: wp.vec2d
    height: f64
    entry: bool


@wp.func
def fence_of(ends: Ends, number: int) -> Fence:
    """The fence of a node: of the source or target, side, whether it is crossed inwards, and piece."""
    piece = number % PIECES
    side = number // PIECES
    out = Fence()
    out.entry = side % 2 == 1
    edge = side // 2
    plan = ends.s_plan
    out.height = ends.s_lo[2]
    top = ends.s_hi[2]
    if edge >= 4:
        plan = ends.t_plan
        out.height = ends.t_lo[2]
        top = ends.t_hi[2]
    if out.entry:
        out.height = top
    k = edge % 4
    following = (k + 1) % 4
    parts = int(1)
    while piece + 1 >= 2 * parts:
        parts *= 2
    # A piece is two such parts.
    j = piece + 1 - parts
    first = wp.vec2d()
    last = wp.vec2d()
    for i in range(2):
        along = plan[following, i] - plan[k, i]
        first[i] = plan[k, i] + along * f64(j) / f64(parts)
        last[i] = plan[k, i] + along * f64(j + 2) / f64(parts)
        out.lo[i] = wp.floor(wp.min(first[i], last[i]))
        out.hi[i] = wp.ceil(wp.max(first[i], last[i]))
    # Corners run so that the prism is on their left, unless mirroring has turned them: who goes out along a side that
    # is followed that way has its end on the left hand.
    swap = ends.turn < f64(0.0)
    if out.entry:
        swap = not swap
    left = last
    right = first
    if swap:
        left = first
        right = last
    out.a = wp.vec2d(wp.ceil(left[0]), wp.floor(left[1]))
    out.b = wp.vec2d(wp.floor(right[0]), wp.ceil(right[1]))
    return out


@wp.func
def fence_stops(fence: Fence, w: wp.vec3d, xi: wp.vec3d) -> bool:
    """Whether a line satisfies none of the ways of a fence; exact for integer w."""
    if w[0] * fence.a[0] - xi[0] >= w[1] * fence.a[1] - xi[1]:
        return False
    if w[1] * fence.b[1] - xi[1] >= w[0] * fence.b[0] - xi[0]:
        return False
    time = w[2] * fence.height - xi[2]
    if fence.entry:
        return time < wp.max(w[0] * fence.lo[0] - xi[0], w[1] * fence.lo[1] - xi[1])
    return time > wp.min(w[0] * fence.hi[0] - xi[0], w[1] * fence.hi[1] - xi[1])


@wp.func
def fence_on(ends: Ends, end: int, entry: bool, w: wp.vec3d, xi: wp.vec3d) -> int:
    """The longest piece of a side that the line crosses out of a prism, or into it, and that stops it; or -1."""
    plan = ends.s_plan
    if end == 1:
        plan = ends.t_plan
    # In floating point: it only tells where to look.
    inside = plan_times(plan, ends.turn, w, xi)
    time = inside[1]
    if entry:
        time = inside[0]
    x = (time + xi[0]) / w[0]
    y = (time + xi[1]) / w[1]
    best = int(-1)
    for k in range(4):
        following = (k + 1) % 4
        u = plan[following, 0] - plan[k, 0]
        v = plan[following, 1] - plan[k, 1]
        share = ((x - plan[k, 0]) * u + (y - plan[k, 1]) * v) / (u * u + v * v)
        away = wp.abs((x - plan[k, 0]) * v - (y - plan[k, 1]) * u) / wp.sqrt(u * u + v * v)
        if best < 0 and away < f64(0.01) and share >= f64(0.0) and share < f64(1.0):
            side = 2 * (4 * end + k)
            if entry:
                side += 1
            parts = int(2)
            for _ in range(LENGTHS):
                # The piece whose middle is nearest.
                j = wp.clamp(int(wp.round(share * f64(parts))) - 1, 0, parts - 2)
                number = side * PIECES + parts - 1 + j
                if best < 0 and fence_stops(fence_of(ends, number), w, xi):
                    best = number
                parts *= 2
    return best


@wp.func
def fence_met(ends: Ends, w: wp.vec3d, xi: wp.vec3d) -> int:
    """A fence that stops a line which meets the plans of its ends, or -1."""
    for end in range(2):
        used = ends.s_oblique
        if end == 1:
            used = ends.t_oblique
        if used == 1:
            for way in range(2):
                found = fence_on(ends, end, way == 1, w, xi)
                if found >= 0:
                    return found
    return -1


@wp.func
def may_miss(ends: Ends, w: wp.vec3d, xi: wp.vec3d) -> bool:
    """Whether a line may miss a prism by less than fences tell apart, in floating point and on the side of "it may"."""
    for end in range(2):
        used = ends.s_oblique
        plan = ends.s_plan
        lo = ends.s_lo
        hi = ends.s_hi
        if end == 1:
            used = ends.t_oblique
            plan = ends.t_plan
            lo = ends.t_lo
            hi = ends.t_hi
        if used == 1:
            inside = plan_times(plan, ends.turn, w, xi)
            first = wp.max(inside[0], w[2] * lo[2] - xi[2])
            last = wp.min(inside[1], w[2] * hi[2] - xi[2])
            # A flat one is met at a single time.
            if first > last or (first >= last - SLACK * (f64(1.0) + wp.abs(first)) and lo[2] < hi[2]):
                return True
    return False


@wp.func
def append_fence_way(work: wp.array[f64], lists: int, counts: vec6i, fence: Fence, cursor: int) -> vec6i:
    """The rows of way `cursor` past a fence: left of it, right of it, or through it at the right time."""
    out = append_past(work, lists, counts, fence.a[0], fence.a[1], cursor > 0)
    if cursor == 0:
        return out
    out = append_past(work, lists, out, fence.b[0], fence.b[1], cursor == 1)
    if cursor == 1:
        return out
    if fence.entry:
        out = append_order(work, lists, out, 0, fence.lo[0], 2, fence.height)
        return append_order(work, lists, out, 1, fence.lo[1], 2, fence.height)
    out = append_order(work, lists, out, 2, fence.height, 0, fence.hi[0])
    return append_order(work, lists, out, 2, fence.height, 1, fence.hi[1])
