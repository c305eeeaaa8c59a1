"""Reports: what they say, and where the pictures put things."""

import re

import numpy as np
import pytest
from builders import small_house
from matplotlib.image import imread
from viewcell.data.errors import InputError
from viewcell.data.graph import CellGraph
from viewcell.workbench.report.plans import COLOURS, Painter, Section, _label, find_storeys, plan_of, section_lines
from viewcell.workbench.report.run import SIGHTLINES_MOST, choose_cells, model_name, report

GRID = 2.0**-10


@pytest.fixture
def house(tmp_path):
    return small_house.small_house(tmp_path)


def share_of(path, colour):
    """Share of the picture's pixels that have a colour."""
    picture = imread(path)[:, :, :3]
    wanted = np.array([int(COLOURS[colour][i : i + 2], 16) / 255 for i in (1, 3, 5)])
    return (np.abs(picture - wanted).max(axis=2) < 0.01).mean()


def floors(*rooms):
    """Graph of unconnected inhabitable rooms: (floor [m], side [m]) each."""
    cells = [[[9 * n, 0, floor], [9 * n + side, side, floor + 2.5]] for n, (floor, side) in enumerate(rooms)]
    count = len(rooms)
    nothing = np.zeros((0, 2), np.int32), np.zeros(0, np.int8), np.zeros((0, 2, 3), np.int32)
    names = np.full(count, "")
    return CellGraph((np.array(cells) / GRID).astype(np.int32), np.ones(count, bool), names, *nothing)


def test_report_of_the_house(house, tmp_path):
    path = report(house, out=tmp_path / "looks")
    text = path.read_text()
    assert path == tmp_path / "looks" / "report.md"
    assert "| cells, inhabitable | 14 | 14 | 1.000 | 0.00 % |" in text
    assert "| opaque triangles | 216 |" in text and "| flood | 0.10 |" in text
    assert "| walls exactly along an axis | 100.0 % |" in text and "| non-axial elements, clusters | 0, 0 |" in text
    assert '["walls exactly along an axis","100.0 %"]' in path.with_name("report.html").read_text()
    pictures = [line.partition("](")[2].rstrip(")") for line in text.splitlines() if line.startswith("![")]
    assert len(pictures) == 1 + len(choose_cells(house))
    assert sorted([*pictures, "report.html", "report.md"]) == sorted(p.name for p in path.parent.iterdir())


def test_what_a_bake_is_worth_stands_in_both_reports(house, tmp_path):
    """As the manifest says; a bake of an older version is measured."""
    eye = {"median": 2.5, "worst": 12.25, "worst_cell": 3, "cells": 4, "eyes": 64}
    house.manifest |= {"kept": {"objects": 0.625, "triangles": 0.5, "eye": eye}, "warnings": ["<it> leaks"]}
    text = report(house, out=tmp_path / "told").read_text()
    assert text.index("> **Warning:** <it> leaks.") < text.index("| model | |")
    assert "| objects, mean by volume | 62.5 % |" in text and "| kept / eye, worst (cell 3) | 12.25 |" in text
    page = (tmp_path / "told" / "report.html").read_text()
    assert '"kept / eye, worst (cell 3)","12.25"' in page and "\\u003cit> leaks" in page
    assert page.index('id="warnings"') < page.index('id="plan-section"')
    del house.manifest["kept"]
    shares = house.potential_objects[house.graph.inhabitable].mean(axis=1)
    text = report(house, out=tmp_path / "found").read_text()
    found = float(text.partition("| objects, mean by volume | ")[2].partition(" %")[0])
    assert 100 * shares.min() - 0.1 < found < 100 * shares.max() + 0.1 and "> **Warning:** <it> leaks." in text


def test_bare_graph_and_default_folder(tmp_path):
    path = report(small_house.small_house(tmp_path, bare=True), cells=[0])
    assert path == tmp_path / "house" / "report" / "report.md"
    assert "| objects | 0 |" in path.read_text()


def test_colours_follow_the_verdicts(house, tmp_path):
    report(house, cells=[0], out=tmp_path)
    assert share_of(tmp_path / "cell-0.png", "unknown") < 0.01
    before = share_of(tmp_path / "cell-0.png", "seen")
    assert before > 0.05 and share_of(tmp_path / "cell-0.png", "source") > 0.02
    rows = house.cell_to_cell.to_pylist()
    for row in rows:
        if row["cell_id"] == 0 and row["reached_cell_id"] == 4:
            row.update(verdict="unknown", origin_x=None)
    house.cell_to_cell = type(house.cell_to_cell).from_pylist(rows, schema=house.cell_to_cell.schema)
    report(house, cells=[0], out=tmp_path)
    assert share_of(tmp_path / "cell-0.png", "unknown") > 0.02
    assert share_of(tmp_path / "cell-0.png", "seen") < 0.8 * before


def test_sections_are_exact_outlines(house):
    """At a height of 1 m the desk (60 to 66, 32 to 38 sixteenths) is gone; at 0.25 m its outline is a square."""
    triangles, owners = house.scene.triangles()
    desk = triangles[owners == 17]
    assert len(section_lines(desk, Section(2, 1024.5))) == 0
    lines = section_lines(desk, Section(2, 256.5))
    assert len(lines) == 8
    assert np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1).sum() == pytest.approx(4 * 6 * 64)
    assert lines.min(axis=(0, 1)).tolist() == [60 * 64, 32 * 64] and lines.max(axis=(0, 1)).tolist() == [
        66 * 64,
        38 * 64,
    ]
    elevation = section_lines(desk, Section(0, 63 * 64 + 0.5))
    assert elevation.max(axis=(0, 1)).tolist() == [38 * 64, 8 * 64]


