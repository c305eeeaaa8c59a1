"""Links and anchors between the pages, and to files of the repository, lead somewhere."""

import json
import re
from functools import cache

import pytest
from builders.places import ROOT

PAGES = [
    *sorted(ROOT.glob("*.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "examples").glob("*.ipynb")),
]
LINK = re.compile(r"!?\[(?:[^\[\]]|\[[^\]]*\])*\]\(([^()\s]+)\)")
FENCE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)


def text_of(page):
    text = page.read_text(encoding="utf-8")
    if page.suffix == ".ipynb":
        text = "\n".join(
            "".join(cell["source"]) for cell in json.loads(text)["cells"] if cell["cell_type"] == "markdown"
        )
    return FENCE.sub("", text)


@cache
def anchors(page):
    """Of its headings, as GitHub makes them: the second of a name gets -1."""
    found: dict[str, int] = {}
    for title in re.findall(r"^#+ (.+?)\s*$", text_of(page), re.MULTILINE):
        name = re.sub(r"[^\w\- ]", "", re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", title).lower()).replace(" ", "-")
        count = found[name] = found.get(name, -1) + 1
        if count:
            found[f"{name}-{count}"] = 0
    return set(found)


def broken(page, root=ROOT):
    """(link, why) of those that lead nowhere."""
    for link in LINK.findall(text_of(page)):
        if re.match(r"https?://|mailto:", link):
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        if not target.is_relative_to(root) or not target.exists():
            yield link, "no such file"
        elif anchor and anchor not in anchors(target):
            yield link, "no such heading"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page):
    assert list(broken(page)) == []


def test_broken_links_are_found(tmp_path):
    (tmp_path / "b.md").write_text("# A `name`, twice\n\n# A name twice\n")
    page = tmp_path / "a.md"
    page.write_text(
        "# One\n[a](#one) [b](#two) [c](b.md#a-name-twice-1) [d](c.md) ![e `x`](b.md#no) [f](https://x.y)\n"
    )
    assert [link for link, _ in broken(page, tmp_path)] == ["#two", "c.md", "b.md#no"]


def test_all_pages_are_found():
    """Guards the guard: links are seen at all."""
    assert len(PAGES) > 35 and sum(len(LINK.findall(text_of(page))) for page in PAGES) > 100
