"""The benchmark: what it writes, what it refuses, what it finds, and that a broken kernel is told."""

import json
from dataclasses import replace

import numpy as np
import pytest
from builders import four_rooms
from scipy.stats import linregress
from viewcell.data.errors import InputError
from viewcell.data.verdict import Verdict
from viewcell.kernels.launch import CPU
from viewcell.workbench.bench import against, growth, suite
from viewcell.workbench.bench import run as benches
from viewcell.workbench.bench.rows import meshes as rows_meshes
from viewcell.workbench.bench.rows import portals as rows_portals
from viewcell.workbench.bench.rows import shadow as rows_shadow
from viewcell.workbench.bench.run import bench
from viewcell.workbench.bench.suite import KERNELS, Case, Errors, Noise, make_cases, measure
from viewcell.workbench.cli import main

ROW = (
    "kernel scene method device n ms_median ms_min ms_max compile_ms wrong_hidden wrong_visible unknown_pct "
    "overestimate gap error baseline ratio peak_mb"
).split()
SMALL = {
    "stab": (40, 80),
    "flood": (24,),
    "target": (24,),
    "shadow": (100,),
    "coverage": (50,),
    "backface": (20,),
    "shaft": (60,),
    "rays": (100, 300),
    "raster": (1_200,),
    "deviation": (80,),
    "select": (20, 40),
    "tour": (60,),
    "runs": (60,),
    "eye": (4,),
    "lookahead": (4,),
    "reads": (4,),
    "projection_point": (4,),
}


@pytest.fixture
def small(monkeypatch):
    """Sizes of a moment, and baselines that run once."""
    monkeypatch.setitem(suite.SIZES, "quick", SMALL)
    monkeypatch.setattr(suite, "BASELINE_S", 0.0)
    monkeypatch.setattr(suite, "SHORT_S", 0.0)
    monkeypatch.setattr(suite, "REPEATS", 3)
    monkeypatch.setattr(rows_meshes, "JUDGED_PIXELS", 6)
    # A test run's heap is large.
    monkeypatch.setattr(suite.gc, "collect", lambda: 0)


@pytest.fixture
def run_of():
    """A run as JSON holds it: rows with the given changes."""

    def make(*changes):
        plain = dict.fromkeys(ROW) | {
            "kernel": "stab",
            "scene": "lists",
            "method": "kernel",
            "device": "cpu",
            "n": 10,
            "ms_median": 10.0,
            "ms_min": 9.0,
            "ms_max": 12.0,
            "compile_ms": 1.0,
            "wrong_hidden": 0,
            "wrong_visible": 0,
            "unknown_pct": 1.0,
            "overestimate": 1.5,
            "baseline": "HiGHS",
            "ratio": 2.0,
            "peak_mb": 1.0,
        }
        rows = [plain | {"n": n, **change} for n, change in enumerate(changes)]
        noise = [{"q1": 0.98 * row["ms_median"], "q3": 1.02 * row["ms_median"]} for row in rows]
        return {"machine": "here", "commit": "abc", "rows": rows, "noise": noise}

    return make


def test_json_has_these_keys_and_no_others(small, tmp_path, capsys):
    out = tmp_path / "run.json"
    assert main(["bench", "--only", "select,rays", "--json", str(out), "--no-progress"]) == 0
    found = json.loads(out.read_text(encoding="utf-8"))
    assert list(found) == ["machine", "commit", "version", "date", "suite", "rows", "noise", "growth"]
    assert [(row["kernel"], row["n"]) for row in found["rows"]] == [
        *(("rays", n) for n in (100, 300)), *(("select", n) for n in (20, 20, 40, 40))
    ]  # fmt: skip
    assert len(found["noise"]) == 6 and found["growth"] == [] and found["suite"] == "quick"
    for row, noise in zip(found["rows"], found["noise"], strict=True):
        assert list(row) == ROW
        assert 0 < row["ms_min"] <= noise["q1"] <= row["ms_median"] <= noise["q3"] and row["ms_median"] <= row["ms_max"]
        assert row["ratio"] > 0 and np.isfinite([row["peak_mb"], row["compile_ms"]]).all()
    assert found["rows"][0]["wrong_visible"] == 0 and found["rows"][0]["gap"] is None
    assert found["rows"][2]["wrong_hidden"] is None and 0 <= found["rows"][2]["gap"] < 0.1
    text = capsys.readouterr().out
    assert "embreex raw" in text and "HiGHS" in text
    assert max(map(len, text.splitlines()[:-1])) <= 160
    assert list(tmp_path.iterdir()) == [out]


