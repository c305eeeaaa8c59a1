"""Shares of the model that cells keep, by hand."""

import numpy as np
import pytest
from viewcell.data.kept import kept_shares, mean_kept
from viewcell.data.view_cells import as_graph

# Three cells of 1, 3 and 8 cubic steps, of which the last is not inhabitable.
CELLS = np.array([[[0, 0, 0], [1, 1, 1]], [[0, 0, 0], [3, 1, 1]], [[0, 0, 0], [2, 2, 2]]])


def test_shares_count_objects_and_their_triangles():
    source, target = np.array([0, 0, 1]), np.array([0, 2, 1])
    objects, triangles = kept_shares(3, source, target, np.array([10, 20, 50, 0]))
    assert objects.tolist() == [0.5, 0.25, 0.0] and triangles.tolist() == [0.75, 0.25, 0.0]


def test_the_mean_is_by_volume_over_inhabitable_cells():
    graph = as_graph(CELLS, inhabitable=np.array([True, True, False]))
    assert mean_kept(graph, np.array([0.8, 0.4, 1.0])) == pytest.approx((0.8 + 3 * 0.4) / 4)
    assert mean_kept(as_graph(CELLS, inhabitable=np.zeros(3, bool)), np.ones(3)) == 0.0


def test_nothing_to_keep_is_kept_by_nobody():
    none = np.zeros(0, int)
    assert [share.tolist() for share in kept_shares(2, none, none, none)] == [[0.0, 0.0]] * 2
