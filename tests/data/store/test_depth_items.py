"""Faces of depth meshes as bytes: what is decoded is what was encoded, and nothing altered gets through unseen."""

import zlib

import numpy as np
import pytest
from builders.depth_images import image
from hypothesis import given, settings
from hypothesis import strategies as st
from viewcell.data.depth_meshes import NOTHING, FarSide
from viewcell.data.errors import InputError
from viewcell.data.store.depth_items import RANKS_MOST, decode_face, encode_face
from viewcell.solvers.depth_meshes.layers import layers_of
from viewcell.solvers.depth_meshes.mesh import depth_mesh


def side_of(seed, far=None):
    """A far side that has one face, whose texels show objects of some ids."""
    parallax, shown = image(seed)
    layers = layers_of(parallax, shown, 1.0)
    meshes = tuple(depth_mesh(parallax, layers == k, 0.3) for k in np.unique(layers[shown]))
    far = np.sort(np.random.default_rng(seed).choice(10**6, 300, replace=False)) if far is None else far
    ids = np.where(shown, far[np.arange(shown.size).reshape(shown.shape) % len(far)], -1)
    none = np.zeros(0, np.int64)
    return FarSide(
        none, none, far, np.zeros(3), 1.0, ids[None].astype(np.int32), parallax[None], layers[None], (meshes,), 1.0, 1.0
    )


@settings(max_examples=20)
@given(st.integers(0, 10**6))
def test_what_is_decoded_is_what_was_encoded(seed):
    side = side_of(seed)
    found = decode_face(encode_face(side, 0), "face")
    assert np.array_equal(np.where(found.ranks < 0, -1, side.far[found.ranks]), side.ids[0])
    assert np.array_equal(found.layers, side.layers[0])
    assert len(found.meshes) == len(side.meshes[0])
    for one, other in zip(found.meshes, side.meshes[0], strict=True):
        for a, b in zip(one.arrays(), other.arrays(), strict=True):
            assert a.dtype == b.dtype and np.array_equal(a, b)
        assert one.error == np.float32(other.error)


def test_a_face_that_shows_nothing():
    side = side_of(0)
    empty = FarSide(
        side.near, side.unseen, side.far, side.middle, 1.0, np.full_like(side.ids, -1), 0 * side.parallax,
        np.full_like(side.layers, NOTHING), ((),), 0.0, 0.0,
    )  # fmt: skip
    found = decode_face(encode_face(empty, 0), "face")
    assert not found.meshes and (found.ranks == -1).all() and (found.layers == NOTHING).all()


def test_more_objects_than_ranks_are_refused():
    with pytest.raises(InputError, match="expected at most 65,535 objects"):
        encode_face(side_of(0, np.arange(RANKS_MOST + 1)), 0)


@settings(max_examples=200)
@given(st.data())
def test_altered_bytes_are_refused_or_name_what_there_is(data):
    whole = bytearray(encode_face(side_of(2), 0))
    if data.draw(st.booleans()):
        whole = whole[: data.draw(st.integers(0, len(whole) - 1))]
    else:
        whole[data.draw(st.integers(0, len(whole) - 1))] ^= data.draw(st.integers(1, 255))
    try:
        found = decode_face(bytes(whole), "face")
    except InputError as error:
        assert str(error).startswith("face: expected")
        return
    check(found)


def check(found):
    texels = len(found.layers)
    assert (found.layers[found.ranks >= 0] < len(found.meshes)).all()
    for mesh in found.meshes:
        assert (mesh.pixels < texels).all() and (mesh.triangles < len(mesh.pixels)).all()


@pytest.mark.parametrize("column", range(5))
def test_numbers_too_large_are_refused(column):
    """The meshes' last numbers, with their checksum put right."""
    side = side_of(3)
    whole = encode_face(side, 0)
    layers, size = np.frombuffer(whole, "<u4", 3)[1:].tolist()
    first = 12 + 12 * layers + size
    planes = bytearray(zlib.decompress(whole[first:]))
    counts = [sum(len(m.pixels) for m in side.meshes[0])] * 2 + [sum(len(m.triangles) for m in side.meshes[0])] * 3
    end = 4 * sum(counts[: column + 1])
    planes[end - 1] = 255
    if column == 1:
        assert np.isfinite(decode_face(whole[:first] + zlib.compress(bytes(planes)), "face").meshes[-1].parallax).all()
        return
    with pytest.raises(InputError, match="face: expected vertices on the image"):
        decode_face(whole[:first] + zlib.compress(bytes(planes)), "face")


def test_a_layer_that_is_not_there_is_refused():
    side = side_of(4)
    side.layers[0][side.ids[0] >= 0] = 77
    with pytest.raises(InputError, match="expected texels of"):
        decode_face(encode_face(side, 0), "face")
