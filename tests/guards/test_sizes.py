"""No function and no file too long to be read at once, and no crowd of arguments; exceptions have a reason."""

import ast

import pytest
from builders.places import ROOT

LINES, ARGUMENTS, FILE_LINES = 80, 12, 500
LONG_FILES = {
    "kernels/select.py": "one idea: the search for a multiplier, its certificate, and the steps that improve it"
}
FLOORS = ("data", "kernels", "solvers", "verify", "workbench")
FILES = [path for floor in FLOORS for kind in ("*.py", "*.mjs") for path in sorted((ROOT / floor).rglob(kind))]


def short(path):
    return str(path.relative_to(ROOT))


@pytest.mark.parametrize("path", FILES, ids=short)
def test_files_can_be_read_at_once(path):
    count = len(path.read_text(encoding="utf-8").splitlines())
    assert count <= FILE_LINES or short(path) in LONG_FILES, f"{count} lines"


def test_exceptions_are_needed():
    assert all(len((ROOT / name).read_text(encoding="utf-8").splitlines()) > FILE_LINES for name in LONG_FILES)


@pytest.mark.parametrize("path", [path for path in FILES if path.suffix == ".py"], ids=short)
def test_functions_can_be_read_at_once(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef):
            lines = node.end_lineno - node.lineno + 1
            arguments = (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)
            count = len([argument for argument in arguments if argument.arg not in ("self", "cls")])
            assert lines <= LINES, f"{node.name}: {lines} lines"
            assert count <= ARGUMENTS, f"{node.name}: {count} arguments"
