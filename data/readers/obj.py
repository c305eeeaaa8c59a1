"""Wavefront OBJ, read here because group and material names decide roles and most loaders drop them."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..errors import InputError
from .triangulate import polygon_triangles


@dataclass
class ObjGroup:
    """Triangles of one object or group with one material.

    Attributes:
        faces: indices into the file's vertices, three each.
        alpha: the material's opacity, 1 where unknown.
    """

    name: str
    material: str
    alpha: float = 1.0
    faces: list[tuple[int, int, int]] = field(default_factory=list)


def read_obj(path: Path) -> tuple[np.ndarray, list[ObjGroup]]:
    """Vertices, shape (n, 3), float64, and groups in order of appearance.

    Polygons are cut into triangles; texture coordinates, normals, lines and points are ignored.

    Raises:
        InputError: a line cannot be understood, or a face names a vertex that is not there.
    """
    vertices: list[tuple[float, float, float]] = []
    groups: dict[tuple[str, str], ObjGroup] = {}
    alphas: dict[str, float] = {}
    name, material, group = path.stem, "", None
    for number, words in _lines(path):
        try:
            if words[0] == "v":
                vertices.append((float(words[1]), float(words[2]), float(words[3])))
            elif words[0] == "f":
                if group is None:
                    group = groups.setdefault((name, material), ObjGroup(name, material, alphas.get(material, 1.0)))
                group.faces += polygon_triangles(vertices, _corners(words[1:], len(vertices)))
            elif words[0] in ("o", "g"):
                name, group = " ".join(words[1:]) or path.stem, None
            elif words[0] == "usemtl":
                material, group = " ".join(words[1:]), None
            elif words[0] == "mtllib":
                alphas |= _alphas(path.parent / " ".join(words[1:]))
        except (ValueError, IndexError) as error:
            raise InputError(f"{path}, line {number}: expected an OBJ {words[0]!r} line, found {error}") from None
    return np.array(vertices, np.float64).reshape(-1, 3), list(groups.values())


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Line number and words of each line that has any, joined where it ends in a backslash."""
    held: list[str] = []
    with path.open(encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, start=1):
            if line.rstrip().endswith("\\"):
                held += line.rstrip()[:-1].split()
                continue
            words, held = held + line.split(), []
            if words and not words[0].startswith("#"):
                yield number, words


def _corners(words: list[str], vertex_count: int) -> list[int]:
    """Vertex indices from 0 of a face's corners; negative numbers count back from the newest vertex."""
    corners = []
    for word in words:
        index = int(word.split("/", 1)[0])
        corner = index - 1 if index > 0 else vertex_count + index
        if index == 0 or not 0 <= corner < vertex_count:
            raise ValueError(f"vertex {index} of {vertex_count}")
        corners.append(corner)
    if len(corners) < 3:
        raise ValueError(f"{len(corners)} corners")
    return corners


def _alphas(path: Path) -> dict[str, float]:
    """Opacity by material; nothing where the library cannot be read: names then decide alone."""
    if not path.is_file():
        return {}
    found: dict[str, float] = {}
    name = ""
    for _, words in _lines(path):
        try:
            if words[0] == "newmtl":
                name = " ".join(words[1:])
            elif words[0] == "d":
                found[name] = float(words[-1])
            elif words[0] == "Tr":
                found[name] = 1.0 - float(words[-1])
        except ValueError:
            continue
    return found
