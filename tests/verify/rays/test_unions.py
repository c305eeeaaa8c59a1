"""Unions of random eyes: what they see where that is known, and how what they miss is counted."""

from itertools import combinations, pairwise
from math import comb

import numpy as np
import pytest
from builders import small_house
from builders.random_buildings import box_triangles as box
from builders.random_buildings import scene_of
from viewcell.data.errors import InputError
from viewcell.data.solids import closed_elements
from viewcell.data.view_cells import as_graph
from viewcell.verify.rays import unions
from viewcell.verify.rays.adjudicate import Judgement, sightline_end
from viewcell.verify.rays.embree import Candidates
from viewcell.verify.rays.unions import EYES, Eyes, Views, cube_directions, eyes_for, frame_errors
from viewcell.workbench.verify import make_judge

DESK, PANE = 17, 18
NONE = Candidates(*np.zeros((3, 0), int), *np.zeros((2, 0, 3)), np.zeros(0))


def room(low, high, thick=100):
    """Six slabs about a box."""
    low, high = np.array(low), np.array(high)
    for axis in range(3):
        for side in (0, 1):
            a, b = low - thick, high + thick
            a[axis], b[axis] = (low[axis] - thick, low[axis]) if side == 0 else (high[axis], high[axis] + thick)
            yield box(a.tolist(), b.tolist()), "occluder"


def eyes_of(scene, boxes, seed=0):
    graph = as_graph(np.array(boxes, np.int32))
    return Eyes(scene, closed_elements(scene), graph, np.arange(len(boxes)), seed)


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(unions, "FRAME_PIXELS", 32)


@pytest.fixture(scope="module")
def house(tmp_path_factory):
    made = small_house.small_house(tmp_path_factory.mktemp("house"))
    sources = np.flatnonzero(made.graph.inhabitable)
    return made, Eyes(made.scene, closed_elements(made.scene), made.graph, sources, 0)


@pytest.mark.parametrize("seed", range(5))
def test_a_convex_empty_room_misses_nothing(seed):
    """From anywhere in it every wall is seen by every eye, and no frame lacks anything."""
    high = np.random.default_rng(seed).integers(300, 9000, 3)
    scene = scene_of(list(room([0, 0, 0], high)))
    eyes = eyes_of(scene, [[[0, 0, 0], high.tolist()]], seed)
    views = eyes.views(16, np.ones((1, 6), bool))
    assert views.eyes == EYES[-1] and not views.missed(1).any() and not len(views.odd.rows)
    assert vars(frame_errors(eyes.frames(), views, 1)) == {"pixels": 0.0, "frames": 0.0, "worst": 0.0}


def test_more_eyes_and_more_pixels_never_miss_more(house):
    made, eyes = house
    views = eyes.views(16, made.potential_objects[eyes.cells], 16)
    missed = [views.missed(count) for count in range(1, 17)]
    assert all((more <= few + 1e-12).all() for few, more in pairwise(missed))
    # Another room's walls are seen from few places: some are missed by one eye, by no means by all.
    assert (
        missed[0][made.potential_objects[eyes.cells]].mean()
        > 1.1 * missed[-1][made.potential_objects[eyes.cells]].mean()
    )
    finer = eyes.views(64, made.potential_objects[eyes.cells], 4)
    assert finer.marks.sum() > 1.01 * eyes.views(16, made.potential_objects[eyes.cells], 4).marks.sum()


