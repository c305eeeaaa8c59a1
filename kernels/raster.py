"""A plain z-buffer rasteriser: the object that each pixel shows, how deep, and the work done for it.

It is the renderer that costs of levels of detail are measured with where the user's own has not been, and that draws
what textured depth meshes are made of. A pixel shows what the ray through its centre meets first. With corners a, b, c
in camera coordinates, x and y multiplied by the focal length, that ray is (x, y, 1) and

    (x, y, 1) = (e_a a + e_b b + e_c c) / det(a, b, c),    e_a = (b x c) . (x, y, 1), ...

so it meets the triangle where no e has the sign opposite to the determinant, and 1 / depth = (e_a + e_b + e_c) / det is
linear on the screen: corners behind the eye need no clipping (Olano and Greer 1997, "Triangle scan conversion using 2D
homogeneous coordinates"). The span of a row ends where an edge's e is 0. Two triangles that share an edge compute that
place to the same bit, so no ray slips between them; a centre exactly on it belongs to both.

Float64, triangles in the order given; of equal depths the first stays. CPU and CUDA give the same answer.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..data.errors import InputError
from .launch import CPU, Device, Scratch, launch_slots

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

# Bounds of a triangle on the screen grow by so much [pixels]: they only save work.
BOUNDS_MARGIN = wp.constant(wp.float64(1.0e-6))


@wp.struct
class Cameras:
    """Eyes [grid steps], right-up-forward axes, and the screen; focal length and size [pixels], near [grid steps]."""

    eyes: wp.array[wp.vec3d]
    axes: wp.array[wp.mat33d]
    focal: wp.float64
    near: wp.float64
    width: int
    height: int


@wp.struct
class DrawCalls:
    """Calls of frame f are starts[f] : starts[f + 1]; each draws triangles first : last as an object."""

    starts: wp.array[int]
    calls: wp.array[wp.vec3i]


@wp.func
def camera_point(cameras: Cameras, frame: int, corner: wp.vec3i) -> wp.vec3d:
    """Corner in camera coordinates, x and y times the focal length."""
    p = wp.vec3d(f64(corner[0]), f64(corner[1]), f64(corner[2])) - cameras.eyes[frame]
    v = cameras.axes[frame] * p
    return wp.vec3d(v[0] * cameras.focal, v[1] * cameras.focal, v[2])


@wp.func
def widened(bounds: wp.vec4d, v: wp.vec3d) -> wp.vec4d:
    """Bounds (low x, low y, high x, high y) that hold a point, too."""
    x = v[0] / v[2]
    y = v[1] / v[2]
    return wp.vec4d(wp.min(bounds[0], x), wp.min(bounds[1], y), wp.max(bounds[2], x), wp.max(bounds[3], y))


@wp.func
def with_edge(bounds: wp.vec4d, a: wp.vec3d, b: wp.vec3d, near: wp.float64) -> wp.vec4d:
    """Bounds that hold what of an edge lies beyond the near plane."""
    grown = wp.vec4d(bounds[0], bounds[1], bounds[2], bounds[3])
    if a[2] >= near:
        grown = widened(grown, a)
    if (a[2] < near) != (b[2] < near):
        crossing = a + (b - a) * ((near - a[2]) / (b[2] - a[2]))
        grown = widened(grown, wp.vec3d(crossing[0], crossing[1], near))
    return grown


@wp.func
def cut_span(span: wp.vec2d, edge: wp.vec3d, y: wp.float64) -> wp.vec2d:
    """Part of a row's span on the inner side of an edge; low above high where there is none."""
    slope = edge[0]
    rest = edge[1] * y + edge[2]
    low = span[0]
    high = span[1]
    if slope > f64(0.0):
        low = wp.max(low, -rest / slope)
    elif slope < f64(0.0):
        high = wp.min(high, -rest / slope)
    elif rest < f64(0.0):
        high = f64(-wp.inf)
    return wp.vec2d(low, high)


