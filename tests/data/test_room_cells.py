"""View cells of rooms: they cover, they stay inside, and what they cannot cover is told."""

import numpy as np
import pytest
import trimesh
from viewcell.data.graph import CellGraph
from viewcell.data.room_cells import (
    COVERED_SHARE,
    RASTER_M,
    add_room_cells,
    eye_points,
    find_room_points,
    in_room,
    room_prisms,
)
from viewcell.data.scene import GRID_M, Scene, Space

L_SHAPE = [[0, 0], [6, 0], [6, 3], [3, 3], [3, 5], [0, 5]]


def extruded(points, height, yaw_deg=0.0):
    from shapely import Polygon

    mesh = trimesh.creation.extrude_polygon(Polygon(points), height)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(yaw_deg), [0, 0, 1]))
    return mesh


def space_of(mesh, name="room"):
    return Space(name, np.array(mesh.vertices, float), np.array(mesh.faces, np.int32))


def sloped(yaw_deg=20.0):
    """Under a roof that falls from 3 m to 1 m."""
    mesh = extruded([[0, 0], [4, 0], [4, 5], [0, 5]], 3.0)
    top = mesh.vertices[:, 2] > 2
    mesh.vertices[top, 2] = 3.0 - 0.4 * mesh.vertices[top, 1]
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(yaw_deg), [0, 0, 1]))
    return mesh


ROOMS = {
    "box": extruded([[0, 0], [5, 0], [5, 4], [0, 4]], 2.8),
    "L": extruded(L_SHAPE, 2.8),
    "L, turned": extruded(L_SHAPE, 2.8, 31.0),
    "box, turned": extruded([[0, 0], [5, 0], [5, 4], [0, 4]], 2.8, 45.0),
    "under a roof": sloped(),
}


def with_room_cells(scene, graph):
    """As `add_room_cells`, without solids."""
    return add_room_cells(scene, graph, find_room_points(scene, []))


def no_cells():
    none = np.zeros((0, 2), np.int32)
    return CellGraph(np.zeros((0, 2, 3), np.int32), np.zeros(0, bool), np.zeros(0, object), none,
                     np.zeros(0, np.int8), np.zeros((0, 2, 3), np.int32))  # fmt: skip


def covered(space):
    """The graph with the room's own cells, and how it is covered."""
    graph, (cover,) = with_room_cells(Scene([], [], [space]), no_cells())
    return graph, cover


def corners(box, plan):
    """Corners of a prism, pulled inwards by some steps [m]."""
    middle = plan.mean(axis=0)
    inner = plan + 8 * (middle - plan) / np.linalg.norm(middle - plan, axis=1)[:, None]
    return np.array([[*p, z] for p in inner for z in (box[0, 2] + 2, box[1, 2] - 2)]) * GRID_M


@pytest.mark.parametrize("name", ROOMS)
def test_a_room_is_covered_by_prisms_named_after_it(name):
    graph, cover = covered(space_of(ROOMS[name], name))
    assert cover.covered == (cover.share >= COVERED_SHARE) == (cover.why == "")
    assert cover.covered
    assert graph.cell_count == len(graph.plans.rows) >= 1 and graph.inhabitable.all()
    assert set(graph.cell_names) == {name} and graph.tile_count == 0


@pytest.mark.parametrize("name", ROOMS)
def test_prisms_stay_inside_their_room(name):
    space = space_of(ROOMS[name], name)
    prisms = room_prisms(space, GRID_M)
    for box, plan in prisms:
        assert (plan.min(axis=0) == box[0, :2]).all() and (plan.max(axis=0) == box[1, :2]).all()
        along = np.roll(plan, -1, axis=0) - plan
        bend = np.roll(along, -1, axis=0)
        assert (along[:, 0] * bend[:, 1] - along[:, 1] * bend[:, 0] > 0).all()
        points = corners(box, plan)
        # A slice under a slope may reach over it by what the slope falls across a raster step.
        lower = points - [0, 0, RASTER_M * (name == "under a roof")]
        assert (in_room(space, points) | in_room(space, lower)).all()
    assert prisms


def test_eyes_of_a_room_are_in_it_and_spread():
    space = space_of(ROOMS["L, turned"])
    points = eye_points(space)
    assert in_room(space, points).all() and len(points) > 400
    assert points[:, 2].min() > 0.1 and points[:, 2].max() < 2.2


def grid_points(mesh, count=6000):
    random = np.random.default_rng(0)
    low, high = mesh.bounds
    return random.uniform(low - 0.5, high + 0.5, (count, 3))


def test_inside_of_a_whole_body():
    mesh = ROOMS["L, turned"]
    points = grid_points(mesh)
    assert (in_room(space_of(mesh), points) == mesh.contains(points)).all()


def test_a_body_turned_inside_out_is_the_same_room():
    mesh = ROOMS["L, turned"].copy()
    points = grid_points(mesh)
    wanted = mesh.contains(points)
    faces = np.array(mesh.faces, np.int32)
    assert (in_room(Space("r", np.array(mesh.vertices), faces[:, ::-1]), points) == wanted).all()
    # Some of its faces only.
    flipped = faces.copy()
    flipped[::3] = flipped[::3, ::-1]
    assert (in_room(Space("r", np.array(mesh.vertices), flipped), points) == wanted).mean() > 0.999


def test_an_open_body_is_as_far_as_it_has_faces_above_and_below():
    mesh = ROOMS["box, turned"].copy()
    points = grid_points(mesh)
    wanted = mesh.contains(points)
    upright = np.abs(mesh.face_normals[:, 2]) < 0.5
    some = np.ones(len(mesh.faces), bool)
    some[np.flatnonzero(upright)[:2]] = False
    found = in_room(Space("r", np.array(mesh.vertices), np.array(mesh.faces[some], np.int32)), points)
    assert (found == wanted).mean() > 0.999
    # Without a floor nothing is inside.
    some = mesh.face_normals[:, 2] > -0.5
    assert not in_room(Space("r", np.array(mesh.vertices), np.array(mesh.faces[some], np.int32)), points).any()


def test_what_cannot_be_covered_is_told():
    thin = space_of(extruded([[0, 0], [5, 0], [5, 0.1], [0, 0.1]], 2.8, 20.0), "shaft")
    graph, cover = covered(thin)
    assert not cover.covered and cover.why and graph.cell_count == 0
    flat = space_of(extruded([[0, 0], [5, 0], [5, 4], [0, 4]], 0.15), "duct")
    assert "0.15 m thin" in covered(flat)[1].why or covered(flat)[1].covered
    mesh = ROOMS["box"]
    floorless = Space("open", np.array(mesh.vertices), np.array(mesh.faces[mesh.face_normals[:, 2] > -0.5], np.int32))
    assert covered(floorless)[1].why == "its body is not closed"


def test_a_room_that_its_cells_cover_gets_no_others():
    space = space_of(ROOMS["box"], "hall")
    cells = np.array([[[0, 0, 0], [5 * 1024, 4 * 1024, 2867]]], np.int32)
    graph = no_cells()
    graph = CellGraph(cells, np.ones(1, bool), np.array(["hall"], object), graph.portal_cells, graph.portal_axis,
                      graph.portals)  # fmt: skip
    again, (cover,) = with_room_cells(Scene([], [], [space]), graph)
    assert cover.share == 1 and again.cell_count == 1
    named = CellGraph(cells, np.ones(1, bool), np.array(["other"], object), graph.portal_cells, graph.portal_axis,
                      graph.portals)  # fmt: skip
    assert with_room_cells(Scene([], [], [space]), named)[0].cell_count > 1
