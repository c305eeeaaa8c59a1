"""Cells, portals, dead cells and inhabitable cells: exact invariants in integers, and the traps that were met."""

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise, product

import numpy as np
import pytest
from builders import random_buildings
from builders.random_buildings import box_triangles as box
from builders.random_buildings import scene_of, tetrahedron
from viewcell.data.graph import OTHER_AXES, CellGraph
from viewcell.data.inhabit import find_inhabitable
from viewcell.data.opaque import opaque_planes
from viewcell.data.portals import find_portals, open_rectangles, shared_faces
from viewcell.data.scene import GRID_M, Space
from viewcell.data.solids import (
    SolidIndex,
    closed_elements,
    dead_cells,
    is_closed,
    triangles_meet_boxes,
    winding_numbers,
)
from viewcell.data.subdivide import cut_large, cut_rooms, merge, subdivide
from viewcell.verify.exact.sightline import Sightlines

SEEDS = range(25)
METRE = 1024


def triangles_of(seed, walls=6):
    """Walls of a random building; some are tilted, some double."""
    rng = np.random.default_rng(seed)
    triangles = random_buildings.rectangle_triangles(random_buildings.wall_rectangles(rng, walls))
    slanted = rng.integers(0, 513, (3, 3, 3)).astype(np.int32)
    double = triangles[rng.random(len(triangles)) < 0.3]
    return np.concatenate([triangles, slanted, double[:, ::-1]])


def cut(triangles, threshold=0.0):
    opaque = opaque_planes(triangles)
    leaves = subdivide(opaque, np.zeros(3), np.full(3, 512), threshold)
    return opaque, leaves, merge(leaves, opaque)


def overlap_somewhere(cells):
    """Whether any two boxes share volume, by looking at every pair."""
    low = np.maximum(cells[:, None, 0], cells[None, :, 0])
    high = np.minimum(cells[:, None, 1], cells[None, :, 1])
    both = (high > low).all(axis=2)
    return bool(np.triu(both, 1).any())


def volume(cells):
    return int(np.prod((cells[:, 1] - cells[:, 0]).astype(np.int64), axis=1).sum())


def holds(triangle, point):
    """Whether the closed triangle holds the point, in integers."""
    turns = []
    for n in range(3):
        a, b = triangle[n], triangle[(n + 1) % 3]
        turns.append((b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0]))
    return min(turns) >= 0 or max(turns) <= 0


@pytest.mark.parametrize("threshold", [0.0, 20_000.0])
@pytest.mark.parametrize("seed", SEEDS)
def test_cells_tile_the_box(seed, threshold):
    _, leaves, cells = cut(triangles_of(seed), threshold)
    for boxes in (leaves, cells):
        assert volume(boxes) == 512**3 and not overlap_somewhere(boxes)
        assert (boxes[:, 0] < boxes[:, 1]).all() and boxes.min() == 0 and boxes.max() == 512
    assert len(cells) <= len(leaves)


@pytest.mark.parametrize("seed", SEEDS)
def test_nothing_opaque_inside_a_cell(seed):
    opaque, _, cells = cut(triangles_of(seed))
    for axis in range(3):
        for rectangle in opaque.boxes[axis]:
            low, high = np.maximum(rectangle[0], cells[:, 0]), np.minimum(rectangle[1], cells[:, 1])
            uv = OTHER_AXES[axis]
            k = rectangle[0, axis]
            inside = (k > cells[:, 0, axis]) & (k < cells[:, 1, axis]) & (high > low)[:, uv].all(axis=1)
            assert not inside.any()


@pytest.mark.parametrize("seed", SEEDS)
def test_merging_leaves_nothing_to_merge(seed):
    opaque, _, cells = cut(triangles_of(seed))
    assert len(merge(cells, opaque)) == len(cells)


