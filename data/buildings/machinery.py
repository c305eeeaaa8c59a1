"""What stands in a process plant: pipes with flanges and valves, pumps, vessels, walkways, stairs, cable trays.

Sizes follow common practice: handrails 1.1 m high with posts every 1.5 m, stairs at about 36 degrees, pipes 160
mm to 400 mm thick.
"""

from collections.abc import Callable

import numpy as np

from ..scene import Mesh
from .shapes import bent, block, laid, moved, pipe, revolved

RAIL_M, POST_EVERY_M = 1.1, 1.5


def disc(radius: float, thickness: float, sides: int) -> Mesh:
    """A round plate on z = 0."""
    return revolved([(0, 0), (radius, 0), (radius, thickness), (0, thickness)], sides)


def handrail(length: float) -> list[Mesh]:
    """Posts, two rails and a kick plate along x from 0 to `length`."""
    count = max(2, round(length / POST_EVERY_M) + 1)
    posts = [pipe([(x, 0, 0), (x, 0, RAIL_M)], 0.024, 6) for x in np.linspace(0.03, length - 0.03, count)]
    rails = [pipe([(0, 0, z), (length, 0, z)], 0.024, 6) for z in (0.55, RAIL_M)]
    return [*posts, *rails, block((0, -0.005, 0), (length, 0.005, 0.1))]


def flange_pair(radius: float, x: float) -> list[Mesh]:
    """Two bolted flanges of a pipe along x."""
    plate = laid(disc(radius * 1.7, 0.04, 12), 0)
    parts = [moved(plate, (x - 0.045, 0, 0)), moved(plate, (x + 0.005, 0, 0))]
    for turn in np.arange(8) * (np.pi / 4) + np.pi / 8:
        y, z = np.cos(turn) * radius * 1.4, np.sin(turn) * radius * 1.4
        parts.append(block((x - 0.08, y - 0.015, z - 0.015), (x + 0.08, y + 0.015, z + 0.015)))
    return parts


def valve(radius: float, x: float) -> list[Mesh]:
    """A gate valve in a pipe along x, hand wheel up."""
    body = [(0, -1.6), (1.5, -1.6), (1.5, -1.3), (1.2, -1.2), (1.4, 0), (1.2, 1.2), (1.5, 1.3), (1.5, 1.6), (0, 1.6)]
    stem = [(0, 0), (0.9, 0), (0.9, 2.2), (0.25, 2.4), (0.25, 4.2), (0, 4.2)]
    ring = [(np.cos(t) * 1.6, np.sin(t) * 1.6, 4.0) for t in np.linspace(0, 1.98 * np.pi, 13)]
    scaled = [(r * radius, z * radius) for r, z in body]
    parts = [moved(laid(revolved(scaled, 12), 0), (x, 0, 0))]
    parts.append(moved(revolved([(r * radius, z * radius) for r, z in stem], 8), (x, 0, 0)))
    parts.append(moved(pipe([(a * radius, b * radius, c * radius) for a, b, c in ring], 0.18 * radius, 6), (x, 0, 0)))
    spoke = (1.6 * radius, 0.12 * radius)
    for a, b in (spoke, spoke[::-1]):
        parts.append(block((x - a, -b, 3.9 * radius), (x + a, b, 4.1 * radius)))
    return parts


def straight_pipe(length: float, radius: float, *, valved: bool) -> list[Mesh]:
    """A run along x from 0 to `length`, flanged near one end, with a valve or not."""
    parts = [pipe([(0, 0, 0), (length, 0, 0)], radius, 14), *flange_pair(radius, 1.2)]
    return parts + (valve(radius, 0.62 * length) if valved else [])


def riser(height: float, radius: float) -> list[Mesh]:
    """From the origin up, over an elbow along x, and down again beside: an inverted U with flanges at its feet."""
    path = bent([(0, 0, 0), (0, 0, height), (4 * radius + 0.6, 0, height), (4 * radius + 0.6, 0, 0.4)], 2.5 * radius)
    return [pipe(path, radius, 12), moved(disc(1.7 * radius, 0.05, 12), (0, 0, 0.3))]


