"""Camera paths: a walk through the cells of a bake, or one that the user has recorded; and what may be seen on it."""

from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from ...data.camera import CameraPath
from ...data.errors import InputError
from ...data.store.bake_folder import BakeFolder
from ...data.store.graph_folder import numbers
from ...data.store.view_cells import read_rows
from ...data.store.walk_folder import WalkFolder

COLUMNS = ("x", "y", "z", "yaw", "pitch", "t")
# How somebody walks: eye above the floor [m], speed [m/s], and frames per second, as the papers'.
EYE_M, SPEED, RATE = 1.7, 1.4, 10.0
# The eye keeps away from the faces of what it walks through, where that is so large.
KEEP_OFF_M = 0.1
# A metre through cells that nobody can stand in counts as so many, a portal too low to walk through as so many more:
# the way leads through doors, hardly through windows.
OUTSIDE, CRAWL_M = 10.0, 30.0
# Points of each curve that its length is measured by.
CURVE_POINTS = 33
# Half the time [s] over which the direction of view is averaged.
TURN_S = 0.4
LEGS_MOST = 10_000


def walk(bake: BakeFolder | WalkFolder, frames: int, seed: int = 0, *, everywhere: bool = False) -> CameraPath:
    """A walk at constant speed to random places of the inhabitable cells, by the shortest way through the portals.

    In each cell the eye follows a cubic Bezier curve whose control points lie in the cell, so the curve does, and it
    crosses portals at right angles, so the walk has no corners. It is 1.7 m above the floor of the cell or portal where
    that is so high. Frames in cells that nobody can stand in (the depth of a doorway) are left out, though their time
    passes: a bake knows nothing of such cells. Cells that touch count as joined in a bake without portals.

    Args:
        bake: any bake, or a display database.
        frames: how many, >= 1; 10 a second.
        seed: of the places.
        everywhere: keep frames in cells that nobody can stand in, too; they count as frames.

    Raises:
        InputError: no frame asked for, or no inhabitable cell.
    """
    if frames < 1:
        raise InputError(f"frames: expected at least 1, found {frames}")
    maze = _Maze(bake)
    random = np.random.default_rng(seed)
    cell = maze.draw(random)
    here = maze.place(random, cell)
    curves, cells, length = [], [], 0.0
    # Frames in doorways do not count: so much of the walk is in inhabitable cells.
    for _ in range(LEGS_MOST):
        if length > SPEED / RATE * frames:
            break
        goal = maze.draw(random, cell)
        there = maze.place(random, goal)
        for inside, curve in maze.leg(cell, here, goal, there):
            curves.append(curve)
            cells.append(inside)
            length += (everywhere or maze.inhabitable[inside]) * np.linalg.norm(np.diff(curve, axis=0), axis=1).sum()
        cell, here = goal, there
    points = np.concatenate([curve[:-1] for curve in curves] + [curves[-1][-1:]])
    owner = np.repeat(cells, CURVE_POINTS - 1)
    run = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    return _sampled(points, run, maze.inhabitable[owner] | everywhere, frames)


def _sampled(points: np.ndarray, run: np.ndarray, stands: np.ndarray, frames: int) -> CameraPath:
    """Frames at even steps of the way, where one can stand, with the direction of view along it."""
    at = np.arange(0.0, run[-1] + 1e-9, SPEED / RATE)
    ahead = np.array([np.interp(at, run, points[:, axis]) for axis in range(2)]).T
    way = np.diff(ahead, axis=0, append=ahead[-1:])
    still = np.linalg.norm(way, axis=1) < 1e-9
    yaw = np.arctan2(way[:, 1], way[:, 0])
    moving = np.flatnonzero(~still)
    # Who stands or climbs keeps looking where he looked.
    yaw = (
        yaw[moving[np.clip(np.searchsorted(moving, np.arange(len(at)), "right") - 1, 0, None)]] if len(moving) else yaw
    )
    half = round(TURN_S * RATE)
    wide = np.pad(np.unwrap(yaw), half, mode="edge")
    yaw = np.convolve(wide, np.full(2 * half + 1, 1 / (2 * half + 1)), mode="valid")
    keep = np.flatnonzero(stands[np.clip(np.searchsorted(run, at, "right") - 1, 0, len(stands) - 1)])[:frames]
    eyes = np.array([np.interp(at[keep], run, points[:, axis]) for axis in range(3)]).T
    return CameraPath(eyes, np.degrees(yaw[keep]), np.zeros(len(keep)), keep / RATE)


