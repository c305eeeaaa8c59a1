"""The target search against brute force, exact lines and proofs: what it calls hidden or visible is so."""

from fractions import Fraction
from itertools import permutations

import numpy as np
import pytest
from builders import needles
from builders.blocker_scenes import blockers_of, case, ladder, random_blockers, random_box, screened, shown
from viewcell.data.verdict import Verdict
from viewcell.kernels.blockers import blocker_tree
from viewcell.kernels.line_tree import launch_line_trees
from viewcell.kernels.target import MAX_BRANCHES, launch_target_search
from viewcell.verify.proofs.line_tree import Blocker, hides
from viewcell.verify.proofs.ways import End

LIMIT = 2**24


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
    compare(range(10_000, 25_000), 4000)


def test_a_blocker_behind_the_near_face_of_the_target_hides_nothing_before_it():
    """The plane of the blocker cuts through the target: sightlines end on the target before they get there."""
    source, target = [[0, 0, 0], [2, 2, 2]], [[8, -4, 0], [12, 6, 2]]
    # A wide wall through the target's middle, seen past its own front part only.
    wall = [[9, -40, -40], [9, 40, 40]]
    answers = launch_target_search(
        blocker_tree(blockers_of(np.array([wall]))), np.array([source, target], np.int32), np.array([[0, 1, 1]])
    )
    assert answers.verdict[0] == Verdict.VISIBLE


@pytest.mark.parametrize("strict", [0, 1])
@pytest.mark.parametrize("reach", [40, 400])
@pytest.mark.parametrize("end", ["source", "target"])
@pytest.mark.parametrize("axes", list(permutations(range(3))))
def test_a_blocker_through_a_box_hides_nothing_on_the_near_side(axes, end, reach, strict):
    """A wall through the target, or the source, of which only the part before it is in sight."""
    near, cut, wall = [[0, -30, 0], [2, -28, 2]], [[8, -4, 0], [30, 6, 2]], [[9, -reach, -reach], [9, reach, reach]]
    near, cut, wall = (np.array(box, np.int32)[:, axes] for box in (near, cut, wall))
    ends = [near, cut] if end == "target" else [cut, near]
    tree = blocker_tree(blockers_of(wall))
    answers = launch_target_search(tree, np.stack(ends), np.array([[0, 1, strict]]))
    assert answers.verdict[0] == Verdict.VISIBLE and answers.nodes[0] > 1


@pytest.mark.parametrize("seed", range(3))
def test_blockers_through_boxes_hide_only_what_no_segment_reaches(seed):
    """Nodes of a hierarchy have walls inside; a sightline need not pass those that come after it has entered."""
    random, count = np.random.default_rng(seed), [0, 0]
    for _ in range(150):
        source, target = (random_box(random, False) for _ in range(2))
        if ((source[0] < target[1]) & (target[0] < source[1])).all():
            continue
        boxes, strict = random_blockers(random, int(random.integers(3, 12))), bool(random.integers(2))
        for box in boxes:
            # Most go through the target or the source.
            axis, through = int((box[0] == box[1]).argmax()), (source, target)[random.integers(2)]
            box[:, axis] = random.integers(through[0, axis], through[1, axis] + 1)
        verdict, _ = judge(source, target, boxes, strict)
        seen = shown(source, target, boxes, strict, int(random.integers(2**31)), 1000)
        assert not (verdict == Verdict.HIDDEN and seen)
        count[0], count[1] = count[0] + seen, count[1] + (verdict == Verdict.HIDDEN)
    assert min(count) > 3


def test_a_row_of_cabinets_does_not_hide_its_own_front():
    """Found by rays in a real model: fronts of a row merge into one blocker inside the box of each cabinet."""
    source, target = [[40, -10, 12], [60, 30, 40]], [[-8, -37, -31], [2, -30, -22]]
    fronts = [[-18, -31, -30], [23, -31, -22]]
    answers = launch_target_search(
        blocker_tree(blockers_of(np.array([fronts]))), np.array([source, target], np.int32), np.array([[0, 1, 1]])
    )
    assert answers.verdict[0] == Verdict.VISIBLE


def mirrored(box, octant):
    """A box in whole numbers after the axes were mirrored on which the octant is negative."""
    low, high = ([int(c) for c in corner] for corner in box)
    flip = [octant >> i & 1 for i in range(3)]
    return [[-other[i] if flip[i] else own[i] for i in range(3)] for own, other in ((low, high), (high, low))]


def line_holds(source, target, boxes, strict, answers, row=0):
    """Whether a visible answer's line passes the insides of both boxes and no blocker between, in rationals."""
    octant = int(answers.octant[row])
    w, xi = ([Fraction(float(c)) for c in column[row]] for column in (answers.line, answers.offset))

    def times(corner):
        return [a * c - x for a, c, x in zip(w, corner, xi, strict=True)]

    ends = []
    for box in (source, target):
        low, high = mirrored(box, octant)
        enter, leave = times(low), times(high)
        if any(enter[i] >= leave[j] for i in range(3) for j in range(3) if i != j):
            return False
        ends.append((max(enter), min(leave)))
    begin, end = ends[0][1], ends[1][0]
    for box in boxes:
        low, high = mirrored(box, octant)
        axis = next(i for i in range(3) if low[i] == high[i])
        time = w[axis] * low[axis] - xi[axis]
        if begin <= time < end or (time == end and not strict):
            point = [(time + x) / a for a, x in zip(w, xi, strict=True)]
            if all(low[i] <= point[i] <= high[i] for i in range(3) if i != axis):
                return False
    return True


