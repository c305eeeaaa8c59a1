"""Objects clipped to cells: the bounds of what each object has of its surface in a closed box.

The same arithmetic as data/incidence.py:clip_rows, which it equals to the last bit, one row a thread.

Source: Sutherland and Hodgman 1974, "Reentrant polygon clipping".
"""

import numpy as np
import warp as wp

from .hierarchy import real
from .launch import CPU, Device, launch_rows

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64
mat93d = wp.types.matrix(shape=(9, 3), dtype=wp.float64)

# A triangle has at most so many corners once it was clipped by six planes.
ROOM = wp.constant(9)
# Rounding of crossings is far below one step: what is rounded outwards, less this much, holds them.
CROSSING = wp.constant(wp.float64(1.0e-6))
EMPTY = 2**30


@wp.struct
class Polygon:
    """Corners of a convex polygon, and how many there are."""

    corners: mat93d
    count: int


@wp.func
def clipped(polygon: Polygon, axis: int, plane: f64, sign: f64) -> Polygon:
    """What is left of a polygon where sign * (coordinate - plane) is not negative."""
    out = Polygon()
    for k in range(ROOM):
        if k < polygon.count:
            after = k + 1
            if after == polygon.count:
                after = 0
            here = sign * (polygon.corners[k, axis] - plane)
            there = sign * (polygon.corners[after, axis] - plane)
            if here >= f64(0.0) and out.count < ROOM:
                for i in range(3):
                    out.corners[out.count, i] = polygon.corners[k, i]
                out.count += 1
            if here * there < f64(0.0) and out.count < ROOM:
                share = here / (here - there)
                for i in range(3):
                    start = polygon.corners[k, i]
                    out.corners[out.count, i] = start + share * (polygon.corners[after, i] - start)
                out.corners[out.count, axis] = plane
                out.count += 1
    return out


@wp.func
def cut_triangle(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, lo: wp.vec3d, hi: wp.vec3d) -> Polygon:
    """What a closed box holds of a triangle."""
    out = Polygon()
    out.count = 3
    for i in range(3):
        out.corners[0, i] = a[i]
        out.corners[1, i] = b[i]
        out.corners[2, i] = c[i]
    for i in range(3):
        out = clipped(out, i, lo[i], f64(1.0))
        out = clipped(out, i, hi[i], f64(-1.0))
    return out


@wp.kernel
def _clip(
    a: wp.array[wp.vec3i],
    b: wp.array[wp.vec3i],
    c: wp.array[wp.vec3i],
    ranges: wp.array[wp.vec2i],
    box_lo: wp.array[wp.vec3i],
    box_hi: wp.array[wp.vec3i],
    first: int,
    lo_out: wp.array[wp.vec3i],
    hi_out: wp.array[wp.vec3i],
):
    row = first + wp.tid()
    lo = real(box_lo[row])
    hi = real(box_hi[row])
    least = wp.vec3d(f64(EMPTY), f64(EMPTY), f64(EMPTY))
    most = -least
    for k in range(ranges[row][0], ranges[row][1]):
        p = real(a[k])
        q = real(b[k])
        r = real(c[k])
        low = wp.min(wp.min(p, q), r)
        high = wp.max(wp.max(p, q), r)
        inside = bool(True)
        apart = bool(False)
        for i in range(3):
            if low[i] > hi[i] or high[i] < lo[i]:
                apart = True
            if low[i] < lo[i] or high[i] > hi[i]:
                inside = False
        if inside:
            least = wp.min(least, low)
            most = wp.max(most, high)
        elif not apart:
            left = cut_triangle(p, q, r, lo, hi)
            if left.count >= 3:
                for i in range(3):
                    begin = left.corners[0, i]
                    end = left.corners[0, i]
                    for j in range(1, left.count):
                        begin = wp.min(begin, left.corners[j, i])
                        end = wp.max(end, left.corners[j, i])
                    begin = wp.max(wp.floor(begin - CROSSING), wp.max(low[i], lo[i]))
                    end = wp.min(wp.ceil(end + CROSSING), wp.min(high[i], hi[i]))
                    least[i] = wp.min(least[i], begin)
                    most[i] = wp.max(most[i], end)
    lo_out[row] = wp.vec3i(int(least[0]), int(least[1]), int(least[2]))
    hi_out[row] = wp.vec3i(int(most[0]), int(most[1]), int(most[2]))


def launch_clip(triangles: np.ndarray, ranges: np.ndarray, boxes: np.ndarray, *, device: Device = CPU) -> np.ndarray:
    """Bounds of what closed boxes hold of lists of triangles, rounded outwards to grid steps.

    Args:
        triangles: [grid steps], shape (m, 3, 3), int32.
        ranges: first and past-the-last triangle of each row, shape (n, 2), int.
        boxes: box of each row [grid steps], shape (n, 2, 3), int32.
        device: where to.

    Returns:
        Shape (n, 2, 3), int64, never less than what is there, and less than two steps more; low > high where nothing
        is left of any triangle.

    Raises:
        InputError: a coordinate beyond the grid.
    """
    corners = [device.corners(triangles[:, k]) for k in range(3)]
    inputs = [*corners, device.array(ranges, wp.vec2i), device.corners(boxes[:, 0]), device.corners(boxes[:, 1])]
    out = [device.zeros(len(boxes), wp.vec3i) for _ in range(2)]
    launch_rows(_clip, len(boxes), inputs, out, device)
    return np.stack([x.numpy().astype(np.int64) for x in out], axis=1).reshape(-1, 2, 3)
