import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import pytest
from viewcell import InputError
from viewcell.data.store.claims import read_claims
from viewcell.data.store.view_cells import ViewCells
from viewcell.data.view_cells import as_graph

NAMES = ["table", "chair", "chair", "lamp", "12"]
BOXES = np.array([[[k, 0, 0], [k + 1, 1, 1]] for k in range(3)])
NO_PLAN = np.zeros(3, bool)
PAIRS = [(10, 0), (10, 3), (30, 2)]


@pytest.fixture
def view():
    names = np.array(["hall", "kitchen", "attic"], object)
    return ViewCells(as_graph(BOXES, names), np.array([10, 20, 30]), NO_PLAN)


def table(pairs=PAIRS, target="object_id", **more):
    return pa.table({"cell_id": [cell for cell, _ in pairs], target: [other for _, other in pairs]} | more)


def expected(pairs=PAIRS):
    matrix = np.zeros((3, 5), bool)
    for cell, target in pairs:
        matrix[cell // 10 - 1, target] = True
    return matrix


def test_pairs_of_ids(view):
    claims = read_claims([table()], view, NAMES)
    assert np.array_equal(claims.objects, expected()) and claims.cells is None


def test_names_stand_for_ids(view):
    pairs = [("hall", "table"), ("hall", "lamp"), ("attic", "12")]
    claims = read_claims([table(pairs)], view, NAMES)
    assert np.array_equal(claims.objects, expected([(10, 0), (10, 3), (30, 4)]))


def test_text_ids_come_before_names():
    view = ViewCells(as_graph(BOXES), np.array(["a", "b", "c"], object), NO_PLAN)
    claims = read_claims([table([("c", "lamp")])], view, NAMES)
    assert np.argwhere(claims.objects).tolist() == [[2, 3]]


def test_numbers_written_as_text_are_ids_unless_they_are_names(view):
    claims = read_claims([table([("10", "3"), ("kitchen", "12"), ("30", "0")])], view, NAMES)
    assert np.argwhere(claims.objects).tolist() == [[0, 3], [1, 4], [2, 0]]


def test_guids_stand_for_objects_as_names_do(view):
    guids = ["2O2Fr$t4X7Zf8NOew3FKau", "1hOSvn6df7F8_7GcBWlRGQ", "", "twice", "twice"]
    pairs = [("hall", guids[0]), ("hall", "lamp"), ("attic", guids[1])]
    claims = read_claims([table(pairs)], view, NAMES, guids=guids)
    assert np.array_equal(claims.objects, expected([(10, 0), (10, 3), (30, 1)]))
    for shared in ("twice", "chair"):
        with pytest.raises(InputError, match=f"found '{shared}' for 2"):
            read_claims([table([("hall", shared)])], view, NAMES, guids=guids)
    # An object whose name is its GUID bears one name.
    same = read_claims([table([("hall", "table")])], view, NAMES, guids=["table", "", "", "", ""])
    assert np.array_equal(same.objects, expected([(10, 0)]))


def test_cells_see_themselves(view):
    claims = read_claims([table([(10, 20)], "reached_cell_id")], view, NAMES)
    assert claims.cells.tolist() == [[True, True, False], [False, True, False], [False, False, True]]


def test_hidden_rows_are_no_claims(view):
    claims = read_claims([table(verdict=["visible", "hidden", "unknown"])], view, NAMES)
    assert np.array_equal(claims.objects, expected([(10, 0), (30, 2)]))


def test_objects_and_cells_from_two_tables(view):
    claims = read_claims([table(), table([(10, 20)], "reached_cell_id")], view, NAMES)
    assert claims.objects.sum() == 3 and claims.cells.sum() == 4


@pytest.mark.parametrize("form", ["bool", "int64", "packed"])
def test_matrices(view, tmp_path, form):
    matrix = expected()
    if form == "packed":
        matrix = np.packbits(matrix, axis=1)
    np.save(tmp_path / "pvs.npy", matrix if form == "packed" else matrix.astype(form))
    for source in (tmp_path / "pvs.npy", matrix):
        assert np.array_equal(read_claims([source], view, NAMES, "objects").objects, expected())


def test_square_matrices_need_a_word(view):
    square = np.eye(3, dtype=bool)
    with pytest.raises(InputError, match="may be either"):
        read_claims([square], view, NAMES[:3])
    assert read_claims([square], view, NAMES[:3], "cells").objects is None
    assert read_claims([square], view, NAMES[:3], "objects").cells is None


def test_files_and_frames(view, tmp_path):
    pq.write_table(table(), tmp_path / "pvs.parquet")
    pyarrow.csv.write_csv(table(), tmp_path / "pvs.csv")
    columns = {name: table()[name].to_pylist() for name in table().column_names}
    for source in (tmp_path / "pvs.parquet", str(tmp_path / "pvs.csv"), columns):
        assert np.array_equal(read_claims([source], view, NAMES).objects, expected())


BAD = {
    "unknown cell": (table([(11, 0)]), "expected cells of the table of cells, found 11"),
    "unknown object": (table([(10, 7)]), "expected objects of the model, found 7"),
    "negative object": (table([(10, -1)]), "expected objects of the model, found -1"),
    "unknown name": (table([("hall", "sofa")]), "expected objects of the model, found 'sofa'"),
    "ambiguous name": (table([("hall", "chair")]), "found 'chair' for 2: use ids"),
    "twice": (table([*PAIRS, (10, 3)]), "expected each pair once, found cell 10, object 3 in rows 1 and 3"),
    "empty": (pa.table({"cell_id": pa.array([], pa.int32()), "object_id": pa.array([], pa.int32())}), "at least one"),
    "all hidden": (table(verdict=["hidden"] * 3), "expected at least one claim, found none"),
    "odd verdict": (table(verdict=["maybe"] * 3), "expected a verdict of visible, unknown, potential, hidden"),
    "no target": (pa.table({"cell_id": [10]}), "expected the columns cell_id and object_id or reached_cell_id"),
    "both targets": (table(reached_cell_id=[10] * 3), "expected the columns cell_id and object_id or"),
    "numbers with fractions": (pa.table({"cell_id": [1.5], "object_id": [0]}), "expected cell ids or names, found"),
    "a null": (pa.table({"cell_id": [10, None], "object_id": [0, 1]}), "found none in row 1"),
    "odd matrix": (np.zeros((3, 4), bool), "expected a matrix of 3 x 5 for objects or 3 x 3 for cells"),
    "no bits": (np.full((3, 5), 2), "expected bits, found 2"),
    "real matrix": (np.zeros((3, 5)), "expected a matrix of bits, found float64"),
    "empty matrix": (np.zeros((3, 5), bool), "expected at least one claim, found none"),
    "text beside numbers": (table([("10", "0"), ("10", "sofa")]), "expected objects of the model, found 'sofa'"),
    "a single bit": (np.array(True), "found a single number"),
    "no table": (7, "expected a table or a matrix"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_claims_are_refused_in_a_line(view, case):
    source, said = BAD[case]
    with pytest.raises(InputError) as error:
        read_claims([source], view, NAMES)
    assert said in str(error.value) and "\n" not in str(error.value)


def test_bad_files_are_refused(view, tmp_path):
    (tmp_path / "pvs.npy").write_bytes(b"\x93NUMPY nothing")
    (tmp_path / "pvs.parquet").write_bytes(b"PAR1 nothing")
    for name in ("pvs.npy", "pvs.parquet", "absent.csv"):
        with pytest.raises(InputError, match=r"expected"):
            read_claims([tmp_path / name], view, NAMES)


def test_claims_come_once_and_of_inhabitable_cells(view):
    with pytest.raises(InputError, match="once, found them a second time"):
        read_claims([table(), table()], view, NAMES)
    closed = ViewCells(as_graph(BOXES, inhabitable=np.array([False, True, True])), view.ids, NO_PLAN)
    with pytest.raises(InputError, match="expected rows of inhabitable cells only, found cell 10"):
        read_claims([table()], closed, NAMES)
    with pytest.raises(InputError, match="found none"):
        read_claims([], view, NAMES)


def test_a_planned_cell_that_no_row_names_is_silent(view):
    view = ViewCells(view.graph, view.ids, np.array([False, True, True]))
    of_one = {"cell_id": [10], "reached_cell_id": [30]}
    claims = read_claims([of_one], view, NAMES)
    assert claims.silent.tolist() == [False, True, False]
    assert claims.cells.tolist() == [[True, True, True], [True] * 3, [False, True, True]]
    # A cell without a plan that no row names is claimed to see nothing, and so is one of a matrix's rows.
    claims = read_claims([{"cell_id": [30], "reached_cell_id": [20]}], view, NAMES)
    assert not claims.silent.any() and claims.cells.tolist() == [
        [True, False, False],
        [False, True, False],
        [False, True, True],
    ]
