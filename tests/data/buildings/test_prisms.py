import numpy as np
import pytest
import trimesh
from builders.closed import assert_closed
from viewcell.data.buildings.prisms import prism, regular, slanted, wall
from viewcell.data.buildings.shapes import pierced_block

SQUARE = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]]
# Corners on lines between others, which a cutter of ears passes over.
HOLES = [[[0.5, 1.0], [1.5, 1.0], [1.0, 2.0]], [[2.0, 1.0], [3.0, 1.0], [3.0, 2.0], [2.0, 2.0]]]


def volume(mesh):
    return trimesh.Trimesh(mesh.vertices, mesh.faces).volume


@pytest.mark.parametrize(("holes", "area"), [([], 12.0), (HOLES[:1], 11.5), (HOLES, 10.5)])
def test_a_prism_is_closed_without_its_holes(holes, area):
    mesh = prism(SQUARE, holes, 1.0, 3.0)
    assert_closed(mesh)
    assert volume(mesh) == pytest.approx(2 * area)
    assert len(mesh.vertices) == 2 * (4 + sum(map(len, holes)))


def test_a_prism_may_be_hollowed_from_its_edge():
    notch = [[0, 0], [1, 0], [0.5, 1], [1, 2], [3, 2], [3.5, 1], [3, 0], [4, 0], [4, 3], [0, 3]]
    assert_closed(prism(notch, [], 0.0, 1.0))
    assert volume(prism(notch, [], 0.0, 1.0)) == pytest.approx(12 - 5)


def test_a_wall_stands_on_its_outline():
    mesh = wall(SQUARE, HOLES, 1.0, 1.25)
    assert_closed(mesh)
    np.testing.assert_allclose([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)], [[0, 1, 0], [4, 1.25, 3]])
    assert volume(mesh) == pytest.approx(10.5 / 4)


@pytest.mark.parametrize("axis", [0, 1])
def test_slanted_ends_leave_all_else(axis):
    order = [axis, 1 - axis, 2]
    low, high = np.array([0.0, 0, 0])[order], np.array([6.0, 1, 3])[order]
    hole = np.array([[2.0, 0, 1], [3, 1, 2]])[:, order]
    mesh = slanted(pierced_block(low, high, [hole]), axis, (-0.5, 0.25), (5.0, 6.5))
    assert_closed(mesh)
    # Ends are trapezoids: the middle of each is where half of its slant is.
    assert volume(mesh) == pytest.approx((5.75 - -0.125) * 3 - 1)
    ends = mesh.vertices[np.isin(mesh.vertices[:, axis], [-0.5, 0.25, 5.0, 6.5])]
    assert {(float(v[axis]), float(v[1 - axis])) for v in ends} == {(-0.5, 0), (0.25, 1), (5, 0), (6.5, 1)}


@pytest.mark.parametrize("sides", [3, 6, 24])
def test_a_regular_polygon_lies_about_its_circle(sides):
    corners = regular(sides, 5.0)
    middles = (corners + np.roll(corners, -1, axis=0)) / 2
    np.testing.assert_allclose(np.linalg.norm(middles, axis=1), 5.0)
    np.testing.assert_allclose(middles[0], [5.0, 0.0], atol=1e-12)
    assert trimesh.path.polygons.Polygon(corners).exterior.is_ccw
