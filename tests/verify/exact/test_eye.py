"""The rational twin of what an eye sees: vectors by hand, rays that are followed exactly, and degenerate eyes."""

import numpy as np
import pytest
from builders.lookers import all_round, edge_eyes, random_boxes
from builders.random_buildings import SIZE, STEP, random_graph
from viewcell.data.graph import CellGraph
from viewcell.verify.exact.eye import clipped, seen_by_eye
from viewcell.verify.exact.trace import portal_links, portal_path

HALF = (1.0, 1.0)
FORWARD = np.array([[0.0, -1, 0], [0, 0, 1], [1, 0, 0]])


def two_rooms(portal):
    cells = np.array([[[-9, -9, -9], [4, 9, 9]], [[4, -9, -9], [20, 9, 9]]], np.int32)
    return CellGraph(
        cells,
        np.ones(2, bool),
        np.full(2, "", object),
        np.array([[0, 1]], np.int32),
        np.zeros(1, np.int8),
        np.array([portal], np.int32),
    )


@pytest.mark.parametrize(
    ("box", "wanted"),
    [
        ([[8, 2, 0], [8, 3, 0]], True),  # its corner is on the edge of the cone
        ([[8, 3, 0], [8, 4, 0]], False),
        ([[5, 2, 0], [7, 9, 9]], False),
        ([[4, 1, 0], [4, 1, 0]], True),  # the portal's own corner
        ([[3, 2, 0], [4, 4, 1]], True),  # in the room of the eye
        ([[-3, 0, 0], [-2, 1, 1]], False),  # behind it
        ([[9, 5, 5], [8, 4, 4]], False),  # nowhere
    ],
)
def test_by_hand(box, wanted):
    graph = two_rooms([[4, -1, -1], [4, 1, 1]])
    objects, cells = seen_by_eye(graph, np.array([box]), np.zeros(3), FORWARD, HALF)
    assert (objects, cells) == ({0} if wanted else set(), {0, 1})


def test_eyes_in_the_plane_of_a_portal():
    graph = two_rooms([[4, -1, -1], [4, 1, 1]])
    for y, cells in ((0.0, {0, 1}), (1.0, {0, 1}), (2.0, {0, 1}), (30.0, set())):
        assert seen_by_eye(graph, np.zeros((0, 2, 3), int), np.array([4, y, 0.0]), FORWARD, HALF)[1] == cells


def test_rays_meet_only_what_it_says():
    """Rays in random directions, traced through the portals: every box that they cross on the way."""
    met = 0
    for seed in range(6):
        graph, _ = random_graph(seed, walls=4)
        rng = np.random.default_rng(seed)
        boxes, eye = random_boxes(rng, 20), rng.integers(1, SIZE * STEP, 3) + 0.5
        path = all_round(eye)
        objects = set().union(*(seen_by_eye(graph, boxes, eye, axes, HALF)[0] for axes in path.axes()))
        links = portal_links(graph)
        holding = ((graph.cells[:, 0] < eye) & (eye < graph.cells[:, 1])).all(axis=1)
        home = int(np.flatnonzero(holding)[0])
        for number, box in enumerate(boxes):
            for end in rng.uniform(box[0], box[1] + 1e-9, (20, 3)):
                cells = np.flatnonzero(((graph.cells[:, 0] < end) & (end < graph.cells[:, 1])).all(axis=1))
                if any(portal_path(links, graph.cells, home, int(c), eye, end - eye) is not None for c in cells):
                    met += 1
                    assert number in objects
    assert met > 100


def test_from_a_portal_both_sides():
    graph, _ = random_graph(2, walls=4)
    for portal in range(0, graph.portal_count, 3):
        for eye in edge_eyes(graph, portal):
            cells = set().union(
                *(seen_by_eye(graph, np.zeros((0, 2, 3), int), eye, a, HALF)[1] for a in all_round(eye).axes())
            )
            assert set(graph.portal_cells[portal].tolist()) <= cells


def test_clipping_to_a_point_leaves_it():
    square = [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
    assert {tuple(p) for p in clipped(square, [[-1, 0, 0], [0, -1, 0]])} == {(0, 0, 1)}
    assert clipped(square, [[-1, -1, -1]]) == []
