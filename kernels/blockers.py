"""Blockers on a device: what a line crosses of them, and the ways to miss one, as rows of the stabbing system.

"A line crosses the plane of blocker R below its low edge" is one row (kernels/stab.py). Where that plane cuts through
the source or the target there are two more ways to miss R: leaving the source after it, entering the target before it,
both linear again.

The blocker that is looked for is the one that covers most of the shaft between the two boxes, not the first one met: a
slab between two storeys ends a search at its root.
"""

import warp as wp

from ..data.blockers import Blockers
from ..data.store import certificates
from .curtains import (
    CURTAIN_WAYS,
    FIRST_CURTAIN,
    append_curtain_way,
    crosses,
    has_curtain_way,
    rises,
    stops,
)
from .ends import CORNERS, Ends, append_corner, append_order, end_missed, has_corner, plan_times
from .fences import FENCE_WAYS, FIRST_FENCE, append_fence_way, fence_met, fence_of, may_miss
from .graph import reflect_high, reflect_low
from .hierarchy import Node, build_hierarchy, item_of, larger, skip_of, smaller
from .launch import CPU, Device
from .stab import LIST_CAPACITY, vec6i

f64 = wp.float64

# Ways to miss a blocker: past one of its four sides, or by entering the target before its plane, or by leaving the
# source after it. The last two exist only where the plane cuts through the target or the source.
WAYS = wp.constant(6)
# What a node may be about instead of a blocker: FIRST_MISS + how an end's plan is missed.
FIRST_MISS = wp.constant(certificates.FIRST_MISS)
# Lookups that found nothing, and one whose line meets a curtain, or misses an end, and no row says so.
CLEAR = wp.constant(-1)
DOUBTFUL = wp.constant(-2)


@wp.struct
class BlockerTree:
    """Blockers and their hierarchy as Warp arrays (see data/blockers.py)."""

    lo: wp.array[wp.vec3i]
    hi: wp.array[wp.vec3i]
    axis: wp.array[int]
    nodes: wp.array[Node]


@wp.func
def side_share(crossing: f64, edge: f64, shaft: f64) -> f64:
    """How much of the way from the crossing to the shaft's side the blocker covers, at most 1; all lengths positive."""
    reach = wp.abs(edge - crossing)
    need = wp.abs(shaft - crossing)
    if reach >= need:
        return f64(1.0)
    return reach / need


@wp.func
def shaft_bounds(ends: Ends, axis: int, b: int, k: f64) -> wp.vec2d:
    """Bounds on axis b, at plane k of another axis, of all segments from source to target.

    Steers the choice of blocker only. Source: the crossing rectangle of a shaft with a plane.
    """
    v0 = ends.s_lo[axis]
    v1 = ends.s_hi[axis]
    x0 = ends.t_lo[axis]
    x1 = ends.t_hi[axis]
    vlo = ends.s_lo[b]
    vhi = ends.s_hi[b]
    xlo = ends.t_lo[b]
    xhi = ends.t_hi[b]
    if k < v1 or k > x0 or x0 <= v1:
        return wp.vec2d(wp.min(vlo, xlo), wp.max(vhi, xhi))
    s = f64(0.0)
    if x1 > v1:
        s = (k - v1) / (x1 - v1)
    t = f64(1.0)
    if x0 > v0:
        t = (k - v0) / (x0 - v0)
    low = wp.min(vlo + s * (xlo - vlo), vlo + t * (xlo - vlo))
    high = wp.max(vhi + s * (xhi - vhi), vhi + t * (xhi - vhi))
    return wp.vec2d(low, high)


@wp.func
def shares(
    lo: wp.vec3d,
    hi: wp.vec3d,
    axis: int,
    point: wp.vec3d,
    ends: Ends,
) -> wp.vec4d:
    """Share of the shaft that a blocker covers towards its sides (u low, u high, v low, v high)."""
    out = wp.vec4d()
    for side_axis in range(2):
        b = int(axis + 1 + side_axis)
        if b > 2:
            b -= 3
        bounds = shaft_bounds(ends, axis, b, lo[axis])
        out[2 * side_axis] = side_share(point[b], lo[b], wp.min(bounds[0], point[b]))
        out[2 * side_axis + 1] = side_share(point[b], hi[b], wp.max(bounds[1], point[b]))
    return out


