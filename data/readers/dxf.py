"""DXF, through ezdxf: 3DFACE, polyface and polygon meshes, MESH; an object is a layer, or what a block holds of one.

Entities of the model space are grouped by layer. Each INSERT is an object of its own, named like its block, with blocks
within blocks; one that holds several layers is one object for each. Blocks are placed by the product of the matrices of
all INSERTs about them: an INSERT alone cannot state what turning inside uneven scaling does.
"""

import logging
import re
import unicodedata
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..extras import need
from .assemble import Model
from .pieces import MeshFile, Piece, bent_note, contents
from .roles import OPAQUE_ALPHA
from .triangulate import triangulated

# Units of $INSUNITS; 0 is none.
UNITS = {
    1: "inch", 2: "foot", 3: 1609.344, 4: "millimetre", 5: "centimetre", 6: "metre", 7: "kilometre", 10: "yard",
    14: "decimetre", 15: 10.0, 16: 100.0, 21: 1200 / 3937, 22: 100 / 3937, 23: 3600 / 3937,
}  # fmt: skip
ACIS = ("3DSOLID", "BODY", "REGION", "SURFACE", "EXTRUDEDSURFACE", "LOFTEDSURFACE", "REVOLVEDSURFACE", "SWEPTSURFACE")
BY_BLOCK, BY_LAYER = 0, 256
WHITE = (255, 255, 255)
# Bit of the flags of a VERTEX: it is of the smoothed surface of a net.
OF_SURFACE = 8
# Signs that the file's own coding lacks; before R2007 only.
NUMBERED, UNICODE_SINCE = re.compile(r"(?:\\U\+[0-9A-Fa-f]{4})+"), "AC1021"
DEPTH, COPIES, POLYGONS = 32, 100_000, 10_000_000


@dataclass
class _Faces:
    """Polygons of entities that follow each other, on one layer and of one look.

    Attributes:
        colour: None for that of the layer.
        through: transparency; 0 for that of the layer.
        corners: of all polygons in turn, shape (n, 3), float64.
        sizes: corners of each polygon.
        entities: how many they are.
    """

    layer: str
    colour: tuple[int, int, int] | None
    through: float
    corners: np.ndarray
    sizes: np.ndarray
    entities: int


@dataclass
class _Block:
    """Faces and INSERTs that a block or the model space holds, in the order of the file; what is neither, by kind."""

    items: list = field(default_factory=list)
    left: Counter = field(default_factory=Counter)


@dataclass
class _Layer:
    """Polygons of one object on one layer."""

    layer: str
    corners: list[np.ndarray] = field(default_factory=list)
    sizes: list[np.ndarray] = field(default_factory=list)
    colours: list[np.ndarray] = field(default_factory=list)
    alpha: float = 1.0


def read_dxf(path: Path, model: Model) -> MeshFile:
    """Polygons of the model space; Z up, in the unit of $INSUNITS, or metres where it states none.

    Raises:
        InputError: the file ends early or is not understood.
    """
    drawing = _open(path)
    try:
        return _taken(path, drawing, model)
    except (InputError, MemoryError):
        raise
    except Exception as error:  # ezdxf raises whatever it trips over
        raise _unreadable(path, error) from None


def _taken(path: Path, drawing, model: Model) -> MeshFile:
    reader = _Reader(path, drawing, model)
    loose: dict[str, _Layer] = {}
    pieces, empty = [], Counter()
    space = reader.held(drawing.modelspace())
    reader.place(_Block([one for one in space.items if isinstance(one, _Faces)], space.left), None, "", loose, 0)
    for insert in space.items:
        if isinstance(insert, _Faces):
            continue
        name, inside, layer = reader.words(insert.dxf.name), reader.block(insert), reader.layer(insert, "")
        for place in reader.copies(insert, None):
            held: dict[str, _Layer] = {}
            reader.place(inside, place, layer, held, 0)
            empty[name] += not held
            pieces += [reader.piece(name if len(held) == 1 else f"{name}: {one.layer}", one) for one in held.values()]
    pieces = [reader.piece(one.layer, one) for one in loose.values()] + pieces
    model.notes += bent_note(reader.bent, reader.polygons)
    for kind, count in sorted(reader.left.items()):
        why = "an ACIS solid, which is not read" if kind in ACIS else "no triangles"
        model.skip(f"{count} of {kind}", why)
    for block, count in sorted((+empty).items()):
        model.skip(f"{count} of block {block}", "no faces that are shown")
    for layer, count in sorted(reader.hidden.items()):
        model.skip(f"{count} entities of layer {layer}", "the layer is off or frozen")
    stated = int(drawing.header.get("$INSUNITS", 0))
    if stated not in UNITS:
        model.note(
            "$INSUNITS", f"{stated} is no unit of buildings: read as metres" if stated else "no unit: read as metres"
        )
    return MeshFile(pieces, UNITS.get(stated, "metre"))


