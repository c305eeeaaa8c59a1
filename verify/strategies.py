"""Hypothesis strategies for tests of visibility code, yours or ours; they need `pip install viewcell[test]`.

Most examples lie on or within two grid steps of a coincidence: edges that a sightline touches, doors that just do not
line up, walls that share an edge or leave a slit. Every example prints as a line that can be pasted into a test, and
shrinks towards few and simple parts.

    from hypothesis import given
    from viewcell.verify.strategies import buildings

    @given(buildings())
    def test_my_baker_is_conservative(building):
        viewcell.assert_conservative(my_baker(building.scene), building.scene, building.view_cells)

Coordinates are integer grid steps of 2**-10 m.
"""

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import pairwise, product
from math import ceil, floor

import numpy as np

from ..data.buildings.furnish import turned
from ..data.buildings.wings import LETTERS, Joint, build_foyer, join_wings
from ..data.buildings.works import Works
from ..data.errors import InputError
from ..data.graph import CellGraph
from ..data.opaque import OpaquePlanes
from ..data.portals import find_portals
from ..data.scene import GRID_M, Definition, Instance, Mesh, Role, Scene, Space

__all__ = [
    "Building",
    "Door",
    "Knapsack",
    "OccludedPair",
    "PortalSequence",
    "buildings",
    "knapsacks",
    "occluded_pairs",
    "portal_sequences",
]

try:
    from hypothesis import strategies as st
except ImportError as error:
    raise ImportError("viewcell.verify.strategies needs Hypothesis: pip install viewcell[test]") from error

Point = tuple[int, int, int]
Box = tuple[Point, Point]
# Steps off a coincidence.
NEAR = st.integers(-2, 2)
# Grid steps in a module of a building, and thickness of its walls.
MODULE, WALL = 1024, 128
# Between two wings where they are nearest.
FOYER = 512
# Angles between two wings.
WING_ANGLES_DEG = (30.0, -17.0, 45.0, 60.0, -75.0)
CORNERS = np.array(list(product((0, 1), repeat=3)))
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
FACES = np.array([face for a, b, c, d in QUADS for face in ((a, b, c), (a, c, d))], np.int32)


@dataclass(frozen=True)
class PortalSequence:
    """Boxes that a line of one direction octant may or may not stab.

    Attributes:
        boxes: (low, high corner) of each; flat ones are portals.
        signs: direction octant, three of +-1.
    """

    boxes: tuple[Box, ...]
    signs: Point

    def array(self) -> np.ndarray:
        """The boxes, shape (n, 2, 3), int64."""
        return np.array(self.boxes, np.int64)


@dataclass(frozen=True)
class OccludedPair:
    """A view cell and a target with a few convex polygons between them.

    Attributes:
        cell: (low, high corner), with volume.
        target: corners of a convex polygon.
        occluders: corners of convex polygons, planar.
    """

    cell: Box
    target: tuple[Point, ...]
    occluders: tuple[tuple[Point, ...], ...]


@dataclass(frozen=True)
class Knapsack:
    """A choice of one level for each object under a budget.

    Attributes:
        benefits: of each object's levels.
        costs: the same shape; integers >= 0.
        budget: integer >= 0.
    """

    benefits: tuple[tuple[int, ...], ...]
    costs: tuple[tuple[int, ...], ...]
    budget: int


@dataclass(frozen=True)
class Door:
    """An opening in the wall between a room and the next one.

    Attributes:
        room: column, row and storey of the room.
        axis: 0 or 1 for a door to the next column or row, 2 for a void in the slab above.
        low: of the opening on the two other axes, from the room's low corner.
        high: likewise.
    """

    room: Point
    axis: int
    low: tuple[int, int]
    high: tuple[int, int]


