"""The shaft test: is every segment from one box to another blocked, proved piece by piece with one occluder each?

All segments from box V to box X cross an axial plane between them inside one rectangle. If an opaque region of that
plane (data/regions.py) covers the rectangle, X is hidden from V: four look-ups in a summed-area table. An oblique
occluder is a disc of opaque triangles with a loop for its outline (data/patches.py): if every segment keeps every edge
of the loop on the same side, the loop winds round it and it must hit the disc; 8 exact orientations an edge decide.

Where no single occluder blocks all of the shaft, the longest side of V or X is halved and both halves must be blocked.
Halving X joins the umbras of several occluders, halving V fuses occluders that are visible past each other. The middle
line of a piece steers: only what it crosses can block the piece, and if it crosses nothing the search ends at once.

All decisions are exact for integer boxes. Source: the umbra of one convex occluder, Chhugani et al. 2005, section 5.2,
without its projection point.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..data.hierarchy import build_hierarchy
from ..data.patches import Patches
from ..data.regions import Regions
from .launch import SlotSizes, run_sliced, triples, vectors
from .sightline import nears, real

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

# Pieces that wait for their turn. A piece is taken before its sibling, so this is the deepest halving.
STACK = wp.constant(72)
# A piece: low and high corners of V and X.
PIECE = wp.constant(12)
# Occluders that blocked last, tried first.
RECENT = wp.constant(8)
# Coordinates are up to 2**24: a half of a product of 51 bits keeps what is left of it exact.
HALF_BITS = wp.constant(wp.float64(2.0**26))
# Padding of node boxes against the rounding of the middle line, which only steers.
NEAR = wp.constant(wp.float64(0.01))


@wp.struct
class Shields:
    """Occluders as Warp arrays: opaque regions of axial planes with their rectangles, and loops of oblique discs."""

    axis: wp.array(dtype=int)
    plane: wp.array(dtype=int)
    places: wp.array2d(dtype=wp.int64)
    u: wp.array(dtype=int)
    v: wp.array(dtype=int)
    open_before: wp.array(dtype=int)
    region: wp.array(dtype=int)
    node_lo: wp.array(dtype=wp.vec3i)
    node_hi: wp.array(dtype=wp.vec3i)
    links: wp.array(dtype=wp.vec2i)
    corners: wp.array(dtype=wp.vec3i)
    starts: wp.array(dtype=int)
    normal: wp.array(dtype=wp.vec3d)
    depth: wp.array(dtype=wp.vec2d)
    patch_lo: wp.array(dtype=wp.vec3i)
    patch_hi: wp.array(dtype=wp.vec3i)
    patch_links: wp.array(dtype=wp.vec2i)


def device_shields(regions: Regions, patches: Patches, device: str = "cpu") -> Shields:
    """Copy occluders to a device."""
    out = Shields()
    for name, values in (
        ("axis", regions.axis),
        ("plane", regions.plane),
        ("u", regions.u),
        ("v", regions.v),
        ("open_before", regions.open_before),
        ("region", regions.region),
        ("starts", patches.starts.astype(np.int32)),
    ):
        setattr(out, name, wp.array(values, dtype=int, device=device))
    out.places = wp.array(regions.places, dtype=wp.int64, device=device)
    nodes = regions.hierarchy
    out.node_lo, out.node_hi = triples(nodes.boxes[:, 0], device), triples(nodes.boxes[:, 1], device)
    out.links = wp.array(nodes.links, dtype=wp.vec2i, device=device)
    out.corners = vectors(patches.corners, device)
    out.normal = wp.array(patches.normal, dtype=wp.vec3d, device=device)
    out.depth = wp.array(patches.depth, dtype=wp.vec2d, device=device)
    nodes = build_hierarchy(patches.boxes)
    out.patch_lo, out.patch_hi = triples(nodes.boxes[:, 0], device), triples(nodes.boxes[:, 1], device)
    out.patch_links = wp.array(nodes.links, dtype=wp.vec2i, device=device)
    return out


@wp.func
def floor_index(values: wp.array(dtype=int), begin: wp.int64, count: int, top: f64, bottom: f64) -> int:
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
def ceil_index(values: wp.array(dtype=int), begin: wp.int64, count: int, top: f64, bottom: f64) -> int:
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
    values: wp.array(dtype=int),
    begin: wp.int64,
    count: int,
    k: f64,
    p: wp.vec2d,
    x: wp.vec2d,
    v_lo: f64,
    v_hi: f64,
    x_lo: f64,
    x_hi: f64,
) -> wp.vec2i:
    """Raster lines around where all segments cross plane k, on one other axis; (-1, -1) if they leave the raster.

    Args:
        values: raster coordinates.
        begin: of this region's.
        count: of them.
        k: the plane.
        p: (near, far) side of V on the plane's axis.
        x: (near, far) side of X on it.
        v_lo: low side of V on the other axis.
        v_hi: high side.
        x_lo: likewise of X.
        x_hi: high side.
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
        first = wp.min(first, floor_index(values, begin, count, v_lo * after + x_lo * before, bottom))
        last = wp.max(last, ceil_index(values, begin, count, v_hi * after + x_hi * before, bottom))
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
def region_blocks(
    shields: Shields, region: int, v_lo: wp.vec3d, v_hi: wp.vec3d, x_lo: wp.vec3d, x_hi: wp.vec3d
) -> bool:
    """Whether a region covers all crossings of segments from V to X with its plane, which must lie between them."""
    axis = shields.axis[region]
    k = f64(shields.plane[region])
    p = wp.vec2d(v_hi[axis], v_lo[axis])
    x = wp.vec2d(x_lo[axis], x_hi[axis])
    if v_lo[axis] >= k:
        p = wp.vec2d(v_lo[axis], v_hi[axis])
        x = wp.vec2d(x_hi[axis], x_lo[axis])
        if x_hi[axis] >= k:
            return False
    elif v_hi[axis] > k or x_lo[axis] <= k:
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
    us = crossing_range(shields.u, shields.places[region, 0], width, k, p, x, v_lo[b], v_hi[b], x_lo[b], x_hi[b])
    if us[0] < 0:
        return False
    vs = crossing_range(shields.v, shields.places[region, 1], height, k, p, x, v_lo[c], v_hi[c], x_lo[c], x_hi[c])
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
def patch_side(shields: Shields, patch: int, v_lo: wp.vec3d, v_hi: wp.vec3d, x_lo: wp.vec3d, x_hi: wp.vec3d) -> int:
    """1 if the disc lies between V and X along its normal, -1 if against it, 0 if neither is certain."""
    n = shields.normal[patch]
    depth = shields.depth[patch]
    # Far above the rounding of three products of coordinates up to 2**24 with a unit vector.
    doubt = f64(1.0e-6)
    if reach(n, v_lo, v_hi, True) <= depth[0] - doubt and reach(n, x_lo, x_hi, False) >= depth[1] + doubt:
        return 1
    if reach(n, v_lo, v_hi, False) >= depth[1] + doubt and reach(n, x_lo, x_hi, True) <= depth[0] - doubt:
        return -1
    return 0


