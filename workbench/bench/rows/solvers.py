"""Cases of the solvers: level-of-detail selection beside HiGHS, projection points beside Clarabel."""

from functools import partial
from itertools import pairwise

import jax
import numpy as np

from ....data.scene import GRID_M
from ....data.silence import silenced
from ....kernels import select as select_kernels
from ....kernels.launch import Device
from ....kernels.select import Selections, launch_select
from ....solvers.levels.choosers import branch_and_bound, literal_greedy
from ....solvers.projection_point import Problem, solve_points
from ....solvers.referees import cone_point
from ....solvers.result import Result
from ....verify.exact.projection_point import relative_gap
from ....verify.exact.select import best_by_milp, upper_bound
from ..suite import Case, Errors

LEVELS, FRAMES, SHARE = 5, 4, 0.3
Knapsacks = tuple[np.ndarray, np.ndarray, np.ndarray, int]
# The optimum is proved for one frame of so many objects at most; HiGHS takes seconds beyond.
PROVED_OBJECTS = 1_000
ROWS, PROVED_POINTS, CLARABEL_POINTS = 100, 10, 20


def knapsacks(objects: int, frames: int, share: float, seed: int) -> Knapsacks:
    """Levels whose cost rises by any amount and whose benefit by ever less, and a weight for each object."""
    random = np.random.default_rng(seed)
    costs = np.zeros((objects, LEVELS), np.int64)
    costs[:, 1:] = np.cumsum(random.integers(10, 2000, (objects, LEVELS - 1)), axis=1)
    benefits = np.zeros((frames, objects, LEVELS))
    steps = -np.sort(-random.random((frames, objects, LEVELS - 1)), axis=2)
    benefits[:, :, 1:] = np.cumsum(steps, axis=2) * random.random((frames, objects, 1)) ** 2
    starts = np.arange(objects + 1) * LEVELS
    return benefits.reshape(frames, -1), costs.ravel(), starts, int(costs[:, -1].sum() * share)


def select_cases(n: int, device: Device) -> list[Case]:
    """Levels of n objects in 4 frames; error is how far below the optimum one frame is, relative to it."""
    asked = knapsacks(n, FRAMES, SHARE, seed=n)
    few = knapsacks(min(n, PROVED_OBJECTS), 1, SHARE, seed=n)
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
        ),
        Case(
            kernel="select",
            scene=f"{FRAMES} frames (bound)",
            method="greedy",
            n=n,
            work=lambda: literal_greedy(*asked),
            judge=partial(judge_choice, asked),
            baseline="HiGHS",
            reference=lambda: quiet_highs(few),
            share=part,
            modules=[],
        ),
    ]


def judge_choice(asked: Knapsacks, choice: np.ndarray) -> Errors:
    """How far a choice may be below the optimum, by the kernel's bound, which holds for every selection."""
    benefits, costs, starts, budget = asked
    taken = starts[:-1] + choice
    if (costs[taken].sum(axis=1) > budget).any():
        raise AssertionError(f"select: expected at most {budget}, found {costs[taken].sum(axis=1).max()}")
    values = np.take_along_axis(benefits, taken, axis=1).sum(axis=1)
    return Errors(gap=float((1.0 - values / launch_select(*asked).bound).max()))


def quiet_highs(asked: Knapsacks) -> np.ndarray:
    """One frame by HiGHS."""
    with silenced():
        return branch_and_bound(*asked)


def judge_selection(asked: Knapsacks, found: Selections) -> Errors:
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


def programmes(count: int, rows: int, seed: int) -> list[Problem]:
    """Cone programmes of one size: cells of 2 to 8 m, four supporting planes per occluder, 0.6 to 20 cells away."""
    random, out = np.random.default_rng(seed), []
    for _ in range(count):
        occluders = (rows - 6) // 5
        scale, centre = float(random.uniform(2000, 8000)), random.uniform(-1e5, 1e5, 3)
        towards = random.normal(size=3)
        normals = towards / np.linalg.norm(towards) + 0.5 * random.normal(size=(occluders, 3))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        distance = scale * random.uniform(0.6, 20, occluders)
        far = normals @ centre + distance
        edges = np.repeat(normals, 4, axis=0) * random.uniform(0.1, 1, (4 * occluders, 1))
        edges += random.normal(size=edges.shape)
        edges /= np.linalg.norm(edges, axis=1, keepdims=True)
        slack = scale * random.uniform(0.1, 0.9, len(edges))
        box = np.concatenate([centre, -centre]) - 2 * scale
        out.append(
            Problem(
                True,
                normals,
                far - distance * random.uniform(1, 6, occluders),
                np.ones(occluders),
                far,
                np.concatenate([edges, np.eye(3), -np.eye(3), -normals]),
                np.concatenate([edges @ centre - slack, box, 1.0 - far]),
                centre,
                scale,
            )
        )
    return out


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
