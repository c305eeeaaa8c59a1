"""Tuning end to end on a small office, its paths, and the files that it writes and a bake reads."""

import base64
import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
from viewcell.data.errors import InputError
from viewcell.workbench.baked import load
from viewcell.workbench.cli import main
from viewcell.workbench.tune import lod as tuning
from viewcell.workbench.tune.lod import CHOOSERS, HIGHS, Outcome, recommend, tune_lod
from viewcell.workbench.walk.path import RATE, SPEED, potential_on, read_path, walk

FAST = ["--frames", "12", "--image", "64x48", "--no-progress"]
FILES = ["samples.csv", "tune-lod.html", "tune-lod.json", "tune-lod.png"]


@pytest.fixture(scope="module")
def office(tmp_path_factory):
    folder = tmp_path_factory.mktemp("office")
    scene = folder / "office.scene"
    assert main(["make", "office", "--floors", "1", "--rooms-per-side", "2", "--out", str(scene)]) == 0
    assert main(["bake", str(scene), "--out", str(folder / "office.bake"), "--no-progress"]) == 0
    return folder


@pytest.fixture(scope="module")
def octree(tmp_path_factory, office):
    out = tmp_path_factory.mktemp("octree") / "octree.bake"
    asked = ["--cells", "octree", "--depth", "0", "--method", "occluders", "--no-progress"]
    assert main(["bake", str(office / "office.scene"), "--out", str(out), *asked]) == 0
    return load(out)


def holding(bake, eye, which=None):
    """Cells that hold an eye."""
    cells = bake.graph.cells * bake.grid_m
    inside = ((cells[:, 0] <= eye) & (eye <= cells[:, 1])).all(axis=1)
    return np.flatnonzero(inside if which is None else inside & which)


def test_walk_is_even_smooth_and_inside(office):
    bake = load(office / "office.bake")
    path = walk(bake, 400, seed=3)
    assert len(path) == 400 and path.axes().shape == (400, 3, 3)
    for eye in path.eyes:
        assert len(holding(bake, eye, bake.graph.inhabitable))
    time = np.diff(path.t)
    assert (time > 0).all() and np.allclose(path.t * RATE, np.round(path.t * RATE))
    # Frames are left out in the depth of doorways only; elsewhere steps are even, but for corners that are cut.
    step = np.linalg.norm(np.diff(path.eyes, axis=0), axis=1)
    assert (step <= SPEED * time + 1e-9).all()
    assert np.median(step) == pytest.approx(SPEED / RATE, rel=1e-3)
    assert (time > 1.5 / RATE).sum() < 40
    turn = (np.diff(path.yaw_deg) + 180) % 360 - 180
    assert np.abs(turn).max() < 60
    # The floors of this office are level.
    floor = bake.graph.cells[bake.graph.inhabitable, 0, 2].min() * bake.grid_m
    assert np.allclose(path.eyes[:, 2], floor + 1.7)
    again, other = walk(bake, 400, seed=3), walk(bake, 400, seed=4)
    assert np.array_equal(path.eyes, again.eyes) and not np.array_equal(path.eyes, other.eyes)
    assert len({int(cell) for eye in path.eyes for cell in holding(bake, eye)}) > 4


def test_walk_between_the_cells_of_an_octree(octree):
    assert octree.graph.portal_count == 0
    path = walk(octree, 100)
    assert len(path) == 100
    assert all(len(holding(octree, eye, octree.graph.inhabitable)) for eye in path.eyes)
    assert len({int(holding(octree, eye)[0]) for eye in path.eyes}) > 2


def test_sets_on_a_path_are_those_of_the_cells_that_hold_the_eye(office):
    bake = load(office / "office.bake")
    path = walk(bake, 30)
    cell = int(np.flatnonzero(bake.graph.inhabitable)[0])
    outside = path.eyes[:1] + 1000
    corner = bake.graph.cells[cell, :1].astype(float) * bake.grid_m
    path = replace(path, eyes=np.concatenate([path.eyes[:28], outside, corner]))
    sets, lost = potential_on(bake, path)
    assert lost.tolist() == [False] * 28 + [True] + [False]
    assert sets[28].all()
    for frame in (*range(28), 29):
        cells = holding(bake, path.eyes[frame], bake.graph.inhabitable)
        wanted = set().union(*(bake.potential(int(c)).tolist() for c in cells))
        assert set(np.flatnonzero(sets[frame]).tolist()) == wanted
        assert not sets[frame].all()


