"""The last step of every reader: parts in metres, Z up, become a `Scene`."""

import re
from collections import Counter
from collections.abc import Hashable
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import InputError
from ..frame import turn_note, wall_yaw
from ..plural import counted
from ..scene import GRID_LIMIT, Definition, Instance, Mesh, NamedStorey, Role, Scene, Space, degenerate, snap, turned

MAX_COORDINATE_M = 1.0e9
# Strays are at most this share of the parts, and further off than this, and than so many times the others reach.
STRAY_SHARE, STRAY_M, STRAY_TIMES = 0.4, 1000.0, 20.0
STRAYS_SHOWN = 3
PLAIN = re.compile(r"[\w ,:#-]+")


@dataclass(frozen=True)
class Part:
    """One object as read.

    Attributes:
        shape: equal for parts that share vertices and faces.
        vertices: [m], in the shape's own frame, shape (n, 3), float64.
        faces: shape (m, 3), int.
        transform: shape's frame to the model's, metres, Z up, shape (4, 4), float64.
        guid, why, storey, materials: as in `Instance`.
        colours: as in `Mesh`.
    """

    name: str
    kind: str
    role: Role
    shape: Hashable
    vertices: np.ndarray
    faces: np.ndarray
    transform: np.ndarray
    guid: str = ""
    why: str = ""
    colours: np.ndarray | None = None
    storey: NamedStorey | None = None
    materials: tuple[str, ...] = ()

    def placed(self) -> np.ndarray:
        """Vertices in the model's frame [m]."""
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused for its size
            return self.vertices @ self.transform[:3, :3].T + self.transform[:3, 3]


@dataclass
class Model:
    """What a reader found, in the file's own frame, metres, Z up.

    Attributes:
        yaw: what the model is turned back by [degrees], or "auto" for the angle at which most of its walls stand.
        openings: points of doors, windows and voids [m], each of shape (n, 3).
        skipped, notes: as in `Scene`.
    """

    source: str
    sha256: str
    unit: str
    grid_m: float
    yaw: str | float = 0.0
    parts: list[Part] = field(default_factory=list)
    spaces: list[Space] = field(default_factory=list)
    openings: list[np.ndarray] = field(default_factory=list)
    skipped: list[dict[str, str]] = field(default_factory=list)
    notes: list[dict[str, str]] = field(default_factory=list)

    def skip(self, what: str, why: str) -> None:
        """Note a part that could not be read."""
        self.skipped.append({"what": what, "why": why})

    def note(self, what: str, why: str) -> None:
        """Note a part that was read otherwise than it is written, or that is not as it should be."""
        self.notes.append({"what": what, "why": why})


def assemble(model: Model) -> Scene:
    """The scene: moved to a whole-metre origin, welded, exact in float32, without empty parts.

    Raises:
        InputError: nothing opaque is left, or a part does not fit on the grid.
    """
    parts = [part for part in model.parts if _usable(part, model)]
    _require_opaque(parts, model)
    origin = _centre(parts, model)
    yaw_deg = _yaw(parts, model)
    if yaw_deg:
        parts, spaces, openings = _turn_back(parts, model, origin, yaw_deg)
    else:
        spaces, openings = model.spaces, model.openings
    definitions, objects = _share(parts, origin, model)
    _require_opaque(objects, model)
    boxes = [
        np.array([points.min(axis=0), points.max(axis=0)]) - origin for points in openings if np.isfinite(points).all()
    ]
    return Scene(
        definitions=definitions,
        objects=objects,
        spaces=[replace(space, vertices=space.vertices - origin) for space in spaces],
        openings=np.array(boxes).reshape(-1, 2, 3),
        origin=origin,
        yaw_deg=yaw_deg,
        grid_m=model.grid_m,
        source=model.source,
        sha256=model.sha256,
        unit=model.unit,
        skipped=model.skipped,
        notes=model.notes,
    )


def _yaw(parts: list[Part], model: Model) -> float:
    """What the model is turned back by [degrees]; noted if the file does not say so."""
    if model.yaw != "auto":
        return float(model.yaw)
    yaw_deg = wall_yaw([(part.placed(), part.faces) for part in parts if part.role is Role.OCCLUDER])
    if yaw_deg:
        model.notes.append(turn_note(yaw_deg))
    return yaw_deg


def _turn_back(
    parts: list[Part], model: Model, origin: np.ndarray, yaw_deg: float
) -> tuple[list[Part], list[Space], list[np.ndarray]]:
    """Parts, rooms and openings, turned about a vertical through the origin."""

    def back(points: np.ndarray) -> np.ndarray:
        # The offset comes off first: far from 0 the turn itself would cost digits.
        return turned(points - origin, -yaw_deg) + origin

    again = []
    for part in parts:
        transform = part.transform.copy()
        transform[:3, :3] = turned(part.transform[:3, :3].T, -yaw_deg).T
        transform[:3, 3] = back(part.transform[:3, 3])
        again.append(replace(part, transform=transform))
    spaces = [replace(space, vertices=back(space.vertices)) for space in model.spaces]
    return again, spaces, [back(points) for points in model.openings]


