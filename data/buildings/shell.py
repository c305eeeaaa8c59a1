"""Walls, slabs, stairs, doors and windows of a plan, with the rooms between them.

All faces are axial and on multiples of 1/32 m; sills, heads and partitions line up, so that few planes cut the
building.
"""

from dataclasses import dataclass, field
from itertools import accumulate, pairwise

import numpy as np

from ..scene import Definition, Instance, Mesh, Role, Space
from .furnish import Room, turned
from .plans import BAY_M, CORRIDOR_M, Plan
from .shapes import lattice_mesh, pierced_block

# Lengths in metres, all multiples of 1/32.
OUTER_WALL_M = 10 / 32
WALL_M = 8 / 32
SLAB_M = 10 / 32
STOREY_M = 3.5
DOOR_M = 1.0
PASSAGE_M = 1.5
HEAD_M = 68 / 32
SILL_M = 1.0
LEAF_M = 2 / 32
PANE_M = 1 / 32
RISER_M = 8 / 32
TREAD_M = 9 / 32
STEPS = 7  # in each of two flights
FLIGHT_M = 1.5
ARRIVAL_M = 1.25
LANDING_M = 49 / 32
INNER_WINDOW_SHARE = 0.5
INNER_DOOR_SHARE = 0.1
FILLINGS = {"door": ("IfcDoor", LEAF_M), "window": ("IfcWindow", PANE_M)}


@dataclass(frozen=True)
class Opening:
    """An opening in a wall: from low to high along it, from foot to head above the floor [m].

    Attributes:
        filling: "door", "window" or nothing.
    """

    low: float
    high: float
    foot: float = 0.0
    head: float = HEAD_M
    filling: str = ""


