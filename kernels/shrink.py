"""Shrunk occluders: what is left of each occluder when seen from one point.

The paper's shrunk occluder for a projection point v is the part q of the occluder with q - v parallel to the cone of
its umbra (kernels/umbra.py): all that lies behind it as seen from v is in the umbra. Source: Chhugani et al. 2005,
section 5.2.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..data.ragged import places_of, starts_of
from .launch import CPU, Device, Scratch, launch_slots
from .umbra import USABLE, Umbras

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64
i64 = wp.int64

# Clipping adds some 1e-7 a plane, and a polygon has 20 or so.
CLIP_SLACK = wp.constant(wp.float64(2.0**-14))
# Corners nearer than this to the last one are dropped, which only shrinks the polygon.
LEAST_SIDE = wp.constant(wp.float64(2.0**-10))
# A projection point nearer than this to the occluder's plane sees nothing of it.
LEAST_HEIGHT = wp.constant(wp.float64(2.0**-6))


@wp.func
def clip(scratch: wp.array[f64], begin: int, end: int, count: int, a: f64, b: f64, c: f64) -> int:
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
def start_square(scratch: wp.array[f64], begin: int, half: f64) -> int:
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
    scratch: wp.array[f64],
    begin: int,
    count: int,
    centre: wp.vec3d,
    e: wp.vec3d,
    g: wp.vec3d,
    at: wp.int64,
    corners_out: wp.array[wp.vec3d],
) -> int:
    """Write the polygon in space without sides of LEAST_SIDE or less; returns its corners, 0 if fewer than three."""
    kept = int(0)
    for i in range(count):
        x = scratch[begin + 2 * i]
        y = scratch[begin + 2 * i + 1]
        j = (i + 1) % count
        if wp.abs(scratch[begin + 2 * j] - x) + wp.abs(scratch[begin + 2 * j + 1] - y) > LEAST_SIDE:
            corners_out[at + i64(kept)] = centre + e * x + g * y
            kept += 1
    return wp.where(kept < 3, 0, kept)


@wp.struct
class ShrinkTable:
    """`Umbras` on a device."""

    status: wp.array[int]
    normal: wp.array[wp.vec3d]
    far: wp.array[f64]
    starts: wp.array[wp.int64]
    planes: wp.array[wp.vec4d]
    limits: wp.array[wp.vec4d]
    centre: wp.array[wp.vec3d]
    radius: wp.array[f64]


@wp.kernel
def _shrink(
    umbras: ShrinkTable,
    rows: wp.array[int],
    points: wp.array[wp.vec3d],
    depths: wp.array[f64],
    spots: wp.array[wp.int64],
    most: int,
    first: int,
    last: int,
    slots: int,
    scratch: wp.array[f64],
    count_out: wp.array[int],
    corners_out: wp.array[wp.vec3d],
):
    row = first + wp.tid()
    while row < last:
        pair = rows[row]
        v = points[row]
        normal = umbras.normal[pair]
        height = umbras.far[pair] - wp.dot(normal, v)
        count = int(0)
        if umbras.status[pair] == USABLE and height >= LEAST_HEIGHT:
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
            count = write_polygon(scratch, begin, count, centre, e, g, spots[row], corners_out)
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


def launch_shrink(
    umbras: Umbras,
    rows: np.ndarray,
    points: np.ndarray,
    depths: np.ndarray | None = None,
    *,
    device: Device = CPU,
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
        device: where to.

    Source: Chhugani et al. 2005, section 5.2, for no limit. With m . q >= c + w max(0, m . v - c) and
    w = depth / (depth + height of v), m . x >= c holds for all x = q + s (q - v) with 0 <= s <= depth / height.
    """
    rows = np.asarray(rows)
    depths = np.full(len(rows), np.inf) if depths is None else depths
    edges = np.diff(umbras.starts)[rows]
    spots = starts_of(4 + 2 * edges)
    most = int(4 + 2 * edges.max(initial=0))
    table = device.struct(ShrinkTable, **{name: getattr(umbras, name) for name in ShrinkTable.vars})
    points = device.array(np.asarray(points).reshape(-1, 3), wp.vec3d)
    work = [device.array(rows, int), points, device.array(depths, f64), device.array(spots, i64), most]
    kept, corners = device.zeros(len(rows), int), device.zeros(int(spots[-1]), wp.vec3d)
    launch_slots(_shrink, len(rows), [table, *work], Scratch(4 * most), [kept, corners], device)
    sizes = kept.numpy()
    # Close the gaps between polygons that were written at `spots`.
    return Polygons(corners.numpy()[places_of(spots[:-1], sizes)], starts_of(sizes))