@pytest.mark.parametrize("threshold", [0.0, 20_000.0])
@pytest.mark.parametrize("seed", SEEDS)
def test_portals_and_walls_make_up_every_face(seed, threshold):
    """Each point of each shared face is either covered by a triangle or in exactly one portal of that pair of cells."""
    triangles = triangles_of(seed)
    opaque, _, cells = cut(triangles, threshold)
    graph = find_portals(cells, opaque)
    faces = 0
    for axis in range(3):
        uv = OTHER_AXES[axis]
        flat = triangles[np.ptp(triangles[:, :, axis], axis=1) == 0]
        for (low, high), face in zip(*shared_faces(cells, axis), strict=True):
            k = cells[low, 1, axis]
            walls = flat[flat[:, 0, axis] == k][:, :, uv].astype(np.int64)
            mine = (graph.portal_cells == (low, high)).all(axis=1)
            assert (graph.portal_axis[mine] == axis).all() and (graph.portals[mine][:, :, axis] == k).all()
            portals = graph.portals[mine][:, :, uv].astype(np.int64)
            ends = np.concatenate([face[None], walls.reshape(-1, 1, 2).repeat(2, axis=1), portals])
            us, vs = (np.unique(np.clip(ends[:, :, c], *face[:, c])) for c in (0, 1))
            for (u0, u1), (v0, v1) in product(pairwise(us), pairwise(vs)):
                middle = (u0 + u1, v0 + v1)
                solid = any(holds(2 * wall, middle) for wall in walls)
                within = ((2 * portals[:, 0] < middle) & (2 * portals[:, 1] > middle)).all(axis=1).sum()
                assert within == (0 if solid else 1)
            faces += 1
    assert faces > (3 if threshold == 0.0 else 0)


@pytest.mark.parametrize("seed", SEEDS)
def test_neighbours_are_found_by_looking_at_every_pair(seed):
    _, _, cells = cut(triangles_of(seed))
    for axis in range(3):
        u, v = OTHER_AXES[axis]
        expected = set()
        for a, b in product(range(len(cells)), repeat=2):
            low, high = np.maximum(cells[a, 0], cells[b, 0]), np.minimum(cells[a, 1], cells[b, 1])
            if cells[a, 1, axis] == cells[b, 0, axis] and high[u] > low[u] and high[v] > low[v]:
                expected.add((a, b, low[u], low[v], high[u], high[v]))
        pairs, faces = shared_faces(cells, axis)
        found = [(*pair, *face.ravel()) for pair, face in zip(pairs.tolist(), faces, strict=True)]
        assert len(found) == len(expected) and set(found) == expected


def test_open_rectangles_of_a_covered_face_are_none():
    faces = np.array([[[0, 0], [8, 8]], [[0, 0], [8, 8]]])
    walls = {3: np.array([[[-1, -1], [9, 9]]]), 5: np.array([[[8, 0], [9, 9]]])}
    face, rectangles = open_rectangles(faces, np.array([3, 5]), walls.__getitem__)
    assert face.tolist() == [1]
    np.testing.assert_array_equal(rectangles, faces[1:])


def test_planes_with_little_that_is_opaque_cut_nothing():
    """A wall of 200 x 512 steps, and a post of 20 x 20: above its area the post leaves its cell whole."""
    wall = np.array([[(100, 0, 0), (100, 200, 0), (100, 200, 512)], [(100, 0, 0), (100, 200, 512), (100, 0, 512)]])
    post = np.array([[(300, 0, 0), (300, 20, 0), (300, 20, 20)], [(300, 0, 0), (300, 20, 20), (300, 0, 20)]])
    opaque = opaque_planes(np.concatenate([wall, post]).astype(np.int32))
    counts = [len(subdivide(opaque, np.zeros(3), np.full(3, 512), least)) for least in (0.0, 399.0, 400.0, 200.0 * 512)]
    assert counts == [3, 3, 2, 1]


