"""The second reader of each format."""

from collections.abc import Iterable
from pathlib import Path

from ...data.errors import InputError
from ...data.scene import Scene
from .referee import Found

SUFFIXES = (".ifc", ".ifczip", ".xml", ".gbxml", ".gltf", ".glb", ".obj", ".ply", ".stl")


def second_reader(path: Path, scene: Scene) -> Iterable[Found]:
    """Objects of a model file by the second reader of its format.

    Args:
        path: the file.
        scene: what was read from it; tells which unit was meant, and nothing else.

    Raises:
        InputError: its format has no second reader.
    """
    raise InputError(f"{path}: expected {', '.join(SUFFIXES)} for a second reader, found {path.suffix!r}")
