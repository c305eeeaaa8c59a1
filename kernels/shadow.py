"""Umbras of outlines over box-shaped view cells, and what is left of each occluder when seen from one point.

Chhugani et al. 2005, section 5.2. Through each edge of an outline and a vertex of the cell runs a supporting plane:
cell and occluder lie on one side. The points beyond the occluder and on the inner side of all these planes are its
umbra. The paper's shrunk occluder for a projection point v is the part q of the occluder with q - v parallel to the
umbra's cone: all that lies behind it as seen from v is in the umbra.

The outlines are those of `data.patches`, whose theorem proves the umbra without asking for flatness: x is hidden if
every line from the cell to x has every edge on its left. Seen along an edge the cell spans an angle; its two ends give
two planes, the supporting plane and, on the other side, the separating plane, which binds for bent outlines only. Both
are found in integers and exactly; their float64 coefficients are then moved inwards by more than all rounding.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..data.errors import InputError
from ..data.patches import LIMIT, Patches
from .launch import SlotSizes, run_sliced, vectors

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64
i64 = wp.int64

# Status of a pair.
USABLE, STRADDLES, TOUCHES, BENT = range(4)
_STRADDLES, _TOUCHES, _BENT = wp.constant(STRADDLES), wp.constant(TOUCHES), wp.constant(BENT)
# Coordinates are below 2**24, so a product normal . point of three terms is off by 1e-8 at most.
HEIGHT_SLACK = wp.constant(wp.float64(2.0**-24))
# Unit normals are off by 5 * 2**-53 a component and points lie 2**25 apart: 1e-7 with the product itself.
PLANE_SLACK = wp.constant(wp.float64(2.0**-20))
# Clipping adds some 1e-7 a plane, and a polygon has 20 or so.
CLIP_SLACK = wp.constant(wp.float64(2.0**-14))
# Corners nearer than this to the last one are dropped, which only shrinks the polygon.
LEAST_SIDE = wp.constant(wp.float64(2.0**-10))
# A projection point nearer than this to the occluder's plane sees nothing of it.
LEAST_HEIGHT = wp.constant(wp.float64(2.0**-6))
# A hole grows by the inverse of the cell's distance from its plane, which must be known well enough.
LEAST_GAP = wp.constant(wp.float64(1.0))
# Holes are cut in planes; no outline with integer corners is flatter than this and not flat.
FLATNESS = wp.constant(wp.float64(2.0**-21))
LOW_BITS = wp.constant(wp.int64(26))
LOW_MASK = wp.constant(wp.int64(2**26 - 1))


@dataclass
class Umbras:
    """Umbras of pairs (cell, outline): points x with `normal . x >= far`, `planes` and `limits` satisfied.

    Attributes:
        status: USABLE; STRADDLES (the cell reaches across the occluder along its normal, or touches its oblique plane);
            TOUCHES (the cell touches the occluder's axial plane outside the outline: the umbra is empty); BENT (the
            cell lies all round an edge). Shape (k,), int32.
        normal: unit normal that points away from the cell, shape (k, 3).
        far: bound on normal . x beyond the whole occluder, shape (k,).
        starts: edges of pair i are starts[i]:starts[i + 1], in the order of the outline's edges; shape (k + 1,), int64.
        planes: supporting plane of each edge, rows (m, c): m . x >= c; m of unit length, shape (edges, 4).
        limits: separating plane of each edge, likewise.
        rho: by how much the umbra grows at the edge per unit of depth, -inf where it is empty; not rounded to a side.
        centre: of the occluder's bounding box [grid steps], shape (k, 3).
        radius: of the sphere about the centre that holds the occluder, shape (k,).
    """

    status: np.ndarray
    normal: np.ndarray
    far: np.ndarray
    starts: np.ndarray
    planes: np.ndarray
    limits: np.ndarray
    rho: np.ndarray
    centre: np.ndarray
    radius: np.ndarray

    def contains(self, pair: int, points: np.ndarray) -> np.ndarray:
        """Whether points [grid steps], shape (n, 3), lie in the umbra of one pair; false where rounding may matter."""
        if self.status[pair] != USABLE:
            return np.zeros(len(points), bool)
        rows = slice(self.starts[pair], self.starts[pair + 1])
        inside = points @ self.normal[pair] >= self.far[pair]
        for plane in np.concatenate([self.planes[rows], self.limits[rows]]):
            inside &= points @ plane[:3] >= plane[3]
        return inside


@wp.func
def dot_sign(m: wp.vec3l, x: wp.vec3l) -> int:
    """Exact sign of m . x for |m| <= 2**51 and |x| <= 2**25."""
    high = (m[0] >> LOW_BITS) * x[0] + (m[1] >> LOW_BITS) * x[1] + (m[2] >> LOW_BITS) * x[2]
    low = (m[0] & LOW_MASK) * x[0] + (m[1] & LOW_MASK) * x[1] + (m[2] & LOW_MASK) * x[2]
    high += low >> LOW_BITS
    low = low & LOW_MASK
    if high > i64(0) or (high == i64(0) and low > i64(0)):
        return 1
    if high < i64(0):
        return -1
    return 0


@wp.func
def box_corner(low: wp.vec3i, high: wp.vec3i, i: int) -> wp.vec3l:
    """Corner i of a box; bit k of i picks the high side of axis k."""
    out = wp.vec3l()
    for k in range(3):
        out[k] = i64(low[k])
        if ((i >> k) & 1) == 1:
            out[k] = i64(high[k])
    return out


@wp.func
def as_double(v: wp.vec3l) -> wp.vec3d:
    """The vector in float64."""
    return wp.vec3d(f64(v[0]), f64(v[1]), f64(v[2]))


@wp.func
def wide(v: wp.vec3i) -> wp.vec3l:
    """The vector in int64."""
    return wp.vec3l(i64(v[0]), i64(v[1]), i64(v[2]))


@wp.func
def extreme_corner(low: wp.vec3i, high: wp.vec3i, a: wp.vec3l, d: wp.vec3l, turn: int) -> int:
    """Corner of the box farthest round the edge at a along d, clockwise for turn 1; -1 if the box lies all round it.

    The plane of edge and corner p is d x (p - a); all other corners are on its positive side (turn 1) or negative side.
    """
    best = int(-1)
    plane = wp.vec3l()
    # The second round matters where corners lie at opposite angles, which a first comparison cannot order.
    for k in range(16):
        to = box_corner(low, high, k % 8) - a
        if best < 0 or dot_sign(plane, to) * turn < 0:
            through = wp.cross(d, to)
            if through[0] != i64(0) or through[1] != i64(0) or through[2] != i64(0):
                best = k % 8
                plane = through
    for k in range(8):
        if dot_sign(plane, box_corner(low, high, k) - a) * turn < 0:
            return -1
    return best


@wp.func
def edge_plane(low: wp.vec3i, high: wp.vec3i, a: wp.vec3l, d: wp.vec3l, corner: int) -> wp.vec4d:
    """Unit plane (m, c) through the edge and a corner of the box, moved inwards beyond its rounding."""
    m = wp.normalize(as_double(wp.cross(d, box_corner(low, high, corner) - a)))
    return wp.vec4d(m[0], m[1], m[2], wp.dot(m, as_double(a)) + PLANE_SLACK)


@wp.func
def heights(low: wp.vec3i, high: wp.vec3i, normal: wp.vec3d) -> wp.vec2d:
    """Least and greatest normal . x over a box, rounded outwards; exact for axial normals."""
    least = f64(0.0)
    most = f64(0.0)
    terms = int(0)
    for k in range(3):
        least += wp.min(normal[k] * f64(low[k]), normal[k] * f64(high[k]))
        most += wp.max(normal[k] * f64(low[k]), normal[k] * f64(high[k]))
        if normal[k] != f64(0.0):
            terms += 1
    if terms > 1:
        least -= HEIGHT_SLACK
        most += HEIGHT_SLACK
    return wp.vec2d(least, most)


@wp.struct
class Outlines:
    """`data.patches.Patches` on a device."""

    corners: wp.array(dtype=wp.vec3i)
    starts: wp.array(dtype=wp.int64)
    normal: wp.array(dtype=wp.vec3d)
    depth: wp.array(dtype=wp.vec2d)


@wp.kernel
def _umbra(
    box_low: wp.array(dtype=wp.vec3i),
    box_high: wp.array(dtype=wp.vec3i),
    outlines: Outlines,
    pairs: wp.array(dtype=wp.vec2i),
    starts: wp.array(dtype=wp.int64),
    first: int,
    last: int,
    slots: int,
    status_out: wp.array(dtype=int),
    normal_out: wp.array(dtype=wp.vec3d),
    far_out: wp.array(dtype=f64),
    planes_out: wp.array(dtype=wp.vec4d),
    limits_out: wp.array(dtype=wp.vec4d),
    rho_out: wp.array(dtype=f64),
):
    row = first + wp.tid()
    while row < last:
        low = box_low[pairs[row][0]]
        high = box_high[pairs[row][0]]
        loop = pairs[row][1]
        normal = outlines.normal[loop]
        depth = outlines.depth[loop]
        reach = heights(low, high, normal)
        status = int(0)
        side = int(1)
        if reach[1] > depth[0]:
            side = -1
            normal = -normal
            depth = wp.vec2d(-depth[1], -depth[0])
            if -reach[0] > depth[0]:
                status = _STRADDLES
        count = int(outlines.starts[loop + 1] - outlines.starts[loop])
        for e in range(count):
            at = starts[row] + i64(e)
            a = wide(outlines.corners[outlines.starts[loop] + i64(e)])
            d = (wide(outlines.corners[outlines.starts[loop] + i64((e + 1) % count)]) - a) * i64(side)
            if status == 0:
                near = extreme_corner(low, high, a, d, 1)
                far = extreme_corner(low, high, a, d, -1)
                if near < 0 or far < 0:
                    status = _BENT
                else:
                    plane = edge_plane(low, high, a, d, near)
                    planes_out[at] = plane
                    limits_out[at] = edge_plane(low, high, a, d, far)
                    m = wp.vec3d(plane[0], plane[1], plane[2])
                    inward = wp.normalize(wp.cross(normal, as_double(d)))
                    rho_out[at] = wp.dot(m, normal) / wp.dot(m, inward)
                    if wp.dot(normal, as_double(box_corner(low, high, near))) >= depth[0]:
                        rho_out[at] = f64(-wp.inf)
                        status = _TOUCHES
        status_out[row] = status
        normal_out[row] = normal
        far_out[row] = depth[1] + HEIGHT_SLACK
        row += slots


@wp.func
def clip(scratch: wp.array(dtype=f64), begin: int, end: int, count: int, a: f64, b: f64, c: f64) -> int:
    """Clip the polygon (x, y) of `count` corners at scratch[begin:] to a x + b y >= c, into scratch[end:]."""
    kept = int(0)
    for i in range(count):
        j = (i + 1) % count
        x = scratch[begin + 2 * i]
        y = scratch[begin + 2 * i + 1]
        s = scratch[begin + 2 * j]
        t = scratch[begin + 2 * j + 1]
        here = a * x + b * y - c
        there = a * s + b * t - c
        if here >= f64(0.0):
            scratch[end + 2 * kept] = x
            scratch[end + 2 * kept + 1] = y
            kept += 1
        if (here >= f64(0.0)) != (there >= f64(0.0)):
            share = here / (here - there)
            scratch[end + 2 * kept] = x + share * (s - x)
            scratch[end + 2 * kept + 1] = y + share * (t - y)
            kept += 1
    return kept


@wp.func
def start_square(scratch: wp.array(dtype=f64), begin: int, half: f64) -> int:
    """Write the square of half side `half`, counter-clockwise; returns its number of corners."""
    for i in range(4):
        scratch[begin + 2 * i] = wp.where(i == 0 or i == 3, -half, half)
        scratch[begin + 2 * i + 1] = wp.where(i < 2, -half, half)
    return 4


@wp.func
def first_axis(normal: wp.vec3d) -> wp.vec3d:
    """Unit vector in the plane of a normal; an axis if the normal is one. The second is normal x first."""
    least = int(0)
    for k in range(1, 3):
        if wp.abs(normal[k]) < wp.abs(normal[least]):
            least = k
    axis = wp.vec3d()
    axis[least] = f64(1.0)
    return wp.normalize(axis - normal * normal[least])


@wp.func
def write_polygon(
    scratch: wp.array(dtype=f64),
    begin: int,
    count: int,
    centre: wp.vec3d,
    e: wp.vec3d,
    g: wp.vec3d,
    least_side: f64,
    out: wp.array(dtype=wp.vec3d),
    at: wp.int64,
) -> int:
    """Write the polygon in space without sides of `least_side` or less; returns its corners, 0 if fewer than three."""
    kept = int(0)
    for i in range(count):
        x = scratch[begin + 2 * i]
        y = scratch[begin + 2 * i + 1]
        j = (i + 1) % count
        if wp.abs(scratch[begin + 2 * j] - x) + wp.abs(scratch[begin + 2 * j + 1] - y) > least_side:
            out[at + i64(kept)] = centre + e * x + g * y
            kept += 1
    return wp.where(kept < 3, 0, kept)


@wp.struct
class DeviceUmbras:
    """`Umbras` on a device."""

    status: wp.array(dtype=int)
    normal: wp.array(dtype=wp.vec3d)
    far: wp.array(dtype=f64)
    starts: wp.array(dtype=wp.int64)
    planes: wp.array(dtype=wp.vec4d)
    limits: wp.array(dtype=wp.vec4d)
    centre: wp.array(dtype=wp.vec3d)
    radius: wp.array(dtype=f64)


@wp.kernel
def _shrink(
    umbras: DeviceUmbras,
    rows: wp.array(dtype=int),
    points: wp.array(dtype=wp.vec3d),
    depths: wp.array(dtype=f64),
    spots: wp.array(dtype=wp.int64),
    most: int,
    scratch: wp.array(dtype=f64),
    first: int,
    last: int,
    slots: int,
    count_out: wp.array(dtype=int),
    corners_out: wp.array(dtype=wp.vec3d),
):
    row = first + wp.tid()
    while row < last:
        pair = rows[row]
        v = points[row]
        normal = umbras.normal[pair]
        height = umbras.far[pair] - wp.dot(normal, v)
        count = int(0)
        if umbras.status[pair] == 0 and height >= LEAST_HEIGHT:
            e = first_axis(normal)
            g = wp.cross(normal, e)
            centre = umbras.centre[pair]
            centre += normal * (umbras.far[pair] - wp.dot(normal, centre))
            begin = int(wp.tid() * 4 * most)
            end = int(begin + 2 * most)
            count = start_square(scratch, begin, f64(2.0) * umbras.radius[pair])
            share = f64(1.0)
            if depths[row] < f64(wp.inf):
                share = depths[row] / (depths[row] + height)
            edges = int(umbras.starts[pair + 1] - umbras.starts[pair])
            for k in range(2 * edges):
                plane = umbras.planes[umbras.starts[pair] + i64(k % edges)]
                if k >= edges:
                    plane = umbras.limits[umbras.starts[pair] + i64(k % edges)]
                m = wp.vec3d(plane[0], plane[1], plane[2])
                bound = plane[3] + share * wp.max(f64(0.0), wp.dot(m, v) - plane[3]) + CLIP_SLACK
                count = clip(scratch, begin, end, count, wp.dot(m, e), wp.dot(m, g), bound - wp.dot(m, centre))
                swap = begin
                begin = end
                end = swap
            count = write_polygon(scratch, begin, count, centre, e, g, LEAST_SIDE, corners_out, spots[row])
        count_out[row] = count
        row += slots


@wp.kernel
def _grow_hole(
    box_low: wp.array(dtype=wp.vec3i),
    box_high: wp.array(dtype=wp.vec3i),
    outlines: Outlines,
    pairs: wp.array(dtype=wp.vec2i),
    points: wp.array(dtype=wp.vec3d),
    spots: wp.array(dtype=wp.int64),
    most: int,
    scratch: wp.array(dtype=f64),
    first: int,
    last: int,
    slots: int,
    status_out: wp.array(dtype=int),
    count_out: wp.array(dtype=int),
    corners_out: wp.array(dtype=wp.vec3d),
):
    row = first + wp.tid()
    while row < last:
        low = box_low[pairs[row][0]]
        high = box_high[pairs[row][0]]
        loop = pairs[row][1]
        v = points[row]
        normal = outlines.normal[loop]
        depth = outlines.depth[loop]
        reach = heights(low, high, normal)
        if reach[1] >= depth[0]:
            normal = -normal
            depth = wp.vec2d(-depth[1], -depth[0])
            reach = wp.vec2d(-reach[1], -reach[0])
        gap = depth[0] - reach[1]
        level = depth[1] + HEIGHT_SLACK
        height = level - wp.dot(normal, v)
        status = int(0)
        if gap < LEAST_GAP or height < LEAST_HEIGHT:
            status = _STRADDLES
        elif depth[1] - depth[0] > FLATNESS:
            status = _BENT
        count = int(0)
        if status == 0:
            corners = int(outlines.starts[loop + 1] - outlines.starts[loop])
            e = first_axis(normal)
            g = wp.cross(normal, e)
            centre = as_double(wide(outlines.corners[outlines.starts[loop]]))
            centre += normal * (level - wp.dot(normal, centre))
            begin = int(wp.tid() * 4 * most)
            end = int(begin + 2 * most)
            for side in range(corners + 8):
                # Directions: the outline's own sides, then the four of the plane's axes and the four between them.
                x = f64(wp.where(side % 8 < 3 or side % 8 == 7, 1, -1))
                y = f64(wp.where(side % 8 < 4, 1, -1))
                if side % 2 == 0:
                    x = wp.where(side % 4 == 0, f64(wp.where(side % 8 == 0, 1, -1)), f64(0.0))
                    y = wp.where(side % 4 == 2, f64(wp.where(side % 8 == 2, 1, -1)), f64(0.0))
                if side >= 8:
                    a = wide(outlines.corners[outlines.starts[loop] + i64(side - 8)])
                    d = wide(outlines.corners[outlines.starts[loop] + i64((side - 7) % corners)]) - a
                    x = wp.dot(as_double(d), g)
                    y = -wp.dot(as_double(d), e)
                    if wp.dot(normal, outlines.normal[loop]) < f64(0.0):
                        x = -x
                        y = -y
                across = wp.normalize(e * x + g * y)
                reached = f64(-1.0e300)
                size = f64(0.0)
                for k in range(corners):
                    w = as_double(wide(outlines.corners[outlines.starts[loop] + i64(k)]))
                    reached = wp.max(reached, wp.dot(across, w - centre))
                    for c in range(8):
                        p = as_double(box_corner(low, high, c))
                        grown = v + (w - p) * (height / (level - wp.dot(normal, p))) - centre
                        reached = wp.max(reached, wp.dot(across, grown))
                        size = wp.max(size, wp.max(wp.length(grown), wp.length(w - p)))
                if side == 0:
                    count = start_square(scratch, begin, f64(2.0) * (size + wp.length(v - centre) + f64(1.0)))
                reached += CLIP_SLACK + f64(8.0) * HEIGHT_SLACK * size / gap
                x = wp.dot(across, e)
                y = wp.dot(across, g)
                count = clip(scratch, begin, end, count, -x, -y, -reached)
                swap = begin
                begin = end
                end = swap
            count = write_polygon(scratch, begin, count, centre, e, g, f64(-1.0), corners_out, spots[row])
        status_out[row] = status
        count_out[row] = count
        row += slots


@dataclass
class Polygons:
    """Convex polygons in space, counter-clockwise about the normal that points away from the cell.

    Attributes:
        corners: [grid steps], one polygon after the other, shape (total, 3), float64.
        starts: polygon i is corners[starts[i]:starts[i + 1]], empty if nothing is left; shape (n + 1,), int64.
    """

    corners: np.ndarray
    starts: np.ndarray


def launch_umbra(
    boxes: np.ndarray, outlines: Patches, pairs: np.ndarray, *, threads: int = 1, device: str = "cpu"
) -> Umbras:
    """Umbra of each pair of view cell and outline.

    What the planes admit is hidden from the whole cell, for |coordinates| < 2**24 and dot products in float64; they lie
    up to 1e-5 grid steps inside the exact ones. The cell may be on either side of an outline, and touch it.

    Args:
        boxes: view cells [grid steps], shape (m, 2, 3), int, with inside.
        outlines: as `find_patches` gives them.
        pairs: (cell, outline), shape (k, 2), int.
        threads: CPU threads.
        device: Warp device.

    Raises:
        InputError: a box is empty or outside the grid.

    Source: Chhugani et al. 2005, section 5.2; the theorem of `data.patches`.
    """
    pairs = np.ascontiguousarray(pairs, np.int32).reshape(-1, 2)
    loop = pairs[:, 1]
    starts = np.concatenate([[0], np.cumsum(np.diff(outlines.starts)[loop])]).astype(np.int64)
    low, high = _boxes(boxes, device)
    table, rows = _outlines(outlines, device), wp.array(pairs, dtype=wp.vec2i, device=device)
    places = wp.array(starts, dtype=wp.int64, device=device)
    count, edges = len(pairs), int(starts[-1])
    status = wp.zeros(count, dtype=int, device=device)
    normal = wp.zeros(count, dtype=wp.vec3d, device=device)
    far = wp.zeros(count, dtype=wp.float64, device=device)
    planes, limits = (wp.zeros(edges, dtype=wp.vec4d, device=device) for _ in range(2))
    rho = wp.zeros(edges, dtype=wp.float64, device=device)

    def launch(first: int, last: int, slots: int, _values: wp.array, _integers: wp.array) -> None:
        inputs = [low, high, table, rows, places, first, last, slots, status, normal, far, planes, limits, rho]
        wp.launch(_umbra, dim=slots, inputs=inputs, device=device)

    run_sliced(launch, count, SlotSizes(1, 1), module=__name__, threads=threads, device=device)
    bounds = outlines.boxes[loop].astype(np.float64)
    return Umbras(
        status.numpy(),
        normal.numpy(),
        far.numpy(),
        starts,
        planes.numpy(),
        limits.numpy(),
        rho.numpy(),
        bounds.mean(axis=1),
        np.linalg.norm(bounds[:, 1] - bounds[:, 0], axis=1) / 2,
    )


def launch_shrink(
    umbras: Umbras,
    rows: np.ndarray,
    points: np.ndarray,
    depths: np.ndarray | None = None,
    *,
    threads: int = 1,
    device: str = "cpu",
) -> Polygons:
    """Shrunk occluders: whatever one of them hides from its projection point lies in its umbra.

    Each lies in the plane normal . q = far behind the whole occluder, which need not be flat. Of a bent occluder it is
    the section of the umbra with that plane, within twice the occluder's size.

    Args:
        umbras: of cells and outlines.
        rows: umbra of each polygon, shape (k,), int; one that is not USABLE gives an empty polygon.
        points: projection points [grid steps], shape (k, 3), float64. Any point in front of the plane is allowed, in
            the cell or not; one behind it or nearer than 1/64 gives an empty polygon.
        depths: hidden is only what lies at most so far beyond the plane [grid steps], shape (k,), inf for no limit;
            None for no limits. Less depth leaves more of the occluder, also where the umbra is bounded.
        threads: CPU threads.
        device: Warp device.

    Source: Chhugani et al. 2005, section 5.2, for no limit. With m . q >= c + w max(0, m . v - c) and
    w = depth / (depth + height of v), m . x >= c holds for all x = q + s (q - v) with 0 <= s <= depth / height.
    """
    rows = np.ascontiguousarray(rows, np.int32)
    count = len(rows)
    if depths is None:
        depths = np.full(count, np.inf)
    edges = np.diff(umbras.starts)[rows]
    spots = np.concatenate([[0], np.cumsum(4 + 2 * edges)]).astype(np.int64)
    most = int(4 + 2 * edges.max(initial=0))
    table = DeviceUmbras()
    table.status = wp.array(umbras.status, dtype=int, device=device)
    table.normal = wp.array(umbras.normal, dtype=wp.vec3d, device=device)
    table.far = wp.array(umbras.far, dtype=wp.float64, device=device)
    table.starts = wp.array(umbras.starts, dtype=wp.int64, device=device)
    table.planes = wp.array(umbras.planes, dtype=wp.vec4d, device=device)
    table.limits = wp.array(umbras.limits, dtype=wp.vec4d, device=device)
    table.centre = wp.array(umbras.centre, dtype=wp.vec3d, device=device)
    table.radius = wp.array(umbras.radius, dtype=wp.float64, device=device)
    row, v = wp.array(rows, dtype=int, device=device), _points(points, device)
    depth = wp.array(np.ascontiguousarray(depths, np.float64), dtype=wp.float64, device=device)
    places = wp.array(spots, dtype=wp.int64, device=device)
    kept = wp.zeros(count, dtype=int, device=device)
    corners = wp.zeros(int(spots[-1]), dtype=wp.vec3d, device=device)

    def launch(first: int, last: int, slots: int, values: wp.array, _integers: wp.array) -> None:
        inputs = [table, row, v, depth, places, most, values, first, last, slots, kept, corners]
        wp.launch(_shrink, dim=slots, inputs=inputs, device=device)

    run_sliced(launch, count, SlotSizes(4 * most, 1), module=__name__, threads=threads, device=device)
    return _compact(corners.numpy(), spots, kept.numpy())


def launch_grow_hole(
    boxes: np.ndarray,
    holes: Patches,
    pairs: np.ndarray,
    points: np.ndarray,
    *,
    threads: int = 1,
    device: str = "cpu",
) -> tuple[np.ndarray, Polygons]:
    """Grown holes: whatever is seen through a hole from anywhere in the cell is behind it as seen from the point.

    An occluder that is a planar convex hull less convex holes hides what its shrunk hull hides and its grown holes do
    not. Holes grow to polygons whose sides have the directions of the hole, of its plane's axes and of their diagonals:
    conv(hole, v + (height of v / height of p) (w - p)) for all corners w of the hole and p of the cell lies inside.

    Args:
        boxes: view cells [grid steps], shape (m, 2, 3), int, with inside.
        holes: outlines of the holes, planar.
        pairs: (cell, hole), shape (k, 2), int.
        points: projection points [grid steps], shape (k, 3), float64.
        threads: CPU threads.
        device: Warp device.

    Returns:
        Status: USABLE, STRADDLES (cell or point are not clearly in front of the hole's plane) or BENT (no plane), shape
        (k,), int32; and the polygons, empty where the status is not USABLE: there the hull must not be used.

    Source: x = w + l (w - p) is seen from p through w, so x - v is in cone(hole - v) + cone(hole - cell).
    """
    pairs = np.ascontiguousarray(pairs, np.int32).reshape(-1, 2)
    count, corners_of = len(pairs), np.diff(holes.starts)[pairs[:, 1]]
    spots = np.concatenate([[0], np.cumsum(12 + corners_of)]).astype(np.int64)
    most = int(12 + corners_of.max(initial=0))
    low, high = _boxes(boxes, device)
    table, rows = _outlines(holes, device), wp.array(pairs, dtype=wp.vec2i, device=device)
    v, places = _points(points, device), wp.array(spots, dtype=wp.int64, device=device)
    status, kept = (wp.zeros(count, dtype=int, device=device) for _ in range(2))
    corners = wp.zeros(int(spots[-1]), dtype=wp.vec3d, device=device)

    def launch(first: int, last: int, slots: int, values: wp.array, _integers: wp.array) -> None:
        inputs = [low, high, table, rows, v, places, most, values, first, last, slots, status, kept, corners]
        wp.launch(_grow_hole, dim=slots, inputs=inputs, device=device)

    run_sliced(launch, count, SlotSizes(4 * most, 1), module=__name__, threads=threads, device=device)
    return status.numpy(), _compact(corners.numpy(), spots, kept.numpy())


def _boxes(boxes: np.ndarray, device: str) -> tuple[wp.array, wp.array]:
    boxes = np.asarray(boxes, np.int64).reshape(-1, 2, 3)
    for i in np.flatnonzero((boxes[:, 0] >= boxes[:, 1]).any(axis=1) | (np.abs(boxes) >= LIMIT).any(axis=(1, 2))):
        raise InputError(f"view cell {i}: expected a box with inside, |c| < 2**24, found {boxes[i].tolist()}")
    return vectors(boxes[:, 0], device), vectors(boxes[:, 1], device)


def _outlines(outlines: Patches, device: str) -> Outlines:
    out = Outlines()
    out.corners = vectors(outlines.corners, device)
    out.starts = wp.array(outlines.starts, dtype=wp.int64, device=device)
    out.normal = wp.array(np.ascontiguousarray(outlines.normal, np.float64), dtype=wp.vec3d, device=device)
    out.depth = wp.array(np.ascontiguousarray(outlines.depth, np.float64), dtype=wp.vec2d, device=device)
    return out


def _points(points: np.ndarray, device: str) -> wp.array:
    return wp.array(np.ascontiguousarray(points, np.float64).reshape(-1, 3), dtype=wp.vec3d, device=device)


def _compact(corners: np.ndarray, spots: np.ndarray, kept: np.ndarray) -> Polygons:
    """Close the gaps between polygons that were written at `spots`."""
    starts = np.concatenate([[0], np.cumsum(kept, dtype=np.int64)])
    where = np.arange(starts[-1]) - np.repeat(starts[:-1] - spots[:-1], kept)
    return Polygons(corners[where], starts)