def clipped(triangle, low, high):
    """The triangle clipped to the closed box, in rationals."""
    polygon = [tuple(Fraction(int(c)) for c in corner) for corner in triangle]
    for axis in range(3):
        for sign, k in ((1, int(low[axis])), (-1, int(high[axis]))):
            edges = list(zip(polygon, polygon[1:] + polygon[:1], strict=True))
            kept = []
            for p, q in edges:
                s, t = sign * (p[axis] - k), sign * (q[axis] - k)
                if s >= 0:
                    kept.append(p)
                if s * t < 0:
                    kept.append(tuple(a + (b - a) * s / (s - t) for a, b in zip(p, q, strict=True)))
            polygon = kept
    return polygon


def test_triangle_meets_open_box_exactly():
    """Against clipping in rationals; half of the edges are parallel to an axis, and many triangles only touch."""
    rng = np.random.default_rng(4)
    triangles = rng.integers(-4, 5, (1500, 3, 3))
    triangles[::2, 1, :2] = triangles[::2, 0, :2]
    boxes = np.sort(rng.integers(-4, 5, (1500, 2, 3)), axis=1)
    boxes[:, 1] += boxes[:, 1] == boxes[:, 0]
    proper = ~(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) == 0).all(axis=1)
    triangles, boxes = triangles[proper], boxes[proper]
    met = triangles_meet_boxes(triangles, boxes)
    extra = 0
    for triangle, (low, high), answer in zip(triangles, boxes, met, strict=True):
        left = clipped(triangle, low, high)
        middle = [sum(c) / len(left) for c in zip(*left, strict=True)] if left else None
        truth = bool(left) and all(int(a) < c < int(b) for a, c, b in zip(low, middle, high, strict=True))
        # A doubt about the triangle's plane may be resolved towards "meets".
        assert answer >= truth, (triangle.tolist(), low.tolist(), high.tolist())
        extra += answer > truth
    assert 100 < met.sum() < len(met) - 100 and extra < 0.01 * len(met)


def door_wall():
    """A wall 4 m long with a door hole, one closed solid; its edges run along the axes."""
    outline = np.array([(0, 0), (1, 0), (1, 2), (2, 2), (2, 0), (4, 0), (4, 3), (0, 3)]) * METRE
    flat = [(0, 1, 7), (1, 2, 7), (2, 6, 7), (2, 3, 6), (3, 5, 6), (3, 4, 5)]
    front = np.array([[(outline[n][0], 0, outline[n][1]) for n in face] for face in flat])
    back = front[:, ::-1] + (0, 200, 0)
    sides = []
    for (x0, z0), (x1, z1) in zip(np.roll(outline, -1, axis=0), outline, strict=True):
        sides += [[(x0, 0, z0), (x1, 0, z1), (x1, 200, z1)], [(x0, 0, z0), (x1, 200, z1), (x0, 200, z0)]]
    return np.concatenate([front, back, np.array(sides)])


def door_wall_cells():
    """Three cells inside the wall, then the doorway, then one half in and half out, then a room in front."""
    boxes = [
        [(0, 0, 0), (1, 200, 3)],
        [(2, 0, 0), (4, 200, 2)],
        [(1, 0, 2), (4, 200, 3)],
        [(1, 0, 0), (2, 200, 2)],
        [(1, 0, 0), (4, 200, 3)],
        [(0, -3 * METRE, 0), (4, 0, 3)],
    ]
    return np.array([[(x * METRE, y, z * METRE) for x, y, z in corners] for corners in boxes])


def test_trap_door_hole_in_a_wall_with_axial_edges():
    """A separating axis of length 0 must not separate: the doorway is no dead cell, the wall around it is."""
    wall = door_wall()
    assert is_closed(wall)
    dead = dead_cells(door_wall_cells(), [(0, wall)])
    np.testing.assert_array_equal(dead, [True, True, True, False, False, False])


