"""The target search against brute force: whatever a random segment shows must not be called hidden."""

import numpy as np
import pytest
from viewcell.data.blockers import Blockers
from viewcell.data.graph import OTHER_AXES
from viewcell.data.hierarchy import build_hierarchy
from viewcell.kernels.target import blocker_tree, launch_target_search

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


def compare(seeds: range, segments: int) -> dict[str, int]:
    count = {"hidden": 0, "visible": 0, "shown": 0}
    for seed in seeds:
        made = case(seed)
        if made is None:
            continue
        source, target, boxes, strict = made
        if not len(boxes):
            continue
        answers = launch_target_search(
            blocker_tree(blockers_of(boxes)), np.stack([source, target]), np.array([[0, 1, int(strict)]]), cap=5000
        )
        hidden = answers.verdict[0] == 0
        seen = shown(source, target, boxes, strict, seed, segments)
        assert not (hidden and seen), f"seed {seed}: called hidden, but a random segment is clear"
        count["hidden"] += int(hidden)
        count["visible"] += int(answers.verdict[0] == 1)
        count["shown"] += int(seen)
    return count


def test_what_random_segments_show_is_never_hidden():
    count = compare(range(1500), 2000)
    assert min(count.values()) > 20


@pytest.mark.slow
def test_what_random_segments_show_is_never_hidden_in_many_cases():
    compare(range(10_000, 40_000), 4000)


def test_a_blocker_behind_the_near_face_of_the_target_hides_nothing_before_it():
    """The plane of the blocker cuts through the target: sightlines end on the target before they get there."""
    source, target = [[0, 0, 0], [2, 2, 2]], [[8, -4, 0], [12, 6, 2]]
    # A wide wall through the target's middle, seen past its own front part only.
    wall = [[9, -40, -40], [9, 40, 40]]
    answers = launch_target_search(
        blocker_tree(blockers_of(np.array([wall]))), np.array([source, target], np.int32), np.array([[0, 1, 1]])
    )
    assert answers.verdict[0] == 1


def test_a_row_of_cabinets_does_not_hide_its_own_front():
    """Found by rays in a real model: fronts of a row merge into one blocker inside the box of each cabinet."""
    source, target = [[40, -10, 12], [60, 30, 40]], [[-8, -37, -31], [2, -30, -22]]
    fronts = [[-18, -31, -30], [23, -31, -22]]
    answers = launch_target_search(
        blocker_tree(blockers_of(np.array([fronts]))), np.array([source, target], np.int32), np.array([[0, 1, 1]])
    )
    assert answers.verdict[0] == 1


def test_a_line_called_visible_crosses_nothing():
    """However weak the blockers on a line are, they are on it."""
    tried = 0
    for seed in range(400):
        made = case(seed)
        if made is None or not len(made[2]):
            continue
        source, target, boxes, strict = made
        answers = launch_target_search(
            blocker_tree(blockers_of(boxes)), np.stack([source, target]), np.array([[0, 1, int(strict)]]), cap=5000
        )
        if answers.verdict[0] != 1:
            continue
        sign = np.where((answers.octant[0] >> np.arange(3)) & 1, -1.0, 1.0)
        w, xi = answers.line[0], answers.offset[0]
        ends = [np.sort(box * sign, axis=0) for box in (source, target)]
        leave, enter = (w * ends[0][1] - xi).min(), (w * ends[1][0] - xi).max()
        segment = sign * (np.array([[leave], [enter]]) + xi) / w
        assert clear_segments(boxes, segment[:1], segment[1:], strict)[0], f"seed {seed}"
        tried += 1
    assert tried > 100
