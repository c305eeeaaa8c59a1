"""Faults of surfaces that are planted, one at a time, and found."""

import numpy as np
import pytest
import trimesh
from builders import random_solids
from viewcell.data.prepared import PreparedModel
from viewcell.data.scene import Role
from viewcell.workbench.inspect.surfaces import find_directions, find_surfaces


def found_in(meshes, roles=None):
    return find_surfaces(PreparedModel(random_solids.scene_of_meshes(meshes, roles)))


def boxes():
    return [random_solids.box([0, 0, 0], [1, 2, 3]), random_solids.box([5, 0, 0], [6, 2, 3])]


def without(mesh, *faces):
    return trimesh.Trimesh(mesh.vertices, np.delete(mesh.faces, faces, axis=0), process=False)


def test_nothing_is_wrong_with_two_boxes():
    found = found_in(boxes())
    assert (found.closed, found.inverted, found.open, found.repeated, found.twins, found.overlaps) == (
        2,
        [],
        [],
        0,
        [],
        [],
    )


def test_a_missing_face_opens_an_object():
    a, b = boxes()
    (one,) = found_in([a, without(b, 3)]).open
    assert (one.object_id, one.edges, one.turned) == (1, 3, False)
    assert one.area_m2 == pytest.approx(b.area - b.area_faces[3])
    assert found_in([a, without(b, 3)], [Role.OCCLUDER, Role.TRANSPARENT]).open == []


def test_a_turned_face_is_told_from_a_missing_one():
    a, b = boxes()
    faces = b.faces.copy()
    faces[3] = faces[3][::-1]
    (one,) = found_in([a, trimesh.Trimesh(b.vertices, faces, process=False)]).open
    assert one.turned and one.edges == 6


def test_an_object_inside_out():
    a, b = boxes()
    b.invert()
    assert found_in([a, b]).inverted == [1]


def test_what_is_there_twice():
    a, b = boxes()
    doubled = trimesh.Trimesh(b.vertices, np.concatenate([b.faces, b.faces[:2], b.faces[2:3, ::-1]]), process=False)
    found = found_in([a, doubled])
    assert found.repeated == 3 and found.twins == []
    moved = a.copy()
    moved.vertices = moved.vertices[::-1]
    moved.faces = len(moved.vertices) - 1 - moved.faces
    assert found_in([a, b, moved]).twins == [[0, 2]]


def test_faces_that_overlap_are_measured():
    """The second box stands 1.5 m along the first's front and top; faces that look at each other do not count."""
    a = random_solids.box([0, 0, 0], [2, 1, 3])
    b = random_solids.box([0.5, 0, 1], [2.5, 2, 3])
    assert found_in([a, b]).overlaps == [(0, 1, pytest.approx(1.5 * 2 + 1.5 * 1))]
    assert found_in([a, random_solids.box([0, 1, 0.5], [2, 2, 2.5])]).overlaps == []


@pytest.mark.parametrize("degrees", [0.0, 12.0, 45.0, 80.0])
def test_the_way_of_walls(degrees):
    wall, other = random_solids.box([0, 0, 0], [10, 0.25, 3]), random_solids.box([20, 0, 0], [21, 1, 1])
    turn = trimesh.transformations.rotation_matrix(np.radians(degrees), [0, 0, 1])
    wall.apply_transform(turn)
    ways = find_directions(random_solids.scene_of_meshes([wall, other]))
    side = 2 * 3 * 10.25
    if degrees == 0.0:
        assert ways.axial == 1.0 and ways.yaw == 0.0
    else:
        assert ways.axial == pytest.approx(4 / (4 + side), rel=1e-3) and ways.yaw == pytest.approx(
            side / (4 + side), abs=1e-3
        )
        assert ways.yaw_deg == pytest.approx(degrees, abs=0.51) and ways.other < 1e-3


def test_no_wall_has_no_way():
    floor = random_solids.box([0, 0, 0], [1, 1, 1])
    assert find_directions(random_solids.scene_of_meshes([floor, floor], [Role.DETAIL, Role.DETAIL])) is None
