"""Space that boxes leave over, counted point by point."""

from itertools import product

import numpy as np
import pytest
from viewcell.workbench.export.outside import boxes_outside


@pytest.mark.parametrize("seed", range(40))
def test_every_unit_cube_is_in_one_box_or_in_the_rest(seed):
    random = np.random.default_rng(seed)
    size, count = 7, seed % 9
    low = random.integers(-2, size, (count, 3))
    boxes = np.stack([low, low + random.integers(0, 5, (count, 3))], axis=1)
    rest = boxes_outside(boxes, np.array([[0] * 3, [size] * 3]))
    for cube in product(range(size), repeat=3):
        held = [((box[0] <= cube) & (np.add(cube, 1) <= box[1])).all() for box in boxes]
        left = [((box[0] <= cube) & (np.add(cube, 1) <= box[1])).all() for box in rest]
        assert sum(left) == (not any(held)), (seed, cube)
    assert ((rest[:, 0] < rest[:, 1]).all(axis=1)).all()


def test_a_grid_of_rooms_leaves_few_boxes():
    rooms = [[[10 * i, 10 * j, 0], [10 * i + 9, 10 * j + 9, 9]] for i in range(8) for j in range(8)]
    # The walls between rooms, and six slabs around all.
    assert len(boxes_outside(np.array(rooms), np.array([[-(2**34)] * 3, [2**34] * 3]))) <= 7 + 8 * 7 + 6
