"""Occluders on a device, and whether one of them blocks a whole shaft: all segments from box V to box X.

The segments cross an axial plane between V and X inside one rectangle. If an opaque region of that plane
(data/regions.py) covers the rectangle, X is hidden from V: four look-ups in a summed-area table. An oblique occluder is
a disc of opaque triangles with a loop for its outline (data/patches.py): if every segment keeps every edge of the loop
on the same side, the loop winds round it and it must hit the disc; 8 exact orientations per edge decide.

All decisions are exact for integer boxes. Source: the umbra of one convex occluder, Chhugani et al. 2005, section 5.2,
without its projection point.
"""

import warp as wp

from ..data.patches import Patches
from ..data.regions import Regions
from .hierarchy import Node, build_hierarchy, inverse, item_of, nears, real, skip_of
from .launch import CPU, Device

f64 = wp.float64

# Coordinates are up to 2**24: a half of a product of 51 bits keeps what is left of it exact.
HALF_BITS = wp.constant(wp.float64(2.0**26))
# Padding of node boxes against the rounding of the middle line, which only steers.
NEAR = wp.constant(wp.float64(0.01))


@wp.struct
class Shields:
    """Occluders as Warp arrays: opaque regions of axial planes with their rectangles, and loops of oblique discs."""

    axis: wp.array[int]
    plane: wp.array[int]
    places: wp.array2d[wp.int64]
    u: wp.array[int]
    v: wp.array[int]
    open_before: wp.array[int]
    region: wp.array[int]
    nodes: wp.array[Node]
    corners: wp.array[wp.vec3i]
    starts: wp.array[int]
    normal: wp.array[wp.vec3d]
    depth: wp.array[wp.vec2d]
    patch_nodes: wp.array[Node]


def device_shields(regions: Regions, patches: Patches, device: Device = CPU) -> Shields:
    """Copy occluders to a device."""
    names = ("axis", "plane", "places", "u", "v", "open_before", "region")
    return device.struct(
        Shields,
        **{name: getattr(regions, name) for name in names},
        nodes=build_hierarchy(regions.boxes).nodes,
        corners=device.corners(patches.corners),
        starts=patches.starts,
        normal=patches.normal,
        depth=patches.depth,
        patch_nodes=build_hierarchy(patches.boxes).nodes,
    )


@wp.struct
class Shaft:
    """All segments from box V to box X."""

    v_lo: wp.vec3d
    v_hi: wp.vec3d
    x_lo: wp.vec3d
    x_hi: wp.vec3d


@wp.func
def floor_index(values: wp.array[int], begin: wp.int64, count: int, top: f64, bottom: f64) -> int:
    """Last place whose value is at most top / bottom (bottom > 0), or -1; exact."""
    low = int(-1)
    high = int(count)
    while high - low > 1:
        middle = (low + high) // 2
        if f64(values[begin + wp.int64(middle)]) * bottom <= top:
            low = middle
        else:
            high = middle
    return low


@wp.func
def ceil_index(values: wp.array[int], begin: wp.int64, count: int, top: f64, bottom: f64) -> int:
    """First place whose value is at least top / bottom (bottom > 0), or count; exact."""
    low = int(-1)
    high = int(count)
    while high - low > 1:
        middle = (low + high) // 2
        if f64(values[begin + wp.int64(middle)]) * bottom >= top:
            high = middle
        else:
            low = middle
    return high


@wp.func
def crossing_range(
    values: wp.array[int], begin: wp.int64, count: int, k: f64, p: wp.vec2d, x: wp.vec2d, shaft: Shaft, b: int
) -> wp.vec2i:
    """Raster lines around where all segments cross plane k, on one other axis; (-1, -1) if they leave the raster.

    Args:
        values: raster coordinates.
        begin: of this region's.
        count: of them.
        k: the plane.
        p: (near, far) side of V on the plane's axis.
        x: (near, far) side of X on it.
        shaft: the segments.
        b: the other axis.
    """
    first = int(count)
    last = int(-1)
    for way in range(2):
        # The share of the way at the plane is least from V's near side to X's far side, and greatest the other way.
        start = p[0]
        stop = x[1]
        if way == 1:
            start = p[1]
            stop = x[0]
        bottom = stop - start
        after = stop - k
        before = k - start
        if bottom < f64(0.0):
            bottom = -bottom
            after = -after
            before = -before
        first = wp.min(first, floor_index(values, begin, count, shaft.v_lo[b] * after + shaft.x_lo[b] * before, bottom))
        last = wp.max(last, ceil_index(values, begin, count, shaft.v_hi[b] * after + shaft.x_hi[b] * before, bottom))
    if first < 0 or last >= count:
        return wp.vec2i(-1, -1)
    if first == last:
        # All segments cross on one raster line: covered if the cells on either side are.
        if first == count - 1:
            first -= 1
        else:
            last += 1
    return wp.vec2i(first, last)