def judge(source, target, boxes, strict, cap=20_000, *, certain=True):
    """The verdict, after its line was checked in rationals or its proof in whole numbers."""
    tree, rows = blocker_tree(blockers_of(boxes)), np.array([[0, 1, int(strict)]])
    ends = np.stack([source, target]).astype(np.int32)
    answers = launch_target_search(tree, ends, rows, cap=cap)
    if answers.verdict[0] == Verdict.VISIBLE:
        assert line_holds(source, target, boxes, strict, answers), "wrong-visible"
        # The crossing times of other lines are rounded, and so they should keep clear of everything by a step. What is
        # in no list of the search is only not met: once in thousands of needles it is nearer.
        grown = boxes + np.array([[-1], [1]]) * (boxes[:, :1] != boxes[:, 1:])
        whole = (answers.line[0] == np.floor(answers.line[0])).all()
        assert not certain or whole or line_holds(source, target, grown, strict, answers), "not certain"
    if answers.verdict[0] == Verdict.HIDDEN:
        words = launch_line_trees(tree, ends, rows, answers.nodes).words.tolist()
        blockers = {n: Blocker(int((box[0] == box[1]).argmax()), box.tolist()) for n, box in enumerate(boxes)}
        assert hides(End(ends[0].tolist()), End(ends[1].tolist()), strict, words, blockers), "no proof"
    return int(answers.verdict[0]), int(answers.nodes[0])


def spread(scene, random):
    """The scene at the size of the grid: stretched on each axis alone and, if it is small, moved to the border."""
    source, target, boxes, strict = scene
    most = np.abs(np.concatenate([source, target, *boxes])).max()
    scale = random.integers(1, LIMIT // most, 3) if random.random() < 0.7 else 1
    away = random.choice([-1, 1], 3) * (LIMIT - most) if np.isscalar(scale) else 0
    return *(group.astype(np.int64) * scale + away for group in (source, target, boxes)), strict


def check_at_the_border(seeds):
    count = [0, 0, 0]
    for seed in seeds:
        scene = case(seed) if seed % 2 else screened(seed, holes=seed // 4 % 3)
        if scene is None or not len(scene[2]):
            continue
        found, _ = judge(*spread(scene, np.random.default_rng(seed)))
        assert found == judge(*scene)[0] or found == Verdict.UNKNOWN, f"seed {seed}"
        count[found] += 1
    return count


def test_size_and_place_change_nothing():
    hidden, visible, unknown = check_at_the_border(range(600))
    assert min(hidden, visible) > 100 and unknown < 5


@pytest.mark.slow
def test_size_and_place_change_nothing_in_many_cases():
    check_at_the_border(range(10_000, 20_000))


def test_a_search_with_any_cap_agrees_with_itself_or_withholds():
    withheld = 0
    for seed in range(300):
        scene = screened(seed, holes=seed // 4 % 3)
        if not len(scene[2]):
            continue
        truth, spent = judge(*scene)
        assert truth != Verdict.UNKNOWN
        for cap in range(1, spent + 1):
            found, _ = judge(*scene, cap=cap)
            assert found in (truth, Verdict.UNKNOWN), f"seed {seed}, cap {cap}"
            withheld += found == Verdict.UNKNOWN
    assert withheld > 300


def check_needles(count, seed, **options):
    """Walls that leave slits of a step: whether a line passes them all is known, and hangs on 2**-24 of a step."""
    random, tally = np.random.default_rng(seed), {True: [0, 0, 0], False: [0, 0, 0]}
    for _ in range(count):
        found = needles.needle(random)
        ends, walls = needles.turned(random, needles.ends(found), needles.walls_of(found))
        verdict, _ = judge(*ends, walls, False, **options)
        tally[found.opens][verdict] += 1
    assert tally[True][Verdict.HIDDEN] == 0, "wrong-hidden"
    assert tally[False][Verdict.VISIBLE] == 0, "wrong-visible"
    assert min(tally[True][Verdict.VISIBLE], tally[True][Verdict.UNKNOWN], tally[False][Verdict.HIDDEN]) > count // 20
    return tally


def test_needles():
    check_needles(150, seed=0)


@pytest.mark.slow
def test_many_needles():
    check_needles(10_000, seed=1, certain=False)


def test_the_deepest_search_withholds():
    """Slats that a search passes one after the other, up to a hole of known size: 0 steps, or more."""
    random, unknown = np.random.default_rng(2), 0
    for n in range(24):
        width = n % 4
        scene = ladder(random, LIMIT // 2, 2 + n % 2, width, square=True)
        verdict, nodes = judge(*scene)
        assert verdict != (Verdict.HIDDEN if width else Verdict.VISIBLE)
        # Well below the cap: what ends it is its depth.
        unknown += verdict == Verdict.UNKNOWN and int(MAX_BRANCHES) <= nodes < 2000
    assert unknown > 3


def test_a_line_called_visible_crosses_nothing():
    """However weak the blockers on a line are, they are on it."""
    tried = [judge(*made)[0] for seed in range(400) if (made := case(seed)) is not None and len(made[2])]
    assert tried.count(Verdict.VISIBLE) > 100
