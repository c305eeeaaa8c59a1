"""Polygons to triangles."""

from collections.abc import Sequence

import mapbox_earcut
import numpy as np

# A polygon whose corners lie further from their common plane than this share of its size is bent.
BENT_SHARE = 1.0e-4


def polygon_triangles(vertices: Sequence, corners: Sequence[int]) -> list[tuple[int, int, int]]:
    """Triangles of a simple, flat polygon, which turn the way it turns; spikes add none.

    A polygon that is neither simple nor flat still gets triangles, none outside its outline as seen along its normal.

    Args:
        vertices: points, three numbers each.
        corners: at least 3 indices into `vertices`.
    """
    if len(corners) == 3:
        return [tuple(corners)]
    points = np.array([vertices[i] for i in corners], np.float64)
    return [tuple(corners[k] for k in ears) for ears in _ears(points)]


def triangulated(vertices: np.ndarray, corners: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Triangles of many polygons.

    Args:
        vertices: shape (n, 3), float64.
        corners: indices into `vertices`, polygon after polygon, int64.
        sizes: corners of each polygon, at least 3, shape (polygons,), int64.

    Returns:
        Triangles, shape (m, 3), in the order of the polygons; the polygon of each, shape (m,); how many are bent.
    """
    starts = np.concatenate([[0], np.cumsum(sizes)])
    small = np.flatnonzero(sizes == 3)
    faces, owners, bent = [corners[starts[small][:, None] + np.arange(3)]], [small], 0
    quads = np.flatnonzero(sizes == 4)
    if len(quads):
        four = corners[starts[quads][:, None] + np.arange(4)]
        points = vertices[four]
        convex = _convex_quads(points)
        faces.append(four[convex][:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3))
        owners.append(np.repeat(quads[convex], 2))
        bent += int(_bent_quads(points[convex]).sum())
        quads = quads[~convex]
    for polygon in [*quads, *np.flatnonzero(sizes > 4)]:
        ring = corners[starts[polygon] : starts[polygon + 1]]
        points = vertices[ring]
        bent += is_bent(points)
        faces.append(ring[np.array(_ears(points), np.int64).reshape(-1, 3)])
        owners.append(np.full(len(faces[-1]), polygon))
    owner = np.concatenate(owners).astype(np.int64)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(faces).astype(np.int64)[order], owner[order], bent


def newell(points: np.ndarray) -> np.ndarray:
    """Twice the area of a polygon along each axis: its normal by Newell's formula, shape (3,)."""
    about = points - points[0]
    return np.cross(about, np.roll(about, -1, axis=0)).sum(axis=0)


def is_bent(points: np.ndarray) -> bool:
    """Whether a polygon's corners, shape (n, 3), lie in no common plane."""
    normal = newell(points)
    length = np.linalg.norm(normal)
    size = np.ptp(points, axis=0).max()
    if not (np.isfinite(length) and length > 0):
        return False
    off = (points - points.mean(axis=0)) @ (normal / length)
    return bool(np.abs(off).max() > BENT_SHARE * size)


def _convex_quads(points: np.ndarray) -> np.ndarray:
    """Whether each quad, shape (n, 4, 3), turns the same way at all corners, so that any diagonal lies inside it."""
    with np.errstate(over="ignore", invalid="ignore"):
        edges = np.roll(points, -1, axis=1) - points
        turns = np.cross(np.roll(edges, 1, axis=1), edges)
        normal = np.cross(points[:, 2] - points[:, 0], points[:, 3] - points[:, 1])
        return ((turns * normal[:, None]).sum(axis=2) > 0).all(axis=1)


def _bent_quads(points: np.ndarray) -> np.ndarray:
    """As `is_bent`, for convex quads, shape (n, 4, 3)."""
    normal = np.cross(points[:, 2] - points[:, 0], points[:, 3] - points[:, 1])
    length = np.linalg.norm(normal, axis=1)
    # Along the normal the diagonals are as far apart as the corners are off their plane, twice.
    apart = np.abs(((points[:, 1] - points[:, 0]) * normal).sum(axis=1)) / np.where(length > 0, length, 1) / 2
    return apart > BENT_SHARE * np.ptp(points, axis=1).max(axis=1)


def _ears(points: np.ndarray) -> list[tuple[int, int, int]]:
    """Triangles of a polygon, as places among its corners."""
    count = len(points)
    flat = _flattened(points)
    fan = [(0, k, k + 1) for k in range(1, count - 1)]
    if not np.isfinite(flat).all():
        return fan
    ring = [k for k in range(count) if not np.array_equal(flat[k], flat[k - 1])]
    if len(ring) < 3:
        return fan
    found = mapbox_earcut.triangulate_float64(
        np.ascontiguousarray(flat[ring] - flat[ring[0]]), np.array([len(ring)], np.uint32)
    )
    if not len(found):
        return fan
    triangles = np.array(ring)[found.reshape(-1, 3).astype(np.int64)]
    return [tuple(map(int, one)) for one in triangles]


def _flattened(points: np.ndarray) -> np.ndarray:
    """The polygon in the coordinate plane where its area is largest, counterclockwise, shape (n, 2)."""
    with np.errstate(over="ignore", invalid="ignore"):
        normal = newell(points)
    axis = int(np.abs(normal).argmax())
    kept = [(1, 2), (2, 0), (0, 1)][axis]
    flat = points[:, kept]
    return flat if normal[axis] >= 0 else flat * [1, -1]
