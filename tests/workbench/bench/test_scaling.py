"""The table of ever larger scenes: a number under each heading, and how fast they grow."""

from dataclasses import replace

import numpy as np
from viewcell.data.buildings.plant import make_plant
from viewcell.workbench.bench.scaling import HEAD, Measured, cells_in_spaces, exponents

ROW = Measured(
    "plant", 1000, 10, 4, 60.0, 0.1, {"read": 1.0, "view cells": 1.0, "prepare": 2.0, "flood": 6.0}, 2, 8, 4, 0.5, 1.0
)


def test_every_row_has_all_columns():
    found = dict(zip(HEAD, ROW.columns(), strict=True))
    assert found["ms per cell"] == "3,000" and found["overestimate"] == "2.00" and found["kept %"] == "50"
    unreached = replace(ROW, bounded=0, potential=0, seen=0)
    assert dict(zip(HEAD, unreached.columns(), strict=True))["overestimate"] == "-"


def test_exponents_are_those_of_the_costs():
    phases = {"read": 4.0, "view cells": 4.0, "prepare": 8.0, "flood": 6.0}
    more = replace(ROW, triangles=16_000, phases=phases, peak_gb=16.0, potential=32, kept=0.125)
    unseen = replace(ROW, triangles=16_000, potential=0, seen=0)
    assert exponents([ROW, more, replace(ROW, scene="city")]) == [
        "plant, exponents in triangles: before the first cell 0.50, a cell 0.00, memory 1.00, overestimate 0.50, "
        "kept share -0.50"
    ]
    assert exponents([ROW, unseen]) == [
        "plant, exponents in triangles: before the first cell 0.00, a cell 0.00, memory 0.00, kept share 0.00"
    ]


def test_cells_lie_in_the_spaces():
    scene = make_plant(triangles=50_000)
    cells = cells_in_spaces(scene, 200)
    spaces = np.array([[s.vertices.min(axis=0), s.vertices.max(axis=0)] for s in scene.spaces])
    held = (cells[:, None, 0] >= spaces[:, 0] - 1e-9) & (cells[:, None, 1] <= spaces[:, 1] + 1e-9)
    assert held.all(axis=2).any(axis=1).all() and (cells[:, 1] - cells[:, 0] <= 2.0).all()
