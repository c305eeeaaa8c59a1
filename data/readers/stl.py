"""STL, binary and text: one object a solid."""

import re
import struct
from pathlib import Path

import numpy as np

from ..errors import InputError
from .assemble import Model
from .pieces import MeshFile, Piece, contents

HEADER_BYTES, COUNT_BYTES, UNKNOWN_COUNT = 84, 4, 2**32 - 1
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
SOLID = re.compile(rb"^[ \t]*(end)?solid\b[ \t]*([^\r\n]*)", re.MULTILINE | re.IGNORECASE)
LOOP = re.compile(rb"\bouter\s+loop\b(.*?)\bendloop\b", re.DOTALL | re.IGNORECASE)
VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)


def read_stl(path: Path, model: Model) -> MeshFile:
    """The solids of a file, named as they are; one without a name is named like the file.

    A binary file may begin with "solid" too. What follows the last triangle is noted.

    Raises:
        InputError: the file ends early, or is neither.
    """
    data = contents(path)
    if _is_text(data):
        return MeshFile(_text_solids(path, data, model))
    if len(data) < HEADER_BYTES:
        raise InputError(f"{path}: expected an STL header of {HEADER_BYTES} bytes, found {len(data)}")
    count = struct.unpack_from("<I", data, HEADER_BYTES - COUNT_BYTES)[0]
    whole, rest = divmod(len(data) - HEADER_BYTES, TRIANGLE.itemsize)
    if not rest and count != whole and (count < whole or count == UNKNOWN_COUNT):
        # Some programs mean to go back and fill in the count, and never do.
        model.note("the count of triangles", f"{count:,} is written, {whole:,} are there: read")
        count = whole
    if count > whole:
        raise InputError(f"{path}: expected {count:,} triangles, found the end of the file after {whole:,}")
    if extra := len(data) - HEADER_BYTES - count * TRIANGLE.itemsize:
        model.note(f"{extra} bytes", "after the last triangle: ignored")
    corners = np.frombuffer(data, TRIANGLE, count, HEADER_BYTES)["corners"].reshape(-1, 3).astype(np.float64)
    if not count:
        raise InputError(f"{path}: expected triangles, found none")
    return MeshFile([Piece(path.name, corners, np.arange(len(corners)).reshape(-1, 3))])


def _is_text(data: bytes) -> bool:
    """Whether the file is text: it begins with "solid" and has facets."""
    if not re.match(rb"(?:\xef\xbb\xbf)?\s*solid\b", data[:200], re.IGNORECASE):
        return False
    # Headers of binary files may look like text, but a count below 2**24 has a byte 0, and text has none.
    return b"\0" not in data[:1024] and re.search(rb"\b(facet|endsolid)\b", data[:100_000], re.IGNORECASE) is not None


def _text_solids(path: Path, data: bytes, model: Model) -> list[Piece]:
    marks = list(SOLID.finditer(data))
    if not marks or not marks[-1][1]:
        raise InputError(f"{path}: expected 'endsolid' at the end, found the end of the file")
    pieces, name, start = [], "", 0
    for mark in marks:
        if not mark[1]:
            if LOOP.search(data, start, mark.start()):
                raise InputError(f"{path}: expected 'endsolid' before the next solid, found none after {name!r}")
            name, start = mark[2].decode("utf-8", errors="replace").strip() or path.name, mark.end()
            continue
        points = _facets(path, data[start : mark.start()], model)
        start = mark.end()
        if len(points):
            pieces.append(Piece(name or path.name, points, np.arange(len(points)).reshape(-1, 3)))
        else:
            model.skip(name or path.name, "a solid without facets")
    return pieces


def _facets(path: Path, body: bytes, model: Model) -> np.ndarray:
    """Corners of the facets, three after three, shape (n, 3)."""
    loops = LOOP.findall(body)
    facets = len(re.findall(rb"(?<!end)\bfacet\b", body, re.IGNORECASE))
    if facets != len(loops) or body.lower().count(b"endfacet") != facets:
        found = f"{len(loops):,} loops and {body.lower().count(b'endfacet'):,} ends"
        raise InputError(f"{path}: expected a whole loop in each of {facets:,} facets, found {found}")
    rows = []
    for loop in loops:
        corners = VERTEX.findall(loop)
        if len(corners) != 3 or len(loop.split()) != 12:
            found = " ".join(loop.decode("latin-1").split())[:60]
            raise InputError(f"{path}: expected 3 vertices of 3 numbers in a facet, found {found!r}")
        rows += corners
    try:
        return np.array([[float(value) for value in row] for row in rows], np.float64).reshape(-1, 3)
    except ValueError as error:
        raise InputError(f"{path}: expected a number, found {error}") from None
