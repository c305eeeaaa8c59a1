"""The hierarchy finds what a loop over all boxes finds."""

import numpy as np
import pytest
from viewcell.kernels import hierarchy
from viewcell.kernels.hierarchy import build_hierarchy, build_of_copies


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


def some_copies(rng, shapes, times):
    """Boxes of groups, some empty, most of them others shifted; where each begins, and its model."""
    groups, models = [], []
    for count in shapes:
        shape, first = random_boxes(rng, count), len(groups)
        for _ in range(times):
            groups += [shape + rng.integers(-(2**21), 2**21, 3), np.zeros((0, 2, 3), int)]
            models += [first, len(groups) - 1]
    order = rng.permutation(len(groups))
    # The first of those that are alike, in the new order.
    names = np.array(models)[order]
    firsts = np.array([np.flatnonzero(names == name)[0] for name in names])
    starts = np.concatenate([[0], np.cumsum([len(groups[k]) for k in order])])
    return np.concatenate([groups[k] for k in order]).astype(np.int32), starts, firsts


@pytest.mark.parametrize("apart", [True, False])
@pytest.mark.parametrize("shapes", [(1,), (5,), (1, 2, 40), (300, 7)])
def test_copies_find_what_a_loop_finds(monkeypatch, shapes, apart):
    """Whether groups have trees of their own or not."""
    monkeypatch.setattr(hierarchy, "mostly_copies", lambda *_: apart)
    rng = np.random.default_rng(len(shapes))
    boxes, starts, models = some_copies(rng, shapes, 6)
    tree = build_of_copies(boxes, starts, models)
    leaves = tree.links[:, 1] >= 0
    assert len(tree.links) == 2 * len(boxes) - 1
    np.testing.assert_array_equal(tree.boxes[leaves], boxes[tree.links[leaves, 1]])
    for query in random_boxes(rng, 100):
        query[1] += 2**20
        truth = np.flatnonzero((boxes[:, 0] <= query[1]).all(axis=1) & (boxes[:, 1] >= query[0]).all(axis=1))
        assert sorted(items_met(tree, query)[0]) == truth.tolist()


def test_groups_that_are_nothing_have_no_tree():
    assert len(build_of_copies(np.zeros((0, 2, 3), np.int32), np.zeros(4, int), np.arange(3)).nodes) == 0


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


def test_every_node_is_the_box_around_what_it_holds():
    boxes = random_boxes(np.random.default_rng(5), 60)
    tree = build_hierarchy(boxes)
    for node, (skip, item) in enumerate(tree.links.tolist()):
        held = tree.links[node:skip, 1]
        held = boxes[held[held >= 0]]
        assert (item >= 0) == (skip == node + 1)
        np.testing.assert_array_equal(tree.boxes[node], [held[:, 0].min(axis=0), held[:, 1].max(axis=0)])


def test_boxes_of_all_sizes_end_in_few_levels_of_waiting():
    """Each box is twice as large as the one before and holds it, and all stand a hundred times."""
    size = 2 ** np.arange(20)
    boxes = np.stack([-np.stack([size] * 3, axis=1), np.stack([size] * 3, axis=1)], axis=1).astype(np.int32)
    boxes = np.tile(boxes, (100, 1, 1))
    tree = build_hierarchy(boxes)
    assert sorted(tree.links[tree.links[:, 1] >= 0, 1]) == list(range(len(boxes)))


def test_walls_do_not_spread_over_the_tree():
    """Among walls and slabs as large as the building, a line through one room looks at little else than that room."""
    planes = np.arange(0, 320, 20)
    low = np.stack(np.meshgrid(planes, planes, planes, indexing="ij"), axis=-1).reshape(-1, 3)
    boxes = [np.stack([low + 2, low + 4], axis=1)]
    for axis in range(3):
        walls = np.tile([[0, 0, 0], [320, 320, 320]], (len(planes), 1, 1))
        walls[:, :, axis] = planes[:, None]
        boxes.append(walls)
    tree = build_hierarchy(np.concatenate(boxes).astype(np.int32))
    rooms = [np.array([x, y, z]) for x in (1, 101) for y in (41, 161) for z in (21, 201, 281)]
    looked = [items_met(tree, np.stack([room, room + np.array([18, 0, 0])]))[1] for room in rooms]
    assert max(looked) < 80, looked
