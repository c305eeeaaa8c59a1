"""Synthetic city quarters of any size: blocks on a street grid, buildings of many shapes, some of them oblique."""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..scene import Mesh, Role, Scene
from .shapes import block, extruded, laid, lattice_mesh, moved, pipe, revolved
from .site import Site, turned

TRIANGLES = (50_000, 50_000_000)
# Triangles of a tile without buildings, at most.
STREET_TRIANGLES = 9_000
# Triangles of a block with its part of the streets, about: decides how wide the city is.
TYPICAL_BLOCK = 24_000
# A tile is a block, its pavement, and half of the streets around it.
TILE_M, HALF_STREET_M, PAVEMENT_M = (78.0, 62.0), 6.0, 3.0
KERB_M, STREET_HEADROOM_M = 0.15, 2.5
# Lots of a block: columns and rows, and the size of each.
LOTS, LOT_M = (3, 2), (20.0, 22.0)
STOREY_M, BAY_M = 3.25, 3.0
OBLIQUE_SHARE, PARK_SHARE, TREE_SHARE, CAR_SHARE = 0.25, 0.06, 0.5, 0.5
LOT_TREES = tuple((x, y) for x in (-7.5, -2.5, 2.5, 7.5) for y in (-8.0, -2.5, 2.5, 8.0))

Outline = tuple[tuple[float, float], ...]


def _rectangle(x: float, y: float) -> Outline:
    return ((-x / 2, -y / 2), (x / 2, -y / 2), (x / 2, y / 2), (-x / 2, y / 2))


@dataclass(frozen=True)
class Tier:
    """A part of a building with one outline; the next tier stands on it.

    Attributes:
        outline: axial, counterclockwise, in metres from the middle of the lot.
    """

    outline: Outline
    storeys: int


@dataclass(frozen=True)
class Design:
    """A kind of building.

    Attributes:
        gable_m: height of a pitched roof over the last tier; 0 for a flat roof.
        weight: how often it stands, relative to the others.
    """

    tiers: tuple[Tier, ...]
    weight: float
    window: str
    gable_m: float = 0.0


L_SHAPE = ((-9, -10), (9, -10), (9, -1), (0, -1), (0, 10), (-9, 10))
U_SHAPE = ((-9, -10), (9, -10), (9, 8), (3, 8), (3, -3), (-3, -3), (-3, 8), (-9, 8))
SMALL_L = ((-6, -7), (6, -7), (6, 0), (0, 0), (0, 7), (-6, 7))
AXIAL = {
    "block 4": Design((Tier(_rectangle(18, 15), 4),), 2, "plain"),
    "block 6": Design((Tier(_rectangle(15, 18), 6),), 2, "plain"),
    "hall 2": Design((Tier(_rectangle(18, 20), 2),), 1, "framed"),
    "slab 9": Design((Tier(_rectangle(18, 9), 9),), 1, "plain"),
    "angle 4": Design((Tier(L_SHAPE, 4),), 2, "plain"),
    "angle 6": Design((Tier(L_SHAPE, 6),), 1, "plain"),
    "court 3": Design((Tier(U_SHAPE, 3),), 1.5, "framed"),
    "court 5": Design((Tier(U_SHAPE, 5),), 1, "plain"),
    "tower 17": Design(
        (Tier(_rectangle(18, 18), 5), Tier(_rectangle(12, 12), 8), Tier(_rectangle(6, 6), 4)), 0.6, "plain"
    ),
    "terrace 3": Design((Tier(_rectangle(18, 9), 3),), 2, "framed", 4.0),
    "house 2": Design((Tier(_rectangle(12, 9), 2),), 2, "framed", 3.5),
}
# These fit into a lot whichever way they are turned.
OBLIQUE = {
    "oblique block 4": Design((Tier(_rectangle(15, 12), 4),), 2, "plain"),
    "oblique block 7": Design((Tier(_rectangle(12, 12), 7),), 1, "plain"),
    "oblique angle 4": Design((Tier(SMALL_L, 4),), 1.5, "framed"),
    "oblique house 2": Design((Tier(_rectangle(12, 9), 2),), 2, "framed", 3.5),
    "oblique tower 11": Design((Tier(_rectangle(12, 12), 7), Tier(_rectangle(9, 9), 4)), 0.6, "plain"),
}


