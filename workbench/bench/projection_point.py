"""Projection points: time, proved gap and violation of each solver on the same programmes.

Run `python -m viewcell.workbench.bench.projection_point [--rows N] [--batch N]`.
"""

import argparse
import sys
import time
from collections.abc import Callable

import numpy as np

from ...solvers.projection_point import Problem, solve_points
from ...solvers.referees import cone_point, gradient_point
from ...solvers.result import Result, Status
from ...verify.exact.projection_point import relative_gap
from .timing import commit, median_range, print_head, print_row

RUNS = 7
# Of the solvers that take one programme at a time; and programmes whose gap is proved in rationals.
SINGLE, PROVED = 100, 20
GRID_M = 2.0**-10
HEAD = (
    "solver",
    "us a programme, median (range)",
    "ratio",
    "solved",
    "proved gap, most",
    "violation m, most",
    "commit",
)


def programmes(count: int, rows: int, seed: int) -> list[Problem]:
    """Cone programmes of one size: cells of 2 to 8 m, four supporting planes an occluder, 0.6 to 20 cells away."""
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


def main(arguments: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=int, default=200, help="constraints a programme")
    parser.add_argument("--batch", type=int, default=1000, help="programmes")
    options = parser.parse_args(arguments)
    problems = programmes(options.batch, options.rows, 0)
    few = problems[:SINGLE]
    ways: dict[str, tuple[list[Problem], Callable[[list[Problem]], list[Result]]]] = {
        "interior point, JAX float64, batched": (problems, lambda all_: [solve_points(all_)]),
        "Clarabel": (few, lambda all_: [cone_point(p) for p in all_]),
        "NLopt SLSQP": (few, lambda all_: [gradient_point(p) for p in all_]),
    }
    print(f"{options.batch:,} programmes of {len(problems[0].rows)} constraints; JAX uses the threads it wants\n")
    print_head(HEAD)
    times: dict[str, list[float]] = {name: [] for name in ways}
    answers = {name: solve(given) for name, (given, solve) in ways.items()}
    for _ in range(RUNS):
        for name, (given, solve) in ways.items():
            begin = time.perf_counter()
            solve(given)
            times[name].append(1e6 * (time.perf_counter() - begin) / len(given))
    base = np.median(times["Clarabel"])
    for name, (given, _) in ways.items():
        points = np.concatenate([r.point for r in answers[name]])
        status = np.concatenate([r.status for r in answers[name]])
        gap = max(relative_gap(p, point) for p, point in zip(given[:PROVED], points, strict=False))
        short = max(float((p.bounds - p.rows @ v).max(initial=0.0)) for p, v in zip(given, points, strict=True))
        solved = f"{(status == Status.SOLVED).sum():,} of {len(given):,}"
        ratio = f"{base / np.median(times[name]):.1f}"
        row = [name, median_range(times[name]), ratio, solved, f"{gap:.1e}", f"{short * GRID_M:.1e}", commit()]
        print_row(row)
    return 0


if __name__ == "__main__":
    sys.exit(main())