def test_storeys_are_grouped_by_area():
    """Stair steps between two floors make no storeys; a landing or a platform joins the storey below it."""
    graph = floors((0.0, 8), (0.2, 4), (0.9, 1), (1.8, 1), (2.7, 1), (3.0, 7), (3.1, 3), (-2.9, 5), (5.2, 1))
    storeys = find_storeys(graph, GRID)
    assert [s.floor * GRID for s in storeys] == pytest.approx([-2.9, 0.0, 3.0], abs=GRID)
    assert [s.cells.tolist() for s in storeys] == [[7], [0, 1, 2, 3], [4, 5, 6, 8]]
    assert plan_of(storeys[1], GRID).level * GRID == pytest.approx(1.2, abs=0.001)


def test_nothing_inhabitable_gives_a_report_without_pictures(house, tmp_path):
    house.graph.inhabitable[:] = False
    house.cell_to_cell, house.potential_cells[:], house.potential_objects[:] = (
        house.cell_to_cell.slice(0, 0),
        False,
        False,
    )
    house.cell_to_object = house.cell_to_object.slice(0, 0)
    path = report(house, out=tmp_path / "r")
    assert sorted(p.name for p in path.parent.iterdir()) == ["report.html", "report.md"]


def test_chosen_cells_tell_something(house):
    house.cell_to_cell = house.cell_to_cell.slice(3)
    chosen = choose_cells(house)
    assert "worst overestimate" in chosen[0]
    assert any("largest set" in why for why in chosen.values()) and any("median" in why for why in chosen.values())


@pytest.mark.parametrize("cell", [1, 7, -1])
def test_unknown_cell_is_one_line(house, tmp_path, cell):
    with pytest.raises(InputError, match=f"expected ids of inhabitable cells, found {cell}$"):
        report(house, cells=[cell], out=tmp_path / "r")
    assert not (tmp_path / "r").exists()


def test_unwritable_folder_is_one_line(house, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"expected a folder to write the report to, found [^\n]*$"):
        report(house, out=tmp_path / "file")


def test_painter_cuts_what_the_section_meets(house):
    painter = Painter(house.graph, house.scene, GRID)
    section = Section(2, 21 * 64 + 0.5)
    assert section.cuts(house.graph.cells).tolist() == [True, False, True, False, True, True, False]
    assert painter.graph is house.graph and section.across == (0, 1) and Section(1, 0.5).across == (0, 2)


@pytest.mark.parametrize(
    ("source", "name"),
    [
        ("make_office(floors=3, rooms_per_side=8, seed=0, furnished=True)", "Synthetic office, 3 floors"),
        ("make_office(like='soda-hall', seed=0)", "Synthetic office like soda-hall"),
        (
            "make_office(floors=1, seed=0, yaw_deg=17, wings=2, wing_angle_deg=30)",
            "Synthetic office, 1 floors, 2 wings",
        ),
        ("make_rotunda(sides=6, seed=0, furnished=True)", "Synthetic rotunda, 6 sides"),
        ("some/folder/house.ifc", "house.ifc"),
        ("", "house"),
    ],
)
def test_models_have_short_names(house, source, name):
    house.manifest["source"] = source
    assert model_name(house) == name


def test_labels_fit_their_cells():
    assert _label(128, "2.105 open", np.array([9.0, 3.0])) == "128\n2.105 open"
    assert _label(128, "2.105 open", np.array([5.0, 3.0])) == _label(128, "2.105 open", np.array([9.0, 2.0])) == "128"
    assert _label(128, "2.105 open", np.array([1.5, 9.0])) == _label(128, "", np.array([9.0, 1.0])) == ""


def test_the_caption_and_the_table_agree(house, tmp_path):
    """Cell 0 sees itself and all it ought to; a cell that loses its witness is unknown, by name."""
    text = report(house, cells=[0], out=tmp_path).read_text()
    known = int(house.potential_cells[0].sum())
    assert f"{known} cells seen, itself included, 0 unknown" in text and f"| {known} | {known} | 1.000 | 0 |" in text
    assert f"Of the sightlines {min(known - 1, SIGHTLINES_MOST['cell'])} are drawn" in text
    assert "\n| cell 4 |" not in text
    rows = house.cell_to_cell.to_pylist()
    for row in rows:
        if row["cell_id"] == 0 and row["reached_cell_id"] == 4:
            row.update(verdict="unknown", origin_x=None)
    house.cell_to_cell = type(house.cell_to_cell).from_pylist(rows, schema=house.cell_to_cell.schema)
    text = report(house, cells=[0], out=tmp_path).read_text()
    kind = "inhabitable" if house.graph.inhabitable[4] else "wall, sliver or exterior"
    assert f"{known - 1} cells seen, itself included, 1 unknown" in text and f"| cell 4 | {kind} cell |" in text


def test_a_report_leads_to_the_view_that_is_there(house, tmp_path):
    """Beside the bake; where there is none, the report says how to make one, and nothing leads nowhere."""
    text = report(house, out=tmp_path / "a").read_text()
    assert f"`viewcell view {house.folder.name}` walks through it in a browser." in text
    assert "Walk through it" not in (tmp_path / "a" / "report.html").read_text()
    there = house.folder.with_suffix(".view") / "index.html"
    there.parent.mkdir()
    there.write_text("")
    path = report(house, out=tmp_path / "b" / "deep")
    (address,) = re.findall(r"\[Walk through it\]\(<(.*)>\) in a browser", path.read_text())
    assert (path.parent / address).resolve() == there.resolve()
    assert f'<a href="{address}">Walk through it</a>' in path.with_name("report.html").read_text()
