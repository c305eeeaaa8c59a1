"""A second reader of glTF: one value after another, triangle by triangle, from the specification alone.

Draco is unpacked by the library that the first reader uses, for there is no other.
"""

import base64
import json
import struct
import urllib.parse
from collections.abc import Iterator
from pathlib import Path

from .plain import Point, found_of
from .referee import Found

Matrix = list[list[float]]
# Letter of `struct`, bytes, and the greatest value of each type of component.
KINDS = {5120: ("b", 1, 127), 5121: ("B", 1, 255), 5122: ("h", 2, 32767), 5123: ("H", 2, 65535)}
KINDS |= {5125: ("I", 4, 2**32 - 1), 5126: ("f", 4, 1)}
WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
IDENTITY = [[float(i == j) for j in range(4)] for i in range(4)]


def found_in_gltf(path: Path, metres: float = 1.0, up: str = "y") -> list[Found]:
    """Objects of a glTF file, one for each node and material."""
    return found_of(_Document(path).objects(), metres, up)


class _Document:
    def __init__(self, path: Path):
        content, self.binary = path.read_bytes(), b""
        if content.startswith(b"glTF"):
            size = int.from_bytes(content[12:16], "little")
            rest = content[20 + size :]
            self.binary = rest[8 : 8 + int.from_bytes(rest[:4], "little")]
            content = content[20 : 20 + size]
        self.json, self.path = json.loads(content.decode("utf-8-sig")), path

    def bytes_of(self, view: dict) -> bytes:
        uri = self.json["buffers"][view["buffer"]].get("uri")
        if uri is None:
            data = self.binary
        elif uri.startswith("data:"):
            data = base64.b64decode(uri.split(",", 1)[1])
        else:
            data = (self.path.parent / urllib.parse.unquote(uri)).read_bytes()
        begin = view.get("byteOffset", 0)
        return data[begin : begin + view["byteLength"]]

    def values(self, index: int) -> list[list[float]]:
        """Elements of an accessor, normalized if it says so."""
        accessor = self.json["accessors"][index]
        letter, size, most = KINDS[accessor["componentType"]]
        width, count = WIDTH[accessor["type"]], accessor["count"]
        out = [[0] * width for _ in range(count)]
        if "bufferView" in accessor:
            out = self._rows(accessor["bufferView"], accessor.get("byteOffset", 0), count, width, letter, size)
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            where, what = sparse["indices"], sparse["values"]
            kind, bytes_each, _ = KINDS[where["componentType"]]
            at = self._rows(where["bufferView"], where.get("byteOffset", 0), sparse["count"], 1, kind, bytes_each)
            new = self._rows(what["bufferView"], what.get("byteOffset", 0), sparse["count"], width, letter, size)
            for (place,), row in zip(at, new, strict=True):
                out[place] = row
        if accessor.get("normalized") and letter != "f":
            out = [[max(value / most, -1.0) for value in row] for row in out]
        return out

    def _rows(self, view: int, begin: int, count: int, width: int, letter: str, size: int) -> list[list[float]]:
        buffer_view = self.json["bufferViews"][view]
        data, step = self.bytes_of(buffer_view), buffer_view.get("byteStride") or width * size
        return [list(struct.unpack_from(f"<{width}{letter}", data, begin + step * k)) for k in range(count)]

    def objects(self) -> Iterator[tuple[str, list[list[Point]]]]:
        """Name and triangles of each object, nodes depth first."""
        nodes = self.json.get("nodes", [])
        below = {child for node in nodes for child in node.get("children", [])}
        roots = [k for k in range(len(nodes)) if k not in below]
        if self.json.get("scenes"):
            roots = self.json["scenes"][self.json.get("scene", 0)].get("nodes", [])
        stack = [(k, IDENTITY) for k in reversed(roots)]
        while stack:
            index, outer = stack.pop()
            node = nodes[index]
            if node.get("extensions", {}).get("KHR_node_visibility", {}).get("visible", True) is False:
                continue
            place = _times(outer, _frame(node))
            if "mesh" in node and "skin" not in node:
                yield from self._of_node(index, node, place)
            stack += [(k, place) for k in reversed(node.get("children", []))]

    def _of_node(self, index: int, node: dict, place: Matrix) -> Iterator[tuple[str, list[list[Point]]]]:
        mesh = self.json["meshes"][node["mesh"]]
        name = node.get("name") or mesh.get("name") or f"node {index}"
        weights = node.get("weights") or mesh.get("weights") or []
        parts: dict[object, list[list[Point]]] = {}
        for primitive in mesh["primitives"]:
            triangles = self._triangles(primitive, weights)
            if triangles:
                parts.setdefault(primitive.get("material"), []).extend(triangles)
        spread = node.get("extensions", {}).get("EXT_mesh_gpu_instancing")
        frames = [(name, place)]
        if spread:
            rows = {key: self.values(accessor) for key, accessor in spread["attributes"].items() if key[0] != "_"}
            count = len(next(iter(rows.values())))
            frames = []
            for k in range(count):
                one = {key.lower(): rows[key][k] for key in ("TRANSLATION", "ROTATION", "SCALE") if key in rows}
                frames.append((f"{name} #{k + 1}", _times(place, _frame(one))))
        for own, frame in frames:
            for material, triangles in parts.items():
                label = "no material" if material is None else self.json["materials"][material].get("name")
                whole = own if len(parts) == 1 else f"{own}: {label or f'material {material}'}"
                yield whole, [[_moved(frame, point) for point in triangle] for triangle in triangles]

    def _triangles(self, primitive: dict, weights: list[float]) -> list[list[Point]]:
        mode = primitive.get("mode", 4)
        draco = primitive.get("extensions", {}).get("KHR_draco_mesh_compression")
        if mode < 4 or "POSITION" not in primitive["attributes"]:
            return []
        if draco:
            import DracoPy

            mesh = DracoPy.decode(self.bytes_of(self.json["bufferViews"][draco["bufferView"]]))
            return [[[float(x) for x in mesh.points[k]] for k in face] for face in mesh.faces]
        points = self.values(primitive["attributes"]["POSITION"])
        for target, weight in zip(primitive.get("targets", []), weights, strict=False):
            if weight and "POSITION" in target:
                moves = self.values(target["POSITION"])
                points = [
                    [p + weight * m for p, m in zip(a, b, strict=True)] for a, b in zip(points, moves, strict=True)
                ]
        corners = range(len(points))
        if "indices" in primitive:
            corners = [row[0] for row in self.values(primitive["indices"])]
        if mode == 4:
            faces = [corners[k : k + 3] for k in range(0, len(corners) - 2, 3)]
        elif mode == 5:
            faces = [corners[k : k + 3] for k in range(len(corners) - 2)]
        else:
            faces = [(corners[0], corners[k], corners[k + 1]) for k in range(1, len(corners) - 1)]
        return [[points[k] for k in face] for face in faces]


