"""A published number and ours: rows of the papers' tables."""

from dataclasses import dataclass

import numpy as np

NONE = "\N{EN DASH}"


@dataclass(frozen=True)
class Line:
    """One published number and ours; a dash where we cannot measure."""

    what: str
    published: str
    ours: str = NONE
    note: str = ""


def mean_max(values: np.ndarray) -> str:
    """Mean and maximum."""
    return f"{values.mean():,.2f} / {values.max():,}"
