"""A second reader of OBJ, PLY and STL: whole polygons, never cut, whose areas are Newell's."""

import re
import struct
from pathlib import Path

from .plain import Point, found_of
from .referee import Found

LETTERS = {
    "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d",
    "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "float32": "f",
    "float64": "d", "int64": "q", "uint64": "Q",
}  # fmt: skip


def found_in_obj(path: Path, metres: float = 1.0, up: str = "z") -> list[Found]:
    """Objects of an OBJ file: the faces of each group in each material."""
    vertices: list[Point] = []
    groups: dict[tuple[str, str], list[list[Point]]] = {}
    name, material = path.stem, ""
    text = path.read_bytes().replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
    try:
        lines = text.decode("utf-8-sig").split("\n")
    except UnicodeDecodeError:
        lines = text.decode("latin-1").split("\n")
    for line in lines:
        words = line.split()
        match words[:1]:
            case ["v"]:
                vertices.append([float(word) for word in words[1:4]])
            case ["o" | "g"]:
                name = " ".join(words[1:]) or path.stem
            case ["usemtl"]:
                material = " ".join(words[1:]).strip('"')
            case ["f"]:
                numbers = [int(word.partition("/")[0]) for word in words[1:]]
                face = [vertices[number - 1 if number > 0 else number] for number in numbers]
                groups.setdefault((name, material), []).append(face)
    return found_of([(name, faces) for (name, _), faces in groups.items()], metres, up)


def found_in_ply(path: Path, metres: float = 1.0, up: str = "z") -> list[Found]:
    """The one object of a PLY file."""
    head, _, body = path.read_bytes().partition(b"end_header")
    body = body[2:] if body[:2] == b"\r\n" else body[1:]
    lines = [line.split() for line in re.split(r"[\r\n]+", head.decode("latin-1"))]
    form = next(line[1] for line in lines if line[:1] == ["format"])
    take = _words(body) if form == "ascii" else _values(body, "<" if "little" in form else ">")
    rows: dict[str, list[dict]] = {}
    for place, line in enumerate(lines):
        if line[:1] != ["element"]:
            continue
        following = [one for one in lines[place + 1 :] if one and one[0] in ("property", "element")]
        properties = []
        for one in following:
            if one[0] == "element":
                break
            properties.append(one[1:])
        rows[line[1]] = [_row(properties, take) for _ in range(int(line[2]))]
    points = [[row["x"], row["y"], row["z"]] for row in rows["vertex"]]
    polygons = []
    for row in rows.get("face", []):
        corners = row.get("vertex_indices", row.get("vertex_index"))
        polygons += [[points[int(k)] for k in corners]] if len(corners) > 2 else []
    for row in rows.get("tristrips", []):
        strip: list[int] = []
        for k in row["vertex_indices"]:
            strip = [] if k == -1 else [*strip, int(k)]
            polygons += [[points[j] for j in strip[-3:]]] if len(strip) > 2 else []
    return found_of([(path.name, polygons)], metres, up)


def _words(body: bytes):
    words = iter(body.split())
    return lambda kind: float(next(words))


def _values(body: bytes, order: str):
    at = 0

    def take(kind: str) -> float:
        nonlocal at
        value = struct.unpack_from(order + LETTERS[kind], body, at)[0]
        at += struct.calcsize(LETTERS[kind])
        return value

    return take


def _row(properties: list[list[str]], take) -> dict:
    row = {}
    for one in properties:
        row[one[-1]] = [take(one[2]) for _ in range(int(take(one[1])))] if one[0] == "list" else take(one[0])
    return row


def found_in_stl(path: Path, metres: float = 1.0, up: str = "z") -> list[Found]:
    """Solids of an STL file; a binary file is told by its length."""
    content = path.read_bytes()
    count, rest = divmod(len(content) - 84, 50)
    stated = struct.unpack_from("<I", content, 80)[0] if len(content) >= 84 else 0
    if content[:5].lower() == b"solid" and (rest or stated != count) and b"endsolid" in content:
        solids: list[tuple[str, list[list[Point]]]] = []
        points: list[Point] = []
        for line in content.decode("utf-8", errors="replace").splitlines():
            words = line.split()
            if words[:1] == ["solid"]:
                solids.append((" ".join(words[1:]) or path.name, []))
            elif words[:1] == ["vertex"]:
                points.append([float(word) for word in words[1:]])
            elif words[:1] == ["endloop"]:
                solids[-1][1].append(points)
                points = []
        return found_of(solids, metres, up)
    triangles = []
    for k in range(min(stated, count) if rest else count):
        values = struct.unpack_from("<12f", content, 84 + 50 * k)
        triangles.append([values[3:6], values[6:9], values[9:12]])
    return found_of([(path.name, triangles)], metres, up)
