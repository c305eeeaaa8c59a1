"""Back-face culling by normal cones against exact integers, triangle by triangle."""

from fractions import Fraction

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.buildings.office import make_office
from viewcell.data.errors import InputError
from viewcell.data.scene import Definition, Instance, Mesh, Role, Scene
from viewcell.data.solids import closed_elements
from viewcell.kernels.backface import LEAF_SIZE, build_cones, integer_normals, launch_backface
from viewcell.kernels.launch import Device
from viewcell.verify.arithmetic import cross, dot
from viewcell.verify.exact.backface import back_facing, outward_triangles
from viewcell.verify.rays.embree import embree_scene


def cones_of(scene):
    return build_cones(closed_elements(scene), scene.triangle_counts, scene.first_alike)


def scene_of(*meshes, role=Role.DETAIL):
    """One object for each (vertices, faces) in grid steps; a grid of 1 m keeps them as they are."""
    shapes = [Mesh(np.array(vertices, float), np.array(faces)) for vertices, faces in meshes]
    definitions = [Definition(f"shape {k}", (mesh,)) for k, mesh in enumerate(shapes)]
    objects = [Instance(f"object {k}", "", k, np.eye(4), role) for k in range(len(meshes))]
    return Scene(definitions, objects, grid_m=1.0)


def box_mesh(low, high):
    mesh = trimesh.creation.box(bounds=[low, high])
    return np.round(mesh.vertices), mesh.faces


def icosphere(radius, centre=(0, 0, 0), subdivisions=3):
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return np.round(mesh.vertices + centre), mesh.faces


def reference(scene, box):
    """Removed triangles of each object, by the twin."""
    triangles, owners = scene.triangles()
    opaque, counts = scene.object_mask(Role.OCCLUDER, Role.DETAIL), np.zeros(len(scene.objects), int)
    for object_id in np.flatnonzero(opaque):
        own = triangles[owners == object_id]
        counts[object_id] = np.sum(np.array(back_facing(own, box)) & outward_triangles(own))
    return counts


def removed(scene, boxes, **options):
    """Counts of all objects for every box, shape (boxes, objects)."""
    rows = np.stack(np.meshgrid(np.arange(len(boxes)), np.arange(len(scene.objects)), indexing="ij"), axis=-1)
    counts, _ = launch_backface(cones_of(scene), np.asarray(boxes), rows.reshape(-1, 2), **options)
    return counts.reshape(len(boxes), -1)


def random_boxes(rng, bounds, count, size):
    low = rng.integers(bounds[0] - size, bounds[1], (count, 3))
    return np.stack([low, low + rng.integers(1, size, (count, 3))], axis=1)


def test_copies_count_as_their_models_do_where_they_stand():
    """Shapes between their copies, one of them inside out, one of many nodes: as if each were looked at alone."""
    ball, box = icosphere(3000), box_mesh([0, 0, 0], [900, 700, 500])
    shapes = [ball, (box[0], box[1][:, ::-1]), box]
    rng = np.random.default_rng(5)
    places = [shape for _ in range(4) for shape in shapes]
    meshes = [(vertices + rng.integers(-9000, 9000, 3), faces) for vertices, faces in places]
    scene = scene_of(*meshes)
    assert (scene.first_alike == np.arange(12) % 3).all()
    boxes = random_boxes(rng, np.array([[-12000] * 3, [12000] * 3]), 20, 3000)
    rows = np.stack(np.meshgrid(np.arange(20), np.arange(12), indexing="ij"), axis=-1).reshape(-1, 2)
    plain = launch_backface(build_cones(closed_elements(scene), scene.triangle_counts), boxes, rows)
    found = launch_backface(cones_of(scene), boxes, rows)
    np.testing.assert_array_equal(found[0], plain[0])
    np.testing.assert_array_equal(found[1], plain[1])
    assert (found[0].reshape(20, 4, 3)[:, :, 1] == 0).all() and len(np.unique(found[0])) > 40


def test_cells_about_a_sphere():
    scene = scene_of(icosphere(3000))
    boxes = random_boxes(np.random.default_rng(0), np.array([[-6000] * 3, [6000] * 3]), 12, 3000)
    counts = removed(scene, boxes)[:, 0]
    assert counts.tolist() == [reference(scene, box)[0] for box in boxes]
    assert 600 < counts.min() < counts.max() < 1200


