"""Target search: is there a sightline from one box to another, past every blocker?

A branch-and-bound over lines instead of portal sequences. Take the middle line of what is still possible and look up
the blockers it crosses between source and target. None: VISIBLE, and the line is the witness. Else the line must pass
blocker R on one of its four sides, and "crosses the plane of R below its low edge" is one more linear row of the
stabbing system (kernels/stab.py). Where that plane cuts through the source or the target there are two more ways:
leaving the source after it, entering the target before it, both linear again. Most children are empty at once; none
left: HIDDEN. Open space costs nothing however finely it was cut into cells, which is where portal sequences explode.

The blocker is the one that covers most of the shaft between the two boxes, not the first one met: a slab between two
storeys ends the search at its root.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..data.blockers import Blockers
from .graph import reflect_high, reflect_low
from .launch import SlotSizes, run_sliced, triples, vectors
from .stab import (
    AT_M,
    AT_W,
    HIDDEN,
    LEVEL_SIZE,
    LIST_CAPACITY,
    LISTS_SIZE,
    STABBED,
    UNDECIDED,
    append_box,
    append_entry,
    decide,
    offsets,
    start_level,
    vec6d,
    vec6i,
)

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

MAX_BRANCHES = wp.constant(60)
# Ways to miss a blocker: past one of its four sides, or by entering the target before its plane, or by leaving the
# source after it. The last two exist only where the plane cuts through the target or the source.
WAYS = wp.constant(6)
# Levels, rows, two spare polygons and the failing cut, and the rows again for widening the witness.
SLOT_SIZE = wp.constant((60 + 2) * (27 + 1 + 4 * 24) + 2 * 6 * 96 * 2 + 2 * (1 + 4 * 24) + 8)
SPARES_SIZE = wp.constant(2 * (1 + 4 * 24) + 8)
# A witness is first tried with this clearance [grid steps] from every edge it passes, then with a quarter of it, ...
WIDEST_CLEARANCE = wp.constant(wp.float64(1024.0))
# Integers a level: blocker, cursor, order of the four sides, six row counts.
FRAME = wp.constant(9)


@wp.struct
class BlockerTree:
    """Blockers and their hierarchy as Warp arrays (see data/blockers.py)."""

    lo: wp.array(dtype=wp.vec3i)
    hi: wp.array(dtype=wp.vec3i)
    axis: wp.array(dtype=int)
    node_lo: wp.array(dtype=wp.vec3i)
    node_hi: wp.array(dtype=wp.vec3i)
    links: wp.array(dtype=wp.vec2i)


@wp.struct
class Pairs:
    """Boxes, and rows (source box, target box, strict) to join; strict leaves out blockers at the target's face."""

    lo: wp.array(dtype=wp.vec3i)
    hi: wp.array(dtype=wp.vec3i)
    rows: wp.array(dtype=wp.vec3i)


@wp.struct
class Answers:
    """Per pair: verdict (0 hidden, 1 visible, 2 unknown), nodes spent, octant and line (w, xi) of a visible pair."""

    verdict: wp.array(dtype=wp.uint8)
    nodes: wp.array(dtype=int)
    octant: wp.array(dtype=int)
    line: wp.array(dtype=wp.vec3d)
    offset: wp.array(dtype=wp.vec3d)


@wp.func
def possible_octant(s_lo: wp.vec3i, s_hi: wp.vec3i, t_lo: wp.vec3i, t_hi: wp.vec3i, octant: int) -> bool:
    """Whether a line of this octant can lead from box s to box t."""
    for i in range(3):
        if ((octant >> i) & 1) == 1:
            if t_lo[i] >= s_hi[i]:
                return False
        else:
            if t_hi[i] <= s_lo[i]:
                return False
    return True


@wp.func
def side_share(crossing: f64, edge: f64, shaft: f64) -> f64:
    """How much of the way from the crossing to the shaft's side the blocker covers, at most 1; all lengths positive."""
    reach = wp.abs(edge - crossing)
    need = wp.abs(shaft - crossing)
    if reach >= need:
        return f64(1.0)
    return reach / need


