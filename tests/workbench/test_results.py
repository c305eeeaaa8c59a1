"""What commands say for programs: one head, names as documented, and the same answers as for people."""

import json
import re

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import viewcell
from builders.places import ROOT
from builders.random_buildings import two_solids
from viewcell.data.store.scene_folder import write_scene
from viewcell.verify.check_result import CheckResult
from viewcell.verify.findings import VerifyResult
from viewcell.workbench.baked import load
from viewcell.workbench.cli import main
from viewcell.workbench.results import as_json

PAGE = (ROOT / "docs/json.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("json")
    write_scene(two_solids(), folder / "a.scene")
    assert main(["bake", str(folder / "a.scene"), "-o", str(folder / "a.bake"), "--certify"]) == 0
    return folder


def told(capsys, *arguments):
    code = main([*map(str, arguments), "--json"])
    head = json.loads(capsys.readouterr().out)
    assert head["schema"] == 1 and head["command"] == arguments[0]
    assert (head["exit_code"], head["ok"]) == (code, code == 0) and ("error" in head) != ("result" in head)
    assert all(f"`{name}`" in PAGE for name in head)
    if "result" in head:
        section = re.search(rf"\*\*{arguments[0]}\*\*:(.*?)(?=\n\n|\Z)", PAGE, re.DOTALL)[1]
        assert all(f"`{name}`" in section for name in head["result"]), arguments[0]
    return head


def test_bake_says_where_it_is_and_what_it_holds(folder, capsys):
    made = load(folder / "a.bake")
    found = told(capsys, "bake", folder / "a.scene", "-o", folder / "a.bake", "--certify")["result"]
    assert found["folder"] == str(folder / "a.bake") and found["written"] is False
    objects = found["pairs"][-1]
    assert objects["targets"] == "objects" and objects["potential"] == made.potential_objects.sum()
    assert objects["unknown"] == objects["potential"] - objects["seen"]
    assert found["counts"] == made.manifest["counts"]
    assert told(capsys, "bake", folder / "a.scene", "-o", folder / "b.bake")["result"]["written"] is True


def test_verify_and_check_say_what_they_found(folder, capsys):
    found = told(capsys, "verify", folder / "a.bake", "--rays", 2000)["result"]
    made = load(folder / "a.bake")
    assert found["wrong_hidden"] == 0 and found["case"] is None and found["rays"] >= 2000
    assert found["witnesses"]["objects"]["confirmed"] == found["pairs"][-1]["seen"]
    assert found["certificates"]["failed"] == 0
    rows = made.cell_to_object
    cell, target = next((r["cell_id"], r["object_id"]) for r in rows.to_pylist() if r["verdict"] == "visible")
    lost = (rows["cell_id"].to_numpy() == cell) & (rows["object_id"].to_numpy() == target)
    pq.write_table(rows.filter(pa.array(~lost)), folder / "cut.parquet")
    asked = folder / "a.scene", "--pvs", folder / "cut.parquet", "--cells", folder / "a.bake", "--rays", 20_000
    head = told(capsys, "check", *asked)
    (wrong,) = head["result"]["wrong_hidden"]
    assert not head["ok"] and (wrong["cell_id"], wrong["target_id"], wrong["kind"]) == (cell, target, "object")
    box = made.in_model(made.graph.cells[cell] * made.grid_m)
    assert (box[0] <= wrong["from"]).all() and (wrong["from"] <= box[1]).all()
    assert head["result"]["targets"]["object"]["wrong_hidden"] == 1


def test_inspect_and_report_say_what_they_found(folder, capsys):
    assert told(capsys, "inspect", folder / "a.scene", "--no-estimate")["result"]["triangles"] == 24
    paths = told(capsys, "report", folder / "a.bake", "-o", folder / "page")["result"]
    assert all((folder / "page" / path).exists() for path in paths.values())


def test_results_fit_on_a_line_that_says_what_matters(folder):
    """As a notebook or a debugger shows them."""
    made, none = load(folder / "a.bake"), np.zeros((2, 2), bool)
    cut = made.potential_objects.copy()
    cut[tuple(np.argwhere(cut)[0])] = False
    judged, seen = made.verify(rays=1000), viewcell.inspect(made.scene, estimate=False)
    checked = viewcell.check(made.scene, cut, made, rays=20_000, targets="objects")
    for result, words in (
        (judged, ("ok", "0 wrong-hidden", "0 refuted witnesses", f"{judged.rays:,} rays")),
        (VerifyResult(wrong_hidden=1, pair="cell 1 sees cell 2"), ("failed", "1 wrong-hidden (cell 1 sees cell 2)")),
        (checked, ("failed", "1 wrong-hidden object from 1 view cell")),
        (CheckResult(np.arange(2), np.arange(2), [], {"cell": none}, {"cell": none}), ("ok", "0 wrong-hidden cells")),
        (seen, ("fit to bake", f"{len(seen.warnings)} warning")),
    ):
        text = repr(result)
        assert "\n" not in text and len(text) < 200 and all(word in text for word in words), text


def test_what_fails_says_so_in_the_same_words(folder, capsys):
    code = main(["verify", str(folder / "nothing"), "--json"])
    printed = capsys.readouterr()
    assert code == 2 and printed.err == f"viewcell: {json.loads(printed.out)['error']}\n"


def test_numbers_that_are_none_are_null():
    found = json.loads(as_json("bake", 0, {"a": np.float64("nan"), "b": [float("inf"), np.int32(3)], "c": (1.5, "x")}))
    assert found["result"] == {"a": None, "b": [None, 3], "c": [1.5, "x"]}
