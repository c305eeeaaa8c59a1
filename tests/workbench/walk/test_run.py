"""A walk as a whole: the same every time, within its memory, true, and refused in one line where it cannot be done."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
import viewcell
from builders.four_rooms import hashes
from builders.range_server import serving
from viewcell.data.camera import CameraPath, Screen
from viewcell.data.errors import InputError
from viewcell.data.store.walk_folder import GEOMETRY, file_digest, read_walk
from viewcell.solvers.walk.policies import POLICIES
from viewcell.solvers.walk.range_cells import RangeCells
from viewcell.workbench.bake.place import leftovers
from viewcell.workbench.cli import main
from viewcell.workbench.walk.pages import frames_csv, walk_json, write_walk
from viewcell.workbench.walk.path import walk as generated
from viewcell.workbench.walk.run import CORNER_M, walk
from viewcell.workbench.walk.settings import WalkSettings
from viewcell.workbench.walk.tables import walk_text

SCREEN = Screen(64, 48)
SMALL = WalkSettings(cache_bytes=60_000, read_bytes=8_000, screen=SCREEN)


def refused(capsys, *arguments):
    """The one line with which the command exits 2."""
    assert main(["walk", *map(str, arguments)]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and err.startswith("viewcell: ")
    return err


@pytest.fixture(scope="module")
def walked(office):
    return walk(office, frames=120, settings=replace(SMALL, policy="all"), check=4)


def test_the_memory_is_never_exceeded_and_nothing_stalls(walked):
    assert [one.name for one in walked.policies] == list(POLICIES)
    for one in walked.policies:
        columns = one.columns
        assert len(columns["claimed"]) == 120
        if POLICIES[one.name].bounded:
            assert (columns["claimed"] <= SMALL.cache_bytes).all()
        assert (columns["resident_bytes"] <= columns["claimed"]).all()
        # An item that is larger alone comes alone.
        assert (columns["read_bytes"] <= SMALL.read_bytes).mean() > 0.9
        assert columns["read_bytes"].max() > 0 and columns["failed"].sum() == 0
        drawn = columns["drawn_objects"] + columns["missing"]
        assert np.array_equal(drawn, walked.shown["chosen_objects"])
    # Here memory is short: something was given up, and something is missing or coarser at times.
    best = walked.policies[0].columns
    assert best["read_bytes"].sum() > SMALL.cache_bytes and best["skipped"].sum() + best["missing"].sum() > 0


def test_what_the_eye_sees_and_is_there_is_drawn(walked):
    assert walked.ok and len(walked.truths) == len(POLICIES)
    for truth in walked.truths:
        assert len(truth.frames) == 4 and truth.wrong == 0
        assert all(frame.seen > 3 and frame.pixels == 64 * 48 for frame in truth.frames)


def test_the_same_walk_is_the_same_to_the_byte(office, walked, tmp_path):
    again = walk(str(office.folder), frames=120, settings=replace(SMALL, policy="all"), check=4)
    for one, other in ((walked, tmp_path / "a"), (again, tmp_path / "b")):
        names = write_walk(one, other)
    assert names == ["frames.csv", "walk.html", "walk.json", "walk.png"]
    assert hashes(tmp_path / "a") == hashes(tmp_path / "b")
    assert walk_text(walked) == walk_text(again)
    # And by the path that it has written.
    by_file = walk(office, tmp_path / "a" / "frames.csv", settings=replace(SMALL, policy="all"), check=4)
    assert walk_text(by_file) == walk_text(walked)


def test_policies_do_not_change_each_other(office, walked):
    for one in walked.policies[1:3]:
        alone = walk(office, frames=120, settings=replace(SMALL, policy=one.name)).policies[0]
        for name in set(one.columns) - {"compute_s", "memory_s", "render_s", "late_s"}:
            np.testing.assert_array_equal(alone.columns[name], one.columns[name], name)


def test_with_memory_enough_nothing_is_missing_after_the_first_frames(office):
    found = walk(office, frames=60, settings=replace(SMALL, cache_bytes=10**7, read_bytes=10**7)).policies[0].columns
    assert found["missing"][0] > 0 and not found["missing"][1:].any() and not found["skipped"][1:].any()
    late = walk(office, frames=60, settings=replace(SMALL, cache_bytes=10**7, read_bytes=10**7, latency_ms=350.0))
    assert np.flatnonzero(late.policies[0].columns["missing"]).tolist() == [0, 1, 2, 3]


def test_slower_lines_show_less(office):
    kept = []
    for rate in (50.0, 0.5, 0.1):
        settings = replace(SMALL, cache_bytes=10**7, read_bytes=10**6, bandwidth_mbit=rate)
        columns = walk(office, frames=60, settings=settings).policies[0].columns
        kept.append(int((columns["skipped"] + columns["missing"]).sum()))
    assert kept[0] < kept[1] < kept[2]


def test_larger_triangles_of_another_renderer_are_simulated(office):
    settings = replace(SMALL, cache_bytes=10**7, polygon_bytes=158)
    found = walk(office, frames=10, settings=settings, check=1)
    assert found.model.bytes == 158 * office.items["faces"].to_numpy().sum() and found.ok
    assert found.policies[0].columns["failed"].sum() == 0


def test_real_time(office):
    """Frames at their times, drawn from what the thread has read; times are measured."""
    path = generated(office, 20, everywhere=True)
    path = replace(path, t=path.t / 5)
    found = walk(office, path, settings=replace(SMALL, cache_bytes=10**7, read_bytes=10**6, real_time=True), check=2)
    columns = found.policies[0].columns
    assert found.ok and (columns["render_s"] > 0).all() and (columns["late_s"] >= 0).all()
    assert not columns["missing"][-5:].any() and columns["resident_bytes"][-1] > 0
    assert "late_s" in frames_csv(found).decode() and "\N{EN DASH}" in walk_text(found)
    assert "render_s" in json.dumps(walk_json(found))


def test_command(office, tmp_path, capsys):
    out = tmp_path / "tour"
    arguments = ["walk", str(office.folder), "--frames", "30", "--image", "64x48", "-o", str(out), "--cache", "60kB"]
    assert main([*arguments, "--check", "1"]) == 0
    said = capsys.readouterr().out
    for title in ("Table 3", "Table 4", "Table 5", "Table 6", "Policies, cache of 0.06 MB", "Truth:"):
        assert title in said
    assert f"written to {out}" in said
    before = hashes(out)
    assert main([*arguments, "--check", "1", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["command"] == "walk" and told["ok"] and told["result"]["frames"] == 30
    assert told["result"]["checked"][0]["wrong"] == 0 and hashes(out) == before
    assert sorted(path.name for path in out.iterdir()) == told["result"]["files"]
    page = (out / "walk.html").read_text()
    assert "<script" not in page and "http" not in page and page.count("<table>") == len(told["result"]["tables"])


def test_an_object_that_is_lost_stops_the_walk(office, capsys, monkeypatch, tmp_path):
    """Planted: what a frame shows lacks the largest object; the check finds it, in rays and in pixels."""
    from viewcell.workbench.walk.display import Display

    choose = Display._choose

    def lossy(self, path, at, objects, row):
        boxes = self.boxes[objects]
        middle = np.linalg.norm(boxes.mean(axis=1) - path.eyes[at], axis=1)
        size = np.prod(boxes[:, 1] - boxes[:, 0] + 0.01, axis=1) / middle
        return choose(self, path, at, np.delete(objects, size.argmax()), row)

    monkeypatch.setattr(Display, "_choose", lossy)
    arguments = ["walk", str(office.folder), "--frames", "20", "--image", "64x48", "-o", str(tmp_path / "a")]
    assert main([*arguments, "--check", "3"]) == 1
    assert "this is a bug" in capsys.readouterr().out
    assert not json.loads((tmp_path / "a" / "walk.json").read_text())["checked"][0]["wrong"] == 0


def test_paths_that_leave_the_model_or_go_through_walls(office, tmp_path, capsys):
    path = generated(office, 30, everywhere=True)
    away = replace(path, eyes=path.eyes + np.array([0, 0, 500.0]))
    with pytest.raises(InputError, match="path: expected eyes in cells of the model, found frame 0 at"):
        walk(office, away, settings=SMALL)
    # Two rooms of which one must go round to the other.
    cells = np.flatnonzero(office.graph.inhabitable)
    middles, ways = office.graph.cells[cells].mean(axis=1) * office.grid_m, RangeCells(office.graph, office.grid_m)
    about = np.zeros((len(cells), len(cells)))
    for row, cell in enumerate(cells):
        reached, length = ways.near(middles[row], np.array([cell]), 100.0)
        told = dict(zip(reached.tolist(), length.tolist(), strict=True))
        about[row] = [told[other] for other in cells.tolist()] - np.linalg.norm(middles - middles[row], axis=1)
    eyes = middles[list(np.unravel_index(about.argmax(), about.shape))]
    assert about.max() > CORNER_M
    jump = CameraPath(eyes, np.zeros(2), np.zeros(2), np.array([0.0, 0.1]))
    with pytest.raises(InputError, match=r"path: expected steps through portals, found one of .* through a wall"):
        walk(office, jump, settings=SMALL)
    table = tmp_path / "none.csv"
    assert "none.csv" in refused(capsys, office.folder, "--path", table)
    table.write_text("x,y,z\n1,2,3\n")
    assert "expected the column 'yaw'" in refused(capsys, office.folder, "--path", table)


def test_bad_input_is_one_line(office, copy, tmp_path, capsys):
    folder = office.folder
    assert "expected at least" in refused(capsys, folder, "--frames", 20, "--cache", 200)
    assert "invalid choice: 'lru'" in refused(capsys, folder, "--policy", "lru")
    assert "expected a number and" in refused(capsys, folder, "--cache", "much")
    assert "expected a number and" in refused(capsys, folder, "--bandwidth", "25")
    assert "cache_bytes: expected a number above 0" in refused(capsys, folder, "--cache", 0)
    assert "budget: expected more than" in refused(capsys, folder, "--target-ms", 0.5)
    assert "no-such.walk" in refused(capsys, "no-such.walk")
    assert "expected kind 'walk'" in refused(capsys, folder.with_name("office.bake"))
    assert "expected a file of viewcell tune lod" in refused(capsys, folder, "--levels", tmp_path / "none.json")
    (tmp_path / "mine").write_text("{}")
    assert "expected a tune-lod.json" in refused(capsys, folder, "--levels", tmp_path / "mine")
    assert "expected a folder to write to" in refused(capsys, folder, "--frames", 2, "-o", tmp_path / "mine")
    # Files that were cut short or altered, and a bake that has changed.
    geometry = (copy / GEOMETRY).read_bytes()
    (copy / GEOMETRY).write_bytes(geometry[:-7])
    assert "cut short or altered" in refused(capsys, copy)
    (copy / GEOMETRY).write_bytes(geometry[:-1] + bytes([geometry[-1] ^ 1]))
    assert "it was altered" in refused(capsys, copy)
    (copy / GEOMETRY).write_bytes(geometry)
    table = copy.with_name("office.bake") / "cell_to_object.parquet"
    pq.write_table(pq.read_table(table).slice(1), table)
    assert "has changed since" in refused(capsys, copy)
    shutil.rmtree(table.parent)
    assert main(["walk", str(copy), "--frames", "2", "--image", "64x48", "-o", str(tmp_path / "a")]) == 0


def test_the_cache_that_is_told_works(office):
    with pytest.raises(InputError) as told:
        walk(office, frames=40, settings=replace(SMALL, cache_bytes=200))
    least = int(str(told.value).split("at least ")[1].split(" bytes")[0].replace(",", ""))
    walk(office, frames=40, settings=replace(SMALL, cache_bytes=least))
    with pytest.raises(InputError, match=f"at least {least:,} bytes"):
        walk(office, frames=40, settings=replace(SMALL, cache_bytes=least - 1))


def test_over_http_it_is_the_same_walk(office):
    settings = replace(SMALL, latency_ms=40.0, bandwidth_mbit=25.0)
    with serving(office.folder.parent) as (url, asked):
        remote = walk(f"{url}/office.walk", frames=60, settings=settings, check=1)
    local = walk(office, frames=60, settings=settings, check=1)
    for name, column in local.policies[0].columns.items():
        if not name.endswith("_s") or name == "swap_s":
            np.testing.assert_array_equal(remote.policies[0].columns[name], column, name)
    assert remote.ok and remote.index_bytes == local.index_bytes < 10**6
    assert sum(name == GEOMETRY for name, _ in asked) >= local.policies[0].columns["reads"].sum() > 0


def test_a_server_that_fails_is_counted_and_given_up(office):
    """Every third range fails, then all: what came is shown, what did not is counted, and the walk ends."""
    settings = replace(SMALL, cache_bytes=10**6, read_bytes=3_000)
    counter = iter(range(10**6))

    def third(name, span):
        return "error" if name == GEOMETRY and next(counter) % 3 == 2 else ""

    with serving(office.folder.parent, third) as (url, _):
        found = walk(f"{url}/office.walk", frames=60, settings=settings)
    one = found.policies[0]
    assert one.columns["failed"].sum() == sum(one.failures.values()) > 0 and not one.given_up
    assert "reads failed: geometry.bin: expected status 206, found 503" in walk_text(found)
    assert one.columns["resident_bytes"][-1] > 0
    with serving(office.folder.parent, lambda name, span: "error" if name == GEOMETRY else "") as (url, asked):
        found = walk(f"{url}/office.walk", frames=60, settings=settings)
    assert found.policies[0].given_up and len(asked) < 20
    assert "nothing was asked for any more" in walk_text(found)
    assert (found.policies[0].columns["missing"] == found.shown["chosen_objects"]).all()


def test_tuned_levels(office, tmp_path, capsys):
    assert (
        main(["tune", "lod", str(office.folder.with_name("office.bake")), "--frames", "12", "-o", str(tmp_path)]) == 0
    )
    file = tmp_path / "tune-lod.json"
    found = walk(office, frames=20, settings=SMALL, levels=file)
    told = json.loads(file.read_text())["lod"]
    assert f"fitted to {told['cost']['samples']} frames" in found.model.cost
    told["method"] = "by hand"
    file.write_text(json.dumps({"lod": told}))
    with pytest.raises(InputError, match="expected a method of viewcell tune lod"):
        walk(office, frames=2, settings=SMALL, levels=file)


@pytest.mark.slow
def test_a_killed_walk_leaves_nothing_broken(office, tmp_path):
    """Killed at 100 moments: what is there is whole, and the next walk is as the first."""
    out = tmp_path / "tour"
    command = [
        *(sys.executable, "-m", "viewcell", "walk", str(office.folder), "--frames", "40", "--image", "64x48"),
        *("-o", str(out), "-q"),
    ]
    begin = time.monotonic()
    subprocess.run(command, check=True, capture_output=True)
    whole, spent = {path.name: file_digest(path) for path in out.iterdir()}, time.monotonic() - begin
    rng = np.random.default_rng(0)
    before = hashes(office.folder)
    for moment in rng.uniform(0.3, 1.1, 100) * spent:
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(moment)
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        assert {path.name for path in out.iterdir() if path.is_file()} == set(whole)
        assert {name: file_digest(out / name) for name in whole} == whole
    assert hashes(office.folder) == before and read_walk(office.folder)
    subprocess.run(command, check=True, capture_output=True)
    assert hashes(out) == whole and leftovers(tmp_path, out.name) == []


def test_public_names():
    assert viewcell.walk is walk
