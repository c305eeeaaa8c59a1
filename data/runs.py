"""Sets as runs of consecutive ids in a variable-length code: how sets of visible things are stored.

A run is two numbers: its gap, the ids left out before it (between two runs one less, as there is at least one), and its
length less 1. Numbers are LEB128: seven bits a byte, the low ones first, the high bit of each byte but the last is set.

    {}        (empty)        {7}              07 00
    {0}       00 00          {0 ... 299}      00 ab 02
    {0, 1, 2, 7, 8, 20}      00 02 03 01 0a 00

A set has one code: a number in more bytes than it needs is refused. Short where ids that come together are neighbours
(solvers/tour.py). Source: Chhugani et al. 2005, section 6.2, codes pairs of offset and run, too, by bits.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .errors import InputError
from .ragged import owners_of, places_of, starts_of

# Ids are int32: numbers of more bytes are none.
MOST_BYTES = 5
ID_LIMIT = 2**31


@dataclass(frozen=True)
class RunSets:
    """Sets as runs, in order.

    Attributes:
        starts: runs of set s are starts[s]:starts[s + 1], shape (sets + 1,), int64.
        first: first id of each run, int64.
        length: ids in it, at least 1, int64; no run touches the next one of its set.
    """

    starts: np.ndarray
    first: np.ndarray
    length: np.ndarray

    def __len__(self) -> int:
        return len(self.starts) - 1

    def of(self, row: int) -> np.ndarray:
        """Ids in a set, ascending, int64."""
        runs = slice(self.starts[row], self.starts[row + 1])
        return places_of(self.first[runs], self.length[runs])

    def ids(self) -> tuple[np.ndarray, np.ndarray]:
        """Starts of the sets, shape (sets + 1,), and the ids of all of them, ascending in each, both int64."""
        sizes = starts_of(self.length)[self.starts]
        return sizes, places_of(self.first, self.length)


def find_runs(starts: np.ndarray, ids: np.ndarray) -> RunSets:
    """Runs of sets: set s is ids[starts[s]:starts[s + 1]], ascending and each id once.

    Raises:
        InputError: ids that are not so, or below 0 or from 2**31 on.
    """
    starts, ids = np.asarray(starts, np.int64), np.asarray(ids, np.int64)
    if len(ids) and not (0 <= ids.min() and ids.max() < ID_LIMIT):
        raise InputError(f"sets: expected ids from 0 to {ID_LIMIT - 1}, found {ids.min()} to {ids.max()}")
    heads = starts[:-1][np.diff(starts) > 0]
    step = np.diff(ids, prepend=-1)
    begins, ascending = step != 1, step > 0
    begins[heads], ascending[heads] = True, True
    if not ascending.all():
        raise InputError("sets: expected ids that ascend within each set, found others")
    rows = np.flatnonzero(begins)
    return RunSets(np.searchsorted(rows, starts), ids[rows], np.diff(np.append(rows, len(ids))))


def encode(starts: np.ndarray, ids: np.ndarray) -> list[bytes]:
    """The code of each set; set s is ids[starts[s]:starts[s + 1]], ascending.

    Raises:
        InputError: ids that do not ascend, or are no int32.
    """
    runs = find_runs(starts, ids)
    later = np.ones(len(runs.first), bool)
    later[runs.starts[:-1][np.diff(runs.starts) > 0]] = False
    before = np.append(0, (runs.first + runs.length)[:-1])
    gap = runs.first - np.where(later, before + 1, 0)
    code, sizes = _numbers_as_bytes(np.column_stack([gap, runs.length - 1]).ravel())
    ends = starts_of(sizes)[2 * runs.starts]
    whole = code.tobytes()
    return [whole[a:b] for a, b in pairwise(ends.tolist())]


def decode(codes: Sequence[bytes], count: int) -> RunSets:
    """The sets of some codes, all at once.

    Args:
        codes: of `encode`.
        count: ids are below this.

    Raises:
        InputError: a code that no set has, or that has an id too large.
    """
    return decode_bytes(np.frombuffer(b"".join(codes), np.uint8), starts_of([len(code) for code in codes]), count)


def decode_bytes(code: np.ndarray, starts: np.ndarray, count: int) -> RunSets:
    """As `decode`, of codes one after the other: that of set s is code[starts[s]:starts[s + 1]], uint8."""
    numbers, at = _bytes_as_numbers(code, starts)
    if (at % 2).any():
        raise InputError(f"runs: expected a gap and a length for each run, found set {_first_of(at % 2)} cut short")
    gap, length, runs = numbers[0::2], numbers[1::2] + 1, at // 2
    filled = runs[:-1][np.diff(runs) > 0]
    step = gap + length + 1
    step[filled] -= 1
    ends = np.cumsum(step)
    # What all sets before have come to is taken off again.
    base = np.append(0, ends)[runs[:-1]]
    ends -= np.repeat(base, np.diff(runs))
    if len(ends) and ends.max() > count:
        row = owners_of(runs)[np.argmax(ends > count)]
        raise InputError(f"runs: expected ids below {count}, found {ends.max() - 1} in set {row}")
    return RunSets(runs, ends - length, length)


def _first_of(odd: np.ndarray) -> int:
    """The set that ends where a mark, one at each end of a set, first is odd."""
    return int(np.flatnonzero(odd)[0]) - 1


def _numbers_as_bytes(numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """LEB128 of numbers below 2**35: all bytes, uint8, and how many each takes."""
    sizes = 1 + sum((numbers >= 1 << bits).astype(np.int64) for bits in (7, 14, 21, 28))
    place = places_of(0, sizes)
    out = np.repeat(numbers, sizes) >> 7 * place & 0x7F
    out[place < np.repeat(sizes, sizes) - 1] |= 0x80
    return out.astype(np.uint8), sizes


def _bytes_as_numbers(code: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of LEB128 bytes, int64, and how many come before each of the byte places `starts`.

    Raises:
        InputError: a number that goes on beyond the end of its set, or is longer than any, or than it need be.
    """
    # Ends of numbers, behind one before the first byte.
    last = np.append(-1, np.flatnonzero(code < 0x80))
    at = np.searchsorted(last[1:], starts)
    ended = last[at] == starts - 1
    if not ended.all():
        raise InputError(f"runs: expected numbers that end with their set, found set {_first_of(~ended)} cut short")
    sizes, last = np.diff(last), last[1:]
    if len(sizes) and (sizes.max() > MOST_BYTES or (code[last[sizes > 1]] == 0).any()):
        raise InputError(f"runs: expected numbers in the fewest bytes, {MOST_BYTES} at most, found others")
    numbers = (code[last] & 0x7F).astype(np.int64)
    # The last byte is the highest: lower ones come in below it.
    for k in range(1, int(sizes.max(initial=0))):
        longer = np.flatnonzero(sizes > k)
        numbers[longer] = numbers[longer] << 7 | code[last[longer] - k] & 0x7F
    return numbers, at
