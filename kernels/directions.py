"""Convex polygons of directions: what cuts leave of the triangle w > 0, exactly.

A cut g . w <= 0 has integer coefficients below 2**26; a corner of a polygon is the cross product of two cuts (below
2**53, so exact in float64), and the sign of a cut at a corner is taken from 64-bit integers where float64 cannot tell.
Trial directions are integers too.
"""

import warp as wp

# A polygon: its edge count, then (x, y, z, tag) of each edge's cut.
EDGE_CAPACITY = wp.constant(24)
POLYGON_SIZE = wp.constant(1 + 4 * EDGE_CAPACITY)
# A trial direction has integer components up to this, so that w * coordinate and sums of six of them stay exact.
W_SCALE = wp.constant(wp.float64(2.0**24))

f64 = wp.float64


@wp.func
def det_sign(g: wp.vec3d, v: wp.vec3d) -> int:
    """Exact sign of g . v for integers |g| <= 2**26, |v| <= 2**53 held in float64."""
    t0 = g[0] * v[0]
    t1 = g[1] * v[1]
    t2 = g[2] * v[2]
    det = t0 + t1 + t2
    # Three products and two sums, each rounded once: the error is below 4 * 2**-53 of the magnitudes; 2**-50 is safe.
    bound = (wp.abs(t0) + wp.abs(t1) + wp.abs(t2)) * f64(8.881784197001252e-16)
    if det > bound:
        return 1
    if det < -bound:
        return -1
    high = wp.int64(0)
    low = wp.int64(0)
    for i in range(3):
        whole = wp.int64(v[i])
        upper = whole >> wp.int64(27)
        high += wp.int64(g[i]) * upper
        low += wp.int64(g[i]) * (whole - (upper << wp.int64(27)))
    high += low >> wp.int64(27)
    low = low & wp.int64(134217727)
    if high > wp.int64(0):
        return 1
    if high < wp.int64(0):
        return -1
    if low > wp.int64(0):
        return 1
    return 0


@wp.func
def edge_cut(work: wp.array[f64], polygon: int, k: int) -> wp.vec3d:
    """Cut of edge k of a polygon."""
    at = polygon + 1 + 4 * k
    return wp.vec3d(work[at], work[at + 1], work[at + 2])


@wp.func
def clip(work: wp.array[f64], source: int, target: int, g: wp.vec3d, tag: f64) -> int:
    """Clip polygon `source` by g . w <= 0 into `target`.

    Returns:
        0 if nothing with g . w < 0 is left, 1 if the cut removed something, 2 if it removed nothing (target untouched),
        3 if the polygon has no room for another edge (target untouched).
    """
    n = int(work[source])
    removed = int(0)
    positive = int(0)
    negative = int(0)
    e = edge_cut(work, source, 0)
    for k in range(n):
        following = int(k + 1)
        if following == n:
            following = 0
        e_next = edge_cut(work, source, following)
        s = det_sign(g, wp.cross(e, e_next))
        if s >= 0:
            removed = removed | (1 << k)
        if s > 0:
            positive += 1
        if s < 0:
            negative += 1
        e = e_next
    if negative == 0:
        return 0
    if positive == 0:
        return 2
    # Vertex k lies between edges k and k + 1. The run of removed vertices starts at `first` and ends before `kept`.
    first = int(0)
    for k in range(n):
        before = int(k - 1)
        if before < 0:
            before = n - 1
        if ((removed >> k) & 1) == 1 and ((removed >> before) & 1) == 0:
            first = k
    kept = int(first)
    while ((removed >> kept) & 1) == 1:
        kept += 1
        if kept == n:
            kept = 0
    # Edges kept .. first survive (vertices kept .. first - 1), then the new one closes the ring.
    count = int(first - kept + 1)
    if count <= 0:
        count += n
    if count + 1 > EDGE_CAPACITY:
        return 3
    k = int(kept)
    for m in range(count):
        for c in range(4):
            work[target + 1 + 4 * m + c] = work[source + 1 + 4 * k + c]
        k += 1
        if k == n:
            k = 0
    at = target + 1 + 4 * count
    work[at] = g[0]
    work[at + 1] = g[1]
    work[at + 2] = g[2]
    work[at + 3] = tag
    work[target] = f64(count + 1)
    return 1


@wp.func
def copy_polygon(work: wp.array[f64], source: int, target: int):
    """Copy the used part of a polygon."""
    n = int(work[source])
    for k in range(1 + 4 * n):
        work[target + k] = work[source + k]


@wp.func
def middle(work: wp.array[f64], polygon: int) -> wp.vec3d:
    """A direction inside the polygon: the mean of its vertices, scaled to sum 1 each."""
    n = int(work[polygon])
    total = wp.vec3d(f64(0.0), f64(0.0), f64(0.0))
    e = edge_cut(work, polygon, 0)
    for k in range(n):
        following = int(k + 1)
        if following == n:
            following = 0
        e_next = edge_cut(work, polygon, following)
        v = wp.cross(e, e_next)
        total += v / (v[0] + v[1] + v[2])
        e = e_next
    return total


@wp.func
def to_integers(w: wp.vec3d) -> wp.vec3d:
    """The direction rounded to integers from 1 to W_SCALE."""
    scale = W_SCALE / wp.max(w[0], wp.max(w[1], w[2]))
    return wp.vec3d(
        wp.max(f64(1.0), wp.floor(w[0] * scale)),
        wp.max(f64(1.0), wp.floor(w[1] * scale)),
        wp.max(f64(1.0), wp.floor(w[2] * scale)),
    )
