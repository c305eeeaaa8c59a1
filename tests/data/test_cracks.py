"""What is a crack: by squares that fit, tried one by one, and whatever way cells cut the opening."""

import numpy as np
import pytest
from builders import corridors
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.cracks import crack_portals
from viewcell.data.graph import OTHER_AXES, CellGraph

SIDE = 12


def graph_of(rectangles, axis):
    """Portals on one plane, of the same two cells."""
    count, (u, v) = len(rectangles), OTHER_AXES[axis]
    portals = np.zeros((count, 2, 3), np.int32)
    portals[:, :, u], portals[:, :, v] = np.moveaxis(np.array(rectangles).reshape(count, 2, 2), 2, 0)
    cells = np.array([[[-SIDE] * 3, [SIDE] * 3], [[-SIDE] * 3, [SIDE] * 3]], np.int32)
    pairs, names = np.tile([[0, 1]], (count, 1)).astype(np.int32), np.full(2, "", object)
    return CellGraph(cells, np.ones(2, bool), names, pairs, np.full(count, axis, np.int8), portals)


def cut(filled):
    """Pixels in runs along v, some of them cut in two."""
    out = []
    for u in range(SIDE):
        ends = np.flatnonzero(np.diff(np.concatenate([[0], filled[u], [0]])))
        for low, high in ends.reshape(-1, 2).tolist():
            middle = low + (high - low) // 2
            parts = [(low, middle), (middle, high)] if u % 2 and middle > low else [(low, high)]
            out += [[[u, a], [u + 1, b]] for a, b in parts]
    return out


@given(st.integers(0, 2**32 - 1), st.integers(1, 5), st.integers(0, 2))
def test_a_portal_in_no_square_is_a_crack(seed, width, axis):
    random = np.random.default_rng(seed)
    filled = np.zeros((SIDE, SIDE), int)
    for _ in range(random.integers(1, 5)):
        low, size = random.integers(0, SIDE, 2), random.integers(1, 8, 2)
        filled[low[0] : low[0] + size[0], low[1] : low[1] + size[1]] = 1
    # Squares at whole steps are enough: the outline has no other corners.
    wide = np.zeros_like(filled)
    for u in range(SIDE - width + 1):
        for v in range(SIDE - width + 1):
            if filled[u : u + width, v : v + width].all():
                wide[u : u + width, v : v + width] = 1
    rectangles = cut(filled)
    wanted = [not wide[a[0] : b[0], a[1] : b[1]].any() for a, b in rectangles]
    assert crack_portals(graph_of(rectangles, axis), width).tolist() == wanted


def test_no_width_closes_nothing():
    graph = corridors.corridor(5)
    assert not crack_portals(graph, 0.0).any() and not crack_portals(graph, 128.0).any()
    assert crack_portals(graph, 128.1).all()


@pytest.mark.parametrize("width", [1.0, 1e4])
def test_a_graph_without_portals(width):
    assert crack_portals(graph_of([], 0), width).tolist() == []
