"""Projection points: from where the shrunk occluders of a cluster hide most (Chhugani et al. 2005, section 5.2).

While v lies inside the supporting half-spaces m_e . v >= c_e of an occluder, its shrunk part is a fixed shape times the
height of v above the occluder's plane. So each occluder alone wants v as far from its plane as the half-spaces allow: b
= min n . x subject to m_e . x >= c_e, a linear programme in three variables. Of many occluders the sum of the shrunk
volumes has many maxima; the paper's substitute is convex:

    min  sum_j w_j (n_j . v - b_j)**2                                                                             (socp)
    under  m_je . v >= c_je,  |v - centre| <= reach on each axis,  n_j . v <= d_j in front of the occluder's plane,

with w_j = 1, a second-order cone programme in the form min t, || diag(sqrt w) (N v - b) || <= t. The volumes,
linearised in the heights, give the linear programme

    max  sum_j a_j depth (2 height(b_j) + depth) height_j(v)   under the same rows,                                (lp)

a_j being the area of occluder j shrunk from a point of height 1. The cell's inside satisfies all rows. They matter for
the optimum, not for safety: `launch_shrink` accepts any point in front of the occluders' planes, and that is tested
again, exactly, before a point is handed out.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from itertools import combinations

import numpy as np

from ..data.errors import InputError
from ..data.extras import need
from ..kernels.shrink import LEAST_HEIGHT, launch_shrink
from ..kernels.umbra import USABLE, Umbras
from .result import Result, Status

__all__ = ["Problem", "cluster_problems", "in_front", "lowest_points", "solve_points"]

# Limits of the interior point method, in units of the cell's diagonal and of the largest coefficient.
ITERATIONS = 60
TOLERANCE = 1e-10
# Keeps Newton's matrix regular where the normals leave a direction free; it slows steps down, the optimum stays.
PROXIMAL = 1e-9
# What still counts as solved.
ACCURACY = 1e-8
# Problems are solved so many at a time, with rows padded to a power of four, because each shape is compiled.
BATCH = 64
# Rows at work at once, rows added a round, and rounds before all rows are used.
WORKING = 64
ADDED = 8
ROUNDS = 6
# A height that no occluder asks for in earnest, in cell diagonals: one hardly larger than the cell asks for any.
MOST_HEIGHT = 1e3
# Triples of planes are judged with this tolerance on their weights: parallel edges give weights of exactly zero.
WEIGHT = -1e-12
# The float64 error of normal . v for coordinates below 2**24.
DOT_ERROR = 2.0**-24


@dataclass(frozen=True)
class Problem:
    """One cluster: minimise sum w (n . v - b)**2, or sum w n . v, over half-spaces; grid steps.

    Attributes:
        quadratic: which of the two.
        normals: n of the occluders used, away from the cell, shape (j, 3).
        targets: b, shape (j,).
        weights: w, shape (j,).
        far: see `Umbras`; shape (j,).
        rows: unit normals of the half-spaces rows . v >= bounds, shape (r, 3).
        bounds: shape (r,).
        centre: of the cell; inside all rows.
        scale: length of the cell's diagonal.
    """

    quadratic: bool
    normals: np.ndarray
    targets: np.ndarray
    weights: np.ndarray
    far: np.ndarray
    rows: np.ndarray
    bounds: np.ndarray
    centre: np.ndarray
    scale: float

    def objective(self, point: np.ndarray) -> float:
        """What is minimised, at a point."""
        heights = self.normals @ point
        return float((self.weights * ((heights - self.targets) ** 2 if self.quadratic else heights)).sum())

    def scaled(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Hessian, gradient at the centre and bounds, in cell diagonals from the centre, the largest coefficient 1."""
        hessian, gradient = np.zeros((3, 3)), self.weights @ self.normals
        if self.quadratic:
            hessian = 2 * self.scale * (self.normals * self.weights[:, None]).T @ self.normals
            gradient = 2 * (self.weights * (self.normals @ self.centre - self.targets)) @ self.normals
        largest = max(np.abs(hessian).max(), np.abs(gradient).max(), 1e-300)
        bounds = (self.bounds - self.rows @ self.centre) / self.scale
        return hessian / largest, gradient / largest, bounds


