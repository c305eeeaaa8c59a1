"""The three answers to "can this be seen?"."""

from enum import StrEnum


class Verdict(StrEnum):
    """VISIBLE has a witness sightline, HIDDEN has a proof, UNKNOWN has neither and is kept as potential."""

    VISIBLE = "visible"
    HIDDEN = "hidden"
    UNKNOWN = "unknown"
