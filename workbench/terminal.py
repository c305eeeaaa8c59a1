"""What commands say, and their exit codes: 0 done, nothing forbidden found; 130 interrupted."""

import contextlib
import logging
import os
import sys
from collections.abc import Iterator

from ..data.progress import LOG, heartbeat, shown

# A check failed; unusable input or arguments; interrupted.
FAILED, UNUSABLE, INTERRUPTED = 1, 2, 130


def say(text: str) -> None:
    """Print a result; a reader that has gone away changes neither the work nor the exit code."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        # Python flushes stdout once more at exit; that must not fail either.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def complain(message: str) -> None:
    """One line on stderr, whatever the message."""
    print(f"viewcell: {' '.join(message.split())}", file=sys.stderr)


@contextlib.contextmanager
def watched(verbose: bool = False, quiet: bool = False) -> Iterator[None]:
    """Say on stderr how far a command is: by bars on a terminal, else by lines.

    Args:
        verbose: lines in any case, about every phase.
        quiet: neither.
    """
    bars = sys.stderr.isatty() and not (verbose or quiet)
    with shown(bars), heartbeat():
        # Made only now: beside bars, stderr is what writes above them.
        handler, level = logging.StreamHandler(), LOG.level
        handler.setLevel(logging.DEBUG if verbose else logging.WARNING if quiet or bars else logging.INFO)
        LOG.addHandler(handler)
        LOG.setLevel(handler.level)
        try:
            yield
        finally:
            LOG.removeHandler(handler)
            LOG.setLevel(level)
