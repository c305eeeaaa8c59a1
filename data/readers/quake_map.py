"""Compiled Quake maps as models: what is drawn of the world and of each entity's brushes, one object a texture.

Faces bound the space that a player walks in; a map has no solids. 1 unit is UNIT_STEPS steps of the usual grid, 1/32 m,
as where portals are checked. Formats: versions 29, 30, BSP2 and 2PSB, as in `data/store/quake.py`.
"""

import re
import struct
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..scene import GRID_M
from ..store.quake import MODEL_BYTES, MODELS, UNIT_STEPS, compiled_map, lump
from .assemble import Model
from .pieces import MeshFile, Piece, bent_note, used
from .triangulate import triangulated

ENTITIES, TEXTURES, VERTICES, TEXTURE_USES, FACES, EDGES, FACE_EDGES = 0, 2, 3, 6, 7, 12, 13
# Plane, side, first edge, number of edges, texture use, styles and light; in wide versions all of four bytes.
FACE = np.dtype([("", "<u2", 2), ("first", "<i4"), ("count", "<u2"), ("use", "<u2"), ("styles", "V8")])
WIDE_FACE = np.dtype([("", "<i4", 2), ("first", "<i4"), ("count", "<i4"), ("use", "<i4"), ("styles", "V8")])
WIDE = (b"BSP2", b"2PSB")
TEXTURE_USE = np.dtype([("axes", "<f4", 8), ("texture", "<i4"), ("flags", "<i4")])
MODEL = np.dtype([("box", "<f4", 6), ("origin", "<f4", 3), ("nodes", "<i4", 5), ("first", "<i4"), ("count", "<i4")])
# Liquids and portals to elsewhere begin with * or !, pictures with holes with {.
CLEAR = re.compile(r"^[*!{]|(?:^|[^a-z])(?:sky|water|lava|slime|glass|teleport)", re.IGNORECASE)
NOT_DRAWN = re.compile(
    r"^(?:clip|skip|hint|hintskip|solidhint|origin|null|nodraw|caulk|bevel|(?:aaa)?trigger|[*!]?\w*skip)$",
    re.IGNORECASE,
)
# Of entities: what is not drawn, and what moves away or may be away, so that it hides nothing for good.
INVISIBLE = re.compile(r"^(?:trigger_|func_(?:ladder|areaportal|clip|buyzone|bomb_target|no_?clip))", re.IGNORECASE)
MOVES = re.compile(
    r"^func_(?:plat|train|rotat|track|pendulum|push|movewall|vehicle|break|bossgate|episodegate|togglewall)|^momentary_",
    re.IGNORECASE,
)


def read_map(path: Path, model: Model) -> MeshFile:
    """Faces of a .bsp by entity and texture; Z up, 1 unit = 1/32 m.

    Raises:
        InputError: it is of another version, ends early, or its parts contradict each other.
    """
    data = compiled_map(path)
    models = _table(data, MODELS, MODEL, path, MODEL_BYTES)
    wide = data[:4] in WIDE
    faces = _table(data, FACES, WIDE_FACE if wide else FACE, path)
    if not len(models) or not len(faces):
        raise InputError(f"{path}: expected faces of a map, found {len(models)} models with {len(faces)} faces")
    polygons = _Polygons(data, path, faces, wide)
    textures = _texture_names(data, path, faces["use"])
    owners = _owners(lump(data, ENTITIES, path))
    pieces, bent, cut = [], 0, 0
    for number, one in enumerate(models):
        kind, origin = owners.get(number, ("worldspawn" if number == 0 else "no entity", np.zeros(3)))
        first, count = int(one["first"]), int(one["count"])
        if first < 0 or count < 0 or first + count > len(faces):
            found = f"{count:,} from {first:,} on in model {number}"
            raise InputError(f"{path}: expected {len(faces):,} faces, found {found}")
        name = "" if number == 0 else f"{kind} *{number}"
        if INVISIBLE.match(kind):
            model.skip(name, f"{kind}: not drawn, {count} faces")
            continue
        mine = np.arange(first, first + count)
        for texture in sorted(set(textures[mine])):
            chosen = mine[textures[mine] == texture]
            if NOT_DRAWN.match(texture):
                model.skip(f"{name} {texture}".strip(), f"a texture that is not drawn, {len(chosen)} faces")
                continue
            vertices, triangles, more = polygons.triangles(chosen)
            bent, cut = bent + more, cut + len(chosen)
            clear = f"texture {texture!r}" if CLEAR.search(texture) else f"{kind} moves" if MOVES.match(kind) else ""
            own = f"{name}: {texture}" if name else texture
            to_file = np.eye(4)
            to_file[:3, 3] = origin
            pieces.append(Piece(own, vertices, triangles, texture, clear, judged=kind, to_file=to_file))
    model.notes += bent_note(bent, cut)
    return MeshFile(pieces, UNIT_STEPS * GRID_M)


