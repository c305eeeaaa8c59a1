"""From nothing to what the eye sees: how many bytes a policy reads first, against an oracle that knows what is visible.

The measure of learned and streamed scenes: an eye appears somewhere, nothing is in memory, and bytes are counted until
99 % and 100 % of its pixels show what they are to show. The oracle reads the items of visible objects alone, those with
the most pixels a byte first.
"""

from dataclasses import dataclass

import numpy as np

from ...solvers.walk.policies import Now, Policy
from .memory import Layout, urgent_first

SHARES = (0.99, 1.0)


@dataclass(frozen=True)
class Arrivals:
    """Eyes by one policy; bytes until 99 % and 100 % of the pixels are there, shape (eyes, 2), float64.

    Attributes:
        policy: its name.
        asked: of the items that it asks for, in its order; inf where it never asks for what is missing.
        read: likewise, with what lies between items in the ranges that are read.
        oracle: of the oracle's items.
    """

    policy: str
    asked: np.ndarray
    read: np.ndarray
    oracle: np.ndarray

    @property
    def ratios(self) -> np.ndarray:
        """Bytes asked for over the oracle's, shape (eyes, 2); 1 where there is nothing to read."""
        return np.divide(self.asked, self.oracle, out=np.ones_like(self.asked), where=self.oracle > 0)


def oracle_bytes(pixels: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Bytes until 99 % and 100 % of the pixels are there, if only what is visible is read, most pixels a byte first.

    Args:
        pixels: that each item shows, shape (n,), int.
        sizes: of the items, bytes, shape (n,), int.

    Returns:
        Shape (2,), float64. For shares below all of it greedy is not the least, but within one item of it.
    """
    seen = np.flatnonzero(pixels)
    order = seen[np.argsort(-pixels[seen] / sizes[seen], kind="stable")]
    return _until(np.cumsum(pixels[order]), np.cumsum(sizes[order]), pixels.sum())


def policy_bytes(
    policy: Policy, now: Now, pixels: np.ndarray, layout: Layout, gap: int, lot: int
) -> tuple[np.ndarray, np.ndarray]:
    """The same for a policy that begins with nothing: of the items it asks for, and of the ranges that are read.

    Args:
        policy: without a memory of frames before.
        now: the frame.
        pixels: that each shown object shows, shape of `now.shown`.
        layout: where items lie.
        gap: bytes read over rather than begun anew behind.
        lot: bytes asked for at a time.
    """
    table, sizes = policy.stock.shelves.table[now.shown], layout.sizes
    items = policy.ahead(now, np.zeros(len(sizes), bool))
    spent = np.cumsum(sizes[items])
    asked = np.full(len(sizes), np.inf)
    asked[items] = spent
    read, total = np.full(len(sizes), np.inf), 0
    for chunk in np.split(items, np.flatnonzero(np.diff(spent // lot)) + 1):
        for one in urgent_first(chunk, now.urgent, layout, gap):
            total += one.size
            read[list(one.items)] = total
    # An object is there with the level that it is to be drawn at, or with a finer one.
    wanted = np.argmax(table == now.wanted[:, None], axis=1)
    enough = (table >= 0) & (np.arange(table.shape[1]) <= wanted[:, None])
    found = []
    for when in (asked, read):
        there = np.where(enough, when[table], np.inf).min(axis=1)
        order = np.argsort(there, kind="stable")
        order = order[(pixels[order] > 0) & np.isfinite(there[order])]
        found.append(_until(np.cumsum(pixels[order]), there[order], int(pixels.sum())))
    return found[0], found[1]


def _until(shown: np.ndarray, spent: np.ndarray, all_pixels: int) -> np.ndarray:
    """What was spent when first so much was shown; inf where it never was; 0 where there is nothing to show."""
    out = np.full(len(SHARES), np.inf if all_pixels else 0.0)
    for place, share in enumerate(SHARES):
        enough = np.flatnonzero(shown >= share * all_pixels)
        if len(enough):
            out[place] = spent[enough[0]]
    return out
