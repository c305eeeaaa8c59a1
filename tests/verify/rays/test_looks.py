"""Rays from the eyes of a path, where it is known what they meet."""

import numpy as np
from builders.lookers import SQUARE, camera
from builders.random_buildings import box_triangles as box
from builders.random_buildings import scene_of
from viewcell.data.view_cells import as_graph
from viewcell.verify.rays.looks import Eyewitness

M = 1024
NONE = np.zeros((0, 2, 3), np.int32)


def hall():
    """A pane of glass with a thing behind it, which hides another; one behind the eye; one in which an eye stands."""
    parts = [
        (box((2 * M, -M, -M), (2 * M + 9, M, M)), "transparent"),
        (box((3 * M, -M, -M), (3 * M + 9, M, M)), "occluder"),
        (box((4 * M, -M, -M), (4 * M + 9, M, M)), "occluder"),
        (box((-4 * M, -M, -M), (-3 * M, M, M)), "occluder"),
    ]
    return scene_of(parts)


def looks(kept, eyes=((0.0, 0.1, 0.2),), cracks=NONE):
    scene = hall()
    witness = Eyewitness(scene, as_graph(np.array([[[-9 * M] * 3, [9 * M] * 3]])), cracks)
    return list(witness.looks(camera(eyes, 0.0), SQUARE, [np.array(k) for k in kept], 2000))


def test_what_is_met_and_lacking_is_dropped():
    (look,) = looks([[0]])
    assert (look.seen.tolist(), look.dropped.tolist(), look.doubtful.tolist()) == ([0, 1], [1], [])
    (look,) = looks([[0, 1]])
    assert look.dropped.tolist() == []
    (look,) = looks([[]])
    assert look.dropped.tolist() == [0, 1]


def test_eyes_in_solids_are_passed_over():
    found = looks([[], [], []], [(-3.5, 0.0, 0.0), (0.0, 0.1, 0.2), (-3.5, 0.1, 0.0)])
    assert [look.frame for look in found] == [1]


def test_what_is_seen_through_a_crack_is_no_error():
    wall = np.array([[[2500, -9 * M, -9 * M], [2500, 9 * M, 9 * M]]], np.int32)
    (look,) = looks([[0]], cracks=wall)
    assert (look.dropped.tolist(), look.doubtful.tolist()) == ([], [1])
