"""Projection points against Clarabel, HiGHS, exact optimality conditions, and the identities behind the programmes."""

import subprocess
import sys
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from builders import outlines
from builders.outlines import outline_table
from builders.projection_problems import exact_optimum, one_problem, random_problems, random_umbras, rectangle
from viewcell.data.errors import InputError
from viewcell.kernels.shrink import launch_shrink
from viewcell.kernels.umbra import STRADDLES, USABLE, launch_umbra
from viewcell.solvers.projection_point import (
    MOST_HEIGHT,
    Problem,
    in_front,
    lowest_points,
    solve_points,
    unit_areas,
)
from viewcell.solvers.referees import cone_point, feasible_point, gradient_point, searched_point, vertex_point
from viewcell.solvers.result import ADVICE, Status
from viewcell.verify.arithmetic import dot
from viewcell.verify.exact.umbra import lowest_height


def test_lowest_points_are_those_of_the_exact_programme():
    rng, bounded = np.random.default_rng(1), 0
    for _ in range(60):
        cell, outline, exact = outlines.random_scene(rng)
        umbras = launch_umbra(cell[None], outline_table([outline]), [[0, 0]])
        lowest = lowest_points(umbras)[0]
        wanted = lowest_height(exact) if umbras.status[0] == USABLE else None
        assert np.isinf(lowest) == (wanted is None)
        if wanted is not None:
            unit = float(dot(exact.normal, exact.normal)) ** 0.5
            assert lowest - umbras.far[0] == pytest.approx(float(wanted) / unit, rel=1e-4, abs=1e-3)
        bounded += wanted is not None
    assert 10 < bounded < 50


def test_the_shrunk_area_grows_with_the_square_of_the_height_inside_the_half_spaces():
    rng = np.random.default_rng(2)
    boxes, umbras, pairs = random_umbras(rng, 10, 40)
    low, size = boxes[pairs[:, 0], 0], np.ptp(boxes, axis=1)[pairs[:, 0]]
    points = [low + rng.random((len(pairs), 3)) * size for _ in range(2)]
    areas = [unit_areas(umbras, p) for p in points]
    large = (np.minimum(*areas) > 1e-3) & (umbras.status == USABLE)
    assert large.sum() > 20
    np.testing.assert_allclose(areas[0][large], areas[1][large], rtol=1e-2)
    polygons = launch_shrink(umbras, np.arange(len(pairs)), points[0])
    row = int(np.flatnonzero(large)[0])
    height = umbras.far[row] - umbras.normal[row] @ points[0][row]
    corners = polygons.corners[polygons.starts[row] : polygons.starts[row + 1]]
    assert areas[0][row] * height**2 == pytest.approx(outlines.area_of(corners))


def check_against_referee(problems, referee):
    """Compare optima to 1e-6 of the optimum or 1e-9 of what the programme measures in all, whichever is more."""
    result, compared = solve_points(problems), 0
    for i, problem in enumerate(problems):
        if len(problem.normals) == 0:
            assert result.status[i] == Status.EMPTY
            continue
        other = referee(problem)
        assert result.status[i] == other.status[0] == Status.SOLVED
        size = problem.weights.sum() * problem.scale**2 if problem.quadratic else 0.0
        scale = abs(other.objective[0]) + 1e-3 * (abs(problem.objective(problem.centre)) + size)
        assert result.objective[i] == pytest.approx(other.objective[0], abs=1e-6 * scale)
        # Inside every row but for the rounding of coordinates of some thousand steps.
        assert (problem.rows @ result.point[i] >= problem.bounds - 1e-11).all() and result.primal[i] <= 1e-14
        compared += 1
    return compared


def test_cone_programmes_agree_with_clarabel():
    assert check_against_referee(random_problems(3, 26, 30, 14), cone_point) >= 200


def test_cone_programmes_agree_with_sequential_quadratic_programming():
    """It ends early now and then, and says so; what it calls solved is."""
    problems = [p for p in random_problems(10, 6, 30, 14) if len(p.normals)]
    solved = [p for p in problems if gradient_point(p).status[0] == Status.SOLVED]
    assert len(solved) >= 0.8 * len(problems)
    assert check_against_referee(solved, gradient_point) >= 40


