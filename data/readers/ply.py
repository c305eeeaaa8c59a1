"""PLY: ASCII and binary of either byte order, polygons of any size, triangle strips, colours; one object a file."""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..errors import InputError
from .assemble import Model
from .pieces import MeshFile, Piece, bent_note, contents
from .triangulate import triangulated

TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
    "double": "f8",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4",
    "float64": "f8", "int64": "i8", "uint64": "u8",
}  # fmt: skip
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
HEADER_BYTES = 1 << 20
CORNERS = ("vertex_indices", "vertex_index")
CHANNELS = ("red", "green", "blue", "alpha")


@dataclass(frozen=True)
class _Property:
    """A column: a scalar, or a list whose length has the type `count`."""

    name: str
    kind: str
    count: str = ""


@dataclass
class _Element:
    """Rows of properties.

    Attributes:
        scalars: values by name, shape (rows,).
        lists: by name, all values in a row, and how many each row has.
    """

    name: str
    rows: int
    properties: list[_Property] = field(default_factory=list)
    scalars: dict[str, np.ndarray] = field(default_factory=dict)
    lists: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)


def read_ply(path: Path, model: Model) -> MeshFile:
    """The faces and strips of a file as one object, named like the file.

    Raises:
        InputError: the header is not understood, the file ends early, or a face names a vertex that is not there.
    """
    data = contents(path)
    order, elements, start = _header(path, data)
    if order:
        end = _read_binary(path, data, start, order, elements)
        if end < len(data):
            model.note(f"{len(data) - end} bytes", "after the last element: ignored")
    else:
        _read_text(path, data[start:], elements, model)
    named = {element.name: element for element in reversed(elements)}
    vertex = named.get("vertex")
    if vertex is None or any(axis not in vertex.scalars for axis in "xyz"):
        raise InputError(f"{path}: expected an element vertex with x, y and z, found {', '.join(named) or 'none'}")
    vertices = np.column_stack([vertex.scalars[axis].astype(np.float64) for axis in "xyz"])
    corners, sizes, colours = _polygons(path, named.get("face"), vertex.rows, model)
    faces, owners, bent = triangulated(vertices, corners, sizes)
    model.notes += bent_note(bent, len(sizes))
    strips = _strips(path, named.get("tristrips"), vertex.rows, model)
    shades = _face_colours(vertex, faces, colours, owners)
    if len(strips):
        more = _face_colours(vertex, strips, None, np.zeros(0))
        shades = np.concatenate([shades, more]) if shades is not None and more is not None else None
        faces = np.concatenate([faces, strips])
    for name in named.keys() - {"vertex", "face", "tristrips", "material"}:
        if named[name].rows:
            model.note(f"{named[name].rows} of element {name!r}", "not read")
    if not len(faces):
        raise InputError(f"{path}: expected faces, found {vertex.rows:,} vertices and none")
    return MeshFile([Piece(path.name, vertices, faces, colours=shades)])


def _header(path: Path, data: bytes) -> tuple[str, list[_Element], int]:
    """Byte order, empty for text; elements without values; where they begin."""
    end = re.search(rb"(?:^|[\r\n])end_header[ \t]*(\r\n|\n|\r)", data[:HEADER_BYTES])
    if not re.match(rb"ply\s", data) or end is None:
        raise InputError(f"{path}: expected a PLY header from 'ply' to 'end_header', found none")
    order, elements = None, []
    for line in re.split(r"[\r\n]+", data[: end.start()].decode("latin-1"))[1:]:
        words = line.split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        if words[0] == "format" and len(words) > 1 and words[1] in ORDERS:
            order = ORDERS[words[1]]
        elif words[0] == "element" and len(words) == 3 and re.fullmatch(r"\d{1,18}", words[2]):
            elements.append(_Element(words[1], int(words[2])))
        elif words[0] == "property" and elements and len(words) == 3 and words[1] in TYPES:
            elements[-1].properties.append(_Property(words[2], TYPES[words[1]]))
        elif words[0] == "property" and elements and len(words) == 5 and {words[2], words[3]} <= TYPES.keys():
            elements[-1].properties.append(_Property(words[4], TYPES[words[3]], TYPES[words[2]]))
        else:
            raise InputError(f"{path}: expected a line of a PLY header, found {' '.join(words)[:60]!r}")
    if order is None:
        raise InputError(f"{path}: expected a format, ascii or binary, found none")
    # A row takes a byte at least; without properties it would take none, and any number of them.
    for element in elements:
        names = [one.name for one in element.properties]
        if element.rows > len(data) or not names or len(set(names)) < len(names):
            found = f"{element.rows:,} rows of {', '.join(names) or 'nothing'} in {len(data):,} bytes"
            raise InputError(
                f"{path}: expected rows of element {element.name!r} that fit the file, found {found}"[:300]
            )
    return order, elements, end.end()


