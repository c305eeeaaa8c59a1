"""The command line: what it prints, its exit codes, and interrupted bakes."""

import json
import subprocess
import sys

import pyarrow.parquet as pq
import pytest
import viewcell
from builders import four_rooms
from viewcell.data.store.scene_folder import write_scene
from viewcell.solvers.visibility.portal_engine import PortalEngine
from viewcell.workbench.bake import blocks
from viewcell.workbench.cli import main

TABLES = ("meshes", "objects", "cells", "portals", "cell_to_cell", "cell_to_object")
HEAVY = {"warp", "jax", "pyarrow", "numpy", "scipy", "trimesh", "ifcopenshell", "matplotlib", "embreex"}
write_graph, hashes = four_rooms.write_graph, four_rooms.hashes


def run(*arguments, **options):
    command = [sys.executable, "-m", "viewcell", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, **options)


def assert_same_tables(first, second):
    for name in TABLES:
        assert pq.read_table(first / f"{name}.parquet").equals(pq.read_table(second / f"{name}.parquet")), name


@pytest.fixture(scope="module")
def office(tmp_path_factory):
    out = tmp_path_factory.mktemp("office") / "office.scene"
    write_scene(viewcell.make_office(floors=1, rooms_per_side=2, furnished=False), out)
    return out


def test_help_and_version_import_nothing_heavy():
    code = (
        "import sys; from viewcell.workbench.cli import main; "
        f"codes = main(['--help']), main(['bake', '--help']), main(['--version']); "
        f"assert codes == (0, 0, 0); print(sorted({HEAVY!r} & set(sys.modules)))"
    )
    lines = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.splitlines()
    assert lines[-1] == "[]" and lines[-2] == f"viewcell {viewcell.__version__}"


def test_bake_prints_and_verify_confirms(graph, tmp_path, capsys):
    out = tmp_path / "rooms.bake"
    assert main(["bake", str(graph), "--out", str(out), "--no-progress"]) == 0
    text = capsys.readouterr().out
    assert "4 cells, 4 inhabitable" in text and "3 portals, 0 objects" in text
    assert ["cells,", "inhabitable", "14", "14", "1.000", "0.00", "%"] in [line.split() for line in text.splitlines()]
    assert text.splitlines()[-1] == f"written to {out}"
    assert main(["bake", str(graph), "--out", str(out), "--no-progress"]) == 0
    assert "was up to date" in capsys.readouterr().out
    assert main(["bake", str(graph), "--out", str(out), "--no-progress", "--overwrite"]) == 0
    assert "written to" in capsys.readouterr().out
    assert main(["verify", str(out), "--rays", "5000"]) == 0
    assert "| wrong-hidden | 0 |" in capsys.readouterr().out
    assert main(["report", str(out), "--cells", "0,3", "--out", str(tmp_path / "report")]) == 0
    assert (tmp_path / "report" / "cell-3.png").stat().st_size > 0


def test_verify_exits_1_on_a_wrong_hidden_and_replays_it(copy, baked, capsys):
    table = pq.read_table(copy / "cell_to_cell.parquet")
    pairs = list(zip(table["cell_id"].to_pylist(), table["reached_cell_id"].to_pylist(), strict=True))
    pq.write_table(table.filter([pair != (0, 2) for pair in pairs]), copy / "cell_to_cell.parquet")
    assert main(["verify", str(copy), "--rays", "50000"]) == 1
    out = capsys.readouterr().out
    assert "| wrong-hidden | 1 (case file " in out
    case = out.partition("(case file ")[2].partition(")")[0]
    assert main(["verify", "--replay", case]) == 1
    assert capsys.readouterr().out.startswith("wrong-hidden: cell 0, cell 2")
    assert main(["verify", str(baked), "--replay", case]) == 0
    assert capsys.readouterr().out.startswith("fixed: cell 0, cell 2")


