"""Imports go down the floors of docs/architecture.md and have no circles."""

import ast
from functools import cache
from graphlib import CycleError, TopologicalSorter

import pytest
from builders.places import ROOT

# What each floor may import besides itself. Nothing imports the root.
BELOW = {
    "data": set(),
    "kernels": {"data"},
    "solvers": {"data", "kernels"},
    "verify": {"data"},
    "workbench": {"data", "kernels", "solvers", "verify"},
}
# Checkers of proofs import arithmetic and data only; twins know no rays, and state proofs as a checker reads them.
WITHIN = {
    "verify.proofs": ("verify.arithmetic", "verify.proofs"),
    "verify.exact": ("verify.arithmetic", "verify.exact", "verify.proofs"),
}


def modules(root):
    """Name, without the package's own, and file of every module on a floor."""
    paths = [path for floor in BELOW for path in sorted((root / floor).rglob("*.py"))]
    return {
        ".".join(p for p in path.relative_to(root).with_suffix("").parts if p != "__init__"): path for path in paths
    }


PATHS = modules(ROOT)


def imported(name, paths=PATHS):
    """(module, name taken) of every import of the package by a module, those within functions and of types included."""
    path = paths[name]
    package = name.split(".") if path.stem == "__init__" else name.split(".")[:-1]
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            way = node.module.split(".") if node.module else []
            if not node.level and way[0] != "viewcell":
                continue
            base = [*package[: len(package) - node.level + 1], *way] if node.level else way[1:]
            for alias in node.names:
                whole = ".".join([*base, alias.name])
                is_module = whole in paths or whole in BELOW
                found.add((whole, None) if is_module else (".".join(base), alias.name))
        elif isinstance(node, ast.Import):
            ways = [alias.name.split(".") for alias in node.names]
            found |= {(".".join(way[1:]), None) for way in ways if way[0] == "viewcell"}
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith(("import_module", "__import__")):
            # What is imported by name cannot be told; nothing but the benches does so.
            found.add(("workbench", None))
    return found


@cache
def edges_of(name):
    """Read when a test asks, not by every process that collects tests."""
    return imported(name)


def breaches(name, edges):
    """Modules that a module imports though its floor or its room may not."""
    floor = name.split(".")[0]
    found = []
    for module, _ in edges:
        below = module.split(".")[0]
        allowed = [rooms for room, rooms in WITHIN.items() if name.startswith(room) and below == floor]
        if (below != floor and below not in BELOW[floor]) or not all(module.startswith(rooms) for rooms in allowed):
            found.append(module)
    return found


@pytest.mark.parametrize("name", PATHS)
def test_imports_go_down(name):
    """So do all that they lead to: truth comes to no kernel by any way round."""
    assert breaches(name, edges_of(name)) == []


WAYS = {
    "from": "from viewcell.kernels.stab import decide\n",
    "relative": "from ...kernels.stab import decide\n",
    "package": "from ... import kernels\n",
    "module of a package": "from ...kernels import stab\n",
    "absolute": "import viewcell.kernels\n",
    "absolute module": "import numpy, viewcell.kernels.stab as s\n",
    "the whole package": "import viewcell\n",
    "through the whole package": "from viewcell import bake\n",
    "in a function": "def late():\n    from ...kernels import stab\n    return stab\n",
    "for types": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from ...kernels.stab import Level\n",
    "by name": "from importlib import import_module\nstab = import_module('viewcell.kernels.stab')\n",
    "by another name": "import importlib\nstab = importlib.import_module('.'.join(['viewcell', 'kernels']))\n",
    "another room": "from ..rays import adjudicate\n",
    "absolute room": "import viewcell.verify.rays.adjudicate\n",
}


@pytest.mark.parametrize("way", WAYS)
def test_no_way_to_import_is_overlooked(way, tmp_path):
    files = {"kernels/__init__.py": "", "kernels/stab.py": "", "verify/rays/adjudicate.py": "", "data/solids.py": ""}
    files |= {"verify/exact/twin.py": WAYS[way], "verify/exact/clean.py": "import numpy\nfrom ...data import solids\n"}
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    paths = modules(tmp_path)
    assert breaches("verify.exact.twin", imported("verify.exact.twin", paths)) != []
    assert breaches("verify.exact.clean", imported("verify.exact.clean", paths)) == []


@pytest.mark.parametrize("name", PATHS)
def test_private_names_stay_at_home(name):
    for module, taken in edges_of(name):
        private = taken is not None and taken.startswith("_") and taken != "__version__"
        assert not private, f"{name} imports {module}.{taken}"


def test_no_circles_of_modules():
    graph = {name: {module for module, _ in edges_of(name) if module in PATHS} - {name} for name in PATHS}
    try:
        list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_a_circle_would_be_found():
    with pytest.raises(CycleError):
        list(TopologicalSorter({"a": {"b"}, "b": {"a"}}).static_order())
