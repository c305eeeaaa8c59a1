"""A second reader of DXF: group after group, as text or binary, from the description of the format alone.

Polygons stay whole; a POLYLINE that is a net closes where its flags say so, and its smoothed surface counts where it
has one. A block is placed point by point, through every INSERT about it.
"""

import math
import re
import string
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from .plain import Point, found_of
from .referee import Found

# Metres by $INSUNITS, for the units of buildings; all else counts as metres.
METRES = {
    1: 0.0254, 2: 0.3048, 3: 1609.344, 4: 0.001, 5: 0.01, 6: 1.0, 7: 1000.0, 10: 0.9144, 14: 0.1, 15: 10.0, 16: 100.0,
    21: 1200 / 3937, 22: 100 / 3937, 23: 3600 / 3937,
}  # fmt: skip
BINARY = b"AutoCAD Binary DXF\r\n\x1a\x00"
# First and last code of each kind of value in a binary file: a letter of `struct`, s for text, x for counted bytes.
KINDS = (
    (0, 9, "s"), (10, 59, "d"), (60, 79, "h"), (90, 99, "i"), (100, 109, "s"), (110, 149, "d"), (160, 169, "q"),
    (170, 179, "h"), (210, 239, "d"), (270, 289, "h"), (290, 299, "b"), (300, 309, "s"), (310, 319, "x"),
    (320, 369, "s"), (370, 389, "h"), (390, 399, "s"), (400, 409, "h"), (410, 419, "s"), (420, 429, "i"),
    (430, 439, "s"), (440, 459, "i"), (460, 469, "d"), (470, 481, "s"), (999, 1003, "s"), (1004, 1004, "x"),
    (1005, 1009, "s"), (1010, 1059, "d"), (1060, 1070, "h"), (1071, 1071, "i"),
)  # fmt: skip
CODE_PAGES = (874, 932, 936, 949, 950, *range(1250, 1259))
# Bits of group 70 of a POLYLINE, and of its VERTEX.
CLOSED_ROWS, SMOOTH, NET, CLOSED_COLUMNS, POLYFACE = 1, 4, 16, 32, 64
OF_SURFACE, PLACE, FACE = 8, 64, 128
# An extrusion closer to Z than this takes its X axis from Y.
NEAR_Z = 1 / 64
# Blanks that do not break a line.
_BLANKS = re.compile("[\u00a0\u1680\u2000-\u200a\u202f\u205f\u3000]")

Group = tuple[int, bytes]


@dataclass
class _Record:
    """What stands between two groups of code 0: its kind, its groups, and the VERTEX records that follow it."""

    kind: bytes
    groups: list[Group] = field(default_factory=list)
    vertices: list["_Record"] = field(default_factory=list)

    def text(self, code: int, default: bytes = b"") -> bytes:
        return next((value for own, value in self.groups if own == code), default)

    def number(self, code: int, default: float = 0.0) -> float:
        return float(self.text(code) or default)

    def whole(self, code: int, default: int = 0) -> int:
        return int(self.number(code, default))

    def point(self, code: int, default: Point = (0.0, 0.0, 0.0)) -> list[float]:
        """Three numbers, whose codes are 10 apart."""
        return [self.number(code + 10 * k, default[k]) for k in range(3)]


@dataclass(frozen=True)
class _Frame:
    """Where one copy of a block lies: its points less `base`, scaled, turned, moved, and seen from `axes`."""

    base: Point
    scale: Point
    turn: float
    at: Point
    axes: list[list[float]]

    def moved(self, point: Point) -> list[float]:
        x, y, z = (self.scale[k] * (point[k] - self.base[k]) for k in range(3))
        cos, sin = math.cos(self.turn), math.sin(self.turn)
        own = (cos * x - sin * y + self.at[0], sin * x + cos * y + self.at[1], z + self.at[2])
        return [sum(self.axes[j][k] * own[j] for j in range(3)) for k in range(3)]


def found_in_dxf(path: Path, metres: float | None = None, up: str = "z") -> list[Found]:
    """Objects of a DXF file: the faces of each layer of the model space, then those that each placed block has of one.

    Args:
        path: the file.
        metres: length of its unit [m]; None for what $INSUNITS says.
        up: axis that points up, "y" or "z".
    """
    drawing = _Drawing(_records(_groups(path.read_bytes())))
    return found_of(drawing.objects(), drawing.metres() if metres is None else metres, up)


def _groups(content: bytes) -> Iterator[Group]:
    """Code and value of each group up to the end of the file; numbers as text."""
    if content.startswith(BINARY):
        yield from _binary_groups(content[len(BINARY) :])
        return
    lines = content.removeprefix(b"\xef\xbb\xbf").split(b"\n")
    for code, value in zip(lines[::2], lines[1::2], strict=False):
        yield int(code), value.rstrip(b"\r")