@wp.func
def draw_triangle(
    cameras: Cameras,
    a: wp.vec3d,
    b: wp.vec3d,
    c: wp.vec3d,
    rows: wp.vec2i,
    object: int,
    depths: wp.array[wp.float64],
    lane: wp.vec2i,
    frame_ids_out: wp.array[int],
) -> int:
    """Draw rows first : last; the number of pixel centres that the triangle covers. Lane: slots, slot."""
    n_a = wp.cross(b, c)
    n_b = wp.cross(c, a)
    n_c = wp.cross(a, b)
    det = wp.dot(a, n_a)
    covered = int(0)
    if det != f64(0.0):
        half_w = f64(cameras.width) * f64(0.5)
        half_h = f64(cameras.height) * f64(0.5)
        bounds = wp.vec4d(f64(wp.inf), f64(wp.inf), f64(-wp.inf), f64(-wp.inf))
        bounds = with_edge(bounds, a, b, cameras.near)
        bounds = with_edge(bounds, b, c, cameras.near)
        bounds = with_edge(bounds, c, a, cameras.near)
        left = wp.max(bounds[0] - BOUNDS_MARGIN, -half_w)
        right = wp.min(bounds[2] + BOUNDS_MARGIN, half_w)
        low = wp.max(bounds[1] - BOUNDS_MARGIN, -half_h)
        high = wp.min(bounds[3] + BOUNDS_MARGIN, half_h)
        if left <= right and low <= high:
            side = wp.sign(det)
            inverse = (n_a + n_b + n_c) / det
            nearest = f64(1.0) / cameras.near
            first = wp.max(rows[0], int(wp.ceil(half_h - high - f64(0.5))))
            last = wp.min(rows[1] - 1, int(wp.floor(half_h - low - f64(0.5))))
            for row in range(first, last + 1):
                y = half_h - (f64(row) + f64(0.5))
                span = cut_span(wp.vec2d(left, right), n_a * side, y)
                span = cut_span(span, n_b * side, y)
                span = cut_span(span, n_c * side, y)
                if span[0] <= span[1]:
                    begin = wp.max(0, int(wp.ceil(span[0] + half_w - f64(0.5))))
                    end = wp.min(cameras.width - 1, int(wp.floor(span[1] + half_w - f64(0.5))))
                    base = inverse[1] * y + inverse[2]
                    for column in range(begin, end + 1):
                        depth = inverse[0] * (f64(column) + f64(0.5) - half_w) + base
                        place = ((row - rows[0]) * cameras.width + column) * lane[0] + lane[1]
                        if depth > depths[place] and depth <= nearest:
                            depths[place] = depth
                            frame_ids_out[row * cameras.width + column] = object
                    covered += wp.max(0, end + 1 - begin)
    return covered


@wp.kernel
def _raster(
    cameras: Cameras,
    draws: DrawCalls,
    triangles: wp.array2d[wp.vec3i],
    bands: int,
    first: int,
    last: int,
    slots: int,
    depths: wp.array[wp.float64],
    ids_out: wp.array2d[int],
    inverse_out: wp.array2d[wp.float64],
    fragments_out: wp.array[wp.int64],
):
    lane = wp.vec2i(slots, wp.tid())
    item = first + wp.tid()
    while item < last:
        frame = item / bands
        band = item % bands
        rows = wp.vec2i(band * cameras.height / bands, (band + 1) * cameras.height / bands)
        for place in range((rows[1] - rows[0]) * cameras.width):
            depths[place * lane[0] + lane[1]] = f64(0.0)
        fragments = wp.int64(0)
        for call in range(draws.starts[frame], draws.starts[frame + 1]):
            what = draws.calls[call]
            for k in range(what[0], what[1]):
                a = camera_point(cameras, frame, triangles[k, 0])
                b = camera_point(cameras, frame, triangles[k, 1])
                c = camera_point(cameras, frame, triangles[k, 2])
                near = cameras.near
                if a[2] >= near or b[2] >= near or c[2] >= near:
                    drawn = draw_triangle(cameras, a, b, c, rows, what[2], depths, lane, ids_out[frame])
                    fragments += wp.int64(drawn)
        # An array without columns asks for no depths.
        if inverse_out.shape[1] > 0:
            for place in range((rows[1] - rows[0]) * cameras.width):
                inverse_out[frame, rows[0] * cameras.width + place] = depths[place * lane[0] + lane[1]]
        fragments_out[item] = fragments
        item += slots