def pump() -> list[Mesh]:
    """A horizontal centrifugal pump on a base plate, 1.9 m along x, with suction and discharge pipes."""
    fins = [moved(laid(disc(0.27, 0.02, 12), 0), (x, 0, 0.55)) for x in np.arange(0.15, 0.8, 0.08)]
    motor = revolved([(0, 0), (0.24, 0.02), (0.24, 0.75), (0.1, 0.8), (0, 0.8)], 14)
    casing = revolved([(0, 0), (0.2, 0), (0.36, 0.06), (0.36, 0.24), (0.2, 0.3), (0, 0.3)], 16)
    return [
        block((0, -0.35, 0), (1.9, 0.35, 0.15)),
        block((0.2, -0.2, 0.15), (0.75, 0.2, 0.36)),
        block((1.25, -0.15, 0.15), (1.55, 0.15, 0.3)),
        moved(laid(motor, 0), (0.1, 0, 0.55)),
        *fins,
        pipe([(0.9, 0, 0.55), (1.25, 0, 0.55)], 0.05, 8),
        moved(laid(casing, 0), (1.25, 0, 0.55)),
        pipe(bent([(1.5, 0, 0.55), (2.3, 0, 0.55), (2.3, 0, 2.6)], 0.3), 0.1, 12),
        pipe(bent([(1.4, 0.2, 0.85), (1.4, 0.2, 2.2), (1.4, 0.9, 2.2)], 0.25), 0.08, 12),
        moved(disc(0.18, 0.05, 12), (2.3, 0, 1.4)),
        moved(disc(0.15, 0.05, 12), (1.4, 0.2, 1.3)),
    ]


def upright_tank(radius: float, low: float, high: float, sides: int) -> Mesh:
    """A cylinder with domed ends."""
    dome = [(radius * np.cos(t), radius * 0.35 * np.sin(t)) for t in np.linspace(0, np.pi / 2, 5)[:-1]]
    bottom = [(r, low - z) for r, z in reversed(dome)]
    top = [(r, high + z) for r, z in dome]
    return revolved([(0, low - radius * 0.35), *bottom, *top, (0, high + radius * 0.35)], sides)


def legs(radius: float, height: float) -> list[Mesh]:
    """Four legs with foot plates."""
    places = [(radius * x, radius * y) for x, y in ((0.65, 0.65), (-0.65, 0.65), (-0.65, -0.65), (0.65, -0.65))]
    return [
        part
        for x, y in places
        for part in (
            block((x - 0.08, y - 0.08, 0.03), (x + 0.08, y + 0.08, height)),
            block((x - 0.18, y - 0.18, 0), (x + 0.18, y + 0.18, 0.03)),
        )
    ]


def nozzles(radius: float, heights: list[float]) -> list[Mesh]:
    """Flanged nozzles that stick out of an upright tank along x and y."""
    parts = []
    for number, z in enumerate(heights):
        stub = revolved([(0, 0), (0.12, 0), (0.12, 0.3), (0.22, 0.3), (0.22, 0.36), (0, 0.36)], 12)
        out = moved(stub, (0, 0, radius - 0.05))
        parts.append(moved(laid(out, number % 2), (0, 0, z)))
    return parts


def ladder(height: float) -> list[Mesh]:
    """A ladder in the plane x = 0, rungs along y."""
    rungs = [pipe([(0, -0.2, z), (0, 0.2, z)], 0.015, 5) for z in np.arange(0.3, height, 0.3)]
    return [*rungs, *(block((-0.02, y - 0.03, 0), (0.02, y + 0.03, height)) for y in (-0.23, 0.23))]


def lying_vessel(length: float, radius: float, sides: int) -> Mesh:
    """A vessel along x, centred on the origin, with domed ends."""
    return moved(laid(upright_tank(radius, 0, length, sides), 0), (-length / 2, 0, 0))


