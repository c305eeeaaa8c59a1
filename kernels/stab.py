"""Axial stabbing: does a straight line meet every box of a list, within one octant of directions?

Crossing-time coordinates make it a linear problem. With w_i = 1/d_i > 0 and xi_i = w_i p_i the line crosses the plane
x_i = k at time w_i k - xi_i, so it meets a box iff `xi_i - xi_j >= w_i lo_i - w_j hi_j` for the six ordered pairs of
axes. Eliminating xi leaves five cycles, each a linear *cut* on w: a two-dimensional problem, solved here with a convex
polygon of directions that every cut shrinks.

All coordinates are integers below 2**24 and every decision is exact: cuts and polygons are those of
kernels/directions.py, trial directions are integers, so "this line passes" is exact as well. HIDDEN is therefore never
wrong, and the few directions too thin for an integer trial give UNKNOWN.

Sources: Megiddo 1996 (US 5,481,658) and Goodman et al. 2006, "Cremona convexity, frame convexity, and a theorem of
Santalo" for the convexity; Funkhouser et al. 1996, section 3.2 for its use.
"""

import warp as wp

from ..data.verdict import Verdict
from .directions import POLYGON_SIZE, clip, copy_polygon, middle, to_integers

# Ordered pairs of axes, two lists per pair: list 2u holds (a, b) = (lo_i, hi_j), list 2u + 1 holds (lo_j, hi_i).
# Unordered pair u: 0 = (x, y), 1 = (y, z), 2 = (x, z).
# Entries a list can hold: a portal sequence longer than this is answered UNKNOWN.
LIST_CAPACITY = wp.constant(96)
LISTS_SIZE = wp.constant(6 * LIST_CAPACITY * 2)
# A level: slope bounds (low numerator, denominator, tag, high numerator, denominator, tag) of three pairs, direction w,
# the maxima M of the six lists at w, and the polygon.
SLOPES_SIZE = wp.constant(18)
AT_W = wp.constant(18)
AT_M = wp.constant(21)
AT_POLYGON = wp.constant(27)
LEVEL_SIZE = wp.constant(AT_POLYGON + POLYGON_SIZE)
# Two spare polygons, and the cut that left nothing with the place of the polygon that it emptied.
FAILING_SIZE = wp.constant(8)
SPARES_SIZE = wp.constant(2 * POLYGON_SIZE + FAILING_SIZE)
MAX_TRIALS = wp.constant(48)
TAG_BASE = wp.constant(128)

f64 = wp.float64
vec6i = wp.types.vector(length=6, dtype=wp.int32)
vec6d = wp.types.vector(length=6, dtype=wp.float64)


def slot_size(levels: int) -> int:
    """Float64 values of scratch that a search through so many levels needs: levels, then lists, then spares."""
    return levels * LEVEL_SIZE + LISTS_SIZE + SPARES_SIZE


@wp.func
def axis_i(u: int) -> int:
    """First axis of unordered pair u."""
    if u == 1:
        return 1
    return 0


@wp.func
def axis_j(u: int) -> int:
    """Second axis of unordered pair u."""
    if u == 0:
        return 1
    return 2


