"""Synthetic process plants of any size: a hall of bays with aisles, walkways, pipe racks, tanks and pumps."""

import numpy as np

from ..errors import InputError
from ..scene import Role, Scene
from .machinery import PARTS, lying_vessel, rack_frame, straight_pipe, upright_tank
from .shapes import Ball, block, pierced_block
from .site import Site

TRIANGLES = (50_000, 50_000_000)
BAY_M, HEIGHT_M = 12.0, 13.0
LEVELS_M = (5.0, 9.0)
WALL_M = 0.3
# Shares of bays with a concrete deck on each level, with stairs, and of inner grid lines with a wall.
DECK_SHARE, STAIR_SHARE, WALL_SHARE, GATE_SHARE, VALVE_SHARE = 0.3, 0.3, 0.4, 0.2, 0.3
# Triangles of a bay, about: decides how wide the hall is.
TYPICAL_BAY = 13_000
KINDS = ("tanks", "vessels", "pumps", "spheres", "switchgear", "exchangers")
# Where the rack's first post stands (y), its tiers (z), and the nominal radii of the pipes on a tier [m].
RACK_M, RACK_WIDTH_M = 3.9, 2.6
TIERS_M = (3.3, 4.1, 7.3, 8.1)
RADII_M = (0.2, 0.12, 0.08, 0.16)
# In a wall between bays: a passage for the aisle and one for each walkway; across x also sleeves for the rack's pipes,
# across y one for the cable tray. As (low, high) along the wall, and in height.
PASSAGES = (((0.7, 3.3), (-1.0, 3.0)), ((0.9, 2.6), (5.0, 7.4)), ((0.9, 2.6), (9.0, 11.4)))
SLEEVES = (((3.7, 6.7), (3.0, 4.5)), ((3.7, 6.7), (7.0, 8.5)))
TRAYS = (((10.3, 11.4), (5.7, 6.8)),)


def make_plant(*, seed: int = 0, triangles: int = 100_000) -> Scene:
    """The hall of a process plant, in square bays of 12 m, 13 m high.

    A bay, north up, at ground level; columns (o) stand on the grid, walls or openings on the lines between them:

        o---------------o
        |   |           |
        | a | equipment |      aisles 3 m wide along the south and the west of every bay, gratings with handrails
        | i |           |      above them 5 m and 9 m up, or a concrete deck; a pipe rack between the aisle and the
        | s |  ~ rack ~ |      equipment, four tiers of four pipes from bay to bay
        |   +-----------|
        |     aisle     |
        o---------------o

    Slabs, walls, columns, decks, ducts, tanks, vessels and cabinets are occluders and closed; the rest is detail. All
    meshes are closed and look outwards. Spaces are boxes along the aisles and walkways.

    Args:
        seed: decides what each bay holds and where walls stand.
        triangles: about how many, 50,000 to 50,000,000: the plant grows by bays. Drums make up the last part of a bay.

    Returns:
        The same scene for the same arguments; never more than `triangles`, and within 1 % of it.

    Raises:
        InputError: a number is out of range.
    """
    least, most = TRIANGLES
    if not least <= triangles <= most:
        raise InputError(f"triangles: expected {least:,} to {most:,}, found {triangles:,}")
    if seed < 0:
        raise InputError(f"seed: expected 0 or more, found {seed}")
    return _Plant(seed, triangles).scene(f"make_plant(seed={seed}, triangles={triangles})")


