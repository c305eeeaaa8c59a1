"""From-region visibility in the plane against all critical lines, its checker, and the twin in space."""

from fractions import Fraction
from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.errors import InputError
from viewcell.data.verdict import Verdict
from viewcell.verify.exact.region import region_visible
from viewcell.verify.exact.region_2d import cell_corners, region_visible_2d
from viewcell.verify.proofs.region_2d import holds_2d

# Turns a line by less than what separates two critical points of the lattice scenes: their coordinates are fractions
# of numerators and denominators below 2**12, so a line through two passes any third by more than 2**-120.
TINY = Fraction(1, 2**140)


def turn(a, b, c):
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def along(a, s, b):
    return [x + s * (y - x) for x, y in zip(a, b, strict=True)]


def ring(points):
    return [*zip(points, [*points[1:], points[0]], strict=True)]


def crossing(a, b, c, d):
    """Where the lines a b and c d meet, as a share of a b; None if they are parallel."""
    rise = turn(a, b, d) - turn(a, b, c)
    return None if rise == 0 else Fraction(turn(c, d, a)) / (turn(c, d, a) - turn(c, d, b))


def meets(a, b, c, d):
    """Whether two closed segments meet."""
    sides = [turn(c, d, a), turn(c, d, b), turn(a, b, c), turn(a, b, d)]
    if any(sides):
        return sides[0] * sides[1] <= 0 and sides[2] * sides[3] <= 0
    inside = lambda x, u, v: min(u[0], v[0]) <= x[0] <= max(u[0], v[0]) and min(u[1], v[1]) <= x[1] <= max(u[1], v[1])  # noqa: E731
    return inside(a, c, d) or inside(b, c, d) or inside(c, a, b)


def inside_shares(corners, x, y):
    """Where the line x y enters and leaves the open cell, as shares of x y; None if it misses it."""
    low, high = None, None
    for a, b in ring(corners):
        here, there = turn(a, b, x), turn(a, b, y)
        if here == there:
            if here <= 0:
                return None
            continue
        share = Fraction(here) / (here - there)
        if there > here:
            low = share if low is None else max(low, share)
        else:
            high = share if high is None else min(high, share)
    return (low, high) if low is not None and high is not None and low < high else None


def sees(corners, target, walls, x, y):
    """Whether some point of the line x y in the open cell sees the point of the line on the target."""
    span, at = inside_shares(corners, x, y), crossing(x, y, *target)
    if span is None or at is None:
        return False
    end = along(x, at, y)
    share = crossing(*target, x, y)
    if not 0 < share < 1:
        return False
    blocking = [wall for wall in walls if any(turn(*target, corner) for corner in wall)]
    # The nearest eye is best: just inside the exit, or beside the target.
    eyes = [span[0], span[1], at] if span[0] <= at <= span[1] else span
    tiny = (span[1] - span[0]) / 2**300
    for eye in eyes:
        for step in (tiny, -tiny):
            if span[0] < eye + step < span[1]:
                start = along(x, eye + step, y)
                if not any(meets(start, end, *wall) for wall in blocking):
                    return True
    return False


def visible_by_critical_lines(corners, target, walls):
    """Every open set of lines ends at a line through two critical points, turned a little about a point between."""
    segments = [*ring(corners), target, *walls]
    points = [x for segment in segments for x in segment]
    for (a, b), (c, d) in combinations(segments, 2):
        if meets(a, b, c, d) and crossing(a, b, c, d) is not None:
            points.append(along(a, crossing(a, b, c, d), b))
    points = sorted({tuple(map(Fraction, x)) for x in points})
    for a, b in combinations(points, 2):
        on = [x for x in points if turn(a, b, x) == 0]
        if on[0] != a or on[1] != b:
            continue
        step = [b[0] - a[0], b[1] - a[1]]
        pivots = [along(u, Fraction(1, 2), v) for u, v in pairwise(on)]
        pivots += [
            [x - y for x, y in zip(on[0], step, strict=True)],
            [x + y for x, y in zip(on[-1], step, strict=True)],
        ]
        for x in pivots:
            for sign in (1, -1):
                y = [x[0] + step[0] - sign * TINY * step[1], x[1] + step[1] + sign * TINY * step[0]]
                if sees(corners, target, walls, x, y):
                    return True
    return False


