"""Objects populated into cells: which cells an object lies in, wholly or partly, and how much of it lies there.

Source: Funkhouser et al. 1996, section 3.1. Beyond the paper: the object's box is clipped to the cell by its triangles,
so that a slab or an L-shaped wall does not fill the empty corners of its bounding box.
"""

from dataclasses import dataclass

import numpy as np

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


def populate(scene: Scene, cells: np.ndarray) -> Incidence:
    """Incidence of all objects, opaque or not, with the cells [grid steps], shape (n, 2, 3), int32."""
    triangles, owners = scene.triangles()
    starts = np.searchsorted(owners, np.arange(len(scene.objects) + 1))
    bounds = scene.object_bounds()
    cell, object_id, boxes, whole = [], [], [], []
    for index in range(len(scene.objects)):
        part = triangles[starts[index] : starts[index + 1]]
        if not len(part):
            continue
        low, high = bounds[index]
        near = np.flatnonzero((cells[:, 0] <= high).all(axis=1) & (cells[:, 1] >= low).all(axis=1))
        inside = (cells[near, 0] < low).all(axis=1) & (cells[near, 1] > high).all(axis=1)
        if inside.any():
            near, clipped = near[inside], bounds[index][None]
        else:
            near, clipped = _clip_to_cells(part, cells, near)
        cell.append(near)
        object_id.append(np.full(len(near), index))
        boxes.append(clipped)
        whole.append(np.full(len(near), bool(inside.any())))
    if not cell:
        cell, object_id, boxes, whole = (
            [np.zeros(0, int)],
            [np.zeros(0, int)],
            [np.zeros((0, 2, 3))],
            [np.zeros(0, bool)],
        )
    rows = np.concatenate(cell)
    order = np.argsort(rows, kind="stable")
    rows = rows[order].astype(np.int32)
    return Incidence(
        rows,
        np.concatenate([np.zeros(0, int), *object_id])[order].astype(np.int32),
        np.concatenate([np.zeros((0, 2, 3), int), *boxes])[order].astype(np.int32),
        np.concatenate([np.zeros(0, bool), *whole])[order],
        np.searchsorted(rows, np.arange(len(cells) + 1)),
    )


def _clip_to_cells(part: np.ndarray, cells: np.ndarray, near: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cells that hold surface of the triangles, and its bounds there."""
    found = np.empty((len(near), 2, 3), np.int64)
    found[:, 0], found[:, 1] = 2**30, -(2**30)
    low, high = part.min(axis=1), part.max(axis=1)
    step = max(1, CHUNK // len(part))
    for begin in range(0, len(near), step):
        boxes = cells[near[begin : begin + step]]
        overlap = (low[None] <= boxes[:, None, 1]).all(axis=2) & (high[None] >= boxes[:, None, 0]).all(axis=2)
        which, t = np.nonzero(overlap)
        ok, clipped = clip_bounds(part[t], boxes[which])
        np.minimum.at(found[begin : begin + step, 0], which[ok], clipped[ok, 0])
        np.maximum.at(found[begin : begin + step, 1], which[ok], clipped[ok, 1])
    kept = (found[:, 0] <= found[:, 1]).all(axis=1)
    # Contact along a line or in a point shows nothing to an open set of sightlines.
    kept &= (found[:, 1] > found[:, 0]).sum(axis=1) >= 2
    return near[kept], found[kept]


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
            corners, used = _clip_plane(corners, used, axis, boxes[:, side, axis].astype(float), sign)
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
