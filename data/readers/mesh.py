"""Mesh files of every format: from pieces as read to a scene."""

import json
import struct
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..scene import Scene
from .assemble import Model, Part, assemble
from .dxf import read_dxf
from .gltf import read_gltf
from .obj import read_obj
from .pieces import MeshFile, Piece, shape_key, told_apart, used
from .ply import read_ply
from .quake_map import read_map
from .roles import RoleRules
from .stl import read_stl
from .units import metres_per_unit

Y_UP_TO_Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
HOLE_FILLERS = ("IfcDoor", "IfcWindow", "IfcPlate")
READERS: dict[str, Callable[[Path, Model], MeshFile]] = {
    ".glb": read_gltf,
    ".gltf": read_gltf,
    ".obj": read_obj,
    ".ply": read_ply,
    ".stl": read_stl,
    ".dxf": read_dxf,
    ".bsp": read_map,
}
# Names of several objects that are noted one by one.
NAMES_NOTED = 20
# What a reader may trip over in a file that is not what it seems.
TRIPS = (ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError, RecursionError, struct.error)


def read_mesh(path: Path, model: Model, *, up: str | None, unit: str | float | None, roles: RoleRules) -> Scene:
    """Scene of a mesh file; each node, group or solid is one object, and its material and name give its role.

    Args:
        path: of one of the kinds in READERS.
        model: source, sha256 and grid step; filled in here.
        up: "y", "z", or None for the format's habit.
        unit: see `metres_per_unit`; None for the file's own, which is the metre where it states none.
        roles: what is glass, a door, or left out.

    Raises:
        InputError: the file cannot be read, or holds nothing opaque.
    """
    found = read_pieces(path, model)
    scale, model.unit = metres_per_unit(found.unit if unit is None else unit)
    to_model = Y_UP_TO_Z_UP if (up or found.up) == "y" else np.eye(4)
    to_model = to_model @ np.diag([scale, scale, scale, 1.0])
    if not found.pieces:
        lost = f"; {len(model.skipped)} skipped, first: {model.skipped[0]['why']}" if model.skipped else ""
        raise InputError(f"{path}: expected triangles, found none{lost}")
    names = [piece.name for piece in found.pieces]
    shared = [(name, count) for name, count in Counter(names).items() if count > 1]
    for name, count in shared[:NAMES_NOTED]:
        model.note(name, f"a name of {count} objects: told apart as {name!r}, {name + ' #2'!r} and so on")
    if more := len(shared[NAMES_NOTED:]):
        model.note(f"{more} more names", "of several objects each: told apart likewise")
    for piece, name in zip(found.pieces, told_apart(names), strict=True):
        part = _part(piece, name, to_model, roles)
        if roles.leaves_out(part.name, part.kind):
            model.skip(part.name, f"{part.kind}: left out as asked")
        else:
            model.parts.append(part)
    model.openings += [placed for part in model.parts if part.kind in HOLE_FILLERS and len(placed := part.placed())]
    return assemble(model)


def read_pieces(path: Path, model: Model) -> MeshFile:
    """The pieces of a mesh file; what is lost or odd goes into the model's `skipped` and `notes`.

    Raises:
        InputError: the file cannot be read.
    """
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused for its size
            return READERS[path.suffix.lower()](path, model)
    except InputError:
        raise
    except json.JSONDecodeError as error:
        raise InputError(f"{path}: expected JSON, found {error}") from None
    except TRIPS as error:
        found = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: expected a readable {path.suffix} file, found {found}") from None


def _part(piece: Piece, name: str, to_model: np.ndarray, roles: RoleRules) -> Part:
    taken = roles.of_mesh(piece.judged or piece.name, piece.material, piece.clear)
    points, faces = used(piece.vertices, piece.faces)
    transform = to_model @ piece.to_file
    key = shape_key(points, faces, piece.colours)
    return Part(name, taken.kind, taken.role, key, points, faces, transform, why=taken.why, colours=piece.colours)
