"""Depth meshes are measured: what a bake's view cells come to, in lines beside the published ones."""

import pytest
from builders.far_bake import TRIANGLES, far_bake
from viewcell.kernels.launch import Device
from viewcell.workbench.bench import depth
from viewcell.workbench.bench.__main__ import main


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return far_bake(tmp_path_factory.mktemp("far"))


@pytest.fixture(autouse=True)
def few(monkeypatch):
    for name, value in (("TEXELS", 500), ("RAYS", 500), ("FRAMES", 3), ("CACHES", (1_000_000, 2_000_000))):
        monkeypatch.setattr(depth, name, value)


def test_view_cells_are_measured(made):
    measured = depth.measure_cells(made, TRIANGLES, Device())
    assert [one.cell for one in measured] == [0, 1]
    for one in measured:
        assert one.check.texels == one.check.rays == 500 == one.check.tenths.sum() and one.check.over == 0
        assert one.check.tenths[10] == 0 and one.check.tenths.argmax() < 9
        assert one.bytes > 0 and one.coarse_texels > 0 and one.seconds[0] > 0
    lines = {line.what: line for line in depth.cell_lines(measured, 2)}
    assert lines["texels off by more"].ours == "0 of 1,000"
    assert lines["triangles of a view cell's meshes"].published == "10,000"


def test_what_is_left_is_what_is_drawn(made):
    measured = depth.measure_cells(made, TRIANGLES, Device())
    lines = depth.reduction_lines(made, measured)
    assert [line.what for line in lines[:4]] == [
        "textured depth meshes",
        "view frustum",
        "occlusion",
        "level of detail",
    ]
    shares = [float(line.ours.split()[0]) / 100 for line in lines[:4]]
    assert all(0 <= share <= 1 for share in shares) and shares[0] > 0.5
    left = float(lines[4].note.split()[0].replace(",", ""))
    assert left < 40 * 1280 * (1 - shares[0])


def test_the_command(made, tmp_path, capsys):
    plot = tmp_path / "graphs.png"
    assert main(["depth", str(made.folder), "--triangles", str(TRIANGLES), "--plot", str(plot)]) == 0
    assert plot.read_bytes().startswith(b"\x89PNG")
    said = capsys.readouterr().out
    assert "MB read with a cache of 2 MB (Graph 3)" in said and "likewise, with depth meshes" in said
    assert all(len(line) <= 160 for line in said.splitlines())
    assert main(["depth", str(made.folder), "--triangles", "1000000"]) == 0
    assert "they pay in none of 2 view cells" in capsys.readouterr().out
