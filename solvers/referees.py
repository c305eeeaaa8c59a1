"""Other ways to find projection points: independent solvers of the same programmes, and search for what is culled.

Slow and one problem at a time; they judge `projection_point.solve_points` and the programmes themselves.
"""

import time
from collections.abc import Callable

import numpy as np

from ..data.extras import need
from .projection_point import Problem, in_front
from .result import Result, Status

# Rows that an answer violates by more [cell diagonals] cannot all be satisfied, or the solver failed.
INFEASIBLE = 1e-6


def cone_point(problem: Problem) -> Result:
    """The quadratic programme as a second-order cone programme, by Clarabel (interior point, conic).

    min t under || diag(sqrt w) (N v - b) || <= t and the rows; the objective is t**2.

    Args:
        problem: a quadratic one, with at least one occluder.
    """
    need("clarabel")
    import clarabel
    from scipy import sparse

    begin = time.perf_counter()
    root = np.sqrt(problem.weights)[:, None]
    target = (problem.targets - problem.normals @ problem.centre) / problem.scale
    length = max(float(np.linalg.norm(root[:, 0] * target)), 1.0)
    # Variables: the step from the centre in cell diagonals, and t. Slack = bound - matrix . variables is in the cone.
    cone = np.vstack([[0, 0, 0, -1], np.hstack([-root * problem.normals, np.zeros_like(root)])])
    cone_bound = np.concatenate([[0.0], -root[:, 0] * target]) / length
    cone[1:] /= length
    rows = np.hstack([-problem.rows, np.zeros((len(problem.rows), 1))])
    bounds = (problem.rows @ problem.centre - problem.bounds) / problem.scale
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    solution = clarabel.DefaultSolver(
        sparse.csc_matrix((4, 4)),
        np.array([0.0, 0, 0, 1]),
        sparse.csc_matrix(np.vstack([rows, cone])),
        np.concatenate([bounds, cone_bound]),
        [clarabel.NonnegativeConeT(len(rows)), clarabel.SecondOrderConeT(len(cone))],
        settings,
    ).solve()
    point = problem.centre + problem.scale * np.array(solution.x[:3])
    solved = solution.status == clarabel.SolverStatus.Solved
    gap = abs(solution.obj_val - solution.obj_val_dual) / (1 + abs(solution.obj_val))
    residuals = (solution.r_prim, solution.r_dual, gap)
    return _single(problem, point, solved, solution.iterations, residuals, begin)


def gradient_point(problem: Problem, *, tolerance: float = 1e-12) -> Result:
    """Either programme by sequential quadratic programming with gradients (NLopt, SLSQP), from the centre.

    Infeasible problems are told by the rows that the answer violates: the library itself may report success.

    Args:
        problem: with at least one occluder.
        tolerance: on the step, relative, at which it stops.
    """
    need("nlopt")
    import nlopt

    begin = time.perf_counter()
    hessian, gradient, bounds = problem.scaled()
    search = nlopt.opt(nlopt.LD_SLSQP, 3)
    last = np.zeros(3)

    def value(step: np.ndarray, slope: np.ndarray) -> float:
        last[:] = step
        if slope.size:
            slope[:] = hessian @ step + gradient
        return float(step @ (hessian @ step) / 2 + gradient @ step)

    def short(out: np.ndarray, step: np.ndarray, slope: np.ndarray) -> None:
        if slope.size:
            slope[:] = -problem.rows
        out[:] = bounds - problem.rows @ step

    search.set_min_objective(value)
    search.add_inequality_mconstraint(short, np.zeros(len(bounds)))
    search.set_xtol_rel(tolerance)
    search.set_maxeval(500)
    try:
        step, stopped = search.optimize(np.zeros(3)), search.last_optimize_result()
    except nlopt.RoundoffLimited:
        # No step reduces the objective any more: it ends where it stands.
        step, stopped = last, nlopt.XTOL_REACHED
    except RuntimeError:
        step, stopped = np.zeros(3), nlopt.FAILURE
    violation = float(np.maximum(bounds - problem.rows @ step, 0).max())
    point = problem.centre + problem.scale * step
    return _single(
        problem,
        point,
        stopped > 0 and stopped != nlopt.MAXEVAL_REACHED,
        search.get_numevals(),
        (violation, 0.0, 0.0),
        begin,
    )


