"""The model: definitions x instances on an integer grid.

Every later verdict is exact for the *snapped* model: world vertex = round(transform . vertex / grid), an int32 for each
coordinate, relative to `origin`. Source of the definition/instance/LOD scheme: Funkhouser et al. 1996, section 2.2.
"""

from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
from itertools import product
from pathlib import Path

import numpy as np

from .animation import Animation
from .errors import InputError
from .ragged import starts_of
from .shapes import first_alike

GRID_M = 2.0**-10
# Coordinate differences stay below 2**25, so the products that the stabbing kernel forms are exact in float64.
GRID_LIMIT = 2**24
# With this begins `what` in `Scene.skipped` for a room that the model names but gives no body.
LOST_ROOM = "room "
# Vertices or triangles that are placed at a time.
FLAT_CHUNK = 200_000


class Role(StrEnum):
    """OCCLUDER shapes cells and portals and blocks rays, DETAIL only blocks rays, TRANSPARENT does neither."""

    OCCLUDER = "occluder"
    DETAIL = "detail"
    TRANSPARENT = "transparent"


# Which end of a box on each axis: its eight corners.
CORNERS = np.array(list(product((0, 1), repeat=3)))
# What stops sightlines.
OPAQUE = (Role.OCCLUDER, Role.DETAIL)


@dataclass(frozen=True)
class Mesh:
    """Triangles of one level of detail.

    Attributes:
        vertices: [m], shape (n, 3), float64, in the definition's frame.
        faces: vertex indices, shape (m, 3), int32.
        error_m: bound on the surface deviation from the finest level; 0 for the finest.
        colours: base colour of each face, red, green, blue and opacity, shape (m, 4), uint8; None where none is known.
    """

    vertices: np.ndarray
    faces: np.ndarray
    error_m: float = 0.0
    colours: np.ndarray | None = None


@dataclass(frozen=True)
class Definition:
    """A shape shared by instances; `lods[0]` is the finest level."""

    name: str
    lods: tuple[Mesh, ...]


@dataclass(frozen=True)
class NamedStorey:
    """A storey as the model's file tells it, which what is found in the cells' heights may differ from.

    Attributes:
        name: the file's own; several storeys may share one.
        elevation_m: as the file states it [m], from a zero that the file chooses; None where it states none.
    """

    name: str
    elevation_m: float | None = None


@dataclass(frozen=True)
class Instance:
    """A placed definition, called an *object* in the tables; its object_id is its place in `Scene.objects`.

    Attributes:
        transform: definition frame to scene frame (metres from `Scene.origin`, Z up), shape (4, 4), float64.
        guid: the file's own lasting name, such as an IFC GlobalId; empty where the format has none.
        why: what it was taken for glass or a door by, in words; empty for the rest, and not kept in folders.
        storey: that the file puts it on; None where it says none.
        materials: names of what the file says it is made of, each once, in the file's order.
        colour: red, green, blue and opacity, 0 to 255, of its faces that have no colour of their own; None where none
            is known.
        animation: how it moves; None if it does not. What moves hides nothing: its role is TRANSPARENT.

    Raises:
        InputError: it moves and has another role.
    """

    name: str
    kind: str
    definition_id: int
    transform: np.ndarray
    role: Role
    guid: str = ""
    why: str = ""
    storey: NamedStorey | None = None
    materials: tuple[str, ...] = ()
    colour: tuple[int, int, int, int] | None = None
    animation: Animation | None = None

    def __post_init__(self) -> None:
        """Refuse occluders that move."""
        if self.animation is not None and self.role is not Role.TRANSPARENT:
            raise InputError(f"object {self.name!r}: expected role transparent of what moves, found {self.role.value}")

    @property
    def opaque(self) -> bool:
        """Whether sightlines stop here."""
        return self.role is not Role.TRANSPARENT


@dataclass(frozen=True)
class Space:
    """A room volume named by the model (IfcSpace), used to find inhabitable cells.

    Attributes:
        vertices: [m], scene frame, shape (n, 3), float64.
        faces: shape (m, 3), int32; a closed surface.
        long_name: the file's longer name, such as "Foyer" for the room "A101"; empty where it has none.
        guid, storey: as in `Instance`.
    """

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    long_name: str = ""
    guid: str = ""
    storey: NamedStorey | None = None


