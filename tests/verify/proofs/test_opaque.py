"""Opaque in the exact sense: surfaces of a plane, insides of closed elements on either side of it, and discs."""

import numpy as np
import pytest
from builders import random_solids
from viewcell.data.graph import OTHER_AXES
from viewcell.data.prepared import PreparedModel
from viewcell.data.rasters import decompose
from viewcell.verify.proofs.opaque import OpaqueSurfaces, bounds_disc


def surfaces_of(meshes):
    return OpaqueSurfaces(*random_solids.scene_of_meshes(meshes).triangles())


def opaque(surfaces, axis, plane, *rectangle):
    """Whether (u0, v0, u1, v1) [m] of a plane [m] is opaque."""
    corners = np.round(np.array(rectangle) * 1024).astype(np.int64).reshape(1, 2, 2)
    return surfaces.open_rectangle(axis, round(plane * 1024), corners) is None


def test_a_box_is_opaque_on_its_faces_and_within():
    surfaces = surfaces_of([random_solids.box([1, 1, 0], [2, 3, 2])])
    for plane in (1, 1.5, 2):
        assert opaque(surfaces, 0, plane, 1, 0, 3, 2)
        assert not opaque(surfaces, 0, plane, 1, 0, 3 + 1 / 1024, 2)
    assert not opaque(surfaces, 0, 2 + 1 / 1024, 1, 0, 3, 2)
    assert not opaque(surfaces, 0, 1, 1, 0, 1, 2)


def test_an_open_element_is_opaque_on_its_faces_only():
    mesh = random_solids.box([0, 0, 0], [1, 1, 1])
    top = (mesh.face_normals[:, 2] > 0.5).nonzero()[0]
    mesh.update_faces(np.arange(len(mesh.faces)) != top[0])
    surfaces = surfaces_of([mesh])
    assert opaque(surfaces, 2, 0, 0, 0, 1, 1)
    assert not opaque(surfaces, 2, 1, 0, 0, 1, 1)
    assert not opaque(surfaces, 0, 0.5, 0.2, 0.2, 0.8, 0.8)


def test_several_elements_cover_together():
    # A wall in two halves with a crossing one between: on the common face only the three cover all.
    walls = [([0, 0, 0], [2, 0.25, 3]), ([2, -1, 0], [2.25, 3, 3]), ([2.25, 0, 0], [4, 0.25, 3])]
    meshes = [random_solids.box(*wall) for wall in walls]
    assert opaque(surfaces_of(meshes), 1, 0.25, 0, 0, 4, 3)
    for missing in range(3):
        assert not opaque(surfaces_of(meshes[:missing] + meshes[missing + 1 :]), 1, 0.25, 0, 0, 4, 3)


def test_doubled_triangles_do_not_cancel():
    surface = random_solids.box([0, 0, 0], [1, 1, 1])
    flipped = surface.copy()
    flipped.invert()
    assert opaque(surfaces_of([surface, flipped]), 0, 1, 0, 0, 1, 1)
    # Together they are closed, but wind round nothing.
    assert not opaque(surfaces_of([surface + flipped]), 0, 0.5, 0, 0, 1, 1)


def test_a_sheet_seen_from_both_sides_does_not_cancel():
    triangles = np.array([[[0, 0, 5], [1024, 0, 5], [1024, 1024, 5]], [[0, 0, 5], [1024, 1024, 5], [0, 1024, 5]]])
    surfaces = OpaqueSurfaces(np.concatenate([triangles, triangles[:, ::-1]]), np.zeros(4, int))
    assert opaque(surfaces, 2, 5 / 1024, 0, 0, 1, 1)


