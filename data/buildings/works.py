"""What is put up of a building whose parts stand in frames of their own: objects, rooms and openings so far."""

from dataclasses import dataclass, field, replace

import numpy as np

from ..scene import GRID_M, Definition, Instance, Mesh, Role, Scene, Space, boxes_around
from .shapes import joined


@dataclass
class Works:
    """A building under construction; equal meshes share a definition.

    A frame is a transform to the scene's, shape (4, 4).

    Attributes:
        openings: boxes around doors, windows and voids [m], each of shape (2, 3).
    """

    definitions: list[Definition] = field(default_factory=list)
    objects: list[Instance] = field(default_factory=list)
    spaces: list[Space] = field(default_factory=list)
    openings: list[np.ndarray] = field(default_factory=list)
    _known: dict[tuple[bytes, ...], int] = field(default_factory=dict)

    def put(self, kind: str, name: str, mesh: Mesh, frame: np.ndarray, role: Role = Role.OCCLUDER) -> None:
        """One object of one closed mesh, rounded to float32."""
        definition_id = self.define(Definition(name, (joined([mesh]),)))
        self.objects.append(Instance(name, kind, definition_id, frame, role))

    def define(self, shape: Definition) -> int:
        """The place of a definition of the same meshes, this one if there was none."""
        key = tuple(part.tobytes() for mesh in shape.lods for part in (mesh.vertices, mesh.faces))
        if key not in self._known:
            self._known[key] = len(self.definitions)
            self.definitions.append(shape)
        return self._known[key]

    def room(self, name: str, mesh: Mesh | Space, frame: np.ndarray) -> None:
        """A room, by the closed mesh of its air."""
        self.spaces.append(Space(name, mesh.vertices @ frame[:3, :3].T + frame[:3, 3], mesh.faces))

    def open(self, box: np.ndarray, frame: np.ndarray) -> None:
        """An opening: a box of the frame, shape (2, 3) [m]."""
        self.openings.append(boxes_around(box[None], frame)[0])

    def take(self, part: Scene, frame: np.ndarray, name: str = "") -> None:
        """All of a scene, placed in a frame; its names begin with `name`."""
        ids = [self.define(shape) for shape in part.definitions]
        for placed in part.objects:
            transform, definition_id = frame @ placed.transform, ids[placed.definition_id]
            again = replace(placed, name=name + placed.name, definition_id=definition_id, transform=transform)
            self.objects.append(again)
        for space in part.spaces:
            self.room(name + space.name, space, frame)
        self.openings += list(boxes_around(part.openings, frame))

    def scene(self, source: str, grid_m: float = GRID_M) -> Scene:
        """All of it."""
        openings = np.array(self.openings).reshape(-1, 2, 3)
        return Scene(self.definitions, self.objects, self.spaces, openings, grid_m=grid_m, source=source)