@dataclass
class Shell:
    """The building without furniture; `build` fills it.

    Attributes:
        joined: whether the west and the east ends of corridors open into another wing, in place of an entrance and
            of windows.
        rows: rooms by floor and row, from the west.
        door_faces: where handles go [m], and the angle that turns +y away from the door.
    """

    plan: Plan
    rng: np.random.Generator
    joined: tuple[bool, bool] = (False, False)
    definitions: list[Definition] = field(default_factory=list)
    objects: list[Instance] = field(default_factory=list)
    rows: list[list[list[Room]]] = field(default_factory=list)
    corridors: list[list[Room]] = field(default_factory=list)
    openings: list[np.ndarray] = field(default_factory=list)
    door_faces: list[tuple[np.ndarray, float]] = field(default_factory=list)
    _known: dict[tuple, int] = field(default_factory=dict)

    def build(self) -> None:
        """Put up every floor, then the roof."""
        for floor in range(len(self.plan.floors)):
            self._lay_out(floor)
            self._slab(floor)
            self._outer_walls(floor)
            self._inner_walls(floor)
            self._stairs(floor)
        low, high = self._inner()
        top = len(self.plan.floors) * STOREY_M
        roof = np.array([[*(low - OUTER_WALL_M), top - SLAB_M], [*(high + OUTER_WALL_M), top]])
        self._block("IfcRoof", "roof", roof, [])

    def rooms(self) -> list[Room]:
        """All rooms, floor by floor."""
        return [
            room
            for rows, corridors in zip(self.rows, self.corridors, strict=True)
            for band in (*rows, corridors)
            for room in band
        ]

    def spaces(self) -> list[Space]:
        """The rooms as closed boxes."""
        boxes = [(room.name, pierced_block(room.low, room.high, [])) for room in self.rooms()]
        return [Space(name, box.vertices, box.faces) for name, box in boxes]

    def footprint(self) -> tuple[float, float]:
        """Length and width over all [m]; the south-west corner is the origin."""
        east, north = self._inner()[1] + OUTER_WALL_M
        return float(east), float(north)

    def levels(self) -> list[tuple[float, float]]:
        """Floor and ceiling of each storey [m]."""
        return [self._levels(floor) for floor in range(len(self.plan.floors))]

    def _inner(self) -> np.ndarray:
        """Rectangle within the outer walls [m], shape (2, 2): low, high."""
        bands = self._bands()
        return np.array([[OUTER_WALL_M, bands[0][0]], [OUTER_WALL_M + self.plan.units * BAY_M - WALL_M, bands[-1][1]]])

    def _bands(self) -> list[tuple[float, float]]:
        """South and north ends of row, corridor, row, ... [m]."""
        depths = [self.plan.depths[0]]
        for depth in self.plan.depths[1:]:
            depths += [CORRIDOR_M, depth]
        starts = accumulate((depth + WALL_M for depth in depths), initial=OUTER_WALL_M)
        return [(start, start + depth) for start, depth in zip(starts, depths, strict=False)]

    def _levels(self, floor: int) -> tuple[float, float]:
        """Floor and ceiling [m]."""
        return floor * STOREY_M, (floor + 1) * STOREY_M - SLAB_M

    def _lay_out(self, floor: int) -> None:
        foot, ceiling = self._levels(floor)
        inner, bands = self._inner(), self._bands()
        rows = []
        for row, (south, north) in enumerate(bands[::2]):
            rooms, west = [], OUTER_WALL_M
            for number, bay in enumerate(self.plan.floors[floor][row], start=1):
                east = west + bay.units * BAY_M - WALL_M
                name = f"{floor + 1}.{row + 1}{number:02d} {bay.kind}"
                box = np.array([[west, south, foot], [east, north, ceiling]])
                rooms.append(Room(name, bay.kind, *box))
                west = east + WALL_M
            rows.append(rooms)
        corridors = []
        for number, (south, north) in enumerate(bands[1::2], start=1):
            box = np.array([[inner[0, 0], south, foot], [inner[1, 0], north, ceiling]])
            corridors.append(Room(f"{floor + 1}.{number} corridor", "corridor", *box))
        self.rows.append(rows)
        self.corridors.append(corridors)

    def _block(
        self, kind: str, name: str, box: np.ndarray, openings: list[np.ndarray], role: Role = Role.OCCLUDER
    ) -> None:
        """One object: a box, shape (2, 3) [m], without the openings; equal blocks share a definition."""
        low, high = box
        relative = [opening - low for opening in openings]
        key = (kind, role, tuple(high - low), tuple(opening.tobytes() for opening in relative))
        if key not in self._known:
            self._define(key, name, pierced_block(low - low, high - low, relative))
        self.objects.append(Instance(name, kind, self._known[key], turned(low, 0.0), role))

    def _define(self, key: tuple, name: str, mesh: Mesh) -> None:
        self._known[key] = len(self.definitions)
        self.definitions.append(Definition(name, (mesh,)))

    def _wall(self, name: str, box: np.ndarray, axis: int, openings: list[Opening]) -> None:
        """A wall along x (axis 0) or y (axis 1), its doors and its windows."""
        foot = box[1, 2] - (STOREY_M - SLAB_M)
        cut = []
        for number, opening in enumerate(openings, start=1):
            clear = box.copy()
            clear[:, axis] = opening.low, opening.high
            clear[:, 2] = foot + opening.foot, foot + opening.head
            cut.append(clear)
            if opening.filling:
                self._fill(f"{opening.filling} {number} of {name}", clear, axis, opening.filling)
        self.openings += cut
        self._block("IfcWall", name, box, cut)

    def _fill(self, name: str, opening: np.ndarray, axis: int, filling: str) -> None:
        """A door leaf or a pane in the middle of a wall."""
        kind, thickness = FILLINGS[filling]
        leaf, across = opening.copy(), 1 - axis
        middle = opening[:, across].mean()
        leaf[:, across] = middle - thickness / 2, middle + thickness / 2
        self._block(kind, name, leaf, [], Role.TRANSPARENT)
        if filling == "door":
            for side, angle in ((1, (0.0, -np.pi / 2)), (-1, (np.pi, np.pi / 2))):
                handle = np.array([0.0, 0.0, opening[0, 2] + 1.0])
                handle[axis] = opening[0, axis] + 0.1
                handle[across] = middle + side * thickness / 2
                self.door_faces.append((handle, angle[axis]))

    def _slab(self, floor: int) -> None:
        low, high = self._inner()
        top = floor * STOREY_M
        voids = []
        if floor:
            found = [self._void(room) for row in self.rows[floor] for room in row]
            voids = [void for void in found if void is not None]
        self._block("IfcSlab", f"slab {floor + 1}", np.array([[*low, top - SLAB_M], [*high, top]]), voids)
        self.openings += voids

    def _void(self, room: Room) -> np.ndarray | None:
        """Where the slab under a room is open to the floor below, shape (2, 3) [m]."""
        box = np.array([room.low, room.high])
        box[:, 2] = room.low[2] - SLAB_M, room.low[2]
        if room.kind == "stair":
            box[0, 1] += ARRIVAL_M
            box[1, 1] = box[0, 1] + STEPS * TREAD_M + LANDING_M
        return box if room.kind in ("stair", "atrium") else None

    def _outer_walls(self, floor: int) -> None:
        foot, ceiling = self._levels(floor)
        inner, bands = self._inner(), self._bands()
        outer = inner + np.array([[-OUTER_WALL_M], [OUTER_WALL_M]])
        for side, row, y in (
            ("south", self.rows[floor][0], (outer[0, 1], inner[0, 1])),
            ("north", self.rows[floor][-1], (inner[1, 1], outer[1, 1])),
        ):
            for number, room in enumerate(row):
                west = room.low[0] if number else outer[0, 0]
                east = room.high[0] + WALL_M if number < len(row) - 1 else outer[1, 0]
                box = np.array([[west, y[0], foot - SLAB_M], [east, y[1], ceiling]])
                self._wall(f"{side} wall of {room.name}", box, 0, self._outer_openings(room, floor))
        ends = ("west", (outer[0, 0], inner[0, 0])), ("east", (inner[1, 0], outer[1, 0]))
        for (side, x), joined in zip(ends, self.joined, strict=True):
            for band, (south, north) in enumerate(bands):
                box = np.array([[x[0], south, foot - SLAB_M], [x[1], north, ceiling]])
                box[1, 1] += WALL_M if band < len(bands) - 1 else 0.0
                openings = []
                if band % 2:
                    entrance = side == "west" and floor == 0
                    openings = [_corridor_end((south + north) / 2, joined, entrance)]
                self._wall(f"{side} wall {floor + 1}.{band + 1}", box, 1, openings)

    def _outer_openings(self, room: Room, floor: int) -> list[Opening]:
        if room.kind == "stair":
            return []
        openings = [Opening(middle - 1.0, middle + 1.0, SILL_M, HEAD_M, "window") for middle in _unit_middles(room)]
        if room.kind == "open" and floor == 0:
            middle = _unit_middles(room)[0]
            openings[0] = Opening(middle - DOOR_M / 2, middle + DOOR_M / 2, filling="door")
            room.doors.append(np.array([middle, room.low[1], room.low[2]]))
        return openings

    def _inner_walls(self, floor: int) -> None:
        rows = self.rows[floor]
        for row, rooms in enumerate(rows):
            for room, neighbour in pairwise(rooms):
                self._partition(room, neighbour)
            for room in rooms:
                # The wall goes on over the end of the partition, so that walls meet face to face.
                east = room.high[0] + (WALL_M if room is not rooms[-1] else 0.0)
                if row < len(rows) - 1:
                    self._corridor_wall(room, "north", room.high[1], east)
                if row > 0:
                    self._corridor_wall(room, "south", room.low[1] - WALL_M, east)

    def _corridor_wall(self, room: Room, side: str, south: float, east: float) -> None:
        foot, ceiling = room.low[2], room.high[2]
        openings = self._corridor_openings(room, side)
        for opening in openings:
            if opening.foot == 0.0:
                room.doors.append(np.array([(opening.low + opening.high) / 2, south + WALL_M / 2, foot]))
        box = np.array([[room.low[0], south, foot], [east, south + WALL_M, ceiling]])
        self._wall(f"{side} wall of {room.name}", box, 0, openings)

    def _corridor_openings(self, room: Room, side: str) -> list[Opening]:
        middles = _unit_middles(room)
        middle = (room.low[0] + room.high[0]) / 2
        if room.kind in ("open", "hall"):
            half = 1.5 if room.kind == "open" else 1.0
            return [Opening(middle - half, middle + half)]
        if room.kind == "atrium":
            # Open up to the ceiling; above ground there is a parapet.
            foot = SILL_M if room.low[2] else 0.0
            return [Opening(room.low[0] + 0.5, room.high[0] - 0.5, foot, STOREY_M - SLAB_M)]
        if room.kind == "stair":
            return [Opening(middle - DOOR_M / 2, middle + DOOR_M / 2, filling="door")] if side == "south" else []
        openings = [Opening(middles[0] - 1.25, middles[0] - 0.25, filling="door")]
        for middle in middles:
            if self.rng.random() < INNER_WINDOW_SHARE:
                openings.append(Opening(middle + 0.25, middle + 1.25, SILL_M, HEAD_M, "window"))
        return openings

    def _partition(self, room: Room, neighbour: Room) -> None:
        """The wall between two rooms of a row; now and then with a door."""
        box = np.array([[room.high[0], room.low[1], room.low[2]], [neighbour.low[0], room.high[1], room.high[2]]])
        openings = []
        if all(side.furnished for side in (room, neighbour)) and self.rng.random() < INNER_DOOR_SHARE:
            middle = room.low[1] + 2.0
            openings = [Opening(middle - DOOR_M / 2, middle + DOOR_M / 2, filling="door")]
            for side in (room, neighbour):
                side.doors.append(np.array([box[:, 0].mean(), middle, room.low[2]]))
        self._wall(f"east wall of {room.name}", box, 1, openings)

    def _stairs(self, floor: int) -> None:
        if floor == len(self.plan.floors) - 1:
            return
        for room in (room for row in self.rows[floor] for room in row if room.kind == "stair"):
            width = room.high[0] - room.low[0]
            key = ("IfcStair", float(width))
            if key not in self._known:
                self._define(key, "stair", _stair_mesh(float(width)))
            foot = room.low + np.array([0.0, ARRIVAL_M, 0.0])
            self.objects.append(
                Instance(f"stair of {room.name}", "IfcStair", self._known[key], turned(foot, 0.0), Role.OCCLUDER)
            )