def _table(data: bytes, number: int, row: np.dtype, path: Path, size: int = 0) -> np.ndarray:
    """Rows of a part; `size` bytes each if that is more than what is read of them."""
    part = lump(data, number, path)
    size = size or row.itemsize
    if len(part) % size:
        raise InputError(f"{path}: expected rows of {size} bytes in part {number}, found {len(part):,} bytes")
    return np.ndarray(len(part) // size, row, part, 0, size) if part else np.zeros(0, row)


class _Polygons:
    """The polygons of a map's faces."""

    def __init__(self, data: bytes, path: Path, faces: np.ndarray, wide: bool):
        self.faces, self.path = faces, path
        self.vertices = _table(data, VERTICES, np.dtype(("<f4", 3)), path).reshape(-1, 3).astype(np.float64)
        ends = _table(data, EDGES, np.dtype(("<u4" if wide else "<u2", 2)), path).reshape(-1, 2).astype(np.int64)
        turns = _table(data, FACE_EDGES, np.dtype("<i4"), path).astype(np.int64)
        if len(turns) and np.abs(turns).max() >= len(ends):
            raise InputError(f"{path}: expected {len(ends):,} edges, found number {np.abs(turns).max():,}")
        # A negative number runs along the edge backwards.
        self.corners = ends[np.abs(turns), (turns < 0).astype(int)] if len(turns) else turns
        if len(self.corners) and self.corners.max() >= len(self.vertices):
            raise InputError(f"{path}: expected {len(self.vertices):,} vertices, found number {self.corners.max():,}")
        first, count = faces["first"].astype(np.int64), faces["count"].astype(np.int64)
        bad = np.flatnonzero((first < 0) | (count < 3) | (first + count > len(self.corners)))
        if len(bad):
            found = f"{count[bad[0]]:,} from {first[bad[0]]:,} on in face {bad[0]}"
            raise InputError(f"{path}: expected 3 or more of {len(self.corners):,} corners, found {found}")

    def triangles(self, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
        """Vertices and triangles of faces, and how many of the faces are bent."""
        sizes = self.faces["count"][chosen].astype(np.int64)
        starts = self.faces["first"][chosen].astype(np.int64)
        within = np.arange(int(sizes.sum())) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        corners = self.corners[np.repeat(starts, sizes) + within]
        triangles, _, bent = triangulated(self.vertices, corners, sizes)
        return *used(self.vertices, triangles), bent


def _texture_names(data: bytes, path: Path, uses: np.ndarray) -> np.ndarray:
    """The name of each face's texture, shape (faces,), object; empty where the file has none."""
    table = _table(data, TEXTURE_USES, TEXTURE_USE, path)
    if len(uses) and not 0 <= int(uses.min()) <= int(uses.max()) < len(table):
        raise InputError(f"{path}: expected {len(table):,} uses of textures, found number {int(uses.max()):,}")
    part = lump(data, TEXTURES, path)
    count = struct.unpack_from("<i", part)[0] if len(part) >= 4 else 0
    if count < 0 or 4 + 4 * count > len(part):
        raise InputError(f"{path}: expected {count:,} textures, found {len(part):,} bytes of them")
    names = []
    for offset in struct.unpack_from(f"<{count}i", part, 4) if count else ():
        # -1 stands for a texture that the compiler did not find.
        name = part[offset : offset + 16].split(b"\0")[0] if 0 <= offset < len(part) else b""
        names.append(name.decode("latin-1"))
    textures = table["texture"][uses]
    return np.array([names[k] if 0 <= k < count and names[k] else f"texture {k}" for k in textures.tolist()], object)


def _owners(entities: bytes) -> dict[int, tuple[str, np.ndarray]]:
    """Class and place [map units] of the entity that each model of brushes belongs to."""
    found: dict[int, tuple[str, np.ndarray]] = {}
    pairs: dict[str, str] = {}
    for key, value, brace in re.findall(r'"([^"]*)"\s*"([^"]*)"|([{}])', entities.decode("latin-1")):
        if brace == "{":
            pairs = {}
        elif brace:
            at = re.fullmatch(r"\*(\d{1,9})", pairs.get("model", ""))
            if at:
                found.setdefault(int(at[1]), (pairs.get("classname") or "no class", _point(pairs.get("origin", ""))))
        else:
            pairs[key.lower()] = value
    return found


def _point(text: str) -> np.ndarray:
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        return np.zeros(3)
    return values if values.shape == (3,) else np.zeros(3)
