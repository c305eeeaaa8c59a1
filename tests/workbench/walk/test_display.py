"""What a frame shows: levels that are good enough and fit the time, from lists of one frame alone."""

from dataclasses import replace

import numpy as np
import pytest
from viewcell.data.camera import Screen
from viewcell.data.errors import InputError
from viewcell.kernels.eye import launch_eye
from viewcell.solvers.levels.benefit import NOTHING
from viewcell.workbench.walk.display import Display, check_path, level_errors, part_of, shelves_of
from viewcell.workbench.walk.far import FarFaces
from viewcell.workbench.walk.level_choice import USUAL_COST, LevelChoice
from viewcell.workbench.walk.path import walk as generated

SCREEN = Screen(320, 240)


def frames_of(display, path):
    display.begin()
    return [display.frame(path, at, np.zeros(0, np.int64)) for at in range(len(path))]


@pytest.fixture(scope="module")
def far(office):
    return FarFaces(office, True)


@pytest.fixture(scope="module")
def path(office):
    return generated(office, 40, everywhere=True)


def test_with_time_enough_every_object_is_drawn_as_coarse_as_does(office, far, path):
    display = Display(office, SCREEN, LevelChoice(), 1000.0, far)
    starts, _ = office.object_items
    errors, finest, coarsest = level_errors(office), 0, 0
    for at, shown in enumerate(frames_of(display, path)):
        assert (shown.lods >= 0).all() and shown.dropped == 0
        for number, lod, limit in zip(shown.objects.tolist(), shown.lods.tolist(), shown.limits.tolist(), strict=True):
            own = errors[starts[number] : starts[number + 1]]
            assert lod >= limit or own[limit] == own[lod]
            gap = np.maximum(
                np.maximum(display.boxes[number, 0] - path.eyes[at], path.eyes[at] - display.boxes[number, 1]), 0
            )
            # A pixel in the middle of the screen at the distance of the box, at the very least.
            assert own[limit] * SCREEN.focal <= 1.01 * max(np.linalg.norm(gap) - own[limit], 0) or limit == 0
            finest, coarsest = finest + (limit == 0), coarsest + (limit > 0)
    assert finest and coarsest


def test_what_is_shown_is_what_the_eye_may_see(office, far, path):
    display = Display(office, SCREEN, LevelChoice(), 16.0, far)
    together = launch_eye(display._eye, path, SCREEN)
    for at, shown in enumerate(frames_of(display, path)):
        own = together.objects[together.starts[at] : together.starts[at + 1]]
        assert set(shown.objects.tolist()) <= set(own.tolist())
        # The screen's own test of boxes leaves out what only touches its frame.
        assert len(own) - len(shown.objects) <= 2 and shown.cells == np.diff(together.cell_starts)[at]


def test_short_times_are_kept_and_said(office, far, path):
    cost = replace(USUAL_COST, primitive_s=2e-5)
    display = Display(office, SCREEN, LevelChoice(cost), 16.0, far)
    found = frames_of(display, path)
    assert all(shown.chosen_ns <= 16e6 for shown in found)
    coarse = sum(int((shown.lods > shown.limits).sum()) for shown in found)
    gone = sum(shown.dropped for shown in found)
    assert coarse + gone > 0 and gone == sum(int((shown.lods == NOTHING).sum()) for shown in found)
    assert all(shown.chosen_ns <= shown.finest_ns for shown in found)
    with pytest.raises(InputError, match="budget: expected more than"):
        Display(office, SCREEN, LevelChoice(), 1.0, far)


def test_doorways_have_sets(office, far):
    display = Display(office, SCREEN, LevelChoice(), 16.0, far)
    known = display.known
    assert known.has.sum() == len(known.cells) > office.graph.inhabitable.sum()
    views = office.sets["cell_id"].to_numpy()
    assert known.cells[: len(views)].tolist() == views.tolist()
    between = known.cells[len(views) :]
    assert known.potential[0][between].any(axis=1).all() and known.potential[1][between, between].all()
    starts, members = office.potential.ids()
    assert np.array_equal(known.starts[: len(starts)], starts) and np.array_equal(
        known.members[: len(members)], members
    )


def test_sizes_are_those_of_the_file_or_of_another_renderer(office, far):
    assert shelves_of(office, far).sizes.tolist() == office.items["size"].to_pylist()
    assert shelves_of(office, far, 158).sizes.tolist() == [158 * n for n in office.items["faces"].to_pylist()]


def test_paths_must_lie_in_cells(office, path):
    ones = np.arange(len(path) + 1)
    check_path(office, path, (ones, np.zeros(len(path), int)))
    with pytest.raises(InputError, match="found frame 39 at"):
        check_path(office, path, (np.minimum(ones, len(path) - 1), np.zeros(len(path) - 1, int)))
    assert len(part_of(path, slice(3, 5))) == 2
