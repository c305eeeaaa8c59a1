"""What every mesh reader gives: pieces in the file's own frame and units, before roles and places are settled."""

from collections import Counter
from collections.abc import Hashable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..errors import InputError


@dataclass(frozen=True)
class Piece:
    """Triangles that are one object: a node, group, solid or layer, of one material.

    Attributes:
        vertices: in the file's unit, in the piece's own frame, shape (n, 3), float64; those that no face names count
            for nothing.
        faces: shape (m, 3), int64.
        material: its name, for what it says of glass; empty where there is none.
        clear: by what its material lets sight pass, in words; empty if it does not say so.
        judged: names to tell doors and windows by; the name itself if empty.
        to_file: the piece's frame to the file's, shape (4, 4), float64.
        colours: as in `Mesh`.
    """

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    material: str = ""
    clear: str = ""
    judged: str = ""
    to_file: np.ndarray = field(default_factory=lambda: np.eye(4))
    colours: np.ndarray | None = None


@dataclass(frozen=True)
class MeshFile:
    """A mesh file as read.

    Attributes:
        unit: of its numbers, a name or metres, where nobody says otherwise.
        up: its upward axis, "y" or "z", likewise.
    """

    pieces: list[Piece]
    unit: str | float = "metre"
    up: str = "z"


def used(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The vertices that faces name, and faces that name them: stray points must not stretch the model."""
    kept, renamed = np.unique(faces, return_inverse=True)
    return vertices[kept], renamed.reshape(-1, 3)


def rgba(*channels: float) -> tuple[int, int, int, int]:
    """A colour of 8 bits a channel of three or four shares from 0 to 1, as the file states them."""
    shares = [*channels, 1.0][:4] if len(channels) == 3 else channels
    return tuple(round(255 * min(max(float(share), 0.0), 1.0)) if share == share else 255 for share in shares)


def one_colour(colour: tuple[int, int, int, int] | None, count: int) -> np.ndarray | None:
    """The colour for each of `count` faces, shape (count, 4), uint8; None for None."""
    return None if colour is None else np.tile(np.array(colour, np.uint8), (count, 1))


def bent_note(bent: int, polygons: int) -> list[dict[str, str]]:
    """A note of polygons whose corners lie in no common plane; none if there are none."""
    why = "not flat: their triangles are one of several readings"
    return [{"what": f"{bent} of {polygons} polygons", "why": why}] if bent else []


def beside(path: Path, name: str) -> Path | None:
    """The file that a model names, beside it; None if there is none.

    Windows' way of parting folders, and names that differ in case, serve where there is no better.
    """
    plain = name.strip().strip("\"'")
    for way in (name, plain, plain.replace("\\", "/")):
        if way and "\0" not in way and _is_file(path.parent / way):
            return path.parent / way
    here = path.parent
    parts = [part for part in plain.replace("\\", "/").split("/") if part not in ("", ".")]
    for part in parts:
        here = here / part if part == ".." or (here / part).exists() else _any_case(here, part)
        if here is None:
            return None
    return here if parts and _is_file(here) else None


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name too long, or with a zero byte
        return False


def _any_case(folder: Path, name: str) -> Path | None:
    if not folder.is_dir():
        return None
    found = sorted(one for one in folder.iterdir() if one.name.casefold() == name.casefold())
    return found[0] if found else None


def contents(path: Path) -> bytes:
    """All of a file.

    Raises:
        InputError: it cannot be read.
    """
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: expected a readable file, found {error.strerror}") from None


def told_apart(names: list[str]) -> Iterator[str]:
    """The names, each once: the second "wall" becomes "wall #2", in the order of the file."""
    taken, uses = set(names), Counter()
    for name in names:
        uses[name] += 1
        if uses[name] == 1:
            yield name
            continue
        while (other := f"{name} #{uses[name]}") in taken:
            uses[name] += 1
        taken.add(other)
        yield other


def shape_key(vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray | None) -> Hashable:
    """Equal for pieces that may share a definition. By content: some writers repeat the geometry of every instance."""
    return vertices.tobytes(), faces.tobytes(), b"" if colours is None else colours.tobytes()