def stair(rise: float, run: float, width: float) -> list[Mesh]:
    """A steel flight along x from the origin to (run, 0, rise), stringers and handrails on both sides."""
    count = round(rise / 0.19)
    going, step = run / count, rise / count
    treads = [
        block((i * going, 0, (i + 1) * step - 0.04), ((i + 1) * going + 0.02, width, (i + 1) * step))
        for i in range(count)
    ]
    slope = [(0.0, 0.0), (run, rise)]
    parts = []
    for y in (-0.03, width + 0.03):
        parts += [pipe([(x, y, z + up) for x, z in slope], radius, 6) for up, radius in ((0.08, 0.09), (0.9, 0.024))]
        parts += [
            pipe([(x, y, x / run * rise), (x, y, x / run * rise + 0.9)], 0.02, 6)
            for x in np.linspace(0.2, run - 0.2, 5)
        ]
    return treads + parts


def cable_tray(length: float) -> list[Mesh]:
    """A tray with seven cables along x."""
    walls = [
        block((0, -0.3, 0), (length, 0.3, 0.01)),
        *(block((0, y, 0.01), (length, y + 0.01, 0.1)) for y in (-0.3, 0.29)),
    ]
    cables = [pipe([(0, y, 0.04), (length, y, 0.04)], 0.025, 8) for y in np.linspace(-0.24, 0.24, 7)]
    hangers = [block((x, s * 0.33 - 0.01, -0.03), (x + 0.04, s * 0.33 + 0.01, 0.7)) for x in (1, 5, 9) for s in (-1, 1)]
    return walls + cables + hangers


def rack_frame(width: float, tiers: list[float], height: float) -> list[Mesh]:
    """A steel portal in the plane x = 0: two posts and a beam under each tier."""
    posts = [block((-0.1, y - 0.1, 0), (0.1, y + 0.1, height)) for y in (0, width)]
    return posts + [block((-0.08, 0.1, z - 0.2), (0.08, width - 0.1, z)) for z in tiers]


def drum() -> list[Mesh]:
    """A 200 litre drum."""
    profile = [(0, 0), (0.29, 0), (0.29, 0.29), (0.3, 0.3), (0.29, 0.31), (0.29, 0.58), (0.3, 0.59), (0.29, 0.6)]
    return [revolved([*profile, (0.29, 0.88), (0, 0.88)], 12)]


def cabinet() -> list[Mesh]:
    """A row of four switch cabinets, one block, with doors and handles in front of it."""
    doors = [block((0.8 * i + 0.02, -0.02, 0.1), (0.8 * i + 0.78, 0.0, 2.05)) for i in range(4)]
    handles = [block((0.8 * i + 0.68, -0.06, 1.0), (0.8 * i + 0.71, -0.02, 1.2)) for i in range(4)]
    return doors + handles


PARTS: dict[str, Callable[[], list[Mesh]]] = {
    "pump": pump,
    "drum": drum,
    "cabinet doors": cabinet,
    "rail": lambda: handrail(9.4),
    "rail short": lambda: handrail(1.0),
    "stair low": lambda: stair(5.0, 6.8, 0.9),
    "stair high": lambda: stair(4.0, 5.4, 0.9),
    "cable tray": lambda: cable_tray(11.4),
    "riser thin": lambda: riser(3.4, 0.08),
    "riser thick": lambda: riser(7.4, 0.16),
    "tank fittings": lambda: [
        *legs(1.9, 1.3),
        *nozzles(1.9, [1.7, 2.6, 4.0, 6.0]),
        *(moved(part, (-2.05, 0.0, 0.0)) for part in ladder(8.5)),
    ],
    "vessel fittings": lambda: [*legs(1.1, 1.7), *nozzles(1.1, [2.0, 2.6, 4.0])],
    "sphere fittings": lambda: [*legs(1.3, 2.7), *nozzles(1.2, [2.5, 2.9])],
    "saddles": lambda: [block((x - 0.15, -0.8, -1.5), (x + 0.15, 0.8, -0.7)) for x in (-1.5, 1.5)],
}
