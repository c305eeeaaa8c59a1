"""The shaft test against exact segments: what it hides no segment reaches, and single occluders are decided exactly."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from builders import random_solids
from builders.places import HARD_CASES
from builders.random_solids import shields_of
from viewcell.data.graph import OTHER_AXES
from viewcell.data.scene import GRID_M, Definition, Instance, Mesh, Role, Scene
from viewcell.data.solids import winding_numbers
from viewcell.data.verdict import Verdict
from viewcell.kernels.launch import Device
from viewcell.kernels.shaft import launch_shaft, patches_met
from viewcell.verify.cases.case_file import load_shadow_cases
from viewcell.verify.exact.sightline import Sight, Sightlines
from viewcell.verify.exact.umbra import hides, occluder

CASES = load_shadow_cases(HARD_CASES / "shadow.txt")
# Nothing is halved.
WHOLE = (2**25, 2**25)


def plate(outline):
    """A scene of one convex outline as a fan of triangles; corners in grid steps."""
    corners = np.array(outline, float) * GRID_M
    faces = np.array([[0, i, i + 1] for i in range(1, len(corners) - 1)], np.int32)
    return Scene([Definition("plate", (Mesh(corners, faces),))], [Instance("plate", "", 0, np.eye(4), Role.OCCLUDER)])


def random_outline(random, oblique):
    """A rectangle that is axial, or turned about one axis by whole steps, in grid steps."""
    axis = random.integers(3)
    u, v = OTHER_AXES[axis]
    size = random.integers(400, 4000, 2)
    corners = np.zeros((4, 3), int)
    corners[1:3, u] = size[0]
    corners[2:, v] = size[1]
    if oblique:
        corners[1:3, axis] = random.integers(100, 2000)
    return (corners + random.integers(-500, 500, 3)).tolist()


def boxes_around(random, outline):
    """A view cell on one side of the outline's middle, and boxes near its umbra."""
    corners = np.array(outline, float)
    middle, normal = corners.mean(axis=0), np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal /= np.linalg.norm(normal)
    place = middle - normal * random.uniform(300, 3000) + random.uniform(-300, 300, 3)
    cell = np.stack([place, place + random.integers(64, 600, 3)]).astype(np.int32)
    along = normal * random.uniform(100, 1500, (40, 1)) + random.uniform(-600, 600, (40, 3))
    low = (middle + along).astype(np.int32)
    return cell, np.stack([low, low + random.integers(1, 500, (40, 3))], axis=1).astype(np.int32)


def random_pairs(random, count, lowest=-1024, highest=6144):
    low = random.integers(lowest, highest, (2 * count, 3))
    boxes = np.stack([low, low + random.integers(64, 1500, (2 * count, 3))], axis=1).astype(np.int32)
    flat = random.random(2 * count) < 0.1
    boxes[flat, 1, 0] = boxes[flat, 0, 0]
    boxes[::2][flat[::2], 1, 0] += 64
    return boxes, np.arange(2 * count).reshape(-1, 2)


def corners_of(box):
    return np.array(list(product(*zip(box[0], box[1], strict=True))), float)


def eyes_and_points(random, v, x, count):
    """Segments from points of the open box v to points of the closed box x, corners included."""

    def points(box, inset):
        corners = corners_of(box)
        inner = box[0] + random.random((count, 3)) * (box[1] - box[0])
        pool = np.concatenate([corners + (box.mean(axis=0) - corners) * inset, inner])
        return np.round(pool[random.integers(0, len(pool), count)] * 1024.0) / 1024.0

    return points(v, 2.0**-7), points(x, 0.0)


@pytest.mark.parametrize("seed", range(4))
def test_no_segment_from_outside_solids_reaches_what_is_hidden(seed):
    scene = random_solids.random_solids(seed, axial=6, turned=4)
    random = np.random.default_rng(seed)
    shields, _, _ = shields_of(scene)
    boxes, rows = random_pairs(random, 2000)
    answers = launch_shaft(shields, boxes, rows, smallest=(64, 64), cap=300)
    hidden = rows[answers.verdict == Verdict.HIDDEN]
    assert 50 < len(hidden) < len(rows)
    segments = [eyes_and_points(random, boxes[v], boxes[x], 60) for v, x in hidden[:80]]
    origins, ends = (np.concatenate(part) for part in zip(*segments, strict=True))
    triangles, owners = scene.triangles()
    free = np.ones(len(origins), bool)
    for owner in np.unique(owners):
        free &= np.abs(winding_numbers(origins, triangles[owners == owner])) < 0.5
    assert free.sum() > 500
    clear = Sightlines(triangles, owners).check(origins[free], ends[free]) == Sight.CLEAR
    assert not clear.any(), (origins[free][clear][0], ends[free][clear][0])


@pytest.mark.parametrize("name", [case.name for case in CASES])
def test_hard_umbra_cases(name):
    case = next(case for case in CASES if case.name == name)
    scene = plate(case.outline)
    shields, _, _ = shields_of(scene)
    boxes = np.array([case.cell, case.box], np.int32)
    verdict = launch_shaft(shields, boxes, np.array([[0, 1]]), smallest=WHOLE).verdict[0]
    assert verdict == (Verdict.UNKNOWN if case.expected == "not" else Verdict.HIDDEN)


