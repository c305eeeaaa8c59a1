"""A second look at claimed pairs that no ray has seen: what is left then is the overestimate, or hard to see."""

import numpy as np

from .embree import embree_scene
from .free_space import FreeSpace
from .targets import Targets

# A hit this far short of the aim, as a share of the way, is in front of it; float32 hits are good to about 1e-6.
SHORT = 1 - 1e-5
BATCH = 1 << 18


class SecondLook:
    """Rays from free points of view cells to points of given targets."""

    def __init__(self, free: FreeSpace, targets: Targets, opaque: tuple[np.ndarray, np.ndarray]):
        """Take where rays may start, where they may end, and the opaque triangles with their objects."""
        self.free, self.targets = free, targets
        self._owners = np.append(opaque[1], -1).astype(np.int64)
        self._scene = embree_scene(opaque[0])

    def see(self, rows: np.ndarray, targets: np.ndarray, tries: int, seed: int) -> tuple[np.ndarray, int]:
        """Which pairs (row of the view cells, target) a ray joins, shape (n,), bool, and how many rays it took.

        Sampled by Embree, so a pair that is not seen may be visible.
        """
        seen, rng, cast, done, copies = np.zeros(len(rows), bool), np.random.default_rng(seed), 0, 0, 1
        while done < tries:
            left = np.flatnonzero(~seen)
            for part in np.array_split(left, max(1, copies * len(left) // BATCH)):
                again = np.repeat(part, copies)
                seen[again[self._joined(rows[again], targets[again], rng)]] = True
                cast += len(again)
            done, copies = done + copies, min(2 * copies, tries - done - copies)
        return seen, cast

    def _joined(self, rows: np.ndarray, targets: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        origins, fresh, mixed = self.free.draw(rows, rng)
        along = self.targets.points(targets, rng) - origins
        # The ray's length is the unit: a hit at 1 is at the aim.
        found = self._scene.run(origins, along, output=1)
        joined = (found["primID"] < 0) | (found["tfar"] > SHORT) | (self._owners[found["primID"]] == targets)
        joined &= fresh
        doubt = np.flatnonzero(joined & mixed)
        joined[doubt] = self.free.lines.outside_solids(origins[doubt].astype(np.float64))
        return joined
