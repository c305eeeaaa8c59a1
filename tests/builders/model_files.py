"""A house of twelve boxes in every format that a mesh reader takes, made in memory."""

import base64
import io
import json
import struct

import numpy as np

# Metres, Z up: least and greatest corner.
HOUSE = {
    "floor": ((0, 0, -0.25), (8, 4, 0)),
    "roof": ((0, 0, 3), (8, 4, 3.25)),
    "wall south": ((0, -0.25, -0.25), (8, 0, 3.25)),
    "wall north": ((0, 4, -0.25), (8, 4.25, 3.25)),
    "wall west": ((-0.25, -0.25, -0.25), (0, 4.25, 3.25)),
    "wall east": ((8, -0.25, -0.25), (8.25, 4.25, 3.25)),
    "mid low": ((3.75, 0, 0), (4, 0.5, 3)),
    "mid high": ((3.75, 1.5, 0), (4, 4, 3)),
    "mid lintel": ((3.75, 0.5, 2), (4, 1.5, 3)),
    "box a": ((0.5, 3, 0), (1, 3.5, 1)),
    "box b": ((4.5, 3, 0), (5, 3.5, 1)),
    "box c": ((7, 0.5, 0), (7.5, 1, 1)),
}
HOUSE_AREA = 367.5
QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])


def box_corners(low, high) -> np.ndarray:
    """Corners of a box, z fastest, shape (8, 3)."""
    ends = np.array([low, high], np.float64)
    return np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def box_triangles() -> np.ndarray:
    return QUADS[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)


def gltf_parts(boxes=None) -> tuple[dict, bytearray]:
    """A glTF document, Y up, with a node and a mesh for each box, and its buffer."""
    boxes = HOUSE if boxes is None else boxes
    out = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(range(len(boxes)))}]}
    out |= {"nodes": [], "meshes": [], "accessors": [], "bufferViews": []}
    data = bytearray()
    for name, (low, high) in boxes.items():
        x, y, z = box_corners(low, high).T
        position = add_accessor(out, data, np.column_stack([x, z, -y]).astype(np.float32), "VEC3")
        index = add_accessor(out, data, box_triangles().astype(np.uint16).reshape(-1, 1), "SCALAR")
        out["nodes"].append({"mesh": len(out["meshes"]), "name": name})
        out["meshes"].append({"primitives": [{"attributes": {"POSITION": position}, "indices": index}], "name": name})
    return out, data


KINDS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}


def add_view(out: dict, data: bytearray, content: bytes, **more) -> int:
    """A new buffer view of the content."""
    data += bytes(-len(data) % 4)
    out["bufferViews"].append({"buffer": 0, "byteOffset": len(data), "byteLength": len(content), **more})
    data += content
    return len(out["bufferViews"]) - 1


def add_accessor(out: dict, data: bytearray, values: np.ndarray, kind: str, **more) -> int:
    """A new accessor of the values, shape (count, width)."""
    view = add_view(out, data, np.ascontiguousarray(values).tobytes())
    component = KINDS[values.dtype.str[1:]]
    out["accessors"].append(
        {"bufferView": view, "componentType": component, "count": len(values), "type": kind, **more}
    )
    return len(out["accessors"]) - 1


def gltf(out: dict, data: bytes) -> bytes:
    """A .gltf file with its buffer within."""
    uri = "data:application/octet-stream;base64," + base64.b64encode(bytes(data)).decode()
    return json.dumps(out | {"buffers": [{"byteLength": len(data), "uri": uri}]}).encode()


