"""Sampled solid angles against closed forms."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from builders import small_house
from viewcell.verify.rays.solid_angles import SolidAngles
from viewcell.workbench.verify import make_judge

DESK, PANE = 17, 18


@pytest.fixture(scope="module")
def house(tmp_path_factory):
    made = small_house.small_house(tmp_path_factory.mktemp("house"))
    sources = np.flatnonzero(made.graph.inhabitable)
    return SimpleNamespace(made=made, judge=make_judge(made), sources=sources, boxes=made.graph.cells)


def in_the_middle(house):
    """The house seen from the middle of each view cell alone, where nothing is near."""
    spots = list(house.boxes[house.sources].astype(float).mean(axis=1)[:, None].astype(np.float32))
    return SolidAngles(house.judge.lines, len(house.made.scene.objects), spots)


def test_solid_angles_of_a_closed_room_fill_the_sphere(house):
    """The graded solid angles of all that is seen from a point sum to 4 pi, as closely as they say."""
    estimate, count, objects = in_the_middle(house), 30_000, np.arange(PANE)
    for row in range(len(house.sources)):
        sums, squares = estimate(np.full(len(objects), row), objects, count, np.random.default_rng(0))
        error = math.sqrt((squares / count - (sums / count) ** 2).sum() / count)
        assert error < 0.02 * 4 * math.pi
        assert abs(sums.sum() / count - 4 * math.pi) < 4 * error


def test_the_solid_angle_of_a_desk_is_that_of_its_outline(house):
    """Half the solid angles of its sides, whichever way they face: a line meets a box that it meets twice."""
    row, count = list(house.sources).index(2), 200_000
    sums, squares = in_the_middle(house)(np.array([row]), np.array([DESK]), count, np.random.default_rng(1))
    error = math.sqrt((squares[0] / count - (sums[0] / count) ** 2) / count)
    triangles, owners = house.made.scene.triangles()
    a, b, c = (triangles[owners == DESK].astype(float) - house.boxes[2].mean(axis=0)).transpose(1, 0, 2)
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    bottom = la * lb * lc + (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    exact = np.abs(2 * np.arctan2((a * np.cross(b, c)).sum(axis=1), bottom)).sum() / 2
    assert error < 0.01 * exact and abs(sums[0] / count - exact) < 4 * error


def test_solid_angles_come_with_their_errors(house):
    """The desk's from its own room within its error; from the store it is never seen, and that is no number."""
    estimate, rows = in_the_middle(house), [list(house.sources).index(cell) for cell in (2, 5)]
    mean, error = estimate.graded(np.array(rows), np.array([DESK, DESK]), np.random.default_rng(3))
    sums, _ = estimate(np.array(rows[:1]), np.array([DESK]), 200_000, np.random.default_rng(4))
    exact = sums[0] / 200_000
    assert error[0] <= 0.3 and abs(mean[0] - exact) < 4 * error[0] * exact
    assert mean[1] == 0 and np.isnan(error[1])
