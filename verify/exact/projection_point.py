"""How near the optimum a projection point is, in rationals: feasibility, and a bound that no point can beat.

The programmes of `solvers.projection_point` minimise a convex f, sum w (n . v - b)**2 or sum w n . v, under rows r . v
>= c; their numbers are float64 and taken at their exact values. For any point u and weights y >= 0 of the rows with

    grad f(u) = sum y r                                                                          (stationarity)

every feasible v has f(v) >= f(u) + grad f(u) . (v - u) = f(u) + sum y r . (v - u) >= f(u) + sum y (c - r . u): Karush,
Kuhn and Tucker's conditions, with what complementarity lacks as the gap. Weights found in float64 miss stationarity by
a little; the rows |v - centre| <= reach, +-1 times an axis, take up the rest exactly, at the price of it times the
reach. No square roots are needed: the cone form min t, || diag(sqrt w) (N v - b) || <= t has t**2 = f.
"""

from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol

import numpy as np

from ...data.errors import InputError
from ..arithmetic import dot

__all__ = ["Optimality", "Programme", "lower_bound", "optimality", "relative_gap"]

Point = list[Fraction]


class Programme(Protocol):
    """Minimise sum w (n . v - b)**2, or sum w n . v, over rows . v >= bounds; what a solver was given."""

    quadratic: bool
    normals: np.ndarray
    targets: np.ndarray
    weights: np.ndarray
    far: np.ndarray
    rows: np.ndarray
    bounds: np.ndarray
    scale: float


@dataclass(frozen=True)
class Optimality:
    """What is proved of a point.

    Attributes:
        value: of the objective at the point, exact.
        bound: no feasible point has a smaller value; None if no weights were found, as without rows of a box.
        weights: the proof of it, by row; see `lower_bound`.
        violation: of the row violated most [grid steps, rows being of unit length], 0 if the point is feasible.
        behind: occluders whose planes the point is not strictly in front of.
    """

    value: Fraction
    bound: Fraction | None
    weights: dict[int, Fraction]
    violation: Fraction
    behind: int

    @property
    def gap(self) -> Fraction | None:
        """How much may be left to gain; negative if the point gains by violating rows."""
        return None if self.bound is None else self.value - self.bound


def optimality(problem: Programme, point: np.ndarray) -> Optimality:
    """Proof of how near the optimum a point is; of the weights only the quality is in float64.

    Args:
        problem: with at least one occluder.
        point: shape (3,), finite [grid steps].

    Raises:
        InputError: the point is not finite, or there is no occluder.
    """
    point = np.asarray(point, np.float64)
    if point.shape != (3,) or not np.isfinite(point).all() or len(problem.normals) == 0:
        raise InputError(f"expected a finite point and an occluder; found {point}, {len(problem.normals)} occluders")
    at = [Fraction(c) for c in point.tolist()]
    value, gradient = _value(problem, at)
    rows = zip(problem.rows.tolist(), problem.bounds.tolist(), strict=True)
    slack = [dot([Fraction(c) for c in row], at) - Fraction(bound) for row, bound in rows]
    weights = _stationary(problem, gradient, _proposed(problem, gradient, slack))
    bound = None if weights is None else lower_bound(problem, at, weights)
    heights = zip(problem.normals.tolist(), problem.far.tolist(), strict=True)
    behind = sum(dot([Fraction(c) for c in n], at) >= Fraction(d) for n, d in heights)
    return Optimality(value, bound, weights or {}, max(0, *(-s for s in slack)), behind)


def relative_gap(problem: Programme, point: np.ndarray) -> float:
    """Proved distance from the optimum, relative to the value and what a cell diagonal makes; NaN without a bound.

    The second keeps optima of 0 comparable, where all occluders have their way.
    """
    proved = optimality(problem, point)
    unit = Fraction(float(problem.weights.sum() * problem.scale**2))
    return float(proved.gap / (proved.value + unit)) if proved.gap is not None else float("nan")


def lower_bound(problem: Programme, at: Point, weights: dict[int, Fraction]) -> Fraction | None:
    """What no feasible point undercuts, by weights of rows; None if they prove nothing. The checker of `Optimality`."""
    value, gradient = _value(problem, at)
    rows = {k: [Fraction(c) for c in problem.rows[k].tolist()] for k in weights}
    total = [sum(y * rows[k][axis] for k, y in weights.items()) for axis in range(3)]
    if min(weights.values(), default=0) < 0 or total != gradient:
        return None
    return value + sum(y * (Fraction(float(problem.bounds[k])) - dot(rows[k], at)) for k, y in weights.items())


def _value(problem: Programme, at: Point) -> tuple[Fraction, Point]:
    """The objective and its gradient."""
    value, gradient = Fraction(0), [Fraction(0)] * 3
    terms = zip(problem.normals.tolist(), problem.targets.tolist(), problem.weights.tolist(), strict=True)
    for normal, target, weight in terms:
        n, w = [Fraction(c) for c in normal], Fraction(weight)
        miss = dot(n, at) - Fraction(target) if problem.quadratic else Fraction(1, 2)
        value += w * (miss * miss if problem.quadratic else dot(n, at))
        gradient = [g + 2 * w * miss * c for g, c in zip(gradient, n, strict=True)]
    return value, gradient


def _proposed(problem: Programme, gradient: Point, slack: list[Fraction]) -> dict[int, Fraction]:
    """Weights near stationarity with the least sum of weight times slack, from a float64 linear programme."""
    from scipy.optimize import linprog

    wanted = np.array([float(g) for g in gradient])
    largest = max(np.abs(wanted).max(), 1e-300)
    cost = np.maximum([float(s) for s in slack], 0.0) / problem.scale
    answer = linprog(cost, A_eq=problem.rows.T, b_eq=wanted / largest, method="highs-ds")
    if answer.x is None:
        return {}
    scale = Fraction(float(largest))
    return {int(k): Fraction(float(answer.x[k])) * scale for k in np.flatnonzero(answer.x > 0)}


def _stationary(problem: Programme, gradient: Point, weights: dict[int, Fraction]) -> dict[int, Fraction] | None:
    """The weights, with what is missing of the gradient put on rows along the axes; None if there is no such row."""
    out = dict(weights)
    rows = problem.rows.tolist()
    for axis in range(3):
        missing = gradient[axis] - sum(y * Fraction(rows[k][axis]) for k, y in weights.items())
        if missing == 0:
            continue
        unit = [float(i == axis) * (1 if missing > 0 else -1) for i in range(3)]
        if unit not in rows:
            return None
        k = rows.index(unit)
        out[k] = out.get(k, Fraction(0)) + abs(missing)
    return out
