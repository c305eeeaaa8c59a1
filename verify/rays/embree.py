"""Rays from every inhabitable cell through the true triangles, by Embree: what they see must be in the bake.

Embree's robust mode misses up to 0.4 % of hits at vertices, so nothing here is final: `Caster.cast` returns candidates
for exact adjudication.
"""

import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import warp as wp
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from ..exact.trace import Links
from .sightings import ROUNDS, Maze, Rays, Sightings, mark_sightings

wp.set_module_options({"enable_backward": False})

CANDIDATE_CAPACITY = 4096
# One ray in this many is also cast at the transparent triangles.
GLASS_SHARE = 8
# Sheets of glass that a ray is followed through, and the step past each [grid steps].
LAYERS = 16
PAST_GLASS = 0.25
# Steps of Roberts' R2 sequence.
R2 = np.array([0.7548776662466927, 0.5698402909980532])
# Of five rounds through a cell's origins three are stratified. Only the first three are followed through the cells:
# following all would take verify below 70 % of Embree's rate, and cells are met far more often than small objects.
AT_FRONTIER = wp.constant(2)
AT_OBJECTS = wp.constant(4)
CROSSING_ROUNDS = 3


@wp.struct
class Aims:
    """What rays of every row start from and are aimed at; see `Caster`."""

    spots: wp.array2d[wp.vec3]
    spot_counts: wp.array[int]
    turns: wp.array[wp.mat33]
    objects: wp.array[wp.vec3]
    object_starts: wp.array[int]
    frontier: wp.array2d[wp.vec3]


@wp.kernel
def aim_rays(
    aims: Aims,
    lattice: wp.array[wp.vec3],
    first: int,
    origins_out: wp.array[wp.vec3],
    directions_out: wp.array[wp.vec3],
):
    """Rays `first` and following of a row: origins in turn, directions from the row's turned lattice or at an aim.

    Of five rounds through the origins three are stratified, one is aimed just beyond the potentially visible set and
    one at objects.
    """
    row = wp.tid()
    run = lattice.shape[0]
    count = aims.spot_counts[row]
    spot = first % count
    round = first // count
    turn = aims.turns[row]
    start = aims.object_starts[row]
    for k in range(run):
        o = aims.spots[row, spot]
        d = wp.vec3()
        kind = round % ROUNDS
        # Points to aim at are in random order: taken in turn they are even, and near in memory. The round shifts them,
        # so that an origin does not always get the same ones.
        place = (round // ROUNDS) * (count + 1) + spot
        if kind == AT_OBJECTS and aims.objects.shape[0] > 0:
            d = wp.normalize(aims.objects[(start + place) % aims.objects.shape[0]] - o)
        if kind == AT_FRONTIER and aims.frontier.shape[1] > 0:
            d = wp.normalize(aims.frontier[row, place % aims.frontier.shape[1]] - o)
        if wp.dot(d, d) < 0.5:
            d = turn * lattice[k]
        origins_out[row * run + k] = o
        directions_out[row * run + k] = d
        spot = (spot + 1) % count
        if spot == 0:
            round += 1


def lattice_points(first: int, count: int) -> np.ndarray:
    """Unit vectors `first` and following of an even sequence on the sphere, shape (count, 3), float32.

    Roberts' R2 sequence, mapped to the sphere by equal areas.
    """
    u, v = ((np.arange(first, first + count)[:, None] + 0.5) * R2 % 1.0).T
    height, angle = 2 * v - 1, 2 * np.pi * u
    radius = np.sqrt(np.maximum(0.0, 1 - height * height))
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height]).astype(np.float32)


@dataclass
class Candidates:
    """Rays that saw what the bake hides; n of them.

    Attributes:
        rows: source row, shape (n,), int.
        kinds: 0 for a cell, 1 for an object, shape (n,).
        targets: cell or object id, shape (n,).
        origins: [grid steps], shape (n, 3), float64 (exact float32 values).
        directions: unit length, shape (n, 3), float64.
        reach: parameter of the hit, inf if none, shape (n,), float64.
    """

    rows: np.ndarray
    kinds: np.ndarray
    targets: np.ndarray
    origins: np.ndarray
    directions: np.ndarray
    reach: np.ndarray