@dataclass
class Scene:
    """A model ready to bake.

    Attributes:
        definitions: shapes.
        objects: placed shapes; the index is the object_id.
        spaces: room volumes, possibly none; the index is the room_id.
        openings: boxes of doors, windows and voids [m], shape (n, 2, 3), float64: shut to find rooms by flooding.
        origin: whole metres subtracted from the model's coordinates, float64 x 3.
        yaw_deg: the model is then turned back by this about the vertical [degrees, counter-clockwise]; see `in_model`.
        grid_m: grid step [m].
        source: path of the model as given, or the generator's command.
        sha256: of the source file; empty for generated scenes.
        unit: the unit of the source file, e.g. "metre".
        skipped: what could not be read, as {"what": name, "why": reason}.
        notes: what was read otherwise than it is written, or is not as files of its kind should be, likewise.
    """

    definitions: list[Definition]
    objects: list[Instance]
    spaces: list[Space] = field(default_factory=list)
    openings: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 3)))
    origin: np.ndarray = field(default_factory=lambda: np.zeros(3))
    yaw_deg: float = 0.0
    grid_m: float = GRID_M
    source: str = ""
    sha256: str = ""
    unit: str = "metre"
    skipped: list[dict[str, str]] = field(default_factory=list)
    notes: list[dict[str, str]] = field(default_factory=list)

    def __repr__(self) -> str:
        """What it is of and how large, on a line."""
        rooms = f", {len(self.spaces):,} rooms" if self.spaces else ""
        return f"<Scene {self.source!r}: {len(self.objects):,} objects{rooms}>"

    @property
    def lost_rooms(self) -> list[str]:
        """Rooms that the model names but gives no body, as listed in `skipped`."""
        return [lost["what"] for lost in self.skipped if lost["what"].startswith(LOST_ROOM)]

    def in_model(self, points: np.ndarray) -> np.ndarray:
        """Points of the scene's frame [m] in the model's own, shape (..., 3), float64."""
        return turned(points, self.yaw_deg) + self.origin

    def with_own_geometry(self, object_id: int, lods: dict[int, Mesh]) -> "Scene":
        """The scene in which an object has shapes of its own at some levels; the others it shares as before.

        Source: Funkhouser et al. 1996, section 2.2. The object gets a definition of its own, whose other levels are the
        very meshes of the old one; a display database stores meshes of the same content once.

        Raises:
            InputError: a level that its definition does not have.
        """
        placed = self.objects[object_id]
        shape = self.definitions[placed.definition_id]
        unknown = [lod for lod in lods if not 0 <= lod < len(shape.lods)]
        if unknown:
            raise InputError(f"object {object_id}: expected a level below {len(shape.lods)}, found {unknown[0]}")
        own = Definition(shape.name, tuple(lods.get(lod, mesh) for lod, mesh in enumerate(shape.lods)))
        objects = [*self.objects]
        objects[object_id] = replace(placed, definition_id=len(self.definitions))
        return replace(self, definitions=[*self.definitions, own], objects=objects)

    def world_vertices(self, object_id: int, lod: int = 0) -> np.ndarray:
        """Snapped world vertices of one object [grid steps], shape (n, 3), int32.

        Raises:
            InputError: a coordinate is not finite, or lies outside the grid.
        """
        placed = self.objects[object_id]
        mesh = self.definitions[placed.definition_id].lods[lod]
        world = mesh.vertices @ placed.transform[:3, :3].T + placed.transform[:3, 3]
        return snap(world, self.grid_m, f"object {object_id} {placed.name!r}")

    def max_snap_m(self) -> float:
        """Largest displacement of any vertex along an axis by snapping to the grid [m]."""
        return self._flat[2]

    @cached_property
    def _flat(self) -> tuple[np.ndarray, np.ndarray, float]:
        finest = [shape.lods[0] for shape in self.definitions]
        of = np.array([placed.definition_id for placed in self.objects], np.int64)
        sizes = np.array([len(mesh.faces) for mesh in finest], np.int64)[of]
        starts = starts_of(sizes)
        triangles, kept, worst = np.empty((starts[-1], 3, 3), np.int32), np.ones(starts[-1], bool), 0.0
        for definition_id in np.unique(of):
            mesh, same = finest[definition_id], np.flatnonzero(of == definition_id)
            # Many small instances at a time, few large ones.
            step = max(1, FLAT_CHUNK // max(1, len(mesh.vertices), len(mesh.faces)))
            for begin in range(0, len(same), step):
                chunk = same[begin : begin + step]
                snapped, moved = self._placed(mesh, chunk)
                worst = max(worst, moved)
                corners = np.take(snapped, mesh.faces, axis=1).reshape(-1, 3, 3)
                rows = (starts[chunk][:, None] + np.arange(len(mesh.faces))).ravel()
                triangles[rows], kept[rows] = corners, ~degenerate(corners)
        owners = np.repeat(np.arange(len(self.objects), dtype=np.int32), sizes)
        if not kept.all():
            triangles, owners = triangles[kept], owners[kept]
        return triangles, owners, worst

    def _placed(self, mesh: Mesh, object_ids: np.ndarray) -> tuple[np.ndarray, float]:
        """Snapped vertices of a mesh for each object, (objects, n, 3), int32, and how far any has moved [m]."""
        transforms = np.stack([self.objects[i].transform for i in object_ids])
        world = mesh.vertices @ transforms[:, :3, :3].transpose(0, 2, 1) + transforms[:, None, :3, 3]
        try:
            snapped = snap(world, self.grid_m, "")
        except InputError:
            for object_id in range(len(self.objects)):
                self.world_vertices(object_id)  # raises, and names the first object at fault
            raise
        return snapped, float(np.abs(world - snapped * self.grid_m).max(initial=0.0))

    def triangles(self, *roles: Role) -> tuple[np.ndarray, np.ndarray]:
        """Snapped, non-degenerate finest-level triangles of objects of the roles, by default all, and their object ids.

        Returns:
            Triangles [grid steps], shape (m, 3, 3), int32, in object order; object_id of each, shape (m,), int32.
        """
        triangles, owners, _ = self._flat
        if not roles:
            return triangles, owners
        wanted = self.object_mask(*roles)[owners]
        return triangles[wanted], owners[wanted]

    @cached_property
    def triangle_starts(self) -> np.ndarray:
        """Triangles of object o are triangle_starts[o]:triangle_starts[o + 1] of all, shape (objects + 1,), int64."""
        return np.searchsorted(self._flat[1], np.arange(len(self.objects) + 1))

    @property
    def triangle_counts(self) -> np.ndarray:
        """Triangles of each object, shape (objects,), int64."""
        return np.diff(self.triangle_starts)

    @cached_property
    def first_alike(self) -> np.ndarray:
        """Of each object the first whose snapped triangles differ by a shift only, shape (objects,), int64."""
        return first_alike(self._flat[0], self.triangle_starts)

    def object_mask(self, *roles: Role) -> np.ndarray:
        """Objects that have one of the roles, shape (objects,), bool."""
        return np.array([placed.role in roles for placed in self.objects], bool).reshape(len(self.objects))

    def bounds(self) -> np.ndarray:
        """Low and high corner of all triangles [grid steps], shape (2, 3), int64."""
        low, high = self._object_bounds[self.triangle_counts > 0].transpose(1, 0, 2)
        return np.array([low.min(axis=0), high.max(axis=0)])

    def object_bounds(self) -> np.ndarray:
        """Snapped box of each object [grid steps], shape (objects, 2, 3), int64; empty objects get min > max."""
        return self._object_bounds.copy()

    @cached_property
    def _object_bounds(self) -> np.ndarray:
        return bounds_by_owner(*self._flat[:2], len(self.objects))


def bounds_by_owner(triangles: np.ndarray, owners: np.ndarray, count: int) -> np.ndarray:
    """Boxes around the triangles of each of so many owners [grid steps], (count, 2, 3), int64; min > max for none.

    Owners ascend.
    """
    bounds = np.empty((count, 2, 3), np.int64)
    bounds[:, 0], bounds[:, 1] = GRID_LIMIT, -GRID_LIMIT
    if len(owners):
        # Corner by corner: NumPy is many times slower along short axes.
        a, b, c = triangles.transpose(1, 0, 2)
        starts = np.flatnonzero(np.append(True, owners[1:] != owners[:-1]))
        for end, least in enumerate((np.minimum, np.maximum)):
            bounds[owners[starts], end] = least.reduceat(least(least(a, b), c), starts, axis=0)
    return bounds


def turned(points: np.ndarray, yaw_deg: float) -> np.ndarray:
    """Points, shape (..., 3), turned counter-clockwise about the z axis."""
    cos, sin = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    return points @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])


