"""A setting tried once: it answers as a bake does, and a sample of view cells as all of them do."""

import numpy as np
import pytest
from builders.furnished_rooms import furnished_rooms
from viewcell.kernels.launch import Device
from viewcell.workbench.bake.run import bake
from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.tune.trial import _Clock, run_trial, sources_of

WHERE = Device(threads=1)


@pytest.fixture(scope="module")
def scene():
    return furnished_rooms()


def pairs(answer):
    return set(zip(answer.objects.source.tolist(), answer.objects.target.tolist(), strict=True))


def test_it_answers_as_a_bake_does(scene, tmp_path):
    made = bake(scene, tmp_path / "o.bake", threads=1)
    answer = run_trial(scene, Settings(), WHERE).answer
    assert np.array_equal(answer.potential, made.potential_objects)
    assert answer.cell_pairs == made.cell_to_cell.num_rows


def test_a_sample_speaks_of_its_view_cells_alone(scene):
    whole = run_trial(scene, Settings(), WHERE).answer
    cells = np.flatnonzero(whole.graph.inhabitable)
    trial = run_trial(scene, Settings(), WHERE, whole.graph.cells[cells[1:4]])
    assert np.flatnonzero(trial.answer.graph.inhabitable).tolist() == cells[1:4].tolist()
    assert pairs(trial.answer) == {(cell, target) for cell, target in pairs(whole) if cell in cells[1:4]}
    assert trial.answer.same_cells(trial.answer) and not trial.answer.same_cells(whole)


def test_an_octree_s_sample_holds_nothing_else(scene):
    settings = Settings(method="occluders", cells="octree", cell_size_m=2.0, depth=0)
    every = sources_of(scene, settings)[0].graph
    sources, left = sources_of(scene, settings, every.cells[:1])
    assert sources.graph.inhabitable.all() and left == every.cell_count - sources.graph.cell_count > 0


def test_an_octree_that_is_refined_answers_as_a_bake_does(scene, tmp_path):
    """Rows are of the cells that are left, whose witnesses serve each other."""
    settings = Settings(
        method="occluders", cells="octree", cell_size_m=4.0, depth=1, refine_gap=0.01, refine_triangles=10
    )
    made = bake(scene, tmp_path / "o.bake", settings=settings, threads=1)
    answer = run_trial(scene, settings, WHERE).answer
    assert np.array_equal(answer.potential, made.potential_objects)
    assert answer.graph.cell_count > sources_of(scene, settings)[0].graph.cell_count
    assert np.array_equal(answer.objects.seen, np.array(made.cell_to_object["verdict"].to_pylist()) == "visible")
    assert made.verify(rays=20_000).ok


def test_what_takes_too_long_is_stopped(scene):
    assert run_trial(scene, Settings(), WHERE, most_s=1e-9).answer is not None  # one block: nothing later to judge by
    cells = sources_of(scene, Settings())[0].graph
    sample = cells.cells[cells.inhabitable][:4]
    assert run_trial(scene, Settings(), WHERE, sample, most_s=1e-9).answer is None


def test_what_is_left_out_takes_as_long_as_later_cells(monkeypatch):
    """What the first ones pay for being first is paid once."""
    from viewcell.workbench.tune import trial

    now = iter([0.0, 10.0, 14.0, 14.0])
    monkeypatch.setattr(trial.time, "perf_counter", lambda: next(now))
    clock = _Clock(60.0, left=20)
    clock.add(2)
    assert not clock.late
    clock.add(4)
    assert clock.all_s == 14.0 + 20 * 1.0 and not clock.late
    clock.add(0)
    assert clock.all_s == 34.0
