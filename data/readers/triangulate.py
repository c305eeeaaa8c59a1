"""Polygons to triangles."""

from collections.abc import Sequence

import numpy as np


def polygon_triangles(vertices: Sequence, corners: list[int]) -> list[tuple[int, int, int]]:
    """Triangles of a simple, flat polygon: a fan where it is convex, else ears cut off one by one.

    A polygon that is neither simple nor flat still gets triangles, as a fan over what is left.

    Args:
        vertices: points, three numbers each.
        corners: at least 3 indices into `vertices`.
    """
    if len(corners) == 3:
        return [tuple(corners)]
    flat = _flattened(np.array([vertices[i] for i in corners], np.float64))
    left, triangles = list(range(len(corners))), []
    while len(left) > 3:
        at = next((k for k in range(len(left)) if _is_ear(flat, left, k)), 0)
        before, after = left[at - 1], left[(at + 1) % len(left)]
        triangles.append((corners[before], corners[left[at]], corners[after]))
        del left[at]
    return [*triangles, tuple(corners[k] for k in left)]


def _flattened(points: np.ndarray) -> np.ndarray:
    """The polygon in the coordinate plane where its area is largest, counterclockwise, shape (n, 2)."""
    normal = np.cross(points - points[0], np.roll(points, -1, axis=0) - points[0]).sum(axis=0)
    axis = int(np.abs(normal).argmax())
    kept = [(1, 2), (2, 0), (0, 1)][axis]
    flat = points[:, kept]
    return flat if normal[axis] >= 0 else flat * [1, -1]


def _is_ear(flat: np.ndarray, left: list[int], at: int) -> bool:
    """Whether the corner is convex and no other corner lies in its triangle."""
    a, b, c = flat[left[at - 1]], flat[left[at]], flat[left[(at + 1) % len(left)]]
    if _cross(a, b, c) <= 0:
        return False
    others = [k for k in left if not any(np.array_equal(flat[k], p) for p in (a, b, c))]
    return not any(min(_cross(a, b, flat[k]), _cross(b, c, flat[k]), _cross(c, a, flat[k])) >= 0 for k in others)


def _cross(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
