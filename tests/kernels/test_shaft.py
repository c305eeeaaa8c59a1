"""The shaft test against exact segments: what it hides no segment reaches, and single occluders are decided exactly."""

from fractions import Fraction
from itertools import product
from math import gcd

import numpy as np
import pytest
import warp as wp
from builders import outlines, random_solids
from builders.places import HARD_CASES
from builders.random_solids import shields_of
from viewcell.data.graph import OTHER_AXES
from viewcell.data.regions import LEAST_M2
from viewcell.data.scene import GRID_M, Definition, Instance, Mesh, Role, Scene
from viewcell.data.solids import winding_numbers
from viewcell.data.verdict import Verdict
from viewcell.kernels.launch import Device
from viewcell.kernels.shaft import launch_shaft, patches_met
from viewcell.kernels.shields import product_sign
from viewcell.verify.cases.case_file import load_shadow_cases
from viewcell.verify.exact.sightline import Sight, Sightlines
from viewcell.verify.exact.umbra import hides, occluder, umbra

CASES = load_shadow_cases(HARD_CASES / "shadow.txt")
# Nothing is halved.
WHOLE = (2**25, 2**25)
LIMIT = 2**24


def plate(outline):
    """A scene of one convex outline as a fan of triangles; corners in grid steps."""
    corners = np.array(outline, float) * GRID_M
    assert np.abs(outline).max() <= LIMIT
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


@pytest.mark.parametrize("size", [1, 2000])
@pytest.mark.parametrize("oblique", [False, True])
def test_one_occluder_is_decided_as_in_rationals(oblique, size):
    """Without halving the test is exact for one convex outline, small or as large as the grid."""
    random = np.random.default_rng(oblique)
    agreed = [0, 0]
    for _ in range(6):
        outline = random_outline(random, oblique)
        cell, boxes = boxes_around(random, outline)
        boxes = size * boxes + random.integers(0, size, (1, 1, 3))
        hidden, wanted, near = decided_exactly((size * np.array(outline)).tolist(), size * cell, boxes)
        assert ((hidden == wanted) | (near & ~hidden)).all()
        agreed[0], agreed[1] = agreed[0] + wanted.sum(), agreed[1] + (~wanted).sum()
    assert min(agreed) > 10


@wp.kernel
def _signs(n: wp.array[wp.vec3d], q: wp.array[wp.vec3d], out: wp.array[int]):
    row = wp.tid()
    out[row] = product_sign(n[row], q[row])


