"""A site that fills up: shapes defined once and placed many times, walkable boxes, and the triangles so far."""

import numpy as np

from ..scene import Definition, Instance, Mesh, Role, Scene, Space
from .shapes import Box, joined

# Turns by quarters are exact, so what is axial stays axial.
QUARTERS = ((1, 0), (0, 1), (-1, 0), (0, -1))
BOX_FACES = Box((0, 0, 0), (1, 1, 1)).mesh(1).faces
BOX_CORNERS = Box((0, 0, 0), (1, 1, 1)).mesh(1).vertices


class Site:
    """Collects definitions, objects and spaces.

    Attributes:
        triangles: of all objects placed so far.
    """

    def __init__(self) -> None:
        """An empty site."""
        self.triangles = 0
        self._definitions: list[Definition] = []
        self._ids: dict[str, int] = {}
        self._objects: list[Instance] = []
        self._spaces: list[Space] = []

    def define(self, name: str, *parts: Mesh) -> None:
        """A shape of closed parts, under a name of its own."""
        self._ids[name] = len(self._definitions)
        self._definitions.append(Definition(name, (joined(list(parts)),)))

    def count(self, name: str) -> int:
        """Triangles of a definition."""
        return len(self._definitions[self._ids[name]].lods[0].faces)

    def place(
        self,
        name: str,
        kind: str,
        role: Role,
        at: tuple[float, float, float],
        quarters: int = 0,
        frame: np.ndarray | None = None,
    ) -> None:
        """Place a definition.

        Args:
            name: of the definition.
            kind: IFC class.
            role: of the object.
            at: where its origin comes to be [m].
            quarters: quarter turns counterclockwise about its own z axis.
            frame: what `at` and the turn are relative to, shape (4, 4); the scene's own frame by default.
        """
        cosine, sine = QUARTERS[quarters % 4]
        transform = np.array(
            [[cosine, -sine, 0, at[0]], [sine, cosine, 0, at[1]], [0, 0, 1, at[2]], [0, 0, 0, 1]], float
        )
        definition_id = self._ids[name]
        transform = transform if frame is None else frame @ transform
        self._objects.append(Instance(f"{name} {len(self._objects)}", kind, definition_id, transform, role))
        self.triangles += len(self._definitions[definition_id].lods[0].faces)

    def walk(self, name: str, low: tuple[float, float, float], high: tuple[float, float, float]) -> None:
        """A box where people may be [m]."""
        corners = np.array(low) + BOX_CORNERS * (np.array(high) - np.array(low))
        self._spaces.append(Space(name, corners, BOX_FACES))

    def mark(self) -> tuple[int, int, int]:
        """Where the site is now, for `reset`."""
        return len(self._objects), len(self._spaces), self.triangles

    def reset(self, mark: tuple[int, int, int]) -> None:
        """Take away everything placed since the mark."""
        objects, spaces, self.triangles = mark
        del self._objects[objects:], self._spaces[spaces:]

    def scene(self, source: str) -> Scene:
        """All of it."""
        return Scene(self._definitions, self._objects, self._spaces, source=source)


def turned(at: tuple[float, float, float], angle: float) -> np.ndarray:
    """A frame at a place, turned counterclockwise about z [m, radians], shape (4, 4)."""
    frame = np.eye(4)
    frame[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    frame[:3, 3] = at
    return frame