def check(cell, target, walls):
    """The verdict, after its proof has been checked by other means."""
    answer, corners = region_visible_2d(cell, target, walls), cell_corners(cell)
    assert answer.verdict is not Verdict.UNKNOWN
    if answer.verdict is Verdict.HIDDEN:
        assert holds_2d(corners, target, walls, answer.certificate)
        return answer.verdict
    assert all(turn(a, b, answer.start) > 0 for a, b in ring(corners))
    assert turn(*target, answer.start) != 0 == turn(*target, answer.end)
    assert 0 < crossing(*target, answer.start, answer.end) < 1
    for wall in walls:
        collinear = turn(*target, wall[0]) == turn(*target, wall[1]) == 0
        assert collinear or not meets(answer.start, answer.end, *wall)
    return answer.verdict


@st.composite
def lattice_scenes(draw, size=6):
    """Few coordinates, so that ends meet and lines pass through several."""
    point = st.tuples(st.integers(-5, 5), st.integers(-5, 5))
    segment = st.tuples(point, point).filter(lambda s: s[0] != s[1])
    low = draw(point)
    box = [low, [c + draw(st.integers(1, 3)) for c in low]]
    cell = draw(st.sampled_from([box, [low, (low[0] + 3, low[1] + 1), (low[0] + 1, low[1] + 4)]]))
    return cell, draw(segment), draw(st.lists(segment, max_size=size))


def wall_scene(random):
    """A wall of pieces of which some leave gaps, between a cell and a target."""
    cuts = sorted({-9, 9, *random.integers(-8, 9, random.integers(1, 5)).tolist()})
    walls = []
    for a, b in pairwise(cuts):
        x = int(random.integers(-3, 4))
        ends = [(x, a), (x + int(random.integers(-1, 2)), b + int(random.integers(-1, 2)))]
        walls += [ends] if ends[0] != ends[1] else []
    return [[-12, -2], [-8, 2]], [(8, int(random.integers(-4, 1))), (int(random.integers(7, 10)), 3)], walls


@given(lattice_scenes(4))
def test_verdicts_are_those_of_the_critical_lines(scene):
    cell, target, walls = scene
    wanted = visible_by_critical_lines(cell_corners(cell), target, walls)
    assert (check(cell, target, walls) is Verdict.VISIBLE) == wanted


def test_walls_with_gaps_are_those_of_the_critical_lines():
    random, found = np.random.default_rng(2), []
    for _ in range(16):
        cell, target, walls = wall_scene(random)
        wanted = visible_by_critical_lines(cell_corners(cell), target, walls)
        assert (check(cell, target, walls) is Verdict.VISIBLE) == wanted, (target, walls)
        found.append(wanted)
    assert 3 < sum(found) < 13


@pytest.mark.slow
def test_verdicts_are_those_of_the_critical_lines_many():
    random = np.random.default_rng(3)
    for _ in range(300):
        cell, target, walls = wall_scene(random)
        wanted = visible_by_critical_lines(cell_corners(cell), target, walls)
        assert (check(cell, target, walls) is Verdict.VISIBLE) == wanted, (target, walls)


@given(lattice_scenes())
def test_prisms_are_seen_as_their_sections(scene):
    """In space, between walls far higher than cell and target, nothing changes."""
    cell, target, walls = scene
    corners = [tuple(corner) for corner in cell_corners(cell)]
    flat = check(cell, target, walls)

    def upright(segment, half):
        (a, b), (c, d) = segment
        return [[a, b, -half], [c, d, -half], [c, d, half], [a, b, half]]

    faces = [upright(edge, 1) for edge in ring(corners)]
    faces += [[(*corner, z) for corner in corners] for z in (-1, 1)]
    tall = region_visible(faces, upright(target, 1), [upright(wall, 10**9) for wall in walls], nodes=400)
    assert tall.verdict is flat


