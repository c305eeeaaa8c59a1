"""Every kernel that others may launch has a twin in verify/ and a test that holds the two together."""

import ast
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
# launch function: its file in kernels/, its twin (module of viewcell.verify and name there), the test of both.
TWINS = {
    "launch_stab": ("stab_batch", "stab_exact.stab", "test_stab.py"),
    # Both searches ask for pairs joined by a stabbing line; tests/random_buildings.py searches with the exact stab.
    "launch_flood": ("flood", "stab_exact.stab", "test_flood.py"),
    "launch_target_search": ("target", "stab_exact.stab", "test_flood.py"),
    "launch_line_trees": ("line_tree", "line_certificate.hides", "test_line_certificate.py"),
    "launch_confirm": ("sightline", "sightline.Sightlines", "test_sightline_kernels.py"),
    "launch_aim": ("sightline", "sightline.Sightlines", "test_sightline_kernels.py"),
    "launch_walk": ("walk", "walk.portal_path", "test_walk.py"),
    "launch_shaft": ("shaft", "shadow_exact.hides", "test_shaft.py"),
    "launch_coverage": ("coverage", "coverage_exact.cover_polygon", "test_coverage.py"),
    "launch_backface": ("backface", "backface_exact.back_facing", "test_backface.py"),
    "launch_umbra": ("shadow", "shadow_exact.umbra", "test_shadow.py"),
    "launch_shrink": ("shadow", "shadow_exact.shrunk", "test_shadow.py"),
    "launch_grow_hole": ("shadow", "shadow_exact.grown_hole", "test_shadow.py"),
    "launch_occludees": ("occludee", "coverage_exact.covers_box", "test_coverage.py"),
    "launch_deviation": ("deviation", "deviation_exact.deviation_squared", "test_deviation.py"),
    "launch_select": ("select", "knapsack_exact.best_by_table", "test_select.py"),
    "launch_raster": ("raster", "raster_exact.first_hit", "test_raster.py"),
}


def launchers():
    """(file stem, name) of every public function in kernels/ whose name starts with launch_."""
    found = []
    for path in sorted((ROOT / "kernels").glob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef) and node.name.startswith("launch_"):
                found.append((path.stem, node.name))
    return found


def names_in(path):
    """Every name that a test file uses, those of the helper files that it loads included."""
    text = path.read_text(encoding="utf-8")
    for helper in ROOT.glob("tests/*.py"):
        if not helper.name.startswith("test_") and f'"{helper.name}"' in text:
            text += helper.read_text(encoding="utf-8")
    tree = ast.parse(text)
    return {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}


def test_every_kernel_is_in_the_table():
    assert {(file, name) for name, (file, _, _) in TWINS.items()} == set(launchers())


@pytest.mark.parametrize("launcher", TWINS)
def test_twin_exists_and_is_compared(launcher):
    file, twin, test = TWINS[launcher]
    module, _, name = twin.partition(".")
    assert hasattr(import_module(f"viewcell.kernels.{file}"), launcher)
    assert hasattr(import_module(f"viewcell.verify.{module}"), name)
    assert {launcher, name} <= names_in(ROOT / "tests" / test), f"{test} does not compare {launcher} with {twin}"


def test_twins_share_no_code_with_kernels():
    for path in (ROOT / "verify").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                assert "kernels" not in (node.module or ""), f"verify/{path.name} imports {node.module}"
