"""A view cell, a target and blockers between them, at random; and whether random segments pass."""

import numpy as np
from viewcell.data.blockers import Blockers
from viewcell.data.graph import OTHER_AXES
from viewcell.data.hierarchy import build_hierarchy

SIZE = 16


def blockers_of(boxes: np.ndarray) -> Blockers:
    boxes = np.asarray(boxes, np.int32).reshape(-1, 2, 3)
    axis = (boxes[:, 1] == boxes[:, 0]).argmax(axis=1).astype(np.int32)
    return Blockers(boxes, axis, build_hierarchy(boxes))


def random_blockers(random: np.random.Generator, count: int) -> np.ndarray:
    boxes = np.zeros((count, 2, 3), np.int32)
    for box in boxes:
        axis = random.integers(3)
        box[:, axis] = random.integers(1, SIZE)
        for other in OTHER_AXES[axis]:
            box[:, other] = np.sort(random.choice(SIZE + 9, 2, replace=False)) - 4
    return boxes


def random_box(random: np.random.Generator, flat: bool) -> np.ndarray:
    low = random.integers(0, SIZE - 4, 3)
    high = low + random.integers(1, 5, 3)
    if flat:
        axis = random.integers(3)
        high[axis] = low[axis]
    return np.stack([low, high]).astype(np.int32)


def clear_segments(boxes: np.ndarray, origins: np.ndarray, ends: np.ndarray, strict: bool) -> np.ndarray:
    """Segments that cross no blocker, in float64; a crossing nearer than 1e-9 to an edge counts as crossing."""
    clear = np.ones(len(origins), bool)
    way = ends - origins
    for low, high in boxes:
        axis = int((high == low).argmax())
        with np.errstate(all="ignore"):
            t = (low[axis] - origins[:, axis]) / way[:, axis]
            point = origins + t[:, None] * way
        last = 1.0 - 1e-9 if strict else 1.0 + 1e-9
        hit = (t > 0) & (t < last)
        for other in OTHER_AXES[axis]:
            hit &= (point[:, other] > low[other] - 1e-9) & (point[:, other] < high[other] + 1e-9)
        clear &= ~hit
    return clear


def case(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool] | None:
    random = np.random.default_rng(seed)
    strict = bool(seed % 2)
    source, target = random_box(random, False), random_box(random, strict and seed % 4 == 3)
    if ((source[0] < target[1]) & (target[0] < source[1])).all():
        return None
    boxes = random_blockers(random, int(random.integers(1, 9)))
    if not strict:
        # Blockers never pass through the inside of a cell.
        inside = ((boxes[:, 0] < target[1]) & (boxes[:, 1] > target[0])).all(axis=1)
        inside |= ((boxes[:, 0] < source[1]) & (boxes[:, 1] > source[0])).all(axis=1)
        boxes = boxes[~inside]
    return source, target, boxes, strict


def shown(source: np.ndarray, target: np.ndarray, boxes: np.ndarray, strict: bool, seed: int, count: int) -> bool:
    random = np.random.default_rng(seed + 1)
    origins = random.uniform(source[0], source[1], (count, 3))
    ends = random.uniform(target[0], target[1], (count, 3))
    if strict:
        # What counts is the way to the surface of the box: move the end to where the segment enters it.
        way = ends - origins
        with np.errstate(all="ignore"):
            first = np.minimum((target[0] - origins) / way, (target[1] - origins) / way)
        enter = np.nan_to_num(first, nan=-np.inf).max(axis=1)
        keep = enter > 0
        origins, ends = origins[keep], origins[keep] + np.minimum(enter[keep], 1.0)[:, None] * way[keep]
    return bool(clear_segments(boxes, origins, ends, strict).any()) if len(origins) else False
