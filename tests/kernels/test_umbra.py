"""Umbras: published vectors, and every claim against rationals."""

from fractions import Fraction

import numpy as np
import pytest
from builders import outlines
from builders.outlines import LIMIT, at_the_border, bent_quadrilateral, bent_scenes, outline_table, random_scene
from builders.places import HARD_CASES
from viewcell.data.errors import InputError
from viewcell.data.patches import find_patches
from viewcell.kernels.launch import Device
from viewcell.kernels.umbra import BENT, STRADDLES, TOUCHES, USABLE, launch_umbra
from viewcell.verify.arithmetic import box_corners, dot, minus, rational
from viewcell.verify.cases.case_file import load_shadow_cases
from viewcell.verify.exact.segment import MISS, crossing_kind
from viewcell.verify.exact.umbra import hides, occluder, recession, umbra, winds

CASES = {c.name: c for c in load_shadow_cases(HARD_CASES / "shadow.txt")}


def points_behind(rng, exact, count):
    """Random points around the cone that the cell and the outline span, many near the umbra's border."""
    outline = np.array(exact.outline, float)
    cell = np.array(exact.cell, float)
    weights = rng.dirichlet(np.full(len(outline), 0.4), count)
    eyes = cell[rng.integers(0, 8, count)] * 0.7 + cell.mean(axis=0) * 0.3
    through = weights @ outline
    through = outline.mean(axis=0) + (through - outline.mean(axis=0)) * rng.choice([0.6, 0.95, 1.0, 1.3], (count, 1))
    x = through + (through - eyes) * rng.choice([0.001, 0.1, 1.0, 7.0], (count, 1)) * rng.random((count, 1))
    # The outline's own corners are on the border, and in sight.
    return np.concatenate([np.clip(np.round(x * 64) / 64, 1 - LIMIT, LIMIT - 1), outline])


def check_umbra(seed, scenes, per_scene, far=False):
    """Kernel against twin against the definition; returns how many points were hidden and how many were not."""
    rng, hidden, seen = np.random.default_rng(seed), 0, 0
    for _ in range(scenes):
        cell, outline, exact = random_scene(rng)
        if far:
            cell, outline, exact = at_the_border(rng, cell, outline)
        umbras = launch_umbra(cell[None], outline_table([outline]), [[0, 0]])
        planes = exact.planes
        if any(exact.depth(p) == 0 for p in exact.cell) and sum(c != 0 for c in exact.normal) > 1:
            assert umbras.status[0] == STRADDLES, "float64 cannot tell a touch of an oblique plane"
            continue
        assert umbras.status[0] == (TOUCHES if planes is None else USABLE)
        points = points_behind(rng, exact, per_scene)
        inside = umbras.contains(0, points)
        for point, held in zip(rational(points.tolist()), inside, strict=True):
            truth = hides(exact, point)
            assert umbra(exact, point) == truth
            assert truth or not held, f"wrong-hidden: {point} behind {outline.tolist()} from {cell.tolist()}"
            assert exact.depth(point) > 0 or not held, "what lies on the occluder is in sight"
            if truth and not held:
                # Only what is within 2e-5 grid steps of a plane may be given away.
                near = [(exact.normal, exact.offset), *planes]
                assert min((dot(m, point) - c) ** 2 / dot(m, m) for m, c in near) < Fraction(1, 2500000000)
            hidden, seen = hidden + truth, seen + (not truth)
    return hidden, seen


