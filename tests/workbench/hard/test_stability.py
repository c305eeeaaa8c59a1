"""Kernels as numbers get hard: the cases against the exact twins, the table, and that a broken kernel is seen."""

import json
from dataclasses import replace

import numpy as np
import pytest
from viewcell.data.errors import InputError
from viewcell.data.scene import GRID_LIMIT
from viewcell.data.verdict import Verdict
from viewcell.kernels.sightline import device_triangles, launch_confirm
from viewcell.kernels.target import launch_target_search
from viewcell.verify.cases.hard_cases import faces
from viewcell.verify.exact.region import box_faces, region_visible
from viewcell.workbench.cli import main
from viewcell.workbench.hard import searches, stability
from viewcell.workbench.hard.stability import FLOAT32, edge_case, measure_stability, slit_case, stab_case, thin_case


def check_region(case):
    """At least one face of the target is seen, or none is."""
    occluders = [face for shape in case.occluders for face in faces(shape)]
    verdicts = {region_visible(case.cell, face, occluders).verdict for face in box_faces(*case.target)}
    assert Verdict.UNKNOWN not in verdicts
    assert (Verdict.VISIBLE in verdicts) == (case.expected == "visible")


@pytest.mark.parametrize("gap", [1, 16, 256])
def test_slits_and_overlaps_are_what_they_say(gap):
    random = np.random.default_rng(gap)
    for visible in (True, False, True):
        check_region(slit_case(random, gap, 2**20, visible))


@pytest.mark.parametrize("aspect", [1, 64, 4096])
def test_thin_walls_are_what_they_say(aspect):
    random = np.random.default_rng(aspect)
    for visible in (True, False):
        check_region(thin_case(random, aspect, visible))


def test_portals_come_open_and_shut():
    random = np.random.default_rng(0)
    assert {stab_case(random, 8, 0, i).expected for i in range(20)} == {"open", "none"}


def test_an_edge_is_where_float64_puts_it():
    random = np.random.default_rng(0)
    assert [edge_case(random, 0.25, 2**10, side).expected for side in (True, False)] == ["clear", "blocked"]
    # 2**-40 beside 2**23 is nothing in float64.
    assert edge_case(random, 2.0**-40, 2**23, True).expected == "graze"


def test_kernels_are_never_wrong_and_refuse_what_lies_beyond_the_grid(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(stability, "CASES", 6)
    monkeypatch.setattr(stability, "OFFSETS", (0, 2**20, 2**25))
    assert main(["curves", "--stability", "--out", str(tmp_path), "--no-progress"]) == 0
    said = capsys.readouterr().out
    rows = json.loads((tmp_path / "stability.json").read_text())
    judged = [row for row in rows if row["kernel"] != FLOAT32]
    assert not any(row["wrong"] for row in judged)
    far = [row for row in judged if row["knob"] == "offset, m" and row["value"] > GRID_LIMIT / 1024]
    assert len(far) == 6 and all(row["refused"] for row in far)
    assert any(row["wrong"] for row in rows if row["kernel"] == FLOAT32)
    assert "from 32,768" in said and (tmp_path / "stability.png").read_bytes().startswith(b"\x89PNG")


def test_a_broken_kernel_is_seen(monkeypatch):
    monkeypatch.setattr(stability, "OFFSETS", ())
    monkeypatch.setattr(stability, "ASPECTS", ())
    monkeypatch.setattr(stability, "DISTANCES", ())

    def hiding(*arguments, **options):
        found = launch_target_search(*arguments, **options)
        return replace(found, verdict=np.zeros_like(found.verdict))

    monkeypatch.setattr(searches, "launch_target_search", hiding)
    rows = measure_stability(cases=4)
    assert all(row.wrong for row in rows if row.kernel == "launch_target_search")


def test_coordinates_beyond_the_grid_are_refused():
    far = np.array([[[0, 0, 0], [GRID_LIMIT + 1, 0, 0], [0, 1, 0]]])
    with pytest.raises(InputError, match="coordinates: expected at most 16777216 grid steps"):
        device_triangles(far, np.zeros(1, int))
    scene = device_triangles(np.minimum(far, 9), np.zeros(1, int))
    with pytest.raises(InputError, match="found 16777218"):
        launch_confirm(scene, np.zeros((1, 3)), np.full((1, 3), GRID_LIMIT + 2.0), np.array([-1]))
    with pytest.raises(InputError, match="found nan"):
        launch_confirm(scene, np.zeros((1, 3)), np.full((1, 3), np.nan), np.array([-1]))


def test_bad_arguments_are_told_in_one_line(tmp_path, capsys):
    for more in ([], [str(tmp_path), "--stability"], ["--stability", "--device", "abacus"]):
        assert main(["curves", *more]) == 2
        assert capsys.readouterr().err.count("\n") == 1
