"""What lies apart on a plane: what touches stays together, and what is covered stays the same."""

import numpy as np
import pytest
from viewcell.data import apart
from viewcell.data.apart import taken_apart
from viewcell.data.buildings.plant import make_plant
from viewcell.data.prepared import PreparedModel


@pytest.mark.parametrize("seed", range(20))
def test_what_touches_stays_together(seed, monkeypatch):
    monkeypatch.setattr(apart, "LARGE", 30)
    random = np.random.default_rng(seed)
    count, owner = 5, random.integers(0, 4, 30) + (seed % 2)
    low = random.integers(-40, 40, (30, 2))
    rectangles = np.stack([low, low + random.integers(1, 9, (30, 2))], axis=1)
    part, owners = taken_apart(owner, rectangles, count)
    assert (owners[part] == owner).all() and (np.diff(owners) >= 0).all() and set(owners) == set(range(count))
    for one in range(30):
        meet = (rectangles[one, 0] <= rectangles[:, 1]).all(axis=1) & (rectangles[one, 1] >= rectangles[:, 0]).all(
            axis=1
        )
        assert (part[meet & (owner == owner[one])] == part[one]).all()
    assert len(owners) > count


def test_gaps_part_what_is_large_and_nothing_else(monkeypatch):
    """Four squares, two of which touch; and as many on a plane that is small enough."""
    square = np.array([[[0, 0], [2, 2]], [[2, 1], [4, 3]], [[0, 4], [2, 6]], [[5, 0], [6, 6]]])
    rectangles, owner = np.concatenate([square, square[2:]]), np.array([0, 0, 0, 0, 1, 1])
    monkeypatch.setattr(apart, "LARGE", 20)
    part, owners = taken_apart(owner, rectangles, 2)
    assert len(set(part[:4])) == 3 and part[0] == part[1] and part[4] == part[5] and owners.tolist() == [0, 0, 0, 1]
    monkeypatch.setattr(apart, "LARGE", 1 << 18)
    assert taken_apart(owner, rectangles, 2)[0].tolist() == owner.tolist()


def test_regions_are_the_same_ones(monkeypatch):
    scene, found = make_plant(triangles=50_000), []
    for large in (1 << 62, 1 << 12):
        monkeypatch.setattr(apart, "LARGE", large)
        regions = PreparedModel(scene).regions
        found.append(np.unique(np.column_stack([regions.axis[regions.region], regions.boxes.reshape(-1, 6)]), axis=0))
    assert found[0].tolist() == found[1].tolist()
