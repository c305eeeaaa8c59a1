"""Umbras of outlines over box-shaped view cells.

Chhugani et al. 2005, section 5.2. Through each edge of an outline and a vertex of the cell runs a supporting plane:
cell and occluder lie on one side. The points beyond the occluder and on the inner side of all these planes are its
umbra.

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
from ..data.ragged import starts_of
from .launch import CPU, Device, launch_rows

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64
i64 = wp.int64

# Status of a pair.
USABLE, STRADDLES, TOUCHES, BENT = (wp.constant(k) for k in range(4))
# Coordinates are below 2**24, so a product normal . point of three terms is off by 1e-8 at most.
HEIGHT_SLACK = wp.constant(wp.float64(2.0**-24))
# Unit normals are off by 5 * 2**-53 a component and points lie 2**25 apart: 1e-7 with the product itself.
PLANE_SLACK = wp.constant(wp.float64(2.0**-20))
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

    corners: wp.array[wp.vec3i]
    starts: wp.array[wp.int64]
    normal: wp.array[wp.vec3d]
    depth: wp.array[wp.vec2d]


@wp.struct
class DeviceUmbras:
    """Columns of `Umbras`."""

    status: wp.array[int]
    normal: wp.array[wp.vec3d]
    far: wp.array[f64]
    planes: wp.array[wp.vec4d]
    limits: wp.array[wp.vec4d]
    rho: wp.array[f64]


@wp.kernel
def _umbra(
    box_low: wp.array[wp.vec3i],
    box_high: wp.array[wp.vec3i],
    outlines: Outlines,
    pairs: wp.array[wp.vec2i],
    starts: wp.array[wp.int64],
    first: int,
    umbras_out: DeviceUmbras,
):
    row = first + wp.tid()
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
            status = STRADDLES
    count = int(outlines.starts[loop + 1] - outlines.starts[loop])
    for e in range(count):
        at = starts[row] + i64(e)
        a = wide(outlines.corners[outlines.starts[loop] + i64(e)])
        d = (wide(outlines.corners[outlines.starts[loop] + i64((e + 1) % count)]) - a) * i64(side)
        if status == 0:
            near = extreme_corner(low, high, a, d, 1)
            far = extreme_corner(low, high, a, d, -1)
            if near < 0 or far < 0:
                status = BENT
            else:
                plane = edge_plane(low, high, a, d, near)
                umbras_out.planes[at] = plane
                umbras_out.limits[at] = edge_plane(low, high, a, d, far)
                m = wp.vec3d(plane[0], plane[1], plane[2])
                inward = wp.normalize(wp.cross(normal, as_double(d)))
                umbras_out.rho[at] = wp.dot(m, normal) / wp.dot(m, inward)
                if wp.dot(normal, as_double(box_corner(low, high, near))) >= depth[0]:
                    umbras_out.rho[at] = f64(-wp.inf)
                    status = TOUCHES
    umbras_out.status[row] = status
    umbras_out.normal[row] = normal
    umbras_out.far[row] = depth[1] + HEIGHT_SLACK


def launch_umbra(boxes: np.ndarray, outlines: Patches, pairs: np.ndarray, *, device: Device = CPU) -> Umbras:
    """Umbra of each pair of view cell and outline.

    What the planes admit is hidden from the whole cell, for |coordinates| < 2**24 and dot products in float64; they lie
    up to 1e-5 grid steps inside the exact ones. The cell may be on either side of an outline, and touch it.

    Args:
        boxes: view cells [grid steps], shape (m, 2, 3), int, with inside.
        outlines: as `find_patches` gives them.
        pairs: (cell, outline), shape (k, 2), int.
        device: where to.

    Raises:
        InputError: a box is empty or outside the grid.

    Source: Chhugani et al. 2005, section 5.2; the theorem of `data.patches`.
    """
    pairs = np.asarray(pairs, np.int32).reshape(-1, 2)
    loop, count = pairs[:, 1], len(pairs)
    starts = starts_of(np.diff(outlines.starts)[loop])
    corners, names = device.corners(outlines.corners), ("starts", "normal", "depth")
    table = device.struct(Outlines, corners=corners, **{name: getattr(outlines, name) for name in names})
    inputs = [*_boxes(boxes, device), table, device.array(pairs, wp.vec2i), device.array(starts, i64)]
    edges = dict.fromkeys(("planes", "limits", "rho"), int(starts[-1]))
    found = device.struct(DeviceUmbras, status=count, normal=count, far=count, **edges)
    launch_rows(_umbra, count, inputs, [found], device)
    bounds = outlines.boxes[loop].astype(np.float64)
    return Umbras(
        found.status.numpy(),
        found.normal.numpy(),
        found.far.numpy(),
        starts,
        found.planes.numpy(),
        found.limits.numpy(),
        found.rho.numpy(),
        bounds.mean(axis=1),
        np.linalg.norm(bounds[:, 1] - bounds[:, 0], axis=1) / 2,
    )


def _boxes(boxes: np.ndarray, device: Device) -> tuple[wp.array, wp.array]:
    boxes = np.asarray(boxes, np.int64).reshape(-1, 2, 3)
    for i in np.flatnonzero((boxes[:, 0] >= boxes[:, 1]).any(axis=1) | (np.abs(boxes) >= LIMIT).any(axis=(1, 2))):
        raise InputError(f"view cell {i}: expected a box with inside, |c| < 2**24, found {boxes[i].tolist()}")
    return device.corners(boxes[:, 0]), device.corners(boxes[:, 1])
