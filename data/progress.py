"""How far long work is: lines in a log for whoever keeps one, bars on a terminal for whoever watches.

The logger is called `viewcell`. Each phase is a line at INFO when it ends, and one every EVERY_S while it lasts; phases
within a phase, and short ones, are lines at DEBUG. Bars are for the terminal behind stderr, and only inside `shown`.
"""

import contextlib
import logging
import threading
import time
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, TypeVar

from .plural import counted

if TYPE_CHECKING:
    from rich.progress import Progress

LOG = logging.getLogger("viewcell")
# Seconds between two lines about the same phase.
EVERY_S = 30.0
# A phase that is over sooner is told of at DEBUG.
LEAST_S = 1.0

Item = TypeVar("Item")


class _Open(threading.local):
    """What is going on in a thread: its phases, the innermost last, and the screen that shows them."""

    def __init__(self) -> None:
        self.phases: list[Phase] = []
        self.screen: Progress | None = None


_OPEN = _Open()


def open_here() -> "tuple[list[Phase], Progress | None]":
    """What is going on in this thread, for `go_on` in another one."""
    return list(_OPEN.phases), _OPEN.screen


def go_on(found: "tuple[list[Phase], Progress | None]") -> None:
    """Let phases of this thread be within those of the one that has begun it."""
    _OPEN.phases, _OPEN.screen = list(found[0]), found[1]


class Phase:
    """A phase of some work, counted in units of it where these are known.

    Attributes:
        name: what is being done.
        total: units in all; None where it is not known.
        unit: what is counted, in the singular; "" where nothing is.
        done: units done.
        under_way: units done of what is begun beside that and not over, as far as can be guessed.
        note: what else there is to say.
    """

    def __init__(self, name: str, total: float | None = None, unit: str = "") -> None:
        self.name, self.total, self.unit, self.note = name, total, unit, ""
        self.done = self.under_way = 0.0
        self._started = self._said = time.perf_counter()
        # What phases within this one take is not what its own units take: the first unit often prepares for all.
        self._within = 0.0
        self._screen, self._task = _OPEN.screen, None
        if self._screen is not None:
            self._task = self._screen.add_task(name, total=total, phase=self)

    @property
    def seconds(self) -> float:
        """Since it began."""
        return time.perf_counter() - self._started

    @property
    def left_s(self) -> float | None:
        """Seconds that it should still take, as its own units took; None where that cannot be said."""
        if not self.total or not 0 < self.done:
            return None
        so_far = self.done + self.under_way
        return max(0.0, self.seconds - self._within) / so_far * max(0.0, self.total - so_far)

    def update(self, more: float = 1) -> None:
        """Count units as done."""
        self.reach(self.done + more)

    def reach(self, done: float) -> None:
        """Say how many units are done in all."""
        self.done = done
        if self._screen is not None:
            self._screen.update(self._task, completed=done, total=self.total)
        for outermost in _OPEN.phases[:1]:
            outermost.beat()

    def grow(self, more: float) -> None:
        """Add units to the total."""
        self.total = (self.total or 0) + more
        self.reach(self.done)

    def beat(self) -> None:
        """Say in the log how far it is, if that was last said EVERY_S ago."""
        if time.perf_counter() - self._said >= EVERY_S:
            self._said = time.perf_counter()
            LOG.info("%s", self.line())

    def line(self) -> str:
        """Name, what is done of what, since when, until when."""
        count = ""
        if self.unit and self.total:
            count = f" {self.done:,.0f} of {self.units()} in"
        left = self.left_s
        more = f", about {left:,.0f} s left" if left and self.done < (self.total or 0) else ""
        return f"{self.name}:{count} {self.seconds:,.1f} s{more}{f' ({self.note})' if self.note else ''}"

    def units(self) -> str:
        """The total in words."""
        return counted(round(self.total), self.unit, self.unit if self.unit == "%" else "")

    def end(self) -> None:
        """Say that it is over; once."""
        if self not in _OPEN.phases:
            return
        while _OPEN.phases.pop() is not self:
            pass
        outer = bool(_OPEN.phases)
        if outer:
            _OPEN.phases[-1]._within += self.seconds
        LOG.log(logging.DEBUG if outer or self.seconds < LEAST_S else logging.INFO, "%s", self.line())
        if self._screen is not None:
            if outer:
                self._screen.remove_task(self._task)
            else:
                # A phase that counts nothing is done when it ends.
                self._screen.update(self._task, total=self.total or 1, completed=self.done or self.total or 1)


def begin(name: str, total: float | None = None, unit: str = "") -> Phase:
    """Begin a phase, within the one that is going on; `end` ends it."""
    phase = Phase(name, total, unit)
    _OPEN.phases.append(phase)
    return phase


@contextlib.contextmanager
def phase(name: str, total: float | None = None, unit: str = "") -> Iterator[Phase]:
    """A phase for the length of a block."""
    found = begin(name, total, unit)
    try:
        yield found
    finally:
        found.end()


def track(items: Iterable[Item], name: str, unit: str, total: int | None = None) -> Iterator[Item]:
    """Items one by one, as units of a phase.

    Args:
        items: what to go through.
        name: of the phase.
        unit: what an item is, in the singular.
        total: how many there are, for those without a length.
    """
    with phase(name, len(items) if total is None else total, unit) as bar:
        for item in items:
            yield item
            bar.update()


@contextlib.contextmanager
def shown(show: bool = True) -> Iterator[None]:
    """Bars on stderr for the phases of a block; within another such block, those of that one."""
    if not show or _OPEN.screen is not None:
        yield
        return
    with bars() as _OPEN.screen:
        try:
            yield
        finally:
            _OPEN.screen = None


def bars() -> "Progress":
    """A live display of phases on stderr, which leaves nothing behind."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeElapsedColumn
    from rich.text import Text

    class Count(ProgressColumn):
        def render(self, task: Task) -> Text:
            shown = task.fields["phase"]
            known = shown.unit and shown.total
            return Text(f"{shown.done:,.0f} of {shown.units()}" if known else "")

    class Left(ProgressColumn):
        def render(self, task: Task) -> Text:
            shown = task.fields["phase"]
            left = None if task.finished else shown.left_s
            note = f" ({shown.note})" if shown.note and not task.finished else ""
            return Text(("" if left is None else f"{left:,.0f} s left") + note)

    columns = TextColumn("{task.description}"), BarColumn(), Count(), TimeElapsedColumn(), Left()
    return Progress(*columns, console=Console(stderr=True), transient=True)


@contextlib.contextmanager
def heartbeat() -> Iterator[None]:
    """Lines every EVERY_S also about phases of this thread that count nothing, or stay long at one unit."""
    phases, over = _OPEN.phases, threading.Event()

    def beat() -> None:
        while not over.wait(EVERY_S / 10):
            for last in phases[:1]:
                last.beat()

    thread = threading.Thread(target=beat, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
