"""Inhabitable cells: where an observer may stand, and why.

By rooms (IfcSpace) where the model names them. Else by flooding: doors, windows and voids are shut, and what the
outside does not reach is a room. Where neither works the reason is reported with the path by which the outside leaks
in.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components

from .graph import CellGraph
from .plural import counted
from .room_cells import in_room, room_name
from .scene import Scene

SMALLEST_SIDE_M = 0.3
SMALLEST_ROOM_M3 = 5.0
SEALED_SHARE = 0.5
# Doors, windows and voids are shut where a portal lies within this of their boxes.
SHUT_MARGIN_M = 0.01
# A cell is named after the rooms that hold so much of it.
NAMED_SHARE = 0.3
# Sample points per axis when a cell's share of the rooms is estimated.
SAMPLES = 4


@dataclass
class Inhabited:
    """Which cells are inhabitable.

    Attributes:
        mask: shape (cells,), bool.
        names: the room of each cell, "" where none, shape (cells,), object.
        reason: one line: by what rule, and what stood in the way of a better one.
        leak: cells from the outside to the largest leaking room, in order; empty if nothing leaks.
    """

    mask: np.ndarray
    names: np.ndarray
    reason: str
    leak: list[int] = field(default_factory=list)


def find_inhabitable(scene: Scene, graph: CellGraph) -> Inhabited:
    """Cells an observer may stand in; the graph must be free of dead cells."""
    sides = (graph.cells[:, 1] - graph.cells[:, 0]) * scene.grid_m
    roomy = sides.min(axis=1) > SMALLEST_SIDE_M
    if scene.spaces:
        names = _rooms_of(scene, graph, roomy)
        mask = names != ""
        reason = f"inside the model's {counted(len(scene.spaces), 'room')}"
        if mask.any() and scene.lost_rooms:
            # Rooms that the model names without a body are among what flooding finds.
            enclosed, leak = _flood(scene, graph)
            mask |= enclosed & roomy
            reason += f", or, for {len(scene.lost_rooms)} without a body, not reached from outside"
            return Inhabited(mask, names, reason, leak)
        if mask.any():
            return Inhabited(mask, names, reason)
    names = np.full(graph.cell_count, "", object)
    enclosed, leak = _flood(scene, graph)
    mask = enclosed & roomy
    if mask.any():
        return Inhabited(mask, names, "not reached from outside when doors, windows and voids are shut", leak)
    # The building's own box: the outermost cells hold the margin and are never rooms. A cell that no portal leaves is
    # the inside of something.
    inner = np.bincount(graph.portal_cells.ravel(), minlength=graph.cell_count) > 0
    inner &= (graph.cells[:, 0] > graph.cells[:, 0].min(axis=0)).all(axis=1)
    inner &= (graph.cells[:, 1] < graph.cells[:, 1].max(axis=0)).all(axis=1)
    if not (roomy & inner).any():
        inner[:] = True
    named = len(scene.spaces) + len(scene.lost_rooms)
    rooms = f"no cell lies in any of the model's {named} rooms" if named else "the model names no rooms"
    reason = f"{rooms}, and the outside leaks into all of it: every roomy cell inside the margin"
    return Inhabited(roomy & inner, names, reason, leak)


def _rooms_of(scene: Scene, graph: CellGraph, roomy: np.ndarray) -> np.ndarray:
    """Names of the rooms of each cell that lies in rooms by more than half, "" elsewhere."""
    share = np.zeros(graph.cell_count)
    names = np.full(graph.cell_count, "", object)
    # Beside the middle, where a diagonal of two triangles may run.
    steps = (np.arange(SAMPLES) + 0.497) / SAMPLES
    unit = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    for space in scene.spaces:
        corners = space.vertices[space.faces] / scene.grid_m
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        near = np.flatnonzero(roomy & (graph.cells[:, 1] > low).all(axis=1) & (graph.cells[:, 0] < high).all(axis=1))
        if not len(near):
            continue
        boxes = graph.cells[near].astype(float)
        points = boxes[:, :1] + unit[None] * (boxes[:, 1:] - boxes[:, :1])
        inside = in_room(space, points.reshape(-1, 3) * scene.grid_m).reshape(points.shape[:2])
        mine = inside.mean(axis=1)
        share[near] += mine
        for cell in near[mine > NAMED_SHARE]:
            names[cell] = f"{names[cell]}, {room_name(space)}" if names[cell] else room_name(space)
    names[share <= 0.5] = ""
    return names


def shut_portals(scene: Scene, graph: CellGraph) -> np.ndarray:
    """Which portals are shut with the doors, windows and voids of a scene, shape (portals,), bool."""
    shut = np.zeros(graph.portal_count, bool)
    margin = SHUT_MARGIN_M / scene.grid_m
    for low, high in scene.openings / scene.grid_m:
        shut |= ((graph.portals[:, 0] >= low - margin) & (graph.portals[:, 1] <= high + margin)).all(axis=1)
    return shut


def _flood(scene: Scene, graph: CellGraph) -> tuple[np.ndarray, list[int]]:
    """Cells in components of room size that only a shut opening joins to the rest, and a leak path if there is one."""
    shut = shut_portals(scene, graph)
    a, b = graph.portal_cells[~shut].T
    links = coo_matrix((np.ones(len(a)), (a, b)), shape=(graph.cell_count, graph.cell_count)).tocsr()
    _, component = connected_components(links, directed=False)
    outside = int(np.argmin(graph.cells[:, 0].sum(axis=1)))
    volume = np.prod((graph.cells[:, 1] - graph.cells[:, 0]) * scene.grid_m, axis=1)
    big = np.bincount(component, volume) >= SMALLEST_ROOM_M3
    enclosed = big[component] & (component != component[outside])
    # The inside of walls and pillars of an open mesh is enclosed too. No opening leads into it; and where the model has
    # no openings to tell by, it is a small share of the building.
    opened = np.zeros(len(big), bool)
    opened[component[graph.portal_cells[shut].ravel()]] = True
    if shut.any():
        enclosed &= opened[component]
    else:
        inner = (graph.cells[:, 0] > graph.cells[:, 0].min(axis=0)).all(axis=1)
        inner &= (graph.cells[:, 1] < graph.cells[:, 1].max(axis=0)).all(axis=1)
        enclosed &= volume[enclosed].sum() > SEALED_SHARE * volume[inner].sum()
    return enclosed, _leak_path(graph, links + links.T, outside, component)


def _leak_path(graph: CellGraph, links: coo_matrix, outside: int, component: np.ndarray) -> list[int]:
    """Cells from the outside to the middle of the building, if they are in one component."""
    centre = (graph.cells.min(axis=(0, 1)).astype(float) + graph.cells.max(axis=(0, 1))) / 2
    middle = int(np.abs(graph.cells.astype(float).mean(axis=1) - centre).sum(axis=1).argmin())
    if component[middle] != component[outside]:
        return []
    _, before = breadth_first_order(links, outside, directed=False)
    path = [middle]
    while path[-1] != outside:
        path.append(int(before[path[-1]]))
    return path[::-1]
