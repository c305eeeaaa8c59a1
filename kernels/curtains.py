"""Curtains: upright rectangles at any angle as blockers, and the ways to miss one as rows of the stabbing system.

A curtain is the diagonal of its plan box, from A at the least x to B. To pass left or right of A or B is one exact row
each (kernels/ends.py). To cross it under or over its edges, or outside source and target, is not linear where the edge
is oblique; but the curtain is crossed after the line has entered its plan box and before it has left it, which gives
rows that every such line satisfies. So a line that satisfies none of the ways meets the curtain, and HIDDEN is never
wrong; a line that meets it but satisfies one is the business of a smaller piece: a curtain comes with halves of halves
of itself (data/curtains.py).
"""

import warp as wp

from ..data.curtains import RISING
from .ends import Ends, append_order, append_past, beside
from .stab import vec6i

f64 = wp.float64

FIRST_CURTAIN = wp.constant(RISING)
# Left of both ends, right of both; then, crossing it one way, under, over, in the target before and out of the source
# after; then the same four crossing it the other way, which only a rising one can be.
CURTAIN_WAYS = wp.constant(10)


@wp.func
def rises(kind: int, octant: int) -> bool:
    """Whether a curtain leads to greater y with greater x, after mirroring."""
    rising = kind == FIRST_CURTAIN
    if (octant & 1) != ((octant >> 1) & 1):
        return not rising
    return rising


@wp.func
def end_ys(lo: wp.vec3d, hi: wp.vec3d, rising: bool) -> wp.vec2d:
    """The y of A and of B."""
    if rising:
        return wp.vec2d(lo[1], hi[1])
    return wp.vec2d(hi[1], lo[1])


@wp.func
def crossing_sense(lo: wp.vec3d, hi: wp.vec3d, rising: bool, w: wp.vec3d, xi: wp.vec3d) -> int:
    """0 if a line passes right of A and left of B, 1 if left of A and right of B, -1 if it does not pass between."""
    ys = end_ys(lo, hi, rising)
    at_a = (w[0] * lo[0] - xi[0]) - (w[1] * ys[0] - xi[1])
    at_b = (w[0] * hi[0] - xi[0]) - (w[1] * ys[1] - xi[1])
    if at_a < f64(0.0) and at_b > f64(0.0):
        return 0
    if at_a > f64(0.0) and at_b < f64(0.0):
        return 1
    return -1


@wp.func
def beyond_end(lo: wp.vec3d, hi: wp.vec3d, rising: bool, sense: int, ends: Ends, target: bool) -> bool:
    """Whether a line that crosses in this sense cannot be in the target before, or in the source after."""
    ys = end_ys(lo, hi, rising)
    # Crossing with A on the left hand, what lies ahead is left of the line from A to B.
    ahead = f64(1.0)
    if sense == 1:
        ahead = f64(-1.0)
    if target:
        return beside(ends.t_plan, lo[0], ys[0], hi[0], ys[1], ahead, ends.strict != 0)
    return beside(ends.s_plan, lo[0], ys[0], hi[0], ys[1], -ahead, False)


@wp.func
def plan_box_times(lo: wp.vec3d, hi: wp.vec3d, w: wp.vec3d, xi: wp.vec3d) -> wp.vec2d:
    """When a line enters the plan box of a curtain and leaves it."""
    first = wp.max(w[0] * lo[0] - xi[0], w[1] * lo[1] - xi[1])
    last = wp.min(w[0] * hi[0] - xi[0], w[1] * hi[1] - xi[1])
    return wp.vec2d(first, last)


@wp.func
def stops(
    lo: wp.vec3d, hi: wp.vec3d, rising: bool, ends: Ends, w: wp.vec3d, xi: wp.vec3d, leave: f64, enter: f64
) -> bool:
    """Whether a line satisfies none of the ways to miss a curtain; exact for integer w.

    Args:
        lo: low corner of the curtain.
        hi: its high corner.
        rising: whether it rises.
        ends: source and target.
        w: direction of the line.
        xi: its offsets.
        leave: when it leaves the source's box.
        enter: when it enters the target's.
    """
    sense = crossing_sense(lo, hi, rising, w, xi)
    if sense < 0:
        return False
    times = plan_box_times(lo, hi, w, xi)
    if w[2] * lo[2] - xi[2] >= times[0] or w[2] * hi[2] - xi[2] <= times[1]:
        return False
    if enter <= times[1] and not beyond_end(lo, hi, rising, sense, ends, True):
        return False
    return leave < times[0] or beyond_end(lo, hi, rising, sense, ends, False)


