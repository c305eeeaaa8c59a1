"""What came of trying ways to choose levels of detail, as rows of a table."""

from dataclasses import dataclass

import numpy as np

from ...solvers.levels.cost_model import CostModel
from ..summary import table

# A loss [share] below the bound's own rounding is none.
ROUNDING = 1.0e-9


@dataclass(frozen=True)
class Outcome:
    """One candidate at one budget, along the path.

    Attributes:
        method: of CHOOSERS.
        coherent: whether with hysteresis and slack.
        budget_ms: frame time asked for.
        frames: how many were chosen for.
        lost_mean: mean of 1 - value / certified bound: what the best choice could have more is no more than that.
        lost_most: the largest.
        kept_detail: value over that of all finest levels, over all frames.
        switches: objects per frame that change level; None where the frames do not follow one another.
        switch_share: of the objects shown; likewise.
        modelled_misses: share of frames whose modelled time is above the budget.
        measured_misses: likewise of those drawn by the software renderer; None if the costs are not its own.
        choose_ms: median time to choose a frame's levels.
        dropped: objects that must be drawn and did not fit, in all frames.
    """

    method: str
    coherent: bool
    budget_ms: float
    frames: int
    lost_mean: float
    lost_most: float
    kept_detail: float
    switches: float | None
    switch_share: float | None
    modelled_misses: float
    measured_misses: float | None
    choose_ms: float
    dropped: int


def percent(share: float) -> str:
    """A loss in percent; below the bound's own rounding it is none."""
    return f"{100 * share:.3g}" if share > ROUNDING else "0"


@dataclass
class Tuning:
    """What was tried and what came of it.

    Attributes:
        cost: fitted model.
        samples: measured frames, by column; None if the user gave them.
        outcomes: every candidate at every budget.
        best: recommended method.
        best_coherent: whether with hysteresis and slack.
        reason: why, in words.
        modelled_ms: by name, modelled frame times along the path at the middle budget, shape (frames,).
        budgets_ms: frame times tried, ascending.
        notes: what else a reader should know, in sentences.
    """

    cost: CostModel
    samples: dict[str, np.ndarray] | None
    outcomes: list[Outcome]
    best: str
    best_coherent: bool
    reason: str
    modelled_ms: dict[str, np.ndarray]
    budgets_ms: list[float]
    notes: list[str]

    def rows(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        """Head and rows of the table."""
        head = ("budget ms", "method", "coherence", "lost %, mean", "worst", "of finest %", "switches per frame")
        head += ("over target %", "measured %", "choosing ms")
        rows = []
        for o in self.outcomes:
            measured = "-" if o.measured_misses is None else f"{100 * o.measured_misses:.0f}"
            switches = "-" if o.switches is None else f"{o.switches:.2f}"
            marks = ("yes" if o.coherent else "no", percent(o.lost_mean), percent(o.lost_most))
            rest = (f"{100 * o.kept_detail:.1f}", switches, f"{100 * o.modelled_misses:.1f}", measured)
            rows.append((f"{o.budget_ms:.3g}", o.method, *marks, *rest, f"{o.choose_ms:.2f}"))
        return head, rows

    def text(self) -> str:
        """Everything that is printed."""
        head, rows = self.rows()
        return "\n".join([self.cost.line(), *self.notes, "", table(head, rows), "", self.reason])
