"""Readers: the simulated one keeps time, the thread loses nothing, and what is not begun can be withdrawn."""

import threading

import pytest
from viewcell.data.store.ranges import Range, ReadFailed
from viewcell.workbench.walk.reader import Line, SimulatedReader, ThreadReader, WallClock

WAIT_S = 20.0


class Source:
    """Bytes that say where they are from; some fail, and all wait while the gate is shut."""

    def __init__(self, failing=()):
        self.failing, self.expected, self.read_at = failing, [], []
        self.gate, self.entered = threading.Event(), threading.Semaphore(0)
        self.gate.set()

    def expect(self, ranges):
        self.expected += ranges

    def read(self, wanted):
        self.entered.release()
        assert self.gate.wait(WAIT_S)
        self.read_at.append(wanted.first)
        if wanted.first in self.failing:
            raise ReadFailed("gone")
        return bytes([wanted.first % 256]) * wanted.size

    def close(self):
        pass


def ranges(*sizes):
    return [Range(k, size, (k,), 0) for k, size in enumerate(sizes)]


def firsts(arrivals):
    return [arrival.wanted.first for arrival in arrivals]


def test_a_simulated_line_takes_its_time():
    reader = SimulatedReader(Source(), Line(bytes_per_s=100.0, latency_s=0.5))
    reader.ask(ranges(50, 100), 0.0)
    # Half a second and half a second; then half and one.
    assert reader.arrived(0.99) == [] and firsts(reader.arrived(1.0)) == [0]
    assert reader.arrived(2.49) == []
    (last,) = reader.arrived(2.5)
    assert last.wanted.first == 1 and last.data == b"\x01" * 100 and last.seconds == 1.5
    # It was idle until it is asked again.
    reader.ask(ranges(50), 9.0)
    assert reader.arrived(9.99) == [] and firsts(reader.arrived(10.0)) == [0]


def test_what_was_begun_comes_and_the_rest_is_withdrawn():
    reader = SimulatedReader(None, Line(100.0))
    reader.ask(ranges(100, 100, 100), 0.0)
    assert firsts(reader.arrived(1.5)) == [0]
    assert [one.first for one in reader.withdraw()] == [2]
    reader.ask([Range(7, 100, (7,), 0)], 1.5)
    assert firsts(reader.arrived(3.0)) == [1, 7] and reader.withdraw() == []
    # Without a source all arrives, and nothing is in it.
    reader.ask(ranges(1), 3.0)
    assert reader.arrived(99.0)[0].data == b""
    reader.ask(ranges(1), 99.0)
    reader.close()
    assert reader.arrived(999.0) == []


@pytest.mark.parametrize("kind", ["simulated", "thread"])
def test_failures_are_told_and_the_next_one_is_read(kind):
    source = Source(failing=(1,))
    reader = SimulatedReader(source, Line(1e9)) if kind == "simulated" else ThreadReader(source, WallClock())
    reader.ask(ranges(4, 4, 4), 0.0)
    found = []
    clock = WallClock()
    while len(found) < 3 and clock.now() < WAIT_S:
        found += reader.arrived(100.0)
    reader.close()
    assert firsts(found) == [0, 1, 2]
    assert [one.data for one in found] == [b"\x00" * 4, None, b"\x02" * 4] and found[1].why == "gone"


def test_a_thread_reads_what_is_not_withdrawn_and_ends():
    source = Source()
    source.gate.clear()
    reader = ThreadReader(source, WallClock())
    reader.ask(ranges(4, 4, 4), 0.0)
    assert source.entered.acquire(timeout=WAIT_S)
    # The first one is being read.
    assert [one.first for one in reader.withdraw()] == [1, 2] and reader.arrived(0.0) == []
    reader.ask([Range(9, 4, (9,), 0)], 0.0)
    source.gate.set()
    found, clock = [], WallClock()
    while len(found) < 2 and clock.now() < WAIT_S:
        found += reader.arrived(0.0)
    assert firsts(found) == [0, 9] and [one.first for one in source.expected] == [0, 1, 2, 9]
    reader.close()
    assert not any(thread.name == "viewcell reader" for thread in threading.enumerate())


def test_a_line_slows_a_thread_down():
    clock = WallClock()
    reader = ThreadReader(Source(), clock, Line(1e9, latency_s=0.05))
    reader.ask(ranges(1, 1), 0.0)
    found = []
    while len(found) < 2 and clock.now() < WAIT_S:
        found += reader.arrived(0.0)
    reader.close()
    assert clock.now() >= 0.1 and all(one.seconds >= 0.05 for one in found)
