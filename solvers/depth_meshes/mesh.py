"""A depth image as few triangles, with a proved bound on what each texel is off by.

Vertices are pixels of the image, heights are texels of parallax (parallax.py). Greedy insertion is a library's business
(pydelatin: Garland and Heckbert 1995, "Fast polygonal approximation of terrains"); that every texel that shows
something lies on the mesh, and how far from where it should, is found here from the mesh as it is stored: which
triangles hold a pixel is decided in integers.

Pixels that show nothing are transparent, so their heights are free: they take those of the nearest pixel that does show
something, and no triangles are spent on silhouettes against the sky.

Source: Aliaga et al. 1999, sections 3.1 and 3.3 (textured depth meshes, simplified; greedy search; skins).
"""

import numpy as np
from pydelatin import Delatin
from scipy import ndimage

from ...data.depth_meshes import PARALLAX_STEP, DepthMesh
from ...data.errors import InputError
from ...data.ragged import lots, owners_of, places_of, starts_of
from .parallax import ROUNDING

# Pixels of triangles' boxes that are looked at together.
PIXELS = 2_000_000


def depth_mesh(parallax: np.ndarray, shown: np.ndarray, error: float, *, most: int | None = None) -> DepthMesh:
    """Triangles that keep every texel within an error, as few as greedy insertion finds.

    Args:
        parallax: of each pixel [texels], shape (height, width), float64, finite, both sizes from 2 to 65,536.
        shown: whether it shows something, same shape, bool.
        error: texels that its parallax may be off by, > 0.
        most: triangles at which to stop, or at one more, whatever the error; None for none.

    Returns:
        A mesh; its own `error` is what was found, at most some 1e-6 of the largest parallax, or half a PARALLAX_STEP
        if that is more than was asked for, above it. Vertices by rows; of each triangle the first one first, and
        triangles by vertices. Without any where nothing is shown.

    Raises:
        InputError: a shape, size, value or error out of range.
    """
    if parallax.ndim != 2 or parallax.shape != shown.shape or not all(2 <= n <= 2**16 for n in parallax.shape):
        raise InputError(f"parallax: expected an image of 2 to 65,536 pixels a side, found shape {parallax.shape}")
    if not np.isfinite(parallax).all():
        raise InputError("parallax: expected finite numbers, found others")
    if not error > 0:
        raise InputError(f"error: expected texels above 0, found {error}")
    if not shown.any():
        empty = np.zeros((0, 2), np.uint16), np.zeros(0, np.float32), np.zeros((0, 3), np.uint32)
        return DepthMesh(*empty, 0.0)
    nearest = ndimage.distance_transform_edt(~shown, return_distances=False, return_indices=True)
    heights = parallax[tuple(nearest)].astype(np.float32)
    # Vertices are rounded as they are stored.
    found = Delatin(heights, max_error=max(error - PARALLAX_STEP / 2, error / 2), max_triangles=most)
    # The library counts rows from below.
    column, row = found.vertices[:, 0].astype(np.int64), len(heights) - 1 - found.vertices[:, 1].astype(np.int64)
    order = np.lexsort((column, row))
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    pixels, triangles = np.column_stack([column, row])[order], place[found.triangles.astype(np.int64)]
    drawn = np.round(heights[row, column][order].astype(np.float64) / PARALLAX_STEP) * PARALLAX_STEP
    kept, off = _measure(pixels, drawn, triangles, parallax, shown)
    used, triangles = np.unique(triangles[kept], return_inverse=True)
    return DepthMesh(pixels[used].astype(np.uint16), drawn[used].astype(np.float32), _in_order(triangles), off)


def _in_order(triangles: np.ndarray) -> np.ndarray:
    """Triangles, each turned until its first vertex is first, by vertices; shape (m, 3), uint32."""
    triangles = triangles.reshape(-1, 3)
    first = triangles.argmin(axis=1)[:, None]
    turned = np.take_along_axis(triangles, (first + np.arange(3)) % 3, axis=1)
    return turned[np.lexsort(turned.T[::-1])].astype(np.uint32)


def _measure(
    pixels: np.ndarray, heights: np.ndarray, triangles: np.ndarray, parallax: np.ndarray, shown: np.ndarray
) -> tuple[np.ndarray, float]:
    """Triangles that hold a pixel that shows something, shape (m,), bool; and the most that such a pixel is off by.

    Infinite if a pixel lies in no triangle.
    """
    corners = pixels[triangles]
    # All turn the same way; the library makes none without an area.
    turned = _area(*corners.transpose(1, 0, 2)) < 0
    corners[turned] = corners[turned][:, ::-1]
    ends = heights[np.where(turned[:, None], triangles[:, ::-1], triangles)]
    low, high = corners[..., 1].min(axis=1), corners[..., 1].max(axis=1)
    kept, held, most = np.zeros(len(triangles), bool), np.zeros(shown.shape, bool), 0.0
    for first, stop in lots((high - low + 1) * np.ptp(corners[..., 0], axis=1), PIXELS):
        rows = high[first:stop] - low[first:stop] + 1
        own, y = owners_of(starts_of(rows)) + first, places_of(low[first:stop], rows)
        begin, end = _spans(corners[own], y)
        width = np.maximum(end - begin + 1, 0)
        own, y, x = np.repeat(own, width), np.repeat(y, width), places_of(begin, width)
        there = shown[y, x]
        own, at = own[there], np.column_stack([x[there], y[there]])
        around = corners.take(own, axis=0)
        # Twice the areas that a pixel cuts off: integers of at most 2^33, none of them negative.
        areas = np.stack([_area(around[:, k - 2], around[:, k - 1], at) for k in range(3)], axis=1)
        drawn = (areas * ends.take(own, axis=0)).sum(axis=1) / areas.sum(axis=1)
        kept[own], held[at[:, 1], at[:, 0]] = True, True
        most = max(most, float(np.abs(drawn - parallax[at[:, 1], at[:, 0]]).max(initial=0.0)))
    if (shown & ~held).any():
        return kept, np.inf
    return kept, most * ROUNDING + float(np.abs(heights).max()) * (ROUNDING - 1)


def _spans(corners: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and last column of each row of pixels that a triangle holds, edges included; first above last for none.

    Args:
        corners: of triangles whose area is positive, shape (n, 3, 2), int64.
        y: rows between their lowest and highest corner, shape (n,), int64.
    """
    begin, end = corners[..., 0].min(axis=1), corners[..., 0].max(axis=1)
    for k in range(3):
        a, (dx, dy) = corners[:, k], (corners[:, (k + 1) % 3] - corners[:, k]).T
        # dy x <= side holds for the columns on the inner side of an edge.
        side = dx * (y - a[:, 1]) + dy * a[:, 0]
        end = np.where(dy > 0, np.minimum(end, side // np.where(dy > 0, dy, 1)), end)
        begin = np.where(dy < 0, np.maximum(begin, -(side // np.where(dy < 0, -dy, 1))), begin)
    return begin, end


def _area(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Twice the signed areas of triangles, integers."""
    return (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
