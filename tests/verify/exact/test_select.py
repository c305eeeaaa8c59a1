"""Knapsacks by table and by HiGHS against all selections, each other, and what greedy selection loses."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.errors import InputError
from viewcell.verify.exact.select import Selection, best_by_milp, best_by_table, upper_bound


def best_of_all(benefits, costs, budget):
    """(value, cost) of the best selection by trying all, least cost first among equals; None if none fits."""
    best = None
    for choice in product(*(range(len(group)) for group in benefits)):
        cost = sum(group[k] for group, k in zip(costs, choice, strict=True))
        value = sum(Fraction(group[k]) for group, k in zip(benefits, choice, strict=True))
        if cost <= budget and (best is None or (value, -cost) > (best[0], -best[1])):
            best = value, cost
    return best


def check_selection(found, benefits, costs, budget):
    assert len(found.choice) == len(benefits)
    assert found.value == sum(Fraction(group[k]) for group, k in zip(benefits, found.choice, strict=True))
    assert found.cost == sum(group[k] for group, k in zip(costs, found.choice, strict=True)) <= budget


@st.composite
def knapsacks(draw):
    benefit = st.one_of(st.integers(-3, 9), st.fractions(-2, 5, max_denominator=6))
    benefits, costs = [], []
    for _ in range(draw(st.integers(0, 5))):
        size = draw(st.integers(1, 4))
        benefits.append(draw(st.lists(benefit, min_size=size, max_size=size)))
        costs.append(draw(st.lists(st.integers(0, 8), min_size=size, max_size=size)))
    return benefits, costs, draw(st.integers(0, 20))


@given(knapsacks())
def test_table_and_highs_find_the_best_of_all_selections(knapsack):
    wanted = best_of_all(*knapsack)
    for found in (best_by_table(*knapsack), best_by_milp(*knapsack)):
        assert (found is None) == (wanted is None)
        if found:
            check_selection(found, *knapsack)
            assert found.value == wanted[0]
    assert wanted is None or best_by_table(*knapsack).cost == wanted[1]


@given(knapsacks(), st.fractions(0, 3, max_denominator=8))
def test_no_selection_exceeds_the_bound_of_any_price(knapsack, price):
    found = best_by_table(*knapsack)
    assert found is None or upper_bound(*knapsack, price) >= found.value


def random_levels(random, objects):
    """Levels of detail: cost doubles, benefit rises ever more slowly; level 0 is nothing."""
    costs = [[0, *np.cumsum(random.integers(1, 60, 4)).tolist()] for _ in range(objects)]
    benefits = [[0, *np.cumsum(np.sort(random.integers(1, 1000, 4))[::-1]).tolist()] for _ in range(objects)]
    return benefits, costs


def test_table_and_highs_agree_on_many_objects():
    random = np.random.default_rng(1)
    for objects in (5, 20, 40):
        benefits, costs = random_levels(random, objects)
        budget = 25 * objects
        table, highs = best_by_table(benefits, costs, budget), best_by_milp(benefits, costs, budget)
        check_selection(highs, benefits, costs, budget)
        assert table.value == highs.value
        bound = min(upper_bound(benefits, costs, budget, Fraction(p, 4)) for p in range(200))
        assert table.value <= bound <= table.value * Fraction(11, 10)


def greedy_by_ratio(benefits, costs, budget):
    """Levels in the order of benefit / cost; each is taken if it fits in place of the object's level so far."""
    choice = [0] * len(benefits)
    levels = [(g, k) for g, group in enumerate(costs) for k in range(1, len(group))]
    for g, k in sorted(levels, key=lambda at: Fraction(benefits[at[0]][at[1]], costs[at[0]][at[1]]), reverse=True):
        spent = sum(group[c] for group, c in zip(costs, choice, strict=True))
        if benefits[g][k] > benefits[g][choice[g]] and spent - costs[g][choice[g]] + costs[g][k] <= budget:
            choice[g] = k
    return sum(group[c] for group, c in zip(benefits, choice, strict=True))


def greedy_by_first(benefits, costs, budget):
    """The same, but the first level taken of an object stays."""
    choice = [0] * len(benefits)
    levels = [(g, k) for g, group in enumerate(costs) for k in range(1, len(group))]
    for g, k in sorted(levels, key=lambda at: Fraction(benefits[at[0]][at[1]], costs[at[0]][at[1]]), reverse=True):
        spent = sum(group[c] for group, c in zip(costs, choice, strict=True))
        if choice[g] == 0 and spent + costs[g][k] <= budget:
            choice[g] = k
    return sum(group[c] for group, c in zip(benefits, choice, strict=True))


def test_greedy_by_benefit_over_cost_is_not_half_of_the_best():
    """The level of the best ratio is cheap and shuts out the one that fills the budget."""
    benefits, costs, budget = [[0, 5], [0, 100]], [[0, 1], [0, 100]], 100
    best = best_by_table(benefits, costs, budget)
    assert best == Selection(100, 100, (0, 1)) and best_by_milp(benefits, costs, budget).value == 100
    assert greedy_by_ratio(benefits, costs, budget) == 5
    # The same within one object, if a level once taken stays.
    benefits, costs = [[0, 5, 106]], [[0, 1, 100]]
    assert best_by_table(benefits, costs, budget).value == 106
    assert Fraction(greedy_by_first(benefits, costs, budget), 106) < Fraction(48, 1000)


def test_what_does_not_fit_is_told():
    assert best_by_table([[5], [7, 1]], [[3], [4, 2]], 4) is None
    assert best_by_milp([[5], [7, 1]], [[3], [4, 2]], 4) is None
    assert best_by_table([[5], [7, 1]], [[3], [4, 2]], 5) == Selection(6, 5, (0, 1))
    assert best_by_table([], [], 0) == best_by_milp([], [], 0) == Selection(0, 0, ())


@pytest.mark.parametrize("best", [best_by_table, best_by_milp])
@pytest.mark.parametrize(
    ("benefits", "costs", "budget", "message"),
    [
        ([[1, 2]], [[0, -1]], 5, "cost >= 0"),
        ([[1, 2]], [[0, 1.5]], 5, "integer cost"),
        ([[1, float("nan")]], [[0, 1]], 5, "finite benefit"),
        ([[1], []], [[0], []], 5, "at least one"),
        ([[1, 2]], [[0]], 5, "as many costs"),
        ([[1]], [[0], [1]], 5, "1 groups"),
        ([[1]], [[0]], -1, "budget"),
        ([[1]], [[0]], float("nan"), "budget"),
    ],
)
def test_bad_input(best, benefits, costs, budget, message):
    with pytest.raises(InputError, match=message):
        best(benefits, costs, budget)


def test_a_negative_price_bounds_nothing():
    with pytest.raises(InputError, match="price"):
        upper_bound([[1]], [[0]], 5, -1)
