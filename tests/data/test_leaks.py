"""Cells that only a crack joins to the outside."""

from dataclasses import replace

import numpy as np
import pytest
from builders import random_solids
from builders.random_buildings import scene_of
from viewcell.data.graph import CellGraph
from viewcell.data.leaks import cells_behind_cracks
from viewcell.data.prepared import PreparedModel
from viewcell.data.scene import Role, Space
from viewcell.workbench.bake.cells import build_graph
from viewcell.workbench.bake.manifest import Clock
from viewcell.workbench.bake.settings import Settings

CRACK_M = 0.05


def house(gap, door=False):
    """Two rooms of 4 x 4 x 3 m; the second one's outer wall stops short of the ceiling, or has a doorway."""
    box = random_solids.box
    end = [box([9, 0, 0], [10, 4, 3 - gap])]
    if door:
        end = [box([9, 0, 0], [10, 1, 3]), box([9, 2, 0], [10, 4, 3]), box([9, 1, 2], [10, 2, 3])]
    meshes = [
        box([-1, -1, -1], [10, 5, 0]), box([-1, -1, 3], [10, 5, 4]),
        box([-1, -1, 0], [10, 0, 3]), box([-1, 4, 0], [10, 5, 3]),
        box([-1, 0, 0], [0, 4, 3]), box([4, 0, 0], [5, 4, 3]), *end,
    ]  # fmt: skip
    scene = random_solids.scene_of_meshes(meshes, [Role.OCCLUDER] * len(meshes))
    for name, low, high in (("a", [0, 0, 0], [4, 4, 3]), ("b", [5, 0, 0], [9, 4, 3])):
        room = box(low, high)
        scene.spaces.append(Space(name, np.array(room.vertices), np.array(room.faces, np.int32)))
    return scene


def leaky(scene):
    """Names of the rooms whose cells are behind cracks."""
    graph, _ = build_graph(PreparedModel(scene), Settings(), Clock())
    return sorted(set(graph.cell_names[cells_behind_cracks(scene, graph, CRACK_M)]))


@pytest.mark.parametrize(("gap", "rooms"), [(0.0, []), (2.0**-6, ["b"]), (0.5, [])])
def test_only_the_room_behind_the_crack_leaks(gap, rooms):
    """A gap of half a metre is an opening that somebody meant."""
    assert leaky(house(gap)) == rooms


def test_a_doorway_is_no_crack_however_it_is_told():
    scene = house(0.0, door=True)
    opening = np.array([[[9.0, 1.0, 0.0], [10.0, 2.0, 2.0]]])
    assert leaky(scene) == leaky(replace(scene, openings=opening)) == []


@pytest.mark.parametrize(("strips", "cracked"), [(1, True), (3, False)])
def test_an_opening_that_cells_cut_into_strips_is_no_crack(strips, cracked):
    """Strips of 3 cm, side by side, between the outside and a cell: a square of 5 cm fits into three of them."""
    cells = np.array([[[-2000, 0, 0], [0, 1000, 1000]], [[0, 0, 0], [1000, 1000, 1000]]], np.int32)
    portals = np.array([[[0, 0, 31 * k], [0, 1000, 31 * k + 31]] for k in range(strips)], np.int32)
    pairs, axis = np.tile([[0, 1]], (strips, 1)).astype(np.int32), np.zeros(strips, np.int8)
    graph = CellGraph(cells, np.array([False, True]), np.full(2, "", object), pairs, axis, portals)
    assert cells_behind_cracks(scene_of([]), graph, CRACK_M).tolist() == [False, cracked]
