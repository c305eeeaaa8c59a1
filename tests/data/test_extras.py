"""What is said where a package of an extra is missing."""

import ast
import re
import sys
import tomllib

import pytest
from builders.places import ROOT
from viewcell.data.errors import InputError
from viewcell.data.extras import EXTRAS, missing, need
from viewcell.workbench.cli import main


def test_every_package_is_in_its_extra():
    """And `all` has every extra but those of developers."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    for package, extra in EXTRAS.items():
        assert any(line.lower().startswith(package.lower()) for line in extras[extra]), package
        assert not any(line.lower().startswith(package.lower()) for line in project["dependencies"]), package
    (everything,) = extras["all"]
    assert set(EXTRAS.values()) <= set(everything.partition("[")[2].rstrip("]").split(","))


def imported(path):
    """Modules that a file of ours imports, ours as paths and others by their package; those of type checkers too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield node.module.partition(".")[0]
        elif isinstance(node, ast.ImportFrom):
            base = path.parents[node.level - 1].joinpath(*(node.module or "").split("."))
            yield from (place for name in ("", *(alias.name for alias in node.names))
                        if (place := (base / name).with_suffix(".py")).is_file())  # fmt: skip


def test_whoever_installs_tune_can_tune():
    """Whatever its files import, and what of ours they do, comes with the extra."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    brought = {re.split("[<>=]", line)[0] for line in extras["tune"]}
    todo, needed = [*(ROOT / "workbench/tune").glob("*.py")], set()
    seen = set(todo)
    while todo:
        for found in imported(todo.pop()):
            if isinstance(found, str):
                needed.add(found)
            elif found not in seen and "readers" not in found.parts:
                seen.add(found)
                todo.append(found)
    assert {"jax", "matplotlib"} <= needed & set(EXTRAS) <= brought


@pytest.mark.parametrize(("package", "file"), [("ifcopenshell", "a.ifc"), ("ezdxf", "a.dxf")])
def test_a_reader_without_its_package_is_one_line(package, file, tmp_path, monkeypatch, capsys):
    (tmp_path / file).write_text("ISO-10303-21;")
    monkeypatch.setitem(sys.modules, package, None)
    assert main(["inspect", str(tmp_path / file)]) == 2
    wanted = f"expected the package {package}, found none; pip install 'viewcell[{EXTRAS[package]}]' brings it"
    assert capsys.readouterr().err == f"viewcell: {wanted}\n"


def test_what_no_extra_brings_is_a_fault_of_ours(monkeypatch):
    monkeypatch.setitem(sys.modules, "jax", None)
    with pytest.raises(InputError, match=r"pip install 'viewcell\[tune\]'"):
        need("jax")
    need("numpy")
    fault = ModuleNotFoundError("no", name="viewcell.data.nothing")
    assert missing(fault) is fault
    assert isinstance(missing(ModuleNotFoundError("no", name="jax.numpy")), InputError)