class _Maze:
    """Cells, and what joins them [m]."""

    def __init__(self, bake: BakeFolder | WalkFolder) -> None:
        graph = bake.graph
        self.cells = graph.cells * bake.grid_m
        self.inhabitable = graph.inhabitable
        if graph.portal_count:
            self.pairs, self.doors = graph.portal_cells, graph.portals * bake.grid_m
            self.axes = graph.portal_axis.astype(int)
        else:
            self.pairs, self.doors = _touching(self.cells)
            self.axes = np.argmin(self.doors[:, 1] - self.doors[:, 0], axis=1)
        # Paths lead through the cells that tile space; prisms lie over them. Without such cells they are all there is.
        tiles = np.flatnonzero(self.inhabitable[: graph.tile_count])
        self.stands = tiles if len(tiles) else np.flatnonzero(self.inhabitable)
        if not len(self.stands):
            raise InputError(f"{bake.folder}: expected at least one inhabitable cell, found none")
        self._join()
        tall = self.stands[(self.cells[self.stands, 1, 2] - self.cells[self.stands, 0, 2]) >= EYE_M + KEEP_OFF_M]
        self.goals = tall if len(tall) else self.stands

    def _join(self) -> None:
        """Lengths of the steps from cell to cell through the widest portal, and the cells that hang together."""
        middles, count = self.cells.mean(axis=1), len(self.cells)
        a, b = self.pairs.T
        effort = np.where(self.inhabitable, 1.0, OUTSIDE)
        length = np.linalg.norm(middles[a] - middles[b], axis=1) * (effort[a] + effort[b]) / 2
        height = self.doors[:, 1, 2] - self.doors[:, 0, 2]
        length += CRAWL_M * ((self.axes != 2) & (height < EYE_M + KEEP_OFF_M))
        across = np.sort(self.doors[:, 1] - self.doors[:, 0], axis=1)[:, 1:].prod(axis=1)
        self.best: dict[tuple[int, int], int] = {}
        for door in np.argsort(across, kind="stable").tolist():
            self.best[tuple(sorted(self.pairs[door].tolist()))] = door
        doors = np.fromiter(self.best.values(), np.int64, len(self.best))
        self.steps = csr_array((length[doors], (a[doors], b[doors])), shape=(count, count))
        self.parts = connected_components(self.steps, directed=False)[1]

    def draw(self, random: np.random.Generator, start: int | None = None) -> int:
        """A random cell to stand in that can be reached from the start; without one, of the largest part."""
        part = np.bincount(self.parts[self.goals]).argmax() if start is None else self.parts[start]
        return int(random.choice(self.goals[self.parts[self.goals] == part]))

    def place(self, random: np.random.Generator, cell: int) -> np.ndarray:
        """A random place in a cell, at the height of an eye."""
        low, high = self.cells[cell]
        spot = low + random.uniform(0.2, 0.8, 3) * (high - low)
        spot[2] = _eye_height(low[2], high[2])
        return spot

    def leg(self, start: int, here: np.ndarray, goal: int, there: np.ndarray) -> list[tuple[int, np.ndarray]]:
        """Curves from a place in one cell to one in another: the cell of each, and points on it."""
        before = dijkstra(self.steps, directed=False, indices=start, return_predecessors=True)[1]
        cells = [goal]
        while cells[-1] != start:
            cells.append(int(before[cells[-1]]))
        cells.reverse()
        doors = [self.best[tuple(sorted(step))] for step in pairwise(cells)]
        stops = [here, *map(self._stop, doors), there]
        normals = [None, *(self._normal(door, cell) for door, cell in zip(doors, cells, strict=False)), None]
        ends = zip(pairwise(stops), pairwise(normals), strict=True)
        return [(cell, self._curve(cell, *stop, *normal)) for cell, (stop, normal) in zip(cells, ends, strict=True)]

    def _stop(self, door: int) -> np.ndarray:
        """Where a portal is crossed: in its middle, at the height of an eye."""
        low, high = self.doors[door]
        stop = (low + high) / 2
        if self.axes[door] != 2:
            stop[2] = _eye_height(low[2], high[2])
        return stop

    def _normal(self, door: int, cell: int) -> np.ndarray:
        """Direction in which a portal is left from a cell."""
        normal = np.zeros(3)
        normal[self.axes[door]] = 1.0 if self.pairs[door, 0] == cell else -1.0
        return normal

    def _curve(
        self, cell: int, p: np.ndarray, q: np.ndarray, out: np.ndarray | None, into: np.ndarray | None
    ) -> np.ndarray:
        """Cubic Bezier curve in a cell; at an end with a direction it runs along that."""
        low, high = self.cells[cell]
        reach = np.linalg.norm(q - p) * 0.4
        a = p + (q - p) / 3 if out is None else np.clip(p + reach * out, low, high)
        b = q - (q - p) / 3 if into is None else np.clip(q - reach * into, low, high)
        t = np.linspace(0, 1, CURVE_POINTS)[:, None]
        return (1 - t) ** 3 * p + 3 * t * (1 - t) ** 2 * a + 3 * t**2 * (1 - t) * b + t**3 * q