def lowest_points(umbras: Umbras) -> np.ndarray:
    """Least n . x within the supporting half-spaces of each umbra, -inf where there is none, shape (k,).

    By duality it is the largest c . w over basic weights w >= 0 with sum w_e m_e = n, at most three of them above zero;
    there are none where the umbra is bounded, to which no projection point gives a shadow without limit. Not rounded to
    a side: it only steers the optimum.
    """
    lowest = np.full(len(umbras.status), -np.inf)
    sizes = np.diff(umbras.starts)
    for size in np.unique(sizes[umbras.status == USABLE]):
        chosen = np.flatnonzero((sizes == size) & (umbras.status == USABLE))
        planes = umbras.planes[umbras.starts[chosen][:, None] + np.arange(size)]
        normal = umbras.normal[chosen]
        for triple in combinations(range(size), 3):
            m, c = planes[:, triple, :3], planes[:, triple, 3]
            volume = np.linalg.det(m)
            firm = np.abs(volume) > 1e-9
            weight = np.linalg.solve(np.where(firm[:, None, None], m, np.eye(3)).transpose(0, 2, 1), normal[:, :, None])
            allowed = firm & (weight[:, :, 0] >= WEIGHT).all(axis=1)
            value = np.where(allowed, (weight[:, :, 0] * c).sum(axis=1), -np.inf)
            lowest[chosen] = np.maximum(lowest[chosen], value)
    return lowest


def unit_areas(umbras: Umbras, points: np.ndarray) -> np.ndarray:
    """Area of each occluder shrunk from a point of height 1, shape (k,); `points` must lie in the cells, (k, 3)."""
    polygons = launch_shrink(umbras, np.arange(len(umbras.status)), points)
    ends = np.roll(polygons.corners, -1, axis=0)
    full = np.flatnonzero(np.diff(polygons.starts))
    ends[polygons.starts[full + 1] - 1] = polygons.corners[polygons.starts[full]]
    which = np.repeat(np.arange(len(umbras.status)), np.diff(polygons.starts))
    spread = np.cross(polygons.corners - umbras.centre[which], ends - umbras.centre[which])
    area = np.bincount(which, (spread * umbras.normal[which]).sum(axis=1), minlength=len(umbras.status)) / 2
    height = umbras.far - (umbras.normal * points).sum(axis=1)
    return np.where(height > 0, area / np.where(height > 0, height, 1) ** 2, 0.0)


def cluster_problems(
    umbras: Umbras,
    cells: np.ndarray,
    cell_of: np.ndarray,
    cluster_of: np.ndarray,
    clusters: int,
    *,
    objective: str = "socp",
    depth: float | None = None,
    reach: float = 2.0,
) -> list[Problem]:
    """The programme of each (cell, cluster), cells first: problem cell * clusters + cluster.

    Args:
        umbras: of cells and occluders. Left out are those not USABLE and those with a bounded umbra, which no
            projection point gives a shadow without limit.
        cells: boxes [grid steps], shape (m, 2, 3).
        cell_of: cell of each umbra, shape (k,), int.
        cluster_of: cluster of each umbra, shape (k,), int.
        clusters: clusters a cell.
        objective: "socp" or "lp".
        depth: how far beyond the occluders hidden things are looked for [grid steps]; needed for "lp".
        reach: how far from the cell's centre v may be on each axis, in cell diagonals.

    Raises:
        InputError: an objective of another name, or no positive depth for "lp".
    """
    if objective not in ("socp", "lp"):
        raise InputError(f"objective: expected socp or lp, found {objective!r}")
    if objective == "lp" and not (depth is not None and 0 < depth < np.inf):
        raise InputError(f"depth: expected a positive length for the linear programme, found {depth!r}")
    cells = np.asarray(cells, np.float64).reshape(-1, 2, 3)
    centre, scale = cells.mean(axis=1), np.linalg.norm(cells[:, 1] - cells[:, 0], axis=1)
    lowest = lowest_points(umbras)
    heights = np.minimum(umbras.far - lowest, MOST_HEIGHT * scale[cell_of])
    used = np.isfinite(lowest) & (umbras.status == USABLE)
    weight = np.ones(len(lowest))
    if objective == "lp":
        weight = unit_areas(umbras, centre[cell_of]) * depth * (2 * heights + depth)
    group = np.where(used, np.asarray(cell_of) * clusters + cluster_of, -1)
    order = np.argsort(group, kind="stable")
    ends = np.searchsorted(group[order], np.arange(len(cells) * clusters + 1))
    problems = []
    for number in range(len(cells) * clusters):
        members, cell = order[ends[number] : ends[number + 1]], number // clusters
        edges = np.concatenate([np.arange(umbras.starts[j], umbras.starts[j + 1]) for j in members] or [[]]).astype(int)
        box = np.concatenate([centre[cell], -centre[cell]]) - reach * scale[cell]
        # In front by a step, or by what the centre of a thin cell allows.
        height = umbras.far[members] - umbras.normal[members] @ centre[cell]
        front = np.minimum(1.0, height / 2) - umbras.far[members]
        problems.append(
            Problem(
                objective == "socp",
                umbras.normal[members],
                umbras.far[members] - heights[members],
                weight[members],
                umbras.far[members],
                np.concatenate([umbras.planes[edges, :3], np.eye(3), -np.eye(3), -umbras.normal[members]]),
                np.concatenate([umbras.planes[edges, 3], box, front]),
                centre[cell],
                float(scale[cell]),
            )
        )
    return problems


