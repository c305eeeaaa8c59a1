"""By how much does a sightline clear everything? Distances from segments to triangles, in float64.

A sightline is evidence for people as well: one that clears its surroundings by centimetres is no matter of rounding.
"""

import numpy as np
import warp as wp

wp.set_module_options({"enable_backward": False})

# Objects told of each sightline, the nearest first.
NEAREST = wp.constant(3)


@wp.func
def _point_triangle(p: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d):
    """Squared distance from a point to a triangle (Ericson 2004, Real-Time Collision Detection, section 5.1.5)."""
    zero, one = wp.float64(0.0), wp.float64(1.0)
    ab, ac, ap = b - a, c - a, p - a
    d1, d2 = wp.dot(ab, ap), wp.dot(ac, ap)
    if d1 <= zero and d2 <= zero:
        return wp.dot(ap, ap)
    bp = p - b
    d3, d4 = wp.dot(ab, bp), wp.dot(ac, bp)
    if d3 >= zero and d4 <= d3:
        return wp.dot(bp, bp)
    cp = p - c
    d5, d6 = wp.dot(ab, cp), wp.dot(ac, cp)
    if d6 >= zero and d5 <= d6:
        return wp.dot(cp, cp)
    vc = d1 * d4 - d3 * d2
    if vc <= zero and d1 >= zero and d3 <= zero:
        off = ap - ab * (d1 / (d1 - d3))
        return wp.dot(off, off)
    vb = d5 * d2 - d1 * d6
    if vb <= zero and d2 >= zero and d6 <= zero:
        off = ap - ac * (d2 / (d2 - d6))
        return wp.dot(off, off)
    va = d3 * d6 - d5 * d4
    if va <= zero and d4 - d3 >= zero and d5 - d6 >= zero:
        off = bp - (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)))
        return wp.dot(off, off)
    share = one / (va + vb + vc)
    off = ap - ab * (vb * share) - ac * (vc * share)
    return wp.dot(off, off)


@wp.func
def _segment_segment(p: wp.vec3d, d: wp.vec3d, q: wp.vec3d, e: wp.vec3d):
    """Squared distance between segments p to p + d and q to q + e, both of some length (Ericson 2004, 5.1.9)."""
    zero, one = wp.float64(0.0), wp.float64(1.0)
    r = p - q
    a, b, c, f, g = wp.dot(d, d), wp.dot(d, e), wp.dot(d, r), wp.dot(e, r), wp.dot(e, e)
    denominator = a * g - b * b
    s = zero
    if denominator > zero:
        s = wp.clamp((b * f - c * g) / denominator, zero, one)
    t = (b * s + f) / g
    if t < zero:
        t = zero
        s = wp.clamp(-c / a, zero, one)
    elif t > one:
        t = one
        s = wp.clamp((b - c) / a, zero, one)
    off = r + d * s - e * t
    return wp.dot(off, off)


@wp.kernel
def nearest_objects(
    origins: wp.array[wp.vec3d],
    ends: wp.array[wp.vec3d],
    targets: wp.array[int],
    triangles: wp.array2d[wp.vec3d],
    owners: wp.array[int],
    distances_out: wp.array2d[wp.float64],
    objects_out: wp.array2d[int],
):
    """The NEAREST objects to each segment that are not its target, by squared distance; ascending."""
    row = wp.tid()
    p = origins[row]
    d = ends[row] - p
    middle = p + d * wp.float64(0.5)
    half = wp.length(d) * wp.float64(0.5)
    for place in range(NEAREST):
        distances_out[row, place] = wp.float64(wp.inf)
        objects_out[row, place] = -1
    for k in range(triangles.shape[0]):
        owner = owners[k]
        if owner != targets[row]:
            a, b, c = triangles[k, 0], triangles[k, 1], triangles[k, 2]
            worst = distances_out[row, NEAREST - 1]
            # The triangle is further than the distance of the balls about both.
            gap = wp.length(a - middle) - half - wp.sqrt(wp.max(wp.length_sq(b - a), wp.length_sq(c - a)))
            if gap < wp.float64(0.0) or gap * gap < worst:
                near = wp.min(_point_triangle(p, a, b, c), _point_triangle(p + d, a, b, c))
                near = wp.min(near, _segment_segment(p, d, a, b - a))
                near = wp.min(near, _segment_segment(p, d, b, c - b))
                near = wp.min(near, _segment_segment(p, d, c, a - c))
                if near < worst:
                    # Where the owner stands already, or the last place; then up to where it belongs.
                    slot = int(NEAREST - 1)
                    for place in range(NEAREST):
                        if objects_out[row, place] == owner:
                            slot = place
                    if near < distances_out[row, slot]:
                        while slot > 0 and distances_out[row, slot - 1] > near:
                            distances_out[row, slot] = distances_out[row, slot - 1]
                            objects_out[row, slot] = objects_out[row, slot - 1]
                            slot -= 1
                        distances_out[row, slot] = near
                        objects_out[row, slot] = owner


def clearances(
    origins: np.ndarray, ends: np.ndarray, targets: np.ndarray, triangles: np.ndarray, owners: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """How near each segment comes to the objects about it.

    Args:
        origins: segment starts [grid steps], shape (n, 3), float64.
        ends: segment ends, likewise.
        targets: object that each segment ends at, which does not count; -1 for none; shape (n,).
        triangles: opaque corners [grid steps], shape (m, 3, 3), none degenerate.
        owners: object of each, shape (m,).

    Returns:
        Distances [grid steps], shape (n, 3), ascending, inf where there is no such object; float64, good to about 1e-9
        steps. The objects, shape (n, 3), -1 for none. The segments must be clear: a triangle that one passes through
        counts by its edges.
    """
    count = len(origins)
    distances, objects = np.empty((count, int(NEAREST))), np.empty((count, int(NEAREST)), np.int32)
    points = [wp.array(np.ascontiguousarray(a, np.float64), dtype=wp.vec3d, device="cpu") for a in (origins, ends)]
    own = wp.array(np.ascontiguousarray(targets, np.int32), device="cpu")
    corners = wp.array(np.ascontiguousarray(triangles, np.float64).reshape(-1, 3, 3), dtype=wp.vec3d, device="cpu")
    of = wp.array(np.ascontiguousarray(owners, np.int32), device="cpu")
    out = [wp.array(distances, device="cpu", copy=False), wp.array(objects, device="cpu", copy=False)]
    wp.launch(nearest_objects, count, inputs=[*points, own, corners, of], outputs=out, device="cpu")
    return np.sqrt(distances), objects
