"""Wavefront OBJ: one object is what a group holds in one material."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..errors import InputError
from .assemble import Model
from .lines import lines_of, unquoted
from .materials import Material, libraries, read_library
from .pieces import MeshFile, Piece, bent_note, one_colour, rgba
from .triangulate import triangulated

# Curves and surfaces that are no polygons.
FREE_FORM = ("curv", "curv2", "surf")


@dataclass
class ObjGroup:
    """Polygons of one object or group with one material: corners, polygon after polygon, and how many each has."""

    name: str
    material: str
    corners: list[int] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)


@dataclass
class _Read:
    """What the lines of a file say."""

    vertices: list[tuple[float, float, float]] = field(default_factory=list)
    colours: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    groups: dict[tuple[str, str], ObjGroup] = field(default_factory=dict)
    libraries: list[str] = field(default_factory=list)
    reopened: set[str] = field(default_factory=set)
    lines: int = 0
    free_form: int = 0


def read_obj(path: Path, model: Model) -> MeshFile:
    """Groups in order of appearance; texture coordinates and normals are ignored.

    Materials may come from libraries that are named after their use. Where `d` and `Tr` contradict each other `d`
    holds: some exporters write both alike.

    Raises:
        InputError: a line cannot be understood, or a face names a vertex that is not there.
    """
    read = _read_lines(path)
    known: dict[str, Material] = {}
    for line in read.libraries:
        for name, found in libraries(path, line):
            if found is None:
                model.skip(name, "a material library that is not there: names alone tell glass")
            else:
                known |= read_library(found)
    loosely = {name.casefold(): material for name, material in known.items()}
    vertices = np.array(read.vertices, np.float64).reshape(-1, 3)
    shades = None
    if len(read.colours) == len(vertices) and len(vertices):
        shades = np.array(list(read.colours.values()))
    pieces, bent, unknown = [], 0, set()
    for group in read.groups.values():
        material = known.get(group.material) or loosely.get(group.material.casefold())
        if group.material and known and material is None:
            unknown.add(group.material)
        faces, _, more = triangulated(vertices, np.array(group.corners), np.array(group.sizes))
        bent += more
        clear = material.clear(group.material) if material else ""
        colours = one_colour(material.colour, len(faces)) if material else None
        if colours is None and shades is not None:
            means = np.column_stack([shades[faces].mean(axis=1), np.ones(len(faces))])
            colours = np.array([rgba(*mean) for mean in means], np.uint8)
        pieces.append(Piece(group.name, vertices, faces, group.material, clear, colours=colours))
    if not pieces:
        raise InputError(f"{path}: expected faces, found {len(vertices)} vertices and none")
    for name in sorted(unknown):
        model.note(name, "a material that no library has: names alone tell glass")
    model.notes += bent_note(bent, sum(len(group.sizes) for group in read.groups.values()))
    if read.reopened:
        model.note(f"{len(read.reopened)} groups", "written in several places: read as one object each")
    if read.lines:
        model.skip(f"{read.lines} lines and points", "no triangles")
    if read.free_form:
        model.skip(f"{read.free_form} curves and surfaces", "free-form: no triangles")
    return MeshFile(pieces)


def _read_lines(path: Path) -> _Read:
    read = _Read()
    name, material, group, last = path.stem, "", None, None
    for number, words in lines_of(path):
        key = words[0].lower()
        try:
            if key == "v":
                read.vertices.append((float(words[1]), float(words[2]), float(words[3])))
                if len(words) >= 7:
                    read.colours[len(read.vertices)] = (float(words[4]), float(words[5]), float(words[6]))
            elif key in ("f", "fo"):
                if group is None:
                    place = (name, material)
                    if place in read.groups and last != name:
                        read.reopened.add(name)
                    group, last = read.groups.setdefault(place, ObjGroup(name, material)), name
                corners = _corners(words[1:], len(read.vertices))
                group.corners += corners
                group.sizes.append(len(corners))
            elif key in ("o", "g"):
                name, group = " ".join(words[1:]) or path.stem, None
            elif key == "usemtl":
                material, group = unquoted(words[1:]), None
            elif key == "mtllib":
                read.libraries.append(" ".join(words[1:]))
            elif key in ("l", "p"):
                read.lines += 1
            elif key in FREE_FORM:
                read.free_form += 1
        except (ValueError, IndexError) as error:
            found = " ".join(str(error).split())[:80]
            raise InputError(f"{path}, line {number}: expected an OBJ {words[0]!r} line, found {found}") from None
    return read


def _corners(words: list[str], vertex_count: int) -> list[int]:
    """Vertex indices from 0 of a face's corners; negative numbers count back from the newest vertex."""
    corners = []
    for word in words:
        if word[0] == "#":
            break
        index = int(word.split("/", 1)[0])
        corner = index - 1 if index > 0 else vertex_count + index
        if index == 0 or not 0 <= corner < vertex_count:
            raise ValueError(f"vertex {index} of {vertex_count}")
        corners.append(corner)
    if len(corners) < 3:
        raise ValueError(f"{len(corners)} corners")
    return corners