@pytest.mark.parametrize("name", CASES)
def test_published_vectors(name):
    case = CASES[name]
    exact = occluder(case.cell, case.outline)
    table = outline_table([case.outline])
    umbras = launch_umbra(np.array([case.cell]), table, [[0, 0]])
    corners = box_corners(case.box)
    assert all(umbra(exact, x) for x in corners) == all(hides(exact, x) for x in corners)
    assert all(umbra(exact, x) for x in corners) == (case.expected in ("hidden", "touch"))
    assert umbras.contains(0, np.array(corners, float)).all() == (case.expected == "hidden")
    if case.rho is None:
        assert umbras.status[0] == STRADDLES and exact.straddles
        return
    assert umbras.status[0] == (TOUCHES if -np.inf in case.rho else USABLE)
    wanted = rho_of_edges(exact)
    for edge, rho in zip((0, 2), case.rho, strict=True):
        assert wanted[edge_name(*case.outline[edge : edge + 2])] == pytest.approx(rho, abs=5e-5)
    if umbras.status[0] == USABLE:
        got = zip(table.corners, np.roll(table.corners, -1, axis=0), umbras.rho, strict=True)
        assert {edge_name(a, b): pytest.approx(rho) for a, b, rho in got} == wanted


def edge_name(a, b):
    return frozenset(tuple(int(c) for c in end) for end in (a, b))


def rho_of_edges(exact):
    """Exact rho by edge, in units of length over length."""
    ends = zip(exact.outline, exact.outline[1:] + exact.outline[:1], recession(exact), strict=True)
    return {
        edge_name(a, b): -np.inf if rho is None else float(rho) / float(dot(minus(b, a), minus(b, a))) ** 0.5
        for a, b, rho in ends
    }


def test_umbra_is_the_definition():
    hidden, seen = check_umbra(1, 40, 20)
    assert hidden > 150 and seen > 150


def test_umbra_is_the_definition_at_the_border_of_the_grid():
    hidden, seen = check_umbra(11, 40, 20, far=True)
    assert hidden > 150 and seen > 150


@pytest.mark.slow
def test_umbra_is_the_definition_many():
    for far in (False, True):
        hidden, seen = check_umbra(2, 500, 55, far)
        assert hidden > 5000 and seen > 5000