def test_trap_diagonal_inside_a_cell_keeps_it_alive():
    """Every triangle of a slanted solid crosses the cell: only separating axes with length may say otherwise."""
    solid = tetrahedron([(0, 0, 0), (3000, 0, 0), (0, 3000, 0), (0, 0, 3000)])
    cells = np.array(
        [[(0, 0, 0), (999, 1000, 1000)], [(0, 0, 0), (1001, 1000, 1000)], [(900, 900, 900), (1200, 1200, 1200)]]
    )
    np.testing.assert_array_equal(dead_cells(cells, [(0, solid)]), [True, False, False])


def test_trap_open_mesh_has_no_inside():
    """An open ceiling does not make the rooms under it solid."""
    closed, open_ = box((0, 0, 0), (100, 100, 100)), box((0, 0, 0), (100, 100, 100))[:-1]
    scene = scene_of([(open_, "occluder"), (closed, "occluder"), (closed, "transparent"), (closed, "detail")])
    assert [number for number, _ in closed_elements(scene)] == [1, 3]
    assert not is_closed(open_) and is_closed(closed)


def test_trap_cell_across_two_solids_is_alive():
    """Each solid alone: a cell half in one and half in the other is in neither."""
    halves = [(0, box((0, 0, 0), (50, 100, 100))), (1, box((50, 0, 0), (100, 100, 100)))]
    cells = np.array([[(25, 25, 25), (75, 75, 75)], [(25, 25, 25), (50, 75, 75)]])
    np.testing.assert_array_equal(dead_cells(cells, halves), [False, True])


def test_trap_sliver_curtain_wall():
    """Mullions of 5 cm between panes: thin open slivers stay portals, and the faces still add up."""
    mullions = [box((x, 0, 0), (x + 51, 153, 3000)) for x in range(0, 3000, 307)]
    triangles = np.concatenate(mullions).astype(np.int32)
    opaque = opaque_planes(triangles)
    low, high = np.array([-2000, -2000, -500]), np.array([5000, 2000, 3500])
    cells = merge(subdivide(opaque, low, high), opaque)
    dead = dead_cells(cells, list(enumerate(mullions)))
    assert dead.sum() >= len(mullions) and volume(cells) == np.prod(high - low)
    assert volume(cells[dead]) == len(mullions) * 51 * 153 * 3000
    graph = find_portals(cells[~dead], opaque)
    for x in range(13, 2700, 51):
        within = (graph.cells[:, 0] < (x, 0, 1500)).all(axis=1) & (graph.cells[:, 1] > (x, 0, 1500)).all(axis=1)
        crossed = (graph.portal_axis == 1) & (graph.portals[:, 0, 1] == 0)
        crossed &= (graph.portals[:, 0] <= (x, 0, 1500)).all(axis=1) & (graph.portals[:, 1] >= (x, 0, 1500)).all(axis=1)
        assert within.sum() + crossed.sum() == (0 if x % 307 < 51 else 1), x


@pytest.mark.parametrize("seed", range(5))
def test_solids_agree_with_the_exact_twin(seed):
    rng = np.random.default_rng(seed)
    parts = [tetrahedron(rng.integers(0, 500, (4, 3))) for _ in range(4)]
    parts += [box(low, low + rng.integers(50, 300, 3)) for low in rng.integers(0, 300, (4, 3))]
    scene = scene_of([(part, "occluder") for part in parts])
    solids = closed_elements(scene)
    points = rng.uniform(1, 499, (800, 3))
    got = SolidIndex(np.array([[(0, 0, 0), (500, 500, 500)]]), solids).outside(points, 0)
    truth = Sightlines(*scene.triangles()).outside_solids(points)
    assert not (got & ~truth).any(), "called outside, but is inside"
    assert (got == truth).mean() > 0.99 and 50 < truth.sum() < 750


def blunt_tetrahedron(rng):
    """One of whose corners none is a needle."""
    while True:
        corners = rng.integers(-60, 60, (4, 3))
        if abs(np.linalg.det((corners[1:] - corners[0]).astype(float))) > 60_000:
            return tetrahedron(corners)


