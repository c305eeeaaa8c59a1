"""Zip archives that hold one model."""

import zipfile
from pathlib import Path

from ..errors import InputError

# Text of these kinds shrinks 10 to 40 times.
MAX_RATIO, FREE_BYTES, MAX_BYTES = 200, 2**20, 8 * 2**30


def only_file(path: Path, suffixes: tuple[str, ...]) -> bytes:
    """Content of the one file in an archive that has one of the suffixes.

    Raises:
        InputError: the archive cannot be read, holds none or several, or one of a size that is not credible.
    """
    kinds = " or ".join(suffixes)
    try:
        with zipfile.ZipFile(path) as archive:
            inside = [entry for entry in archive.infolist() if entry.filename.lower().endswith(suffixes)]
            if len(inside) != 1:
                raise InputError(f"{path}: expected one {kinds} file in the archive, found {len(inside)}")
            size = inside[0].file_size
            if size > min(MAX_BYTES, MAX_RATIO * inside[0].compress_size + FREE_BYTES):
                raise InputError(f"{path}: expected a file that shrank at most {MAX_RATIO} times, found {size} bytes")
            return archive.read(inside[0])  # no more than it says: zipfile checks
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: expected a readable file, found {error.strerror}") from None
    except Exception as error:  # zipfile raises its own, zlib's, and what encryption and unknown methods bring
        raise InputError(f"{path}: expected a zip archive with a {kinds} file, found {error}") from None
