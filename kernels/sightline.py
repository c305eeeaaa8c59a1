"""Sightlines against the true triangles.

A sightline is accepted only if float64 is certain that it clears every opaque triangle: each orientation carries a
bound on its rounding, and a doubtful one counts as blocked. So an accepted sightline is never wrong; a rejected one may
be clear. (The exact check of every stored witness is verify/exact/sightline.py, which shares nothing with this file.)

Source of the bound: Shewchuk 1997, "Adaptive Precision Floating-Point Arithmetic", orient3d, stage A.
"""

import numpy as np
import warp as wp

from ..data.ragged import places_of, take_lists
from .hierarchy import Node, build_hierarchy, build_of_copies, inverse, item_of, nears, real, skip_of
from .launch import CPU, Device, check_coordinates, launch_rows

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

# (7 + 56 e) e with e = 2**-53 is 7.8e-16 of the permanent; the product of 1-norms used here is never smaller than that.
ORIENT_BOUND = wp.constant(wp.float64(1.0e-15))
# Grid steps added to every node box: coordinates up to 2**24 carry rounding errors far below it.
PADDING = wp.constant(wp.float64(0.001))
# A witness on an object must hit it within this multiple of its length (the check grants 1.001).
PROLONGED = wp.constant(wp.float64(1.0005))


@wp.struct
class Triangles:
    """Triangles in grid steps in object order, who owns them, which are opaque, their running area, their hierarchy."""

    a: wp.array[wp.vec3i]
    b: wp.array[wp.vec3i]
    c: wp.array[wp.vec3i]
    owner: wp.array[int]
    opaque: wp.array[wp.uint8]
    running_area: wp.array[f64]
    nodes: wp.array[Node]


def device_triangles(
    triangles: np.ndarray,
    owners: np.ndarray,
    device: Device = CPU,
    *,
    opaque: np.ndarray | None = None,
    models: np.ndarray | None = None,
) -> Triangles:
    """Copy triangles to a device.

    Args:
        triangles: [grid steps], shape (m, 3, 3), int32.
        owners: object of each, ascending, shape (m,), int.
        device: where to.
        opaque: which of them are obstacles, shape (m,), bool; all by default.
        models: of each object the first that is alike (`Scene.first_alike`), shape (objects,), int: saves time.

    Raises:
        InputError: a coordinate beyond the grid.
    """
    # Corner by corner, and coordinate by coordinate: NumPy is many times slower along short axes.
    a, b, c = (np.ascontiguousarray(triangles[:, i]) for i in range(3))
    boxes = np.stack([least(least(a, b), c) for least in (np.minimum, np.maximum)], axis=1)
    if models is None:
        nodes, area = build_hierarchy(boxes), _areas(a, b, c)
    else:
        starts = np.searchsorted(owners, np.arange(len(models) + 1))
        nodes, area = build_of_copies(boxes, starts, models), _areas_of_copies(a, b, c, starts, models)
    area = np.cumsum(area)
    a, b, c = (device.corners(corner) for corner in (a, b, c))
    opaque = np.ones(len(triangles), bool) if opaque is None else opaque
    columns = {"a": a, "b": b, "c": c, "owner": owners, "opaque": opaque, "running_area": area}
    return device.struct(Triangles, **columns, nodes=nodes.nodes)


