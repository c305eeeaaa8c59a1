"""Tuning of projection points, end to end on a small office, and the files that it leaves."""

import json
import re
from contextlib import redirect_stdout
from io import StringIO

import pytest
from viewcell.data.buildings.office import make_office
from viewcell.workbench.bake.run import bake
from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.bake.settings_file import read_settings
from viewcell.workbench.cli import main
from viewcell.workbench.tune import points as tune_points
from viewcell.workbench.tune.candidates import Candidate, front_of


@pytest.fixture(scope="module")
def baked(tmp_path_factory):
    out = tmp_path_factory.mktemp("tune") / "o.bake"
    bake(make_office(floors=1, rooms_per_side=2), out, settings=Settings(method="portals"), threads=1)
    return out


@pytest.fixture(scope="module", autouse=True)
def quick():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tune_points, "CLUSTERS", (1, 6))
        patch.setattr(tune_points, "RESOLUTIONS", (64,))
        patch.setattr(tune_points, "EVALUATIONS", 4)
        yield


@pytest.fixture(scope="module")
def tuned(baked, quick, tmp_path_factory):
    """A tuning by the command line: the folder that it wrote, what it said, and what it had found."""
    folder, found = tmp_path_factory.mktemp("tuned") / "t", []

    def noted(*arguments, **options):
        found.append(honest(*arguments, **options))
        return found[0]

    honest = tune_points.tune_projection_point
    asked = ["tune", "projection-point", str(baked), "--cells", "2", "--out", str(folder), "--no-progress"]
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(StringIO()) as said:
        patch.setattr(tune_points, "tune_projection_point", noted)
        assert main(asked) == 0
    return folder, said.getvalue(), found[0]


def test_tuning_recommends_what_bake_takes(tuned):
    folder, said, _ = tuned
    assert "recommended: " in said and "Clarabel" in said
    content = json.loads((folder / "tune-projection-point.json").read_text())
    assert all(c["wrong hidden"] == 0 and c["potential / seen"] >= 1 for c in content["candidates"])
    names = {c["name"] for c in content["candidates"]}
    assert content["recommended"] in names and "6 clusters, culled, by COBYLA, 512 px" in names
    settings = read_settings(folder / "tune-projection-point.json").settings
    assert settings["method"] == "vlod" and settings["clusters"] in (1, 6, 26)
    page = (folder / "tune-projection-point.html").read_text()
    assert "data:image/png;base64," in page and not re.search(r"(src|href)=\"http", page)
    assert (folder / "tune-projection-point.png").read_bytes().startswith(b"\x89PNG")
    assert len(list(folder.iterdir())) == 3


def test_solvers_answer_the_same_programmes(tuned):
    _, _, found = tuned
    rows = {row.name: row for row in found.solvers}
    best = rows["interior point, JAX float64, batched"]
    assert best.gap < 1e-8 and best.violation_m < 1e-12 and re.fullmatch(r"\d+ solved", best.statuses)
    assert rows["random feasible point"].gap > 1e-3
    assert found.wrong_hidden == 0


def test_a_setting_that_hides_what_is_seen_fails(baked, tmp_path, capsys, monkeypatch):
    def hide(self, settings, chooser, boxes):
        hidden, stats = honest(self, settings, chooser, boxes)
        return hidden | True, stats

    honest = tune_points._Bench._hidden
    monkeypatch.setattr(tune_points._Bench, "_hidden", hide)
    asked = ["tune", "projection-point", str(baked), "--cells", "1", "--out", str(tmp_path / "t"), "--no-progress"]
    assert main(asked) == 1
    assert "hidden although seen" in capsys.readouterr().err


def test_a_bare_graph_has_no_occluders(graph, tmp_path, capsys):
    assert main(["bake", str(graph), "--out", str(tmp_path / "g.bake"), "--no-progress"]) == 0
    assert main(["tune", "projection-point", str(tmp_path / "g.bake"), "--out", str(tmp_path / "t")]) == 2
    assert "expected the bake of a model" in capsys.readouterr().err
    assert not (tmp_path / "t").exists()


def test_the_front_is_what_nothing_beats():
    points = [(1.0, 5.0), (2.0, 5.0), (2.0, 3.0), (3.0, 4.0), (4.0, 1.0), (4.0, 2.0)]
    front = front_of([Candidate("", "", *point) for point in points])
    assert [(c.time, c.error) for c in front] == [(1.0, 5.0), (2.0, 3.0), (4.0, 1.0)]


def test_the_fastest_of_nearly_the_best_is_recommended():
    points = [(1.0, 1.5), (2.0, 1.015), (9.0, 1.0)]
    assert tune_points.recommend([Candidate("", "", *point) for point in points]).time == 2.0
