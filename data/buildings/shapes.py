"""Closed meshes for synthetic buildings: blocks on a lattice, boxes, prisms, pipes, balls, solids of revolution."""

from dataclasses import dataclass

import numpy as np

from ..scene import Mesh


def lattice_mesh(lines: tuple[np.ndarray, np.ndarray, np.ndarray], solid: np.ndarray) -> Mesh:
    """The surface of the solid cells of a box lattice: closed, with no faces inside and no T-junctions.

    Args:
        lines: coordinates of the lattice planes on x, y, z [m], ascending.
        solid: shape (len(x) - 1, len(y) - 1, len(z) - 1), bool; solid cells must not touch at an edge or corner only.
    """
    shape = tuple(len(line) for line in lines)
    padded = np.pad(solid, 1).astype(np.int8)
    quads = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        step = np.diff(padded, axis=axis)
        step = step[tuple(slice(None) if k == axis else slice(1, -1) for k in range(3))]
        cells = np.argwhere(step)
        corners = np.repeat(cells[:, None, :], 4, axis=1)
        corners[:, 1:3, u] += 1
        corners[:, 2:4, v] += 1
        # A rise from empty to solid is a face that looks back along the axis.
        rising = step[tuple(cells.T)] > 0
        corners[rising] = corners[rising][:, ::-1]
        quads.append(np.ravel_multi_index(tuple(corners.reshape(-1, 3).T), shape).reshape(-1, 4))
    used, index = np.unique(np.concatenate(quads), return_inverse=True)
    index = index.reshape(-1, 4)
    at = np.unravel_index(used, shape)
    vertices = np.stack([np.asarray(line, np.float64)[i] for line, i in zip(lines, at, strict=True)], axis=1)
    return Mesh(vertices, np.concatenate([index[:, [0, 1, 2]], index[:, [0, 2, 3]]]).astype(np.int32))


def pierced_block(low: np.ndarray, high: np.ndarray, openings: list[np.ndarray]) -> Mesh:
    """A box without the boxes `openings`, each of shape (2, 3) [m], none touching another at an edge alone."""
    clipped = [np.clip(opening, low, high) for opening in openings]
    lines = tuple(
        np.unique([low[k], high[k], *(opening[i, k] for opening in clipped for i in (0, 1))]) for k in range(3)
    )
    centres = np.stack(np.meshgrid(*[(line[1:] + line[:-1]) / 2 for line in lines], indexing="ij"), axis=-1)
    solid = np.ones(centres.shape[:3], bool)
    for opening in clipped:
        solid &= ~((centres > opening[0]) & (centres < opening[1])).all(axis=-1)
    return lattice_mesh(lines, solid)


@dataclass(frozen=True)
class Box:
    """An axial box; every level of detail shows it whole."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    def mesh(self, sides: int) -> Mesh:
        """Its 12 triangles; `sides` is for round shapes."""
        return pierced_block(np.array(self.low), np.array(self.high), [])

    def sagitta(self, sides: int) -> float:
        """Nothing is rounded off."""
        return 0.0


@dataclass(frozen=True)
class Cylinder:
    """An upright cylinder.

    Attributes:
        foot: centre of the bottom [m].
    """

    foot: tuple[float, float, float]
    radius: float
    height: float

    def mesh(self, sides: int) -> Mesh:
        """A prism of `sides` sides inscribed in the cylinder, 4 sides - 4 triangles."""
        turn = np.arange(sides) * (2 * np.pi / sides)
        ring = np.stack([np.cos(turn) * self.radius, np.sin(turn) * self.radius, np.zeros(sides)], axis=1) + self.foot
        here = np.arange(sides)
        there = (here + 1) % sides
        fan = np.stack([np.zeros(sides - 2, int), np.arange(1, sides - 1), np.arange(2, sides)], axis=1)
        faces = [
            np.stack([here, there, there + sides], axis=1),
            np.stack([here, there + sides, here + sides], axis=1),
            fan[:, ::-1],
            fan + sides,
        ]
        return Mesh(
            np.concatenate([ring, ring + np.array([0, 0, self.height])]), np.concatenate(faces).astype(np.int32)
        )

    def sagitta(self, sides: int) -> float:
        """How far the prism's sides lie inside the cylinder [m]."""
        return self.radius * (1 - np.cos(np.pi / sides))


@dataclass(frozen=True)
class Ball:
    """A sphere."""

    centre: tuple[float, float, float]
    radius: float

    def mesh(self, sides: int) -> Mesh:
        """A globe of `sides` meridians, an even number, and half as many bands; sides (sides - 2) triangles."""
        bands = sides // 2
        tilt = np.arange(1, bands)[:, None] * (np.pi / bands)
        turn = np.arange(sides)[None, :] * (2 * np.pi / sides)
        rings = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt) + 0 * turn], axis=-1)
        points = np.concatenate([[[0, 0, 1]], rings.reshape(-1, 3), [[0, 0, -1]]]) * self.radius + self.centre
        here = np.arange(sides)
        there = (here + 1) % sides
        last = len(points) - 1
        faces = [np.stack([np.zeros(sides, int), 1 + here, 1 + there], axis=1)]
        for start in range(1, last - sides, sides):
            faces.append(np.stack([start + here, start + sides + here, start + sides + there], axis=1))
            faces.append(np.stack([start + here, start + sides + there, start + there], axis=1))
        faces.append(np.stack([np.full(sides, last), last - sides + there, last - sides + here], axis=1))
        return Mesh(points, np.concatenate(faces).astype(np.int32))

    def sagitta(self, sides: int) -> float:
        """How far the globe's facets may lie inside the sphere [m]."""
        return self.radius * (1 - np.cos(np.pi / sides) ** 2)


