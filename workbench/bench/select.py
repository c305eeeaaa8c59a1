"""Level-of-detail selection: time and certified gap, beside branch and bound and greedy selection.

Run `python -m viewcell.workbench.bench.select`.
"""

import time
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import warp as wp
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csr_array

from ...kernels import select
from ...kernels.select import launch_select
from ...solvers.levels.greedy import incremental_greedy, literal_greedy
from .timing import commit, median_range, print_head, print_row, quiet

LEVELS = 5
# Objects, and frames that are timed one by one.
SIZES = ((1_000, 7), (100_000, 7))
# Of the most that all objects can cost.
BUDGETS = (0.1, 0.3, 0.6)
HIGHS_OBJECTS = 1_000

Problem = tuple[np.ndarray, np.ndarray, np.ndarray, int]
HEAD = (
    "objects",
    "budget %",
    "frames",
    "method, one thread",
    "ms a frame, median (range)",
    "1 - value / bound, most",
    "over budget",
    "commit",
)


def problem(objects: int, frames: int, share: float, seed: int) -> Problem:
    """Levels whose cost rises by any amount and whose benefit by ever less, and a weight for each object."""
    random = np.random.default_rng(seed)
    costs = np.zeros((objects, LEVELS), np.int64)
    costs[:, 1:] = np.cumsum(random.integers(10, 2000, (objects, LEVELS - 1)), axis=1)
    benefits = np.zeros((frames, objects, LEVELS))
    steps = -np.sort(-random.random((frames, objects, LEVELS - 1)), axis=2)
    benefits[:, :, 1:] = np.cumsum(steps, axis=2) * random.random((frames, objects, 1)) ** 2
    starts = np.arange(objects + 1) * LEVELS
    return benefits.reshape(frames, -1), costs.ravel(), starts, int(costs[:, -1].sum() * share)


def highs(benefits: np.ndarray, costs: np.ndarray, starts: np.ndarray, budget: int) -> np.ndarray:
    """Choice of HiGHS at its default gap (1e-4), as the greedy selections give theirs; one frame."""
    count = len(costs)
    owners = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    one = csr_array((np.ones(count), (owners, np.arange(count))))
    within = LinearConstraint(costs[None].astype(float), -np.inf, budget)
    answer = milp(
        -benefits[0],
        integrality=np.ones(count),
        bounds=Bounds(0, 1),
        constraints=[LinearConstraint(one, 1, 1), within],
    )
    return np.array([[int(np.argmax(answer.x[a:b])) for a, b in pairwise(starts)]])


def ours(improve: bool) -> Callable[..., np.ndarray]:
    """The kernel's choice."""
    return lambda *asked: launch_select(*asked, improve=improve).choice


METHODS: dict[str, Callable[..., np.ndarray]] = {
    "kernel": ours(improve=True),
    "kernel, not improved": ours(improve=False),
    "HiGHS, default gap": highs,
    "greedy by benefit / cost": literal_greedy,
    "incremental greedy, from nothing": incremental_greedy,
}


def row(name: str, asked: Problem, share: float) -> None:
    """Time a method frame by frame; its gap is to the bound of the kernel, which holds for every selection."""
    benefits, costs, starts, budget = asked
    found = launch_select(*asked)
    spent, values, over = [], [], 0
    for frame in benefits:
        start = time.perf_counter()
        choice = METHODS[name](frame[None], costs, starts, budget)[0]
        spent.append((time.perf_counter() - start) * 1e3)
        values.append(frame[starts[:-1] + choice].sum())
        over += int(costs[starts[:-1] + choice].sum() > budget)
    gap = f"{(1 - np.array(values) / found.bound).max():.1e}"
    print_row((len(starts) - 1, f"{100 * share:.0f}", len(benefits), name, median_range(spent), gap, over, commit()))


def main() -> None:
    """Print the table; compile time excluded."""
    quiet()
    wp.load_module(select.__name__, device="cpu")
    print_head(HEAD)
    for objects, frames in SIZES:
        for share in BUDGETS:
            asked = problem(objects, frames, share, seed=objects)
            for name in METHODS:
                if name != "HiGHS, default gap" or objects <= HIGHS_OBJECTS:
                    row(name, asked, share)


if __name__ == "__main__":
    main()
