"""What an eye sees through portals: vectors, the exact twin, and laws."""

from dataclasses import replace

import numpy as np
import pytest
from builders.lookers import SQUARE, all_round, camera, edge_eyes, random_boxes, sets
from builders.random_buildings import SIZE, STEP, random_graph
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.camera import Screen
from viewcell.data.errors import InputError
from viewcell.data.graph import CellGraph
from viewcell.data.plans import Plans
from viewcell.kernels.eye import eye_model, launch_eye
from viewcell.kernels.launch import Device
from viewcell.verify.exact.eye import seen_by_eye

WIDE = Screen(640, 480, 60.0)


def row_of_rooms(*portals, depth=1000):
    """Rooms one behind the other on the x axis, joined by (low u, high u, low v, high v) in planes x = depth, ..."""
    count = len(portals) + 1
    cells = np.array([[[k * depth, -9000, -9000], [(k + 1) * depth, 9000, 9000]] for k in range(count)])
    cells[0, 0, 0] = -depth
    flat = [[[(k + 1) * depth, a, c], [(k + 1) * depth, b, d]] for k, (a, b, c, d) in enumerate(portals)]
    return CellGraph(
        cells.astype(np.int32),
        np.ones(count, bool),
        np.full(count, "", object),
        np.array([[k, k + 1] for k in range(count - 1)], np.int32),
        np.zeros(count - 1, np.int8),
        np.array(flat, np.int32),
    )


def seen(graph, boxes, path, screen=SQUARE, **options):
    return sets(launch_eye(eye_model(graph, np.array(boxes), 1.0), path, screen, **options))


# The first portal leaves |y|, |z| <= 0.5 at x = 1; what is left of the second, in x = 2, is seen in x = 3.
@pytest.mark.parametrize(
    ("second", "inside", "outside"),
    [
        ((800, 1200), [(1200, 1500)], [(1502, 1600), (0, 1198)]),
        ((990, 1500), [(1485, 1500)], [(1502, 1700), (0, 1484)]),
        ((1010, 1500), [], [(0, 3000)]),
    ],
)
def test_second_portal_is_cut_by_the_first(second, inside, outside):
    graph = row_of_rooms((-500, 500, -500, 500), (*second, -2000, 2000))
    boxes = [[[2999, a, 0], [2999, b, 0]] for a, b in (*inside, *outside)]
    (found,) = seen(graph, boxes, camera([0, 0, 0], 0))
    # At x = 2.999 a ray through y at x = 2 is at 1.4995 y.
    assert found == set(range(len(inside)))


def test_heights_are_cut_by_the_first_portal_too():
    graph = row_of_rooms((-500, 500, -500, 500), (800, 1200, -2000, 2000))
    boxes = [[[2999, 1300, z], [2999, 1300, z + 1]] for z in (0, 1498, 1500, -1499, -1502)]
    assert seen(graph, boxes, camera([0, 0, 0], 0)) == [{0, 1, 3}]


def check_against_twin(graph, boxes, path, exact_cells):
    answers = launch_eye(eye_model(graph, boxes, 1.0), path, SQUARE)
    objects, cells = sets(answers), sets(answers, "cells")
    more = kept = 0
    for frame, (eye, axes) in enumerate(zip(path.eyes, path.axes(), strict=True)):
        wanted, reached = seen_by_eye(graph, boxes, eye, axes, (np.tan(np.pi / 4),) * 2)
        assert wanted <= objects[frame] and reached <= cells[frame]
        assert not exact_cells or reached == cells[frame]
        more, kept = more + len(objects[frame] - wanted), kept + len(objects[frame])
    return more, kept


def test_random_buildings():
    """Nothing is dropped; planes one by one keep a little more than rays meet."""
    more = kept = 0
    for seed in range(12):
        graph, _ = random_graph(seed, walls=6)
        rng = np.random.default_rng(seed)
        eyes = rng.uniform(1, SIZE * STEP - 1, (4, 3))
        path = camera(eyes, rng.uniform(0, 360, 4), rng.uniform(-60, 60, 4))
        found = check_against_twin(graph, random_boxes(rng, 60), path, exact_cells=True)
        more, kept = more + found[0], kept + found[1]
    assert kept > 150 and more <= 0.05 * kept


