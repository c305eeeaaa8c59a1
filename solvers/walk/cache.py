"""The memory that items are held in: what to read, and what to give up for it.

Memory is claimed when an item is asked for, not when it arrives, so that what is held never exceeds the cache. Given up
is what has least recently been looked ahead to.

Source: Funkhouser et al. 1996, section 4.3.2 (read set, release set).
"""

from dataclasses import dataclass

import numpy as np

ABSENT, ASKED, RESIDENT = 0, 1, 2


@dataclass(frozen=True)
class Change:
    """What a frame changes.

    Attributes:
        read: items to ask for, the most wanted first, int64.
        released: items that are given up for them, int64.
    """

    read: np.ndarray
    released: np.ndarray


class Cache:
    """Items by state, and the bytes that they claim.

    Attributes:
        sizes: bytes of each item, int64.
        capacity: bytes.
        state: ABSENT, ASKED or RESIDENT, of each item, uint8.
        used: bytes of all that is not absent.
    """

    def __init__(self, sizes: np.ndarray, capacity: int, bounded: bool = True) -> None:
        """Empty; one that is not bounded takes what is looked ahead to although it does not fit, as published."""
        self.sizes, self.capacity, self._bounded = sizes, capacity, bounded
        self.state, self.used = np.zeros(len(sizes), np.uint8), 0
        # Frame in which an item was last looked ahead to, and its place among those.
        self._stamp, self._place = np.full(len(sizes), -1), np.zeros(len(sizes), np.int64)

    @property
    def resident(self) -> np.ndarray:
        """Whether each item is there, bool."""
        return self.state == RESIDENT

    def change(self, frame: int, wanted: np.ndarray, most_bytes: int) -> Change:
        """Claim memory for the first of the wanted items that are absent, and give up others for it.

        Args:
            frame: ascending from call to call.
            wanted: items looked ahead to, each once, the most wanted first, int64; none of them is given up.
            most_bytes: that may be asked for now; if any, the first item may be larger.
        """
        self._stamp[wanted], self._place[wanted] = frame, np.arange(len(wanted))
        absent = wanted[self.state[wanted] == ABSENT] if most_bytes > 0 else wanted[:0]
        ends = np.cumsum(self.sizes[absent])
        read = absent[: max(int(np.searchsorted(ends, most_bytes, "right")), 1)]
        need = self.used + np.cumsum(self.sizes[read]) - self.capacity
        released = np.zeros(0, np.int64)
        if len(read) and need[-1] > 0:
            old = np.flatnonzero(self.resident & (self._stamp < frame))
            old = old[np.lexsort((-self._place[old], self._stamp[old]))]
            freed = np.cumsum(self.sizes[old])
            if self._bounded:
                read = read[: int(np.searchsorted(need, freed[-1] if len(old) else 0, "right"))]
            short = need[len(read) - 1] if len(read) else 0
            released = old[: int(np.searchsorted(freed, short)) + 1] if short > 0 else released
        self._set(released, ABSENT)
        self._set(read, ASKED)
        return Change(read, released)

    def arrive(self, items: np.ndarray) -> None:
        """Items that were asked for are there."""
        self.state[items] = RESIDENT

    def forget(self, items: np.ndarray) -> None:
        """Items that were asked for will not come: what they claim is free."""
        self._set(items, ABSENT)

    def _set(self, items: np.ndarray, state: int) -> None:
        size = int(self.sizes[items].sum())
        self.used += size if state == ASKED else -size
        self.state[items] = state
