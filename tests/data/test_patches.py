"""Patches: what they hold, and the theorem that makes an outline an occluder, checked in integers."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from builders.outlines import random_disc, surface
from viewcell.data.errors import InputError
from viewcell.data.patches import area_vectors, find_patches
from viewcell.verify.arithmetic import cross, dot, minus
from viewcell.verify.exact.segment import MISS, crossing_kind


def patches_of(triangles, owners=None, **options):
    owners = np.zeros(len(triangles), np.int32) if owners is None else owners
    return find_patches(triangles, owners, **{"least_area": 1.0, **options})


def outlines(patches):
    return [patches.corners[a:b] for a, b in zip(patches.starts[:-1], patches.starts[1:], strict=True)]


def oblique(scale=1000):
    """A plane that no snapped polygon lies in."""
    return lambda u, v: (
        u * scale * 1.0003 + v / 3,
        u * scale / 2.1 + v * scale / 9,
        v * scale * 0.7002 + u * scale / 31.7,
    )


def corners_of(box):
    return [[int(box[side][i]) for i, side in enumerate(pick)] for pick in product((0, 1), repeat=3)]


def winds_round_every_line(outline, cell, box):
    """Condition (1) of the theorem by its 64 pairs of vertices, in integers."""
    edges = [(a.tolist(), b.tolist()) for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True)]
    signs = set()
    for p, x in product(corners_of(cell), corners_of(box)):
        along = minus(x, p)
        signs |= {np.sign(dot(along, cross(minus(a, p), minus(b, p)))) for a, b in edges}
    return signs <= {0, 1} or signs <= {0, -1}


def separates(direction, cell, points, box):
    """Whether cell, points, box come in this order along an integer direction, the box clear of the points."""
    before, at, behind = (
        [dot(direction, point) for point in group] for group in (corners_of(cell), points.tolist(), corners_of(box))
    )
    return max(before) <= min(at) and max(at) < min(behind)


def check_theorem(seed, scenes):
    """Random cells and boxes on both sides of random discs; returns how often the conditions held."""
    rng, held = np.random.default_rng(seed), 0
    for _ in range(scenes):
        triangles, size = random_disc(rng)
        patches = patches_of(triangles, axial=True, most_corners=12, cos_limit=0.5)
        if len(patches.area) != 1:
            continue
        points, outline = triangles.reshape(-1, 3), outlines(patches)[0]
        direction = np.round(patches.normal[0] * 1000).astype(np.int64) * int(rng.choice([-1, 1]))
        middle = points.mean(axis=0)
        for _ in range(6):
            ends = []
            for sign in (-1, 1):
                away = sign * direction / 1000 * size * rng.uniform(0.3, 6) + rng.normal(size=3) * size * 0.4
                low = np.round(middle + away).astype(np.int64)
                ends.append(np.array([low, low + rng.integers(1, 2 + size // 2, 3)]))
            cell, box = ends
            if not separates(direction.tolist(), cell, points, box) or not winds_round_every_line(outline, cell, box):
                continue
            held += 1
            for _ in range(5):
                # Sixteenths are exact, and the ends of the range are the box's own faces.
                p, x = (e[0] + rng.integers(0, 17, 3) * (e[1] - e[0]) / 16 for e in (cell, box))
                assert any(crossing_kind(p, x, t) != MISS for t in triangles), f"{p} sees {x} through {triangles}"
    return held


def test_every_segment_of_the_theorem_meets_the_disc():
    assert check_theorem(1, 120) > 40


@pytest.mark.slow
def test_every_segment_of_the_theorem_meets_the_disc_many():
    assert check_theorem(2, 5000) > 2000


def test_a_snapped_quadrilateral_is_one_occluder_though_no_plane_holds_it():
    triangles = surface(1, 1, oblique())
    a, b = area_vectors(triangles.astype(np.int64))
    assert np.cross(a, b).any()
    patches = patches_of(triangles)
    assert [len(outline) for outline in outlines(patches)] == [4]
    assert patches.area[0] == pytest.approx(np.linalg.norm(a + b) / 2)
    assert patches.depth[0, 1] - patches.depth[0, 0] < 2


@pytest.mark.parametrize("columns, rows", [(4, 1), (4, 3), (7, 7)])
def test_a_grid_of_exactly_coplanar_triangles_is_one_rectangle(columns, rows):
    triangles = surface(columns, rows, lambda u, v: (u * 1000, u * 500 + v * 100, v * 700 + u * 32))
    for turned in (triangles, triangles[:, ::-1], triangles * [1, 1, -1], triangles[:, [1, 2, 0]] * [-1, 1, 1]):
        assert [len(outline) for outline in outlines(patches_of(turned))] == [4]


def test_a_snapped_grid_is_one_occluder_if_it_may_have_the_corners():
    triangles = surface(4, 3, oblique())
    assert len(patches_of(triangles, most_corners=14).area) == 1
    several = patches_of(triangles, most_corners=8)
    assert len(several.area) > 1
    assert np.diff(several.starts).max() <= 8


def test_an_l_shape_is_held_by_overlapping_convex_patches():
    squares = [(0, 0), (1, 0), (2, 0), (0, 1), (0, 2)]
    plane = surface(3, 3, lambda u, v: (u * 600, v * 600, u * 200 + v * 200))
    at = np.stack([plane[:, :, 0].min(axis=1), plane[:, :, 1].min(axis=1)], axis=1) // 600
    plane = plane[[tuple(corner) in squares for corner in at.tolist()]]
    patches = patches_of(plane)
    middles = [np.array([600 * i + 300, 600 * j + 300]) for i, j in squares]
    found = []
    for outline in outlines(patches):
        flat = outline[:, :2].astype(np.int64)
        sides = np.roll(flat, -1, axis=0) - flat
        turns = [np.sign(sides[:, 0] * (m - flat)[:, 1] - sides[:, 1] * (m - flat)[:, 0]) for m in middles]
        found.append([abs(t.sum()) == len(t) for t in turns])
    assert np.any(found, axis=0).all()
    assert np.sum(found) > len(squares), "no overlap"


def test_measures_are_those_of_the_disc():
    patches = patches_of(surface(5, 2, lambda u, v: (u * 300, v * 400 + u * 20, 900 * np.sin(u / 4) + v * 55)))
    for i, outline in enumerate(outlines(patches)):
        spread = (outline - outline[0]).astype(np.int64)
        vector = np.cross(spread, np.roll(spread, -1, axis=0)).sum(axis=0) / 2
        np.testing.assert_allclose(patches.normal[i] * patches.area[i], vector)
        assert (patches.boxes[i, 0] <= outline.min(axis=0)).all() and (patches.boxes[i, 1] >= outline.max(axis=0)).all()
        low, high = (Fraction(float(d)) for d in patches.depth[i])
        normal = [Fraction(float(c)) for c in patches.normal[i]]
        for corner in outline.tolist():
            assert low <= sum(n * c for n, c in zip(normal, corner, strict=True)) <= high


def test_depth_and_box_hold_corners_inside_the_outline():
    roof = surface(2, 2, lambda u, v: (u * 500, v * 500, np.where((u == 1) & (v == 1), 5, 0)))
    patches = patches_of(roof, axial=True)
    assert np.ptp(patches.boxes[0], axis=0).tolist() == [1000, 1000, 5]
    assert patches.depth[0, 1] - patches.depth[0, 0] == pytest.approx(5)


def test_axial_triangles_are_left_out_unless_asked_for():
    wall = surface(2, 1, lambda u, v: (u * 500, v * 500, 7))
    assert len(patches_of(wall).area) == 0
    assert patches_of(wall, axial=True).area.tolist() == [500_000.0]


def test_a_cube_has_six_faces():
    cube = []
    for axis, side in product(range(3), (0, 900)):
        face = surface(1, 1, lambda u, v, side=side: (u * 900, v * 900, side))
        cube.append(np.roll(face, axis, axis=2))
    assert patches_of(np.concatenate(cube), axial=True).area.tolist() == [810_000.0] * 6


def test_orientation_doubles_and_slivers_do_not_matter():
    triangles = surface(2, 2, oblique())
    wanted = patches_of(triangles, most_corners=12)
    mixed = triangles.copy()
    mixed[::3] = mixed[::3, ::-1]
    sliver = np.array([[triangles[0, 0], triangles[0, 1], triangles[0, 1]]])
    for changed in (mixed, np.concatenate([triangles, triangles[2:5, [1, 2, 0]], mixed[:4], sliver])):
        got = patches_of(changed, most_corners=12)
        assert np.diff(got.starts).tolist() == np.diff(wanted.starts).tolist()
        np.testing.assert_allclose(got.area, wanted.area)


def test_owners_corners_and_folds_part_patches():
    triangles = surface(2, 1, oblique())
    parted = patches_of(triangles, np.array([4, 9, 4, 9]))
    assert sorted(parted.owner.tolist()) == [4, 9]
    folded = surface(2, 1, lambda u, v: (u * 300 + v, v * 400 + u * 3, 150 * abs(u - 1)))
    assert len(patches_of(folded).area) == 2
    ridge = patches_of(folded, cos_limit=0.5)
    assert np.diff(ridge.starts).tolist() == [6], "corners on the ridge are collinear in plan only"


def test_small_patches_are_dropped():
    triangles = surface(2, 1, oblique())
    area = patches_of(triangles).area[0]
    assert len(patches_of(triangles, least_area=area * 1.01).area) == 0
    assert len(patches_of(np.zeros((0, 3, 3), np.int32)).area) == 0
    waves = surface(20, 20, lambda u, v: (u * 1000, v * 1000, 3000 * np.sin(u / 3) + 2000 * np.cos(v / 4)))
    patches = patches_of(waves)
    assert len(patches.area) < len(waves) / 4, "patches cover what others hold instead of what none does"
    middle = float(np.median(patches.area))
    large = patches_of(waves, least_area=middle)
    assert 0 < len(large.area) < len(patches.area) and large.area.min() >= middle


@pytest.mark.parametrize("options", [{"most_corners": 2}, {"cos_limit": 0.0}, {"cos_limit": 1.5}])
def test_bad_options(options):
    with pytest.raises(InputError, match="expected most_corners"):
        patches_of(surface(1, 1, oblique()), **options)
