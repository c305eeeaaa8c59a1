"""Every kernel that others may launch has a twin in verify/ and a test that holds the two together."""

import ast
from importlib import import_module

import pytest
from builders.places import ROOT

# Launch function: its file in kernels/, its twin (module of viewcell.verify and name there), the test of both.
TWINS = {
    "launch_stab": ("stab_batch", "exact.stab.stab", "kernels/test_stab.py"),
    "launch_flood": ("flood", "exact.stab.stab", "kernels/test_flood.py"),
    "launch_target_search": ("target", "exact.stab.stab", "kernels/test_flood.py"),
    "launch_line_trees": ("line_tree", "proofs.line_tree.hides", "verify/proofs/test_line_tree.py"),
    "launch_confirm": ("sightline", "exact.sightline.Sightlines", "kernels/test_sightline.py"),
    "launch_aim": ("aim", "exact.sightline.Sightlines", "kernels/test_aim.py"),
    "launch_clip": ("clip", "exact.clip.clipped", "kernels/test_clip.py"),
    "launch_trace": ("trace", "exact.trace.portal_path", "kernels/test_trace.py"),
    "launch_eye": ("eye", "exact.eye.seen_by_eye", "kernels/test_eye.py"),
    "launch_shaft": ("shaft", "exact.umbra.hides", "kernels/test_shaft.py"),
    "launch_coverage": ("coverage", "exact.coverage.cover_polygon", "kernels/test_coverage.py"),
    "launch_backface": ("backface", "exact.backface.back_facing", "kernels/test_backface.py"),
    "launch_umbra": ("umbra", "exact.umbra.umbra", "kernels/test_umbra.py"),
    "launch_shrink": ("shrink", "exact.shrink.shrunk", "kernels/test_shrink.py"),
    "launch_occludees": ("occludee", "exact.occludee.covers_box", "kernels/test_coverage.py"),
    "launch_deviation": ("deviation", "exact.deviation.deviation_squared", "kernels/test_deviation.py"),
    "launch_select": ("select", "exact.select.best_by_table", "kernels/test_select.py"),
    "launch_near_columns": ("tour", "exact.tour.nearest", "kernels/test_tour.py"),
    "launch_tour": ("tour", "exact.tour.least_runs", "kernels/test_tour.py"),
    "launch_raster": ("raster", "exact.raster.first_hit", "kernels/test_raster.py"),
}
# Kernels that answer another file's question in their own way have its twin: `stab_batch` is the plain stab, both
# searches ask for pairs joined by a stabbing line (builders/random_buildings.py searches with the exact stab), aiming
# gives sightlines, and a shaft that is not halved is blocked by one occluder iff the box lies in its umbra.
QUESTIONS = {"stab_batch": "stab", "aim": "sightline", "flood": "stab", "target": "stab", "shaft": "umbra"}


def launchers():
    """(file stem, name) of every public function in kernels/ whose name starts with launch_."""
    found = []
    for path in sorted((ROOT / "kernels").glob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body if path.stem != "launch" else ():
            if isinstance(node, ast.FunctionDef) and node.name.startswith("launch_"):
                found.append((path.stem, node.name))
    return found


def names_in(path):
    """Every name that a test file uses, those of the helper files that it loads included."""
    text = path.read_text(encoding="utf-8")
    for helper in ROOT.glob("tests/builders/*.py"):
        if helper.stem in text:
            text += helper.read_text(encoding="utf-8")
    tree = ast.parse(text)
    return {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}


def test_every_kernel_is_in_the_table():
    assert {(file, name) for name, (file, _, _) in TWINS.items()} == set(launchers())


def test_twins_have_the_stem_of_their_kernel():
    for file, twin, _ in TWINS.values():
        assert twin.split(".")[1] == QUESTIONS.get(file, file), f"kernels/{file}.py has the twin {twin}"


@pytest.mark.parametrize("launcher", TWINS)
def test_twin_exists_and_is_compared(launcher):
    file, twin, test = TWINS[launcher]
    module, _, name = twin.rpartition(".")
    assert hasattr(import_module(f"viewcell.kernels.{file}"), launcher)
    assert hasattr(import_module(f"viewcell.verify.{module}"), name)
    assert {launcher, name} <= names_in(ROOT / "tests" / test), f"{test} does not compare {launcher} with {twin}"