def test_eyes_in_portals_on_their_edges_and_corners():
    for seed in range(6):
        graph, _ = random_graph(seed, walls=4)
        rng = np.random.default_rng(seed)
        eyes = edge_eyes(graph, int(rng.integers(graph.portal_count)))
        path = camera(eyes, 90.0 * rng.integers(0, 4, len(eyes)))
        check_against_twin(graph, random_boxes(rng, 20), path, exact_cells=False)


def test_portals_of_one_grid_step():
    graph = row_of_rooms((0, 1, 0, 1), (-1, 1, 0, 1), (0, 1, 0, 2), depth=4096)
    boxes = np.array([[[8000, -1, 0], [8001, 3, 4]], [[16000, 0, 0], [16001, 4, 4]], [[16000, 9, 0], [16001, 9, 4]]])
    for eye in ([0, 0, 0], [0.25, 0.5, 0.5], [4095.999999, 0.5, 0.5], [4096, 0, 0.5], [4096, 0, 0]):
        check_against_twin(graph, boxes, camera(eye, 0.0), exact_cells=False)


@given(st.integers(0, 2**31), st.integers(0, 40))
def test_wedge_within_rectangles_and_round_within_sets(seed, building):
    """Rectangles keep what the wedge keeps, up to grazes; and no eye sees more than its cell."""
    graph, _ = random_graph(building, walls=5)
    rng = np.random.default_rng(seed)
    boxes, eye = random_boxes(rng, 40), rng.uniform(1, SIZE * STEP - 1, 3)
    path = all_round(eye)
    free = eye_model(graph, boxes, 1.0)
    wedge, rectangles = launch_eye(free, path, SQUARE), launch_eye(free, path, SQUARE, limit=0)
    assert (wedge.sequences >= 0).all()
    exact = [seen_by_eye(graph, boxes, eye, axes, (np.tan(np.pi / 4),) * 2)[0] for axes in path.axes()[:1]]
    assert exact[0] <= sets(rectangles)[0]
    for few, more in zip(sets(wedge, "cells"), sets(rectangles, "cells"), strict=True):
        assert few <= more
    potential = rng.random((graph.cell_count, len(boxes))) < 0.5, rng.random((graph.cell_count,) * 2) < 0.8
    bound = eye_model(graph, boxes, 1.0, potential)
    (home,) = np.flatnonzero(((graph.cells[:, 0] < eye) & (eye < graph.cells[:, 1])).all(axis=1))
    allowed = set(np.flatnonzero(potential[0][home]).tolist())
    for limit in (0, 2000):
        assert set().union(*sets(launch_eye(bound, path, SQUARE, limit=limit))) <= allowed
    reached = set().union(*sets(launch_eye(bound, path, SQUARE), "cells"))
    assert reached - {home} <= set(np.flatnonzero(potential[1][home]).tolist())


def test_sets_of_whole_buildings_take_nothing_away():
    graph, _ = random_graph(3, walls=5)
    rng = np.random.default_rng(3)
    boxes = random_boxes(rng, 40)
    path = camera(rng.uniform(1, SIZE * STEP - 1, (20, 3)), rng.uniform(0, 360, 20))
    everything = np.ones((graph.cell_count, len(boxes)), bool), np.ones((graph.cell_count,) * 2, bool)
    free, bound = (launch_eye(eye_model(graph, boxes, 1.0, given), path, SQUARE) for given in (None, everything))
    assert sets(free) == sets(bound) and sum(map(len, sets(free)))


