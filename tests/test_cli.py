"""The command line: what it prints, its exit codes, and that bad input costs nothing."""

import errno
import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import viewcell
from viewcell.data.scene_folder import write_scene
from viewcell.kernels.engine import Engine
from viewcell.workbench import commands
from viewcell.workbench.cli import main

TABLES = ("meshes", "objects", "cells", "portals", "cell_to_cell", "cell_to_object")
HEAVY = {"warp", "jax", "pyarrow", "numpy", "scipy", "trimesh", "ifcopenshell", "matplotlib", "embreex"}
# Three rooms in a row and one round the corner, which the first does not see.
CELLS = [[0, 0, 0, 4, 4, 3], [4, 0, 0, 8, 4, 3], [8, 0, 0, 12, 4, 3], [8, 4, 0, 12, 8, 3]]
PORTALS = [(0, 1, 0, 4, 1, 1.25, 0, 2), (1, 2, 0, 8, 1, 1.25, 0, 2), (2, 3, 1, 4, 11.5, 12, 0, 2)]
CUBE = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1))


def write_graph(folder, cells=CELLS, portals=PORTALS, cell_ids=None, drop=""):
    """A folder with cells.parquet and portals.parquet [m]."""
    folder.mkdir(parents=True, exist_ok=True)
    names = ("min_x", "min_y", "min_z", "max_x", "max_y", "max_z")
    columns = {"cell_id": list(range(len(cells))) if cell_ids is None else cell_ids}
    columns |= {name: [cell[i] for cell in cells] for i, name in enumerate(names)}
    names = ("cell_a", "cell_b", "axis", "coordinate", "min_u", "max_u", "min_v", "max_v")
    more = {"portal_id": list(range(len(portals)))} | {n: [p[i] for p in portals] for i, n in enumerate(names)}
    for name, table in (("cells", columns), ("portals", more)):
        pq.write_table(pa.table({k: v for k, v in table.items() if k != drop}), folder / f"{name}.parquet")
    return folder


def hashes(folder):
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(folder.iterdir())}


def run(*arguments, **options):
    command = [sys.executable, "-m", "viewcell.workbench.cli", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, **options)


