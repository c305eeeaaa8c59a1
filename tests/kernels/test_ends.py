"""Prisms as ends of a search: what an open view shows is never hidden, and what an edge parts is told apart."""

from dataclasses import replace

import numpy as np
import pytest
from builders.oblique_scenes import Oblique, around, judge, ordered, proved, scene, search, shown, words_of
from viewcell.data.store.certificates import FIRST_MISS, NODE_STEP, PARTING
from viewcell.data.verdict import Verdict

HIDDEN, VISIBLE, UNKNOWN = Verdict.HIDDEN, Verdict.VISIBLE, Verdict.UNKNOWN
FAR = np.array([[[1000, 1000, 5000], [1001, 1003, 5001]]])


def cut_tags(words):
    """Tags of all cuts of a tree."""
    tags, left = [], 0
    for word in words:
        if word < 0:
            more, tag = (0, -1 - word) if left else divmod(-1 - word, 1 << 24)
            left = left - 1 if left else more
            tags.append(tag)
    return tags


def test_ends_see_each_other_where_nothing_is_between():
    found = [0, 0, 0]
    for seed in range(600):
        found[judge(replace(scene(seed), quads=FAR))] += 1
    assert found[HIDDEN] == 0 and found[VISIBLE] > 500


def test_both_ends_as_prisms_are_narrower_than_their_boxes():
    """What hides boxes hides prisms in them; and some prisms are hidden whose boxes are not."""
    more = 0
    for seed in range(400):
        made = scene(seed)
        boxes = replace(made, plans=(None, None))
        if all(plan is None for plan in made.plans) or (
            (made.boxes[0, 0] < made.boxes[1, 1]).all() and (made.boxes[1, 0] < made.boxes[0, 1]).all()
        ):
            continue
        wide, own = judge(boxes), judge(made)
        assert wide != HIDDEN or own != VISIBLE, f"seed {seed}"
        more += own == HIDDEN and wide != HIDDEN
    assert more > 3


def beside_each_other(gap: int, at: float = 0.5) -> Oblique:
    """Two prisms whose axial boxes overlap, along one direction; and a wall so far across the gap."""
    plan = np.array([[0, 0], [40, 20], [30, 40], [-10, 20]])
    other = plan + np.array([-10, 20]) + gap * np.array([-1, 2])
    boxes = np.array([around(plan, (0, 20)), around(other, (5, 25))])
    a, b = plan[3] + [-40, -20], plan[2] + [40, 20]
    wall = ordered(np.array([[*a, -5000], [*b, 5000]])) + int(gap * at) * np.array([-1, 2, 0])
    return Oblique(boxes, (plan, other), np.array([wall]), True)


def test_a_wall_between_prisms_whose_boxes_overlap():
    for gap in (4, 6, 8):
        made = beside_each_other(gap)
        assert (made.boxes[0, 0] < made.boxes[1, 1]).all() and (made.boxes[1, 0] < made.boxes[0, 1]).all()
        answers = search(made)
        words = words_of(made, answers)
        assert answers.verdict[0] == HIDDEN and proved(made, words)
        assert any(tag % 8 == PARTING for tag in cut_tags(words))


def test_a_wall_on_the_face_of_the_target_hides_a_cell_but_not_an_object():
    made = beside_each_other(4, at=1.0)
    assert judge(replace(made, strict=False)) == HIDDEN
    assert judge(made) != HIDDEN and shown(made, 0, 200)


@pytest.mark.parametrize("step", [-1, 1])
def test_a_wall_a_step_short_of_the_gap_shows_it(step):
    """The wall is exactly as long as the shaft of the two prisms where it stands; less is seen past."""
    made = beside_each_other(8)
    wall = made.quads[0].copy()
    wall[0 if step < 0 else 1, :2] = wall[:, :2].sum(axis=0) // 2
    assert judge(replace(made, quads=wall[None])) == VISIBLE


def test_corners_between_the_outermost_count():
    """Sightlines that meet the target only past the corner between its leftmost and its topmost one."""
    target = np.array([[0, 0], [200, 200], [125, 191], [50, 180]])
    boxes = np.array([[[-500, -320, 5], [-480, -300, 25]], around(target, (5, 25))])
    made = Oblique(boxes, (None, target), np.array([[[-60, -20, 0], [20, 60, 30]]]), True)
    assert judge(made) == VISIBLE and shown(made, 1, 20_000)


def test_trees_ask_which_corner_of_a_plan_is_passed():
    named = set()
    for seed in range(800):
        made = scene(seed)
        answers = search(made)
        if answers.verdict[0] == HIDDEN:
            named |= {word // NODE_STEP - FIRST_MISS for word in words_of(made, answers) if word >= 0}
    assert {0, 1, 2, 3} <= named
