"""Model readers: IFC, gbXML, meshes and scene folders, chosen by the path."""

import hashlib
from pathlib import Path

from ..errors import InputError
from ..frame import in_frame
from ..scene import GRID_M, Scene, source_path
from .assemble import Model
from .roles import RoleRules

IFC_SUFFIXES = (".ifc", ".ifczip")
GBXML_SUFFIXES = (".gbxml", ".xml", ".zip")
MESH_SUFFIXES = (".bsp", ".dxf", ".glb", ".gltf", ".obj", ".ply", ".stl")
UP_CHOICES = (None, "y", "z")


def read(
    path: str | Path,
    *,
    up: str | None = None,
    unit: str | float | None = None,
    doors: str = "open",
    glass: str = "",
    doors_by: str = "",
    leave_out: str = "",
    yaw: str | float = 0.0,
    grid_m: float = GRID_M,
) -> Scene:
    """The model in a file or scene folder, as a scene ready to bake.

    Args:
        path: .ifc, .ifczip, .gbxml, .xml, .zip (with a gbXML file), .glb, .gltf, .obj, .ply, .stl, .dxf, .bsp (a
            compiled Quake map), or a folder written by `write_scene`.
        up: axis that points up in a mesh file, "y" or "z"; by default y for glTF, which says so, and z for the others.
        unit: unit of a mesh file's numbers: a name such as "millimetre", or metres as a number; by default what a DXF
            states, 1/32 m for a map, and the metre for the others.
        doors: "open" (sight passes every door) or "closed" (doors occlude; glazing never does).
        glass: regular expression in place of the words for glass and windows in names; see `RoleRules`.
        doors_by: in place of the words for doors.
        leave_out: parts whose name, GUID or kind it finds are not read.
        yaw: what the model is turned back by about the vertical [degrees], or "auto" for the angle at which most of its
            walls stand; see `Scene.in_model`. At 0, the default, a scene folder stays as it was written.
        grid_m: grid step [m].

    Raises:
        InputError: the file is missing, of no known type, unreadable, empty, or too large for the grid; or `up`,
            `unit`, `grid_m` or what tells roles do not fit it.
    """
    path = source_path(path)
    roles = RoleRules(doors, glass, doors_by, leave_out)
    if up not in UP_CHOICES:
        raise InputError(f"up: expected y or z, found {up!r}")
    if yaw != "auto" and not (isinstance(yaw, int | float) and abs(yaw) <= 360.0):
        raise InputError(f"yaw: expected auto or degrees up to 360, found {yaw!r}")
    if not 0.0 < grid_m < float("inf"):
        raise InputError(f"grid step: expected a positive length in metres, found {grid_m!r}")
    if path.is_dir():
        return in_frame(_read_folder(path, grid_m), yaw)
    suffix = path.suffix.lower()
    if suffix == ".map":
        how = "compile it with qbsp of ericw-tools, and read the .bsp"
        raise InputError(f"{path}: expected a compiled map, found the source of one: {how}")
    known = IFC_SUFFIXES + GBXML_SUFFIXES + MESH_SUFFIXES
    if suffix not in known:
        raise InputError(f"{path}: expected {', '.join(known)} or a folder, found {suffix!r}")
    model = Model(source=str(path), sha256=_sha256(path), unit="metre", grid_m=grid_m, yaw=yaw)
    if suffix in IFC_SUFFIXES + GBXML_SUFFIXES:
        if up == "y" or unit is not None:
            what = "IFC" if suffix in IFC_SUFFIXES else "gbXML"
            raise InputError(f"{path}: expected no up or unit for {what}, which states its own, found {up or unit}")
        if suffix in IFC_SUFFIXES:
            from .ifc import read_ifc

            return read_ifc(path, model, roles)
        from .gbxml import read_gbxml

        return read_gbxml(path, model, roles)
    from .mesh import read_mesh

    return read_mesh(path, model, up=up, unit=unit, roles=roles)


def _read_folder(path: Path, grid_m: float) -> Scene:
    from ..store.scene_folder import read_scene

    scene = read_scene(path)
    if grid_m not in (GRID_M, scene.grid_m):
        raise InputError(f"{path}: expected its own grid step {scene.grid_m:g} m, found {grid_m:g} m")
    return scene


def _sha256(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{path}: expected a readable file, found {error.strerror}") from None
