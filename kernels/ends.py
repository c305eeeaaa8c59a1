"""Source and target of a search of lines: boxes, or upright prisms over four-sided plans, and rows about them.

The prisms stand at any angle. In an octant of directions all of whose components are positive, a line passes right of
the plan point (x, y) iff it crosses the plane x before the plane y: one row of the stabbing system. So it meets a
convex plan iff it is right of some corner and left of another, which is exact. A search starts with the boxes around
its ends, and when a line is wholly to one side of a plan it branches on the corners: on those that no other one makes
superfluous.
"""

import warp as wp

from ..data.store import certificates
from ..data.verdict import Verdict
from .directions import POLYGON_SIZE, copy_polygon
from .graph import reflect_high, reflect_low
from .stab import AT_POLYGON, append_entry, clip_spare, start_level, vec6i

f64 = wp.float64
mat42d = wp.types.matrix(shape=(4, 2), dtype=wp.float64)

CORNERS = wp.constant(4)
# Tags of cuts by an edge that parts the plans are this, plus eight times the edge.
PARTING = wp.constant(certificates.PARTING)


@wp.struct
class Pairs:
    """Boxes, and rows (source box, target box, strict) to join; strict leaves out blockers at the target's face.

    `plan_of` is the place of a box's plan among `plans`, rows of four corners counter-clockwise, or -1 where the box
    is all there is to it.
    """

    lo: wp.array[wp.vec3i]
    hi: wp.array[wp.vec3i]
    plan_of: wp.array[int]
    plans: wp.array2d[wp.vec2i]
    rows: wp.array[wp.vec3i]


@wp.struct
class Ends:
    """Source and target of a search, mirrored so that every component of a line's direction is positive.

    Attributes:
        s_lo: low corner of the source's box.
        s_hi: its high corner.
        t_lo: of the target.
        t_hi: likewise.
        s_plan: corners of the source's plan, those of its box where it has no other.
        t_plan: of the target.
        s_oblique: whether the source has a plan other than its box, 0 or 1.
        t_oblique: of the target.
        turn: 1 where the corners of plans are counter-clockwise, -1 where mirroring has turned them round.
        octant: that was mirrored.
        strict: as in `Pairs`.
    """

    s_lo: wp.vec3d
    s_hi: wp.vec3d
    t_lo: wp.vec3d
    t_hi: wp.vec3d
    s_plan: mat42d
    t_plan: mat42d
    s_oblique: int
    t_oblique: int
    turn: f64
    octant: int
    strict: int


@wp.func
def reflect_plan(pairs: Pairs, box: int, lo: wp.vec3d, hi: wp.vec3d, octant: int) -> mat42d:
    """Corners of the plan of a box, mirrored; those of the mirrored box where it has no other."""
    out = mat42d()
    place = pairs.plan_of[box]
    if place < 0:
        out[0, 0] = lo[0]
        out[0, 1] = lo[1]
        out[1, 0] = hi[0]
        out[1, 1] = lo[1]
        out[2, 0] = hi[0]
        out[2, 1] = hi[1]
        out[3, 0] = lo[0]
        out[3, 1] = hi[1]
        return out
    for k in range(4):
        for i in range(2):
            out[k, i] = f64(pairs.plans[place, k][i])
            if ((octant >> i) & 1) == 1:
                out[k, i] = -out[k, i]
    return out


@wp.func
def ends_of(pairs: Pairs, row: int, octant: int) -> Ends:
    """Ends of a row, mirrored for an octant."""
    pair = pairs.rows[row]
    out = Ends()
    out.s_lo = reflect_low(pairs.lo[pair[0]], pairs.hi[pair[0]], octant)
    out.s_hi = reflect_high(pairs.lo[pair[0]], pairs.hi[pair[0]], octant)
    out.t_lo = reflect_low(pairs.lo[pair[1]], pairs.hi[pair[1]], octant)
    out.t_hi = reflect_high(pairs.lo[pair[1]], pairs.hi[pair[1]], octant)
    out.s_plan = reflect_plan(pairs, pair[0], out.s_lo, out.s_hi, octant)
    out.t_plan = reflect_plan(pairs, pair[1], out.t_lo, out.t_hi, octant)
    if pairs.plan_of[pair[0]] >= 0:
        out.s_oblique = 1
    if pairs.plan_of[pair[1]] >= 0:
        out.t_oblique = 1
    out.turn = f64(1.0)
    if (octant & 1) != ((octant >> 1) & 1):
        out.turn = f64(-1.0)
    out.octant = octant
    out.strict = pair[2]
    return out


