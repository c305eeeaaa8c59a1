"""What random eyes miss: measured on a small office, told, drawn, and how a wrongly hidden pair ends it."""

import json
import shutil

import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from viewcell.data.buildings.office import make_office
from viewcell.data.errors import InputError
from viewcell.verify.rays import solid_angles, unions
from viewcell.workbench.bake.run import bake
from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.baked import load
from viewcell.workbench.cli import main
from viewcell.workbench.curves.eyes import EyesMissed, decade_text, eyes_lines, eyes_missed
from viewcell.workbench.verify import replay


@pytest.fixture(scope="module")
def baked(tmp_path_factory):
    out = tmp_path_factory.mktemp("eyes") / "o.bake"
    bake(make_office(floors=1, rooms_per_side=2), out, settings=Settings(method="portals"), threads=1)
    return out


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(unions, "FRAME_EYES", 2)
    monkeypatch.setattr(unions, "FRAME_PIXELS", 32)
    monkeypatch.setattr(solid_angles, "SAMPLES", ((1 << 9, 0.3), (1 << 12, 0.3)))


def test_the_command_tells_draws_and_writes(baked, tmp_path, capsys):
    arguments = ["curves", str(baked), "--eyes", "--cells", "2", "--pixels", "8,32"]
    assert main([*arguments, "--out", str(tmp_path / "a"), "--no-progress"]) == 0
    said = capsys.readouterr().out
    found = json.loads((tmp_path / "a" / "eyes.json").read_text())
    assert [(one["pixels"], one["eyes"]) for one in found["unions"]] == [(p, n) for p in (8, 32) for n in unions.EYES]
    for pixels in (8, 32):
        missed = [one["missed"] for one in found["unions"] if one["pixels"] == pixels]
        assert missed == sorted(missed, reverse=True) and missed[0] > missed[-1]
    coarse, fine = (next(one for one in found["unions"] if one["pixels"] == pixels) for pixels in (8, 32))
    assert 0 < fine["missed"] < coarse["missed"] < 1 and fine["pixels_missed"] < coarse["pixels_missed"] < 1
    assert found["wrong_hidden"] == 0 and sum(one["pairs"] for one in found["grades"]) <= found["pairs"]
    assert "union of 125 random eyes" in said and "0 hidden wrongly" in said
    assert (tmp_path / "a" / "eyes.png").read_bytes().startswith(b"\x89PNG")
    # The same again, but for the seconds.
    assert main([*arguments, "--out", str(tmp_path / "b"), "--no-progress"]) == 0
    again = json.loads((tmp_path / "b" / "eyes.json").read_text())
    for one in (*found["unions"], *again["unions"]):
        del one["seconds"]
    assert again == found


def planted(baked, folder, verdict):
    """A copy of the bake that hides, or knows nothing of, the object that its first cell sees most easily."""
    copy = folder / "copy.bake"
    shutil.copytree(baked, copy)
    made = load(baked)
    cell = int(np.flatnonzero(made.graph.inhabitable)[0])
    floor = int(np.flatnonzero(made.potential_objects[cell])[0])
    table = pq.read_table(copy / "cell_to_object.parquet")
    own = pc.and_(pc.equal(table["cell_id"], cell), pc.equal(table["object_id"], floor))
    if verdict == "hidden":
        table = table.filter(pc.invert(own))
    else:
        verdicts = pc.if_else(own, "unknown", pc.cast(table["verdict"], "string"))
        place = table.column_names.index("verdict")
        table = table.set_column(place, "verdict", pc.cast(verdicts, table.schema.field("verdict").type))
    pq.write_table(table, copy / "cell_to_object.parquet")
    return copy, cell, floor


def test_what_is_hidden_though_eyes_see_it_fails(baked, tmp_path, capsys):
    copy, cell, floor = planted(baked, tmp_path, "hidden")
    arguments = ["curves", str(copy), "--eyes", "--cells", "9", "--pixels", "16", "--no-progress"]
    assert main([*arguments, "--out", str(tmp_path / "out")]) == 1
    said = capsys.readouterr()
    assert "1 hidden wrongly" in said.out and "this is a bug" in said.err and f"object {floor}" in said.err
    found = json.loads((tmp_path / "out" / "eyes.json").read_text())
    assert found["wrong_hidden"] == 1 and f"cell {cell}" in found["pair"]
    assert not replay(found["case"]).ok


def test_what_is_unknown_though_eyes_see_it_is_counted(baked, tmp_path):
    copy, *_ = planted(baked, tmp_path, "unknown")
    whole, found = (eyes_missed(load(one), cells=9, pixels=(16,)) for one in (baked, copy))
    assert (found.beyond, found.confirmed, found.pairs) == (whole.beyond + 1, whole.confirmed + 1, whole.pairs - 1)
    assert found.wrong_hidden == 0


def test_only_models_can_be_looked_at(graph, tmp_path, capsys):
    assert main(["bake", str(graph), "--out", str(tmp_path / "g.bake"), "--no-progress"]) == 0
    capsys.readouterr()
    assert main(["curves", str(tmp_path / "g.bake"), "--eyes", "--no-progress"]) == 2
    assert "expected the bake of a model" in capsys.readouterr().err


def test_unusable_resolutions_are_told_in_one_line(baked, capsys):
    for pixels in ("0", "128,99999"):
        assert main(["curves", str(baked), "--eyes", "--pixels", pixels, "--no-progress"]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    with pytest.raises(InputError, match="expected a resolution"):
        eyes_missed(load(baked), pixels=())


def test_what_is_left_out_is_said():
    said = eyes_lines(EyesMissed("house", [1], 2, 5, [], [], 3, 1, 0, 0))
    assert "3 pairs without a witness" in said and "1 unknown that are visible" in said and "2 cells left out" in said


def test_decades_in_words():
    assert [decade_text(low) for low in (None, -5, -1)] == ["below 10⁻⁶ or not measured", "10⁻⁵ to 10⁻⁴", "above 10⁻¹"]
