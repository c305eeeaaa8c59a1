"""What the ray through a pixel's centre meets first, in rationals: the referee of the rasteriser."""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from ..arithmetic import cross, dot, fractions, minus


@dataclass(frozen=True)
class Hit:
    """What a ray meets.

    Attributes:
        owner: of the triangle met first; -1 if none is met.
        clear: squared distance [pixels] from the ray to the nearest edge on the screen, of triangles that end within
            a pixel; None if there is none.
        lead: by how much the next owner's surface is farther away, as part of the depth; None if there is none.
        depth: along the view, of what is met; None if nothing is.
    """

    owner: int
    clear: Fraction | None
    lead: Fraction | None
    depth: Fraction | None = None


def first_hit(
    triangles: np.ndarray,
    owners: Sequence[int],
    eye: np.ndarray,
    axes: np.ndarray,
    pixel: tuple[float, float],
    focal: float,
    near: float,
) -> Hit:
    """The owner that a ray meets first beyond the near plane, and how narrowly.

    Args:
        triangles: shape (m, 3, 3), integers.
        owners: of each triangle.
        eye: 3 float64.
        axes: right, up, forward as rows, shape (3, 3), float64; camera coordinates of p are axes . (p - eye), exactly.
        pixel: x to the right and y up, from the middle of the screen.
        focal: in the same unit.
        near: smallest depth that is drawn.
    """
    ray = [*fractions(pixel), Fraction(float(focal))]
    origin, rows, least = fractions(eye), [fractions(row) for row in axes], Fraction(float(near))
    nearest: dict[int, Fraction] = {}
    clear: Fraction | None = None
    for corners, owner in zip(triangles, owners, strict=True):
        a, b, c = ([dot(row, minus(fractions(p), origin)) for row in rows] for p in corners)
        sides = [cross(b, c), cross(c, a), cross(a, b)]
        volume = dot(a, sides[0])
        if volume == 0:
            continue
        weights = [dot(side, ray) / volume for side in sides]
        gaps = [dot(side, ray) ** 2 / (side[0] ** 2 + side[1] ** 2) for side in sides if (side[0], side[1]) != (0, 0)]
        near_edge = min(gaps, default=None)
        if near_edge is not None and (clear is None or near_edge < clear):
            clear = near_edge
        if min(weights) < 0:
            continue
        # ray = sum of weights times corners: the plane is met at ray / sum(weights).
        depth = ray[2] / sum(weights)
        if depth >= least and (owner not in nearest or depth < nearest[owner]):
            nearest[owner] = depth
    if not nearest:
        return Hit(-1, clear, None)
    order = sorted(nearest, key=lambda owner: nearest[owner])
    lead = nearest[order[1]] / nearest[order[0]] - 1 if len(order) > 1 else None
    return Hit(order[0], clear, lead, nearest[order[0]])
