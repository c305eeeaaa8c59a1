"""Random axial buildings on a coarse grid, and what is exactly true of them."""

from itertools import product

import numpy as np
from viewcell.data.graph import OTHER_AXES
from viewcell.data.opaque import opaque_planes
from viewcell.data.portals import find_portals
from viewcell.data.scene import GRID_M, Definition, Instance, Mesh, Role, Scene, Space
from viewcell.data.subdivide import merge, subdivide
from viewcell.data.verdict import Verdict
from viewcell.verify.exact.stab import stab

# Coarse steps of the building's box and grid steps a coarse step.
SIZE, STEP = 8, 64
OCTANTS = list(product((1, -1), repeat=3))


def wall_rectangles(rng, walls):
    """Walls with a hole each, as rectangles (axis, plane, u0, u1, v0, v1) in coarse steps."""
    found = []
    for _ in range(walls):
        axis, k = rng.integers(0, 3), rng.integers(1, SIZE)
        u, v = (np.sort(rng.choice(SIZE + 1, 2, replace=False)) for _ in range(2))
        if rng.random() < 0.6:
            u, v = np.array([0, SIZE]), np.array([0, SIZE])
        (a, b), (c, d) = (np.sort(rng.choice(np.arange(x[0], x[1] + 1), 2, replace=False)) for x in (u, v))
        pieces = [(u[0], a, *v), (b, u[1], *v), (a, b, v[0], c), (a, b, d, v[1])]
        found += [(axis, k, *piece) for piece in pieces if piece[1] > piece[0] and piece[3] > piece[2]]
    return found


def rectangle_triangles(rectangles, step=STEP):
    """Two triangles a rectangle, shape (n, 3, 3), int32."""
    corners = []
    for axis, k, u0, u1, v0, v1 in rectangles:
        quad = np.full((4, 3), k)
        quad[:, OTHER_AXES[axis]] = [(u0, v0), (u1, v0), (u1, v1), (u0, v1)]
        corners += [quad[[0, 1, 2]], quad[[0, 2, 3]]]
    return (np.array(corners).reshape(-1, 3, 3) * step).astype(np.int32)


def random_graph(seed, walls=5):
    """Cells and portals of a random building, every cell inhabitable, and its opaque rectangles."""
    opaque = opaque_planes(rectangle_triangles(wall_rectangles(np.random.default_rng(seed), walls)))
    leaves = subdivide(opaque, np.zeros(3), np.full(3, SIZE * STEP))
    graph = find_portals(merge(leaves, opaque), opaque)
    graph.inhabitable[:] = True
    return graph, opaque


def reached_cells(graph, source, octants=OCTANTS):
    """Cells that a portal sequence with an open stabbing line joins to the source: depth-first, exact, in Python."""
    starts, entries = graph.adjacency()
    reached = {source}
    stack = [(source, graph.cells[source][None].astype(np.int64), tuple(octants))]
    while stack:
        cell, boxes, fitting = stack.pop()
        for portal, behind in entries[starts[cell] : starts[cell + 1]].tolist():
            axis, sense = graph.portal_axis[portal], 1 if graph.portal_cells[portal, 0] == cell else -1
            longer = np.concatenate([boxes, graph.portals[portal][None]])
            open_ones = [o for o in fitting if o[axis] == sense and stab(longer, o).verdict is Verdict.VISIBLE]
            if open_ones:
                reached.add(behind)
                stack.append((behind, longer, tuple(open_ones)))
    return reached


def reached_matrix(graph):
    """All pairs; a line can be followed either way, so half the octants and both directions give everything."""
    half = [o for o in OCTANTS if o[0] > 0]
    out = np.zeros((graph.cell_count, graph.cell_count), bool)
    for source in range(graph.cell_count):
        out[source, list(reached_cells(graph, source, half))] = True
    return out | out.T


UNIT_BOX = np.array(list(product((0, 1), repeat=3)))
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
BOX_FACES = np.array([face for a, b, c, d in SIDES for face in ((a, b, c), (a, c, d))], np.int32)


def box_triangles(low, high):
    """The closed surface of a box, outward, shape (12, 3, 3)."""
    return (np.array(low) + UNIT_BOX * (np.array(high) - np.array(low)))[BOX_FACES]


def tetrahedron(corners):
    """A closed tetrahedron, outward, shape (4, 3, 3)."""
    corners = np.array(corners)
    if np.linalg.det((corners[1:] - corners[0]).astype(float)) < 0:
        corners = corners[[0, 2, 1, 3]]
    return corners[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]]


def scene_of(parts, rooms=()):
    """A scene of (triangles [grid steps], role) parts; rooms are boxes (low, high) [grid steps]."""
    definitions, objects = [], []
    for number, (triangles, role) in enumerate(parts):
        faces = np.arange(3 * len(triangles), dtype=np.int32).reshape(-1, 3)
        definitions.append(Definition(f"shape {number}", (Mesh(np.array(triangles).reshape(-1, 3) * GRID_M, faces),)))
        objects.append(Instance(f"part {number}", "part", number, np.eye(4), Role(role)))
    spaces = []
    for number, (low, high) in enumerate(rooms):
        corners = (np.array(low) + UNIT_BOX * (np.array(high) - np.array(low))) * GRID_M
        spaces.append(Space(f"room {number}", corners, BOX_FACES))
    return Scene(definitions, objects, spaces)


def two_solids():
    """Two solids and a room between them."""
    parts = [([0, 0, 0], [99, 2000, 2000]), ([999, 0, 0], [1999] * 3)]
    return scene_of([(box_triangles(*part), "occluder") for part in parts], [((100, 0, 0), (999, 1999, 1999))])


def clutter(seed, count=30, size=1000):
    """Triangles of boxes and tetrahedra with their owners."""
    rng = np.random.default_rng(seed)
    parts = [tetrahedron(rng.integers(0, size, (4, 3))) for _ in range(count // 2)]
    parts += [box_triangles(low, low + rng.integers(5, 200, 3)) for low in rng.integers(0, size, (count // 2, 3))]
    owners = np.repeat(np.arange(len(parts)), [len(part) for part in parts]).astype(np.int32)
    return np.concatenate(parts).astype(np.int32), owners
