"""Triangles that sightlines meet are made when they are first asked, once, and not at all where that takes too long."""

import numpy as np
import pytest
from builders import random_solids
from viewcell.data.prepared import PreparedModel
from viewcell.kernels.launch import CPU
from viewcell.solvers.visibility import aim
from viewcell.solvers.visibility.aim import Sights


@pytest.fixture
def sights(monkeypatch):
    """Of a model that counts as large: one of its objects is tried."""
    monkeypatch.setattr(aim, "LARGE", 1)
    monkeypatch.setattr(aim, "TRIAL", 1)
    made, work = [], aim.device_triangles
    monkeypatch.setattr(aim, "device_triangles", lambda all_, *a, **k: made.append(len(all_)) or work(all_, *a, **k))
    scene = random_solids.random_solids(2)
    found = Sights.of(PreparedModel(scene), np.array([[[0, 0, 0], [900, 900, 900]]], np.int32), 0, CPU)
    return found, made


def test_nothing_is_made_before_it_is_asked(sights):
    found, made = sights
    assert found.ranges[-1, 1] == len(found.model.scene.triangles()[0]) and found.targets.opaque is None
    assert made == []
    other = found.from_cells(found.cells + 5)
    assert other.finder is found.finder and other.triangles is found.triangles and len(made) == 1
    assert found.targets.opaque is found.finder.scene is not None


def test_a_trial_tells_whether_there_is_time(sights):
    found, made = sights
    assert not found.targets.make(0.0) and found.targets.opaque is None
    assert made == [found.ranges[0, 1]]
    assert found.targets.make(1e6) and found.targets.make(0.0)
    assert made[1:] == [found.ranges[0, 1], found.ranges[-1, 1]]


def test_small_models_are_not_tried(sights, monkeypatch):
    found, made = sights
    monkeypatch.setattr(aim, "LARGE", 10**9)
    assert found.targets.make(0.0) and made == [found.ranges[-1, 1]]