def on_surface(rng, triangles, count):
    """Corners, points of edges and points of faces, in quarters."""
    weights = rng.choice([[4, 0, 0], [1, 3, 0], [2, 2, 0], [0, 2, 2], [2, 1, 1], [1, 2, 1], [1, 1, 2]], count) / 4
    return np.einsum("nk,nki->ni", weights, triangles[rng.integers(0, len(triangles), count)].astype(float))


@pytest.mark.parametrize("seed", range(6))
def test_what_lies_on_a_solid_is_not_outside(seed):
    """Half or a quarter of the way round is on it; boxes up to the size of the grid, and points beside them."""
    rng = np.random.default_rng(seed)
    parts = [blunt_tetrahedron(rng) * 4 for _ in range(2)]
    size = int(rng.choice([4, 2**17])) if seed % 2 else 4
    parts += [box(low * size, (low + rng.integers(5, 60, 3)) * size) for low in rng.integers(-60, 40, (2, 3))]
    triangles, owners = scene_of([(part, "occluder") for part in parts[2 * (seed % 2) :]]).triangles()
    points = on_surface(rng, triangles, 600)
    points = np.concatenate([points, points + rng.choice([-1, 0, 1], points.shape)])
    solids = [(n, triangles[owners == n]) for n in np.unique(owners)]
    got = SolidIndex(np.array([[points.min(axis=0) - 1, points.max(axis=0) + 1]]), solids).outside(points, 0)
    truth = Sightlines(triangles, owners).outside_solids(points)
    assert not (got & ~truth).any(), "called outside, but is on or inside"
    assert got.sum() > 0.8 * truth.sum() > 100 and (~truth).sum() > 600


def test_winding_number_of_a_solid_turned_inside_out():
    points = np.array([[5.0, 5.0, 5.0], [20.0, 5.0, 5.0]])
    outward = winding_numbers(points, box((0, 0, 0), (10, 10, 10)))
    np.testing.assert_allclose(np.abs(outward), [1, 0], atol=1e-9)
    np.testing.assert_allclose(winding_numbers(points, box((0, 0, 0), (10, 10, 10))[:, ::-1]), -outward, atol=1e-9)


def test_rooms_cut_only_cells_that_they_share():
    cells = np.array([[(0, 0, -100), (100, 100, 500)], [(100, 0, -100), (300, 100, 500)]], np.int32)
    rooms = np.array([[(0, 0, 0), (120, 100, 300)]])
    made = cut_rooms(cells, rooms)
    assert volume(made) == volume(cells) and not overlap_somewhere(made)
    assert sorted(made[made[:, 1, 0] == 100][:, 0, 2].tolist()) == [-100, 0, 300]
    assert (made[:, 1, 0] == 300).sum() == 1
    np.testing.assert_array_equal(cut_rooms(cells, np.zeros((0, 2, 3), int)), cells)


def room_scene(hole=None, rooms=()):
    """A room of 4 x 4 x 3 m with walls of 20 cm, one of them with a hole of the given size in steps."""
    size, wall = np.array([4, 4, 3]) * METRE, 205
    parts = []
    for axis in range(3):
        for side in (0, 1):
            low, high = np.full(3, -wall), size + wall
            low[axis] = size[axis] if side else -wall
            high[axis] = size[axis] + wall if side else 0
            if axis == 0 and side and hole:
                parts.append((box(low, (high[0], 0, high[2])), "occluder"))
                parts.append((box((low[0], hole, low[2]), high), "occluder"))
                parts.append((box((low[0], 0, low[2]), (high[0], hole, 0)), "occluder"))
                parts.append((box((low[0], 0, 2 * METRE), (high[0], hole, high[2])), "occluder"))
            else:
                parts.append((box(low, high), "occluder"))
    return scene_of(parts, rooms)


