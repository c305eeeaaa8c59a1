"""Sightlines that may be clear, found by Embree: float32 and fast, so nothing here is final."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from ...data.shapes import shared_corners
from ...kernels.launch import Device

# Rays that a thread casts at a time.
RUN = 1 << 14


class Finder:
    """Casts sightlines at the opaque ones of some triangles, on the CPU: a `Guide` towards free points.

    Attributes:
        triangles: all of them [grid steps], shape (m, 3, 3), int32.
        owners: object of each, and -1 for none, shape (m + 1,), int.
        scene: the opaque ones in Embree, in their order; None if there are none.
    """

    def __init__(
        self,
        triangles: np.ndarray,
        owners: np.ndarray,
        opaque: np.ndarray,
        device: Device,
        models: np.ndarray | None = None,
    ) -> None:
        """Build the scene of those triangles that are opaque, shape (m,), bool; `models` as of `device_triangles`."""
        self.triangles, self.owners, self._device, self.scene = triangles, np.append(owners, -1), device, None
        self._index = np.append(np.flatnonzero(opaque), -1)
        if opaque.any():
            self.scene = EmbreeScene(robust=True)
            models = np.arange(int(owners.max()) + 1) if models is None else models
            # Most of the time goes into handing over corners, one by one.
            corners, places = shared_corners(triangles, np.searchsorted(owners, np.arange(len(models) + 1)), models)
            TriangleMesh(self.scene, corners.astype(np.float32), places[opaque])
            # The first ray commits the scene, which must not happen on two threads at once.
            self.scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))

    def may_be_clear(self, rows: np.ndarray, origins: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """As of `Guide`: those that meet no opaque triangle."""
        return self.first(origins, ends) < 0

    def wanted(self, rows: np.ndarray, found: np.ndarray) -> np.ndarray:
        """As of `Guide`: all."""
        return np.ones(len(rows), bool)

    def first(self, origins: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """First triangle that each sightline meets before its end, -1 for none; shape (n,), int."""
        if self.scene is None:
            return np.full(len(origins), -1)

        def cast(begin: int) -> np.ndarray:
            start, ways = origins[begin : begin + RUN], ends[begin : begin + RUN] - origins[begin : begin + RUN]
            reach = np.ones(len(start), np.float32)
            return self._index[self.scene.run(start.astype(np.float32), ways.astype(np.float32), dists=reach)]

        runs = range(0, len(origins), RUN)
        threads = self._device.threads_here
        if threads == 1 or len(runs) < 2:
            return np.concatenate([np.zeros(0, int), *map(cast, runs)])
        with ThreadPoolExecutor(threads) as pool:
            return np.concatenate(list(pool.map(cast, runs)))