def _read_binary(path: Path, data: bytes, start: int, order: str, elements: list[_Element]) -> int:
    """Fill the elements; returns where the last one ends."""
    at = start
    for element in elements:
        if any(one.count for one in element.properties):
            at = _read_lists(path, data, at, order, element)
            continue
        row = np.dtype([(one.name, order + one.kind) for one in element.properties])
        if at + element.rows * row.itemsize > len(data):
            raise _early(path, element, len(data))
        values = np.frombuffer(data, row, element.rows, at)
        element.scalars = {one.name: values[one.name] for one in element.properties}
        at += element.rows * row.itemsize
    return at


def _early(path: Path, element: _Element, size: int) -> InputError:
    found = f"the end of the file at {size:,} bytes"
    return InputError(f"{path}: expected {element.rows:,} rows of element {element.name!r}, found {found}")


def _read_lists(path: Path, data: bytes, at: int, order: str, element: _Element) -> int:
    """Fill an element whose rows differ in length: find where each row's values are, then take them all at once."""
    places = {one.name: np.empty(element.rows, np.int64) for one in element.properties}
    counts = {one.name: np.ones(element.rows, np.int64) for one in element.properties}
    little = "little" if order == "<" else "big"
    steps = [
        (np.dtype(one.kind).itemsize, np.dtype(one.count).itemsize if one.count else 0, one.count[:1] == "i",
         places[one.name], counts[one.name])
        for one in element.properties
    ]  # fmt: skip
    if any(one.count[:1] == "f" for one in element.properties):
        raise InputError(f"{path}: expected whole numbers as lengths in element {element.name!r}, found floats")
    size = len(data)
    for row in range(element.rows):
        for width, head, signed, where, many in steps:
            if head:
                count = data[at] if head == 1 and not signed and at < size else int.from_bytes(
                    data[at : at + head], little, signed=signed
                )  # fmt: skip
                at += head
                if count < 0 or at > size:
                    raise _early(path, element, size)
                many[row] = count
                where[row] = at
                at += count * width
            else:
                where[row] = at
                at += width
        if at > size:
            raise _early(path, element, size)
    raw = np.frombuffer(data, np.uint8)
    for one in element.properties:
        kind = np.dtype(order + one.kind)
        many = counts[one.name]
        first = np.repeat(places[one.name] - np.concatenate([[0], np.cumsum(many)[:-1]]) * kind.itemsize, many)
        offsets = first + np.arange(int(many.sum())) * kind.itemsize
        values = raw[offsets[:, None] + np.arange(kind.itemsize)].copy().view(kind)[:, 0] if len(offsets) else raw[:0]
        if one.count:
            element.lists[one.name] = (values, many)
        else:
            element.scalars[one.name] = values
    return at


def _read_text(path: Path, body: bytes, elements: list[_Element], model: Model) -> None:
    """Fill the elements from words."""
    words = body.split()
    at = 0
    for element in elements:
        if not any(one.count for one in element.properties):
            width = len(element.properties)
            part = words[at : at + element.rows * width]
            if len(part) < element.rows * width:
                raise _early(path, element, len(body))
            values = _numbers(path, part).reshape(element.rows, width)
            element.scalars = {one.name: values[:, k] for k, one in enumerate(element.properties)}
            at += element.rows * width
            continue
        taken: dict[str, list] = {one.name: [] for one in element.properties}
        counts: dict[str, list[int]] = {one.name: [] for one in element.properties}
        for _ in range(element.rows):
            for one in element.properties:
                count = 1
                if one.count:
                    if at >= len(words):
                        raise _early(path, element, len(body))
                    count, at = _length(path, words[at]), at + 1
                if count < 0 or at + count > len(words):
                    raise _early(path, element, len(body))
                taken[one.name] += words[at : at + count]
                counts[one.name].append(count)
                at += count
        for one in element.properties:
            values = _numbers(path, taken[one.name])
            if one.count:
                element.lists[one.name] = (values, np.array(counts[one.name], np.int64))
            else:
                element.scalars[one.name] = values
    if at < len(words):
        model.note(f"{len(words) - at} words", "after the last element: ignored")


