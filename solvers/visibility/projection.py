"""What is hidden from view cells, by the occlusion method of vLOD: projection points, shrunk occluders and cube maps.

For each view cell the occluders are put into clusters by direction. Each cluster gets a projection point; from there
its occluders are shrunk (kernels/umbra.py, kernels/shrink.py), so that whatever they hide from the point they hide from
all of the cell, and drawn into a cube map (kernels/coverage.py) that the occludees are tested against
(kernels/occludee.py). Every step errs on the side of the visible.

An eye counts only outside every solid where the occluders are sections of solids. Source: Chhugani et al. 2005, section
5.2. Beyond the paper occluders may be shrunk for occludees within a distance, one cube map for each shell of distances.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from ...data.errors import InputError
from ...data.patches import Patches
from ...data.ragged import starts_of
from ...data.scene import GRID_LIMIT
from ...data.verdict import Verdict
from ...kernels.coverage import check_resolution, launch_coverage
from ...kernels.launch import CPU, Device
from ...kernels.occludee import launch_occludees
from ...kernels.shrink import launch_shrink
from ...kernels.umbra import USABLE, Umbras, launch_umbra
from ..projection_point import cluster_problems, solve_points
from ..result import Status

__all__ = [
    "ShrunkOccluders",
    "VlodSettings",
    "VlodStats",
    "cluster_directions",
    "culling_scores",
    "shrunk_occluders",
    "split_cell",
    "vlod_hidden",
]

CLUSTERS = (1, 6, 14, 26)
OBJECTIVES = ("centre", "random", "socp", "lp")
# From programmes (solvers/projection_point.py) to points.
PointChooser = Callable[[list], np.ndarray]
# View cells whose projection points are solved for together.
BLOCK = 16


@dataclass(frozen=True)
class VlodSettings:
    """How view cells are treated.

    Attributes:
        clusters: of occluders by direction: 1, 6 (axes), 14 (and diagonals of the cube), 26 (and those of its faces).
        objective: how projection points are chosen: "centre" of the cell, a "random" point of it, or the optimum of the
            second-order cone programme ("socp") or of the linear programme ("lp") of solvers/projection_point.py.
        resolution: pixels on a cube map face's side.
        shells: cube maps for occludees within the scene's diameter, half of it, a quarter, ...; 0 for a single map
            without a limit, as in the paper.
        split: parts on each axis of a view cell; what is hidden from all parts is hidden from the cell.
        occluders: used at most for a view cell, those of the largest solid angle about its centre.
        seed: of random points.
    """

    clusters: int = 14
    objective: str = "socp"
    resolution: int = 512
    shells: int = 0
    split: int = 1
    occluders: int = 2000
    seed: int = 0

    def __post_init__(self):
        if self.clusters not in CLUSTERS:
            raise InputError(f"clusters: expected one of {CLUSTERS}, found {self.clusters}")
        if self.objective not in OBJECTIVES:
            raise InputError(f"objective: expected one of {OBJECTIVES}, found {self.objective!r}")
        check_resolution(self.resolution)
        if self.shells < 0 or self.split < 1 or self.occluders < 0:
            found = f"{self.shells}, {self.split}, {self.occluders}"
            raise InputError(f"shells, split, occluders: expected at least 0, 1 and 0, found {found}")


@dataclass
class VlodStats:
    """What the method did.

    Attributes:
        seconds: by phase: umbra, solve, shrink, coverage, occludees.
        occluders: of all cells, those that an umbra was found for; and `drawn`, polygons left after shrinking.
        fallbacks: clusters whose solution could not be used, and that took the cell's centre.
    """

    seconds: dict[str, float] = field(default_factory=dict)
    occluders: int = 0
    drawn: int = 0
    fallbacks: int = 0

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Add the time spent inside to a phase."""
        start = time.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start


def cluster_directions(count: int) -> np.ndarray:
    """Unit directions of so many clusters, shape (count, 3)."""
    grid = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    steps = np.abs(grid).sum(axis=1)
    kinds = {1: (), 6: (1,), 14: (1, 3), 26: (1, 2, 3)}[count]
    chosen = grid[np.isin(steps, kinds)] if kinds else np.array([[0, 0, 1]])
    return chosen / np.linalg.norm(chosen, axis=1, keepdims=True)