def test_tunes_an_office(office, tmp_path, capsys):
    out = tmp_path / "tuned"
    assert main(["tune", "lod", str(office / "office.bake"), *FAST, "--out", str(out), "--seed", "5"]) == 0
    said = capsys.readouterr().out
    assert sorted(file.name for file in out.iterdir()) == FILES
    found = json.loads((out / "tune-lod.json").read_text())
    assert found["tuned"] == "lod" and found["settings"] == load(office / "office.bake").manifest["settings"]
    assert found["reason"] in said and "recommended: " in said and "software renderer" in said
    lod = found["lod"]
    assert lod["method"] in CHOOSERS and lod["screen"] == {"width": 64, "height": 48, "fov_deg": 60.0}
    assert lod["cost"]["samples"] == 48 and lod["cost"]["relative_rms"] > 0
    assert len(lod["budgets_ms"]) == 3
    outcomes = [Outcome(**row) for row in found["outcomes"]]
    assert len(outcomes) == 3 * (2 * 4 + 1)
    assert recommend(outcomes)[:2] == (lod["method"], lod["slack"] > 0)
    for o in outcomes:
        assert o.frames == 12 and 0 <= o.lost_mean <= o.lost_most < 1
        assert 0 <= o.measured_misses <= 1 and 0 < o.kept_detail <= 1
        assert o.dropped == 0
        if o.method != HIGHS:
            assert o.modelled_misses == 0
        if o.method in ("kernel", HIGHS) and not o.coherent:
            best = min(p.lost_mean for p in outcomes if p.budget_ms == o.budget_ms)
            assert o.lost_mean <= best + 0.05
    # The tightest frame time cannot hold all that would fit in a fraction.
    assert max(o.lost_mean for o in outcomes) > 1e-4
    page = (out / "tune-lod.html").read_text()
    picture = base64.b64decode(re.search(r'src="data:image/png;base64,([^"]+)"', page)[1])
    assert picture == (out / "tune-lod.png").read_bytes() and picture.startswith(b"\x89PNG")
    assert page.count("<tr>") == 1 + len(outcomes)
    assert not re.search(r'(src|href)="(?!data:)', page)
    header, *rows = (out / "samples.csv").read_text().split()
    assert header.replace('"', "") == "primitives,pixels,objects,seconds" and len(rows) == 48


def test_coherence_changes_fewer_levels_and_loses_no_more_than_its_slack(office, tmp_path):
    # Costs that are measured depend on what else the machine does.
    work = np.random.default_rng(0).integers(100, 100_000, (40, 2))
    rows = np.column_stack([work, 1e-4 + work @ [1e-8, 2e-9]])
    np.savetxt(tmp_path / "gpu.csv", rows, delimiter=",", header="primitives,pixels,seconds", comments="", fmt="%.17g")
    result = tune_lod(
        load(office / "office.bake"), frames=40, screen=tuning.Screen(64, 48), samples=tmp_path / "gpu.csv"
    )
    # HiGHS has solved a frame here and there: nothing can be said of flicker.
    assert {o.method for o in result.outcomes if o.switches is None} == {HIGHS}
    for budget in result.budgets_ms:
        plain, coherent = (
            next(o for o in result.outcomes if (o.method, o.coherent, o.budget_ms) == ("kernel", how, budget))
            for how in (False, True)
        )
        assert coherent.switches <= plain.switches
        assert coherent.lost_mean <= plain.lost_mean + tuning.COHERENCE.slack + 0.01


def test_a_users_samples_and_path_are_used(office, tmp_path, capsys):
    path = walk(load(office / "office.bake"), 8)
    columns = np.column_stack([path.eyes, path.yaw_deg, path.pitch_deg, path.t])
    np.savetxt(tmp_path / "path.csv", columns, delimiter=",", header="x,y,z,yaw,pitch,t", comments="", fmt="%.17g")
    work = np.random.default_rng(0).integers(100, 100_000, (40, 2))
    rows = np.column_stack([work, 1e-4 + work @ [1e-8, 2e-9]])
    np.savetxt(tmp_path / "gpu.csv", rows, delimiter=",", header="primitives,pixels,seconds", comments="", fmt="%.17g")
    given = ["--path", str(tmp_path / "path.csv"), "--samples", str(tmp_path / "gpu.csv"), "--budget-ms", "0.3,0.2"]
    asked = ["tune", "lod", str(office / "office.bake"), *FAST, "--out", str(tmp_path / "out"), *given]
    assert main([*asked, "--always", "IfcWall,IfcSlab"]) == 0
    said = capsys.readouterr().out
    assert "40 frames of gpu.csv" in said and "8 frames, 64 x 48" in said and "Frames were not drawn" in said
    found = json.loads((tmp_path / "out" / "tune-lod.json").read_text())
    assert found["lod"]["budgets_ms"] == [0.2, 0.3]
    assert found["lod"]["cost"]["primitive_s"] == pytest.approx(1e-8, rel=1e-6)
    assert all(row["measured_misses"] is None for row in found["outcomes"])
    assert all(row["switches"] is not None for row in found["outcomes"])
    assert not (tmp_path / "out" / "samples.csv").exists()
    # The samples are the same whenever they are read: so is everything but the time to choose.
    assert main([*asked[:6], *asked[6:8], "--out", str(tmp_path / "again"), *given, "--always", "IfcWall,IfcSlab"]) == 0
    again = json.loads((tmp_path / "again" / "tune-lod.json").read_text())
    timed = {"choose_ms"}
    assert [{k: v for k, v in row.items() if k not in timed} for row in again["outcomes"]] == [
        {k: v for k, v in row.items() if k not in timed} for row in found["outcomes"]
    ]


