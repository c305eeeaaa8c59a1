"""Checking a proof of "no sightline" without the solver that found it.

The claim: no line of the given direction octant meets the inside of all boxes. Source: the five cycle conditions of
axial stabbing in crossing-time coordinates (see `verify.exact.stab`); a nonnegative combination of them that is
positive for every direction is a contradiction.
"""

from dataclasses import dataclass

import numpy as np

Arc = tuple[int, int, int, int]


@dataclass(frozen=True)
class Certificate:
    """Proof that no line of one octant passes through the inside of all boxes.

    Attributes:
        cuts: at most three cycles over the axes; an arc (i, j, k, m) of a cycle says "the line enters the slab of axis
            i of box k no later than it leaves the slab of axis j of box m", which holds only within one box: k == m.
        lambdas: integers >= 0, one a cut, not all 0.
        graze: the combination is 0 rather than positive: it excludes lines through the insides, not grazing lines.
    """

    cuts: tuple[tuple[Arc, ...], ...]
    lambdas: tuple[int, ...]
    graze: bool = False


def check_certificate(boxes: np.ndarray, signs: tuple[int, int, int], certificate: Certificate) -> bool:
    """Whether the certificate proves its claim, in exact integers.

    Args:
        boxes: (low, high corner) [grid steps], shape (n, 2, 3), integers.
        signs: direction octant, three of +-1.
        certificate: the proof to check.
    """
    total = [0, 0, 0]
    if len(certificate.cuts) != len(certificate.lambdas) or not 1 <= len(certificate.cuts) <= 3:
        return False
    if min(certificate.lambdas) < 0 or max(certificate.lambdas) == 0:
        return False
    for cycle, weight in zip(certificate.cuts, certificate.lambdas, strict=True):
        starts, ends = [arc[0] for arc in cycle], [arc[1] for arc in cycle]
        if len(cycle) < 2 or len(set(starts)) != len(cycle) or ends != starts[1:] + starts[:1]:
            return False
        for i, j, k, m in cycle:
            if k != m or not (0 <= k < len(boxes) and 0 <= min(i, j) and max(i, j) < 3):
                return False
            # A mirrored axis swaps its box's ends: the slab is entered at the high end.
            total[i] += int(weight) * signs[i] * int(boxes[k][0 if signs[i] > 0 else 1][i])
            total[j] -= int(weight) * signs[j] * int(boxes[k][1 if signs[j] > 0 else 0][j])
    return min(total) >= 0 and any(total) != certificate.graze
