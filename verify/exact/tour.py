"""Orders of columns of bits by trying them all: the referee of tours.

Columns are integers, bit r for row r. A closed tour that begins with the column 0 is twice as long as its rows have
runs of ones.
"""

from collections.abc import Sequence
from itertools import pairwise

MOST = 12


def as_columns(rows: Sequence[str]) -> list[int]:
    """Columns of rows of the characters 0 and 1."""
    return [sum(1 << r for r, row in enumerate(rows) if row[k] == "1") for k in range(len(rows[0]))]


def runs(rows: Sequence[str], order: Sequence[int]) -> int:
    """Runs of ones in the rows, where their characters stand in an order."""
    return sum(len("".join(row[k] for k in order).replace("0", " ").split()) for row in rows)


def length(columns: Sequence[int], order: Sequence[int]) -> int:
    """Bits in which neighbours of a closed tour differ."""
    return sum((columns[a] ^ columns[b]).bit_count() for a, b in pairwise([*order, *order[:1]]))


def nearest(columns: Sequence[int], most: int) -> list[list[int]]:
    """The columns that differ least from each, nearest first, of equals the lower number."""
    found = []
    for here, column in enumerate(columns):
        others = [((column ^ other).bit_count(), k) for k, other in enumerate(columns) if k != here]
        found.append([k for _, k in sorted(others)[:most]])
    return found


def least_runs(columns: Sequence[int]) -> int:
    """The fewest runs that rows can have, over all orders of the columns: dynamic programming over their subsets.

    Raises:
        ValueError: more than 12 columns.
    """
    if len(columns) > MOST:
        raise ValueError(f"expected at most {MOST} columns, found {len(columns)}")
    # Shortest way from nothing through a subset of columns, that ends with one of them.
    best = {(1 << k, k): column.bit_count() for k, column in enumerate(columns)}
    for _ in range(len(columns) - 1):
        longer: dict[tuple[int, int], int] = {}
        for (done, here), way in best.items():
            for k, column in enumerate(columns):
                if not done >> k & 1:
                    found = way + (columns[here] ^ column).bit_count()
                    key = done | 1 << k, k
                    longer[key] = min(found, longer.get(key, found))
        best = longer
    return min((way + columns[here].bit_count() for (_, here), way in best.items()), default=0) // 2


def shorter(columns: Sequence[int], order: Sequence[int], segment: int) -> list[int] | None:
    """A shorter tour that is a step away, None if there is none.

    Steps are 2-opt, a part turned round; and Or-opt, up to `segment` columns put elsewhere, either way round, where the
    first of them comes beside a column that is nearer than the one that it leaves.
    """
    now, count = length(columns, order), len(order)
    for begin in range(count):
        for end in range(begin + 2, count + 1):
            tried = [*order[:begin], *reversed(order[begin:end]), *order[end:]]
            if length(columns, tried) < now:
                return tried
    for turned in (list(order), list(reversed(order))):
        for begin in range(count):
            around = turned[begin:] + turned[:begin]
            for size in range(1, min(segment, count - 3) + 1):
                moved, left = around[:size], around[size:]
                was = (columns[left[-1]] ^ columns[moved[0]]).bit_count()
                for at in range(1, len(left)):
                    for part, beside in ((moved, left[at - 1]), (moved[::-1], left[at])):
                        tried = left[:at] + part + left[at:]
                        nearer = (columns[beside] ^ columns[moved[0]]).bit_count() < was
                        if nearer and length(columns, tried) < now:
                            return tried
    return None