def room_graph(scene):
    triangles, _ = scene.triangles()
    opaque = opaque_planes(triangles)
    low, high = triangles.min(axis=(0, 1)) - 2 * METRE, triangles.max(axis=(0, 1)) + 2 * METRE
    cells = merge(subdivide(opaque, low, high), opaque)
    return find_portals(cells[~dead_cells(cells, closed_elements(scene))], opaque)


def test_inhabitable_by_rooms():
    scene = room_scene(rooms=[((0, 0, 0), (4 * METRE, 4 * METRE, 3 * METRE))])
    graph = room_graph(scene)
    found = find_inhabitable(scene, graph)
    np.testing.assert_array_equal(graph.cells[found.mask], [[(0, 0, 0), (4 * METRE, 4 * METRE, 3 * METRE)]])
    assert found.names[found.mask].tolist() == ["room 0"] and "1 room" in found.reason


def bare_graph(cells):
    """Cells without portals."""
    count, none = len(cells), np.zeros((0, 2), np.int32)
    names = np.full(count, "", object)
    return CellGraph(
        np.array(cells, np.int32), np.zeros(count, bool), names, none, np.zeros(0, np.int8), none.reshape(0, 2, 3)
    )


@pytest.mark.parametrize("axis", range(3))
def test_a_cell_belongs_to_a_room_that_holds_more_than_half_of_it(axis):
    """Rooms that hold a quarter, a half and three quarters of a cell of 4 m; and two that hold a half each."""
    cells, rooms = [], []
    for place, quarters in enumerate((1, 2, 3)):
        low = np.array([0, 0, 0]) + 10 * METRE * place * np.eye(3, dtype=int)[axis - 1]
        high = low + 4 * METRE
        cells.append([low, high])
        rooms.append((low - 500, np.where(np.arange(3) == axis, low + quarters * METRE, high + 500)))
    low, high = cells[0] = np.array(cells[0]) - 20 * METRE
    halfway = np.where(np.arange(3) == axis, low + 2 * METRE, high)
    rooms = [rooms[1], rooms[2], (low, halfway), (np.where(np.arange(3) == axis, halfway, low), high + 1)]
    cells.append(np.array(cells[1]) + 40 * METRE)
    rooms.append((cells[-1][0] - 500, np.where(np.arange(3) == axis, cells[-1][0] + METRE, cells[-1][1] + 500)))
    # Rooms that hold half of no cell name none of those: these hold another one whole.
    for room in (0, -1):
        low, high = rooms[room]
        before = np.where(np.arange(3) == axis, low - 6 * METRE, low)
        cells.append([before + 1000, np.where(np.arange(3) == axis, low - METRE, high - 1000)])
        rooms[room] = before, high
    found = find_inhabitable(room_scene(rooms=rooms), bare_graph(cells))
    np.testing.assert_array_equal(found.mask, [True, False, True, False, True, True])
    assert found.names.tolist() == ["room 2, room 3", "", "room 1", "", "room 0", "room 4"]


def test_a_room_that_is_no_box_holds_what_is_inside_it():
    """A room round a corner, whose box holds a cell that it does not."""
    scene = room_scene()
    corner = 8 * METRE * np.array([(0, 0), (1, 0), (1, 0.5), (0.5, 0.5), (0.5, 1), (0, 1)])
    flat = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    low, high = (np.column_stack([corner, np.full(6, z)]) for z in (0, 4 * METRE))
    faces = [face[::-1] for face in flat] + [tuple(6 + k for k in face) for face in flat]
    for k in range(6):
        faces += [(k, (k + 1) % 6, 6 + (k + 1) % 6), (k, 6 + (k + 1) % 6, 6 + k)]
    scene.spaces = [Space("corner", np.concatenate([low, high]) * GRID_M, np.array(faces, np.int32))]
    cells = METRE * np.array([[[0, 0, 0], [4, 4, 4]], [[4, 0, 0], [8, 4, 4]], [[4, 4, 0], [8, 8, 4]]])
    np.testing.assert_array_equal(find_inhabitable(scene, bare_graph(cells)).mask, [True, True, False])


