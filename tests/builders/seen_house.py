"""The small house with witnesses of objects, as a bake of view cells, and with curves: what pages are made of."""

import numpy as np
import pyarrow as pa

from builders import small_house

GRID = 2.0**-10
POINT = {"value": 1, "seconds": 0.5, "error": 1.25, "unknown": 0.2, "wrong_hidden": 0}
SAFE = [
    {"method": "portals", "knob": "area", "points": [POINT, POINT | {"value": 2, "seconds": 2.0, "error": 1.5}]},
    {"method": "both", "knob": "no knob", "points": [POINT | {"seconds": 1.0, "error": 1.05}]},
]
UNSAFE = {
    "method": "sampling",
    "knob": "rays",
    "points": [POINT | {"seconds": 0.1, "wrong_hidden": 7}, POINT | {"seconds": 0.2}],
}
LEVELS = {"method": "levels", "knob": "pixels", "points": [POINT | {"seconds": None, "unknown": None}]}
CURVES = {"scene": "house", "series": [one | {"apart": False} for one in (*SAFE, UNSAFE, LEVELS)]}


def seen_house(tmp_path):
    """The house with made-up witnesses of objects: from the middle of the cell to the middle of the object's box."""
    made = small_house.small_house(tmp_path)
    rows, bounds = made.cell_to_object.to_pylist(), made.scene.object_bounds()
    for row in rows:
        origin = made.graph.cells[row["cell_id"]].mean(axis=0) * GRID
        way = bounds[row["object_id"]].mean(axis=0) * GRID - origin
        row.update(verdict="visible")
        row.update(
            {
                f"{name}_{k}": float(v[n])
                for name, v in (("origin", origin), ("direction", way))
                for n, k in enumerate("xyz")
            }
        )
    made.cell_to_object = pa.Table.from_pylist(rows, schema=made.cell_to_object.schema)
    return made


def with_rooms(made):
    """The bake with two rooms: the hall, and a suite of the room and the study, cells 2 and 4."""
    rows = [
        dict(zip(made.rooms.column_names, values, strict=True))
        for values in (
            (0, "1", "Hall", "0BTBFw6f90Nfh9rP1dlXrr", "Ground", -0.5, 1.0, True, [0]),
            (1, "suite", None, None, "Ground", -0.5, 0.9, True, [2, 4]),
        )
    ]
    made.rooms = pa.Table.from_pylist(rows, schema=made.rooms.schema)
    return made


def forget(table, column, cell, target):
    rows = table.to_pylist()
    for row in rows:
        if row["cell_id"] == cell and row[column] == target:
            row.update(
                verdict="unknown", **{f"{end}_{axis}": None for end in ("origin", "direction") for axis in "xyz"}
            )
    return pa.Table.from_pylist(rows, schema=table.schema)


def views_only(tmp_path):
    """The house as a bake of view cells, which speaks of objects only."""
    made = seen_house(tmp_path)
    graph = made.graph
    keep = np.flatnonzero(graph.inhabitable)
    graph.cells, graph.cell_names, graph.inhabitable = (
        graph.cells[keep],
        graph.cell_names[keep],
        np.ones(len(keep), bool),
    )
    graph.portals, graph.portal_cells, graph.portal_axis = (
        graph.portals[:0],
        graph.portal_cells[:0],
        graph.portal_axis[:0],
    )
    rows = [row | {"cell_id": int(np.searchsorted(keep, row["cell_id"]))} for row in made.cell_to_object.to_pylist()]
    made.cell_to_object = pa.Table.from_pylist(rows, schema=made.cell_to_object.schema)
    made.cell_to_object = forget(made.cell_to_object, "object_id", 0, rows[0]["object_id"])
    made.potential_objects, made.claims_cells = made.potential_objects[keep], False
    made.cell_to_cell = made.cell_to_cell.slice(0, 0)
    return made