def test_linear_programmes_agree_with_highs():
    problems = random_problems(4, 26, 30, 14, objective="lp", depth=20_000.0)
    assert check_against_referee(problems, vertex_point) >= 200


@pytest.mark.slow
def test_programmes_agree_with_their_referees_many():
    assert check_against_referee(random_problems(5, 150, 60, 14), cone_point) >= 1500
    problems = random_problems(6, 150, 60, 14, objective="lp", depth=20_000.0)
    assert check_against_referee(problems, vertex_point) >= 1500


def test_small_cone_programmes_satisfy_the_exact_optimality_conditions():
    rng, sizes, problems = np.random.default_rng(7), set(), []
    while len(problems) < 10:
        plane = rng.choice([-1, 1], 3) * rng.integers(400, 9000, 3)
        low, high = -rng.integers(0, 4000, (3, 2)), 1000 + rng.integers(0, 4000, (3, 2))
        plane += np.where(plane > 0, 1000, 0)
        outlines = [rectangle(k, plane[k], low[k, 0], high[k, 0], low[k, 1], high[k, 1]) for k in range(3)]
        _, problem = one_problem(outlines)
        if np.linalg.matrix_rank(problem.normals) == 3:
            # The lowest points lie on supporting planes; targets near the centre have their optimum inside.
            moved = problem.normals @ problem.centre - rng.uniform(0, 400 * len(problems), 3)
            problems.append(replace(problem, targets=moved if len(problems) % 2 else problem.targets))
    result = solve_points(problems)
    for i, problem in enumerate(problems):
        wanted, size = exact_optimum(problem)
        scale = float(wanted) + 1e-3 * problem.objective(problem.centre)
        assert result.objective[i] == pytest.approx(float(wanted), abs=1e-6 * scale)
        sizes.add(size)
    assert len(sizes) > 1, "optima inside and on the boundary"


def test_parallel_occluders_leave_the_point_on_the_axis_they_leave_free():
    near, far = rectangle(0, 3000, -4000, 5000, -4000, 5000), rectangle(0, 5000, -9000, 9000, -9000, 9000)
    _, problem = one_problem([near, far])
    assert np.linalg.matrix_rank(problem.scaled()[0], tol=1e-9) == 1
    result = solve_points([problem])
    assert result.status[0] == Status.SOLVED
    assert result.objective[0] == pytest.approx(cone_point(problem).objective[0], rel=1e-6)
    assert (problem.rows @ result.point[0] >= problem.bounds - 1e-3).all()


def test_an_apex_that_can_be_reached_is_the_optimum():
    _, problem = one_problem([rectangle(0, 3000, -2000, 3000, -2000, 3000)])
    result = solve_points([problem])
    # Both pairs of sides have rho 2/3, so the planes meet 5000 / (4/3) before the occluder.
    assert problem.targets[0] == pytest.approx(-750, abs=1e-3)
    assert problem.normals[0] @ result.point[0] == pytest.approx(-750, abs=0.1)
    assert np.abs(problem.rows @ result.point[0] - problem.bounds).min() < 0.1


def test_linear_weights_are_volumes():
    _, problem = one_problem([rectangle(0, 3000, -2000, 3000, -2000, 3000)], objective="lp", depth=5000.0)
    assert problem.weights[0] == pytest.approx(16 / 9 * 5000 * (2 * 3750 + 5000), rel=1e-4)


@pytest.mark.parametrize("objective", ["socp", "lp"])
def test_an_occluder_in_the_way_stops_the_point_before_its_plane(objective):
    wall, way = rectangle(0, -2000, -500, 1500, -500, 1500), rectangle(0, 1200, -2000, 3000, -2000, 3000)
    _, problem = one_problem([wall, way], objective=objective, depth=90_000.0)
    problem = replace(problem, weights=np.array([1.0, 1e-6]))
    free = replace(problem, rows=problem.rows[:-2], bounds=problem.bounds[:-2])
    result = solve_points([problem, free])
    assert result.status.tolist() == [Status.SOLVED, Status.REJECTED]
    assert result.point[0][0] == pytest.approx(1199, abs=1e-2)


