"""Conservative cube maps: the depth behind which everything is covered, as seen from a projection point.

Occluders are underestimated: a pixel is written only where one polygon covers its whole closed square, with the
polygon's farthest depth there; the nearest such polygon is kept. Polygons that share an edge leave the pixels on it
open, so coplanar ones must be merged before, into maximal overlapping rectangles (data/blockers.py). Boxes are tested
against the maps by kernels/occludee.py.

A face looks along one axis; depth is the distance along it. Maps store 1 / depth, which is linear over a face and 0
where nothing covers, and a pyramid of its least values. Source: Chhugani et al. 2005, section 5.2 (conservative
rendering, there by alpha cut-off); Greene et al. 1993, "Hierarchical Z-buffer visibility".
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..data.errors import InputError
from .launch import CPU, Device, launch_rows

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

MAX_RESOLUTION = 4096
# Share of the sum of absolute products by which an edge function must exceed zero. Its rounding error is below 15 units
# of 2**-53 of that sum: differences, two products and their difference for each component, evaluation and root.
EDGE_BOUND = wp.constant(wp.float64(2.0**-48))
# The same for scalar products of three terms, and for a few operations on positive numbers.
DOT_BOUND = wp.constant(wp.float64(2.0**-49))
DOWN = wp.constant(wp.float64(1.0 - 2.0**-48))
# More than float32 can round up.
FLOAT32_DOWN = wp.constant(wp.float64(1.0 - 2.0**-23))
FAR = wp.constant(wp.float64(1.0e300))


@wp.struct
class Polygons:
    """Polygons of all maps: corners starts[i] to starts[i + 1], and the map that owns each."""

    viewpoints: wp.array[wp.vec3d]
    corners: wp.array[wp.vec3d]
    starts: wp.array[int]
    owners: wp.array[int]


@wp.struct
class Projected:
    """What polygons look like from their viewpoints.

    `edges` row k: normal of the plane through the viewpoint and edge k, towards the polygon, and its bound. `planes`
    row p: g with 1 / depth >= g . direction on polygon p. `rows` row 6 p + face: pixel rows that may be covered.
    """

    edges: wp.array[wp.vec4d]
    planes: wp.array[wp.vec3d]
    rows: wp.array[wp.vec2i]


@wp.struct
class Faces:
    """Faces that have an image: map * 6 + face of each, and the polygons that reach it, starts[i] to starts[i + 1]."""

    keys: wp.array[int]
    starts: wp.array[int]
    polygons: wp.array[int]


@wp.struct
class Maps:
    """`slots` row map * 6 + face: its image, or -1; `images` row: 1 / depth, row by row, level 0, 1, ..."""

    viewpoints: wp.array[wp.vec3d]
    slots: wp.array[int]
    images: wp.array2d[wp.float32]


@wp.func
def border(i: int, size: int) -> f64:
    """Where pixel i of a face begins, from -1 to 1; exact."""
    return f64(2 * i - size) / f64(size)


@wp.func
def face_sign(face: int) -> f64:
    """Direction in which a face looks along its axis, which is face // 2."""
    if face % 2 == 1:
        return f64(-1.0)
    return f64(1.0)


@wp.func
def absolute_sum(a: wp.vec3d, b: wp.vec3d) -> f64:
    """Sum of the absolute products of the components."""
    return wp.abs(a[0] * b[0]) + wp.abs(a[1] * b[1]) + wp.abs(a[2] * b[2])


@wp.func
def edge_plane(p: wp.vec3d, q: wp.vec3d, turn: f64) -> wp.vec4d:
    """Normal of the plane through the origin, p and q, and what n . d must exceed to be certainly positive."""
    m = wp.cross(p, q) * turn
    total = wp.abs(p[1] * q[2]) + wp.abs(p[2] * q[1]) + wp.abs(p[2] * q[0]) + wp.abs(p[0] * q[2])
    total += wp.abs(p[0] * q[1]) + wp.abs(p[1] * q[0])
    return wp.vec4d(m[0], m[1], m[2], total * EDGE_BOUND)


