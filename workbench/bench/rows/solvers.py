"""Cases of the solvers: level-of-detail selection beside HiGHS, projection points beside Clarabel."""

from functools import partial
from itertools import pairwise

import jax
import numpy as np

from ....kernels import select as select_kernels
from ....kernels.launch import Device
from ....kernels.select import Selections, launch_select
from ....solvers.projection_point import solve_points
from ....solvers.referees import cone_point
from ....solvers.result import Result
from ....verify.exact.projection_point import relative_gap
from ....verify.exact.select import best_by_milp, upper_bound
from ..projection_point import GRID_M, programmes
from ..select import LEVELS, Problem, highs, problem
from ..suite import Case, Errors, silenced

FRAMES, SHARE = 4, 0.3
# The optimum is proved for one frame of so many objects at most; HiGHS takes seconds beyond.
PROVED_OBJECTS = 1_000
ROWS, PROVED_POINTS, CLARABEL_POINTS = 100, 10, 20


def select_cases(n: int, device: Device) -> list[Case]:
    """Levels of n objects in 4 frames; error is how far below the optimum one frame is, relative to it."""
    asked = problem(n, FRAMES, SHARE, seed=n)
    few = problem(min(n, PROVED_OBJECTS), 1, SHARE, seed=n)
    part = (few[0].size / LEVELS) / (FRAMES * n)
    return [
        Case(
            kernel="select",
            scene=f"{FRAMES} frames ({'all' if n <= PROVED_OBJECTS else 'bound'})",
            method="kernel",
            n=n,
            work=lambda: launch_select(*asked, device=device),
            judge=partial(judge_selection, asked),
            baseline="HiGHS",
            reference=lambda: quiet_highs(few),
            share=part,
            modules=[select_kernels.__name__],
        )
    ]


def quiet_highs(asked: Problem) -> np.ndarray:
    """One frame by HiGHS."""
    with silenced():
        return highs(*asked)


def judge_selection(asked: Problem, found: Selections) -> Errors:
    """Certified gap of all frames, an exact check of the first frame's bound, and its distance from the optimum.

    Raises:
        AssertionError: the certified bound is below what exact arithmetic proves, or the budget is exceeded.
    """
    benefits, costs, starts, budget = asked
    if (found.cost > budget).any() or not found.feasible.all():
        raise AssertionError(f"select: expected at most {budget}, found {found.cost.max()}")
    error = None
    if len(starts) - 1 <= PROVED_OBJECTS:
        groups = list(pairwise(starts))
        levels = [benefits[0, a:b] for a, b in groups], [costs[a:b].tolist() for a, b in groups]
        with silenced():
            best = best_by_milp(*levels, budget)
        proved = upper_bound(*levels, budget, float(found.price[0]))
        if found.bound[0] < float(proved) * (1 - 1e-12):
            raise AssertionError(f"select: expected a bound of {float(proved)} at least, found {found.bound[0]}")
        error = max(0.0, 1.0 - float(found.value[0]) / float(best.value))
    return Errors(gap=float(found.gap.max()), error=error)


def projection_point_cases(n: int, device: Device) -> list[Case]:
    """Projection points of n programmes; the gap is proved in rationals, the error is the violation [m]."""
    # JAX takes a device of its own.
    del device
    problems = programmes(n, ROWS, seed=n)
    few = problems[:CLARABEL_POINTS]

    def judge(found: Result) -> Errors:
        gaps = [relative_gap(p, point) for p, point in zip(problems[:PROVED_POINTS], found.point, strict=False)]
        short = max(
            float((p.bounds - p.rows @ point).max(initial=0.0)) for p, point in zip(problems, found.point, strict=True)
        )
        return Errors(gap=max(gaps), error=short * GRID_M)

    return [
        Case(
            kernel="projection_point",
            scene=f"{ROWS} rows ({min(n, PROVED_POINTS)})",
            method="interior",
            n=n,
            work=lambda: solve_points(problems),
            judge=judge,
            baseline="Clarabel",
            reference=lambda: [cone_point(one) for one in few],
            share=len(few) / n,
            modules=[],
            device=jax.default_backend(),
        )
    ]
