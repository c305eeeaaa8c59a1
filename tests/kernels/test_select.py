"""Level-of-detail selection against exact knapsacks: budget, bound and half of the optimum; and greedy selection."""

from dataclasses import fields
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.errors import InputError
from viewcell.kernels import select
from viewcell.kernels.launch import Device
from viewcell.kernels.select import launch_select
from viewcell.solvers.levels.choosers import incremental_greedy, literal_greedy
from viewcell.verify.exact.select import best_by_milp, best_by_table, upper_bound
from viewcell.verify.strategies import knapsacks


def flat(benefits, costs):
    """Arguments for one frame: benefits, costs and starts."""
    starts = np.cumsum([0, *map(len, costs)])
    return np.array([[b for group in benefits for b in group]], float), np.concatenate(costs).astype(int), starts


def grouped(row, starts):
    return [row[a:b].tolist() for a, b in pairwise(starts)]


def check(found, frame, benefits, costs, budget, best=best_by_table):
    """One frame's answer against the optimum, in exact arithmetic; the optimal value, or None if nothing fits."""
    choice = found.choice[frame].tolist()
    value = sum((Fraction(group[k]) for group, k in zip(benefits, choice, strict=True)), Fraction(0))
    assert found.cost[frame] == sum(group[k] for group, k in zip(costs, choice, strict=True))
    size = sum((max(abs(Fraction(b)) for b in group) for group in benefits), Fraction(0))
    assert abs(Fraction(found.value[frame]) - value) <= size / 2**52
    base = [max((-c, Fraction(b)) for b, c in zip(*group, strict=True)) for group in zip(benefits, costs, strict=True)]
    optimum = best(benefits, costs, budget)
    assert found.feasible[frame] == (optimum is not None)
    cheapest = sum((b for _, b in base), Fraction(0))
    if optimum is None:
        assert np.isnan(found.bound[frame]) and np.isnan(found.gap[frame])
        assert value == cheapest and found.cost[frame] == -sum(c for c, _ in base) > budget
        return None
    assert found.cost[frame] <= budget
    bound = Fraction(found.bound[frame])
    assert value <= optimum.value <= bound
    assert 2 * (value - cheapest) >= optimum.value - cheapest - size / 2**48
    if np.isfinite(found.gap[frame]):
        assert optimum.value - value <= Fraction(found.gap[frame]) * abs(bound)
    # The price proves the bound: levels that fit into no selection aside, nobody's dual is larger or much smaller.
    spare = budget + sum(c for c, _ in base)
    usable = [
        [(b, c) for b, c in zip(*group, strict=True) if c + least <= spare]
        for group, (least, _) in zip(zip(benefits, costs, strict=True), base, strict=True)
    ]
    usable = [[[pair[i] for pair in group] for group in usable] for i in range(2)]
    dual = upper_bound(*usable, budget, found.price[frame])
    assert dual <= bound <= dual + (size + dual - cheapest) / 2**47 + Fraction(1, 2**1074)
    return optimum.value


def equal(a, b):
    return all(np.array_equal(getattr(a, f.name), getattr(b, f.name), equal_nan=True) for f in fields(a))


@given(knapsacks())
def test_bounds_hold_and_half_is_reached(knapsack):
    found = launch_select(*flat(knapsack.benefits, knapsack.costs), knapsack.budget)
    check(found, 0, knapsack.benefits, knapsack.costs, knapsack.budget)


NUMBERS = st.floats(-1e3, 1e3) | st.sampled_from([0.0, 1.0, 1.0 + 2**-52, 0.1, 0.3, 1e-300, 5e-324, 1e100])


@given(st.data())
def test_floats_at_their_exact_values(data):
    """Any signs and sizes, levels in any order, three frames of one scene."""
    shape = data.draw(st.lists(st.integers(1, 4), min_size=0, max_size=5))
    costs = [data.draw(st.lists(st.integers(0, 9), min_size=n, max_size=n)) for n in shape]
    frames = [[data.draw(st.lists(NUMBERS, min_size=n, max_size=n)) for n in shape] for _ in range(3)]
    budgets = data.draw(st.lists(st.integers(0, 30), min_size=3, max_size=3))
    benefits = np.array([[b for group in frame for b in group] for frame in frames], float).reshape(3, -1)
    flat_costs = np.array([c for group in costs for c in group], int)
    found = launch_select(benefits, flat_costs, np.cumsum([0, *shape]), budgets)
    for n, (frame, budget) in enumerate(zip(frames, budgets, strict=True)):
        check(found, n, frame, costs, budget)