@wp.func
def region_blocks(shields: Shields, region: int, shaft: Shaft) -> bool:
    """Whether a region covers all crossings of segments from V to X with its plane, which must lie between them."""
    axis = shields.axis[region]
    k = f64(shields.plane[region])
    p = wp.vec2d(shaft.v_hi[axis], shaft.v_lo[axis])
    x = wp.vec2d(shaft.x_lo[axis], shaft.x_hi[axis])
    if shaft.v_lo[axis] >= k:
        p = wp.vec2d(shaft.v_lo[axis], shaft.v_hi[axis])
        x = wp.vec2d(shaft.x_hi[axis], shaft.x_lo[axis])
        if shaft.x_hi[axis] >= k:
            return False
    elif shaft.v_hi[axis] > k or shaft.x_lo[axis] <= k:
        # A surface on the plane itself is not behind it.
        return False
    b = int(0)
    c = int(1)
    if axis == 0:
        b = 1
    if axis < 2:
        c = 2
    width = int(shields.places[region + 1, 0] - shields.places[region, 0])
    height = int(shields.places[region + 1, 1] - shields.places[region, 1])
    us = crossing_range(shields.u, shields.places[region, 0], width, k, p, x, shaft, b)
    if us[0] < 0:
        return False
    vs = crossing_range(shields.v, shields.places[region, 1], height, k, p, x, shaft, c)
    if vs[0] < 0:
        return False
    at = shields.places[region, 2]
    uncovered = (
        shields.open_before[at + wp.int64(us[1] * height + vs[1])]
        - shields.open_before[at + wp.int64(us[0] * height + vs[1])]
        - shields.open_before[at + wp.int64(us[1] * height + vs[0])]
        + shields.open_before[at + wp.int64(us[0] * height + vs[0])]
    )
    return uncovered == 0


@wp.func
def product_sign(n: wp.vec3d, q: wp.vec3d) -> int:
    """Sign of n . q, exactly, for integers |n_i| <= 2**51 and |q_i| <= 2**25."""
    high = wp.vec3d(wp.round(n[0] / HALF_BITS), wp.round(n[1] / HALF_BITS), wp.round(n[2] / HALF_BITS))
    low = n - high * HALF_BITS
    total = wp.dot(high, q) * HALF_BITS + wp.dot(low, q)
    if total > f64(0.0):
        return 1
    if total < f64(0.0):
        return -1
    return 0


@wp.func
def reach(n: wp.vec3d, lo: wp.vec3d, hi: wp.vec3d, most: bool) -> f64:
    """Greatest, or least, n . x over a box."""
    total = f64(0.0)
    for i in range(3):
        if (n[i] > f64(0.0)) == most:
            total += n[i] * hi[i]
        else:
            total += n[i] * lo[i]
    return total


@wp.func
def patch_side(shields: Shields, patch: int, shaft: Shaft) -> int:
    """1 if the disc lies between V and X along its normal, -1 if against it, 0 if neither is certain."""
    n = shields.normal[patch]
    depth = shields.depth[patch]
    # Far above the rounding of three products of coordinates up to 2**24 with a unit vector.
    doubt = f64(1.0e-6)
    if (
        reach(n, shaft.v_lo, shaft.v_hi, True) <= depth[0] - doubt
        and reach(n, shaft.x_lo, shaft.x_hi, False) >= depth[1] + doubt
    ):
        return 1
    if (
        reach(n, shaft.v_lo, shaft.v_hi, False) >= depth[1] + doubt
        and reach(n, shaft.x_lo, shaft.x_hi, True) <= depth[0] - doubt
    ):
        return -1
    return 0


