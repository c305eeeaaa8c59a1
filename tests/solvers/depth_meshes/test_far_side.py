"""What is near and what is far: every object on one side, nothing transparent or unseen on images alone."""

import numpy as np
import pytest
from builders.depth_scenes import CELL, CULL_BOX, around, boxes_scene
from viewcell.data.depth_meshes import FACES, NOTHING
from viewcell.data.errors import InputError
from viewcell.data.scene import Role
from viewcell.kernels.launch import Device
from viewcell.solvers.depth_meshes.far_side import FarSides

SMALL = {"texels": 64}


def test_faces_look_to_all_sides():
    assert sorted(map(tuple, FACES[:, 2].tolist())) == sorted(
        map(tuple, np.concatenate([np.eye(3), -np.eye(3)]).tolist())
    )
    assert np.allclose(FACES @ FACES.transpose(0, 2, 1), np.eye(3))


@pytest.mark.parametrize("seed", range(4))
def test_every_object_is_on_one_side(seed):
    scene = boxes_scene(around(np.random.default_rng(seed)))
    potential = np.arange(0, 30, 2)
    found = FarSides(scene, **SMALL).of(potential, CELL, CULL_BOX)
    assert np.array_equal(np.union1d(found.near, found.far), potential)
    assert not len(np.intersect1d(found.near, found.far)) and np.isin(found.unseen, found.near).all()
    assert np.array_equal(np.unique(found.ids[found.ids >= 0]), found.far)
    boxes = scene.object_bounds()
    touching = ((boxes[:, 0] <= CULL_BOX / 2) & (boxes[:, 1] >= -CULL_BOX / 2)).all(axis=1)
    assert np.isin(potential[touching[potential]], found.near).all() and not touching[found.far].any()
    # What is neither near nor behind others is on the images.
    assert len(found.far) > 3
    assert ((found.layers != NOTHING) == (found.ids >= 0)).all()
    for face, meshes in enumerate(found.meshes):
        assert len(meshes) == len(np.unique(found.layers[face][found.ids[face] >= 0]))
    assert found.error <= 1.0 + 1e-4 and found.triangles > 0


def test_what_texels_do_not_show_and_glass_are_geometry():
    wall = [[10, -8, -8], [10.5, 8, 8]]
    boxes = [wall, [[12, -1, -1], [13, 1, 1]], [[-12, -1, -1], [-11, 1, 1]], [[-20, -1, 4], [-19.9, -0.99, 4.01]]]
    roles = [Role.OCCLUDER, Role.DETAIL, Role.TRANSPARENT, Role.DETAIL]
    found = FarSides(boxes_scene(boxes, roles), **SMALL).of(np.arange(4), CELL, CULL_BOX)
    # Behind the wall, of glass, and too small for a texel.
    assert found.near.tolist() == [1, 2, 3] and found.unseen.tolist() == [1, 3] and found.far.tolist() == [0]
    # A box that touches the cull box is near.
    beside = FarSides(boxes_scene([[[4, 0, 0], [5, 1, 1]], [[4.01, 3, 0], [5, 4, 1]]]), **SMALL)
    assert beside.of(np.arange(2), CELL, CULL_BOX).near.tolist() == [0]


def test_a_wall_is_on_every_face_that_it_crosses():
    found = FarSides(boxes_scene([[[-30, 10, -2], [30, 10.5, 2]]]), **SMALL).of(np.arange(1), CELL, CULL_BOX)
    assert [bool((face >= 0).any()) for face in found.ids] == [True, True, True, False, False, False]


def test_skins_are_stretched_no_farther_than_patches_hang_together():
    apart = [[[6, -3, -3], [6.1, 0, 3]], [[20, -20, -20], [20.1, 20, 20]]]
    found = FarSides(boxes_scene(apart), **SMALL).of(np.arange(2), CELL, CULL_BOX)
    assert len(found.meshes[0]) == 2 and found.skin <= 2.0


def test_nothing_far_needs_no_mesh():
    found = FarSides(boxes_scene([[[0, 0, 2], [1, 1, 3]]]), **SMALL).of(np.arange(1), CELL, CULL_BOX)
    assert found.triangles == 0 and found.error == 0 and found.skin == 0 and found.near.tolist() == [0]
    none = FarSides(boxes_scene([[[0, 0, 2], [1, 1, 3]]]), **SMALL).of(np.zeros(0, int), CELL, CULL_BOX)
    assert not len(none.near) and not len(none.far)


def test_threads_do_not_matter():
    scene = boxes_scene(around(np.random.default_rng(7)))
    one, two = (FarSides(scene, **SMALL, device=Device(threads=n)).of(np.arange(30), CELL, CULL_BOX) for n in (1, 2))
    assert np.array_equal(one.ids, two.ids) and np.array_equal(one.layers, two.layers)
    for a, b in zip(one.meshes, two.meshes, strict=True):
        assert all(
            np.array_equal(x, y) for m, n in zip(a, b, strict=True) for x, y in zip(m.arrays(), n.arrays(), strict=True)
        )


def test_bad_input_is_one_line():
    scene = boxes_scene([[[8, 0, 2], [9, 1, 3]]])
    for kind in ({"texels": 7}, {"texels": 2**15}, {"error": 0.0}, {"error": np.inf}):
        with pytest.raises(InputError, match="expected"):
            FarSides(scene, **kind)
    with pytest.raises(InputError, match="cull box: expected a size above 3,547 steps"):
        FarSides(scene, **SMALL).of(np.arange(1), CELL, 3500)