@dataclass
class Caster:
    """Casts batches of rays from all source cells; batches may run on several threads.

    Attributes:
        sources: cell id of each row, shape (rows,), int32.
        spots: origins of each row, ragged.
        aims: points on objects, shape (n, 3), float32.
        frontier: points beyond each row's potentially visible set, shape (rows, n, 3), float32.
        boxes: all cells [grid steps], shape (cells, 2, 3).
        links: ways between the cells.
        potential_cells: shape (rows, cells), bool.
        potential_objects: shape (rows, objects), bool.
        opaque: triangles [grid steps], shape (m, 3, 3), and their owners; none for a bare graph.
        glass: the same of transparent objects.
        seed: of the directions.
        scenes: Embree's, of the opaque triangles and of the others, where another caster has built them.
    """

    sources: np.ndarray
    spots: list[np.ndarray]
    aims: np.ndarray
    frontier: np.ndarray
    boxes: np.ndarray
    links: Links
    potential_cells: np.ndarray
    potential_objects: np.ndarray
    opaque: tuple[np.ndarray, np.ndarray]
    glass: tuple[np.ndarray, np.ndarray]
    seed: int = 0
    scenes: tuple | None = None
    seen_cells: np.ndarray = field(init=False)
    seen_objects: np.ndarray = field(init=False)

    def __post_init__(self):
        self.seen_cells = np.zeros(self.potential_cells.shape, np.uint8)
        self.seen_objects = np.zeros(self.potential_objects.shape, np.uint8)
        # A ray starts in its own cell, which therefore needs no mark.
        self.seen_cells[np.arange(len(self.sources)), self.sources] = 1
        self._lock = threading.Lock()
        self.scenes = self.scenes or (embree_scene(self.opaque[0]), embree_scene(self.glass[0]))
        self._scene, self._glass_scene = self.scenes
        self._aims, self._maze, self._marks = self._make_aims(), Maze(), Sightings()
        self._buffers = threading.local()
        self._maze.boxes = _share(np.ascontiguousarray(self.boxes.reshape(-1, 6), np.int32))
        for name in ("starts", "cells", "rectangles"):
            setattr(self._maze, name, _share(getattr(self.links, name)))
        for name, table in (("cells", self.seen_cells), ("objects", self.seen_objects)):
            setattr(self._marks, name, _share(table))
        for name in ("potential_cells", "potential_objects"):
            setattr(self._marks, name, _share(np.ascontiguousarray(getattr(self, name))))
        self._crossing = CROSSING_ROUNDS if self._scene is not None else ROUNDS
        self._owners = _share(self.opaque[1].astype(np.int32) if len(self.opaque[1]) else np.zeros(1, np.int32))
        self._sources = _share(self.sources.astype(np.int32))

    def _make_aims(self) -> Aims:
        rng, rows = np.random.default_rng(self.seed), len(self.sources)
        spots = np.zeros((rows, max(map(len, self.spots)), 3), np.float32)
        for row, own in enumerate(self.spots):
            spots[row, : len(own)] = own
        turns = np.linalg.qr(rng.normal(size=(rows, 3, 3)))[0].astype(np.float32)
        aims = Aims()
        aims.spots, aims.frontier = (_share(points, wp.vec3) for points in (spots, self.frontier))
        aims.spot_counts = _share(np.array([len(own) for own in self.spots], np.int32))
        aims.turns, aims.objects = _share(turns, wp.mat33), _share(self.aims, wp.vec3)
        aims.object_starts = _share(rng.integers(0, max(len(self.aims), 1), rows).astype(np.int32))
        return aims

    def rays(self, first: int, run: int) -> tuple[np.ndarray, np.ndarray]:
        """Rays first to first + run - 1 of every row: origins and directions, shape (rows * run, 3), float32.

        The arrays belong to the calling thread and are overwritten by its next call.
        """
        rows = len(self.sources)
        if getattr(self._buffers, "count", -1) < rows * run:
            self._buffers.count = rows * run
            self._buffers.arrays = np.empty((rows * run, 3), np.float32), np.empty((rows * run, 3), np.float32)
        origins, directions = (array[: rows * run] for array in self._buffers.arrays)
        inputs = [self._aims, _share(lattice_points(first, run), wp.vec3), first]
        out = [_share(origins, wp.vec3), _share(directions, wp.vec3)]
        wp.launch(aim_rays, rows, inputs=inputs, outputs=out, device="cpu")
        return origins, directions

    def embree(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """First hit of each ray: parameter (inf if none) and triangle (-1 if none)."""
        if self._scene is None:
            return np.full(len(origins), np.inf, np.float32), np.full(len(origins), -1, np.int32)
        found = self._scene.run(origins, directions, output=1)
        return found["tfar"], found["primID"]

    def cast(self, first: int, run: int) -> Candidates:
        """Cast rays first to first + run - 1 of every row; marks what they see and returns what should be hidden."""
        origins, directions = self.rays(first, run)
        reach, hits = self.embree(origins, directions)
        found, count = np.zeros((CANDIDATE_CAPACITY, 4), np.int32), np.zeros(1, np.int32)
        rays = Rays()
        rays.origins, rays.directions = _share(origins, wp.vec3), _share(directions, wp.vec3)
        rays.reach, rays.hits = _share(reach), _share(hits)
        rounds = [self._aims.spot_counts, first, self._crossing]
        inputs = [self._maze, self._sources, run, *rounds, rays, self._owners, self._marks]
        wp.launch(
            mark_sightings, len(self.sources), inputs=inputs, outputs=[_share(found), _share(count)], device="cpu"
        )
        found = found[: count[0]]
        if self._glass_scene is not None:
            found = np.concatenate([found, self._look_through_glass(origins, directions, reach, run)])
        found = found[np.lexsort(found.T[::-1])]
        ray = found[:, 3]
        reach = np.where(hits[ray] >= 0, reach[ray], np.inf).astype(np.float64)
        return Candidates(*found.T[:3], origins[ray].astype(np.float64), directions[ray].astype(np.float64), reach)

    def _look_through_glass(
        self, origins: np.ndarray, directions: np.ndarray, reach: np.ndarray, run: int
    ) -> np.ndarray:
        """Mark transparent objects in front of the opaque hit, for a share of the rays."""
        part = np.arange(0, len(origins), GLASS_SHARE)
        limits = np.minimum(reach[part], np.float32(1e30))
        hits = self._glass_scene.run(origins[part], directions[part], dists=limits)
        part, hits = part[hits >= 0], hits[hits >= 0]
        rows, objects = part // run, self.glass[1][hits]
        hidden = ~self.potential_objects[rows, objects]
        self.seen_objects[rows[~hidden], objects[~hidden]] = 1
        rows, objects, part = rows[hidden], objects[hidden], part[hidden]
        once = np.unique(rows * self.potential_objects.shape[1] + objects, return_index=True)[1]
        return np.column_stack([rows[once], np.ones(len(once)), objects[once], part[once]]).astype(np.int32)

    def cell_rays(self, total: int) -> int:
        """How many of the first `total` rays of every row are followed through the cells; a bare graph's all are."""
        spots = np.array([len(own) for own in self.spots])
        whole, rest = np.divmod(total, ROUNDS * spots)
        return int((whole * self._crossing * spots + np.minimum(rest, self._crossing * spots)).sum())

    def raw_rate(self, first: int, run: int) -> float:
        """Rays a second of Embree alone, on two batches of the same rays and two threads."""
        batches = [[array.copy() for array in self.rays(first + k * run, run)] for k in range(2)]
        threads = [threading.Thread(target=self._scene.run, args=batch) for batch in batches]
        start = time.perf_counter()
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        return sum(len(origins) for origins, _ in batches) / (time.perf_counter() - start)


def embree_scene(triangles: np.ndarray) -> EmbreeScene | None:
    """Robust Embree scene of triangles in grid steps, shape (m, 3, 3), below 2**24 and so exact in float32."""
    if not len(triangles):
        return None
    scene = EmbreeScene(robust=True)
    corners = triangles.reshape(-1, 3).astype(np.float32)
    TriangleMesh(scene, corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3))
    # The first ray commits the scene, which must not happen on two threads at once.
    scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))
    return scene


