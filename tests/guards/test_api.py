"""docs/api.md lists what is public, and `__all__` of each module says the same."""

import ast
import re
from importlib import import_module

import pytest
from builders.places import ROOT

PAGE = (ROOT / "docs/api.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| `(viewcell[\w.]*)` \| (.*?) \|", PAGE, re.MULTILINE)
FLOORS = ("data", "kernels", "solvers", "verify", "workbench")


def test_every_module_that_says_what_is_public_is_listed():
    paths = [path for floor in FLOORS for path in (ROOT / floor).rglob("*.py")]
    found = [path.relative_to(ROOT) for path in paths if "\n__all__ = " in path.read_text(encoding="utf-8")]
    assert {".".join(("viewcell", *path.with_suffix("").parts)) for path in found} == {name for name, _ in ROWS[1:]}


@pytest.mark.parametrize(("module", "names"), ROWS, ids=[name for name, _ in ROWS])
def test_all_agrees_with_the_list(module, names):
    public = import_module(module)
    assert sorted(re.findall(r"`(\w+)`", names)) == sorted(public.__all__)
    assert all(hasattr(public, name) for name in public.__all__)


def test_type_checkers_see_the_names_that_are_imported_late():
    """What stands under TYPE_CHECKING is what `__getattr__` imports, from the same modules."""
    import viewcell

    tree = ast.parse((ROOT / "__init__.py").read_text(encoding="utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    seen = {name.name: f"viewcell.{node.module}" for node in block.body for name in node.names}
    assert seen == viewcell._HOME and set(seen) == set(viewcell.__all__)
    assert (ROOT / "py.typed").exists()
