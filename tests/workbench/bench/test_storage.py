"""The table of storage: every code counted on the same sets, and its command."""

import numpy as np
import pytest
from builders.packed_house import packed_scene
from viewcell.data.errors import InputError
from viewcell.data.store.bake_folder import read_bake
from viewcell.workbench.bake.run import bake
from viewcell.workbench.bench import storage
from viewcell.workbench.bench.__main__ import main
from viewcell.workbench.bench.rows import sets as rows
from viewcell.workbench.bench.storage import AS_PACKED, SAMPLED_ORDER, SCHEME, TOUR, measure_storage


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return bake(packed_scene(), tmp_path_factory.mktemp("stored") / "house.bake", threads=1)


def test_orders_and_codes_are_told(made, capsys, monkeypatch):
    found = measure_storage(made)
    assert found.runs[TOUR] <= min(found.runs.values()) and SAMPLED_ORDER in found.runs
    assert found.sizes["bitmasks"] == found.view_cells * -(-found.objects // 8)
    assert set(found.sizes) >= {SCHEME, AS_PACKED, "sets, tour, varints"}
    assert found.fewer("random") == 0 and found.below("bitmasks") == 1 and found.runs_us > 0
    # What is left out where there are too many columns.
    monkeypatch.setattr(storage, "sampled_order", lambda sets: None)
    assert main(["storage", str(made.folder)]) == 0
    said = capsys.readouterr().out
    assert "tour of sets" in said and SAMPLED_ORDER not in said and SCHEME not in said


def test_bare_graphs_have_no_objects(baked):
    with pytest.raises(InputError, match="without objects"):
        measure_storage(read_bake(baked))


def test_judges_see_what_is_wrong():
    sets, _ = rows.seen_within_reach(60)
    order = np.arange(60)
    assert 0 <= rows.judge_order(sets, order).gap < 1
    with pytest.raises(ValueError, match="each object once"):
        rows.judge_order(sets, order[1:])
    (case,) = rows.runs_cases(60, rows.CPU)
    found = case.work()
    assert case.judge(found).error == 0
    found.length[0] += 1
    assert case.judge(found).error > 0