class _Plant(Site):
    """A plant under construction, bay by bay in rows from south to north."""

    def __init__(self, seed: int, triangles: int) -> None:
        super().__init__()
        self._rng = np.random.default_rng(seed)
        self._bays: list[tuple[int, int]] = []
        self._storage: list[tuple[float, float]] = []
        self._define()
        columns = max(2, round(np.sqrt(1.3 * triangles / TYPICAL_BAY)))
        while True:
            before = self.mark(), len(self._storage)
            self._bay(len(self._bays) % columns, len(self._bays) // columns)
            # Columns and outer walls are few beside what a bay holds: they matter at the end only.
            if self.triangles > 0.9 * triangles and self.triangles + self._shell_triangles() > triangles:
                break
        self.reset(before[0])
        del self._bays[-1], self._storage[before[1] :]
        self._shell()
        for x, y, z in [(*at, z) for z in (0.0, 0.88, 1.76) for at in self._storage]:
            if self.triangles + self.count("drum") > triangles:
                break
            self.place("drum", "IfcTank", Role.DETAIL, (x, y, z))

    def _define(self) -> None:
        """All shapes; none depends on the seed."""
        for name, parts in PARTS.items():
            self.define(name, *parts())
        self.define("floor", block((0, 0, -0.3), (BAY_M, BAY_M, 0)))
        self.define("roof", block((0, 0, HEIGHT_M), (BAY_M, BAY_M, HEIGHT_M + 0.25)))
        self.define("deck", block((0, 0, -0.25), (BAY_M, BAY_M, 0)))
        self.define("column", block((-0.3, -0.3, 0), (0.3, 0.3, HEIGHT_M)))
        self.define("duct", block((0.3, -0.5, -0.4), (BAY_M - 0.3, 0.5, 0.4)))
        low, high = np.array([-WALL_M / 2, 0.3, 0]), np.array([WALL_M / 2, BAY_M - 0.3, HEIGHT_M])
        walls = {"wall": (), "gate wall": PASSAGES[:1], "wall x": PASSAGES + SLEEVES, "wall y": PASSAGES + TRAYS}
        for name, openings in walls.items():
            boxes = [np.array([[-1, y0, z0], [1, y1, z1]]) for (y0, y1), (z0, z1) in openings]
            self.define(name, pierced_block(low, high, boxes))
        strips = [((0, 1), (BAY_M, 2.5)), ((1, 0), (2.5, 1)), ((1, 2.5), (2.5, BAY_M))]
        self.define("grating", *(block((*a, -0.04), (*b, 0)) for a, b in strips))
        for number, radius in enumerate(RADII_M):
            self.define(f"pipe {number}", *straight_pipe(BAY_M, radius, valved=False))
            self.define(f"valved pipe {number}", *straight_pipe(BAY_M, radius, valved=True))
        self.define("rack frame", *rack_frame(RACK_WIDTH_M, [z - 0.2 for z in TIERS_M], 8.4))
        self.define("tank", upright_tank(1.9, 1.2, 7.6, 28))
        self.define("vessel", upright_tank(1.1, 1.6, 4.2, 24))
        self.define("sphere", Ball((0, 0, 2.7), 1.3).mesh(20))
        self.define("exchanger", lying_vessel(4.6, 0.9, 24))
        self.define("cabinets", block((0, 0, 0), (3.2, 0.8, 2.1)))

    def _bay(self, i: int, j: int) -> None:
        """One bay with all that stands in it, and its walls to the bays before it."""
        rng = self._rng
        x, y = i * BAY_M, j * BAY_M
        kind = KINDS[rng.integers(len(KINDS))]
        decks = [kind not in ("tanks", "spheres") and rng.random() < DECK_SHARE for _ in LEVELS_M]
        stairs = not any(decks) and rng.random() < STAIR_SHARE
        self.place("floor", "IfcSlab", Role.OCCLUDER, (x, y, 0))
        self.place("roof", "IfcRoof", Role.OCCLUDER, (x, y, 0))
        for neighbour, name, quarters in (((i - 1, j), "wall x", 0), ((i, j - 1), "wall y", 3)):
            if rng.random() < WALL_SHARE and neighbour in self._bays_near(i, j):
                self.place(name, "IfcWall", Role.OCCLUDER, (x, y, 0), quarters)
        for level, deck in zip(LEVELS_M, decks, strict=True):
            if deck:
                self.place("deck", "IfcSlab", Role.OCCLUDER, (x, y, level))
                self._equipment(kind if kind != "exchangers" else "pumps", x, y, level)
            else:
                self._walkway(x, y, level, stairs)
        if stairs:
            self.place("stair low", "IfcStair", Role.DETAIL, (x + 4.2, y + 2.65, 0))
            self.place("stair high", "IfcStair", Role.DETAIL, (x + 11.0, y + 3.55, 5), 2)
        self._rack(x, y)
        self._equipment(kind, x, y, 0.0)
        self.place("cable tray", "IfcCableCarrierSegment", Role.DETAIL, (x + 10.85, y + 0.3, 5.95), 1)
        self.place("duct", "IfcDuctSegment", Role.OCCLUDER, (x, y + 8.6, 12.2))
        if kind != "tanks":
            self._storage += [(x + 4.3 + 0.64 * k, y + 11.3) for k in range(11)]
        for name, low, high in (
            ("aisle", 0.0, 2.5),
            *((f"walkway {level:g} m", level, level + 2.1) for level in LEVELS_M),
        ):
            wide = 0.5 if low == 0.0 else 1.1
            far = 2.6 if low == 0.0 else 2.4
            self.walk(f"{name} east {i} {j}", (x + 0.2, y + wide, low), (x + BAY_M - 0.2, y + far, high))
            self.walk(f"{name} north {i} {j}", (x + wide, y + far, low), (x + far, y + BAY_M - 0.2, high))
        self._bays.append((i, j))

    def _bays_near(self, i: int, j: int) -> set[tuple[int, int]]:
        """The bays to the west and to the south, as far as they are there."""
        return {bay for bay in ((i - 1, j), (i, j - 1)) if min(bay) >= 0}

    def _walkway(self, x: float, y: float, level: float, stairs: bool) -> None:
        """Gratings that cross, and handrails; none where stairs arrive."""
        self.place("grating", "IfcSlab", Role.DETAIL, (x, y, level))
        sides = [((2.55, 1.0), 0), ((1.0, 2.55), 1), ((2.5, 2.55), 1)] + ([] if stairs else [((2.55, 2.5), 0)])
        for name, places in (
            ("rail", sides),
            ("rail short", [((0, 1.0), 0), ((0, 2.5), 0), ((1, 0), 1), ((2.5, 0), 1)]),
        ):
            for (dx, dy), quarters in places:
                self.place(name, "IfcRailing", Role.DETAIL, (x + dx, y + dy, level), quarters)

    def _rack(self, x: float, y: float) -> None:
        """Two frames, and pipes from one side of the bay to the other."""
        for dx in (4.1, 9.1):
            self.place("rack frame", "IfcMember", Role.DETAIL, (x + dx, y + RACK_M, 0))
        for z in TIERS_M:
            dy = 0.3
            for number in self._rng.permutation(len(RADII_M)):
                name = f"valved pipe {number}" if self._rng.random() < VALVE_SHARE else f"pipe {number}"
                self.place(name, "IfcPipeSegment", Role.DETAIL, (x, y + RACK_M + dy, z + RADII_M[number]))
                dy += RACK_WIDTH_M / 4
        for _ in range(self._rng.integers(1, 5)):
            dx, thick = self._rng.uniform(4.3, 9.8), self._rng.random() < 0.4
            self.place(f"riser {'thick' if thick else 'thin'}", "IfcPipeFitting", Role.DETAIL, (x + dx, y + 6.95, 0))

    def _equipment(self, kind: str, x: float, y: float, z: float) -> None:
        """What a bay of this kind has on one floor."""
        if kind == "tanks":
            for dx in (6.0, 10.0):
                turn = int(self._rng.integers(1, 3))
                self.place("tank", "IfcTank", Role.OCCLUDER, (x + dx, y + 9.3, z))
                self.place("tank fittings", "IfcTank", Role.DETAIL, (x + dx, y + 9.3, z), turn)
        elif kind in ("vessels", "spheres"):
            name, places = ("vessel", (5.3, 7.9, 10.4)) if kind == "vessels" else ("sphere", (5.7, 9.7))
            for dx in places:
                self.place(name, "IfcTank", Role.OCCLUDER, (x + dx, y + 9.2, z))
                self.place(f"{name} fittings", "IfcTank", Role.DETAIL, (x + dx, y + 9.2, z), int(self._rng.integers(4)))
        elif kind == "exchangers":
            for dz in (1.5, 3.7):
                self.place("exchanger", "IfcTank", Role.OCCLUDER, (x + 7.8, y + 9.2, z + dz))
                self.place("saddles", "IfcMember", Role.DETAIL, (x + 7.8, y + 9.2, z + dz))
        elif kind == "pumps":
            for dx in (4.4, 7.9):
                for dy in (8.0, 9.7):
                    if self._rng.random() < 0.9:
                        self.place("pump", "IfcPump", Role.DETAIL, (x + dx, y + dy, z))
        else:
            for dx in (4.5, 8.1):
                for dy in (7.9, 10.0):
                    self.place("cabinets", "IfcElectricDistributionBoard", Role.OCCLUDER, (x + dx, y + dy, z))
                    self.place("cabinet doors", "IfcElectricDistributionBoard", Role.DETAIL, (x + dx, y + dy, z))

    def _outer_walls(self) -> list[tuple[int, int, int]]:
        """Grid lines between a bay and the outside: the cell, and the quarter turns of its wall."""
        bays = set(self._bays)
        found = []
        for i, j in self._bays:
            for neighbour, place, quarters in (
                ((i - 1, j), (i, j), 0),
                ((i + 1, j), (i + 1, j), 0),
                ((i, j - 1), (i, j), 3),
                ((i, j + 1), (i, j + 1), 3),
            ):
                if neighbour not in bays:
                    found.append((*place, quarters))
        return found

    def _corners(self) -> list[tuple[int, int]]:
        return sorted({(i + a, j + b) for i, j in self._bays for a in (0, 1) for b in (0, 1)})

    def _shell_triangles(self) -> int:
        """At most so many are to come in columns and outer walls."""
        return len(self._corners()) * self.count("column") + len(self._outer_walls()) * self.count("gate wall")

    def _shell(self) -> None:
        """Columns, and the walls around all bays, some with a gate where an aisle ends."""
        for i, j in self._corners():
            self.place("column", "IfcColumn", Role.OCCLUDER, (i * BAY_M, j * BAY_M, 0))
        for i, j, quarters in self._outer_walls():
            name = "gate wall" if self._rng.random() < GATE_SHARE else "wall"
            self.place(name, "IfcWall", Role.OCCLUDER, (i * BAY_M, j * BAY_M, 0), quarters)