def make_city(*, seed: int = 0, triangles: int = 100_000) -> Scene:
    """A quarter of a city: blocks of six lots on a grid of streets 12 m wide.

        ====================== street =====================
        || +--------+ +--+     +--------+ | o  o  o | ||      lots of 20 m x 22 m; trees and lamps
        || |  +--+  | |  +---+ |  tower | | o  o  o | ||      on the pavement, cars beside it
        || +--+  +--+ +------+ +--------+ | o park  | ||
        ===================================================

    Flat and pitched roofs, L- and U-shaped outlines, towers with setbacks; about a quarter of the buildings is turned
    by any angle. The bodies of buildings, ground and pavements are occluders; windows (sills, lintels, jambs),
    chimneys, lamps, trees and cars are detail. All meshes are closed and look outwards. Spaces are the streets up to
    2.5 m above the ground.

    Args:
        seed: decides what stands where.
        triangles: about how many, 50,000 to 50,000,000: the city grows by blocks. The last lots are parks, whose trees
            make up what no building fits into.

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
    return _City(seed, triangles).scene(f"make_city(seed={seed}, triangles={triangles})")


class _City(Site):
    """A city under construction, block by block in rows from south to north."""

    def __init__(self, seed: int, triangles: int) -> None:
        super().__init__()
        self._rng = np.random.default_rng(seed)
        self._most = triangles
        self._define()
        self._costs = {name: self._cost(design) for name, design in (AXIAL | OBLIQUE).items()}
        self._spare: list[tuple[float, float]] = []
        columns = max(1, round(np.sqrt(triangles / TYPICAL_BLOCK)))
        number = 0
        while number == 0 or self.triangles + STREET_TRIANGLES <= triangles:
            self._block(number % columns, number // columns)
            number += 1
        self._park(number % columns, number // columns)
        for x, y in reversed(self._spare):
            if self.triangles + self.count("tree") > triangles:
                break
            self.place("tree", "IfcPlant", Role.DETAIL, (x, y, KERB_M))

    def _define(self) -> None:
        """All shapes; none depends on the seed."""
        (width, depth), half = TILE_M, HALF_STREET_M
        self.define("ground", block((0, 0, -0.5), (width, depth, 0)))
        self.define("pavement", block((half, half, 0), (width - half, depth - half, KERB_M)))
        for name, design in (AXIAL | OBLIQUE).items():
            for number, tier in enumerate(design.tiers):
                last = number == len(design.tiers) - 1
                self.define(f"{name} body {number}", _body(tier, design.gable_m if last else 0.0))
                for _, _, length in _edges(tier.outline):
                    self._define_row(design.window, length)
        for name, parts in STREET.items():
            self.define(name, *parts())

    def _define_row(self, window: str, length: float) -> None:
        """A storey's windows along a wall of this length, outwards to the left of x."""
        name = f"{window} windows {length:g} m"
        if name not in self._ids:
            count = int(length // BAY_M)
            self.define(name, *(p for k in range(count) for p in _window(window, (k + 0.5) * length / count)))

    def _cost(self, design: Design) -> int:
        """Triangles of a building."""
        rows = [
            tier.storeys * self.count(f"{design.window} windows {length:g} m")
            for tier in design.tiers
            for _, _, length in _edges(tier.outline)
        ]
        return sum(rows) + 200

    def _block(self, i: int, j: int) -> None:
        """Ground, streets and what stands on the lots."""
        rng = self._rng
        x, y = self._ground(i, j)
        self._street(x, y)
        for at in self._lots(x, y):
            oblique = rng.random() < OBLIQUE_SHARE
            designs = OBLIQUE if oblique else AXIAL
            weights = np.array([design.weight for design in designs.values()])
            name = list(designs)[rng.choice(len(designs), p=weights / weights.sum())]
            angle = rng.uniform(0.1, np.pi / 2 - 0.1) if oblique else 0.0
            turned_round = bool(rng.integers(2))
            if self.triangles + self._costs[name] > self._most:
                self._spare += [(at[0] + dx, at[1] + dy) for dx, dy in LOT_TREES]
            elif rng.random() < PARK_SHARE:
                for dx, dy in LOT_TREES:
                    if rng.random() < 0.7:
                        self.place("tree", "IfcPlant", Role.DETAIL, (at[0] + dx, at[1] + dy, KERB_M))
            else:
                self._building(name, designs[name], turned((*at, KERB_M), angle), turned_round)

    def _park(self, i: int, j: int) -> None:
        """A block with room for trees only."""
        x, y = self._ground(i, j)
        self._spare += [(at[0] + dx, at[1] + dy) for at in self._lots(x, y) for dx, dy in LOT_TREES]

    def _lots(self, x: float, y: float) -> list[tuple[float, float]]:
        """Middles of a block's lots."""
        edge = HALF_STREET_M + PAVEMENT_M
        columns, rows = range(LOTS[0]), range(LOTS[1])
        return [(x + edge + (a + 0.5) * LOT_M[0], y + edge + (b + 0.5) * LOT_M[1]) for a in columns for b in rows]

    def _ground(self, i: int, j: int) -> tuple[float, float]:
        """The ground of a tile, its pavement and its streets to walk in; its corner."""
        (width, depth), half = TILE_M, HALF_STREET_M
        x, y = i * width, j * depth
        self.place("ground", "IfcSlab", Role.OCCLUDER, (x, y, 0))
        self.place("pavement", "IfcSlab", Role.OCCLUDER, (x, y, 0))
        for name, low, high in (
            ("south", (0, 0), (width, half)),
            ("north", (0, depth - half), (width, depth)),
            ("west", (0, half), (half, depth - half)),
            ("east", (width - half, half), (width, depth - half)),
        ):
            self.walk(
                f"street {name} {i} {j}", (x + low[0], y + low[1], 0), (x + high[0], y + high[1], STREET_HEADROOM_M)
            )
        return x, y

    def _street(self, x: float, y: float) -> None:
        """Trees and lamps on the pavement, cars beside it."""
        (width, depth), half, rng = TILE_M, HALF_STREET_M, self._rng
        near, far_x, far_y = half + 1.0, width - half - 1.0, depth - half - 1.0
        for along in np.arange(half + 6.0, width - half - 4.0, 8.0):
            for across, car_at in ((near, half - 1.2), (far_y, depth - half + 1.2)):
                self._stand(x + along, y + across, rng)
                if rng.random() < CAR_SHARE:
                    self.place(
                        "car", "IfcTransportElement", Role.DETAIL, (x + along, y + car_at, 0), 2 * int(rng.integers(2))
                    )
        for along in np.arange(half + 9.0, depth - half - 6.0, 8.0):
            for across, car_at in ((near, half - 1.2), (far_x, width - half + 1.2)):
                self._stand(x + across, y + along, rng)
                if rng.random() < CAR_SHARE:
                    turn = 1 + 2 * int(rng.integers(2))
                    self.place("car", "IfcTransportElement", Role.DETAIL, (x + car_at, y + along, 0), turn)

    def _stand(self, x: float, y: float, rng: np.random.Generator) -> None:
        """A tree, a lamp or room for a tree."""
        lot = rng.random()
        if lot < TREE_SHARE:
            self.place("tree", "IfcPlant", Role.DETAIL, (x, y, KERB_M), int(rng.integers(4)))
        elif lot < 0.75:
            self.place("lamp", "IfcLightFixture", Role.DETAIL, (x, y, KERB_M))
        else:
            self._spare.append((x, y))

    def _building(self, name: str, design: Design, frame: np.ndarray, turned_round: bool) -> None:
        """Its tiers, windows storey by storey, and what stands on the roof."""
        base = 0.0
        if turned_round:
            frame = frame @ np.diag([-1.0, -1.0, 1.0, 1.0])
        for number, tier in enumerate(design.tiers):
            self.place(f"{name} body {number}", "IfcBuilding", Role.OCCLUDER, (0, 0, base), frame=frame)
            for start, quarter, length in _edges(tier.outline):
                for storey in range(tier.storeys):
                    at = (*start, base + storey * STOREY_M)
                    row = f"{design.window} windows {length:g} m"
                    self.place(row, "IfcWindow", Role.DETAIL, at, quarter, frame)
            base += tier.storeys * STOREY_M
        if design.gable_m:
            self.place("chimney", "IfcChimney", Role.DETAIL, (2.0, 1.0, base), frame=frame)
        else:
            (x0, y0), (x1, _) = design.tiers[-1].outline[:2]
            at = ((x0 + x1) / 2, y0 + 2.5, base)
            self.place("roof plant", "IfcUnitaryEquipment", Role.DETAIL, at, frame=frame)


def _edges(outline: Outline) -> list[tuple[tuple[float, float], int, float]]:
    """Start, direction in quarter turns from x, and length of each side."""
    found = []
    for (x0, y0), (x1, y1) in zip(outline, (*outline[1:], outline[0]), strict=True):
        quarter = (0 if x1 > x0 else 2) if y0 == y1 else (1 if y1 > y0 else 3)
        found.append(((x0, y0), quarter, abs(x1 - x0) + abs(y1 - y0)))
    return found


def _body(tier: Tier, gable: float) -> Mesh:
    """The walls and the roof of a tier."""
    height = tier.storeys * STOREY_M
    corners = np.array(tier.outline, np.float64)
    (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
    if gable:
        profile = [(y0, 0.0), (y1, 0.0), (y1, height), ((y0 + y1) / 2, height + gable), (y0, height)]
        return laid(extruded(profile, x0, x1), 0)
    lines = np.unique(corners[:, 0]), np.unique(corners[:, 1]), np.array([0.0, height])
    solid = np.zeros((len(lines[0]) - 1, len(lines[1]) - 1, 1), bool)
    for a, x in enumerate((lines[0][1:] + lines[0][:-1]) / 2):
        for b, y in enumerate((lines[1][1:] + lines[1][:-1]) / 2):
            # Inside an axial outline an odd number of its sides lies to the east.
            ahead = [min(y_, v) < y < max(y_, v) for (x_, y_), (u, v) in _sides(tier.outline) if x_ == u and x_ > x]
            solid[a, b, 0] = sum(ahead) % 2
    return lattice_mesh(lines, solid)


def _sides(outline: Outline) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    return list(zip(outline, (*outline[1:], outline[0]), strict=True))


def _window(kind: str, x: float) -> list[Mesh]:
    """Frame of a window 1.4 m wide about x, on the outside of a wall in the plane y = 0 that looks to -y."""
    parts = [block((x - 0.85, -0.14, 0.8), (x + 0.85, 0.0, 0.88)), block((x - 0.8, -0.08, 2.3), (x + 0.8, 0.0, 2.45))]
    if kind == "framed":
        parts += [block((x + s - 0.06, -0.08, 0.88), (x + s + 0.06, 0.0, 2.3)) for s in (-0.72, 0.72)]
        parts.append(block((x - 0.03, -0.05, 0.88), (x + 0.03, 0.0, 2.3)))
    return parts


def _tree() -> list[Mesh]:
    """A trunk and a crown 4 m wide, 6.5 m high."""
    crown = [(0, 2.2), (1.2, 2.5), (1.9, 3.4), (2.0, 4.4), (1.5, 5.6), (0.7, 6.3), (0, 6.5)]
    return [revolved([(0, 0), (0.18, 0), (0.12, 2.6), (0, 2.6)], 8), revolved(crown, 12)]


def _lamp() -> list[Mesh]:
    """A mast 6 m high with an arm."""
    mast = [(0, 0), (0.1, 0), (0.1, 0.8), (0.06, 0.9), (0.04, 6.0), (0, 6.0)]
    return [
        revolved(mast, 8),
        pipe([(0, 0, 5.95), (0, 0.5, 6.1), (0, 1.0, 6.1)], 0.03, 6),
        block((-0.1, 0.9, 6.02), (0.1, 1.5, 6.12)),
    ]


def _car() -> list[Mesh]:
    """A saloon 4.4 m along x."""
    lower = [(-2.2, 0.3), (2.2, 0.3), (2.2, 0.65), (1.2, 0.85), (-1.9, 0.9), (-2.2, 0.85)]
    cabin = [(-1.9, 0.88), (1.2, 0.84), (0.5, 1.4), (-1.2, 1.45)]
    # Outlines in x and z are drawn in y and x, and come to their place when z is laid along y.
    hull = [laid(extruded([(z, x) for x, z in reversed(part)], -w, w), 1) for part, w in ((lower, 0.85), (cabin, 0.75))]
    wheel = revolved([(0, 0), (0.3, 0), (0.3, 0.22), (0, 0.22)], 12)
    wheels = [moved(laid(wheel, 1), (x, y, 0.3)) for x in (-1.35, 1.35) for y in (-0.87, 0.65)]
    return [*hull, *wheels]


STREET = {
    "tree": _tree,
    "lamp": _lamp,
    "car": _car,
    "chimney": lambda: [block((-0.4, -0.3, -0.5), (0.4, 0.3, 4.3)), block((-0.5, -0.4, 4.3), (0.5, 0.4, 4.45))],
    "roof plant": lambda: [
        block((-1.6, -1.0, 0.0), (0.3, 1.0, 1.6)),
        moved(revolved([(0, 0), (0.5, 0), (0.5, 1.1), (0.7, 1.15), (0.7, 1.3), (0, 1.3)], 12), (1.2, 0, 0)),
    ],
}
