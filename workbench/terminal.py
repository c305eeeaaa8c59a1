"""What commands say, and their exit codes: 0 done, nothing forbidden found; 130 interrupted."""

import os
import sys

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
