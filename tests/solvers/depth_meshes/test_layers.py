"""Layers: what hangs together stays together, what is near another patch of its layer is no patch of it."""

import numpy as np
import pytest
from builders.depth_images import image
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from viewcell.data.depth_meshes import NOTHING
from viewcell.solvers.depth_meshes import layers as module
from viewcell.solvers.depth_meshes.layers import APART, layers_of


def plain_patches(parallax, shown, step):
    """By flooding from texel to texel."""
    label, count = np.full(shown.shape, -1), 0
    for start in zip(*np.nonzero(shown), strict=True):
        if label[start] >= 0:
            continue
        queue = [start]
        label[start] = count
        while queue:
            y, x = queue.pop()
            for at in ((y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)):
                inside = 0 <= at[0] < shown.shape[0] and 0 <= at[1] < shown.shape[1]
                if inside and shown[at] and label[at] < 0 and abs(parallax[at] - parallax[y, x]) <= step:
                    label[at] = count
                    queue.append(at)
        count += 1
    return label, count


@settings(max_examples=30)
@given(st.integers(0, 10**6), st.sampled_from([0.1, 2.0]))
def test_laws(seed, step):
    parallax, shown = image(seed)
    found = layers_of(parallax, shown, step)
    label, count = plain_patches(parallax, shown, step)
    assert ((found != NOTHING) == shown).all()
    for patch in range(count):
        own = label == patch
        (layer,) = np.unique(found[own])
        around = ndimage.binary_dilation(own, np.ones((2 * APART - 1, 2 * APART - 1), bool))
        assert not (around & (found == layer) & ~own).any()
    used = np.unique(found[shown])
    assert np.array_equal(used, np.arange(len(used)))


def test_a_bent_pipe_is_one_patch_and_the_wall_behind_it_another():
    parallax = np.full((40, 40), 3.0)
    parallax[5:35, 10:12] = 20.0
    parallax[33:35, 10:30] = 20.0
    found = layers_of(parallax, np.ones((40, 40), bool), 1.0)
    assert len(np.unique(found)) == 2 and len(np.unique(found[parallax > 10])) == 1
    assert (layers_of(parallax, np.zeros((40, 40), bool), 1.0) == NOTHING).all()


def test_beyond_the_last_layer_patches_share_it(monkeypatch):
    monkeypatch.setattr(module, "NOTHING", 3)
    parallax = np.arange(36.0).reshape(6, 6) * 10
    found = module.layers_of(parallax, np.ones((6, 6), bool), 1.0)
    assert set(np.unique(found)) == {0, 1, 2}


@pytest.mark.parametrize("shape", [(1, 5), (5, 1)])
def test_thin_images(shape):
    assert (layers_of(np.ones(shape), np.ones(shape, bool), 1.0) == 0).all()