def test_contacts():
    cell, target = [[-10, -1], [-8, 1]], [(10, -1), (10, 1)]
    assert check(cell, target, [[(0, -1), (0, 1)]]) is Verdict.HIDDEN
    assert check(cell, target, [[(0, -1), (0, 1 - Fraction(1, 10**9))]]) is Verdict.VISIBLE
    assert check(cell, target, [[(0, -5), (0, 0)], [(0, 0), (0, 5)]]) is Verdict.HIDDEN
    assert check(cell, target, [[(0, -5), (0, 0)], [(0, Fraction(1, 10**9)), (0, 5)]]) is Verdict.VISIBLE
    assert check(cell, target, [[(10, -9), (10, 9)]]) is Verdict.VISIBLE
    assert check(cell, target, [[(-8, -9), (-8, 9)]]) is Verdict.HIDDEN
    assert check(cell, target, [[(-9, -9), (-9, 9)]]) is Verdict.VISIBLE
    # The end of an occluder inside the cell lies on the way to the middle of the target.
    assert check(cell, target, [[(Fraction(-17, 2), 0), (Fraction(-17, 2), 5)]]) is Verdict.VISIBLE
    # Staggered: each alone leaves a view, together they leave only the one slanted line through both ends.
    assert check(cell, target, [[(-2, -9), (-2, 0)], [(2, 0), (2, 9)]]) is Verdict.VISIBLE
    assert check(cell, [(10, 3), (10, 4)], [[(-2, -9), (-2, 0)], [(2, 0), (2, 9)]]) is Verdict.HIDDEN
    assert check(cell, [(-9, 0), (9, 0)], [[(-8, -9), (-8, 9)]]) is Verdict.VISIBLE
    assert check(cell, [(-9, 1), (9, 1)], [[(-8, -9), (-8, 9)], [(-10, 1), (-8, 1)]]) is Verdict.VISIBLE
    assert check(cell, [(-8, 1), (9, 1)], [[(-8, -9), (-8, 9)]]) is Verdict.HIDDEN


def altered(tree):
    if tree[0] == "leaf":
        yield None
        yield "leaf", (0,) * len(tree[1])
        yield "leaf", tuple(-x for x in tree[1])
        yield "leaf", (*tree[1], 1)
    else:
        yield "branch", tree[1], tree[3], tree[2]
        for k in (2, 3):
            for other in altered(tree[k]):
                yield (*tree[:k], other, *tree[k + 1 :])


def test_altered_certificates_fail():
    cell, target, walls = [[-10, -1], [-8, 1]], [(10, -2), (11, 1)], [[(0, -5), (0, 0)], [(0, 0), (0, 5)]]
    corners, trees = cell_corners(cell), region_visible_2d(cell, target, walls).certificate
    assert holds_2d(corners, target, walls, trees)
    count = 0
    for k, pair in enumerate(trees):
        for j, tree in enumerate(pair):
            for other in altered(tree) if tree else ():
                changed = tuple(other if i == j else part for i, part in enumerate(pair))
                assert not holds_2d(corners, target, walls, (*trees[:k], changed, *trees[k + 1 :])), other
                count += 1
    assert count > 10
    assert not holds_2d(corners, target, walls, trees[:-1])
    assert not holds_2d(corners, target, [walls[0], [(0, 1), (0, 5)]], trees)
    assert not holds_2d(corners, [(-9, 0), (-9, 1)], walls, trees)


@pytest.mark.parametrize(
    ("cell", "target", "message"),
    [
        ([[0, 0], [0, 1]], [(5, 0), (5, 1)], "low < high"),
        ([(0, 0), (4, 0), (1, 1), (0, 4)], [(5, 0), (5, 1)], "convex"),
        ([[0, 0], [1, 1]], [(5, 0), (5, 0)], "different"),
        ([[0, 0], [1, 1]], [(5, 0), (5, float("inf"))], "rational"),
    ],
)
def test_bad_input(cell, target, message):
    with pytest.raises(InputError, match=message):
        region_visible_2d(cell, target, [])
