"""The memory of a walk, frame by frame: what has arrived, what is looked ahead to, asked for and given up."""

import time
from dataclasses import dataclass, replace

import numpy as np

from ...data.store.ranges import Range, items_in, ranges_of
from ...solvers.levels.benefit import NOTHING
from ...solvers.walk.cache import ABSENT, RESIDENT, Cache
from ...solvers.walk.policies import Now, Policy
from .reader import Line, Reader

# A solid-state disk reads this much in the time that another read costs.
GAP_BYTES = 16 * 1024
# Nothing of an object is there.
MISSING = -2
# A source that has failed so often in a row is asked no more: the walk goes on with what is there.
FAILURES_MOST = 3


@dataclass(frozen=True)
class Layout:
    """Where items lie in the file, and where they would at other sizes.

    Attributes:
        offsets: first byte of each item, int64.
        sizes: bytes of each, int64.
        real: whether these are those of the file.
    """

    offsets: np.ndarray
    sizes: np.ndarray
    real: bool


@dataclass(frozen=True)
class Stored:
    """A frame's memory.

    Attributes:
        drawn: level that each shown object is drawn at, MISSING where none is there, NOTHING where none was wanted.
        skipped: levels between those wanted and those drawn.
        missing: objects of which no level is there.
        resident: items that are there.
        ahead: items looked ahead to.
        read: items that were asked for.
        claimed: bytes of all that is there or asked for.
        reads: ranges asked for.
        read_bytes: of them.
        waste: bytes of them that lie between items.
        failed: ranges that did not come.
        swap_s: time that reading took, of what arrived since the frame before.
        seconds: of computing.
    """

    drawn: np.ndarray
    skipped: int
    missing: int
    resident: np.ndarray
    ahead: np.ndarray
    read: np.ndarray
    claimed: int
    reads: int
    read_bytes: int
    waste: int
    failed: int
    swap_s: float
    seconds: float


def gap_bytes(line: Line) -> int:
    """Bytes that come in the time that another read costs."""
    return max(GAP_BYTES, int(line.latency_s * line.bytes_per_s))


def urgent_first(items: np.ndarray, shown: np.ndarray, layout: Layout, gap: int) -> list[Range]:
    """Ranges of items; those that are shown now come first, and are not held up by what lies beside them.

    Others that lie between them come along.
    """
    urgent = np.isin(items, shown)
    first = ranges_of(items[urgent], layout.offsets, layout.sizes, gap)
    rest = items[~urgent]
    for place, one in enumerate(first):
        at = layout.offsets[rest]
        within = (at >= one.first) & (at + layout.sizes[rest] <= one.first + one.size)
        if within.any():
            along = rest[within]
            waste = one.waste - int(layout.sizes[along].sum())
            first[place] = replace(one, items=tuple(sorted({*one.items, *along.tolist()})), waste=waste)
            rest = rest[~within]
    return first + ranges_of(rest, layout.offsets, layout.sizes, gap)