def test_an_occluder_hardly_larger_than_the_cell_asks_for_no_more_than_the_reach():
    umbras, problem = one_problem([rectangle(0, 3000, -1, 1001, -1, 1001)], reach=2.0)
    assert np.isfinite(lowest_points(umbras)).all()
    result = solve_points([problem])
    assert result.status[0] == Status.SOLVED
    assert problem.targets[0] < -1e6
    assert result.point[0][0] == pytest.approx(problem.centre[0] - 2.0 * problem.scale, abs=0.1)
    wider = one_problem([rectangle(0, 3000, 0, 1000, 0, 1001)])[1]
    assert wider.targets[0] == pytest.approx(3000 - MOST_HEIGHT * wider.scale)


def test_occluders_without_infinite_shadow_or_cut_by_the_cell_take_no_part():
    small, cut = rectangle(0, 3000, 300, 700, 300, 700), rectangle(0, 500, -9, 9, -9, 9)
    large = rectangle(1, -900, -9000, 9000, -9000, 9000)
    umbras, problem = one_problem([small, cut, large])
    assert umbras.status.tolist() == [USABLE, STRADDLES, USABLE]
    assert np.isinf(lowest_points(umbras)[[0, 2]]).tolist() == [True, False]
    assert len(problem.normals) == 1
    _, nothing = one_problem([small, cut])
    result = solve_points([nothing])
    assert result.status[0] == Status.EMPTY
    assert result.point[0].tolist() == [500.0, 500.0, 500.0]
    assert np.isnan(result.objective[0])
    assert result.advice(0) == ADVICE[Status.EMPTY]


def box_problem(target, far, normal=(1.0, 0.0, 0.0), rows=(), bounds=()):
    box = np.concatenate([np.eye(3), -np.eye(3)])
    return Problem(
        True,
        np.array([normal]),
        np.array([target]),
        np.ones(1),
        np.array([far]),
        np.concatenate([np.array(rows).reshape(-1, 3), box]),
        np.concatenate([np.array(bounds), np.full(6, -100.0)]),
        np.zeros(3),
        50.0,
    )


def test_an_optimum_behind_an_occluder_is_rejected_for_the_centre():
    result = solve_points([box_problem(40.0, 30.0), box_problem(20.0, 30.0)])
    assert result.status.tolist() == [Status.REJECTED, Status.SOLVED]
    assert result.point[0].tolist() == [0.0, 0.0, 0.0]
    assert result.point[1] == pytest.approx([20.0, 0.0, 0.0], abs=1e-4)
    assert result.objective[0] == pytest.approx(0.0, abs=1e-4)
    assert cone_point(box_problem(40.0, 30.0)).status[0] == Status.REJECTED


def test_a_row_left_out_is_kept_to_rounding():
    """Of more rows than are at work at once: one that the optimum violates by less than what would put it to work."""
    idle, wall, tight = np.tile([0.0, 0, 1], (60, 1)), np.tile([-1.0, 0, 0], (8, 1)), np.array([[-0.5, 0, 0]])
    rows, bounds = (
        np.concatenate([idle, wall, tight, wall]),
        [*np.linspace(-2, -1, 60), *[-20.0] * 8, -10 + 2e-9, *[-21.0] * 8],
    )
    problem = box_problem(40.0, 1e9, rows=rows, bounds=bounds)
    loose = replace(problem, bounds=np.where(problem.bounds == -10 + 2e-9, -11, problem.bounds))
    assert (problem.rows @ solve_points([loose]).point[0] < problem.bounds - 1e-10).any()
    found = solve_points([problem])
    assert found.status[0] == Status.SOLVED and found.primal[0] <= 1e-15
    assert (problem.rows @ found.point[0] >= problem.bounds - 1e-14).all()


def test_rows_that_leave_nothing_are_reported():
    impossible = box_problem(0.0, 30.0, rows=[[1.0, 0, 0], [-1.0, 0, 0]], bounds=[5.0, 19.0])
    result = solve_points([impossible, box_problem(20.0, 30.0)])
    assert result.status.tolist() == [Status.INFEASIBLE, Status.SOLVED]
    assert result.point[0].tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("referee", [cone_point, gradient_point, feasible_point])