def test_what_must_be_drawn_and_does_not_fit_is_told(office, tmp_path, capsys):
    rows = "".join(f"{n * 1000},{n * n * 100},{1e-4 + n * 1e-3}\n" for n in range(1, 20))
    (tmp_path / "slow.csv").write_text("primitives,pixels,seconds\n" + rows)
    asked = ["tune", "lod", str(office / "office.bake"), *FAST, "--out", str(tmp_path / "out")]
    more = ["--samples", str(tmp_path / "slow.csv"), "--budget-ms", "0.2", "--always", "IfcWall"]
    assert main([*asked, *more]) == 0
    assert re.search(r"\d+ times an object that must be drawn did not fit and was dropped", capsys.readouterr().out)


def test_a_bake_takes_what_was_tuned(office, tmp_path, capsys):
    rows = "".join(f"{n * 1000},{n * n * 100},{1e-4 + n * 1e-3}\n" for n in range(1, 20))
    (tmp_path / "s.csv").write_text("primitives,pixels,seconds\n" + rows)
    out = tmp_path / "tuned"
    asked = [
        "tune",
        "lod",
        str(office / "office.bake"),
        *FAST,
        "--samples",
        str(tmp_path / "s.csv"),
        "--budget-ms",
        "9",
    ]
    assert main([*asked, "--out", str(out)]) == 0
    copy = tmp_path / "office.bake"
    shutil.copytree(office / "office.bake", copy)
    before = {file.name: file.read_bytes() for file in copy.iterdir()}
    bake = ["bake", str(office / "office.scene"), "--out", str(copy), "--no-progress"]
    assert main([*bake, "--settings", str(out / "tune-lod.json")]) == 0
    tuned = json.loads((out / "tune-lod.json").read_text())["lod"]
    assert load(copy).manifest["lod"] == tuned
    # Nothing was baked again: the tables do not depend on it.
    assert {f.name for f in copy.iterdir() if f.read_bytes() != before[f.name]} == {"manifest.json"}
    capsys.readouterr()
    assert main([*bake, "--settings", str(out / "tune-lod.json")]) == 0
    assert "was up to date" in capsys.readouterr().out
    fresh = [*bake[:3], str(tmp_path / "fresh.bake"), "--no-progress", "--settings", str(out / "tune-lod.json")]
    assert main([*fresh, "--seed", "9"]) == 0
    manifest = load(tmp_path / "fresh.bake").manifest
    assert manifest["lod"] == tuned and manifest["settings"]["seed"] == 9