@dataclass(frozen=True)
class Building:
    """Rooms on a grid, walls with openings, and furniture; as it stands, turned, or several of it joined end to end.

    Attributes:
        rooms: columns, rows and storeys.
        doors: openings; two in one wall may touch or overlap. With several wings, those of the last column to the next
            are passages from wing to wing.
        furniture: boxes.
        yaw_deg: by which all of it is turned counter-clockwise about the origin.
        wings: copies of the building, each joined to the last column of the one before by a foyer.
        wing_angle_deg: by which each is turned relative to the one before, -90 to 90.
    """

    rooms: Point
    doors: tuple[Door, ...] = ()
    furniture: tuple[Box, ...] = ()
    yaw_deg: float = 0.0
    wings: int = 1
    wing_angle_deg: float = 0.0

    def room(self, place: Point) -> np.ndarray:
        """Box of a room, shape (2, 3)."""
        low = np.array(place) * MODULE + WALL // 2
        return np.array([low, low + MODULE - WALL])

    @cached_property
    def solids(self) -> list[Box]:
        """Boxes of walls and slabs of the first wing, those around it included; they touch but do not overlap."""
        return self._solids(False, self.wings > 1)

    def _solids(self, west: bool, east: bool) -> list[Box]:
        """Boxes of a wing whose west and east ends may have passages."""
        out = [box for panel in self._panels(west, east) for box in panel[0]]
        # Walls meet in posts and beams, from node to node of the grid.
        for place in product(*(range(n + 1) for n in self.rooms)):
            node = np.array(place) * MODULE - WALL // 2
            out.append(_box(node, node + WALL))
            for axis in range(3):
                if place[axis] < self.rooms[axis]:
                    along = np.arange(3) == axis
                    out.append(_box(node + along * WALL, node + np.where(along, MODULE, WALL)))
        return out

    def _panels(self, west: bool = False, east: bool = False) -> list[tuple[list[Box], list[Box]]]:
        """Walls between rooms and around them, without posts and beams: solid pieces, and open ones, of each."""
        found = []
        for axis in range(3):
            for place in product(*(range(n + (i == axis)) for i, n in enumerate(self.rooms))):
                below = tuple(c - (i == axis) for i, c in enumerate(place))
                open_ = 0 < place[axis] < self.rooms[axis]
                if axis == 0 and place[0] in (0, self.rooms[0]):
                    # A passage stands in both ends that it joins.
                    below, open_ = (self.rooms[0] - 1, *place[1:]), east if place[0] else west
                found.append(
                    self._panel(axis, place, [d for d in self.doors if open_ and (d.axis, d.room) == (axis, below)])
                )
        return found

    def _panel(self, axis: int, place: Point, doors: list[Door]) -> tuple[list[Box], list[Box]]:
        """A wall in pieces, cut along all edges of its doors."""
        low = np.array(place) * MODULE + WALL // 2
        low[axis] -= WALL
        high = low + WALL
        u, v = (i for i in range(3) if i != axis)
        us, vs = (sorted({0, MODULE - WALL, *(c for d in doors for c in (d.low[i], d.high[i]))}) for i in range(2))
        solid, open_ = [], []
        for (a, b), (c, d) in product(pairwise(us), pairwise(vs)):
            start, end = low.copy(), high.copy()
            start[[u, v]], end[[u, v]] = low[[u, v]] + (a, c), low[[u, v]] + (b, d)
            through = any(h.low[0] <= a and b <= h.high[0] and h.low[1] <= c and d <= h.high[1] for h in doors)
            (open_ if through else solid).append(_box(start, end))
        return solid, open_

    @cached_property
    def frames(self) -> tuple[list[np.ndarray], list[Joint]]:
        """Each wing's frame to the scene's [m], shape (4, 4), and the joints between them."""
        size = (np.array(self.rooms[:2]) * MODULE + WALL) * GRID_M
        corner = turned(np.array([-WALL / 2 * GRID_M, -WALL / 2 * GRID_M, 0.0]), 0.0)
        first = turned(np.zeros(3), np.radians(self.yaw_deg)) @ corner
        frames, joints = join_wings(tuple(size), self.wings, self.wing_angle_deg, first, gap=FOYER * GRID_M)
        return [frame @ np.linalg.inv(corner) for frame in frames], joints

    @cached_property
    def scene(self) -> Scene:
        """Walls as occluders, furniture as detail, rooms as spaces; with wings, names begin with A, B and so on."""
        frames, joints = self.frames
        works = Works()
        for number, frame in enumerate(frames):
            wing = self._wing(number > 0, number < self.wings - 1)
            works.take(wing, frame, f"{LETTERS[number]} " if self.wings > 1 else "")
        levels = [(WALL / 2 * GRID_M, (self.rooms[2] * MODULE - WALL / 2) * GRID_M)]
        for number, joint in enumerate(joints):
            build_foyer(works, joint, f"foyer {number}", levels, WALL / 2 * GRID_M)
        return works.scene(repr(self))

    def _wing(self, west: bool, east: bool) -> Scene:
        """One wing on the axes."""
        shape = Definition("box", (Mesh(CORNERS.astype(float), FACES),))
        parts = [(box, f"wall {n}", Role.OCCLUDER) for n, box in enumerate(self._solids(west, east))]
        parts += [(box, f"furniture {n}", Role.DETAIL) for n, box in enumerate(self.furniture)]
        objects = []
        for (low, high), name, role in parts:
            transform = np.eye(4)
            transform[:3, :3] = np.diag(np.subtract(high, low) * GRID_M)
            transform[:3, 3] = np.array(low) * GRID_M
            objects.append(Instance(name, "box", 0, transform, role))
        spaces = []
        for place in product(*map(range, self.rooms)):
            low, high = self.room(place)
            spaces.append(Space(f"room {place}", (low + CORNERS * (high - low)) * GRID_M, FACES))
        return Scene([shape], objects, spaces)

    @cached_property
    def view_cells(self) -> dict[str, list]:
        """One view cell per room [m], wing by wing, as a table that `viewcell.check` takes.

        In rooms that are turned they are the largest boxes that fit, less two grid steps.
        """
        boxes = []
        for frame in self.frames[0]:
            fit = np.abs(frame[:2, :2]).sum(axis=1).max()
            for place in product(*map(range, self.rooms)):
                low, high = self.room(place) * GRID_M
                half, inset = (high - low) / 2, 0.0
                if fit > 1.0:
                    half, inset = half / [fit, fit, 1.0], [2 * GRID_M, 2 * GRID_M, 0.0]
                middle = frame[:3, :3] @ (low + high) / 2 + frame[:3, 3]
                boxes.append([middle - half + inset, middle + half - inset])
        found = np.array(boxes)
        columns: dict[str, list] = {"cell_id": list(range(len(found)))}
        for side, end in enumerate(("min", "max")):
            columns |= {f"{end}_{axis}": found[:, side, i].tolist() for i, axis in enumerate("xyz")}
        return columns

    def graph(self) -> CellGraph:
        """Rooms and doorways of one wing as a bare cell graph, all cells inhabitable."""
        cells = [self.room(place) for place in product(*map(range, self.rooms))]
        cells += [np.array(box) for panel in self._panels() for box in panel[1]]
        graph = find_portals(np.array(cells, np.int32), OpaquePlanes([np.zeros((0, 2, 3), np.int32)] * 3, 0.0, 0.0))
        graph.inhabitable[:] = True
        return graph