def _binary_groups(content: bytes) -> Iterator[Group]:
    # Codes have two bytes, but in old files one, or three of which the first is 255.
    old, at = content[1:2] != b"\0", 0
    while at < len(content):
        if old and content[at] != 255:
            code, at = content[at], at + 1
        else:
            at += old
            code, at = struct.unpack_from("<h", content, at)[0], at + 2
        letter = next(letter for first, last, letter in KINDS if first <= code <= last)
        if letter == "s":
            end = content.index(b"\0", at)
            yield code, content[at:end]
            at = end + 1
            if code == 0 and content[at - 4 : at] == b"EOF\0":
                return
        elif letter == "x":
            at += 1 + content[at]
        else:
            yield code, repr(struct.unpack_from("<" + letter, content, at)[0]).encode()
            at += struct.calcsize("<" + letter)


def _records(groups: Iterable[Group]) -> Iterator[_Record]:
    record = None
    for code, value in groups:
        if code == 0:
            if record:
                yield record
            if value.strip() == b"EOF":
                return
            record = _Record(value.strip())
        elif record and code != 999:
            record.groups.append((code, value))


class _Drawing:
    def __init__(self, records: Iterable[_Record]):
        self.header: dict[bytes, bytes] = {}
        self.hidden: set[str] = set()
        self.blocks: dict[str, tuple[Point, list[_Record]]] = {}
        self.space: list[_Record] = []
        section, into, corners = b"", None, None
        for record in records:
            if record.kind == b"SECTION":
                section = record.text(2).strip()
                into = self.space if section == b"ENTITIES" else None
                if section == b"HEADER":
                    # The value of a variable is the group after its name.
                    for (code, name), (_, value) in zip(record.groups, record.groups[1:], strict=False):
                        if code == 9:
                            self.header[name.strip()] = value.strip()
            elif record.kind == b"LAYER" and section == b"TABLES":
                # A negative colour turns a layer off, bit 1 freezes it.
                if record.number(62) < 0 or record.whole(70) & 1:
                    self.hidden.add(self.words(record, 2).lower())
            elif record.kind == b"BLOCK" and section == b"BLOCKS":
                into = []
                self.blocks[self.words(record, 2).lower()] = record.point(10), into
            elif record.kind == b"ENDBLK":
                into = None
            elif record.kind == b"VERTEX":
                if corners is not None:
                    corners.append(record)
            elif into is not None:
                corners = record.vertices if record.kind == b"POLYLINE" else None
                if record.whole(67) != 1 or into is not self.space:  # 1 is paper
                    into.append(record)

    def metres(self) -> float:
        """Length of the drawing's unit [m]."""
        return METRES.get(int(self.header.get(b"$INSUNITS", b"0")), 1.0)

    def words(self, record: _Record, code: int, default: bytes = b"") -> str:
        """A text in the file's own coding; before R2007 with numbers for the signs that this lacks."""
        coding, old = "utf-8", self.header.get(b"$ACADVER", b"AC1009") < b"AC1021"
        if old:
            page = self.header.get(b"$DWGCODEPAGE", b"").decode("latin-1").rpartition("_")[2]
            coding = f"cp{page}" if page in map(str, CODE_PAGES) else "cp1252"
        text = record.text(code, default).decode(coding, errors="surrogateescape")
        return _spelt(text) if old else text

    def objects(self) -> Iterator[tuple[str, list[list[Point]]]]:
        """Name and polygons of each object."""
        loose: dict[str, list[list[Point]]] = {}
        self.gather([one for one in self.space if one.kind != b"INSERT"], [], "", loose)
        yield from loose.items()
        for insert in self.space:
            if insert.kind != b"INSERT":
                continue
            name = self.words(insert, 2)
            for frame, inside in self.copies(insert):
                held: dict[str, list[list[Point]]] = {}
                self.gather(inside, [frame], self.layer(insert, ""), held)
                for layer, polygons in held.items():
                    yield (name if len(held) == 1 else f"{name}: {layer}"), polygons

    def gather(
        self, records: list[_Record], frames: list[_Frame], outer: str, into: dict[str, list[list[Point]]]
    ) -> None:
        """Add the polygons of entities to those of their layers.

        Args:
            records: the entities.
            frames: where the block that holds them lies, outermost first.
            outer: layer of the INSERT that places it, for entities of layer 0.
            into: polygons by layer.
        """
        for record in records:
            layer = self.layer(record, outer)
            if record.kind == b"INSERT":
                for frame, inside in self.copies(record):
                    self.gather(inside, [*frames, frame], layer, into)
            elif layer.lower() not in self.hidden:
                for polygon in _polygons(record):
                    for frame in reversed(frames):
                        polygon = [frame.moved(point) for point in polygon]
                    if len(set(map(tuple, polygon))) > 2:
                        into.setdefault(layer, []).append(polygon)

    def layer(self, record: _Record, outer: str) -> str:
        """An entity's layer; layer 0 of a block is that of its INSERT."""
        own = self.words(record, 8, b"0")
        return outer if own == "0" and outer else own

    def copies(self, insert: _Record) -> Iterator[tuple[_Frame, list[_Record]]]:
        """Where each copy of a block lies that an INSERT places, and what the block holds; rows step along its Y."""
        name = self.words(insert, 2).lower()
        if name not in self.blocks:
            return
        base, inside = self.blocks[name]
        scale = [insert.number(code, 1.0) or 1.0 for code in (41, 42, 43)]
        turn, at = math.radians(insert.number(50)), insert.point(10)
        axes = _axes(insert.point(210, (0.0, 0.0, 1.0)))
        across, along = insert.number(44), insert.number(45)
        # Copies without a distance between them are one.
        columns = max(1, insert.whole(70, 1)) if across else 1
        rows = max(1, insert.whole(71, 1)) if along else 1
        for row in range(rows):
            for column in range(columns):
                x, y = column * across, row * along
                step = math.cos(turn) * x - math.sin(turn) * y, math.sin(turn) * x + math.cos(turn) * y
                yield _Frame(base, scale, turn, [at[0] + step[0], at[1] + step[1], at[2]], axes), inside


