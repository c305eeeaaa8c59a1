"""Multiple-choice knapsacks solved to the optimum: one level for each object, within a budget.

    max  sum_g benefit[g][k_g]   under   sum_g cost[g][k_g] <= budget,  exactly one k_g for each group g.

A group is an object and its choices are its levels of detail; that it may be left out is a choice of cost 0. With costs
as polygon counts this is the selection of Funkhouser and Sequin 1993, "Adaptive display algorithm for interactive frame
rates".
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isfinite

import numpy as np

from ...data.errors import InputError

__all__ = ["Selection", "best_by_milp", "best_by_table", "upper_bound"]

Number = int | float | Fraction


@dataclass(frozen=True)
class Selection:
    """A best choice in each group.

    Attributes:
        value: sum of the benefits, exact.
        cost: sum of the costs.
        choice: index of the choice in each group.
    """

    value: Number
    cost: int
    choice: tuple[int, ...]


def best_by_table(
    benefits: Sequence[Sequence[Number]], costs: Sequence[Sequence[int]], budget: int
) -> Selection | None:
    """The best selection by dynamic programming over all costs up to the budget, in exact arithmetic.

    Args:
        benefits: of the choices of each group; integers, fractions, or floats at their exact values.
        costs: the same shape, integers >= 0.
        budget: integer >= 0. Time and memory grow with groups * budget.

    Returns:
        A selection of the largest benefit, of the least cost among those; None if no selection fits.

    Raises:
        InputError: shapes differ, a group is empty, a cost is negative or no integer, a benefit is not finite.
    """
    groups, budget = _groups(benefits, costs, budget)
    # best[c]: most benefit at cost exactly c, with the choices that give it.
    best: dict[int, tuple[Fraction, tuple]] = {0: (Fraction(0), ())}
    for group in groups:
        after: dict[int, tuple[Fraction, tuple]] = {}
        for spent, (value, path) in best.items():
            for k, (benefit, cost) in enumerate(group):
                total = spent + cost
                if total <= budget and (total not in after or after[total][0] < value + benefit):
                    after[total] = value + benefit, (path, k)
        best = after
    if not best:
        return None
    cost, (value, path) = min(best.items(), key=lambda entry: (-entry[1][0], entry[0]))
    choice = []
    while path:
        path, k = path
        choice.append(k)
    return _selection(groups, choice[::-1])


def best_by_milp(benefits: Sequence[Sequence[Number]], costs: Sequence[Sequence[int]], budget: int) -> Selection | None:
    """The best selection by branch and bound, HiGHS with no gap allowed.

    Args, errors and None as for `best_by_table`, for budgets of any size. The selection is within the budget and added
    up exactly; that none is better is HiGHS's word, in float64 with tolerances of 1e-6 of the largest benefit (and of 1
    in each cost). `upper_bound` tells exactly how far it can be off.

    Raises:
        RuntimeError: HiGHS gives up, or overspends within its tolerance.
    """
    from scipy.optimize import Bounds, LinearConstraint, milp

    groups, budget = _groups(benefits, costs, budget)
    flat = [choice for group in groups for choice in group]
    if not flat:
        return Selection(0, 0, ())
    which = np.repeat(np.arange(len(groups)), [len(group) for group in groups])
    one = (which == np.arange(len(groups))[:, None]).astype(float)
    scale = float(max(abs(benefit) for benefit, _ in flat)) or 1.0
    answer = milp(
        [-float(benefit) / scale for benefit, _ in flat],
        integrality=np.ones(len(flat)),
        bounds=Bounds(0, 1),
        constraints=[
            LinearConstraint(one, 1, 1),
            LinearConstraint(np.array([[float(cost) for _, cost in flat]]), -np.inf, float(budget)),
        ],
        options={"mip_rel_gap": 0.0},
    )
    if answer.status == 2:
        return None
    if answer.status != 0:
        raise RuntimeError(f"HiGHS gave up: {answer.message}")
    picked, choice, first = answer.x, [], 0
    for group in groups:
        choice.append(int(np.argmax(picked[first : first + len(group)])))
        first += len(group)
    found = _selection(groups, choice)
    if found.cost > budget:
        raise RuntimeError(f"HiGHS overspent by {found.cost - budget}")
    return found


def upper_bound(
    benefits: Sequence[Sequence[Number]], costs: Sequence[Sequence[int]], budget: int, price: Number
) -> Fraction:
    """No selection within the budget is worth more: price * budget + sum_g max_k (benefit - price * cost), exact.

    Args as for `best_by_table`; the price of a unit of cost is any number >= 0 (Lagrange multiplier of the budget).
    """
    groups, budget = _groups(benefits, costs, budget)
    price = Fraction(price)
    if price < 0:
        raise InputError(f"price: expected >= 0; found {price}")
    return price * budget + sum(max(benefit - price * cost for benefit, cost in group) for group in groups)


def _groups(
    benefits: Sequence[Sequence[Number]], costs: Sequence[Sequence[int]], budget: int
) -> tuple[list[list[tuple[Fraction, int]]], int]:
    """(benefit, cost) of the choices of each group, and the budget, checked."""
    if not isfinite(budget) or int(budget) != budget or budget < 0:
        raise InputError(f"budget: expected an integer >= 0; found {budget}")
    if len(benefits) != len(costs):
        raise InputError(f"costs: expected {len(benefits)} groups, as many as of benefits; found {len(costs)}")
    groups = []
    for g, (values, prices) in enumerate(zip(benefits, costs, strict=True)):
        if len(values) != len(prices) or len(values) == 0:
            raise InputError(f"group {g}: expected as many costs as benefits, at least one; found {values}, {prices}")
        for k, (value, price) in enumerate(zip(values, prices, strict=True)):
            if not isfinite(value):
                raise InputError(f"group {g}, choice {k}: expected a finite benefit; found {value}")
            if not isfinite(price) or int(price) != price or price < 0:
                raise InputError(f"group {g}, choice {k}: expected an integer cost >= 0; found {price}")
        groups.append([(Fraction(value), int(price)) for value, price in zip(values, prices, strict=True)])
    return groups, int(budget)


def _selection(groups: list[list[tuple[Fraction, int]]], choice: Sequence[int]) -> Selection:
    picked = [group[k] for group, k in zip(groups, choice, strict=True)]
    value = sum((benefit for benefit, _ in picked), Fraction(0))
    return Selection(value, sum(cost for _, cost in picked), tuple(choice))