@wp.func
def patch_blocks(shields: Shields, patch: int, v_lo: wp.vec3d, v_hi: wp.vec3d, x_lo: wp.vec3d, x_hi: wp.vec3d) -> bool:
    """Whether every segment from V to X keeps every edge of the loop on the same side, so that it hits the disc."""
    side = patch_side(shields, patch, v_lo, v_hi, x_lo, x_hi)
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
        for corner in range(8):
            x = wp.vec3d(x_lo[0], x_lo[1], x_lo[2])
            for i in range(3):
                if ((corner >> i) & 1) == 1:
                    x[i] = x_hi[i]
            n = wp.cross(a - x, b - x) * f64(side)
            # orient(p, x, a, b) = -(p - x) . n: least where (p - x) . n is greatest.
            p = wp.vec3d()
            for i in range(3):
                p[i] = v_lo[i]
                if n[i] > f64(0.0):
                    p[i] = v_hi[i]
            if product_sign(n, p - x) > 0:
                return False
    return True


@wp.func
def blocks(shields: Shields, item: int, v_lo: wp.vec3d, v_hi: wp.vec3d, x_lo: wp.vec3d, x_hi: wp.vec3d) -> bool:
    """Whether occluder `item` blocks the whole shaft: a region, or -1 - item, a patch."""
    if item >= 0:
        return region_blocks(shields, item, v_lo, v_hi, x_lo, x_hi)
    return patch_blocks(shields, -1 - item, v_lo, v_hi, x_lo, x_hi)


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
def find_blocker(shields: Shields, v_lo: wp.vec3d, v_hi: wp.vec3d, x_lo: wp.vec3d, x_hi: wp.vec3d) -> wp.vec2i:
    """(1, occluder) that blocks the whole shaft; (0, 0) if some only block its middle line; (-1, 0) if none does."""
    p = (v_lo + v_hi) * f64(0.5)
    d = (x_lo + x_hi) * f64(0.5) - p
    met = int(-1)
    tried = int(-1)
    node = int(0)
    count = shields.links.shape[0]
    while node < count:
        link = shields.links[node]
        if nears(p, d, real(shields.node_lo[node]), real(shields.node_hi[node]), NEAR):
            if link[1] >= 0:
                region = shields.region[link[1]]
                met = 0
                # A region's rectangles overlap.
                if region != tried:
                    tried = region
                    if region_blocks(shields, region, v_lo, v_hi, x_lo, x_hi):
                        return wp.vec2i(1, region)
            node += 1
        else:
            node = link[0]
    node = int(0)
    count = shields.patch_links.shape[0]
    while node < count:
        link = shields.patch_links[node]
        if nears(p, d, real(shields.patch_lo[node]), real(shields.patch_hi[node]), NEAR):
            if link[1] >= 0 and winds(shields, link[1], p, d):
                met = 0
                if patch_blocks(shields, link[1], v_lo, v_hi, x_lo, x_hi):
                    return wp.vec2i(1, -1 - link[1])
            node += 1
        else:
            node = link[0]
    return wp.vec2i(met, 0)


