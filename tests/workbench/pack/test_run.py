"""Packing: what comes out is the bake's, the same every time, whole or not at all."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pyarrow.parquet as pq
import pytest
import viewcell
from builders.four_rooms import hashes
from builders.packed_house import packed_scene
from viewcell.data.store.walk_folder import column_bytes, read_walk
from viewcell.verify.readers.walk import differences
from viewcell.workbench.bake.place import clean, leftovers
from viewcell.workbench.bake.run import bake
from viewcell.workbench.cli import main
from viewcell.workbench.pack.run import default_out, pack
from viewcell.workbench.pack.words import pack_text

BALL_NAMES = [f"ball {number}" for number in range(3)]


def refused(capsys, *arguments):
    """The one line with which the command exits 2."""
    assert main(["pack", *map(str, arguments)]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and err.startswith("viewcell: ")
    return err


@pytest.mark.parametrize("flatten", [False, True])
def test_a_second_reader_finds_the_bake(flatten, made, tmp_path):
    walk = pack(made, tmp_path / "house.walk", flatten=flatten)
    assert differences(walk.folder, made) == []
    items = walk.items.num_rows
    assert items == sum(len(made.scene.definitions[o.definition_id].lods) for o in made.scene.objects) or not flatten
    again = read_walk(walk.folder)
    assert again.stale() == "" and again.manifest == walk.manifest


def test_the_same_bake_gives_the_same_bytes(made, tmp_path):
    """Twice, and from a bake made again elsewhere; only the bake's name in the manifest may differ."""
    first, second = (pack(made, tmp_path / name) for name in ("a.walk", "b.walk"))
    assert hashes(first.folder) == hashes(second.folder)


def test_items_lie_step_by_step_from_the_coarsest(made, tmp_path):
    walk = pack(made, tmp_path / "house.walk", flatten=True)
    starts, items = walk.object_items
    levels = np.diff(starts)
    step = np.repeat(levels, levels) - 1 - np.concatenate([np.arange(n) for n in levels])
    order = np.argsort(items)
    owner = np.repeat(np.arange(len(levels)), levels)
    assert np.array_equal(items[order], np.arange(len(items)))
    assert (np.diff(step[order]) >= 0).all() and step.max() > 0
    assert all((np.diff(owner[order][step[order] == s]) > 0).all() for s in range(step.max() + 1))
    assert (np.diff(walk.items["offset"].to_numpy()) >= 0).all()


def test_bytes_are_those_of_the_items_that_a_view_cell_may_need(made, packed):
    sizes, (starts, items) = packed.items["size"].to_pylist(), packed.object_items
    ends, members = packed.potential.ids()
    for row in range(len(packed.potential)):
        wanted = set()
        for k in range(ends[row], ends[row + 1]):
            of = items[starts[members[k]] : starts[members[k] + 1]].tolist()
            wanted |= set(of[packed.limits[k] :])
        assert packed.sets["bytes"][row].as_py() == sum(sizes[item] for item in wanted)
    assert packed.limits.max() > 0


def test_what_the_order_is_worth_is_told(packed, capsys):
    told = packed.manifest["order"]
    assert 0 < told["runs"] <= min(told["runs_as_made"], told["runs_at_random"])
    assert len(packed.potential.first) == told["runs"]
    assert f"in {told['runs']:,} runs" in pack_text(packed)
    assert column_bytes(packed, "potential") < packed.manifest["files"]["sets.parquet"]["bytes"]


def test_command(made, tmp_path, capsys):
    out = tmp_path / "house.walk"
    assert main(["pack", str(made.folder), "-o", str(out)]) == 0
    assert f"written to {out}\n" in capsys.readouterr().out
    before = hashes(out), out.stat().st_ino
    assert main(["pack", str(made.folder), "-o", str(out)]) == 0
    assert "was up to date" in capsys.readouterr().out and (hashes(out), out.stat().st_ino) == before
    assert main(["pack", "--check", str(out)]) == 0
    assert "view cells" in capsys.readouterr().out and hashes(out) == before[0]
    # Asked for otherwise, it is packed anew; files of others stay.
    (out / "notes.txt").write_text("mine")
    assert main(["pack", str(made.folder), "-o", str(out), "--flatten"]) == 0
    assert "flattened" in capsys.readouterr().out and (out / "notes.txt").read_text() == "mine"
    assert default_out(made) == made.folder.with_name("house.walk")
    assert viewcell.pack(str(made.folder), out, flatten=True).manifest == read_walk(out).manifest
    assert made.pack(out, flatten=True).manifest == read_walk(out).manifest


def test_a_changed_bake_is_told(copy, made, capsys):
    assert read_walk(copy).stale() == ""
    table = copy.with_name("house.bake") / "cell_to_object.parquet"
    pq.write_table(pq.read_table(table).slice(1), table)
    line = read_walk(copy).stale()
    assert "has changed since" in line and "\n" not in line
    assert main(["pack", "--check", str(copy)]) == 1
    assert capsys.readouterr().err == f"viewcell: {line}\n"
    # It is packed anew without being asked twice, as it is of the same bake.
    before = hashes(copy)
    assert main(["pack", str(table.parent), "-o", str(copy)]) == 0
    assert hashes(copy) != before and read_walk(copy).stale() == ""