def through_glass(
    glass: EmbreeScene | None, origins: np.ndarray, directions: np.ndarray, reach: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Sheets of glass that rays pass before they are stopped, one sheet after the other, at most 16.

    Args:
        glass: the transparent triangles; None if there are none.
        origins: [grid steps], shape (n, 3), float32.
        directions: unit length, shape (n, 3), float32.
        reach: parameter where each ray is stopped, infinity if it is not, shape (n,), float32.

    Yields:
        Rays (places in the arrays), the triangle that each meets, and the parameter where it does.
    """
    rays, passed = np.arange(len(origins)), np.zeros(len(origins), np.float32)
    for _ in range(LAYERS if glass is not None else 0):
        starts = origins[rays] + passed[:, None] * directions[rays]
        limits = np.minimum(reach[rays] - passed, np.float32(1e30))
        rays, starts, limits, passed = (column[limits > 0] for column in (rays, starts, limits, passed))
        # Embree overwrites the limits.
        found = glass.run(starts, directions[rays], dists=limits.copy(), output=1)
        hit = np.flatnonzero(found["primID"] >= 0)
        if not len(hit):
            return
        rays, passed = rays[hit], passed[hit] + found["tfar"][hit]
        yield rays, found["primID"][hit], passed
        # A step in float32, whose spacing is 2**-23 of the coordinate.
        passed = passed + np.float32(PAST_GLASS) + np.abs(starts[hit]).max(axis=1) * np.float32(2**-20)


def _share(array: np.ndarray, dtype: type | None = None) -> wp.array:
    """The array as Warp sees it, without a copy; `dtype` gathers the last axes into vectors or matrices."""
    if dtype is None:
        return wp.array(array, device="cpu", copy=False)
    return wp.array(array, dtype=dtype, device="cpu", copy=False)