def check_eyes(seed, scenes):
    """Points that the kernel calls hidden behind flat and bent discs, from random eyes; returns how many."""
    rng, held = np.random.default_rng(seed), 0
    for scene in range(scenes):
        if scene % 2:
            triangles, size = outlines.random_disc(rng)
            patches = find_patches(
                triangles, np.zeros(len(triangles)), least_area=1.0, most_corners=12, cos_limit=0.5, axial=True
            )
            if len(patches.area) != 1:
                continue
            away = patches.normal[0] * rng.choice([-1, 1])
            low = np.round(triangles.mean(axis=(0, 1)) - away * size * rng.uniform(0.2, 5)).astype(int)
            cell = np.stack([low, low + rng.integers(1, 2 + size // 2, 3)])
            outline = patches.corners
        else:
            cell, outline, _ = random_scene(rng)
            patches = outline_table([outline])
            fan = [outline[[0, i, i + 1]] for i in range(1, len(outline) - 1)]
            triangles = np.array(fan)
        umbras = launch_umbra(cell[None], patches, [[0, 0]])
        if umbras.status[0] != USABLE:
            continue
        weights = rng.dirichlet(np.ones(len(outline)), 20)
        behind = weights @ outline
        points = behind + (behind - cell.mean(axis=0)) * rng.uniform(0.01, 3, (20, 1))
        for point in points[umbras.contains(0, points)][:6]:
            held += 1
            eye = cell[0] + rng.integers(0, 17, 3) * (cell[1] - cell[0]) / 16
            assert any(crossing_kind(eye, point, t) != MISS for t in triangles), f"{eye} sees {point}"
    return held


def test_no_eye_in_the_cell_sees_into_the_umbra():
    assert check_eyes(3, 120) > 150


@pytest.mark.slow
def test_no_eye_in_the_cell_sees_into_the_umbra_many():
    assert check_eyes(4, 6000) > 10_000


@pytest.mark.parametrize("scene", range(7))
def test_the_umbra_of_a_bent_outline_is_where_it_winds_round_every_line(scene):
    rng, held = np.random.default_rng(11), np.zeros(2, int)
    bent, cell = list(bent_scenes())[scene]
    assert np.diff(bent.starts).tolist() == [4]
    umbras = launch_umbra(cell[None], bent, [[0, 0]])
    assert umbras.status[0] == USABLE
    away = umbras.normal[0]
    points = rng.normal(size=(500, 3)) * rng.choice([30, 300, 3000], (500, 1))
    points += away * (umbras.far[0] + 0.01 + rng.exponential(30, (500, 1)) - points @ away[:, None])
    for point, inside in zip(points, umbras.contains(0, points), strict=True):
        truth = winds(cell.tolist(), bent.corners.tolist(), rational([point])[0])
        assert inside == truth or (truth and not umbras.contains(0, point[None] + away * 1e-3)[0])
        held[int(inside)] += 1
    assert held.min() > 30


def test_a_touching_cell_has_an_umbra_only_where_the_outline_covers_the_contact():
    rng, seen = np.random.default_rng(12), set()
    for _ in range(150):
        axis, side = rng.integers(0, 3), rng.integers(0, 2)
        cell = np.stack([low := rng.integers(-9, 9, 3), low + rng.integers(1, 6, 3)])
        uv = [i for i in range(3) if i != axis]
        outline = np.full((4, 3), cell[side, axis])
        ends = np.stack([cell[0] - rng.integers(-3, 4, 3), cell[1] + rng.integers(-1, 4, 3)])
        if (ends[0] >= ends[1]).any():
            continue
        outline[:, uv] = [(ends[i, uv[0]], ends[j, uv[1]]) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]
        exact = occluder(cell.tolist(), outline.tolist())
        status = launch_umbra(cell[None], outline_table([outline]), [[0, 0]]).status[0]
        assert status == (TOUCHES if exact.planes is None else USABLE)
        seen.add(int(status))
    assert seen == {TOUCHES, USABLE}


def test_bent_outlines_have_no_umbra_from_cells_that_they_cut_or_that_are_round_an_edge():
    cut, before = [[40, 40, 0], [60, 60, 20]], [[0, 0, -99], [9, 9, -90]]
    round_an_edge = [[95, -105, -65], [105, -95, -55]]
    umbras = launch_umbra([cut, round_an_edge, before], bent_quadrilateral(60), [[0, 0], [1, 0], [2, 0]])
    assert umbras.status.tolist() == [STRADDLES, BENT, USABLE]


def test_what_is_before_the_outline_is_in_no_umbra():
    table = outline_table([[[30, 2, 3], [30, 9, 3], [30, 9, 8]]])
    flat = launch_umbra([[[0, 0, 0], [1, 1, 1]]], table, [[0, 0]])
    assert not flat.contains(0, np.array([[29.0, 5, 5]]))[0]


def test_threads_and_order_change_nothing():
    rng = np.random.default_rng(10)
    scenes = [random_scene(rng)[:2] for _ in range(40)]
    boxes, table = np.array([cell for cell, _ in scenes]), outline_table([outline for _, outline in scenes])
    pairs = np.stack(np.meshgrid(np.arange(40), np.arange(40)), axis=-1).reshape(-1, 2)
    one, two = (launch_umbra(boxes, table, pairs, device=Device(threads=threads)) for threads in (1, 2))
    for name in ("status", "planes", "rho"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
    last = launch_umbra(boxes, table, pairs[-1:])
    np.testing.assert_array_equal(last.planes, one.planes[one.starts[-2] :])


@pytest.mark.parametrize("box", [[[0, 0, 0], [1, 0, 1]], [[0, 0, 0], [1, 1, 2**24]]])
def test_bad_cells(box):
    with pytest.raises(InputError, match="view cell 0: expected a box with inside"):
        launch_umbra([box], outline_table([[[30, 2, 3], [30, 9, 3], [30, 9, 8]]]), [[0, 0]])