def test_summary_says_what_is_kept_warned_of_and_skipped(copy, capsys):
    manifest = json.loads((copy / "manifest.json").read_text())
    parts = [{"what": f"wall {n}", "why": "no\nfaces"} for n in range(5)]
    manifest |= {"warnings": ["it leaks"], "skipped": parts, "inhabitable_because": "inside the model's 9 rooms"}
    eye = {"median": 2.5, "worst": 12.25, "worst_cell": 3, "cells": 4, "eyes": 64}
    manifest |= {"kept": {"objects": 0.125, "triangles": 0.5, "eye": eye}}
    (copy / "manifest.json").write_text(json.dumps(manifest))
    from viewcell.workbench.summary import summary

    lines = summary(viewcell.load(copy)).splitlines()
    assert lines[0] == "4 cells, 4 inhabitable (inside the model's 9 rooms)"
    assert "warning: it leaks" in lines
    assert "kept by a view cell on average: 12.5 % of the objects, 50.0 % of the triangles" in lines
    assert "kept / eye: 2.50 in the median, 12.25 at worst (cell 3); 64 random eyes in each of 4 cells" in lines
    assert lines[-5:-3] == ["skipped 5:", "  wall 0: no faces"] and lines[-1].startswith("  ...")


def test_make_office(tmp_path, capsys):
    assert main(["make", "office", "--floors", "1", "--rooms-per-side", "2", "--out", str(tmp_path / "a.glb")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[1:7]] == ["Low", "MedLow", "Medium", "MedHigh", "High", "All"]
    objects, polygons = (int(word.replace(",", "")) for word in lines[6].split()[1:3])
    scene = viewcell.read(tmp_path / "a.glb")
    assert objects == len(scene.objects)
    assert polygons == sum(len(scene.definitions[x.definition_id].lods[0].faces) for x in scene.objects)


def test_make_an_office_with_wings(tmp_path, capsys):
    out, size = str(tmp_path / "a.scene"), ["--floors", "1", "--rooms-per-side", "1"]
    turn = ["--yaw", "17", "--wings", "2", "--wing-angle", "-40"]
    assert main(["make", "office", *size, *turn, "--out", out]) == 0
    assert "written to" in capsys.readouterr().out
    made = viewcell.make_office(floors=1, rooms_per_side=1, yaw_deg=17, wings=2, wing_angle_deg=-40)
    assert viewcell.read(out).source == made.source and len(viewcell.read(out).objects) == len(made.objects)
    assert main(["make", "office", *size, "--wings", "9", "--wing-angle", "60", "--out", out, "--overwrite"]) == 2
    complaint = capsys.readouterr().err
    assert "expected wings that stand clear of each other" in complaint and complaint.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "source"),
    [
        (["rotunda", "--sides", "5"], "make_rotunda(sides=5, seed=2"),
        (["arcade", "--windows", "2", "--segments", "4"], "make_arcade(windows=2, segments=4, seed=2"),
    ],
)
def test_make_other_buildings(arguments, source, tmp_path, capsys):
    assert main(["make", *arguments, "--seed", "2", "--out", str(tmp_path / "a.scene")]) == 0
    lines = capsys.readouterr().out.splitlines()
    scene = viewcell.read(tmp_path / "a.scene")
    assert scene.source.startswith(source) and len(scene.objects) == int(lines[1].split()[1])
    assert main(["make", arguments[0], arguments[1], "1000", "--out", str(tmp_path / "b.scene")]) == 2
    assert f"{arguments[1][2:]}: expected" in capsys.readouterr().err and not (tmp_path / "b.scene").exists()


def test_up_and_unit_reach_the_reader(tmp_path, monkeypatch):
    seen = {}

    def read(path, **options):
        seen.update(options)
        raise viewcell.InputError("enough")

    monkeypatch.setattr("viewcell.data.readers.read", read)
    model = tmp_path / "a.obj"
    model.write_text("v 0 0 0\n")
    assert main(["bake", str(model), "--up", "y", "--unit", "0.0254", "--doors", "closed"]) == 2
    assert seen == {"up": "y", "unit": 0.0254, "doors": "closed", "yaw": "auto"}
    seen.clear()
    assert main(["bake", str(model), "--unit", "foot"]) == 2
    assert seen == {"up": None, "unit": "foot", "yaw": "auto"}


