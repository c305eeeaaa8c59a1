"""What a check that found nothing is worth: how large a hole it would have missed, and how often.

A *hole* of a view cell is everything visible from it that its set does not hold. Its size is the solid angle that it
fills, averaged over the free points of the cell: x sr. A ray from a random free point in a random direction meets it
with probability x / 4 pi, so n independent rays all miss it with probability (1 - x / 4 pi)**n. With K cells the
allowed error is shared out evenly (Bonferroni), so that the statement holds for all of them at once. Derivation and
what it leaves out: docs/decisions/0009.
"""

import math
from dataclasses import dataclass

import numpy as np

SPHERE = 4 * math.pi
LEVEL = 0.05


@dataclass(frozen=True)
class Confidence:
    """The statement of a check that found nothing in its random rays.

    Attributes:
        rays: independent uniform rays of each view cell, shape (cells,), int.
        level: chance that the statement is wrong about any cell.
    """

    rays: np.ndarray
    level: float = LEVEL

    @property
    def holes_sr(self) -> np.ndarray:
        """For each cell the smallest size of hole [sr] that is ruled out, all cells at once; 4 pi without rays."""
        share = self.level / max(len(self.rays), 1)
        with np.errstate(divide="ignore"):
            return np.where(self.rays > 0, -SPHERE * np.expm1(np.log(share) / np.maximum(self.rays, 1)), SPHERE)

    def chance_missed(self, hole_sr: float) -> float:
        """Greatest chance, over the cells, that a hole of a size of one's own [sr] in the cell was missed."""
        if not len(self.rays):
            return 1.0
        return float(np.max((1.0 - min(hole_sr, SPHERE) / SPHERE) ** self.rays))

    def line(self) -> str:
        """The statement in a sentence."""
        if not len(self.rays) or not self.rays.min():
            return "none: a view cell got no random ray"
        least, worst = int(self.rays.min()), float(self.holes_sr.max())
        alone = -SPHERE * math.expm1(math.log(0.01) / least)
        return (
            f"with {100 * (1 - self.level):g} % confidence no view cell of {len(self.rays):,} hides more than "
            f"{worst:.2g} sr of what a random eye in it sees (at least {least:,} random rays per cell; a hole of "
            f"{alone:.2g} sr in a given cell would have been missed with probability below 1 %)"
        )
