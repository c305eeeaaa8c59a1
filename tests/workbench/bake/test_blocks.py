"""Blocks side by side."""

import threading

from viewcell.data.progress import Phase
from viewcell.kernels.launch import Device
from viewcell.workbench.bake.blocks import Work


def test_a_lane_still_at_work_counts_half(monkeypatch):
    bar, both, said = Phase("visibility", 40, "cell"), threading.Barrier(2), []
    monkeypatch.setattr(bar, "update", lambda more: said.append((more, bar.under_way)))
    work = Work(engine=None, device=Device(threads=2), store=None, bar=bar)
    assert work.each(lambda item: (both.wait(), item)[1], "ab", [10, 30]) == ["a", "b"]
    # Whichever lane is the first to end, the other has been at work for as long.
    assert said in ([(10, 15.0), (30, 0.0)], [(30, 5.0), (10, 0.0)])
