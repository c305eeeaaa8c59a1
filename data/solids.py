"""Closed opaque elements: what is inside a solid, exactly where it matters.

Only closed elements count, each alone: an open ceiling would make everything under it "inside".
"""

import numpy as np

from .ragged import lots, places_of, starts_of
from .scene import GRID_LIMIT, OPAQUE, Role, Scene

SHIFT = 2 * GRID_LIMIT
# Pairs of a point and a triangle that are looked at together: they stay in the cache.
PAIRS = 1 << 13


def closed_elements(scene: Scene, *roles: Role) -> list[tuple[int, np.ndarray]]:
    """Objects of the roles (by default all opaque ones) whose directed edges all pair off.

    Returns:
        (object_id, triangles (m, 3, 3) int32) of each.
    """
    triangles, _ = scene.triangles()
    starts, models, found = scene.triangle_starts, scene.first_alike.tolist(), []
    closed: dict[int, bool] = {}
    for object_id in np.flatnonzero(scene.object_mask(*(roles or OPAQUE))).tolist():
        part, model = triangles[starts[object_id] : starts[object_id + 1]], models[object_id]
        if model not in closed:
            closed[model] = len(part) >= 4 and is_closed(part)
        if closed[model]:
            found.append((object_id, part))
    return found


def is_closed(triangles: np.ndarray) -> bool:
    """Whether every directed edge has its opposite, as often; triangles (m, 3, 3), int32, positions welded by value."""
    # Positions as single integers, exactly: x and y share 64 bits, and so do their rank and z.
    x, y, z = triangles.reshape(-1, 3).T.astype(np.int64) + SHIFT
    _, flat = np.unique(x * 2 * SHIFT + y, return_inverse=True)
    _, corner = np.unique(flat * 2 * SHIFT + z, return_inverse=True)
    corner = corner.reshape(-1, 3).astype(np.int64)
    start, end = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
    base = corner.max() + 1
    forward, backward = np.sort(start * base + end), np.sort(end * base + start)
    return bool((forward == backward).all())


