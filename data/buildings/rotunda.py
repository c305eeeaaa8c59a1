"""Round buildings: a ring of rooms along a ring corridor about a court, with any number of sides."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from ..errors import InputError
from ..scene import Instance, Mesh, Role, Scene
from .furnish import Room, Slots, free_slots, furniture_shapes, gathered, placed_pieces, turned, wanted_pieces
from .furniture import FURNITURE
from .plans import CORRIDOR_M, ROOM_DEPTH_M
from .prisms import prism, regular, slanted
from .shapes import pierced_block
from .shell import (
    DOOR_M,
    FILLINGS,
    HEAD_M,
    INNER_WINDOW_SHARE,
    OUTER_WALL_M,
    PASSAGE_M,
    SILL_M,
    SLAB_M,
    STOREY_M,
    WALL_M,
)
from .works import Works

SIDES = (3, 64)
# The corridor's outer wall is so far from the middle, and each of its sides so long, at least [m].
LEAST_APOTHEM_M, LEAST_SIDE_M = 5.0, 4.0
INNER_DOOR_SHARE = 0.4
# How far walls reach into those that they meet, so that what is rounded in different frames leaves no slit [m].
EMBED_M = 2 / 32
CEILING_M = STOREY_M - SLAB_M


@dataclass(frozen=True)
class Ring:
    """Distances of the walls from the middle [m], each to the middle of a side.

    Attributes:
        sides: of all polygons.
        court: inside of the wall around the court.
        corridor: inside of the corridor, outside of the court's wall.
        passage: outside of the corridor.
        room: inside of the rooms.
        outer: inside of the outer wall, outside of the rooms.
    """

    sides: int
    court: float
    corridor: float
    passage: float
    room: float
    outer: float

    @property
    def slope(self) -> float:
        """Half the length of a side, for a metre from the middle."""
        return float(np.tan(np.pi / self.sides))

    @property
    def secant(self) -> float:
        """Distance of a corner, for a metre from the middle to a side."""
        return float(1 / np.cos(np.pi / self.sides))

    def frame(self, side: float) -> np.ndarray:
        """Frame of a side, shape (4, 4): x outwards through its middle, y along it."""
        return turned(np.zeros(3), side * 2 * np.pi / self.sides)

    def strip(self, near: float, far: float, holes: list[np.ndarray], inset: float = 0.0, embed: float = 0.0) -> Mesh:
        """What lies between two distances on one side, from floor to ceiling, mitred.

        Args:
            near: distance from the middle [m].
            far: distance from the middle [m].
            holes: boxes that are left out [m], each of shape (2, 3).
            inset: distance from the planes through the corners [m].
            embed: how far it reaches beyond them at its near face [m]; there its neighbours are solid.
        """
        ends = near * self.slope + embed - inset * self.secant, far * self.slope - inset * self.secant
        block = pierced_block(np.array([near, -max(ends), 0.0]), np.array([far, max(ends), CEILING_M]), holes)
        return slanted(block, 1, (-ends[0], -ends[1]), ends)


def make_rotunda(*, sides: int = 6, seed: int = 0, furnished: bool = True) -> Scene:
    """A building of one storey over a regular polygon: rooms, a ring corridor, and a court open to the sky.

    Each side has a room with an outer window, a door to the corridor, about half the time a window beside it, and now
    and then a door to the next room. The first room is the hall, open to the corridor and with a door outdoors; the
    court has a door from there, and a window to the corridor on the other sides. Walls, slab and roof are closed
    occluders; furniture is detail and turned with its room. Rooms, corridor and court are spaces.

    Args:
        sides: of the building, 3 to 64.
        seed: decides doors between rooms, inner windows, and where furniture stands.
        furnished: whether furniture stands in the rooms.

    Returns:
        The same scene for the same arguments, about its middle.

    Raises:
        InputError: a number is out of range.
    """
    least, most = SIDES
    if not least <= sides <= most:
        raise InputError(f"sides: expected {least} to {most}, found {sides}")
    if seed < 0:
        raise InputError(f"seed: expected 0 or more, found {seed}")
    rng = np.random.default_rng(seed)
    ring = _ring(sides)
    works = Works()
    _slabs(works, ring)
    rooms, faces = _rooms(ring), [[] for _ in range(sides)]
    for side in range(sides):
        _walls(works, ring, rooms[side], side, faces[side], rng)
    for side in range(sides):
        _partition(works, ring, rooms, side, rng)
    for side, room in enumerate(rooms):
        works.room(room.name, ring.strip(ring.room, ring.outer, [], inset=WALL_M / 2), ring.frame(side))
    if furnished:
        _furnish(works, ring, rooms, faces, rng)
    return works.scene(f"make_rotunda(sides={sides}, seed={seed}, furnished={furnished})")


def _ring(sides: int) -> Ring:
    """The smallest building of so many sides."""
    least = LEAST_SIDE_M / 2 / np.tan(np.pi / sides)
    room = max(LEAST_APOTHEM_M, float(np.ceil(least * 32) / 32))
    passage = room - WALL_M
    corridor = passage - CORRIDOR_M
    return Ring(sides, corridor - WALL_M, corridor, passage, room, room + ROOM_DEPTH_M)


def _slabs(works: Works, ring: Ring) -> None:
    """The slab under all, the roof over all but the court, and the two spaces that go round."""
    outline, still = partial(regular, ring.sides), np.eye(4)
    outside = outline(ring.outer + OUTER_WALL_M)
    works.put("IfcSlab", "slab", prism(outside, [], -SLAB_M, 0.0), still)
    works.put("IfcRoof", "roof", prism(outside, [outline(ring.court)], CEILING_M, STOREY_M), still)
    works.room("corridor", prism(outline(ring.passage), [outline(ring.corridor)], 0.0, CEILING_M), still)
    works.room("court", prism(outline(ring.court), [], 0.0, CEILING_M), still)


def _rooms(ring: Ring) -> list[Room]:
    """A room on each side, by the largest box in its own frame that is as deep as the room."""
    half = ring.room * ring.slope - WALL_M / 2 * ring.secant
    low, high = np.array([ring.room, -half, 0.0]), np.array([ring.outer, half, CEILING_M])
    kinds = ["hall", *["office"] * (ring.sides - 1)]
    return [Room(f"{number} {kind}", kind, low, high) for number, kind in enumerate(kinds, start=1)]


def _hole(depths: tuple[float, float], along: tuple[float, float], levels: tuple[float, float]) -> np.ndarray:
    """An opening through a wall, shape (2, 3) [m]."""
    return np.array([[depths[0], along[0], levels[0]], [depths[1], along[1], levels[1]]])


def _fill(works: Works, hole: np.ndarray, axis: int, filling: str, name: str, frame: np.ndarray) -> None:
    """A door leaf or a pane in the middle of an opening, and the opening itself; `axis` is across the wall."""
    works.open(hole, frame)
    if not filling:
        return
    kind, thickness = FILLINGS[filling]
    leaf = hole.copy()
    leaf[:, axis] = hole[:, axis].mean() + np.array([-0.5, 0.5]) * thickness
    size = leaf[1] - leaf[0]
    # Equal leaves share a shape, wherever they hang.
    at = frame @ turned(leaf[0], 0.0)
    works.put(kind, f"{filling} of {name}", pierced_block(np.zeros(3), size, []), at, Role.TRANSPARENT)


def _walls(
    works: Works,
    ring: Ring,
    room: Room,
    side: int,
    faces: list[tuple[np.ndarray, float]],
    rng: np.random.Generator,
) -> None:
    """The three walls of a side, with what opens in them; door handles go to `faces`."""
    door, window = (0.0, HEAD_M), (SILL_M, HEAD_M)
    middle, wide = (-DOOR_M / 2, DOOR_M / 2), (-PASSAGE_M / 2, PASSAGE_M / 2)
    hall = room.kind == "hall"
    beside = rng.random() < INNER_WINDOW_SHARE
    inner = [("", wide, door)] if hall else [("door", (-1.25, -0.25), door)]
    if beside and not hall:
        inner.append(("window", (0.25, 1.25), window))
    out = [("door", middle, door)] if hall else [("window", (-1.0, 1.0), window)]
    court = [("door", middle, door)] if hall else [("window", middle, window)]
    frame = ring.frame(side)
    for name, near, far, openings in (
        ("court wall", ring.court, ring.corridor, court),
        ("corridor wall", ring.passage, ring.room, inner),
        ("outer wall", ring.outer, ring.outer + OUTER_WALL_M, out),
    ):
        name = f"{name} of {room.name}"
        holes = [_hole((near, far), along, levels) for _, along, levels in openings]
        works.put("IfcWall", name, ring.strip(near, far, holes, embed=EMBED_M), frame)
        for (filling, along, _), hole in zip(openings, holes, strict=True):
            _fill(works, hole, 0, filling, name, frame)
            if filling == "door":
                faces += _handles((near + far) / 2, along[0])
            if filling != "window" and name.startswith(("corridor", "outer")):
                room.doors.append(np.array([(near + far) / 2, sum(along) / 2, 0.0]))


def _handles(across: float, along: float) -> list[tuple[np.ndarray, float]]:
    """Where handles go on both faces of a leaf across x, and the angle that turns +y away from it."""
    half = FILLINGS["door"][1] / 2
    return [(np.array([across + sign * half, along + 0.1, 1.0]), -sign * np.pi / 2) for sign in (1, -1)]


def _partition(works: Works, ring: Ring, rooms: list[Room], side: int, rng: np.random.Generator) -> None:
    """The wall between a room and the next, along the plane through the corners; now and then with a door."""
    half, name = WALL_M / 2, f"wall between {rooms[side].name} and {rooms[(side + 1) % ring.sides].name}"
    # Its ends lie within the walls that it meets: those stand askew to it.
    near = ring.room * ring.secant - half * ring.slope - EMBED_M
    far = ring.outer * ring.secant + EMBED_M
    holes = []
    if rng.random() < INNER_DOOR_SHARE:
        start = (near + far - DOOR_M) / 2
        holes = [_hole((start, start + DOOR_M), (-half, half), (0.0, HEAD_M))]
    block = pierced_block(np.array([near, -half, 0.0]), np.array([far, half, CEILING_M]), holes)
    frame = ring.frame(side + 0.5)
    works.put("IfcWall", name, block, frame)
    for hole in holes:
        _fill(works, hole, 1, "door", name, frame)
        middle = frame @ np.append(hole.mean(axis=0) * [1, 1, 0], 1.0)
        for number in (side, (side + 1) % ring.sides):
            rooms[number].doors.append((np.linalg.inv(ring.frame(number)) @ middle)[:3])


def _furnish(
    works: Works, ring: Ring, rooms: list[Room], faces: list[list[tuple[np.ndarray, float]]], rng: np.random.Generator
) -> None:
    """Furniture in every room, square to its walls, and a plant in the court."""
    parts: list[tuple[Slots, np.ndarray]] = [
        (free_slots([room], handles, rng), ring.frame(side))
        for side, (room, handles) in enumerate(zip(rooms, faces, strict=True))
    ]
    slots, first = gathered(parts, rng), len(works.definitions)
    works.definitions += furniture_shapes()
    works.objects += placed_pieces(slots, wanted_pieces(rooms, slots), first)
    plant = first + [piece.name for piece in FURNITURE].index("plant")
    works.objects.append(Instance("plant of the court", "IfcFurniture", plant, np.eye(4), Role.DETAIL))
