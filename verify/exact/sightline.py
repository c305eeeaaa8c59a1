"""Is a sightline clear? Exact verdicts for segments against triangles, and for points against solids.

Float64 with a rigorous error bound decides almost all; what it cannot decide goes to Python integers. Shares no
code with `kernels/`. Source of the bounds: Shewchuk 1997, "Adaptive Precision Floating-Point Arithmetic", orient3d
stage A.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from enum import IntEnum
from functools import cached_property

import numpy as np

from ...data.errors import InputError
from .boxtree import BoxTree
from .segment import MISS, column_crossing, crossing_kind

BATCH = 16384
THREADS = 2
# Stage A of orient3d is (7 + 56 eps) eps, eps = 2**-53; doubled for the sums that NumPy may order differently.
BOUND = 16 * 2.0**-53
# Products of tiny differences may underflow; below this size a determinant's sign is left to integers.
UNDERFLOW = 1e-250


class Sight(IntEnum):
    """What an open segment meets: nothing, at most edges, vertices and coplanar triangles, or a triangle's inside."""

    CLEAR = 0
    GRAZE = 1
    BLOCKED = 2


class Sightlines:
    """Exact adjudication of segments and points against one set of triangles."""

    def __init__(self, triangles: np.ndarray, owners: np.ndarray | None = None):
        """Take the triangles.

        Args:
            triangles: corners [grid steps], shape (m, 3, 3), integers, |coordinate| <= 2**25, none degenerate.
            owners: object_id of each triangle, shape (m,); needed for `outside_solids`.
        """
        self.triangles = np.asarray(triangles, np.int64)
        self.owners = np.zeros(len(self.triangles), np.int32) if owners is None else np.asarray(owners)
        self._corners = self.triangles.astype(np.float64)
        # Differences are below 2**26 and their products below 2**52: the normal is exact in float64.
        edges = self.triangles[:, 1:] - self.triangles[:, :1]
        self._normals = np.cross(edges[:, 0], edges[:, 1]).astype(np.float64)

    @cached_property
    def _tree(self) -> BoxTree:
        return BoxTree(self.triangles.min(axis=1), self.triangles.max(axis=1))

    def check(self, origins: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """What each open segment (origin, end) meets.

        Args:
            origins: segment starts [grid steps], shape (n, 3), float64, any finite values.
            ends: segment ends, likewise.

        Returns:
            Values of `Sight`, shape (n,), uint8; exact for the doubles given. A crossing through the common edge of two
            triangles is a GRAZE even if they block together.

        Raises:
            InputError: the shapes differ or a value is not finite.
        """
        segments, _, kinds = self.hits(origins, ends)
        verdicts = np.zeros(len(origins), np.uint8)
        np.maximum.at(verdicts, segments, kinds)
        return verdicts

    def hits(self, origins: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """All (segment, triangle, Sight.GRAZE or Sight.BLOCKED) that meet; arguments and errors as for `check`."""
        origins, ends = _points(origins, "origins"), _points(ends, "ends")
        if origins.shape != ends.shape:
            raise InputError(f"ends: expected shape {origins.shape} like origins, found {ends.shape}")
        if not len(self.triangles):
            return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0, np.uint8)
        return _batched(lambda part: self._hits(origins[part], ends[part]), len(origins))

    def _hits(self, origins: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        segments, ids = self._tree.candidates(origins, ends)
        with np.errstate(over="ignore", invalid="ignore", under="ignore"):
            before = self._plane_side(ids, origins[segments])
            after = self._plane_side(ids, ends[segments])
            keep = before * after <= 0
            segments, ids, before, after = segments[keep], ids[keep], before[keep], after[keep]
            turns = self._edge_turns(ids, origins[segments], ends[segments])
        certain = (before * after < 0) & (turns != 0).all(axis=1)
        crossing = certain & (np.abs(turns.sum(axis=1)) == 3)
        kinds = np.where(crossing, Sight.BLOCKED, MISS).astype(np.uint8)
        # The line surely passes two edges on opposite sides: it misses the triangle, whatever the third.
        apart = (turns == 1).any(axis=1) & (turns == -1).any(axis=1)
        for pair in np.flatnonzero(~certain & ~apart):
            s = segments[pair]
            kinds[pair] = crossing_kind(origins[s], ends[s], self.triangles[ids[pair]])
        met = kinds != MISS
        return segments[met], ids[met], kinds[met]

    def _plane_side(self, ids: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Sign of each point against its triangle's plane; 0 where float64 cannot tell."""
        normals = self._normals[ids]
        normals *= points - self._corners[ids, 0]
        return sure_sign(normals[:, 0] + normals[:, 1] + normals[:, 2], np.abs(normals).sum(axis=1))

    def _edge_turns(self, ids: np.ndarray, origins: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """Signs of the lines against the triangles' three edges, shape (pairs, 3); 0 where float64 cannot tell."""
        along = ends - origins
        corners = [self._corners[ids, c] - origins for c in range(3)]
        turns = np.empty((len(ids), 3), np.int8)
        for edge in range(3):
            a, b = corners[edge], corners[(edge + 1) % 3]
            value, size = np.zeros(len(ids)), np.zeros(len(ids))
            for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
                left, right = a[:, j] * b[:, k], a[:, k] * b[:, j]
                value += along[:, i] * (left - right)
                size += np.abs(along[:, i]) * (np.abs(left) + np.abs(right))
            turns[:, edge] = sure_sign(value, size)
        return turns

    @cached_property
    def closed_owners(self) -> np.ndarray:
        """Objects whose triangles close: every directed edge is matched by its opposite, corners welded where equal."""
        return closed_objects(self.triangles, self.owners)

    @cached_property
    def _solids(self) -> tuple[np.ndarray, np.ndarray, BoxTree]:
        """Boxes of the closed objects, shape (2, objects, 3), each object's place among them (-1: open), their tree."""
        closed = self.closed_owners
        place = np.full(int(self.owners.max(initial=0)) + 1, -1)
        place[closed] = np.arange(len(closed))
        part = place[self.owners]
        bounds = np.empty((2, len(closed), 3), np.int64)
        bounds[0], bounds[1] = 2**30, -(2**30)
        np.minimum.at(bounds[0], part[part >= 0], self.triangles[part >= 0].min(axis=1))
        np.maximum.at(bounds[1], part[part >= 0], self.triangles[part >= 0].max(axis=1))
        return bounds, place, BoxTree(*bounds)

    def outside_solids(self, points: np.ndarray) -> np.ndarray:
        """Whether each point lies strictly outside every closed object, each object taken alone.

        Args:
            points: [grid steps], shape (n, 3), float64, any finite values.

        Returns:
            Shape (n,), bool, exact: the winding number about every closed object is 0 and the point is on none of their
            triangles. Open objects have no inside.

        Raises:
            InputError: the shape, or a value that is not finite.
        """
        points = _points(points, "points")
        outside = np.ones(len(points), bool)
        if len(self.closed_owners):
            inside = _batched(lambda part: (self._inside(points[part]),), len(points))[0]
            outside[inside] = False
        return outside

    def _inside(self, points: np.ndarray) -> np.ndarray:
        """Points on or inside a closed object: count the signed crossings of the column above each, by object.

        Only objects whose box holds the point are looked at, and columns end above their boxes.
        """
        bounds, place, tree = self._solids
        held, by = tree.candidates(points, points)
        count = len(self.closed_owners)
        pairs = np.sort(held * count + by)
        tops = np.full(len(points), -np.inf)
        np.maximum.at(tops, held, bounds[1, by, 2] + 1.0)
        chosen = np.flatnonzero(tops > -np.inf)
        top = points[chosen].copy()
        top[:, 2] = np.maximum(top[:, 2], tops[chosen])
        which, ids = self._tree.candidates(points[chosen], top)
        which, object_place = chosen[which], place[self.owners[ids]]
        keys = which * count + object_place
        known = (object_place >= 0) & (pairs[np.minimum(np.searchsorted(pairs, keys), max(len(pairs) - 1, 0))] == keys)
        which, ids, keys = which[known], ids[known], keys[known]
        with np.errstate(over="ignore", invalid="ignore", under="ignore"):
            side = self._plane_side(ids, points[which])
            turns = self._column_turns(ids, points[which])
        upward = np.sign(self._normals[ids, 2])
        apart = (turns == 1).any(axis=1) & (turns == -1).any(axis=1)
        certain = (side != 0) & (turns != 0).all(axis=1) & (upward != 0)
        crossing = np.where(certain & ~apart & (side * upward < 0), upward, 0).astype(np.int64)
        touched = [np.zeros(0, np.int64)]
        # A steep triangle, or one that the column surely misses, counts only if the point lies on it.
        for pair in np.flatnonzero(~certain & ~(apart & (upward != 0)) & ~((upward == 0) & (side != 0))):
            crossing[pair], on = column_crossing(points[which[pair]], self.triangles[ids[pair]])
            if on:
                touched.append(which[pair : pair + 1])
        hit = crossing != 0
        keys, slot = np.unique(keys[hit], return_inverse=True)
        winding = np.bincount(slot, weights=crossing[hit], minlength=len(keys))
        return np.concatenate([*touched, keys[winding != 0] // count])

    def _column_turns(self, ids: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Signs of the points against the triangles' edges in plan, shape (pairs, 3); 0 where float64 cannot tell."""
        turns = np.empty((len(ids), 3), np.int8)
        for edge in range(3):
            u, v = self._corners[ids, edge, :2], self._corners[ids, (edge + 1) % 3, :2]
            along, across = v - u, points[:, :2] - u
            left, right = along[:, 0] * across[:, 1], along[:, 1] * across[:, 0]
            turns[:, edge] = sure_sign(left - right, np.abs(left) + np.abs(right))
        return turns


def closed_objects(triangles: np.ndarray, owners: np.ndarray) -> np.ndarray:
    """Ids of the objects in which every directed edge is matched by its opposite (corners are welded where equal).

    Args:
        triangles: corners [grid steps], shape (m, 3, 3), integers below 2**25 in size.
        owners: object_id of each triangle, shape (m,).
    """
    if not len(triangles):
        return np.zeros(0, owners.dtype)
    corners = triangles.reshape(-1, 3).astype(np.int64) + 2**25
    plan = np.unique(corners[:, 0] * 2**26 + corners[:, 1], return_inverse=True)[1]
    # A corner's number tells its object too, and the edges between two corners are those of one object.
    space = np.unique(plan * 2**26 + corners[:, 2], return_inverse=True)[1]
    known, ids = np.unique(np.repeat(owners.astype(np.int64), 3) * len(corners) + space, return_inverse=True)
    start, end = ids, np.roll(ids.reshape(-1, 3), -1, axis=1).ravel()
    keys = np.minimum(start, end) * len(corners) + np.maximum(start, end)
    order = np.argsort(keys)
    keys = keys[order]
    first = np.flatnonzero(np.diff(keys, prepend=-1))
    balance = np.add.reduceat(np.sign(end - start)[order], first)
    unmatched = known[keys[first[balance != 0]] // len(corners)] // len(corners)
    return np.setdiff1d(owners, unmatched)


def sure_sign(value: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Sign of a determinant, 0 where its rounding error could change it; `size`: sum of its terms' magnitudes."""
    return np.where(np.abs(value) > BOUND * size + UNDERFLOW, np.sign(value), 0.0)


def _points(points: np.ndarray, what: str) -> np.ndarray:
    points = np.asarray(points, np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"{what}: expected shape (n, 3), found {points.shape}")
    if not np.isfinite(points).all():
        raise InputError(f"{what}: expected finite coordinates, found {points[~np.isfinite(points)][0]}")
    return points


def _batched(work: Callable, count: int) -> tuple[np.ndarray, ...]:
    """Columns that `work(slice)` returns, joined; the first column counts from its slice's start."""
    parts = [slice(start, min(start + BATCH, count)) for start in range(0, max(count, 1), BATCH)]
    with ThreadPoolExecutor(THREADS) as pool:
        results = list(pool.map(work, parts))
    shifted = [(first + part.start, *rest) for part, (first, *rest) in zip(parts, results, strict=True)]
    return tuple(np.concatenate(column) for column in zip(*shifted, strict=True))
