"""Level-of-detail selection: a multiple-choice knapsack per frame, by a Lagrange multiplier, with a certified gap.

Each object g shows exactly one of its levels; the benefits should add up to as much as possible within a budget B of
cost (Funkhouser and Sequin 1993). A price p on cost splits the problem: object g takes a level that maximises b - p c.
The total cost falls as p rises, and for every p >= 0 the dual value

    D(p) = p B + sum_g max_k (b_gk - p c_gk)

is at least the optimum. The price is searched for without sorting, between one at which the levels cost too much and
one at which they fit. The steps are where the two tangents of D meet (D is convex and piecewise linear), and a
bisection of the float64 bit patterns where a tangent step did not halve the cost that the two ends differ by. So there
are at most 2 (53 + 63) passes, each over the objects that still differ; about 20 are usual for 100,000 objects.

Objects that differ between the two ends are all indifferent at the final price, and there may be many: instances of one
definition switch together. They are switched in order of their number while they fit.

At least half of the optimum. Count costs and benefits from the cheapest set (the cheapest level of each object, of
equals the most beneficial). A level that does not fit into B beside the other cheapest levels is left out; it is in no
selection. Let s be the first object that does not fit, V and C value and cost when it is met, d_s > B - C what it
would have cost and e_s = p d_s what it would have gained. Then

    optimum <= D(p) = V + p (B - C) < V + e_s,

and the cheapest set with the one level of s is a selection worth e_s or more, since what s takes at a positive price is
never worth less than its cheapest level. The better of the two is at least half of their sum. The best single level of
all is tried, so what the result gains over the cheapest set is at least half of what the optimum gains, and its value
is at least half of the optimum where the cheapest set is worth 0 or more. Float64 moves this by less than 2**-48 of
sum_g max_k |b_gk|; the certified gap allows for it.

Costs are whole numbers with sums below 2**53, so their float64 sums are exact in any order; benefits are added in the
order of the objects, one thread a frame. CPU and CUDA give the same answer.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..data.errors import InputError
from .launch import CHUNK, CPU, GPU_SLOTS, Device, Scratch, launch_slots

__all__ = ["Selections", "launch_select"]

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

COST_LIMIT = 2**53
# Compensated sums of so many terms err by less than 2**-52 of the sum of their sizes: (2**24 * 2**-53)**2 < 2**-57.
OBJECT_LIMIT = 2**24
# Products of prices and costs stay finite.
BENEFIT_LIMIT = 2.0**400
# Rounding of the dual and of the value, as part of sum_g max_k |b_gk| and of p B: see `dual_value`.
DUAL_MARGIN = wp.constant(wp.float64(2.0**-48))
FILL_ROUNDS = wp.constant(8)
# Rows of scratch: three of levels, one of objects.
ACTIVE = wp.constant(3)
ROWS = 4
# Levels that a CPU thread takes at a time, and slots times objects on a GPU.
CPU_LEVELS = 50_000
GPU_ENTRIES = 2**28


@wp.struct
class Knapsacks:
    """The frames' problems; costs and budgets count from the cheapest set and are whole."""

    benefits: wp.array2d[wp.float64]
    costs: wp.array[wp.float64]
    starts: wp.array[int]
    budgets: wp.array[wp.float64]


@wp.struct
class Bracket:
    """Two choices of levels at two prices: `lo` costs too much, `hi` fits.

    `value` and `cost` are what lo has more than hi; `spent` is the cost of hi. `lo` and `hi` number two of the first
    three rows of scratch; the row ACTIVE begins with `active` objects, all others have the same level in both.
    """

    lo: int
    hi: int
    active: int
    price_lo: wp.float64
    price_hi: wp.float64
    value: wp.float64
    cost: wp.float64
    spent: wp.float64


@wp.struct
class Step:
    """What the best levels at a price have more than those of a bracket's hi (up), and less than its lo (down)."""

    up_value: wp.float64
    up_cost: wp.float64
    down_value: wp.float64
    down_cost: wp.float64
    active: int