@wp.func
def seen_through(p: wp.vec3d, q: wp.vec3d, axis: int, sign: f64) -> wp.vec2d:
    """Least and greatest v / depth of segment pq inside |u| <= depth, or (2, -2) if it has no point there."""
    u = int((axis + 1) % 3)
    v = int((axis + 2) % 3)
    out = wp.vec2d(f64(2.0), f64(-2.0))
    first = f64(0.0)
    last = f64(1.0)
    for side in range(2):
        turn = f64(2 * side - 1)
        at = sign * p[axis] + turn * p[u]
        to = sign * q[axis] + turn * q[u]
        if at < f64(0.0) and to < f64(0.0):
            return out
        if at < f64(0.0):
            first = wp.max(first, at / (at - to))
        if to < f64(0.0):
            last = wp.min(last, at / (at - to))
    if first > last:
        return out
    for end in range(2):
        t = first
        if end == 1:
            t = last
        x = p + (q - p) * t
        depth = sign * x[axis]
        ratio = f64(2.0)
        if x[v] < f64(0.0):
            ratio = f64(-2.0)
        if wp.abs(x[v]) < f64(2.0) * depth:
            ratio = x[v] / depth
        out[0] = wp.min(out[0], ratio)
        out[1] = wp.max(out[1], ratio)
    return out


