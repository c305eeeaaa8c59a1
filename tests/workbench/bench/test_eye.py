"""The bench of eyes: the wedge keeps less than the frustum, drops nothing, and a broken one is found out."""

from dataclasses import replace

import numpy as np
import pytest
from builders.packed_house import packed_scene
from viewcell.workbench.bake.run import bake
from viewcell.workbench.bench import eye
from viewcell.workbench.bench.__main__ import main
from viewcell.workbench.bench.eye import measure_eye


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return bake(packed_scene(), tmp_path_factory.mktemp("looked") / "house.bake", threads=1)


def test_frames_are_measured(made, capsys):
    found = measure_eye(made, 40, 10, 500)
    means = {way: count.mean() for way, count in found.objects.items()}
    assert 0 < found.seen <= means["wedge"] <= means["wedge without sets"]
    assert means["wedge"] < means["boxes in the frustum"]
    assert found.dropped == 0 and 0 < found.looked <= 10 and len(found.each_ms) == 40
    assert main(["eye", str(made.folder), "--frames", "20", "--looked", "5", "--rays", "200"]) == 0
    assert "0 dropped" in capsys.readouterr().out


def test_what_is_dropped_is_found_out(made, monkeypatch):
    launch = eye.launch_eye

    def broken(*work, **options):
        found = launch(*work, **options)
        return replace(found, starts=np.zeros_like(found.starts), objects=found.objects[:0])

    monkeypatch.setattr(eye, "launch_eye", broken)
    assert measure_eye(made, 20, 5, 200).dropped > 0
    assert main(["eye", str(made.folder), "--frames", "20", "--looked", "5", "--rays", "200"]) == 1
