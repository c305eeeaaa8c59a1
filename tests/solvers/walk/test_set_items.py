"""Items of sets, and the time before which nothing can come into view: never later than it does."""

import numpy as np
import pytest
from viewcell.solvers.walk.set_items import Balls, Motion, SetItems, Shelves, turn_seconds

# Object 0 has one level, 1 has three, 2 shares the coarsest of 1.
STARTS, ITEMS = np.array([0, 1, 4, 6]), np.array([0, 4, 3, 1, 5, 1])
SIZES = np.array([10, 20, 0, 40, 80, 60])


def shelves():
    return Shelves.of(STARTS, ITEMS, SIZES, SIZES // 10)


def test_shelves():
    found = shelves()
    assert found.table.tolist() == [[0, -1, -1], [4, 3, 1], [5, 1, -1]]
    assert found.counts.tolist() == [1, 3, 2] and found.coarsest.tolist() == [0, 1, 1]
    assert found.owners.tolist() == [0, -1, -1, 1, 1, 2]
    # Levels from the coarsest; nobody's item is never wanted.
    assert found.steps[[0, 1, 3, 4, 5]].tolist() == [0, 0, 1, 2, 1] and found.steps[2] > 100


def test_all_levels_up_to_the_one_that_does():
    sets = SetItems.of(shelves(), np.array([0, 2, 2, 4]), np.array([0, 1, 1, 2]), np.array([0, 1, 2, 0]))
    assert sets.starts.tolist() == [0, 3, 3, 6]
    assert sets.objects.tolist() == [0, 1, 1, 1, 2, 2] and sets.items.tolist() == [0, 3, 1, 1, 5, 1]
    assert sets.finest.tolist() == [True, True, False, True, True, False]
    assert sets.row_bytes(shelves()).tolist() == [70, 0, 80]
    entries, place = sets.of_rows(np.array([2, 0]))
    assert entries.tolist() == [3, 4, 5, 0, 1, 2] and place.tolist() == [0, 0, 0, 1, 1, 1]


def test_vectors():
    motion = Motion(speed=2.0, turn_deg=90.0, ahead_s=1.0)
    eye, forward = np.zeros(3), np.array([1.0, 0, 0])
    boxes = np.array([[[5, -1, -1], [6, 1, 1]], [[-1, -1, -1], [1, 1, 1]], [[-6, -0.1, -0.1], [-5.9, 0.1, 0.1]]])
    found = turn_seconds(Balls.around(boxes), eye, forward, np.radians(30), motion)
    assert found[0] == 0 and found[1] == 0
    # Right behind: 180 - 30 degrees less its own size to turn, 5.9 m away.
    assert 1.1 < found[2] < 150 / 90


@pytest.mark.parametrize("seed", range(3))
def test_nothing_is_in_view_sooner(seed):
    """Eyes that move and turn as they may see points of boxes only after that time."""
    rng = np.random.default_rng(seed)
    low = rng.uniform(-4, 4, (200, 3))
    boxes = np.stack([low, low + rng.uniform(0, 1.5, (200, 3))], axis=1)
    motion, half = Motion(2.0, 120.0, 1.0), np.radians(35)
    eye, forward = np.zeros(3), np.array([1.0, 0, 0])
    least = turn_seconds(Balls.around(boxes), eye, forward, half, motion)
    assert (least > 0.3).any()
    for _ in range(400):
        t = rng.uniform(0, 1.5)
        way, axis = rng.normal(size=(2, 3))
        moved = way / np.linalg.norm(way) * motion.speed * t
        axis -= axis @ forward * forward
        axis /= np.linalg.norm(axis)
        angle = np.radians(motion.turn_deg) * t
        ahead = np.cos(angle) * forward + np.sin(angle) * axis
        points = boxes[:, 0] + rng.random((200, 3)) * (boxes[:, 1] - boxes[:, 0])
        to = points - moved
        seen = to @ ahead >= np.cos(half) * np.linalg.norm(to, axis=1)
        assert (least[seen] <= t + 1e-9).all()