def test_the_first_run_and_the_memory_of_the_second_are_told_apart(monkeypatch):
    """Compiling is by what the first run was longer than the median of those that count."""
    held, spent, peaks = [], iter([90.0, 5.0, 10.0, 30.0, 20.0, 8.0, 8.0, 8.0]), iter([100.0, 164.0])
    monkeypatch.setattr(suite, "REPEATS", 3)
    monkeypatch.setattr(suite, "SHORT_S", 0.0)
    monkeypatch.setattr(suite, "clock", lambda work, device: (next(spent), work()))
    monkeypatch.setattr(suite, "_peak_mb", lambda: next(peaks))
    judge = lambda answer: Errors(gap=0.0)  # noqa: E731
    case = Case("select", "none", "kernel", 3, lambda: held.append(1), judge, "HiGHS", list, 0.5, [])
    row, noise = measure(case, CPU)
    assert (row.ms_min, row.ms_median, row.ms_max) == (10.0, 20.0, 30.0) and noise.q1 < 20.0 < noise.q3
    assert row.compile_ms == pytest.approx(70.0, abs=5.0) and row.peak_mb == 64.0 and row.ratio == 0.8
    # Two runs that do not count, three that do.
    assert len(held) == 5


def test_memory_that_is_held_is_seen():
    with suite.PeakMemory() as large:
        held = np.ones(2**23)
    assert large.megabytes > 0.9 * held.nbytes / 1e6


def test_every_kernel_is_judged_and_none_hides_what_is_seen(small):
    result = bench()
    assert [*dict.fromkeys(row.kernel for row in result.rows)] == [*KERNELS]
    assert result.wrong_hidden == 0 and all(not row.wrong_visible for row in result.rows)
    assert {row.kernel for row in result.rows if row.wrong_hidden is not None} == {
        "stab", "flood", "target", "shadow", "coverage", "backface", "shaft", "raster", "eye"
    }  # fmt: skip
    assert max(map(len, result.text().splitlines())) <= 160


def answered(case, change):
    """Errors of the case's answer after a change to it."""
    return case.judge(change(case.work()))


def all_hidden(found):
    return replace(found, verdict=np.full_like(found.verdict, Verdict.HIDDEN))


@pytest.mark.parametrize(
    ("kernel", "n", "change"),
    [
        ("stab", 50, all_hidden),
        ("target", 24, all_hidden),
        ("shaft", 100, all_hidden),
        ("flood", 24, lambda found: (np.eye(len(found[0]), dtype=bool),) * 2),
        ("backface", 40, lambda found: (found[0] + 1, found[1])),
        ("raster", 1_200, lambda found: replace(found, ids=found.ids + 1)),
    ],
)
def test_a_judge_sees_what_is_wrongly_hidden(small, kernel, n, change):
    case = make_cases(kernel, n, CPU)[0]
    assert answered(case, change).wrong_hidden > 0


def test_judges_of_shadows_see_what_is_wrongly_hidden():
    umbra, shrink = make_cases("shadow", 100, CPU)
    moved = umbra.work()
    moved.limits[:, 3] = moved.planes[:, 3] = moved.far[:] = -1e9
    assert umbra.judge(moved).wrong_hidden > 0
    polygons = shrink.work()
    middle = polygons.corners.mean(axis=0)
    assert shrink.judge(replace(polygons, corners=middle + 3 * (polygons.corners - middle))).wrong_hidden > 0


