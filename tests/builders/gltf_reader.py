"""Reads binary glTF from its bytes alone: what every node draws, in a frame with Z up."""

import json
import struct

import numpy as np

TYPES = {5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC3": 3}
# Y up to Z up: x, y, z becomes x, -z, y.
UPRIGHT = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


def split(data):
    """The document and the binary part of a GLB."""
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data)) and length % 4 == 0
    chunks, at = {}, 12
    while at < length:
        size, kind = struct.unpack_from("<I4s", data, at)
        chunks[kind] = data[at + 8 : at + 8 + size]
        at += 8 + size
    assert at == length
    return json.loads(chunks[b"JSON"]), chunks.get(b"BIN\0", b"")


def values(document, buffers, number):
    accessor = document["accessors"][number]
    view = document["bufferViews"][accessor["bufferView"]]
    width, kind = WIDTHS[accessor["type"]], np.dtype(TYPES[accessor["componentType"]])
    assert view["byteOffset"] % 4 == 0 and accessor["count"] * width * kind.itemsize == view["byteLength"]
    found = np.frombuffer(buffers[view["buffer"]], kind, accessor["count"] * width, view["byteOffset"]).reshape(
        -1, width
    )
    if "min" in accessor:
        assert np.array_equal(found.min(axis=0), accessor["min"]) and np.array_equal(found.max(axis=0), accessor["max"])
    return found


def local(node):
    """A node's own matrix, in float64."""
    out = np.eye(4)
    if "matrix" in node:
        out = np.array(node["matrix"], float).reshape(4, 4).T
        lengths = np.linalg.norm(out[:3, :3], axis=0)
        # The format allows rotation and scale only.
        assert np.allclose((out[:3, :3] / lengths).T @ (out[:3, :3] / lengths), np.eye(3), atol=1e-5)
    out[:3, 3] += node.get("translation", (0, 0, 0))
    return out


def drawn(data):
    """What each node of a GLB draws; see `drawn_by`."""
    document, binary = split(data)
    return drawn_by(document, [binary])


def drawn_by(document, buffers):
    """(node, triangles (n, 3, 3) [m], base colour of each (n, 4)) of each node that stands for an object."""
    out = []
    assert [entry["byteLength"] for entry in document.get("buffers", [])] == [len(data) for data in buffers if data]

    def visit(number, above):
        node = document["nodes"][number]
        matrix = above @ local(node)
        triangles, colours = [np.zeros((0, 3, 3))], [np.zeros((0, 4))]
        for part in document["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []:
            points = values(document, buffers, part["attributes"]["POSITION"]).astype(float)
            corners = (points @ matrix[:3, :3].T + matrix[:3, 3]) @ UPRIGHT.T
            triangles.append(corners[values(document, buffers, part["indices"]).ravel()].reshape(-1, 3, 3))
            colour = document["materials"][part["material"]]["pbrMetallicRoughness"]["baseColorFactor"]
            colours.append(np.repeat([colour], len(triangles[-1]), axis=0))
        if "id" in node.get("extras", {}):
            out.append((node, np.concatenate(triangles), np.concatenate(colours)))
        for child in node.get("children", []):
            visit(child, matrix)

    for root in document["scenes"][document["scene"]]["nodes"]:
        visit(root, np.eye(4))
    return out