def boxes_around(boxes: np.ndarray, transform: np.ndarray) -> np.ndarray:
    """Axial boxes around boxes [m] that a transform of shape (4, 4) moves, both of shape (n, 2, 3)."""
    corners = boxes[:, CORNERS, np.arange(3)] @ transform[:3, :3].T + transform[:3, 3]
    return np.stack([corners.min(axis=1), corners.max(axis=1)], axis=1)


def snap(metres: np.ndarray, grid_m: float, where: str) -> np.ndarray:
    """Nearest grid points [grid steps], int32.

    Raises:
        InputError: a coordinate is NaN or infinite, or further than GRID_LIMIT steps from the origin.
    """
    if not np.isfinite(metres).all():
        raise InputError(f"{where}: expected finite coordinates, found {metres[~np.isfinite(metres)][0]}")
    steps = np.round(metres / grid_m)
    if steps.size and np.abs(steps).max() > GRID_LIMIT:
        raise InputError(
            f"{where}: expected coordinates within {GRID_LIMIT * grid_m:g} m of the model's origin, "
            f"found {np.abs(metres).max():g} m; check the unit or choose a coarser grid"
        )
    return steps.astype(np.int32)


def degenerate(triangles: np.ndarray) -> np.ndarray:
    """Triangles without area, exactly; shape (m,), bool, for corners of shape (m, 3, 3) in grid steps."""
    a, b = (triangles[:, 1] - triangles[:, 0]).astype(np.int64), (triangles[:, 2] - triangles[:, 0]).astype(np.int64)
    flat = np.arange(len(triangles))
    for u, v in ((0, 1), (1, 2), (2, 0)):
        flat = flat[a[flat, u] * b[flat, v] == a[flat, v] * b[flat, u]]
    found = np.zeros(len(triangles), bool)
    found[flat] = True
    return found


def source_path(path: str | Path) -> Path:
    """The path, if it names something readable.

    Raises:
        InputError: it does not exist.
    """
    path = Path(path)
    if not path.exists():
        raise InputError(f"{path}: expected a model file or folder, found nothing there")
    return path
