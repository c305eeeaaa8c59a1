"""From-region visibility against its checker, sampled segments, single umbras, the shaft kernel, and laws."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from builders.random_solids import shields_of
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.errors import InputError
from viewcell.data.scene import GRID_M, Definition, Instance, Mesh, Role, Scene
from viewcell.data.verdict import Verdict
from viewcell.kernels.shaft import launch_shaft
from viewcell.verify.arithmetic import along, box_corners, cross, dot, minus, rational
from viewcell.verify.exact.matrix_game import play
from viewcell.verify.exact.region import _corner, _dual, box_faces, cell_faces, region_visible, segment_clear
from viewcell.verify.exact.umbra import hides, occluder
from viewcell.verify.proofs.region import _hidden, holds, plane, side

CELL = [[-60, -6, -6], [-50, 6, 6]]
OCTAGON = ((6, 0), (4, 4), (0, 6), (-4, 4), (-6, 0), (-4, -4), (0, -6), (4, -4))


def random_polygon(random, centre, size):
    """Three to five corners of an octagon in a random plane."""
    while True:
        u, v = random.integers(-3, 4, (2, 3))
        if np.cross(u, v).any():
            break
    picked = np.sort(random.choice(8, random.integers(3, 6), replace=False))
    steps = [OCTAGON[k] for k in picked]
    return [
        [Fraction(int(c)) + Fraction(int(size * (x * a + y * b)), 12) for c, a, b in zip(centre, u, v, strict=True)]
        for x, y in steps
    ]


def far_target(random):
    return random_polygon(random, [50, *random.integers(-5, 6, 2)], random.integers(3, 8))


def loose(random):
    """Polygons between cell and target, of a size that hides about half of the targets."""
    return [
        random_polygon(random, random.integers(-12, 13, 3), random.integers(4, 20))
        for _ in range(random.integers(1, 9))
    ]


def strips(random):
    """A wall cut into strips, some of them out of line, with overlaps or gaps."""
    half, lean = random.integers(7, 25), random.integers(0, 9)
    cuts = sorted({-half, half, *random.integers(1 - half, half, random.integers(1, 4)).tolist()})
    walls = []
    for a, b in pairwise(cuts):
        x, more = random.integers(-lean, lean + 1), random.integers(0, 2) if lean else 0
        walls.append([[x, a - more, -half], [x, b + more, -half], [x, b + more, half], [x, a - more, half]])
    return [[[int(c) for c in corner] for corner in wall] for wall in walls]


def panels(random):
    """A slanted wall of four panels whose joints meet in T-junctions."""
    half, slant = int(random.integers(7, 14)), random.integers(-1, 2, 2)
    middle, walls = int(random.integers(-5, 6)), []
    for a, b in ((-half, middle), (middle, half)):
        joint = int(random.integers(-5, 6))
        for c, d in ((-half, joint), (joint, half)):
            corners = ((a, c), (b, c), (b, d), (a, d))
            walls.append([[int(slant[0] * y + slant[1] * z), y, z] for y, z in corners])
    return walls


def stacked_boxes(random):
    """Boxes on top of each other; faces touch."""
    y, walls = -int(random.integers(6, 14)), []
    for _ in range(random.integers(1, 4)):
        x, half, height = int(random.integers(-10, 5)), int(random.integers(6, 14)), int(random.integers(4, 16))
        walls += box_faces([x, y, -half], [x + int(random.integers(2, 12)), y + height, half])
        y += height
    return walls


SCENES = {"loose": loose, "strips": strips, "panels": panels, "stacked_boxes": stacked_boxes}


def strictly_inside(point, faces):
    for face in faces:
        n, c = plane(face)
        if dot(n, point) >= c:
            return False
    return True


def in_polygon(polygon, n, x):
    """Whether a point of its plane is in the closed convex polygon, either way round."""
    pairs = zip(polygon, [*polygon[1:], polygon[0]], strict=True)
    turns = [dot(n, cross(minus(b, a), minus(x, a))) for a, b in pairs]
    return min(turns) >= 0 or max(turns) <= 0


def meets(start, end, wall):
    """Whether the closed segment meets the closed polygon; None in its plane."""
    n, c = plane(wall)
    before, behind = dot(n, start) - c, dot(n, end) - c
    if before == behind == 0:
        return None
    if before * behind > 0:
        return False
    return in_polygon(wall, n, along(start, before / (before - behind), minus(end, start)))


def check(cell, target, walls, **options):
    """The verdict, after its proof has been checked by other means."""
    answer, faces = region_visible(cell, target, walls, **options), cell_faces(cell)
    target, walls = rational(target), [rational(wall) for wall in walls]
    if answer.verdict is Verdict.HIDDEN:
        assert holds(faces, target, walls, answer.certificate[0])
    if answer.verdict is Verdict.VISIBLE:
        n, c = plane(target)
        assert strictly_inside(answer.start, faces) and dot(n, answer.start) != c == dot(n, answer.end)
        # Inside even with every corner pulled in a little.
        pulled = [along(corner, Fraction(1, 10**40), minus(answer.end, corner)) for corner in target]
        assert in_polygon(target, n, answer.end) and in_polygon(pulled, n, answer.end)
        for wall in walls:
            assert meets(answer.start, answer.end, wall) is False or all(dot(n, corner) == c for corner in wall)
    return answer.verdict


def sampled(random, cell, target, walls, count):
    """Whether one of many segments is clear; found in float64, confirmed in rationals."""
    low, high = np.array(cell, float)
    eyes = low + (high - low) * random.integers(1, 64, (count, 3)) / 64
    corners = np.array([[float(c) for c in corner] for corner in target])
    shares = random.dirichlet(np.ones(len(corners)), count)
    ends = np.round(shares @ corners * 2**20) / 2**20
    blocked = np.zeros(count, bool)
    for wall in walls:
        points = np.array([[float(c) for c in corner] for corner in wall])
        n = np.array([float(c) for c in plane(rational(wall))[0]])
        before, behind = (eyes - points[0]) @ n, (ends - points[0]) @ n
        crosses = before * behind <= 0
        x = eyes + (before / np.where(before == behind, 1, before - behind))[:, None] * (ends - eyes)
        sides = [np.cross(b - a, x - a) @ n for a, b in zip(points, np.roll(points, -1, axis=0), strict=True)]
        blocked |= crosses & (np.min(sides, axis=0) >= 0)
    exact = [rational(wall) for wall in walls]
    for k in np.flatnonzero(~blocked):
        # The rounded end is a little off the target; through its weights it is on it.
        weights = [Fraction(float(s)) for s in shares[k]]
        end = [sum(w * c for w, c in zip(weights, x, strict=True)) / sum(weights) for x in zip(*target, strict=True)]
        if all(segment_clear([Fraction(float(c)) for c in eyes[k]], end, wall) for wall in exact):
            return True
    return False


@pytest.mark.parametrize("kind", SCENES)
def test_verdicts_have_proofs_and_agree_with_sampled_segments(kind):
    random, found = np.random.default_rng(len(kind)), []
    for _ in range(24):
        target, walls = far_target(random), SCENES[kind](random)
        verdict = check(CELL, target, walls, nodes=2000)
        if sampled(random, CELL, target, walls, 300):
            assert verdict is Verdict.VISIBLE, (target, walls)
        found.append(verdict)
    assert min(found.count(Verdict.VISIBLE), found.count(Verdict.HIDDEN)) >= 5
    assert found.count(Verdict.UNKNOWN) <= 1


@pytest.mark.slow
@pytest.mark.parametrize("kind", SCENES)
def test_verdicts_have_proofs_and_agree_with_sampled_segments_many(kind):
    random, unknown = np.random.default_rng(100 + len(kind)), 0
    for _ in range(400):
        target, walls = far_target(random), SCENES[kind](random)
        verdict = check(CELL, target, walls, nodes=2000)
        unknown += verdict is Verdict.UNKNOWN
        assert verdict is not Verdict.HIDDEN or not sampled(random, CELL, target, walls, 3000), (target, walls)
    assert unknown <= 10


def test_sampling_finds_what_the_twin_finds_where_gaps_are_wide():
    random = np.random.default_rng(5)
    seen = [
        k for k in range(30) if sampled(random, CELL, far_target(random), [wall[:3] for wall in loose(random)[:1]], 300)
    ]
    assert len(seen) > 15


def test_one_polygon_hides_its_umbra():
    random, found = np.random.default_rng(3), []
    for _ in range(80):
        wall = random_polygon(random, random.integers(-10, 11, 3), random.integers(12, 40))
        target = random_polygon(random, [random.integers(15, 50), *random.integers(-6, 7, 2)], random.integers(1, 4))
        o = occluder(CELL, wall)
        wanted = not o.straddles and all(o.depth(corner) >= 0 and hides(o, corner) for corner in target)
        assert (check(CELL, target, [wall]) is Verdict.HIDDEN) == wanted
        found.append(wanted)
    assert 10 < sum(found) < 70


def test_an_umbra_that_ends_at_the_target_hides_it():
    # From (-60, 6) past 8 at x = 0: what is beyond the plate is hidden up to 8 + 50 / 30 at x = 50.
    wall = [[0, -8, -8], [0, 8, -8], [0, 8, 8], [0, -8, 8]]
    square = lambda half: [[50, -half, -half], [50, half, -half], [50, half, half], [50, -half, half]]  # noqa: E731
    assert check(CELL, square(Fraction(29, 3)), [wall]) is Verdict.HIDDEN
    assert check(CELL, square(Fraction(29, 3) + Fraction(1, 2**30)), [wall]) is Verdict.VISIBLE
    wall[2] = [0, 8, 8 - Fraction(1, 2**30)]
    assert check(CELL, square(Fraction(29, 3)), [wall]) is Verdict.VISIBLE


def grid_plates(random):
    """Rectangles that tile part of a wall, axial or oblique, in grid steps."""
    lean, walls = int(random.integers(0, 3)) * 400, []
    joint = int(random.integers(-600, 600))
    for low, high in ((-2500, joint), (joint, 2500)):
        x = 0 if lean else int(random.integers(0, 2)) * 200
        walls.append([[x, low, -2500], [x + lean, high, -2500], [x + lean, high, 2500], [x, low, 2500]])
    return walls


def test_the_shaft_kernel_hides_nothing_that_is_visible():
    random, agreed = np.random.default_rng(11), {"hidden": 0, "visible": 0}
    for _ in range(12):
        walls, definitions = grid_plates(random), []
        for wall in walls:
            faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
            definitions.append(Definition("plate", (Mesh(np.array(wall, float) * GRID_M, faces),)))
        instances = [Instance("plate", "", k, np.eye(4), Role.OCCLUDER) for k in range(len(walls))]
        shields, _, _ = shields_of(Scene(definitions, instances))
        cell = np.array([-3000, -300, -300]) + random.integers(-200, 200, 3)
        low = np.column_stack([random.integers(1400, 3000, 8), random.integers(-3600, 3300, (8, 2))])
        boxes = [[cell, cell + 500], *([corner, corner + 300] for corner in low)]
        rows = np.array([[0, k] for k in range(1, 9)])
        verdicts = launch_shaft(shields, np.array(boxes, np.int32), rows, smallest=(64, 64), cap=2000).verdict
        for k, verdict in enumerate(verdicts):
            corners = [[int(c) for c in corner] for corner in (low[k], low[k] + 300)]
            eyes = [[int(c) for c in corner] for corner in boxes[0]]
            answer = region_visible(eyes, box_faces(*corners), walls, nodes=5000)
            assert verdict != 0 or answer.verdict is not Verdict.VISIBLE, (boxes[0], corners, walls)
            agreed["hidden"] += verdict == 0 and answer.verdict is Verdict.HIDDEN
            agreed["visible"] += verdict != 0 and answer.verdict is Verdict.VISIBLE
    assert min(agreed.values()) > 5


def kinds_of(tree):
    if not isinstance(tree, tuple):
        return set()
    own = {tree[0]} if tree and isinstance(tree[0], str) else set()
    return own.union(*(kinds_of(part) for part in tree))


def test_the_corner_of_a_box_needs_more_than_the_hull_of_lines():
    """Past a corner one of three edges chosen, each in turn, is a set of lines that is empty though its hull is not.

    Polytopes in Pluecker space alone, without the quadric of real lines, would call the target visible.
    """
    walls, target = box_faces([-10, -10, -10], [10, 10, 10]), [[24, 16, 16], [16, 24, 16], [16, 16, 24]]
    cell = [[-42, -42, -42], [-38, -38, -38]]
    answer = region_visible(cell, target, walls)
    assert check(cell, target, walls) is Verdict.HIDDEN
    assert "corner" in kinds_of(answer.certificate)


def test_strips_hide_together_what_none_hides_alone():
    walls = [[[0, a, -20], [0, a + 10, -20], [0, a + 10, 20], [0, a, 20]] for a in (-20, -10, 0, 10)]
    target = [[50, -5, -5], [50, 5, -5], [50, 5, 5], [50, -5, 5]]
    assert check(CELL, target, walls) is Verdict.HIDDEN
    for k in range(4):
        assert check(CELL, target, [walls[k]]) is Verdict.VISIBLE
    # The least gap between two of them shows it.
    walls[1] = [[x, y - Fraction(y == 0, 10**6), z] for x, y, z in walls[1]]
    assert check(CELL, target, walls) is Verdict.VISIBLE


def test_contacts_and_places():
    wall = [[0, -90, -90], [0, 90, -90], [0, 90, 90], [0, -90, 90]]
    behind = [[50, -5, -5], [50, 5, -5], [50, 5, 5], [50, -5, 5]]
    moved = lambda points, x: [[x, *point[1:]] for point in points]  # noqa: E731
    assert check(CELL, behind, [wall]) is Verdict.HIDDEN
    # In the plane of the target an occluder hides nothing of it; on the cell's face, or in front of it, it does.
    assert check(CELL, behind, [moved(wall, 50)]) is Verdict.VISIBLE
    assert check(CELL, behind, [moved(wall, -50)]) is Verdict.HIDDEN
    # Inside the cell it does not: the eye may be beyond it.
    assert check(CELL, behind, [moved(wall, -51)]) is Verdict.VISIBLE
    assert check(CELL, behind, [moved(wall, -51), moved(wall, -49)]) is Verdict.HIDDEN
    # Inside the cell, or on its face, the target is seen from as near as needed.
    assert check(CELL, moved(behind, -55), [moved(wall, -56), moved(wall, -54)]) is Verdict.VISIBLE
    assert check(CELL, moved(behind, -50), [moved(wall, -49)]) is Verdict.VISIBLE
    # It touches the cell along an edge only.
    flap = [[-50, -5, 6], [-40, -5, 6], [-40, 5, 6], [-50, 5, 6]]
    assert check(CELL, flap, []) is Verdict.VISIBLE
    assert check(CELL, flap, [moved(wall, -50)]) is Verdict.HIDDEN
    # A target through the occluder is seen in front of it.
    through = [[-5, 0, 0], [5, 0, 0], [5, 3, 0]]
    assert check(CELL, through, [wall]) is Verdict.VISIBLE
    assert check(CELL, [[0, 0, 0], [5, 0, 0], [5, 3, 0]], [wall]) is Verdict.HIDDEN


def test_a_polytope_is_seen_if_a_face_is():
    wall = [[0, -9, -9], [0, 9, -9], [0, 9, 9], [0, -9, 9]]
    assert region_visible(CELL, box_faces([20, -2, -2], [24, 2, 2]), [wall]).verdict is Verdict.HIDDEN
    assert region_visible(CELL, box_faces([20, -2, -2], [24, 2, 12]), [wall]).verdict is Verdict.VISIBLE


@st.composite
def lattice_scenes(draw):
    """Few coordinates, so that planes, edges and corners meet."""
    point = st.tuples(*[st.integers(-4, 4)] * 3)

    def polygon(shift):
        while True:
            o, u, v = draw(point), draw(point), draw(point)
            if np.cross(u, v).any():
                break
            u, v = (1, 0, 0), (0, 1, 0)
            break
        corners = [o, np.add(o, u), np.add(np.add(o, u), v), np.add(o, v)][: draw(st.integers(3, 4))]
        return [[int(c) + shift for c in corner] for corner in corners]

    low = [draw(st.integers(-8, 0)) for _ in range(3)]
    cell = [low, [c + draw(st.integers(1, 3)) for c in low]]
    return cell, polygon(4), [polygon(0) for _ in range(draw(st.integers(0, 8)))]


@given(lattice_scenes(), st.data())
def test_laws(scene, data):
    cell, target, walls = scene
    verdict = check(cell, target, walls, nodes=500)
    shift, flip = data.draw(st.tuples(*[st.integers(-9, 9)] * 3)), data.draw(st.tuples(*[st.sampled_from([1, -1])] * 3))
    move = lambda points: [[s * c + d for c, s, d in zip(p, flip, shift, strict=True)] for p in points]  # noqa: E731
    mirrored = [[*ends] for ends in zip(*(sorted(pair) for pair in zip(*move(cell), strict=True)), strict=True)]
    other = region_visible(mirrored, move(target)[::-1], [move(wall) for wall in walls], nodes=500).verdict
    assert {verdict, other} != {Verdict.VISIBLE, Verdict.HIDDEN}
    if verdict is Verdict.HIDDEN:
        # Halves of the cell see no more than the whole, more occluders hide no less.
        middle = Fraction(cell[0][0] + cell[1][0], 2)
        for half in ([cell[0], [middle, *cell[1][1:]]], [[middle, *cell[0][1:]], cell[1]]):
            assert check(half, target, walls, nodes=500) is not Verdict.VISIBLE
    elif verdict is Verdict.VISIBLE and walls:
        assert check(cell, target, walls[1:], nodes=500) is not Verdict.HIDDEN


def test_a_cell_may_be_any_polytope():
    tetrahedron = [(0, 0, 0), (8, 0, 0), (0, 8, 0), (0, 0, 8)]
    faces = [[tetrahedron[k] for k in picked] for picked in ((0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3))]
    target, wall = [[20, 1, 1], [20, 2, 1], [20, 2, 2]], [[10, -1, -1], [10, 5, -1], [10, 5, 5], [10, -1, 5]]
    assert check(faces, target, [wall]) is Verdict.HIDDEN
    assert check([[0, 0, 0], [8, 8, 8]], target, [wall]) is Verdict.VISIBLE


def test_the_limit_of_nodes_is_told():
    walls, target = box_faces([-10, -10, -10], [10, 10, 10]), [[24, 16, 16], [16, 24, 16], [16, 16, 24]]
    answer = region_visible([[-42, -42, -42], [-38, -38, -38]], target, walls, nodes=5)
    assert answer.verdict is Verdict.UNKNOWN and answer.certificate is None and answer.start is None


@pytest.mark.parametrize("apart", [0, 1])
def test_three_edges_are_a_corner_only_if_no_line_passes_outside_all(apart):
    random, agreed = np.random.default_rng(8 + apart), {True: 0, False: 0}
    for _ in range(200):
        near, far = random.integers(-9, 10, (3, 3)), random.integers(-9, 10, (3, 3))
        near[:, 0], far[:, 0] = random.integers(-40, -30, 3), random.integers(30, 40, 3)
        ways = random.integers(-5, 6, (3, 3))
        if not np.linalg.det(ways).round() or not np.cross(near[1] - near[0], near[2] - near[0]).any():
            continue
        starts = np.zeros((3, 3), int) + random.integers(-2, 3, 3) + apart * random.integers(-3, 4, (3, 3))
        edges = [
            [[int(c) for c in start], [int(c) for c in start + way]] for start, way in zip(starts, ways, strict=True)
        ]
        a, b = near.tolist(), far.tolist()
        claimed = _hidden(a, b, edges, [], ("corner", 0, 1, 2))
        duals = [_dual((*u, 1), (*v, 1)) for u, v in edges]
        assert claimed == (_corner([(*p, 1) for p in a], [(*t, 1) for t in b], duals) is not None)
        shares = random.dirichlet(np.ones(3), (2, 60))
        pairs = zip(shares[0] @ near, shares[1] @ far, strict=True)
        assert not claimed or all(min(side(p, t, edge) for edge in edges) < 1e-6 for p, t in pairs)
        agreed[claimed] += 1
    assert agreed[False] > 50 and (apart or agreed[True] > 10)


def test_what_halving_leaves_open_is_not_called_hidden():
    """Edges of two boxes in the plane of a face of the cell: lines in that plane graze three of them."""
    target = [[45, Fraction(-48, 17), Fraction(-165, 17)], [Fraction(95, 2), Fraction(37, 34), Fraction(-847, 136)]]
    target += [[Fraction(109, 2), Fraction(-257, 34), Fraction(-189, 136)]]
    target += [[Fraction(105, 2), Fraction(-309, 34), Fraction(-513, 136)]]
    boxes = [([-1, -10, -12], [7, -6, 12]), ([-6, -6, -10], [-3, 5, 10]), ([-1, 5, -9], [5, 17, 9])]
    walls = [face for low, high in boxes for face in box_faces(low, high)]
    assert check(CELL, target, walls, nodes=300) is not Verdict.VISIBLE


def altered(tree):
    """Every tree with one leaf replaced by nothing or by equal weights, or one branch's children reversed."""
    if not isinstance(tree, tuple) or not tree:
        return
    if tree[0] == "leaf":
        yield None
        yield "leaf", (0,) * len(tree[1])
        yield "leaf", tuple(-x for x in tree[1])
        yield "leaf", (*tree[1], 1)
    elif tree[0] == "branch":
        yield "branch", tree[1], tree[2][:-1]
        yield "branch", tree[1] - 1, tree[2]
    for k, part in enumerate(tree):
        for other in altered(part):
            yield (*tree[:k], other, *tree[k + 1 :])


