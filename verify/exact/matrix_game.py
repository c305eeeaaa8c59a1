"""Exact matrix games: which side of zero their value is on, and a strategy that proves it."""

from collections.abc import Sequence
from typing import NamedTuple

# Pivots by Dantzig's rule (largest gain) before Bland's, which cannot cycle.
DANTZIG = 60


class Play(NamedTuple):
    """A proof of the sign of a game's value: exactly one of the two is not None.

    Attributes:
        rows: integers >= 0, not all 0, whose combination of the rows is <= 0 in every column.
        columns: integers >= 0, not all 0, whose combination of the columns is > 0 in every row.
    """

    rows: list[int] | None
    columns: list[int] | None


def play(matrix: Sequence[Sequence[int]]) -> Play:
    """Whether some combination of the columns is positive in every row (Ville's alternative).

    Args:
        matrix: integers of any size, at least one row and one column, all rows equally long.

    Returns:
        Weights of the rows, or of the columns; never wrong.

    Source: Ville 1938 for the alternative. With K so large that M + K > 0 the largest sum of x >= 0 under
    x (M + K) <= 1 is 1 / (K + value), and any feasible x with sum >= 1 / K proves that the value is <= 0. Simplex
    method on the condensed tableau; integer pivots as in Edmonds 1967, "Systems of distinct representatives and linear
    algebra": all entries share the denominator `common` and stay minors of the first tableau.
    """
    count, shift = len(matrix), 1 - min(0, *map(min, matrix))
    table = [[row[k] + shift for row in matrix] + [1] for k in range(len(matrix[0]))]
    table.append([-1] * count + [0])
    # Numbers below `count` are the rows of the matrix, the others its columns.
    outside, inside = list(range(count)), list(range(count, count + len(matrix[0])))
    common, pivots = 1, 0
    while shift * table[-1][-1] < common:
        gains = table[-1][:-1]
        enter = min(range(count), key=gains.__getitem__)
        if gains[enter] >= 0:
            return Play(None, _weights(outside, table[-1], count, len(matrix[0])))
        if pivots >= DANTZIG:
            enter = min((k for k in range(count) if gains[k] < 0), key=outside.__getitem__)
        leave = None
        for k, row in enumerate(table[:-1]):
            if row[enter] > 0:
                order = 0 if leave is None else row[-1] * table[leave][enter] - table[leave][-1] * row[enter]
                if leave is None or order < 0 or (order == 0 and inside[k] < inside[leave]):
                    leave = k
        common = _pivot(table, leave, enter, common)
        outside[enter], inside[leave] = inside[leave], outside[enter]
        pivots += 1
    solution = [0] * count
    for number, row in zip(inside, table, strict=False):
        if number < count:
            solution[number] = row[-1]
    return Play(solution, None)


def _pivot(table: list[list[int]], leave: int, enter: int, common: int) -> int:
    """Exchange a row and a column of the tableau in place; returns its new denominator."""
    pivot_row = table[leave]
    pivot = pivot_row[enter]
    for k, row in enumerate(table):
        if k != leave:
            factor = row[enter]
            table[k] = [(pivot * x - factor * y) // common for x, y in zip(row, pivot_row, strict=True)]
            table[k][enter] = -factor
    pivot_row[enter] = common
    return pivot


def _weights(outside: list[int], gains: list[int], count: int, columns: int) -> list[int]:
    """Weights of the columns: the reduced costs of the slacks that have left the basis."""
    weights = [0] * columns
    for number, gain in zip(outside, gains, strict=False):
        if number >= count:
            weights[number - count] = gain
    return weights