def solve_points(problems: list[Problem]) -> Result:
    """Projection points of clusters, all at once, by an interior point method (JAX, float64).

    Every point is in front of all occluders of its cluster, exactly; where the optimum is not, the cell's centre is
    given instead, and so it is where nothing is to be solved. Rows that the optimum violates by the method's tolerance
    are kept by a step towards the centre; `primal` says what the rounding of that step leaves. Where optima fill a line
    or a face, as with parallel occluders, the point is in the middle of them, as far as the barrier of the rows goes.
    """
    begin = time.perf_counter()
    count = len(problems)
    result = Result(
        np.array([p.centre for p in problems]).reshape(-1, 3),
        np.full(count, np.nan),
        np.full(count, Status.EMPTY, np.int32),
        np.zeros(count, np.int32),
        *(np.zeros(count) for _ in range(3)),
        0.0,
    )
    full = [i for i, p in enumerate(problems) if len(p.normals)]
    # Of thousands of rows a few bind: those nearest to the centre first, then those that the point found violates.
    working = {i: _nearest_rows(problems[i]) for i in full}
    todo = full
    for _ in range(ROUNDS):
        _solve_all(problems, working, todo, result)
        todo = [i for i in todo if _add_violated(problems[i], working, i, result.point[i])]
        if not todo:
            break
    if todo:
        _solve_all(problems, {i: np.arange(len(problems[i].rows)) for i in todo}, todo, result)
    for i in full:
        if result.status[i] == Status.INFEASIBLE:
            result.point[i] = problems[i].centre
            continue
        _pull_inside(problems[i], i, result)
        if not in_front(problems[i], result.point[i]):
            result.point[i], result.status[i] = problems[i].centre, Status.REJECTED
    return Result(**{**vars(result), "seconds": time.perf_counter() - begin})


def in_front(problem: Problem, point: np.ndarray) -> bool:
    """Whether a point lies in front of the plane of every occluder of the cluster, by 1/64 grid step; exact."""
    if not np.isfinite(point).all() or np.abs(point).max() >= 2.0**24:
        return False
    least = float(LEAST_HEIGHT)
    height = problem.far - problem.normals @ point
    for j in np.flatnonzero(height < least + 4 * DOT_ERROR):
        exact = sum(Fraction(float(n)) * Fraction(float(x)) for n, x in zip(problem.normals[j], point, strict=True))
        # The kernel that uses the point subtracts in float64.
        if Fraction(float(problem.far[j])) - exact < Fraction(least) + Fraction(DOT_ERROR):
            return False
    return True