def test_a_damaged_pack_is_packed_anew(copy, capsys):
    before, geometry = hashes(copy), copy / "geometry.bin"
    geometry.write_bytes(geometry.read_bytes()[:-5])
    assert "cut short" in refused(capsys, "--check", copy)
    assert main(["pack", str(copy.with_name("house.bake")), "-o", str(copy)]) == 0
    assert "written to" in capsys.readouterr().out and hashes(copy) == before


def test_another_bakes_pack_is_not_replaced_unasked(made, copy, capsys):
    before = hashes(copy)
    assert "--overwrite" in refused(capsys, made.folder, "-o", copy)
    assert hashes(copy) == before
    assert main(["pack", str(made.folder), "-o", str(copy), "--overwrite"]) == 0
    assert read_walk(copy).manifest["bake"]["path"].endswith(made.folder.name)


def test_what_cannot_be_packed_is_told_in_one_line(made, baked, tmp_path, capsys):
    assert "no-such-bake" in refused(capsys, "no-such-bake")
    assert "without objects" in refused(capsys, baked, "-o", tmp_path / "a.walk")
    assert "something else there" in refused(capsys, made.folder, "-o", made.folder)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").touch()
    assert "something else there" in refused(capsys, made.folder, "-o", tmp_path / "mine")
    assert "expected " in refused(capsys, "--check", made.folder)
    assert "nothing to write beside --check" in refused(capsys, "--check", made.folder, "--flatten")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine"]


def test_a_full_disk_leaves_what_was_there(made, copy, monkeypatch, capsys):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    before = hashes(copy)
    monkeypatch.setattr(pq, "write_table", full)
    assert "No space left" in refused(capsys, copy.with_name("house.bake"), "-o", copy, "--flatten", "--overwrite")
    assert hashes(copy) == before and not leftovers(copy.parent)


def begun(bake_folder, out):
    """A process that packs, from when it has begun to work."""
    script = "import viewcell, sys; pack = viewcell.pack; print('go', flush=True); pack(*sys.argv[1:])"
    running = subprocess.Popen([sys.executable, "-c", script, str(bake_folder), str(out)], stdout=subprocess.PIPE)
    running.stdout.readline()
    running.stdout.close()
    return running


def whole_pack(bake_folder, out):
    """Seconds that a pack takes from then on."""
    running, begin = begun(bake_folder, out), time.perf_counter()
    assert running.wait() == 0
    return time.perf_counter() - begin


def kill_at(bake_folder, out, seconds):
    """Kill a pack so long after it has begun to work; whether it was still at it."""
    running = begun(bake_folder, out)
    time.sleep(seconds)
    alive = running.poll() is None
    if alive:
        os.kill(running.pid, signal.SIGKILL)
    running.wait()
    return alive


def survives(made, tmp_path, moments):
    """Nothing broken is left, wherever a pack is killed: none, the old or the new one, and it can be packed again."""
    out, killed = tmp_path / "house.walk", 0
    whole = hashes(pack(made, tmp_path / "whole.walk").folder)
    for k, seconds in enumerate(moments):
        if k % 2:
            pack(made, out, flatten=True)
        killed += kill_at(made.folder, out, seconds)
        clean(tmp_path)
        if out.exists():
            read_walk(out)
        assert sorted(path.name for path in tmp_path.iterdir() if "lock" not in path.name) in (
            ["whole.walk"],
            ["house.walk", "whole.walk"],
        )
        assert hashes(pack(made, out).folder) == whole
    return killed


@pytest.mark.slow
def test_a_killed_pack_leaves_nothing_broken(made, tmp_path):
    assert survives(made, tmp_path, [0.0, 0.05, 0.3, 0.6]) >= 1


@pytest.mark.slow
def test_a_pack_killed_at_a_hundred_moments_leaves_nothing_broken(made, tmp_path):
    """Fifty moments of each of the two bakes, all within the time that a whole pack takes."""
    took = whole_pack(made.folder, tmp_path / "house.walk")
    assert survives(made, tmp_path, np.random.default_rng(0).uniform(0, took, 50).tolist()) >= 15


def test_what_a_budget_leaves_is_unknown(tmp_path):
    made = bake(packed_scene(), tmp_path / "house.bake", budget_s=1e-6, threads=1)
    walk = pack(made)
    assert len(walk.unknown.ids()[1]) > 0 and differences(walk.folder, made) == []


def test_a_shape_of_its_own_at_one_level_shares_the_others(packed):
    """Three balls: two of one shape, one that differs at level 1; Berkeley 1996, figure 13."""
    starts, items = packed.object_items
    names = packed.objects["name"].to_pylist()
    own, mirrored, plain = (items[starts[k] : starts[k + 1]].tolist() for k in map(names.index, BALL_NAMES))
    assert mirrored == plain and own[0] == plain[0] and own[2] == plain[2] and own[1] != plain[1]
    assert packed.mesh(own[1]).error_m == 1.5e-5 and packed.mesh(plain[1]).error_m == 1e-5


def test_view_cells_of_an_octree_claim_nothing_of_cells(tmp_path):
    scene = viewcell.make_office(floors=1, rooms_per_side=2, furnished=False)
    made = bake(scene, tmp_path / "o.bake", cells="octree", cell_size_m=8.0, depth=0, threads=1)
    walk = pack(made)
    assert walk.potential_cells is None and differences(walk.folder, made) == []
    manifest = json.loads((walk.folder / "manifest.json").read_text())
    assert manifest["kind"] == "walk" and manifest["counts"]["view_cells"] == len(walk.potential)