def test_the_least_floats():
    """Benefits that are subnormal, or just not."""
    random = np.random.default_rng(10)
    for size in (3, 1000, 2**30, 2**52, 2**53, 2**56):
        for _ in range(10):
            costs = [[0, *np.cumsum(random.integers(1, 9, 3)).tolist()] for _ in range(5)]
            steps = [[0, *np.cumsum(random.integers(0, size, 3)).tolist()] for _ in range(5)]
            benefits = [[step * 5e-324 for step in group] for group in steps]
            found = launch_select(*flat(benefits, costs), 30)
            check(found, 0, benefits, costs, 30)


def random_knapsack(random):
    """Instances of a few shapes, as cheap or as dear as they come; often all of one price, or one huge item."""
    kinds = []
    for _ in range(random.integers(1, 4)):
        costs = np.concatenate([[0], np.cumsum(random.integers(0, 12, random.integers(1, 4)))])
        steps = random.integers(0, 50, len(costs) - 1)
        if random.random() < 0.4:
            steps = np.diff(costs) * random.integers(1, 4)
        kinds.append((np.concatenate([[0], np.cumsum(steps)]).tolist(), costs.tolist()))
    if random.random() < 0.3:
        kinds.append(([0, int(random.integers(1, 3000))], [0, int(random.integers(20, 90))]))
    picks = random.integers(0, len(kinds), random.integers(1, 9))
    benefits, costs = ([kinds[k][i] for k in picks] for i in range(2))
    return benefits, costs, int(random.integers(0, sum(map(max, costs)) + 2))


def compare_with_table(count, seed):
    """Worst part of the optimum reached, here where the cheapest set is worth nothing."""
    random = np.random.default_rng(seed)
    worst = [1.0, 1.0]
    for _ in range(count):
        benefits, costs, budget = random_knapsack(random)
        for n, improve in enumerate((False, True)):
            found = launch_select(*flat(benefits, costs), budget, improve=improve)
            best = check(found, 0, benefits, costs, budget)
            if best:
                worst[n] = min(worst[n], found.value[0] / float(best))
    return worst


def test_instances_and_huge_items():
    plain, improved = compare_with_table(300, seed=1)
    assert 0.5 <= plain <= improved


@pytest.mark.slow
def test_instances_and_huge_items_many_times():
    assert min(compare_with_table(20_000, seed=2)) >= 0.5


def levels(objects, frames, seed):
    """Costs rise, benefits rise ever more slowly; level 0 is nothing: benefits, costs, starts and a budget."""
    random = np.random.default_rng(seed)
    costs = np.cumsum(random.integers(0, 2000, (objects, 5)) * [0, 1, 1, 1, 1], axis=1)
    steps = -np.sort(-random.random((frames, objects, 5)), axis=2) * [0, 1, 1, 1, 1]
    benefits = np.cumsum(steps, axis=2) * random.random((frames, objects, 1)) ** 2
    return benefits.reshape(frames, -1), costs.ravel(), np.arange(objects + 1) * 5, int(costs[:, -1].sum() * 0.3)


def test_against_branch_and_bound():
    benefits, costs, starts, budget = levels(60, 3, seed=3)
    found = launch_select(benefits, costs, starts, budget)
    for frame, row in enumerate(benefits):
        check(found, frame, grouped(row, starts), grouped(costs, starts), budget, best=best_by_milp)


def test_many_objects_leave_a_small_gap():
    benefits, costs, starts, budget = levels(1000, 20, seed=4)
    found = launch_select(benefits, costs, starts, budget)
    assert found.feasible.all() and (found.cost <= budget).all()
    assert (found.gap >= 0).all() and found.gap.max() < 1e-4
    assert (launch_select(benefits, costs, starts, budget, improve=False).gap >= found.gap).all()


def test_the_improvement_is_never_worse():
    random = np.random.default_rng(5)
    for _ in range(100):
        benefits, costs, budget = random_knapsack(random)
        asked = (*flat(benefits, costs), budget)
        assert launch_select(*asked).value >= launch_select(*asked, improve=False).value


def test_frames_threads_and_chunks_change_nothing(monkeypatch):
    benefits, costs, starts, _ = levels(200, 40, seed=6)
    budgets = np.random.default_rng(6).integers(0, costs.reshape(-1, 5)[:, 4].sum(), 40)
    together = launch_select(benefits, costs, starts, budgets)
    assert len(np.unique(together.choice, axis=0)) > 30
    monkeypatch.setattr(select, "CPU_LEVELS", 3000)
    assert equal(together, launch_select(benefits, costs, starts, budgets, device=Device(threads=3)))
    for n in range(40):
        alone = launch_select(benefits[n : n + 1], costs, starts, int(budgets[n]))
        for field in fields(together):
            assert np.array_equal(getattr(alone, field.name)[0], getattr(together, field.name)[n])


