"""A flat polygon with holes to triangles."""

from itertools import pairwise

import numpy as np

# Shares of an area that two ways to compute it may differ by.
SAME_SHARE = 1e-6


def ring_triangles(outer: np.ndarray, holes: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Triangles that cover a polygon but for its holes, which may touch it, one another, or reach beyond it.

    Args:
        outer: corners in order [m], shape (n, 3), finite; flat, or nearly.
        holes: each likewise, in the polygon's plane or beside it: they are moved into it along the polygon's normal.

    Returns:
        Vertices, shape (k, 3), float64, and faces turned as the polygon is, shape (m, 3), int64; no faces for none.
    """
    import mapbox_earcut

    normal = newell(outer)
    axis = int(np.abs(normal).argmax())
    if normal[axis] == 0:
        return outer, np.zeros((0, 3), np.int64)
    kept = [(1, 2), (2, 0), (0, 1)][axis] if normal[axis] > 0 else [(2, 1), (0, 2), (1, 0)][axis]
    rings = [outer, *(hole for hole in holes if len(hole) >= 3)]
    flat = [ring[:, kept] for ring in rings]
    points = np.concatenate(flat)
    ends = np.cumsum([len(ring) for ring in flat]).astype(np.uint32)
    faces = mapbox_earcut.triangulate_float64(points, ends).reshape(-1, 3).astype(np.int64)
    corners = points[faces]
    areas = _cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    faces[areas < 0] = faces[areas < 0][:, ::-1]
    whole = _area(flat[0])
    covered, wanted = np.abs(areas).sum(), whole - sum(abs(_area(ring)) for ring in flat[1:])
    if len(rings) > 1 and not abs(covered - wanted) <= SAME_SHARE * whole:
        points, faces = _slabs(flat[0], flat[1:])
    lifted = np.empty((len(points), 3))
    lifted[:, kept] = points
    # On the plane through the middle of the corners; corners of the polygon itself keep their places.
    along = outer.mean(axis=0) @ normal - points @ normal[list(kept)]
    lifted[:, axis] = along / normal[axis]
    if len(points) >= len(outer) and np.array_equal(points[: len(outer)], flat[0]):
        lifted[: len(outer)] = outer
    return lifted, faces


def newell(ring: np.ndarray) -> np.ndarray:
    """Normal of a polygon, as long as its area [m2], by Newell's formula."""
    relative = ring - ring[0]
    return np.cross(relative, np.roll(relative, -1, axis=0)).sum(axis=0) / 2


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _area(ring: np.ndarray) -> float:
    relative = ring - ring[0]
    return float(_cross(relative, np.roll(relative, -1, axis=0)).sum() / 2)


def _slabs(outer: np.ndarray, holes: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of what lies in one ring and in no other, cut into slabs at every corner and crossing; any rings."""
    rings = [outer, *holes]
    a = np.concatenate(rings)
    b = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    of = np.repeat(np.arange(len(rings)), [len(ring) for ring in rings])
    levels = np.unique(np.concatenate([a[:, 1], _crossings(a, b)]))
    points, faces = [], []
    for low, high in pairwise(levels):
        middle = (low + high) / 2
        cut = (np.minimum(a[:, 1], b[:, 1]) < middle) & (middle < np.maximum(a[:, 1], b[:, 1]))
        slope = (b[cut, 0] - a[cut, 0]) / (b[cut, 1] - a[cut, 1])
        at, *ends = (a[cut, 0] + (level - a[cut, 1]) * slope for level in (middle, low, high))
        order, inside, begin = np.argsort(at, kind="stable"), np.zeros(len(rings), bool), -1
        for edge in order:
            before = inside[0] and not inside[1:].any()
            inside[of[cut][edge]] ^= True
            after = inside[0] and not inside[1:].any()
            if after and not before:
                begin = edge
            elif before and not after:
                first = len(points)
                points += [(ends[0][begin], low), (ends[0][edge], low), (ends[1][edge], high), (ends[1][begin], high)]
                faces += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    vertices, names = np.unique(np.array(points).reshape(-1, 2), axis=0, return_inverse=True)
    named = names.reshape(-1)[np.array(faces, np.int64).reshape(-1, 3)]
    flat = (named[:, 0] == named[:, 1]) | (named[:, 1] == named[:, 2]) | (named[:, 2] == named[:, 0])
    return vertices, named[~flat]


def _crossings(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Heights at which edges ab cross each other."""
    d = b - a
    turn = _cross(d[:, None], d[None])
    between = a[None] - a[:, None]
    crossed = np.where(turn == 0, 1.0, turn)
    first, second = _cross(between, d[None]) / crossed, _cross(between, d[:, None]) / crossed
    meet = (turn != 0) & (first > 0) & (first < 1) & (second > 0) & (second < 1)
    return (a[:, None, 1] + first * d[:, None, 1])[meet]
