"""A house of boxes with an exactly known potentially visible set, shaped like a bake."""

from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

import numpy as np
import pyarrow as pa
from viewcell.data.graph import CellGraph
from viewcell.data.pair_sets import PairSets
from viewcell.data.scene import Definition, Instance, Mesh, Role, Scene
from viewcell.data.store.bake_folder import BakeFolder
from viewcell.data.store.room_tables import read_room_table
from viewcell.data.verdict import Verdict
from viewcell.verify.exact.stab import stab

SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
FACES = np.array([face for a, b, c, d in SIDES for face in ((a, b, c), (a, c, d))], np.int32)
UNIT_BOX = np.array(list(product((0.0, 1.0), repeat=3)))
OCTANTS = list(product((1, -1), repeat=3))
AXES = "xyz"


@dataclass
class StandIn:
    """What `verify` and `report` need of a bake."""

    scene: Scene | None
    graph: CellGraph
    grid_m: float
    origin: np.ndarray
    manifest: dict
    folder: Path
    cell_to_cell: pa.Table
    cell_to_object: pa.Table
    potential_cells: np.ndarray
    potential_objects: np.ndarray
    cracks: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 3), np.int32))
    claims_cells: bool = True
    in_model = BakeFolder.in_model
    yaw_deg: float = 0.0
    rooms: pa.Table = field(default_factory=lambda: read_room_table(Path("none"), "rooms"))
    rooms_of_cells = property(BakeFolder.rooms_of_cells.func)
    cell_text = BakeFolder.cell_text
    cell_sets = property(lambda self: sets_of(self.potential_cells))
    object_sets = property(lambda self: sets_of(self.potential_objects))


def sets_of(matrix: np.ndarray) -> PairSets:
    """Sets whose pairs are those of a matrix of bool."""
    return PairSets.of(np.nonzero(matrix), matrix.shape)


def small_graph() -> CellGraph:
    """Rooms 0, 2, 4 in a row, doorways 1 and 3 that are not in line, and room 5 beside room 4 behind doorway 6."""
    cells = [
        [[0, 0, 0], [40, 40, 30]],
        [[40, 5, 0], [44, 15, 20]],
        [[44, 0, 0], [84, 40, 30]],
        [[84, 25, 0], [88, 35, 20]],
        [[88, 0, 0], [128, 40, 30]],
        [[88, 44, 0], [128, 84, 30]],
        [[92, 40, 0], [102, 44, 20]],
    ]
    portals = [
        ([40, 5, 0], [40, 15, 20], 0, (0, 1)),
        ([44, 5, 0], [44, 15, 20], 0, (1, 2)),
        ([84, 25, 0], [84, 35, 20], 0, (2, 3)),
        ([88, 25, 0], [88, 35, 20], 0, (3, 4)),
        ([92, 40, 0], [102, 40, 20], 1, (4, 6)),
        ([92, 44, 0], [102, 44, 20], 1, (6, 5)),
    ]
    return CellGraph(
        cells=np.array(cells, np.int32) * 64,
        inhabitable=np.array([True, False, True, False, True, True, False]),
        cell_names=np.array(["hall", "", "room", "", "study", "store", ""]),
        portal_cells=np.array([p[3] for p in portals], np.int32),
        portal_axis=np.array([p[2] for p in portals], np.int8),
        portals=np.array([p[:2] for p in portals], np.int32) * 64,
    )


SOLIDS = [
    ([-4, -4, -4], [132, 88, 0]),
    ([-4, -4, 30], [132, 88, 34]),
    ([-4, -4, 0], [0, 44, 30]),
    ([0, -4, 0], [132, 0, 30]),
    ([0, 40, 0], [88, 44, 30]),
    ([128, 0, 0], [132, 88, 30]),
    ([84, 44, 0], [88, 88, 30]),
    ([88, 84, 0], [128, 88, 30]),
    ([40, 0, 0], [44, 5, 30]),
    ([40, 15, 0], [44, 40, 30]),
    ([40, 5, 20], [44, 15, 30]),
    ([84, 0, 0], [88, 25, 30]),
    ([84, 35, 0], [88, 40, 30]),
    ([84, 25, 20], [88, 35, 30]),
    ([88, 40, 0], [92, 44, 30]),
    ([102, 40, 0], [128, 44, 30]),
    ([92, 40, 20], [102, 44, 30]),
]
# A desk stands free in room 2; a pane of glass fills doorway 3.
FURNITURE = [([60, 32, 0], [66, 38, 8], "desk", Role.DETAIL), ([85, 25, 0], [86, 35, 20], "pane", Role.TRANSPARENT)]


