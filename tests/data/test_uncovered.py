"""Rooms that no inhabitable cell covers, named."""

import numpy as np
from builders.random_buildings import scene_of
from viewcell.data.uncovered import uncovered_rooms
from viewcell.data.view_cells import as_graph

ROOMS = [((0, 0, 0), (1000, 1000, 1000)), ((2000, 0, 0), (3000, 1000, 1000))]


def uncovered(cells, inhabitable=None):
    graph = as_graph(
        np.array(cells).reshape(-1, 2, 3), inhabitable=None if inhabitable is None else np.array(inhabitable)
    )
    return uncovered_rooms(scene_of([], ROOMS), graph)


def test_a_room_without_an_inhabitable_cell_is_named():
    assert uncovered(ROOMS) == [] and uncovered(ROOMS, [True, False]) == ["room 1"]
    assert uncovered(np.zeros((0, 2, 3))) == ["room 0", "room 1"]


def test_a_neighbour_that_reaches_a_little_into_a_room_does_not_cover_it():
    """Cells that hold 5 % of the room do not; one that holds a fifth, or two that share it, do."""
    first = ROOMS[0]
    assert uncovered([first, ((2350, 350, 350), (2650, 650, 650))]) == ["room 1"]
    assert uncovered([first, ((1000, 0, 0), (2050, 1000, 1000))]) == ["room 1"]
    assert uncovered([first, ((1000, 0, 0), (2200, 1000, 1000))]) == []
    halves = [((2000, 0, 0), (2500, 1000, 1000)), ((2500, 0, 0), (3000, 1000, 1000))]
    assert uncovered([first, *halves]) == []