def test_sign_of_a_product_is_exact():
    """Normals of 51 bits and points of 25 whose product all but vanishes: far below what float64 can tell."""
    rng = np.random.default_rng(3)
    normals, points, truth = [], [], []
    while len(truth) < 500:
        q = rng.integers(-(2**25), 2**25, 3).tolist()
        if gcd(q[1], q[2]) != 1 or abs(q[2]) < 2:
            continue
        first, wanted = int(rng.integers(-(2**50), 2**50)), int(rng.integers(-2, 3) * 2 ** rng.integers(0, 22))
        second = (wanted - first * q[0]) * pow(q[1], -1, abs(q[2])) % abs(q[2])
        second += abs(q[2]) * int(rng.integers(-(2**25), 2**25))
        n = [first, second, (wanted - first * q[0] - second * q[1]) // q[2]]
        if max(map(abs, n)) <= 2**51:
            normals.append(n)
            points.append(q)
            truth.append((wanted > 0) - (wanted < 0))
    out = wp.zeros(len(truth), dtype=int, device="cpu")
    inputs = [wp.array(np.array(x, float), dtype=wp.vec3d, device="cpu") for x in (normals, points)]
    wp.launch(_signs, dim=len(truth), inputs=[*inputs, out], device="cpu")
    np.testing.assert_array_equal(out.numpy(), truth)


def decided_exactly(outline, cell, boxes, within=hides):
    """The kernel's verdict and the exact one of each box behind one convex outline, and where it may withhold."""
    ends = np.array([np.min(outline, axis=0), np.max(outline, axis=0)])
    rectangle = len(outline) == 4 and ((outline == ends[0]) | (outline == ends[1])).all()
    area = np.sort(ends[1] - ends[0])[1:].prod() * GRID_M**2
    left_out = (ends[0] == ends[1]).any() and not (rectangle and area >= LEAST_M2)
    shields, _, patches = shields_of(plate(outline))
    rows = np.column_stack([np.zeros(len(boxes), int), 1 + np.arange(len(boxes))])
    everything = np.concatenate([[cell], boxes]).astype(np.int32)
    hidden = launch_shaft(shields, everything, rows, smallest=WHOLE).verdict == Verdict.HIDDEN
    exact = occluder(cell.tolist(), outline)
    wanted, near = [], []
    for box in boxes:
        corners = [[Fraction(int(c)) for c in corner] for corner in corners_of(box)]
        beyond = min(exact.depth(corner) for corner in corners)
        wanted.append(not exact.straddles and beyond > 0 and all(within(exact, corner) for corner in corners))
        # Next to an oblique plane by less than its normal is known, and where an outline is cut into rectangles or too
        # small: unknown, which is safe.
        before = min(-exact.depth([Fraction(int(c)) for c in corner]) for corner in corners_of(cell))
        least = min(beyond, before)
        close = least * least < Fraction(1, 100) * sum(c * c for c in exact.normal)
        near.append(left_out or (len(patches.area) and close))
    return hidden, np.array(wanted, bool), np.array(near, bool)


def lattice_scene(random):
    """An outline, a cell and boxes on few coordinates, so that corners, edges and planes meet all the time."""
    step = int(random.choice([64, 256, LIMIT // 512]))
    while True:
        outline = outlines.random_outline(random)
        if random.random() < 0.3:
            outline = np.array(random_outline(random, False)) // 200
        oblique = (np.ptp(outline, axis=0) > 0).all()
        if np.ptp(outline) < 240 and np.ptp(outline, axis=0).max() > 2 and (oblique or random.random() < 0.3):
            break
    middle = np.round(outline.mean(axis=0)).astype(int)
    low = middle + random.integers(-40, 40, 3)
    cell = np.stack([low, low + random.integers(1, 6, 3)])
    # A corner of each box on the border of the umbra, where a corner of the cell is seen past one of the outline, or
    # a step off it; of some boxes there the one that is hidden best.
    eyes = cell[random.integers(0, 2, (400, 3)), np.arange(3)]
    past = outline[random.integers(0, len(outline), 400)]
    corner = past + random.integers(1, 3, (400, 1)) * (past - eyes)
    exact = occluder(cell.tolist(), outline.tolist())
    held = [umbra(exact, point) for point in corner.tolist()]
    corner = corner[np.argsort(~np.array(held), kind="stable")[:60]]
    corner = corner + (random.random((60, 1)) < 0.3) * random.integers(-1, 2, (60, 3))
    # Some on the outline itself, which hides nothing of what lies on it.
    corner[:6] = past[:6]
    boxes = [cell]
    for point in corner:
        tried = [np.sort([point, point + random.integers(-4, 5, 3)], axis=0) for _ in range(8)]
        boxes.append(min(tried, key=lambda box: sum(not umbra(exact, x) for x in corners_of(box).tolist())))
    boxes = np.array(boxes)
    about = np.concatenate([outline, boxes.reshape(-1, 3)])
    shift = -((about.min(axis=0) + about.max(axis=0)) // 2)
    step = min(step, (LIMIT - 1) // np.abs(about + shift).max())
    away = random.choice([-1, 0, 1], 3) * (LIMIT - 1 - step * np.abs(about + shift).max())
    outline, boxes = ((part + shift) * step + away for part in (outline, boxes))
    return outline.tolist(), boxes[0], boxes[1:]


def check_lattice(seed, scenes):
    random, agreed = np.random.default_rng(seed), [0, 0]
    for _ in range(scenes):
        outline, cell, boxes = lattice_scene(random)
        hidden, wanted, near = decided_exactly(outline, cell, boxes, umbra)
        assert not (hidden & ~wanted).any(), (outline, cell.tolist(), boxes[hidden & ~wanted].tolist())
        assert (hidden | ~wanted | near).all(), (outline, cell.tolist(), boxes[wanted & ~hidden].tolist())
        agreed[0], agreed[1] = agreed[0] + wanted.sum(), agreed[1] + (~wanted).sum()
    return agreed


def test_one_occluder_is_decided_as_in_rationals_where_everything_touches():
    assert min(check_lattice(4, 40)) > 60


@pytest.mark.slow
def test_one_occluder_is_decided_as_in_rationals_where_everything_touches_many():
    assert min(check_lattice(5, 500)) > 1000


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


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("axis", range(3))
def test_a_surface_on_the_occluder_is_not_hidden_by_it(axis, side):
    outline = np.array([[0, 0, 0], [0, 2048, 0], [0, 2048, 2048], [0, 0, 2048]])
    shields, _, _ = shields_of(plate(np.roll(outline, axis, axis=1).tolist()))
    boxes = np.array([[[-800, 900, 900], [-700, 1000, 1000]], [[0, 900, 900], [0, 1000, 1000]]])
    for shift, verdict in ((0, Verdict.UNKNOWN), (1, Verdict.HIDDEN)):
        moved = (boxes + np.array([[[0]], [[shift]]]) * [1, 0, 0]) * [side, 1, 1]
        moved = np.roll(np.sort(moved, axis=1), axis, axis=2).astype(np.int32)
        assert launch_shaft(shields, moved, np.array([[0, 1]]), smallest=WHOLE).verdict[0] == verdict