def _box(low: np.ndarray, high: np.ndarray) -> Box:
    return tuple(low.tolist()), tuple(high.tolist())


@st.composite
def portal_sequences(draw: st.DrawFn, most: int = 8, size: int = 2_000) -> PortalSequence:
    """Boxes near a common line: each has an edge or a corner within two steps of it, and the line may miss some.

    Args:
        draw: of Hypothesis.
        most: boxes at most.
        size: of the scene [grid steps].
    """
    signs = draw(st.tuples(*[st.sampled_from((1, -1))] * 3))
    way = [draw(st.integers(1, 9)) * sign for sign in signs]
    count = draw(st.integers(2, most))
    times = sorted(draw(st.lists(st.integers(0, size // 10), min_size=count, max_size=count, unique=True)))
    boxes = []
    for time in times:
        flat = draw(st.integers(0, 3))
        low, high = [0, 0, 0], [0, 0, 0]
        for axis in range(3):
            at = time * way[axis]
            # The line passes this far inside the box, on one side or the other; 0 is its edge.
            inside, extent = draw(NEAR), draw(st.integers(0, size // 20))
            ends = (at - inside, at - inside + extent) if draw(st.booleans()) else (at + inside - extent, at + inside)
            low[axis], high[axis] = (at, at) if axis == flat else ends
        boxes.append((tuple(low), tuple(high)))
    return PortalSequence(tuple(boxes), signs)


@st.composite
def occluded_pairs(draw: st.DrawFn, most: int = 4, size: int = 40) -> OccludedPair:
    """Walls across the way from a cell to a rectangle beyond, each in pieces that share an edge or leave a slit.

    Args:
        draw: of Hypothesis.
        most: walls at most; each is one, two or four polygons.
        size: of the scene [grid steps].
    """
    small = st.integers(1, size // 4)
    cell = ((0, 0, 0), (draw(small), draw(small), draw(small)))
    far = size + draw(small)
    start = (draw(st.integers(-size // 4, size // 4)), draw(st.integers(-size // 4, size // 4)))
    end = (start[0] + draw(small), start[1] + draw(small))
    target = ((far, start[0], start[1]), (far, end[0], start[1]), (far, end[0], end[1]), (far, start[0], end[1]))
    occluders = []
    for _ in range(draw(st.integers(0, most))):
        at = draw(st.integers(cell[1][0], far))
        # Where the outermost lines from cell to target cross the wall's plane: edges lie within two steps of them.
        shares = [Fraction(at - x, far - x) if far > x else Fraction(0) for x in (0, cell[1][0])]
        low = [floor(min(s * start[i] for s in shares)) - draw(st.integers(-1, 2)) for i in range(2)]
        high = [
            ceil(max(cell[1][1 + i] + s * (end[i] - cell[1][1 + i]) for s in shares)) + draw(st.integers(-1, 2))
            for i in range(2)
        ]
        high = [max(a + 1, b) for a, b in zip(low, high, strict=True)]
        us, vs = [(low[0], high[0])], [(low[1], high[1])]
        gap = draw(st.integers(0, 1))
        for spans, axis in ((us, 0), (vs, 1)):
            if draw(st.booleans()) and high[axis] - low[axis] > 2 + gap:
                cut = draw(st.integers(low[axis] + 1, high[axis] - 1 - gap))
                spans[:] = [(low[axis], cut), (cut + gap, high[axis])]
        # A wall may lean: its upper edge is moved along x.
        lean = draw(NEAR) if len(us) == len(vs) == 1 else 0
        for (a, b), (c, d) in product(us, vs):
            occluders.append(((at, a, c), (at, b, c), (at + lean, b, d), (at + lean, a, d)))
    return OccludedPair(cell, target, tuple(occluders))


@st.composite
def knapsacks(draw: st.DrawFn, groups: int = 6, levels: int = 4) -> Knapsack:
    """Level choices with ties, dominated and identical objects, and budgets at the edge of what fits.

    Args:
        draw: of Hypothesis.
        groups: objects at most.
        levels: of each at most.
    """
    count = draw(st.integers(1, groups))
    shapes = []
    for number in range(count):
        if number and draw(st.booleans()):
            # Instances of one shape switch at the same price; that breaks plain bisection.
            shapes.append(shapes[draw(st.integers(0, number - 1))])
            continue
        size = draw(st.integers(1, levels))
        costs = sorted(draw(st.lists(st.integers(0, 30), min_size=size, max_size=size)))
        benefits = sorted(draw(st.lists(st.integers(0, 1000), min_size=size, max_size=size)))
        shapes.append((tuple(benefits), tuple(costs)))
    least = sum(min(costs) for _, costs in shapes)
    whole = sum(max(costs) for _, costs in shapes)
    budget = draw(st.one_of(st.integers(0, whole + 1), st.sampled_from([least - 1, least, whole - 1, whole])))
    return Knapsack(tuple(b for b, _ in shapes), tuple(c for _, c in shapes), max(0, budget))


@st.composite
def buildings(
    draw: st.DrawFn,
    columns: int = 3,
    rows: int = 2,
    storeys: int = 1,
    furniture: int = 2,
    yaw: tuple[float, ...] = (0.0,),
    wings: int = 1,
) -> Building:
    """Rooms with doors that line up, or miss each other by a step or two, and furniture near the edges of doors.

    Args:
        draw: of Hypothesis.
        columns: at most.
        rows: at most.
        storeys: at most.
        furniture: pieces at most.
        yaw: angles to choose from, by which a building is turned [degrees].
        wings: at most; with several, a building may stand in any of a few angles to the next.
    """
    rooms = (draw(st.integers(1, columns)), draw(st.integers(1, rows)), draw(st.integers(1, storeys)))
    count = draw(st.integers(1, wings))
    inner, doors = MODULE - WALL, []
    # All doors of a building are about two places, from which they differ by a step or two.
    places = [draw(st.integers(0, inner // 2)) for _ in range(2)]
    for place in product(*map(range, rooms)):
        for axis in range(3):
            passage = axis == 0 and count > 1
            if (passage or place[axis] + 1 < rooms[axis]) and draw(st.integers(0, 3)):
                low, high = [], []
                for _ in range(2):
                    first = min(max(0, draw(st.sampled_from(places)) + draw(NEAR)), inner - 1)
                    width = draw(st.sampled_from((1, 2, 64, inner // 3)))
                    low.append(first)
                    high.append(min(inner, first + width))
                doors.append(Door(place, axis, tuple(low), tuple(high)))
    boxes = []
    for _ in range(draw(st.integers(0, furniture))):
        room = tuple(draw(st.integers(0, n - 1)) for n in rooms)
        corner, box = WALL // 2 + np.array(room) * MODULE, ([], [])
        for axis in range(3):
            first = min(max(0, draw(st.sampled_from(places)) + draw(NEAR)), inner - 2)
            box[0].append(int(corner[axis]) + first)
            box[1].append(int(corner[axis]) + min(inner, first + draw(st.sampled_from((1, 40, 300, 800)))))
        boxes.append((tuple(box[0]), tuple(box[1])))
    angle = draw(st.sampled_from(_clear_angles(rooms, count))) if count > 1 else 0.0
    return Building(rooms, tuple(doors), tuple(boxes), draw(st.sampled_from(yaw)), count, angle)


def _clear_angles(rooms: Point, wings: int) -> list[float]:
    """Angles between wings at which none stands in the way of another."""
    found = []
    for angle in WING_ANGLES_DEG:
        try:
            _ = Building(rooms, wings=wings, wing_angle_deg=angle).frames
        except InputError:
            continue
        found.append(angle)
    return found
