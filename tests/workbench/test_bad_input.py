"""Bad input: one line with what was expected and found, exit 2, and the previous bake untouched."""

import errno
import json
import os

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import viewcell
from builders import four_rooms
from viewcell.data import progress
from viewcell.workbench import commands
from viewcell.workbench.cli import main

write_graph, hashes = four_rooms.write_graph, four_rooms.hashes
CELLS = four_rooms.CELLS
CUBE = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1))


@pytest.fixture(autouse=True)
def no_phase_is_long(monkeypatch):
    """A busy machine takes more than a second to read a file, and then says so on a line of its own."""
    monkeypatch.setattr(progress, "LEAST_S", float("inf"))


def refused(capsys, *arguments):
    """The one line with which a command exits 2."""
    assert main([str(argument) for argument in arguments]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and err.startswith("viewcell: ")
    return err


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
    "other version": (edit(format=3), "expected format 1 or 2, found 3"),
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
        (KeyboardInterrupt(), 130, "interrupted"),
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
