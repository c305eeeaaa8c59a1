"""What every solver returns: for each problem of a batch an answer that can be used, and how good it is.

A solver does not raise because a problem is empty, unbounded or badly conditioned: it says so in `status`, gives a
point that is safe to use all the same, and `advice` tells what to do about it. Exceptions are for unusable arguments.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

__all__ = ["ADVICE", "Result", "Status"]


class Status(IntEnum):
    """How a problem ended."""

    SOLVED = 0
    LIMIT = 1
    EMPTY = 2
    INFEASIBLE = 3
    REJECTED = 4


ADVICE = {
    Status.SOLVED: "optimal within the residuals",
    Status.LIMIT: "stopped early: the point is safe but not optimal; look at the residuals, allow more iterations",
    Status.EMPTY: "nothing to optimise: no usable occluder; the start point is returned",
    Status.INFEASIBLE: "no point satisfies all rows; supporting planes of one cell always leave one: check the planes",
    Status.REJECTED: "the optimum failed the exact test before use, the start point is returned: reduce the reach",
}


@dataclass(frozen=True)
class Result:
    """Answers to a batch of n problems.

    Attributes:
        point: safe to use whatever the status, shape (n, variables), float64.
        objective: at the optimum, not at a point returned instead of it; nan where nothing was to solve; shape (n,).
        status: `Status` of each, shape (n,), int32.
        iterations: shape (n,), int32.
        primal: largest violation of a row, in the solver's scaled units, shape (n,).
        dual: largest component of the Lagrangian's gradient, likewise.
        gap: duality gap over 1 + |objective|, likewise.
        seconds: for the batch, compiling included.
    """

    point: np.ndarray
    objective: np.ndarray
    status: np.ndarray
    iterations: np.ndarray
    primal: np.ndarray
    dual: np.ndarray
    gap: np.ndarray
    seconds: float

    def advice(self, row: int) -> str:
        """What the status of one problem means and what to do, for who calls a solver from Python."""
        return ADVICE[Status(int(self.status[row]))]
