"""Walls a few steps off the axes: planes inside them, exactly opaque, that cut cells as those of straight walls do."""

import numpy as np
import pytest
import shapely
import trimesh
from builders import random_solids
from viewcell.data.opaque import NO_PLANES, opaque_planes
from viewcell.data.prepared import PreparedModel
from viewcell.data.scene import Role
from viewcell.data.skewed import SLIVER, with_sections
from viewcell.verify.proofs.opaque import OpaqueSurfaces

GRID_M = 2.0**-10


def wall_of(length, thick, deg, height=3.0, doors=()):
    """A wall along x with doors (from, to) in metres, turned by some degrees."""
    face = shapely.box(0, 0, length, height)
    for low, high in doors:
        face = face.difference(shapely.box(low, -1, high, 2.1))
    wall = trimesh.creation.extrude_polygon(face, thick)
    # Its elevation stands up, and it is thick towards y.
    wall.apply_transform(np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]]))
    wall.apply_transform(trimesh.transformations.rotation_matrix(np.radians(deg), [0, 0, 1]))
    return wall


def sections(scene):
    return with_sections(NO_PLANES, PreparedModel(scene).sections)


@pytest.mark.parametrize("deg", [0.01, 0.15, -0.3, 1.0])
def test_a_wall_thicker_than_it_is_askew_is_cut_inside_both_faces(deg):
    scene = random_solids.scene_of_meshes([wall_of(5.0, 0.3, deg)])
    found = sections(scene)
    assert found.sliver == SLIVER and not len(found.boxes[0]) and len(np.unique(found.boxes[1][:, 0, 1])) == 2
    size = (found.boxes[1][:, 1] - found.boxes[1][:, 0]).astype(float)
    for plane in np.unique(found.boxes[1][:, 0, 1]):
        area = size[found.boxes[1][:, 0, 1] == plane][:, [0, 2]].prod(axis=1).sum() * GRID_M**2
        assert 0.98 * 15.0 < area <= 15.0


@pytest.mark.parametrize("deg", [0.0, 4.0, 20.0])
def test_straight_walls_and_those_askew_by_more_than_they_are_thick_are_left_alone(deg):
    planes = sections(random_solids.scene_of_meshes([wall_of(6.0, 0.2, deg)]))
    assert planes is NO_PLANES


@pytest.mark.parametrize("deg", [0.02, 0.4, -0.7])
def test_every_rectangle_is_opaque_throughout(deg):
    scene = random_solids.scene_of_meshes([wall_of(6.0, 0.25, deg, doors=[(1.0, 2.0), (3.5, 4.4)])])
    found, surfaces = sections(scene), OpaqueSurfaces(*scene.triangles())
    assert len(found.boxes[1]) > 2
    for box in found.boxes[1]:
        assert surfaces.open_rectangle(1, int(box[0, 1]), box[None, :, [0, 2]].astype(int)) is None


def test_planes_of_straight_models_are_the_very_same():
    scene = random_solids.random_solids(3, axial=8, turned=0)
    triangles = scene.triangles(Role.OCCLUDER)[0]
    both = PreparedModel(scene).planes, opaque_planes(triangles)
    for one, other in zip(both[0].boxes, both[1].boxes, strict=True):
        np.testing.assert_array_equal(one, other)
    assert both[0].sliver == 0
