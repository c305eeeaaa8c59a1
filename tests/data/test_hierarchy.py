"""The hierarchy finds what a loop over all boxes finds."""

import numpy as np
import pytest
from viewcell.data.hierarchy import build_hierarchy


def random_boxes(rng, count):
    low = rng.integers(-(2**20), 2**20, (count, 3))
    return np.stack([low, low + rng.integers(0, 2**18, (count, 3))], axis=1).astype(np.int32)


def items_met(tree, query):
    """Items of leaves that touch the query, in the order of a walk without a stack, and the nodes looked at."""
    found, node, looked = [], 0, 0
    while node < len(tree.links):
        looked += 1
        box, (skip, item) = tree.boxes[node], tree.links[node]
        if (box[0] <= query[1]).all() and (box[1] >= query[0]).all():
            if item >= 0:
                found.append(int(item))
            node += 1
        else:
            node = skip
    return found, looked


@pytest.mark.parametrize("count", [0, 1, 2, 3, 5, 8, 17, 200])
def test_finds_what_a_loop_finds(count):
    rng = np.random.default_rng(count)
    boxes = random_boxes(rng, count)
    tree = build_hierarchy(boxes)
    for query in random_boxes(rng, 50) if count else np.zeros((1, 2, 3), int):
        truth = np.flatnonzero((boxes[:, 0] <= query[1]).all(axis=1) & (boxes[:, 1] >= query[0]).all(axis=1))
        assert sorted(items_met(tree, query)[0]) == truth.tolist()


@pytest.mark.parametrize("count", [1, 2, 3, 7, 64, 100])
def test_every_box_is_one_leaf(count):
    boxes = random_boxes(np.random.default_rng(count), count)
    tree = build_hierarchy(boxes)
    leaves = tree.links[:, 1] >= 0
    assert sorted(tree.links[leaves, 1]) == list(range(count))
    np.testing.assert_array_equal(tree.boxes[leaves], boxes[tree.links[leaves, 1]])
    assert len(tree.links) < 4 * count


def test_equal_boxes_are_all_kept():
    tree = build_hierarchy(np.tile(np.array([[[0, 0, 0], [1, 1, 1]]], np.int32), (9, 1, 1)))
    assert sorted(items_met(tree, np.array([[0, 0, 0], [0, 0, 0]]))[0]) == list(range(9))


def test_a_small_query_looks_at_few_nodes():
    """Points of a cube of unit boxes: the walk descends one path, not the tree."""
    low = np.stack(np.meshgrid(*[np.arange(0, 32, 2)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    tree = build_hierarchy(np.stack([low, low + 1], axis=1).astype(np.int32))
    found, looked = items_met(tree, np.array([[4, 4, 4], [4, 4, 4]]))
    assert len(found) == 1 and looked < 100
