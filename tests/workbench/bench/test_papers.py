"""A paper's tables, by itself and on a page."""

import pytest
from viewcell.workbench.bench import papers
from viewcell.workbench.bench.__main__ import main


def test_carving_leaves_fewer_portals(capsys):
    assert main(["papers", "--only", "carving"]) == 0
    said = capsys.readouterr().out
    rows = {row.split(" | ")[0].strip("| "): row.split(" | ")[1:] for row in said.splitlines() if row.startswith("| ")}
    portals, uncarved = int(rows["portals"][1]), int(rows["portals"][2].split()[0])
    assert portals < 0.5 * uncarved and rows["non-axial clusters"][:2] == ["8", "9"]
    assert "--only carving" in said


def test_the_page_has_every_paper(tmp_path, monkeypatch, capsys):
    line = papers.Line("polygons", "3", "4", "triangles")
    monkeypatch.setattr(papers, "PAPERS", {name: (name, lambda folder: {"Table 1": [line]}) for name in ("a", "b")})
    assert main(["papers", "--out", str(tmp_path / "papers.md")]) == 0 and "written" in capsys.readouterr().out
    text = (tmp_path / "papers.md").read_text()
    assert text.count("| polygons | 3 | 4 | triangles |") == 2 and "## a\n" in text and "{" not in text


def test_a_paper_that_is_none():
    with pytest.raises(SystemExit):
        main(["papers", "--only", "rtm"])
