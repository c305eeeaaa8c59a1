"""Hard cases of orders: which columns are near to each other, and a short tour through them."""

import numpy as np

from ...kernels.launch import Device
from ...kernels.tour import SEGMENT, launch_near_columns, launch_tour
from ...verify.cases.hard_cases import HardCases, TourCase
from ...verify.exact.tour import as_columns, length, nearest, shorter
from .outcomes import Outcome, Outcomes

# Near columns that are asked for: fewer than most cases have.
NEAR = 4


def bits_of(case: TourCase) -> np.ndarray:
    """The case's matrix behind a column of zeros, shape (rows, columns), bool."""
    return np.array([[False, *(c == "1" for c in row)] for row in case.rows])


def near_columns(cases: HardCases, device: Device) -> Outcomes:
    """The nearest columns of each, in order."""
    for case in cases.tour:
        found = launch_near_columns(bits_of(case), NEAR, device)
        truth = nearest([0, *as_columns(case.rows)], NEAR)
        same = [[k for k in row if k >= 0] for row in found.tolist()] == truth
        yield case.name, Outcome.RIGHT if same else Outcome.WRONG


def tour(cases: HardCases, device: Device) -> Outcomes:
    """No column left out, and no step left that shortens the tour; what is above the fewest runs is withheld."""
    for case in cases.tour:
        bits, columns = bits_of(case), [0, *as_columns(case.rows)]
        order = launch_tour(bits, launch_near_columns(bits, len(columns), device), np.zeros(0, int), device).tolist()
        runs = length(columns, order) / 2
        if sorted(order) != list(range(len(columns))) or runs < case.expected:
            yield case.name, Outcome.WRONG
        elif shorter(columns, order, SEGMENT) is not None:
            yield case.name, Outcome.WRONG
        else:
            yield case.name, Outcome.RIGHT if runs == case.expected else Outcome.WITHHELD
