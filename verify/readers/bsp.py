"""A second reader of compiled Quake maps: edge after edge, face by face, from the description of the format alone."""

import struct
from collections.abc import Iterator
from pathlib import Path

from .plain import Point, found_of
from .referee import Found

# 32 units of a map are a metre.
METRES = 1 / 32
ENTITIES, TEXTURES, VERTICES, TEXTURE_USES, FACES, EDGES, FACE_EDGES, MODELS = 0, 2, 3, 6, 7, 12, 13, 14
# Entities and textures that no player sees, by how a class begins and by whole names.
NOT_SEEN = ("trigger_", "func_ladder", "func_areaportal", "func_clip", "func_buyzone", "func_bomb_target")
NOT_SEEN += ("func_noclip", "func_no_clip")
NOT_DRAWN = ("clip", "hint", "solidhint", "origin", "null", "nodraw", "caulk", "bevel", "trigger", "aaatrigger")


def found_in_bsp(path: Path, metres: float | None = None, up: str = "z") -> list[Found]:
    """Objects of a .bsp: the faces that each model has of one texture.

    Args:
        path: the file, of version 29, 30, BSP2 or 2PSB.
        metres: length of its unit [m]; None for 1/32 m.
        up: axis that points up, "y" or "z".
    """
    return found_of(_Map(path.read_bytes()).objects(), METRES if metres is None else metres, up)


class _Map:
    def __init__(self, content: bytes):
        self.content, wide = content, content[:4] in (b"BSP2", b"2PSB")
        self.points = self.rows(VERTICES, "<3f")
        self.edges = self.rows(EDGES, "<2I" if wide else "<2H")
        self.turns = [turn for (turn,) in self.rows(FACE_EDGES, "<i")]
        # Plane, side, first edge, number of edges, use of a texture, four styles, place of its light.
        self.faces = self.rows(FACES, "<5i4Bi" if wide else "<HHiHH4Bi")
        # Eight numbers of its axes, texture, flags.
        self.uses = self.rows(TEXTURE_USES, "<8f2i")
        self.pictures = self.part(TEXTURES)

    def part(self, number: int) -> bytes:
        begin, size = struct.unpack_from("<2i", self.content, 4 + 8 * number)
        return self.content[begin : begin + size]

    def rows(self, number: int, form: str) -> list[tuple]:
        return list(struct.iter_unpack(form, self.part(number)))

    def objects(self) -> Iterator[tuple[str, list[list[Point]]]]:
        """Name and polygons of each object: by model, then by texture in the order of their names."""
        owners = self.owners()
        # Box, origin, four trees, leaves, first face, number of faces.
        for number, model in enumerate(self.rows(MODELS, "<9f7i")):
            kind, at = owners.get(number, ("no entity", (0.0, 0.0, 0.0)))
            if number and kind.lower().startswith(NOT_SEEN):
                continue
            of_texture: dict[str, list[list[Point]]] = {}
            for face in self.faces[model[14] : model[14] + model[15]]:
                of_texture.setdefault(self.texture(face[4]), []).append(self.polygon(face, at))
            for texture, polygons in sorted(of_texture.items()):
                if not _not_drawn(texture):
                    yield (f"{kind} *{number}: {texture}" if number else texture), polygons

    def polygon(self, face: tuple, at: Point) -> list[Point]:
        """Corners of a face, moved with its entity; a negative number runs along an edge backwards."""
        corners = []
        for turn in self.turns[face[2] : face[2] + face[3]]:
            begin, end = self.edges[abs(turn)]
            point = self.points[end if turn < 0 else begin]
            corners.append([point[k] + at[k] for k in range(3)])
        return corners

    def texture(self, use: int) -> str:
        """Name of the texture that a use of one names; its number where the file has no name."""
        number, part = self.uses[use][8], self.pictures
        count = struct.unpack_from("<i", part)[0] if part else 0
        if 0 <= number < count:
            begin = struct.unpack_from("<i", part, 4 + 4 * number)[0]
            if 0 <= begin < len(part):
                name = part[begin : begin + 16].partition(b"\0")[0].decode("latin-1")
                return name or f"texture {number}"
        return f"texture {number}"

    def owners(self) -> dict[int, tuple[str, Point]]:
        """Class and place [map units] of the entity that first claims each model."""
        found: dict[int, tuple[str, Point]] = {}
        words: list[str] = []
        # Between quotes stand words, key and value in turn; outside of them braces.
        for place, piece in enumerate(self.part(ENTITIES).decode("latin-1").split('"')):
            if place % 2:
                words.append(piece)
                continue
            for sign in piece:
                if sign == "{":
                    words = []
                elif sign == "}":
                    pairs = {key.lower(): value for key, value in zip(words[::2], words[1::2], strict=False)}
                    model = pairs.get("model", "")
                    if model.startswith("*") and model[1:].isdigit():
                        kind = pairs.get("classname") or "no class"
                        found.setdefault(int(model[1:]), (kind, _place(pairs.get("origin", ""))))
        return found


def _place(text: str) -> Point:
    """Three numbers of a text; zeros where it is anything else."""
    try:
        x, y, z = (float(word) for word in text.split())
    except ValueError:
        return (0.0, 0.0, 0.0)
    return (x, y, z)


def _not_drawn(texture: str) -> bool:
    name = texture.lower()
    if name in NOT_DRAWN:
        return True
    # Of liquids too there are such as the compiler leaves out: *waterskip.
    bare = name[1:] if name[:1] in ("*", "!") else name
    return bare.endswith("skip") and bare.replace("_", "a").isalnum()
