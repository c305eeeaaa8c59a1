"""Aiming: sightlines drawn at random towards boxes and objects until one is certainly clear.

What is drawn for a row depends on its seed alone. Whoever can tell quickly which sightlines may be clear, such as a ray
tracer in float32, leaves few to be confirmed (kernels/sightline.py), which alone decides.
"""

from typing import Protocol

import numpy as np
import warp as wp

from ..data.plans import NO_PLANS, Plans
from .hierarchy import high_of, item_of, low_of, real, skip_of
from .launch import CPU, Device, launch_rows
from .sightline import PADDING, Triangles, launch_confirm

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

# Sightline ends are multiples of 2**-10 grid steps, so that origin, direction and their sum are exact in float64.
QUANTUM = wp.constant(wp.float64(1024.0))
# Points drawn on an object before giving up that one falls into the wanted box. Near a hint the nearest of some counts.
PICKS = wp.constant(16)
NEAR_PICKS = wp.constant(6)
# Sightlines near a hint move by a share of the box down to two to this power, evenly in the exponent.
NEAREST = wp.constant(wp.float64(-6.0))
# Sightlines drawn for a row at first; then twice as many each time, for rows that lack one. And drawn together.
FIRST_DRAWN, TOGETHER = 4, 1 << 20


class Guide(Protocol):
    """Knows more of sightlines than `launch_aim` does; nothing it says is final but what it no longer wants."""

    def may_be_clear(self, rows: np.ndarray, origins: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """Which sightlines of rows are worth to be confirmed, shape (n,), bool."""

    def wanted(self, rows: np.ndarray, found: np.ndarray) -> np.ndarray:
        """Which of the rows, all that still lack a sightline, are to go on, bool; found says of every row if it has."""


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
class Aims:
    """Work of `launch_aim`: source and target boxes, object to hit (-1: none) and a range.

    Ranges are of an object's triangles; or, where only those in the target box count, of items, with running weights.
    """

    source_lo: wp.array[wp.vec3i]
    source_hi: wp.array[wp.vec3i]
    target_lo: wp.array[wp.vec3i]
    target_hi: wp.array[wp.vec3i]
    hint_origin: wp.array[wp.vec3d]
    hint_end: wp.array[wp.vec3d]
    owner: wp.array[int]
    begin: wp.array[int]
    end: wp.array[int]
    item: wp.array[int]
    running: wp.array[f64]
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
def pick(running: wp.array[f64], begin: int, end: int, share: f64) -> int:
    """Place in a range below whose part of the range's weight a share of it lies."""
    low = int(begin)
    high = int(end - 1)
    before = f64(0.0)
    if low > 0:
        before = running[low - 1]
    wanted = before + share * (running[high] - before)
    while low < high:
        middle = (low + high) // 2
        if running[middle] < wanted:
            low = middle + 1
        else:
            high = middle
    return low


@wp.func
def widest(normal: wp.vec3d) -> int:
    """Axis along which a triangle of this normal covers most."""
    axis = int(0)
    for i in range(1, 3):
        if wp.abs(normal[i]) > wp.abs(normal[axis]):
            axis = i
    return axis


@wp.struct
class Cut:
    """What a box leaves of the box around a triangle, and whether that is all of it."""

    lo: wp.vec3d
    hi: wp.vec3d
    whole: bool
    any: bool


@wp.func
def cut(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, lo: wp.vec3i, hi: wp.vec3i) -> Cut:
    """Cut the box around a triangle by a box."""
    low = wp.min(wp.min(a, b), c)
    high = wp.max(wp.max(a, b), c)
    out = Cut(wp.max(low, real(lo)), wp.min(high, real(hi)), True, True)
    for i in range(3):
        if out.lo[i] > out.hi[i]:
            out.any = False
        if out.lo[i] != low[i] or out.hi[i] != high[i]:
            out.whole = False
    return out


@wp.func
def point_on(scene: Triangles, k: int, around: Cut, s: f64, t: f64) -> wp.vec3d:
    """A point of the triangle; or, if a box leaves not all of it, one of its plane above or below what it leaves."""
    a = real(scene.a[k])
    b = real(scene.b[k])
    c = real(scene.c[k])
    if around.whole:
        r = wp.sqrt(s)
        return a * (f64(1.0) - r) + b * (r * (f64(1.0) - t)) + c * (r * t)
    normal = wp.cross(b - a, c - a)
    axis = widest(normal)
    u = (axis + 1) % 3
    v = (axis + 2) % 3
    out = wp.vec3d()
    out[u] = around.lo[u] + s * (around.hi[u] - around.lo[u])
    out[v] = around.lo[v] + t * (around.hi[v] - around.lo[v])
    out[axis] = a[axis] - (normal[u] * (out[u] - a[u]) + normal[v] * (out[v] - a[v])) / normal[axis]
    return out


@wp.func
def on_triangle(scene: Triangles, k: int, p: wp.vec3d) -> bool:
    """Whether a point of a triangle's plane lies in the triangle, as far as rounding tells."""
    a = real(scene.a[k])
    b = real(scene.b[k])
    c = real(scene.c[k])
    normal = wp.cross(b - a, c - a)
    first = wp.dot(wp.cross(b - a, p - a), normal)
    second = wp.dot(wp.cross(c - b, p - b), normal)
    third = wp.dot(wp.cross(a - c, p - c), normal)
    return first >= f64(0.0) and second >= f64(0.0) and third >= f64(0.0)


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
def aim_at_object(scene: Triangles, aims: Aims, row: int, near: bool, attempt: int, drawn: Aim) -> Aim:
    """End the sightline on the object; if it is to be near the hint, at the nearest of several points to its end."""
    out = drawn
    state = drawn.state
    wanted = int(1)
    if near:
        wanted = NEAR_PICKS
    boxed = aims.item.shape[0] > 0
    best = f64(1.0e300)
    point = wp.vec3d()
    k = int(0)
    picks = int(0)
    while picks < PICKS:
        picks += 1
        share = f64(wp.randf(state))
        s = f64(wp.randf(state))
        t = f64(wp.randf(state))
        around = Cut(point, point, True, True)
        if boxed:
            k = aims.item[pick(aims.running, aims.begin[row], aims.end[row], share)]
            around = cut(real(scene.a[k]), real(scene.b[k]), real(scene.c[k]), aims.target_lo[row], aims.target_hi[row])
        else:
            k = pick(scene.running_area, aims.begin[row], aims.end[row], share)
        point = point_on(scene, k, around, s, t)
        if around.whole or (on_triangle(scene, k, point) and holds(aims.target_lo[row], aims.target_hi[row], point)):
            distance = wp.length_sq(point - aims.hint_end[row])
            if distance < best:
                best = distance
                out.end = point
                out.triangle = k
            wanted -= 1
            if wanted == 0:
                picks = PICKS
    if best == f64(1.0e300):
        out.end = point
        out.triangle = k
    if near:
        out.origin = pull(drawn.origin, aims.hint_origin[row], f64(1.0) / f64(1 + attempt))
    out.state = state
    return out


@wp.func
def weight(scene: Triangles, k: int, lo: wp.vec3i, hi: wp.vec3i) -> f64:
    """About the area of a triangle inside a box, and never 0."""
    a = real(scene.a[k])
    b = real(scene.b[k])
    c = real(scene.c[k])
    around = cut(a, b, c, lo, hi)
    normal = wp.cross(b - a, c - a)
    axis = widest(normal)
    # A triangle covers half of the box around it; less than a step counts as one.
    left = around.hi - around.lo
    u = wp.max(left[(axis + 1) % 3], f64(1.0))
    v = wp.max(left[(axis + 2) % 3], f64(1.0))
    return u * v * wp.length(normal) / wp.abs(normal[axis])


@wp.kernel
def _within(
    scene: Triangles,
    owner: wp.array[int],
    box_lo: wp.array[wp.vec3i],
    box_hi: wp.array[wp.vec3i],
    start: wp.array[int],
    first: int,
    count_out: wp.array[int],
    item_out: wp.array[int],
    weight_out: wp.array[f64],
):
    """Triangles of an object that may meet a box; counted only, where there is no room for them."""
    row = first + wp.tid()
    lo = box_lo[row]
    hi = box_hi[row]
    found = int(0)
    node = int(0)
    while node < scene.nodes.shape[0]:
        around = scene.nodes[node]
        low = low_of(around)
        high = high_of(around)
        inside = low[0] <= hi[0] and low[1] <= hi[1] and low[2] <= hi[2]
        if inside and high[0] >= lo[0] and high[1] >= lo[1] and high[2] >= lo[2]:
            k = item_of(around)
            if k >= 0:
                if scene.owner[k] == owner[row]:
                    if item_out.shape[0] > 0:
                        item_out[start[row] + found] = k
                        weight_out[start[row] + found] = weight(scene, k, lo, hi)
                    found += 1
            node += 1
        else:
            node = skip_of(around)
    count_out[row] = found


@wp.kernel
def _draw(
    scene: Triangles,
    aims: Aims,
    rows: wp.array[int],
    attempt: int,
    count: int,
    first: int,
    origins_out: wp.array2d[wp.vec3d],
    ends_out: wp.array2d[wp.vec3d],
    triangles_out: wp.array2d[int],
    states_out: wp.array[wp.uint32],
):
    place = first + wp.tid()
    row = rows[place]
    aim = Aim()
    aim.state = states_out[row]
    if attempt == 0:
        aim.state = wp.rand_init(aims.seed[row])
    for k in range(count):
        state = aim.state
        share = wp.vec3d(f64(wp.randf(state)), f64(wp.randf(state)), f64(wp.randf(state)))
        aim.state = state
        aim.origin = start_at(aims, row, share)
        # Odd attempts stay near the line that the axial model allows.
        near = aims.near[row] == 1 and (attempt + k) % 2 == 1
        if aims.owner[row] < 0:
            aim = aim_at_box(aims, row, near, aim)
        else:
            aim = aim_at_object(scene, aims, row, near, attempt + k, aim)
        origins_out[place, k] = quantised(aim.origin)
        ends_out[place, k] = quantised(aim.end)
        triangles_out[place, k] = aim.triangle
    states_out[row] = aim.state


def launch_aim(
    scene: Triangles,
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
    guide: Guide | None = None,
    device: Device = CPU,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shoot from random points of each source box, or of the prism in it, at its target until a sightline is clear.

    Args:
        scene: triangles, opaque and others.
        sources: source box of each row [grid steps], shape (n, 2, 3), int32.
        boxes: target box of each row; used where there is no object to hit, or with `boxed`.
        hints: origin and end of a sightline that the axial model allows [grid steps], shape (n, 2, 3), float64.
        objects: object to hit and its first and past-the-last triangle; or -1, 0 and 0 to reach a point of the
            target box; shape (n, 3), int.
        seeds: of each row's random stream, shape (n,), int.
        near: rows whose every other sightline stays near the hint, shape (n,), bool.
        tries: sightlines shot per row at most.
        boxed: aim only at the part of the object inside this row's box; nothing is shot where it has none.
        plans: of sources that are prisms, parallelograms but for rounding: points may be a step outside.
        guide: tells which sightlines are worth to be confirmed; all are without it, as suits a GPU.
        device: where to.

    Returns:
        Found, shape (n,), bool; origins and ends [grid steps], shape (n, 3), float64, defined where found.

    Raises:
        InputError: a coordinate of a box beyond the grid.
    """
    count = len(sources)
    ranges, items, running = _items(scene, objects[:, 0], boxes, device) if boxed else (objects[:, 1:], 0, 0)
    aims = _device_aims(sources, boxes, hints, plans, device)
    columns = {"begin": ranges[:, 0], "end": ranges[:, 1], "owner": objects[:, 0], "seed": seeds, "near": near}
    for name, values in columns.items():
        setattr(aims, name, device.array(values, int))
    if boxed:
        aims.item, aims.running = device.array(items, int), device.array(running, f64)
    states = device.zeros(count, wp.uint32)
    found, lines = np.zeros(count, bool), np.zeros((2, count, 3))
    attempt, drawn = 0, FIRST_DRAWN
    left = np.flatnonzero((ranges[:, 0] < ranges[:, 1]) | (objects[:, 0] < 0))
    while attempt < tries and len(left):
        drawn = min(drawn, tries - attempt)
        step = max(1, TOGETHER // drawn)
        for begin in range(0, len(left), step):
            rows = left[begin : begin + step]
            out = [device.zeros((len(rows), drawn), kind) for kind in (wp.vec3d, wp.vec3d, int)]
            inputs = [scene, aims, device.array(rows, int), attempt, drawn]
            launch_rows(_draw, len(rows), inputs, [*out, states], device)
            good, *ends = _first_clear(scene, objects, rows, [x.numpy() for x in out], guide, device)
            found[good] = True
            lines[:, good] = ends
        attempt, drawn = attempt + drawn, 2 * drawn
        left = left[~found[left]]
        if guide is not None:
            left = left[guide.wanted(left, found)]
    return found, *lines


def _device_aims(sources: np.ndarray, boxes: np.ndarray, hints: np.ndarray, plans: Plans, device: Device) -> Aims:
    """Where the rows of `launch_aim` start and end, on the device."""
    count = len(sources)
    corners = plans.filled(count, np.arange(count)).astype(float)
    return device.struct(
        Aims,
        source_lo=device.corners(sources[:, 0]),
        source_hi=device.corners(sources[:, 1]),
        target_lo=device.corners(boxes[:, 0]),
        target_hi=device.corners(boxes[:, 1]),
        hint_origin=hints[:, 0],
        hint_end=hints[:, 1],
        turned=plans.places(count) >= 0,
        corner=corners[:, 0],
        along=corners[:, 1] - corners[:, 0],
        across=corners[:, 3] - corners[:, 0],
    )


def _items(
    scene: Triangles, objects: np.ndarray, boxes: np.ndarray, device: Device
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles of each row's object in its box: ranges of items, shape (n, 2), the items and their running weight."""
    asked, own = np.unique(np.column_stack([objects, boxes.reshape(-1, 6)]), axis=0, return_inverse=True)
    count = device.zeros(len(asked), int)
    inputs = [scene, device.array(asked[:, 0], int), device.corners(asked[:, 1:4]), device.corners(asked[:, 4:])]
    starts = np.zeros(len(asked) + 1, int)
    none = [device.zeros(0, int), device.zeros(0, f64)]
    launch_rows(_within, len(asked), [*inputs, device.array(starts, int)], [count, *none], device)
    starts[1:] = np.cumsum(count.numpy())
    out = [device.zeros(int(starts[-1]), int), device.zeros(int(starts[-1]), f64)]
    launch_rows(_within, len(asked), [*inputs, device.array(starts, int)], [count, *out], device)
    return np.column_stack([starts[:-1], starts[1:]])[own], out[0].numpy(), np.cumsum(out[1].numpy())


def _first_clear(
    scene: Triangles,
    objects: np.ndarray,
    rows: np.ndarray,
    drawn: list[np.ndarray],
    guide: Guide | None,
    device: Device,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First certainly clear one of the sightlines drawn for each row.

    Args:
        scene: as of `launch_aim`.
        objects: likewise.
        rows: that were drawn for, shape (m,), int.
        drawn: origins, ends and triangles aimed at, shape (m, k, ...).
        guide: as of `launch_aim`.
        device: likewise.

    Returns:
        The rows that one was found for, and its origin and end.
    """
    origins, ends, triangles = (x.reshape(-1, *x.shape[2:]) for x in drawn)
    row = np.repeat(rows, drawn[0].shape[1])
    if guide is None:
        left, most = np.arange(len(row)), len(row)
    else:
        # Most are clear then: one per row is enough at first.
        left, most = np.flatnonzero(guide.may_be_clear(row, origins, ends)), 1
    clear = np.zeros(len(row), bool)
    while len(left):
        own = row[left]
        asked = np.arange(len(left)) - np.searchsorted(own, own) < most
        at, left, most = left[asked], left[~asked], 2 * most
        on = triangles[at, None] + np.where(objects[row[at], :1] < 0, 0, [[0, 1]])
        clear[at] = launch_confirm(scene, origins[at], ends[at], objects[row[at], 0], ranges=on, device=device)
        left = left[~np.isin(row[left], row[at[clear[at]]])]
    at = np.flatnonzero(clear)
    at = at[np.unique(row[at], return_index=True)[1]]
    return row[at], origins[at], ends[at]