def test_a_closed_pipe_is_quiet_and_keeps_the_exit_code(baked):
    command = [sys.executable, "-m", "viewcell", "verify", str(baked), "--rays", "1000"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        assert (process.stderr.read(), process.wait(60)) == (b"", 0)


def test_unknown_device_is_one_line_in_a_process_of_its_own(graph, tmp_path):
    done = run("bake", graph, "--device", "abacus", cwd=tmp_path)
    assert done.returncode == 2 and done.stdout == "" and done.stderr.count("\n") == 1
    assert "abacus" in done.stderr and not list(tmp_path.iterdir())


def test_interrupted_before_the_end_leaves_no_bake(office, tmp_path, monkeypatch, capsys):
    def interrupt(self, block):
        raise KeyboardInterrupt

    monkeypatch.setattr(PortalEngine, "visible", interrupt)
    assert main(["bake", str(office), "--out", str(tmp_path / "o.bake"), "--no-progress"]) == 130
    assert capsys.readouterr().err == "viewcell: interrupted\n"
    assert not (tmp_path / "o.bake").exists()


def test_interrupted_bake_resumes_to_the_same_result(office, tmp_path, monkeypatch):
    out, whole = tmp_path / "o.bake", tmp_path / "whole.bake"
    monkeypatch.setattr(blocks, "BLOCK", 3)
    write_graph(tmp_path / "rooms")
    assert main(["bake", str(tmp_path / "rooms"), "--out", str(out), "--no-progress"]) == 0
    old, arguments = hashes(out), ["bake", str(office), "--overwrite", "--no-progress", "--threads", "1", "--out"]
    # The signal comes in the middle of the second block, however fast the machine is; it is heard even where the tests
    # run in the background, where processes are born deaf to it.
    code = """
import os, signal, sys, threading, time
signal.signal(signal.SIGINT, signal.default_int_handler)
from viewcell.solvers.visibility.portal_engine import PortalEngine
from viewcell.workbench.bake import blocks
from viewcell.workbench.cli import main
blocks.BLOCK = 3
visible, begun = PortalEngine.visible, []
def interrupted(self, block):
    begun.append(block)
    if len(begun) == 2:
        threading.Timer(0.02, os.kill, (os.getpid(), signal.SIGINT)).start()
    found = visible(self, block)
    if len(begun) == 2:
        time.sleep(60)
    return found
PortalEngine.visible = interrupted
sys.exit(main(sys.argv[1:]))
"""
    command = [sys.executable, "-c", code, *arguments, str(out)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 130
    assert done.stderr == "viewcell: interrupted; the same command goes on from there\n"
    assert hashes(out) == old and list(tmp_path.glob(".o.bake.*.partial/0.arrow"))
    assert main([*arguments, str(out)]) == 0
    assert main([*arguments, str(whole)]) == 0
    assert_same_tables(out, whole)
    assert not list(tmp_path.glob(".*"))


def test_bakes_verify_themselves_and_subpackages_hide_no_function(baked):
    code = (
        "import viewcell.workbench.bake.run, viewcell; "
        f"assert viewcell.load({str(baked)!r}).verify(rays=1000).ok; "
        "assert callable(viewcell.bake) and callable(viewcell.report)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def test_short_options_and_the_package_as_a_command(tmp_path, graph):
    command = [sys.executable, "-m", "viewcell"]
    said = subprocess.run([*command, "-V"], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert said.stdout == f"viewcell {viewcell.__version__}\n" and said.stderr == ""
    assert main(["bake", str(graph), "-o", str(tmp_path / "short.bake"), "--no-progress"]) == 0
    assert (tmp_path / "short.bake" / "manifest.json").exists()