@wp.struct
class Answers:
    """One row per frame; costs count from the cheapest set."""

    choices: wp.array2d[int]
    values: wp.array[wp.float64]
    costs: wp.array[wp.float64]
    bounds: wp.array[wp.float64]
    prices: wp.array[wp.float64]


@wp.func
def spot(lane: wp.vec3i, row: int, g: int) -> int:
    """Place of an object in a row of scratch; lane: objects, slots, slot."""
    return (row * lane[0] + g) * lane[1] + lane[2]


@wp.func
def best_level(knapsacks: Knapsacks, frame: int, g: int, price: wp.float64) -> int:
    """Level that maximises benefit - price * cost of those that fit alone; of equals the cheapest, then the first."""
    budget = knapsacks.budgets[frame]
    best = int(-1)
    most = f64(-wp.inf)
    least = f64(0.0)
    for level in range(knapsacks.starts[g], knapsacks.starts[g + 1]):
        cost = knapsacks.costs[level]
        worth = knapsacks.benefits[frame, level] - price * cost
        better = cost <= budget and (worth > most or (worth == most and cost < least))
        best = wp.where(better, level, best)
        most = wp.where(better, worth, most)
        least = wp.where(better, cost, least)
    return best


@wp.func
def cheapest_level(knapsacks: Knapsacks, frame: int, g: int) -> int:
    """Level of cost 0 above the cheapest; of equals the most beneficial, then the first."""
    best = int(-1)
    for level in range(knapsacks.starts[g], knapsacks.starts[g + 1]):
        if knapsacks.costs[level] == f64(0.0):
            if best < 0 or knapsacks.benefits[frame, level] > knapsacks.benefits[frame, best]:
                best = level
    return best


@wp.func
def open_bracket(knapsacks: Knapsacks, frame: int, scratch: wp.array[int], lane: wp.vec3i) -> Bracket:
    """Most beneficial levels in row 0, cheapest in row 1, and prices at which they are best."""
    found = Bracket()
    found.lo = 0
    found.hi = 1
    found.active = lane[0]
    low = f64(wp.inf)
    high = f64(0.0)
    value = f64(0.0)
    cost = f64(0.0)
    budget = knapsacks.budgets[frame]
    for g in range(lane[0]):
        dear = best_level(knapsacks, frame, g, f64(0.0))
        cheap = cheapest_level(knapsacks, frame, g)
        scratch[spot(lane, 0, g)] = dear
        scratch[spot(lane, 1, g)] = cheap
        scratch[spot(lane, ACTIVE, g)] = g
        top = knapsacks.benefits[frame, dear]
        bottom = knapsacks.benefits[frame, cheap]
        width = knapsacks.costs[dear]
        value += top - bottom
        cost += width
        for level in range(knapsacks.starts[g], knapsacks.starts[g + 1]):
            c = knapsacks.costs[level]
            b = knapsacks.benefits[frame, level]
            if c > f64(0.0) and c <= budget:
                high = wp.max(high, (b - bottom) / c)
            if c < width:
                low = wp.min(low, (top - b) / (width - c))
    found.price_lo = low
    found.price_hi = high
    found.value = value
    found.cost = cost
    found.spent = f64(0.0)
    return found