@wp.func
def list_from(p: int) -> int:
    """Axis i of list p: its rows read xi_i - xi_j >= w_i a - w_j b."""
    if p % 2 == 0:
        return axis_i(p // 2)
    return axis_j(p // 2)


@wp.func
def list_to(p: int) -> int:
    """Axis j of list p."""
    if p % 2 == 0:
        return axis_j(p // 2)
    return axis_i(p // 2)


@wp.func
def append_entry(work: wp.array[f64], lists: int, p: int, k: int, a: f64, b: f64):
    """Store row k of list p."""
    at = lists + (p * LIST_CAPACITY + k) * 2
    work[at] = a
    work[at + 1] = b


@wp.func
def append_box(work: wp.array[f64], lists: int, counts: vec6i, lo: wp.vec3d, hi: wp.vec3d, flat: int) -> vec6i:
    """Append the rows of one box; a box flat on axis `flat` needs only the four that name that axis (-1: all six)."""
    out = counts
    for p in range(6):
        i = list_from(p)
        j = list_to(p)
        if flat < 0 or i == flat or j == flat:
            append_entry(work, lists, p, out[p], lo[i], hi[j])
            out[p] = out[p] + 1
    return out


@wp.func
def start_level(work: wp.array[f64], level: int):
    """The widest level: slopes in (0, infinity), the whole triangle of directions."""
    for u in range(3):
        at = level + 6 * u
        work[at] = f64(0.0)
        work[at + 1] = f64(1.0)
        work[at + 2] = f64(-1.0)
        work[at + 3] = f64(1.0)
        work[at + 4] = f64(0.0)
        work[at + 5] = f64(-1.0)
    polygon = level + AT_POLYGON
    work[polygon] = f64(3.0)
    for i in range(3):
        for c in range(3):
            work[polygon + 1 + 4 * i + c] = f64(0.0)
        work[polygon + 1 + 4 * i + i] = f64(-1.0)
        work[polygon + 1 + 4 * i + 3] = f64(-1.0)


@wp.func
def worst_cycle(m: vec6d) -> f64:
    """F: the largest of the five cycle sums; negative means an open set of lines has this direction."""
    f = wp.max(m[0] + m[1], wp.max(m[2] + m[3], m[4] + m[5]))
    return wp.max(f, wp.max(m[0] + m[2] + m[5], m[4] + m[3] + m[1]))


@wp.func
def raise_maxima(m: vec6d, w: wp.vec3d, lo: wp.vec3d, hi: wp.vec3d, flat: int) -> vec6d:
    """The maxima with one more box; exact for integer w and box."""
    out = m
    for p in range(6):
        i = list_from(p)
        j = list_to(p)
        if flat < 0 or i == flat or j == flat:
            out[p] = wp.max(out[p], w[i] * lo[i] - w[j] * hi[j])
    return out


@wp.func
def narrow_slopes(work: wp.array[f64], lists: int, level: int, before: vec6i, counts: vec6i) -> int:
    """Tighten the slope bounds of a level by every two-cycle that a row at or past `before` takes part in.

    Returns:
        HIDDEN as soon as some pair of axes has no open slope interval, else 1 + 4 times a bit mask of moved bounds.
    """
    moved = int(0)
    for u in range(3):
        at = level + 6 * u
        ln = work[at]
        ld = work[at + 1]
        lt = work[at + 2]
        hn = work[at + 3]
        hd = work[at + 4]
        ht = work[at + 5]
        front = lists + (2 * u) * LIST_CAPACITY * 2
        back = lists + (2 * u + 1) * LIST_CAPACITY * 2
        for k in range(counts[2 * u]):
            a = work[front + 2 * k]
            b = work[front + 2 * k + 1]
            m = int(0)
            if k < before[2 * u]:
                m = before[2 * u + 1]
            while m < counts[2 * u + 1]:
                cu = a - work[back + 2 * m + 1]
                cv = work[back + 2 * m] - b
                if cu > f64(0.0):
                    if -cv * hd < hn * cu:
                        hn = -cv
                        hd = cu
                        ht = f64(u + 8 * (k + TAG_BASE * m))
                        moved = moved | (2 << (2 * u))
                elif cu < f64(0.0):
                    if cv * ld > -ln * cu:
                        ln = cv
                        ld = -cu
                        lt = f64(u + 8 * (k + TAG_BASE * m))
                        moved = moved | (1 << (2 * u))
                elif cv >= f64(0.0):
                    # No direction at all; said as an empty interval whose one cut is the certificate.
                    hn = -cv
                    hd = f64(0.0)
                    ht = f64(u + 8 * (k + TAG_BASE * m))
                    work[at + 3] = f64(-1.0)
                    work[at + 4] = f64(0.0)
                    work[at + 5] = ht
                    return Verdict.HIDDEN
                m += 1
        work[at] = ln
        work[at + 1] = ld
        work[at + 2] = lt
        work[at + 3] = hn
        work[at + 4] = hd
        work[at + 5] = ht
        if hn * ld <= ln * hd:
            return Verdict.HIDDEN
    return 4 * moved + 1


@wp.func
def maxima(work: wp.array[f64], lists: int, counts: vec6i, w: wp.vec3d) -> tuple[vec6d, vec6i, f64]:
    """M of the six lists at w, the rows that attain it, and the largest magnitude that entered."""
    m = vec6d()
    arg = vec6i()
    magnitude = f64(0.0)
    for p in range(6):
        i = list_from(p)
        j = list_to(p)
        best = f64(-1.0e300)
        best_at = int(0)
        for k in range(counts[p]):
            at = lists + (p * LIST_CAPACITY + k) * 2
            forward = w[i] * work[at]
            backward = w[j] * work[at + 1]
            value = forward - backward
            magnitude = wp.max(magnitude, wp.abs(forward) + wp.abs(backward))
            if value > best:
                best = value
                best_at = k
        m[p] = best
        arg[p] = best_at
    return m, arg, magnitude


@wp.func
def cycle_cut(work: wp.array[f64], lists: int, m: vec6d, arg: vec6i) -> wp.vec4d:
    """The worst cycle at the trial direction as a cut (x, y, z) with its tag."""
    best = m[0] + m[1]
    cycle = int(0)
    for u in range(1, 3):
        value = m[2 * u] + m[2 * u + 1]
        if value > best:
            best = value
            cycle = u
    if m[0] + m[2] + m[5] > best:
        best = m[0] + m[2] + m[5]
        cycle = 3
    if m[4] + m[3] + m[1] > best:
        cycle = 4
    p0 = int(2 * cycle)
    p1 = int(2 * cycle + 1)
    p2 = int(-1)
    if cycle == 3:
        p0 = 0
        p1 = 2
        p2 = 5
    if cycle == 4:
        p0 = 4
        p1 = 3
        p2 = 1
    g = wp.vec3d(f64(0.0), f64(0.0), f64(0.0))
    tag = int(cycle + 8 * (arg[p0] + TAG_BASE * arg[p1]))
    for step in range(3):
        p = int(p0)
        if step == 1:
            p = p1
        if step == 2:
            p = p2
        if p >= 0:
            at = lists + (p * LIST_CAPACITY + arg[p]) * 2
            g[list_from(p)] = g[list_from(p)] + work[at]
            g[list_to(p)] = g[list_to(p)] - work[at + 1]
    if p2 >= 0:
        tag = tag + 8 * TAG_BASE * TAG_BASE * arg[p2]
    return wp.vec4d(g[0], g[1], g[2], f64(tag))


@wp.func
def slope_cut(work: wp.array[f64], level: int, bound: int) -> wp.vec4d:
    """Slope bound 2u (low) or 2u + 1 (high) of a level as a cut (x, y, z) with its tag."""
    u = bound // 2
    at = level + 6 * u + 3 * (bound % 2)
    g = wp.vec4d(f64(0.0), f64(0.0), f64(0.0), work[at + 2])
    if bound % 2 == 0:
        g[axis_i(u)] = -work[at + 1]
        g[axis_j(u)] = work[at]
    else:
        g[axis_i(u)] = work[at + 1]
        g[axis_j(u)] = -work[at]
    return g


@wp.func
def clip_spare(work: wp.array[f64], current: int, spare_a: int, spare_b: int, g: wp.vec4d) -> tuple[int, int]:
    """Clip the current polygon into whichever spare is free; returns (clip's answer, where the polygon is now)."""
    target = spare_a
    if current == spare_a:
        target = spare_b
    answer = clip(work, current, target, wp.vec3d(g[0], g[1], g[2]), g[3])
    if answer == 1:
        return answer, target
    return answer, current


@wp.func
def report_failing(work: wp.array[f64], failing: int, g: wp.vec4d, polygon: int):
    """Store the cut that left nothing and where the polygon is that it emptied."""
    for c in range(4):
        work[failing + c] = g[c]
    work[failing + 4] = f64(polygon)


@wp.func
def decide(
    work: wp.array[f64], lists: int, inherited: int, level: int, spare: int, before: vec6i, counts: vec6i
) -> int:
    """Decide the rows of the lists, given the level `inherited` that was decided with the rows up to `before`.

    Writes slopes, direction, maxima and polygon to `level` (which may not be `inherited`). On HIDDEN the polygon at
    `spare` ends with the cut that emptied it (see `launch_stab`).

    Returns:
        HIDDEN: exact, no open set of lines. VISIBLE: exact, w and M are a witness. UNKNOWN: neither could be shown.
    """
    for k in range(SLOPES_SIZE):
        work[level + k] = work[inherited + k]
    moved = narrow_slopes(work, lists, level, before, counts)
    # The failing cut is reported at `spare + 2 * POLYGON_SIZE`; slopes that failed are flagged by tag -2.
    failing = spare + 2 * POLYGON_SIZE
    if moved == Verdict.HIDDEN:
        work[failing + 3] = f64(-2.0)
        return Verdict.HIDDEN
    moved = moved // 4
    current = inherited + AT_POLYGON
    spare_b = spare + POLYGON_SIZE
    for bound in range(6):
        if ((moved >> bound) & 1) == 1:
            g = slope_cut(work, level, bound)
            answer, at = clip_spare(work, current, spare, spare_b, g)
            if answer == 0:
                report_failing(work, failing, g, current)
                return Verdict.HIDDEN
            current = at
    verdict = int(Verdict.UNKNOWN)
    m = vec6d()
    w = wp.vec3d()
    trial = int(0)
    while trial < MAX_TRIALS:
        trial += 1
        real = middle(work, current)
        w = to_integers(real)
        m, arg, magnitude = maxima(work, lists, counts, w)
        if worst_cycle(m) < f64(0.0):
            verdict = int(Verdict.VISIBLE)
            trial = MAX_TRIALS
        else:
            g = cycle_cut(work, lists, m, arg)
            answer, at = clip_spare(work, current, spare, spare_b, g)
            if answer == 0:
                report_failing(work, failing, g, current)
                return Verdict.HIDDEN
            if answer >= 2:
                # Too thin for integers: the unrounded direction, with a bound on what rounding can do to a cycle sum
                # (at most 3 rows; products, difference and sums each round once: 4 * 2**-53 a row, doubled).
                m, arg, magnitude = maxima(work, lists, counts, real)
                if worst_cycle(m) < f64(-2.6645352591003757e-15) * magnitude:
                    w = real
                    verdict = int(Verdict.VISIBLE)
                trial = MAX_TRIALS
            current = at
    for c in range(3):
        work[level + AT_W + c] = w[c]
    for p in range(6):
        work[level + AT_M + p] = m[p]
    copy_polygon(work, current, level + AT_POLYGON)
    return verdict


@wp.func
def offsets(m: vec6d) -> wp.vec3d:
    """Offsets xi (xi_z = 0) in the middle of what the maxima M allow: the line that keeps clear of every row.

    Shortest paths close M over the third axis first, so the interval of xi_x is exact, then that of xi_y given xi_x.
    """
    x_low = wp.max(m[4], m[0] + m[2])
    x_high = wp.min(-m[5], -(m[3] + m[1]))
    x = f64(0.5) * (x_low + x_high)
    y_low = wp.max(m[2], x + m[1])
    y_high = wp.min(-m[3], x - m[0])
    return wp.vec3d(x, f64(0.5) * (y_low + y_high), f64(0.0))


@wp.func
def direction(work: wp.array[f64], level: int) -> wp.vec3d:
    """Direction w of a decided level."""
    return wp.vec3d(work[level + AT_W], work[level + AT_W + 1], work[level + AT_W + 2])


@wp.func
def level_maxima(work: wp.array[f64], level: int) -> vec6d:
    """Maxima M of a decided level at its direction."""
    m = vec6d()
    for p in range(6):
        m[p] = work[level + AT_M + p]
    return m


@wp.func
def store_counts(frames: wp.array[int], at: int, counts: vec6i):
    """Save row counts."""
    for p in range(6):
        frames[at + p] = counts[p]


@wp.func
def load_counts(frames: wp.array[int], at: int) -> vec6i:
    """Saved row counts."""
    counts = vec6i()
    for p in range(6):
        counts[p] = frames[at + p]
    return counts
