"""How long something may take that can be left out: it asks between its steps, however deep in it they are.

Nobody asks in vain: without `within` there is time for everything.
"""

import contextlib
import threading
import time
from collections.abc import Iterator

import numpy as np


class OutOfTime(Exception):
    """Something is not made, as that would take longer than it may."""


class _Until(threading.local):
    """When there is no more time, of `time.perf_counter`; of each thread."""

    value = np.inf


_UNTIL = _Until()


@contextlib.contextmanager
def within(seconds: float) -> Iterator[None]:
    """A block that may take so many seconds, and no longer than the one that it is in."""
    outer = _UNTIL.value
    _UNTIL.value = min(outer, time.perf_counter() + seconds)
    try:
        yield
    finally:
        _UNTIL.value = outer


def ask() -> None:
    """Go on if there is time.

    Raises:
        OutOfTime: there is none.
    """
    if time.perf_counter() > _UNTIL.value:
        raise OutOfTime
