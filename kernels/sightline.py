"""Sightlines against the true triangles, and the search for a clear one by aiming.

A sightline is accepted only if float64 is certain that it clears every opaque triangle: each orientation carries a
bound on its rounding, and a doubtful one counts as blocked. So an accepted sightline is never wrong; a rejected one may
be clear. (The exact check of every stored witness is verify/exact/sightline.py, which shares nothing with this file.)

Source of the bound: Shewchuk 1997, "Adaptive Precision Floating-Point Arithmetic", orient3d, stage A.
"""

import numpy as np
import warp as wp

from ..data.hierarchy import build_hierarchy
from ..data.plans import NO_PLANS, Plans
from .launch import CPU, Device, check_coordinates, launch_rows, node_columns

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

# (7 + 56 e) e with e = 2**-53 is 7.8e-16 of the permanent; the product of 1-norms used here is never smaller than that.
ORIENT_BOUND = wp.constant(wp.float64(1.0e-15))
# Grid steps added to every node box: coordinates up to 2**24 carry rounding errors far below it.
PADDING = wp.constant(wp.float64(0.001))
# Sightline ends are multiples of 2**-10 grid steps, so that origin, direction and their sum are exact in float64.
QUANTUM = wp.constant(wp.float64(1024.0))
# Points drawn on an object before giving up that one falls into the wanted box.
PICKS = wp.constant(64)
NEAR_PICKS = wp.constant(6)
# Sightlines near a hint move by a share of the box down to two to this power, evenly in the exponent.
NEAREST = wp.constant(wp.float64(-6.0))
# A witness on an object must hit it within this multiple of its length (the check grants 1.001).
PROLONGED = wp.constant(wp.float64(1.0005))


@wp.struct
class Triangles:
    """Opaque triangles in grid steps, who owns them, and their hierarchy."""

    a: wp.array[wp.vec3i]
    b: wp.array[wp.vec3i]
    c: wp.array[wp.vec3i]
    owner: wp.array[int]
    node_lo: wp.array[wp.vec3i]
    node_hi: wp.array[wp.vec3i]
    links: wp.array[wp.vec2i]


def device_triangles(triangles: np.ndarray, owners: np.ndarray, device: Device = CPU) -> Triangles:
    """Copy opaque triangles (m, 3, 3) [grid steps] and their object ids to a device."""
    nodes = build_hierarchy(np.stack([triangles.min(axis=1), triangles.max(axis=1)], axis=1))
    a, b, c = (device.corners(triangles[:, i]) for i in range(3))
    return device.struct(Triangles, a=a, b=b, c=c, owner=owners, **node_columns(nodes))


@wp.func
def real(v: wp.vec3i) -> wp.vec3d:
    """Integer vector as float64."""
    return wp.vec3d(f64(v[0]), f64(v[1]), f64(v[2]))


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
def nears(p: wp.vec3d, d: wp.vec3d, lo: wp.vec3d, hi: wp.vec3d, padding: f64) -> bool:
    """Whether the segment p + [0, 1] d meets a box that is padded on all sides, in rounded arithmetic."""
    first = f64(0.0)
    last = f64(1.0)
    for i in range(3):
        low = lo[i] - padding - p[i]
        high = hi[i] + padding - p[i]
        if d[i] == f64(0.0):
            if low > f64(0.0) or high < f64(0.0):
                last = f64(-1.0)
        else:
            t0 = low / d[i]
            t1 = high / d[i]
            first = wp.max(first, wp.min(t0, t1))
            last = wp.min(last, wp.max(t0, t1))
    return first <= last


@wp.func
def obstacle(scene: Triangles, p: wp.vec3d, q: wp.vec3d, except_owner: int) -> int:
    """A triangle that segment pq does not certainly clear, or -1; those of one object excepted (-1: none)."""
    d = q - p
    count = scene.links.shape[0]
    node = int(0)
    while node < count:
        link = scene.links[node]
        if nears(p, d, real(scene.node_lo[node]), real(scene.node_hi[node]), PADDING):
            item = link[1]
            if item >= 0:
                if scene.owner[item] != except_owner:
                    if not clears(p, q, real(scene.a[item]), real(scene.b[item]), real(scene.c[item])):
                        return item
            node += 1
        else:
            node = link[0]
    return -1


