"""DXF, through ezdxf: 3DFACE, polyface and polygon meshes, MESH; an object is a layer, or what a block holds of one.

Entities of the model space are grouped by layer. Each INSERT is an object of its own, named like its block, with blocks
within blocks; one that holds several layers is one object for each.
"""

import logging
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..errors import InputError
from .assemble import Model
from .pieces import MeshFile, Piece, bent_note, contents, one_colour
from .roles import OPAQUE_ALPHA
from .triangulate import triangulated

# Units of $INSUNITS; 0 is none.
UNITS = {
    1: "inch", 2: "foot", 3: 1609.344, 4: "millimetre", 5: "centimetre", 6: "metre", 7: "kilometre", 10: "yard",
    14: "decimetre", 15: 10.0, 16: 100.0, 21: 1200 / 3937, 22: 100 / 3937, 23: 3600 / 3937,
}  # fmt: skip
ACIS = ("3DSOLID", "BODY", "REGION", "SURFACE", "EXTRUDEDSURFACE", "LOFTEDSURFACE", "REVOLVEDSURFACE", "SWEPTSURFACE")
BY_BLOCK, BY_LAYER = 0, 256
DEPTH, COPIES = 32, 100_000


@dataclass
class _Layer:
    """Polygons of one object on one layer."""

    layer: str
    vertices: list[tuple[float, float, float]] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)
    colours: list[tuple[int, int, int, int]] = field(default_factory=list)
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
    for entity in drawing.modelspace():
        if entity.dxftype() != "INSERT":
            reader.take(entity, "", loose)
            continue
        for copy in reader.copies(entity):
            held: dict[str, _Layer] = {}
            reader.expand(copy, "", held, 0)
            block = str(copy.dxf.name)
            empty[block] += not held
            pieces += [reader.piece(block if len(held) == 1 else f"{block}: {one.layer}", one) for one in held.values()]
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
        self.left: Counter = Counter()
        self.hidden: Counter = Counter()
        self.bent = self.polygons = self.copied = 0

    def copies(self, insert) -> Iterator:
        """An INSERT, or each of an array of them."""
        count = max(1, insert.mcount)
        self.copied += count
        if self.copied > COPIES:
            raise InputError(f"{self.path}: expected at most {COPIES:,} placed blocks, found more")
        return insert.multi_insert() if count > 1 else iter([insert])

    def expand(self, insert, layer: str, into: dict[str, _Layer], depth: int) -> None:
        """Take what a block holds, placed; entities of layer 0 are on the layer of the INSERT."""
        if depth > DEPTH:
            raise InputError(f"{self.path}: expected blocks within blocks at most {DEPTH} deep, found deeper")
        if insert.block() is None:
            return
        own = _layer_of(insert, layer)
        for entity in insert.virtual_entities():
            if entity.dxftype() == "INSERT":
                for copy in self.copies(entity):
                    self.expand(copy, own, into, depth + 1)
            else:
                self.take(entity, own, into)

    def take(self, entity, layer: str, into: dict[str, _Layer]) -> None:
        """Add the polygons of an entity to those of its layer."""
        kind, layer = entity.dxftype(), _layer_of(entity, layer)
        faces = list(_polygons(entity))
        if not faces:
            self.left[kind] += 1
            return
        entry = self.drawing.layers.get(layer) if self.drawing.layers.has_entry(layer) else None
        if entry is not None and (entry.is_off() or entry.is_frozen()):
            self.hidden[layer] += 1
            return
        colour = self._colour(entity, entry)
        one = into.setdefault(layer, _Layer(layer))
        one.alpha = min(one.alpha, colour[3] / 255)
        for face in faces:
            one.vertices += face
            one.sizes.append(len(face))
            one.colours.append(colour)

    def _colour(self, entity, entry) -> tuple[int, int, int, int]:
        """Red, green, blue and opacity of an entity, or of its layer."""
        from ezdxf.colors import aci2rgb

        stated = entity.rgb
        index = entity.dxf.get("color", BY_LAYER)
        if stated is None and index in (BY_LAYER, BY_BLOCK) and entry is not None:
            stated, index = entry.rgb, abs(entry.dxf.get("color", 7))
        if stated is None:
            stated = aci2rgb(index) if 1 <= index <= 255 else (255, 255, 255)
        through = entity.transparency if entity.dxf.hasattr("transparency") else 0.0
        if not through and entry is not None:
            through = entry.transparency
        return *(int(channel) for channel in stated), round(255 * (1 - through))

    def piece(self, name: str, one: _Layer) -> Piece:
        """The object of what was gathered."""
        vertices = np.array(one.vertices, np.float64).reshape(-1, 3)
        faces, owners, bent = triangulated(vertices, np.arange(len(vertices)), np.array(one.sizes, np.int64))
        self.bent += bent
        self.polygons += len(one.sizes)
        clear = f"transparency of layer {one.layer!r}" if one.alpha < OPAQUE_ALPHA else ""
        colours = np.array(one.colours, np.uint8)[owners] if one.colours else one_colour(None, 0)
        return Piece(name, vertices, faces, one.layer, clear, colours=colours)


def _layer_of(entity, outer: str) -> str:
    layer = str(entity.dxf.get("layer", "0"))
    return outer if layer == "0" and outer else layer


def _polygons(entity) -> Iterator[list[tuple[float, float, float]]]:
    """Corners of each face of an entity, none twice in a row; nothing for what has no faces."""
    kind = entity.dxftype()
    if kind == "3DFACE":
        rings = [[entity.dxf.vtx0, entity.dxf.vtx1, entity.dxf.vtx2, entity.dxf.vtx3]]
    elif kind == "POLYLINE" and (entity.is_poly_face_mesh or entity.is_polygon_mesh):
        from ezdxf.render import MeshBuilder

        mesh = MeshBuilder.from_polyface(entity)
        rings = [[mesh.vertices[k] for k in face] for face in mesh.faces]
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
