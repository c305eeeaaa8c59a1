"""Meshes to simplify and to split: closed, open, pinched, with a fin, many boxes; and scenes of them."""

from dataclasses import replace

import numpy as np
import trimesh
from viewcell.data.scene import GRID_M, Definition, Instance, Mesh, Role, Scene


def mesh(shape, move=(0, 0, 0)):
    return Mesh(np.round((np.array(shape.vertices) + move) / GRID_M) * GRID_M, np.array(shape.faces, np.int32))


def joined(*parts):
    starts = np.cumsum([0, *[len(part.vertices) for part in parts]])
    faces = [part.faces + start for part, start in zip(parts, starts, strict=False)]
    return Mesh(np.concatenate([part.vertices for part in parts]), np.concatenate(faces).astype(np.int32))


def box(low, high, inwards=False):
    made = trimesh.creation.box(bounds=[low, high])
    made = mesh(made)
    return replace(made, faces=made.faces[:, ::-1]) if inwards else made


def soup(mesh):
    """Every triangle with corners of its own."""
    return Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(mesh.faces.size, dtype=np.int32).reshape(-1, 3))


BALL = mesh(trimesh.creation.icosphere(subdivisions=2))
RING = mesh(trimesh.creation.torus(1.0, 0.3, major_sections=20, minor_sections=12))
BOWL = replace(BALL, faces=BALL.faces[BALL.vertices[BALL.faces].mean(axis=1)[:, 2] < 0.3])
# Two balls that share a vertex, one edge with three triangles, and a heap of 40 boxes.
PINCHED = joined(BALL, replace(BALL, vertices=BALL.vertices + BALL.vertices[0] - BALL.vertices[5]))
FIN = joined(BALL, Mesh(np.vstack([BALL.vertices[BALL.faces[0][:2]], [[0, 0, 2.0]]]), np.array([[0, 1, 2]], np.int32)))
HEAP = joined(*[box([i % 7, i % 5, i], [i % 7 + 2, i % 5 + 1.5, i + 0.5]) for i in range(40)])
MESHES = {"ball": BALL, "ring": RING, "bowl": BOWL, "pinched": PINCHED, "fin": FIN, "heap": HEAP, "soup": soup(RING)}


def corners(level):
    return level.vertices[level.faces]


def scene_of(*shapes, transforms=None):
    transforms = transforms or [np.eye(4)] * len(shapes)
    definitions = [Definition(f"shape {i}", (shape,)) for i, shape in enumerate(shapes)]
    objects = [Instance(f"thing {i}", "thing", i, t, Role.DETAIL) for i, t in enumerate(transforms)]
    return Scene(definitions, objects)


def turned(scale):
    """A rotation, stretched along one axis."""
    matrix = np.eye(4)
    matrix[:3, :3] = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3])[:3, :3] @ np.diag([1, scale, 1])
    return matrix
