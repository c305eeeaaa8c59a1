"""Tuning of a bake: what is compared, with given times, and the files that it leaves."""

import json
from dataclasses import replace

import numpy as np
import pytest
from builders.furnished_rooms import furnished_rooms
from viewcell.data.store.scene_folder import write_scene
from viewcell.kernels.launch import Device
from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.bake.settings_file import read_settings
from viewcell.workbench.cli import main
from viewcell.workbench.tune import bake as tune
from viewcell.workbench.tune.bake import asked_settings, compared
from viewcell.workbench.tune.bake_words import says, tuning_text, write_tuning
from viewcell.workbench.tune.choice import AS_TIGHT, LOOSER, TIGHTER, Row
from viewcell.workbench.tune.trial import run_trial


@pytest.fixture(scope="module")
def scene():
    return furnished_rooms()


@pytest.fixture(scope="module")
def default(scene):
    return run_trial(scene, Settings(), Device(threads=1)).answer


@pytest.fixture(scope="module")
def known():
    """Trials by settings: each is run once."""
    return {}


@pytest.fixture
def timed(monkeypatch, scene, known):
    """Tunes with given seconds by setting, without a clock: `timed({"--threshold 1": 5.0}) -> BakeTuning`."""

    def given(seconds, tries, answers=lambda settings, answer: answer):
        def run(scene, settings, device, sample=None, most_s=np.inf):
            if settings not in known:
                known[settings] = run_trial(scene, settings, device, sample)
            found = known[settings]
            name = (
                "default"
                if settings == Settings()
                else next(n for n, c in tries.items() if replace(Settings(), **c) == settings)
            )
            return replace(found, seconds=seconds[name], answer=answers(name, found.answer))

        monkeypatch.setattr(tune, "run_trial", run)
        monkeypatch.setattr(tune, "neighbours", lambda *_: list(tries.values()))
        monkeypatch.setattr(tune, "RAYS", 2_000)
        return tune.tune_bake(scene, threads=1)

    return given


def test_a_faster_setting_that_is_as_tight_is_recommended_and_written(timed, tmp_path):
    tries = {"both": {"method": "both"}, "large": {"largest_cell": 1.0}}
    found = timed({"default": 10.0, "both": 7.0, "large": 15.0}, tries)
    assert found.chosen.name == "--method both" and found.chosen.ratios == [0.7] * tune.ROUNDS
    assert [row.hidden for row in found.rows] == [0, 0, 0] and found.rows[2].tightness == TIGHTER
    assert len(found.rows[2].ratios) == 1
    file = write_tuning(found, tmp_path / "t")
    first = file.read_text().splitlines()[0]
    assert first.startswith('{"says": "Changes the method from auto to both') and "the default: 10 s" in first
    content = json.loads(file.read_text())
    assert content["default"]["object_pairs"] == found.rows[0].pairs and content["settings"] == {"method": "both"}
    assert sorted(path.suffix for path in (tmp_path / "t").iterdir()) == [".html", ".json", ".png"]
    assert "recommended: Changes the method" in tuning_text(
        found
    ) and "If time matters less: --largest-cell 1" in tuning_text(found)


def test_nothing_better_keeps_the_default_and_says_so(timed, tmp_path):
    found = timed({"default": 10.0, "both": 10.2}, {"both": {"method": "both"}})
    assert found.chosen is found.rows[0] and says(found).startswith("Keeps the default (method auto): nothing tried")
    assert read_settings(write_tuning(found, tmp_path / "t")).settings == {"method": "auto"}


def test_a_setting_that_hides_what_is_seen_is_never_recommended(timed):
    def broken(name, answer):
        if name != "portals":
            return answer
        return replace(answer, objects=answer.objects.take(np.arange(len(answer.objects)) > 9))

    found = timed({"default": 10.0, "portals": 1.0}, {"portals": {"method": "portals"}}, broken)
    assert found.chosen is found.rows[0] and found.rows[1].hidden > 0 and found.wrong_hidden > 0
    assert "This is a bug" in tuning_text(found)


def test_the_same_cells_are_compared_pair_for_pair(default):
    points = default.graph.cells[default.graph.inhabitable].mean(axis=1)
    fewer = replace(default, objects=default.objects.take(np.arange(len(default.objects)) > 0))
    assert [compared(one, default, points)[1] for one in (default, fewer)] == [AS_TIGHT, TIGHTER]
    assert compared(default, fewer, points)[1] == LOOSER
    assert compared(replace(fewer, cell_pairs=default.cell_pairs + 1), default, points)[1] == LOOSER
    share = len(default.objects) / default.graph.inhabitable.sum() / len(default.scene.objects)
    assert compared(default, default, points)[0] == pytest.approx(share)


def test_other_cells_are_compared_at_the_same_points(scene, default):
    cut = run_trial(scene, Settings(largest_cell=1.0), Device(threads=1)).answer
    points = tune._points(default.graph, 0)
    kept, tightness, uncovered = compared(cut, default, points)
    assert kept < compared(default, default, points)[0] and tightness == TIGHTER and uncovered == 0.0
    assert compared(default, cut, points)[1] == LOOSER
    part = replace(
        cut,
        graph=replace(
            cut.graph, inhabitable=cut.graph.inhabitable & (np.arange(cut.graph.cell_count) > cut.graph.cell_count // 2)
        ),
    )
    assert compared(part, default, points)[2] > 0


def test_settings_of_a_file_are_those_that_differ():
    assert asked_settings(Settings()) == {"method": "auto"}
    assert asked_settings(Settings(doors="closed", depth=3)) == {"method": "auto", "doors": "closed", "depth": 3}


def test_a_stopped_or_unusable_row_is_told(timed, tmp_path):
    found = timed({"default": 10.0}, {})
    found.rows.append(Row("--depth 3", {"depth": 3}, [25.0], [2.5], stopped=True))
    found.rows.append(Row("--depth 4", {"depth": 4}, unusable="cannot be had"))
    text = tuning_text(found)
    assert "more than 2.50" in text and "slower, stopped" in text and "cannot be had" in text
    rows = json.loads(write_tuning(found, tmp_path / "t").read_text())["rows"]
    assert rows[0]["object_pairs"] is None and rows[1]["seconds"] == []


@pytest.mark.slow
def test_a_tuning_from_end_to_end(scene, tmp_path, capsys):
    write_scene(scene, tmp_path / "o.scene")
    out = tmp_path / "t"
    assert main(["tune", str(tmp_path / "o.scene"), "--budget", "20", "-o", str(out), "--no-progress"]) == 0
    said = capsys.readouterr().out
    assert "the default" in said and "--method portals" in said and "recommended: " in said
    settings = read_settings(out / "tune-bake.json")
    assert settings.line == json.loads((out / "tune-bake.json").read_text())["says"]


def test_unusable_input_is_one_line_and_writes_nothing(graph, tmp_path, capsys):
    for arguments, told in (
        ([str(graph)], "expected a model to tune on, found a bare graph"),
        ([str(tmp_path / "none.ifc")], "none.ifc"),
        ([str(graph), "--budget", "0"], "budget"),
    ):
        assert main(["tune", *arguments, "-o", str(tmp_path / "t"), "--no-progress"]) == 2
        said = capsys.readouterr().err
        assert told in said and said.count("\n") == 1
    assert not (tmp_path / "t").exists()