def _eye_height(low: float, high: float) -> float:
    """1.7 m above a floor, or as high as the ceiling lets."""
    return (
        max(min(low + EYE_M, high - KEEP_OFF_M), (low + high) / 2) if high - low < EYE_M + KEEP_OFF_M else low + EYE_M
    )


def _touching(cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of boxes that share a face or more, and what they share."""
    pairs = []
    for k in range(len(cells) - 1):
        extent = np.minimum(cells[k + 1 :, 1], cells[k, 1]) - np.maximum(cells[k + 1 :, 0], cells[k, 0])
        joined = np.flatnonzero((extent >= 0).all(axis=1) & ((extent > 0).sum(axis=1) >= 2))
        pairs.append(np.column_stack([np.full(len(joined), k), joined + k + 1]))
    found = np.concatenate([*pairs, np.zeros((0, 2), int)])
    a, b = cells[found[:, 0]], cells[found[:, 1]]
    return found, np.stack([np.maximum(a[:, 0], b[:, 0]), np.minimum(a[:, 1], b[:, 1])], axis=1)


def read_path(path: str | Path) -> CameraPath:
    """A recorded path: a Parquet or CSV table of x, y, z [m, relative to the origin], yaw, pitch [degrees] and t [s].

    Raises:
        InputError: it is unreadable, a column is missing or holds something else than finite numbers, it has no row,
            or the time does not ascend.
    """
    table = read_rows(path)
    missing = [name for name in COLUMNS if name not in table.column_names]
    if missing:
        raise InputError(f"{path}: expected the column {missing[0]!r}, found {', '.join(table.column_names)}")
    if not table.num_rows:
        raise InputError(f"{path}: expected at least one frame, found an empty table")
    values = numbers(table, COLUMNS, Path(path))
    back = np.flatnonzero(np.diff(values[:, 5]) <= 0)
    if len(back):
        raise InputError(f"{path}: expected t to ascend, found {values[back[0], 5]} before {values[back[0] + 1, 5]}")
    return CameraPath(values[:, :3], values[:, 3], values[:, 4], values[:, 5])


def potential_on(bake: BakeFolder, path: CameraPath) -> tuple[np.ndarray, np.ndarray]:
    """Objects that may be seen from each eye: those of the inhabitable cells that hold it.

    Returns:
        Shape (frames, objects), bool, and which eyes no inhabitable cell holds, shape (frames,), bool: the bake knows
        nothing of them, so there every object may be seen. An eye on a face has the sets of both sides.
    """
    stands = np.flatnonzero(bake.graph.inhabitable)
    boxes, eyes = bake.graph.cells[stands], path.eyes / bake.grid_m
    sets = np.zeros((len(path), bake.manifest["counts"]["objects"]), bool)
    lost = np.zeros(len(path), bool)
    for frame, eye in enumerate(eyes):
        holding = stands[(boxes[:, 0] <= eye).all(axis=1) & (eye <= boxes[:, 1]).all(axis=1)]
        holding = holding[bake.graph.plans.hold(holding, np.tile(eye, (len(holding), 1)), bake.graph.cell_count)]
        lost[frame] = not len(holding)
        sets[frame] = bake.potential_objects[holding].any(axis=0) if len(holding) else True
    return sets, lost