@wp.func
def quantised(v: wp.vec3d) -> wp.vec3d:
    """Nearest point whose coordinates are multiples of 2**-10 grid steps."""
    return wp.vec3d(wp.round(v[0] * QUANTUM), wp.round(v[1] * QUANTUM), wp.round(v[2] * QUANTUM)) / QUANTUM


@wp.func
def point_at(lo: wp.vec3d, hi: wp.vec3d, share: wp.vec3d) -> wp.vec3d:
    """Point of a box at shares 0 to 1 of its sides, kept off its faces by 1/64 of its size."""
    out = wp.vec3d()
    for i in range(3):
        out[i] = lo[i] + (f64(0.015625) + f64(0.96875) * share[i]) * (hi[i] - lo[i])
    return out


@wp.func
def holds(lo: wp.vec3i, hi: wp.vec3i, point: wp.vec3d) -> bool:
    """Whether the point lies in the box, rounding forgiven."""
    for i in range(3):
        if point[i] < f64(lo[i]) - PADDING or point[i] > f64(hi[i]) + PADDING:
            return False
    return True


@wp.struct
class AimTargets:
    """Triangles of all objects that may be aimed at, opaque or not, grouped by object, with their running area."""

    a: wp.array[wp.vec3i]
    b: wp.array[wp.vec3i]
    c: wp.array[wp.vec3i]
    running_area: wp.array[f64]


def aim_targets(triangles: np.ndarray, device: Device = CPU) -> AimTargets:
    """Copy the triangles (m, 3, 3) of all objects, in object order, to a device."""
    edges = (triangles[:, 1:] - triangles[:, :1]).astype(float)
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    a, b, c = (device.corners(triangles[:, i]) for i in range(3))
    return device.struct(AimTargets, a=a, b=b, c=c, running_area=np.cumsum(area))


@wp.struct
class Aims:
    """Work of `launch_aim`: source and target boxes, object to hit (-1: none), and the object's triangle range."""

    source_lo: wp.array[wp.vec3i]
    source_hi: wp.array[wp.vec3i]
    target_lo: wp.array[wp.vec3i]
    target_hi: wp.array[wp.vec3i]
    hint_origin: wp.array[wp.vec3d]
    hint_end: wp.array[wp.vec3d]
    owner: wp.array[int]
    begin: wp.array[int]
    end: wp.array[int]
    seed: wp.array[int]
    near: wp.array[int]
    turned: wp.array[int]
    corner: wp.array[wp.vec2d]
    along: wp.array[wp.vec2d]
    across: wp.array[wp.vec2d]


@wp.struct
class Aim:
    """One attempt: where the sightline starts and ends, on which triangle, and the random state after it was drawn."""

    origin: wp.vec3d
    end: wp.vec3d
    triangle: int
    state: wp.uint32


@wp.func
def start_at(aims: Aims, row: int, share: wp.vec3d) -> wp.vec3d:
    """A point of the source: of its box, or of the prism in it."""
    out = point_at(real(aims.source_lo[row]), real(aims.source_hi[row]), share)
    if aims.turned[row] == 1:
        plan = aims.corner[row] + aims.along[row] * share[0] + aims.across[row] * share[1]
        out[0] = plan[0]
        out[1] = plan[1]
    return out


@wp.func
def pull(point: wp.vec3d, hint: wp.vec3d, reach: f64) -> wp.vec3d:
    """The point moved towards the hint: reach 1 leaves it, 0 gives the hint."""
    return hint + (point - hint) * reach


@wp.func
def pick_triangle(targets: AimTargets, begin: int, end: int, share: f64) -> int:
    """Triangle of a range below whose part of the range's area a share of it lies."""
    low = int(begin)
    high = int(end - 1)
    before = f64(0.0)
    if low > 0:
        before = targets.running_area[low - 1]
    pick = before + share * (targets.running_area[high] - before)
    while low < high:
        middle = (low + high) // 2
        if targets.running_area[middle] < pick:
            low = middle + 1
        else:
            high = middle
    return low


@wp.func
def aim_at_box(aims: Aims, row: int, near: bool, drawn: Aim) -> Aim:
    """End the sightline in the target box; if it is to be near the hint, with both ends pulled towards the hint's."""
    out = drawn
    state = drawn.state
    share = wp.vec3d(f64(wp.randf(state)), f64(wp.randf(state)), f64(wp.randf(state)))
    out.end = point_at(real(aims.target_lo[row]), real(aims.target_hi[row]), share)
    if near:
        reach = wp.pow(f64(2.0), NEAREST * f64(wp.randf(state)))
        out.origin = pull(drawn.origin, aims.hint_origin[row], reach)
        out.end = pull(out.end, aims.hint_end[row], reach)
    out.state = state
    return out