@pytest.mark.gpu
def test_a_gpu_changes_nothing():
    benefits, costs, starts, _ = levels(200, 100, seed=6)
    budgets = np.random.default_rng(6).integers(0, costs.reshape(-1, 5)[:, 4].sum(), 100)
    assert equal(*(launch_select(benefits, costs, starts, budgets, device=Device(name)) for name in ("cpu", "cuda:0")))


def test_units_change_nothing():
    """Benefits in other units (powers of two), costs from another zero."""
    benefits, costs, starts, budget = levels(80, 5, seed=7)
    found = launch_select(benefits, costs, starts, budget)
    for scale in (2.0**-300, 2.0**380):
        scaled = launch_select(benefits * scale, costs, starts, budget)
        assert np.array_equal(scaled.choice, found.choice) and (scaled.gap < found.gap + 1e-12).all()
    extra = np.random.default_rng(7).integers(0, 10**12, 80)
    moved = launch_select(benefits, costs + np.repeat(extra, 5), starts, budget + extra.sum())
    assert np.array_equal(moved.choice, found.choice) and np.array_equal(moved.cost, found.cost + extra.sum())


def test_everything_fits():
    benefits, costs, starts, _ = levels(50, 2, seed=8)
    for budget in (costs[4::5].sum(), 2**63 - 1):
        found = launch_select(benefits, costs, starts, budget)
        assert (found.choice == benefits.reshape(2, 50, 5).argmax(axis=2)).all()
        assert (found.price == 0).all() and (found.gap < 1e-14).all()


@pytest.mark.parametrize("budget", [3000, 5000])
def test_small_benefits_beside_a_large_one_are_not_lost(budget):
    """Each is below half a unit in the last place of the sum so far."""
    benefits = np.tile([0.0, 1.0], 4001)
    benefits[1] = 2.0**54
    costs, starts = np.tile([0, 1], 4001), np.arange(0, 8003, 2)
    found = launch_select(benefits[None], costs, starts, budget)
    most = Fraction(2**54 + min(budget, 4001) - 1)
    assert most <= Fraction(found.bound[0]) <= most * (1 + Fraction(1, 2**47))
    assert abs(Fraction(found.value[0]) - most) <= 4


def test_nothing_fits():
    """The cheapest level of each object, of equals the best, then the first."""
    found = launch_select([[1, 9, 4, 9, 3, 5]], [2, 1, 1, 1, 3, 2], [0, 4, 6], 2)
    assert not found.feasible[0] and found.cost[0] == 3 and found.choice.tolist() == [[1, 1]]
    assert np.isnan(found.bound[0]) and np.isnan(found.gap[0]) and found.value[0] == 14


def test_ties_go_to_the_cheapest_then_the_first():
    found = launch_select([[5, 5, 5, 7, 7]], [4, 2, 2, 3, 1], [0, 3, 5], [9])
    assert found.choice.tolist() == [[1, 1]] and found.cost[0] == 3


def test_no_objects_and_no_frames():
    found = launch_select(np.zeros((2, 0)), [], [0], [0, 5])
    assert found.choice.shape == (2, 0) and found.value.tolist() == found.gap.tolist() == [0, 0]
    assert launch_select(np.zeros((0, 1)), [1], [0, 1], []).choice.shape == (0, 1)


def test_costs_to_the_limit():
    most = 2**53 - 4
    found = launch_select([[0, 5, 0, 1]], [0, most, 0, 3], [0, 2, 4], most + 2)
    assert found.choice.tolist() == [[1, 0]] and found.cost[0] == most and 6 <= found.bound[0] <= 6 + 1e-12
    with pytest.raises(InputError, match=r"less than 2\*\*53 for all dearest levels"):
        launch_select([[0, 5, 0, 1]], [0, most + 1, 0, 3], [0, 2, 4], 7)


