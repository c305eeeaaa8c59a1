"""Other ways to choose levels, to compare `kernels.select` with: two published greedy ones, and branch and bound."""

import heapq
from itertools import pairwise

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csr_array

from ...data.errors import InputError
from ...kernels.select import check_knapsacks


def literal_greedy(
    benefits: np.ndarray, costs: np.ndarray, starts: np.ndarray, budgets: np.ndarray | int
) -> np.ndarray:
    """Levels taken in descending order of benefit / cost, one per object, each if it fits.

    Benefit and cost count from the object's cheapest level (of equals the most beneficial), which it keeps if nothing
    else is taken. A cheap level of a high ratio shuts out the dear ones of its object: 0.047 of the optimum has been
    seen (benefits 5 and 106, costs 1 and 100, budget 100), and there is no lower limit.

    Args and errors: as `viewcell.kernels.select.launch_select`.

    Returns:
        Level of each object, counted from its first, shape (frames, objects), int32; the cheapest levels where even
        they do not fit.

    Source: the 1996 description of the Berkeley walkthrough: "selects object tuples with the highest Benefit/Cost".
    """
    benefits, costs, starts, budgets = check_knapsacks(benefits, costs, starts, budgets)
    owners = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    out = np.empty((len(benefits), len(starts) - 1), np.int32)
    for frame, (benefit, budget) in enumerate(zip(benefits, budgets.tolist(), strict=True)):
        base = _cheapest(benefit, costs, starts)
        gain, more = benefit - benefit[base][owners], costs - costs[base][owners]
        useful = np.flatnonzero((gain > 0) & (more > 0))
        order = useful[np.argsort(-gain[useful] / more[useful], kind="stable")]
        left, choice, taken = budget - int(costs[base].sum()), base.copy(), np.zeros(len(base), bool)
        for level, owner in zip(order.tolist(), owners[order].tolist(), strict=True):
            if not taken[owner] and more[level] <= left:
                taken[owner], choice[owner] = True, level
                left -= int(more[level])
        out[frame] = choice - starts[:-1]
    return out


def incremental_greedy(
    benefits: np.ndarray,
    costs: np.ndarray,
    starts: np.ndarray,
    budgets: np.ndarray | int,
    previous: np.ndarray | None = None,
) -> np.ndarray:
    """Levels changed one step at a time from those of the frame before.

    In each round the object that gains most for a unit of cost goes one level up; then those that lose least for
    a unit go down until the budget holds. A round that gains nothing is taken back and ends the frame. Steps lead over
    the levels that no cheaper one of the object equals in benefit.

    Args and errors: as `viewcell.kernels.select.launch_select`, and

        previous: level of each object before the first frame, counted from its first, shape (objects,), int; the
            cheapest levels unless given.

    Returns:
        As `literal_greedy`.

    Source: Funkhouser and Sequin 1993, "Adaptive display algorithm for interactive frame rates", section 5.
    """
    benefits, costs, starts, budgets = check_knapsacks(benefits, costs, starts, budgets)
    if previous is not None:
        previous = np.asarray(previous)
        if previous.shape != (len(starts) - 1,) or not ((previous >= 0) & (previous < np.diff(starts))).all():
            raise InputError(f"previous: expected a level of each of {len(starts) - 1} objects; found {previous}")
    out = np.empty((len(benefits), len(starts) - 1), np.int32)
    for frame, (benefit, budget) in enumerate(zip(benefits, budgets.tolist(), strict=True)):
        state = _Ladder(benefit, costs, starts, budget, previous)
        while state.improve():
            pass
        previous = out[frame] = state.choice() - starts[:-1]
    return out


def branch_and_bound(benefits: np.ndarray, costs: np.ndarray, starts: np.ndarray, budget: int) -> np.ndarray:
    """Choice of HiGHS at its default gap of 1e-4, one frame; prints what no option of it silences.

    Args: as of `literal_greedy`, of a single frame.

    Returns:
        Level of each object, counted from its first, shape (1, objects), int.
    """
    count = len(costs)
    owners = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    one = csr_array((np.ones(count), (owners, np.arange(count))))
    within = LinearConstraint(costs[None].astype(float), -np.inf, budget)
    constraints = [LinearConstraint(one, 1, 1), within]
    answer = milp(-benefits[0], integrality=np.ones(count), bounds=Bounds(0, 1), constraints=constraints)
    return np.array([[int(np.argmax(answer.x[a:b])) for a, b in pairwise(starts)]])


