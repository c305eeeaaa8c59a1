"""Who reads items while frames are drawn: on a simulated clock, always alike, or one thread in earnest.

Requests are immutable, and only the main thread changes what is resident. What has not been begun when a newer frame
asks is withdrawn: whoever asks later knows better. Source: Funkhouser et al. 1996, section 4.3.3.
"""

import math
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Protocol

from ...data.store.ranges import Range, ReadFailed, Source


@dataclass(frozen=True)
class Line:
    """What a disk or a network takes.

    Attributes:
        bytes_per_s: > 0.
        latency_s: before the first byte of a range, >= 0.
    """

    bytes_per_s: float
    latency_s: float = 0.0

    def seconds(self, wanted: Range) -> float:
        """Time to read a range."""
        return self.latency_s + wanted.size / self.bytes_per_s


@dataclass(frozen=True)
class Arrival:
    """A range that was read.

    Attributes:
        wanted: the range.
        data: its bytes; None if it did not come.
        why: it did not.
        seconds: that reading took.
    """

    wanted: Range
    data: bytes | None
    why: str
    seconds: float


class WallClock:
    """Seconds since the walk began."""

    def __init__(self) -> None:
        """It begins now."""
        self.begin()

    def begin(self) -> None:
        """It begins only now."""
        self._zero = time.monotonic()

    def now(self) -> float:
        """[s]."""
        return time.monotonic() - self._zero

    def wait_until(self, when: float) -> None:
        """Return no sooner [s]."""
        left = when - self.now()
        if left > 0:
            time.sleep(left)


class Reader(Protocol):
    """Reads ranges in order, one at a time."""

    def arrived(self, now: float) -> list[Arrival]:
        """What has been read by now [s], since the last call."""

    def withdraw(self) -> list[Range]:
        """Take back what has not been begun."""

    def ask(self, ranges: Sequence[Range], now: float) -> None:
        """Read these, after what has been begun."""

    def close(self) -> None:
        """Read no more."""


class SimulatedReader:
    """A line of which every range takes as long as it is said to take.

    What has arrived by the clock is read from the source then, however long that takes: the clock stands still.
    """

    def __init__(self, source: Source | None, line: Line) -> None:
        """Without a source no bytes come, but all arrives."""
        self._source, self._line = source, line
        self._waiting: list[Range] = []
        self._begun: tuple[Range, float] | None = None
        self._free_at = -math.inf

    def arrived(self, now: float) -> list[Arrival]:
        """What has been read by now [s], since the last call."""
        done = []
        while self._begun is not None and self._begun[1] <= now + 1e-9:
            done.append(self._read(self._begun[0]))
            self._next(self._begun[1])
        return done

    def withdraw(self) -> list[Range]:
        """Take back what has not been begun."""
        taken, self._waiting = self._waiting, []
        return taken

    def ask(self, ranges: Sequence[Range], now: float) -> None:
        """Read these, after what has been begun."""
        self._waiting += ranges
        if self._begun is None:
            self._next(max(now, self._free_at))

    def close(self) -> None:
        """Read no more."""
        self._waiting, self._begun = [], None

    def _next(self, begin: float) -> None:
        self._free_at, self._begun = begin, None
        if self._waiting:
            wanted = self._waiting.pop(0)
            self._begun = wanted, begin + self._line.seconds(wanted)

    def _read(self, wanted: Range) -> Arrival:
        seconds = self._line.seconds(wanted)
        if self._source is None:
            return Arrival(wanted, b"", "", seconds)
        try:
            return Arrival(wanted, self._source.read(wanted), "", seconds)
        except ReadFailed as error:
            return Arrival(wanted, None, str(error), seconds)


class ThreadReader:
    """One thread that reads; with a line, a source that is faster than it is slowed down to it."""

    def __init__(self, source: Source, clock: WallClock, line: Line | None = None) -> None:
        """Start the thread."""
        self._source, self._clock, self._line = source, clock, line
        self._waiting: list[Range] = []
        self._wake, self._stopped = threading.Condition(), False
        self._done: SimpleQueue[Arrival] = SimpleQueue()
        self._thread = threading.Thread(target=self._work, name="viewcell reader", daemon=True)
        self._thread.start()

    def arrived(self, now: float) -> list[Arrival]:
        """What has been read since the last call."""
        done = []
        while True:
            try:
                done.append(self._done.get_nowait())
            except Empty:
                return done

    def withdraw(self) -> list[Range]:
        """Take back what has not been begun."""
        with self._wake:
            taken, self._waiting = self._waiting, []
        return taken

    def ask(self, ranges: Sequence[Range], now: float) -> None:
        """Read these, after what has been begun."""
        self._source.expect(ranges)
        with self._wake:
            self._waiting += ranges
            self._wake.notify()

    def close(self) -> None:
        """End the thread, after what it reads."""
        with self._wake:
            self._stopped, self._waiting = True, []
            self._wake.notify()
        self._thread.join()

    def _work(self) -> None:
        while True:
            with self._wake:
                while not (self._waiting or self._stopped):
                    self._wake.wait()
                if self._stopped:
                    return
                wanted = self._waiting.pop(0)
            begun = self._clock.now()
            data, why = None, ""
            try:
                data = self._source.read(wanted)
            except ReadFailed as error:
                why = str(error)
            if self._line is not None:
                self._clock.wait_until(begun + self._line.seconds(wanted))
            self._done.put(Arrival(wanted, data, why, self._clock.now() - begun))
