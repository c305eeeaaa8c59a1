"""Closed meshes for synthetic buildings: blocks on a lattice, boxes, cylinders and balls."""

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


def pierced_block(low: np.ndarray, high: np.ndarray, holes: list[np.ndarray]) -> Mesh:
    """A box without the boxes `holes`, each of shape (2, 3) [m]; holes must not touch at an edge or corner only."""
    clipped = [np.clip(hole, low, high) for hole in holes]
    lines = tuple(np.unique([low[k], high[k], *(hole[i, k] for hole in clipped for i in (0, 1))]) for k in range(3))
    centres = np.stack(np.meshgrid(*[(line[1:] + line[:-1]) / 2 for line in lines], indexing="ij"), axis=-1)
    solid = np.ones(centres.shape[:3], bool)
    for hole in clipped:
        solid &= ~((centres > hole[0]) & (centres < hole[1])).all(axis=-1)
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


def joined(meshes: list[Mesh], error_m: float = 0.0) -> Mesh:
    """All meshes as one, rounded to float32."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = np.concatenate([mesh.vertices for mesh in meshes]).astype(np.float32).astype(np.float64)
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)])
    return Mesh(vertices, faces.astype(np.int32), error_m)
