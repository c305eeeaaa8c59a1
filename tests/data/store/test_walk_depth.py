"""The index of depth meshes: every number names what there is, and every member of a set is near or far."""

import numpy as np
import pyarrow as pa
import pytest
from viewcell.data.errors import InputError
from viewcell.data.runs import RunSets, decode, encode
from viewcell.data.store.walk_depth import DepthIndex

LEVELS = np.array([1, 2, 3, 1, 1])
SET_CELLS = np.array([2, 5, 9])


def sets_of(*lists) -> RunSets:
    return decode(encode(np.cumsum([0, *map(len, lists)]), np.concatenate(lists).astype(np.int64)), 5)


def table(**changes):
    rows = {
        "cell_id": [2, 9],
        "cull_box_m": [8.0, 9.0],
        "pixels": [1.0, 2.0],
        "near": encode(np.array([0, 2, 3]), np.array([0, 2, 4])),
        "levels": [bytes([0, 2]), bytes([0])],
        "far": encode(np.array([0, 1, 2]), np.array([1, 3])),
        "middle": [[0.0, 0.0, 0.0]] * 2,
        "reach_m": [1.0, 1.0],
        "texels": [512, 512],
        "error_texels": [1.0, 1.0],
        "skin_texels": [9.0, 9.0],
        "offsets": [[0, 16, 32, 48, 64, 80], [96] * 6],
        "sizes": [[9] * 6, [4] * 6],
        "faces": [[3] * 6, [1] * 6],
    }
    return pa.table(rows | changes)


def check(found, sets=((0, 1, 2), (0,), (3, 4)), size=100):
    found.check(sets_of(*sets), SET_CELLS, LEVELS, size)


def test_what_is_there():
    found = DepthIndex.of(table(), 5)
    check(found)
    assert len(found) == 2 and found.cells.tolist() == [2, 9]
    near, levels = found.near_levels(0)
    assert near.tolist() == [0, 2] and levels.tolist() == [0, 2]
    near, levels = found.near_levels(1)
    assert near.tolist() == [4] and levels.tolist() == [0]
    assert found.offsets.shape == found.sizes.shape == found.faces.shape == (2, 6)
    check(DepthIndex.of(table().slice(0, 0), 5))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"cell_id": [2, 3]}, "a row for each of some view cells"),
        ({"cell_id": [2, 11]}, "a row for each of some view cells"),
        ({"cell_id": [9, 2]}, "a row for each of some view cells"),
        ({"levels": [bytes([0, 3]), bytes([0])]}, "a level that there is"),
        ({"levels": [bytes([0]), bytes([0])]}, "a level that there is"),
        ({"near": encode(np.array([0, 2, 3]), np.array([0, 2, 3]))}, "near or far"),
        ({"far": encode(np.array([0, 0, 1]), np.array([3]))}, "near or far"),
        ({"far": encode(np.array([0, 2, 3]), np.array([0, 1, 3]))}, "near or far"),
        ({"offsets": [[0, 16, 32, 48, 64, 80], [97] * 6]}, "faces within the geometry"),
        ({"offsets": [[-1, 16, 32, 48, 64, 80], [9] * 6]}, "faces within the geometry"),
        ({"sizes": [[-9] * 6, [4] * 6]}, "faces within the geometry"),
    ],
)
def test_what_is_not_there_is_refused(changes, words):
    with pytest.raises(InputError, match=words):
        check(DepthIndex.of(table(**changes), 5))


@pytest.mark.parametrize("changes", [{"faces": [[1] * 5] * 2}, {"middle": [[0.0] * 2] * 2}])
def test_other_numbers_of_faces_are_refused(changes):
    with pytest.raises(InputError, match="numbers for each view cell"):
        DepthIndex.of(table(**changes), 5)
