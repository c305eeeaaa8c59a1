"""What sightlines meet first, before the object that they were aimed at: it is seen as well.

Source: Bittner et al. 2009, "Adaptive global visibility sampling", section 4.1, where every ray serves what it hits.
"""

from collections.abc import Callable

import numpy as np

from ...data.rows import Rows
from .finder import Finder
from .search import on_witness_grid

# Sightlines that are kept per pair and round of drawing, the first ones: an exact test may refuse some.
KEPT = 3


class FirstHits:
    """A `Guide` of sightlines aimed at objects, which also serves other pairs of the same view cell."""

    def __init__(self, finder: Finder, rows: Rows, pairs: np.ndarray, serve: Callable[..., None]) -> None:
        """Watch attempts to see pairs.

        Args:
            finder: casts the sightlines.
            rows: pairs of view cells and objects.
            pairs: row of each attempt, shape (n,), int.
            serve: given the rows, some of them, triangles of their objects, and origins and ends of sightlines there,
                shows those that are seen, in place.
        """
        self._finder, self._rows, self._pairs, self._serve = finder, rows, pairs, serve
        self._count = 1 + int(rows.target.max(initial=0))
        unknown = np.flatnonzero(~rows.seen)
        key = rows.source[unknown] * self._count + rows.target[unknown]
        order = np.argsort(key)
        # With a pair that is none at the end, for keys beyond all.
        self._key, self._row = np.append(key[order], -1), np.append(unknown[order], -1)
        self._taken: list[tuple[np.ndarray, ...]] = []

    def may_be_clear(self, rows: np.ndarray, origins: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """As of `Guide`: those that meet nothing; what others meet is remembered."""
        triangle, source = self._finder.first(origins, ends), self._rows.source[self._pairs[rows]]
        owner = self._finder.owners[triangle]
        hit = np.flatnonzero((owner >= 0) & (owner < self._count))
        key = source[hit] * self._count + owner[hit]
        at = np.searchsorted(self._key[:-1], key)
        known = self._key[at] == key
        self._taken.append(first_of_each(self._row[at[known]], triangle, origins, ends, hit[known]))
        return triangle < 0

    def wanted(self, rows: np.ndarray, found: np.ndarray) -> np.ndarray:
        """As of `Guide`: those of pairs that no attempt has seen by now."""
        row, *columns = (np.concatenate(column) for column in zip(*self._taken, strict=True))
        self._taken = []
        row, triangle, origin, end = first_of_each(row, *columns, np.arange(len(row)))
        met, end = cut_short(self._finder.triangles[triangle], origin, end)
        met &= ~self._rows.seen[row]
        self._serve(self._rows, row[met], triangle[met], origin[met], end[met])
        pairs = self._pairs[rows]
        return ~self._rows.seen[pairs] & ~np.isin(pairs, self._pairs[found])


def first_of_each(row: np.ndarray, *columns: np.ndarray) -> tuple[np.ndarray, ...]:
    """First few of each row: the row, and what the columns but the last hold at the places that the last names."""
    *columns, place = columns
    order = np.argsort(row, kind="stable")
    row = row[order]
    kept = np.flatnonzero(np.arange(len(row)) - np.searchsorted(row, row) < KEPT)
    return row[kept], *(column[place[order[kept]]] for column in columns)


def cut_short(triangles: np.ndarray, origin: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether each line meets its triangle's plane, bool, and where, on the witness grid, shape (n, 3)."""
    a, b, c = triangles.astype(float).transpose(1, 0, 2)
    normal, way = np.cross(b - a, c - a), end - origin
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = ((a - origin) * normal).sum(axis=1) / (way * normal).sum(axis=1)
    met = (reach > 0) & (reach <= 1)
    return met, on_witness_grid(origin + np.where(met, reach, 0.0)[:, None] * way)