@pytest.mark.parametrize("limit", [0, 2000])
@pytest.mark.parametrize(("x", "yaw"), [(100, 0.0), (2900, 180.0)])
def test_only_what_a_cell_holds_of_a_box_is_seen_in_it(x, yaw, limit):
    """In the middle room it is beside the cone, and where the cone would be wide enough the next portal cuts it."""
    graph = row_of_rooms((-500, 500, -500, 500), (-500, 500, -500, 500))
    boxes = [[[10, 1200, 0], [2990, 1210, 9]], [[10, 1000, 0], [2990, 1210, 9]]]
    assert seen(graph, boxes, camera([x, 0, 0], yaw), Screen(100, 100, 60.0), limit=limit) == [{1}]


def test_near_portals_fill_the_screen():
    """A wide portal that begins beside the eye: a corner of it is hardly before the eye at all."""
    graph = row_of_rooms((-500, 500, -500, 500))
    boxes = [[[1500, y, 0], [1501, y + 1, 1]] for y in (-8000, -400, 400, 8000)]
    for limit in (0, 2000):
        for yaw in (0.0, 45.0, 135.0):
            path = camera([1000 - 1e-7, 500, 0], yaw)
            wanted = seen_by_eye(graph, np.array(boxes), path.eyes[0], path.axes()[0], (np.tan(np.pi / 4),) * 2)[0]
            assert wanted <= seen(graph, boxes, path, limit=limit)[0]


def test_past_the_limit_rectangles():
    graph, _ = random_graph(5, walls=5)
    rng = np.random.default_rng(5)
    boxes, path = random_boxes(rng, 40), camera(rng.uniform(1, SIZE * STEP - 1, (30, 3)), rng.uniform(0, 360, 30))
    model = eye_model(graph, boxes, 1.0)
    free, bound, never = (launch_eye(model, path, SQUARE, limit=limit) for limit in (2000, 3, 0))
    over = free.sequences > 3
    assert 0 < over.sum() < 30
    np.testing.assert_array_equal(bound.sequences, np.where(over, -1, free.sequences))
    for frame in range(30):
        assert sets(bound)[frame] == (sets(never) if over[frame] else sets(free))[frame]


def test_a_row_longer_than_the_stack():
    graph = row_of_rooms(*[(-500, 500, -500, 500)] * 70, depth=10)
    boxes = [[[705, 0, 0], [706, 1, 1]], [[705, 8000, 0], [706, 8001, 1]]]
    path = camera([0, 0, 0], 0)
    assert launch_eye(eye_model(graph, np.array(boxes), 1.0), path, SQUARE).sequences.tolist() == [-1]
    assert seen(graph, boxes, path) == [{0}]


def test_without_portals_the_set_cut_by_the_screen():
    """Also of a view cell at an angle, whose prism holds the eye; an eye that nothing holds sees the whole screen."""
    plans = Plans(np.array([1]), np.array([[[200, 150], [150, 200], [100, 150], [150, 100]]], np.int32))
    cells = np.array([[[0, 0, 0], [100, 100, 100]], [[100, 100, 0], [200, 200, 100]]], np.int32)
    graph = CellGraph(
        cells,
        np.ones(2, bool),
        np.full(2, "", object),
        np.zeros((0, 2), np.int32),
        np.zeros(0, np.int8),
        np.zeros((0, 2, 3), np.int32),
        plans,
    )
    boxes = np.array([[[500, 40, 40], [510, 60, 60]], [[-500, 40, 40], [-400, 60, 60]], [[500, 140, 0], [510, 160, 9]]])
    potential = np.array([[True, True, False], [False, True, True]]), np.ones((2, 2), bool)
    model = eye_model(graph, boxes, 1.0, potential)
    path = camera([[50, 50, 50], [150, 150, 50], [105, 105, 50]], 0)
    found = launch_eye(model, path, SQUARE)
    assert sets(found) == [{0}, {2}, {0, 2}]
    assert sets(found, "cells") == [{0}, {1}, set()]