@wp.func
def shaft_bounds(v0: f64, v1: f64, x0: f64, x1: f64, k: f64, vlo: f64, vhi: f64, xlo: f64, xhi: f64) -> wp.vec2d:
    """Bounds on one axis, at plane k of another, of all segments from [v0, v1] x [vlo, vhi] to [x0, x1] x [xlo, xhi].

    Steers the choice of blocker only. Source: the crossing rectangle of a shaft with a plane.
    """
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
    s_lo: wp.vec3d,
    s_hi: wp.vec3d,
    t_lo: wp.vec3d,
    t_hi: wp.vec3d,
) -> wp.vec4d:
    """Share of the shaft that a blocker covers towards its sides (u low, u high, v low, v high)."""
    out = wp.vec4d()
    for side_axis in range(2):
        b = int(axis + 1 + side_axis)
        if b > 2:
            b -= 3
        bounds = shaft_bounds(
            s_lo[axis], s_hi[axis], t_lo[axis], t_hi[axis], lo[axis], s_lo[b], s_hi[b], t_lo[b], t_hi[b]
        )
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
def scan(
    tree: BlockerTree,
    w: wp.vec3d,
    xi: wp.vec3d,
    octant: int,
    s_lo: wp.vec3d,
    s_hi: wp.vec3d,
    t_lo: wp.vec3d,
    t_hi: wp.vec3d,
    strict: int,
) -> wp.vec2i:
    """The strongest blocker that the line crosses between leaving s and entering t, and the order of its sides.

    Exact for integer w: every crossing time is an integer multiple of 1/4. Touching an edge counts as crossing.
    Returns (-1, 0) if the line is clear.
    """
    leave = wp.min(w[0] * s_hi[0] - xi[0], wp.min(w[1] * s_hi[1] - xi[1], w[2] * s_hi[2] - xi[2]))
    enter = wp.max(w[0] * t_lo[0] - xi[0], wp.max(w[1] * t_lo[1] - xi[1], w[2] * t_lo[2] - xi[2]))
    best = wp.vec2i(-1, 0)
    best_strength = f64(-100.0)
    node = int(0)
    count = tree.links.shape[0]
    while node < count:
        link = tree.links[node]
        lo = reflect_low(tree.node_lo[node], tree.node_hi[node], octant)
        hi = reflect_high(tree.node_lo[node], tree.node_hi[node], octant)
        first = wp.max(w[0] * lo[0] - xi[0], wp.max(w[1] * lo[1] - xi[1], w[2] * lo[2] - xi[2]))
        last = wp.min(w[0] * hi[0] - xi[0], wp.min(w[1] * hi[1] - xi[1], w[2] * hi[2] - xi[2]))
        if first <= last and first <= enter and last >= leave and (strict == 0 or first < enter):
            if link[1] >= 0:
                axis = tree.axis[link[1]]
                time = w[axis] * lo[axis] - xi[axis]
                # A flat box that a line with no zero component meets is crossed at one time, and first == last == time.
                if time >= leave:
                    point = wp.vec3d((time + xi[0]) / w[0], (time + xi[1]) / w[1], (time + xi[2]) / w[2])
                    share = shares(lo, hi, axis, point, s_lo, s_hi, t_lo, t_hi)
                    value = strength(share)
                    # A plane that cuts source or target leaves two more ways to miss the blocker.
                    if lo[axis] < s_hi[axis] or cuts_target(lo[axis], t_lo[axis], strict):
                        value -= f64(3.0)
                    if value > best_strength:
                        best_strength = value
                        best = wp.vec2i(link[1], side_order(share))
                        if value >= f64(20.0):
                            return best
            node += 1
        else:
            node = link[0]
    return best


@wp.func
def append_order(
    work: wp.array(dtype=f64), lists: int, counts: vec6i, i: int, first: f64, j: int, second: f64
) -> vec6i:
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
def cuts_target(plane: f64, t_lo: f64, strict: int) -> bool:
    """Whether a sightline may be in the target before it crosses the blocker's plane, and so need not pass it."""
    return plane > t_lo or (strict != 0 and plane >= t_lo)