def test_furniture_of_an_office():
    scene = make_office(floors=1, rooms_per_side=2, seed=4)
    bounds = scene.object_bounds()
    boxes = random_boxes(np.random.default_rng(1), (bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)), 1, 1024)
    counts = removed(scene, boxes)
    np.testing.assert_array_equal(counts[0], reference(scene, boxes[0]))
    assert counts.sum() > 0.3 * len(scene.triangles()[0])


@given(st.integers(0, 2), st.booleans(), st.integers(-1, 1), st.integers(1, 50))
def test_a_cell_at_the_plane_of_a_side(axis, above, step, size):
    """From the plane on outwards the cell is before the side; a cell that only touches it from inside is not."""
    scene = scene_of(box_mesh((-100, -200, -300), (100, 200, 300)))
    low = np.array([-size, -size, -size])
    half = 100 * (axis + 1)
    low[axis] = half + step if above else -half - step - size
    counts = removed(scene, [[low, low + size]])
    assert counts.tolist() == [[10 if step >= 0 else 12 if size + step <= 0 else 10]]
    assert counts[0, 0] == reference(scene, np.array([low, low + size]))[0]


@pytest.mark.parametrize("seed", range(3))
def test_planes_that_pass_a_corner_within_a_step(seed):
    """Large tetrahedra, and cells with a corner at the grid point nearest to a point of a side's plane."""
    rng = np.random.default_rng(seed)
    corners = rng.integers(-(2**24) + 1, 2**24, (40, 4, 3))
    inverted = np.linalg.det((corners[:, 1:] - corners[:, :1]).astype(float)) < 0
    corners[inverted] = corners[inverted][:, [0, 2, 1, 3]]
    faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
    scene = scene_of(*((tetrahedron, faces) for tetrahedron in corners))
    share = rng.dirichlet(np.ones(3), 40)
    points = np.einsum("nk,nki->ni", share, corners[:, :3]).round().astype(int)
    size = rng.integers(1, 200, (40, 3))
    side = rng.integers(0, 2, (40, 3))
    boxes = np.stack([points - side * size, points + (1 - side) * size], axis=1)
    rows = np.column_stack([np.arange(40)] * 2)
    counts, _ = launch_backface(cones_of(scene), boxes, rows)
    triangles, _ = scene.triangles()
    assert counts.tolist() == [sum(back_facing(triangles[4 * k : 4 * k + 4], box)) for k, box in enumerate(boxes)]
    assert outward_triangles(triangles[:4]) == [True] * 4


def test_only_closed_shells_turned_outwards_are_culled():
    vertices, faces = box_mesh((0, 0, 0), (100, 100, 100))
    both = np.concatenate([vertices, vertices + 500]), np.concatenate([faces, faces[:, ::-1] + len(vertices)])
    room_in_box = (
        np.concatenate([vertices, vertices * 0.5 + 25]),
        np.concatenate([faces, faces[:, ::-1] + len(vertices)]),
    )
    scene = scene_of((vertices, faces), (vertices, faces[:, ::-1]), (vertices, faces[1:]), both, room_in_box)
    boxes = np.array([[[200, 20, 20], [220, 40, 40]], [[-200, -200, -200], [-190, -190, -190]]])
    counts = removed(scene, boxes)
    # Beside a box five sides of it are turned away, before a corner three; an inverted shell never, a cavity neither.
    assert counts.tolist() == [[10, 0, 0, 10, 10], [6, 0, 0, 6, 6]]
    np.testing.assert_array_equal(counts, [reference(scene, box) for box in boxes])
    glass = scene_of((vertices, faces), role=Role.TRANSPARENT)
    assert not removed(glass, boxes).any()


def test_a_cell_inside_an_object_is_told():
    scene = scene_of(box_mesh((-100, -100, -100), (100, 100, 100)))
    cells = np.array([[[-9, -9, -9], [9, 9, 9]], [[-9, -9, -9], [9, 9, 101]]])
    counts, whole = launch_backface(cones_of(scene), cells, np.array([[0, 0], [1, 0]]))
    assert counts.tolist() == [12, 10]
    assert whole.tolist() == [True, False]