def refused(capsys, *arguments):
    """The one line with which a command exits 2."""
    assert main([str(argument) for argument in arguments]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and err.startswith("viewcell: ")
    return err


def assert_same_tables(first, second):
    for name in TABLES:
        assert pq.read_table(first / f"{name}.parquet").equals(pq.read_table(second / f"{name}.parquet")), name


@pytest.fixture(scope="module")
def graph(tmp_path_factory):
    return write_graph(tmp_path_factory.mktemp("graph") / "rooms")


@pytest.fixture(scope="module")
def baked(graph, tmp_path_factory):
    """A finished bake of the four rooms; tests copy it before they change it."""
    out = tmp_path_factory.mktemp("baked") / "rooms.bake"
    assert main(["bake", str(graph), "--out", str(out), "--no-progress"]) == 0
    return out


@pytest.fixture
def copy(baked, tmp_path):
    return Path(shutil.copytree(baked, tmp_path / "copy.bake"))


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
    assert ["cells,", "all", "14", "14", "1.000", "0.00", "%"] in [line.split() for line in text.splitlines()]
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


def test_summary_says_what_leaks_and_what_was_skipped(copy, capsys):
    manifest = json.loads((copy / "manifest.json").read_text())
    parts = [{"what": f"wall {n}", "why": "no\nfaces"} for n in range(5)]
    manifest |= {"leak_cells": [3, 1, 2], "skipped": parts, "inhabitable_because": "inside the model's 9 rooms"}
    (copy / "manifest.json").write_text(json.dumps(manifest))
    from viewcell.workbench.summary import summary

    lines = summary(viewcell.load(copy)).splitlines()
    assert lines[0] == "4 cells, 4 inhabitable (inside the model's 9 rooms)"
    assert "the outside leaks into the middle of the building, through cells 3, 1, 2" in lines
    assert lines[-5:-3] == ["skipped 5:", "  wall 0: no faces"] and lines[-1].startswith("  ...")


def test_make_office(tmp_path, capsys):
    assert main(["make", "office", "--floors", "1", "--rooms-per-side", "2", "--out", str(tmp_path / "a.glb")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[1:7]] == ["Low", "MedLow", "Medium", "MedHigh", "High", "All"]
    objects, polygons = (int(word.replace(",", "")) for word in lines[6].split()[1:3])
    scene = viewcell.read(tmp_path / "a.glb")
    assert objects == len(scene.objects)
    assert polygons == sum(len(scene.definitions[x.definition_id].lods[0].faces) for x in scene.objects)


def test_up_and_unit_reach_the_reader(tmp_path, monkeypatch):
    seen = {}

    def read(path, **options):
        seen.update(options)
        raise viewcell.InputError("enough")

    monkeypatch.setattr("viewcell.data.readers.read", read)
    model = tmp_path / "a.obj"
    model.write_text(CUBE)
    assert main(["bake", str(model), "--up", "y", "--unit", "0.0254", "--doors", "closed"]) == 2
    assert seen == {"up": "y", "unit": 0.0254, "doors": "closed"}
    assert main(["bake", str(model), "--unit", "foot"]) == 2
    assert seen == {"up": None, "unit": "foot", "doors": "open"}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "COMMAND"),
        (["frob"], "frob"),
        (["bake"], "MODEL"),
        (["bake", "{graph}", "--frob"], "--frob"),
        (["bake", "{graph}", "--budget", "-1"], "above 0, found -1"),
        (["bake", "{graph}", "--budget", "0"], "above 0, found 0"),
        (["bake", "{graph}", "--budget", "nan"], "found nan"),
        (["bake", "{graph}", "--budget", "soon"], "expected a number, found 'soon'"),
        (["bake", "{graph}", "--threshold", "-0.5"], "from 0, found -0.5"),
        (["bake", "{graph}", "--threshold", "inf"], "found inf"),
        (["bake", "{graph}", "--threads", "0"], "from 1, found '0'"),
        (["bake", "{graph}", "--seed", "-1"], "found '-1'"),
        (["bake", "{graph}", "--seed", "2147483648"], "found '2147483648'"),
        (["bake", "{graph}", "--device", "cuda:99"], "found 'cuda:99'"),
        (["bake", "{graph}", "--device", "abacus"], "found 'abacus'"),
        (["bake", "{graph}", "--doors", "ajar"], "ajar"),
        (["bake", "{graph}", "--up", "x"], "'x'"),
        (["bake", "{graph}", "--unit", "foot"], "found a folder"),
        (["bake", "{graph}", "--doors", "closed"], "found a folder"),
        (["make", "office", "--floors", "0"], "found '0'"),
        (["make", "office", "--floors", "101"], "101"),
        (["make", "office", "--rooms-per-side", "2.5"], "found '2.5'"),
        (["make", "office", "--out", "office.txt"], "found 'office.txt'"),
        (["make", "office", "--like", "the-ritz"], "the-ritz"),
        (["make", "office", "--like", "soda-hall", "--floors", "2"], "found floors"),
        (["verify"], "neither"),
        (["verify", "{baked}", "--rays", "-1"], "found '-1'"),
        (["verify", "--replay", "no-such-case.json"], "no-such-case.json"),
        (["verify", "no-such-bake"], "no-such-bake"),
        (["report", "{baked}", "--cells", "99"], "found 99"),
        (["report", "{baked}", "--cells", "one"], "found 'one'"),
        (["report", "{baked}", "--out", "{baked}/manifest.json"], "manifest.json"),
    ],
)
def test_unusable_arguments(arguments, words, graph, baked, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    before = hashes(baked)
    line = refused(capsys, *(argument.format(graph=graph, baked=baked) for argument in arguments))
    assert words in line
    assert not list(tmp_path.iterdir()) and hashes(baked) == before


MODELS = {
    "unknown.txt": (b"hello", "found '.txt'"),
    "garbage.ifc": (b"hello", "garbage.ifc"),
    "garbage.glb": (b"\0\1\2", "garbage.glb"),
    "garbage.ply": (b"ply\nformat ascii 1.0\n", "garbage.ply"),
    "none.stl": (b"", "none.stl"),
    "empty.obj": (b"# nothing\n", "empty.obj"),
    "points.obj": (CUBE.encode(), "points.obj"),
    "nan.obj": ((CUBE + "v nan 0 0\nf 1 2 3\nf 1 2 9\n").encode(), "nan"),
    "infinite.obj": ((CUBE + "v inf 0 0\nf 1 2 3\nf 1 2 9\n").encode(), "inf"),
    "huge.obj": ((CUBE + "v 1e9 0 0\nf 1 2 3\nf 1 2 9\n").encode(), "m of the model's origin"),
    "flat.obj": ((CUBE + "f 1 1 1\nf 1 2 1\n").encode(), "flat.obj"),
    "index.obj": ((CUBE + "f 1 2 99\n").encode(), "index.obj"),
}


@pytest.mark.parametrize("name", MODELS)
def test_unusable_models_leave_the_bake_alone(name, copy, tmp_path, capsys):
    content, words = MODELS[name]
    (tmp_path / name).write_bytes(content)
    before = hashes(copy)
    assert words in refused(capsys, "bake", tmp_path / name, "--out", copy, "--overwrite")
    assert hashes(copy) == before and {path.name for path in tmp_path.iterdir()} == {name, copy.name}


def test_missing_model(tmp_path, capsys):
    line = refused(capsys, "bake", tmp_path / "no such.ifc")
    assert "no such.ifc" in line and "found nothing there" in line


def moved(cell, by):
    return [value + by if axis in (0, 3) else value for axis, value in enumerate(cell)]


GRAPHS = {
    "overlap": ({"cells": [CELLS[0], moved(CELLS[1], -1), *CELLS[2:]]}, "cells 0 and 1 overlapping"),
    "flat cell": ({"cells": [[0, 0, 0, 0, 4, 3], *CELLS[1:]]}, "cell 0 without volume"),
    "no cells": ({"cells": [], "portals": []}, "empty table"),
    "nan cell": ({"cells": [[float("nan"), 0, 0, 4, 4, 3], *CELLS[1:]]}, "nan in min_x of row 0"),
    "large cell": ({"cells": [[-1e9, 0, 0, 4, 4, 3], *CELLS[1:]]}, "found 1e+09 m"),
    "text cell": ({"cells": [["a", "0", "0", "4", "4", "3"]], "portals": []}, "another type"),
    "ids twice": ({"cell_ids": [0, 1, 1, 2]}, "each once"),
    "no column": ({"drop": "max_z"}, "'max_z'"),
    "portal off": ({"portals": [(0, 1, 0, 4.5, 1, 2, 0, 2)]}, "portal 0 off the common face of cells 0 and 1"),
    "portal outside": ({"portals": [(0, 1, 0, 4, 1, 5, 0, 2)]}, "portal 0 off the common face"),
    "portal turned": ({"portals": [(1, 0, 0, 4, 1, 2, 0, 2)]}, "cell_a (low side)"),
    "portal thin": ({"portals": [(0, 1, 0, 4, 1, 1, 0, 2)]}, "portal 0 without"),
    "unknown cell": ({"portals": [(0, 9, 0, 4, 1, 2, 0, 2)]}, "found 9 in row 0"),
    "unknown axis": ({"portals": [(0, 1, 3, 4, 1, 2, 0, 2)]}, "found 3 in row 0"),
    "text portal": ({"portals": [(0, 1, 0, "four", 1, 2, 0, 2)]}, "another type"),
}


@pytest.mark.parametrize("name", GRAPHS)
def test_tables_that_contradict_each_other(name, copy, tmp_path, capsys):
    change, words = GRAPHS[name]
    folder = write_graph(tmp_path / "bad", **change)
    before = hashes(copy)
    assert words in refused(capsys, "bake", folder, "--out", copy, "--overwrite")
    assert hashes(copy) == before and len(list(tmp_path.iterdir())) == 2


def test_no_portals_table(tmp_path, capsys):
    (write_graph(tmp_path / "half") / "portals.parquet").unlink()
    assert "portals.parquet" in refused(capsys, "bake", tmp_path / "half", "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["a file", "a folder"])
def test_somebody_elses_place_is_not_replaced(name, graph, tmp_path, capsys):
    out = tmp_path / "mine"
    if name == "a folder":
        out.mkdir()
        (out / "thesis.tex").write_text("x")
    else:
        out.write_text("x")
    assert "something else" in refused(capsys, "bake", graph, "--out", out, "--overwrite")
    assert (out / "thesis.tex" if out.is_dir() else out).read_text() == "x"


def edit(**values):
    """Changes a manifest's values; None removes one."""

    def apply(folder):
        manifest = json.loads((folder / "manifest.json").read_text()) | values
        (folder / "manifest.json").write_text(json.dumps({k: v for k, v in manifest.items() if v is not None}))

    return apply


def other_ids(folder):
    table = pq.read_table(folder / "cell_to_cell.parquet")
    ids = pa.array([77] * table.num_rows, pa.int32())
    pq.write_table(table.set_column(1, "reached_cell_id", ids), folder / "cell_to_cell.parquet")


BAKES = {
    "other version": (edit(format=2), "expected format 1, found 2"),
    "unfinished": (edit(complete=False), "expected complete True, found False"),
    "a scene": (edit(kind="scene"), "expected kind 'bake', found 'scene'"),
    "no grid": (edit(grid_m=None), "'grid_m'"),
    "no manifest": (lambda folder: (folder / "manifest.json").unlink(), "manifest.json"),
    "not JSON": (lambda folder: (folder / "manifest.json").write_text("{"), "expected JSON"),
    "no cells": (lambda folder: (folder / "cells.parquet").unlink(), "cells.parquet"),
    "cut table": (lambda folder: (folder / "cell_to_cell.parquet").write_bytes(b"PAR1"), "cell_to_cell.parquet"),
    "unknown ids": (other_ids, "found 77"),
}


@pytest.mark.parametrize("command", ["verify", "report"])
@pytest.mark.parametrize("name", BAKES)
def test_unusable_bakes(name, command, copy, capsys):
    change, words = BAKES[name]
    change(copy)
    assert words in refused(capsys, command, copy)


def test_a_full_disk_leaves_the_bake_alone(graph, copy, tmp_path, monkeypatch, capsys):
    def full(*args, **kwargs):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    before = hashes(copy)
    monkeypatch.setattr(pq, "write_table", full)
    assert "No space left" in refused(capsys, "bake", graph, "--out", copy, "--overwrite", "--no-progress")
    assert hashes(copy) == before
    assert "No space left" in refused(capsys, "make", "office", "--floors", "1", "--out", tmp_path / "o.scene")
    assert not (tmp_path / "o.scene").exists()


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (MemoryError("Unable to allocate 9 TiB"), 2, "memory, found too little (Unable to allocate 9 TiB)"),
        (RuntimeError("Failed to allocate 9 bytes on device 'cuda:0'"), 2, "on the device, found too little"),
        (PermissionError(errno.EACCES, "Permission denied", "x.bake"), 2, "x.bake: expected"),
        (KeyboardInterrupt(), 130, "interrupted; run the same command again to resume"),
        (viewcell.InputError("two\nlines"), 2, "two lines"),
    ],
)
def test_one_line_for_each_failure(error, code, words, monkeypatch, capsys):
    def fail(options):
        raise error

    monkeypatch.setattr(commands, "report", fail)
    assert main(["report", "x.bake"]) == code
    err = capsys.readouterr().err
    assert words in err and err.count("\n") == 1