@wp.func
def split(
    knapsacks: Knapsacks,
    frame: int,
    scratch: wp.array[int],
    lane: wp.vec3i,
    ends: Bracket,
    price: wp.float64,
) -> Step:
    """Put the best levels at a price into the third row.

    Costs fall as the price rises: what is best at both ends is best between. Such objects leave the row ACTIVE, with
    the same level in all rows.
    """
    step = Step()
    up_value = f64(0.0)
    up_cost = f64(0.0)
    down_value = f64(0.0)
    down_cost = f64(0.0)
    kept = int(0)
    for n in range(ends.active):
        g = scratch[spot(lane, ACTIVE, n)]
        dear = scratch[spot(lane, ends.lo, g)]
        cheap = scratch[spot(lane, ends.hi, g)]
        level = int(cheap)
        if dear != cheap:
            scratch[spot(lane, ACTIVE, kept)] = g
            kept += 1
            level = best_level(knapsacks, frame, g, price)
            b = knapsacks.benefits[frame, level]
            c = knapsacks.costs[level]
            up_value += b - knapsacks.benefits[frame, cheap]
            up_cost += c - knapsacks.costs[cheap]
            down_value += knapsacks.benefits[frame, dear] - b
            down_cost += knapsacks.costs[dear] - c
        scratch[spot(lane, 3 - ends.lo - ends.hi, g)] = level
    step.up_value = up_value
    step.up_cost = up_cost
    step.down_value = down_value
    step.down_cost = down_cost
    step.active = kept
    return step


@wp.func
def close_bracket(knapsacks: Knapsacks, frame: int, scratch: wp.array[int], lane: wp.vec3i, opened: Bracket) -> Bracket:
    """Bring the two prices together: objects that then differ are indifferent at value / cost."""
    ends = opened
    bisect = bool(False)
    searching = bool(True)
    while searching:
        price = ends.value / ends.cost
        tangent = not bisect and price > ends.price_lo and price < ends.price_hi
        if not tangent:
            # Positive floats are ordered as their bit patterns.
            first = wp.cast(ends.price_lo, wp.int64)
            price = wp.cast(first + (wp.cast(ends.price_hi, wp.int64) - first) / wp.int64(2), wp.float64)
        if price <= ends.price_lo or price >= ends.price_hi:
            searching = False
        else:
            step = split(knapsacks, frame, scratch, lane, ends, price)
            ends.active = step.active
            if tangent and (step.up_cost == f64(0.0) or step.down_cost == f64(0.0)):
                # Both tangents touch the dual here: its minimum.
                searching = False
            else:
                before = ends.cost
                if ends.spent + step.up_cost > knapsacks.budgets[frame]:
                    ends.lo = 3 - ends.lo - ends.hi
                    ends.price_lo = price
                    ends.value = step.up_value
                    ends.cost = step.up_cost
                else:
                    ends.hi = 3 - ends.lo - ends.hi
                    ends.price_hi = price
                    ends.spent += step.up_cost
                    ends.value = step.down_value
                    ends.cost = step.down_cost
                bisect = tangent and ends.cost > f64(0.5) * before
    return ends


@wp.func
def switch_while_fits(knapsacks: Knapsacks, frame: int, scratch: wp.array[int], lane: wp.vec3i, ends: Bracket) -> int:
    """Move objects of row hi to their levels of row lo where they fit; the first that does not (one never does)."""
    left = knapsacks.budgets[frame] - ends.spent
    stopped = int(-1)
    for g in range(lane[0]):
        dear = scratch[spot(lane, ends.lo, g)]
        cheap = scratch[spot(lane, ends.hi, g)]
        if dear != cheap:
            more = knapsacks.costs[dear] - knapsacks.costs[cheap]
            if more <= left:
                scratch[spot(lane, ends.hi, g)] = dear
                left -= more
            elif stopped < 0:
                stopped = g
    return stopped


@wp.func
def row_cost(knapsacks: Knapsacks, scratch: wp.array[int], lane: wp.vec3i, row: int) -> wp.float64:
    """Cost of a row above the cheapest set."""
    cost = f64(0.0)
    for g in range(lane[0]):
        cost += knapsacks.costs[scratch[spot(lane, row, g)]]
    return cost


@wp.func
def plus(total: wp.vec2d, term: wp.float64) -> wp.vec2d:
    """Compensated addition (Neumaier 1974): the sum, and what its roundings have lost."""
    after = total[0] + term
    if wp.abs(total[0]) >= wp.abs(term):
        return wp.vec2d(after, total[1] + ((total[0] - after) + term))
    return wp.vec2d(after, total[1] + ((term - after) + total[0]))


