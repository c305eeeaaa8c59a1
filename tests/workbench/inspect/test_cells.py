"""Cracks of known size between two rooms, and what a seal makes of them."""

import numpy as np
import pytest
from builders import random_solids
from viewcell.data.errors import InputError
from viewcell.data.prepared import PreparedModel
from viewcell.data.scene import Role, Space
from viewcell.verify.findings import count_pairs
from viewcell.workbench.bake.run import bake
from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.inspect.cells import find_cells
from viewcell.workbench.verify import verify_bake

GAP = 2.0**-6


def two_rooms(gap=GAP):
    """Rooms of 4 x 4 x 3 m on both sides of a wall that stops short of the ceiling, and a table in the second."""
    box = random_solids.box
    meshes = [
        box([-1, -1, -1], [10, 5, 0]), box([-1, -1, 3], [10, 5, 4]),
        box([-1, -1, 0], [10, 0, 3]), box([-1, 4, 0], [10, 5, 3]),
        box([-1, 0, 0], [0, 4, 3]), box([9, 0, 0], [10, 4, 3]),
        box([4, 0, 0], [5, 4, 3 - gap]), box([7, 1, 0], [8, 2, 1]),
    ]  # fmt: skip
    scene = random_solids.scene_of_meshes(meshes, [Role.OCCLUDER] * 7 + [Role.DETAIL])
    for name, low, high in (("a", [0, 0, 0], [4, 4, 3]), ("b", [5, 0, 0], [9, 4, 3])):
        room = box(low, high)
        scene.spaces.append(Space(name, np.array(room.vertices), np.array(room.faces, np.int32)))
    return scene


@pytest.mark.parametrize("gap", [0.0, GAP, 0.5])
def test_a_crack_is_found_and_measured(gap):
    found = find_cells(PreparedModel(two_rooms(gap)), tried=1)
    assert found.bake_s > 0 and found.counts[1] >= 2 and not found.leak
    cracks = [crack for crack in found.cracks if crack.rooms]
    assert bool(cracks) == (gap == GAP)
    if cracks:
        assert {round(crack.box[0, 0], 3) for crack in cracks} == {4.0, 5.0}
        assert all(crack.width_m == GAP and crack.length_m == 4.0 for crack in cracks)
        assert {"o6", "o1"} == set(cracks[0].between)


def test_a_seal_closes_the_crack_and_lists_what_it_hides(tmp_path):
    scene = two_rooms()
    made = bake(scene, tmp_path / "open", threads=1)
    sealed = bake(scene, tmp_path / "sealed", settings=Settings(seal=0.02), threads=1)
    whole = bake(two_rooms(0.0), tmp_path / "whole", threads=1)
    counts = [[pair.potential for pair in count_pairs(one)] for one in (made, sealed, whole)]
    assert counts[0] > counts[1]
    room = {name: int(np.flatnonzero(sealed.graph.cell_names == name)[0]) for name in "ab"}
    assert made.potential_cells[room["a"], room["b"]] and not sealed.potential_cells[room["a"], room["b"]]
    assert len(sealed.cracks) == sealed.manifest["counts"]["closed_cracks"] > 0
    leaks = sealed.leaks.to_pylist()
    assert {"cell_id": room["a"], "reached_cell_id": room["b"], "object_id": None} in leaks
    gone = [(row["cell_id"], row["object_id"]) for row in leaks if row["object_id"] is not None]
    assert gone and all(made.potential_objects[pair] and not sealed.potential_objects[pair] for pair in gone)
    assert made.potential_objects.sum() - sealed.potential_objects.sum() == len(gone)
    # What is seen through the crack is no fault of a bake that closed it.
    judged = verify_bake(sealed, rays=200_000)
    assert judged.ok and verify_bake(made, rays=50_000).ok
    assert len(made.cracks) == 0 and made.leaks.num_rows == 0


def test_a_seal_narrower_than_the_crack_changes_nothing(tmp_path):
    made = bake(two_rooms(), tmp_path / "open", threads=1)
    sealed = bake(two_rooms(), tmp_path / "sealed", settings=Settings(seal=GAP), threads=1)
    np.testing.assert_array_equal(sealed.potential_cells, made.potential_cells)
    np.testing.assert_array_equal(sealed.potential_objects, made.potential_objects)
    assert sealed.leaks.num_rows == 0


@pytest.mark.parametrize("other", [{"certify": True}, {"method": "vlod"}, {"method": "occluders"}, {"cells": "octree"}])
def test_a_seal_is_of_portals(other, tmp_path):
    with pytest.raises(InputError, match="seal"):
        bake(two_rooms(), tmp_path / "b", settings=Settings(seal=0.02, **other), threads=1)
