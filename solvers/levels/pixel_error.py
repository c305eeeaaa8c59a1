"""Levels of detail that a view cell may use: the coarsest whose deviation stays below some pixels on every image.

Camera: a flat image of w x h square pixels, vertical field of view phi, so focal length F = (h/2) / tan(phi/2) pixels
and T = sqrt(w**2 + h**2) / (2 F), the tangent of the angle between the axis and a corner. Any eye in the cell, any
orientation.

Let p be a point of one of the two surfaces that the image shows, and p' the point of the other within e of it; let the
eye be at distance r >= d from p, d > e. Then the angle g at the eye between them is at most b, sin b = e / d. On the
image, in units of F, let q and q' be their places and D = |q' - q|. Then

    tan g = |(q, 1) x (q', 1)| / (1 + q . q') = sqrt(D**2 + (q x q')**2) / (1 + q . q'),

and 1 + q . q' <= 1 + |q|**2 + |q| D, with q x q' = 0 where that is attained: of all displacements D, one straight
outwards takes the least angle, tan g >= D / (1 + |q|**2 + |q| D). So

    D <= tan g (1 + |q|**2) / (1 - |q| tan g),          that is, tan(theta + g) - tan(theta) for |q| = tan(theta),

which grows with g <= b and with |q| <= T (where T tan b >= 1 there is no bound: p' may be beside or behind the eye). It
is attained: p in a corner of the image, p' outwards of it on the tangent to the sphere about p. So F D <= pixels
exactly if tan b <= K, K = pixels / (F (1 + T**2) + pixels T), and that is e <= d K / sqrt(1 + K**2).

d is the distance between the view cell and the object's box grown by e, which holds both surfaces, p being of either.
Source of the question: Chhugani et al. 2005, section 4; of a deviation's image by an angle: Cohen, Olano and Manocha
1998, "Appearance-preserving simplification", which has the image's middle only.
"""

from dataclasses import dataclass

import numpy as np

from ...data.camera import Screen
from ...data.errors import InputError

FULL_HD = Screen(1920, 1080, 60.0)
# Far above the rounding of the few operations from a distance to a verdict, and from coordinates to a distance.
ROUNDING = 2.0**-40
# Pairs at a time, for the memory.
CHUNK = 2**18


@dataclass(frozen=True)
class PixelLimit:
    """What an image may show of a deviation.

    Attributes:
        pixels: limit on the displacement of a surface on the image, above 0.
        screen: the image.
    """

    pixels: float = 1.0
    screen: Screen = FULL_HD

    def __post_init__(self) -> None:
        """Raise InputError for a number out of range."""
        if not 0 < self.pixels < np.inf:
            raise InputError(f"pixels: expected a number above 0, found {self.pixels}")

    @property
    def deviation_per_distance(self) -> float:
        """The greatest e / d whose image stays within the limit, wherever on the image; rounded down."""
        focal = self.screen.focal
        corner = np.hypot(self.screen.width, self.screen.height) / (2 * focal)
        limit = self.pixels / (focal * (1 + corner**2) + self.pixels * corner)
        return float(limit / np.hypot(1, limit) * (1 - ROUNDING))


def pixel_levels(
    cells: np.ndarray, bounds: np.ndarray, errors: np.ndarray, starts: np.ndarray, rows: np.ndarray, limit: PixelLimit
) -> np.ndarray:
    """Coarsest level of an object whose deviation is within a limit of pixels from everywhere in a view cell.

    Args:
        cells: boxes of view cells, shape (cells, 2, 3); every length in one unit.
        bounds: box of each object at level 0, shape (objects, 2, 3).
        errors: bound on each level's deviation from level 0, object after object, not falling along an object's levels.
        starts: where each object's levels begin, shape (objects + 1,), int.
        rows: (cell, object), shape (n, 2), int.
        limit: the image and what it may show.

    Returns:
        Shape (n,), int32. Never too coarse, and 0 where the cell meets the object's box; finer than need be where the
        box is nearer than the surface.

    Raises:
        InputError: a row names no cell or no object, or an object has no level.
    """
    cells, bounds, errors = (np.asarray(x, np.float64) for x in (cells, bounds, errors))
    rows, starts = np.asarray(rows, np.int64).reshape(-1, 2), np.asarray(starts, np.int64)
    limits = (len(cells), len(bounds))
    if len(rows) and ((rows < 0).any() or (rows.max(axis=0) >= limits).any()):
        raise InputError(f"rows: expected pairs below {limits}, found {rows.min(axis=0)} to {rows.max(axis=0)}")
    counts = np.diff(starts)
    if len(starts) != len(bounds) + 1 or (counts < 1).any() or starts[-1] != len(errors):
        raise InputError(f"starts: expected at least one level for each of {len(bounds)} objects, found {starts}")
    ratio = limit.deviation_per_distance
    margin = ROUNDING * max(np.abs(cells).max(initial=0), np.abs(bounds).max(initial=0))
    found = np.zeros(len(rows), np.int32)
    for first in range(0, len(rows), CHUNK):
        cell, item = rows[first : first + CHUNK].T
        several = np.flatnonzero(counts[item] > 1)
        cell, item = cell[several], item[several]
        # Of every axis: how far the boxes are apart, before the object's is grown.
        apart = np.maximum(bounds[item, 0] - cells[cell, 1], cells[cell, 0] - bounds[item, 1])
        level = np.zeros(len(item), np.int32)
        for k in range(1, int(counts[item].max(initial=1))):
            error = errors[np.minimum(starts[item] + k, starts[item + 1] - 1)]
            gap = np.maximum(apart - error[:, None] - margin, 0)
            enough = (error * error <= ratio * ratio * (gap * gap).sum(axis=1)) & (k < counts[item])
            # Errors do not fall along a chain, so what is too coarse stays so.
            level[enough] = k
        found[first + several] = level
    return found
