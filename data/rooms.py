"""Which view cells belong to which rooms, and what follows for rooms from what is visible from their cells.

What is seen from a room is the union over its view cells; where these do not hold all of the room, the union does not
speak of the rest, and `covered` says how much that is.
"""

from dataclasses import dataclass

import numpy as np

from .graph import CellGraph
from .plans import box_corners
from .ragged import places_of, starts_of
from .room_cells import called_after, in_room, points_in_cell
from .rows import Rows
from .scene import Scene, Space
from .verdict import Verdict

# Sample points of a cell per axis.
SAMPLES = 4


@dataclass(frozen=True)
class RoomCells:
    """Rooms and their view cells.

    Attributes:
        starts: cells of room r are cells[starts[r]:starts[r + 1]], shape (rooms + 1,), int64.
        cells: inhabitable, of each room ascending, shape (n,), int64; a cell may belong to several rooms.
        covered: share of where eyes may be in each room that lies in its cells, shape (rooms,), float64.
        claims_rooms: rooms that have cells, from all of which the bake says what other cells are visible: not those
            with a view cell that has a plan, of which nothing but objects is claimed; shape (rooms,), bool.
    """

    starts: np.ndarray
    cells: np.ndarray
    covered: np.ndarray
    claims_rooms: np.ndarray

    @property
    def count(self) -> int:
        """Number of rooms."""
        return len(self.covered)

    def of(self, room: int) -> np.ndarray:
        """Cells of one room."""
        return self.cells[self.starts[room] : self.starts[room + 1]]


def join_rooms(
    scene: Scene, graph: CellGraph, room_points: list[np.ndarray], *, named: bool = True, claims: bool = True
) -> RoomCells:
    """The inhabitable cells of each room of a model: those that hold a point of it.

    Points are the places in the room where eyes may be, and samples of the cell.

    Args:
        scene: the model.
        graph: its cells.
        room_points: of each room, as of `find_room_points`.
        named: whether cells are called after their rooms: only such a cell is then the room's.
        claims: whether the bake says what cells see of each other.
    """
    found, covered = [], []
    for space, points in zip(scene.spaces, room_points, strict=True):
        low, high = (pick(space.vertices / scene.grid_m, axis=0) for pick in (np.min, np.max))
        near = graph.inhabitable & (graph.cells[:, 0] <= high).all(axis=1) & (graph.cells[:, 1] >= low).all(axis=1)
        cells = [cell for cell in np.flatnonzero(near) if not named or called_after(graph.cell_names[cell], space)]
        held = np.array([points_in_cell(graph, cell, points) for cell in cells], bool).reshape(len(cells), len(points))
        own = held.any(axis=1) | _sampled(space, graph, np.array(cells, np.int64), scene.grid_m)
        found.append(np.array(cells, np.int64)[own])
        covered.append(held.any(axis=0).mean() if len(points) else 0.0)
    claim = [claims and bool(len(own)) and bool((own < graph.tile_count).all()) for own in found]
    cells = np.concatenate([np.zeros(0, np.int64), *found])
    return RoomCells(starts_of([len(own) for own in found]), cells, np.array(covered, float), np.array(claim, bool))


def _sampled(space: Space, graph: CellGraph, cells: np.ndarray, grid_m: float) -> np.ndarray:
    """Whether a sample point of each cell lies in a room, shape (n,), bool."""
    if not len(cells):
        return np.zeros(0, bool)
    corners = box_corners(graph.cells).astype(float)
    corners[graph.plans.rows] = graph.plans.corners
    # Beside the middle, where a diagonal of two triangles may run.
    steps = (np.arange(SAMPLES) + 0.497) / SAMPLES
    u, v, w = (axis.ravel() for axis in np.meshgrid(steps, steps, steps, indexing="ij"))
    shares = np.stack([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v])
    flat = np.einsum("ks,ckd->csd", shares, corners[cells])
    low, high = (graph.cells[cells, end, 2, None].astype(float) for end in (0, 1))
    points = np.concatenate([flat, (low + w * (high - low))[:, :, None]], axis=2)
    return in_room(space, points.reshape(-1, 3) * grid_m).reshape(len(cells), -1).any(axis=1)


def seen_from_rooms(rooms: RoomCells, rows: Rows) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What some cell of each room may see: the union of its cells' rows.

    Args:
        rooms: with their cells.
        rows: of these cells, of one kind of target.

    Returns:
        Room, target and verdict of each pair, by room, then target, shape (n,), int64: VISIBLE if any cell of the room
        sees the target, else UNKNOWN. A pair that is absent is hidden from all cells of the room.
    """
    place, size = _by_cell(rooms.cells, int(rows.source.max(initial=-1)) + 1)
    order = np.argsort(rooms.cells, kind="stable")
    owners = np.repeat(np.arange(rooms.count), np.diff(rooms.starts))[order]
    times = size[rows.source]
    room = owners[places_of(place[rows.source], times)]
    return _best(room, np.repeat(rows.target, times), np.repeat(rows.verdict, times))


def rooms_from_rooms(rooms: RoomCells, rows: Rows | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which rooms each room reaches: some of its cells may see some cell of the other.

    Of rooms that do not claim it nothing is hidden: their pairs are all there, UNKNOWN unless cells say better.

    Args:
        rooms: with their cells.
        rows: what cells see of each other; None if nothing is claimed of them.

    Returns:
        Room, reached room and verdict, as of `seen_from_rooms`; a room that has cells sees itself.
    """
    own = np.flatnonzero(np.diff(rooms.starts))
    silent = np.flatnonzero(~rooms.claims_rooms)
    every, loud = np.arange(rooms.count), np.flatnonzero(rooms.claims_rooms)
    pairs = [(own, own, np.full(len(own), Verdict.VISIBLE))]
    for rows_of, columns in ((silent, every), (loud, silent)):
        here, there = np.repeat(rows_of, len(columns)), np.tile(columns, len(rows_of))
        pairs.append((here, there, np.full(len(here), Verdict.UNKNOWN)))
    if rows is not None:
        room, cell, verdict = seen_from_rooms(rooms, rows)
        back = Rows.unseen(cell, room)
        back.verdict[:] = verdict
        reached, room, verdict = seen_from_rooms(rooms, back)
        pairs.append((room, reached, verdict))
    return _best(*(np.concatenate(column) for column in zip(*pairs, strict=True)))


def _by_cell(cells: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Where each cell's rooms start once they are sorted by cell, and how many they are, shape (cells,) each."""
    size = np.bincount(cells, minlength=count)
    return starts_of(size)[:-1], size


def _best(room: np.ndarray, target: np.ndarray, verdict: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs once each, VISIBLE where any of the same is, by room, then target."""
    # As single numbers, which are sorted many times faster than columns.
    targets = int(target.max(initial=0)) + 1
    keys = np.sort((room * targets + target) * 2 + (verdict != Verdict.VISIBLE))
    pairs = keys >> 1
    first = np.append(True, pairs[1:] != pairs[:-1])[: len(keys)]
    return *np.divmod(pairs[first], targets), np.where(keys[first] & 1, Verdict.UNKNOWN, Verdict.VISIBLE)
