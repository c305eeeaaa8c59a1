"""Fences: a prism that a line meets in plan, and at its heights, but not at once, is missed; trees say so."""

from dataclasses import replace

import numpy as np
from builders.oblique_scenes import Oblique, around, halved, judge, ordered, scene, search, words_of
from viewcell.data.store.certificates import FENCES, FIRST_FENCE, FIRST_MISS, NODE_STEP
from viewcell.data.verdict import Verdict

HIDDEN, VISIBLE, UNKNOWN = Verdict.HIDDEN, Verdict.VISIBLE, Verdict.UNKNOWN


def larger(made: Oblique, scale: int) -> Oblique:
    plans = tuple(plan if plan is None else plan * scale for plan in made.plans)
    quads = np.array([ordered(quad) for quad in made.quads * scale])
    return replace(made, boxes=made.boxes * scale, plans=plans, quads=quads)


def fences_of(seeds: range, scale: int) -> list[int]:
    """Numbers of the fences in the trees of hidden scenes, whose proofs hold."""
    found = []
    for seed in seeds:
        made = larger(halved(scene(seed)), scale)
        answers = search(made)
        judge(made)
        if answers.verdict[0] == HIDDEN:
            nodes = [word // NODE_STEP for word in words_of(made, answers) if word >= 0]
            found += [node - FIRST_FENCE for node in nodes if FIRST_FENCE <= node < FIRST_MISS]
    return found


def test_trees_with_fences_hold():
    found = fences_of(range(500), 1) + fences_of(range(500), 64)
    edges = {number // FENCES // 2 for number in found}
    assert len(found) > 30 and {n // FENCES % 2 for n in found} == {0, 1}
    assert edges & set(range(4)) and edges & set(range(4, 8))
    # Pieces, and sides as a whole.
    assert len({number % FENCES for number in found}) > 5


def steep(gap: int) -> Oblique:
    """A low prism under a wall's foot, from a source above: only lines that enter through its top see it."""
    plan = np.array([[0, 0], [300, 100], [260, 220], [-40, 120]])
    boxes = np.array([[[100, -900, 800], [160, -800, 900]], around(plan, (0, 40))])
    wall = ordered(np.array([[-2000, -700, 40 + gap], [2096, 708, 4000]]))
    return halved(Oblique(boxes, (None, plan), wall[None], True), 6)


def test_a_wall_over_a_low_prism():
    """From above, a wall whose foot is high hides a prism behind it, until the foot is so high that one sees under."""
    verdicts = [judge(steep(gap)) for gap in (-100, 0, 150, 600, 1500)]
    assert verdicts[0] == HIDDEN and verdicts[-1] == VISIBLE
    assert verdicts == sorted(verdicts, key=[HIDDEN, UNKNOWN, VISIBLE].index)


def test_a_line_that_is_shown_meets_prisms_in_space():
    """Flat prisms that a steep line meets in plan and at their heights one after the other; lines hold in rationals."""
    seen = 0
    for seed in range(500):
        made = scene(seed)
        if all(plan is None for plan in made.plans):
            continue
        thin = made.boxes.copy()
        thin[:, 1, 2] = thin[:, 0, 2] + 1
        seen += judge(replace(made, boxes=thin, quads=made.quads[:1])) == VISIBLE
    assert seen > 80
