"""The HTML page of a bake: what it holds is the bake, and it loads nothing."""

import base64
import gzip
import json
import re
import tomllib
from dataclasses import replace
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
import pytest
from builders import small_house
from builders.places import ROOT
from builders.seen_house import CURVES, GRID, views_only, with_rooms
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.errors import InputError
from viewcell.workbench.cli import main
from viewcell.workbench.curves.series import Curves, read_curves
from viewcell.workbench.report import web_page as report_page
from viewcell.workbench.report.run import report
from viewcell.workbench.report.web_page import join_segments, pack, page, table_rows

TABLES = {"cellRows": ("cell_to_cell", "reached_cell_id"), "objectRows": ("cell_to_object", "object_id")}


def content(text):
    """The page's JSON, arrays unpacked."""
    (found,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    return unpacked(json.loads(found))


def unpacked(node):
    if isinstance(node, list):
        return [unpacked(one) for one in node]
    if not isinstance(node, dict):
        return node
    if "gzip" not in node:
        return {name: unpacked(one) for name, one in node.items()}
    plain = gzip.decompress(base64.b64decode(node["gzip"]))
    if node["dtype"] == "json":
        return json.loads(plain)
    return np.frombuffer(plain, np.dtype(node["dtype"]).newbyteorder("<")).reshape(node["shape"]).astype(np.int64)


def sets_of(rows):
    """Verdict by (source, target), as the page has it."""
    found = {}
    for cell, (first, last) in enumerate(zip(rows["starts"][:-1], rows["starts"][1:], strict=True)):
        for row, target in zip(range(first, last), np.cumsum(rows["gaps"][first:last]), strict=True):
            assert (cell, int(target)) not in found
            found[cell, int(target)] = ("unknown", "visible", "visible")[rows["codes"][row]]
    return found


@pytest.mark.parametrize("views", [False, True])
def test_the_page_holds_exactly_the_sets_of_the_bake(house, tmp_path, views):
    made = views_only(tmp_path) if views else house
    found = content(page(made, "house"))
    for name, (table, column) in TABLES.items():
        rows = getattr(made, table).to_pylist()
        wanted = {(row["cell_id"], row[column]): row["verdict"] for row in rows}
        assert sets_of(found[name]) == wanted
        assert views or {"visible", "unknown"} == set(wanted.values()) or name == "objectRows"
    assert (found["cells"]["boxes"] == made.graph.cells).all() and (
        found["portals"]["boxes"] == made.graph.portals
    ).all()
    assert (found["portals"]["cells"] == made.graph.portal_cells).all()
    assert found["cells"]["inhabitable"].tolist() == made.graph.inhabitable.tolist()
    assert (found["objects"]["boxes"] == made.scene.object_bounds()).all()
    assert found["objects"]["names"] == [o.name for o in made.scene.objects]
    assert found["facts"]["claimsCells"] is not views


def test_sightlines_are_the_witnesses_to_half_a_unit(house):
    found = content(page(house, "house"))
    for name, (table, column) in TABLES.items():
        rows = sorted(getattr(house, table).to_pylist(), key=lambda row: (row["cell_id"], row[column]))
        rows = [row for row in rows if row["verdict"] == "visible" and row["origin_x"] is not None]
        packed = found[name]
        assert packed["lines"].min() == 0 and packed["lines"].max(axis=(0, 1)).max() == 65535
        ends = np.array(packed["low"]) + np.array(packed["unit"]) * packed["lines"]
        origin, way = (
            np.array([[row[f"{end}_{k}"] for k in "xyz"] for row in rows]) for end in ("origin", "direction")
        )
        wanted = np.stack([origin, origin + way], axis=1) / GRID
        assert (np.abs(ends - wanted) <= 0.51 * np.array(packed["unit"])).all()
        if "portals" in rows[0]:
            assert packed["portals"].tolist() == [p for row in rows for p in row["portals"] or []]
            assert packed["crossings"].tolist() == [len(row["portals"] or []) for row in rows]


def test_a_page_too_large_keeps_all_verdicts_and_the_largest_sightlines(house, monkeypatch):
    everything = table_rows(house, "object")
    count = int((everything.codes == 1).sum())
    monkeypatch.setattr(report_page, "SIGHTLINES_MOST", count // 2)
    fewer = table_rows(house, "object")
    assert (fewer.targets == everything.targets).all() and (fewer.codes > 0).tolist() == (everything.codes > 0).tolist()
    assert (fewer.codes == 1).sum() == len(fewer.lines) == count // 2
    size = np.linalg.norm(np.ptp(house.scene.object_bounds().astype(float), axis=1), axis=1)
    for first, last in zip(fewer.starts[:-1], fewer.starts[1:], strict=True):
        kept, left = ((fewer.codes[first:last] == code) for code in (1, 2))
        assert last == first or kept.any()
        if kept.any() and left.any():
            own = size[fewer.targets[first:last]]
            assert own[kept].min() >= own[left].max()
    monkeypatch.setattr(report_page, "CROSSINGS_MOST", 3)
    cells = table_rows(house, "cell")
    assert cells.crossings.sum() == len(cells.portals) <= 3 and (cells.codes == 2).any()


def test_the_page_holds_the_rooms_and_their_view_cells(house):
    assert content(page(house, "house"))["rooms"]["words"] == []
    house.scene.objects[3] = replace(house.scene.objects[3], guid="2O2Fr$t4X7Zf8NOew3FLKr")
    found = content(page(with_rooms(house), "house"))
    hall, suite = found["rooms"]["words"]
    assert hall == {
        **{"name": "1", "longName": "Hall", "guid": "0BTBFw6f90Nfh9rP1dlXrr", "storey": "Ground"},
        **{"elevation": -0.5, "covered": 1.0},
    }
    assert (suite["name"], suite["longName"], suite["guid"]) == ("suite", "", "")
    assert found["rooms"]["starts"].tolist() == [0, 1, 3] and found["rooms"]["cells"].tolist() == [0, 2, 4]
    assert found["objects"]["guids"][2:4] == ["", "2O2Fr$t4X7Zf8NOew3FLKr"]


def test_the_page_loads_nothing(house):
    text = page(house, "house", Curves.of_content(CURVES))
    assert text.startswith("<!DOCTYPE html>") and '<html lang="en">' in text and "<title>house" in text
    assert "default-src 'none'" in text
    assert not re.search(
        r"""\b(?:src|srcset|action|data-src)\s*=|@import|url\(|\bimport\s*\(|XMLHttpRequest|\bfetch\(""", text
    )
    assert {h for h in re.findall(r'href="([^"]*)"', text) if not h.startswith("#")} == {"data:,"}
    assert set(re.findall(r"(?:https?:)?//[\w.]+\.[a-z]{2,}[\w./]*", text)) == {"http://www.w3.org/2000/svg"}


def test_names_cannot_leave_the_data(house):
    name = "</script><script>alert(1)</script><!-- {{data}} {{script}}"
    house.scene.objects[0] = replace(house.scene.objects[0], name=name)
    house.graph.cell_names = np.array([name] * house.graph.cell_count)
    house.manifest["source"] = name
    text = page(house, name)
    assert text.count("<script") == text.count("</script>") == 2 and "<!--" not in text.partition("<body>")[2]
    found = content(text)
    assert found["objects"]["names"][0] == found["cells"]["names"][3] == found["title"] == name
    assert found["facts"]["source"] == name


OWNER, NEAR = st.integers(0, 1), st.integers(0, 6)
LEVEL = st.tuples(OWNER, NEAR, st.integers(0, 1), NEAR).map(lambda s: (s[0], s[1], s[2], s[3], s[2]))
UPRIGHT = LEVEL.map(lambda s: (s[0], s[2], s[1], s[4], s[3]))
ANY = st.tuples(OWNER, NEAR, NEAR, NEAR, NEAR)


@given(st.lists(LEVEL | UPRIGHT | ANY, max_size=12))
def test_joined_segments_cover_the_same(segments):
    """Axial segments of an owner cover the same unit intervals once; the others are kept once, points are dropped."""
    rows = np.array(segments, np.int64).reshape(-1, 5)
    lines, owners = join_segments(rows[:, 1:].reshape(-1, 2, 2) * 8.0, rows[:, 0], 8)
    cover, slanted, got_slanted, got = set(), set(), [], []
    for owner, x, y, u, v in rows.tolist():
        (x, y), (u, v) = sorted([(x, y), (u, v)])
        if x == u or y == v:
            cover |= {(owner, x, t, "y") for t in range(y, v)} if x == u else {(owner, y, t, "x") for t in range(x, u)}
        else:
            slanted.add((owner, x, y, u, v))
    for owner, (x, y, u, v) in zip(owners.tolist(), lines.tolist(), strict=True):
        if x == u or y == v:
            assert (x, y) != (u, v)
            got += [(owner, x, t, "y") for t in range(y, v)] if x == u else [(owner, y, t, "x") for t in range(x, u)]
        else:
            got_slanted.append((owner, x, y, u, v))
    assert sorted(got) == sorted(cover) and sorted(got_slanted) == sorted(slanted)


@given(st.lists(st.integers(-(2**31), 2**31 - 1), max_size=8))
def test_packed_arrays_come_back(values):
    for array in (np.array(values, np.int64), np.abs(np.array(values, np.int64))):
        assert unpacked(pack(array)).tolist() == array.tolist()


def test_plans_are_cut_and_coarser_where_there_is_too_much(house, monkeypatch):
    storeys = content(page(house, "house"))["storeys"]
    assert [(s["floor"], s["step"]) for s in storeys] == [(0, 8)] and storeys[0]["level"] == int(1.2 / GRID) + 0.5
    # The desk (object 17) is lower than the cut; outer walls end at 132 and 88 sixteenths of a metre.
    assert 17 not in storeys[0]["owners"]
    drawn = storeys[0]["lines"].reshape(-1, 2) * 8
    assert drawn.min(axis=0).tolist() == [-4 * 64, -4 * 64] and drawn.max(axis=0).tolist() == [132 * 64, 88 * 64]
    assert len(storeys[0]["lines"]) > 8
    monkeypatch.setattr(report_page, "SEGMENTS_MOST", len(storeys[0]["lines"]) - 1)
    (coarse,) = content(page(house, "house"))["storeys"]
    assert 8 < coarse["step"] <= 1024 and 0 < len(coarse["lines"]) < len(storeys[0]["lines"])


def test_a_bare_graph_and_an_empty_one_have_pages(tmp_path):
    made = small_house.small_house(tmp_path, bare=True)
    found = content(page(made, "graph"))
    assert found["objects"]["names"] == [] and len(found["storeys"][0]["lines"]) == 0
    made.graph.inhabitable[:] = False
    made.cell_to_cell, made.cell_to_object = made.cell_to_cell.slice(0, 0), made.cell_to_object.slice(0, 0)
    assert content(page(made, "graph"))["storeys"] == []


def test_the_command_writes_the_page(house, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("viewcell.workbench.baked.load", lambda folder: house)
    out = tmp_path / "report"
    assert main(["report", "x", "--cells", "0", "--out", str(out)]) == 0
    assert capsys.readouterr().out.splitlines() == [str(out / "report.md"), str(out / "report.html")]
    assert content((out / "report.html").read_text(encoding="utf-8"))["curves"] is None
    # Curves in the folder are shown; those that are named go before them.
    (out / "curves.json").write_text(json.dumps(CURVES))
    assert main(["report", "x", "--cells", "0", "--out", str(out)]) == 0
    shown = content((out / "report.html").read_text(encoding="utf-8"))["curves"]
    front = [point.pop("front") for one in shown["series"] for point in one["points"]]
    assert shown.pop("pairs") == 0 and shown == CURVES and front == [True, False, True, False, False, False]
    (tmp_path / "mine.json").write_text(json.dumps(CURVES | {"scene": "mine"}))
    assert main(["report", "x", "--cells", "0", "--out", str(out), "--curves", str(tmp_path / "mine.json")]) == 0
    assert content((out / "report.html").read_text(encoding="utf-8"))["curves"]["scene"] == "mine"


def broken(*path):
    curves = json.loads(json.dumps(CURVES))
    node = curves
    for key in path[:-1]:
        node = node[key]
    del node[path[-1]]
    return json.dumps(curves)


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        "{}",
        '"x"',
        broken("series", 0, "knob"),
        broken("series", 0, "points", 0, "error"),
        json.dumps(CURVES).replace("1.25", '"x"'),
        json.dumps(CURVES | {"series": 3}),
    ],
)
def test_curves_that_are_none_are_one_line(house, tmp_path, text):
    file = tmp_path / "c.json"
    file.write_text(text)
    with pytest.raises(InputError, match=r"c\.json: expected a scene and series of points, found \w+$"):
        report(house, out=tmp_path / "r", curves=file)
    assert not (tmp_path / "r").exists()
    with pytest.raises(InputError, match=r"none\.json: expected curves, found No such file"):
        read_curves(tmp_path / "none.json")


def test_unknown_numbers_of_curves_are_null(tmp_path):
    (tmp_path / "c.json").write_text(json.dumps(CURVES).replace("1.25", "NaN"))
    assert read_curves(tmp_path / "c.json").content()["series"][0]["points"][0]["error"] is None


def test_a_failure_leaves_nothing_half_written(house, tmp_path, monkeypatch):
    report(house, out=tmp_path / "r")
    before = {path.name: path.read_bytes() for path in (tmp_path / "r").iterdir()}

    def full(self, *_args, **_keys):
        raise OSError(28, "No space left on device", str(self))

    write = Path.write_text
    monkeypatch.setattr(Path, "write_text", lambda s, *a, **k: (full if s.suffix == ".html" else write)(s, *a, **k))
    with pytest.raises(InputError, match=r"found No space left on device$"):
        report(house, cells=[0], out=tmp_path / "r")
    assert {path.name: path.read_bytes() for path in (tmp_path / "r").iterdir()} == before


def test_the_page_is_package_data():
    """Everything that the page is made of goes into the wheel."""
    globs = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"][
        "viewcell.workbench.report"
    ]
    parts = sorted(f"page/{path.name}" for path in (ROOT / "workbench" / "report" / "page").iterdir())
    modules = [part for part in parts if part.endswith(".mjs")]
    assert "page/main.mjs" in modules and parts == sorted(["page/report.css", "page/report.html", *modules])
    assert all(any(fnmatch(part, glob) for glob in globs) for part in parts)
