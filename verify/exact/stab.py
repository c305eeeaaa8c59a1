"""Axial stabbing in exact integers: does a line meet the inside of every box?

Twin of `kernels/stab.py`; shares nothing with it. In crossing-time coordinates w_i = 1 / d_i > 0, xi_i = w_i p_i the
slab tests of a box are linear, and eliminating xi leaves five cycle conditions on w (Goodman et al. 2006,
math/0409219, for the coordinates; Megiddo 1996 for the linear programme):

    M_ij(w) = max over boxes k of (w_i lo_ki - w_j hi_kj)
    F(w) = max(M_xy + M_yx, M_yz + M_zy, M_xz + M_zx, M_xy + M_yz + M_zx, M_xz + M_zy + M_yx)

A line through all insides exists exactly when F(w) < 0 for some w > 0. The search clips the cone w >= 0 by violated
cycles; every clip removes an interior ray and there are finitely many cycles, so it ends. Only rays with all w_i > 0
are tried: on the boundary w_i = 0 F can vanish without a line (all doors of one storey share a z range).
"""

from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations
from math import gcd

import numpy as np

from ...data.errors import InputError
from ...data.verdict import Verdict
from ..proofs.stab import Arc, Certificate

__all__ = ["Stab", "stab", "stab_closed"]

Ray = tuple[int, int, int]
CYCLES = ((0, 1), (1, 2), (0, 2), (0, 1, 2), (0, 2, 1))
AXIS_RAYS: tuple[Ray, ...] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


@dataclass(frozen=True)
class Stab:
    """Answer to one stabbing question.

    Attributes:
        verdict: VISIBLE or HIDDEN.
        point: a point of the witness line [grid steps], exact; None if HIDDEN.
        direction: of the witness line, signs as asked (0 allowed in the closed test), exact; None if HIDDEN.
        certificate: proof of HIDDEN, None if VISIBLE or if a closed test also had to exclude axis-parallel lines.
        graze: HIDDEN, but a line of the octant touches all closed boxes.
    """

    verdict: Verdict
    point: tuple[Fraction, Fraction, Fraction] | None = None
    direction: tuple[Fraction, Fraction, Fraction] | None = None
    certificate: Certificate | None = None
    graze: bool = False


def stab(boxes: np.ndarray, signs: tuple[int, int, int]) -> Stab:
    """Whether a line of the octant passes through the inside of all boxes (a flat box: of its rectangle).

    Args:
        boxes: (low, high corner) [grid steps], shape (n, 2, 3), integers of any size; low == high on an axis is a
            rectangle, on two a segment, on three a point. Segments and points have no inside: at best a graze.
        signs: direction octant, three of +-1.

    Returns:
        VISIBLE with a rational line, or HIDDEN with a certificate; never wrong.

    Raises:
        InputError: the shape, the signs, or low > high.
    """
    low, high = _mirrored(boxes, signs)
    w, certificate, graze = _search(low, high)
    if certificate is not None:
        return Stab(Verdict.HIDDEN, certificate=certificate, graze=graze is not None)
    return Stab(Verdict.VISIBLE, *_line(low, high, w, signs))


def stab_closed(boxes: np.ndarray, signs: tuple[int, int, int]) -> Stab:
    """Whether a line of the closed octant (zero components included) touches all closed boxes.

    For case files and tests, which tell what is grazed from what is missed. Args and errors as for `stab`. HIDDEN has
    the certificate of the open octant; the axis-parallel directions are excluded by the search itself.
    """
    low, high = _mirrored(boxes, signs)
    w, certificate, graze = _search(low, high)
    if w or graze:
        return Stab(Verdict.VISIBLE, *_line(low, high, w or graze, signs))
    line = _parallel_line(low, high, signs)
    return Stab(Verdict.VISIBLE, *line) if line else Stab(Verdict.HIDDEN, certificate=certificate)