def _frame(node: dict) -> Matrix:
    """A node's matrix, rows first."""
    if "matrix" in node:
        return [[float(node["matrix"][4 * column + row]) for column in range(4)] for row in range(4)]
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    length = (x * x + y * y + z * z + w * w) ** 0.5 or 1.0
    # The columns are what the quaternion makes of the axes: q v q*.
    columns = []
    for axis, factor in zip(range(3), node.get("scale", (1, 1, 1)), strict=True):
        v = [float(k == axis) for k in range(3)]
        a, b, c, d = x / length, y / length, z / length, w / length
        t = [2 * (b * v[2] - c * v[1]), 2 * (c * v[0] - a * v[2]), 2 * (a * v[1] - b * v[0])]
        turned = [
            v[0] + d * t[0] + b * t[2] - c * t[1],
            v[1] + d * t[1] + c * t[0] - a * t[2],
            v[2] + d * t[2] + a * t[1] - b * t[0],
        ]
        columns.append([factor * value for value in turned])
    at = node.get("translation", (0, 0, 0))
    return [[columns[0][k], columns[1][k], columns[2][k], float(at[k])] for k in range(3)] + [[0.0, 0.0, 0.0, 1.0]]


def _times(a: Matrix, b: Matrix) -> Matrix:
    return [[sum(a[i][k] * b[k][j] for k in range(4)) for j in range(4)] for i in range(4)]


def _moved(matrix: Matrix, point: Point) -> list[float]:
    return [sum(matrix[i][k] * point[k] for k in range(3)) + matrix[i][3] for i in range(3)]
