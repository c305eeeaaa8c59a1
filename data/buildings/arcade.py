"""A corridor with arched windows and an octagonal passage: what is left oblique in a building on the axes.

After the scene of Lei and Ouhyoung 1998, "Carving", section 5: a storey whose only shapes off the axes are eight arched
windows along a hallway, of 24 faces each, and, downstairs, a passage that is a regular octagon.
"""

import numpy as np

from ..errors import InputError
from ..scene import Instance, Role, Scene
from .furnish import Room, free_slots, furniture_shapes, placed_pieces, turned, wanted_pieces
from .furniture import FURNITURE
from .plans import ROOM_DEPTH_M
from .prisms import Ring, wall
from .shapes import pierced_block
from .shell import DOOR_M, FILLINGS, HEAD_M, OUTER_WALL_M, PANE_M, SLAB_M, STOREY_M, WALL_M
from .works import Works

WINDOWS, SEGMENTS = (1, 100), (2, 64)
# Lengths in metres, all multiples of 1/32.
BAY_M, CORRIDOR_M, HALL_M = 3.0, 2.75, 6.0
ARCH_M, SILL_M, SPRING_M = 1.75, 0.75, 1.75
OCTAGON_M = 2.25
COURT_M, GARDEN_WALL_M = 6.0, 2.5
BAYS_A_ROOM = 2
CEILING_M = STOREY_M - SLAB_M
STILL = np.eye(4)


def make_arcade(*, windows: int = 8, segments: int = 12, seed: int = 0, furnished: bool = True) -> Scene:
    """A corridor with arched windows to a court, rooms on its other side, and a hall behind an octagonal passage.

    Seen from above, north up (d: door, (): arched windows, <: the passage):

        +--------+--------+--------+--------+---------+
        | office | office | office | office |         |
        +---d----+---d----+---d----+---d----+  hall   |
        d              corridor             <         |
        +-( )( )-( )( )-( )( )-( )( )-------+----d----+
        |              court                          |
        +---------------------------------------------+

    Walls are closed solids, those with an arch too; with slab and roof they are occluders. The walls' edges are on the
    axes but for those of arches and octagon. Panes and door leaves are transparent, furniture is detail. All rooms and
    the court are spaces.

    Args:
        windows: arched windows, 1 to 100; the corridor has a bay of 3 m for each.
        segments: straight pieces of an arch, an even number from 2 to 64.
        seed: decides where furniture stands.
        furnished: whether furniture stands in the rooms, and plants in the court.

    Returns:
        The same scene for the same arguments.

    Raises:
        InputError: a number is out of range.
    """
    for what, count, (least, most) in (("windows", windows, WINDOWS), ("segments", segments, SEGMENTS)):
        if not least <= count <= most:
            raise InputError(f"{what}: expected {least} to {most}, found {count}")
    if segments % 2:
        raise InputError(f"segments: expected an even number, found {segments}")
    if seed < 0:
        raise InputError(f"seed: expected 0 or more, found {seed}")
    build = _Arcade(windows, segments)
    build.walls()
    build.spaces()
    if furnished:
        build.furnish(np.random.default_rng(seed))
    text = f"make_arcade(windows={windows}, segments={segments}, seed={seed}, furnished={furnished})"
    return build.works.scene(text)