def feasible_point(problem: Problem, *, seed: int = 0) -> Result:
    """A random point that no row forbids: on a chord through the centre, which is inside."""
    begin = time.perf_counter()
    _, _, bounds = problem.scaled()
    random = np.random.default_rng(seed)
    direction = random.normal(size=3)
    slope, slack = problem.rows @ direction, -bounds
    ends = np.where(slope < 0, slack / np.where(slope < 0, -slope, 1.0), np.inf)
    reach = max(0.0, float(ends.min()))
    point = problem.centre + problem.scale * random.random() * reach * direction
    return _single(problem, point, bool((slack >= 0).all()), 1, (0.0, 0.0, 0.0), begin)


def vertex_point(problem: Problem) -> Result:
    """The linear programme, by the simplex method of HiGHS: the referee of `solve_points` in tests.

    Args:
        problem: a linear one, with at least one occluder.
    """
    from scipy.optimize import linprog

    begin = time.perf_counter()
    _, gradient, bounds = problem.scaled()
    answer = linprog(gradient, A_ub=-problem.rows, b_ub=-bounds, bounds=(None, None), method="highs-ds")
    point = problem.centre + problem.scale * (answer.x if answer.x is not None else np.zeros(3))
    violation = float(np.maximum(bounds - problem.rows @ (point - problem.centre) / problem.scale, 0).max())
    return _single(problem, point, answer.status == 0, answer.nit, (violation, 0.0, 0.0), begin)


def searched_point(
    problem: Problem,
    score: Callable[[np.ndarray], float],
    *,
    reach: float = 1.0,
    starts: int = 8,
    evaluations: int = 100,
    seed: int = 0,
) -> Result:
    """A point of high score, by derivative-free search (NLopt, COBYLA) from several starts.

    The upper reference: with `score` the number of triangles culled from a point, it tells what the convex programmes
    leave on the table. A local search of a step function: more starts find more.

    Args:
        problem: where the point may be, in front of all its occluders.
        score: to be maximised, of a point [grid steps].
        reach: how far from the cell's centre the point may be on each axis, in cell diagonals.
        starts: the centre, then random points.
        evaluations: of the score, for each start.
        seed: of the random points.
    """
    need("nlopt")
    import nlopt

    begin = time.perf_counter()
    rng = np.random.default_rng(seed)
    best, found, count = problem.centre, float(score(problem.centre)), 1
    worst = found

    def value(step: np.ndarray, _gradient: np.ndarray) -> float:
        nonlocal best, found, worst, count
        point = problem.centre + problem.scale * step
        if not in_front(problem, point):
            # The search may step outside its constraints.
            return worst
        count += 1
        gained = float(score(point))
        worst = min(worst, gained)
        if gained > found:
            best, found = point.copy(), gained
        return gained

    def behind(out: np.ndarray, step: np.ndarray, _gradient: np.ndarray) -> None:
        out[:] = (problem.normals @ (problem.centre + problem.scale * step) - problem.far) / problem.scale

    for start in range(starts):
        search = nlopt.opt(nlopt.LN_COBYLA, 3)
        search.set_lower_bounds(np.full(3, -reach))
        search.set_upper_bounds(np.full(3, reach))
        search.set_initial_step(reach / 4)
        search.set_maxeval(evaluations)
        search.set_xtol_abs(1e-4 * reach)
        search.set_max_objective(value)
        if len(problem.far):
            search.add_inequality_mconstraint(behind, np.full(len(problem.far), 1e-9))
        try:
            search.optimize(rng.uniform(-reach, reach, 3) if start else np.zeros(3))
        except nlopt.RoundoffLimited:
            # A flat score ends a search early; the best point seen is kept.
            continue
    return _result(best, found, Status.SOLVED, count, (0.0, 0.0, 0.0), begin)


def _single(
    problem: Problem, point: np.ndarray, solved: bool, iterations: int, residuals: tuple, begin: float
) -> Result:
    """Result of one problem, the point replaced by the centre where it may not be used."""
    objective = problem.objective(point)
    status = Status.SOLVED if solved else Status.LIMIT
    if (problem.bounds - problem.rows @ point).max(initial=0.0) > INFEASIBLE * problem.scale:
        point, status = problem.centre, Status.INFEASIBLE
    elif not in_front(problem, point):
        point, status = problem.centre, Status.REJECTED
    return _result(point, objective, status, iterations, residuals, begin)


def _result(
    point: np.ndarray, objective: float, status: Status, iterations: int, residuals: tuple, begin: float
) -> Result:
    return Result(
        point[None],
        np.array([objective]),
        np.array([status], np.int32),
        np.array([iterations], np.int32),
        *(np.array([float(r)]) for r in residuals),
        time.perf_counter() - begin,
    )
