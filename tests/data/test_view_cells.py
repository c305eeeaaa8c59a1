"""View cells from tables and octrees."""

from itertools import combinations

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from builders import random_solids
from viewcell.data.errors import InputError
from viewcell.data.prepared import PreparedModel
from viewcell.data.store.view_cells import read_view_cells
from viewcell.data.view_cells import octants, octree_roots, walkable

HEAD = "min_x,min_y,min_z,max_x,max_y,max_z"


@pytest.fixture(scope="module")
def room():
    """A room of 8 x 6 x 3 m on a slab, without a ceiling."""
    boxes = [
        ([0, 0, -0.25], [8, 6, 0]),
        ([0, 0, 0], [8, 0.25, 3]),
        ([0, 5.75, 0], [8, 6, 3]),
        ([0, 0, 0], [0.25, 6, 3]),
        ([7.75, 0, 0], [8, 6, 3]),
    ]
    return random_solids.scene_of_meshes([random_solids.box(*box) for box in boxes])


def write(path, text):
    path.write_text(text)
    return path


def test_boxes_are_snapped_outwards_and_moved_to_the_origin(room, tmp_path):
    room.origin[:] = [100.0, 0.0, 0.0]
    path = write(tmp_path / "cells.csv", f"{HEAD}\n101.0003,1,1,102.0003,2,2\n")
    try:
        graph = read_view_cells(path, room)
    finally:
        room.origin[:] = 0.0
    assert graph.cells.tolist() == [[[1024, 1024, 1024], [2049, 2048, 2048]]]
    assert graph.inhabitable.all() and graph.portal_count == 0


def test_parquet_with_ids_in_any_order_and_names(room, tmp_path):
    table = pa.table(
        {
            "cell_id": [1, 0],
            **{name: [1.0, 2.0] for name in HEAD.split(",")[:3]},
            **{name: [3.0, 4.0] for name in HEAD.split(",")[3:]},
            "inhabitable": [True, False],
            "name": ["one", "zero"],
        }
    )
    pq.write_table(table, tmp_path / "cells.parquet")
    graph = read_view_cells(tmp_path / "cells.parquet", room)
    assert graph.cell_names.tolist() == ["zero", "one"]
    assert graph.inhabitable.tolist() == [False, True]
    assert graph.cells[:, 0, 0].tolist() == [2048, 1024]


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        (f"{HEAD}\n", "at least one view cell"),
        (f"{HEAD}\n1,1,1,2,2,1\n", "cell 0 without volume"),
        (f"{HEAD}\n1,1,1,2,2,2\n3,1,1,2,2,2\n", "cell 1 without volume"),
        (f"{HEAD}\n50,1,1,52,2,2\n", "cell 0 outside"),
        (f"{HEAD}\n1,1,1,2,2,1e9\n", "near the model"),
        (f"{HEAD}\n1,1,nan,2,2,2\n", "finite numbers"),
        (f"{HEAD}\n1,1,x,2,2,2\n", "expected numbers"),
        ("min_x,min_y\n1,2\n", "the column 'min_z'"),
        (f"cell_id,{HEAD}\n5,1,1,1,2,2,2\n", "cell_id 0 to 0"),
        (f"{HEAD}\n1,1\n", "CSV table"),
    ],
)
def test_bad_tables_are_refused_in_one_line(room, tmp_path, text, wanted):
    with pytest.raises(InputError) as error:
        read_view_cells(write(tmp_path / "cells.csv", text), room)
    assert wanted in str(error.value) and "\n" not in str(error.value)


def test_a_missing_table_is_refused(room, tmp_path):
    for name in ("none.csv", "none.parquet"):
        with pytest.raises(InputError, match="expected a"):
            read_view_cells(tmp_path / name, room)


def test_octree_covers_the_model_and_its_octants_tile_it(room):
    roots = octree_roots(room, 4.0)
    assert (roots[:, 0].min(axis=0) <= [0, 0, -256]).all() and (roots[:, 1].max(axis=0) >= [8192, 6144, 3072]).all()
    children = octants(roots)
    sizes = (children[:, 1] - children[:, 0]).astype(float).prod(axis=1).reshape(-1, 8)
    np.testing.assert_array_equal(sizes.sum(axis=1), (roots[:, 1] - roots[:, 0]).astype(float).prod(axis=1))
    families = children.reshape(-1, 8, 2, 3)
    # Of one size in all and without overlap: they leave nothing out.
    for a, b in combinations(range(8), 2):
        shared = np.minimum(families[:, a, 1], families[:, b, 1]) - np.maximum(families[:, a, 0], families[:, b, 0])
        assert (shared <= 0).any(axis=1).all()
    assert (families[:, :, 0] >= roots[:, None, 0]).all() and (families[:, :, 1] <= roots[:, None, 1]).all()


def test_walkable_cells_have_a_floor_and_air(room):
    cells = np.array(
        [
            [[2048, 2048, 512], [3072, 3072, 1536]],
            [[2048, 2048, 2900], [3072, 3072, 3900]],
            [[20480, 2048, 512], [21504, 3072, 1536]],
            [[1024, 20, 1024], [2048, 200, 2048]],
        ],
        np.int32,
    )
    # Over the floor; too high above it; beside the building; inside a wall.
    assert walkable(cells, PreparedModel(room)).tolist() == [True, False, False, False]


@pytest.mark.parametrize("size", [0.0, -1.0, np.nan, 1e-3])
def test_absurd_cell_sizes_are_refused(room, size):
    with pytest.raises(InputError, match="cell size"):
        octree_roots(room, size)
