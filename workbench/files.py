"""Files that a command leaves in a folder."""

import tempfile
from collections.abc import Callable
from pathlib import Path

from ..data.errors import InputError

# What folders are called in which files are made before they appear.
SCRATCH = ".writing."


def write_files(folder: Path, make: Callable[[], dict[str, bytes]]) -> None:
    """Write files by name into a folder, made if need be; each appears whole or not at all, in the order given.

    They are made only where they can be written.

    Raises:
        InputError: the folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix=SCRATCH) as scratch:
            files = make()
            for name, data in files.items():
                (Path(scratch) / name).write_bytes(data)
            for name in files:
                (Path(scratch) / name).replace(folder / name)
    except OSError as error:
        raise InputError(f"{folder}: expected a folder to write to, found {error.strerror}") from None
