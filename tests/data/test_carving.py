"""Faces against a second reading of the paper: of polygons instead of triangles, in fractions, one edge at a time."""

from collections import Counter
from fractions import Fraction
from itertools import combinations, pairwise

import numpy as np
import pytest
import trimesh
from builders import random_solids
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull
from viewcell.data.buildings.arcade import make_arcade
from viewcell.data.carving import find_faces
from viewcell.data.scene import GRID_M, Role

STEP = 512


def cross(a, b):
    return tuple(a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3))


def edges_of(polygon):
    return [
        tuple(Fraction(x) - Fraction(y) for x, y in zip(a, b, strict=True)) for a, b in pairwise([*polygon, polygon[0]])
    ]


def kind_of(polygon):
    """Section 3 of the paper, word by word, but that a polygon with right angles only counts as its rectangles."""

    def axial(vector):
        return sum(x != 0 for x in vector) == 1

    edges = edges_of(polygon)
    normal = cross(edges[0], edges[1])
    if axial(normal) and all(axial(edge) for edge in edges):
        return 0
    square = all(sum(x * y for x, y in zip(a, b, strict=True)) == 0 for a, b in pairwise([*edges, edges[0]]))
    floor = all(edge[2] == 0 or edge[:2] == (0, 0) for edge in edges)
    return 1 if square and floor else 2


def groups(polygons, *, any_edge):
    """Number of sets of polygons that are connected by edges, by all or by those that are not axial."""
    sides = [{frozenset(ends) for ends in pairwise([*polygon, polygon[0]])} for polygon in polygons]
    label = list(range(len(polygons)))
    for a, b in combinations(range(len(polygons)), 2):
        shared = sides[a] & sides[b]
        axial = [sum(x != y for x, y in zip(*ends, strict=True)) == 1 for ends in shared]
        if any(any_edge or not one for one in axial):
            label = [label[a] if one == label[b] else one for one in label]
    return len(set(label))


def prism(ring, height, axis):
    """Polygons of a prism over a convex ring; its axis is one of the three."""
    turned = [[tuple(np.roll([*map(int, p), z], axis + 1).tolist()) for p in ring] for z in (0, height)]
    low, high = turned
    sides = [(low[i - 1], low[i], high[i], high[i - 1]) for i in range(len(ring))]
    return [tuple(low[::-1]), tuple(high), *sides]


def ring_of(rng):
    """A convex ring whose corners lie on a coarse grid, often a rectangle, on the axes or turned."""
    if (choice := rng.integers(3)) == 2:
        while True:
            points = rng.integers(0, 17, (rng.integers(3, 9), 2))
            if np.linalg.matrix_rank(points - points[0]) == 2:
                return points[ConvexHull(points).vertices] * STEP
    a, b = rng.integers(1, 3, 2)
    along, across = (np.array([4, 0]), np.array([0, 4])) if choice else (np.array([3, 4]), np.array([-4, 3]))
    return np.array([[0, 0], a * along, a * along + b * across, b * across]) * STEP


def scene_of(solids, roles=None):
    meshes = []
    for polygons in solids:
        corners = [corner for p in polygons for k in range(1, len(p) - 1) for corner in (p[0], p[k], p[k + 1])]
        faces = np.arange(len(corners)).reshape(-1, 3)
        meshes.append(trimesh.Trimesh(np.array(corners) * GRID_M, faces, process=False))
    return random_solids.scene_of_meshes(meshes, roles)


