"""A model file by the second reader of its format, against the scene that was read from it."""

from pathlib import Path

from ...data.errors import InputError
from ...data.scene import Scene
from .gbxml import differences_gbxml
from .ifc import differences_ifc
from .meshes import SECOND_READERS, found_in_mesh
from .referee import differences

IFC, GBXML = (".ifc", ".ifczip"), (".xml", ".gbxml")


def disagreements(scene: Scene, path: Path, *, metres: float | None = None, up: str | None = None) -> list[str]:
    """What a second reader finds otherwise, one line each.

    Args:
        scene: what was read.
        path: the whole file that it was read from.
        metres: length of a mesh file's unit [m]; None for its own.
        up: axis that points up in a mesh file; None for the format's habit.

    Raises:
        InputError: its format has no second reader.
    """
    suffix = path.suffix.lower()
    if suffix in IFC:
        return differences_ifc(scene, path)
    if suffix in GBXML:
        return differences_gbxml(scene, path)
    found = found_in_mesh(path, metres, up)
    if found is None:
        known = ", ".join((*IFC, *GBXML, *SECOND_READERS))
        raise InputError(f"{path}: expected {known} for a second reader, found {suffix!r}")
    return differences(scene, found)