Shape = Box | Cylinder | Ball


def block(low: tuple[float, float, float], high: tuple[float, float, float]) -> Mesh:
    """The 12 triangles of an axial box [m]."""
    return Box(low, high).mesh(1)


def revolved(profile: list[tuple[float, float]], sides: int) -> Mesh:
    """A solid of revolution about the z axis, inscribed with `sides` sides.

    Args:
        profile: (radius, z) [m] from the bottom to the top; the first and the last radius are 0, no other is.
        sides: 3 or more; 2 sides (len(profile) - 2) triangles.
    """
    radius, z = np.array(profile[1:-1], np.float64).T
    turn = np.arange(sides) * (2 * np.pi / sides)
    rings = np.empty((len(radius), sides, 3))
    rings[:, :, 0], rings[:, :, 1] = radius[:, None] * np.cos(turn), radius[:, None] * np.sin(turn)
    rings[:, :, 2] = z[:, None]
    return _rings_mesh(rings, np.array([0, 0, profile[0][1]]), np.array([0, 0, profile[-1][1]]))


def pipe(path: list[tuple[float, float, float]], radius: float, sides: int) -> Mesh:
    """A round bar along a path of points [m], its ends flat; 2 sides len(path) triangles.

    Bends should be cut into short steps (`bent`): each ring is square to the mean of the directions beside it.
    """
    points = np.array(path, np.float64)
    steps = np.diff(points, axis=0)
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    ahead = np.concatenate([steps[:1], steps[:-1] + steps[1:], steps[-1:]])
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    turn = np.arange(sides) * (2 * np.pi / sides)
    across = np.cross(ahead[0], np.eye(3)[np.abs(ahead[0]).argmin()])
    rings = []
    for point, direction in zip(points, ahead, strict=True):
        # The last ring's direction, made square to the new one, keeps the bar from twisting.
        across = across - direction * (across @ direction)
        across /= np.linalg.norm(across)
        other = np.cross(direction, across)
        rings.append(point + radius * (np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * other))
    return _rings_mesh(np.array(rings), points[0], points[-1])


def bent(path: list[tuple[float, float, float]], reach: float, steps: int = 4) -> list[tuple[float, float, float]]:
    """The path with each corner replaced by a curve that begins and ends `reach` [m] from it."""
    points = np.array(path, np.float64)
    curved = [points[0]]
    for before, corner, after in zip(points[:-2], points[1:-1], points[2:], strict=True):
        start = corner + (before - corner) * (reach / np.linalg.norm(before - corner))
        end = corner + (after - corner) * (reach / np.linalg.norm(after - corner))
        share = np.linspace(0, 1, steps + 1)[:, None]
        curved += list((1 - share) ** 2 * start + 2 * share * (1 - share) * corner + share**2 * end)
    return [tuple(point) for point in [*curved, points[-1]]]


def _rings_mesh(rings: np.ndarray, start: np.ndarray, end: np.ndarray) -> Mesh:
    """Rings of points, counterclockwise seen from the end, joined to each other and closed to a point at both ends."""
    count, sides, _ = rings.shape
    here = np.arange(sides)
    there = (here + 1) % sides
    first, last = count * sides, count * sides + 1
    top = (count - 1) * sides
    faces = [np.stack([np.full(sides, first), there, here], axis=1)]
    for base in range(0, top, sides):
        faces.append(np.stack([base + here, base + there, base + sides + there], axis=1))
        faces.append(np.stack([base + here, base + sides + there, base + sides + here], axis=1))
    faces.append(np.stack([np.full(sides, last), top + here, top + there], axis=1))
    return Mesh(np.concatenate([rings.reshape(-1, 3), [start, end]]), np.concatenate(faces).astype(np.int32))


def extruded(outline: list[tuple[float, float]], low: float, high: float) -> Mesh:
    """A prism over a convex outline, counterclockwise in x and y, between two heights [m]; 4 sides - 4 triangles."""
    ring = np.array(outline, np.float64)
    sides = len(ring)
    here = np.arange(sides)
    there = (here + 1) % sides
    fan = np.stack([np.zeros(sides - 2, int), np.arange(1, sides - 1), np.arange(2, sides)], axis=1)
    vertices = np.concatenate([np.column_stack([ring, np.full(sides, z)]) for z in (low, high)])
    faces = [
        np.stack([here, there, there + sides], axis=1),
        np.stack([here, there + sides, here + sides], axis=1),
        fan[:, ::-1],
        fan + sides,
    ]
    return Mesh(vertices, np.concatenate(faces).astype(np.int32))


def laid(mesh: Mesh, axis: int) -> Mesh:
    """The mesh with its z axis laid along another one: 0 for x, 1 for y."""
    return Mesh(mesh.vertices[:, [(2, 0, 1), (1, 2, 0)][axis]], mesh.faces, mesh.error_m)


def moved(mesh: Mesh, by: tuple[float, float, float]) -> Mesh:
    """The mesh elsewhere [m]."""
    return Mesh(mesh.vertices + np.array(by), mesh.faces, mesh.error_m)


def joined(meshes: list[Mesh], error_m: float = 0.0) -> Mesh:
    """All meshes as one, rounded to float32."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = np.concatenate([mesh.vertices for mesh in meshes]).astype(np.float32).astype(np.float64)
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)])
    return Mesh(vertices, faces.astype(np.int32), error_m)
