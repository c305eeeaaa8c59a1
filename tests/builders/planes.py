"""Triangles of one plane, and rectangles of it looked at point by point."""

import numpy as np
from viewcell.data.buildings.prisms import prism


def covered(triangles, points):
    """Whether each point lies in a closed triangle; integers throughout."""
    triangles, points = triangles.astype(np.int64), points.astype(np.int64)
    inside = np.zeros(len(points), bool)
    for triangle in triangles:
        turns = []
        for a, b in zip(triangle, np.roll(triangle, -1, axis=0), strict=True):
            turns.append(np.sign((b[0] - a[0]) * (points[:, 1] - a[1]) - (b[1] - a[1]) * (points[:, 0] - a[0])))
        inside |= (np.min(turns, axis=0) >= 0) | (np.max(turns, axis=0) <= 0)
    return inside


def raster(us, vs):
    """Doubled centres of a raster's cells, shape (cells, 2), and their areas."""
    centre = np.stack(np.meshgrid(us[1:] + us[:-1], vs[1:] + vs[:-1], indexing="ij"), axis=-1).reshape(-1, 2)
    return centre, np.outer(np.diff(us), np.diff(vs)).ravel()


def inside_rectangles(rectangles, doubled):
    """How many rectangles hold each point."""
    low, high = 2 * rectangles[:, 0].astype(np.int64), 2 * rectangles[:, 1].astype(np.int64)
    return ((doubled[:, None] > low) & (doubled[:, None] < high)).all(axis=2).sum(axis=1)


def pierced(hole, *, size=4096):
    """Triangles of a square with a hole, and the square's corners."""
    square = np.array([(0, 0), (size, 0), (size, size), (0, size)])
    mesh = prism(square, [np.array(hole)], 0.0, 1.0)
    flat = mesh.vertices[mesh.faces][(mesh.vertices[mesh.faces][:, :, 2] == 0).all(axis=1)]
    return flat[:, :, :2].astype(np.int32)


def axial_triangles(rng, count, size=20):
    """Overlapping rectangles, each cut along one diagonal or into a fan about a point of an edge, in any turn."""
    out = []
    for _ in range(count):
        u, v = (np.sort(rng.choice(size, 2, replace=False)) for _ in range(2))
        quad = [(u[0], v[0]), (u[1], v[0]), (u[1], v[1]), (u[0], v[1])]
        if rng.random() < 0.4 and u[1] - u[0] > 1:
            middle = (rng.integers(u[0] + 1, u[1]), v[0])
            fan = [quad[1], quad[2], quad[3], quad[0]]
            made = [(middle, fan[n], fan[n + 1]) for n in range(3)]
        else:
            turn = rng.integers(0, 2)
            made = [(quad[turn], quad[turn + 1], quad[turn + 2]), (quad[turn], quad[turn + 2], quad[turn - 1])]
        out += [triangle[:: rng.choice([-1, 1])] for triangle in made]
    return np.array(out, np.int32)


def arched(width, rise):
    """Corners of a window with a round top, whose curve takes the upper `rise`."""
    turn = np.linspace(0, np.pi, 13)
    top = np.round(np.column_stack([1000 + (np.cos(turn) + 1) * width / 2, 2000 + np.sin(turn) * rise]))
    return np.concatenate([[[1000, 500], [1000 + width, 500]], top])


ROUND = np.round(
    2000 + 800 * np.column_stack([f(np.linspace(0, 2 * np.pi, 24, endpoint=False)) for f in (np.cos, np.sin)])
)