def _cheapest(benefit: np.ndarray, costs: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Cheapest level of each object, of equals the most beneficial, then the first; numbered through."""
    owners = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    return np.lexsort((-benefit, costs, owners))[starts[:-1]]


class _Ladder:
    """One frame: a step on the ladder of useful levels for each object, and the next steps up and down by ratio."""

    def __init__(
        self, benefit: np.ndarray, costs: np.ndarray, starts: np.ndarray, budget: int, previous: np.ndarray | None
    ) -> None:
        self.benefit, self.costs, self.budget = benefit.tolist(), costs.tolist(), budget
        self.rungs = [self._useful(a, b) for a, b in pairwise(starts.tolist())]
        self.at = [0] * len(self.rungs)
        if previous is not None:
            for g, level in enumerate((starts[:-1] + previous).tolist()):
                below = [n for n, rung in enumerate(self.rungs[g]) if self.costs[rung] <= self.costs[level]]
                self.at[g] = below[-1]
        self.spent = sum(self.costs[level] for level in self.choice().tolist())
        self.ups: list[tuple[float, int, int]] = []
        self.downs: list[tuple[float, int, int]] = []
        for g in range(len(self.at)):
            self._offer(g)
        self._descend()

    def _useful(self, begin: int, end: int) -> list[int]:
        """Levels in the order of their costs that are worth more than all before."""
        found: list[int] = []
        for level in sorted(range(begin, end), key=lambda n: (self.costs[n], -self.benefit[n], n)):
            if not found or self.benefit[level] > self.benefit[found[-1]]:
                found.append(level)
        return found

    def choice(self) -> np.ndarray:
        """Level of each object, numbered through."""
        return np.array([rungs[n] for rungs, n in zip(self.rungs, self.at, strict=True)], np.int32)

    def _step(self, g: int, rung: int) -> tuple[float, int]:
        """Benefit and cost that a rung has more than the one below."""
        low, high = self.rungs[g][rung - 1 : rung + 1]
        return self.benefit[high] - self.benefit[low], self.costs[high] - self.costs[low]

    def _offer(self, g: int) -> None:
        """Put the object's next steps into the queues."""
        if self.at[g] + 1 < len(self.rungs[g]):
            gain, more = self._step(g, self.at[g] + 1)
            heapq.heappush(self.ups, (-gain / more, g, self.at[g]))
        if self.at[g] > 0:
            gain, more = self._step(g, self.at[g])
            heapq.heappush(self.downs, (gain / more, g, self.at[g]))

    def _pop(self, queue: list[tuple[float, int, int]]) -> int | None:
        """First object of a queue that has not moved since it was put there."""
        while queue:
            _, g, rung = heapq.heappop(queue)
            if self.at[g] == rung:
                return g
        return None

    def _descend(self) -> tuple[float, list[int]]:
        """Go down until the budget holds or all are at the cheapest: benefit lost, and the objects in order."""
        lost, moved = 0.0, []
        while self.spent > self.budget:
            g = self._pop(self.downs)
            if g is None:
                break
            gain, more = self._step(g, self.at[g])
            self.at[g] -= 1
            self.spent -= more
            lost += gain
            moved.append(g)
            self._offer(g)
        return lost, moved

    def improve(self) -> bool:
        """One round; whether it gained."""
        g = self._pop(self.ups)
        if g is None or self.spent > self.budget:
            return False
        self.at[g] += 1
        gain, more = self._step(g, self.at[g])
        self.spent += more
        self._offer(g)
        lost, moved = self._descend()
        if gain > lost:
            return True
        for other in moved:
            self.at[other] += 1
        self.at[g] -= 1
        return False