def test_unions_are_all_the_draws_of_eyes():
    """Against trying every draw of m of 7 eyes; disjoint groups are the first ones."""
    marks = np.random.default_rng(1).random((2, 7, 5)) < 0.3
    views = Views(8, marks, NONE, 0.0)
    for count in range(1, 8):
        draws = [~marks[:, list(chosen)].any(axis=1) for chosen in combinations(range(7), count)]
        assert len(draws) == comb(7, count)
        assert views.missed(count) == pytest.approx(np.mean(draws, axis=0))
        groups = views.unions(count)
        assert groups.shape == (2, 7 // count, 5)
        assert (groups[:, 0] == marks[:, :count].any(axis=1)).all()


def test_eyes_see_no_more_than_can_be_seen(house):
    """The house's verdicts are exact; what is seen through the pane counts, and so does the pane."""
    made, eyes = house
    potential = made.potential_objects[eyes.cells]
    views = eyes.views(64, potential, 16)
    assert not (views.marks.any(axis=1) & ~potential).any() and not len(views.odd.rows)
    study, room_ = (list(eyes.cells).index(cell) for cell in (4, 2))
    assert views.marks[[study, room_]].any(axis=1)[:, PANE].all()
    assert views.marks[room_].any(axis=0)[DESK] and views.marks[study].any(axis=0)[DESK]


def test_what_is_not_expected_is_proposed_once_and_is_true(house):
    """Without the desk and the pane in what is expected there is a ray to each, which the exact judge confirms."""
    made, eyes = house
    usual = made.potential_objects[eyes.cells].copy()
    usual[:, [DESK, PANE]] = False
    found, judge = eyes.views(32, usual, 16).odd, make_judge(made)
    pairs = list(zip(found.rows.tolist(), found.targets.tolist(), strict=True))
    assert len(set(pairs)) == len(pairs) >= 4 and {target for _, target in pairs} == {DESK, PANE}
    for number, (place, target) in enumerate(pairs):
        end = sightline_end(found, number, made.graph.cells)
        cell = int(eyes.cells[place])
        assert judge.judge("object", cell, target, found.origins[number], end) is Judgement.VISIBLE


def test_eyes_stand_in_their_cell_outside_solids():
    """A solid fills the lower half of one cell and all of the other, which has no eyes."""
    scene = scene_of([(box((0, 0, 0), (1000, 1000, 500)), "occluder")])
    eyes = eyes_of(scene, [[[0, 0, 0], [1000, 1000, 1000]], [[10, 10, 10], [400, 400, 400]]])
    assert eyes.cells.tolist() == [0]
    every = np.concatenate([eyes.points, eyes.frame_eyes, eyes.spots], axis=1)[0]
    assert (every[:, 2] > 500).all() and ((every > 0) & (every < 1000)).all()
    assert len(np.unique(every, axis=0)) == len(every)


def test_the_same_for_a_seed_whatever_other_cells_there_are(house):
    made, eyes = house
    usual = made.potential_objects
    alone = Eyes(made.scene, closed_elements(made.scene), made.graph, eyes.cells[2:3], 0)
    other = Eyes(made.scene, closed_elements(made.scene), made.graph, eyes.cells[2:3], 1)
    assert (alone.points[0] == eyes.points[2]).all() and not (other.points == alone.points).any()
    one, two = alone.views(16, usual[eyes.cells[2:3]], 4), eyes.views(16, usual[eyes.cells], 4)
    assert (one.marks[0] == two.marks[2]).all()


def test_frames_count_pixels_that_a_union_lacks():
    """Half of each frame along x shows one of two halves of a wall; a union that lacks it lacks these pixels."""
    frames = np.zeros((1, 4, 3), np.int32)
    frames[0, :, 0] = unions.FRAME_PIXELS**2 // 2
    frames[0, 0, 1] = unions.FRAME_PIXELS**2 // 4
    marks = np.array([[[True, False, True], [True, True, False]]])
    views = Views(8, marks, NONE, 0.0)
    one, two = frame_errors(frames, views, 1), frame_errors(frames, views, 2)
    # One of two unions lacks a quarter of one of four frames.
    assert one.pixels == pytest.approx(1 / 32) and one.frames == pytest.approx(1 / 8) and 0.2 < one.worst <= 0.25
    assert vars(two) == {"pixels": 0.0, "frames": 0.0, "worst": 0.0}


def test_frames_show_every_pixel_of_a_closed_room(house):
    _, eyes = house
    frames = eyes.frames()
    assert (frames.sum(axis=2) == unions.FRAME_PIXELS**2).all() and (frames[:, :, PANE] == 0).all()


def test_a_cube_map_has_a_ray_through_the_middle_of_each_pixel():
    for pixels in (1, 2, 5):
        along = cube_directions(pixels, 0, 6 * pixels**2)
        assert np.linalg.norm(along, axis=1) == pytest.approx(1)
        on_face = along / np.abs(along).max(axis=1, keepdims=True)
        steps = (on_face + 1) * pixels / 2
        middles = np.isclose(steps % 1, 0.5).sum(axis=1) + (np.isclose(steps, 0) | np.isclose(steps, pixels)).sum(
            axis=1
        )
        assert (middles == 3).all() and len(np.unique(on_face.round(6), axis=0)) == 6 * pixels**2
        part = cube_directions(pixels, 3, 2)
        assert (part == along[3:5]).all()


def test_fewer_eyes_look_at_more_pixels():
    assert [eyes_for(pixels) for pixels in (16, 128, 256, 512, 1024, 4096)] == [125, 125, 32, 16, 4, 1]


def test_what_cannot_be_looked_at_is_refused(house):
    _, eyes = house
    for pixels, count in ((0, 1), (1 << 15, 1), (8, 0), (8, 126)):
        with pytest.raises(InputError, match="expected 1 to"):
            eyes.views(pixels, np.ones((len(eyes.cells), 19), bool), count)