@wp.func
def can_lead(ends: Ends) -> bool:
    """Whether a line in the ends' octant can lead from the source to the target."""
    return ends.t_hi[0] > ends.s_lo[0] and ends.t_hi[1] > ends.s_lo[1] and ends.t_hi[2] > ends.s_lo[2]


@wp.func
def append_order(work: wp.array[f64], lists: int, counts: vec6i, i: int, first: f64, j: int, second: f64) -> vec6i:
    """The row "plane x_i = first is crossed before plane x_j = second": xi_i - xi_j >= w_i first - w_j second."""
    p = int(0)
    if i + j == 3:
        p = 2
    if i + j == 2:
        p = 4
    if i > j:
        p += 1
    append_entry(work, lists, p, counts[p], first, second)
    out = counts
    out[p] = out[p] + 1
    return out


@wp.func
def append_past(work: wp.array[f64], lists: int, counts: vec6i, x: f64, y: f64, right: bool) -> vec6i:
    """The row "passes right of the plan point (x, y)", or left of it."""
    if right:
        return append_order(work, lists, counts, 0, x, 1, y)
    return append_order(work, lists, counts, 1, y, 0, x)


@wp.func
def plan_side(plan: mat42d, w: wp.vec3d, xi: wp.vec3d) -> int:
    """0 if a line is left of all corners of a plan, 1 if right of all, -1 if it meets the plan; exact for integer w."""
    left = bool(True)
    right = bool(True)
    for k in range(4):
        ahead = (w[0] * plan[k, 0] - xi[0]) - (w[1] * plan[k, 1] - xi[1])
        if ahead < f64(0.0):
            left = False
        if ahead > f64(0.0):
            right = False
    if left:
        return 0
    if right:
        return 1
    return -1


@wp.func
def end_missed(ends: Ends, w: wp.vec3d, xi: wp.vec3d) -> int:
    """How a line misses the plans of its ends: 0, 1 left or right of the source, 2, 3 of the target; else -1."""
    if ends.s_oblique == 1:
        side = plan_side(ends.s_plan, w, xi)
        if side >= 0:
            return side
    if ends.t_oblique == 1:
        side = plan_side(ends.t_plan, w, xi)
        if side >= 0:
            return 2 + side
    return -1


@wp.func
def matters(plan: mat42d, k: int, right: bool) -> bool:
    """Whether no other corner is passed on this side by every line that passes corner k on it."""
    for other in range(4):
        across = plan[other, 0] <= plan[k, 0] and plan[other, 1] >= plan[k, 1]
        if not right:
            across = plan[other, 0] >= plan[k, 0] and plan[other, 1] <= plan[k, 1]
        same = plan[other, 0] == plan[k, 0] and plan[other, 1] == plan[k, 1]
        if across and other != k and (not same or other < k):
            return False
    return True


@wp.func
def missed_plan(ends: Ends, miss: int) -> mat42d:
    """The plan that a line misses."""
    if miss >= 2:
        return ends.t_plan
    return ends.s_plan


@wp.func
def has_corner(ends: Ends, miss: int, k: int) -> bool:
    """Whether way k to meet a missed plan exists: past corner k."""
    return matters(missed_plan(ends, miss), k, miss % 2 == 0)


@wp.func
def append_corner(work: wp.array[f64], lists: int, counts: vec6i, ends: Ends, miss: int, k: int) -> vec6i:
    """The rows of way k to meet a missed plan: past corner k on the side of the miss, and not past those before."""
    plan = missed_plan(ends, miss)
    right = miss % 2 == 0
    out = counts
    for earlier in range(k):
        if matters(plan, earlier, right):
            out = append_past(work, lists, out, plan[earlier, 0], plan[earlier, 1], not right)
    return append_past(work, lists, out, plan[k, 0], plan[k, 1], right)


