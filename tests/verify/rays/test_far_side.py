"""The judge of depth meshes: finds nothing in honest ones, and what is broken in others."""

from dataclasses import replace

import numpy as np
import pytest
from builders.depth_scenes import CELL, CULL_BOX, around, boxes_scene
from viewcell.data.depth_meshes import NOTHING
from viewcell.solvers.depth_meshes.far_side import FarSides
from viewcell.verify.rays.far_side import check_far_side

TEXELS, RAYS = 4_000, 20_000


@pytest.fixture(scope="module")
def honest():
    scene = boxes_scene(around(np.random.default_rng(3), 60))
    return scene, FarSides(scene, texels=128).of(np.arange(60), CELL, CULL_BOX)


def judged(scene, side):
    return check_far_side(scene, side, CELL, np.random.default_rng(0), texels=TEXELS, rays=RAYS)


def with_meshes(side, change):
    return replace(side, meshes=tuple(tuple(change(mesh) for mesh in face) for face in side.meshes))


def test_honest_meshes_are_where_they_say(honest):
    found = judged(*honest)
    assert found.texels == TEXELS and found.over == 0 and 0 < found.worst <= 1
    assert found.tenths.sum() == TEXELS and found.tenths[10] == 0 < found.tenths[:5].sum()
    assert found.nothing + found.near + found.on_images + found.uncovered == found.rays == RAYS
    # Boxes in the open: most is on images, little hides behind others, and what is there is where it should be.
    assert found.on_images > 4 * found.uncovered > 0
    assert found.misplaced < 0.01 * found.on_images and found.near_lost == 0


def test_meshes_elsewhere_are_told(honest):
    scene, side = honest
    nearer = judged(scene, with_meshes(side, lambda mesh: replace(mesh, parallax=mesh.parallax * np.float32(1.3))))
    assert nearer.over > 0.1 * TEXELS and nearer.misplaced > 0 and nearer.tenths[10] == nearer.over
    wider = judged(scene, with_meshes(side, lambda mesh: replace(mesh, pixels=mesh.pixels[:, ::-1])))
    assert wider.over > 0.1 * TEXELS and wider.misplaced > 0.1 * wider.on_images
    stated = judged(scene, replace(side, error=side.error / 100))
    assert stated.over > 0 and stated.worst > 1


def test_torn_meshes_and_lost_texels_are_told(honest):
    scene, side = honest
    torn = judged(scene, with_meshes(side, lambda mesh: replace(mesh, triangles=mesh.triangles[::2])))
    assert torn.over > 0.1 * TEXELS and torn.worst == np.inf and torn.misplaced > 0.1 * torn.on_images
    blank = replace(side, ids=np.where(side.ids == side.far[0], -1, side.ids))
    assert judged(scene, blank).uncovered > judged(scene, side).uncovered
    dim = replace(side, layers=np.full_like(side.layers, NOTHING))
    found = judged(scene, dim)
    assert found.misplaced == found.on_images > 0 and found.over == TEXELS


def test_meshes_before_geometry_are_told():
    """Meshes that hang together although something stands between them hide it."""
    boxes = [[[8, -6, -6], [8.1, 6, 6]], [[6, -1, -1], [6.1, 1, 1]]]
    scene = boxes_scene(boxes)
    side = FarSides(scene, texels=64).of(np.arange(1), CELL, CULL_BOX)
    nearer = with_meshes(side, lambda mesh: replace(mesh, parallax=mesh.parallax * np.float32(1.7)))
    assert judged(scene, side).near_lost == 0 < judged(scene, nearer).near_lost


def test_counts_add_up(honest):
    one = judged(*honest)
    two = one + one
    assert two.rays == 2 * one.rays and two.worst == one.worst and two.uncovered == 2 * one.uncovered
