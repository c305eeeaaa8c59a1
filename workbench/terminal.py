"""What commands say, and their exit codes: 0 done, nothing forbidden found; 130 interrupted."""

import contextlib
import os
import sys
from collections.abc import Iterator

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
def silenced(stream: int = 1) -> Iterator[None]:
    """No output of compiled libraries to stdout, or to stderr with 2, where no option of theirs turns it off."""
    sys.stdout.flush()
    kept = os.dup(stream)
    try:
        with open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), stream)
        yield
    finally:
        os.dup2(kept, stream)
        os.close(kept)