@given(st.integers(0, 2**32), st.integers(1, 4))
def test_faces_are_what_the_paper_calls_them(seed, count):
    rng = np.random.default_rng(seed)
    solids = [prism(ring_of(rng), int(rng.integers(1, 9)) * STEP, int(rng.integers(3))) for _ in range(count)]
    found = find_faces(scene_of(solids))
    kinds = [[kind_of(polygon) for polygon in polygons] for polygons in solids]
    assert found.counts == tuple(Counter(kind for of in kinds for kind in of)[kind] for kind in range(3))
    oblique = [
        [polygon for polygon, kind in zip(*both, strict=True) if kind == 2] for both in zip(solids, kinds, strict=True)
    ]
    assert found.elements == sum(groups(polygons, any_edge=False) for polygons in oblique)
    assert found.clusters == sum(groups(polygons, any_edge=True) for polygons in oblique)
    areas = [0.0] * 3
    for polygons, of in zip(solids, kinds, strict=True):
        for polygon, kind in zip(polygons, of, strict=True):
            fan = np.array(polygon, float) * GRID_M
            areas[kind] += np.linalg.norm(np.cross(fan[1:-1] - fan[0], fan[2:] - fan[0]).sum(axis=0)) / 2
    assert found.areas_m2 == pytest.approx(areas) and sum(found.shares) == pytest.approx(1.0)


def test_two_slopes_without_gables_are_two_elements_of_one_cluster():
    """They share the ridge, which is axial."""
    roof = prism([(0, 0), (2048, 0), (1024, 512)], 4096, 1)
    slopes = [polygon for polygon in roof if len(polygon) == 4 and kind_of(polygon) == 2]
    assert len(slopes) == 2
    found = find_faces(scene_of([slopes]))
    assert (found.counts, found.elements, found.clusters) == ((0, 0, 2), 2, 1)
    gabled = find_faces(scene_of([roof]))
    assert (gabled.counts, gabled.elements, gabled.clusters) == ((1, 0, 4), 1, 1)


def test_the_arcade_has_a_cluster_for_each_window_and_one_for_the_passage():
    """192 faces of the reveals, as in the paper, in half as many planes; front and back of nine walls have an arch."""
    found = find_faces(make_arcade(furnished=False))
    assert found.counts[1:] == (0, 8 * 12 + 4 + 9 * 2) and (found.elements, found.clusters) == (9, 9)
    assert found.wall_shares[0] > 0.99


@pytest.mark.parametrize(
    ("steps", "band"), [(0, 0), (1, 1), (3, 1), (4, 2), (40, 2), (41, 3), (100, 3), (104, 4), (9000, 4)]
)
@pytest.mark.parametrize("axis", [0, 1])
def test_walls_are_measured_by_how_far_they_miss_their_axis(steps, band, axis):
    """A wall of 10 m whose far end lies so many steps beside the axis."""
    ring = np.array([(0, 0), (10240, steps), (10240, steps + 256), (0, 256)])
    found = find_faces(scene_of([prism(ring if axis else ring[::-1, ::-1], 3072, 2)]))
    ends = 2 * 256 * 3072 * GRID_M**2
    length = np.hypot(10240, steps)
    sides = 2 * length * 3072 * GRID_M**2
    expected = [0.0] * 5
    expected[0] += ends
    expected[band] += sides
    assert found.walls_m2 == pytest.approx(expected)


def test_what_is_turned_and_snapped_is_still_rectangular():
    box = random_solids.box([0, 0, 0], [10, 4, 3])
    box.apply_transform(trimesh.transformations.rotation_matrix(0.3, [0, 0, 1]))
    found = find_faces(random_solids.scene_of_meshes([box]))
    assert found.counts == (0, 6, 0) and found.wall_shares[4] == 1.0


@pytest.mark.parametrize("angle", [0.3, 0.5, 0.7, 0.9])
def test_faces_that_snapping_bends_are_one_each(angle):
    box = random_solids.box([0.123, 0.4567, 0], [10, 4, 3])
    box.apply_transform(trimesh.transformations.rotation_matrix(angle, [1, 2, 3]))
    found = find_faces(random_solids.scene_of_meshes([box]))
    assert (found.counts, found.elements, found.clusters) == ((0, 0, 6), 1, 1)


def test_only_occluders_have_a_say():
    scene = random_solids.scene_of_meshes([random_solids.box([0, 0, 0], [1, 1, 1])], [Role.DETAIL])
    found = find_faces(scene)
    assert sum(found.counts) == 0 and found.shares == [0.0] * 3 and found.wall_shares == [0.0] * 5
