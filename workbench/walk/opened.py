"""A display database as a walk opens it: a folder, or an address."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from ...data.errors import InputError
from ...data.store.ranges import FileSource, Source
from ...data.store.remote import HttpSource, fetch_index, is_remote
from ...data.store.walk_folder import GEOMETRY, INDEX_FILES, WalkFolder, read_walk


@dataclass(frozen=True)
class Opened:
    """A display database, and where its geometry is read from.

    Attributes:
        walk: the database.
        source: of its geometry.
        index_bytes: read before the first frame.
        place: as the user named it.
    """

    walk: WalkFolder
    source: Source
    index_bytes: int
    place: str


@contextmanager
def opened(database: WalkFolder | str | Path, timeout_s: float) -> Iterator[Opened]:
    """A database, here or on a server; what it is read from is closed in the end.

    Raises:
        InputError: it is unreadable, altered or older than its bake, or a server does not answer in so many seconds.
    """
    with tempfile.TemporaryDirectory() as name:
        if is_remote(database):
            url = str(database).rstrip("/")
            found, size = fetch_index(url, Path(name), timeout_s)
            source, place = HttpSource(url, timeout_s), url
        else:
            found = database if isinstance(database, WalkFolder) else read_walk(database)
            if stale := found.stale():
                raise InputError(stale)
            folder = Path(found.folder)
            size = sum((folder / name).stat().st_size for name in ("manifest.json", *INDEX_FILES))
            source, place = FileSource(folder / GEOMETRY), str(folder)
        try:
            yield Opened(found, source, size, place)
        finally:
            source.close()