def winding_numbers(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Winding number of a closed surface about each point, unrounded, float64.

    Args:
        points: [grid steps], shape (n, 3), float64.
        triangles: [grid steps], shape (m, 3, 3).

    Returns:
        Shape (n,); within 1e-6 of an integer unless the point lies on the surface. Source: van Oosterom and Strackee
        1983, "The solid angle of a plane triangle".
    """
    out = np.zeros(len(points))
    # Corner by corner and coordinate by coordinate: NumPy is many times slower along short axes.
    corners, places = triangles.astype(float).transpose(1, 2, 0), points.T
    step = max(1, PAIRS // max(1, len(triangles)))
    for begin in range(0, len(points), step):
        at = places[:, begin : begin + step, None]
        angles = _half_angles(*([corner[i][None] - at[i] for i in range(3)] for corner in corners))
        out[begin : begin + step] = angles.sum(axis=1) / (2 * np.pi)
    return out


def winds_around(points: np.ndarray, row: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Whether the winding number of a closed surface about each point is not 0; each point has a surface of its own.

    Args:
        points: [grid steps], shape (n, 3), float64, on none of the surfaces.
        row: point of each triangle, shape (m,).
        triangles: [grid steps], shape (m, 3, 3).
    """
    return np.abs(_windings(points, row, triangles)) > 0.5


def rays_wind(points: np.ndarray, row: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """As `winds_around`, by what is above each point: many times faster, of triangles that may be above alone.

    Signs in the plan are exact; a point on a level line with a corner is taken a little further along x, and along y.

    Args:
        points: twice their coordinates, shape (n, 3), int64.
        row: point of each triangle, shape (m,).
        triangles: as of `winds_around`, at least all that have something straight above their point.

    Returns:
        False also where the point lies so near to a surface that float64 does not tell.
    """
    a, b, c = (2 * triangles[:, k].astype(np.int64) - points[row] for k in range(3))
    one, two, three = (_turns(x, y) for x, y in ((a, b), (b, c), (c, a)))
    hit = np.flatnonzero((one == two) & (two == three))
    normal = np.cross((b - a)[hit].astype(float), (c - a)[hit].astype(float))
    terms = normal * a[hit]
    height = terms.sum(axis=1)
    doubt = np.abs(height) <= 1e-9 * np.abs(terms).sum(axis=1)
    # The plane is above where it rises from below along its upward normal.
    above = height * one[hit] > 0
    winding = np.bincount(row[hit[above]], one[hit[above]], minlength=len(points))
    winding[row[hit[doubt]]] = 0
    return winding != 0


def _turns(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """1 where the way from a to b in plan passes the origin on its left, -1 where on its right, 0 if it is a point."""
    way = b - a
    side = np.sign(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    side = np.where(side == 0, -np.sign(way[:, 1]), side)
    return np.where(side == 0, np.sign(way[:, 0]), side)


def _windings(points: np.ndarray, row: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """As `winding_numbers`, of a surface for each point; arguments as of `winds_around`."""
    places, angles = points.T, np.empty(len(row))
    for begin in range(0, len(row), PAIRS):
        part = slice(begin, begin + PAIRS)
        corners, at = triangles[part].astype(float).transpose(1, 2, 0), places[:, row[part]]
        angles[part] = _half_angles(*([corner[i] - at[i] for i in range(3)] for corner in corners))
    return np.bincount(row, angles, minlength=len(points)) / (2 * np.pi)


def _half_angles(a: list[np.ndarray], b: list[np.ndarray], c: list[np.ndarray]) -> np.ndarray:
    """Half of the solid angles of triangles about the origin, signed; corners by coordinate, float64."""
    la, lb, lc = (np.sqrt(_dot(x, x)) for x in (a, b, c))
    top = _dot(a, [b[i - 2] * c[i - 1] - b[i - 1] * c[i - 2] for i in range(3)])
    bottom = la * lb * lc + _dot(a, b) * lc + _dot(b, c) * la + _dot(c, a) * lb
    # In the plane of a triangle the sign of a zero would say on which side the point is: on it, it is on neither.
    return np.where(top == 0.0, 0.0, np.arctan2(top, bottom))


def _dot(a: list[np.ndarray], b: list[np.ndarray]) -> np.ndarray:
    """Scalar products of vectors by coordinate."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def triangles_meet_boxes(triangles: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Whether each triangle meets the open box of the same row, exactly (separating axes in 64-bit integers).

    Args:
        triangles: shape (n, 3, 3), int, |coordinate| < 2**24.
        boxes: shape (n, 2, 3), int, likewise.
    """
    # Doubled, so that box centres are integers.
    t = 2 * triangles.astype(np.int64) - (boxes[:, :1].astype(np.int64) + boxes[:, 1:])
    half = boxes[:, 1].astype(np.int64) - boxes[:, 0]
    edges = np.roll(t, -1, axis=1) - t
    separated = ((t.min(axis=1) >= half) | (t.max(axis=1) <= -half)).any(axis=1)
    normal = np.cross(edges[:, 0] // 2, edges[:, 1] // 2)
    # The plane: |n . v0| >= sum |n_i| half_i, in float64 with the doubt resolved towards "meets".
    reach, away = (
        (np.abs(normal) * half.astype(float)).sum(axis=1),
        np.abs((normal * t[:, 0].astype(float)).sum(axis=1)),
    )
    separated |= away > reach * (1 + 1e-12)
    for e in range(3):
        for axis in range(3):
            # cross(unit axis, edge); an edge parallel to the axis gives no direction and separates nothing.
            j, k = (axis + 1) % 3, (axis + 2) % 3
            along = edges[:, e] // 2
            p = t[:, :, k] * along[:, None, j] - t[:, :, j] * along[:, None, k]
            radius = half[:, k] * np.abs(along[:, j]) + half[:, j] * np.abs(along[:, k])
            separated |= ((p.min(axis=1) >= radius) | (p.max(axis=1) <= -radius)) & (radius > 0)
    return ~separated


def dead_cells(cells: np.ndarray, solids: list[tuple[int, np.ndarray]]) -> np.ndarray:
    """Cells wholly inside one closed opaque element: no triangle of it meets the open cell, winding number not 0.

    Args:
        cells: [grid steps], shape (n, 2, 3), int32.
        solids: as from `closed_elements`.

    Returns:
        Shape (n,), bool. Never true for a cell that an eye could stand in.
    """
    dead = np.zeros(len(cells), bool)
    for _, triangles in solids:
        low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
        near = np.flatnonzero(~dead & (cells[:, 0] >= low).all(axis=1) & (cells[:, 1] <= high).all(axis=1))
        if not len(near):
            continue
        centres = cells[near].astype(float).mean(axis=1)
        near = near[np.abs(winding_numbers(centres, triangles)) > 0.5]
        boxes = cells[near]
        overlap = (triangles.min(axis=1)[None] < boxes[:, None, 1]).all(axis=2) & (
            triangles.max(axis=1)[None] > boxes[:, None, 0]
        ).all(axis=2)
        # A flat triangle inside the open box has min == max there, which the strict test above keeps.
        which, t = np.nonzero(overlap)
        touched = np.zeros(len(near), bool)
        touched[which[triangles_meet_boxes(triangles[t], boxes[which])]] = True
        dead[near[~touched]] = True
    return dead


class SolidIndex:
    """Closed solids by the cell that they reach into, to tell whether a sightline starts outside all of them."""

    def __init__(self, cells: np.ndarray, solids: list[tuple[int, np.ndarray]]) -> None:
        """Find which solids overlap which open cell.

        Args:
            cells: [grid steps], shape (n, 2, 3), int32.
            solids: as from `closed_elements`.
        """
        self._starts = starts_of([len(triangles) for _, triangles in solids])
        self._triangles = np.concatenate([np.zeros((0, 3, 3), np.int32), *(triangles for _, triangles in solids)])
        boxes = np.array([[t.min(axis=(0, 1)), t.max(axis=(0, 1))] for _, t in solids]).reshape(-1, 2, 3)
        # Coordinate by coordinate: NumPy is many times slower along short axes.
        self._low, self._high = (np.ascontiguousarray(boxes[:, side].T) for side in (0, 1))
        self._cells = cells
        self._near: dict[int, np.ndarray] = {}

    def outside(self, points: np.ndarray, cell: int | np.ndarray) -> np.ndarray:
        """Points that certainly lie outside every solid.

        Args:
            points: [grid steps], shape (n, 3), float64, each inside its open cell.
            cell: the cell that holds them all, or that of each, shape (n,).

        Returns:
            Shape (n,), bool. True is safe; False may lie on a surface or in a doubtful place.
        """
        rows, solids = self._boxed(points, np.broadcast_to(cell, len(points)))
        sizes = np.diff(self._starts)[solids]
        free = np.ones(len(points), bool)
        for first, stop in lots(sizes, PAIRS):
            row = np.repeat(np.arange(stop - first), sizes[first:stop])
            triangles = self._triangles[places_of(self._starts[solids[first:stop]], sizes[first:stop])]
            within = np.abs(_windings(points[rows[first:stop]], row, triangles)) >= 1e-3
            free[rows[first:stop][within]] = False
        return free

    def _boxed(self, points: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points, and solids that reach into their cells, whose boxes hold them."""
        rows, solids = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
        order, places = np.argsort(cells, kind="stable"), points.T
        names, starts = np.unique(cells[order], return_index=True)
        for cell, mine in zip(names.tolist(), np.split(order, starts)[1:], strict=True):
            if cell not in self._near:
                low, high = self._cells[cell]
                meet = [(self._low[axis] < high[axis]) & (self._high[axis] > low[axis]) for axis in range(3)]
                self._near[cell] = np.flatnonzero(meet[0] & meet[1] & meet[2])
            near = self._near[cell]
            held = np.ones((len(mine), len(near)), bool)
            for own, low, high in zip(places[:, mine], self._low[:, near], self._high[:, near], strict=True):
                held &= (own[:, None] >= low) & (own[:, None] <= high)
            row, solid = np.nonzero(held)
            rows.append(mine[row])
            solids.append(near[solid])
        return np.concatenate(rows), np.concatenate(solids)
