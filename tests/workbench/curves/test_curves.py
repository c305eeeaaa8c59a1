"""Curves of time against error: what is swept, what is told, and that methods that hide what is seen are found."""

from dataclasses import replace

import numpy as np
import pytest
from viewcell.data.buildings.office import make_office
from viewcell.data.errors import InputError
from viewcell.verify.rays import solid_angles, unions
from viewcell.workbench.bake.run import bake
from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.baked import load
from viewcell.workbench.cli import main
from viewcell.workbench.curves import plot as plots
from viewcell.workbench.curves import sweep as sweeps
from viewcell.workbench.curves.plot import curve_lines, curves_plot, write_curves
from viewcell.workbench.curves.series import Curves, Point, Series, read_curves
from viewcell.workbench.curves.sweep import sweep
from viewcell.workbench.verify import seen_by_rays


@pytest.fixture(scope="module")
def baked(tmp_path_factory):
    out = tmp_path_factory.mktemp("curves") / "o.bake"
    bake(make_office(floors=1, rooms_per_side=2), out, settings=Settings(method="portals"), threads=1)
    return out


@pytest.fixture
def quick(monkeypatch):
    small = {"THRESHOLDS_M2": (0.0,), "SPLITS": (2,), "SIDES_M": (1.0,), "SHARES": (0.2,), "RESOLUTIONS": (32,)}
    for name, values in (small | {"CLUSTERS": (1,), "RAYS": (100, 10_000), "GRAPH_RAYS": (10, 1_000)}).items():
        monkeypatch.setattr(sweeps, name, values)
    monkeypatch.setattr(unions, "FRAME_PIXELS", 32)
    monkeypatch.setattr(solid_angles, "SAMPLES", ((1 << 9, 0.3),))


@pytest.mark.slow
def test_every_knob_of_a_model_is_swept(baked, quick, tmp_path, capsys):
    assert main(["curves", str(baked), "--cells", "2", "--pixels", "8", "--out", str(tmp_path), "--no-progress"]) == 0
    said = capsys.readouterr().out
    found = read_curves(tmp_path / "curves.json")
    methods = {(one.method, one.knob): one for one in found.series}
    assert {method for method, _ in methods} == {
        "portals alone",
        "occluders alone",
        "both",
        "projection points",
        "sampling alone",
        "levels of detail",
        "occluders, all cells",
    }
    assert all(p.error >= 1 and p.wrong_hidden == 0 for one in found.safe for p in one.points)
    # More time never makes it looser.
    early, late = sorted(methods["occluders, all cells", "budget, share"].points, key=lambda p: p.value)
    assert early.error >= late.error and late.unknown < 0.3
    few, many = methods["sampling alone", "rays per cell"].points
    assert few.error < many.error < 1 and few.wrong_hidden > many.wrong_hidden > 0
    shares = [p.error for p in methods["levels of detail", "pixels"].points]
    assert shares == sorted(shares, reverse=True) and shares[-1] < 1
    assert "union of 125 random eyes" in said and (tmp_path / "eyes.json").exists()
    assert "sampling alone, rays per cell" in said and (tmp_path / "curves.png").read_bytes().startswith(b"\x89PNG")
    assert "NaN" not in (tmp_path / "curves.json").read_text()


def test_a_bare_graph_is_swept_by_portals_and_rays(graph, quick, tmp_path):
    assert main(["bake", str(graph), "--out", str(tmp_path / "g.bake"), "--no-progress"]) == 0
    found = sweep(load(tmp_path / "g.bake"))
    assert [one.method for one in found.series] == ["portals alone", "sampling alone"]
    assert found.series[0].points[0].error == 1.0
    few, many = found.series[1].points
    assert many.wrong_hidden < few.wrong_hidden < 14


@pytest.mark.slow
def test_a_method_that_hides_what_is_seen_fails(baked, quick, tmp_path, monkeypatch):
    honest = sweeps.bake

    def hiding(*arguments, **options):
        made = honest(*arguments, **options)
        if options["settings"].method == "vlod":
            made.__dict__["potential_objects"] = np.zeros_like(made.potential_objects)
        return made

    monkeypatch.setattr(sweeps, "bake", hiding)
    for name in ("THRESHOLDS_M2", "SPLITS", "SIDES_M", "SHARES", "CLUSTERS"):
        monkeypatch.setattr(sweeps, name, ())
    few = ["--cells", "1", "--pixels", "8"]
    assert main(["curves", str(baked), *few, "--out", str(tmp_path), "--no-progress"]) == 1