def _corridor_end(middle: float, joined: bool, entrance: bool) -> Opening:
    """What a corridor ends in: a passage into another wing, an entrance, or a window."""
    half = (PASSAGE_M if joined else DOOR_M) / 2
    if joined:
        return Opening(middle - half, middle + half)
    if entrance:
        return Opening(middle - half, middle + half, filling="door")
    return Opening(middle - half, middle + half, SILL_M, filling="window")


def _unit_middles(room: Room) -> list[float]:
    """Middle of each unit of a room, along the row [m]."""
    count = round((room.high[0] - room.low[0] + WALL_M) / BAY_M)
    return [float(room.low[0] + (BAY_M - WALL_M) / 2 + i * BAY_M) for i in range(count)]


def _stair_mesh(width: float) -> Mesh:
    """Two flights of steps, up northwards in the west and back southwards in the east, and the landing between them."""
    xs = np.array([0.0, FLIGHT_M, width - FLIGHT_M, width])
    ys = np.append(np.arange(STEPS + 1) * TREAD_M, STEPS * TREAD_M + LANDING_M)
    zs = np.arange(2 * STEPS + 1) * RISER_M
    solid = np.zeros((3, STEPS + 1, 2 * STEPS), bool)
    for step in range(STEPS):
        solid[0, step, max(0, step - 1) : step + 1] = True
        solid[2, STEPS - 1 - step, STEPS - 1 + step : STEPS + 1 + step] = True
    solid[:, STEPS, STEPS - 2 : STEPS] = True
    return lattice_mesh((xs, ys, zs), solid)
