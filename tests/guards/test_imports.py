"""Imports go down the floors of docs/architecture.md and have no circles."""

import ast
from graphlib import CycleError, TopologicalSorter

import pytest
from builders.places import ROOT

# What each floor may import besides itself. Nothing imports the root but for its version.
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


def module_name(path):
    return ".".join(part for part in path.relative_to(ROOT).with_suffix("").parts if part != "__init__")


PATHS = {module_name(path): path for floor in BELOW for path in sorted((ROOT / floor).rglob("*.py"))}


def imported(name):
    """(module, name taken) of every relative import of a module, those within functions and of types included."""
    path = PATHS[name]
    package = name.split(".") if path.stem == "__init__" else name.split(".")[:-1]
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = [*package[: len(package) - node.level + 1], *(node.module.split(".") if node.module else [])]
            for alias in node.names:
                whole = ".".join([*base, alias.name])
                found.add((whole, None) if whole in PATHS else (".".join(base), alias.name))
    return found


EDGES = {name: imported(name) for name in PATHS}


@pytest.mark.parametrize("name", PATHS)
def test_imports_go_down(name):
    floor = name.split(".")[0]
    for module, taken in EDGES[name]:
        if module == "" and taken == "__version__":
            continue
        below = module.split(".")[0]
        assert below == floor or below in BELOW[floor], f"{name} imports {module}"
        for room, allowed in WITHIN.items():
            if name.startswith(room) and below == floor:
                assert module.startswith(allowed), f"{name} imports {module}"


@pytest.mark.parametrize("name", PATHS)
def test_private_names_stay_at_home(name):
    for module, taken in EDGES[name]:
        private = taken is not None and taken.startswith("_") and taken != "__version__"
        assert not private, f"{name} imports {module}.{taken}"


def test_no_circles_of_modules():
    graph = {name: {module for module, _ in edges if module in PATHS} - {name} for name, edges in EDGES.items()}
    try:
        list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_a_circle_would_be_found():
    with pytest.raises(CycleError):
        list(TopologicalSorter({"a": {"b"}, "b": {"a"}}).static_order())