def test_walls_that_touch_and_eyes_between_cells():
    graph = row_of_rooms((-500, 500, -500, 500))
    # Flat on the far wall, flat in the portal's wall, nowhere, and behind the eye, narrow and wide.
    boxes = [
        [[2000, -100, -100], [2000, 100, 100]],
        [[1000, 600, 0], [1000, 700, 9]],
        [[1500, 0, 0], [1400, 9, 9]],
        [[-500, 0, 0], [-400, 9, 9]],
        [[-500, -900, -900], [-400, 900, 900]],
    ]
    assert seen(graph, boxes, camera([[0, 0, 0], [1000, 900, 0], [1000, 0, 0]], 0)) == [{0, 1}, {0}, {0}]
    assert seen(graph, boxes, camera([[0, 0, 0]], 180)) == [{3, 4}]


def test_threads_and_lots_change_nothing(monkeypatch):
    graph, _ = random_graph(1, walls=5)
    rng = np.random.default_rng(1)
    boxes, path = random_boxes(rng, 50), camera(rng.uniform(1, SIZE * STEP - 1, (2500, 3)), rng.uniform(0, 360, 2500))
    one, two = (launch_eye(eye_model(graph, boxes, 1.0, device=Device(threads=k)), path, WIDE) for k in (1, 2))
    monkeypatch.setattr("viewcell.kernels.eye.WORDS", 100)
    lots = launch_eye(eye_model(graph, boxes, 1.0), path, WIDE)
    for got in (two, lots):
        for name, wanted in vars(one).items():
            np.testing.assert_array_equal(getattr(got, name), wanted)


@pytest.mark.parametrize("limit", [2000, 3, 0])
def test_one_eye_at_a_time_sees_the_same(limit):
    """The launch for one eye is kept and done again: what eyes before it saw, and where, leaves no trace."""
    graph, _ = random_graph(1, walls=5)
    rng = np.random.default_rng(2)
    # On portals, edges and corners, which several cells hold, and anywhere.
    eyes = np.concatenate([edge_eyes(graph, 0), rng.uniform(1, SIZE * STEP - 1, (40, 3))])
    path = camera(eyes, rng.uniform(0, 360, len(eyes)))
    model = eye_model(graph, random_boxes(rng, 50), 1.0)
    wanted = launch_eye(model, path, WIDE, limit=limit)
    for frame in range(len(path)):
        one = replace(path, **{name: column[frame : frame + 1] for name, column in vars(path).items()})
        for screen, most in ((SQUARE, limit), (WIDE, limit + 7), (WIDE, limit)):
            got = launch_eye(model, one, screen, limit=most)
        for starts, ids in (("starts", "objects"), ("cell_starts", "cells")):
            own = slice(*getattr(wanted, starts)[frame : frame + 2])
            np.testing.assert_array_equal(getattr(got, ids), getattr(wanted, ids)[own])
        assert got.sequences[0] == wanted.sequences[frame]


def test_no_frames_and_no_objects():
    graph = row_of_rooms((-500, 500, -500, 500))
    path = camera([[0, 0, 0]], 0)
    none = replace(path, eyes=path.eyes[:0], yaw_deg=path.yaw_deg[:0], pitch_deg=path.pitch_deg[:0], t=path.t[:0])
    empty = np.zeros((0, 2, 3), int)
    assert launch_eye(eye_model(graph, empty, 1.0), none, WIDE).starts.tolist() == [0]
    found = launch_eye(eye_model(graph, empty, 1.0), path, WIDE)
    assert found.starts.tolist() == [0, 0] and found.cells.tolist() == [0, 1]


def test_refused():
    graph = row_of_rooms((-500, 500, -500, 500))
    boxes = np.zeros((1, 2, 3), int)
    with pytest.raises(InputError, match="eyes: expected finite coordinates"):
        launch_eye(eye_model(graph, boxes, 1.0), camera([[0, np.nan, 0]], 0), WIDE)
    with pytest.raises(InputError, match=r"potential: expected shapes \[\(2, 1\), \(2, 2\)\], found \[\(2, 2\)"):
        eye_model(graph, boxes, 1.0, (np.ones((2, 2), bool), np.ones((2, 2), bool)))
