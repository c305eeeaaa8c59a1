"""Closed prisms that are not boxes: over polygons with holes, upright as walls, and blocks whose ends are slanted."""

import numpy as np
import shapely

from ..scene import Mesh

Ring = np.ndarray


def prism(outline: Ring, holes: list[Ring], low: float, high: float) -> Mesh:
    """The closed solid over a simple polygon with holes, between two heights [m].

    Args:
        outline: corners in x and y [m], shape (n, 2), counterclockwise.
        holes: the same, each strictly within the outline and clear of the others.
        low: z of the bottom.
        high: z of the top.

    Returns:
        A mesh without T-junctions: its only vertices are the corners.
    """
    rings = [np.asarray(outline, np.float64), *(np.asarray(hole, np.float64)[::-1] for hole in holes)]
    points, ends = np.concatenate(rings), np.cumsum([len(ring) for ring in rings])
    count = len(points)
    cap = _triangles(points, rings)
    here = np.arange(count)
    there = here + 1
    there[ends - 1] = ends - [len(ring) for ring in rings]
    sides = [np.stack([here, there, there + count], axis=1), np.stack([here, there + count, here + count], axis=1)]
    vertices = np.concatenate([np.column_stack([points, np.full(count, z)]) for z in (low, high)])
    return Mesh(vertices, np.concatenate([*sides, cap[:, ::-1], cap + count]).astype(np.int32))


def _triangles(points: np.ndarray, rings: list[Ring]) -> np.ndarray:
    """Triangles of a polygon that names every corner, counterclockwise: indices into its points, shape (m, 3)."""
    # Ears would be cut without the corners that lie on the line between two others.
    parts = shapely.constrained_delaunay_triangles(shapely.Polygon(rings[0], rings[1:]))
    corners = shapely.get_coordinates(parts).reshape(-1, 4, 2)[:, :3]
    number = {tuple(point): i for i, point in enumerate(points.tolist())}
    found = np.array([[number[tuple(corner)] for corner in triangle] for triangle in corners.tolist()])
    a, b, c = corners.transpose(1, 0, 2)
    clockwise = (b - a)[:, 0] * (c - a)[:, 1] < (b - a)[:, 1] * (c - a)[:, 0]
    found[clockwise] = found[clockwise][:, ::-1]
    return found


def wall(outline: Ring, holes: list[Ring], front: float, back: float) -> Mesh:
    """The same as a wall along x: corners in x and z, from the plane y = front to the plane y = back."""
    mesh = prism(outline, holes, -back, -front)
    return Mesh(mesh.vertices[:, [0, 2, 1]] * [1.0, -1.0, 1.0], mesh.faces)


def slanted(mesh: Mesh, axis: int, first: tuple[float, float], last: tuple[float, float]) -> Mesh:
    """A block whose two ends on an axis become slanted planes; all else of it stays.

    Args:
        mesh: a pierced block, along x (axis 0) or y (axis 1).
        axis: along which it lies.
        first: where its low end comes to be along the axis [m], at its lowest and at its highest across.
        last: likewise its high end. Both lie beyond all of its holes.
    """
    vertices = mesh.vertices.copy()
    along, across = vertices[:, axis].copy(), vertices[:, 1 - axis]
    share = (across - across.min()) / (across.max() - across.min())
    for end, (low, high) in ((along.min(), first), (along.max(), last)):
        # Weighted so that both corners of an end are exact.
        slant = low * (1.0 - share) + high * share
        vertices[along == end, axis] = slant[along == end]
    return Mesh(vertices, mesh.faces, mesh.error_m)


def regular(sides: int, apothem: float) -> Ring:
    """Corners of a regular polygon about the origin [m], counterclockwise; the middle of side 0 lies on the x axis."""
    turn = (np.arange(sides) - 0.5) * (2 * np.pi / sides)
    return apothem / np.cos(np.pi / sides) * np.column_stack([np.cos(turn), np.sin(turn)])
