import numpy as np
import pytest
from viewcell.data.readers.rings import newell, ring_triangles

WALL = np.array([[0, 0, 0], [8, 0, 0], [8, 0, 3], [0, 0, 3]], float)


def hole(x: float, z: float, width: float, height: float) -> np.ndarray:
    return np.array([[x, 0, z], [x + width, 0, z], [x + width, 0, z + height], [x, 0, z + height]], float)


def area(vertices: np.ndarray, faces: np.ndarray) -> float:
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1).sum(), np.linalg.norm(normals.sum(axis=0)))
    return float(np.linalg.norm(normals, axis=1).sum())


HOLES = {
    "none": ([], 24),
    "a window": ([hole(1, 1, 2, 1)], 22),
    "a door to the floor": ([hole(1, 0, 1, 2)], 22),
    "doors side by side": ([hole(1, 0, 1, 2), hole(2, 0, 1, 2)], 20),
    "two that overlap": ([hole(1, 1, 2, 1), hole(2, 1, 2, 1)], 21),
    "one in another": ([hole(1, 1, 3, 1), hole(2, 1.25, 1, 0.5)], 21),
    "one twice": ([hole(1, 1, 2, 1), hole(1, 1, 2, 1)], 22),
    "one beyond the edge": ([hole(7, 1, 2, 1)], 23),
    "one through the wall": ([hole(3, -1, 1, 5)], 21),
    "all of it": ([hole(0, 0, 8, 3)], 0),
    "more than all": ([hole(-1, -1, 10, 5)], 0),
    "turned the other way": ([hole(1, 1, 2, 1)[::-1]], 22),
}


@pytest.mark.parametrize("what", HOLES)
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("turn", [1, -1])
def test_holes_are_cut_whatever_they_touch(what, axis, turn):
    holes, left = HOLES[what]
    rings = [np.roll(ring, axis, axis=1)[::turn] for ring in (WALL, *holes)]
    vertices, faces = ring_triangles(rings[0], rings[1:])
    assert area(vertices, faces) == pytest.approx(left)
    if left:
        corners = vertices[faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (normals @ newell(rings[0]) > 0).all()


def test_what_is_left_is_not_the_hole():
    vertices, faces = ring_triangles(WALL, [hole(3, -1, 1, 5), hole(6, 1, 1, 1)])
    middles = vertices[faces].mean(axis=1)
    for low, high in ((3, 4), (6, 7)):
        inside = (middles[:, 0] > low) & (middles[:, 0] < high) & ((low == 3) | (abs(middles[:, 2] - 1.5) < 0.5))
        assert not inside.any()


@pytest.mark.parametrize("seed", range(20))
def test_an_oblique_star_keeps_its_corners_and_its_area(seed):
    random = np.random.default_rng(seed)
    angles = np.sort(random.uniform(0, 2 * np.pi, 12))
    flat = np.stack([np.cos(angles), np.sin(angles)], axis=1) * random.uniform(1, 3, (12, 1))
    frame = np.linalg.qr(random.normal(size=(3, 3)))[0]
    ring = flat @ frame[:2] + random.normal(size=3)
    vertices, faces = ring_triangles(ring, [])
    np.testing.assert_array_equal(vertices, ring)
    assert area(vertices, faces) == pytest.approx(np.linalg.norm(newell(ring)))


def test_a_line_has_no_triangles():
    assert len(ring_triangles(WALL[[0, 1, 1]], [])[1]) == 0