def _padded(size: int) -> int:
    """The next power of four."""
    return 4 ** max(2, (int(size - 1).bit_length() + 1) // 2)


def _nearest_rows(problem: Problem) -> np.ndarray:
    """The rows that come nearest to the centre, ascending."""
    if len(problem.rows) <= WORKING:
        return np.arange(len(problem.rows))
    slack = problem.rows @ problem.centre - problem.bounds
    return np.sort(np.argpartition(slack, WORKING // 2)[: WORKING // 2])


def _pull_inside(problem: Problem, number: int, result: Result) -> None:
    """Move a point towards the centre, which is inside, until no row is violated by more than rounding."""
    point, inside = result.point[number], problem.rows @ problem.centre - problem.bounds
    slack = problem.rows @ point - problem.bounds
    short = (slack < 0) & (inside > 0)
    if short.any():
        share = (inside[short] / (inside[short] - slack[short])).min() * (1 - 2.0**-50)
        result.point[number] = problem.centre + share * (point - problem.centre)
        result.objective[number] = problem.objective(result.point[number])
        slack = problem.rows @ result.point[number] - problem.bounds
    result.primal[number] = max(0.0, -float(slack.min())) / problem.scale


def _add_violated(problem: Problem, working: dict[int, np.ndarray], number: int, point: np.ndarray) -> bool:
    """Add the rows that the point violates most to those at work; false if it violates none."""
    short = problem.bounds - problem.rows @ point
    short[working[number]] = -np.inf
    worst = np.argsort(-short, kind="stable")[:ADDED]
    worst = worst[short[worst] > TOLERANCE * problem.scale]
    working[number] = np.union1d(working[number], worst)
    return len(worst) > 0


def _solve_all(problems: list[Problem], working: dict[int, np.ndarray], chosen: list[int], result: Result) -> None:
    """Solve the chosen problems with the rows at work, in batches of one padded size."""
    sizes = np.array([_padded(len(working[i])) for i in chosen], int)
    for size in np.unique(sizes):
        members = np.array(chosen)[sizes == size]
        for first in range(0, len(members), BATCH):
            part = members[first : first + BATCH]
            cut = [
                replace(problems[i], rows=problems[i].rows[working[i]], bounds=problems[i].bounds[working[i]])
                for i in part
            ]
            _solve_batch(cut, int(size), part, result)


def _solve_batch(problems: list[Problem], size: int, rows: np.ndarray, result: Result) -> None:
    """Solve at most BATCH problems of one padded size and write their answers into `rows` of the result."""
    batch = [*problems, *[problems[0]] * (BATCH - len(problems))]
    parts = [p.scaled() for p in batch]
    hessian, gradient = (np.array([part[k] for part in parts]) for k in (0, 1))
    # The rows that fill up say 0 >= -1.
    a, c = np.zeros((len(batch), size, 3)), np.full((len(batch), size), -1.0)
    for i, p in enumerate(batch):
        a[i, : len(p.rows)] = p.rows
        c[i, : len(p.rows)] = parts[i][2]
    need("jax")
    import jax

    with jax.enable_x64(True):
        answers = [np.asarray(x)[: len(problems)] for x in _interior_point()(hessian, gradient, a, c)]
    v, iterations, primal, dual, gap = answers
    converged = np.maximum(np.maximum(primal, dual), gap) <= ACCURACY
    for i, p in enumerate(problems):
        point = p.centre + p.scale * v[i]
        result.point[rows[i]] = point
        result.objective[rows[i]] = p.objective(point)
    result.status[rows] = np.where(converged, Status.SOLVED, np.where(primal > 1e-6, Status.INFEASIBLE, Status.LIMIT))
    result.iterations[rows] = iterations
    result.primal[rows], result.dual[rows], result.gap[rows] = primal, dual, gap


@cache
def _interior_point() -> Callable:
    """Mehrotra's predictor-corrector method for min v H v / 2 + q v, A v >= c, on a batch; compiled on first use."""
    need("jax")
    import jax
    import jax.numpy as jnp

    def longest(x: jax.Array, dx: jax.Array) -> jax.Array:
        """The step that keeps x + step dx positive."""
        return jnp.min(jnp.where(dx < 0, -x / jnp.where(dx < 0, dx, -1.0), jnp.inf))

    def solve(hessian: jax.Array, linear: jax.Array, a: jax.Array, c: jax.Array) -> tuple:
        def residuals(v: jax.Array, s: jax.Array, w: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
            """Gradient of the Lagrangian, violation of the rows, mean complementarity."""
            return hessian @ v + linear - a.T @ w, a @ v - c - s, (s * w).mean()

        def error(v: jax.Array, s: jax.Array, w: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
            dual, primal, mu = residuals(v, s, w)
            value = jnp.abs(v @ hessian @ v / 2 + linear @ v)
            return jnp.abs(primal).max(), jnp.abs(dual).max(), len(c) * mu / (1 + value)

        def step(state: tuple) -> tuple:
            v, s, w, iteration = state
            dual, primal, mu = residuals(v, s, w)
            ratio = w / s
            matrix = hessian + (a.T * ratio) @ a + PROXIMAL * jnp.eye(3)

            def direction(target: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
                """Newton step to complementarity s w = target."""
                dv = jnp.linalg.solve(matrix, -dual + a.T @ (target / s - w - ratio * primal))
                ds = a @ dv + primal
                return dv, ds, target / s - w - ratio * ds

            _, ds, dw = direction(jnp.zeros_like(s))
            ahead = jnp.minimum(1.0, jnp.minimum(longest(s, ds), longest(w, dw)))
            after = ((s + ahead * ds) * (w + ahead * dw)).mean()
            dv, ds, dw = direction((after / mu) ** 3 * mu - ds * dw)
            # Equal steps in both: with a quadratic objective others would not reduce the gradient.
            ahead = jnp.minimum(1.0, 0.995 * jnp.minimum(longest(s, ds), longest(w, dw)))
            moved = (v + ahead * dv, s + ahead * ds, w + ahead * dw)
            good = jnp.isfinite(moved[0]).all() & jnp.isfinite(moved[1]).all() & jnp.isfinite(moved[2]).all()
            kept = tuple(jnp.where(good, new, old) for new, old in zip(moved, (v, s, w), strict=True))
            return (*kept, jnp.where(good, iteration + 1, ITERATIONS))

        def unfinished(state: tuple) -> jax.Array:
            return (state[3] < ITERATIONS) & (jnp.array(error(*state[:3])).max() > TOLERANCE)

        start = (jnp.zeros(3), jnp.maximum(-c, 1e-2), jnp.ones_like(c) / len(c), 0)
        v, s, w, iteration = jax.lax.while_loop(unfinished, step, start)
        return (v, iteration, *error(v, s, w))

    # Beyond level 1 compiling takes as long again and gains nothing; level 0 saves half a second and costs 100 us a
    # problem.
    return jax.jit(jax.vmap(solve), compiler_options={"xla_backend_optimization_level": 1})