@wp.func
def row_value(knapsacks: Knapsacks, frame: int, scratch: wp.array[int], lane: wp.vec3i, row: int) -> wp.float64:
    """Benefit of a row."""
    total = wp.vec2d(f64(0.0), f64(0.0))
    for g in range(lane[0]):
        total = plus(total, knapsacks.benefits[frame, scratch[spot(lane, row, g)]])
    return total[0] + total[1]


@wp.func
def fill(knapsacks: Knapsacks, frame: int, scratch: wp.array[int], lane: wp.vec3i, row: int):
    """Spend what is left of the budget: the level that gains most, some times over."""
    left = knapsacks.budgets[frame] - row_cost(knapsacks, scratch, lane, row)
    rounds = int(0)
    while rounds < FILL_ROUNDS and left > f64(0.0):
        object = int(-1)
        chosen = int(-1)
        most = f64(0.0)
        price = f64(0.0)
        for g in range(lane[0]):
            now = scratch[spot(lane, row, g)]
            b = knapsacks.benefits[frame, now]
            c = knapsacks.costs[now]
            for level in range(knapsacks.starts[g], knapsacks.starts[g + 1]):
                more = knapsacks.costs[level] - c
                gain = knapsacks.benefits[frame, level] - b
                if more <= left and (gain > most or (gain == most and chosen >= 0 and more < price)):
                    object = g
                    chosen = level
                    most = gain
                    price = more
        rounds += 1
        if chosen < 0:
            rounds = FILL_ROUNDS
        else:
            scratch[spot(lane, row, object)] = chosen
            left -= price


@wp.func
def trade(knapsacks: Knapsacks, frame: int, scratch: wp.array[int], lane: wp.vec3i, row: int):
    """Bring a row that costs too much into the budget by the one level that loses least; one must exist."""
    over = row_cost(knapsacks, scratch, lane, row) - knapsacks.budgets[frame]
    object = int(-1)
    chosen = int(-1)
    least = f64(wp.inf)
    for g in range(lane[0]):
        now = scratch[spot(lane, row, g)]
        b = knapsacks.benefits[frame, now]
        c = knapsacks.costs[now]
        if c >= over:
            for level in range(knapsacks.starts[g], knapsacks.starts[g + 1]):
                loss = b - knapsacks.benefits[frame, level]
                if c - knapsacks.costs[level] >= over and loss < least:
                    object = g
                    chosen = level
                    least = loss
    scratch[spot(lane, row, object)] = chosen


@wp.func
def single_upgrade(knapsacks: Knapsacks, frame: int, scratch: wp.array[int], lane: wp.vec3i, row: int):
    """The cheapest set with the one level that gains most."""
    object = int(-1)
    chosen = int(-1)
    most = f64(0.0)
    for g in range(lane[0]):
        cheap = cheapest_level(knapsacks, frame, g)
        scratch[spot(lane, row, g)] = cheap
        level = best_level(knapsacks, frame, g, f64(0.0))
        gain = knapsacks.benefits[frame, level] - knapsacks.benefits[frame, cheap]
        if gain > most:
            object = g
            chosen = level
            most = gain
    if object >= 0:
        scratch[spot(lane, row, object)] = chosen


@wp.func
def dual_value(knapsacks: Knapsacks, frame: int, lane: wp.vec3i, price: wp.float64) -> wp.float64:
    """Not less than D(price), with room for what `row_value` rounds.

    With u = 2**-53 and m = max_k |b|: a level that is truly best has p c <= b - (benefit of the cheapest) <= 2 m and
    -m <= b - p c <= m, so b - p c is computed to 3 u m, and no other level is computed higher by more. The compensated
    sum errs by 2 u sum m, the product p B by u p B, the last addition by u (sum m + p B), the value of a selection by
    2 u sum m: less than 2**-48 (sum m + p B) together. Costs are whole, so products and sums that are subnormal are
    exact.
    """
    total = wp.vec2d(f64(0.0), f64(0.0))
    size = f64(0.0)
    budget = knapsacks.budgets[frame]
    for g in range(lane[0]):
        term = f64(-wp.inf)
        largest = f64(0.0)
        for level in range(knapsacks.starts[g], knapsacks.starts[g + 1]):
            cost = knapsacks.costs[level]
            if cost <= budget:
                b = knapsacks.benefits[frame, level]
                term = wp.max(term, b - price * cost)
                largest = wp.max(largest, wp.abs(b))
        size += largest
        total = plus(total, term)
    return total[0] + total[1] + price * budget + DUAL_MARGIN * (size + price * budget)