def test_inhabitable_by_flooding_when_no_room_is_named():
    scene = room_scene()
    graph = room_graph(scene)
    found = find_inhabitable(scene, graph)
    np.testing.assert_array_equal(graph.cells[found.mask], [[(0, 0, 0), (4 * METRE, 4 * METRE, 3 * METRE)]])
    assert "not reached from outside" in found.reason and found.leak == []


def test_inhabitable_with_a_shut_opening_and_with_a_leak():
    scene = room_scene(hole=METRE)
    graph = room_graph(scene)
    leaking = find_inhabitable(scene, graph)
    assert "leaks" in leaking.reason and len(leaking.leak) > 1
    links = {tuple(sorted(pair)) for pair in graph.portal_cells.tolist()}
    assert all(tuple(sorted(step)) in links for step in pairwise(leaking.leak))
    scene.openings = np.array([[(4 * METRE, 0, 0), (4 * METRE + 205, METRE, 2 * METRE)]]) * GRID_M
    shut = find_inhabitable(scene, graph)
    assert "not reached from outside" in shut.reason and shut.mask.any()
    assert (graph.cells[shut.mask][:, 0] >= 0).all() and (graph.cells[shut.mask][:, 1, 0] <= 4 * METRE).all()


def test_a_flooded_room_is_large_and_has_an_opening():
    """Outside, a room behind a door, the inside of a wall, a cupboard with a door, and a shed that stands open."""
    ends = [-4, 0, 4, 8, 8.375, 12]
    cells = [[[a * METRE, 0, 0], [b * METRE, 4 * METRE, 3 * METRE]] for a, b in pairwise(ends)]
    pairs, planes = [(0, 1), (3, 4), (0, 4)], [0, 8.375, 12]
    flat = np.array([[[x * METRE, 0, 0], [x * METRE, METRE, 2 * METRE]] for x in planes], np.int32)
    graph = replace(
        bare_graph(cells), portal_cells=np.array(pairs, np.int32), portal_axis=np.zeros(3, np.int8), portals=flat
    )
    scene = room_scene()
    scene.openings = np.array([[[x - 0.125, 0, 0], [x + 0.125, 1, 2]] for x in planes[:2]])
    found = find_inhabitable(scene, graph)
    assert "not reached from outside" in found.reason
    np.testing.assert_array_equal(found.mask, [False, True, False, False, False])


def test_trap_sliver_of_a_room_is_not_inhabitable():
    """A cell thinner than 30 cm is no place to stand, room or not."""
    scene = room_scene(rooms=[((0, 0, 0), (4 * METRE, 4 * METRE, 3 * METRE))])
    cells = np.array([[(0, 0, 0), (250, 4096, 3072)], [(250, 0, 0), (4096, 4096, 3072)]], np.int32)
    none = np.zeros((0, 2), np.int32)
    graph = CellGraph(
        cells, np.zeros(2, bool), np.full(2, ""), none, np.zeros(0, np.int8), np.zeros((0, 2, 3), np.int32)
    )
    np.testing.assert_array_equal(find_inhabitable(scene, graph).mask, [False, True])


def test_large_cells_are_cut_into_equal_parts_that_tile_them():
    cells = np.array([[[0, 0, 0], [10, 3, 4]], [[10, 0, 0], [20, 3, 4]], [[0, 3, 0], [4, 7, 4]]], np.int32)
    boxes, parents = cut_large(cells, np.array([True, False, True]), 4.0)
    assert parents.tolist() == [0, 0, 0, 1, 2]
    assert boxes[:3, :, 0].tolist() == [[0, 3], [3, 6], [6, 10]] and boxes[3:].tolist() == cells[1:].tolist()
    size = np.diff(boxes, axis=1)[:, 0]
    assert size[[0, 1, 2, 4]][:, :2].max() <= 4
    for cell in range(3):
        assert size[parents == cell].prod(axis=1).sum() == np.diff(cells[cell], axis=0).prod()