def test_rays_see_no_more_than_is_potential_and_leave_the_bake_alone(baked):
    made = load(baked)
    cells, objects = seen_by_rays(made, 50_000)
    assert not (objects & ~made.potential_objects).any() and not (cells & ~made.potential_cells).any()
    assert objects.sum() > 0.3 * made.potential_objects.sum()
    assert not made.potential_objects.all()


def test_the_front_leaves_out_what_is_of_other_cells():
    points = [Point(1.0, seconds, error, 0.0, 0) for seconds, error in ((1, 2.0), (2, 1.5), (3, 1.6))]
    assert Curves("", [Series("a", "k", points)], 1).front == points[:2]
    better = [Point(1.0, 0.1, 1.0, 0.0, 0)]
    apart, unsafe = (
        Series("b", "k", better, apart=True),
        Series("c", "k", [replace(better[0], wrong_hidden=1), *better]),
    )
    timeless = Series("d", "k", [replace(better[0], seconds=np.nan), replace(better[0], error=np.nan)])
    curves = Curves("", [Series("a", "k", points), apart, unsafe, timeless], 1)
    assert curves.front == points[:2]
    assert apart not in curves.compared and apart in curves.safe


def drawn(curves, monkeypatch):
    """Axes of the picture of some curves, by title."""
    found = []
    monkeypatch.setattr(plots, "png", lambda figure: found.append(figure) or b"")
    curves_plot(curves)
    return {axes.get_title().partition("\n")[0]: axes for axes in found[0].axes}


def test_nothing_beats_the_front_in_the_panel_that_shows_it(monkeypatch):
    """Points of other view cells, which would, have a panel of their own, without the front."""
    slow = [Point(value, 2.0 + value, 1.5 - 0.1 * value, 0.0, 0) for value in (1.0, 2.0)]
    better = [Point(value, 0.1, 1.01 + 0.1 * value, 0.0, 0) for value in (1.0, 2.0)]
    panels = drawn(Curves("", [Series("a", "k", slow), Series("a", "smaller", better, apart=True)], 1), monkeypatch)
    assert list(panels) == ["the same view cells: nothing visible is hidden", "other view cells: not to be compared"]
    same, other = panels.values()
    front = {line.get_label(): line for line in same.lines}["Pareto front of this panel"]
    steps = list(zip(*front.get_data(), strict=True))
    for line in same.lines:
        for x, y in zip(*line.get_data(), strict=True):
            assert not any(x < s and y < e for s, e in steps)
    assert min(x for line in same.lines for x in line.get_xdata()) > 1 > max(x for x in other.lines[0].get_xdata())
    assert len(other.lines) == 1
    # Without such series there is no such panel.
    assert len(drawn(Curves("", [Series("a", "k", slow)], 1), monkeypatch)) == 1


def test_the_table_says_which_rows_are_of_other_view_cells():
    points = [Point(1.0, 1.0, 1.5, 0.0, 0)]
    said = curve_lines(Curves("o", [Series("a", "k", points), Series("b", "k", [replace(points[0])], apart=True)], 1))
    assert "a, k *" in said and "b, k (other view cells)" in said


def test_the_front_is_the_same_as_by_comparing_all_with_all():
    random = np.random.default_rng(3)
    for _ in range(50):
        points = [Point(0.0, float(s), float(e), 0.0, 0) for s, e in random.integers(1, 12, (12, 2))]
        beaten = [
            any(
                q.seconds <= p.seconds and q.error <= p.error and (q.seconds, q.error) != (p.seconds, p.error)
                for q in points
            )
            for p in points
        ]
        wanted = sorted({(p.seconds, p.error) for p, worse in zip(points, beaten, strict=True) if not worse})
        assert [(p.seconds, p.error) for p in Curves("", [Series("a", "k", points)], 1).front] == wanted


@pytest.mark.parametrize("text", ["", "[]", '{"scene": "a"}', '{"scene": "a", "pairs": 1, "series": [{}]}'])
def test_other_files_are_no_curves(text, tmp_path):
    path = tmp_path / "curves.json"
    path.write_text(text)
    with pytest.raises(InputError, match="curves"):
        read_curves(path)


def test_unusable_folders_are_told_in_one_line(baked, quick, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["curves", str(tmp_path), "--no-progress"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    with pytest.raises(InputError, match="expected a folder"):
        write_curves(Curves("a", [Series("sampling alone", "k", [])], 0), tmp_path / "file")
