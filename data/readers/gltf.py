"""glTF 2.0, text and binary, by our own reader: loaders drop, rename and misread without a word.

One object is what a node shows in one material, and each instance of EXT_mesh_gpu_instancing. Objects follow the nodes
depth first. Source: Khronos, glTF 2.0 specification and its registry of extensions.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..extras import need
from .assemble import Model
from .gltf_buffers import Gltf, extensions
from .pieces import MeshFile, Piece, one_colour, rgba
from .roles import OPAQUE_ALPHA

DRACO, INSTANCING, SPECULAR = (
    "KHR_draco_mesh_compression", "EXT_mesh_gpu_instancing", "KHR_materials_pbrSpecularGlossiness",
)  # fmt: skip
TRANSMISSION, VISIBILITY, VARIANTS = "KHR_materials_transmission", "KHR_node_visibility", "KHR_materials_variants"
# What is read, and what changes no surface's place.
READ = {DRACO, INSTANCING, VISIBILITY, "KHR_mesh_quantization", "EXT_meshopt_compression", "KHR_meshopt_compression"}
HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "EXT_lights_", "KHR_xmp", "KHR_animation_")
HARMLESS += ("MSFT_texture_dds", "EXT_mesh_features", "EXT_structural_metadata", "EXT_instance_features", "KHR_audio")
POINTS_AND_LINES = {0: "points", 1: "lines", 2: "lines", 3: "lines"}
TRIANGLES, STRIP, FAN = 4, 5, 6


def read_gltf(path: Path, model: Model) -> MeshFile:
    """What the default scene of a .gltf or .glb file shows; metres, Y up, as the format demands.

    Raises:
        InputError: the file ends early, a buffer is missing or short, an extension is required and unknown, or its
            parts contradict each other.
    """
    notes: list[tuple[str, str]] = []
    gltf = Gltf(path, notes)
    for note in notes:
        model.note(*note)
    _require_known(gltf)
    shown, placed = _Shown(gltf, model), _placed_nodes(gltf, model)
    pieces = [piece for index, to_file in placed for piece in shown.of_node(index, to_file)]
    if moved := {str(_names(channel)) for one in gltf.listed("animations") for channel in one.get("channels", [])}:
        model.note(f"{len(moved)} animated nodes", "read where they rest")
    return MeshFile(pieces, up="y")


def _names(channel: dict) -> object:
    target = channel.get("target")
    return target.get("node") if isinstance(target, dict) else None


def _require_known(gltf: Gltf) -> None:
    for name in gltf.listed("extensionsRequired"):
        if name not in READ and not str(name).startswith(HARMLESS):
            raise InputError(f"{gltf.path}: expected extensions that this reader knows, found {str(name)[:60]!r}")


def _placed_nodes(gltf: Gltf, model: Model) -> list[tuple[int, np.ndarray]]:
    """Nodes of the default scene that have a mesh, depth first, each with its frame in the file's."""
    nodes, scenes = gltf.listed("nodes"), gltf.listed("scenes")
    children = {child for node in nodes for child in _children(gltf, node)}
    if scenes:
        roots = gltf.item("scenes", gltf.document.get("scene", 0)).get("nodes", [])
    else:
        roots = [index for index in range(len(nodes)) if index not in children]
    seen: set[int] = set()
    found = []
    stack = [(root, np.eye(4), True) for root in reversed(roots)]
    while stack:
        index, outer, visible = stack.pop()
        node = gltf.item("nodes", index)
        if index in seen:
            raise InputError(f"{gltf.path}: expected a tree of nodes, found node {index} in two places")
        seen.add(index)
        to_file = outer @ _local(gltf, node, index)
        visible = visible and extensions(node).get(VISIBILITY, {}).get("visible", True) is not False
        if "mesh" in node and visible:
            found.append((index, to_file))
        elif "mesh" in node:
            model.skip(_name(gltf, index), "the file hides this node")
        stack += [(child, to_file, visible) for child in reversed(_children(gltf, node))]
    for index, node in enumerate(nodes):
        if index not in seen and "mesh" in node:
            model.skip(_name(gltf, index), "in no node of the default scene")
    used = {node.get("mesh") for node in nodes}
    for index, mesh in enumerate(gltf.listed("meshes")):
        if index not in used:
            model.skip(str(mesh.get("name") or f"mesh {index}"), "placed by no node")
    return found


