"""A hierarchy of boxes, level by level, for searches that take a whole level at once.

Boxes are halved at the median of their widest axis into a perfect binary tree. Lines go through trees of
kernels/hierarchy.py, which are better for them.
"""

import numpy as np

EMPTY = 2**25


def build_levels(boxes: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """Nodes of the hierarchy over boxes.

    Args:
        boxes: shape (n, 2, 3), integers.

    Returns:
        Node bounds, one array (2**level, 2, 3), int32, per level, low > high where empty; and the box of each node of
        the last level, -1 for none.
    """
    count = len(boxes)
    depth = int(np.ceil(np.log2(count))) if count > 1 else 0
    items = np.full(2**depth, -1, np.int64)
    items[leaves_of(boxes, depth)] = np.arange(count)
    bounds = np.empty((2**depth, 2, 3), np.int64)
    bounds[:, 0], bounds[:, 1] = EMPTY, -EMPTY
    bounds[items >= 0] = boxes[items[items >= 0]]
    levels = [bounds.astype(np.int32)]
    for _ in range(depth):
        pairs = bounds.reshape(-1, 2, 2, 3)
        bounds = np.stack([pairs[:, :, 0].min(axis=1), pairs[:, :, 1].max(axis=1)], axis=1)
        levels.append(bounds.astype(np.int32))
    return levels[::-1], items


def leaves_of(boxes: np.ndarray, depth: int) -> np.ndarray:
    """Leaf of each box in a tree so deep, shape (n,), int; neighbours share one where there are fewer leaves."""
    # Spread evenly, so that every subtree gets its share.
    places = np.arange(len(boxes)) * 2**depth // max(len(boxes), 1)
    leaves = np.empty(len(boxes), int)
    leaves[median_order(boxes.astype(np.int64).sum(axis=1), places, depth)] = places
    return leaves


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
