"""The target search against brute force: whatever a random segment shows must not be called hidden."""

import numpy as np
import pytest
from builders.blocker_scenes import blockers_of, case, clear_segments, shown
from viewcell.data.verdict import Verdict
from viewcell.kernels.blockers import blocker_tree
from viewcell.kernels.target import launch_target_search


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
        hidden = answers.verdict[0] == Verdict.HIDDEN
        seen = shown(source, target, boxes, strict, seed, segments)
        assert not (hidden and seen), f"seed {seed}: called hidden, but a random segment is clear"
        count["hidden"] += int(hidden)
        count["visible"] += int(answers.verdict[0] == Verdict.VISIBLE)
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
    assert answers.verdict[0] == Verdict.VISIBLE


def test_a_row_of_cabinets_does_not_hide_its_own_front():
    """Found by rays in a real model: fronts of a row merge into one blocker inside the box of each cabinet."""
    source, target = [[40, -10, 12], [60, 30, 40]], [[-8, -37, -31], [2, -30, -22]]
    fronts = [[-18, -31, -30], [23, -31, -22]]
    answers = launch_target_search(
        blocker_tree(blockers_of(np.array([fronts]))), np.array([source, target], np.int32), np.array([[0, 1, 1]])
    )
    assert answers.verdict[0] == Verdict.VISIBLE


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
        if answers.verdict[0] != Verdict.VISIBLE:
            continue
        sign = np.where((answers.octant[0] >> np.arange(3)) & 1, -1.0, 1.0)
        w, xi = answers.line[0], answers.offset[0]
        ends = [np.sort(box * sign, axis=0) for box in (source, target)]
        leave, enter = (w * ends[0][1] - xi).min(), (w * ends[1][0] - xi).max()
        segment = sign * (np.array([[leave], [enter]]) + xi) / w
        assert clear_segments(boxes, segment[:1], segment[1:], strict)[0], f"seed {seed}"
        tried += 1
    assert tried > 100