def _centre(parts: list[Part], model: Model) -> np.ndarray:
    """Whole metres nearest to the middle of the parts' common box."""
    boxes = np.array([[(placed := part.placed()).min(axis=0), placed.max(axis=0)] for part in parts])
    _find_strays(parts, boxes, model)
    low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    # Beyond this, float64 no longer resolves the grid and the sums below may overflow.
    reach = np.abs([low, high]).max()
    if reach > MAX_COORDINATE_M:
        raise InputError(f"{model.source}: expected coordinates below {MAX_COORDINATE_M:g} m, found {reach:g} m")
    return np.round((low + high) / 2) + 0.0  # -0.0 becomes 0.0


def _find_strays(parts: list[Part], boxes: np.ndarray, model: Model) -> None:
    """Note the few parts that lie far from all the others, such as a survey point.

    Raises:
        InputError: one lies so far off that the others do not fit on the grid with it.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused for its size
        away = np.abs(boxes - np.median(boxes.mean(axis=1), axis=0)).max(axis=(1, 2))
    near = np.quantile(away, 1 - STRAY_SHARE, method="lower")
    far = np.flatnonzero(away > max(STRAY_M, STRAY_TIMES * near))
    if not len(far):
        return
    far = far[np.argsort(-away[far], kind="stable")]
    names = list(dict.fromkeys(parts[i].name for i in far))
    shown = ", ".join(map(repr, names[:STRAYS_SHOWN])) + (", ..." if len(names) > STRAYS_SHOWN else "")
    apart = f"{len(far)} of {len(parts)} parts up to {away[far[0]] / 1000:,.0f} km from the others: {shown}"
    pattern = "|".join(name if PLAIN.fullmatch(name) else re.escape(name) for name in names[:STRAYS_SHOWN])
    if away[far[0]] > GRID_LIMIT * model.grid_m:
        reach = f"all parts within {GRID_LIMIT * model.grid_m:g} m of one another"
        raise InputError(f"{model.source}: expected {reach}, found {apart}; --leave-out '{pattern}' reads the rest")
    model.note(shown, f"far from all else: {apart}; --leave-out '{pattern}' reads the rest")


def _usable(part: Part, model: Model) -> bool:
    if not len(part.faces) or not len(part.vertices):
        model.skip(part.name, f"{part.kind}: no triangles")
        return False
    if not (np.isfinite(part.vertices).all() and np.isfinite(part.transform).all()):
        model.skip(part.name, f"{part.kind}: a coordinate is not finite")
        return False
    return True


def _share(parts: list[Part], origin: np.ndarray, model: Model) -> tuple[list[Definition], list[Instance]]:
    """Definitions for shapes, and instances of them; a shape used once is stored in place.

    In place, walls that meet at a plane get the same float32 and the same grid plane, whatever frames they came in.
    """
    uses = Counter(part.shape for part in parts)
    known: dict[Hashable, tuple[int, np.ndarray]] = {}
    definitions: list[Definition] = []
    objects: list[Instance] = []
    dropped = 0
    for part in parts:
        flat = _flat_count(part, origin, model)
        if flat == len(part.faces):
            model.skip(part.name, f"{part.kind}: no area on the grid")
            continue
        dropped += flat
        if uses[part.shape] == 1:
            mesh, to_scene = float32_mesh(part.placed() - origin, part.faces, colours=part.colours), np.eye(4)
            definitions.append(Definition(part.name, (mesh,)))
            definition_id = len(definitions) - 1
        else:
            if part.shape not in known:
                centre = np.round((part.vertices.min(axis=0) + part.vertices.max(axis=0)) / 2)
                known[part.shape] = len(definitions), centre
                mesh = float32_mesh(part.vertices - centre, part.faces, colours=part.colours)
                definitions.append(Definition(part.name, (mesh,)))
            definition_id, centre = known[part.shape]
            to_scene = part.transform.copy()
            to_scene[:3, 3] += part.transform[:3, :3] @ centre - origin
        words = part.guid, part.why, part.storey, part.materials
        objects.append(Instance(part.name, part.kind, definition_id, to_scene, part.role, *words))
    if dropped:
        model.skip(counted(dropped, "triangle"), "no area on the grid")
    return definitions, objects


def _flat_count(part: Part, origin: np.ndarray, model: Model) -> int:
    """How many of the part's triangles have no area on the grid."""
    snapped = snap(part.placed() - origin, model.grid_m, f"{model.source}: {part.name!r}")
    return int(degenerate(snapped[part.faces]).sum())


def float32_mesh(
    vertices: np.ndarray, faces: np.ndarray, error_m: float = 0.0, colours: np.ndarray | None = None
) -> Mesh:
    """A mesh of welded vertices that float32 holds exactly, so that writing and reading it moves nothing."""
    rounded, index = np.unique(np.asarray(vertices).astype(np.float32), axis=0, return_inverse=True)
    return Mesh(rounded.astype(np.float64), index.reshape(-1)[np.asarray(faces)].astype(np.int32), error_m, colours)


def _require_opaque(parts: list[Part] | list[Instance], model: Model) -> None:
    if all(part.role is Role.TRANSPARENT for part in parts):
        lost = f"; {len(model.skipped)} skipped, first: {model.skipped[0]['why']}" if model.skipped else ""
        raise InputError(f"{model.source}: expected something opaque, found {len(parts)} transparent objects{lost}")
