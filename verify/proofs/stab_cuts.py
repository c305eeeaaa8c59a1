"""The proof behind a HIDDEN of the stabbing kernel, rebuilt in integers from the cuts that it names."""

from itertools import combinations

import numpy as np

from .stab import Arc, Certificate

# The arcs of the five cycles, in the order in which the kernel numbers their rows.
CYCLES = (
    ((0, 1), (1, 0)),
    ((1, 2), (2, 1)),
    ((0, 2), (2, 0)),
    ((0, 1), (1, 2), (2, 0)),
    ((0, 2), (2, 1), (1, 0)),
)
TAG_BASE = 128


def arcs_of(tag: int) -> tuple[Arc, ...]:
    """The cycle that a tag names: tag = cycle + 8 (box + 128 (box + 128 box)), one box an arc."""
    cycle, boxes = CYCLES[tag % 8], tag // 8
    return tuple((i, j, (k := boxes // TAG_BASE**n % TAG_BASE), k) for n, (i, j) in enumerate(cycle))


def stab_certificate(boxes: np.ndarray, signs: tuple[int, int, int], tags: np.ndarray) -> Certificate | None:
    """At most three of the named cuts that contradict each other, or None if no three of them do.

    Args:
        boxes: (low, high corner) [grid steps], shape (n, 2, 3), integers.
        signs: direction octant, three of +-1.
        tags: a row of `kernels.stab_batch.StabAnswers.cuts`; the last one that is not -1 takes part in every proof.
    """
    named = [arcs_of(int(tag)) for tag in tags if tag >= 0]
    if not named:
        return None
    low, high = (np.asarray(boxes)[:, side] * np.array(signs) for side in (0, 1))
    low, high = np.minimum(low, high).tolist(), np.maximum(low, high).tolist()
    cuts = [_coefficients(low, high, arcs) for arcs in named]
    last, graze = len(named) - 1, None
    for size in range(min(3, len(named))):
        for others in combinations(range(last), size):
            chosen = (last, *others)
            for lambdas in _combinations([cuts[c] for c in chosen]):
                total = [
                    sum(weight * cuts[c][axis] for weight, c in zip(lambdas, chosen, strict=True)) for axis in range(3)
                ]
                used = [(named[c], weight) for weight, c in zip(lambdas, chosen, strict=True) if weight]
                if used and min(total) >= 0:
                    proof = Certificate(*zip(*used, strict=True), graze=not any(total))
                    if not proof.graze:
                        return proof
                    graze = graze or proof
    return graze


def _coefficients(low: list[list[int]], high: list[list[int]], arcs: tuple[Arc, ...]) -> tuple[int, int, int]:
    """Cut g of a cycle: g . w <= 0 for every line through the boxes."""
    g = [0, 0, 0]
    for i, j, k, _ in arcs:
        g[i] += low[k][i]
        g[j] -= high[k][j]
    return tuple(g)


def _combinations(cuts: list[tuple[int, int, int]]) -> list[tuple[int, ...]]:
    """Weights >= 0 that can span the cone of all weights with a nonnegative sum: its extreme rays.

    A ray of m cuts makes m - 1 components of the sum vanish, or it needs fewer cuts.
    """
    if len(cuts) == 1:
        return [(1,)]
    rows = list(zip(*cuts, strict=True))
    if len(cuts) == 2:
        rays = [(-b, a) for a, b in rows]
    else:
        pairs = combinations(rows, 2)
        rays = [(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]) for a, b in pairs]
    signed = [*rays, *(tuple(-x for x in ray) for ray in rays)]
    return [ray for ray in signed if min(ray) >= 0 and any(ray)]
