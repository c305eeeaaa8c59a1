"""A bounding volume hierarchy that kernels traverse without a stack.

Boxes are halved at the median of their widest axis, level by level, into a perfect binary tree stored in depth-first
order: a node's first child is the next node, and `skip` is where to go when the node is missed or done.
"""

from dataclasses import dataclass

import numpy as np

EMPTY = 2**25


@dataclass
class Hierarchy:
    """Nodes in depth-first order.

    Attributes:
        boxes: shape (nodes, 2, 3), int32; empty subtrees have low > high.
        links: shape (nodes, 2), int32: (skip, item of a leaf or -1).
    """

    boxes: np.ndarray
    links: np.ndarray


def build_hierarchy(boxes: np.ndarray) -> Hierarchy:
    """Hierarchy over boxes (n, 2, 3), int32; one box a leaf, exact integer bounds."""
    count = len(boxes)
    if count == 0:
        return Hierarchy(np.zeros((0, 2, 3), np.int32), np.zeros((0, 2), np.int32))
    depth = int(np.ceil(np.log2(count))) if count > 1 else 0
    # The leaf of the i-th box in order: spread evenly, so that every subtree gets its share.
    leaves = np.arange(count) * 2**depth // count
    order = median_order(boxes.astype(np.int64).sum(axis=1), leaves, depth)
    bounds = np.empty((2**depth, 2, 3), np.int32)
    bounds[:, 0], bounds[:, 1] = EMPTY, -EMPTY
    bounds[leaves] = boxes[order]
    items = np.full(2**depth, -1, np.int32)
    items[leaves] = order
    node_boxes = np.empty((2 ** (depth + 1) - 1, 2, 3), np.int32)
    links = np.full((2 ** (depth + 1) - 1, 2), -1, np.int32)
    places = [np.zeros(1, np.int64)]
    for level in range(depth):
        left = places[-1] + 1
        places.append(np.column_stack([left, left + 2 ** (depth - level) - 1]).ravel())
    for level in range(depth, -1, -1):
        node_boxes[places[level]] = bounds
        links[places[level], 0] = places[level] + 2 ** (depth - level + 1) - 1
        if level == depth:
            links[places[level], 1] = items
        pairs = bounds.reshape(-1, 2, 2, 3) if level else None
        if pairs is not None:
            bounds = np.stack([pairs[:, :, 0].min(axis=1), pairs[:, :, 1].max(axis=1)], axis=1)
    return Hierarchy(node_boxes, links)


def build_levels(boxes: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """The same tree level by level, for searches that take a whole level at once.

    Args:
        boxes: shape (n, 2, 3), integers.

    Returns:
        Node bounds, one array (2**level, 2, 3), int32, per level, low > high where empty; and the box of each node of
        the last level, -1 for none.
    """
    count = len(boxes)
    depth = int(np.ceil(np.log2(count))) if count > 1 else 0
    places = np.arange(count) * 2**depth // max(count, 1)
    items = np.full(2**depth, -1, np.int64)
    items[places] = median_order(boxes.astype(np.int64).sum(axis=1), places, depth)
    bounds = np.empty((2**depth, 2, 3), np.int64)
    bounds[:, 0], bounds[:, 1] = EMPTY, -EMPTY
    bounds[items >= 0] = boxes[items[items >= 0]]
    levels = [bounds.astype(np.int32)]
    for _ in range(depth):
        pairs = bounds.reshape(-1, 2, 2, 3)
        bounds = np.stack([pairs[:, :, 0].min(axis=1), pairs[:, :, 1].max(axis=1)], axis=1)
        levels.append(bounds.astype(np.int32))
    return levels[::-1], items


def median_order(centres: np.ndarray, leaves: np.ndarray, depth: int) -> np.ndarray:
    """Order of the boxes that halves every node at the median of its widest axis.

    Args:
        centres: doubled box centres, shape (n, 3), int64.
        leaves: leaf of the i-th box in order, ascending, shape (n,).
        depth: levels of the perfect tree.
    """
    order = np.arange(len(centres))
    for level in range(depth):
        node = leaves >> (depth - level)
        starts = np.flatnonzero(np.diff(node, prepend=-1))
        here = centres[order]
        spread = np.maximum.reduceat(here, starts) - np.minimum.reduceat(here, starts)
        sizes = np.diff(np.append(starts, len(order)))
        axis = np.repeat(spread.argmax(axis=1), sizes)
        order = order[np.lexsort((here[np.arange(len(order)), axis], node))]
    return order