class Memory:
    """Items that are there, by a policy."""

    def __init__(self, policy: Policy, layout: Layout, reader: Reader, line: Line, read_bytes: int) -> None:
        """Empty."""
        self.policy, self._layout, self._reader, self._read_bytes = policy, layout, reader, read_bytes
        shelves, capacity = policy.stock.shelves, policy.stock.capacity
        self._table, self._group = shelves.table, np.zeros(len(shelves.sizes), np.int64)
        shares = [1.0]
        if policy.near_share is not None:
            self._group, shares = policy.stock.second.astype(np.int64), [policy.near_share, 1 - policy.near_share]
        self.caches = [Cache(shelves.sizes, int(share * capacity), policy.bounded) for share in shares]
        self._gap = gap_bytes(line)
        # Bytes of resident items, where a source gives them.
        self.held: dict[int, bytes] = {}
        self.failures: dict[str, int] = {}
        self._going: list[int] = []
        self._in_flight, self._in_a_row = 0, 0

    @property
    def given_up(self) -> bool:
        """Whether nothing is asked for any more."""
        return self._in_a_row >= FAILURES_MOST

    def frame(self, number: int, now: Now, lods: np.ndarray, clock_s: float) -> Stored:
        """The next frame.

        Args:
            number: of the frame.
            now: the frame.
            lods: level that each shown object is to be drawn at, or NOTHING.
            clock_s: time of the walk [s].
        """
        begin = time.perf_counter()
        # What the frame before has drawn was there until it was.
        for item in self._going:
            self.held.pop(item, None)
        self._going = []
        failed, swap_s = self._take(clock_s)
        drawn = self.drawn(now.shown, lods)
        for wanted in self._reader.withdraw():
            self._forget(wanted.items)
            self._in_flight -= wanted.size
        ahead = self.policy.ahead(now, self._states() != ABSENT)
        read, left = [], 0 if self.given_up else self._read_bytes - self._in_flight
        for group, cache in enumerate(self.caches):
            change = cache.change(number, ahead[self._group[ahead] == group], left)
            left -= int(self._layout.sizes[change.read].sum())
            read.append(change.read)
            self._going += change.released.tolist()
        asked = np.concatenate(read)
        ranges = urgent_first(asked, now.urgent, self._layout, self._gap)
        self._in_flight += sum(wanted.size for wanted in ranges)
        self._reader.ask(ranges, clock_s)
        short = (drawn >= 0) & (drawn != lods)
        return Stored(
            drawn, int(np.abs(drawn - lods)[short].sum()), int((drawn == MISSING).sum()),
            np.flatnonzero(self.resident), ahead, asked, sum(cache.used for cache in self.caches), len(ranges),
            sum(wanted.size for wanted in ranges), sum(wanted.waste for wanted in ranges), failed, swap_s,
            time.perf_counter() - begin,
        )  # fmt: skip

    @property
    def resident(self) -> np.ndarray:
        """Whether each item is there, bool."""
        return self._states() == RESIDENT

    def _states(self) -> np.ndarray:
        """Of each item, in its own cache."""
        if len(self.caches) == 1:
            return self.caches[0].state
        return np.choose(self._group, [cache.state for cache in self.caches])

    def drawn(self, objects: np.ndarray, lods: np.ndarray) -> np.ndarray:
        """The level of each object that is there and nearest to what is wanted: coarser ones first, then finer ones."""
        items = self._table[objects]
        there = self.resident[items] & (items >= 0)
        levels = np.arange(items.shape[1])
        away = levels - lods[:, None]
        cost = np.where(there, np.where(away >= 0, away, len(levels) - away), 3 * len(levels))
        best = cost.argmin(axis=1) if len(objects) else np.zeros(0, np.int64)
        found = np.where(there.any(axis=1), best, MISSING)
        return np.where(lods == NOTHING, NOTHING, found)

    def _take(self, clock_s: float) -> tuple[int, float]:
        """Take what has arrived: ranges that did not come, and the time that reading took [s]."""
        failed, swap_s = 0, 0.0
        for arrival in self._reader.arrived(clock_s):
            wanted, swap_s = arrival.wanted, swap_s + arrival.seconds
            self._in_flight -= wanted.size
            self._in_a_row = self._in_a_row + 1 if arrival.data is None else 0
            if arrival.data is None:
                failed += 1
                self.failures[arrival.why] = self.failures.get(arrival.why, 0) + 1
                self._forget(wanted.items)
                continue
            for group, cache in enumerate(self.caches):
                items = np.array(wanted.items, np.int64)
                cache.arrive(items[self._group[items] == group])
            if self._layout.real and arrival.data:
                self.held |= items_in(wanted, arrival.data, self._layout.offsets, self._layout.sizes)
        return failed, swap_s

    def _forget(self, wanted: tuple[int, ...]) -> None:
        items = np.array(wanted, np.int64)
        for group, cache in enumerate(self.caches):
            cache.forget(items[self._group[items] == group])
