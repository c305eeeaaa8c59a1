"""Doorways: rays from eyes in them meet nothing but what their sets hold."""

import numpy as np
import pytest
from builders.lookers import SQUARE, all_round
from builders.small_house import small_house
from viewcell.data.graph import CellGraph
from viewcell.solvers.walk.doorways import CELLS_MOST, doorways
from viewcell.verify.rays.looks import Eyewitness


@pytest.fixture(scope="module")
def house(tmp_path_factory):
    return small_house(tmp_path_factory.mktemp("doorways"))


def test_rays_from_doorways_meet_nothing_else(house):
    graph, boxes = house.graph, house.scene.object_bounds()
    found = doorways(graph, boxes, (house.potential_objects, house.potential_cells))
    assert found.cells.tolist() == [1, 3, 6]
    witness = Eyewitness(house.scene, graph, house.cracks)
    seen = 0
    rng = np.random.default_rng(0)
    for place, cell in enumerate(found.cells.tolist()):
        low, high = graph.cells[cell]
        for eye in low + rng.uniform(0.02, 0.98, (4, 3)) * (high - low):
            kept = [np.flatnonzero(found.objects[place])] * 6
            for look in witness.looks(all_round(eye * house.grid_m), SQUARE, kept, 2000):
                assert look.dropped.tolist() == []
                seen += len(look.seen)
    assert seen > 100
    # Nor is everything in them: behind two more doors there is a wall that no eye in the first one sees.
    assert not found.objects[0].all()
    assert [np.flatnonzero(row).tolist() for row in found.reached[:1]] == [
        sorted({0, 1, 2} | set(np.flatnonzero(house.potential_cells[[0, 2]].any(axis=0)).tolist()))
    ]


def row(count):
    """Rooms at both ends of a row of cells that are no view cells."""
    cells = np.array([[[k, 0, 0], [k + 1, 1, 1]] for k in range(count)], np.int32) * 100
    return CellGraph(
        cells,
        np.isin(np.arange(count), (0, count - 1)),
        np.full(count, "", object),
        np.array([[k, k + 1] for k in range(count - 1)], np.int32),
        np.zeros(count - 1, np.int8),
        np.array([[[k + 1, 0, 0], [k + 1, 1, 1]] for k in range(count - 1)], np.int32) * 100,
    )


def test_cells_that_hang_together_share_and_many_of_them_are_none():
    boxes = np.array([[[110, 10, 10], [120, 20, 20]], [[10, 10, 10], [20, 20, 20]], [[210, 10, 10], [220, 20, 20]]])
    for count in (CELLS_MOST + 2, CELLS_MOST + 3):
        graph = row(count)
        sets = np.zeros((count, 3), bool), np.zeros((count, count), bool)
        sets[0][0, 1], sets[1][0, 0] = True, True
        found = doorways(graph, boxes, sets)
        if count == CELLS_MOST + 3:
            assert not len(found.cells)
            continue
        assert found.cells.tolist() == list(range(1, count - 1))
        assert found.objects.all() and found.reached.all()
    bare = graph.with_portals(np.zeros(0, int))
    assert not len(doorways(bare, boxes, sets).cells)
