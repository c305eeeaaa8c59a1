"""Furniture with levels of detail: shapes that get more sides, and parts that appear, as the level rises.

Source of the scheme: Funkhouser et al. 1996, section 2.3 (simpler shapes for some parts, other parts removed).
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from ..scene import Definition, Mesh
from .shapes import Ball, Box, Cylinder, Shape, joined


class Place(StrEnum):
    """Where a piece may stand."""

    FLOOR = "floor"
    TOP = "top"
    BOARD = "board"
    CEILING = "ceiling"
    DOOR = "door"


@dataclass(frozen=True)
class Piece:
    """A kind of furniture.

    Attributes:
        kind: IFC class.
        parts: a shape, and its number of sides at each level from coarse to fine; 0 where the level leaves it out. Any
            other number will do for boxes.
        tops: places for small things, in the piece's frame [m], shape (n, 3).
        boards: the same, for things that fit between boards.
    """

    name: str
    kind: str
    place: Place
    parts: tuple[tuple[Shape, tuple[int, ...]], ...]
    tops: tuple[tuple[float, float, float], ...] = ()
    boards: tuple[tuple[float, float, float], ...] = ()

    @property
    def level_count(self) -> int:
        """Number of levels of detail."""
        return len(self.parts[0][1])

    def definition(self) -> Definition:
        """The piece's meshes, finest first, with bounds on their deviation from the finest."""
        levels = [self._level(level) for level in reversed(range(self.level_count))]
        return Definition(self.name, tuple(levels))

    def _level(self, level: int) -> Mesh:
        shown = [shape.mesh(sides[level]) for shape, sides in self.parts if sides[level]]
        anchors = np.concatenate([mesh.vertices for mesh in shown])
        error = 0.0
        for shape, sides in self.parts:
            if sides[level]:
                error = max(error, float(shape.sagitta(sides[level]) if sides[level] != sides[-1] else 0.0))
            elif sides[-1]:
                # Distance to one fixed point is greatest at a vertex, so this bounds the whole missing part.
                missing = shape.mesh(sides[-1]).vertices
                away = np.linalg.norm(missing[:, None] - anchors[None], axis=-1)
                error = max(error, float(away.max(axis=0).min()))
        return joined(shown, error)


def _grid(width: float, depth: float, height: float, columns: int, rows: int) -> tuple:
    """Places on a top, column by column, in from its edge."""
    xs = (np.arange(columns) + 0.5) / columns * width - width / 2
    ys = (np.arange(rows) + 0.5) / rows * depth - depth / 2
    return tuple((float(x), float(y), height) for x in xs for y in ys)


def _legs(x: float, y: float, half: float, height: float) -> list[Box]:
    return [
        Box((sx * x - half, sy * y - half, 0.0), (sx * x + half, sy * y + half, height))
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]


_LEGS = _legs(0.46, 0.27, 0.03, 0.7)
_CHAIR_LEGS = [Cylinder((x, y, 0.0), 0.02, 0.42) for x in (-0.18, 0.18) for y in (-0.18, 0.18)]
_BOARDS = [0.1, 0.5, 0.9, 1.3, 1.7]

