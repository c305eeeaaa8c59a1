"""Tables of view cells and of claims as they come: columns twice, ids that no float tells apart."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from builders.model_files import obj
from builders.places import SHARED
from viewcell.data.errors import InputError
from viewcell.data.frame import in_frame
from viewcell.data.readers import read
from viewcell.data.store.claims import read_claims
from viewcell.data.store.view_cells import read_rows, view_cells
from viewcell.workbench.check.run import check
from viewcell.workbench.cli import main

TABLES = SHARED / "cases" / "readers" / "tables"
shared = pytest.mark.skipif(not TABLES.is_dir(), reason="no shared cases folder beside the checkout")
BOX = {"min_x": 0.3, "min_y": 0.3, "min_z": 0.1, "max_x": 3.5, "max_y": 2.8, "max_z": 2.8}
NAMES = [f"object {k}" for k in range(12)]


@pytest.fixture
def house(tmp_path):
    (tmp_path / "house.obj").write_bytes(obj())
    return tmp_path / "house.obj"


def cells(ids) -> pa.Table:
    return pa.table({"cell_id": ids} | {name: [value] * len(ids) for name, value in BOX.items()})


HUGE = [2**53 + 1, 2**53, 2**53 + 2, 10**18, 10**18 + 1, 2**63 - 1, -(2**53) - 1]


@pytest.mark.parametrize("kind", [pa.int64(), pa.uint64()])
def test_ids_above_two_to_the_53_are_exact(house, kind):
    ids = [number for number in HUGE if kind == pa.int64() or number >= 0]
    view = view_cells(cells(pa.array(ids, kind)), read(house), "cells")
    assert view.ids.tolist() == ids
    claims = read_claims([{"cell_id": ids[:2], "object_id": [0, 3]}], view, NAMES)
    assert claims.objects.sum(axis=1).tolist()[:2] == [1, 1] and claims.objects[0, 0] and claims.objects[1, 3]


BAD_IDS = {
    "twice": [2**53 + 1, 2**53 + 1],
    "too large": pa.array([2**63], pa.uint64()),
    "floats that may be others": [float(2**53 + 2)],
    "between two": [0.5],
    "none": [None, 1],
}


@pytest.mark.parametrize("case", BAD_IDS)
def test_ids_that_cannot_be_told_are_refused(house, case):
    with pytest.raises(InputError, match="cell_id") as error:
        view_cells(cells(BAD_IDS[case]), read(house), "cells")
    assert "\n" not in str(error.value)


def test_floats_and_dictionaries_may_be_ids(house):
    scene = read(house)
    assert view_cells(cells([3.0, 4.0]), scene, "cells").ids.tolist() == [3, 4]
    words = pa.array(["a", "b"]).dictionary_encode()
    assert view_cells(cells(words), scene, "cells").ids.tolist() == ["a", "b"]


def test_a_column_twice_is_one_line(house, tmp_path):
    scene = read(house)
    twice = pa.Table.from_arrays([*cells([0]).columns, pa.array([9.0])], names=["cell_id", *BOX, "min_x"])
    pq.write_table(twice, tmp_path / "twice.parquet")
    with pytest.raises(InputError, match="min_x") as error:
        view_cells(read_rows(tmp_path / "twice.parquet"), scene, "cells")
    assert "\n" not in str(error.value)
    with pytest.raises(InputError, match="'min_x' more than once"):
        view_cells(twice, scene, "cells")
    view = view_cells(cells([0]), scene, "cells")
    claims = pa.Table.from_arrays([pa.array([0])] * 3, names=["cell_id", "object_id", "object_id"])
    with pytest.raises(InputError, match="'object_id' more than once"):
        read_claims([claims], view, NAMES)


@shared
def test_shared_tables(house, tmp_path, capsys):
    (tmp_path / "cells.csv").write_text(",".join(BOX) + "\n" + ",".join(map(str, BOX.values())) + "\n")
    for options in (
        ["--cells", tmp_path / "cells.csv", "--pvs", TABLES / "twocol.csv"],
        ["--cells", TABLES / "cells_twocol.csv", "--pvs", TABLES / "id53.csv"],
    ):
        assert main(["check", str(house), *map(str, options)]) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 1
    found = check(house, TABLES / "id53.csv", TABLES / "cell_id53.csv", rays=2000)
    assert found.cell_ids.tolist() == [2**53 + 1]
    claims = {"cell_id": [10**18, 10**18 + 1], "object_id": [0, 0]}
    found = check(house, claims, TABLES / "cells_hugeid.csv", rays=2000)
    assert found.cell_ids.tolist() == [10**18, 10**18 + 1]


@pytest.mark.parametrize("inwards", [False, True])
@pytest.mark.parametrize("yaw", [17.0, -30.0, 45.0])
def test_boxes_of_the_models_own_frame_are_prisms_in_a_turned_one(house, yaw, inwards):
    """Not larger than they are by more than rounding, and on the side that is asked for."""
    scene = in_frame(read(house), yaw)
    view = view_cells(cells([0, 1]), scene, "cells", inwards=inwards)
    assert view.graph.plans.rows.tolist() == [0, 1] and view.graph.tile_count == 0
    rows = cells([0, 1]).to_pylist()
    for row, plan, box in zip(rows, view.graph.plans.corners, view.graph.cells, strict=True):
        level = np.column_stack([plan * scene.grid_m, np.zeros(4)])
        x, y, _ = scene.in_model(level).T
        low, high = (row["min_x"], row["min_y"]), (row["max_x"], row["max_y"])
        grown = np.array([x.min() - low[0], y.min() - low[1], high[0] - x.max(), high[1] - y.max()])
        grown = grown if inwards else -grown
        assert (grown >= 0).all() and (grown < 5 * scene.grid_m).all()
        np.testing.assert_array_equal(box[:, :2], [plan.min(axis=0), plan.max(axis=0)])


@pytest.mark.parametrize(
    ("plan", "told"),
    [
        ([0.0, 0.0, 1.0, 0.0], "four corners"),
        ([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0], "counter-clockwise"),
        ([0.0, 0.0, 1.0, 0.0, 0.4, 0.2, 0.0, 1.0], "convex"),
    ],
)
def test_plans_that_are_none_are_bad_input(house, plan, told):
    table = cells([0, 1]).append_column("plan", pa.array([None, plan], pa.list_(pa.float64())))
    with pytest.raises(InputError, match=told):
        view_cells(table, read(house), "cells")
