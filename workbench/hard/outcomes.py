"""What a kernel did with a hard case."""

from collections.abc import Iterable, Iterator
from enum import IntEnum

from ...data.verdict import Verdict


class Outcome(IntEnum):
    """What a kernel did with a case."""

    RIGHT = 0
    WITHHELD = 1
    WRONG = 2


Outcomes = Iterator[tuple[str, Outcome]]


def one_sided(claimed: bool, hidden: bool) -> Outcome:
    """Of a kernel that can prove hidden, and says nothing otherwise."""
    if claimed == hidden:
        return Outcome.RIGHT
    return Outcome.WRONG if claimed else Outcome.WITHHELD


def two_sided(verdict: int, hidden: bool) -> Outcome:
    """Of a kernel that answers with a `Verdict`."""
    if verdict == Verdict.UNKNOWN:
        return Outcome.WITHHELD
    return Outcome.RIGHT if (verdict == Verdict.HIDDEN) == hidden else Outcome.WRONG


def worst(outcomes: Iterable[Outcome]) -> Outcome:
    """The worst of some; right if there is none."""
    return max(outcomes, default=Outcome.RIGHT)
