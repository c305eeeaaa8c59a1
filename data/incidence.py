"""Objects populated into cells: which cells an object lies in, wholly or partly, and how much of it lies there.

Source: Funkhouser et al. 1996, section 3.1. Beyond the paper: the object's box is clipped to the cell by its triangles,
so that a slab or an L-shaped wall does not fill the empty corners of its bounding box.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .contents import contents
from .ragged import owners_of, places_of
from .scene import Scene

CHUNK = 200_000


@dataclass
class Incidence:
    """One row for each (cell, object) with surface in the closed cell, ordered by cell, then object.

    Attributes:
        cell: shape (n,), int32.
        object_id: shape (n,), int32.
        boxes: bounds of the object's surface inside the closed cell [grid steps], shape (n, 2, 3), int32.
        whole: whether the object lies wholly in this cell, shape (n,), bool.
        starts: rows of cell c are starts[c]:starts[c + 1], shape (cells + 1,), int64.
    """

    cell: np.ndarray
    object_id: np.ndarray
    boxes: np.ndarray
    whole: np.ndarray
    starts: np.ndarray


def clip_rows(triangles: np.ndarray, ranges: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Bounds of what closed boxes hold of lists of triangles; as kernels/clip.py, whose reference it is."""
    found = np.empty((len(boxes), 2, 3), np.int64)
    found[:, 0], found[:, 1] = 2**30, -(2**30)
    sizes = ranges[:, 1] - ranges[:, 0]
    ends = np.cumsum(sizes)
    begin = 0
    while begin < len(boxes):
        stop = max(begin + 1, int(np.searchsorted(ends, ends[begin] - sizes[begin] + CHUNK)))
        part = sizes[begin:stop]
        row = begin + np.repeat(np.arange(len(part)), part)
        t = places_of(ranges[begin:stop, 0], part)
        near = (triangles[t].min(axis=1) <= boxes[row, 1]).all(axis=1)
        near &= (triangles[t].max(axis=1) >= boxes[row, 0]).all(axis=1)
        row, t = row[near], t[near]
        left, clipped = clip_bounds(triangles[t], boxes[row])
        np.minimum.at(found[:, 0], row[left], clipped[left, 0])
        np.maximum.at(found[:, 1], row[left], clipped[left, 1])
        begin = stop
    return found


def populate(scene: Scene, cells: np.ndarray, clip: Callable[..., np.ndarray] = clip_rows) -> Incidence:
    """Incidence of all objects, opaque or not, with the cells [grid steps], shape (n, 2, 3), int32.

    `clip` gives bounds as `clip_rows` does; kernels/clip.py is faster.
    """
    triangles, starts = scene.triangles()[0], scene.triangle_starts
    bounds = scene.object_bounds()
    near, rows = contents(bounds, cells)
    objects = owners_of(near)
    low, high = bounds[objects].transpose(1, 0, 2)
    within = (cells[rows, 0] <= low).all(axis=1) & (cells[rows, 1] >= high).all(axis=1)
    within &= np.diff(near)[objects] == 1
    boxes = bounds[objects]
    own = objects[~within]
    boxes[~within] = clip(triangles, np.column_stack([starts[own], starts[own + 1]]), cells[rows[~within]])
    kept = (boxes[:, 0] <= boxes[:, 1]).all(axis=1)
    # Contact along a line or in a point shows nothing to an open set of sightlines.
    kept &= (boxes[:, 1] > boxes[:, 0]).sum(axis=1) >= 2
    order = np.flatnonzero(kept)
    order = order[np.argsort(rows[order], kind="stable")]
    rows = rows[order].astype(np.int32)
    return Incidence(
        rows,
        objects[order].astype(np.int32),
        boxes[order].astype(np.int32),
        within[order],
        np.searchsorted(rows, np.arange(len(cells) + 1)),
    )


def clip_bounds(triangles: np.ndarray, boxes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Integer bounds, rounded outward, of each triangle clipped to the closed box of the same row.

    Args:
        triangles: [grid steps], shape (n, 3, 3), int.
        boxes: [grid steps], shape (n, 2, 3), int.

    Returns:
        Whether a polygon (three corners or more) is left, shape (n,), bool; its bounds, shape (n, 2, 3), int64.
    """
    count = len(triangles)
    corners = np.zeros((count, 9, 3))
    corners[:, :3] = triangles
    used = np.zeros((count, 9), bool)
    used[:, :3] = True
    for axis in range(3):
        for side, sign in ((0, 1.0), (1, -1.0)):
            plane = boxes[:, side, axis].astype(float)
            # Most triangles end before most sides of their boxes.
            rows = np.flatnonzero((used & (sign * (corners[:, :, axis] - plane[:, None]) < 0)).any(axis=1))
            corners[rows], used[rows] = _clip_plane(corners[rows], used[rows], axis, plane[rows], sign)
    low = np.where(used[:, :, None], corners, np.inf).min(axis=1)
    high = np.where(used[:, :, None], corners, -np.inf).max(axis=1)
    left = used.sum(axis=1) >= 3
    low[~left], high[~left] = 0.0, 0.0
    # Rounding of the crossings is far below one step; the outward rounding absorbs it, the clamps are exact.
    low = np.maximum(np.floor(low - 1e-6), np.maximum(triangles.min(axis=1), boxes[:, 0]))
    high = np.minimum(np.ceil(high + 1e-6), np.minimum(triangles.max(axis=1), boxes[:, 1]))
    return left, np.stack([low, high], axis=1).astype(np.int64)


def _clip_plane(
    corners: np.ndarray, used: np.ndarray, axis: int, plane: np.ndarray, sign: float
) -> tuple[np.ndarray, np.ndarray]:
    """Sutherland-Hodgman against sign * (x_axis - plane) >= 0, all polygons at once; used corners come first."""
    count, room = used.shape
    index = np.arange(count)[:, None]
    sizes = used.sum(axis=1)
    after = np.where(np.arange(room)[None] + 1 >= sizes[:, None], 0, np.arange(room)[None] + 1)
    following = corners[index, after]
    here, there = sign * (corners[:, :, axis] - plane[:, None]), sign * (following[:, :, axis] - plane[:, None])
    crossing = used & (here * there < 0)
    share = np.divide(here, here - there, out=np.zeros_like(here), where=crossing)
    points = corners + share[:, :, None] * (following - corners)
    points[:, :, axis] = np.where(crossing, plane[:, None], points[:, :, axis])
    both = np.stack([corners, points], axis=2).reshape(count, 2 * room, 3)
    keep = np.stack([used & (here >= 0), crossing], axis=2).reshape(count, 2 * room)
    order = np.argsort(~keep, axis=1, kind="stable")[:, :room]
    return both[index, order], keep[index, order]