@wp.func
def corner_at(frames: wp.array(dtype=int), at: int) -> wp.vec3d:
    """A corner of a stored piece."""
    return wp.vec3d(f64(frames[at]), f64(frames[at + 1]), f64(frames[at + 2]))


@wp.kernel
def _shaft(
    shields: Shields,
    lo: wp.array(dtype=wp.vec3i),
    hi: wp.array(dtype=wp.vec3i),
    rows: wp.array(dtype=wp.vec2i),
    smallest: wp.vec2i,
    cap: int,
    first: int,
    last: int,
    frames: wp.array(dtype=int),
    verdict: wp.array(dtype=wp.uint8),
    nodes_out: wp.array(dtype=int),
    leaves_out: wp.array(dtype=int),
    middle: wp.array2d(dtype=wp.vec3d),
    spots: wp.array(dtype=wp.int64),
    certificate: wp.array2d(dtype=int),
):
    slot = wp.tid()
    slots = frames.shape[0] // (STACK * PIECE + RECENT)
    base = slot * (STACK * PIECE + RECENT)
    recent = base + STACK * PIECE
    row = first + slot
    while row < last:
        pair = rows[row]
        for i in range(3):
            frames[base + i] = lo[pair[0]][i]
            frames[base + 3 + i] = hi[pair[0]][i]
            frames[base + 6 + i] = lo[pair[1]][i]
            frames[base + 9 + i] = hi[pair[1]][i]
        known = int(0)
        newest = int(0)
        nodes = int(0)
        leaves = int(0)
        top = int(0)
        hidden = bool(True)
        while top >= 0:
            at = base + top * PIECE
            v_lo = corner_at(frames, at)
            v_hi = corner_at(frames, at + 3)
            x_lo = corner_at(frames, at + 6)
            x_hi = corner_at(frames, at + 9)
            nodes += 1
            found = wp.vec2i(-1, 0)
            for r in range(known):
                if found[0] < 1 and blocks(shields, frames[recent + r], v_lo, v_hi, x_lo, x_hi):
                    found = wp.vec2i(1, frames[recent + r])
            if found[0] < 1:
                found = find_blocker(shields, v_lo, v_hi, x_lo, x_hi)
                if found[0] == 1:
                    frames[recent + newest] = found[1]
                    newest = (newest + 1) % RECENT
                    known = wp.min(known + 1, RECENT)
            if found[0] == 1:
                if certificate.shape[0] > 0:
                    out = int(spots[row]) + leaves
                    certificate[out, 0] = found[1]
                    for i in range(12):
                        certificate[out, 1 + i] = frames[at + i]
                leaves += 1
                top -= 1
            else:
                widest = int(-1)
                length = int(0)
                for s in range(6):
                    low = s
                    least = smallest[0]
                    if s >= 3:
                        low = s + 3
                        least = smallest[1]
                    size = frames[at + low + 3] - frames[at + low]
                    if size > length and size >= 2 * least:
                        length = size
                        widest = low
                if found[0] < 0 or widest < 0 or nodes >= cap or top + 2 > STACK:
                    hidden = False
                    top = -1
                    middle[row, 0] = (v_lo + v_hi) * f64(0.5)
                    middle[row, 1] = (x_lo + x_hi) * f64(0.5)
                else:
                    for i in range(12):
                        frames[at + PIECE + i] = frames[at + i]
                    halfway = (frames[at + widest] + frames[at + widest + 3]) // 2
                    frames[at + widest] = halfway
                    frames[at + PIECE + widest + 3] = halfway
                    top += 1
        verdict[row] = wp.uint8(0)
        if not hidden:
            verdict[row] = wp.uint8(2)
        nodes_out[row] = nodes
        leaves_out[row] = leaves
        row += slots


