"""Stabbing: the kernel against a linear programme (HiGHS) on the same decisions, with the exact twin as the judge.

Run `python -m viewcell.workbench.bench.stab`; it needs highspy, which only developers install.
"""

import statistics
import time
from collections.abc import Callable

import numpy as np
import warp as wp
from scipy.optimize import linprog

from ...data.verdict import Verdict
from ...kernels import stab_batch
from ...kernels.stab_batch import launch_stab
from ...verify.exact.stab import stab
from .timing import commit

SIZES = (3, 5, 8, 16)
LISTS = 100_000
LP_LISTS = 100
# How far beside its line a portal may begin [grid steps], so that about half of the lists are stabbed.
MISSES = {3: 1500, 5: 450, 8: 200, 16: 1}
REPEATS = 7


def sequences(count: int, size: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Portals beside points of oblique lines in octant +++: boxes (count, size, 2, 3) and signs (count, 3)."""
    rng = np.random.default_rng(seed)
    speed = rng.integers(200, 2000, (count, 1, 3))
    steps = np.cumsum(rng.integers(1, 8, (count, size)), axis=1)
    touch = steps[:, :, None] * speed
    low = touch - rng.integers(-MISSES[size], 1000, (count, size, 3))
    high = low + rng.integers(500, 2500, (count, size, 3))
    axis = rng.integers(0, 3, (count, size))[:, :, None] == np.arange(3)
    low, high = np.where(axis, touch, low), np.where(axis, touch, high)
    return np.stack([low, high], axis=2).astype(np.int32), np.ones((count, 3), np.int32)


def programme(boxes: np.ndarray) -> tuple[np.ndarray, list[tuple[float, float]]]:
    """Rows A x <= 0 and bounds: w_i lo_i - xi_i + t <= w_j hi_j - xi_j for all boxes and i != j, w >= 1, t <= 1."""
    rows = np.zeros((6 * len(boxes), 7))
    at = 0
    for low, high in boxes.astype(float):
        for i in range(3):
            for j in range(3):
                if i != j:
                    rows[at, [i, j, 3 + i, 3 + j, 6]] = low[i], -high[j], -1.0, 1.0, 1.0
                    at += 1
    return rows, [(1.0, np.inf)] * 3 + [(-np.inf, np.inf)] * 2 + [(0.0, 0.0), (-np.inf, 1.0)]


def margin_by_highs(boxes: np.ndarray) -> float:
    """Largest t, by HiGHS through its own interface."""
    import highspy

    rows, bounds = programme(boxes)
    solver = highspy.Highs()
    solver.setOptionValue("output_flag", False)
    solver.setOptionValue("threads", 1)
    for low, high in bounds:
        solver.addVar(low, high)
    solver.changeColCost(6, 1.0)
    solver.changeObjectiveSense(highspy.ObjSense.kMaximize)
    for row in rows:
        index = np.nonzero(row)[0].astype(np.int32)
        solver.addRow(-highspy.kHighsInf, 0.0, len(index), index, row[index])
    solver.run()
    return solver.getInfo().objective_function_value


def margin_by_scipy(boxes: np.ndarray) -> float:
    """Largest t, by HiGHS through SciPy."""
    rows, bounds = programme(boxes)
    cost = np.array([0.0] * 6 + [-1.0])
    return -linprog(cost, A_ub=rows, b_ub=np.zeros(len(rows)), bounds=bounds, method="highs").fun


def timed(work: Callable[[], object], count: int) -> tuple[list[float], object]:
    """Microseconds a decision of each repeat, ascending, and the last result."""
    spent, result = [], None
    for _ in range(REPEATS):
        start = time.perf_counter()
        result = work()
        spent.append((time.perf_counter() - start) / count * 1e6)
    return sorted(spent), result


def row(name: str, size: int, count: int, spent: list[float], ratio: str, found: np.ndarray, truth: np.ndarray) -> str:
    """One row of the table; `found` is 0 hidden, 1 stabbed, 2 undecided, of the first lists, and `truth` is bool."""
    judged = found[: len(truth)]
    wrong = ((judged == 0) & truth).sum(), ((judged == 1) & ~truth).sum(), 100 * (judged == 2).mean()
    cost = f"{statistics.median(spent):,.2f} ({spent[0]:,.2f}-{spent[-1]:,.2f})"
    head = f"| {size} | {100 * truth.mean():.0f} | {count:,} | {name} | {cost} | {ratio}"
    return f"{head} | {wrong[0]} | {wrong[1]} | {wrong[2]:.2f} | {commit()} |"


def main() -> None:
    """Print the table: one CPU thread, compile time excluded, wrong verdicts judged by the exact twin."""
    wp.config.log_level = wp.LOG_WARNING
    wp.load_module(stab_batch.__name__, device="cpu")
    print(
        "| boxes | stabbed % | lists | method, one thread | us a decision, median of 7 (range) | times the kernel's ",
        end="",
    )
    print("| wrong hidden | wrong stabbed | undecided % | commit |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for size in SIZES:
        boxes, signs = sequences(LISTS, size, seed=size)
        few = boxes[:LP_LISTS]
        truth = np.array([stab(one.astype(np.int64), (1, 1, 1)).verdict is Verdict.VISIBLE for one in few])
        fast, answers = timed(lambda boxes=boxes, signs=signs: launch_stab(boxes, signs), LISTS)
        median = statistics.median(fast)
        for name, solve in (("HiGHS", margin_by_highs), ("HiGHS through SciPy", margin_by_scipy)):
            slow, margins = timed(lambda few=few, solve=solve: np.array([solve(one) for one in few]), LP_LISTS)
            ratio = f"{statistics.median(slow) / median:,.0f}"
            print(row(name, size, LP_LISTS, slow, ratio, np.where(margins > 1e-7, 1, 0), truth), flush=True)
        print(row("kernel", size, LISTS, fast, "1", answers.verdict, truth), flush=True)


if __name__ == "__main__":
    main()