@wp.func
def solve(
    knapsacks: Knapsacks, frame: int, scratch: wp.array[int], lane: wp.vec3i, opened: Bracket, improve: bool
) -> wp.vec2d:
    """Row of the best selection found, and the price, where the most beneficial levels do not fit."""
    ends = close_bracket(knapsacks, frame, scratch, lane, opened)
    stopped = switch_while_fits(knapsacks, frame, scratch, lane, ends)
    best = int(ends.hi)
    traded = int(ends.lo)
    single = 3 - ends.lo - ends.hi
    if improve:
        for g in range(lane[0]):
            if g != stopped:
                scratch[spot(lane, traded, g)] = scratch[spot(lane, best, g)]
        trade(knapsacks, frame, scratch, lane, traded)
        fill(knapsacks, frame, scratch, lane, traded)
        fill(knapsacks, frame, scratch, lane, best)
        if row_value(knapsacks, frame, scratch, lane, traded) > row_value(knapsacks, frame, scratch, lane, best):
            best = traded
    single_upgrade(knapsacks, frame, scratch, lane, single)
    if row_value(knapsacks, frame, scratch, lane, single) > row_value(knapsacks, frame, scratch, lane, best):
        best = single
        if improve:
            fill(knapsacks, frame, scratch, lane, best)
    return wp.vec2d(f64(best), wp.max(f64(0.0), ends.value / ends.cost))


@wp.kernel
def _select(
    knapsacks: Knapsacks,
    improve: bool,
    first: int,
    last: int,
    slots: int,
    scratch: wp.array[int],
    answers_out: Answers,
):
    objects = knapsacks.starts.shape[0] - 1
    lane = wp.vec3i(objects, slots, wp.tid())
    frame = first + wp.tid()
    while frame < last:
        row = int(0)
        price = f64(0.0)
        if knapsacks.budgets[frame] < f64(0.0):
            for g in range(objects):
                scratch[spot(lane, 0, g)] = cheapest_level(knapsacks, frame, g)
        else:
            opened = open_bracket(knapsacks, frame, scratch, lane)
            if opened.cost > knapsacks.budgets[frame]:
                solved = solve(knapsacks, frame, scratch, lane, opened, improve)
                row = int(solved[0])
                price = solved[1]
        answers_out.values[frame] = row_value(knapsacks, frame, scratch, lane, row)
        answers_out.costs[frame] = row_cost(knapsacks, scratch, lane, row)
        answers_out.bounds[frame] = dual_value(knapsacks, frame, lane, price)
        answers_out.prices[frame] = price
        for g in range(objects):
            answers_out.choices[frame, g] = scratch[spot(lane, row, g)] - knapsacks.starts[g]
        frame += slots


