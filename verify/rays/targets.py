"""Points on objects and in cells to aim rays at, which of them are near each other, and edges to look past."""

from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

# Triangles of an object that are drawn from, beside each once: by area.
BY_AREA = 64
# Points of each target by which neighbours are found, and the nearest points looked at.
SAMPLES, NEAREST = 16, 48
NEIGHBOURS = 16
# Targets whose neighbours are looked for together.
CHUNK = 1 << 10
# Normals whose cosine is above this make a flat edge.
FLAT = 1 - 1e-9
# Odd multipliers that mix coordinates and ids (Steele et al. 2014, "Fast Splittable Pseudorandom Number Generators").
MIX = np.array([0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB], np.uint64)


class Targets:
    """Objects and cells as targets of rays: object_id, or object count + cell_id.

    Attributes:
        count: of objects and cells.
        objects: of objects.
        present: targets that have points, shape (count,), bool.
        cells: boxes of the cells [grid steps], shape (cells, 2, 3), float32.
    """

    def __init__(self, triangles: np.ndarray, owners: np.ndarray, objects: int, cells: np.ndarray):
        """Take the surfaces.

        Args:
            triangles: corners [grid steps], shape (m, 3, 3), below 2**24 and so exact in float32.
            owners: object of each, shape (m,).
            objects: number of objects, with or without triangles.
            cells: boxes of cells that are targets too, shape (cells, 2, 3).
        """
        order = np.argsort(owners, kind="stable")
        self._triangles, owners = triangles[order].astype(np.float32), owners[order]
        self.objects, self.count = objects, objects + len(cells)
        self.cells = cells.reshape(-1, 2, 3).astype(np.float32)
        self.present = np.ones(self.count, bool)
        self.present[:objects] = np.bincount(owners, minlength=objects)[:objects] > 0
        sides = self._triangles[:, 1:].astype(np.float64) - self._triangles[:, :1]
        area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
        starts = np.searchsorted(owners, np.arange(objects + 1))
        pools = [np.zeros(0, np.int64)]
        for first, last in pairwise(starts.tolist()):
            if first < last:
                total = np.cumsum(area[first:last])
                drawn = np.searchsorted(total, (np.arange(BY_AREA) + 0.5) / BY_AREA * total[-1])
                pools.append(first + np.concatenate([np.minimum(drawn, last - first - 1), np.arange(last - first)]))
        self._pool = np.concatenate(pools).astype(np.int32)
        sizes = np.diff(starts) + np.where(self.present[:objects], BY_AREA, 0)
        self._ends = np.cumsum(sizes)
        self._starts = self._ends - sizes

    def points(self, targets: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """A random point of each target, shape (n, 3), float32: by area and by triangle on objects, inside cells."""
        out = np.empty((len(targets), 3), np.float32)
        on = np.flatnonzero(targets < self.objects)
        own = targets[on]
        place = self._starts[own] + (rng.random(len(on)) * (self._ends[own] - self._starts[own])).astype(np.int64)
        corners = self._triangles[self._pool[place]]
        root, share = np.sqrt(rng.random((len(on), 1), np.float32)), rng.random((len(on), 1), np.float32)
        out[on] = corners[:, 0] * (1 - root) + corners[:, 1] * (root * (1 - share)) + corners[:, 2] * (root * share)
        inside = np.flatnonzero(targets >= self.objects)
        low, high = self.cells[targets[inside] - self.objects].transpose(1, 0, 2)
        out[inside] = low + rng.random((len(inside), 3), np.float32) * (high - low)
        return out

    def neighbours(self, rng: np.random.Generator) -> np.ndarray:
        """Nearest other targets of each, shape (count, 16), int32; -1 where the 48 nearest points have no more."""
        ids = np.repeat(np.flatnonzero(self.present), SAMPLES)
        out = np.full((self.count, NEIGHBOURS), -1, np.int32)
        if len(ids):
            points = self.points(ids, rng)
            tree = cKDTree(points)
            for first in range(0, len(ids), CHUNK * SAMPLES):
                part = slice(first, first + CHUNK * SAMPLES)
                distance, place = tree.query(points[part], k=np.arange(1, min(NEAREST, len(points)) + 1), workers=2)
                keep_nearest(np.repeat(ids[part], place.shape[1]), ids[place].ravel(), distance.ravel(), out)
        return out


def keep_nearest(here: np.ndarray, there: np.ndarray, distance: np.ndarray, out: np.ndarray) -> None:
    """Write the targets nearest to each of `here`, itself excepted, into its row of `out`, the nearest first."""
    keys = here * np.int64(len(out)) + there
    order = np.argsort(distance)
    order = order[(here != there)[order]]
    # The first of a pair is its nearest.
    first = np.sort(np.unique(keys[order], return_index=True)[1])
    pairs = order[first[np.argsort(here[order[first]], kind="stable")]]
    here, there = here[pairs], there[pairs]
    rank = np.arange(len(here)) - np.searchsorted(here, here)
    kept = rank < out.shape[1]
    out[here[kept], rank[kept]] = there[kept]


def sharp_edges(triangles: np.ndarray, owners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Edges of objects where two triangles do not lie in one plane, or that one triangle has alone.

    Args:
        triangles: corners [grid steps], shape (m, 3, 3), integers.
        owners: object of each, shape (m,).

    Returns:
        Object of each edge, shape (n,), ascending, and its two ends, each of shape (n, 3), float32. Edges are told
        apart by 64-bit hashes of their corners: one may be missing or be there in vain, so only rays may rely on them.
    """
    corners = triangles.astype(np.int64)
    sides = (corners[:, 1:] - corners[:, :1]).astype(np.float64)
    normals = np.cross(sides[:, 0], sides[:, 1])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    mixed = (corners.astype(np.uint64) * MIX).sum(axis=2, dtype=np.uint64)
    mixed = (mixed ^ (mixed >> np.uint64(29))) * MIX[1]
    start, end = mixed.ravel(), np.roll(mixed, -1, axis=1).ravel()
    owner = np.repeat(owners.astype(np.uint64), 3)
    keys = (np.minimum(start, end) * MIX[2]) ^ np.maximum(start, end) ^ (owner * MIX[0])
    order = np.argsort(keys, kind="stable")
    same = np.diff(keys[order]) == 0
    normal = np.repeat(normals, 3, axis=0)[order]
    flat = np.zeros(len(keys), bool)
    level = same & ((normal[1:] * normal[:-1]).sum(axis=1) > FLAT)
    flat[1:] = level
    flat[:-1] |= level
    kept = order[~flat & np.concatenate([np.ones(min(1, len(keys)), bool), ~same])]
    kept = kept[np.argsort(owner[kept], kind="stable")]
    ends = (side.reshape(-1, 3)[kept].astype(np.float32) for side in (corners, np.roll(corners, -1, axis=1)))
    return owner[kept].astype(np.int64), *ends