def test_oblique_outlines_to_the_step():
    mesh = random_solids.box([0, 0, 0], [1, 1, 1])
    mesh.vertices[:, 0] *= 1 - mesh.vertices[:, 1] * 0.5
    surfaces = surfaces_of([mesh])
    # x <= 1 - y / 2 at every height.
    assert opaque(surfaces, 2, 0.5, 0, 0, 0.75, 0.5)
    assert not opaque(surfaces, 2, 0.5, 0, 0, 0.75, 0.5 + 1 / 1024)
    assert not opaque(surfaces, 2, 0.5, 0, 0, 0.75 + 1 / 1024, 0.5)
    assert opaque(surfaces, 2, 1, 0, 0, 0.75, 0.5) and not opaque(surfaces, 2, 1, 0, 0, 0.76, 0.5)


@pytest.mark.parametrize("seed", range(2))
def test_regions_are_opaque_and_cannot_all_grow(seed):
    scene = random_solids.random_solids(seed)
    triangles, owners = scene.triangles()
    regions = PreparedModel(scene).regions
    surfaces, grown = OpaqueSurfaces(triangles, owners), 0
    for region, (axis, plane) in enumerate(zip(regions.axis, regions.plane, strict=True)):
        (u0, v0, t0), (u1, v1, t1) = regions.places[region], regions.places[region + 1]
        us, vs = regions.u[u0:u1], regions.v[v0:v1]
        before = regions.open_before[t0:t1].reshape(len(us), len(vs))
        rectangles = decompose(np.diff(np.diff(before, axis=0), axis=1) == 0, us, vs).astype(np.int64)
        assert surfaces.open_rectangle(int(axis), int(plane), rectangles) is None
        bounds = scene.object_bounds()[:, :, OTHER_AXES[axis]]
        beyond = np.array([[bounds[:, 0].min(axis=0) - 1, rectangles[0, 1]]])
        grown += surfaces.open_rectangle(int(axis), int(plane), beyond) is None
    assert len(regions.axis) and not grown


FAN = np.array([[[0, 0, 0], [4, 0, 1], [4, 4, 0]], [[0, 0, 0], [0, 4, 1], [4, 4, 0]]])
OUTLINE = [[0, 0, 0], [4, 0, 1], [4, 4, 0], [0, 4, 1]]


def test_a_disc_is_of_triangles_that_its_object_has():
    surfaces = OpaqueSurfaces(np.concatenate([FAN, FAN + 9]), np.repeat([3, 7], 2))
    assert surfaces.disc(3, [1, 0]).tolist() == FAN[::-1].tolist()
    assert surfaces.disc(7, [1]).tolist() == (FAN[1:] + 9).tolist()
    for object_id, places in ((3, []), (3, [0, 0]), (3, [0, 2]), (3, [-1, 0]), (4, [0]), (8, [0]), (2, [0])):
        assert surfaces.disc(object_id, places) is None


def test_a_disc_is_bounded_by_its_outline():
    assert bounds_disc(FAN, OUTLINE) and bounds_disc(FAN, OUTLINE[::-1]) and bounds_disc(FAN[::-1, ::-1], OUTLINE)
    # A point along an edge may be left out, one beside it may not.
    fan = np.array([[[0, 0, 0], [2, 0, 0], [4, 4, 0]], [[2, 0, 0], [4, 0, 0], [4, 4, 0]]])
    assert bounds_disc(fan, [[0, 0, 0], [4, 0, 0], [4, 4, 0]])
    fan[:, :, 2] += (fan[:, :, 0] == 2) & (fan[:, :, 1] == 0)
    assert not bounds_disc(fan, [[0, 0, 0], [4, 0, 0], [4, 4, 0]])


@pytest.mark.parametrize(
    ("triangles", "outline"),
    [
        (FAN[:1], OUTLINE),
        (FAN[[0, 1, 1]], OUTLINE),
        (FAN, [*OUTLINE[:3], [0, 5, 1]]),
        (FAN, OUTLINE[:3]),
        (FAN + 1, OUTLINE),
    ],
)
def test_what_bounds_no_disc(triangles, outline):
    assert not bounds_disc(triangles, outline)