def _mirrored(boxes: np.ndarray, signs: tuple[int, int, int]) -> tuple[list[Ray], list[Ray]]:
    boxes = np.asarray(boxes)
    if boxes.ndim != 3 or boxes.shape[1:] != (2, 3) or len(boxes) == 0 or boxes.dtype.kind not in "iuO":
        raise InputError(f"boxes: expected integers of shape (n, 2, 3), n > 0; found {boxes.dtype} {boxes.shape}")
    if len(signs) != 3 or any(s not in (1, -1) for s in signs):
        raise InputError(f"signs: expected three of +1 and -1; found {tuple(signs)}")
    if (boxes[:, 0] > boxes[:, 1]).any():
        raise InputError(f"boxes: expected low <= high; found box {int(np.argmax((boxes[:, 0] > boxes[:, 1]).any(1)))}")
    low, high = boxes[:, 0].tolist(), boxes[:, 1].tolist()
    for axis in range(3):
        if signs[axis] < 0:
            for a, b in zip(low, high, strict=True):
                a[axis], b[axis] = -b[axis], -a[axis]
    return low, high


def _longest_arcs(low: list[Ray], high: list[Ray], w: Ray) -> tuple[dict, dict]:
    """M_ij(w) of all ordered pairs of axes with w > 0, and the box that attains it."""
    longest, box = {}, {}
    axes = [i for i in range(3) if w[i]]
    enter = [[w[i] * a[i] for a in low] for i in range(3)]
    leave = [[w[i] * b[i] for b in high] for i in range(3)]
    for i in axes:
        for j in axes:
            if i != j:
                values = [a - b for a, b in zip(enter[i], leave[j], strict=True)]
                longest[i, j] = most = max(values)
                box[i, j] = values.index(most)
    return longest, box


def _worst_cycle(low: list[Ray], high: list[Ray], w: Ray) -> tuple[int, tuple[Arc, ...]]:
    """F(w), restricted to the axes with w > 0, and the cycle that attains it."""
    longest, box = _longest_arcs(low, high, w)
    worst, arcs = None, ()
    for cycle in CYCLES:
        pairs = [*zip(cycle, cycle[1:] + cycle[:1], strict=True)]
        if all(pair in longest for pair in pairs):
            value = sum(longest[pair] for pair in pairs)
            if worst is None or value > worst:
                worst, arcs = value, tuple((i, j, box[i, j], box[i, j]) for i, j in pairs)
    return worst, arcs


def _cut(low: list[Ray], high: list[Ray], arcs: tuple[Arc, ...]) -> Ray:
    """Coefficients g of the condition g . w <= 0 that a cycle of arcs imposes."""
    g = [0, 0, 0]
    for i, j, k, _ in arcs:
        g[i] += low[k][i]
        g[j] -= high[k][j]
    return tuple(g)


