"""Objects that sightlines to others meet first are seen, by the exact test, and from that view cell only."""

import numpy as np
import pytest
from builders import random_solids
from viewcell.data.prepared import PreparedModel
from viewcell.data.rows import Rows
from viewcell.data.scene import GRID_M, Role
from viewcell.kernels import aim as drawing
from viewcell.kernels.launch import CPU
from viewcell.solvers.visibility.aim import Sights, middles
from viewcell.solvers.visibility.first_hits import FirstHits
from viewcell.verify.exact.sightline import Sight, Sightlines

# The target stands behind a screen; glass and a post are in front of it, one more post elsewhere.
TARGET, SCREEN = ([20, -1, 0], [21, 1, 2]), ([15, -20, -20], [15.2, 20, 22])
POST, GLASS, BESIDE = ([10, -0.3, 0], [10.4, 0.3, 2]), ([5, -3, -2], [5.1, 3, 4]), ([-20, 0, 0], [-19, 1, 1])
CELLS = np.array([[[0, -1, 0.5], [1, 1, 1.5]], [[30, -1, 0.5], [31, 1, 1.5]]])


@pytest.fixture(scope="module")
def sights():
    meshes = [random_solids.box(*box) for box in (TARGET, SCREEN, POST, GLASS, BESIDE)]
    roles = [Role.DETAIL, Role.OCCLUDER, Role.DETAIL, Role.TRANSPARENT, Role.DETAIL]
    model = PreparedModel(random_solids.scene_of_meshes(meshes, roles))
    return Sights.of(model, np.round(CELLS / GRID_M).astype(np.int32), 0, CPU)


def aimed(sights, tries=16):
    """From both cells at the target, while the pairs of all objects are unknown."""
    rows = Rows.unseen(np.repeat([1, 0], 5), np.tile(np.arange(5), 2))
    pairs = np.flatnonzero(rows.target == 0)
    boxes = np.repeat(sights.model.occludees.bounds[:1], 2, axis=0)
    hints = middles(sights.cells[rows.source[pairs]], boxes)
    sights.aim(rows, pairs, boxes, hints, rows.target[pairs], tries, 0)
    return rows


def test_what_is_met_first_is_seen(sights):
    rows = aimed(sights)
    seen = {(source, target) for source, target in zip(rows.source[rows.seen], rows.target[rows.seen], strict=True)}
    # The screen and the post from in front, the target from behind: glass is no obstacle and not met.
    assert seen == {(0, 1), (0, 2), (1, 0)}
    triangles, owners = sights.model.scene.triangles()
    for row in np.flatnonzero(rows.seen):
        box, own = sights.cells[rows.source[row]], owners == rows.target[row]
        assert ((rows.origin[row] > box[0]) & (rows.origin[row] < box[1])).all()
        line, beyond = rows.origin[row][None], rows.origin[row] + 1.001 * (rows.end[row] - rows.origin[row])
        rest = ~own & (owners != 3)
        assert Sightlines(triangles[rest]).check(line, rows.end[row][None]) == Sight.CLEAR
        assert Sightlines(triangles[own]).check(line, beyond[None]) != Sight.CLEAR


def test_what_is_drawn_together_changes_nothing(sights, monkeypatch):
    whole = aimed(sights)
    monkeypatch.setattr(drawing, "TOGETHER", 4)
    single = aimed(sights)
    for name in ("verdict", "origin", "end"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(single, name), err_msg=name)


def test_a_pair_that_was_served_is_not_shot_at_again(sights):
    """The target's own row ends at once, though its sightlines are stopped by what is in front of its back."""
    rows = Rows.unseen(np.zeros(2, int), np.array([0, 2]))
    boxes = sights.model.occludees.bounds[[0, 2]]
    hints = middles(sights.cells[[0, 0]], boxes)
    asked = []
    first = sights.finder.first
    sights.finder.first = lambda origins, ends: (asked.append(len(origins)), first(origins, ends))[1]
    try:
        sights.aim(rows, np.arange(2), boxes, hints, np.arange(2), 12, 0)
    finally:
        del sights.finder.first
    assert rows.seen.tolist() == [False, True] and asked == [8, 8]


def test_attempts_at_a_pair_end_together(sights):
    """A second attempt is wanted only as long as the first has found nothing."""
    rows = Rows.unseen(np.ones(1, int), np.zeros(1, int))
    guide = FirstHits(sights.finder, rows, np.zeros(2, int), lambda *_: None)
    nothing = np.zeros((0, 3))
    for found, wanted in ((True, False), (False, True)):
        guide.may_be_clear(np.zeros(0, int), nothing, nothing)
        assert guide.wanted(np.array([1]), np.array([found, False])).tolist() == [wanted]