@wp.func
def pixel_rows(
    polygons: Polygons, projected: Projected, begin: int, end: int, eye: wp.vec3d, face: int, size: int
) -> wp.vec2i:
    """Pixel rows of a face that the polygon may cover; missing some would leave them open, no more."""
    axis = int(face // 2)
    sign = face_sign(face)
    v = int((axis + 2) % 3)
    least = f64(2.0)
    most = f64(-2.0)
    low_pole = bool(True)
    high_pole = bool(True)
    for k in range(begin, end):
        after = k + 1
        if after == end:
            after = begin
        span = seen_through(polygons.corners[k] - eye, polygons.corners[after] - eye, axis, sign)
        least = wp.min(least, span[0])
        most = wp.max(most, span[1])
        high_pole = high_pole and projected.edges[k][v] > projected.edges[k][3]
        low_pole = low_pole and -projected.edges[k][v] > projected.edges[k][3]
    # Seen between |u| <= depth, a polygon round the v axis has no end.
    if high_pole:
        most = f64(2.0)
        least = wp.min(least, f64(1.0))
    if low_pole:
        least = f64(-2.0)
        most = wp.max(most, f64(-1.0))
    low = wp.clamp((least + f64(1.0)) * f64(0.5), f64(0.0), f64(1.0)) * f64(size)
    high = wp.clamp((most + f64(1.0)) * f64(0.5), f64(0.0), f64(1.0)) * f64(size)
    return wp.vec2i(int(wp.floor(low)), int(wp.ceil(high)))


@wp.kernel
def _project(polygons: Polygons, size: int, first: int, projected_out: Projected):
    """Edge planes, depth plane and pixel rows of every polygon."""
    p = first + wp.tid()
    begin = polygons.starts[p]
    end = polygons.starts[p + 1]
    eye = polygons.viewpoints[polygons.owners[p]]
    start = polygons.corners[begin] - eye
    normal = wp.vec3d()
    for k in range(begin + 1, end - 1):
        a = polygons.corners[k] - polygons.corners[begin]
        normal += wp.cross(a, polygons.corners[k + 1] - polygons.corners[begin])
    turn = f64(1.0)
    if wp.dot(normal, start) < f64(0.0):
        turn = f64(-1.0)
    normal = normal * turn
    # Any normal will do, as long as every corner lies beyond the viewpoint and not beyond the farthest plane.
    near = FAR
    far = f64(0.0)
    for k in range(begin, end):
        r = polygons.corners[k] - eye
        bound = absolute_sum(normal, r) * DOT_BOUND
        near = wp.min(near, wp.dot(normal, r) - bound)
        far = wp.max(far, wp.dot(normal, r) + bound)
    usable = near > f64(0.0)
    if usable:
        projected_out.planes[p] = normal * (DOWN / far)
    for k in range(begin, end):
        after = k + 1
        if after == end:
            after = begin
        a = polygons.corners[k] - eye
        b = polygons.corners[after] - eye
        projected_out.edges[k] = edge_plane(a, b, turn)
        if polygons.corners[k] == polygons.corners[after]:
            # A repeated corner bounds nothing.
            projected_out.edges[k] = wp.vec4d(f64(0.0), f64(0.0), f64(0.0), f64(-1.0))
    for face in range(6):
        rows = wp.vec2i(0, 0)
        if usable:
            rows = pixel_rows(polygons, projected_out, begin, end, eye, face, size)
        projected_out.rows[6 * p + face] = rows


@wp.func
def covered_pixels(polygons: Polygons, projected: Projected, p: int, face: int, row: int, size: int) -> wp.vec2i:
    """First and past-the-last pixel of a row whose closed squares lie inside the polygon."""
    axis = int(face // 2)
    u = int((axis + 1) % 3)
    v = int((axis + 2) % 3)
    sign = face_sign(face)
    bottom = border(row, size)
    top = border(row + 1, size)
    begin = int(0)
    end = int(size)
    half = f64(0.5) * f64(size)
    for k in range(polygons.starts[p], polygons.starts[p + 1]):
        m = projected.edges[k]
        # The edge function m_u a + rest is positive in the whole square if it is so at the border that m_u points from.
        rest = sign * m[axis] + wp.min(m[v] * bottom, m[v] * top) - m[3]
        if m[u] > f64(0.0):
            a = wp.clamp(-rest / m[u], f64(-1.0), f64(1.0))
            begin = wp.max(begin, int(wp.ceil((a + f64(1.0)) * half)))
        elif m[u] < f64(0.0):
            a = wp.clamp(-rest / m[u], f64(-1.0), f64(1.0))
            end = wp.min(end, int(wp.floor((a + f64(1.0)) * half)))
        elif rest <= f64(0.0):
            end = int(0)
    return wp.vec2i(begin, end)


@wp.kernel
def _cover(polygons: Polygons, projected: Projected, faces: Faces, size: int, first: int, maps_out: Maps):
    """Fill pixel row after pixel row of all images at level 0."""
    item = first + wp.tid()
    slot = int(item // size)
    row = int(item % size)
    face = int(faces.keys[slot] % 6)
    axis = int(face // 2)
    for entry in range(faces.starts[slot], faces.starts[slot + 1]):
        p = faces.polygons[entry]
        rows = projected.rows[6 * p + face]
        if row >= rows[0] and row < rows[1]:
            span = covered_pixels(polygons, projected, p, face, row, size)
            g = projected.planes[p]
            # By the resolution, a power of two, and so exactly what it is times a border.
            slope = g[(axis + 1) % 3] / f64(size)
            rise = g[(axis + 2) % 3]
            bound = (wp.abs(g[0]) + wp.abs(g[1]) + wp.abs(g[2])) * DOT_BOUND
            rest = face_sign(face) * g[axis] - bound
            rest += wp.min(rise * border(row, size), rise * border(row + 1, size))
            shift = -size
            if slope < f64(0.0):
                shift += 2
            for i in range(span[0], span[1]):
                value = wp.float32((slope * f64(2 * i + shift) + rest) * FLOAT32_DOWN)
                if value > maps_out.images[slot, row * size + i]:
                    maps_out.images[slot, row * size + i] = value


@wp.func
def level_start(size: int, level: int) -> int:
    """Where a level of an image begins: 4/3 (size^2 - (size / 2^level)^2)."""
    width = size >> level
    return 4 * ((size - width) * (size + width) // 3)


@wp.kernel
def _reduce(size: int, level: int, first: int, maps_out: Maps):
    """Fill a level of the pyramids: the least of four pixels of the level before."""
    width = size >> level
    before = level_start(size, level - 1)
    here = level_start(size, level)
    item = first + wp.tid()
    slot = int(item // width)
    row = int(item % width)
    for i in range(width):
        a = before + 4 * row * width + 2 * i
        b = a + 2 * width
        low = wp.min(maps_out.images[slot, a], maps_out.images[slot, a + 1])
        high = wp.min(maps_out.images[slot, b], maps_out.images[slot, b + 1])
        maps_out.images[slot, here + row * width + i] = wp.min(low, high)


@dataclass
class CubeMaps:
    """Cube maps on a device.

    Attributes:
        resolution: pixels on a face's side, a power of two.
        arrays: the maps.
        device: that holds them.
    """

    resolution: int
    arrays: Maps
    device: Device

    def depth(self, index: int) -> np.ndarray:
        """Depth of map `index` [grid steps], shape (6, N, N), float64; infinite where nothing covers.

        Face 2 * axis + (1 if it looks down the axis), pixel row along axis + 2, pixel in it along axis + 1 (cyclic).
        """
        size = self.resolution
        out = np.full((6, size, size), np.inf)
        for face, slot in enumerate(self.arrays.slots.numpy()[6 * index : 6 * index + 6]):
            if slot >= 0:
                image = self.arrays.images[int(slot)].numpy()[: size * size].astype(np.float64)
                np.divide(1.0, image.reshape(size, size), out=out[face], where=image.reshape(size, size) > 0)
        return out


def launch_coverage(
    viewpoints: np.ndarray,
    corners: np.ndarray,
    starts: np.ndarray,
    owners: np.ndarray,
    *,
    resolution: int = 512,
    device: Device = CPU,
) -> CubeMaps:
    """Cube maps of convex polygons: behind a pixel's depth every direction of that pixel is covered by one polygon.

    Args:
        viewpoints: of each map [grid steps], shape (maps, 3), float64, |coordinate| < 2**25.
        corners: of all polygons, one after the other, in either sense of rotation [grid steps], shape (total, 3),
            float64. A corner that rounding put off the plane moves the depth back, which is safe; a polygon whose plane
            passes through its viewpoint, or almost, covers nothing.
        starts: first corner of each polygon, and the total, shape (polygons + 1,), int.
        owners: map of each polygon, shape (polygons,), int.
        resolution: pixels on a face's side, a power of two, 2 to 4096.
        device: where to.

    Returns:
        The maps. Depth may be too far, and a covered pixel may be left open; never the other way round.

    Raises:
        InputError: a shape, a number that is not finite, a polygon with less than three corners, the resolution.
    """
    points, corners = (np.ascontiguousarray(x, np.float64) for x in (viewpoints, corners))
    starts, owners = (np.ascontiguousarray(x, np.int32) for x in (starts, owners))
    _check(points, corners, starts, owners, resolution)
    polygons = device.struct(Polygons, viewpoints=points, corners=corners, starts=starts, owners=owners)
    count = len(owners)
    projected = device.struct(Projected, edges=len(corners), planes=count, rows=6 * count)
    launch_rows(_project, count, [polygons, resolution], [projected], device)
    faces, slots = _faces(projected.rows.numpy().reshape(-1, 6, 2), owners, len(points), device)
    images, pixels = len(faces.keys), (4 * resolution**2 - 1) // 3
    maps = device.struct(Maps, viewpoints=polygons.viewpoints, slots=slots, images=(images, pixels))
    launch_rows(_cover, images * resolution, [polygons, projected, faces, resolution], [maps], device)
    for level in range(1, resolution.bit_length()):
        launch_rows(_reduce, images * (resolution >> level), [resolution, level], [maps], device)
    return CubeMaps(resolution, maps, device)


def check_resolution(resolution: int) -> None:
    """Refuse a cube map's resolution that is not a power of two from 2 to 4096 with an InputError."""
    if not 2 <= resolution <= MAX_RESOLUTION or resolution & (resolution - 1):
        raise InputError(f"resolution: expected a power of two, 2 to {MAX_RESOLUTION}, found {resolution}")


def _check(points: np.ndarray, corners: np.ndarray, starts: np.ndarray, owners: np.ndarray, resolution: int) -> None:
    """Raise InputError unless the arguments of `launch_coverage` fit together."""
    if points.ndim != 2 or points.shape[1] != 3 or corners.ndim != 2 or corners.shape[1] != 3:
        raise InputError(f"viewpoints, corners: expected shape (n, 3) each, found {points.shape}, {corners.shape}")
    if not (np.isfinite(points).all() and np.isfinite(corners).all()):
        raise InputError("viewpoints, corners: expected finite coordinates, found NaN or infinity")
    if starts.shape != (len(owners) + 1,) or starts[0] != 0 or starts[-1] != len(corners):
        raise InputError(f"starts: expected 0 to {len(corners)} for {len(owners)} polygons, found shape {starts.shape}")
    if (np.diff(starts) < 3).any():
        short = int(np.argmax(np.diff(starts) < 3))
        raise InputError(f"polygon {short}: expected at least 3 corners, found {int(np.diff(starts)[short])}")
    if len(owners) and (owners.min() < 0 or owners.max() >= len(points)):
        raise InputError(f"owners: expected maps 0 to {len(points) - 1}, found {owners.min()} to {owners.max()}")
    check_resolution(resolution)


def _faces(rows: np.ndarray, owners: np.ndarray, maps: int, device: Device) -> tuple[Faces, np.ndarray]:
    """Faces that some polygon reaches, and the image of each face of each map, -1 for none; rows (polygons, 6, 2)."""
    polygon, face = np.nonzero(rows[:, :, 0] < rows[:, :, 1])
    keys = owners[polygon] * 6 + face
    order = np.argsort(keys, kind="stable")
    used, first = np.unique(keys[order], return_index=True)
    slots = np.full(6 * maps, -1, np.int32)
    slots[used] = np.arange(len(used))
    faces = device.struct(Faces, keys=used, starts=np.append(first, len(keys)), polygons=polygon[order])
    return faces, slots
