"""How large is what a view cell sees of an object? Mean solid angles, by sampling, with their errors."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from ..exact.sightline import Sightlines
from .embree import embree_scene

# Samples a pair in turn, as long as the relative error of its solid angle is above the wanted one; above the last it
# is too uncertain.
SAMPLES = ((1 << 11, 0.3), (1 << 14, 0.3), (1 << 17, 0.5))
# Samples cast together.
CHUNK = 1 << 18
THREADS = 2


class SolidAngles:
    """Solid angles of opaque objects from view cells: means over free points of them.

    The solid angle is the mean of A cos(a) / r**2 over pairs of a free point and a point uniform on the object's
    area A, r apart, with the angle a to the normal, where Embree's first hit is that point. Unbiased but for Embree's
    rounding, which may stop a ray, or let it through, at an edge.
    """

    def __init__(self, lines: Sightlines, objects: int, spots: list[np.ndarray]):
        """Take the scene.

        Args:
            lines: the opaque triangles and their objects.
            objects: of the model.
            spots: free points of each view cell [grid steps], ragged, float32; at least one in each.
        """
        self._corners, self._owners = lines.triangles.astype(np.float64), lines.owners
        sides = self._corners[:, 1:] - self._corners[:, :1]
        normals = np.cross(sides[:, 0], sides[:, 1])
        areas = np.linalg.norm(normals, axis=1) / 2
        self._normals, self._total = normals / (2 * areas[:, None]), np.concatenate([[0], np.cumsum(areas)])
        self._starts = np.searchsorted(self._owners, np.arange(objects + 1))
        self._scene = embree_scene(lines.triangles)
        self._spots, self._counts = np.concatenate(spots), np.array([len(own) for own in spots])
        self._first = np.cumsum(self._counts) - self._counts

    def graded(self, rows: np.ndarray, objects: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Solid angle of each pair [sr] and its relative error, by as many samples as it needs.

        Args:
            rows: place of the view cell, shape (n,), int.
            objects: that has opaque triangles, shape (n,), int.
            rng: source of randomness.

        Returns:
            Two arrays of shape (n,), float64. The error is one standard deviation; NaN where no sample saw the object.
        """
        sums, squares, counts = np.zeros((3, len(rows)))
        left = np.arange(len(rows))
        for count, wanted in SAMPLES:
            parts = np.array_split(left, max(1, -(-len(left) * count // CHUNK)))
            draws = rng.spawn(len(parts))
            works = [(rows[part], objects[part], count, own) for part, own in zip(parts, draws, strict=True)]
            with ThreadPoolExecutor(THREADS) as pool:
                for part, (total, square) in zip(parts, pool.map(lambda work: self(*work), works), strict=True):
                    sums[part] += total
                    squares[part] += square
                    counts[part] += count
            mean = sums / counts
            with np.errstate(divide="ignore", invalid="ignore"):
                error = np.sqrt(np.maximum(squares / counts - mean**2, 0) / counts) / mean
            left = np.flatnonzero(~(error <= wanted))
        return mean, error

    def __call__(
        self, rows: np.ndarray, objects: np.ndarray, count: int, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Sums, and sums of squares, over `count` samples of each pair [sr]."""
        row, chosen = np.repeat(rows, count), np.repeat(objects, count)
        origins = self._spots[self._first[row] + rng.integers(0, self._counts[row])].astype(np.float64)
        low, high = self._total[self._starts[chosen]], self._total[self._starts[chosen + 1]]
        place = low + rng.random(len(row)) * (high - low)
        triangles = np.clip(
            np.searchsorted(self._total, place, "right") - 1, self._starts[chosen], self._starts[chosen + 1] - 1
        )
        points = np.einsum("nc,nca->na", rng.dirichlet((1.0, 1.0, 1.0), len(row)), self._corners[triangles])
        along = points - origins
        distance = np.linalg.norm(along, axis=1)
        along /= distance[:, None]
        found = self._scene.run(origins.astype(np.float32), along.astype(np.float32), output=1)
        seen = (found["primID"] >= 0) & (self._owners[found["primID"]] == chosen)
        seen &= np.abs(found["tfar"] - distance) < 1e-4 * distance + 0.5
        cosine = np.abs((along * self._normals[triangles]).sum(axis=1))
        value = np.where(seen, (high - low) * cosine / distance**2, 0.0).reshape(-1, count)
        return value.sum(axis=1), (value**2).sum(axis=1)
