"""gbXML files once more: areas by Newell's formula and by lines swept over a surface, without triangles."""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree
from zipfile import ZipFile, is_zipfile

import numpy as np

from ...data.scene import Scene
from .referee import Found, differences
from .words import Told, word_differences

METRES = {
    "kilometers": 1000.0,
    "meters": 1.0,
    "centimeters": 0.01,
    "millimeters": 0.001,
    "miles": 1609.344,
    "yards": 0.9144,
    "feet": 0.3048,
    "inches": 0.0254,
}
# An area that vanishes [m2].
NO_AREA = 1e-9
# Share of the height between two corners by which the sweep keeps off them.
SLIVER = 1e-6


def differences_gbxml(scene: Scene, path: Path) -> list[str]:
    """What a scene has otherwise than its file: surfaces, windows, doors and spaces, lost, extra, moved or altered.

    Args:
        scene: as read from the file, nothing left out.
        path: the .xml file, or a zip archive with it alone.
    """
    root = ElementTree.fromstring(_content(path))
    lines = differences(scene, found_gbxml(path))
    wanted = sorted(space.findtext("{*}Name") or space.get("id") for space in root.iter() if _is(space, "Space"))
    named = [space.name for space in scene.spaces]
    lost = [lost["what"] for lost in scene.skipped]
    for name in sorted({*wanted, *named}):
        count = named.count(name) + sum(f"{name!r} (Space " in what for what in lost)
        if count != wanted.count(name):
            lines.append(f"room {name!r}: expected {wanted.count(name)} as a second reader finds, found {count}")
    return lines + word_differences(scene, *_told(root))


def _told(root: ElementTree.Element) -> tuple[list[Told], list[Told]]:
    """What the file says of surfaces and openings, and of spaces, of two of one id the first."""
    metres = METRES[root.get("lengthUnit", "Meters").strip().lower()]
    by_kind: dict[str, list[ElementTree.Element]] = {}
    for element in root.iter():
        by_kind.setdefault(element.tag.split("}")[-1], []).append(element)
    ids = {kind: {one.get("id"): one for one in reversed(all_)} for kind, all_ in by_kind.items()}
    storeys, spaces = ids.get("BuildingStorey", {}), ids.get("Space", {})

    def storey_of(space: str | None) -> tuple[str, float | None] | None:
        storey = storeys.get(spaces[space].get("buildingStoreyIdRef")) if space in spaces else None
        if storey is None:
            return None
        level = (storey.findtext("{*}Level") or "").strip()
        return (storey.findtext("{*}Name") or "").strip() or storey.get("id"), metres * float(level) if level else None

    def names(owner: ElementTree.Element) -> Iterator[str]:
        construction = ids.get("Construction", {}).get(owner.get("constructionIdRef"))
        for layer in () if construction is None else construction.findall("{*}LayerId"):
            for one in ids["Layer"][layer.get("layerIdRef")].findall("{*}MaterialId"):
                material = ids["Material"][one.get("materialIdRef")]
                yield (material.findtext("{*}Name") or "").strip() or material.get("id")

    things = []
    for surface in by_kind.get("Surface", []):
        beside = [storey_of(space.get("spaceIdRef")) for space in surface.findall("{*}AdjacentSpaceId")[:2]]
        storey = beside[0] if beside and all(one == beside[0] for one in beside) else None
        for thing in (surface, *surface.findall("{*}Opening")):
            things.append(Told(thing.get("id"), storey=storey, materials=tuple(dict.fromkeys(names(thing)))))
    rooms = [
        Told(key, (space.findtext("{*}Name") or "").strip() or key, storey=storey_of(key))
        for key, space in spaces.items()
    ]
    return things, rooms


def found_gbxml(path: Path) -> Iterator[Found]:
    """Surfaces and openings of a gbXML file, but for those of air, by their ids."""
    root = ElementTree.fromstring(_content(path))
    yield from _things(root, METRES[root.get("lengthUnit", "Meters").strip().lower()])


def _content(path: Path) -> bytes:
    if not is_zipfile(path):
        return path.read_bytes()
    with ZipFile(path) as archive:
        return archive.read(archive.infolist()[0])


def _is(element: ElementTree.Element, name: str) -> bool:
    return element.tag.split("}")[-1] == name


