"""What all launchers share: coordinates beyond the grid are refused, and every item is done once."""

import threading
import time

import numpy as np
import pytest
import warp as wp
from builders import random_solids
from builders.blocker_scenes import blockers_of
from viewcell.data import progress
from viewcell.data.errors import InputError
from viewcell.data.solids import closed_elements
from viewcell.kernels.backface import build_cones, launch_backface
from viewcell.kernels.blockers import blocker_tree
from viewcell.kernels.coverage import launch_coverage
from viewcell.kernels.launch import CPU, Device, check_coordinates, lanes, run_sliced, side_by_side
from viewcell.kernels.line_tree import launch_line_trees
from viewcell.kernels.occludee import launch_occludees
from viewcell.kernels.shaft import launch_shaft
from viewcell.kernels.sightline import device_triangles, launch_confirm
from viewcell.kernels.stab_batch import launch_stab
from viewcell.kernels.target import launch_target_search

LIMIT = 2**24
SCENE = random_solids.scene_of_meshes([random_solids.box([0, 0, 0], [1, 2, 3])])
CONES = build_cones(closed_elements(SCENE), SCENE.triangle_counts)
ROW, PAIR = np.array([[0, 1, 0]]), np.array([[0, 0]])


def blockers():
    return blocker_tree(blockers_of(np.array([[[5, -9, -9], [5, 9, 9]]])))


def maps():
    corners = np.array([[900.0, -9, -9], [900, 9, -9], [900, 0, 9]])
    return launch_coverage(np.zeros((1, 3)), corners, [0, 3], [0], resolution=2)


# What each launcher does with two boxes, shape (2, 2, 3).
LAUNCHERS = {
    "blockers": lambda boxes: blocker_tree(blockers_of(np.where([0, 0, 1], boxes[:, :1], boxes))),
    "target": lambda boxes: launch_target_search(blockers(), boxes, ROW),
    "line trees": lambda boxes: launch_line_trees(blockers(), boxes, ROW, np.array([3])),
    "shaft": lambda boxes: launch_shaft(random_solids.shields_of(SCENE)[0], boxes, ROW[:, :2], smallest=(64, 64)),
    "triangles": lambda boxes: device_triangles(
        boxes.reshape(1, 4, 3)[:, [0, 1, 3]].astype(np.int32), np.zeros(1, int)
    ),
    "confirm": lambda boxes: launch_confirm(
        device_triangles(*SCENE.triangles()), boxes[:, 0].astype(float), boxes[:, 1].astype(float), np.array([-1, -1])
    ),
    "occludees": lambda boxes: launch_occludees(maps(), boxes, PAIR),
    "backface": lambda boxes: launch_backface(CONES, boxes, PAIR),
    "stab": lambda boxes: launch_stab(boxes[None], np.ones((1, 3), int)),
}


@pytest.mark.parametrize("launcher", LAUNCHERS)
@pytest.mark.parametrize("side", [-1, 1])
def test_coordinates_beyond_the_grid_are_refused(launcher, side):
    boxes = np.array([[[-9, -8, -7], [-1, -2, -3]], [[1, 2, 3], [9, 8, 7]]])
    far = boxes.copy()
    place = (0, 0, 0) if side < 0 else (1, 1, 0)
    far[place] = side * LIMIT
    LAUNCHERS[launcher](far)
    far[place] += side
    with pytest.raises(InputError, match=r"expected .*16777216 (grid )?steps.*found \S*16777217"):
        LAUNCHERS[launcher](far)


@pytest.mark.parametrize("value", [LIMIT + 1, -LIMIT - 1, np.nan, np.inf, LIMIT + 0.001])
def test_the_limit_is_exact(value):
    check_coordinates(np.array([LIMIT, -LIMIT, 0.0]))
    check_coordinates(np.zeros(0))
    with pytest.raises(InputError, match="coordinates: expected at most 16777216 grid steps"):
        check_coordinates(np.array([0.0, value]))
    if value == np.floor(value):
        with pytest.raises(InputError, match="coordinates"):
            CPU.corners(np.array([[0, 0, int(value)]]) if np.isfinite(value) else np.array([[0, 0, value]]))


class AsGpu(Device):
    """The CPU, treated as a GPU."""

    is_cpu = False


@pytest.mark.parametrize("device", [CPU, Device("cpu", 3), AsGpu()], ids=["cpu", "threads", "gpu"])
@pytest.mark.parametrize("count", [1, 3, 4, 5, 11, 12])
def test_every_row_is_launched_once(count, device):
    rows = []
    launch = lambda first, last: rows.extend(range(first, last))  # noqa: E731
    run_sliced(launch, count, wp.get_module("viewcell.kernels.launch"), device, chunk=4, gpu_chunk=4)
    assert sorted(rows) == list(range(count))


def test_a_launch_compiles_one_variant():
    """Warp's own loading of a module takes blocks of many threads, which no launch on a CPU has."""
    LAUNCHERS["backface"](np.array([[[-9, -8, -7], [-1, -2, -3]], [[1, 2, 3], [9, 8, 7]]]))
    module = wp.get_module("viewcell.kernels.backface")
    assert [block for context, block in module.execs if context == wp.get_device("cpu").context] == [1]


@pytest.mark.parametrize("device", [CPU, Device("cpu", 3), AsGpu("cpu", 3)], ids=["cpu", "threads", "gpu"])
def test_work_side_by_side_is_done_once_and_keeps_its_place(device):
    found = dict(side_by_side(lambda piece: piece**2, range(7), device))
    assert found == {place: place**2 for place in range(7)}
    assert dict(side_by_side(str, [], device)) == {}


def test_work_side_by_side_shares_the_threads_of_the_device():
    device = Device("cpu", 5)
    seen = dict(side_by_side(lambda _: (device.threads_here, lanes(9, device)), range(2), device))
    assert seen == {0: (2, 2), 1: (2, 2)} and device.threads_here == 5
    assert lanes(3, device) == 3 and lanes(9, AsGpu("cpu", 5)) == 1


def test_phases_of_work_side_by_side_are_within_those_of_the_caller():
    def inner(piece):
        with progress.phase(f"piece {piece}") as mine:
            return progress.open_here()[0][:-1], mine in progress.open_here()[0]

    with progress.phase("all") as outer:
        found = dict(side_by_side(inner, range(4), Device("cpu", 2)))
    assert all(above == [outer] and within for above, within in found.values())


def test_when_one_fails_the_others_end_with_what_they_launch_next():
    started, ended, until = threading.Event(), [], time.monotonic() + 20.0

    def endless(piece):
        if piece == 0:
            started.wait(10)
            raise ValueError("the first")
        try:
            while time.monotonic() < until:
                started.set()
                run_sliced(lambda first, last: None, 1, wp.get_module("viewcell.kernels.launch"), CPU)
        except KeyboardInterrupt:
            ended.append(piece)
            raise

    with pytest.raises(ValueError, match="the first"):
        list(side_by_side(endless, range(5), Device("cpu", 2)))
    assert 1 in ended