def test_altered_certificates_fail():
    walls = [[[0, a, -20], [0, a + 20, -20], [0, a + 20, 20], [0, a, 20]] for a in (-20, 0)]
    target = [[50, -5, -5], [52, 5, -5], [52, 5, 5], [50, -5, 5]]
    faces = cell_faces(CELL)
    (trees,) = region_visible(CELL, target, walls).certificate
    assert holds(faces, target, walls, trees)
    others = list(altered(trees))
    assert len(others) > 20
    for other in others:
        assert not holds(faces, target, walls, other), other
    assert not holds(faces, target, walls, trees[:-1])
    narrow = [[[x, y, min(z, 2)] for x, y, z in wall] for wall in walls]
    assert not holds(faces, target, narrow, trees)
    inside = [[-55, -5, -5], [-55, 5, -5], [-55, 5, 5]]
    assert not holds(faces, inside, walls, trees)


def test_a_certificate_of_a_corner_fails_if_the_edges_do_not_meet():
    walls, target = box_faces([-10, -10, -10], [10, 10, 10]), [[24, 16, 16], [16, 24, 16], [16, 16, 24]]
    cell = [[-42, -42, -42], [-38, -38, -38]]
    (trees,) = region_visible(cell, target, walls).certificate
    assert holds(cell_faces(cell), target, walls, trees)
    apart = [[[x + (k == 1), y, z] for x, y, z in wall] for k, wall in enumerate(walls)]
    assert not holds(cell_faces(cell), target, apart, trees)


