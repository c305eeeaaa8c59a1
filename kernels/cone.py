"""Cones of directions from an eye: planes through it, narrowed by portals, and boxes that lie outside.

All points are relative to the eye, in grid steps. Coordinates of a model are integers, so the differences are right to
one rounding, however far the model is from its origin. Each test is loosened by `slack` and by SWAY of the distance,
which is more than rounding can amount to (see THIN): a cone holds all that can be seen, and a little more.

Source: Funkhouser et al. 1996, section 4.2.1 (eye-to-cell visibility by half-spaces through the eye).
"""

import warp as wp

from .graph import DeviceGraph

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

# Planes of a cone. A polygon with more edges gives up the rest of them: the cone is larger then, never smaller.
PLANES = wp.constant(12)
CONE_SIZE = wp.constant(3 * PLANES)
# Each plane that cuts a rectangle adds one corner at most.
CORNERS = wp.constant(4 + PLANES)
POLYGON_SIZE = wp.constant(3 * CORNERS)
# An edge from a to b of a portal that lies at most r from the eye gives a plane if |a x b| > THIN r max(|a|, |b|).
# Corners are off by at most 6 roundings of r, so its normal sways by less than 2**-53 (6 + 3) / THIN < SWAY.
THIN = wp.constant(wp.float64(1.0e-8))
SWAY = wp.constant(wp.float64(1.0e-7))


@wp.func
def norm_bound(p: wp.vec3d) -> f64:
    """At least the length."""
    return wp.abs(p[0]) + wp.abs(p[1]) + wp.abs(p[2])


@wp.func
def put(work: wp.array[f64], at: int, p: wp.vec3d):
    """Store a vector."""
    work[at] = p[0]
    work[at + 1] = p[1]
    work[at + 2] = p[2]


@wp.func
def get(work: wp.array[f64], at: int) -> wp.vec3d:
    """Fetch a vector."""
    return wp.vec3d(work[at], work[at + 1], work[at + 2])


@wp.func
def screen_cone(work: wp.array[f64], cone: int, axes: wp.mat33d, rectangle: wp.vec4d) -> int:
    """The cone through a rectangle (low x, low y, high x, high y) of the image plane at distance 1; its planes."""
    for side in range(5):
        n = wp.vec3d(f64(0.0), f64(0.0), f64(1.0))
        if side < 2:
            n = wp.vec3d(f64(1.0), f64(0.0), -rectangle[0])
            if side == 1:
                n = wp.vec3d(-f64(1.0), f64(0.0), rectangle[2])
        elif side < 4:
            n = wp.vec3d(f64(0.0), f64(1.0), -rectangle[1])
            if side == 3:
                n = wp.vec3d(f64(0.0), -f64(1.0), rectangle[3])
        put(work, cone + 3 * side, wp.normalize(wp.transpose(axes) * n))
    return 5


@wp.func
def misses_box(work: wp.array[f64], cone: int, planes: int, lo: wp.vec3d, hi: wp.vec3d, slack: f64) -> bool:
    """Whether a closed box lies wholly outside one plane of a cone."""
    reach = wp.vec3d()
    for i in range(3):
        reach[i] = wp.max(wp.abs(lo[i]), wp.abs(hi[i]))
    loose = slack + SWAY * norm_bound(reach)
    for k in range(planes):
        n = get(work, cone + 3 * k)
        most = f64(0.0)
        for i in range(3):
            most += wp.max(n[i] * lo[i], n[i] * hi[i])
        if most < -loose:
            return True
    return False


@wp.func
def portal_corner(lo: wp.vec3d, hi: wp.vec3d, axis: int, number: int) -> wp.vec3d:
    """Corners 0 to 3 of a flat box, anticlockwise as seen from the high side."""
    out = wp.vec3d(lo[0], lo[1], lo[2])
    if number == 1 or number == 2:
        out[(axis + 1) % 3] = hi[(axis + 1) % 3]
    if number > 1:
        out[(axis + 2) % 3] = hi[(axis + 2) % 3]
    return out


