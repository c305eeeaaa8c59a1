"""The judge of suspects against a plain one: every triangle in turn, in rationals, from the words of its docstring."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from builders import random_buildings, random_solids, small_house
from viewcell.data.scene import OPAQUE, Role
from viewcell.data.view_cells import as_graph
from viewcell.verify.exact.segment import BLOCKED, MISS, crossing_kind
from viewcell.verify.exact.sightline import Sightlines
from viewcell.verify.exact.trace import contact_links
from viewcell.verify.rays.adjudicate import Judge, Judgement, sightline_end
from viewcell.verify.rays.embree import Candidates
from viewcell.workbench.verify import make_judge


def judge_of(scene, cells):
    opaque, glass = scene.triangles(*OPAQUE), scene.triangles(Role.TRANSPARENT)
    return Judge(as_graph(cells), Sightlines(*opaque), Sightlines(*glass), contact_links(cells))


def time_of(origin, end, triangle):
    """Where a segment crosses a triangle's plane, as a share of it."""
    o, e = ([Fraction(float(c)) for c in point] for point in (origin, end))
    a, b, c = ([Fraction(int(x)) for x in corner] for corner in triangle)
    u, v = ([q - p for p, q in zip(a, other, strict=True)] for other in (b, c))
    n = [u[i - 2] * v[i - 1] - u[i - 1] * v[i - 2] for i in range(3)]
    before, after = (sum(x * (p - q) for x, p, q in zip(n, point, a, strict=True)) for point in (o, e))
    return before / (before - after)


class Plain:
    """What a sightline shows, triangle by triangle; which points are outside solids is asked of `Sightlines`."""

    def __init__(self, scene, cells):
        triangles, owners = scene.triangles()
        opaque = scene.object_mask(Role.OCCLUDER, Role.DETAIL)[owners]
        self.triangles, self.owners, self.opaque, self.cells = triangles, owners, opaque, cells
        self.solids = Sightlines(triangles[opaque], owners[opaque])

    def __call__(self, kind, cell, target, origin, end):
        low, high = self.cells[cell]
        if not ((origin > low) & (origin < high)).all() or not self.solids.outside_solids(origin[None])[0]:
            return Judgement.BLOCKED
        kinds = np.zeros(len(self.triangles), int)
        for k in np.flatnonzero(self.near(origin, end)):
            kinds[k] = crossing_kind(origin, end, self.triangles[k])
        met = np.flatnonzero(kinds != MISS)
        if kind == "cell":
            low, high = self.cells[target]
            if not ((end > low) & (end < high)).all():
                return Judgement.GRAZE
            worst = max([kinds[k] for k in met if self.opaque[k]], default=MISS)
            return (Judgement.VISIBLE, Judgement.GRAZE, Judgement.BLOCKED)[worst]
        own = [k for k in met if self.owners[k] == target and kinds[k] == BLOCKED]
        others = [k for k in met if self.owners[k] != target and self.opaque[k]]
        if not own:
            return Judgement.GRAZE
        first = min(time_of(origin, end, self.triangles[k]) for k in own)
        if any(kinds[k] != BLOCKED for k in others):
            return Judgement.GRAZE
        before = [k for k in others if time_of(origin, end, self.triangles[k]) <= first]
        return Judgement.BLOCKED if before else Judgement.VISIBLE

    def near(self, origin, end):
        low, high = np.minimum(origin, end), np.maximum(origin, end)
        return ((self.triangles.min(axis=1) <= high) & (self.triangles.max(axis=1) >= low)).all(axis=1)


def suspects(rng, scene, cells, kind, count):
    """Sightlines from cells at targets, many of them from, at or along what is on the grid: cells, targets and ends."""
    triangles, owners = scene.triangles()
    sources = rng.integers(0, len(cells), count)
    low, high = cells[sources].transpose(1, 0, 2).astype(float)
    # Now and then on the boundary or beyond.
    origins = low + rng.choice([0.0, 0.25, 0.5, 0.75, 1.0, -1.0], (count, 3), p=[0.02, 0.3, 0.33, 0.3, 0.03, 0.02]) * (
        high - low
    )
    origins = np.where(rng.random((count, 1)) < 0.5, origins, low + rng.random((count, 3)) * (high - low))
    if kind == "cell":
        targets = rng.integers(0, len(cells), count)
        low, high = cells[targets].transpose(1, 0, 2).astype(float)
        ends = low + rng.choice([0.0, 0.25, 0.5, 0.75, 1.0], (count, 3), p=[0.02, 0.31, 0.34, 0.31, 0.02]) * (
            high - low
        )
        return sources, targets, origins, ends
    picked = rng.integers(0, len(triangles), count)
    weights = rng.choice(4, (count, 3)) + np.eye(3)[rng.integers(0, 3, count)]
    points = np.einsum("nk,nki->ni", weights / weights.sum(axis=1, keepdims=True), triangles[picked].astype(float))
    return (
        sources,
        owners[picked],
        origins,
        origins + (points - origins) * rng.choice([1.0, 1.0001, 1.01, 2.0], (count, 1)),
    )