@wp.func
def plan_times(plan: mat42d, turn: f64, w: wp.vec3d, xi: wp.vec3d) -> wp.vec2d:
    """When a line enters a plan and leaves it, in floating point: it steers only."""
    enter = f64(-1.0e300)
    leave = f64(1.0e300)
    for k in range(4):
        following = (k + 1) % 4
        along = wp.vec2d(plan[following, 0] - plan[k, 0], plan[following, 1] - plan[k, 1])
        # Inside is where start + rate * time is positive.
        start = turn * (along[0] * (xi[1] / w[1] - plan[k, 1]) - along[1] * (xi[0] / w[0] - plan[k, 0]))
        rate = turn * (along[0] / w[1] - along[1] / w[0])
        if rate > f64(0.0):
            enter = wp.max(enter, -start / rate)
        if rate < f64(0.0):
            leave = wp.min(leave, -start / rate)
    return wp.vec2d(enter, leave)


@wp.func
def beside(plan: mat42d, ax: f64, ay: f64, bx: f64, by: f64, side: f64, strict: bool) -> bool:
    """Whether a plan lies wholly on one side of the line from a to b: left for side 1, right for -1; exact.

    On the line counts; with `strict` no side of the plan may lie there, but one corner may.
    """
    touching = int(0)
    for k in range(4):
        turn = side * ((bx - ax) * (plan[k, 1] - ay) - (by - ay) * (plan[k, 0] - ax))
        if turn < f64(0.0):
            return False
        if turn == f64(0.0):
            touching += 1
    return not strict or touching <= 1


@wp.func
def parting(ends: Ends, edge: int) -> wp.vec2d:
    """Normal of an edge, of the source (0 to 3) or the target (4 to 7), if it parts the two plans; towards the target.

    0 where the edge does not part them, or belongs to an end without a plan of its own.
    """
    own = ends.s_plan
    other = ends.t_plan
    used = ends.s_oblique
    if edge >= 4:
        own = ends.t_plan
        other = ends.s_plan
        used = ends.t_oblique
    k = edge % 4
    following = (k + 1) % 4
    n = wp.vec2d(own[following, 1] - own[k, 1], own[k, 0] - own[following, 0]) * ends.turn
    for corner in range(4):
        away = n[0] * (other[corner, 0] - own[k, 0]) + n[1] * (other[corner, 1] - own[k, 1])
        if away < f64(0.0):
            used = 0
    if used == 0:
        return wp.vec2d()
    if edge >= 4:
        return -n
    return n


@wp.func
def start_directions(ends: Ends, work: wp.array[f64], level: int, spare: int) -> int:
    """The widest level of directions that lead from the source to the target; HIDDEN if an edge leaves none.

    Past an edge that parts the plans a sightline goes towards the target: n . d > 0 with d = (1 / w_x, 1 / w_y), so
    n_y w_x + n_x w_y > 0. Where boxes around oblique plans overlap, nothing else tells the two ends apart.
    """
    start_level(work, level)
    if ends.s_oblique + ends.t_oblique == 0:
        return Verdict.UNKNOWN
    current = level + AT_POLYGON
    for edge in range(8):
        n = parting(ends, edge)
        tag = f64(PARTING + 8 * edge)
        if n[0] < f64(0.0) or n[1] < f64(0.0):
            if n[1] < f64(0.0):
                # w_x / w_y is below n_x / -n_y, which is below every slope where n_x is not positive.
                if n[0] * work[level + 4] < work[level + 3] * -n[1]:
                    work[level + 3] = n[0]
                    work[level + 4] = -n[1]
                    work[level + 5] = tag
            elif n[1] > f64(0.0):
                if -n[0] * work[level + 1] > work[level] * n[1]:
                    work[level] = -n[0]
                    work[level + 1] = n[1]
                    work[level + 2] = tag
            else:
                # Straight against it.
                work[level + 3] = n[0]
                work[level + 4] = f64(0.0)
                work[level + 5] = tag
            if n[0] <= f64(0.0) and n[1] <= f64(0.0):
                return Verdict.HIDDEN
            answer, at = clip_spare(work, current, spare, spare + POLYGON_SIZE, wp.vec4d(-n[1], -n[0], f64(0.0), tag))
            if answer == 0:
                return Verdict.HIDDEN
            current = at
    if current != level + AT_POLYGON:
        copy_polygon(work, current, level + AT_POLYGON)
    return Verdict.UNKNOWN