@given(
    st.integers(1, 6).flatmap(
        lambda n: st.lists(st.lists(st.integers(-3, 3), min_size=n, max_size=n), min_size=1, max_size=6)
    )
)
def test_games_are_decided_by_a_strategy(matrix):
    rows, columns = play(matrix)
    if rows is None:
        assert min(columns) >= 0 and all(np.array(matrix) @ columns > 0)
    else:
        assert min(rows) >= 0 and max(rows) > 0 and all(np.array(rows) @ np.array(matrix) <= 0)


@pytest.mark.parametrize(
    ("cell", "target", "message"),
    [
        ([[0, 0, 0], [1, 0, 1]], [[5, 0, 0], [5, 1, 0], [5, 0, 1]], "low < high"),
        ([[0, 0, 0], [1, 1, 1]], [[5, 0, 0], [5, 1, 0]], "three or more"),
        ([[0, 0, 0], [1, 1, 1]], [[5, 0, 0], [5, 1, 0], [5, 2, 0]], "with area"),
        ([[0, 0, 0], [1, 1, 1]], [[5, 0, 0], [5, 4, 0], [5, 1, 1], [5, 0, 4]], "convex"),
        ([[0, 0, 0], [1, 1, 1]], [[5, 0, 0], [5, 1, 0], [5, 1, 1], [6, 0, 1]], "planar"),
        ([[0, 0, 0], [1, 1, 1]], [[5, 0, 0], [5, 1, float("nan")], [5, 1, 1]], "rational"),
        (box_faces([0, 0, 0], [1, 1, 1])[:5], [[5, 0, 0], [5, 1, 0], [5, 0, 1]], "open edge"),
    ],
)
def test_bad_input(cell, target, message):
    with pytest.raises(InputError, match=message):
        region_visible(cell, target, [])


def test_corners_of_boxes_are_those_of_their_faces():
    faces = box_faces(*CELL)
    assert {tuple(c) for face in faces for c in face} == {tuple(c) for c in box_corners(CELL)}
    assert all(dot(plane(face)[0], [-55, 0, 0]) != plane(face)[1] for face in faces)
