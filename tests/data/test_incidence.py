"""Objects in cells: against clipping every triangle to every cell in rationals."""

import numpy as np
import pytest
from builders.random_buildings import box_triangles as box
from builders.random_buildings import scene_of, tetrahedron
from viewcell.data.incidence import clip_bounds, populate
from viewcell.verify.exact.clip import bounds_of, clipped, has_area


def grid_cells():
    """27 cells of uneven size that tile 300 x 300 x 300 steps."""
    ends = [0, 70, 150, 300]
    spans = [(ends[i], ends[i + 1]) for i in range(3)]
    return np.array([[(x[0], y[0], z[0]), (x[1], y[1], z[1])] for x in spans for y in spans for z in spans], np.int32)


def random_scene(seed):
    rng = np.random.default_rng(seed)
    parts = []
    for _ in range(5):
        corners = rng.integers(5, 295, (4, 3))
        parts.append((tetrahedron(corners), "detail"))
        low = rng.integers(0, 200, 3) // 10 * 10
        parts.append((box(low, low + rng.integers(1, 100, 3)), "occluder"))
    return scene_of(parts)


@pytest.mark.parametrize("seed", range(4))
def test_incidence_against_rational_clipping(seed):
    scene, cells = random_scene(seed), grid_cells()
    found = populate(scene, cells)
    rows = {(int(c), int(o)): n for n, (c, o) in enumerate(zip(found.cell, found.object_id, strict=True))}
    triangles, owners = scene.triangles()
    for number in range(len(scene.objects)):
        for cell, (low, high) in enumerate(cells):
            pieces = [clipped(triangle, low, high) for triangle in triangles[owners == number]]
            shown = [piece for piece in pieces if has_area(piece)]
            if not shown:
                continue
            assert (cell, number) in rows, f"object {number} has surface in cell {cell}"
            least, most = bounds_of([point for piece in shown for point in piece])
            made = found.boxes[rows[cell, number]]
            for axis in range(3):
                assert made[0, axis] <= least[axis] and made[1, axis] >= most[axis]
    # Not looser than by touching pieces and by rounding outward.
    for (cell, number), row in rows.items():
        pieces = [clipped(triangle, *cells[cell]) for triangle in triangles[owners == number]]
        least, most = bounds_of([point for piece in pieces for point in piece])
        for axis in range(3):
            assert found.boxes[row, 0, axis] > least[axis] - 2 and found.boxes[row, 1, axis] < most[axis] + 2
    assert len(rows) == len(found.cell)


@pytest.mark.parametrize("seed", range(4))
def test_rows_are_in_order_and_whole_means_whole(seed):
    scene, cells = random_scene(seed), grid_cells()
    found = populate(scene, cells)
    order = np.lexsort((found.object_id, found.cell))
    np.testing.assert_array_equal(order, np.arange(len(order)))
    for cell in range(len(cells)):
        assert (found.cell[found.starts[cell] : found.starts[cell + 1]] == cell).all()
    assert found.starts[-1] == len(found.cell)
    bounds = scene.object_bounds()
    inside = (cells[found.cell, 0] < bounds[found.object_id, 0]).all(axis=1)
    inside &= (cells[found.cell, 1] > bounds[found.object_id, 1]).all(axis=1)
    np.testing.assert_array_equal(found.whole, inside)
    np.testing.assert_array_equal(found.boxes[found.whole], bounds[found.object_id[found.whole]])


def test_an_l_shaped_object_leaves_the_empty_corner():
    """Its bounding box fills the room, its surface does not reach the cell in the corner."""
    parts = np.concatenate([box((0, 0, 0), (300, 20, 100)), box((0, 0, 0), (20, 300, 100))])
    found = populate(scene_of([(parts, "occluder")]), grid_cells())
    corner = np.flatnonzero((grid_cells()[:, 0] == (150, 150, 0)).all(axis=1))[0]
    assert corner not in found.cell and len(found.cell) > 3


def test_touching_along_a_line_is_no_incidence():
    cells = np.array([[(0, 0, 0), (10, 10, 10)], [(10, 10, 0), (20, 20, 10)]], np.int32)
    found = populate(scene_of([(box((2, 2, 2), (10, 10, 8)), "detail")]), cells)
    np.testing.assert_array_equal(found.cell, [0])


def test_an_object_on_a_face_belongs_to_both_cells():
    cells = np.array([[(0, 0, 0), (10, 10, 10)], [(10, 0, 0), (20, 10, 10)]], np.int32)
    found = populate(scene_of([(box((10, 2, 2), (14, 8, 8)), "detail")]), cells)
    np.testing.assert_array_equal(found.cell, [0, 1])
    np.testing.assert_array_equal(found.boxes[0], [(10, 2, 2), (10, 8, 8)])


def test_no_objects_no_rows():
    found = populate(scene_of([]), grid_cells())
    assert len(found.cell) == 0 and found.boxes.shape == (0, 2, 3) and found.starts.tolist() == [0] * 28


def test_clip_bounds_are_within_triangle_and_box():
    rng = np.random.default_rng(1)
    triangles, low = rng.integers(-50, 50, (3000, 3, 3)), rng.integers(-50, 40, (3000, 3))
    boxes = np.stack([low, low + rng.integers(1, 60, (3000, 3))], axis=1)
    left, bounds = clip_bounds(triangles, boxes)
    assert 500 < left.sum() < 2900
    for side, limit, sense in ((0, np.maximum(triangles.min(axis=1), boxes[:, 0]), 1), (1, None, -1)):
        limit = np.minimum(triangles.max(axis=1), boxes[:, 1]) if limit is None else limit
        assert (sense * (bounds[left, side] - limit[left]) >= 0).all()
