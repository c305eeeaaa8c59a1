"""The one table of visibility: what each view cell may see, from the search to the bake folder."""

from dataclasses import dataclass, replace

import numpy as np

from .ragged import starts_of, take_lists
from .verdict import Verdict


@dataclass
class Rows:
    """Pairs of a view cell and a cell or object that is not proved hidden from it; a pair that is absent is hidden.

    Attributes:
        source: view cell, shape (n,), int64.
        target: reached cell, or object, shape (n,), int64.
        verdict: VISIBLE where there is a witness, else UNKNOWN, shape (n,), uint8.
        origin: of the witness, in the view cell [grid steps], shape (n, 3), float64; undefined where unknown.
        end: of the witness, on the target, likewise.
        portal_starts: portals that the witness of row r crosses are portals[portal_starts[r]:portal_starts[r + 1]],
            shape (n + 1,), int64; None where they are not listed.
        portals: int32, or None.
    """

    source: np.ndarray
    target: np.ndarray
    verdict: np.ndarray
    origin: np.ndarray
    end: np.ndarray
    portal_starts: np.ndarray | None = None
    portals: np.ndarray | None = None

    @classmethod
    def unseen(cls, source: np.ndarray, target: np.ndarray) -> "Rows":
        """Pairs without a witness."""
        count = len(source)
        unknown = np.full(count, Verdict.UNKNOWN, np.uint8)
        return cls(np.asarray(source, np.int64), np.asarray(target, np.int64), unknown, *np.zeros((2, count, 3)))

    @classmethod
    def join(cls, parts: "list[Rows]") -> "Rows":
        """All of some rows, in order, without their portals."""
        parts = [cls.unseen(np.zeros(0), np.zeros(0)), *parts]
        names = ("source", "target", "verdict")
        joined = cls.unseen(*np.zeros((2, sum(map(len, parts)))))
        joined.source, joined.target, joined.verdict = (
            np.concatenate([getattr(part, name) for part in parts]) for name in names
        )
        begin = 0
        for part in parts:
            for name in ("origin", "end"):
                points = getattr(part, name)
                # Zeros are there already, and take no memory as long as nobody writes them.
                if points.any():
                    getattr(joined, name)[begin : begin + len(part)] = points
            begin += len(part)
        return joined

    def __len__(self) -> int:
        return len(self.source)

    @property
    def seen(self) -> np.ndarray:
        """Rows that have a witness, shape (n,), bool."""
        return self.verdict == Verdict.VISIBLE

    def show(self, chosen: np.ndarray, origin: np.ndarray, end: np.ndarray) -> None:
        """Give the chosen rows these witnesses, in place."""
        self.verdict[chosen] = Verdict.VISIBLE
        self.origin[chosen], self.end[chosen] = origin, end

    def adopt(self, others: "Rows") -> None:
        """Show rows without a witness by those that others, ordered and all seen, have of the same pair, in place."""
        if len(others):
            span = 1 + max(int(self.target.max(initial=0)), int(others.target.max()))
            key, known = (rows.source * span + rows.target for rows in (self, others))
            at = np.searchsorted(known, key).clip(max=len(known) - 1)
            rows = np.flatnonzero(~self.seen & (known[at] == key))
            self.show(rows, others.origin[at[rows]], others.end[at[rows]])

    def take(self, chosen: np.ndarray) -> "Rows":
        """Some rows (indices or bool), with their portals."""
        out = Rows.unseen(self.source[chosen], self.target[chosen])
        out.verdict = self.verdict[chosen]
        # As in `join`.
        if self.origin.any() or self.end.any():
            out.origin, out.end = self.origin[chosen], self.end[chosen]
        if self.portal_starts is not None:
            out.portal_starts, places = take_lists(self.portal_starts, chosen)
            out.portals = self.portals[places]
        return out

    def order(self) -> "Rows":
        """Ordered by source, then target; itself if it is."""
        step = np.diff(self.source)
        if ((step > 0) | ((step == 0) & (np.diff(self.target) >= 0))).all():
            return self
        return self.take(np.lexsort((self.target, self.source)))

    def once(self) -> "Rows":
        """Ordered rows without those whose pair the row before has."""
        first = np.ones(len(self), bool)
        first[1:] = (np.diff(self.source) != 0) | (np.diff(self.target) != 0)
        return self.take(first)

    def with_portals(self, counts: np.ndarray, portals: np.ndarray) -> "Rows":
        """The same rows, each with so many of the portals."""
        return replace(self, portal_starts=starts_of(counts), portals=portals)

    def relabelled(self, places: np.ndarray) -> "Rows":
        """The rows with source c called places[c], and without those of sources whose place is -1."""
        kept = self.take(places[self.source] >= 0)
        return replace(kept, source=places[kept.source])