@dataclass(frozen=True)
class Images:
    """Drawn frames.

    Attributes:
        ids: object that each pixel shows, -1 for none, top row first, shape (frames, height, width), int32.
        fragments: pixels of all triangles drawn, hidden ones included, shape (frames,), int64.
        inverse_depths: of what each pixel shows [1 / grid steps], 0 for nothing, shape as ids, float64; None unless
            asked for.
    """

    ids: np.ndarray
    fragments: np.ndarray
    inverse_depths: np.ndarray | None = None


def device_triangles(triangles: np.ndarray, device: Device = CPU) -> wp.array:
    """Triangles [grid steps], shape (m, 3, 3), int32, as `launch_raster` takes them."""
    return device.array(np.asarray(triangles).reshape(-1, 3, 3), wp.vec3i)


def launch_raster(
    triangles: wp.array,
    calls: np.ndarray,
    starts: np.ndarray,
    eyes: np.ndarray,
    axes: np.ndarray,
    *,
    width: int,
    height: int,
    focal: float,
    near: float,
    depths: bool = False,
    device: Device = CPU,
) -> Images:
    """The object that each pixel of each frame shows, and how deep it is.

    Args:
        triangles: of `device_triangles`, on the same device.
        calls: first triangle, one beyond the last, and object, of each draw, shape (n, 3), int.
        starts: draws of frame f are starts[f] : starts[f + 1], shape (frames + 1,), int.
        eyes: [grid steps], shape (frames, 3), float64.
        axes: right, up and forward as rows, shape (frames, 3, 3), float64.
        width: [pixels].
        height: [pixels].
        focal: [pixels], see `data.camera.Screen`.
        near: depth before which nothing is drawn [grid steps], > 0.
        depths: whether to keep depths, too.
        device: where to. CPU threads share the frames, one frame is drawn by one thread; on a GPU a thread draws a row.

    Returns:
        Images. The object is that of the ray through the pixel's centre, but where the centre lies within rounding
        (some 1e-9 pixels) of an edge, or two surfaces within rounding of one depth.

    Raises:
        InputError: a shape, a range of triangles beyond the array, or a size, focal length or near that is not
            positive.
    """
    frames = len(eyes)
    calls, starts = np.asarray(calls).reshape(-1, 3), np.asarray(starts)
    if starts.shape != (frames + 1,) or np.shape(axes) != (frames, 3, 3) or np.shape(eyes) != (frames, 3):
        raise InputError(
            f"frames: expected eyes (n, 3), axes (n, 3, 3) and starts (n + 1,); "
            f"found {np.shape(eyes)}, {np.shape(axes)} and {starts.shape}"
        )
    if starts[0] != 0 or starts[-1] != len(calls) or (np.diff(starts) < 0).any():
        raise InputError(f"starts: expected 0, ..., {len(calls)} (draws), ascending; found {starts}")
    if len(calls) and not (0 <= calls[:, 0].min() and calls[:, :2].max() <= len(triangles)):
        raise InputError(f"calls: expected triangles 0 to {len(triangles)}; found {calls[:, :2].min(axis=0)} and more")
    if not (width > 0 and height > 0 and focal > 0 and near > 0):
        raise InputError(
            f"screen: expected sizes, focal length and near above 0; found {width}, {height}, {focal}, {near}"
        )
    screen = {"focal": focal, "near": near, "width": width, "height": height}
    cameras = device.struct(Cameras, eyes=np.asarray(eyes), axes=np.asarray(axes), **screen)
    draws = device.struct(DrawCalls, starts=starts, calls=calls)
    bands = 1 if device.is_cpu else height
    ids = wp.full((frames, width * height), -1, dtype=int, device=device.name)
    fragments = device.zeros(frames * bands, wp.int64)
    inverse = wp.zeros((frames, width * height if depths else 0), dtype=f64, device=device.name)
    scratch, out = Scratch(width * -(-height // bands)), [ids, inverse, fragments]
    launch_slots(_raster, frames * bands, [cameras, draws, triangles, bands], scratch, out, device, chunk=1)
    counted, shape = fragments.numpy().reshape(frames, bands).sum(axis=1), (frames, height, width)
    return Images(ids.numpy().reshape(shape), counted, inverse.numpy().reshape(shape) if depths else None)