def test_referees_tell_impossible_rows_and_edge_cases(referee):
    impossible = box_problem(0.0, 30.0, rows=[[1.0, 0, 0], [-1.0, 0, 0]], bounds=[5.0, 19.0])
    assert referee(impossible).status[0] in (Status.INFEASIBLE, Status.LIMIT)
    assert not referee(impossible).point.any()
    # Only one direction matters, and the optimum is inside, on a row, or beyond all of them.
    for target in (20.0, 100.0, 1e6):
        problem = box_problem(target, 1e9)
        found = referee(problem)
        assert found.status[0] == Status.SOLVED
        assert (problem.rows @ found.point[0] >= problem.bounds - 1e-6).all()
        if referee is not feasible_point:
            assert found.point[0][0] == pytest.approx(min(target, 100.0), abs=1e-2)


def test_random_feasible_points_differ_and_keep_all_rows():
    problems = [p for p in random_problems(11, 4, 30, 14) if len(p.normals)]
    points = np.array([[feasible_point(p, seed=seed).point[0] for seed in range(5)] for p in problems])
    for problem, found in zip(problems, points, strict=True):
        assert (found @ problem.rows.T >= problem.bounds - 1e-9).all()
    assert (np.ptp(points, axis=1) > 0).all()


def test_the_last_test_before_use_is_exact():
    """Around the limit of 1/64 grid step and the float64 slack, nearer than float64 can tell."""
    rng, limit, told = np.random.default_rng(9), Fraction(1, 64) + Fraction(1, 2**24), []
    for _ in range(200):
        normal, point = rng.normal(size=3), rng.uniform(-9000, 9000, 3)
        reach = dot(*([Fraction(float(x)) for x in v] for v in (normal, point)))
        far = float(reach + limit)
        allowed = in_front(box_problem(0.0, far, normal), point)
        assert allowed == (Fraction(far) - reach >= limit)
        told.append((allowed, far - float(reach) >= float(limit)))
    assert {True, False} == {allowed for allowed, _ in told}
    assert any(allowed != naive for allowed, naive in told)
    assert not in_front(box_problem(0.0, np.inf), np.full(3, np.nan))


def test_batches_and_their_order_change_nothing():
    problems = random_problems(8, 12, 20, 14)
    whole, turned = solve_points(problems), solve_points(problems[::-1])
    np.testing.assert_allclose(whole.point, turned.point[::-1], rtol=0, atol=1e-9)
    assert whole.status.tolist() == turned.status[::-1].tolist()
    assert len(solve_points([]).point) == 0


def test_search_finds_what_the_programme_finds():
    _, problem = one_problem([rectangle(axis, 3000, -2000, 3000, -2000, 3000) for axis in (0, 1)])
    open_box = replace(problem, rows=problem.rows[8:], bounds=problem.bounds[8:])
    best = solve_points([open_box])
    found = searched_point(open_box, lambda v: -open_box.objective(v), reach=2.0, starts=3, evaluations=200)
    assert -found.objective[0] >= best.objective[0] - 1.0
    assert -found.objective[0] < 1e-3 * open_box.objective(open_box.centre)
    assert searched_point(open_box, lambda v: -open_box.objective(v), starts=1, evaluations=9).iterations[0] <= 11
    flat = searched_point(open_box, lambda v: 7.0, starts=2, evaluations=20)
    assert flat.point[0].tolist() == problem.centre.tolist() and flat.objective[0] == 7.0


def test_search_stays_in_front_of_the_occluders():
    _, problem = one_problem([rectangle(0, 1500, -2000, 3000, -2000, 3000)])
    found = searched_point(problem, lambda v: v[0], reach=3.0, starts=2, evaluations=100)
    assert in_front(problem, found.point[0])
    assert found.point[0][0] > 1000


def test_nothing_slow_is_imported_before_it_is_needed():
    code = (
        "import sys, viewcell, viewcell.solvers.projection_point, viewcell.solvers.referees\n"
        "from viewcell.workbench.cli import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit:\n    pass\n"
        "print(sorted({'jax', 'clarabel', 'nlopt'} & set(sys.modules)))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.splitlines()[-1] == "[]"


@pytest.mark.parametrize("options", [{"objective": "qp"}, {"objective": "lp"}, {"objective": "lp", "depth": -1.0}])
def test_bad_options(options):
    with pytest.raises(InputError, match="expected"):
        one_problem([rectangle(0, 3000, -2000, 3000, -2000, 3000)], **options)
