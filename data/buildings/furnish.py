"""Where furniture goes: places in rooms, on tops, between boards, on ceilings and doors, filled by numbers wanted."""

from dataclasses import dataclass, field
from itertools import zip_longest

import numpy as np

from ..errors import InputError
from ..scene import Definition, Instance, Role
from .furniture import FURNITURE, PIECES, Place

SLOT_M = 1.2
WALL_GAP_M = 0.65
DOOR_GAP_M = 1.0
LAMP_GAP_M = 2.5
# Round things may stand at any angle; the others stand square to the walls.
TURNED = ("chair", "plant", "telephone", "lamp")
# Area in m2 for each piece of furniture, hosts before what stands on them.
AREA_M2 = {
    "desk": 12.0,
    "shelf": 16.0,
    "table": 30.0,
    "plant": 40.0,
    "sofa": 60.0,
    "chair": 8.0,
    "terminal": 18.0,
    "lamp": 20.0,
    "telephone": 24.0,
    "tumbler": 12.0,
    "pencil": 8.0,
    "book": 2.0,
}


@dataclass
class Room:
    """A clear volume of the building.

    Attributes:
        kind: office, meeting, open, lab, classroom, corridor, hall, stair or atrium.
        low: lowest corner [m], shape (3,).
        high: highest corner [m], shape (3,).
        doors: middles of its doors on the floor [m], each of shape (3,).
    """

    name: str
    kind: str
    low: np.ndarray
    high: np.ndarray
    doors: list[np.ndarray] = field(default_factory=list)

    @property
    def furnished(self) -> bool:
        """Whether furniture stands here."""
        return self.kind in ("office", "meeting", "open", "lab", "classroom")

    @property
    def area(self) -> float:
        """Floor area [m2]."""
        return float(np.prod(self.high[:2] - self.low[:2]))


@dataclass
class Slots:
    """Free places: position [m] and angle about z [rad]."""

    free: dict[Place, list[tuple[np.ndarray, float]]]
    rng: np.random.Generator

    def place(self, name: str, count: int, definition_id: int) -> list[Instance]:
        """Instances of one piece on the next free places.

        Raises:
            InputError: there are fewer places than pieces.
        """
        piece = PIECES[name]
        free = self.free[piece.place]
        if count > len(free):
            raise InputError(f"furniture: expected at most {len(free)} more on a {piece.place}, found {count} x {name}")
        taken, self.free[piece.place] = free[:count], free[count:]
        placed = []
        for number, (position, angle) in enumerate(taken):
            if name in TURNED:
                angle += self.rng.uniform(-0.6, 0.6)
            transform = turned(position, angle)
            placed.append(Instance(f"{name} {number + 1}", piece.kind, definition_id, transform, Role.DETAIL))
            self.free[Place.TOP] += [(_at(transform, top), angle) for top in piece.tops]
            self.free[Place.BOARD] += [(_at(transform, board), angle) for board in piece.boards]
        return placed

    def mix_tops(self) -> None:
        """Shuffle the free places on and in furniture."""
        for place in (Place.TOP, Place.BOARD):
            order = self.rng.permutation(len(self.free[place]))
            self.free[place] = [self.free[place][i] for i in order]


def free_slots(rooms: list[Room], door_faces: list[tuple[np.ndarray, float]], rng: np.random.Generator) -> Slots:
    """All places of an empty building; those on furniture come with it.

    Args:
        rooms: the rooms.
        door_faces: where handles go, and the angle that turns +y away from the door.
        rng: shuffles the places within each room.
    """
    floors = [_floor_slots(room, rng) for room in rooms if room.furnished]
    # One place a room in turn, so that what is placed first stands in every room.
    floor = [slot for turn in zip_longest(*floors) for slot in turn if slot is not None]
    ceiling = [slot for room in rooms if room.kind not in ("stair", "atrium") for slot in _ceiling_slots(room)]
    return Slots(
        {Place.FLOOR: floor, Place.TOP: [], Place.BOARD: [], Place.CEILING: ceiling, Place.DOOR: list(door_faces)}, rng
    )