@dataclass(frozen=True)
class Selections:
    """One level for each object, in each frame.

    Attributes:
        choice: level of each object, counted from the object's first, shape (frames, objects), int32.
        value: sum of the benefits, rounded in float64 (exact where benefits are whole and sums below 2**53),
            shape (frames,), float64.
        cost: sum of the costs, shape (frames,), int64; never above the budget of a feasible frame.
        bound: no selection within the budget is worth more, rounding included, shape (frames,), float64; NaN where
            not feasible.
        gap: (bound - value) / |bound|, certified: the optimum exceeds the exact value by no more than this part of the
            bound, shape (frames,), float64; infinite where the bound is 0 and the value below; NaN where not feasible.
        price: Lagrange multiplier of the budget that gives the bound, shape (frames,), float64, >= 0.
        feasible: whether any selection is within the budget, shape (frames,), bool. Where not, the choice is the
            cheapest level of each object (of equals the most beneficial, then the first), over the budget.
    """

    choice: np.ndarray
    value: np.ndarray
    cost: np.ndarray
    bound: np.ndarray
    gap: np.ndarray
    price: np.ndarray
    feasible: np.ndarray


def launch_select(
    benefits: np.ndarray,
    costs: np.ndarray,
    starts: np.ndarray,
    budgets: np.ndarray | int,
    *,
    improve: bool = True,
    device: Device = CPU,
) -> Selections:
    """Levels of detail of much benefit within each frame's budget of cost, with a bound on what the best could gain.

    The budget is never exceeded if anything fits. Over the cheapest set of levels, the selection gains at least half of
    what the best gains, up to rounding (see the module); `gap` says how near it is in fact. The answer depends neither
    on the threads nor on the device, nor on which frames are asked together.

    Args:
        benefits: of each level in each frame, shape (frames, levels), float64, finite, |benefit| < 2**400.
        costs: of each level, shape (levels,), whole numbers >= 0; the dearest levels of all objects together cost
            less than 2**53.
        starts: levels of object g are starts[g] : starts[g + 1], at least one, in any order; shape (objects + 1,), int,
            fewer than 2**24 objects. An object that may be left out has a level of cost 0.
        budgets: of each frame, or one for all, shape (frames,), whole numbers >= 0.
        improve: spend what is left by single changes of level; cannot make the selection worse. Without it a frame
            takes about a third less time and the gap is ten times as large and more.
        device: where to. CPU threads share the frames; one GPU thread solves one frame.

    Raises:
        InputError: a shape, an object without levels, starts out of order, a benefit that is not finite, a cost or
            budget that is negative or not whole, or something beyond the limits above.

    Source: Funkhouser and Sequin 1993, "Adaptive display algorithm for interactive frame rates" (the problem); the
    bound is the Lagrangian dual of the budget (Everett 1963).
    """
    benefit, cost, first, budget = check_knapsacks(benefits, costs, starts, budgets)
    frames, objects = len(benefit), len(first) - 1
    least = np.minimum.reduceat(cost, first[:-1]) if objects else cost
    above = (cost - np.repeat(least, np.diff(first))).astype(np.float64)
    spare = np.clip(budget - least.sum(), -1, COST_LIMIT).astype(np.float64)
    knapsacks, answers = Knapsacks(), Answers()
    knapsacks.costs, knapsacks.budgets = device.array(above, f64), device.array(spare, f64)
    knapsacks.starts = device.array(first, int)
    if device.is_cpu:
        knapsacks.benefits = wp.array(benefit, dtype=f64, device=device.name, copy=False)
        answers.choices = device.zeros((frames, objects), int)
    else:
        # Threads of a GPU are frames: what neighbours read and write lies side by side.
        knapsacks.benefits = device.array(benefit.T, f64).transpose()
        answers.choices = device.zeros((objects, frames), int).transpose()
    answers.values, answers.costs, answers.bounds, answers.prices = (device.zeros(frames, f64) for _ in range(4))
    launch_slots(
        _select,
        frames,
        [knapsacks, improve],
        Scratch(0, max(1, ROWS * objects)),
        [answers],
        device,
        chunk=max(1, min(CHUNK, CPU_LEVELS // max(1, len(cost)))),
        # Scratch may have no room for all frames at once.
        gpu_chunk=max(1, min(GPU_SLOTS, GPU_ENTRIES // max(1, objects))),
    )
    return _selections(answers, int(least.sum()), spare >= 0)


def _selections(answers: Answers, least: int, feasible: np.ndarray) -> Selections:
    """The frames' answers, with their gaps."""
    value, price = answers.values.numpy(), answers.prices.numpy()
    bound = np.where(feasible, answers.bounds.numpy(), np.nan)
    short, size = bound - value, np.abs(bound)
    gap = np.divide(short, size, out=np.where(short > 0, np.inf, short), where=size > 0)
    cost = answers.costs.numpy().astype(np.int64) + least
    choice = np.ascontiguousarray(answers.choices.numpy())
    return Selections(choice, value, cost, bound, gap, price, feasible)


def check_knapsacks(
    benefits: np.ndarray, costs: np.ndarray, starts: np.ndarray, budgets: np.ndarray | int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Arguments of `launch_select` as contiguous arrays: float64, int64, int32 and int64, a budget for each frame.

    Raises:
        InputError: as `launch_select`.
    """
    cost, first = _whole(costs, "costs"), _whole(starts, "starts", np.int32)
    benefit = np.ascontiguousarray(benefits, np.float64)
    if benefit.ndim != 2 or cost.ndim != 1 or benefit.shape[1] != len(cost):
        raise InputError(
            f"benefits, costs: expected shapes (frames, levels) and (levels,); found {benefit.shape} and {cost.shape}"
        )
    if first.ndim != 1 or not 0 < len(first) <= OBJECT_LIMIT or first[0] != 0 or first[-1] != len(cost):
        raise InputError(
            f"starts: expected 0, ..., {len(cost)} (levels), below {OBJECT_LIMIT} objects; found {_shown(first)}"
        )
    empty = np.flatnonzero(np.diff(first) <= 0)
    if len(empty):
        g = int(empty[0])
        raise InputError(f"object {g}: expected at least one level; found starts {first[g]} and {first[g + 1]}")
    # NaN is neither above nor below.
    if benefit.size and not (benefit.min() > -BENEFIT_LIMIT and benefit.max() < BENEFIT_LIMIT):
        frame, level = np.argwhere(~(np.abs(benefit) < BENEFIT_LIMIT))[0].tolist()
        raise InputError(
            f"frame {frame}, level {level}: expected a finite benefit below 2**400; found {benefit[frame, level]}"
        )
    dearest = np.maximum.reduceat(cost, first[:-1]).astype(np.float64).sum() if len(cost) else 0.0
    if dearest >= COST_LIMIT:
        raise InputError(f"costs: expected less than 2**53 for all dearest levels together; found {dearest:.3g}")
    budget = _whole(budgets, "budgets")
    if budget.ndim and budget.shape != (len(benefit),):
        raise InputError(f"budgets: expected one, or one for each of {len(benefit)} frames; found shape {budget.shape}")
    return benefit, cost, first, np.broadcast_to(budget, len(benefit))


def _whole(numbers: np.ndarray | int, name: str, dtype: type = np.int64) -> np.ndarray:
    """Integers >= 0 that the type holds, contiguous."""
    found = np.asarray(numbers)
    if found.dtype.kind not in "iuf" and found.size:
        raise InputError(f"{name}: expected whole numbers; found {found.dtype}")
    good = (found >= 0) & (found <= np.iinfo(dtype).max) & (found == np.floor(found))
    if found.dtype.kind == "f":
        # The nearest float64 of the largest int64 is 2**63 itself.
        good &= found < 2.0**63
    if not good.all():
        at = np.unravel_index(int(np.argmin(good)), found.shape)
        where = f"{name}[{', '.join(map(str, map(int, at)))}]" if at else name
        raise InputError(f"{where}: expected a whole number from 0 to {np.iinfo(dtype).max}; found {found[at]}")
    return np.ascontiguousarray(found, dtype) if found.ndim else found.astype(dtype)


def _shown(numbers: np.ndarray) -> str:
    """Shape, and first and last number."""
    ends = f": {numbers.flat[0]}, ..., {numbers.flat[-1]}" if numbers.size else ""
    return f"shape {numbers.shape}{ends}"
