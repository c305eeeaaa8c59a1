"""Random points of view cells outside every solid: fresh ones for every ray, exact where it matters."""

import numpy as np
from scipy.ndimage import label

from ...data.plans import NO_PLANS, Plans
from ..exact.plan import inside_plans
from ..exact.sightline import Sightlines

# Voxels along each axis of a view cell.
RESOLUTION = 32
FREE, SOLID, MIXED = 0, 1, 2
# Draws before a view cell that is nearly all solid falls back on its given points.
DRAWS = 8
# Share of a voxel by which triangles' boxes are widened: far above the rounding of a point's voxel.
PAD = 1e-3


class FreeSpace:
    """View cells on a voxel grid whose voxels are free, solid, or met by the surface of a solid.

    No surface of a closed object meets a connected set of unmixed voxels, so one exact test decides all its points.
    """

    def __init__(self, boxes: np.ndarray, spots: list[np.ndarray], lines: Sightlines, plans: Plans = NO_PLANS):
        """Classify the voxels.

        Args:
            boxes: view cells [grid steps], shape (rows, 2, 3), integers.
            spots: free points strictly inside each, ragged, float32; possibly none.
            lines: the opaque triangles and their objects.
            plans: of view cells that are prisms in their boxes.
        """
        self._plans = plans
        self.low, self.high = boxes[:, 0].astype(np.float64), boxes[:, 1].astype(np.float64)
        self.lines = lines
        self._middles = ((self.low + self.high) / 2).astype(np.float32)
        self._counts = np.array([len(own) for own in spots], np.int64)
        self._starts = np.cumsum(self._counts) - self._counts
        self._spots = np.concatenate([np.zeros((0, 3), np.float32), *spots]).astype(np.float32)
        closed = np.isin(lines.owners, lines.closed_owners)
        corners = lines.triangles[closed]
        low, high = (bound.astype(np.float64) for bound in (corners.min(axis=1), corners.max(axis=1)))
        order = np.argsort(low[:, 0], kind="stable")
        low, high = low[order], high[order]
        states = [self._classify(row, low, high) for row in range(len(boxes))]
        self.state = np.stack(states) if states else np.zeros((0, *(RESOLUTION,) * 3), np.uint8)
        self.lit = (self.state != SOLID).any(axis=(1, 2, 3)) | (self._counts > 0)

    def _classify(self, row: int, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        start, size = self.low[row], self.high[row] - self.low[row]
        near = np.searchsorted(low[:, 0], self.high[row, 0], "right")
        met = np.flatnonzero(high[:near, 0] >= start[0])
        for axis in (1, 2):
            met = met[(low[met, axis] <= self.high[row, axis]) & (high[met, axis] >= start[axis])]
        places = ((bound[met] - start) / size * RESOLUTION for bound in (low, high))
        first, last = (
            np.clip(np.floor(place + pad), 0, RESOLUTION - 1).astype(int)
            for place, pad in zip(places, (-PAD, PAD), strict=True)
        )
        # Boxes are added as differences at their eight corners; sums along the axes count them in every voxel.
        counts = np.zeros((RESOLUTION + 1,) * 3, np.int64)
        for corner in np.ndindex(2, 2, 2):
            index = np.where(corner, last + 1, first)
            np.add.at(counts, tuple(index.T), (-1) ** sum(corner))
        for axis in range(3):
            counts = counts.cumsum(axis=axis)
        mixed = counts[:-1, :-1, :-1] > 0
        parts, count = label(~mixed)
        samples = np.zeros((count, 3))
        number, place = np.unique(parts, return_index=True)
        samples[number[number > 0] - 1] = np.column_stack(np.unravel_index(place[number > 0], parts.shape))
        outside = self.lines.outside_solids(start + (samples + 0.5) / RESOLUTION * size)
        return np.concatenate([[MIXED], np.where(outside, FREE, SOLID)]).astype(np.uint8)[parts]

    def draw(self, rows: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A random point strictly inside each row's view cell, uniform in its voxels that are not solid.

        Args:
            rows: shape (n,), int.
            rng: source of randomness.

        Returns:
            Points [grid steps], shape (n, 3), float32 (exact as float64); whether each is such a point, shape (n,),
            bool: where chance found none it is a given one, or the view cell's middle; and whether it lies in a mixed
            voxel, where only an exact test can tell free from solid. The points that are not mixed are free, and with
            those that pass the test they are uniform in the view cell's free part.
        """
        points = self._middles[rows]
        fresh, mixed = np.zeros((2, len(rows)), bool)
        left = np.arange(len(rows))
        for _ in range(DRAWS):
            own = rows[left]
            place = rng.random((len(left), 3))
            drawn = (self.low[own] + place * (self.high[own] - self.low[own])).astype(np.float32)
            good = all_axes((drawn > self.low[own]) & (drawn < self.high[own]))
            x, y, z = (place * RESOLUTION).astype(np.int64).T
            state = self.state[own, x, y, z]
            good &= state != SOLID
            good &= inside_plans(self._plans, own, drawn.astype(np.float64))
            points[left[good]], fresh[left[good]], mixed[left[good]] = drawn[good], True, state[good] == MIXED
            left = left[~good]
            if not len(left):
                break
        left = left[self._counts[rows[left]] > 0]
        own = rows[left]
        points[left] = self._spots[self._starts[own] + (rng.random(len(left)) * self._counts[own]).astype(np.int64)]
        return points, fresh, mixed


def all_axes(flags: np.ndarray) -> np.ndarray:
    """flags.all(axis=1) of shape (n, 3), several times as fast."""
    return flags[:, 0] & flags[:, 1] & flags[:, 2]
