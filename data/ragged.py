"""Ragged arrays: lists of different lengths in one array; list i is values[starts[i]:starts[i + 1]]."""

from itertools import pairwise

import numpy as np


def starts_of(sizes: np.ndarray | list[int]) -> np.ndarray:
    """Where lists of these sizes start, and where the last one ends, shape (n + 1,), int64."""
    out = np.zeros(len(sizes) + 1, np.int64)
    np.cumsum(sizes, out=out[1:])
    return out


def owners_of(starts: np.ndarray) -> np.ndarray:
    """List of each value, int64."""
    return np.repeat(np.arange(len(starts) - 1), np.diff(starts))


def places_of(firsts: np.ndarray | int, sizes: np.ndarray) -> np.ndarray:
    """Place after place of each run: firsts[i], firsts[i] + 1, ... sizes[i] of them; all runs in order, int64."""
    ends = np.cumsum(sizes)
    total = int(ends[-1]) if len(ends) else 0
    return np.arange(total) + np.repeat(firsts - (ends - sizes), sizes)


def lots(sizes: np.ndarray | list[int], most: int) -> list[tuple[int, int]]:
    """First and past-the-last of consecutive lists that hold about so many values together."""
    total = np.cumsum(sizes, dtype=np.int64)
    ends = [0, *(np.flatnonzero(np.diff(total // most)) + 1).tolist(), len(total)]
    return [(first, stop) for first, stop in pairwise(ends) if first < stop]


def take_lists(starts: np.ndarray, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Starts of the chosen lists (indices or bool) alone, and the places of their values."""
    sizes = np.diff(starts)[chosen]
    return starts_of(sizes), places_of(starts[:-1][chosen], sizes)