@wp.func
def strength(share: wp.vec4d) -> f64:
    """Rank of a blocker: sides wholly covered first, then how much of the others."""
    total = f64(0.0)
    for c in range(4):
        total += share[c]
        if share[c] >= f64(1.0):
            total += f64(4.0)
    return total


@wp.func
def side_order(share: wp.vec4d) -> int:
    """The four sides, least covered first, two bits each."""
    order = int(0)
    for place in range(4):
        best = f64(3.0)
        pick = int(0)
        for c in range(4):
            used = bool(False)
            for earlier in range(place):
                if ((order >> (2 * earlier)) & 3) == c:
                    used = True
            if not used and share[c] < best:
                best = share[c]
                pick = c
        order = order | (pick << (2 * place))
    return order


@wp.func
def cuts_target(plane: f64, t_lo: f64, strict: int) -> bool:
    """Whether a sightline may be in the target before it crosses the blocker's plane, and so need not pass it."""
    return plane > t_lo or (strict != 0 and plane >= t_lo)


@wp.func
def curtain_share(lo: wp.vec3d, hi: wp.vec3d, time: f64, w: wp.vec3d, xi: wp.vec3d, ends: Ends) -> wp.vec4d:
    """As `shares`, of a curtain taken for a rectangle across the axis that it is least extended on."""
    axis = int(0)
    if hi[1] - lo[1] < hi[0] - lo[0]:
        axis = 1
    point = wp.vec3d((time + xi[0]) / w[0], (time + xi[1]) / w[1], (time + xi[2]) / w[2])
    flat = wp.vec3d(lo[0], lo[1], lo[2])
    flat[axis] = f64(0.5) * (lo[axis] + hi[axis])
    return shares(flat, hi, axis, point, ends)


@wp.func
def node_times(node: Node, swift: wp.vec3d, xi: wp.vec3d) -> wp.vec2d:
    """When a line enters a node's box and when it leaves it; later than it enters if it misses the box.

    Args:
        node: of the hierarchy.
        swift: the line's w, negative on the axes that were mirrored; so the box need not be.
        xi: of the line.
    """
    first = f64(-1.0e300)
    last = f64(1.0e300)
    for i in range(3):
        a = swift[i] * f64(node[i])
        b = swift[i] * f64(node[4 + i])
        first = larger(first, smaller(a, b) - xi[i])
        last = smaller(last, larger(a, b) - xi[i])
    return wp.vec2d(first, last)