def _open(path: Path):
    """The drawing.

    Raises:
        InputError: ezdxf cannot read it, or it does not come to its end.
    """
    need("ezdxf")
    import ezdxf

    logging.getLogger("ezdxf").addHandler(logging.NullHandler())  # what it complains of is no use without the drawing
    data = contents(path)
    if b"EOF" not in data[-64:]:
        raise InputError(f"{path}: expected EOF at the end of the DXF, found the end of the file")
    try:
        return ezdxf.readfile(path)
    except Exception as error:  # ezdxf raises whatever its parsing trips over
        raise _unreadable(path, error) from None


def _unreadable(path: Path, error: Exception) -> InputError:
    found = " ".join(str(error).encode(errors="replace").decode().split())[:120] or type(error).__name__
    return InputError(f"{path}: expected a readable DXF file, found {found}")


class _Reader:
    """Takes entities, and counts what it leaves."""

    def __init__(self, path: Path, drawing, model: Model):
        self.path, self.drawing, self.model = path, drawing, model
        self.numbered = drawing.dxfversion < UNICODE_SINCE
        self.layers = {self.words(entry.dxf.name).lower(): entry for entry in drawing.layers}
        self.blocks: dict[str, _Block] = {}
        self.left: Counter = Counter()
        self.hidden: Counter = Counter()
        self.bent = self.polygons = self.copied = self.placed = 0

    def words(self, name: str) -> str:
        """A name, with the signs that it writes as numbers."""
        return NUMBERED.sub(_signs, str(name)) if self.numbered else str(name)

    def layer(self, entity, outer: str) -> str:
        """An entity's layer; layer 0 of a block is that of its INSERT."""
        return _within(self.words(entity.dxf.get("layer", "0")), outer)

    def block(self, insert) -> _Block:
        """What the block of an INSERT holds; nothing if it is gone."""
        key = str(insert.dxf.name).lower()
        if key not in self.blocks:
            layout = insert.block()
            self.blocks[key] = _Block() if layout is None else self.held(layout)
        return self.blocks[key]

    def held(self, entities) -> _Block:
        """Faces, INSERTs, and what is neither."""
        block = _Block()
        read = ((entity, list(_polygons(entity))) for entity in entities)
        for look, alike in groupby(read, lambda pair: self.look(pair[0]) if pair[1] else pair[0].dxftype()):
            found = list(alike)
            if look == "INSERT":
                block.items += [entity for entity, _ in found]
            elif isinstance(look, str):
                block.left[look] += len(found)
            else:
                polygons = [polygon for _, several in found for polygon in several]
                corners = np.array([corner for polygon in polygons for corner in polygon], np.float64)
                sizes = np.array([len(polygon) for polygon in polygons], np.int64)
                block.items.append(_Faces(*look, corners, sizes, len(found)))
        return block

    def look(self, entity) -> tuple[str, tuple[int, int, int] | None, float]:
        """Layer, colour and transparency of an entity, as `_Faces` has them."""
        stated, index = entity.rgb, entity.dxf.get("color", BY_LAYER)
        colour = None if stated is None and index in (BY_LAYER, BY_BLOCK) else _shade(stated, index)
        through = entity.transparency if entity.dxf.hasattr("transparency") else 0.0
        return self.layer(entity, ""), colour, through

    def copies(self, insert, outer: np.ndarray | None) -> Iterator[np.ndarray]:
        """Where an INSERT puts its block, or each of an array of them: matrices for rows of coordinates, and 1.

        Args:
            insert: the INSERT.
            outer: where what holds it is put; None for the model space.
        """
        # Copies without a distance between them are one.
        columns = max(1, insert.dxf.column_count) if insert.dxf.column_spacing else 1
        rows = max(1, insert.dxf.row_count) if insert.dxf.row_spacing else 1
        self.copied += rows * columns
        if self.copied > COPIES:
            raise InputError(f"{self.path}: expected at most {COPIES:,} placed blocks, found more")
        own = np.array(list(insert.matrix44().rows()), np.float64)
        along = [insert.ocs().to_wcs(axis.rotate_deg(insert.dxf.rotation)).xyz for axis in _steps(insert)]
        for row in range(rows):
            for column in range(columns):
                moved = own.copy()
                if row or column:
                    moved[3, :3] += _product(np.array([[column, row]], np.float64), np.array(along))[0]
                yield moved if outer is None else _product(moved, outer)

    def place(self, block: _Block, matrix: np.ndarray | None, layer: str, into: dict[str, _Layer], depth: int) -> None:
        """Take what a block holds, placed; entities of layer 0 are on the layer of the INSERT.

        Args:
            block: what it holds.
            matrix: as of `copies`; None where it lies as written.
            layer: that of the INSERT.
            into: polygons by layer.
            depth: how many INSERTs are about that one.
        """
        if depth > DEPTH:
            raise InputError(f"{self.path}: expected blocks within blocks at most {DEPTH} deep, found deeper")
        self.left.update(block.left)
        for item in block.items:
            if isinstance(item, _Faces):
                self.take(item, matrix, layer, into)
                continue
            inside, own = self.block(item), self.layer(item, layer)
            for place in self.copies(item, matrix):
                self.place(inside, place, own, into, depth + 1)

    def take(self, faces: _Faces, matrix: np.ndarray | None, outer: str, into: dict[str, _Layer]) -> None:
        """Add polygons to those of their layer."""
        layer = _within(faces.layer, outer)
        entry = self.layers.get(layer.lower())
        if entry is not None and (entry.is_off() or entry.is_frozen()):
            self.hidden[layer] += faces.entities
            return
        corners = faces.corners
        if matrix is not None:
            self.placed += len(faces.sizes)
            if self.placed > POLYGONS:
                raise InputError(f"{self.path}: expected at most {POLYGONS:,} polygons in placed blocks, found more")
            corners = _product(corners, matrix[:3, :3]) + matrix[3, :3]
        through = faces.through or (entry.transparency if entry is not None else 0.0)
        colour = faces.colour or (WHITE if entry is None else _shade(entry.rgb, abs(entry.dxf.get("color", 7))))
        colour = (*colour, round(255 * (1 - through)))
        one = into.setdefault(layer, _Layer(layer))
        one.alpha = min(one.alpha, colour[3] / 255)
        one.corners.append(corners)
        one.sizes.append(faces.sizes)
        one.colours.append(np.tile(np.array(colour, np.uint8), (len(faces.sizes), 1)))

    def piece(self, name: str, one: _Layer) -> Piece:
        """The object of what was gathered."""
        vertices, sizes = np.concatenate(one.corners), np.concatenate(one.sizes)
        faces, owners, bent = triangulated(vertices, np.arange(len(vertices)), sizes)
        self.bent += bent
        self.polygons += len(sizes)
        clear = f"transparency of layer {one.layer!r}" if one.alpha < OPAQUE_ALPHA else ""
        return Piece(name, vertices, faces, one.layer, clear, colours=np.concatenate(one.colours)[owners])