def _children(gltf: Gltf, node: dict) -> list[int]:
    found = node.get("children", [])
    if not isinstance(found, list) or any(type(child) is not int for child in found):
        raise InputError(f"{gltf.path}: expected a list of nodes as children, found {str(found)[:40]}")
    return found


def _local(gltf: Gltf, node: dict, index: int) -> np.ndarray:
    """A node's frame in that of the node above it, shape (4, 4)."""
    if "matrix" in node:
        return _floats(gltf, node["matrix"], 16, f"matrix of node {index}").reshape(4, 4).T
    parts = [
        _floats(gltf, node.get(key, rest), len(rest), f"{key} of node {index}")[None]
        for key, rest in (("translation", (0, 0, 0)), ("rotation", (0, 0, 0, 1)), ("scale", (1, 1, 1)))
    ]
    return _matrices(*parts)[0]


def _floats(gltf: Gltf, values: object, count: int, where: str) -> np.ndarray:
    try:
        found = np.array(values, np.float64)
    except (TypeError, ValueError, OverflowError):
        found = np.zeros(0)
    if found.shape != (count,):
        raise InputError(f"{gltf.path}: expected {count} numbers as {where}, found {str(values)[:60]}")
    return found


def _matrices(translations: np.ndarray, rotations: np.ndarray, scales: np.ndarray) -> np.ndarray:
    """Frames of translation, rotation (a quaternion x, y, z, w, of any length) and scale, shape (n, 4, 4)."""
    length = np.linalg.norm(rotations, axis=1, keepdims=True)
    x, y, z, w = (rotations / np.where(length > 0, length, 1)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    out = np.tile(np.eye(4), (len(translations), 1, 1))
    out[:, :3, :3] = np.array(rows).transpose(2, 0, 1) * scales[:, None]
    out[:, :3, 3] = translations
    return out


def _name(gltf: Gltf, index: int) -> str:
    """A node's own name, else that of its mesh, else its number."""
    node = gltf.item("nodes", index)
    mesh = gltf.listed("meshes")[node["mesh"]] if _is_place(node.get("mesh"), gltf.listed("meshes")) else {}
    return str(node.get("name") or (mesh.get("name") if isinstance(mesh, dict) else "") or f"node {index}")


def _is_place(index: object, entries: list) -> bool:
    return type(index) is int and 0 <= index < len(entries)


class _Shown:
    """The triangles of meshes by material, read once each."""

    def __init__(self, gltf: Gltf, model: Model):
        self.gltf, self.model = gltf, model
        self._known: dict[tuple, list[tuple]] = {}

    def of_node(self, index: int, to_file: np.ndarray) -> Iterator[Piece]:
        """What a node shows."""
        node, name = self.gltf.item("nodes", index), _name(self.gltf, index)
        mesh = self.gltf.item("meshes", node["mesh"])
        if "skin" in node:
            self.model.skip(name, "a skin moves it, which is not read")
            return
        weights = tuple(node.get("weights") or mesh.get("weights") or ())
        key = (node["mesh"], weights)
        if key not in self._known:
            self._known[key] = list(self._by_material(mesh, name, weights))
        elif not self._known[key]:
            self.model.skip(name, "no triangles")
        parts = self._known[key]
        judged = " ".join(dict.fromkeys((name, str(mesh.get("name") or name))))
        places = list(self._instances(node, name, to_file))
        for number, place in enumerate(places, start=1):
            each = name if INSTANCING not in extensions(node) else f"{name} #{number}"
            for material, points, faces, colours in parts:
                stated, clear = self._material_name(material), self._clear(material)
                label = stated or ("no material" if material is None else f"material {material}")
                own = each if len(parts) == 1 else f"{each}: {label}"
                yield Piece(own, points, faces, stated, clear, judged, place, colours)

    def _instances(self, node: dict, name: str, to_file: np.ndarray) -> Iterator[np.ndarray]:
        """Where a node stands: once, or where the instances of an extension say."""
        if INSTANCING not in extensions(node):
            yield to_file
            return
        attributes = extensions(node)[INSTANCING]["attributes"]
        rest = {"TRANSLATION": (0, 0, 0), "ROTATION": (0, 0, 0, 1), "SCALE": (1, 1, 1)}
        given = {key: self.gltf.accessor(attributes[key]) for key in rest if key in attributes}
        counts = {len(values) for values in given.values()}
        widths = all(values.shape[1] == len(rest[key]) for key, values in given.items())
        if len(counts) != 1 or not widths:
            found = ", ".join(f"{len(values)} {key}" for key, values in given.items()) or "none"
            raise InputError(
                f"{self.gltf.path}: expected as many places as turns of instances, found {found} of {name!r}"
            )
        count = counts.pop()
        parts = [given.get(key, np.tile(np.array(plain, np.float64), (count, 1))) for key, plain in rest.items()]
        if not count:
            self.model.skip(name, f"{INSTANCING}: no instance")
        for matrix in _matrices(*parts):
            yield to_file @ matrix

    def _by_material(self, mesh: dict, name: str, weights: tuple) -> Iterator[tuple]:
        """Material, vertices, faces and colours of a mesh, in the order in which its materials appear."""
        found: dict[int | None, list[tuple]] = {}
        for number, primitive in enumerate(mesh.get("primitives", [])):
            what = name if len(mesh["primitives"]) == 1 else f"{name}, primitive {number}"
            points, faces = self._triangles(primitive, what, weights)
            if faces is None:
                continue
            if not len(faces):
                self.model.skip(what, "no triangles")
                continue
            material = primitive.get("material")
            colours = self._colours(primitive, material, faces)
            found.setdefault(material, []).append((points, faces, colours))
        if not mesh.get("primitives"):
            self.model.skip(name, "a mesh without primitives")
        for material, parts in found.items():
            starts = np.cumsum([0, *(len(points) for points, _, _ in parts)])
            faces = np.concatenate([faces + start for (_, faces, _), start in zip(parts, starts[:-1], strict=True)])
            colours = [part[2] for part in parts]
            shades = None if any(shade is None for shade in colours) else np.concatenate(colours)
            yield material, np.concatenate([points for points, _, _ in parts]), faces, shades

    def _triangles(self, primitive: dict, what: str, weights: tuple) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Vertices and faces of a primitive; None, and a line in `skipped`, for what has no triangles."""
        mode, attributes = primitive.get("mode", TRIANGLES), primitive.get("attributes", {})
        if type(mode) is int and mode in POINTS_AND_LINES:
            self.model.skip(what, f"{POINTS_AND_LINES[mode]}: no triangles")
            return None, None
        if type(mode) is not int or mode not in (TRIANGLES, STRIP, FAN):
            raise InputError(f"{self.gltf.path}: expected a mode from 0 to 6, found {str(mode)[:40]} in {what!r}")
        if DRACO in extensions(primitive):
            points, faces = self._draco(primitive, what)
        elif "POSITION" not in attributes:
            self.model.skip(what, "no POSITION")
            return None, None
        else:
            points = self.gltf.accessor(attributes["POSITION"])
            points = self._morphed(points, primitive.get("targets", []), weights, what)
            corners = np.arange(len(points))
            if "indices" in primitive:
                corners = self.gltf.accessor(primitive["indices"], raw=True)[:, 0]
            if corners.dtype.kind == "f":
                raise InputError(f"{self.gltf.path}: expected whole numbers as indices, found others in {what!r}")
            faces = self._faces(corners.astype(np.int64), mode, what)
        if points.shape[1] != 3:
            raise InputError(f"{self.gltf.path}: expected 3 coordinates, found {points.shape[1]} in {what!r}")
        if len(faces) and not 0 <= faces.min() <= faces.max() < len(points):
            found = f"{faces.max():,} in {what!r}"
            raise InputError(f"{self.gltf.path}: expected indices below {len(points):,}, found {found}")
        return points, faces

    def _faces(self, corners: np.ndarray, mode: int, what: str) -> np.ndarray:
        """Triangles of a list, strip or fan of corners, shape (m, 3)."""
        if mode == TRIANGLES:
            if left := len(corners) % 3:
                self.model.note(what, f"{left} corners beyond the last whole triangle: ignored")
            return corners[: len(corners) // 3 * 3].reshape(-1, 3)
        if len(corners) < 3:
            return np.zeros((0, 3), np.int64)
        if mode == FAN:
            return np.column_stack([np.full(len(corners) - 2, corners[0]), corners[1:-1], corners[2:]])
        faces = np.column_stack([corners[:-2], corners[1:-1], corners[2:]])
        faces[1::2] = faces[1::2, [1, 0, 2]]
        # Strips turn corners by repeating them.
        a, b, c = faces.T
        return faces[(a != b) & (b != c) & (c != a)]

    def _morphed(self, points: np.ndarray, targets: list, weights: tuple, what: str) -> np.ndarray:
        """The vertices moved by the targets whose weights are not 0."""
        for target, weight in zip(targets, weights, strict=False):
            if weight and "POSITION" in target:
                moves = self.gltf.accessor(target["POSITION"])
                if moves.shape != points.shape:
                    raise InputError(f"{self.gltf.path}: expected {len(points)} moves, found {len(moves)} in {what!r}")
                points = points + float(weight) * moves
        return points

    def _draco(self, primitive: dict, what: str) -> tuple[np.ndarray, np.ndarray]:
        """Vertices and faces that Draco packs.

        Raises:
            InputError: they cannot be unpacked.
        """
        need("DracoPy")
        import DracoPy

        data, _ = self.gltf.view(extensions(primitive)[DRACO]["bufferView"])
        try:
            mesh = DracoPy.decode(bytes(data))
            points, faces = np.array(mesh.points, np.float64), np.array(mesh.faces, np.int64)
        except Exception as error:  # the library raises plain exceptions of its own
            found = " ".join(str(error).split())[:80]
            raise InputError(f"{self.gltf.path}: expected {DRACO} that unpacks, found {found} in {what!r}") from None
        stated = self.gltf.item("accessors", primitive.get("attributes", {}).get("POSITION"))
        if stated.get("normalized") is True and stated.get("componentType") in (5120, 5121, 5122, 5123):
            bits = 8 if stated["componentType"] in (5120, 5121) else 16
            signed = stated["componentType"] in (5120, 5122)
            points = np.maximum(points / (2 ** (bits - signed) - 1), -1.0)
        return points.reshape(-1, points.shape[-1]), faces.reshape(-1, 3)

    def _material(self, index: object) -> dict:
        return {} if index is None else self.gltf.item("materials", index)

    def _material_name(self, index: object) -> str:
        return str(self._material(index).get("name") or "")

    def _base(self, index: object) -> tuple[float, ...]:
        """The base colour of a material, red, green, blue and opacity, from 0 to 1."""
        material = self._material(index)
        if SPECULAR in extensions(material):
            factor = extensions(material)[SPECULAR].get("diffuseFactor", (1, 1, 1, 1))
        else:
            factor = material.get("pbrMetallicRoughness", {}).get("baseColorFactor", (1, 1, 1, 1))
        return tuple(_floats(self.gltf, factor, 4, f"colour of material {index}"))

    def _clear(self, index: object) -> str:
        """By what a material lets sight pass, in words; empty if it does not."""
        material = self._material(index)
        name = material.get("name") or f"material {index}"
        mode = material.get("alphaMode", "OPAQUE")
        if mode in ("BLEND", "MASK"):
            return f"alphaMode {mode} of {name!r}"
        # The factor of the older workflow beside that of the newer one: what either lets through is seen through.
        plain = material.get("pbrMetallicRoughness", {}).get("baseColorFactor", (1, 1, 1, 1))
        alpha = min(self._base(index)[3], _floats(self.gltf, plain, 4, f"colour of material {index}")[3])
        if alpha < OPAQUE_ALPHA:
            return f"opacity {alpha:g} of {name!r}"
        passing = extensions(material).get(TRANSMISSION, {}).get("transmissionFactor", 0)
        return f"transmission {passing:g} of {name!r}" if passing > 0 else ""

    def _colours(self, primitive: dict, material: object, faces: np.ndarray) -> np.ndarray | None:
        """Colour of each face: that of the material, times those of its corners."""
        shade = primitive.get("attributes", {}).get("COLOR_0")
        base = self._base(material)
        if shade is None or DRACO in extensions(primitive):
            return None if material is None else one_colour(rgba(*base), len(faces))
        corners = self.gltf.accessor(shade)
        if corners.shape[1] not in (3, 4) or (len(faces) and len(corners) <= faces.max()):
            return None if material is None else one_colour(rgba(*base), len(faces))
        means = np.ones((len(faces), 4))
        means[:, : corners.shape[1]] = corners[faces].mean(axis=1)
        return np.round(255 * np.clip(np.nan_to_num(means * base), 0, 1)).astype(np.uint8)