def small_scene() -> Scene:
    """Opaque walls, floor and ceiling, a desk and a pane; object ids in that order."""
    parts = [(low, high, f"wall {n}", Role.OCCLUDER) for n, (low, high) in enumerate(SOLIDS)] + FURNITURE
    objects = []
    for low, high, name, role in parts:
        transform = np.eye(4)
        transform[:3, :3] = np.diag(np.subtract(high, low) / 16.0)
        transform[:3, 3] = np.array(low) / 16.0
        objects.append(Instance(name, "box", 0, transform, role))
    return Scene([Definition("box", (Mesh(UNIT_BOX, FACES),))], objects)


def sequences(graph, cell):
    """All portal sequences that do not repeat a cell: (cells, portals, signed octants that fit)."""
    starts, entries = graph.adjacency()
    stack = [([cell], [], OCTANTS)]
    while stack:
        cells, portals, octants = stack.pop()
        yield cells, portals, octants
        for portal, there in entries[starts[cells[-1]] : starts[cells[-1] + 1]].tolist():
            axis, sense = graph.portal_axis[portal], 1 if graph.portal_cells[portal, 0] == cells[-1] else -1
            fitting = [o for o in octants if o[axis] == sense]
            if there not in cells and fitting:
                stack.append(([*cells, there], [*portals, portal], fitting))


def inside(box, point, direction):
    """Middle of the line's way through a box."""
    times = [sorted((int(c) - p) / d for c in side) for side, p, d in zip(box.T, point, direction, strict=True)]
    middle = (max(t[0] for t in times) + min(t[1] for t in times)) / 2
    return [p + middle * d for p, d in zip(point, direction, strict=True)]


def stabbed(graph, cells, portals, target, octants):
    """(origin, end) of a line from the first cell through the portals into the target box, or None."""
    boxes = np.concatenate([graph.cells[cells[:1]], graph.portals[portals], target[None]]).astype(np.int64)
    for signs in octants:
        answer = stab(boxes, signs)
        if answer.verdict is Verdict.VISIBLE:
            return [inside(b, answer.point, answer.direction) for b in (boxes[0], boxes[-1])]
    return None


def row(first, second, line, grid_m):
    """Table row with the witness in metres, or nulls."""
    values = {"cell_id": first, second[0]: second[1], "verdict": "visible" if line else "unknown"}
    for axis in range(3):
        start, end = (float(point[axis]) * grid_m for point in line) if line else (None, None)
        values[f"origin_{AXES[axis]}"] = start
        values[f"direction_{AXES[axis]}"] = end - start if line else None
    return values


def small_house(folder: Path, bare: bool = False) -> StandIn:
    """The house as a bake with every verdict exact; `bare`: the cell graph alone."""
    graph, scene = small_graph(), None if bare else small_scene()
    grid_m = 2.0**-10
    pairs, sights = {}, {}
    for cell in np.flatnonzero(graph.inhabitable).tolist():
        for cells, portals, octants in sequences(graph, cell):
            line = stabbed(graph, cells, portals, graph.cells[cells[-1]], octants)
            if line and (cell, cells[-1]) not in pairs:
                pairs[cell, cells[-1]] = {**row(cell, ("reached_cell_id", cells[-1]), line, grid_m), "portals": portals}
            if not line or bare:
                continue
            for target, box in enumerate(scene.object_bounds()):
                clipped = np.array(
                    [np.maximum(box[0], graph.cells[cells[-1], 0]), np.minimum(box[1], graph.cells[cells[-1], 1])]
                )
                if (clipped[0] <= clipped[1]).all() and stabbed(graph, cells, portals, clipped, octants):
                    sights[cell, target] = row(cell, ("object_id", target), None, grid_m)
    objects = 0 if bare else len(scene.objects)
    potential_cells = np.zeros((graph.cell_count, graph.cell_count), bool)
    potential_objects = np.zeros((graph.cell_count, objects), bool)
    for table, found in ((potential_cells, pairs), (potential_objects, sights)):
        for pair in found:
            table[pair] = True
    names = ["cell_id", "object_id", "verdict", *(f"{v}_{a}" for v in ("origin", "direction") for a in AXES)]
    types = [pa.int32(), pa.int32(), pa.string(), *[pa.float64()] * 6]
    manifest = {"source": "small house", "settings": {"seal": 0.0}, "seconds": {"flood": 0.1}}
    return StandIn(
        scene, graph, grid_m, np.zeros(3), manifest,
        folder / "house", pa.Table.from_pylist(list(pairs.values())),
        pa.Table.from_pylist(list(sights.values()), schema=pa.schema(list(zip(names, types, strict=True)))),
        potential_cells, potential_objects,
    )  # fmt: skip
