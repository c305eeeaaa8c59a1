"""The page's modules: their own tests, which Node runs, and that they are the same joined as apart."""

import re
from pathlib import Path

import pytest
from builders.node import run_module_tests, run_node
from builders.places import ROOT
from viewcell.workbench.report.modules import DECLARED, IMPORT, join_modules

PAGE = ROOT / "workbench" / "report" / "page"
MODULES = {path.name: path.read_text(encoding="utf-8") for path in sorted(PAGE.glob("*.mjs"))}
TESTS = sorted((Path(__file__).parent / "page").glob("*.test.mjs"))


@pytest.mark.parametrize("file", TESTS, ids=lambda path: path.name.partition(".")[0])
def test_a_module_does_what_its_tests_say(file):
    run_module_tests(file)


def test_every_module_is_in_the_page():
    script = join_modules(PAGE, "main.mjs")
    assert len(TESTS) > 5 and len(MODULES) > 5
    for name, text in MODULES.items():
        assert text.partition("\n")[0] in script, name


def test_the_page_is_a_script_in_which_no_name_is_declared_twice(tmp_path):
    """Node reads it as one block, where even functions may not have one name; the joiner sees top-level names only."""
    block = join_modules(PAGE, "main.mjs").replace("(() => {", "{", 1).removesuffix("})();\n") + "}\n"
    for text, code in ((block, 0), (block[:-2] + "function count() {}\n}\n", 1)):
        (tmp_path / "page.cjs").write_text(text, encoding="utf-8")
        assert run_node("--check", str(tmp_path / "page.cjs")).returncode == code


def test_modules_import_what_they_use_of_each_other_and_no_more():
    """Joined, a forgotten import would not show. Words other than that use should differ from exported names."""
    owners = {name: module for module, text in MODULES.items() for export, name in DECLARED.findall(text) if export}
    assert len(owners) > 50
    for module, text in MODULES.items():
        imported = {name.strip() for names, _ in IMPORT.findall(text) for name in names.split(",")} - {""}
        plain = re.sub(r"//.*|/\*.*?\*/|\"[^\"\n]*\"", "", IMPORT.sub("", text))
        # A name after a dot or before a colon is a property's, a dollar before a brace a template's.
        words = re.findall(r"(?<![.#$\w-])(?:\$(?![{\w])|\w+(?![$\w:]))", plain)
        assert {word for word in words if owners.get(word, module) != module} == imported, module
