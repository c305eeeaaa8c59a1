"""The model as binary glTF 2.0: a mesh per definition, a node per object, ids and GUIDs in `extras`.

trimesh writes glTF too, but gives each mesh one material and a copy of its vertices: here instances of one definition
share them whatever their faces' colours or roles are.
"""

import json
import struct
from collections.abc import Sequence

import numpy as np

from ...data.buildings.glb import COLOURS, Z_UP_TO_Y_UP, material_name
from ...data.scene import Mesh, Scene
from ...data.store.bake_folder import BakeFolder
from ...data.version import __version__
from .sets import model_of, placement

GLB_HEAD, CHUNK_HEAD = struct.Struct("<4sII"), struct.Struct("<I4s")
FLOAT, UNSIGNED_SHORT, UNSIGNED_INT = 5126, 5123, 5125
VERTICES, INDICES = 34962, 34963
# Axes of a transform that are this far from a right angle (cosine) are no rotation and scale.
SKEW = 1e-6


def model_as_glb(bake: BakeFolder) -> bytes:
    """The whole model in its own coordinates, Y up as glTF has it, in metres.

    Raises:
        InputError: the bake is of a bare cell graph.
    """
    scene = model_of(bake)
    return objects_as_glb(scene, range(len(scene.objects)), placement(bake))


def objects_as_glb(scene: Scene, object_ids: Sequence[int], place: np.ndarray) -> bytes:
    """Some objects of a scene, at their finest level.

    Args:
        scene: the model.
        object_ids: of what is to be in the file, at least one.
        place: what moves the scene's frame to where the file is to be, Z up, shape (4, 4), float64.
    """
    return _Writer(scene).glb(object_ids, place)


def objects_as_gltf(scene: Scene, object_ids: Sequence[int], place: np.ndarray, above: str) -> tuple[dict, dict]:
    """The same as a JSON document, with each shape in a file of its own that other documents share.

    Args:
        scene: the model.
        object_ids: of what is to be in the document, at least one.
        place: as of `objects_as_glb`.
        above: what leads from the document to the shapes' files, such as "../".

    Returns:
        The document, and the files' bytes by name.
    """
    writer = _Writer(scene, above)
    return writer.document(object_ids, place), writer.files


