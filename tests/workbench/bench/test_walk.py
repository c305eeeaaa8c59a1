"""The bench of walks: reads by the order of items, and the lines of the papers' tables."""

import pytest
import viewcell
from viewcell.workbench.bench.__main__ import main
from viewcell.workbench.bench.lines import NONE
from viewcell.workbench.bench.walk import GAPS, PACKED, RANDOM, measure_walk, walk_lines
from viewcell.workbench.pack.run import pack
from viewcell.workbench.walk.settings import ALL, WalkSettings


@pytest.fixture(scope="module")
def office(tmp_path_factory):
    folder = tmp_path_factory.mktemp("walks")
    return pack(viewcell.bake(viewcell.make_office(floors=1, rooms_per_side=1), folder / "office.bake"), flatten=True)


def test_reads_are_counted_in_every_order(office, capsys):
    settings = WalkSettings(policy=ALL, cache_bytes=40_000, read_bytes=4_000)
    found = measure_walk(office, 60, settings)
    asked = found.walked.policies[0]
    for order in (RANDOM, PACKED):
        counts = [found.reads[order, gap] for gap in GAPS]
        # The wider the gaps, the fewer reads and the more bytes between.
        assert counts == sorted(counts, key=lambda pair: (-pair[0], pair[1])) and counts[0][1] == 0
    assert found.reads[PACKED, 0][0] <= found.reads[RANDOM, 0][0] <= sum(map(len, asked.asked))
    assert found.fewer(0) == 100 * (1 - found.reads[PACKED, 0][0] / found.reads[RANDOM, 0][0]) >= 0
    lines = [line for lines in walk_lines(found).values() for line in lines]
    assert NONE not in {line.ours for line in lines}
    assert main(["walk", str(office.folder), "--frames", "20", "--polygon-bytes", "158"]) == 0
    said = capsys.readouterr().out
    assert "look-ahead and cache" in said and PACKED in said