def vlod_hidden(
    cells: np.ndarray,
    occluders: Patches,
    pieces: np.ndarray,
    owners: np.ndarray,
    settings: VlodSettings,
    *,
    objects: int | None = None,
    points: PointChooser | None = None,
    device: Device = CPU,
) -> tuple[np.ndarray, VlodStats]:
    """Objects that are hidden from all of a view cell.

    Args:
        cells: view cells [grid steps], shape (m, 2, 3), int32.
        occluders: outlines of opaque discs, and of sections of solids for eyes outside them (`rectangle_outlines`).
        pieces: boxes that together hold each object [grid steps], shape (p, 2, 3), int32.
        owners: object of each piece, shape (p,), int.
        settings: of the method.
        objects: how many there are; by default one more than the last owner.
        points: chooses projection points instead of `settings.objective`, to compare solvers: from the clusters'
            programmes to points, shape (clusters, 3); any point in front of all occluders of its cluster is safe.
        device: where to.

    Returns:
        Shape (m, objects), bool: true is never wrong, false may be. An object without pieces is hidden. And what was
        done.

    Raises:
        InputError: a shape or an owner.
    """
    cells, pieces, owners = (np.asarray(x) for x in (cells, pieces, owners))
    objects = int(owners.max(initial=-1)) + 1 if objects is None else objects
    if cells.shape[1:] != (2, 3) or pieces.shape[1:] != (2, 3) or owners.shape != (len(pieces),):
        found = f"{cells.shape}, {pieces.shape}, {owners.shape}"
        raise InputError(f"cells, pieces, owners: expected shapes (m, 2, 3), (p, 2, 3), (p,), found {found}")
    if len(owners) and not 0 <= owners.min() <= owners.max() < objects:
        raise InputError(f"owners: expected objects 0 to {objects - 1}, found {owners.min()} to {owners.max()}")
    method = _Method(occluders, pieces.astype(np.int32), settings, VlodStats(), device, points)
    hidden = np.ones((len(cells), objects), bool)
    split = [split_cell(cell, settings.split) for cell in cells]
    block = max(1, BLOCK // settings.split**3)
    for first in range(0, len(cells), block):
        prepared = iter(method.prepare(np.concatenate(split[first : first + block])))
        for row in range(first, min(first + block, len(cells))):
            seen = np.zeros(len(pieces), bool)
            for _ in split[row]:
                seen[~seen] = ~method.hidden(next(prepared), np.flatnonzero(~seen))
            hidden[row, owners[seen]] = False
    return hidden, method.stats


@dataclass
class ShrunkOccluders:
    """What is drawn into the cube maps of one view cell.

    Attributes:
        points: projection point of each cluster [grid steps], shape (clusters, 3), float64.
        corners: of the shrunk occluders, one after the other [grid steps], shape (total, 3), float64.
        starts: occluder i is corners[starts[i]:starts[i + 1]], shape (n + 1,), int64.
        cluster: of each, shape (n,), int.
    """

    points: np.ndarray
    corners: np.ndarray
    starts: np.ndarray
    cluster: np.ndarray


def shrunk_occluders(
    cell: np.ndarray, occluders: Patches, pieces: np.ndarray, settings: VlodSettings, *, device: Device = CPU
) -> ShrunkOccluders:
    """Projection points and shrunk occluders of a view cell, to look at; arguments as of `vlod_hidden`."""
    method = _Method(occluders, np.asarray(pieces, np.int32), settings, VlodStats(), device)
    view = method.prepare(np.asarray(cell)[None])[0]
    return method.shrink(view, None)


def culling_scores(
    cell: np.ndarray, occluders: Patches, pieces: np.ndarray, weights: np.ndarray, settings: VlodSettings
) -> list[Callable[[np.ndarray], float]]:
    """For each cluster of a view cell: weight of the pieces that its occluders hide, as a function of the point.

    This is what projection points are chosen for and what their programmes stand in for; a step function.

    Args:
        cell: one view cell [grid steps], shape (2, 3), int32.
        occluders: as of `vlod_hidden`.
        pieces: as of `vlod_hidden`.
        weights: of the pieces, such as their triangles, shape (p,).
        settings: of the method; the objective plays no part.
    """
    method = _Method(occluders, np.asarray(pieces, np.int32), replace(settings, objective="centre"), VlodStats())
    view = method.prepare(np.asarray(cell)[None])[0]
    everything = np.arange(len(pieces))

    def score_of(cluster: int) -> Callable[[np.ndarray], float]:
        rows = np.flatnonzero(view.cluster == cluster)
        points = view.points.copy()

        def score(point: np.ndarray) -> float:
            if not len(rows):
                return 0.0
            points[cluster] = point
            part = _View(view.cell, view.umbras, view.rows[rows], view.cluster[rows], points)
            return float(weights[method.hidden(part, everything)].sum())

        return score

    return [score_of(cluster) for cluster in range(settings.clusters)]


def split_cell(cell: np.ndarray, count: int) -> np.ndarray:
    """Boxes that tile a view cell, `count` on each axis, fewer where it is thinner [grid steps], shape (n, 2, 3)."""
    borders = [np.unique(np.linspace(cell[0, axis], cell[1, axis], count + 1).astype(np.int64)) for axis in range(3)]
    low = np.stack(np.meshgrid(*(b[:-1] for b in borders), indexing="ij"), axis=-1).reshape(-1, 3)
    high = np.stack(np.meshgrid(*(b[1:] for b in borders), indexing="ij"), axis=-1).reshape(-1, 3)
    return np.stack([low, high], axis=1)


@dataclass
class _View:
    """A view cell, its usable occluders (rows of the umbras), their clusters, and the clusters' projection points."""

    cell: np.ndarray
    umbras: Umbras
    rows: np.ndarray
    cluster: np.ndarray
    points: np.ndarray


@dataclass
class _Method:
    """Occluders, occludees and settings, and how view cells are done with them."""

    occluders: Patches
    pieces: np.ndarray
    settings: VlodSettings
    stats: VlodStats
    device: Device = CPU
    choose: PointChooser | None = None

    def prepare(self, cells: np.ndarray) -> list[_View]:
        """Umbras and projection points of some view cells."""
        with self.stats.phase("umbra"):
            chosen = [self._largest(cell) for cell in cells]
            cell_of = np.repeat(np.arange(len(cells)), [len(c) for c in chosen])
            occluder = np.concatenate(chosen)
            pairs = np.column_stack([cell_of, occluder])
            umbras = launch_umbra(cells, self.occluders, pairs, device=self.device)
            self.stats.occluders += int((umbras.status == USABLE).sum())
        with self.stats.phase("solve"):
            cluster = self._cluster(cells[cell_of], occluder)
            points = self._points(cells, umbras, cell_of, cluster)
        views = []
        for number, cell in enumerate(cells):
            rows = np.flatnonzero((umbras.status == USABLE) & (cell_of == number))
            views.append(_View(cell, umbras, rows, cluster[rows], points[number]))
        return views

    def hidden(self, view: _View, chosen: np.ndarray) -> np.ndarray:
        """Whether each chosen piece is hidden from a view cell, shape (len(chosen),), bool."""
        out = np.zeros(len(chosen), bool)
        shell, limits = self._shells(view.cell, self.pieces[chosen])
        for number, limit in enumerate(limits):
            mine = np.flatnonzero(shell == number)
            if len(mine):
                out[mine] = self._covered(view, limit, self.pieces[chosen[mine]])
        return out

    def _largest(self, cell: np.ndarray) -> np.ndarray:
        """Occluders of the largest solid angle about the cell's centre, roughly, in order."""
        away = np.clip(cell.mean(axis=0), self.occluders.boxes[:, 0], self.occluders.boxes[:, 1]) - cell.mean(axis=0)
        square = np.maximum((away * away).sum(axis=1), 1.0)
        # Solid angle of a facing disc of the occluder's area, as near as the occluder's nearest point.
        size = self.occluders.area * np.abs((away * self.occluders.normal).sum(axis=1)) / square**1.5
        if len(size) <= self.settings.occluders:
            return np.arange(len(size))
        return np.sort(np.argpartition(-size, self.settings.occluders)[: self.settings.occluders])

    def _cluster(self, cells: np.ndarray, occluder: np.ndarray) -> np.ndarray:
        """Cluster of each occluder: the direction nearest to that of its box's point nearest to the cell's centre."""
        centre, boxes = cells.mean(axis=1), self.occluders.boxes[occluder]
        towards = np.clip(centre, boxes[:, 0], boxes[:, 1]) - centre
        return (towards @ cluster_directions(self.settings.clusters).T).argmax(axis=1)

    def _points(self, cells: np.ndarray, umbras: Umbras, cell_of: np.ndarray, cluster: np.ndarray) -> np.ndarray:
        """Projection point of each cluster of each view cell, shape (cells, clusters, 3)."""
        shape = (len(cells), self.settings.clusters, 3)
        if self.choose is None and self.settings.objective == "centre":
            return np.broadcast_to(cells.mean(axis=1)[:, None], shape)
        if self.choose is None and self.settings.objective == "random":
            # A cell's points depend on nothing but the cell and the seed.
            seeds = [[self.settings.seed, *(cell.astype(np.int64) + GRID_LIMIT).ravel()] for cell in cells]
            share = np.stack([np.random.default_rng(seed).random(shape[1:]) for seed in seeds])
            return cells[:, None, 0] + share * (cells[:, None, 1] - cells[:, None, 0])
        size = self.pieces.max(axis=(0, 1), initial=1).astype(float) - self.pieces.min(axis=(0, 1), initial=0)
        objective = "lp" if self.settings.objective == "lp" else "socp"
        only = {"objective": objective, "depth": float(np.linalg.norm(size))}
        problems = cluster_problems(umbras, cells, cell_of, cluster, self.settings.clusters, **only)
        if self.choose is not None:
            return self.choose(problems).reshape(shape)
        result = solve_points(problems)
        self.stats.fallbacks += int(np.isin(result.status, (Status.REJECTED, Status.INFEASIBLE)).sum())
        return result.point.reshape(shape)

    def _shells(self, cell: np.ndarray, boxes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Shell of each box, the narrowest that holds it, and the greatest depth beyond an occluder in each shell.

        What lies within a distance of the cell lies within that distance beyond any plane in front of it. Without
        shells all boxes are in one.
        """
        away = np.maximum(np.maximum(cell[0] - boxes[:, 0], boxes[:, 1] - cell[1]), 0).astype(float)
        # A step more covers the rounding of the lengths.
        distance = np.sqrt((away * away).sum(axis=1)) + 1
        limits = distance.max(initial=1) / 2.0 ** np.arange(max(1, self.settings.shells))
        return (distance[:, None] <= limits).sum(axis=1) - 1, limits

    def shrink(self, view: _View, limits: np.ndarray | None) -> ShrunkOccluders:
        """What is left of a view cell's occluders, for occludees at most `limits` beyond each, or any."""
        polygons = launch_shrink(view.umbras, view.rows, view.points[view.cluster], limits, device=self.device)
        sizes = np.diff(polygons.starts)
        starts = starts_of(sizes[sizes > 0])
        return ShrunkOccluders(view.points, polygons.corners, starts, view.cluster[sizes > 0])

    def _covered(self, view: _View, limit: float, boxes: np.ndarray) -> np.ndarray:
        """Whether a cube map of some cluster covers each box, with occluders shrunk for a depth, shape (n,), bool."""
        with self.stats.phase("shrink"):
            limits = np.full(len(view.rows), limit) if self.settings.shells else None
            shrunk = self.shrink(view, limits)
            self.stats.drawn += len(shrunk.cluster)
        with self.stats.phase("coverage"):
            options = {"resolution": self.settings.resolution, "device": self.device}
            maps = launch_coverage(view.points, shrunk.corners, shrunk.starts, shrunk.cluster, **options)
        with self.stats.phase("occludees"):
            hidden = np.zeros(len(boxes), bool)
            for number in np.unique(shrunk.cluster):
                rest = np.flatnonzero(~hidden)
                rows = np.column_stack([rest, np.full(len(rest), number)])
                hidden[rest] = launch_occludees(maps, boxes, rows) == Verdict.HIDDEN
        return hidden
