"""Boxes against conservative cube maps (kernels/coverage.py): does a map cover all of a box?

Overestimated: every pixel that the box touches must be covered more nearly than the box's nearest point in that pixel.
The pyramid of least values ends the test of most large boxes early. Source: Chhugani et al. 2005, section 5.2; Greene
et al. 1993, "Hierarchical Z-buffer visibility".
"""

import numpy as np
import warp as wp

from ..data.errors import InputError
from ..data.verdict import Verdict
from .coverage import CubeMaps, Maps, border, level_start
from .launch import launch_rows

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

# Share of a sum of absolute values by which float64 is widened after an operation or two.
WIDENED = wp.constant(wp.float64(2.0**-50))
UP = wp.constant(wp.float64(1.0 + 2.0**-50))
DOWN = wp.constant(wp.float64(1.0 - 2.0**-50))
FAR = wp.constant(wp.float64(1.0e300))


@wp.func
def reciprocal_range(low: f64, high: f64, begin: f64, end: f64) -> wp.vec2d:
    """Least and greatest 1 / depth at which [low, high] / depth meets [begin, end]; empty if least > greatest.

    That is low / depth <= end and high / depth >= begin, both linear in 1 / depth; rounded outwards.
    """
    least = f64(0.0)
    most = FAR
    if low > f64(0.0):
        most = wp.min(most, end / low)
    elif low < f64(0.0):
        least = wp.max(least, end / low)
    elif end < f64(0.0):
        most = f64(-1.0)
    if high < f64(0.0):
        most = wp.min(most, begin / high)
    elif high > f64(0.0):
        least = wp.max(least, begin / high)
    elif begin > f64(0.0):
        most = f64(-1.0)
    return wp.vec2d(least * DOWN, most * UP)


@wp.func
def face_covers(maps: Maps, slot: int, size: int, levels: int, low: wp.vec3d, high: wp.vec3d) -> bool:
    """Whether every pixel of an image that the box (a, b, depth) touches is nearer than the box.

    Walks the pyramid from its top; given the depth, a box and a pixel's cone overlap on each axis on its own, so
    the box's nearest depth within a pixel is exact.
    """
    level = int(levels)
    i = int(0)
    j = int(0)
    going = bool(True)
    nearest = FAR
    if low[2] > f64(0.0):
        nearest = UP / low[2]
    while going:
        width = size >> level
        a = reciprocal_range(low[0], high[0], border(i, width), border(i + 1, width))
        b = reciprocal_range(low[1], high[1], border(j, width), border(j + 1, width))
        least = wp.max(wp.max(a[0], b[0]), DOWN / high[2])
        most = wp.min(wp.min(a[1], b[1]), nearest)
        covered = bool(least > most)
        if not covered:
            covered = f64(maps.images[slot, level_start(size, level) + j * width + i]) > most
        if not covered:
            if level == 0:
                return False
            level -= 1
            i *= 2
            j *= 2
        else:
            while level < levels and (i & 1) == 1 and (j & 1) == 1:
                level += 1
                i = i >> 1
                j = j >> 1
            if level == levels:
                going = False
            elif (i & 1) == 0:
                i += 1
            else:
                i -= 1
                j += 1
    return True


@wp.func
def map_covers(maps: Maps, m: int, size: int, levels: int, low: wp.vec3d, high: wp.vec3d) -> bool:
    """Whether map m covers a box given relative to its viewpoint; never if that is inside, where no depth is least."""
    # A point at the viewpoint is in no face's pyramid: nothing would be asked of it.
    if wp.max(low[0], wp.max(low[1], low[2])) <= f64(0.0) and wp.min(high[0], wp.min(high[1], high[2])) >= f64(0.0):
        return False
    for face in range(6):
        axis = int(face // 2)
        u = int((axis + 1) % 3)
        v = int((axis + 2) % 3)
        far = high[axis]
        near = low[axis]
        if face % 2 == 1:
            far = -low[axis]
            near = -high[axis]
        # The box meets the face's pyramid |u| <= depth, |v| <= depth.
        if far > f64(0.0) and far >= wp.max(wp.max(low[u], -high[u]), wp.max(low[v], -high[v])):
            slot = maps.slots[6 * m + face]
            if slot < 0:
                return False
            box_low = wp.vec3d(low[u], low[v], near)
            box_high = wp.vec3d(high[u], high[v], far)
            if not face_covers(maps, slot, size, levels, box_low, box_high):
                return False
    return True


@wp.kernel
def _occludees(
    maps: Maps,
    size: int,
    levels: int,
    boxes_low: wp.array[wp.vec3i],
    boxes_high: wp.array[wp.vec3i],
    rows: wp.array[wp.vec2i],
    first: int,
    verdict_out: wp.array[wp.uint8],
):
    row = first + wp.tid()
    pair = rows[row]
    eye = maps.viewpoints[pair[1]]
    low = wp.vec3d()
    high = wp.vec3d()
    for c in range(3):
        a = f64(boxes_low[pair[0]][c])
        b = f64(boxes_high[pair[0]][c])
        low[c] = a - eye[c] - (wp.abs(a) + wp.abs(eye[c])) * WIDENED
        high[c] = b - eye[c] + (wp.abs(b) + wp.abs(eye[c])) * WIDENED
    verdict_out[row] = wp.uint8(Verdict.UNKNOWN)
    if map_covers(maps, pair[1], size, levels, low, high):
        verdict_out[row] = wp.uint8(Verdict.HIDDEN)


def launch_occludees(maps: CubeMaps, boxes: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Verdicts on boxes that a map covers: everything in them lies behind a polygon, as seen from the map's viewpoint.

    Args:
        maps: from `launch_coverage`.
        boxes: closed boxes [grid steps], shape (n, 2, 3), int32.
        rows: (box, map), shape (m, 2), int.

    Returns:
        `Verdict` of each row, shape (m,), uint8. HIDDEN is never wrong; UNKNOWN says nothing. Boxes that hold the
        viewpoint, on their boundary too, are UNKNOWN.

    Raises:
        InputError: a shape, or a row that names no box or no map.
    """
    boxes, rows = np.asarray(boxes), np.ascontiguousarray(rows, np.int32)
    if boxes.shape[1:] != (2, 3) or rows.ndim != 2 or rows.shape[1] != 2:
        raise InputError(f"boxes, rows: expected shapes (n, 2, 3) and (m, 2), found {boxes.shape} and {rows.shape}")
    limits = (len(boxes), len(maps.arrays.viewpoints))
    if len(rows) and ((rows < 0).any() or (rows.max(axis=0) >= limits).any()):
        raise InputError(f"rows: expected pairs below {limits}, found {rows.min(axis=0)} to {rows.max(axis=0)}")
    low, high = (maps.device.corners(boxes[:, end]) for end in (0, 1))
    verdict = maps.device.zeros(len(rows), wp.uint8)
    inputs = [maps.arrays, maps.resolution, maps.resolution.bit_length() - 1, low, high]
    launch_rows(_occludees, len(rows), [*inputs, maps.device.array(rows, wp.vec2i)], [verdict], maps.device)
    return verdict.numpy()
