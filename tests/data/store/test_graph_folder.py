"""A folder with cells and portals: what is read, and every contradiction told in one line."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from builders import random_buildings
from viewcell.data.errors import InputError
from viewcell.data.graph import OTHER_AXES
from viewcell.data.store.graph_folder import CELL_COLUMNS, PORTAL_COLUMNS, first_overlap, plan_column, read_graph

GRID_M = 2.0**-10


def columns_of(graph):
    """Tables of a graph as dictionaries of lists [m]."""
    cells = graph.cells.reshape(-1, 6) * GRID_M
    first = {"cell_id": list(range(len(cells)))} | {n: cells[:, i].tolist() for i, n in enumerate(CELL_COLUMNS[1:])}
    uv = OTHER_AXES[graph.portal_axis]
    rows = np.arange(graph.portal_count)
    metres = graph.portals * GRID_M
    ends = [metres[rows, 0, graph.portal_axis]] + [metres[rows, s, uv[:, c]] for c in (0, 1) for s in (0, 1)]
    second = {"portal_id": rows.tolist(), "cell_a": graph.portal_cells[:, 0].tolist()}
    second |= {"cell_b": graph.portal_cells[:, 1].tolist(), "axis": graph.portal_axis.tolist()}
    return first, second | {n: x.tolist() for n, x in zip(PORTAL_COLUMNS[4:], ends, strict=True)}


def write(folder, cells, portals):
    for name, table in (("cells", cells), ("portals", portals)):
        pq.write_table(pa.table(table), folder / f"{name}.parquet")
    return folder


def some_graph(seed=3):
    return random_buildings.random_graph(seed, walls=5)[0]


@pytest.mark.parametrize("seed", range(5))
def test_what_was_written_is_read(seed, tmp_path):
    graph = some_graph(seed)
    again, moved = read_graph(write(tmp_path, *columns_of(graph)))
    assert moved == 0.0 and again.inhabitable.all()
    for name in ("cells", "portal_cells", "portal_axis", "portals"):
        np.testing.assert_array_equal(getattr(again, name), getattr(graph, name), err_msg=name)
        assert getattr(again, name).dtype == getattr(graph, name).dtype


def test_cells_are_put_in_order_and_off_grid_is_told(tmp_path):
    graph = some_graph()
    cells, portals = columns_of(graph)
    turned = {name: values[::-1] for name, values in cells.items()}
    turned["inhabitable"] = [n % 2 == 0 for n in turned["cell_id"]]
    turned["name"] = [f"room {n}" for n in turned["cell_id"]]
    again, _ = read_graph(write(tmp_path, turned, portals))
    np.testing.assert_array_equal(again.cells, graph.cells)
    np.testing.assert_array_equal(again.inhabitable, np.arange(graph.cell_count) % 2 == 0)
    assert again.cell_names.tolist() == [f"room {n}" for n in range(graph.cell_count)]
    for table, names in ((cells, CELL_COLUMNS[1:]), (portals, PORTAL_COLUMNS[4:])):
        for name in names:
            table[name] = [value + GRID_M / 8 for value in table[name]]
    again, moved = read_graph(write(tmp_path, cells, portals))
    assert moved == GRID_M / 8
    np.testing.assert_array_equal(again.portals, graph.portals)


def spoil(table, name, row, value):
    def change(cells, portals):
        (cells if table == "cells" else portals)[name][row] = value

    return change


def drop(table, name):
    return lambda cells, portals: (cells if table == "cells" else portals).pop(name)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (spoil("cells", "max_x", 0, float("nan")), "expected finite numbers, found nan in max_x of row 0"),
        (spoil("cells", "min_z", 1, float("inf")), "expected finite numbers, found inf"),
        (spoil("cells", "min_z", 1, None), "expected finite numbers, found nan"),
        (spoil("cells", "cell_id", 1, 0), "each once"),
        (spoil("cells", "max_x", 0, -9.0), "found cell 0 without volume"),
        (spoil("cells", "max_x", 0, 1e6), "expected coordinates within"),
        (spoil("portals", "cell_a", 0, 999), "expected cell_a from 0"),
        (spoil("portals", "cell_b", 0, -1), "found -1 in row 0"),
        (spoil("portals", "axis", 0, 3), "expected axis from 0 to 2, found 3"),
        (spoil("portals", "coordinate", 0, 0.25 + 1 / 64), "off the common face"),
        (spoil("portals", "max_u", 0, 9.0), "off the common face"),
        (spoil("portals", "max_u", 0, -9.0), "expected portals with area, found portal 0 without"),
        (lambda _, portals: portals["cell_a"].__setitem__(0, portals["cell_b"][0]), "off the common face"),
        (lambda _, portals: portals["cell_b"].__setitem__(0, portals["cell_a"][0]), "off the common face"),
        (drop("cells", "max_y"), "max_y"),
        (drop("portals", "axis"), "axis"),
        (lambda cells, _: cells.update(min_x=["a"] * len(cells["min_x"])), "expected numbers"),
    ],
)
def test_contradictions_are_one_line(change, message, tmp_path):
    cells, portals = columns_of(some_graph())
    change(cells, portals)
    with pytest.raises(InputError) as told:
        read_graph(write(tmp_path, cells, portals))
    assert message in str(told.value) and "\n" not in str(told.value)


def test_overlapping_cells_are_refused(tmp_path):
    cells, portals = columns_of(some_graph())
    cells = {name: [*values, values[0]] for name, values in cells.items()}
    cells["cell_id"][-1] = len(cells["cell_id"]) - 1
    with pytest.raises(InputError, match="found cells 0 and"):
        read_graph(write(tmp_path, cells, portals))


def test_missing_and_broken_files_are_one_line(tmp_path):
    with pytest.raises(InputError, match=r"cells\.parquet"):
        read_graph(tmp_path)
    write(tmp_path, *columns_of(some_graph()))
    (tmp_path / "portals.parquet").write_bytes(b"PAR1 but not for long")
    with pytest.raises(InputError, match=r"portals\.parquet"):
        read_graph(tmp_path)
    none = {name: values[:0] for name, values in columns_of(some_graph())[0].items()}
    write(tmp_path, none, columns_of(some_graph())[1])
    with pytest.raises(InputError, match="found an empty table"):
        read_graph(tmp_path)


def test_overlaps_are_found_by_looking_at_every_pair():
    rng = np.random.default_rng(2)
    found = 0
    for _ in range(300):
        low = rng.integers(0, 20, (4, 3))
        cells = np.stack([low, low + rng.integers(1, 9, (4, 3))], axis=1)
        pair = first_overlap(cells)
        both = (
            np.maximum(cells[:, None, 0], cells[None, :, 0]) < np.minimum(cells[:, None, 1], cells[None, :, 1])
        ).all(2)
        assert (pair is not None) == np.triu(both, 1).any()
        found += pair is not None
        assert pair is None or (both[pair] and pair[0] != pair[1])
    assert 50 < found < 250


PLAN = [0.0, 0.0, 1.0, 0.5, 0.5, 1.5, -0.5, 1.0]


def planned(plan=PLAN, **box):
    """A change that adds a cell over a plan after all others."""

    def change(cells, portals):
        count = len(cells["cell_id"])
        extent = {"min_x": -0.5, "min_y": 0.0, "min_z": 0.0, "max_x": 1.0, "max_y": 1.5, "max_z": 2.0} | box
        for name, values in cells.items():
            values.append(count if name == "cell_id" else extent[name])
        cells["plan"] = [None] * count + [plan]

    return change


def test_plans_are_read(tmp_path):
    cells, portals = columns_of(some_graph())
    count = len(cells["cell_id"])
    planned()(cells, portals)
    graph, moved = read_graph(write(tmp_path, cells, portals))
    assert moved == 0 and graph.plans.rows.tolist() == [count] and graph.tile_count == count
    assert (graph.plans.corners[0].ravel() * GRID_M).tolist() == PLAN
    assert graph.tiles.cell_count == count and not len(graph.tiles.plans.rows)
    written = plan_column(graph.plans.filled(count + 1, np.arange(count + 1)), np.arange(count + 1) == count, GRID_M)
    assert written.to_pylist() == [None] * count + [PLAN]


def swap_last(cells, portals):
    """The cell over a plan comes before another."""
    planned()(cells, portals)
    for name, values in cells.items():
        if name != "cell_id":
            values[-1], values[-2] = values[-2], values[-1]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (planned(PLAN[:6]), "expected plans of four corners, found another number of coordinates"),
        (planned([*PLAN, 3.0, 3.0]), "expected plans of four corners, found another number"),
        (planned(PLAN[::-1]), "expected convex plans, counter-clockwise"),
        (planned([*PLAN[:2], *PLAN[6:], *PLAN[4:6], *PLAN[2:4]]), "expected convex plans, counter-clockwise"),
        (planned([0.0, 0.0, 1.0, 0.5, 0.0, 0.5, -0.5, 1.5]), "expected convex plans, counter-clockwise"),
        (planned(max_x=1.5), "that touch their box on every side, found another in cell"),
        (planned(min_y=-0.5), "that touch their box on every side, found another in cell"),
        (swap_last, "expected cells with a plan after all others, found one before cell"),
    ],
)
def test_plans_that_are_none_are_one_line(change, message, tmp_path):
    cells, portals = columns_of(some_graph())
    change(cells, portals)
    with pytest.raises(InputError) as told:
        read_graph(write(tmp_path, cells, portals))
    assert message in str(told.value) and "\n" not in str(told.value)
    assert "cells.parquet" in str(told.value)