def test_the_judge_of_maps_sees_what_is_wrongly_hidden(monkeypatch):
    case = make_cases("coverage", 50, CPU)[0]
    monkeypatch.setattr(rows_shadow, "launch_occludees", lambda maps, boxes, rows: np.full(len(rows), Verdict.HIDDEN))
    assert case.judge(case.work()).wrong_hidden > 0


def test_judges_of_rays_and_deviation_see_errors():
    rays = make_cases("rays", 300, CPU)[0]
    assert answered(rays, np.logical_not).wrong_visible > 0
    assert answered(rays, np.zeros_like).unknown_pct > 0
    deviation = make_cases("deviation", 80, CPU)[0]
    assert answered(deviation, lambda found: replace(found, upper=found.upper / 2)).error > 0.5


def test_judges_of_solvers_refuse_false_bounds():
    select = make_cases("select", 30, CPU)[0]
    with pytest.raises(AssertionError, match="bound"):
        answered(select, lambda found: replace(found, bound=found.bound * 0.9))
    with pytest.raises(AssertionError, match="at most"):
        answered(select, lambda found: replace(found, cost=found.cost * 2))
    point = make_cases("projection_point", 3, CPU)[0]
    assert answered(point, lambda found: replace(found, point=found.point + 100.0)).error > 0.01


def test_plain_references_agree_with_the_kernels():
    random = np.random.default_rng(0)
    shafts = make_cases("shaft", 60, CPU)[0]
    hidden, unsplit = shafts.work().verdict == Verdict.HIDDEN, shafts.reference()
    assert not (unsplit & ~hidden[: len(unsplit)]).any() and unsplit.any()
    backface = make_cases("backface", 60, CPU)[0]
    # Only closed shells are culled.
    culled = backface.work()[0]
    np.testing.assert_array_equal(culled[culled > 0], np.array(backface.reference())[culled > 0])
    outlines = rows_shadow.parallelograms(random, 50)
    corners = outlines.corners.reshape(-1, 4, 3)
    low = np.round(corners.mean(axis=1) + 3000 * outlines.normal).astype(int)
    cells = np.stack([low, low + 200], axis=1)
    umbras = rows_shadow.launch_umbra(cells, outlines, np.repeat(np.arange(50)[:, None], 2, axis=1))
    planes, offsets = rows_shadow.numpy_umbra(cells, corners)
    for k in np.flatnonzero(umbras.status == rows_shadow.USABLE):
        x = rows_shadow.points_behind(random, cells[k], corners[k])
        beyond = (x - corners[k, 0]) @ outlines.normal[k] < 0
        inside = beyond & (x @ planes[k].T >= offsets[k]).all(axis=1)
        np.testing.assert_array_equal(umbras.contains(k, x), inside)
    eye, triangles = np.array([0.5, 0.25, 0.125]), random.integers(-3000, 3000, (5, 3, 3))
    maps = rows_shadow.launch_coverage(
        eye[None], triangles.reshape(-1, 3).astype(float), np.arange(6) * 3, np.zeros(5, int), resolution=128
    )
    ours, plain = maps.depth(0), rows_shadow.numpy_coverage(eye, triangles.astype(float))
    assert np.isfinite(plain).any(axis=(1, 2)).sum() > 2
    assert (np.isfinite(ours) == np.isfinite(plain)).mean() > 0.999
    both = np.isfinite(ours) & np.isfinite(plain)
    np.testing.assert_allclose(ours[both], plain[both], rtol=1e-4)


def test_a_row_without_truth_is_none():
    case = Case("stab", "", "kernel", 1, int, lambda _: Errors(), "int", int, 1.0, [])
    with pytest.raises(ValueError, match="measures something"):
        measure(case, CPU)


def test_a_row_names_where_its_work_ran(small):
    elsewhere = replace(make_cases("stab", 40, CPU)[0], device="gpu")
    assert measure(elsewhere, CPU)[0].device == "gpu"
    assert measure(replace(elsewhere, device=None), CPU)[0].device == "cpu"