@wp.func
def crosses(lo: wp.vec3d, hi: wp.vec3d, rising: bool, w: wp.vec3d, xi: wp.vec3d, leave: f64, enter: f64) -> bool:
    """Whether a line may meet a curtain between two times, in floating point and on the side of "it may"."""
    if crossing_sense(lo, hi, rising, w, xi) < 0:
        return False
    times = plan_box_times(lo, hi, w, xi)
    ys = end_ys(lo, hi, rising)
    share = wp.vec2d()
    for k in range(2):
        x = (times[k] + xi[0]) / w[0] - lo[0]
        y = (times[k] + xi[1]) / w[1] - ys[0]
        share[k] = (hi[0] - lo[0]) * y - (ys[1] - ys[0]) * x
    time = times[0]
    if share[0] != share[1]:
        time = times[0] + (times[1] - times[0]) * share[0] / (share[0] - share[1])
    z = (time + xi[2]) / w[2]
    slack = f64(1.0e-6) * (f64(1.0) + wp.abs(time))
    return time >= leave - slack and time <= enter + slack and z >= lo[2] - f64(0.01) and z <= hi[2] + f64(0.01)


@wp.func
def has_curtain_way(lo: wp.vec3d, hi: wp.vec3d, rising: bool, cursor: int, ends: Ends) -> bool:
    """Whether way `cursor` to miss a curtain exists."""
    if cursor < 2:
        return True
    sense = (cursor - 2) // 4
    if sense == 1 and not rising:
        return False
    how = (cursor - 2) % 4
    if how == 2:
        reached = ends.t_lo[0] <= hi[0] and ends.t_lo[1] <= hi[1]
        return reached and not beyond_end(lo, hi, rising, sense, ends, True)
    if how == 3:
        left = ends.s_hi[0] >= lo[0] and ends.s_hi[1] >= lo[1]
        return left and not beyond_end(lo, hi, rising, sense, ends, False)
    return True


@wp.func
def append_curtain_way(
    work: wp.array[f64], lists: int, counts: vec6i, lo: wp.vec3d, hi: wp.vec3d, rising: bool, cursor: int, ends: Ends
) -> vec6i:
    """The rows of way `cursor` to miss a curtain."""
    ys = end_ys(lo, hi, rising)
    out = counts
    if cursor < 2:
        out = append_past(work, lists, out, lo[0], ys[0], cursor == 1)
        return append_past(work, lists, out, hi[0], ys[1], cursor == 1)
    sense = (cursor - 2) // 4
    how = (cursor - 2) % 4
    out = append_past(work, lists, out, lo[0], ys[0], sense == 0)
    out = append_past(work, lists, out, hi[0], ys[1], sense == 1)
    if how == 0:
        # Under: the low edge's height is reached after the plan box was entered.
        out = append_order(work, lists, out, 0, lo[0], 2, lo[2])
        return append_order(work, lists, out, 1, lo[1], 2, lo[2])
    if how == 1:
        out = append_order(work, lists, out, 2, hi[2], 0, hi[0])
        return append_order(work, lists, out, 2, hi[2], 1, hi[1])
    if how == 2:
        # In the target, on every axis, before the plan box is left.
        out = append_order(work, lists, out, 0, ends.t_lo[0], 1, hi[1])
        out = append_order(work, lists, out, 1, ends.t_lo[1], 0, hi[0])
        out = append_order(work, lists, out, 2, ends.t_lo[2], 0, hi[0])
        return append_order(work, lists, out, 2, ends.t_lo[2], 1, hi[1])
    out = append_order(work, lists, out, 1, lo[1], 0, ends.s_hi[0])
    out = append_order(work, lists, out, 0, lo[0], 1, ends.s_hi[1])
    out = append_order(work, lists, out, 0, lo[0], 2, ends.s_hi[2])
    return append_order(work, lists, out, 1, lo[1], 2, ends.s_hi[2])