FURNITURE = (
    Piece("book", "IfcFurniture", Place.BOARD, ((Box((-0.02, -0.06, 0.0), (0.02, 0.06, 0.19)), (1,)),)),
    Piece("pencil", "IfcFurniture", Place.TOP, ((Cylinder((0.0, 0.0, 0.0), 0.004, 0.17), (6,)),)),
    Piece("tumbler", "IfcFurniture", Place.TOP, ((Cylinder((0.0, 0.0, 0.0), 0.035, 0.1), (9,)),)),
    Piece("ceiling lamp", "IfcLightFixture", Place.CEILING, ((Cylinder((0.0, 0.0, -0.08), 0.2, 0.08), (8,)),)),
    Piece(
        "desk",
        "IfcFurniture",
        Place.FLOOR,
        (
            (Box((-0.5, -0.31, 0.7), (0.5, 0.31, 0.74)), (1, 1)),
            *((leg, (0, 1)) for leg in _LEGS),
            (Box((0.1, -0.28, 0.3), (0.4, 0.28, 0.68)), (0, 1)),
        ),
        tops=_grid(0.9, 0.55, 0.74, 3, 2),
    ),
    Piece(
        "shelf",
        "IfcFurniture",
        Place.FLOOR,
        (
            (Box((-0.45, -0.15, 0.0), (-0.42, 0.15, 1.8)), (0, 1)),
            (Box((0.42, -0.15, 0.0), (0.45, 0.15, 1.8)), (0, 1)),
            *((Box((-0.42, -0.15, z - 0.03), (0.42, 0.15, z)), (int(z in (0.1, 1.7)), 1)) for z in _BOARDS),
        ),
        boards=tuple((x, 0.0, z) for z in _BOARDS[:4] for x, *_ in _grid(0.8, 0.3, z, 10, 1)),
    ),
    Piece(
        "table",
        "IfcFurniture",
        Place.FLOOR,
        (
            (Cylinder((0.0, 0.0, 0.7), 0.5, 0.04), (5, 12)),
            (Cylinder((0.0, 0.0, 0.0), 0.06, 0.7), (0, 8)),
        ),
        tops=_grid(0.6, 0.6, 0.74, 3, 3),
    ),
    Piece(
        "door handle",
        "IfcDiscreteAccessory",
        Place.DOOR,
        (
            (Ball((0.0, 0.03, 0.0), 0.03), (4, 8)),
            (Cylinder((0.0, 0.0, -0.05), 0.012, 0.1), (0, 6)),
        ),
    ),
    Piece(
        "chair",
        "IfcFurniture",
        Place.FLOOR,
        (
            (Box((-0.22, -0.22, 0.42), (0.22, 0.22, 0.46)), (1, 1, 1)),
            (Box((-0.22, 0.18, 0.46), (0.22, 0.22, 0.9)), (0, 1, 1)),
            *((leg, (0, 3, 8)) for leg in _CHAIR_LEGS),
            (Box((-0.25, -0.2, 0.64), (-0.22, 0.2, 0.67)), (0, 0, 1)),
            (Box((0.22, -0.2, 0.64), (0.25, 0.2, 0.67)), (0, 0, 1)),
        ),
    ),
    Piece(
        "telephone",
        "IfcFurniture",
        Place.TOP,
        (
            (Box((-0.08, -0.08, 0.0), (0.08, 0.08, 0.04)), (1, 1, 1)),
            (Box((-0.07, -0.02, 0.05), (0.07, 0.02, 0.07)), (0, 1, 1)),
            (Cylinder((-0.05, 0.0, 0.04), 0.02, 0.03), (0, 6, 14)),
            (Cylinder((0.05, 0.0, 0.04), 0.02, 0.03), (0, 5, 14)),
            (Cylinder((0.0, -0.05, 0.04), 0.015, 0.005), (0, 0, 11)),
        ),
    ),
    Piece(
        "lamp",
        "IfcLamp",
        Place.TOP,
        (
            (Cylinder((0.0, 0.0, 0.0), 0.08, 0.02), (5, 6, 16, 48)),
            (Cylinder((0.0, 0.0, 0.02), 0.012, 0.33), (0, 5, 10, 24)),
            (Ball((0.0, 0.0, 0.42), 0.09), (0, 6, 12, 22)),
        ),
    ),
    Piece(
        "terminal",
        "IfcCommunicationsAppliance",
        Place.TOP,
        (
            (Box((-0.18, -0.15, 0.04), (0.18, 0.12, 0.34)), (1, 1, 1, 1)),
            (Cylinder((0.0, 0.0, 0.0), 0.13, 0.04), (0, 6, 20, 50)),
            (Box((-0.2, -0.26, 0.0), (0.2, -0.17, 0.02)), (0, 1, 1, 1)),
            (Cylinder((0.24, -0.2, 0.0), 0.03, 0.02), (0, 4, 14, 40)),
            (Ball((0.24, -0.2, 0.03), 0.02), (0, 0, 8, 20)),
        ),
    ),
    Piece(
        "plant",
        "IfcFurniture",
        Place.FLOOR,
        (
            (Cylinder((0.0, 0.0, 0.0), 0.2, 0.35), (5, 6, 16, 30, 36)),
            (Ball((0.0, 0.0, 0.95), 0.3), (0, 6, 10, 20, 24)),
            (Cylinder((0.0, 0.0, 0.35), 0.03, 0.35), (0, 4, 6, 12, 14)),
            (Ball((0.15, 0.1, 1.2), 0.17), (0, 0, 8, 14, 16)),
            (Ball((-0.15, 0.05, 1.25), 0.17), (0, 0, 0, 14, 16)),
        ),
    ),
    Piece(
        "sofa",
        "IfcFurniture",
        Place.FLOOR,
        (
            (Box((-0.55, -0.35, 0.1), (0.55, 0.35, 0.4)), (1, 1, 1, 1, 1)),
            (Box((-0.55, 0.2, 0.4), (0.55, 0.35, 0.8)), (0, 1, 1, 1, 1)),
            (Ball((-0.35, 0.05, 0.52), 0.13), (0, 6, 10, 18, 22)),
            (Ball((0.35, 0.05, 0.52), 0.13), (0, 0, 10, 18, 22)),
            (Cylinder((-0.45, -0.25, 0.0), 0.04, 0.1), (0, 3, 6, 14, 16)),
            (Cylinder((0.45, -0.25, 0.0), 0.04, 0.1), (0, 0, 6, 14, 16)),
            (Cylinder((-0.45, 0.25, 0.0), 0.04, 0.1), (0, 0, 5, 14, 16)),
            (Cylinder((0.45, 0.25, 0.0), 0.04, 0.1), (0, 0, 5, 14, 16)),
        ),
    ),
)
PIECES = {piece.name: piece for piece in FURNITURE}