def test_a_broken_kernel_fails(small, monkeypatch, capsys, tmp_path):
    launch = rows_portals.launch_stab
    monkeypatch.setattr(rows_portals, "launch_stab", lambda *a, **k: all_hidden(launch(*a, **k)))
    assert main(["bench", "--only", "stab", "--no-progress"]) == 1
    assert "wrongly hidden; this is a bug" in capsys.readouterr().err


def test_graphs_are_flooded_too(small, tmp_path):
    for name in ("a", "b"):
        four_rooms.write_graph(tmp_path / name)
    found = bench(only=["rays"], graphs=tmp_path)
    assert [row.scene[0] for row in found.rows if row.kernel == "flood"] == ["a", "b"]
    assert found.wrong_hidden == 0
    with pytest.raises(InputError, match="expected cells"):
        bench(only=["rays"], graphs=tmp_path / "c")


def test_a_search_that_is_cut_short_still_refutes(monkeypatch):
    monkeypatch.setattr(rows_portals, "STEPS", 1)
    case = make_cases("flood", 100, CPU)[0]
    errors = case.judge(case.work())
    assert errors.wrong_hidden == 0 and errors.wrong_visible is None
    assert case.judge((np.eye(case.n, dtype=bool),) * 2).wrong_hidden > 0


def test_ctrl_c_leaves_nothing(small, monkeypatch, tmp_path, capsys):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(benches, "measure", interrupt)
    assert main(["bench", "--only", "rays", "--json", str(tmp_path / "x.json"), "--no-progress"]) == 130
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "wanted"),
    [
        (["--only", "stab,nothing"], "nothing"),
        (["--device", "cuda:99", "--only", "rays"], "cuda:99"),
        (["--json", "{tmp}"], "expected a file"),
        (["--json", "{tmp}/no/run.json"], "expected a file"),
        (["--against", "{tmp}/absent.json"], "--json, found No such file"),
        (["--against", "{tmp}/text.json"], "found no JSON"),
        (["--against", "{tmp}/bytes.json"], "found no JSON"),
        (["--against", "{tmp}/list.json"], "found no rows"),
        (["--against", "{tmp}/number.json"], "found no rows"),
        (["--against", "{tmp}/foreign.json"], "row 0"),
    ],
)
def test_bad_input_is_one_line(arguments, wanted, tmp_path, capsys):
    (tmp_path / "text.json").write_text("rows", encoding="utf-8")
    (tmp_path / "bytes.json").write_bytes(b"\xff\xfe\x00\x01")
    (tmp_path / "list.json").write_text("[1]", encoding="utf-8")
    (tmp_path / "number.json").write_text('{"rows": 1}', encoding="utf-8")
    (tmp_path / "foreign.json").write_text('{"rows": [{"kernel": "x"}]}', encoding="utf-8")
    assert main(["bench", *(text.format(tmp=tmp_path) for text in arguments), "--no-progress"]) == 2
    error = capsys.readouterr().err
    assert wanted in error and error.count("\n") == 1


@pytest.mark.parametrize(
    "change", [{"ms_median": 0}, {"ms_median": None}, {"ms_min": "1"}, {"gap": -1}, {"gap": "x"}, {"n": [1]}]
)
def test_foreign_numbers_are_refused(change, run_of, tmp_path):
    run = run_of({})
    run["rows"][0] |= change
    (tmp_path / "run.json").write_text(json.dumps(run), encoding="utf-8")
    with pytest.raises(InputError, match="row 0"):
        against.load_bench(tmp_path / "run.json")


def test_slower_beyond_noise(run_of):
    old = run_of({}, {}, {}, {})
    change = against.compare(old, run_of({"ms_median": 14.0}, {"ms_median": 10.9}, {"ms_median": 6.0}, {}))
    assert len(change.slower) == 1 and "n = 0" in change.slower[0] and "1.40 x" in change.slower[0]
    noisy = run_of({"ms_median": 14.0}, {}, {}, {})
    noisy["noise"][0] = {"q1": 9.0, "q3": 15.0}
    assert not against.compare(old, noisy).slower
    del noisy["noise"], old["noise"]
    assert against.compare(old, noisy).slower == []
    assert "nothing" in against.compare(old, old).text()


