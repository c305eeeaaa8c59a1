"""What is said of long work: to a log, and on a screen."""

import io
import logging

import pytest
from viewcell.data import progress
from viewcell.data.progress import Phase, begin, heartbeat, phase, shown, track


@pytest.fixture
def clock(monkeypatch):
    """A clock that stands until it is set."""

    class Clock:
        now = 100.0

        def __call__(self):
            return self.now

    clock = Clock()
    monkeypatch.setattr(progress.time, "perf_counter", clock)
    return clock


@pytest.fixture
def lines(caplog):
    caplog.set_level(logging.DEBUG, "viewcell")
    return lambda level: [r.getMessage() for r in caplog.records if r.levelno == level]


def test_each_phase_is_a_line(clock, lines):
    with phase("read"):
        clock.now += 2
    with phase("visibility", 3, "cell") as bar:
        for _ in range(3):
            clock.now += 4
            bar.update()
    assert lines(logging.INFO) == ["read: 2.0 s", "visibility: 3 of 3 cells in 12.0 s"]
    assert list(track([7, 8], "two", "item")) == [7, 8]
    assert lines(logging.DEBUG) == ["two: 2 of 2 items in 0.0 s"]


def test_a_long_phase_says_how_far_it_is(clock, lines):
    with phase("visibility", 100, "cell") as bar:
        for _ in range(20):
            clock.now += 3
            bar.update()
        assert lines(logging.INFO) == [
            "visibility: 10 of 100 cells in 30.0 s, about 270 s left",
            "visibility: 20 of 100 cells in 60.0 s, about 240 s left",
        ]


def test_what_is_done_once_within_a_phase_does_not_lengthen_the_rest(clock, lines):
    with phase("visibility", 10, "cell") as bar:
        with phase("curtains"):
            clock.now += 50
        clock.now += 2
        bar.update()
        assert bar.left_s == 18 and bar.seconds == 52
    assert lines(logging.DEBUG) == ["curtains: 50.0 s"]
    assert lines(logging.INFO)[0] == "visibility: 1 of 10 cells in 52.0 s, about 18 s left"


def test_what_others_are_at_counts_as_begun(clock):
    with phase("visibility", 12, "cell") as bar:
        clock.now += 6
        bar.under_way = 1
        bar.update(2)
        assert bar.left_s == 18
        bar.under_way = 0
        bar.update(2)
        assert bar.left_s == 12


def test_nothing_known_nothing_said(clock):
    assert Phase("read").left_s is None and Phase("read", 5, "file").left_s is None
    more = Phase("cells", 1, "cell")
    more.update()
    more.grow(3)
    clock.now += 1
    assert (more.done, more.total, more.left_s) == (1, 4, 3)
    assert more.line() == "cells: 1 of 4 cells in 1.0 s, about 3 s left"
    more.note = "halved"
    assert more.line().endswith("(halved)")


def test_a_phase_that_fails_is_over(clock, lines):
    with pytest.raises(ValueError, match="no"), phase("outer"):
        begin("left open")
        clock.now += 5
        raise ValueError("no")
    with phase("next"):
        clock.now += 5
    assert [line.split(":")[0] for line in lines(logging.INFO)] == ["outer", "next"]


def test_bars_show_what_goes_on_and_leave_nothing(monkeypatch):
    from rich.console import Console

    screen = io.StringIO()
    monkeypatch.setattr("rich.console.Console", lambda **_: Console(file=screen, force_terminal=True, width=120))
    with shown(), shown():
        with phase("visibility", 40, "cell") as bar:
            bar.note = "halving"
            bar.update(10)
            progress._OPEN.screen.refresh()
            with phase("curtains", 3, "element"):
                progress._OPEN.screen.refresh()
        assert len(progress._OPEN.screen.tasks) == 1
    text = screen.getvalue()
    assert "10 of 40 cells" in text and "s left (halving)" in text and "0 of 3 elements" in text
    assert progress._OPEN.screen is None
    with shown(False), phase("quiet"):
        assert progress._OPEN.screen is None


def test_the_heart_beats_without_updates(monkeypatch, lines):
    monkeypatch.setattr(progress, "EVERY_S", 0.02)
    with heartbeat(), phase("compile") as bar:
        deadline = bar.seconds + 10
        while len(lines(logging.INFO)) < 2 and bar.seconds < deadline:
            pass
    assert lines(logging.INFO)[0].startswith("compile: 0.")
