"""gbXML files: surfaces without thickness, windows and doors in them, spaces.

A surface is one object, from which its openings are cut; each opening is an object of its own, but for those that are
air. What a file says that gbXML does not know is read as what can hide least, and noted.
"""

import xml.etree.ElementTree as ElementTree
import zipfile
from collections import Counter
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from xml.parsers import expat

import numpy as np

from ..errors import InputError
from ..scene import LOST_ROOM, Role, Scene, Space
from .archive import only_file
from .assemble import Model, Part, assemble
from .gbxml_words import Node, Words
from .rings import newell, ring_triangles
from .roles import RoleRules, Taken
from .units import METRES, metres_per_unit

WALLS = frozenset(
    "InteriorWall ExteriorWall Roof InteriorFloor ExposedFloor UndergroundWall UndergroundSlab UndergroundCeiling "
    "Ceiling SlabOnGrade RaisedFloor FreestandingColumn EmbeddedColumn".split()
)
DETAIL, AIR = "Shade", "Air"
WINDOWS = frozenset("FixedWindow OperableWindow FixedSkylight OperableSkylight".split())
DOORS = frozenset("SlidingDoor NonSlidingDoor".split())
MILE_M = 1609.344
# Corners further than this from their polygon's plane, and openings from that of their surface, are noted [m].
FLAT_M = 0.01
# Openings may reach beyond their surface by this share of its area before it is noted.
BEYOND_SHARE = 1e-3