@pytest.mark.parametrize("oblique", [False, True])
def test_one_occluder_is_decided_as_in_rationals(oblique):
    """Without halving the test is exact for one convex outline, whatever touches."""
    random = np.random.default_rng(oblique)
    agreed = {True: 0, False: 0}
    for _ in range(12):
        outline = random_outline(random, oblique)
        shields, _, patches = shields_of(plate(outline))
        assert len(patches.area) == oblique
        cell, boxes = boxes_around(random, outline)
        everything = np.concatenate([[cell], boxes])
        rows = np.column_stack([np.zeros(len(boxes), int), 1 + np.arange(len(boxes))])
        hidden = launch_shaft(shields, everything, rows, smallest=WHOLE).verdict == Verdict.HIDDEN
        exact = occluder(cell.tolist(), outline)
        for box, answer in zip(boxes, hidden, strict=True):
            corners = [[Fraction(int(c)) for c in corner] for corner in corners_of(box)]
            beyond = min(exact.depth(corner) for corner in corners)
            wanted = beyond > 0 and all(hides(exact, corner) for corner in corners)
            # Behind an oblique plane by less than its normal is known: unknown, which is safe.
            near = oblique and beyond * beyond < sum(c * c for c in exact.normal)
            assert answer == wanted or (near and not answer), (cell, box)
            agreed[bool(wanted)] += 1
    assert min(agreed.values()) > 20


def test_two_walls_hide_together_only_after_halving():
    # A doorway between the halves of a wall, and a screen behind it: neither hides the box alone.
    walls = [([0, 0, 0], [0.2, 2, 3]), ([0, 3, 0], [0.2, 5, 3]), ([1, 1, 0], [1.2, 4, 3])]
    scene = random_solids.scene_of_meshes([random_solids.box(*wall) for wall in walls])
    shields, _, _ = shields_of(scene)
    boxes = np.array([[[-1024, 2300, 1024], [-512, 2800, 1536]], [[1400, 1500, 1024], [1600, 3500, 1536]]], np.int32)
    rows = np.array([[0, 1]])
    assert launch_shaft(shields, boxes, rows, smallest=WHOLE).verdict[0] == Verdict.HIDDEN
    boxes[1, :, 1] = 200, 4800
    assert launch_shaft(shields, boxes, rows, smallest=WHOLE).verdict[0] == Verdict.UNKNOWN
    answers = launch_shaft(shields, boxes, rows, smallest=(16, 16), cap=20_000, certify=True)
    assert answers.verdict[0] == Verdict.HIDDEN and answers.leaves[0] > 1
    sizes = (answers.certificate[:, 4:7] - answers.certificate[:, 1:4]).prod(axis=1) * (
        answers.certificate[:, 10:13] - answers.certificate[:, 7:10]
    ).prod(axis=1)
    assert sizes.sum() == np.prod(boxes[:, 1] - boxes[:, 0])


def test_answers_do_not_depend_on_threads_and_failing_pieces_are_unblocked_lines():
    scene = random_solids.random_solids(7)
    shields, _, _ = shields_of(scene)
    boxes, rows = random_pairs(np.random.default_rng(7), 3000)
    one = launch_shaft(shields, boxes, rows, smallest=(64, 64), cap=200, certify=True)
    two = launch_shaft(shields, boxes, rows, smallest=(64, 64), cap=200, certify=True, device=Device(threads=2))
    for name in ("verdict", "nodes", "leaves", "middle", "certificate", "starts"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
    failed = np.flatnonzero(one.verdict == Verdict.UNKNOWN)
    inside = (one.middle[failed, 0] >= boxes[rows[failed, 0], 0]) & (one.middle[failed, 0] <= boxes[rows[failed, 0], 1])
    assert inside.all()


def test_lines_past_all_oblique_occluders_meet_none():
    outline = [[0, 0, 0], [2048, 0, 1024], [2048, 2048, 1024], [0, 2048, 0]]
    shields, _, _ = shields_of(plate(outline))
    origins = np.array([[1024.0, 1024.0, 4096.0], [1024.0, 4096.0, 4096.0]])
    ends = origins - [0.0, 0.0, 8192.0]
    assert patches_met(shields, origins, ends).tolist() == [True, False]


def test_nothing_to_hide_with():
    shields, _, _ = shields_of(random_solids.scene_of_meshes([random_solids.box([0, 0, 0], [0.01, 0.01, 0.01])]))
    boxes, rows = random_pairs(np.random.default_rng(0), 10)
    assert (launch_shaft(shields, boxes, rows, smallest=(64, 64)).verdict == Verdict.UNKNOWN).all()


def test_a_surface_on_the_occluder_is_not_hidden_by_it():
    shields, _, _ = shields_of(plate([[0, 0, 0], [0, 2048, 0], [0, 2048, 2048], [0, 0, 2048]]))
    boxes = np.array([[[-800, 900, 900], [-700, 1000, 1000]], [[0, 900, 900], [0, 1000, 1000]]], np.int32)
    for shift, verdict in ((0, Verdict.UNKNOWN), (1, Verdict.HIDDEN)):
        moved = boxes + np.array([[[0]], [[shift]]]) * [1, 0, 0]
        assert launch_shaft(shields, moved.astype(np.int32), np.array([[0, 1]]), smallest=WHOLE).verdict[0] == verdict