def _spelt(text: str) -> str:
    r"""The text with what \U+ and four digits stand for; those in a row stay if they are no text on one line."""
    first, *rest = text.split("\\U+")
    out, units, written = [first], [], ""
    for part in rest:
        if len(part) < 4 or set(part[:4]) - set(string.hexdigits):
            out += [_of_units(units, written), "\\U+", part]
            units, written = [], ""
            continue
        units, written = [*units, int(part[:4], 16)], f"{written}\\U+{part[:4]}"
        if part[4:]:
            out += [_of_units(units, written), part[4:]]
            units, written = [], ""
    return "".join([*out, _of_units(units, written)])


def _of_units(units: list[int], written: str) -> str:
    """The text of units of UTF-16; as written if it has half a pair, or what is neither printed nor a blank."""
    text = struct.pack(f"<{len(units)}H", *units).decode("utf-16-le", errors="replace")
    halves = text.count("\ufffd") != units.count(0xFFFD)
    return written if halves or not "".join(_BLANKS.split(text)).isprintable() else text


def _axes(extrusion: Point) -> list[list[float]]:
    """The axes of an entity's own frame, told from its extrusion: Y or Z crossed with it is X."""
    length = math.hypot(*extrusion)
    z = [value / length for value in extrusion] if length else [0.0, 0.0, 1.0]
    x = _cross([0.0, 1.0, 0.0] if abs(z[0]) < NEAR_Z and abs(z[1]) < NEAR_Z else [0.0, 0.0, 1.0], z)
    x = [value / math.hypot(*x) for value in x]
    return [x, _cross(z, x), z]


def _cross(a: Point, b: Point) -> list[float]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _polygons(record: _Record) -> Iterator[list[Point]]:
    """Corners of each face of an entity, as written; nothing for what has no faces."""
    if record.kind == b"3DFACE":
        third = record.point(12)
        yield [record.point(10), record.point(11), third, record.point(13, third)]
    elif record.kind == b"MESH":
        yield from _of_mesh(record)
    elif record.kind == b"POLYLINE" and record.whole(70) & POLYFACE:
        places = [one.point(10) for one in record.vertices if one.whole(70) & FACE and one.whole(70) & PLACE]
        for one in record.vertices:
            if one.whole(70) & FACE and not one.whole(70) & PLACE:
                # A negative number hides the edge that begins there; 0 is no corner.
                yield [places[abs(k) - 1] for k in (one.whole(code) for code in (71, 72, 73, 74)) if k]
    elif record.kind == b"POLYLINE" and record.whole(70) & NET:
        yield from _of_net(record)


def _of_net(record: _Record) -> Iterator[list[Point]]:
    """The quads of a net, row after row; of the smoothed surface where there is one."""
    flags, rows, columns = record.whole(70), record.whole(71), record.whole(72)
    places = [one.point(10) for one in record.vertices]
    smooth = [one.point(10) for one in record.vertices if one.whole(70) & OF_SURFACE]
    if flags & SMOOTH and smooth and len(smooth) == record.whole(73) * record.whole(74):
        places, rows, columns = smooth, record.whole(73), record.whole(74)
    for i in range(rows if flags & CLOSED_ROWS else rows - 1):
        for j in range(columns if flags & CLOSED_COLUMNS else columns - 1):
            ring = ((i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j))
            yield [places[(a % rows) * columns + b % columns] for a, b in ring]


def _of_mesh(record: _Record) -> Iterator[list[Point]]:
    """The faces of a MESH, not smoothed: group 92 counts vertices, 93 the numbers of its list of faces."""
    codes = [code for code, _ in record.groups]
    begin = codes.index(92) + 1
    count = record.whole(92)
    flat = [float(value) for code, value in record.groups[begin:] if code in (10, 20, 30)][: 3 * count]
    points = [flat[k : k + 3] for k in range(0, 3 * count, 3)]
    begin = codes.index(93) + 1
    numbers = [int(value) for code, value in record.groups[begin : begin + record.whole(93)]]
    while numbers:
        size = numbers[0]
        yield [points[k] for k in numbers[1 : 1 + size]]
        numbers = numbers[1 + size :]
