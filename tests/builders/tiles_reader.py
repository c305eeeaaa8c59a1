"""What an exported tileset, and its draft in glTF, show to an eye: walked as their texts say, and nothing else."""

import json
from functools import cache

import numpy as np

from builders import gltf_reader


@cache
def read(file):
    return json.loads(file.read_text(encoding="utf-8"))


@cache
def contents(file):
    """Ids of the objects in a glTF document and its files, and their triangles in its own frame, Z up."""
    document = read(file)
    buffers = [(file.parent / entry["uri"]).read_bytes() for entry in document.get("buffers", [])]
    return {node["extras"]["id"]: triangles for node, triangles, _ in gltf_reader.drawn_by(document, buffers)}


def placed(point, matrix):
    return np.linalg.solve(matrix, [*point, 1.0])[:3]


def in_box(numbers, point):
    """Whether a box of 3D Tiles holds a point: middle, then three half edges."""
    middle, half = np.array(numbers[:3]), np.array(numbers[3:]).reshape(3, 3)
    return bool((np.abs(np.linalg.solve(half.T, point - middle)) <= 1).all())


def shown_by_tiles(folder, point):
    """What tileset.json shows to an eye at a point of the model.

    Returns (triangles, all boxes that should hold them) by object id, in the tileset's frame, and that frame.
    """
    root = read(folder / "tileset.json")["root"]
    matrix = np.array(root["transform"]).reshape(4, 4).T
    eye, shown = placed(point, matrix), {}

    def visit(tile, base, above):
        if "viewerRequestVolume" in tile and not in_box(tile["viewerRequestVolume"]["box"], eye):
            return
        boxes = [*above, tile["boundingVolume"]["box"]]
        uri = tile.get("content", {}).get("uri", "")
        if uri.endswith(".json"):
            assert "children" not in tile
            inner = read(base / uri)
            assert inner["asset"]["version"] == "1.1" and inner["geometricError"] <= tile["geometricError"]
            visit(inner["root"], (base / uri).parent, boxes)
        elif uri:
            for number, triangles in contents(base / uri).items():
                shown[number] = (triangles, boxes)
        for child in tile.get("children", []):
            assert child["geometricError"] <= tile["geometricError"]
            visit(child, base, boxes)

    visit(root, folder, [])
    return shown, matrix


def shown_by_draft(folder, point):
    """Ids of the objects that draft.gltf shows to a camera at a point of the model."""
    return set(_visited(folder, "draft.gltf", np.array([point[0], point[2], -point[1]]), np.eye(4)))


def _visited(folder, name, eye, above):
    document = read(folder / name)
    assert document["asset"]["minVersion"] == "2.1" and "draft" in document["asset"]["extras"]

    def visit(number, above):
        node = document["nodes"][number]
        matrix = above @ gltf_reader.local(node)
        visibility = node.get("extensions", {}).get("KHR_node_visibility")
        if visibility is not None:
            assert {"KHR_node_visibility", "EXT_node_visibility_volume"} <= set(document["extensionsRequired"])
            volume = visibility["extensions"]["EXT_node_visibility_volume"]["boundingVolume"]
            size = document["shapes"][volume["shape"]]["box"]["size"]
            if (
                visibility["visible"]
                or (np.abs(placed(eye, matrix) - volume["translation"]) > np.array(size) / 2).any()
            ):
                return
        if "externalAsset" in node:
            uri = document["files"][document["externalAssets"][node["externalAsset"]]["file"]]["uri"]
            if "asset" in read(folder / uri) and "files" in read(folder / uri):
                yield from _visited(folder, uri, eye, matrix)
            else:
                yield from contents(folder / uri)
        for child in node.get("children", []):
            yield from visit(child, matrix)

    for root in document["scenes"][document["scene"]]["nodes"]:
        yield from visit(root, above)
