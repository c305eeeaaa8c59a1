"""Every command and every block of Python in the README and the guides runs, and prints what the page says."""

import re
import shutil

import pyarrow as pa
import pyarrow.csv
import pytest
import viewcell
from builders.lobby_house import lobby_house
from builders.pages import blocks, follow
from builders.places import ROOT

README = ROOT / "README.md"
PAGES = [README, *sorted((ROOT / "docs/guides").glob("*.md")), ROOT / "docs/bim.md", ROOT / "docs/tune-file.md"]
# Whose joins are compared with plain loops over the tables, too.
ELSEWHERE = {"docs/bim.md": "tests/workbench/bake/test_bake.py"}
# What they leave behind, beside what they found.
LEFT = {
    "docs/guides/export.md": {"house.glb", "house.json", "house.bits", "viewcell_bits.h", "house.tiles", "house.prt"},
    "docs/guides/tune.md": {"house.tune", "house.bake", "house.bake.tune", "bench.json"},
}
SLOW = ("docs/guides/tune.md", "docs/guides/hard-cases.md")
# Commands that no test runs from a page: CI does, and tests of the view, where its script is built.
OMITTED = 1, "chest of Office"
NOT_RUN = {"make install", "make run", "viewcell view house.bake"}
KINDS = {"console", "python", "text", "c", "sh"}


def short(page):
    return page.relative_to(ROOT).as_posix()


def marked(page):
    return pytest.param(page, id=short(page), marks=[pytest.mark.slow] if short(page) in SLOW else [])


@pytest.fixture(scope="module")
def house(tmp_path_factory):
    """What a reader has: house.ifc, a bake of it, boxes in its rooms, and a PVS that lacks the office's own chest."""
    folder = tmp_path_factory.mktemp("house")
    lobby_house(folder / "house.ifc")
    bake = viewcell.bake(folder / "house.ifc", folder / "house.bake")
    cells, names = range(4), [placed.name for placed in bake.scene.objects]
    rooms = {"min_x": [4.2 * n + 0.5 for n in cells], "max_x": [4.2 * n + 3.5 for n in cells]}
    rooms |= {"min_y": [0.5] * 4, "max_y": [3.5] * 4, "min_z": [1.2] * 4, "max_z": [1.8] * 4}
    pyarrow.csv.write_csv(pa.table(rooms), folder / "boxes.csv")
    pairs = [(cell, number) for cell in cells for number, name in enumerate(names) if (cell, name) != OMITTED]
    claims = dict(zip(("cell_id", "object_id"), zip(*pairs, strict=True), strict=True))
    pyarrow.csv.write_csv(pa.table({name: list(ids) for name, ids in claims.items()}), folder / "pvs.csv")
    return folder


@pytest.mark.parametrize("page", [marked(page) for page in PAGES if short(page) not in ELSEWHERE])
def test_pages_do_what_they_say(page, house, tmp_path, monkeypatch):
    makes_bake = any("house.ifc -o house.bake" in text for text in blocks(page, "console"))
    for name in ("house.ifc", "boxes.csv", "pvs.csv"):
        shutil.copy(house / name, tmp_path / name)
    if not makes_bake:
        shutil.copytree(house / "house.bake", tmp_path / "house.bake")
    before = {path.name for path in tmp_path.iterdir()}
    monkeypatch.chdir(tmp_path)
    follow(page)
    assert {path.name for path in tmp_path.iterdir()} - before >= LEFT.get(short(page), set())


@pytest.mark.parametrize("page", PAGES, ids=short)
def test_pages_have_no_commands_that_nobody_runs(page):
    text = page.read_text(encoding="utf-8")
    assert {kind for kind, _ in blocks(page)} <= KINDS
    said = [line.partition("#")[0].strip() for block in blocks(page, "sh") for line in block.splitlines()]
    assert set(said) <= NOT_RUN
    outside = re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)
    assert not re.findall(r"^ {4,}(?:\$ )?(?:viewcell|python|pytest|pip|make) .*", outside, re.MULTILINE)
    told = "\n".join(blocks(page, "text"))
    assert not re.findall(r"^\s*(?:\$ )?(?:viewcell|python|pytest|pip|make) ", told, re.MULTILINE)


def test_pages_that_others_run_are_run_there():
    for page, test in ELSEWHERE.items():
        assert f'follow(ROOT / "{page}")' in (ROOT / test).read_text(encoding="utf-8")


def test_a_stranger_sees_the_readme_at_once():
    lines = README.read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 120
