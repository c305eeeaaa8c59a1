"""Curtains in the line search: nothing hidden that a segment shows, every hidden pair has a proof, laws, vectors."""

from dataclasses import replace

import numpy as np
import pytest
from builders import oblique_scenes as made_of
from builders.oblique_scenes import LIMIT, Oblique, halved, judge, line_holds, ordered, scene, search, shown
from viewcell.data.verdict import Verdict
from viewcell.verify.exact.region import region_visible

HIDDEN, VISIBLE, UNKNOWN = Verdict.HIDDEN, Verdict.VISIBLE, Verdict.UNKNOWN


def compare(seeds: range, count: int) -> list[int]:
    """Verdicts of scenes; no random segment passes where all is hidden, lines and proofs hold."""
    found = [0, 0, 0, 0]
    for seed in seeds:
        made = halved(scene(seed)) if seed % 2 else scene(seed)
        verdict, seen = judge(made), shown(made, seed, count)
        assert not (seen and verdict == HIDDEN), f"seed {seed}: called hidden, but a segment is clear"
        found[verdict] += 1
        found[3] += seen
    return found


def test_what_segments_show_is_never_hidden():
    hidden, visible, unknown, seen = compare(range(800), 300)
    assert hidden > 240 and visible > 220 and seen > 360 and unknown < 260


@pytest.mark.slow
def test_what_segments_show_is_never_hidden_in_many_scenes():
    hidden, visible, unknown, seen = compare(range(100_000, 115_000), 1500)
    assert hidden > 4_500 and visible > 4_125 and seen > 6_750 and unknown < 4_875


def test_a_segment_along_a_hidden_pairs_side_is_found_by_sampling():
    """The reference sees: without its curtains every scene is shown."""
    for seed in range(60):
        made = scene(seed)
        far = made.quads + np.array([0, 0, 10_000])
        assert shown(replace(made, quads=far), seed, 400)


def small(seed: int) -> Oblique:
    """Few curtains and a target that is a surface."""
    return replace(scene(seed, curtains=2), strict=True)


def faces_of(box, plan) -> list:
    """Faces of an end as polygons; one for a flat end."""
    corners, (low, high) = made_of.corners_of(box, plan).tolist(), (int(box[0, 2]), int(box[1, 2]))
    rings = [[[*p, low] for p in corners], [[*p, high] for p in corners]]
    sides = [
        [[*a, low], [*b, low], [*b, high], [*a, high]] for a, b in zip(corners, corners[1:] + corners[:1], strict=True)
    ]
    return [face for face in rings + sides if np.unique(face, axis=0).shape[0] == 4]


def exact(made: Oblique) -> Verdict:
    """By the search in rationals, which shares nothing with the kernel."""
    walls = [[[*a[:2], a[2]], [*b[:2], a[2]], [*b[:2], b[2]], [*a[:2], b[2]]] for a, b in made.quads.tolist()]
    source, target = (faces_of(box, plan) for box, plan in zip(made.boxes, made.plans, strict=True))
    return region_visible(source, target, walls, nodes=3000).verdict


def test_small_scenes_have_the_exact_answer():
    found = []
    for seed in range(120):
        made = small(seed)
        verdict, truth = judge(made), exact(made)
        assert truth == UNKNOWN or verdict in (truth, UNKNOWN), f"seed {seed}"
        found.append((verdict, truth))
    assert min(found.count((v, v)) for v in (HIDDEN, VISIBLE)) > 15


# Curtains of one search, and its exact answer.
VECTORS = [
    ([(0, 0), (100, 37)], HIDDEN),
    ([(20, 7), (100, 37)], VISIBLE),
    ([(0, 0), (20, 7)], VISIBLE),
    ([(20, -300), (20, 300)], HIDDEN),
    ([(20, 300), (20, -300)], HIDDEN),
    ([(20, -300), (21, 300)], HIDDEN),
    ([(21, -300), (20, 300)], HIDDEN),
    ([(-300, 10), (300, 10)], HIDDEN),
]


def vector(ends, top: int = 25) -> Oblique:
    boxes = np.array([[[-50, 60, 5], [-40, 70, 25]], [[90, -60, 5], [100, -50, top]]])
    return Oblique(boxes, (None, None), np.array([ordered(np.array([[*ends[0], 0], [*ends[1], 30]]))]), True)


@pytest.mark.parametrize(("ends", "expected"), VECTORS)
def test_vectors(ends, expected):
    made = vector(ends)
    assert judge(made) == exact(made) == expected
    if expected == HIDDEN:
        assert search(made).nodes[0] <= 4


def test_a_target_that_rises_over_the_curtain_is_seen_over_it():
    made = vector([(0, 0), (100, 37)], top=60)
    assert judge(made) == exact(made) == VISIBLE


def laws():
    """Changes of points that keep the answer."""
    yield "x mirrored", lambda p: p * [-1, 1, 1]
    yield "y mirrored", lambda p: p * [1, -1, 1]
    yield "z mirrored", lambda p: p * [1, 1, -1]
    yield "x and y exchanged", lambda p: p[:, [1, 0, 2]]
    yield "at the border", lambda p: p + (LIMIT - 500)
    yield "at the other border", lambda p: p - np.array([LIMIT - 500, -LIMIT + 500, LIMIT - 500])
    yield "as large as the grid", lambda p: p * [LIMIT // 1000, LIMIT // 1000, LIMIT // 1000]


@pytest.mark.parametrize(("name", "change"), list(laws()))
def test_laws(name, change):
    same = 0
    for seed in range(150):
        made = scene(seed)
        before, after = judge(made), judge(made.moved(change))
        assert UNKNOWN in (before, after) or before == after, f"seed {seed}: {name}"
        same += before == after
    assert same > 120


def test_the_order_of_curtains_and_of_their_ends_changes_nothing():
    for seed in range(200):
        made = scene(seed)
        quads = np.array([ordered(quad[::-1]) for quad in made.quads[::-1]])
        before, after = judge(made), judge(replace(made, quads=quads))
        assert UNKNOWN in (before, after) or before == after, f"seed {seed}"


def test_a_curtain_that_is_met_but_not_stopped_is_unknown():
    """A line close over an oblique edge satisfies a relaxed way; there are no pieces."""
    made = vector([(0, 0), (100, 37)])
    low = replace(made, quads=made.quads + np.array([[0, 0, 0], [0, 0, -6]]))
    assert search(low).verdict[0] != HIDDEN
    count = [0, 0, 0]
    for seed in range(400):
        answers = search(scene(seed))
        count[answers.verdict[0]] += 1
        assert answers.verdict[0] != VISIBLE or line_holds(scene(seed), answers)
    assert count[UNKNOWN] > 40


def test_pieces_answer_what_whole_curtains_leave_open():
    whole, parts = [0, 0, 0], [0, 0, 0]
    for seed in range(300):
        made = scene(seed)
        # Ends at multiples of 8, so that halves of halves end on the grid.
        made = replace(made, quads=np.array([ordered(q) for q in made.quads * 8]), boxes=made.boxes * 8,
                       plans=tuple(p if p is None else p * 8 for p in made.plans))  # fmt: skip
        pieces = halved(made)
        one, other = search(made).verdict[0], judge(pieces)
        assert UNKNOWN in (one, other) or one == other, f"seed {seed}"
        whole[one] += 1
        parts[other] += 1
    assert parts[UNKNOWN] < 0.8 * whole[UNKNOWN]