def _areas(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Twice the areas of triangles by their corners, each of shape (m, 3), int32."""
    u, v = ((end - a).T.astype(float, order="C") for end in (b, c))
    return np.sqrt(sum((u[i - 2] * v[i - 1] - u[i - 1] * v[i - 2]) ** 2 for i in range(3)))


def _areas_of_copies(a: np.ndarray, b: np.ndarray, c: np.ndarray, starts: np.ndarray, models: np.ndarray) -> np.ndarray:
    """The same of triangles of objects, of which those that are alike are measured once; as of `build_of_copies`."""
    firsts = models == np.arange(len(models))
    begins, rows = take_lists(starts, firsts)
    own = np.zeros(len(models), np.int64)
    own[firsts] = begins[:-1]
    return _areas(*(corner.take(rows, axis=0) for corner in (a, b, c)))[places_of(own[models], np.diff(starts))]


@wp.func
def certain_side(u: wp.vec3d, v: wp.vec3d, w: wp.vec3d) -> int:
    """Sign of det(u, v, w) of differences of float64 points; 0 where rounding could have made it."""
    det = wp.dot(u, wp.cross(v, w))
    bound = (
        ORIENT_BOUND
        * (wp.abs(u[0]) + wp.abs(u[1]) + wp.abs(u[2]))
        * (wp.abs(v[0]) + wp.abs(v[1]) + wp.abs(v[2]))
        * (wp.abs(w[0]) + wp.abs(w[1]) + wp.abs(w[2]))
    )
    if det > bound:
        return 1
    if det < -bound:
        return -1
    return 0


@wp.func
def clears(p: wp.vec3d, q: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d) -> bool:
    """Whether the closed segment pq certainly misses the closed triangle abc."""
    d = q - p
    u = a - p
    v = b - p
    w = c - p
    s0 = certain_side(d, u, v)
    s1 = certain_side(d, v, w)
    s2 = certain_side(d, w, u)
    if (s0 > 0 or s1 > 0 or s2 > 0) and (s0 < 0 or s1 < 0 or s2 < 0):
        return True
    above = certain_side(u, v, w)
    if above == 0:
        return False
    return above == certain_side(a - q, b - q, c - q)


@wp.func
def hits(p: wp.vec3d, q: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d) -> bool:
    """Whether the segment pq certainly crosses the inside of the triangle abc."""
    d = q - p
    u = a - p
    v = b - p
    w = c - p
    s0 = certain_side(d, u, v)
    if s0 == 0 or s0 != certain_side(d, v, w) or s0 != certain_side(d, w, u):
        return False
    above = certain_side(u, v, w)
    return above != 0 and above == -certain_side(a - q, b - q, c - q)


@wp.func
def obstacle(scene: Triangles, p: wp.vec3d, q: wp.vec3d, except_owner: int) -> int:
    """An opaque triangle that pq does not certainly clear, or -1; those of one object excepted (-1: none)."""
    back = inverse(q - p)
    count = scene.nodes.shape[0]
    node = int(0)
    while node < count:
        box = scene.nodes[node]
        if nears(p, back, box, PADDING):
            item = item_of(box)
            if item >= 0:
                if scene.owner[item] != except_owner and scene.opaque[item] != wp.uint8(0):
                    if not clears(p, q, real(scene.a[item]), real(scene.b[item]), real(scene.c[item])):
                        return item
            node += 1
        else:
            node = skip_of(box)
    return -1


@wp.func
def surely_hits(scene: Triangles, p: wp.vec3d, q: wp.vec3d, k: int) -> bool:
    """Whether the segment pq, prolonged a little, surely hits the inside of a triangle."""
    return hits(p, p + (q - p) * PROLONGED, real(scene.a[k]), real(scene.b[k]), real(scene.c[k]))


@wp.kernel
def _confirm(
    scene: Triangles,
    origins: wp.array[wp.vec3d],
    ends: wp.array[wp.vec3d],
    except_owner: wp.array[int],
    on: wp.array[wp.vec2i],
    first: int,
    clear_out: wp.array[wp.uint8],
):
    row = first + wp.tid()
    k = int(on[row][0])
    # An empty range asks for no target.
    met = bool(k == on[row][1])
    while not met and k < on[row][1]:
        met = surely_hits(scene, origins[row], ends[row], k)
        k += 1
    if met:
        met = obstacle(scene, origins[row], ends[row], except_owner[row]) < 0
    clear_out[row] = wp.uint8(met)


def launch_confirm(
    scene: Triangles,
    origins: np.ndarray,
    ends: np.ndarray,
    owners: np.ndarray,
    *,
    ranges: np.ndarray | None = None,
    device: Device = CPU,
) -> np.ndarray:
    """Sightlines that certainly clear every opaque triangle, and hit a target, if there is one.

    Args:
        scene: opaque triangles and others.
        origins: [grid steps], shape (n, 3), float64.
        ends: likewise.
        owners: object whose triangles are no obstacle (the target), or -1, shape (n,), int.
        ranges: first and past-the-last triangle of each row's target, one of which the sightline has to hit; equal
            where there is none.
        device: where to.

    Returns:
        Shape (n,), bool. True is never wrong; False may be clear by less than rounding.

    Raises:
        InputError: a coordinate beyond the grid.
    """
    check_coordinates(origins)
    check_coordinates(ends)
    clear = device.zeros(len(origins), wp.uint8)
    lines = [device.array(points, wp.vec3d) for points in (origins, ends)]
    on = device.array(np.zeros((len(origins), 2)) if ranges is None else ranges, wp.vec2i)
    asked = [scene, *lines, device.array(owners, int), on]
    launch_rows(_confirm, len(origins), asked, [clear], device)
    return clear.numpy().astype(bool)
