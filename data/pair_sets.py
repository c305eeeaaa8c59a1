"""Sets of targets, one for each cell, as the pairs that are in them: what is hidden takes no memory."""

from dataclasses import dataclass

import numpy as np

from .ragged import owners_of, places_of, starts_of


@dataclass(frozen=True)
class PairSets:
    """For each row the targets in its set.

    Attributes:
        starts: members of row r are members[starts[r]:starts[r + 1]], shape (rows + 1,), int64.
        members: targets, ascending in each row and once, int64.
        count: of all targets.
        whole: rows that hold every target, whatever their members, shape (rows,), bool.
        shared: targets that every row in `sharing` holds beside its members, shape (count,), bool.
        sharing: those rows, shape (rows,), bool.
    """

    starts: np.ndarray
    members: np.ndarray
    count: int
    whole: np.ndarray
    shared: np.ndarray
    sharing: np.ndarray

    @classmethod
    def of(cls, pairs: tuple[np.ndarray, np.ndarray], shape: tuple[int, int]) -> "PairSets":
        """Sets of pairs (row, target), in any order; one that comes twice counts once."""
        rows, count = shape
        # Below 2**62: ids are int32.
        keys = np.unique(np.asarray(pairs[0], np.int64) * max(count, 1) + pairs[1])
        row, member = np.divmod(keys, max(count, 1))
        nothing = np.zeros(rows, bool)
        return cls(np.searchsorted(row, np.arange(rows + 1)), member, count, nothing, np.zeros(count, bool), nothing)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and targets."""
        return len(self.starts) - 1, self.count

    @property
    def sizes(self) -> np.ndarray:
        """Number of targets in each row, shape (rows,), int64."""
        own = np.diff(self.starts)
        if self.shared.any():
            twice = np.bincount(owners_of(self.starts), self.shared[self.members], len(own)).astype(np.int64)
            own = np.where(self.sharing, own - twice + self.shared.sum(), own)
        return np.where(self.whole, self.count, own)

    def __getitem__(self, rows: "int | np.ndarray") -> np.ndarray:
        """One row, shape (targets,), or some, shape (n, targets), as bool; rows as ids, not as a mask."""
        if np.ndim(rows) == 0:
            return self[np.array([rows])][0]
        sizes = np.diff(self.starts)[rows]
        out = np.zeros((len(rows), self.count), bool)
        out[np.repeat(np.arange(len(rows)), sizes), self.members[places_of(self.starts[rows], sizes)]] = True
        out[np.ix_(np.flatnonzero(self.sharing[rows]), np.flatnonzero(self.shared))] = True
        out[self.whole[rows]] = True
        return out

    def has(self, row: int, target: int) -> bool:
        """Whether a target is in a row's set."""
        own = self.members[self.starts[row] : self.starts[row + 1]]
        place = np.searchsorted(own, target)
        listed = place < len(own) and own[place] == target
        return bool(listed or self.whole[row] or (self.sharing[row] and self.shared[target]))

    def lists(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Starts, shape (n + 1,), and targets of some rows, ascending in each, int64."""
        if not (self.shared.any() or self.whole.any()):
            sizes = np.diff(self.starts)[rows]
            return starts_of(sizes), self.members[places_of(self.starts[rows], sizes)]
        some = self[rows]
        return starts_of(some.sum(axis=1)), np.nonzero(some)[1]