@wp.kernel
def _meets(
    shields: Shields,
    origins: wp.array(dtype=wp.vec3d),
    ends: wp.array(dtype=wp.vec3d),
    first: int,
    last: int,
    slots: int,
    meets: wp.array(dtype=wp.uint8),
):
    row = first + wp.tid()
    while row < last:
        p = origins[row]
        d = ends[row] - p
        found = wp.uint8(0)
        node = int(0)
        count = shields.patch_links.shape[0]
        while node < count:
            link = shields.patch_links[node]
            if nears(p, d, real(shields.patch_lo[node]), real(shields.patch_hi[node]), NEAR):
                if link[1] >= 0 and winds(shields, link[1], p, d):
                    found = wp.uint8(1)
                    node = count
                node += 1
            else:
                node = link[0]
        meets[row] = found
        row += slots


def patches_met(
    shields: Shields, origins: np.ndarray, ends: np.ndarray, *, threads: int = 1, device: str = "cpu"
) -> np.ndarray:
    """Whether each segment may meet an oblique occluder: where it does not, no shaft around it can be blocked by one.

    Args:
        shields: occluders on the same device.
        origins: [grid steps], shape (n, 3), float64.
        ends: likewise.
        threads: CPU threads.
        device: Warp device.

    Returns:
        Shape (n,), bool; in rounded arithmetic, for steering only.
    """
    starts, stops = (
        wp.array(np.ascontiguousarray(x, np.float64), dtype=wp.vec3d, device=device) for x in (origins, ends)
    )
    meets = wp.zeros(len(origins), dtype=wp.uint8, device=device)

    def launch(first: int, last: int, slots: int, _values: wp.array, _integers: wp.array) -> None:
        wp.launch(_meets, dim=slots, inputs=[shields, starts, stops, first, last, slots, meets], device=device)

    run_sliced(launch, len(origins), SlotSizes(1, 1), module=__name__, threads=threads, device=device)
    return meets.numpy().astype(bool)