def test_hierarchies_hold_what_they_should():
    scene = make_office(floors=1, rooms_per_side=2, seed=2)
    cones = cones_of(scene)
    normals = integer_normals(cones.triangles).astype(float)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    narrow = 0
    for node, (first, last) in enumerate(cones.ranges):
        low, high = cones.boxes[node]
        part = cones.triangles[first:last]
        assert (part >= low).all()
        assert (part <= high).all()
        assert len(set(cones.owners[first:last])) == 1
        sine = cones.cones[node, 3]
        if sine <= 1:
            narrow += 1
            assert (np.linalg.norm(np.cross(normals[first:last], cones.cones[node, :3]), axis=1) <= sine).all()
            assert (normals[first:last] @ cones.cones[node, :3] > 0).all()
        child, after = cones.links[node]
        if child < 0:
            assert last - first <= LEAF_SIZE
        else:
            assert cones.ranges[child].tolist() == [first, cones.ranges[child + 1][0]]
            assert cones.ranges[child + 1][1] == last
            assert cones.links[child][1] == child + 1
            assert cones.links[child + 1][1] == after
    assert narrow > len(cones.ranges) / 2
    assert (cones.owners[cones.ranges[cones.roots[cones.roots >= 0], 0]] == np.flatnonzero(cones.roots >= 0)).all()


def test_cones_hold_their_normals_exactly():
    """In rationals: the sine is rounded up, not to the nearest."""
    cones, looked_at = cones_of(scene_of(icosphere(3000, subdivisions=2), icosphere(2**23, subdivisions=2))), 0
    normals = integer_normals(cones.triangles).tolist()
    for (first, last), cone in zip(cones.ranges.tolist(), cones.cones, strict=True):
        *axis, sine = (Fraction(x) for x in cone.tolist())
        if sine > 1:
            continue
        looked_at += 1
        for n in normals[first:last]:
            assert dot(axis, n) > 0
            across = cross(axis, n)
            assert dot(across, across) <= sine * sine * dot(n, n) * dot(axis, axis)
    assert looked_at > 100


def test_no_ray_from_outside_meets_a_removed_triangle_first():
    scene = scene_of(icosphere(3000, (200, 300, 400)), icosphere(900, (5000, 0, 0)))
    triangles, owners = scene.triangles()
    cell = np.array([[3600, -900, -900], [3900, 900, 900]])
    away = np.array(back_facing(triangles, cell))
    assert removed(scene, [cell])[0].tolist() == [away[owners == k].sum() for k in (0, 1)]
    rng = np.random.default_rng(0)
    eyes = rng.uniform(cell[0], cell[1], (4000, 3)).astype(np.float32)
    aims = triangles[rng.choice(np.flatnonzero(away), 4000)].mean(axis=1)
    hits = embree_scene(triangles).run(eyes, (aims - eyes).astype(np.float32), output=1)["primID"]
    assert (hits >= 0).all()
    assert not away[hits].any()


def test_threads_change_nothing():
    scene = scene_of(icosphere(3000), box_mesh((0, 0, 4000), (900, 900, 5000)))
    boxes = random_boxes(np.random.default_rng(7), np.array([[-6000] * 3, [6000] * 3]), 3000, 2000)
    np.testing.assert_array_equal(removed(scene, boxes), removed(scene, boxes, device=Device(threads=2)))


def test_a_scene_without_closed_objects():
    vertices, faces = box_mesh((0, 0, 0), (9, 9, 9))
    scene = scene_of((vertices, faces[1:]))
    assert removed(scene, [[[20, 0, 0], [30, 9, 9]]]).tolist() == [[0]]
    assert len(cones_of(Scene([], [])).roots) == 0


@pytest.mark.parametrize(
    ("boxes", "rows", "message"),
    [
        (np.zeros((2, 3), int), [[0, 0]], "shapes"),
        (np.zeros((1, 2, 3), int), [0, 0], "shapes"),
        (np.zeros((1, 2, 3), int), [[0, 1]], "below"),
        (np.zeros((1, 2, 3), int), [[-1, 0]], "below"),
    ],
)
def test_bad_rows_are_refused(boxes, rows, message):
    with pytest.raises(InputError, match=message):
        launch_backface(cones_of(scene_of(box_mesh((0, 0, 0), (9, 9, 9)))), boxes, rows)
