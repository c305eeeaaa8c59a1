"""Time that passes only where a test wants it to."""

from viewcell.data import patience, prepared, regions
from viewcell.solvers.visibility.portal_engine import PortalEngine
from viewcell.workbench.bake import blocks, budget, coarse, run


class Clock:
    """Time that passes only while blocks are computed: so many seconds each without and with aiming."""

    def __init__(self, monkeypatch, seconds, engine=PortalEngine):
        self.now, self.calls, self.seconds = 0.0, [], seconds
        visible = engine.visible

        def timed(one, block, *, aim=True):
            self.now += seconds[aim]
            self.calls.append(aim)
            return visible(one, block, aim=aim)

        stopped = type("stopped", (), {"perf_counter": lambda: self.now})
        monkeypatch.setattr(engine, "visible", timed)
        monkeypatch.setattr(blocks, "BLOCK", 1)
        monkeypatch.setattr(blocks, "VIEW_BLOCK", 1)
        monkeypatch.setattr(blocks, "time", stopped)
        monkeypatch.setattr(budget, "time", stopped)
        monkeypatch.setattr(coarse, "time", stopped)
        monkeypatch.setattr(run, "time", stopped)

    def wait(self, seconds):
        """Let so much pass."""
        self.now += seconds


def lots_take(monkeypatch, seconds):
    """Where preparing looks time passes only while a lot of planes is worked on, so many seconds each."""
    now, work = [0.0], regions._parts

    def timed(*args):
        now[0] += seconds
        return work(*args)

    monkeypatch.setattr(regions, "_parts", timed)
    for module in (patience, prepared):
        monkeypatch.setattr(module, "time", type("stopped", (), {"perf_counter": lambda: now[0]}))
