"""Rows of a comparison with a default setting, and which of them is never worse than it.

Times are noise in part. So a row counts as faster only where its times in the same round, divided by the default's, are
below 1 by more than they vary.
"""

import statistics
from dataclasses import dataclass, field

# A setting whose median is slower than the default by no more than 0, and by no more than this in any round, is not
# slower; one that is as tight must gain at least so much time.
ROUND_MOST, LEAST_GAIN = 1.1, 0.05
LOOSER, AS_TIGHT, TIGHTER = -1, 0, 1
# What is not worth a second round is slower than the default by more than this in the first.
HOPELESS = 1.25


@dataclass
class Row:
    """A setting beside the default.

    Attributes:
        name: in words.
        changes: settings in which it differs from the default's row; empty for that.
        seconds: about what all view cells of the model take, one number a round.
        ratios: seconds over the default's of the same round.
        stopped: it was stopped because it took too long: seconds and ratios are the least that it takes.
        cells: view cells that were tried.
        pairs: potentially visible pairs of them and objects; None where it was stopped.
        cell_pairs: likewise of them and cells; None where nothing is claimed.
        kept: share of the model's objects that a view cell keeps, mean by volume of the default's view cells.
        tightness: TIGHTER, AS_TIGHT or LOOSER than the default.
        uncovered: share of the volume of the default's view cells that is in none of this row's.
        hidden: pairs hidden although they are visible: 0, or a bug.
        unusable: why the model cannot be baked so, if it cannot.
    """

    name: str
    changes: dict[str, object] = field(default_factory=dict)
    seconds: list[float] = field(default_factory=list)
    ratios: list[float] = field(default_factory=list)
    stopped: bool = False
    cells: int = 0
    pairs: int | None = None
    cell_pairs: int | None = None
    kept: float = float("nan")
    tightness: int = AS_TIGHT
    uncovered: float = 0.0
    hidden: int = 0
    unusable: str = ""

    @property
    def time(self) -> float:
        """Median of its seconds."""
        return statistics.median(self.seconds)

    @property
    def ratio(self) -> float:
        """Median of its ratios."""
        return statistics.median(self.ratios)

    @property
    def spread(self) -> float:
        """Largest ratio less the smallest."""
        return max(self.ratios) - min(self.ratios)


def why_not(row: Row) -> str:
    """Why a row is not to be recommended before the default; empty if it may be."""
    if row.unusable:
        return row.unusable
    if row.hidden:
        return f"hides {row.hidden:,} visible"
    if row.stopped:
        return "slower, stopped"
    if row.uncovered:
        return f"looks from {100 * row.uncovered:.2g} % less"
    if row.tightness == LOOSER:
        return "looser"
    slower = row.ratio > 1.0 or max(row.ratios) > ROUND_MOST
    if row.tightness == TIGHTER:
        return "tighter, slower" if slower else ""
    if row.ratio + max(row.spread, LEAST_GAIN) < 1.0:
        return ""
    return "slower" if slower else "no gain beyond noise"


def hopeful(row: Row) -> bool:
    """Whether another round can make a row recommended."""
    lost = row.unusable or row.hidden or row.stopped or row.uncovered or row.tightness == LOOSER
    return not lost and row.ratio <= HOPELESS


def recommended(rows: list[Row], least_rounds: int) -> Row:
    """The tightest of those that are never worse than the default, of these the fastest; else the default.

    Args:
        rows: the default's first.
        least_rounds: a row that was measured in fewer is not recommended.
    """
    good = [row for row in rows[1:] if not why_not(row) and len(row.ratios) >= least_rounds]
    return min(good, key=lambda row: (-row.tightness, row.kept, row.ratio), default=rows[0])