@dataclass
class ShaftAnswers:
    """Answers of the shaft test, one row a pair.

    Attributes:
        verdict: 0 hidden, 2 unknown; uint8.
        nodes: pieces looked at, int32.
        leaves: pieces proved, int32.
        middle: ends of the middle line of the piece that was not proved [grid steps], shape (n, 2, 3), float64; a
            direction to look for a witness in.
        certificate: of the hidden rows, if asked for: (occluder, low and high corner of V', low and high corner of X')
            a leaf, shape (sum of leaves, 13), int32. Occluder r is a region, -1 - p a patch. Empty otherwise.
        starts: leaves of row r are starts[r]:starts[r + 1], shape (n + 1,), int64.
    """

    verdict: np.ndarray
    nodes: np.ndarray
    leaves: np.ndarray
    middle: np.ndarray
    certificate: np.ndarray
    starts: np.ndarray


def launch_shaft(
    shields: Shields,
    boxes: np.ndarray,
    rows: np.ndarray,
    *,
    smallest: tuple[int, int],
    cap: int = 2000,
    certify: bool = False,
    threads: int = 1,
    device: str = "cpu",
) -> ShaftAnswers:
    """Prove that no segment leads from one box to another.

    Args:
        shields: occluders on the same device.
        boxes: [grid steps], shape (m, 2, 3), int32, |coordinate| <= 2**24.
        rows: (view cell, occludee) boxes, shape (n, 2), int.
        smallest: sides of V and of X that are not halved below this [grid steps].
        cap: pieces looked at a pair before the answer is unknown.
        certify: list the leaves of every proof.
        threads: CPU threads; ignored on a GPU.
        device: Warp device.

    Returns:
        Answers. Hidden is exact for eyes outside every solid. Unknown says nothing: the box may be hidden or not.

    Raises:
        InputError: a coordinate beyond the grid, where products of differences are no longer exact.
    """
    count = len(rows)
    low, high = vectors(boxes[:, 0], device), vectors(boxes[:, 1], device)
    spread = wp.vec2i(*smallest)

    def run(rows: np.ndarray, spots: np.ndarray, leaves: int) -> tuple[list[wp.array], wp.array]:
        pairs = wp.array(np.ascontiguousarray(rows, np.int32), dtype=wp.vec2i, device=device)
        verdict = wp.zeros(len(rows), dtype=wp.uint8, device=device)
        nodes, proved = (wp.zeros(len(rows), dtype=int, device=device) for _ in range(2))
        middle = wp.zeros((len(rows), 2), dtype=wp.vec3d, device=device)
        places = wp.array(spots, dtype=wp.int64, device=device)
        certificate = wp.zeros((leaves, 13), dtype=int, device=device)
        outputs = [verdict, nodes, proved, middle]

        def launch(first: int, last: int, slots: int, _values: wp.array, frames: wp.array) -> None:
            inputs = [shields, low, high, pairs, spread, cap, first, last, frames, *outputs, places, certificate]
            wp.launch(_shaft, dim=slots, inputs=inputs, device=device)

        sizes = SlotSizes(1, int(STACK) * int(PIECE) + int(RECENT))
        run_sliced(launch, len(rows), sizes, module=__name__, threads=threads, device=device)
        return [output.numpy() for output in outputs], certificate

    (verdict, nodes, leaves, middle), _ = run(rows, np.zeros(count, np.int64), 0)
    starts = np.zeros(count + 1, np.int64)
    certificate = np.zeros((0, 13), np.int32)
    if certify:
        proved = np.flatnonzero(verdict == 0)
        np.cumsum(np.where(verdict == 0, leaves, 0), out=starts[1:])
        # The leaves are counted first and written by a second run: nothing is shared between threads.
        certificate = run(rows[proved], starts[proved], int(starts[-1]))[1].numpy()
    return ShaftAnswers(verdict, nodes, leaves, middle, certificate, starts)
