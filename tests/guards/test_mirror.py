"""A test stands where the file stands that it tests, and bears its name, or that of the folder as a whole."""

import pytest
from builders.places import ROOT

FLOORS = ("data", "kernels", "solvers", "verify", "workbench")
# What no single file answers for.
ELSE = {
    "kernels/test_cuda_compile.py": "every kernel at once",
    "workbench/test_bad_input.py": "every command at once",
    "workbench/bake/test_levels.py": "levels of detail through a whole bake",
    "workbench/report/test_in_browser.py": "the page as a person uses it",
    "workbench/report/test_page_modules.py": "runs the modules' own tests in Node",
    "workbench/view/test_depth.py": "depth meshes in the view's folder and in its page",
    "workbench/view/test_in_browser.py": "the view as a person uses it",
    "workbench/view/test_page_modules.py": "runs the modules' own tests in Node",
}
TESTS = [
    path.relative_to(ROOT / "tests") for floor in FLOORS for path in sorted((ROOT / "tests" / floor).rglob("test_*.py"))
]


@pytest.mark.parametrize("path", TESTS, ids=str)
def test_tests_mirror_files(path):
    stem = path.stem.removeprefix("test_")
    assert (ROOT / path.parent / f"{stem}.py").exists() or stem == path.parent.name or str(path) in ELSE


def test_exceptions_are_needed():
    assert set(ELSE) <= set(map(str, TESTS))