def glb(out: dict, data: bytes) -> bytes:
    """A .glb file."""
    text = json.dumps(out | {"buffers": [{"byteLength": len(data)}]}).encode()
    text += b" " * (-len(text) % 4)
    data = bytes(data) + bytes(-len(data) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4s2I", b"glTF", 2, 12 + len(body)) + body


def with_draco(out: dict, data: bytearray) -> None:
    """Pack every primitive with Draco."""
    import DracoPy

    for mesh in out["meshes"]:
        (primitive,) = mesh["primitives"]
        accessor = out["accessors"][primitive["attributes"]["POSITION"]]
        view = out["bufferViews"][accessor.pop("bufferView")]
        points = np.frombuffer(bytes(data), np.float32, 24, view["byteOffset"]).reshape(8, 3)
        out["accessors"][primitive["indices"]].pop("bufferView")
        packed = DracoPy.encode(points, box_triangles(), quantization_bits=16)
        extension = {"bufferView": add_view(out, data, packed), "attributes": {"POSITION": 0}}
        primitive["extensions"] = {"KHR_draco_mesh_compression": extension}
    out["extensionsUsed"] = out["extensionsRequired"] = ["KHR_draco_mesh_compression"]


def obj(boxes=None, head: str = "", material: str = "") -> bytes:
    """An OBJ file of quads, one object each."""
    lines, start = [head] if head else [], 1
    for name, (low, high) in (HOUSE if boxes is None else boxes).items():
        lines += [f"o {name}"] + ([f"usemtl {material}"] if material else [])
        lines += ["v {:g} {:g} {:g}".format(*corner) for corner in box_corners(low, high)]
        lines += ["f {} {} {} {}".format(*(quad + start)) for quad in QUADS]
        start += 8
    return ("\n".join(lines) + "\n").encode()


def house_points() -> np.ndarray:
    """Corners of all boxes, shape (96, 3)."""
    return np.concatenate([box_corners(*ends) for ends in HOUSE.values()])


def house_quads() -> np.ndarray:
    """Quads of all boxes, shape (72, 4)."""
    return np.concatenate([QUADS + 8 * k for k in range(len(HOUSE))])


def ply(order: str = "ascii", points=None, polygons=None, colours=None) -> bytes:
    """A PLY file of polygons; `order` is "ascii", "<" or ">"; colours of the vertices, 0 to 255."""
    points = house_points() if points is None else np.asarray(points, np.float64)
    polygons = house_quads() if polygons is None else polygons
    form = {"ascii": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]
    shades = "" if colours is None else "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    head = f"ply\nformat {form} 1.0\ncomment made for a test\nelement vertex {len(points)}\n"
    head += "property float x\nproperty float y\nproperty float z\n" + shades
    head += f"element face {len(polygons)}\nproperty list uchar int vertex_indices\nend_header\n"
    if order == "ascii":
        rows = [" ".join(f"{value:g}" for value in point) for point in points]
        if colours is not None:
            rows = [f"{row} {r} {g} {b}" for row, (r, g, b) in zip(rows, colours, strict=True)]
        rows += [" ".join(map(str, (len(polygon), *polygon))) for polygon in polygons]
        return (head + "\n".join(rows) + "\n").encode()
    body = b""
    for k, point in enumerate(points):
        body += struct.pack(order + "3f", *point) + (bytes(colours[k]) if colours is not None else b"")
    for polygon in polygons:
        body += struct.pack(f"{order}B{len(polygon)}i", len(polygon), *polygon)
    return head.encode() + body


def stl(binary: bool = True, head: bytes = b"made for a test") -> bytes:
    """An STL file of triangles; as text a solid for each box."""
    triangles = np.concatenate([box_corners(*ends)[box_triangles()] for ends in HOUSE.values()]).astype(np.float32)
    if binary:
        body = b"".join(bytes(12) + one.tobytes() + b"\0\0" for one in triangles)
        return head.ljust(80) + struct.pack("<I", len(triangles)) + body
    lines = []
    for k, name in enumerate(HOUSE):
        lines.append(f"solid {name}")
        for one in triangles[12 * k : 12 * k + 12]:
            lines += ["  facet normal 0 0 0", "    outer loop"]
            lines += ["      vertex {:g} {:g} {:g}".format(*corner) for corner in one]
            lines += ["    endloop", "  endfacet"]
        lines.append(f"endsolid {name}")
    return ("\n".join(lines) + "\n").encode()


def dxf(draw, units: int = 6, version: str = "R2010") -> bytes:
    """A DXF file; `draw` gets the drawing."""
    import ezdxf

    drawing = ezdxf.new(version)
    drawing.header["$INSUNITS"] = units
    draw(drawing)
    text = io.StringIO()
    drawing.write(text)
    return text.getvalue().encode()


def draw_house(drawing) -> None:
    """Each box as 3DFACEs on a layer of its own, the first as a MESH, the last as a block."""
    space = drawing.modelspace()
    names = list(HOUSE)
    for name, (low, high) in HOUSE.items():
        drawing.layers.add(name, color=1)
        points = [tuple(map(float, corner)) for corner in box_corners(low, high)]
        if name == names[0]:
            with space.add_mesh(dxfattribs={"layer": name}).edit_data() as mesh:
                mesh.vertices, mesh.faces = points, [list(map(int, quad)) for quad in QUADS]
        elif name == names[-1]:
            block = drawing.blocks.new(name)
            for quad in QUADS:
                block.add_3dface([np.subtract(points[k], low) for k in quad])
            space.add_blockref(name, low, dxfattribs={"layer": name})
        else:
            for quad in QUADS:
                space.add_3dface([points[k] for k in quad], dxfattribs={"layer": name})


def bsp(boxes=None, textures=None, entities=(), version=29, origins=None) -> bytes:
    """A compiled map, 32 units a metre, whose models are boxes: the world first, then those of the entities.

    Args:
        boxes: for each model, a dict of boxes by name.
        textures: by the box's name; "wall" where there is none.
        entities: classes of the models after the first.
        version: 29, 30, b"BSP2" or b"2PSB".
        origins: place of an entity by the number of its model, in map units, as text.
    """
    boxes, textures = [HOUSE] if boxes is None else boxes, textures or {}
    wide = isinstance(version, bytes)
    names = sorted({textures.get(name, "wall") for one in boxes for name in one})
    vertices, edges, turns, faces, models = [], [struct.pack("<2I" if wide else "<2H", 0, 0)], [], [], []
    for one in boxes:
        first = len(faces)
        for name, ends in one.items():
            start = len(vertices)
            vertices += [struct.pack("<3f", *(32 * corner)) for corner in box_corners(*ends)]
            for quad in QUADS:
                where = len(turns)
                for a, b in zip(quad, np.roll(quad, -1), strict=True):
                    pair, backwards = (a, b), len(turns) % 2
                    edges.append(
                        struct.pack("<2I" if wide else "<2H", *(start + k for k in pair[:: -1 if backwards else 1]))
                    )
                    turns.append(struct.pack("<i", -(len(edges) - 1) if backwards else len(edges) - 1))
                use = names.index(textures.get(name, "wall"))
                faces.append(struct.pack("<5i8x" if wide else "<2Hi2H8x", 0, 0, where, 4, use))
        models.append(struct.pack("<9f7i", *[0] * 9, 0, 0, 0, 0, 0, first, len(faces) - first))
    pictures = struct.pack("<i", len(names))
    pictures += b"".join(struct.pack("<i", 4 + 4 * len(names) + 40 * k) for k in range(len(names)))
    pictures += b"".join(name.encode().ljust(16, b"\0") + bytes(24) for name in names)
    text = '{\n"classname" "worldspawn"\n}\n'
    for k, kind in enumerate(entities, start=1):
        place = f'"origin" "{origins[k]}"\n' if k in (origins or {}) else ""
        text += f'{{\n"classname" "{kind}"\n"model" "*{k}"\n{place}}}\n'
    uses = b"".join(struct.pack("<8f2i", *[0] * 8, k, 0) for k in range(len(names)))
    parts = {0: text.encode() + b"\0", 2: pictures, 3: b"".join(vertices), 6: uses, 7: b"".join(faces)}
    parts |= {12: b"".join(edges), 13: b"".join(turns), 14: b"".join(models)}
    head, body = version if wide else struct.pack("<i", version), b""
    for number in range(15):
        part = parts.get(number, b"")
        head += struct.pack("<2i", 4 + 8 * 15 + len(body), len(part))
        body += part
    return head + body


def draco_glb() -> bytes:
    """The house, packed by Draco."""
    out, data = gltf_parts()
    with_draco(out, data)
    return glb(out, data)


# Content by a name that tells the kind.
FILES = {
    "text.gltf": lambda: gltf(*gltf_parts()),
    "binary.glb": lambda: glb(*gltf_parts()),
    "draco.glb": draco_glb,
    "quads.obj": obj,
    "text.ply": ply,
    "little.ply": lambda: ply("<"),
    "big.ply": lambda: ply(">"),
    "binary.stl": stl,
    "text.stl": lambda: stl(binary=False),
    "drawing.dxf": lambda: dxf(draw_house),
    "map.bsp": bsp,
}
