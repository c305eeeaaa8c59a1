import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.readers.triangulate import is_bent, newell, polygon_triangles, triangulated


def area(points: np.ndarray, faces: np.ndarray) -> float:
    corners = points[faces]
    return float(
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    )


def cut(points: np.ndarray) -> tuple[np.ndarray, int]:
    faces, _, bent = triangulated(points, np.arange(len(points)), np.array([len(points)]))
    return faces, bent


@given(st.lists(st.integers(1, 6), min_size=3, max_size=60), st.integers(0, 3), st.floats(-1, 1), st.booleans())
def test_combs_keep_their_area_and_all_corners(teeth, start, tilt, clockwise):
    """Concave, with corners in line; from any corner, in any plane, of more corners than ear cutting sorts."""
    outline = [(0.0, 9.0), (0.0, 0.0)]
    for k, depth in enumerate(teeth):
        outline += [(2 * k + x, y) for x, y in ((1, 0), (1, depth), (1.5, depth), (2, depth), (2, 0))]
    end = 2.0 * len(teeth) + 1
    flat = np.array([*outline, (end, 0.0), (end, 9.0)], np.float64)
    flat = np.roll(flat, start, axis=0)[:: -1 if clockwise else 1]
    points = np.column_stack([flat, tilt * flat[:, 0] - tilt / 2 * flat[:, 1]])
    faces, bent = cut(points)
    assert not bent
    assert area(points, faces) == pytest.approx(np.linalg.norm(newell(points)) / 2)
    assert set(faces.ravel().tolist()) == set(range(len(points)))
    normals = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
    assert (normals @ newell(points) > -1e-9).all()


def test_corners_in_line_are_kept():
    side = np.arange(4.0)
    flat = np.concatenate([np.column_stack(pair) for pair in (
        (side, 0 * side), (0 * side + 4, side), (4 - side, 0 * side + 4), (0 * side, 4 - side))])  # fmt: skip
    for start in range(len(flat)):
        points = np.column_stack([np.roll(flat, start, axis=0), np.zeros(len(flat))])
        faces, _ = cut(points)
        assert set(faces.ravel().tolist()) == set(range(16))
        assert area(points, faces) == pytest.approx(16)


def test_spikes_and_repeated_corners_add_nothing():
    points = np.array([[0, 0, 0], [4, 0, 0], [4, 0, 0], [4, 3, 0], [4, 7, 0], [4, 3, 0], [0, 3, 0], [0, 0, 0]], float)
    assert area(points, cut(points)[0]) == pytest.approx(12)


def test_a_concave_quad_is_cut_along_its_inner_diagonal():
    points = np.array([[0, 0, 0], [4, 0, 0], [1, 1, 0], [0, 4, 0]], float)
    for turn in range(4):
        turned = np.roll(points, turn, axis=0)
        assert area(turned, cut(turned)[0]) == pytest.approx(4)


def test_bent_polygons_are_counted():
    square = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]], float)
    pentagon = np.array([[0, 0, 0], [4, 0, 0], [5, 2, 0], [4, 4, 0], [0, 4, 0]], float)
    for points in (square, pentagon):
        assert cut(points)[1] == 0 and not is_bent(points)
        points[2, 2] = 0.5
        assert cut(points)[1] == 1 and is_bent(points)


def test_polygons_without_area_or_end_do_not_stop():
    for points in (np.zeros((5, 3)), np.full((5, 3), np.nan), np.full((6, 3), np.inf), np.arange(15.0).reshape(5, 3)):
        with np.errstate(invalid="ignore"):
            assert len(polygon_triangles(points.tolist(), list(range(len(points)))))


def test_order_and_owners_of_many_polygons():
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0.5, 2, 0], [0, 1, 0]], float)
    corners, sizes = np.array([0, 1, 2, 3, 4, 0, 1, 2, 0, 1, 2, 4]), np.array([5, 3, 4])
    faces, owners, _ = triangulated(points, corners, sizes)
    assert owners.tolist() == [0, 0, 0, 1, 2, 2]
    assert faces[3].tolist() == [0, 1, 2]
