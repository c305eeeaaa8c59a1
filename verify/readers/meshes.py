"""The second reader of a mesh file, chosen by its name."""

from pathlib import Path

from .bsp import found_in_bsp
from .dxf import found_in_dxf
from .gltf import found_in_gltf
from .polygons import found_in_obj, found_in_ply, found_in_stl
from .referee import Found

SECOND_READERS = {
    ".gltf": found_in_gltf,
    ".glb": found_in_gltf,
    ".obj": found_in_obj,
    ".ply": found_in_ply,
    ".stl": found_in_stl,
    ".dxf": found_in_dxf,
    ".bsp": found_in_bsp,
}
# Formats that have a unit of their own, for files that nobody gives another; the rest is in metres.
OWN_UNIT = (".dxf", ".bsp")


def found_in_mesh(path: Path, metres: float | None = None, up: str | None = None) -> list[Found] | None:
    """Objects of a mesh file as its second reader finds them; None for a kind that has none.

    Args:
        path: the file; one that the first reader refuses may raise anything here.
        metres: length of the file's unit [m]; None for its own.
        up: "y" or "z"; None for the format's habit.
    """
    suffix = path.suffix.lower()
    if suffix not in SECOND_READERS:
        return None
    if metres is None and suffix not in OWN_UNIT:
        metres = 1.0
    return SECOND_READERS[suffix](path, metres, up or ("y" if suffix in (".gltf", ".glb") else "z"))
