"""Balance: the budget is kept where it can be, no level is off by more than it says, errors go the way they must."""

import numpy as np
import pytest
from builders.depth_scenes import CELL, balls_scene
from viewcell.data.camera import Screen
from viewcell.data.errors import InputError
from viewcell.solvers.depth_meshes import balance as module
from viewcell.solvers.depth_meshes.balance import PIXELS_LEAST, PIXELS_MOST, PUBLISHED_WEIGHT, Balance, Budget
from viewcell.solvers.depth_meshes.far_side import FarSides

SMALL, ALL = {"texels": 64}, np.arange(40)


@pytest.fixture(scope="module")
def scene():
    return balls_scene(np.random.default_rng(0))


def faces_of(scene, found):
    """Triangles of near geometry at its levels."""
    return sum(
        len(scene.definitions[scene.objects[o].definition_id].lods[level].faces)
        for o, level in zip(found.side.near.tolist(), found.levels.tolist(), strict=True)
    )


@pytest.mark.parametrize("triangles", [1_500, 2_000, 2_500, 3_000, 4_000, 8_000, 16_000])
def test_the_budget_is_kept(scene, triangles):
    found = Balance(scene, Budget(triangles, skin_weight=0.01), **SMALL).of(ALL, CELL)
    assert found.triangles == faces_of(scene, found) + found.side.triangles <= triangles
    assert np.array_equal(np.union1d(found.side.near, found.side.far), ALL)
    assert found.without <= scene.triangle_counts.sum()
    assert PIXELS_LEAST <= found.pixels <= PIXELS_MOST


@pytest.mark.parametrize("weight", [PUBLISHED_WEIGHT, 0.03])
@pytest.mark.parametrize(("seed", "triangles", "count"), [(1, 2_500, 40), (2, 3_000, 40), (0, 20_000, 200)])
def test_of_boxes_the_one_with_the_least_errors(seed, triangles, count, weight):
    """Against many boxes, each with the least threshold that does; of many balls some hide behind others."""
    scene, every = balls_scene(np.random.default_rng(seed), count, 16.0), np.arange(count)
    balance = Balance(scene, Budget(triangles, skin_weight=weight), **SMALL)
    found = balance.of(every, CELL)
    assert found.triangles <= triangles
    reach, boxes = found.side.reach, scene.object_bounds()
    away = np.maximum(boxes[:, 0], -boxes[:, 1]).max(axis=1)
    always = np.isin(every, FarSides(scene, **SMALL).geometry(every, CELL, 4 * reach))

    def errors(box):
        geometry = every[always | (away <= box / 2)]
        allowed = triangles * (1 if len(geometry) == count else 1 - module.MESH_SHARE)
        for pixels in module.THRESHOLDS:
            levels = balance._levels(geometry, CELL.astype(float), pixels)
            if sum(len(scene.definitions[o].lods[k].faces) for o, k in zip(geometry, levels, strict=True)) <= allowed:
                skin = balance._skin(reach, box) if len(geometry) < count else 0.0
                return weight * skin + pixels
        return np.inf

    others = np.geomspace(4 * reach, 2 * away.max(), 100)
    assert errors(found.cull_box) <= min(map(errors, others)) * (1 + 1e-9) < np.inf


def test_as_boxes_grow_skins_shrink_and_levels_coarsen(scene):
    balance, reach = Balance(scene, Budget(4_000), **SMALL), np.sqrt(3) * 1024
    boxes = np.geomspace(4 * reach, 40 * reach, 20)
    skins = [balance._skin(reach, box) for box in boxes]
    assert skins == sorted(skins, reverse=True)
    away = np.maximum(scene.object_bounds()[:, 0], -scene.object_bounds()[:, 1]).max(axis=1)
    thresholds = [balance._threshold(ALL[away <= box / 2], CELL.astype(float), 4_000) for box in boxes]
    assert thresholds == sorted(thresholds) and thresholds[0] < thresholds[-1]


def test_with_triangles_to_spare_all_is_geometry(scene):
    found = Balance(scene, Budget(100_000), **SMALL).of(ALL, CELL)
    assert found.pixels == PIXELS_LEAST and not len(found.side.far) and not found.pays
    assert len(Balance(scene, Budget(3_000, skin_weight=0.01), **SMALL).of(ALL, CELL).side.far) > 5
    assert not len(Balance(scene, Budget(), **SMALL).of(ALL[:0], CELL).side.near)


def test_what_cannot_be_kept_is_as_coarse_as_can_be(scene):
    found = Balance(scene, Budget(10), **SMALL).of(ALL, CELL)
    assert found.pixels == PIXELS_MOST and found.triangles > 10


@pytest.mark.parametrize("pixels", [0.5, 2.0, 9.0])
def test_no_level_is_off_by_more(scene, pixels):
    """By the angle of its deviation from the nearest corner of the cell, in a corner of the screen."""
    screen = Screen()
    balance = Balance(scene, Budget(1000, screen), **SMALL)
    levels = balance._levels(ALL, CELL.astype(float), pixels)
    corner = np.arctan(np.hypot(screen.width, screen.height) / 2 / screen.focal)
    boxes = scene.object_bounds()
    for number, level in enumerate(levels.tolist()):
        error = scene.definitions[number].lods[level].error_m / scene.grid_m
        apart = np.maximum(0, np.maximum(boxes[number, 0] - CELL[1], CELL[0] - boxes[number, 1]) - error)
        angle = np.arcsin(min(1.0, error / np.linalg.norm(apart)))
        assert screen.focal * (np.tan(corner + angle) - np.tan(corner)) <= pixels * (1 + 1e-9) or level == 0
    assert levels.max() > 0


@pytest.mark.parametrize("seed", range(3))
def test_geometry_about_a_larger_box_is_geometry_about_a_smaller_one_or_within_it(seed):
    scene = balls_scene(np.random.default_rng(seed), count=200, spread=16.0)
    sides, boxes, every = FarSides(scene, texels=128), scene.object_bounds(), np.arange(200)
    small, large = 8 * 1024, 14 * 1024
    found = sides.geometry(every, CELL, large)
    within = ((boxes[:, 0] <= large / 2) & (boxes[:, 1] >= -large / 2)).all(axis=1)
    assert np.isin(found, np.union1d(sides.geometry(every, CELL, small), np.flatnonzero(within))).all()
    assert np.array_equal(found, sides.of(every, CELL, large).near)
    assert within[found].any() and not within[found].all()


def test_meshes_pay_if_they_have_half_of_the_triangles(scene):
    found = Balance(scene, Budget(5_000, skin_weight=0.01), **SMALL).of(ALL, CELL)
    assert found.pays == (2 * found.side.triangles < found.stood_for)
    assert 0 < found.stood_for < found.without


@pytest.mark.parametrize("changes", [{"triangles": 0}, {"skin_weight": -1.0}, {"skin_weight": np.inf}])
def test_a_budget_of_nothing_is_refused(changes):
    with pytest.raises(InputError, match="expected a number above 0"):
        Budget(**changes)