def _clip(rays: list[Ray], g: Ray) -> list[Ray]:
    """Extreme rays of the cone's part with g . w <= 0; neighbours in the list share a face of the cone."""
    side = [g[0] * r[0] + g[1] * r[1] + g[2] * r[2] for r in rays]
    kept = []
    for here, (r, s) in enumerate(zip(rays, side, strict=True)):
        if s <= 0:
            kept.append(r)
        q, t = rays[here - 1 if here else -1], side[here - 1 if here else -1]
        if (s < 0 < t) or (t < 0 < s):
            cross = [abs(t) * a + abs(s) * b for a, b in zip(r, q, strict=True)]
            shared = gcd(*cross)
            kept.insert(len(kept) - (s <= 0), tuple(c // shared for c in cross))
    # A segment of two rays meets its crossing twice, once from each end.
    return list(dict.fromkeys(kept))


def _search(low: list[Ray], high: list[Ray]) -> tuple[Ray | None, Certificate | None, Ray | None]:
    """(w with F(w) < 0, None, None), or (None, proof, w > 0 with F(w) = 0 if there is one)."""
    rays, cuts, arcs_of, flat = list(AXIS_RAYS), [], [], False
    while True:
        w = tuple(map(sum, zip(*rays, strict=True))) if rays else (0, 0, 0)
        if not all(w):
            return None, _certificate(cuts, arcs_of, positive=True), None
        worst, arcs = _worst_cycle(low, high, w)
        if worst < 0:
            return w, None, None
        if flat and worst == 0:
            return None, _certificate(cuts, arcs_of, positive=False), w
        g = _cut(low, high, arcs)
        cuts.append(g)
        arcs_of.append(arcs)
        flat = flat or not any(g[0] * r[0] + g[1] * r[1] + g[2] * r[2] < 0 for r in rays)
        rays = _clip(rays, g)


def _certificate(cuts: list[Ray], arcs_of: list[tuple[Arc, ...]], positive: bool) -> Certificate:
    """At most three of the cuts that contradict each other (Helly's theorem in the plane says that three suffice).

    Newest first: the last cuts emptied the cone.
    """
    newest = range(len(cuts) - 1, -1, -1)
    for size in (1, 2, 3):
        for chosen in combinations(newest, size):
            lambdas = _combination([cuts[c] for c in chosen], positive)
            if lambdas:
                used = [(arcs_of[c], weight) for c, weight in zip(chosen, lambdas, strict=True) if weight]
                arcs, weights = zip(*used, strict=True)
                return Certificate(arcs, weights, graze=not positive)
    raise AssertionError("three cuts suffice in the plane")


def _combination(cuts: list[Ray], positive: bool) -> tuple[int, ...] | None:
    """Integers lambda >= 0 with sum lambda g >= 0, not all 0; the sum itself not 0 if `positive`."""
    size = len(cuts)
    rays = list(AXIS_RAYS[:size])
    for axis in range(3):
        rays = _clip(rays, tuple([-g[axis] for g in cuts] + [0] * (3 - size)))
    if not rays:
        return None
    lambdas = tuple(map(sum, zip(*rays, strict=True)))
    total = [sum(weight * g[axis] for weight, g in zip(lambdas, cuts, strict=False)) for axis in range(3)]
    return lambdas[:size] if any(total) or not positive else None


def _line(low: list[Ray], high: list[Ray], w: Ray, signs: tuple[int, int, int]) -> tuple[tuple, tuple]:
    """A line of reciprocal direction w > 0: midway between the earliest and the latest crossing times."""
    worst = _worst_cycle(low, high, w)[0]
    # Scaled by 12 so that a sixth of F is an integer: it keeps the line off every boundary if F < 0.
    longest = {pair: 12 * value - 2 * worst for pair, value in _longest_arcs(low, high, w)[0].items()}
    xi = [0, 0, 0]
    for i, j in ((0, 1), (1, 0)):
        least = max(longest[i, 2], longest[i, j] + longest[j, 2])
        most = min(-longest[2, i], -longest[2, j] - longest[j, i])
        xi[i] = least + most
    point = tuple(Fraction(signs[i] * xi[i], 24 * w[i]) for i in range(3))
    return point, tuple(Fraction(signs[i], w[i]) for i in range(3))


def _parallel_line(low: list[Ray], high: list[Ray], signs: tuple[int, int, int]) -> tuple[tuple, tuple] | None:
    """A line with one or two zero components that touches all closed boxes, if there is one."""
    shared = [(max(a[i] for a in low), min(b[i] for b in high)) for i in range(3)]
    meets = [a <= b for a, b in shared]
    for axis in range(3):
        others = [i for i in range(3) if i != axis]
        if all(meets[i] for i in others):
            point = [Fraction(signs[i] * shared[i][0]) for i in range(3)]
            point[axis] = Fraction(0)
            return tuple(point), tuple(Fraction(signs[i] if i == axis else 0) for i in range(3))
    for axis in range(3):
        if meets[axis]:
            i, j = (k for k in range(3) if k != axis)
            w = _flat_search(low, high, i, j)
            if w:
                longest, _ = _longest_arcs(low, high, w)
                point, direction = [Fraction(0)] * 3, [Fraction(0)] * 3
                point[axis] = Fraction(signs[axis] * shared[axis][0])
                point[i] = Fraction(signs[i] * longest[i, j], w[i])
                direction[i], direction[j] = Fraction(signs[i], w[i]), Fraction(signs[j], w[j])
                return tuple(point), tuple(direction)
    return None


def _flat_search(low: list[Ray], high: list[Ray], i: int, j: int) -> Ray | None:
    """Reciprocal direction w with w_i, w_j > 0 and M_ij(w) + M_ji(w) <= 0, if there is one."""
    rays = [AXIS_RAYS[i], AXIS_RAYS[j]]
    while rays:
        w = tuple(map(sum, zip(*rays, strict=True)))
        if not (w[i] and w[j]):
            return None
        worst, arcs = _worst_cycle(low, high, w)
        if worst <= 0:
            return w
        rays = _clip(rays, _cut(low, high, arcs))
    return None