@wp.func
def keeps_side(shaft: Shaft, a: wp.vec3d, b: wp.vec3d, side: f64) -> bool:
    """Whether every segment of the shaft passes the edge ab on the same side: 8 exact orientations."""
    for corner in range(8):
        x = wp.vec3d(shaft.x_lo[0], shaft.x_lo[1], shaft.x_lo[2])
        for i in range(3):
            if ((corner >> i) & 1) == 1:
                x[i] = shaft.x_hi[i]
        n = wp.cross(a - x, b - x) * side
        # orient(p, x, a, b) = -(p - x) . n: least where (p - x) . n is greatest.
        p = wp.vec3d(shaft.v_lo[0], shaft.v_lo[1], shaft.v_lo[2])
        for i in range(3):
            if n[i] > f64(0.0):
                p[i] = shaft.v_hi[i]
        if product_sign(n, p - x) > 0:
            return False
    return True


@wp.func
def patch_blocks(shields: Shields, patch: int, shaft: Shaft) -> bool:
    """Whether every segment from V to X keeps every edge of the loop on the same side, so that it hits the disc."""
    side = patch_side(shields, patch, shaft)
    if side == 0:
        return False
    begin = shields.starts[patch]
    end = shields.starts[patch + 1]
    for e in range(begin, end):
        following = int(e + 1)
        if following == end:
            following = begin
        a = real(shields.corners[e])
        b = real(shields.corners[following])
        if not keeps_side(shaft, a, b, f64(side)):
            return False
    return True


@wp.func
def blocks(shields: Shields, item: int, shaft: Shaft) -> bool:
    """Whether occluder `item` blocks the whole shaft: a region, or -1 - item, a patch."""
    if item >= 0:
        return region_blocks(shields, item, shaft)
    return patch_blocks(shields, -1 - item, shaft)


@wp.func
def winds(shields: Shields, patch: int, p: wp.vec3d, d: wp.vec3d) -> bool:
    """Whether a line keeps every edge of a loop on one side, in rounded arithmetic; steers only."""
    begin = shields.starts[patch]
    end = shields.starts[patch + 1]
    left = int(0)
    for e in range(begin, end):
        following = int(e + 1)
        if following == end:
            following = begin
        if wp.dot(d, wp.cross(real(shields.corners[e]) - p, real(shields.corners[following]) - p)) >= f64(0.0):
            left += 1
    return left == 0 or left == end - begin


@wp.func
def blocking_region(shields: Shields, shaft: Shaft, p: wp.vec3d, d: wp.vec3d) -> wp.vec2i:
    """(1, region) that blocks the whole shaft; (0, 0) if some are met by its middle line p + d; (-1, 0) if none is."""
    met = int(-1)
    tried = int(-1)
    node = int(0)
    count = shields.nodes.shape[0]
    back = inverse(d)
    while node < count:
        box = shields.nodes[node]
        if nears(p, back, box, NEAR):
            if item_of(box) >= 0:
                region = shields.region[item_of(box)]
                met = 0
                # A region's rectangles overlap.
                if region != tried:
                    tried = region
                    if region_blocks(shields, region, shaft):
                        return wp.vec2i(1, region)
            node += 1
        else:
            node = skip_of(box)
    return wp.vec2i(met, 0)


@wp.func
def next_patch(shields: Shields, start: int, p: wp.vec3d, d: wp.vec3d) -> int:
    """Node, from `start` on, of a patch that the segment p + [0, 1] d may meet; past the last if there is none."""
    node = int(start)
    count = shields.patch_nodes.shape[0]
    back = inverse(d)
    while node < count:
        box = shields.patch_nodes[node]
        if nears(p, back, box, NEAR):
            if item_of(box) >= 0 and winds(shields, item_of(box), p, d):
                return node
            node += 1
        else:
            node = skip_of(box)
    return count


@wp.func
def find_blocker(shields: Shields, shaft: Shaft) -> wp.vec2i:
    """(1, occluder) that blocks the whole shaft; (0, 0) if some only block its middle line; (-1, 0) if none does."""
    p = (shaft.v_lo + shaft.v_hi) * f64(0.5)
    d = (shaft.x_lo + shaft.x_hi) * f64(0.5) - p
    found = blocking_region(shields, shaft, p, d)
    if found[0] == 1:
        return found
    met = found[0]
    node = next_patch(shields, 0, p, d)
    while node < shields.patch_nodes.shape[0]:
        met = 0
        patch = item_of(shields.patch_nodes[node])
        if patch_blocks(shields, patch, shaft):
            return wp.vec2i(1, -1 - patch)
        node = next_patch(shields, node + 1, p, d)
    return wp.vec2i(met, 0)