@wp.func
def aim_at_object(targets: AimTargets, aims: Aims, row: int, near: bool, boxed: int, attempt: int, drawn: Aim) -> Aim:
    """End the sightline on the object; if it is to be near the hint, at the nearest of several points to its end."""
    out = drawn
    state = drawn.state
    wanted = int(1)
    if near:
        wanted = NEAR_PICKS
    best = f64(1.0e300)
    point = wp.vec3d()
    low = int(0)
    picks = int(0)
    while picks < PICKS:
        picks += 1
        low = pick_triangle(targets, aims.begin[row], aims.end[row], f64(wp.randf(state)))
        s = wp.sqrt(f64(wp.randf(state)))
        t = f64(wp.randf(state))
        a = real(targets.a[low])
        b = real(targets.b[low])
        point = a * (f64(1.0) - s) + b * (s * (f64(1.0) - t)) + real(targets.c[low]) * (s * t)
        if boxed == 0 or holds(aims.target_lo[row], aims.target_hi[row], point):
            distance = wp.length_sq(point - aims.hint_end[row])
            if distance < best:
                best = distance
                out.end = point
                out.triangle = low
            wanted -= 1
            if wanted == 0:
                picks = PICKS
    if best == f64(1.0e300):
        out.end = point
        out.triangle = low
    if near:
        out.origin = pull(drawn.origin, aims.hint_origin[row], f64(1.0) / f64(1 + attempt))
    out.state = state
    return out


@wp.func
def recently_stopped(scene: Triangles, recent: wp.vec4i, origin: wp.vec3d, end: wp.vec3d) -> bool:
    """Whether one of the triangles that stopped the last sightlines stops this one."""
    for k in range(4):
        item = recent[k]
        if item >= 0:
            if not clears(origin, end, real(scene.a[item]), real(scene.b[item]), real(scene.c[item])):
                return True
    return False


@wp.func
def surely_hits(targets: AimTargets, aim: Aim) -> bool:
    """Whether the sightline, prolonged a little, surely hits the inside of the triangle that it was aimed at."""
    beyond = aim.origin + (aim.end - aim.origin) * PROLONGED
    k = aim.triangle
    return hits(aim.origin, beyond, real(targets.a[k]), real(targets.b[k]), real(targets.c[k]))


@wp.kernel
def _confirm(
    scene: Triangles,
    targets: AimTargets,
    origins: wp.array[wp.vec3d],
    ends: wp.array[wp.vec3d],
    except_owner: wp.array[int],
    on: wp.array[wp.vec2i],
    first: int,
    clear_out: wp.array[wp.uint8],
):
    row = first + wp.tid()
    aim = Aim(origins[row], ends[row], on[row][0], wp.uint32(0))
    # An empty range asks for no target.
    met = bool(on[row][0] == on[row][1])
    while not met and aim.triangle < on[row][1]:
        met = surely_hits(targets, aim)
        aim.triangle += 1
    if met:
        met = obstacle(scene, aim.origin, aim.end, except_owner[row]) < 0
    clear_out[row] = wp.uint8(met)


@wp.kernel
def _aim(
    scene: Triangles,
    targets: AimTargets,
    aims: Aims,
    tries: int,
    boxed: int,
    first: int,
    found_out: wp.array[wp.uint8],
    origins_out: wp.array[wp.vec3d],
    ends_out: wp.array[wp.vec3d],
):
    row = first + wp.tid()
    found_out[row] = wp.uint8(0)
    owner = aims.owner[row]
    aim = Aim()
    aim.state = wp.rand_init(aims.seed[row])
    recent = wp.vec4i(-1, -1, -1, -1)
    newest = int(0)
    attempt = int(0)
    while attempt < tries:
        state = aim.state
        share = wp.vec3d(f64(wp.randf(state)), f64(wp.randf(state)), f64(wp.randf(state)))
        aim.state = state
        aim.origin = start_at(aims, row, share)
        # Odd attempts stay near the line that the axial model allows.
        near = aims.near[row] == 1 and attempt % 2 == 1
        if owner < 0:
            aim = aim_at_box(aims, row, near, aim)
        else:
            aim = aim_at_object(targets, aims, row, near, boxed, attempt, aim)
        aim.origin = quantised(aim.origin)
        aim.end = quantised(aim.end)
        attempt += 1
        # What stopped the last sightlines of this row mostly stops the next one.
        if not recently_stopped(scene, recent, aim.origin, aim.end):
            item = obstacle(scene, aim.origin, aim.end, owner)
            if item >= 0:
                recent[newest] = item
                newest = (newest + 1) % 4
            elif owner < 0 or surely_hits(targets, aim):
                found_out[row] = wp.uint8(1)
                origins_out[row] = aim.origin
                ends_out[row] = aim.end
                attempt = tries