def gathered(parts: list[tuple[Slots, np.ndarray]], rng: np.random.Generator) -> Slots:
    """Places of several parts of a building, each in a frame of its own, shape (4, 4); one of each part in turn."""
    free = {}
    for place in Place:
        columns = []
        for slots, frame in parts:
            turn = float(np.arctan2(frame[1, 0], frame[0, 0]))
            columns.append([(_at(frame, position), angle + turn) for position, angle in slots.free[place]])
        free[place] = [slot for row in zip_longest(*columns) for slot in row if slot is not None]
    return Slots(free, rng)


def furniture_shapes() -> list[Definition]:
    """A shape for each piece, in the order of `FURNITURE`."""
    return [piece.definition() for piece in FURNITURE]


def wanted_pieces(rooms: list[Room], slots: Slots) -> dict[str, int]:
    """Furniture for rooms of this area, hosts first; on the floor no more than there are places."""
    area, left = sum(room.area for room in rooms if room.furnished), len(slots.free[Place.FLOOR])
    wanted = {name: max(1, round(area / each)) for name, each in AREA_M2.items()}
    for name in wanted:
        if PIECES[name].place is Place.FLOOR:
            wanted[name] = min(wanted[name], left)
            left -= wanted[name]
    return wanted | fixed_pieces(slots)


def fixed_pieces(slots: Slots) -> dict[str, int]:
    """A handle on each face of a door, and a lamp at each place for one."""
    return {name: len(slots.free[PIECES[name].place]) for name in ("door handle", "ceiling lamp")}


def placed_pieces(slots: Slots, wanted: dict[str, int], first: int) -> list[Instance]:
    """So many of each piece, in the order given; `first` is the definition of the first piece."""
    ids = {piece.name: first + i for i, piece in enumerate(FURNITURE)}
    placed: list[Instance] = []
    for name, count in wanted.items():
        if name == "terminal":  # all hosts stand: what follows is spread over them
            slots.mix_tops()
        placed += slots.place(name, count, ids[name])
    return placed


def _floor_slots(room: Room, rng: np.random.Generator) -> list[tuple[np.ndarray, float]]:
    slots = []
    for x, y in _spots(room, SLOT_M, WALL_GAP_M):
        position = np.array([x, y, room.low[2]])
        if all(np.abs(position - door).max() > DOOR_GAP_M for door in room.doors):
            slots.append((position, float(rng.integers(4)) * np.pi / 2))
    return [slots[i] for i in rng.permutation(len(slots))]


def _ceiling_slots(room: Room) -> list[tuple[np.ndarray, float]]:
    return [(np.array([x, y, room.high[2]]), 0.0) for x, y in _spots(room, LAMP_GAP_M, 1.0)]


def _spots(room: Room, gap: float, margin: float) -> list[tuple[float, float]]:
    lines = []
    for k in range(2):
        low, high = room.low[k] + margin, room.high[k] - margin
        count = max(1, int((high - low) / gap) + 1)
        lines.append(np.linspace(low, high, count) if count > 1 else [(low + high) / 2])
    return [(float(x), float(y)) for x in lines[0] for y in lines[1]]


def turned(position: np.ndarray, angle: float) -> np.ndarray:
    """Turn about z, then move, shape (4, 4); quarter turns are exact."""
    cosine, sine = np.cos(angle), np.sin(angle)
    if np.isclose(angle % (np.pi / 2), [0, np.pi / 2]).any():
        cosine, sine = np.round(cosine), np.round(sine)
    transform = np.eye(4)
    transform[:2, :2] = [[cosine, -sine], [sine, cosine]]
    transform[:3, 3] = position
    return transform


def _at(transform: np.ndarray, point: tuple[float, float, float]) -> np.ndarray:
    return transform[:3, :3] @ np.array(point) + transform[:3, 3]
