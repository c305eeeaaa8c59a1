"""Items of a display database as contiguous ranges of its flat file, and reading them from a folder.

Items that are wanted together lie together (data/store/walk_tables.py), and what lies between them is read over where
that costs less than another read: on a disk a seek, over a network the time until an answer comes.
"""

import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from ..errors import InputError


class ReadFailed(Exception):
    """A range that did not come: whoever asked goes on without it."""


@dataclass(frozen=True)
class Range:
    """Consecutive bytes of the file.

    Attributes:
        first: byte.
        size: bytes, those between items included.
        items: in it, ascending.
        waste: bytes of it that nobody asked for.
    """

    first: int
    size: int
    items: tuple[int, ...]
    waste: int


class Source(Protocol):
    """Where ranges are read from; one thread at a time."""

    def expect(self, ranges: Sequence[Range]) -> None:
        """These will be read soon."""

    def read(self, wanted: Range) -> bytes:
        """All bytes of a range.

        Raises:
            ReadFailed: they did not come.
        """

    def close(self) -> None:
        """No more is read."""


def ranges_of(items: np.ndarray, offsets: np.ndarray, sizes: np.ndarray, gap: int) -> list[Range]:
    """The fewest ranges that hold items and no gap larger than so many bytes.

    Args:
        items: each once, the most wanted first, shape (n,), int.
        offsets: first byte of every item of the file, ascending, int64.
        sizes: bytes of every item, int64.
        gap: bytes that are read over rather than begun anew behind.

    Returns:
        Ranges, in the order of their most wanted items.
    """
    if not len(items):
        return []
    rank = np.argsort(items, kind="stable")
    lying = items[rank]
    first, last = offsets[lying], offsets[lying] + sizes[lying]
    breaks = np.flatnonzero(first[1:] - last[:-1] > gap) + 1
    begins, ends = np.append(0, breaks), np.append(breaks, len(lying))
    order = np.argsort(np.minimum.reduceat(rank, begins), kind="stable")
    size, used = last[ends - 1] - first[begins], np.add.reduceat(sizes[lying], begins)
    return [
        Range(int(first[begins[k]]), int(size[k]), tuple(lying[begins[k] : ends[k]].tolist()), int(size[k] - used[k]))
        for k in order.tolist()
    ]


def items_in(wanted: Range, data: bytes, offsets: np.ndarray, sizes: np.ndarray) -> dict[int, bytes]:
    """Bytes of each item of a range that has been read."""
    at = {item: int(offsets[item]) - wanted.first for item in wanted.items}
    return {item: data[first : first + int(sizes[item])] for item, first in at.items()}


class FileSource:
    """Ranges of a file."""

    def __init__(self, path: Path) -> None:
        """Open it.

        Raises:
            InputError: it cannot be opened.
        """
        self._path = path
        try:
            self._file = os.open(path, os.O_RDONLY)
        except OSError as error:
            raise InputError(f"{path}: expected a file of items, found {error.strerror}") from None

    def expect(self, ranges: Sequence[Range]) -> None:
        """The kernel reads all of them while the first is used; not every system can be told."""
        with suppress(AttributeError, OSError):
            for wanted in ranges:
                os.posix_fadvise(self._file, wanted.first, wanted.size, os.POSIX_FADV_WILLNEED)

    def read(self, wanted: Range) -> bytes:
        """All bytes of a range.

        Raises:
            ReadFailed: the file is shorter than it was, or cannot be read.
        """
        parts, left = [], wanted.size
        while left:
            try:
                part = os.pread(self._file, left, wanted.first + wanted.size - left)
            except OSError as error:
                raise ReadFailed(f"{self._path}: {error.strerror}") from None
            if not part:
                raise ReadFailed(f"{self._path}: expected {wanted.size} bytes at {wanted.first}, found {left} fewer")
            parts.append(part)
            left -= len(part)
        return b"".join(parts)

    def close(self) -> None:
        """No more is read."""
        os.close(self._file)
