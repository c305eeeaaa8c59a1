"""The command line: arguments in, an exit code out. The commands themselves are in `commands`, imported when one runs.

Exit 0: done, nothing forbidden found; 1: a check failed; 2: unusable input or arguments; 130: interrupted.
"""

import sys
from collections.abc import Sequence

from ..data.errors import InputError
from ..data.extras import missing
from .options.parser import parser
from .terminal import INTERRUPTED, UNUSABLE, complain, say, watched

# What `tune` tunes; a model in their place means the first.
SOLVERS = ("bake", "projection-point", "lod")


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and say what came of it.

    Args:
        argv: arguments after the program's name; by default those of the process.

    Returns:
        The exit code. What the user can mend, a full disk and a lack of memory are one line on stderr.
    """
    try:
        options = parser().parse_args(_with_solver(sys.argv[1:] if argv is None else argv))
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else 0
    try:
        from . import commands

        with watched(options.verbose, options.quiet):
            return getattr(commands, options.run)(options)
    except KeyboardInterrupt:
        complain("interrupted")
        return INTERRUPTED
    except Exception as error:
        told = _told(error)
        if told is None:
            raise
    complain(told)
    if options.json is True:
        from .results import as_json

        say(as_json(options.run, UNUSABLE, error=" ".join(told.split())))
    return UNUSABLE


def _told(error: Exception) -> str | None:
    """What the user can mend, in words; None for what is a fault of ours."""
    if isinstance(error, ModuleNotFoundError):
        error = missing(error)
    if isinstance(error, InputError):
        return str(error)
    if isinstance(error, MemoryError):
        return f"expected enough memory, found too little{f' ({error})' if str(error) else ''}"
    # Warp's own way to say that a device's memory is full.
    if isinstance(error, RuntimeError) and "Failed to allocate" in str(error):
        return f"expected enough memory on the device, found too little ({error})"
    if isinstance(error, OSError):
        where = f"{error.filename}: " if error.filename else ""
        return f"{where}expected to be able to read and write, found {error.strerror or error}"
    return None


def _with_solver(argv: Sequence[str]) -> list[str]:
    """Arguments in which `tune MODEL` names what it tunes: the bake."""
    if argv[:1] != ["tune"] or len(argv) < 2 or argv[1] in ("-h", "--help", *SOLVERS):
        return list(argv)
    return ["tune", "bake", *argv[1:]]


if __name__ == "__main__":
    sys.exit(main())