class _Writer:
    """A glTF document as it grows: meshes and materials are written when the first object needs them."""

    def __init__(self, scene: Scene, above: str | None = None) -> None:
        self._scene = scene
        self._above = above
        self.files: dict[str, bytearray] = {}
        self._lists: dict[str, list[dict]] = {
            name: [] for name in ("nodes", "meshes", "materials", "accessors", "bufferViews")
        }
        self._materials: dict[tuple, int] = {}
        self._shapes: dict[str, list[tuple[tuple | None, dict]]] = {}
        self._meshes: dict[tuple, int | None] = {}

    def document(self, object_ids: Sequence[int], place: np.ndarray) -> dict:
        nodes = self._lists["nodes"]
        root = {"name": "viewcell", "children": [], "matrix": _numbers((Z_UP_TO_Y_UP @ place).T)}
        root["extras"] = {"unit": "metre"}
        nodes.append(root)
        for object_id in object_ids:
            root["children"].append(len(nodes))
            nodes.append(self._node(int(object_id)))
        document = {"asset": {"version": "2.0", "generator": f"viewcell {__version__}"}}
        document |= {"scene": 0, "scenes": [{"nodes": [0]}]}
        document |= {name: rows for name, rows in self._lists.items() if rows}
        if self.files:
            uris = [{} if self._above is None else {"uri": self._above + name} for name in self.files]
            document["buffers"] = [u | {"byteLength": len(f)} for u, f in zip(uris, self.files.values(), strict=True)]
        return document

    def glb(self, object_ids: Sequence[int], place: np.ndarray) -> bytes:
        text = json.dumps(self.document(object_ids, place), ensure_ascii=False, separators=(",", ":"), allow_nan=False)
        data = text.encode()
        chunks = [(b"JSON", data + b" " * (-len(data) % 4))]
        chunks += [(b"BIN\0", bytes(binary)) for binary in self.files.values()]
        body = b"".join(CHUNK_HEAD.pack(len(data), kind) + data for kind, data in chunks)
        return GLB_HEAD.pack(b"glTF", 2, GLB_HEAD.size + len(body)) + body

    def _node(self, object_id: int) -> dict:
        placed = self._scene.objects[object_id]
        extras = {"id": object_id, "kind": placed.kind, "role": placed.role.value}
        extras |= {"guid": placed.guid} if placed.guid else {}
        extras |= {"storey": placed.storey.name} if placed.storey else {}
        node = {"name": placed.name or f"{placed.kind} {object_id}", "extras": extras}
        mesh = self._scene.definitions[placed.definition_id].lods[0]
        linear = placed.transform[:3, :3]
        fallback = COLOURS[material_name(placed.role, placed.kind)]
        if placed.colour is not None:
            fallback = tuple(c / 255 for c in placed.colour)
        if _skewed(linear):
            # No rotation and scale make this transform, which is all that a node may have: the vertices move instead.
            moved = mesh.vertices @ linear.T + placed.transform[:3, 3]
            index = self._mesh(f"object_{object_id}", Mesh(moved, mesh.faces, colours=mesh.colours), fallback)
        else:
            index = self._mesh(str(placed.definition_id), mesh, fallback)
            node |= _placement(placed.transform)
        return node if index is None else node | {"mesh": index}

    def _mesh(self, key: str, mesh: Mesh, fallback: tuple) -> int | None:
        """A mesh for a shape, and for the colour that it gets where its faces have none; None where it has no faces."""
        if key not in self._shapes:
            self._shapes[key] = self._primitives("" if self._above is None else f"shapes/{key}.bin", mesh)
        coloured = all(colour is not None for colour, _ in self._shapes[key])
        name = (key, None if coloured else fallback)
        if name not in self._meshes:
            parts = [
                part | {"material": self._material(fallback if colour is None else colour)}
                for colour, part in self._shapes[key]
            ]
            self._meshes[name] = len(self._lists["meshes"]) if parts else None
            if parts:
                self._lists["meshes"].append({"primitives": parts})
        return self._meshes[name]

    def _primitives(self, file: str, mesh: Mesh) -> list[tuple[tuple | None, dict]]:
        """Faces by colour, all over the same vertices, in a file."""
        if not len(mesh.faces):
            return []
        points = self._accessor(file, np.asarray(mesh.vertices, np.float32), VERTICES)
        if mesh.colours is None:
            groups = [(None, mesh.faces)]
        else:
            colours, which = np.unique(mesh.colours, axis=0, return_inverse=True)
            groups = [(tuple((c / 255).tolist()), mesh.faces[which.ravel() == k]) for k, c in enumerate(colours)]
        # 65,535 would end a strip.
        kind = np.uint16 if len(mesh.vertices) < 2**16 else np.uint32
        return [
            (colour, {"attributes": {"POSITION": points}, "indices": self._accessor(file, faces.astype(kind), INDICES)})
            for colour, faces in groups
        ]

    def _accessor(self, file: str, values: np.ndarray, target: int) -> int:
        binary, data = self.files.setdefault(file, bytearray()), values.tobytes()
        view = {"buffer": list(self.files).index(file), "byteOffset": len(binary), "byteLength": len(data)}
        binary += data + bytes(-len(data) % 4)
        accessor = {"bufferView": len(self._lists["bufferViews"])}
        self._lists["bufferViews"].append(view | {"target": target})
        if target == VERTICES:
            accessor |= {"componentType": FLOAT, "count": len(values), "type": "VEC3"}
            accessor |= {"min": _numbers(values.min(axis=0)), "max": _numbers(values.max(axis=0))}
        else:
            kind = UNSIGNED_SHORT if values.dtype == np.uint16 else UNSIGNED_INT
            accessor |= {"componentType": kind, "count": values.size, "type": "SCALAR"}
        self._lists["accessors"].append(accessor)
        return len(self._lists["accessors"]) - 1

    def _material(self, colour: tuple) -> int:
        if colour not in self._materials:
            self._materials[colour] = len(self._lists["materials"])
            surface = {"baseColorFactor": [round(part, 4) for part in colour], "metallicFactor": 0}
            blend = {"alphaMode": "BLEND"} if colour[3] < 1 else {}
            self._lists["materials"].append({"pbrMetallicRoughness": surface, "doubleSided": True} | blend)
        return self._materials[colour]


def _skewed(linear: np.ndarray) -> bool:
    """Whether a matrix is more than a rotation (or mirror) of scaled axes, or flattens one."""
    lengths = np.linalg.norm(linear, axis=0)
    if not lengths.all():
        return True
    unit = linear / lengths
    return bool(np.abs(unit.T @ unit - np.eye(3)).max() > SKEW)


def _placement(transform: np.ndarray) -> dict:
    """A node's transform, in the fewest words."""
    if np.array_equal(transform[:3, :3], np.eye(3)):
        return {"translation": _numbers(transform[:3, 3])} if transform[:3, 3].any() else {}
    return {"matrix": _numbers(transform.T)}


def _numbers(values: np.ndarray) -> list[float | int]:
    """Numbers for JSON, whole ones without a point."""
    return [int(value) if value.is_integer() else value for value in np.asarray(values, np.float64).ravel().tolist()]
