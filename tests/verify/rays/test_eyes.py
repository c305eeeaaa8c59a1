"""What random eyes see, where it is known exactly."""

import numpy as np
import pytest
from builders.random_buildings import box_triangles as box
from builders.random_buildings import scene_of
from viewcell.data.solids import closed_elements
from viewcell.data.view_cells import as_graph
from viewcell.verify.rays import eyes
from viewcell.verify.rays.embree import embree_scene
from viewcell.verify.rays.eyes import EyeSample, kept_by_eye

M = 1024
# Two halves of a hall; small boxes stand along their far ends.
HALVES = [[[0, 0, 0], [4 * M, 4 * M, 3 * M]], [[4 * M + 100, 0, 0], [8 * M + 100, 4 * M, 3 * M]]]
BOTH = [[0, 0, 0], [8 * M + 100, 4 * M, 3 * M]]
EACH = 4


def hall(role="occluder", wall=True):
    """The wall, if there is one, is object 0 and meets the hall's own walls, which nobody needs."""
    parts = [(box((4 * M, -9 * M, -9 * M), (4 * M + 100, 13 * M, 12 * M)), role)] if wall else []
    for x in (-200, 8 * M + 200):
        parts += [(box((x, 900 * k, M), (x + 100, 900 * k + 300, M + 300)), "detail") for k in range(EACH)]
    return scene_of(parts)


def sample(scene, cells, pairs=None, seed=0):
    graph = as_graph(np.array(cells))
    everything = np.indices((len(cells), len(scene.objects))).reshape(2, -1)
    return kept_by_eye(scene, closed_elements(scene), graph, tuple(everything if pairs is None else pairs), seed)


def test_one_cell_over_both_halves_keeps_what_an_eye_does_not_see():
    """2 n + 1 objects are kept; whoever stands on one side of the wall sees it and n others."""
    found = sample(hall(), [BOTH])
    assert found.ratios == pytest.approx((2 * EACH + 1) / (EACH + 1), abs=0.01)
    assert found.cells.tolist() == [0] and found.eyes >= 64


def test_where_nothing_hides_the_ratio_is_one():
    assert sample(hall(wall=False), [BOTH]).ratios.tolist() == [1.0]


def test_glass_hides_nothing_and_is_seen():
    assert sample(hall("transparent"), [BOTH]).ratios.tolist() == [1.0]


def test_glass_behind_a_wall_is_not_seen():
    pane = box((5 * M, -M, -M), (5 * M + 10, 5 * M, 4 * M))
    scene = scene_of([(box((4 * M, -9 * M, -9 * M), (4 * M + 100, 13 * M, 12 * M)), "occluder"), (pane, "transparent")])
    found = sample(scene, HALVES)
    assert found.ratios.tolist() == [2.0, 1.0] and found.worst == 0


def test_only_what_is_kept_counts():
    """Cells of the halves that keep no more than they can see are as good as an eye."""
    near = [[0, *range(1, EACH + 1)], [0, *range(EACH + 1, 2 * EACH + 1)]]
    pairs = np.repeat([0, 1], EACH + 1), np.concatenate(near)
    assert sample(hall(), HALVES, pairs).ratios.tolist() == [1.0, 1.0]


def test_a_hit_on_what_is_not_kept_is_no_sight_of_what_is():
    """From the right half, of four boxes behind the wall and one in front of it."""
    pairs = np.full(EACH + 1, 1), np.array([*range(1, EACH + 1), 2 * EACH])
    assert sample(hall(), HALVES, pairs).ratios.tolist() == [EACH + 1.0]


def test_eyes_stand_outside_solids():
    """A solid with something in it fills the left half of the cell; all eyes are in the right one."""
    block = box((0, 0, 0), (4 * M, 4 * M, 3 * M))
    scene = scene_of([(block, "occluder"), (box((M, M, M), (M + 9, M + 9, M + 9)), "detail")])
    assert sample(scene, [BOTH]).ratios.tolist() == [2.0]
    assert sample(scene, [[[10, 10, 10], [3 * M, 3 * M, 2 * M]]]) is None


def test_nothing_kept_is_no_ratio():
    none = np.zeros(0, int)
    assert sample(hall(), HALVES, (none, none)) is None


def test_the_same_again_and_another_seed_nearly():
    one, same, other = (sample(hall(), [*HALVES, BOTH], seed=seed) for seed in (0, 0, 5))
    assert one.ratios.tolist() == same.ratios.tolist()
    assert other.ratios == pytest.approx(one.ratios, rel=0.05)


def test_many_objects_are_sampled(monkeypatch):
    monkeypatch.setattr(eyes, "OBJECTS_MOST", 6)
    assert 1.0 < sample(hall(), [BOTH]).ratios[0] < 3.0


def test_cells_are_drawn_by_volume():
    """A cell of half the volume is always there and stands for half; no more are measured than allowed."""
    small = [[[0, 0, 10 * k], [1000, 1000, 10 * k + 10]] for k in range(100)]
    large = [[2000, 0, 0], [3000, 1000, 1000]]
    found = sample(scene_of([(box((0, 0, 5000), (3000, 1000, 6000)), "detail")]), [*small, large])
    assert found.cells[-1] == 100 and len(found.cells) <= eyes.CELLS_MOST
    assert found.weights[-1] / found.weights.sum() == pytest.approx(0.5, abs=0.04)


def test_the_median_is_by_volume_and_the_worst_is_the_highest():
    found = EyeSample(np.array([3, 5, 8]), np.array([9.0, 1.0, 2.0]), np.array([1.0, 5.0, 1.0]))
    assert found.median == 1.0 and found.worst == 0


def test_triangles_that_somebody_has_in_embree_show_the_same(monkeypatch):
    scene, graph = hall(), as_graph(np.array(HALVES))
    pairs = tuple(np.indices((2, len(scene.objects))).reshape(2, -1))
    own = kept_by_eye(scene, closed_elements(scene), graph, pairs)
    theirs = embree_scene(scene.triangles()[0])
    built = []
    monkeypatch.setattr(eyes, "embree_scene", lambda triangles: built.append(len(triangles)) or None)
    found = kept_by_eye(scene, closed_elements(scene), graph, pairs, opaque=theirs)
    assert found.ratios.tolist() == own.ratios.tolist() and built == [0], "of glass alone"