@wp.func
def scan(tree: BlockerTree, ends: Ends, w: wp.vec3d, xi: wp.vec3d) -> wp.vec2i:
    """The strongest blocker that the line crosses between leaving source and entering target, and its sides' order.

    Exact for integer w: every crossing time is an integer multiple of 1/4. Touching an edge of an axial blocker counts
    as crossing. Returns (CLEAR, 0) if the line is clear, (DOUBTFUL, 0) if it satisfies some way to miss each blocker
    that it may cross.
    """
    out = w[0] * ends.s_hi[0] - xi[0]
    leave = wp.min(out, wp.min(w[1] * ends.s_hi[1] - xi[1], w[2] * ends.s_hi[2] - xi[2]))
    into = w[0] * ends.t_lo[0] - xi[0]
    enter = wp.max(into, wp.max(w[1] * ends.t_lo[1] - xi[1], w[2] * ends.t_lo[2] - xi[2]))
    # When it leaves and enters the plans, to look for curtains that lie within the boxes around them.
    leave_plan = leave
    if ends.s_oblique == 1:
        leave_plan = wp.min(leave, plan_times(ends.s_plan, ends.turn, w, xi)[1] - f64(1.0e-6))
    enter_plan = enter
    if ends.t_oblique == 1:
        enter_plan = wp.max(enter, plan_times(ends.t_plan, ends.turn, w, xi)[0] + f64(1.0e-6))
    best = wp.vec2i(CLEAR, 0)
    best_strength = f64(-100.0)
    swift = w
    for i in range(3):
        if ((ends.octant >> i) & 1) == 1:
            swift[i] = -w[i]
    node = int(0)
    count = tree.nodes.shape[0]
    while node < count:
        box = tree.nodes[node]
        met = node_times(box, swift, xi)
        first = met[0]
        last = met[1]
        if first <= last and first <= enter_plan and last >= leave_plan and (ends.strict == 0 or first < enter_plan):
            item = item_of(box)
            if item >= 0:
                axis = tree.axis[item]
                lo = reflect_low(tree.lo[item], tree.hi[item], ends.octant)
                hi = reflect_high(tree.lo[item], tree.hi[item], ends.octant)
                value = f64(-200.0)
                share = wp.vec4d()
                if axis < FIRST_CURTAIN:
                    time = w[axis] * lo[axis] - xi[axis]
                    # A flat box that a line with no zero component meets is crossed at one time: first, last, time.
                    if time >= leave and first <= enter and (ends.strict == 0 or first < enter):
                        point = wp.vec3d((time + xi[0]) / w[0], (time + xi[1]) / w[1], (time + xi[2]) / w[2])
                        share = shares(lo, hi, axis, point, ends)
                        value = strength(share)
                        # A plane that cuts source or target leaves two more ways to miss the blocker.
                        if lo[axis] < ends.s_hi[axis] or cuts_target(lo[axis], ends.t_lo[axis], ends.strict):
                            value -= f64(3.0)
                    elif best[0] == CLEAR:
                        # Out of a prism, or before it, but inside the box around it: ways do not tell.
                        best = wp.vec2i(DOUBTFUL, 0)
                else:
                    rising = rises(axis, ends.octant)
                    if stops(lo, hi, rising, ends, w, xi, leave, enter):
                        share = curtain_share(lo, hi, f64(0.5) * (first + last), w, xi, ends)
                        value = strength(share)
                        if first <= leave or last >= enter:
                            value -= f64(3.0)
                    elif best[0] == CLEAR:
                        if crosses(lo, hi, rising, w, xi, leave_plan, enter_plan):
                            best = wp.vec2i(DOUBTFUL, 0)
                if value > best_strength:
                    best_strength = value
                    best = wp.vec2i(item, side_order(share))
                    if axis >= FIRST_CURTAIN:
                        best[1] = 0
                    if value >= f64(20.0):
                        return best
            node += 1
        else:
            node = skip_of(box)
    return best


@wp.func
def look_up(tree: BlockerTree, ends: Ends, w: wp.vec3d, xi: wp.vec3d) -> wp.vec2i:
    """What a node with this line is about: an end that it misses, or else as `scan`."""
    miss = end_missed(ends, w, xi)
    if miss >= 0:
        return wp.vec2i(FIRST_MISS + miss, 0)
    if ends.s_oblique + ends.t_oblique > 0:
        fence = fence_met(ends, w, xi)
        if fence >= 0:
            return wp.vec2i(FIRST_FENCE + fence, 0)
    found = scan(tree, ends, w, xi)
    if found[0] == CLEAR and may_miss(ends, w, xi):
        found[0] = DOUBTFUL
    return found


@wp.func
def append_beyond(
    work: wp.array[f64], lists: int, counts: vec6i, plane: f64, axis: int, corner: wp.vec3d, at_target: bool
) -> vec6i:
    """The rows "enters the target before the blocker's plane", or "leaves the source after it".

    Args:
        work: scratch.
        lists: where the rows are.
        counts: rows so far.
        plane: of the blocker.
        axis: it is perpendicular to.
        corner: low corner of the target, or high corner of the source.
        at_target: which of the two.
    """
    out = counts
    for step in range(1, 3):
        i = int(axis + step)
        if i > 2:
            i -= 3
        if at_target:
            out = append_order(work, lists, out, i, corner[i], axis, plane)
        else:
            out = append_order(work, lists, out, axis, plane, i, corner[i])
    return out


