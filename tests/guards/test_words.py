"""Files that texts name exist, and every term has one entry in the glossary."""

import re
from collections import Counter

import pytest
from builders.places import ROOT

FLOORS = ("data", "kernels", "solvers", "verify", "workbench", "docs")
NAMED = re.compile(r"(?<![\w/.])((?:data|kernels|solvers|verify|workbench|docs|tests)/[\w/]+\.(?:py|txt|md|mjs))\b")
PATTERNS = [f"{floor}/**/*.{kind}" for floor in FLOORS for kind in ("py", "md", "txt", "mjs")]
TEXTS = [path for pattern in ("README.md", "CONTRIBUTING.md", *PATTERNS) for path in sorted(ROOT.glob(pattern))]


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_files_that_are_named_exist(path):
    named = NAMED.findall(path.read_text(encoding="utf-8"))
    assert [name for name in named if not (ROOT / name).exists()] == []


def test_the_glossary_gives_each_term_one_meaning():
    entries = re.findall(r"^- (.*)$", (ROOT / "docs/glossary.md").read_text(encoding="utf-8"), re.MULTILINE)
    # A term stands in bold before a colon; an entry may explain its opposite after a semicolon or full stop.
    terms = [term for entry in entries for term in re.findall(r"\*\*([^*]+)\*\*(?=[^*.;]*:)", entry)]
    assert [term for term, count in Counter(terms).items() if count > 1] == []
    assert len(terms) > 80