@dataclass
class _Building:
    """What is gathered while a file is read.

    Attributes:
        metres: length of the file's unit [m].
        shells: triangles of each space by its own geometry, (vertices, faces), or None.
        sides: surfaces around each space: polygon and whether it is seen from behind.
        faults: how often each fault was found, and where first.
        words: what the file says of storeys and materials.
        beside: of each part the spaces that it bounds, and its construction.
    """

    metres: float
    model: Model
    roles: RoleRules
    ids: Counter = field(default_factory=Counter)
    names: dict[str, str] = field(default_factory=dict)
    shells: dict[str, list[np.ndarray]] = field(default_factory=dict)
    sides: dict[str, list[np.ndarray]] = field(default_factory=dict)
    faults: dict[str, list[str]] = field(default_factory=dict)
    words: Words = field(init=False)
    beside: list[tuple[tuple[str, ...], str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.words = Words(self.metres)

    def fault(self, what: str, where: str) -> None:
        """Gather a fault, to be noted once for all places where it is."""
        self.faults.setdefault(what, []).append(where)


def read_gbxml(path: Path, model: Model, roles: RoleRules) -> Scene:
    """Scene of a gbXML file.

    Args:
        path: .xml, .gbxml, or a .zip archive with one of them.
        model: source, sha256 and grid step; filled in here.
        roles: what is glass, a door, or left out.

    Raises:
        InputError: the file is no XML, declares entities, is no gbXML, or holds nothing opaque.
    """
    content = only_file(path, (".xml", ".gbxml")) if zipfile.is_zipfile(path) else _bytes(path)
    _check_xml(path, content)
    building = _read(path, content, model, roles)
    told = zip(model.parts, building.beside, strict=True)
    model.parts = [building.words.told(part, *beside) for part, beside in told]
    _add_spaces(building)
    for what, places in building.faults.items():
        more = f" and {len(places) - 1} more" if len(places) > 1 else ""
        model.note(f"{places[0]}{more}", what)
    return assemble(model)


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: expected a readable file, found {error.strerror}") from None


def _check_xml(path: Path, content: bytes) -> None:
    """Refuse what is no XML, and declarations of entities, a few of which may stand for gigabytes or other files."""

    def refuse(*_: object) -> None:
        raise InputError(f"{path}: expected no DOCTYPE, which gbXML does not have, found one")

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(content, True)
    except (expat.ExpatError, ValueError, LookupError) as error:  # the others are of unknown encodings
        raise InputError(f"{path}: expected XML, found {error}") from None


def _read(path: Path, content: bytes, model: Model, roles: RoleRules) -> _Building:
    """The surfaces as parts; the spaces' geometry is gathered."""
    building, namespace, surfaces = None, "", 0
    for event, element in ElementTree.iterparse(BytesIO(content), events=("start", "end")):
        if building is None:
            namespace, name = _parted(element.tag)
            if name.lower() != "gbxml":
                raise InputError(f"{path}: expected gbXML, found <{name}>")
            metres, model.unit = _unit(path, element.get("lengthUnit"), model)
            building = _Building(metres, model, roles)
        if event == "start":
            continue
        name = element.tag.removeprefix(namespace)
        building.words.gather(name, Node(element))
        if name == "Surface":
            surfaces += 1
            _add_surface(Node(element), building)
            element.clear()
        elif name == "Space":
            _gather_space(Node(element), building)
            element.clear()
    if not surfaces:
        raise InputError(f"{path}: expected surfaces, found none")
    for space in sorted(building.sides.keys() - building.names.keys()):
        building.fault("bounds a space that the file does not have", f"space {space!r}")
    for key, count in building.ids.items():
        if count > 1:
            building.fault("an id that stands for several surfaces or openings, all kept", f"{key!r}")
    return building


def _parted(tag: str) -> tuple[str, str]:
    """Namespace, with its brackets, and name of a tag."""
    end = tag.rfind("}") + 1
    return tag[:end], tag[end:]


def _unit(path: Path, unit: str | None, model: Model) -> tuple[float, str]:
    """Length of a gbXML unit [m] and its name."""
    if unit is None:
        model.note("lengthUnit", "not given: metres")
        return 1.0, "metre"
    if unit.strip().lower() in ("mile", "miles"):
        return MILE_M, "mile"
    try:
        metres, name = metres_per_unit(unit)
    except InputError:
        metres, name = 0.0, ""
    if name not in METRES:
        raise InputError(f"{path}: expected a lengthUnit such as Meters or Feet, found {unit!r}")
    return metres, name


def _ring(loop: Node, metres: float) -> np.ndarray:
    """Corners of a polygon [m], shape (n, 3), each once.

    Raises:
        ValueError: a coordinate is no finite number, or a point has not three.
    """
    points = [[float(number.element.text or "") for number in p.all("Coordinate")] for p in loop.all("CartesianPoint")]
    if any(len(point) != 3 for point in points):
        raise ValueError("a point without three coordinates")
    ring = np.array(points, np.float64).reshape(-1, 3) * metres
    if not (np.abs(ring) < 1e12).all():
        raise ValueError("a coordinate that is no number of metres")
    return ring[(ring != np.roll(ring, 1, axis=0)).any(axis=1)] if len(ring) > 1 else ring


def _polygon(node: Node, building: _Building, what: str) -> np.ndarray | None:
    """The polygon of a surface or an opening [m]; None, and the reason in `skipped`, if it has none with an area."""
    loops = node.all("PlanarGeometry", "PolyLoop")
    why = "no polygon" if not loops else ""
    if len(loops) > 1:
        building.fault("several polygons: all but the first are left out", what)
    if not why:
        try:
            ring = _ring(loops[0], building.metres)
        except ValueError as error:
            why = f"{error}"
    if not why and (len(ring) < 3 or not np.linalg.norm(newell(ring))):
        why = "a polygon without area"
    if why:
        building.model.skip(what, why)
        return None
    off = _off(ring, ring)
    if off > FLAT_M:
        building.fault(f"a polygon whose corners lie off its plane by up to {off:.2f} m", what)
    return ring


def _off(ring: np.ndarray, points: np.ndarray) -> float:
    """The furthest that points lie from the plane of a polygon [m]."""
    normal = newell(ring)
    return float(np.abs((points - ring.mean(axis=0)) @ normal).max() / np.linalg.norm(normal))


def _add_surface(node: Node, building: _Building) -> None:
    kind, key = node.get("surfaceType"), node.get("id")
    name = node.text("Name") or key
    what = f"surface {key or name!r}"
    building.ids[key] += 1
    outer = _polygon(node, building, what)
    if outer is None:
        return
    spaces = tuple(space.get("spaceIdRef") for space in node.all("AdjacentSpaceId")[:2])
    for place, space in enumerate(spaces):
        building.sides.setdefault(space, []).append(outer[::-1] if place else outer)
    # An opening is there even where its surface is air.
    openings = node.all("Opening")
    holes = [hole for opening in openings if (hole := _add_opening(opening, outer, what, spaces, building))]
    if kind == AIR:
        return
    text = f"{name} {node.text('CADObjectId')}"
    if building.roles.leaves_out(name, key, kind):
        building.model.skip(name, f"{kind}: left out as asked")
        return
    vertices, faces = ring_triangles(outer, [ring for (ring,) in holes])
    corners = vertices[faces]
    if len(holes) and not len(faces):
        return  # all of it is windows or doors
    left = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    wanted = np.linalg.norm(newell(outer)) - sum(np.linalg.norm(newell(ring)) for (ring,) in holes)
    if abs(left - wanted) > BEYOND_SHARE * np.linalg.norm(newell(outer)):
        building.fault("a polygon that crosses itself, or openings that overlap or reach beyond it", what)
    _add_part(building, node, kind, _role(kind, text, what, building), spaces, vertices, faces)


def _role(kind: str, text: str, what: str, building: _Building) -> Taken:
    if why := building.roles.named_glass(text, "product name"):
        return Taken(Role.TRANSPARENT, kind, why)
    if kind in WALLS:
        return Taken(Role.OCCLUDER, kind)
    if kind != DETAIL:
        building.fault(f"surfaceType {kind!r}, which gbXML does not know: taken for detail", what)
    return Taken(Role.DETAIL, kind or "Surface")


def _add_opening(
    node: Node, outer: np.ndarray, where: str, spaces: tuple[str, ...], building: _Building
) -> tuple[np.ndarray] | None:
    """Add a window or door; its polygon is what is to be cut from the surface."""
    kind, key = node.get("openingType"), node.get("id")
    name = node.text("Name") or key
    what = f"opening {key or name!r} of {where}"
    building.ids[key] += 1
    ring = _polygon(node, building, what)
    if ring is None:
        return None
    if (off := _off(outer, ring)) > FLAT_M:
        building.fault(f"an opening off its surface's plane by up to {off:.2f} m", what)
    building.model.openings.append(ring)
    if kind == AIR:
        return (ring,)
    if building.roles.leaves_out(name, key, kind):
        building.model.skip(name, f"{kind}: left out as asked")
        return (ring,)
    if why := building.roles.named_glass(f"{name} {node.text('CADObjectId')}", "product name"):
        taken = Taken(Role.TRANSPARENT, kind, why)
    elif kind in DOORS:
        taken = Taken(building.roles.door, kind, f"door: openingType {kind}")
    else:
        if kind not in WINDOWS:
            building.fault(f"openingType {kind!r}, which gbXML does not know: taken for a window", what)
        taken = Taken(Role.TRANSPARENT, kind or "Opening", f"glass: openingType {kind}")
    _add_part(building, node, kind or "Opening", taken, spaces, *ring_triangles(ring, []))
    return (ring,)


def _add_part(
    building: _Building,
    node: Node,
    kind: str,
    taken: Taken,
    spaces: tuple[str, ...],
    vertices: np.ndarray,
    faces: np.ndarray,
) -> None:
    name, key, place = node.text("Name") or node.get("id"), node.get("id"), len(building.model.parts)
    part = Part(name, kind or taken.kind, taken.role, place, vertices, faces, np.eye(4), guid=key, why=taken.why)
    building.model.parts.append(part)
    building.beside.append((spaces, node.get("constructionIdRef")))


def _gather_space(node: Node, building: _Building) -> None:
    """The polygons of a space by its shell, or by the boundaries that it lists."""
    key = node.get("id")
    if key in building.names:
        building.fault("an id that stands for several spaces: the first is kept", f"{key!r}")
        return
    building.names[key] = node.text("Name") or key
    for way in (("ShellGeometry", "ClosedShell", "PolyLoop"), ("SpaceBoundary", "PlanarGeometry", "PolyLoop")):
        try:
            rings = [_ring(loop, building.metres) for loop in node.all(*way)]
        except ValueError as error:
            building.fault(f"a space with {error}", f"space {key!r}")
            continue
        rings = [ring for ring in rings if len(ring) >= 3]
        if len(rings) > 3:
            building.shells[key] = rings
            return


def _add_spaces(building: _Building) -> None:
    """Rooms as the volumes that their shells enclose, else the surfaces around them."""
    for key, name in building.names.items():
        rings = building.shells.get(key) or building.sides.get(key, [])
        if len(rings) < 4:
            building.model.skip(
                f"{LOST_ROOM}{name!r} (Space {key})", "a room without a body: no shell, and no surfaces that enclose it"
            )
            continue
        pieces = [ring_triangles(ring, []) for ring in rings]
        starts = np.cumsum([0, *(len(vertices) for vertices, _ in pieces)])
        vertices = np.concatenate([vertices for vertices, _ in pieces])
        faces = np.concatenate([faces + start for (_, faces), start in zip(pieces, starts[:-1], strict=True)])
        words = {"guid": key, "storey": building.words.storey_of(key)}
        building.model.spaces.append(Space(name, vertices, faces.astype(np.int32), **words))