def _numbers(path: Path, words: list[bytes]) -> np.ndarray:
    try:
        return np.array(words, np.bytes_).astype(np.float64) if words else np.zeros(0)
    except ValueError:
        odd = next(word for word in words if not _is_number(word))
        raise InputError(f"{path}: expected a number, found {odd.decode('latin-1')[:40]!r}") from None


def _length(path: Path, word: bytes) -> int:
    if not re.fullmatch(rb"-?\d{1,18}", word):
        raise InputError(f"{path}: expected a number of corners, found {word.decode('latin-1')[:40]!r}")
    return int(word)


def _is_number(word: bytes) -> bool:
    try:
        return float(word) is not None
    except ValueError:
        return False


def _corners(path: Path, element: _Element) -> tuple[np.ndarray, np.ndarray]:
    """Vertex indices of faces or strips, one after another, int64, and how many each has."""
    name = next((name for name in CORNERS if name in element.lists), None)
    if name is None:
        found = ", ".join(one.name for one in element.properties)
        raise InputError(f"{path}: expected a list vertex_indices in element {element.name!r}, found {found}")
    values, sizes = element.lists[name]
    if not np.isfinite(values.astype(np.float64)).all() or (values != np.floor(values)).any():
        raise InputError(f"{path}: expected whole numbers as vertex indices, found others")
    return values.astype(np.int64), sizes


def _check(path: Path, corners: np.ndarray, count: int) -> None:
    if len(corners) and not 0 <= corners.min() <= corners.max() < count:
        bad = corners[(corners < 0) | (corners >= count)][0]
        raise InputError(f"{path}: expected vertices from 0 to {count - 1:,}, found a face of vertex {bad:,}")


def _polygons(path: Path, face: _Element | None, count: int, model: Model) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners and sizes of the faces of three corners or more, and the colours that faces themselves have, if any."""
    if face is None or not face.rows:
        return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 4))
    corners, sizes = _corners(path, face)
    _check(path, corners, count)
    whole = sizes >= 3
    if not whole.all():
        model.skip(f"{int((~whole).sum())} faces", "fewer than 3 corners")
    return corners[np.repeat(whole, sizes)], sizes[whole], _channels(face)[whole]


def _strips(path: Path, strips: _Element | None, count: int, model: Model) -> np.ndarray:
    """Triangles of strips, which -1 parts; every other one is turned over."""
    if strips is None or not strips.rows:
        return np.zeros((0, 3), np.int64)
    corners, sizes = _corners(path, strips)
    _check(path, corners[corners != -1], count)
    found, short = [np.zeros((0, 3), np.int64)], 0
    for whole in np.split(corners, np.cumsum(sizes)[:-1]):
        for strip in np.split(whole, np.flatnonzero(whole == -1)):
            strip = strip[strip != -1]
            if len(strip) < 3:
                short += len(strip) > 0
                continue
            faces = np.column_stack([strip[:-2], strip[1:-1], strip[2:]])
            faces[1::2] = faces[1::2, [1, 0, 2]]
            found.append(faces)
    if short:
        model.skip(f"{short} strips", "fewer than 3 corners")
    faces = np.concatenate(found)
    a, b, c = faces.T
    return faces[(a != b) & (b != c) & (c != a)]


def _channels(element: _Element) -> np.ndarray:
    """Colours of an element's rows from 0 to 255, shape (rows, 4); shape (rows, 0) where it has none."""
    for prefix in ("", "diffuse_"):
        names = [prefix + channel for channel in CHANNELS]
        if all(name in element.scalars for name in names[:3]):
            given = [element.scalars[name] for name in names if name in element.scalars]
            kinds = {one.name: one.kind for one in element.properties}
            scale = 255.0 if kinds[names[0]][0] == "f" else 255.0 / np.iinfo(kinds[names[0]]).max
            out = np.full((element.rows, 4), 255.0)
            out[:, : len(given)] = np.column_stack(given).astype(np.float64) * scale
            return np.clip(np.nan_to_num(out), 0, 255)
    return np.zeros((element.rows, 0))


def _face_colours(vertex: _Element, faces: np.ndarray, own: np.ndarray | None, owners: np.ndarray) -> np.ndarray | None:
    """Colour of each triangle: its face's own, else the mean of its corners', shape (m, 4), uint8; None for none."""
    if own is not None and own.shape[1]:
        return np.round(own[owners]).astype(np.uint8)
    corners = _channels(vertex)
    return np.round(corners[faces].mean(axis=1)).astype(np.uint8) if corners.shape[1] else None