def test_a_closed_pipe_is_quiet_and_keeps_the_exit_code(baked):
    command = [sys.executable, "-m", "viewcell.workbench.cli", "verify", str(baked), "--rays", "1000"]
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

    monkeypatch.setattr(Engine, "visible", interrupt)
    assert main(["bake", str(office), "--out", str(tmp_path / "o.bake"), "--no-progress"]) == 130
    assert "run the same command again" in capsys.readouterr().err
    assert not (tmp_path / "o.bake").exists()


def test_interrupted_bake_resumes_to_the_same_result(tmp_path):
    scene, out, whole = tmp_path / "o.scene", tmp_path / "o.bake", tmp_path / "whole.bake"
    write_scene(viewcell.make_office(floors=2, rooms_per_side=6, furnished=False), scene)
    write_graph(tmp_path / "rooms")
    assert main(["bake", str(tmp_path / "rooms"), "--out", str(out), "--no-progress"]) == 0
    old, arguments = hashes(out), ["bake", str(scene), "--overwrite", "--no-progress", "--out"]
    command = [sys.executable, "-m", "viewcell.workbench.cli", *arguments, str(out)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while not list(tmp_path.glob(".o.bake.partial/*.block")):
            assert process.poll() is None, process.stderr.read()
            time.sleep(0.005)
        process.send_signal(signal.SIGINT)
        assert process.wait(120) == 130
        assert process.stderr.read() == "viewcell: interrupted; run the same command again to resume\n"
    assert hashes(out) == old and list(tmp_path.glob(".o.bake.partial/0.block"))
    assert main([*arguments, str(out)]) == 0
    assert main([*arguments, str(whole)]) == 0
    assert_same_tables(out, whole)
    assert not list(tmp_path.glob(".*"))


def test_verify_is_callable_although_a_subpackage_has_its_name(baked):
    code = (
        "import viewcell.verify.rays, viewcell; "
        f"assert viewcell.verify(viewcell.load({str(baked)!r}), rays=1000).ok; "
        "assert callable(viewcell.bake) and callable(viewcell.report)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def test_readme_example_prints_what_the_readme_says(tmp_path):
    readme = (Path(__file__).resolve().parents[1] / "README.md").read_text(encoding="utf-8")
    code = readme.partition("```python\n")[2].partition("```")[0]
    expected = readme.partition("```text\n")[2].partition("```")[0]
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path)
    # Warp greets on stdout before.
    assert done.stdout.endswith(expected)