def launch_confirm(
    scene: Triangles,
    origins: np.ndarray,
    ends: np.ndarray,
    owners: np.ndarray,
    *,
    targets: "AimTargets | None" = None,
    ranges: np.ndarray | None = None,
    device: Device = CPU,
) -> np.ndarray:
    """Sightlines that certainly clear every opaque triangle, and hit a target, if there is one.

    Args:
        scene: opaque triangles.
        origins: [grid steps], shape (n, 3), float64.
        ends: likewise.
        owners: object whose triangles are no obstacle (the target), or -1, shape (n,), int.
        targets: triangles of all objects, with `ranges`.
        ranges: first and past-the-last triangle of each row's target, one of which the sightline has to hit.
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
    asked = [scene, targets or AimTargets(), *lines, device.array(owners, int), on]
    launch_rows(_confirm, len(origins), asked, [clear], device)
    return clear.numpy().astype(bool)


def launch_aim(
    scene: Triangles,
    targets: AimTargets,
    sources: np.ndarray,
    boxes: np.ndarray,
    hints: np.ndarray,
    objects: np.ndarray,
    seeds: np.ndarray,
    near: np.ndarray,
    *,
    tries: int,
    boxed: bool = False,
    plans: Plans = NO_PLANS,
    device: Device = CPU,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shoot from random points of each source box, or of the prism in it, at its target until a sightline is clear.

    Args:
        scene: opaque triangles.
        targets: triangles to aim at.
        sources: source box of each row [grid steps], shape (n, 2, 3), int32.
        boxes: target box of each row; used where there is no object to hit, or with `boxed`.
        hints: origin and end of a sightline that the axial model allows [grid steps], shape (n, 2, 3), float64.
        objects: object to hit and its first and past-the-last row in `targets`; or -1, 0 and 0 to reach a point of the
            target box; shape (n, 3), int.
        seeds: of each row's random stream, shape (n,), int.
        near: rows whose every other sightline stays near the hint, shape (n,), bool.
        tries: sightlines shot per row at most.
        boxed: aim only at the part of the object inside the row's box (most of the time: a part that random points on
            the object rarely hit is given up, and the point is used as it is).
        plans: of sources that are prisms, parallelograms but for rounding: points may be a step outside.
        device: where to.

    Returns:
        Found, shape (n,), bool; origins and ends [grid steps], shape (n, 3), float64, defined where found.

    Raises:
        InputError: a coordinate of a box beyond the grid.
    """
    count = len(sources)
    corners = plans.filled(count, np.arange(count)).astype(float)
    aims = device.struct(
        Aims,
        source_lo=device.corners(sources[:, 0]),
        source_hi=device.corners(sources[:, 1]),
        target_lo=device.corners(boxes[:, 0]),
        target_hi=device.corners(boxes[:, 1]),
        hint_origin=hints[:, 0],
        hint_end=hints[:, 1],
        owner=objects[:, 0],
        begin=objects[:, 1],
        end=objects[:, 2],
        seed=seeds,
        near=near,
        turned=plans.places(count) >= 0,
        corner=corners[:, 0],
        along=corners[:, 1] - corners[:, 0],
        across=corners[:, 3] - corners[:, 0],
    )
    found = device.zeros(count, wp.uint8)
    origins, ends = device.zeros(count, wp.vec3d), device.zeros(count, wp.vec3d)
    launch_rows(_aim, count, [scene, targets, aims, tries, int(boxed)], [found, origins, ends], device)
    return found.numpy().astype(bool), origins.numpy(), ends.numpy()
