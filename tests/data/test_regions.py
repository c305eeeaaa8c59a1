"""Opaque regions of axial planes: nothing in them is open, and walls that meet become one."""

import numpy as np
import pytest
import trimesh
from builders import random_solids
from viewcell.data.graph import OTHER_AXES
from viewcell.data.prepared import PreparedModel
from viewcell.data.solids import winding_numbers


def regions_of(scene):
    return PreparedModel(scene).regions


def covered_cells(regions, region):
    """Raster cells of a region that it covers: middles (u, v) in the plane, shape (n, 2), and the rectangles."""
    (u0, v0, t0), (u1, v1, t1) = regions.places[region], regions.places[region + 1]
    us, vs = regions.u[u0:u1].astype(float), regions.v[v0:v1].astype(float)
    before = regions.open_before[t0:t1].reshape(len(us), len(vs))
    closed = before[1:, 1:] - before[:-1, 1:] - before[1:, :-1] + before[:-1, :-1] == 0
    i, j = np.nonzero(closed)
    return np.stack([np.stack([us[i], vs[j]], axis=1), np.stack([us[i + 1], vs[j + 1]], axis=1)], axis=1)


def open_points(scene, regions, random, share=3):
    """Points of regions that are neither on opaque surface of the plane nor next to the inside of a closed element."""
    triangles, owners = scene.triangles()
    bad = []
    for region, (axis, k) in enumerate(zip(regions.axis, regions.plane, strict=True)):
        boxes = covered_cells(regions, region)
        points = boxes[:, :1] + random.uniform(0.02, 0.98, (len(boxes), share, 2)) * (boxes[:, 1:] - boxes[:, :1])
        # A tenth of a step off the corners: where rounding outwards would show.
        inset = np.minimum(0.1, (boxes[:, 1] - boxes[:, 0]) / 4)
        low, high = boxes[:, 0] + inset, boxes[:, 1] - inset
        corners = [low, high, np.stack([low[:, 0], high[:, 1]], 1), np.stack([high[:, 0], low[:, 1]], 1)]
        points = np.concatenate([points.reshape(-1, 2), boxes.mean(axis=1), *corners])
        held = np.zeros(len(points), bool)
        flat = (triangles[:, :, axis] == k).all(axis=1)
        for corners in triangles[flat][:, :, OTHER_AXES[axis]].astype(float):
            a, b, c = corners
            sides = [np.cross(q - p, points - p) for p, q in ((a, b), (b, c), (c, a))]
            held |= (np.minimum.reduce(sides) >= 0) | (np.maximum.reduce(sides) <= 0)
        for step in (-1e-3, 1e-3):
            eyes = np.zeros((len(points), 3))
            eyes[:, axis], eyes[:, OTHER_AXES[axis]] = k + step, points
            for element in np.unique(owners):
                held |= np.abs(winding_numbers(eyes, triangles[owners == element])) > 0.5
        bad.append(points[~held])
    return np.concatenate(bad)


@pytest.mark.filterwarnings("ignore:Arrays of 2-dimensional vectors")
@pytest.mark.parametrize("seed", range(5))
def test_every_point_of_a_region_is_opaque(seed):
    scene = random_solids.random_solids(seed)
    regions = regions_of(scene)
    assert len(regions.axis)
    assert len(open_points(scene, regions, np.random.default_rng(seed))) == 0


def prism(outline):
    """A solid of some corners (x, y) [m], 3 m high."""
    return trimesh.creation.extrude_triangulation(*outline, 3.0)


@pytest.mark.filterwarnings("ignore:Arrays of 2-dimensional vectors")
@pytest.mark.parametrize("axis", range(3))
def test_what_is_no_box_is_opaque_where_it_is_only(axis):
    """A wall of L shape, and a box of which an edge is cut off although all eight corners are there."""
    corners = np.array([[0, 0], [4, 0], [4, 0.5], [0.5, 0.5], [0.5, 4], [0, 4]], float)
    wall = prism((corners, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])))
    cut = random_solids.box([6, 0, 0], [9, 3, 3])
    edge = np.flatnonzero((cut.vertices[:, 1] == 0) & (cut.vertices[:, 2] == 0))
    beside = [face for face in cut.faces.tolist() if set(edge) <= set(face)]
    (a, b), (c, d) = edge, [next(v for v in face if v not in edge) for face in beside]
    rest = [face for face in cut.faces.tolist() if face not in beside]
    for new in ([[a, c, d], [d, c, b]], [[a, d, c], [d, b, c]]):
        if trimesh.Trimesh(cut.vertices, rest + new, process=False).is_winding_consistent:
            cut.faces = rest + new
    assert wall.is_watertight and cut.is_watertight and len(cut.faces) == 12 and cut.volume == 27 - 4.5
    for mesh in (wall, cut):
        mesh.vertices = np.roll(mesh.vertices, axis, axis=1)
    scene = random_solids.scene_of_meshes([wall, cut])
    regions = regions_of(scene)
    # The wall is cut from its foot to its head, and what is below or above is not.
    heights = regions.plane[regions.axis == (2 + axis) % 3]
    assert {0, 3072} <= set(heights.tolist()) and heights.min() == 0 and heights.max() == 3072
    assert len(open_points(scene, regions, np.random.default_rng(0))) == 0


def test_section_of_a_crossing_wall_closes_the_gap_in_a_face():
    # The face of the long wall is modelled in two halves, with the crossing wall's end between them.
    walls = [
        random_solids.box([0, 0, 0], [2, 0.2, 3]),
        random_solids.box([2, 0, 0], [2.2, 3, 3]),
        random_solids.box([2.2, 0, 0], [4, 0.2, 3]),
    ]
    regions = regions_of(random_solids.scene_of_meshes(walls))
    face = np.flatnonzero((regions.axis == 1) & (regions.plane == 205))
    assert len(face) == 1
    boxes = regions.boxes[regions.region == face[0]]
    assert [0, 205, 0] in boxes[:, 0].tolist() and [4096, 205, 3072] in boxes[:, 1].tolist()


def test_open_elements_give_no_section():
    mesh = random_solids.box([0, 0, 0], [1, 1, 1])
    mesh.update_faces(np.arange(len(mesh.faces)) > 0)
    regions = regions_of(random_solids.scene_of_meshes([mesh]))
    assert not ((regions.plane > 0) & (regions.plane < 1024)).any()


def test_rectangles_lie_in_their_region_and_cover_it():
    regions = regions_of(random_solids.random_solids(3))
    for region, axis in enumerate(regions.axis):
        cells = covered_cells(regions, region)
        boxes = regions.boxes[regions.region == region][:, :, OTHER_AXES[axis]].astype(float)
        inside = (cells[:, None, 0] >= boxes[None, :, 0]).all(axis=2) & (cells[:, None, 1] <= boxes[None, :, 1]).all(
            axis=2
        )
        assert inside.any(axis=1).all()
        area = np.prod(cells[:, 1] - cells[:, 0], axis=1)
        np.testing.assert_allclose((inside * area[:, None]).sum(axis=0), np.prod(boxes[:, 1] - boxes[:, 0], axis=1))