def arch(width: float, sill: float, spring: float, segments: int) -> Ring:
    """A window with a round arch, corners in x and z [m] about x = 0, shape (segments + 3, 2), counterclockwise.

    Args:
        width: of the window, and twice the arch's radius.
        sill: z of the lower edge.
        spring: z where the arch begins.
        segments: straight pieces of the arch.
    """
    turn = np.linspace(0.0, np.pi, segments + 1)
    curve = np.column_stack([np.cos(turn), np.sin(turn)]) * width / 2 + [0.0, spring]
    # Both ends and the crown exactly, so that they lie on the grid.
    curve[0], curve[-1], curve[segments // 2] = (width / 2, spring), (-width / 2, spring), (0.0, spring + width / 2)
    return np.concatenate([[[-width / 2, sill], [width / 2, sill]], curve])


def octagon(width: float) -> Ring:
    """A regular octagon that stands on z = 0 about x = 0, corners in x and z [m], shape (8, 2), counterclockwise."""
    half, side = width / 2, width / 2 * (np.sqrt(2.0) - 1.0)
    x = np.array([side, half, half, side, -side, -half, -half, -side])
    z = half + np.array([-half, -side, side, half, half, side, -side, -half])
    return np.column_stack([x, z])


class _Arcade:
    """The building under construction; x runs along the corridor, from the outside of the west wall."""

    def __init__(self, windows: int, segments: int):
        self.works, self.windows, self.segments = Works(), windows, segments
        self.east = OUTER_WALL_M + windows * BAY_M
        self.hall = self.east + WALL_M, self.east + WALL_M + HALL_M
        self.corridor = OUTER_WALL_M, OUTER_WALL_M + CORRIDOR_M
        self.rooms_from = self.corridor[1] + WALL_M
        self.north = self.rooms_from + ROOM_DEPTH_M
        bays = range(0, windows, BAYS_A_ROOM)
        starts = [OUTER_WALL_M + bay * BAY_M + (WALL_M / 2 if bay else 0.0) for bay in bays]
        ends = [OUTER_WALL_M + bay * BAY_M - WALL_M / 2 for bay in bays[1:]]
        self.rooms = [
            Room(
                f"{number} office", "office", np.array([a, self.rooms_from, 0.0]), np.array([b, self.north, CEILING_M])
            )
            for number, (a, b) in enumerate(zip(starts, [*ends, self.east], strict=True), start=1)
        ]
        low, high = (self.hall[0], OUTER_WALL_M, 0.0), (self.hall[1], self.north, CEILING_M)
        self.rooms.append(Room("hall", "open", np.array(low), np.array(high)))
        self.door_faces: list[tuple[np.ndarray, float]] = []

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Outer corners of the building on the ground [m]."""
        return np.zeros(2), np.array([self.hall[1] + OUTER_WALL_M, self.north + OUTER_WALL_M])

    def block(self, kind: str, name: str, low: tuple, high: tuple, holes: list[np.ndarray] | None = None) -> None:
        """A box between two corners [m] without holes."""
        self.works.put(kind, name, pierced_block(np.array(low), np.array(high), holes or []), STILL)

    def door(self, low: tuple[float, float], high: tuple[float, float], name: str, rooms: list[Room]) -> np.ndarray:
        """A door between two corners on the ground [m], with its leaf and handles; the hole, shape (2, 3)."""
        hole = np.array([[*low, 0.0], [*high, HEAD_M]])
        self.works.open(hole, STILL)
        across = int(high[1] - low[1] < high[0] - low[0])
        kind, thickness = FILLINGS["door"]
        leaf, middle = hole.copy(), hole[:, across].mean()
        leaf[:, across] = middle + np.array([-0.5, 0.5]) * thickness
        self.works.put(kind, f"door of {name}", pierced_block(*leaf, []), STILL, Role.TRANSPARENT)
        for sign, angle in ((1, (-np.pi / 2, 0.0)), (-1, (np.pi / 2, np.pi))):
            handle = np.array([0.0, 0.0, 1.0])
            handle[1 - across], handle[across] = hole[0, 1 - across] + 0.1, middle + sign * thickness / 2
            self.door_faces.append((handle, angle[across]))
        for room in rooms:
            room.doors.append(hole.mean(axis=0) * [1, 1, 0])
        return hole

    def walls(self) -> None:
        """Everything that occludes, and what fills it."""
        (west, south), (east, north) = self.ends
        self.block("IfcSlab", "slab", (west, -COURT_M - OUTER_WALL_M, -SLAB_M), (east, north, 0.0))
        self.block("IfcRoof", "roof", (west, south, CEILING_M), (east, north, STOREY_M))
        self.arches()
        self.passage()
        middle = sum(self.corridor) / 2
        entrance = self.door((0.0, middle - DOOR_M / 2), (OUTER_WALL_M, middle + DOOR_M / 2), "the corridor", [])
        self.block("IfcWall", "west wall", (0.0, 0.0, 0.0), (OUTER_WALL_M, north, CEILING_M), [entrance])
        self.block("IfcWall", "north wall", (OUTER_WALL_M, self.north, 0.0), (self.hall[1], north, CEILING_M))
        self.block("IfcWall", "east wall", (self.hall[1], 0.0, 0.0), (east, north, CEILING_M))
        x = sum(self.hall) / 2
        gate = self.door((x - DOOR_M / 2, 0.0), (x + DOOR_M / 2, OUTER_WALL_M), "the hall", [self.rooms[-1]])
        self.block(
            "IfcWall", "south wall of the hall", (self.east, 0.0, 0.0), (self.hall[1], OUTER_WALL_M, CEILING_M), [gate]
        )
        for room, after in zip(self.rooms[:-2], self.rooms[1:-1], strict=True):
            low, high = (room.high[0], self.rooms_from, 0.0), (after.low[0], self.north, CEILING_M)
            self.block("IfcWall", f"wall between {room.name} and {after.name}", low, high)
        for room in self.rooms[:-1]:
            self.corridor_wall(room)
        self.garden()

    def arches(self) -> None:
        """The corridor's south wall, a piece for each bay, its windows in their arches."""
        hole = arch(ARCH_M, SILL_M, SPRING_M, self.segments)
        half = BAY_M / 2
        panel = wall([[-half, 0.0], [half, 0.0], [half, CEILING_M], [-half, CEILING_M]], [hole], 0.0, OUTER_WALL_M)
        pane = wall(hole, [], (OUTER_WALL_M - PANE_M) / 2, (OUTER_WALL_M + PANE_M) / 2)
        low, high = hole.min(axis=0), hole.max(axis=0)
        box = np.array([[low[0], 0.0, low[1]], [high[0], OUTER_WALL_M, high[1]]])
        for number in range(self.windows):
            frame = turned(np.array([OUTER_WALL_M + (number + 0.5) * BAY_M, 0.0, 0.0]), 0.0)
            self.works.put("IfcWall", f"arched wall {number + 1}", panel, frame)
            self.works.put("IfcWindow", f"arched window {number + 1}", pane, frame, Role.TRANSPARENT)
            self.works.open(box, frame)

    def passage(self) -> None:
        """The wall between the corridor and the hall, with the octagon, and its way on past the last room."""
        ring, half = octagon(OCTAGON_M), (self.corridor[1] - self.corridor[0]) / 2
        # From the octagon's lower edge round it, then round the wall: an outline without holes.
        around = np.concatenate([ring[-1:], ring[-2::-1]])
        corners = [[half, 0.0], [half, CEILING_M], [-half, CEILING_M], [-half, 0.0]]
        outline = np.concatenate([around, corners])
        mesh = wall(outline, [], 0.0, WALL_M)
        # Turned by a quarter: what was along x is along y, and what was its front is its east.
        frame = turned(np.array([self.east + WALL_M, sum(self.corridor) / 2, 0.0]), np.pi / 2)
        self.works.put("IfcWall", "octagonal passage", mesh, frame)
        low, high = ring.min(axis=0), ring.max(axis=0)
        self.works.open(np.array([[low[0], 0.0, low[1]], [high[0], WALL_M, high[1]]]), frame)
        low, high = (self.east, self.corridor[1], 0.0), (self.hall[0], self.north, CEILING_M)
        self.block("IfcWall", "west wall of the hall", low, high)

    def corridor_wall(self, room: Room) -> None:
        """The wall between a room and the corridor, over the end of the partition behind it."""
        last = room is self.rooms[-2]
        after = self.rooms[self.rooms.index(room) + 1]
        east = self.east if last else after.low[0]
        x = (room.low[0] + room.high[0]) / 2
        low, high = (x - DOOR_M / 2, self.corridor[1]), (x + DOOR_M / 2, self.rooms_from)
        hole = self.door(low, high, room.name, [room])
        low, high = (room.low[0], self.corridor[1], 0.0), (east, self.rooms_from, CEILING_M)
        self.block("IfcWall", f"south wall of {room.name}", low, high, [hole])

    def garden(self) -> None:
        """The walls around the court."""
        east, south = self.ends[1][0], -COURT_M - OUTER_WALL_M
        self.block("IfcWall", "south wall of the court", (0.0, south, 0.0), (east, -COURT_M, GARDEN_WALL_M))
        self.block("IfcWall", "west wall of the court", (0.0, -COURT_M, 0.0), (OUTER_WALL_M, 0.0, GARDEN_WALL_M))
        low, high = (east - OUTER_WALL_M, -COURT_M, 0.0), (east, 0.0, GARDEN_WALL_M)
        self.block("IfcWall", "east wall of the court", low, high)

    def spaces(self) -> None:
        """Rooms, corridor and court."""
        boxes = [(room.name, room.low, room.high) for room in self.rooms]
        (low, high), outer = self.corridor, OUTER_WALL_M
        boxes.append(("corridor", (outer, low, 0.0), (self.east, high, CEILING_M)))
        boxes.append(("court", (outer, -COURT_M, 0.0), (self.hall[1], 0.0, GARDEN_WALL_M)))
        for name, low, high in boxes:
            self.works.room(name, pierced_block(np.array(low), np.array(high), []), STILL)

    def furnish(self, rng: np.random.Generator) -> None:
        """Furniture in the rooms and the hall, and a plant before every window."""
        slots, first = free_slots(self.rooms, self.door_faces, rng), len(self.works.definitions)
        self.works.definitions += furniture_shapes()
        self.works.objects += placed_pieces(slots, wanted_pieces(self.rooms, slots), first)
        plant = first + [piece.name for piece in FURNITURE].index("plant")
        for number in range(self.windows):
            across, away = rng.uniform(-0.75, 0.75), rng.uniform(1.5, COURT_M - 1.0)
            at = np.array([OUTER_WALL_M + (number + 0.5) * BAY_M + across, -away, 0.0])
            name = f"plant {number + 1} of the court"
            self.works.objects.append(Instance(name, "IfcFurniture", plant, turned(at, 0.0), Role.DETAIL))
