"""Claims about a bare cell graph: only a line that exact arithmetic confirms accuses, and what is open is told."""

import numpy as np
import pytest
from builders import four_rooms
from viewcell.workbench.bake.run import bake
from viewcell.workbench.check import graph as checking
from viewcell.workbench.check.run import check

SEEN = np.ones((4, 4), bool)
SEEN[0, 3] = SEEN[3, 0] = False


@pytest.fixture
def rooms(tmp_path):
    return four_rooms.write_graph(tmp_path / "rooms")


def test_every_hidden_pair_that_is_seen_accuses(rooms):
    for cell, target in np.argwhere(SEEN & ~np.eye(4, dtype=bool)):
        claims = SEEN.copy()
        claims[cell, target] = False
        result = check(rooms, claims)
        assert [(w.cell, w.target) for w in result.wrong] == [(cell, target)] and not result.ok
        assert "left open" not in result.confidence_line()
    assert check(rooms, SEEN).ok and check(rooms, np.ones((4, 4), bool)).ok


def test_a_line_that_is_not_confirmed_accuses_nobody(rooms, monkeypatch):
    monkeypatch.setattr(checking, "confirm_cells", lambda lines, *_: np.full(len(lines.cells), 5))
    result = check(rooms, np.eye(4, dtype=bool))
    assert result.ok and "10 pairs that the claims hide were left open" in result.confidence_line()


def test_what_the_bake_leaves_unknown_is_told(rooms, monkeypatch):
    """Without time nothing is decided: nobody is accused, and nothing is called proved."""
    monkeypatch.setattr(checking, "bake", lambda *paths: bake(*paths, budget_s=1e-9))
    result = check(rooms, np.eye(4, dtype=bool))
    assert result.ok and "12 pairs that the claims hide were left open" in result.confidence_line()
    assert not result.seen["cell"].any()
