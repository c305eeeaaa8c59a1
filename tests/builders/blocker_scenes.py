"""A view cell, a target and blockers between them, at random; and whether random segments pass."""

import numpy as np
from viewcell.data.blockers import Blockers
from viewcell.data.graph import OTHER_AXES

SIZE = 16


def blockers_of(boxes: np.ndarray) -> Blockers:
    boxes = np.asarray(boxes, np.int32).reshape(-1, 2, 3)
    axis = (boxes[:, 1] == boxes[:, 0]).argmax(axis=1).astype(np.int32)
    return Blockers(boxes, axis)


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


def screens(random: np.random.Generator, low: np.ndarray, high: np.ndarray, depth: int) -> list[list[list[int]]]:
    """Rectangles of the y z plane that tile one and reach over their borders, at different x."""
    axis = random.integers(2)
    if depth == 0 or high[axis] - low[axis] < 4:
        x, more = random.integers(6, 10), random.integers(0, 3)
        return [[[x, *(low - more)], [x, *(high + more)]]]
    first, second = high.copy(), low.copy()
    first[axis] = second[axis] = random.integers(low[axis] + 1, high[axis])
    return screens(random, low, first, depth - 1) + screens(random, second, high, depth - 1)


def screened(seed: int, holes: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
    """Source, target, blockers that mostly hide it together, less so many, and whether the target is a surface."""
    random = np.random.default_rng(seed)
    closed, turn, signs = bool(seed % 2), random.permutation(3), random.choice([-1, 1], 3)
    low = random.integers(0, 12, (2, 3)) + np.array([[0, 0, 0], [10, 0, 0]])
    low[0, 0] = random.integers(0, 5)
    ends = np.stack([low, low + random.integers([1, 1, 1], [3, 8, 8], (2, 3))], axis=1)
    ends[1, 1, 0] -= (seed % 4 == 3) * (ends[1, 1, 0] - ends[1, 0, 0])
    boxes = np.array(screens(random, np.full(2, -8), np.full(2, 28), int(random.integers(0, 6))))
    boxes = boxes[random.permutation(len(boxes))[holes:]] if holes else boxes
    ends, boxes = (np.sort(group[:, :, turn] * signs, axis=1).astype(np.int32) for group in (ends, boxes))
    return *ends, boxes, closed


def rungs(border: int, slit: int) -> list[tuple[int, int]]:
    """Intervals from a border to a slit, each a little more than half of what is left: a search passes them in turn."""
    found = []
    while border != slit:
        way = int(0.51 * (slit - border)) or slit - border
        found.append((min(border, border + way), max(border, border + way)))
        border += way
    return found


def ladder(
    random: np.random.Generator, size: int, planes: int, width: int, *, square: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
    """As `screened`, with walls across x of slats that end at a slit of some width, or at a square hole; 0 for none."""
    boxes, far = [], 2 * size
    ends = np.array([[[-size, -size, -size], [-size // 2 - 2, size, size]]] * 2)
    ends[1, :, 0] = size // 2 + 2, size
    at = [int(random.integers(-size // 2, size - planes - width)) for _ in range(2)]
    for k, x in enumerate(np.linspace(-size // 2, size // 2, planes).round().astype(int).tolist()):
        for u in (1, 2)[: 1 + square]:
            slit = at[u - 1] + k
            for low, high in rungs(-size, slit) + rungs(size, slit + width):
                box = np.array([[x, -far, -far], [x, far, far]])
                box[:, u] = low, high
                boxes.append(box)
    turn, signs = random.permutation(3), random.choice([-1, 1], 3)
    ends, boxes = (np.sort(np.clip(g, -far, far)[:, :, turn] * signs, axis=1) for g in (ends, np.array(boxes)))
    return *ends.astype(np.int32), boxes.astype(np.int32), False


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