def _things(root: ElementTree.Element, metres: float) -> Iterator[Found]:
    """Every surface and opening that is not air."""
    for surface in root.iter():
        if not _is(surface, "Surface"):
            continue
        outer = _corners(surface, metres)
        holes = []
        for opening in surface.findall("{*}Opening"):
            ring = _corners(opening, metres)
            holes.append(ring)
            if opening.get("openingType") != "Air" and np.linalg.norm(_newell(ring)) > NO_AREA:
                yield Found(opening.get("id"), _box(ring), float(np.linalg.norm(_newell(ring))))
        area, box = _left(outer, holes) if len(outer) > 2 else (0.0, _box(outer))
        if surface.get("surfaceType") != "Air" and area > NO_AREA:
            yield Found(surface.get("id"), box, area)


def _corners(owner: ElementTree.Element, metres: float) -> np.ndarray:
    """Corners of the owner's polygon [m], shape (n, 3)."""
    loop = owner.find("{*}PlanarGeometry/{*}PolyLoop")
    points = [[float(x.text) for x in point.findall("{*}Coordinate")] for point in loop.findall("{*}CartesianPoint")]
    return np.array(points, float).reshape(-1, 3) * metres


def _box(ring: np.ndarray) -> np.ndarray:
    return np.array([ring.min(axis=0), ring.max(axis=0)])


def _newell(ring: np.ndarray) -> np.ndarray:
    """Normal of a polygon, as long as its area [m2]."""
    normal = np.zeros(3)
    for a, b in zip(ring - ring[0], np.roll(ring, -1, axis=0) - ring[0], strict=True):
        normal += (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    return normal / 2


def _left(outer: np.ndarray, holes: list[np.ndarray]) -> tuple[float, np.ndarray]:
    """Area [m2] and box [m] of what holes leave of a polygon, whether or not they overlap or reach beyond it."""
    normal = _newell(outer)
    area = float(np.linalg.norm(normal))
    if not holes or area == 0:
        return area, _box(outer)
    # Its shadow along an axis is smaller by the share of the normal that lies along it.
    axis = int(np.abs(normal).argmax())
    flat = [np.delete(ring, axis, axis=1) for ring in (outer, *holes)]
    levels = sorted({y for ring in flat for y in ring[:, 1]} | set(_meetings(flat)))
    shadow, ends = 0.0, []
    for low, high in pairwise(levels):
        shadow += (high - low) * sum(b - a for a, b in _pieces(flat, (low + high) / 2))
        inset = SLIVER * (high - low)
        ends += [(x, y) for y in (low + inset, high - inset) for piece in _pieces(flat, y) for x in piece]
    points = np.insert(np.array(ends).reshape(-1, 2), axis, 0.0, axis=1)
    points[:, axis] = (outer.mean(axis=0) @ normal - points @ normal) / normal[axis]
    return shadow * area / abs(normal[axis]), _box(points) if len(points) else _box(outer)


def _meetings(rings: list[np.ndarray]) -> Iterator[float]:
    """Heights at which sides of two rings cross."""
    sides = [(ring[i - 1], ring[i]) for ring in rings for i in range(len(ring))]
    for i, (a, b) in enumerate(sides):
        for c, d in sides[:i]:
            (ux, uy), (vx, vy) = b - a, d - c
            turn = ux * vy - uy * vx
            if turn:
                share = ((c[0] - a[0]) * vy - (c[1] - a[1]) * vx) / turn
                other = ((c[0] - a[0]) * uy - (c[1] - a[1]) * ux) / turn
                if 0 < share < 1 and 0 < other < 1:
                    yield float(a[1] + share * uy)


def _pieces(rings: list[np.ndarray], y: float) -> Iterator[tuple[float, float]]:
    """Pieces of the line at height y that lie in the first ring and in no other."""
    ends = [sorted(_ends(ring, y)) for ring in rings]
    for a, b in pairwise(sorted(x for found in ends for x in found)):
        inside = [sum(x < (a + b) / 2 for x in found) % 2 for found in ends]
        if a < b and inside[0] and not any(inside[1:]):
            yield a, b


def _ends(ring: np.ndarray, y: float) -> Iterator[float]:
    for a, b in zip(ring, np.roll(ring, 1, axis=0), strict=True):
        if min(a[1], b[1]) <= y < max(a[1], b[1]):
            yield float(a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