@wp.func
def append_beyond(
    work: wp.array(dtype=f64), lists: int, counts: vec6i, plane: f64, axis: int, corner: wp.vec3d, at_target: bool
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
    work: wp.array(dtype=f64), lists: int, counts: vec6i, lo: wp.vec3d, hi: wp.vec3d, axis: int, side: int, inside: bool
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
def has_way(cursor: int, plane: f64, axis: int, s_hi: wp.vec3d, t_lo: wp.vec3d, strict: int) -> bool:
    """Whether way `cursor` to miss a blocker exists: four sides always, the other two where its plane cuts a box."""
    if cursor == 4:
        return cuts_target(plane, t_lo[axis], strict)
    if cursor == 5:
        return plane < s_hi[axis]
    return True


@wp.func
def append_way(
    work: wp.array(dtype=f64),
    lists: int,
    counts: vec6i,
    lo: wp.vec3d,
    hi: wp.vec3d,
    axis: int,
    order: int,
    cursor: int,
    s_hi: wp.vec3d,
    t_lo: wp.vec3d,
) -> vec6i:
    """The rows of way `cursor` to miss a blocker: a side, and short of the sides before it in `order`, or beyond it."""
    out = counts
    if cursor < 4:
        for earlier in range(cursor + 1):
            side = (order >> (2 * earlier)) & 3
            out = append_side(work, lists, out, lo, hi, axis, side, earlier < cursor)
    elif cursor == 4:
        out = append_beyond(work, lists, out, lo[axis], axis, t_lo, True)
    else:
        out = append_beyond(work, lists, out, lo[axis], axis, s_hi, False)
    return out


@wp.func
def inset(lo: wp.vec3d, hi: wp.vec3d, clearance: f64) -> wp.vec3d:
    """How far to shrink a box on each axis: the clearance, but never more than a quarter of the box."""
    out = wp.vec3d()
    for i in range(3):
        out[i] = wp.floor(wp.min(clearance, f64(0.25) * (hi[i] - lo[i])))
    return out


@wp.func
def widen(
    work: wp.array(dtype=f64),
    lists: int,
    level: int,
    spare: int,
    counts: vec6i,
    s_lo: wp.vec3d,
    s_hi: wp.vec3d,
    t_lo: wp.vec3d,
    t_hi: wp.vec3d,
    clearance: f64,
) -> int:
    """Decide the same rows again, each tightened by a clearance, into `level`; STABBED if a line keeps that clear."""
    roomy = spare + SPARES_SIZE
    s_in = inset(s_lo, s_hi, clearance)
    t_in = inset(t_lo, t_hi, clearance)
    done = append_box(work, roomy, vec6i(), s_lo + s_in, s_hi - s_in, -1)
    done = append_box(work, roomy, done, t_lo + t_in, t_hi - t_in, -1)
    for p in range(6):
        for k in range(2, counts[p]):
            at = lists + (p * LIST_CAPACITY + k) * 2
            append_entry(work, roomy, p, k, work[at] + clearance, work[at + 1] - clearance)
    start_level(work, level)
    return decide(work, roomy, level, level + LEVEL_SIZE, spare, vec6i(), counts)


@wp.kernel
def _search(
    tree: BlockerTree,
    pairs: Pairs,
    first: int,
    last: int,
    cap: int,
    work: wp.array(dtype=f64),
    frames: wp.array(dtype=int),
    answers: Answers,
):
    slot = wp.tid()
    levels = slot * SLOT_SIZE
    lists = levels + (MAX_BRANCHES + 2) * LEVEL_SIZE
    spare = lists + LISTS_SIZE
    stack = slot * (MAX_BRANCHES + 2) * FRAME
    slots = work.shape[0] // SLOT_SIZE
    row = first + slot
    while row < last:
        pair = pairs.rows[row]
        verdict = int(HIDDEN)
        nodes = int(0)
        octant = int(0)
        while octant < 8:
            if possible_octant(pairs.lo[pair[0]], pairs.hi[pair[0]], pairs.lo[pair[1]], pairs.hi[pair[1]], octant):
                s_lo = reflect_low(pairs.lo[pair[0]], pairs.hi[pair[0]], octant)
                s_hi = reflect_high(pairs.lo[pair[0]], pairs.hi[pair[0]], octant)
                t_lo = reflect_low(pairs.lo[pair[1]], pairs.hi[pair[1]], octant)
                t_hi = reflect_high(pairs.lo[pair[1]], pairs.hi[pair[1]], octant)
                counts = append_box(work, lists, vec6i(), s_lo, s_hi, -1)
                counts = append_box(work, lists, counts, t_lo, t_hi, -1)
                start_level(work, levels)
                answer = decide(work, lists, levels, levels + LEVEL_SIZE, spare, vec6i(), counts)
                depth = int(0)
                fresh = bool(True)
                if answer == UNDECIDED:
                    verdict = UNDECIDED
                if answer != STABBED:
                    depth = -1
                for p in range(6):
                    frames[stack + 3 + p] = counts[p]
                while depth >= 0:
                    at = stack + depth * FRAME
                    level = levels + (depth + 1) * LEVEL_SIZE
                    w = wp.vec3d(work[level + AT_W], work[level + AT_W + 1], work[level + AT_W + 2])
                    if fresh:
                        nodes += 1
                        m = vec6d()
                        for p in range(6):
                            m[p] = work[level + AT_M + p]
                        xi = offsets(m)
                        hit = scan(tree, w, xi, octant, s_lo, s_hi, t_lo, t_hi, pair[2])
                        frames[at] = hit[0]
                        frames[at + 1] = 0
                        frames[at + 2] = hit[1]
                        fresh = False
                        if hit[0] < 0:
                            depth = -1
                            # An unrounded direction makes crossing times inexact: kept, but not called a witness.
                            if w[0] == wp.floor(w[0]):
                                verdict = STABBED
                                for p in range(6):
                                    counts[p] = frames[at + 3 + p]
                                clearance = WIDEST_CLEARANCE
                                while clearance >= f64(1.0):
                                    if (
                                        widen(work, lists, levels, spare, counts, s_lo, s_hi, t_lo, t_hi, clearance)
                                        == STABBED
                                    ):
                                        wide = levels + LEVEL_SIZE
                                        for p in range(6):
                                            m[p] = work[wide + AT_M + p]
                                        w_wide = wp.vec3d(
                                            work[wide + AT_W], work[wide + AT_W + 1], work[wide + AT_W + 2]
                                        )
                                        xi_wide = offsets(m)
                                        hit = scan(tree, w_wide, xi_wide, octant, s_lo, s_hi, t_lo, t_hi, pair[2])
                                        if hit[0] < 0:
                                            w = w_wide
                                            xi = xi_wide
                                            clearance = f64(0.0)
                                    clearance *= f64(0.25)
                                answers.octant[row] = octant
                                answers.line[row] = w
                                answers.offset[row] = xi
                                octant = 8
                            else:
                                verdict = UNDECIDED
                        elif nodes >= cap or depth == MAX_BRANCHES:
                            verdict = UNDECIDED
                            depth = -1
                            octant = 8
                    elif frames[at + 1] == WAYS:
                        depth -= 1
                    else:
                        cursor = frames[at + 1]
                        frames[at + 1] = cursor + 1
                        blocker = frames[at]
                        lo = reflect_low(tree.lo[blocker], tree.hi[blocker], octant)
                        hi = reflect_high(tree.lo[blocker], tree.hi[blocker], octant)
                        axis = tree.axis[blocker]
                        for p in range(6):
                            counts[p] = frames[at + 3 + p]
                        if not has_room(counts):
                            verdict = UNDECIDED
                            depth = -1
                            octant = 8
                        else:
                            answer = HIDDEN
                            grown = counts
                            if has_way(cursor, lo[axis], axis, s_hi, t_lo, pair[2]):
                                grown = append_way(
                                    work, lists, counts, lo, hi, axis, frames[at + 2], cursor, s_hi, t_lo
                                )
                                answer = decide(work, lists, level, level + LEVEL_SIZE, spare, counts, grown)
                            if answer == UNDECIDED:
                                verdict = UNDECIDED
                            if answer == STABBED:
                                depth += 1
                                for p in range(6):
                                    frames[at + FRAME + 3 + p] = grown[p]
                                fresh = True
            octant += 1
        answers.verdict[row] = wp.uint8(verdict)
        answers.nodes[row] = nodes
        row += slots


@dataclass
class TargetAnswers:
    """Answers of a target search, one row a pair.

    Attributes:
        verdict: 0 hidden, 1 visible, 2 unknown; uint8.
        nodes: lines tried, int32.
        octant: of a visible pair's line, int32.
        line: its w, float64, shape (n, 3): component i of the direction is sign_i / w_i.
        offset: its xi: coordinate i at time t is sign_i (t + xi_i) / w_i.
    """

    verdict: np.ndarray
    nodes: np.ndarray
    octant: np.ndarray
    line: np.ndarray
    offset: np.ndarray


def blocker_tree(blockers: Blockers, device: str = "cpu") -> BlockerTree:
    """Copy blockers to a device."""
    tree = BlockerTree()
    tree.lo, tree.hi = vectors(blockers.boxes[:, 0], device), vectors(blockers.boxes[:, 1], device)
    tree.axis = wp.array(blockers.axis, dtype=int, device=device)
    nodes = blockers.hierarchy
    tree.node_lo, tree.node_hi = triples(nodes.boxes[:, 0], device), triples(nodes.boxes[:, 1], device)
    tree.links = wp.array(nodes.links, dtype=wp.vec2i, device=device)
    return tree


def launch_target_search(
    tree: BlockerTree, boxes: np.ndarray, rows: np.ndarray, *, cap: int = 2000, threads: int = 1, device: str = "cpu"
) -> TargetAnswers:
    """Whether an open set of sightlines leads from box to box past every blocker.

    Args:
        tree: blockers on the same device.
        boxes: [grid steps], shape (m, 2, 3), int32, |coordinate| <= 2**24.
        rows: (source box, target box, strict), shape (n, 3), int. Source and target must not overlap. With strict 1 a
            blocker that lies on the target's near face does not count (the target is a surface, not a cell).
        cap: lines tried a pair before the answer is unknown.
        threads: CPU threads; ignored on a GPU.
        device: Warp device.

    Returns:
        Answers. Hidden is exact: no open set of lines passes. Visible is exact for the blockers given, and its line
        keeps the widest clearance that was found (1024, 256, ... 1 grid steps, or whatever the first line had). Unknown
        is neither: keep it.

    Raises:
        InputError: a coordinate beyond the grid, where products of differences are no longer exact.
    """
    count = len(rows)
    work = Pairs()
    work.lo, work.hi = vectors(boxes[:, 0], device), vectors(boxes[:, 1], device)
    work.rows = triples(rows, device)
    answers = Answers()
    answers.verdict = wp.zeros(count, dtype=wp.uint8, device=device)
    answers.nodes = wp.zeros(count, dtype=int, device=device)
    answers.octant = wp.zeros(count, dtype=int, device=device)
    answers.line = wp.zeros(count, dtype=wp.vec3d, device=device)
    answers.offset = wp.zeros(count, dtype=wp.vec3d, device=device)

    def launch(first: int, last: int, slots: int, scratch: wp.array, frames: wp.array) -> None:
        wp.launch(_search, dim=slots, inputs=[tree, work, first, last, cap, scratch, frames, answers], device=device)

    scratch = SlotSizes(int(SLOT_SIZE), (int(MAX_BRANCHES) + 2) * int(FRAME))
    run_sliced(launch, count, scratch, module=__name__, threads=threads, device=device)
    return TargetAnswers(*(getattr(answers, name).numpy() for name in TargetAnswers.__dataclass_fields__))