def crowded_scene(seed):
    """Solids of all roles, some of whose faces coincide, and view cells among them."""
    scene = random_solids.random_solids(seed, axial=7, turned=3)
    roles = (Role.OCCLUDER, Role.DETAIL, Role.TRANSPARENT)
    scene.objects = [replace(placed, role=roles[number % 3]) for number, placed in enumerate(scene.objects)]
    random = np.random.default_rng(seed)
    low = 256 * random.integers(-2, 14, (5, 3))
    return scene, np.stack([low, low + 256 * random.integers(1, 6, (5, 3))], axis=1)


def agreed(scene, cells, kind, seed, count):
    """How often each judgement is given, after both ways to judge gave the plain one."""
    rng, judge, plain = np.random.default_rng(seed), judge_of(scene, cells), Plain(scene, cells)
    work = suspects(rng, scene, cells, kind, count)
    together = judge.judge_all(kind, *work)
    for row, found in enumerate(together):
        one = [int(column[row]) for column in work[:2]], [column[row] for column in work[2:]]
        alone = judge.judge(kind, *one[0], *one[1])
        assert alone == found, (kind, one)
        assert alone == plain(kind, *one[0], *one[1]), (kind, one)
    return np.bincount(together, minlength=len(Judgement))


@pytest.mark.parametrize("kind", ["cell", "object"])
def test_all_judges_agree(kind):
    count = sum(agreed(*crowded_scene(seed), kind, seed, 150) for seed in range(3))
    assert min(count[[Judgement.BLOCKED, Judgement.GRAZE, Judgement.VISIBLE]]) > 15


@pytest.mark.parametrize("kind", ["cell", "object"])
def test_all_judges_agree_in_a_house(kind):
    graph = small_house.small_graph()
    count = agreed(small_house.small_scene(), graph.cells, kind, 7, 200)
    assert min(count[[Judgement.BLOCKED, Judgement.VISIBLE]]) > 10


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["cell", "object"])
def test_all_judges_agree_on_many(kind):
    for seed in range(100, 110):
        agreed(*crowded_scene(seed), kind, seed, 1000)


@pytest.mark.parametrize("sealed", [False, True])
@pytest.mark.parametrize("bare", [False, True])
def test_many_at_once_are_judged_as_one_by_one(bare, sealed, tmp_path):
    """With cracks to be sealed, and in a graph without triangles, too."""
    house = small_house.small_house(tmp_path, bare=bare)
    house.cracks = house.graph.portals[:3] if sealed and not bare else house.cracks
    judge, rng = make_judge(house), np.random.default_rng(5)
    for kind in ("cell",) if bare else ("cell", "object"):
        work = suspects(rng, small_house.small_scene(), house.graph.cells, kind, 240)
        if kind == "cell":
            # Through doorways, or hardly any sightline would pass.
            doors = house.graph.portals[rng.integers(0, 6, 160)]
            through = doors[:, 0] + rng.choice([0.0, 0.3, 0.5, 0.9], (160, 3)) * (doors[:, 1] - doors[:, 0])
            work[3][:160] = work[2][:160] + (through - work[2][:160]) * rng.choice([1.5, 2.0, 3.0], (160, 1))
            inside = (work[3][:, None] > house.graph.cells[:, 0]) & (work[3][:, None] < house.graph.cells[:, 1])
            held = inside.all(axis=2)
            work[1][:] = np.where(held.any(axis=1), held.argmax(axis=1), work[1])
        work[3][(work[2] == work[3]).all(axis=1)] += 1.0
        together = judge.judge_all(kind, *work)
        alone = [judge.judge(kind, *(int(c[row]) for c in work[:2]), *(c[row] for c in work[2:])) for row in range(240)]
        np.testing.assert_array_equal(together, alone)
        assert (together == Judgement.VISIBLE).sum() > 3
        assert kind == "object" or (together == Judgement.LEAK).any() == (sealed and not bare)


def test_of_two_objects_with_one_face_neither_hides_the_other_nor_shows():
    """Where their faces coincide either may be drawn; a little aside each is seen."""
    parts = [([1000, 0, 0], [1200, 600, 600]), ([1000, 300, 0], [1300, 900, 600])]
    scene = random_buildings.scene_of([(random_buildings.box_triangles(*part), "occluder") for part in parts])
    judge = judge_of(scene, np.array([[[0, 0, 0], [500, 900, 600]]]))
    origin = np.array([100.0, 455.3, 310.1])
    for target, alone in ((0, 150.7), (1, 750.7)):
        for y, outcome in ((alone, Judgement.VISIBLE), (450.7, Judgement.BLOCKED)):
            end = np.array([1000.0, y, 301.9])
            end = origin + (end - origin) * 1.0001
            assert judge.judge("object", 0, target, origin, end) is outcome
            assert judge.judge_all("object", *(np.array([x]) for x in (0, target, origin, end)))[0] == outcome


def test_the_end_of_a_sightline_is_where_it_should_be():
    """Behind the surface that float32 found, or in the middle of its way through the cell before it is stopped."""
    cells = np.array([[[0, 0, 0], [10, 10, 10]], [[100, 0, 0], [200, 10, 10]]])
    along = np.array([[1.0, 0, 0]] * 3)
    rays = Candidates(
        np.zeros(3, int), np.array([1, 0, 0]), np.array([0, 1, 1]), np.array([[5.0, 5, 5]] * 3), along,
        np.array([45.0, np.inf, 135.0]),
    )  # fmt: skip
    ends = [sightline_end(rays, k, cells)[0] for k in range(3)]
    assert 50.0 < ends[0] < 50.1
    assert ends[1:] == [150.0, 120.0]