def _within(layer: str, outer: str) -> str:
    return outer if layer == "0" and outer else layer


def _signs(found: re.Match) -> str:
    """What a run of numbered signs stands for, read as UTF-16; itself where that is no text, or breaks the line."""
    try:
        text = bytes.fromhex(found[0].replace("\\U+", "")).decode("utf-16-be")
    except UnicodeDecodeError:
        return found[0]
    shown = all(sign.isprintable() or unicodedata.category(sign) == "Zs" for sign in text)
    return text if shown else found[0]


def _steps(insert) -> list:
    """From one copy of an array to the next, across and along, before the array is turned."""
    from ezdxf.math import Vec3

    return [Vec3(insert.dxf.column_spacing, 0, 0), Vec3(0, insert.dxf.row_spacing, 0)]


def _product(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The matrix product; numbers beyond all measure become what the assembly refuses."""
    with np.errstate(invalid="ignore", over="ignore"):
        return left @ right


def _shade(stated, index: int) -> tuple[int, int, int]:
    """Red, green and blue, as stated or by an index of colours."""
    from ezdxf.colors import aci2rgb

    if stated is None:
        stated = aci2rgb(index) if 1 <= index <= 255 else WHITE
    return tuple(int(channel) for channel in stated)


def _polygons(entity) -> Iterator[list[tuple[float, float, float]]]:
    """Corners of each face of an entity, none twice in a row; nothing for what has no faces."""
    kind = entity.dxftype()
    if kind == "3DFACE":
        rings = [[entity.dxf.vtx0, entity.dxf.vtx1, entity.dxf.vtx2, entity.dxf.vtx3]]
    elif kind == "POLYLINE" and entity.is_poly_face_mesh:
        rings = [list(face.points()) for face in entity.indexed_faces()[1]]
    elif kind == "POLYLINE" and entity.is_polygon_mesh:
        rings = _net(entity)
    elif kind == "MESH":
        points = list(entity.vertices)
        if any(not 0 <= k < len(points) for face in entity.faces for k in face):
            raise ValueError(f"a MESH of {len(points)} vertices with a face beyond them")
        rings = [[points[k] for k in face] for face in entity.faces]
    else:
        return
    for ring in rings:
        corners = [tuple(map(float, point)) for point in ring]
        kept = [point for k, point in enumerate(corners) if point != corners[k - 1]]
        if len(kept) >= 3:
            yield kept


def _net(entity) -> list[list]:
    """The quads of a polygon mesh, with those that close it; of its smoothed surface where it has one."""
    rows, columns, vertices = entity.dxf.m_count, entity.dxf.n_count, list(entity.vertices)
    smooth = [vertex for vertex in vertices if vertex.dxf.flags & OF_SURFACE]
    dense = entity.dxf.m_smooth_density, entity.dxf.n_smooth_density
    if entity.dxf.flags & entity.SPLINE_FIT_VERTICES_ADDED and smooth and len(smooth) == dense[0] * dense[1]:
        vertices, (rows, columns) = smooth, dense
    if rows < 1 or columns < 1:
        return []
    if rows * columns > len(vertices):
        raise ValueError(f"a polygon mesh of {rows} by {columns} with {len(vertices)} vertices")
    places = [vertex.dxf.location for vertex in vertices]
    return [
        [places[a % rows * columns + b % columns] for a, b in ((i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j))]
        for i in range(rows if entity.is_m_closed else rows - 1)
        for j in range(columns if entity.is_n_closed else columns - 1)
    ]