def test_settings_come_from_the_file_unless_given(graph, tmp_path):
    (tmp_path / "s.json").write_text('{"seed": 7, "cell_size_m": 3, "method": "portals"}')
    asked = ["bake", str(graph), "--no-progress", "--settings", str(tmp_path / "s.json")]
    assert main([*asked, "--out", str(tmp_path / "a.bake")]) == 0
    found = load(tmp_path / "a.bake").manifest["settings"]
    assert (found["seed"], found["cell_size_m"], found["method"], found["depth"]) == (7, 3.0, "portals", 2)
    assert main([*asked, "--out", str(tmp_path / "b.bake"), "--seed", "0", "--method", "auto"]) == 0
    found = load(tmp_path / "b.bake").manifest["settings"]
    assert (found["seed"], found["cell_size_m"], found["method"]) == (0, 3.0, "auto")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"sede": 1}', "expected keys among doors, glass"),
        ('{"seed": 1.5}', "expected seed to be like 0, found 1.5"),
        ('{"seed": true}', "expected seed to be like 0, found True"),
        ('{"certify": 1}', "expected certify to be like false, found 1"),
        ('{"tuned": "lod", "settings": [], "lod": {}}', "expected an object as settings"),
        ('{"tuned": "lod", "settings": {}, "lod": 3}', "expected an object as lod"),
        ('{"image": [9, 9]}', 'expected image to be like "1920x1080", found [9, 9]'),
        ("[1]", "expected a JSON object"),
        ("{", "expected JSON"),
    ],
)
def test_bake_refuses_settings_that_it_does_not_know(text, said, graph, tmp_path, capsys):
    (tmp_path / "s.json").write_text(text)
    asked = ["bake", str(graph), "--out", str(tmp_path / "x.bake"), "--settings", str(tmp_path / "s.json")]
    assert main(asked) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
    assert not (tmp_path / "x.bake").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--budget-ms", "0"], "budget: expected milliseconds above 0, found 0"),
        (["--budget-ms", "5,-1"], "budget: expected milliseconds above 0, found -1"),
        (["--budget-ms", "nan"], "budget: expected milliseconds above 0"),
        (["--budget-ms", "1e-9"], "which an empty frame takes"),
        (["--budget-ms", "ten"], "expected a number"),
        (["--image", "640"], "expected WIDTHxHEIGHT"),
        (["--image", "0x5"], "expected at least 1x1"),
        (["--fov", "180"], "fov: expected degrees"),
        (["--frames", "0"], "expected a whole number from 1"),
        (["--always", "IfcDragon"], "kinds: expected"),
        (["--path", "nowhere.csv"], "nowhere.csv"),
        (["--samples", "nowhere.csv"], "nowhere.csv"),
    ],
)
def test_tune_refuses_in_one_line(options, said, office, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(tuning, "SAMPLE_FRAMES", 4)
    out = tmp_path / "out"
    assert main(["tune", "lod", str(office / "office.bake"), *FAST, "--out", str(out), *options]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
    assert not out.exists()


def test_tune_refuses_bare_graphs_and_files_in_its_way(baked, office, tmp_path, capsys):
    assert main(["tune", "lod", str(baked), *FAST]) == 2
    assert "expected the bake of a model" in capsys.readouterr().err
    (tmp_path / "out").write_text("mine")
    assert main(["tune", "lod", str(office / "office.bake"), *FAST, "--out", str(tmp_path / "out")]) == 2
    assert (tmp_path / "out").read_text() == "mine"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x,y,z,yaw,pitch\n1,2,3,4,5\n", "expected the column 't'"),
        ("x,y,z,yaw,pitch,t\n", "at least one frame"),
        ("x,y,z,yaw,pitch,t\n1,2,3,4,5,6\n1,2,3,4,5,6\n", "expected t to ascend"),
        ("x,y,z,yaw,pitch,t\n1,2,a,4,5,6\n", "expected numbers"),
        ("x,y,z,yaw,pitch,t\n1,2,nan,4,5,6\n", "expected finite numbers"),
    ],
)
def test_refuses_paths_that_lead_nowhere(text, said, tmp_path):
    (tmp_path / "path.csv").write_text(text)
    with pytest.raises(InputError, match=said):
        read_path(tmp_path / "path.csv")


def test_interrupted_tuning_leaves_nothing(office, tmp_path, monkeypatch):
    out = tmp_path / "out"

    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("viewcell.workbench.tune.lod.html_page", interrupt)
    assert main(["tune", "lod", str(office / "office.bake"), *FAST, "--out", str(out)]) == 130
    assert not list(out.iterdir())


def outcome(method, coherent, lost, switches, misses=0.0, budget=10.0):
    return Outcome(method, coherent, budget, 9, lost, lost, 1.0, switches, switches / 100, misses, None, 1.0, 0)


def test_recommendation_follows_its_rule():
    late = outcome("kernel", False, 0.0, 0.1, misses=0.02)
    wild = outcome("kernel, not improved", False, 0.001, 9.0)
    good, worse = outcome("literal greedy", True, 0.01, 1.5), outcome("incremental greedy", True, 0.02, 1.0)
    subset = outcome(HIGHS, False, 0.0, 0.0)
    assert recommend([late, wild, worse, good, subset])[:2] == ("literal greedy", True)
    # Where all change much, what changes no more than half as much again as the calmest counts as calm.
    wilder = [outcome("kernel", True, 0.01, 14.0), outcome("literal greedy", True, 0.001, 16.0), worse]
    assert recommend([*wilder[:2], outcome("incremental greedy", True, 0.02, 10.0)])[:2] == ("kernel", True)
    assert recommend([late])[:2] == ("kernel", False)
