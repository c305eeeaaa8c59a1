"""Keeping compiled libraries quiet where no option of theirs does."""

import contextlib
import os
import sys
from collections.abc import Iterator


@contextlib.contextmanager
def silenced(stream: int = 1) -> Iterator[None]:
    """No output of compiled libraries to stdout, or to stderr with 2, where the process has such a stream."""
    own = sys.stderr if stream == 2 else sys.stdout
    # What Python has written before is not the library's; a reader that has gone away is not its business either.
    with contextlib.suppress(AttributeError, OSError):
        own.flush()
    try:
        kept = os.dup(stream)
    except OSError:
        yield
        return
    try:
        with open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), stream)
        yield
    finally:
        os.dup2(kept, stream)
        os.close(kept)


def start_warp() -> None:
    """Start Warp without its greeting, and without its warning that there is no GPU, which no setting silences."""
    import warp

    warp.config.log_level = warp.LOG_WARNING
    with silenced(2):
        warp.init()
