"""Exact bounds of projection points: against every feasible point, the exact optimum, and independent solvers."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from builders import projection_problems
from viewcell.data.errors import InputError
from viewcell.solvers.projection_point import Problem, solve_points
from viewcell.solvers.referees import cone_point, vertex_point
from viewcell.verify.exact.projection_point import lower_bound, optimality


def problems_of(seed, objective, count):
    problems = projection_problems.random_problems(seed, 12, 30, 10, objective=objective, depth=20_000.0)
    return [p for p in problems if len(p.normals)][:count]


def measure(problem):
    """What a relative gap is relative to: the optimum is 0 where an apex can be reached."""
    size = problem.weights.sum() * problem.scale**2 if problem.quadratic else 0.0
    return max(1e-3 * (abs(problem.objective(problem.centre)) + size), 1e-300)


def exact_objective(problem, point):
    at, value = [Fraction(float(c)) for c in point], Fraction(0)
    for n, b, w in zip(problem.normals, problem.targets, problem.weights, strict=True):
        height = sum(Fraction(float(x)) * c for x, c in zip(n, at, strict=True))
        value += Fraction(float(w)) * ((height - Fraction(float(b))) ** 2 if problem.quadratic else height)
    return value


def is_feasible(problem, point):
    at = [Fraction(float(c)) for c in point]
    return all(
        sum(Fraction(float(x)) * c for x, c in zip(row, at, strict=True)) >= Fraction(float(bound))
        for row, bound in zip(problem.rows, problem.bounds, strict=True)
    )


@pytest.mark.parametrize(("objective", "referee"), [("socp", cone_point), ("lp", vertex_point)])
def test_points_and_their_referees_are_within_a_millionth_of_the_bound(objective, referee):
    problems = problems_of(3, objective, 30)
    result = solve_points(problems)
    for problem, point in zip(problems, result.point, strict=True):
        found, scale = optimality(problem, point), measure(problem)
        assert found.behind == 0 and found.violation <= 1e-9 * problem.scale
        assert found.value == exact_objective(problem, point)
        limit = Fraction(1e-6) * (abs(found.value) + Fraction(scale))
        assert abs(found.gap) <= limit
        other = optimality(problem, referee(problem).point[0])
        assert abs(other.value - found.bound) <= limit
        assert other.bound - found.value <= limit
        if is_feasible(problem, point):
            assert found.violation == 0 and found.gap >= 0 and other.bound <= found.value
        else:
            assert found.violation > 0
    assert len(problems) == 30


@pytest.mark.parametrize("objective", ["socp", "lp"])
def test_no_feasible_point_undercuts_the_bound_found_at_any_point(objective):
    random, tested = np.random.default_rng(4), 0
    for problem in problems_of(4, objective, 25):
        points = problem.centre + problem.scale * random.normal(size=(30, 3)) * random.choice([0.1, 0.5, 1.5], (30, 1))
        feasible = [point for point in [problem.centre, *points] if is_feasible(problem, point)]
        values = [exact_objective(problem, point) for point in feasible]
        for point in points[:4]:
            found = optimality(problem, point)
            assert found.bound <= min(values)
            assert (found.violation == 0) == is_feasible(problem, point)
            tested += len(values)
    assert tested > 200


def test_the_exact_optimum_lies_between_bound_and_value():
    """Three axial walls: the optimum by trying all active sets in rationals."""
    walls = [projection_problems.rectangle(axis, 3000 + 500 * axis, -2000, 3000, -2500, 3500) for axis in range(3)]
    _, problem = projection_problems.one_problem(walls)
    problem = replace(problem, targets=problem.targets - 300)
    optimum, _ = projection_problems.exact_optimum(problem)
    found = optimality(problem, solve_points([problem]).point[0])
    assert found.violation == 0 and found.bound <= optimum <= found.value
    assert found.gap <= Fraction(1e-6) * optimum
    # Away from the optimum the gap is as large as what is lost.
    far = optimality(problem, problem.centre)
    assert far.bound <= optimum and far.gap >= far.value - optimum > optimum / 10


def unit_problem(rows, bounds):
    """Squared distance from (3, 0, 0) along x and y."""
    normals = np.array([[1.0, 0, 0], [0, 1.0, 0]])
    return Problem(
        True,
        normals,
        np.array([3.0, 0]),
        np.ones(2),
        np.full(2, 9.0),
        np.array(rows),
        np.array(bounds),
        np.zeros(3),
        1.0,
    )


def test_a_problem_solved_by_hand():
    box = [*np.eye(3), *-np.eye(3)]
    problem = unit_problem(box, [-1.0] * 6)
    found = optimality(problem, [1.0, 0, 0])
    assert (found.value, found.bound, found.gap, found.violation, found.behind) == (4, 4, 0, 0, 0)
    assert found.weights == {3: 4}
    outside = optimality(problem, [1.5, 0, -2.0])
    assert (outside.violation, outside.bound <= 4) == (1, True)
    assert optimality(problem, [9.0, 0, 0]).behind == 1
    # Without a row along the gradient nothing is proved.
    open_above = unit_problem(box[:3], [-1.0] * 3)
    assert optimality(open_above, [1.0, 0, 0]).bound is None and optimality(open_above, [1.0, 0, 0]).gap is None


def test_altered_weights_prove_nothing():
    problem = unit_problem([*np.eye(3), *-np.eye(3)], [-1.0] * 6)
    at = [Fraction(1), Fraction(0), Fraction(0)]
    assert lower_bound(problem, at, {3: Fraction(4)}) == 4
    assert lower_bound(problem, at, {3: Fraction(4), 1: Fraction(1, 10**30)}) is None
    assert lower_bound(problem, at, {0: Fraction(-4)}) is None
    assert lower_bound(problem, at, {}) is None
    assert lower_bound(problem, [Fraction(3), Fraction(0), Fraction(0)], {}) == 0


def test_bad_input():
    problem = unit_problem([*np.eye(3), *-np.eye(3)], [-1.0] * 6)
    with pytest.raises(InputError, match="finite point"):
        optimality(problem, [1.0, np.nan, 0])
    with pytest.raises(InputError, match="0 occluders"):
        optimality(replace(problem, normals=problem.normals[:0]), [1.0, 0, 0])