@wp.func
def append_side(
    work: wp.array[f64], lists: int, counts: vec6i, lo: wp.vec3d, hi: wp.vec3d, axis: int, side: int, inside: bool
) -> vec6i:
    """The row "passes the blocker's plane beyond this side", or with `inside` short of it."""
    b = int(axis + 1 + side // 2)
    if b > 2:
        b -= 3
    edge = lo[b]
    below = bool(True)
    if side % 2 == 1:
        edge = hi[b]
        below = False
    if inside:
        below = not below
    # Below: the plane is crossed before the edge, T_axis(plane) < T_b(edge).
    if below:
        return append_order(work, lists, counts, axis, lo[axis], b, edge)
    return append_order(work, lists, counts, b, edge, axis, lo[axis])


@wp.func
def has_room(counts: vec6i) -> bool:
    """Whether the rows of one more way fit."""
    for p in range(6):
        if counts[p] + 4 > LIST_CAPACITY:
            return False
    return True


@wp.func
def has_side(cursor: int, plane: f64, axis: int, ends: Ends) -> bool:
    """Whether way `cursor` to miss a rectangle exists: four sides, the others where its plane cuts a box."""
    if cursor == 4:
        return cuts_target(plane, ends.t_lo[axis], ends.strict)
    if cursor == 5:
        return plane < ends.s_hi[axis]
    return True


@wp.func
def way_count(tree: BlockerTree, item: int) -> int:
    """Ways of a node that is about an item, whether they exist or not."""
    if item >= FIRST_MISS:
        return CORNERS
    if item >= FIRST_FENCE:
        return FENCE_WAYS
    if tree.axis[item] >= FIRST_CURTAIN:
        return CURTAIN_WAYS
    return WAYS


@wp.func
def has_way(tree: BlockerTree, item: int, cursor: int, ends: Ends) -> bool:
    """Whether way `cursor` to miss a blocker, or to meet a missed plan, exists."""
    if item >= FIRST_MISS:
        return has_corner(ends, item - FIRST_MISS, cursor)
    if item >= FIRST_FENCE:
        return True
    lo = reflect_low(tree.lo[item], tree.hi[item], ends.octant)
    axis = tree.axis[item]
    if axis >= FIRST_CURTAIN:
        hi = reflect_high(tree.lo[item], tree.hi[item], ends.octant)
        return has_curtain_way(lo, hi, rises(axis, ends.octant), cursor, ends)
    return has_side(cursor, lo[axis], axis, ends)


@wp.func
def append_sides(
    work: wp.array[f64],
    lists: int,
    counts: vec6i,
    lo: wp.vec3d,
    hi: wp.vec3d,
    axis: int,
    order: int,
    cursor: int,
    ends: Ends,
) -> vec6i:
    """The rows of way `cursor` to miss a rectangle: a side, short of the sides before it in `order`; or beyond it."""
    out = counts
    if cursor < 4:
        for earlier in range(cursor + 1):
            side = (order >> (2 * earlier)) & 3
            out = append_side(work, lists, out, lo, hi, axis, side, earlier < cursor)
    elif cursor == 4:
        out = append_beyond(work, lists, out, lo[axis], axis, ends.t_lo, True)
    else:
        out = append_beyond(work, lists, out, lo[axis], axis, ends.s_hi, False)
    return out


@wp.func
def append_way(
    work: wp.array[f64], lists: int, counts: vec6i, tree: BlockerTree, item: int, order: int, cursor: int, ends: Ends
) -> vec6i:
    """The rows of way `cursor` to miss a blocker, or to meet a missed plan."""
    if item >= FIRST_MISS:
        return append_corner(work, lists, counts, ends, item - FIRST_MISS, cursor)
    if item >= FIRST_FENCE:
        return append_fence_way(work, lists, counts, fence_of(ends, item - FIRST_FENCE), cursor)
    lo = reflect_low(tree.lo[item], tree.hi[item], ends.octant)
    hi = reflect_high(tree.lo[item], tree.hi[item], ends.octant)
    axis = tree.axis[item]
    if axis >= FIRST_CURTAIN:
        return append_curtain_way(work, lists, counts, lo, hi, rises(axis, ends.octant), cursor, ends)
    return append_sides(work, lists, counts, lo, hi, axis, order, cursor, ends)


def blocker_tree(blockers: Blockers, device: Device = CPU) -> BlockerTree:
    """Copy blockers to a device."""
    lo, hi = (device.corners(blockers.boxes[:, side]) for side in (0, 1))
    return device.struct(BlockerTree, lo=lo, hi=hi, axis=blockers.axis, nodes=build_hierarchy(blockers.boxes).nodes)