GOOD = {"benefits": [[0.0, 5.0, 1.0]], "costs": [0, 3, 1], "starts": [0, 2, 3], "budgets": [4]}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"benefits": [[0, float("nan"), 1]]}, "frame 0, level 1: expected a finite benefit"),
        ({"benefits": [[0, 5, -float("inf")]]}, "frame 0, level 2: expected a finite benefit"),
        ({"benefits": [[0, 2.0**400, 1]]}, "below 2"),
        ({"benefits": [0, 5, 1]}, r"expected shapes \(frames, levels\) and \(levels,\); found \(3,\)"),
        ({"costs": [0, 3]}, r"found \(1, 3\) and \(2,\)"),
        ({"costs": [0, -3, 1]}, r"costs\[1\]: expected a whole number from 0"),
        ({"costs": [0, 3, 1.5]}, r"costs\[2\]: expected a whole number from 0"),
        ({"costs": [0, float("nan"), 1]}, r"costs\[1\]"),
        ({"costs": ["0", "3", "1"]}, "costs: expected whole numbers"),
        ({"starts": [0, 0, 3]}, "object 0: expected at least one level; found starts 0 and 0"),
        ({"starts": [0, 4, 3]}, "object 1: expected at least one level; found starts 4 and 3"),
        ({"starts": [0, 2]}, "starts: expected 0, ..., 3"),
        ({"starts": [1, 2, 3]}, "starts: expected 0, ..., 3"),
        ({"starts": []}, "starts: expected 0, ..., 3"),
        ({"starts": [0, 2, 2**31]}, r"starts\[2\]"),
        ({"budgets": -1}, "budgets: expected a whole number"),
        ({"budgets": [0.5]}, r"budgets\[0\]: expected a whole number"),
        ({"budgets": [2.0**63]}, r"budgets\[0\]: expected a whole number"),
        ({"budgets": [1, 2]}, r"one for each of 1 frames; found shape \(2,\)"),
    ],
)
@pytest.mark.parametrize("solve", [launch_select, literal_greedy, incremental_greedy])
def test_bad_input(solve, change, message):
    solve(**GOOD)
    with pytest.raises(InputError, match=message) as caught:
        solve(**(GOOD | change))
    assert "\n" not in str(caught.value)


def test_literal_greedy_is_not_half_of_the_best():
    asked = (*flat([[0, 5, 106]], [[0, 1, 100]]), 100)
    assert literal_greedy(*asked).tolist() == [[1]]
    assert launch_select(*asked).choice.tolist() == [[2]]
    asked = (*flat([[0, 5], [0, 100]], [[0, 1], [0, 100]]), 100)
    assert literal_greedy(*asked).tolist() == [[1, 0]] and launch_select(*asked).choice.tolist() == [[0, 1]]


@given(knapsacks())
def test_greedy_choices_keep_the_budget_and_the_bound(knapsack):
    asked = (*flat(knapsack.benefits, knapsack.costs), knapsack.budget)
    found = launch_select(*asked)
    for solve in (literal_greedy, incremental_greedy):
        choice = solve(*asked)[0].tolist()
        cost = sum(group[k] for group, k in zip(knapsack.costs, choice, strict=True))
        value = sum(group[k] for group, k in zip(knapsack.benefits, choice, strict=True))
        if found.feasible[0]:
            assert cost <= knapsack.budget and value <= found.bound[0]
        else:
            assert choice == found.choice[0].tolist()


def test_incremental_greedy_starts_from_the_frame_before():
    benefits, costs, starts = flat([[0, 5], [0, 6]], [[0, 10], [0, 10]])
    frames = np.repeat(benefits, 3, axis=0)
    # The better one is taken up; then the other gains, and only what was shown is exchanged for it.
    frames[1:, 1] = 7
    assert incremental_greedy(frames, costs, starts, [10, 10, 20]).tolist() == [[0, 1], [1, 0], [1, 1]]
    # From above the budget, what loses least goes.
    assert incremental_greedy(benefits, costs, starts, 10, previous=[1, 1]).tolist() == [[0, 1]]
    # What was taken up goes down again at once: a selection from which greed finds no way.
    assert incremental_greedy(*flat([[0, 5], [0, 60]], [[0, 1], [0, 100]]), 100, previous=[1, 0]).tolist() == [[1, 0]]
    # The way to the best level leads over a poor one; only who stood there before keeps it.
    ladder = flat([[0, 1, 100], [0, 8]], [[0, 10, 50], [0, 50]])
    frames = np.repeat(ladder[0], 2, axis=0) * [[1, 1, 1, 0, 0], [1, 1, 1, 1, 1]]
    assert incremental_greedy(frames, *ladder[1:], 50).tolist() == [[2, 0], [2, 0]]
    assert incremental_greedy(frames[1:], *ladder[1:], 50).tolist() == [[0, 1]]
    with pytest.raises(InputError, match="previous: expected a level of each of 2 objects"):
        incremental_greedy(benefits, costs, starts, 10, previous=[2, 0])


def test_incremental_greedy_is_near_the_bound_where_returns_diminish():
    benefits, costs, starts, budget = levels(300, 3, seed=9)
    costs = np.cumsum(np.sort(np.diff(costs.reshape(-1, 5), axis=1, prepend=0), axis=1), axis=1).ravel()
    bound = launch_select(benefits, costs, starts, budget).bound
    choices = incremental_greedy(benefits, costs, starts, budget)
    value = np.take_along_axis(benefits, choices + starts[:-1], axis=1).sum(axis=1)
    assert (value <= bound).all() and (value > 0.99 * bound).all()
