"""What pictures and pages share."""

import re

import pytest
from builders.places import ROOT
from jinja2 import UndefinedError
from viewcell.workbench.pages import COLOURS, fill, html_page, pareto_front


def test_pictures_and_the_page_have_the_same_colours():
    script = (ROOT / "workbench/report/page/charts.mjs").read_text(encoding="utf-8")
    series = re.search(r"const SERIES = \[(.*?)\]", script)[1]
    assert tuple(re.findall(r'"(#\w+)"', series)) == COLOURS


def test_a_page_escapes_text_and_has_the_style_of_all():
    made = html_page("a < b", b"\x00\x01", ["<i>"], [["1 & 2"]], ["one", "two\nlines <b>", ""], lead="<u>")
    assert "<h1>a &lt; b</h1>" in made and "<th>&lt;i&gt;</th>" in made and "<td>1 &amp; 2</td>" in made
    assert "<p>one</p>" in made and "<pre>two\nlines &lt;b&gt;</pre>" in made and "<p>&lt;u&gt;</p>" in made
    assert made.count("<p>") == 2 and "base64,AAE=" in made
    assert (ROOT / "workbench/templates/base.css").read_text(encoding="utf-8") in made
    assert "<p>" not in html_page("a", b"", ["x"], [], [""])


def test_a_template_without_a_part_is_a_fault_of_ours(tmp_path):
    (tmp_path / "a.html").write_text("{{ nothing }}")
    with pytest.raises(UndefinedError):
        fill(tmp_path, "a.html")


def test_the_front_has_what_no_other_beats():
    points = [(1.0, 3.0), (2.0, 2.0), (2.5, 2.0), (3.0, 1.0), (1.0, 4.0)]
    assert pareto_front(points, lambda p: p) == [(1.0, 3.0), (2.0, 2.0), (3.0, 1.0)]
