"""Tracing sightlines through portals against the twin, and each trace checked in rationals."""

from fractions import Fraction

import numpy as np
import pytest
from builders import random_buildings
from viewcell.kernels.graph import device_graph
from viewcell.kernels.launch import Device
from viewcell.kernels.trace import launch_trace
from viewcell.verify.exact.trace import portal_links, portal_path


def random_segments(graph, rng, count):
    """Segments between random points of random cells; some run to points beyond the building."""
    sources, targets = rng.integers(0, graph.cell_count, (2, count))
    share = rng.uniform(0.01, 0.99, (2, count, 3))
    ends = [
        np.round((graph.cells[c, 0] + s * (graph.cells[c, 1] - graph.cells[c, 0])) * 1024) / 1024
        for c, s in zip((sources, targets), share, strict=True)
    ]
    ends[1][::17] += 600
    return sources, *ends


def check_exactly(graph, cell, target, portals, origin, end):
    """The segment crosses the portals one after the other, inside them, and each leads on from the last."""
    start, along = ([Fraction(float(c)) for c in v] for v in (origin, end - origin))
    before = Fraction(0)
    for portal in portals:
        axis, box = int(graph.portal_axis[portal]), graph.portals[portal]
        time = (int(box[0, axis]) - start[axis]) / along[axis]
        assert before <= time < 1
        for i in {0, 1, 2} - {axis}:
            assert int(box[0, i]) < start[i] + time * along[i] < int(box[1, i])
        ends = graph.portal_cells[portal].tolist()
        assert cell in ends
        cell, before = sum(ends) - cell, time
    assert cell == target


@pytest.mark.parametrize("seed", range(6))
def test_traces_as_the_twin_does(seed):
    graph, _ = random_buildings.random_graph(seed, walls=5)
    sources, origins, ends = random_segments(graph, np.random.default_rng(seed), 500)
    reached, starts, portals = launch_trace(device_graph(graph), sources, origins, ends)
    lines = np.stack([origins, ends - origins], axis=1)
    holding = (graph.cells[None, :, 0] < ends[:, None]).all(axis=2) & (graph.cells[None, :, 1] > ends[:, None]).all(
        axis=2
    )
    for row, cell in enumerate(reached):
        target = int(holding[row].argmax()) if holding[row].any() else -1
        path = portal_path(portal_links(graph), graph.cells, int(sources[row]), target, *lines[row])
        if path is None or target < 0:
            assert cell == -1
        else:
            assert cell == target
            assert portals[starts[row] : starts[row + 1]].tolist() == list(path)
            check_exactly(graph, int(sources[row]), target, path, origins[row], ends[row])
    assert 20 < (reached >= 0).sum() < 490


def test_threads_change_nothing():
    graph, _ = random_buildings.random_graph(1, walls=5)
    work = random_segments(graph, np.random.default_rng(1), 3000)
    one, two = (launch_trace(device_graph(graph), *work, device=Device(threads=threads)) for threads in (1, 2))
    for got, wanted in zip(two, one, strict=True):
        np.testing.assert_array_equal(got, wanted)


def test_a_line_through_an_edge_of_a_portal_is_given_up():
    """Along the rim of the first portal float64 could not be sure, so the trace ends there."""
    graph, _ = random_buildings.random_graph(2, walls=5)
    box, axis = graph.portals[0].astype(float), int(graph.portal_axis[0])
    cell = graph.cells[graph.portal_cells[0, 0]]
    rim = box[0].copy()
    rim[(axis + 2) % 3] = box[:, (axis + 2) % 3].mean()
    origin, end = rim.copy(), rim.copy()
    origin[axis] -= 0.25 * (cell[1, axis] - cell[0, axis])
    end[axis] += 1
    reached, _, _ = launch_trace(device_graph(graph), graph.portal_cells[:1, 0], origin[None], end[None])
    assert reached[0] == -1
