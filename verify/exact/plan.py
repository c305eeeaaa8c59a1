"""Whether points lie inside the plans of view cells, exactly."""

from fractions import Fraction

import numpy as np

from ...data.plans import Plans
from .sightline import sure_sign


def inside_plans(plans: Plans, boxes: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Whether points lie strictly inside the plans of their boxes, where these have one, exactly; shape (n,), bool.

    Args:
        plans: of some boxes.
        boxes: box of each point, shape (n,), int.
        points: [grid steps], shape (n, 3), float64.
    """
    held = np.ones(len(points), bool)
    if not len(plans.rows):
        return held
    place = np.minimum(np.searchsorted(plans.rows, boxes), len(plans.rows) - 1)
    rows = np.flatnonzero(plans.rows[place] == boxes)
    corners, p = plans.corners[place[rows]].astype(np.float64), points[rows, :2].astype(np.float64)
    for k in range(4):
        a, b = corners[:, k], corners[:, (k + 1) % 4]
        left = (b[:, 0] - a[:, 0]) * (p[:, 1] - a[:, 1])
        right = (b[:, 1] - a[:, 1]) * (p[:, 0] - a[:, 0])
        sign = sure_sign(left - right, np.abs(left) + np.abs(right))
        for row in np.flatnonzero(sign == 0):
            (ax, ay), (bx, by), (x, y) = ([Fraction(float(c)) for c in point[row]] for point in (a, b, p))
            value = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
            sign[row] = (value > 0) - (value < 0)
        held[rows] &= sign > 0
    return held
