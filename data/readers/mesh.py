"""Mesh files: glTF, PLY and STL through trimesh, OBJ by our own reader."""

import warnings
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..scene import Scene
from .assemble import Model, Part, assemble
from .obj import read_obj
from .roles import OPAQUE_ALPHA, RoleRules
from .units import metres_per_unit

Y_UP_TO_Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
HOLE_FILLERS = ("IfcDoor", "IfcWindow", "IfcPlate")


def read_mesh(path: Path, model: Model, *, up: str | None, unit: str | float | None, roles: RoleRules) -> Scene:
    """Scene of a mesh file; each node, group or solid is one object, and its material and name give its role.

    Args:
        path: .glb, .gltf, .obj, .ply or .stl.
        model: source, sha256 and grid step; filled in here.
        up: "y", "z", or None for the format's habit.
        unit: see `metres_per_unit`; None for metres.
        roles: what is glass, a door, or left out.

    Raises:
        InputError: the file cannot be read, or holds nothing opaque.
    """
    scale, model.unit = metres_per_unit("metre" if unit is None else unit)
    is_gltf = path.suffix.lower() in (".glb", ".gltf")
    to_model = Y_UP_TO_Z_UP if (up or ("y" if is_gltf else "z")) == "y" else np.eye(4)
    to_model = to_model @ np.diag([scale, scale, scale, 1.0])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what the loaders complain of shows in what they return
            take = _take_obj if path.suffix.lower() == ".obj" else _take_scene
            take(path, model, to_model, roles)
    except (InputError, MemoryError):
        raise
    except (ImportError, UnicodeError):  # trimesh then wants a package to guess the encoding, which is no help here
        raise InputError(f"{path}: expected a whole binary file or UTF-8 text, found neither") from None
    except Exception as error:  # the loaders raise whatever their parsing trips over
        found = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: expected a readable {path.suffix} file, found {found}") from None
    model.openings += [
        np.array([placed.min(axis=0), placed.max(axis=0)])
        for part in model.parts
        if part.kind in HOLE_FILLERS and len(placed := part.placed())
    ]
    return assemble(model)


def _take_obj(path: Path, model: Model, to_model: np.ndarray, roles: RoleRules) -> None:
    vertices, groups = read_obj(path)
    for at, group in enumerate(groups):
        points, faces = _used(vertices, np.array(group.faces))
        clear = "" if group.alpha >= OPAQUE_ALPHA else f"opacity {group.alpha:g} of {group.material!r}"
        taken = roles.of_mesh(group.name, group.material, clear)
        model.parts.append(Part(group.name, taken.kind, taken.role, at, points, faces, to_model, why=taken.why))
    if not groups:
        raise InputError(f"{path}: expected faces, found {len(vertices)} vertices and none")


def _take_scene(path: Path, model: Model, to_model: np.ndarray, roles: RoleRules) -> None:
    import trimesh

    loaded = trimesh.load_scene(str(path), process=False)
    for node in sorted(loaded.graph.nodes_geometry):
        placement, shape = loaded.graph[node]
        mesh = loaded.geometry[shape]
        if not isinstance(mesh, trimesh.Trimesh):
            model.skip(str(node), f"{type(mesh).__name__}: no triangles")
            continue
        material = getattr(mesh.visual, "material", None)
        clear = "a material that lets light pass" if _see_through(material) else ""
        taken = roles.of_mesh(f"{node} {shape}", str(getattr(material, "name", "") or ""), clear)
        transform = to_model @ np.asarray(placement, np.float64)
        points, faces = _used(np.array(mesh.vertices, np.float64), np.array(mesh.faces))
        # By content: some writers repeat the geometry of every instance.
        content = (points.tobytes(), faces.tobytes())
        model.parts.append(Part(str(node), taken.kind, taken.role, content, points, faces, transform, why=taken.why))
    if not model.parts:
        raise InputError(f"{path}: expected triangles, found none")


def _used(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The vertices that faces name, and faces that name them: stray points must not stretch the model."""
    used, renamed = np.unique(faces, return_inverse=True)
    return vertices[used], renamed.reshape(-1, 3)


def _see_through(material: object) -> bool:
    """Whether a glTF material lets light pass: blended, cut out by a mask, or with alpha below 1."""
    if getattr(material, "alphaMode", None) in ("BLEND", "MASK"):
        return True
    colour = getattr(material, "baseColorFactor", None)
    if colour is None or len(colour) < 4:
        return False
    alpha = float(colour[3])
    return alpha < (255 * OPAQUE_ALPHA if np.asarray(colour).dtype.kind in "iu" else OPAQUE_ALPHA)
