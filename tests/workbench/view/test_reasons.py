"""Sightlines and proofs that a view holds are those of the bake."""

import json
import shutil
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from builders.certified_bake import make_honest
from builders.view_scripts import read_script
from viewcell.data.store.walk_folder import read_walk
from viewcell.verify.rays.clearance import clearances
from viewcell.workbench.baked import load
from viewcell.workbench.pack.run import pack
from viewcell.workbench.view.reasons import reasons, rectangle
from viewcell.workbench.view.run import view

VECTORS = Path(__file__).parent / "page" / "clearances.json"


@pytest.fixture(scope="module")
def honest(tmp_path_factory):
    folder = make_honest(tmp_path_factory.mktemp("honest"))
    return load(folder), pack(folder)


def test_every_sightline_of_the_bake_is_held(office, walk):
    head, arrays = read_script(reasons(load(office.folder), walk))
    objects, cells = walk.objects["object_id"].to_numpy(), walk.cells["cell_id"].to_numpy()
    assert head == {"certified": False} and "proofCells" not in arrays
    for kind, ids in (("object", objects), ("cell", cells)):
        table = office.cell_to_object if kind == "object" else office.cell_to_cell
        name = "object_id" if kind == "object" else "reached_cell_id"
        seen = [row for row in table.to_pylist() if row["verdict"] == "visible"]
        pairs = arrays[f"{kind}Pairs"].reshape(-1, 2)
        found = list(zip(cells[pairs[:, 0]], ids[pairs[:, 1]], strict=True))
        assert found == [(row["cell_id"], row[name]) for row in seen]
        lines = arrays[f"{kind}Lines"].reshape(-1, 2, 3)
        origins = [[row[f"origin_{axis}"] for axis in "xyz"] for row in seen]
        ways = [[row[f"direction_{axis}"] for axis in "xyz"] for row in seen]
        assert np.allclose(lines[:, 0], origins, atol=1e-5) and np.allclose(lines[:, 1] - lines[:, 0], ways, atol=1e-5)
    starts, portals = arrays["sequenceStarts"], walk.portals["portal_id"].to_numpy()
    found = [portals[arrays["sequences"][a:b]].tolist() for a, b in pairwise(starts)]
    assert found == [row["portals"] for row in seen] and max(map(len, found)) > 2


def test_occluders_that_proofs_name(honest):
    """Trees name rectangles, leaves regions and patches."""
    bake, walk = honest
    head, arrays = read_script(reasons(bake, walk))
    assert head == {"certified": True}
    tables = {name: pq.read_table(bake.folder / f"{name}.parquet") for name in ("proofs", "blockers", "occluders")}
    assert len(arrays["proofCells"]) == tables["proofs"].num_rows == len(arrays["proofStarts"]) - 1
    count = tables["blockers"].num_rows + tables["occluders"].num_rows
    assert len(arrays["blockerStarts"]) == count + 1 and sorted(set(arrays["proofBlockers"])) == list(range(count))
    corners = arrays["blockerCorners"].reshape(-1, 4, 3)
    # All of them are faces of what hides, or lie in it: none is a point.
    sizes = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert (sizes > 1e-6).all()
    assert tables["blockers"].num_rows and "patch" in tables["occluders"]["kind"].to_pylist()


def test_a_curtain_stands_over_its_segment():
    row = {"coordinate": 5.0, "min_u": 1.0, "min_v": 2.0, "max_u": 3.0, "max_v": 4.0, "top": 6.0}
    assert rectangle(row | {"axis": 3}) == [1, 2, 5, 3, 4, 5, 3, 4, 6, 1, 2, 6]
    assert rectangle(row | {"axis": 4}) == [1, 4, 5, 3, 2, 5, 3, 2, 6, 1, 4, 6]
    assert rectangle(row | {"axis": 1}) == [1, 5, 2, 3, 5, 2, 3, 5, 4, 1, 5, 4]


@pytest.mark.parametrize("what", ["there", "elsewhere", "changed"])
def test_a_database_is_asked_for_its_bake(honest, tmp_path, built, what):
    bake, walk = tmp_path / "a.bake", tmp_path / "a.walk"
    shutil.copytree(honest[0].folder, bake)
    pack(bake, walk)
    if what == "elsewhere":
        shutil.move(bake, tmp_path / "b.bake")
    if what == "changed":
        table = pq.read_table(bake / "cells.parquet")
        pq.write_table(table, bake / "cells.parquet", compression="none")
    page = view(walk, tmp_path / "v").page
    head, arrays = read_script((page.parent / "why.js").read_text())
    assert head["certified"] is (True if what == "there" else None) and bool(arrays) == (what == "there")
    assert read_walk(walk).objects.num_rows


def test_vectors_of_the_page_are_those_of_the_check():
    """page/clearance.test.mjs expects the same numbers."""
    for case in json.loads(VECTORS.read_text()):
        lines = np.array(case["line"], float).reshape(2, 3)
        triangle = np.array(case["triangle"], float).reshape(1, 3, 3)
        found, _ = clearances(lines[:1], lines[1:], np.array([-1]), triangle, np.array([0]))
        assert found[0, 0] == pytest.approx(case["distance"], abs=1e-9)