@wp.func
def cut(work: wp.array[f64], polygon: int, count: int, target: int, n: wp.vec3d, loose: f64) -> int:
    """What of a polygon lies inside a plane, or at most `loose` outside, goes to `target`; its corners."""
    kept = int(0)
    for k in range(count):
        p = get(work, polygon + 3 * k)
        q = get(work, polygon + 3 * ((k + 1) % count))
        here = wp.dot(n, p) + loose
        there = wp.dot(n, q) + loose
        if here >= f64(0.0) and kept < CORNERS:
            put(work, target + 3 * kept, p)
            kept += 1
        if (here > f64(0.0) and there < f64(0.0)) or (here < f64(0.0) and there > f64(0.0)):
            if kept < CORNERS:
                put(work, target + 3 * kept, p + (q - p) * (here / (here - there)))
                kept += 1
    return kept


@wp.func
def portal_in_cone(
    work: wp.array[f64], cone: int, planes: int, lo: wp.vec3d, hi: wp.vec3d, axis: int, spare: int, slack: f64
) -> wp.vec2i:
    """Corners of the part of a portal that a cone holds, and where they are: one of two polygons at `spare`."""
    polygon = int(spare)
    target = int(spare + POLYGON_SIZE)
    reach = wp.vec3d()
    for i in range(3):
        reach[i] = wp.max(wp.abs(lo[i]), wp.abs(hi[i]))
    loose = slack + SWAY * norm_bound(reach)
    for k in range(4):
        put(work, polygon + 3 * k, portal_corner(lo, hi, axis, k))
    count = int(4)
    for k in range(planes):
        if count > 0:
            count = cut(work, polygon, count, target, get(work, cone + 3 * k), loose)
            other = int(polygon)
            polygon = target
            target = other
    return wp.vec2i(count, polygon)


@wp.func
def polygon_cone(work: wp.array[f64], polygon: int, count: int, turn: f64, reach: f64, cone: int) -> int:
    """The cone through a polygon that runs anticlockwise (turn 1) or clockwise (-1) as seen from the eye."""
    planes = int(0)
    for k in range(count):
        a = get(work, polygon + 3 * k)
        b = get(work, polygon + 3 * ((k + 1) % count))
        n = wp.cross(a, b) * turn
        size = wp.length(n)
        if planes < PLANES and size > THIN * reach * wp.max(wp.length(a), wp.length(b)):
            put(work, cone + 3 * planes, n / size)
            planes += 1
    return planes


@wp.func
def side_of(graph: DeviceGraph, entry: wp.vec4i, eye: wp.vec3d) -> int:
    """Whether rays from the eye leave the entry's cell through its portal: 1, 0 if the eye is in its plane, else -1."""
    ahead = f64(graph.portal_lo[entry[0]][entry[2]]) - eye[entry[2]]
    if ahead == f64(0.0):
        return 0
    if (ahead > f64(0.0)) == ((entry[3] & 1) == 1):
        return 1
    return -1


@wp.func
def edge_on(work: wp.array[f64], cone: int, planes: int, axis: int, narrow: int) -> int:
    """The part of a cone in the plane through the eye across an axis: as much as rays along a portal can leave by."""
    count = wp.min(planes, PLANES - 2)
    for k in range(count):
        put(work, narrow + 3 * k, get(work, cone + 3 * k))
    n = wp.vec3d()
    n[axis] = f64(1.0)
    put(work, narrow + 3 * count, n)
    put(work, narrow + 3 * count + 3, -n)
    return count + 2


@wp.func
def narrow_cone(
    graph: DeviceGraph,
    entry: wp.vec4i,
    eye: wp.vec3d,
    slack: f64,
    work: wp.array[f64],
    cone: int,
    planes: int,
    spare: int,
    narrow: int,
) -> int:
    """Writes what of a cone goes on through a portal to `narrow`; its planes, or -1 if nothing does."""
    side = side_of(graph, entry, eye)
    if side < 0:
        return -1
    axis = entry[2]
    lo = wp.vec3d()
    hi = wp.vec3d()
    reach = wp.vec3d()
    for i in range(3):
        lo[i] = f64(graph.portal_lo[entry[0]][i]) - eye[i]
        hi[i] = f64(graph.portal_hi[entry[0]][i]) - eye[i]
        reach[i] = wp.max(wp.abs(lo[i]), wp.abs(hi[i]))
    left = portal_in_cone(work, cone, planes, lo, hi, axis, spare, slack)
    if left[0] < 1 or (side > 0 and left[0] < 3):
        return -1
    if side == 0:
        # An eye within the portal is in both its cells, and looks from both.
        return edge_on(work, cone, planes, axis, narrow)
    turn = f64(1.0)
    if (entry[3] & 1) == 0:
        turn = -f64(1.0)
    return polygon_cone(work, left[1], left[0], turn, wp.length(reach), narrow)
