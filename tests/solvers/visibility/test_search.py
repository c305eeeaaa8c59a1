"""Pieces of objects, a few at a time."""

import numpy as np
import pytest
from viewcell.solvers.visibility.search import OPEN_ENOUGH, open_pieces


@pytest.mark.parametrize("seed", range(20))
def test_every_object_is_looked_at_until_some_pieces_are_open(seed):
    """Against a look at all: no open object is missed, no piece is asked about twice, few when enough are open."""
    rng = np.random.default_rng(seed)
    sizes = rng.integers(0, 20, 30)
    last = np.cumsum(sizes)
    first = last - sizes
    is_open = rng.random(last[-1]) < rng.choice([0.05, 0.5, 1.0])
    asked = []

    def prove(at, piece):
        assert ((piece >= first[at]) & (piece < last[at])).all()
        asked.extend(piece.tolist())
        left = np.flatnonzero(is_open[piece])
        return left, np.repeat(piece[left], 6).reshape(-1, 2, 3).astype(float)

    kept = first.copy()
    objects, piece, lines = open_pieces(first, last, prove)
    assert (first == kept).all() and len(asked) == len(set(asked))
    assert (
        is_open[piece].all()
        and (lines[:, 0, 0] == piece).all()
        and (objects == np.searchsorted(last, piece, "right")).all()
    )
    for number in range(30):
        mine, here = piece[objects == number], np.arange(first[number], last[number])
        assert len(mine) >= min(OPEN_ENOUGH, is_open[here].sum())
        # Twice as many at a time: those that are open come before so many.
        if is_open[here].all():
            assert len(mine) <= 2 * OPEN_ENOUGH
