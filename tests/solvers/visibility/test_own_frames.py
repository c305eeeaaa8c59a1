"""What a frame hides, no segment shows; and it hides most of what is hidden."""

import numpy as np
import pytest
from builders import turned_house
from viewcell.data.own_frames import find_own_frames
from viewcell.data.plans import Plans
from viewcell.data.prepared import PreparedModel
from viewcell.data.scene import GRID_M
from viewcell.kernels.launch import CPU
from viewcell.solvers.visibility.aim import Sights
from viewcell.solvers.visibility.occluders import OccluderModel, seen_objects
from viewcell.solvers.visibility.own_frames import FrameSearch


@pytest.fixture(scope="module")
def house():
    """The model of two turned rooms, and a view cell in the middle of each, turned with it."""
    scene = turned_house.turned_scene()
    turn = np.exp(1j * np.radians(turned_house.YAW_DEG))
    plans = []
    for x in (2.0, 6.2):
        corners = [complex(x + dx, 2 + dy) * turn for dx, dy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        plans.append(np.round(np.array([(c.real, c.imag) for c in corners]) / GRID_M))
    plans = Plans(np.arange(2), np.array(plans, np.int32))
    cells = np.zeros((2, 2, 3), np.int32)
    cells[:, 0, :2], cells[:, 1, :2] = plans.corners.min(axis=1), plans.corners.max(axis=1)
    cells[:, :, 2] = np.round(np.array([0.5, 2.0]) / GRID_M)
    return PreparedModel(scene), cells, plans


@pytest.fixture(scope="module")
def search(house):
    model, cells, plans = house
    (frame,) = find_own_frames(model.scene, model.large_closed, cells, plans)
    return FrameSearch.of(frame, CPU)


def shown(model, plan, heights, count, seed):
    """Objects that segments from points of a prism's middle parts reach first, by a plain test of every triangle."""
    random = np.random.default_rng(seed)
    triangles, owners = (part for part in model.scene.triangles())
    share = random.uniform(0, 1, (count, 2))
    a, b, d = plan[0], plan[1], plan[3]
    plane = a + share[:, :1] * (b - a) + share[:, 1:] * (d - a)
    origin = np.column_stack([plane, random.uniform(*heights, count)])
    way = random.normal(size=(count, 3))
    p, e1, e2 = (part.astype(float) for part in (triangles[:, 0], triangles[:, 1] - triangles[:, 0],
                                                 triangles[:, 2] - triangles[:, 0]))  # fmt: skip
    found = set()
    for o, w in zip(origin, way, strict=True):
        h = np.cross(w, e2)
        det = (e1 * h).sum(axis=1)
        det[det == 0] = np.nan
        s = o - p
        u = (s * h).sum(axis=1) / det
        q = np.cross(s, e1)
        v, t = (q @ w) / det, (q * e2).sum(axis=1) / det
        hit = (u > 0) & (v > 0) & (u + v < 1) & (t > 0)
        if hit.any():
            found.add(int(owners[hit][t[hit].argmin()]))
    return found


def test_places(search):
    assert search.places(np.array([1, 0, 5])).tolist() == [
        *(int(np.flatnonzero(search.frame.cells == cell)[0]) for cell in (1, 0)),
        -1,
    ]


def test_what_is_shown_is_not_hidden(house, search):
    model, cells, plans = house
    count = len(model.scene.objects)
    kept = set(zip(*(part.tolist() for part in search.left(np.arange(2), 3, 40)), strict=True))
    assert len(kept) < 2 * count
    source, target = np.repeat(np.arange(2), count), np.tile(np.arange(count), 2)
    hidden, _ = search.hides(source, target, 2000)
    # The chest outside from both rooms, and the other room's chests.
    assert hidden.sum() >= 3
    hides = set(zip(source[hidden].tolist(), target[hidden].tolist(), strict=True))
    for cell in range(2):
        seen = shown(model, plans.corners[cell].astype(float), cells[cell, :, 2], 4000, seed=cell)
        assert len(seen) > 5
        for object_id in seen:
            assert (cell, object_id) in kept and (cell, object_id) not in hides


def test_lines_past_a_frame_lead_from_the_cell_to_the_object(house, search):
    """In the model's own frame: from inside the plan of the cell to the box around a piece of the object."""
    model, cells, plans = house
    count = len(model.scene.objects)
    source, target = np.repeat(np.arange(2), count), np.tile(np.arange(count), 2)
    hidden, passing = search.hides(source, target, 2000)
    assert len(passing.row) > 10 and not hidden[passing.row].any()
    start, end = passing.lines[:, 0], passing.lines[:, 1]
    # The box in the frame is a few steps wider than the plan.
    middle = cells[source[passing.row]].mean(axis=1)
    assert plans.hold(source[passing.row], middle + 0.99 * (start - middle), len(cells)).all()
    own = cells[source[passing.row]]
    assert (start[:, 2] >= own[:, 0, 2]).all() and (start[:, 2] <= own[:, 1, 2]).all()
    assert (end >= passing.boxes[:, 0]).all() and (end <= passing.boxes[:, 1]).all()
    bounds = model.occludees.bounds[target[passing.row]]
    # Rounding in the frame moves a piece by less than two steps.
    assert ((passing.boxes[:, 0] < bounds[:, 1] + 2) & (passing.boxes[:, 1] > bounds[:, 0] - 2)).all()
    second = passing.take(passing.row == passing.row[1])
    assert (second.row == passing.row[1]).all() and (second.lines[0] == passing.lines[1]).all()


def test_frames_serve_the_cells_that_they_fit(house):
    """With frames no more is kept than without, and nothing that is seen is lost."""
    model, cells, plans = house
    with_frames, without = (
        OccluderModel.of(Sights.of(model, cells, 0, CPU, plans), certify=certify) for certify in (False, True)
    )
    assert len(with_frames.frames) == 1 and not without.frames
    assert not with_frames.from_cells(cells).frames
    rows, plain = (seen_objects(some, np.arange(2))[0] for some in (with_frames, without))
    pairs, others = (set(zip(part.source.tolist(), part.target.tolist(), strict=True)) for part in (rows, plain))
    assert pairs <= others
    witnessed = plain.take(plain.seen)
    assert set(zip(witnessed.source.tolist(), witnessed.target.tolist(), strict=True)) <= pairs
    assert np.array_equal(np.lexsort((rows.target, rows.source)), np.arange(len(rows)))
