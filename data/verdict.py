"""The three answers to "can this be seen?"."""

from enum import IntEnum

import numpy as np


class Verdict(IntEnum):
    """VISIBLE has a witness sightline, HIDDEN has a proof, UNKNOWN has neither and is kept as potential.

    Arrays and kernels hold the numbers, tables of a bake the words.
    """

    HIDDEN = 0
    VISIBLE = 1
    UNKNOWN = 2

    @property
    def word(self) -> str:
        """As tables of a bake and messages have it."""
        return self.name.lower()

    @classmethod
    def words(cls, verdicts: np.ndarray) -> np.ndarray:
        """Words of an array of verdicts, of the same shape, object."""
        return np.array([verdict.word for verdict in cls], object)[verdicts]