def test_looser_by_ratio_and_worst_first(run_of):
    old = run_of({}, {"gap": 1e-4}, {"overestimate": 1.0})
    change = against.compare(old, run_of({"unknown_pct": 4.0}, {"gap": 1.1e-4}, {"overestimate": 0.9}))
    assert [line.split(": ")[1] for line in change.looser] == [
        "unknown_pct 4.00 x, 1 to 4", "gap 1.10 x, 0.0001 to 0.00011"
    ]  # fmt: skip


def test_wrong_hidden_and_missing_rows_are_named(run_of):
    change = against.compare(run_of({}, {}, {}), run_of({}, {"wrong_hidden": 2}))
    assert len(change.wrong) == 1 and "n = 1" in change.wrong[0] and "2 wrongly hidden" in change.wrong[0]
    assert len(change.missing) == 1 and "n = 2" in change.missing[0]
    assert not against.compare(run_of({}, {}), run_of({}), only=["rays"]).missing
    assert against.compare(run_of(), run_of({"wrong_hidden": 1})).wrong
    assert "another machine" in against.compare(run_of() | {"machine": "there"}, run_of()).text()


def test_against_on_the_command_line(small, tmp_path, monkeypatch, capsys):
    out = tmp_path / "old.json"
    arguments = ["bench", "--only", "rays", "--no-progress"]
    assert main([*arguments, "--json", str(out)]) == 0
    old = json.loads(out.read_text(encoding="utf-8"))
    for row in old["rows"]:
        row["ms_median"] = row["ms_min"] = row["ms_max"] = row["ms_median"] / 1e6
    old["noise"] = [{"q1": 1.0, "q3": 1.0} for _ in old["rows"]]
    out.write_text(json.dumps(old), encoding="utf-8")
    assert main([*arguments, "--against", str(out)]) == 0
    assert "slower: rays" in capsys.readouterr().out
    assert main([*arguments, "--against", str(out), "--strict"]) == 1


def test_exponents_are_fitted():
    slope, error = growth.fit([10, 100, 1000], [3.0, 300.0, 30_000.0])
    assert slope == pytest.approx(2.0) and error == pytest.approx(0.0, abs=1e-9)
    sizes, ms = [10, 50, 200, 1000, 9000], [1.0, 20.0, 70.0, 100.0, 2000.0]
    wanted = linregress(np.log(sizes), np.log(ms))
    assert growth.fit(sizes, ms) == pytest.approx((wanted.slope, wanted.stderr))
    assert growth.fit([1, 10], [1.0, 10.0]) == (pytest.approx(1.0), None)


def test_growth_is_in_the_full_suite_alone(small, monkeypatch, capsys):
    monkeypatch.setitem(suite.SIZES, "full", dict.fromkeys(KERNELS, ()))
    for name, sizes in (("CELLS", (12, 24)), ("OFFICES", ((1, 1), (1, 2))), ("OBJECTS", (10, 100))):
        monkeypatch.setattr(growth, name, sizes)
    result = bench(suite="full")
    assert {(one.kernel, one.against) for one in result.growth} == {
        ("flood", "cells"), ("flood", "portals"), ("shaft", "occluders"),
        ("occlusion", "objects"), ("occlusion", "triangles"), ("select", "objects"),
    }  # fmt: skip
    assert all(len(one.sizes) == 2 and one.sizes[0] < one.sizes[1] for one in result.growth)
    assert "exponent" in result.text() and len(result.json()["growth"]) == 6


@pytest.mark.slow
def test_the_quick_suite():
    result = bench()
    assert result.wrong_hidden == 0
    # Three sizes each; flood, shadow and select with two methods.
    assert len(result.rows) == 3 * (len(KERNELS) + 3)
    assert max(map(len, result.text().splitlines())) <= 160
    assert isinstance(result.noise[0], Noise)
