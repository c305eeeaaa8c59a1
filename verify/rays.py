"""Rays from every inhabitable cell through the true triangles, by Embree: what they see must be in the bake.

Embree's robust mode misses up to 0.4 % of hits at vertices, so nothing here is final: `Caster.cast` returns candidates
for exact adjudication.
"""

import threading
import time
from dataclasses import dataclass, field

import numpy as np
import warp as wp
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from .aims import ORIGINS_MOST
from .walk import Links, Maze, Sightings, walk_rays

CANDIDATE_CAPACITY = 4096
ORIGINS = wp.constant(ORIGINS_MOST)
# One ray in this many is also cast at the transparent triangles.
GLASS_SHARE = 8


@wp.kernel
def aim_rays(
    seed: int, first: int, spots: wp.array3d[float], spot_counts: wp.array[int], aims: wp.array2d[float],
    frontier: wp.array3d[float], origins_out: wp.array2d[float], directions_out: wp.array2d[float],
):  # fmt: skip
    """Rays `first` and following of every row: origins in turn, directions from a shifted lattice or at an aim.

    Of five rays three are stratified, one is aimed at an object and one just beyond the potentially visible set.

    The lattice is Roberts' R2 sequence, mapped to the sphere by equal areas, shifted at random for every origin.
    """
    ray = wp.tid()
    rows = spot_counts.shape[0]
    run = origins_out.shape[0] // rows
    row = ray // run
    number = first + ray % run
    spot = number % spot_counts[row]
    turn = number // spot_counts[row]
    o = wp.vec3(spots[row, spot, 0], spots[row, spot, 1], spots[row, spot, 2])
    # One stream a ray for its aim, one an origin for the shift of its lattice.
    state = wp.rand_init(seed, row * 1048573 + number)
    d = wp.vec3()
    if turn % 5 == 3 and aims.shape[0] > 0:
        aim = wp.randi(state, 0, aims.shape[0])
        d = wp.normalize(wp.vec3(aims[aim, 0], aims[aim, 1], aims[aim, 2]) - o)
    if turn % 5 == 4 and frontier.shape[1] > 0:
        aim = wp.randi(state, 0, frontier.shape[1])
        d = wp.normalize(wp.vec3(frontier[row, aim, 0], frontier[row, aim, 1], frontier[row, aim, 2]) - o)
    if wp.length(d) < 0.5:
        shift = wp.rand_init(seed + 1, row * ORIGINS + spot)
        # R2's two steps as 32-bit fractions: the wrap-around is the lattice's modulo.
        u = wp.randu(shift) + wp.uint32(turn) * wp.uint32(3242174889)
        v = wp.randu(shift) + wp.uint32(turn) * wp.uint32(2447445414)
        height = float(v) * (2.0 / 4294967296.0) - 1.0
        angle = float(u) * (2.0 * wp.pi / 4294967296.0)
        radius = wp.sqrt(wp.max(0.0, 1.0 - height * height))
        d = wp.vec3(radius * wp.cos(angle), radius * wp.sin(angle), height)
    for axis in range(3):
        origins_out[ray, axis] = o[axis]
        directions_out[ray, axis] = d[axis]


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
    seen_cells: np.ndarray = field(init=False)
    seen_objects: np.ndarray = field(init=False)

    def __post_init__(self):
        self.seen_cells = np.zeros(self.potential_cells.shape, np.uint8)
        self.seen_objects = np.zeros(self.potential_objects.shape, np.uint8)
        # A ray starts in its own cell, which therefore needs no mark of the walk.
        self.seen_cells[np.arange(len(self.sources)), self.sources] = 1
        self._lock = threading.Lock()
        self._scene, self._glass_scene = embree_scene(self.opaque[0]), embree_scene(self.glass[0])
        spots = np.zeros((len(self.spots), max(map(len, self.spots)), 3), np.float32)
        for row, own in enumerate(self.spots):
            spots[row, : len(own)] = own
        self._aim = (_share(spots), _share(np.array([len(own) for own in self.spots], np.int32)))
        self._aim += (_share(self.aims), _share(self.frontier))
        self._maze, self._marks = Maze(), Sightings()
        self._maze.boxes = _share(self.boxes.reshape(-1, 6).astype(np.float64))
        for name in ("starts", "cells", "rectangles", "portals"):
            setattr(self._maze, name, _share(getattr(self.links, name)))
        for name, table in (("cells", self.seen_cells), ("objects", self.seen_objects)):
            setattr(self._marks, name, _share(table))
        for name in ("potential_cells", "potential_objects"):
            setattr(self._marks, name, _share(np.ascontiguousarray(getattr(self, name))))
        self._owners = _share(self.opaque[1].astype(np.int32) if len(self.opaque[1]) else np.zeros(1, np.int32))
        self._sources = _share(self.sources.astype(np.int32))

    def rays(self, first: int, run: int) -> tuple[np.ndarray, np.ndarray]:
        """Rays first to first + run - 1 of every row: origins and directions, shape (rows * run, 3), float32."""
        count = len(self.sources) * run
        origins, directions = np.empty((count, 3), np.float32), np.empty((count, 3), np.float32)
        out = [_share(origins), _share(directions)]
        wp.launch(aim_rays, count, inputs=[self.seed, first, *self._aim], outputs=out, device="cpu")
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
        rays = [_share(origins), _share(directions), _share(reach)]
        inputs = [self._maze, self._sources, *rays, self._owners, _share(hits), self._marks]
        wp.launch(walk_rays, len(origins), inputs=inputs, outputs=[_share(found), _share(count)], device="cpu")
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

    def raw_rate(self, rounds: int = 3) -> float:
        """Rays a second of Embree alone, on the same rays and two threads; the median of some rounds."""
        run = max(1, 100_000 // len(self.sources))
        batches = [self.rays(k * run, run) for k in range(2)]
        rates = []
        for _ in range(rounds):
            start = time.perf_counter()
            threads = [threading.Thread(target=self._scene.run, args=batch) for batch in batches]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
            rates.append(sum(len(o) for o, _ in batches) / (time.perf_counter() - start))
        return float(np.median(rates))


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


def _share(array: np.ndarray) -> wp.array:
    """The array as Warp sees it, without a copy."""
    return wp.array(array, device="cpu", copy=False)
