"""Rooms and the cells that are named after them: how much of each is covered, and view cells for what is not.

Cells of the cell-and-portal graph are boxes along the axes, cut by walls. A room at an angle, under a sloped roof, or
cut into slivers by the treads of a stair has few of them or none. Such a room gets view cells of its own: upright
prisms over rectangles of its own frame, which may overlap anything, as an eye counts only outside solids.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .frame import wall_yaw
from .graph import CellGraph
from .plans import Plans, are_convex, box_corners, plan_bounds, turned_plan
from .scene import Scene, Space, turned
from .solids import SolidIndex, winding_numbers

# Eyes are between these heights over a room's floor; what is higher need not be covered.
LOWEST_EYE_M, HIGHEST_EYE_M = 0.1, 2.2
# Of every room this share of where eyes may be lies in cells named after it, or the bake says so.
COVERED_SHARE = 0.95
# Sample points across a room's longer side, and up.
ACROSS, UP = 24, 4
# Rooms are cut where their own outline bends, or this far apart where it bends too often [m].
RASTER_M = 0.15
MOST_BENDS = 40
# Slices of rooms under slopes [m], and upright faces by their normals.
SLICE_M = 0.35
UPRIGHT, OBLIQUE = 1e-3, 0.02
LEAST_LINE_M = 0.005
# View cells of a room are no thinner and no more than this, and are made until so much of it is covered.
THINNEST_M = 0.2
MOST_CELLS = 24
ENOUGH = 0.98
# What is covered already counts so little where prisms have to overlap.
REACHED = 1e-3
# Winding numbers of closed bodies are so near to whole ones.
WHOLE = 1e-3
# A point is under an edge of a face if its share of the opposite corner is less than this.
ON_EDGE = 1e-9
# Directions of a room's walls within this angle are one.
SNAPPED_DEG = 0.1


@dataclass(frozen=True)
class RoomCover:
    """How much of a room lies in inhabitable cells named after it.

    Attributes:
        name: of the room.
        share: of the volume where eyes may be, 0 to 1.
        why: what is in the way, in words; empty for a room that is covered.
    """

    name: str
    share: float
    why: str = ""

    @property
    def covered(self) -> bool:
        """Whether it is enough."""
        return self.share >= COVERED_SHARE

    @property
    def entry(self) -> dict:
        """What the manifest says of it under `rooms`; only a room that is not covered has a `why`."""
        return {"name": self.name, "covered": round(self.share, 4), **({"why": self.why} if self.why else {})}


def room_name(space: Space) -> str:
    """What its cells are called."""
    return space.name or "room"


def add_room_cells(scene: Scene, graph: CellGraph, room_points: list[np.ndarray]) -> tuple[CellGraph, list[RoomCover]]:
    """The graph with view cells for rooms that its own cells do not cover, and how all rooms are covered then.

    Args:
        scene: the model.
        graph: with inhabitable cells and their names.
        room_points: of each room, as of `find_room_points`.
    """
    covers, prisms, names = [], [], []
    for space, points in zip(scene.spaces, room_points, strict=True):
        share = _covered_share(space, points, graph)
        made: list[tuple[np.ndarray, np.ndarray]] = []
        if share < COVERED_SHARE and len(points):
            made = room_prisms(space, scene.grid_m)
            own = _with_cells(graph, made, [room_name(space)] * len(made))
            share = _covered_share(space, points, own)
        covers.append(_cover(space, points, share))
        prisms += made
        names += [room_name(space)] * len(made)
    return _with_cells(graph, prisms, names), covers


def room_covers(scene: Scene, graph: CellGraph, room_points: list[np.ndarray]) -> list[RoomCover]:
    """How the rooms of a model are covered by the inhabitable cells of a graph that are named after them."""
    points = zip(scene.spaces, room_points, strict=True)
    return [_cover(space, own, _covered_share(space, own, graph)) for space, own in points]


def _cover(space: Space, points: np.ndarray, share: float) -> RoomCover:
    if share >= COVERED_SHARE:
        return RoomCover(room_name(space), share)
    extent = np.ptp(space.vertices, axis=0)
    if extent.min() < THINNEST_M:
        why = f"its body is {extent.min():.2f} m thin"
    elif not len(eye_points(space)):
        why = "its body is not closed"
    else:
        why = "its outline is too fine for boxes" if len(points) else "solids fill it"
    return RoomCover(room_name(space), share, why)


def find_room_points(scene: Scene, solids: list[tuple[int, np.ndarray]]) -> list[np.ndarray]:
    """`eye_points` of each room outside all solids [grid steps], each of shape (n, 3), float64."""
    points = [eye_points(space) / scene.grid_m for space in scene.spaces]
    around = [np.array([own.min(axis=0), own.max(axis=0)]) if len(own) else np.zeros((2, 3)) for own in points]
    index = SolidIndex(np.array(around).reshape(-1, 2, 3), solids)
    rooms = np.repeat(np.arange(len(points)), [len(own) for own in points])
    free = index.outside(np.concatenate([np.zeros((0, 3)), *points]), rooms)
    ends = np.cumsum([len(own) for own in points])[:-1]
    return [own[mine] for own, mine in zip(points, np.split(free, ends) if points else [], strict=True)]


def _with_cells(graph: CellGraph, prisms: list[tuple[np.ndarray, np.ndarray]], names: list[str]) -> CellGraph:
    """The graph with more view cells."""
    if not prisms:
        return graph
    boxes, corners = (np.array(column) for column in zip(*prisms, strict=True))
    rows = np.arange(graph.cell_count, graph.cell_count + len(boxes))
    return CellGraph(
        np.concatenate([graph.cells, boxes.astype(np.int32)]),
        np.concatenate([graph.inhabitable, np.ones(len(boxes), bool)]),
        np.concatenate([graph.cell_names, np.array(names, object)]),
        graph.portal_cells,
        graph.portal_axis,
        graph.portals,
        Plans(
            np.concatenate([graph.plans.rows, rows]), np.concatenate([graph.plans.corners, corners.astype(np.int32)])
        ),
    )


def _covered_share(space: Space, points: np.ndarray, graph: CellGraph) -> float:
    """Share of points of a room [grid steps] that lie in inhabitable cells named after it."""
    if not len(points):
        return 0.0
    low, high = points.min(axis=0), points.max(axis=0)
    near = graph.inhabitable & (graph.cells[:, 0] <= high).all(axis=1) & (graph.cells[:, 1] >= low).all(axis=1)
    held = np.zeros(len(points), bool)
    for cell in np.flatnonzero(near):
        if called_after(graph.cell_names[cell], space):
            held |= points_in_cell(graph, cell, points)
    return float(held.mean())


def called_after(cell_name: str, space: Space) -> bool:
    """Whether a cell's name has the room's in it; names of rooms may hold commas themselves."""
    return f", {room_name(space)}, " in f", {cell_name}, "


def points_in_cell(graph: CellGraph, cell: int, points: np.ndarray) -> np.ndarray:
    """Points [grid steps], shape (n, 3), in a closed cell, or in its box and strictly in its plan, shape (n,), bool."""
    held = ((points >= graph.cells[cell, 0]) & (points <= graph.cells[cell, 1])).all(axis=1)
    inside = np.flatnonzero(held)
    held[inside] = graph.plans.hold(np.full(len(inside), cell), points[inside], graph.cell_count)
    return held


def eye_points(space: Space) -> np.ndarray:
    """Points of a room at heights where eyes may be, evenly in its volume [m], shape (n, 3), float64."""
    low, high = space.vertices.min(axis=0), space.vertices.max(axis=0)
    top = min(low[2] + HIGHEST_EYE_M, high[2])
    bottom = min(low[2] + LOWEST_EYE_M, top)
    step = max(float((high - low)[:2].max()) / ACROSS, 1e-3)
    # Off the middle of the raster, so that points are on no wall of a room of round measures.
    x, y = (np.arange(low[axis] + 0.437 * step, high[axis], step) for axis in (0, 1))
    z = bottom + (np.arange(UP) + 0.5) / UP * (top - bottom)
    points = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
    return points[in_room(space, points)]


def in_room(space: Space, points: np.ndarray) -> np.ndarray:
    """Points [m], shape (n, 3), that are inside a room, shape (n,), bool.

    By the faces above a point, counted with their signs: the winding number of a closed body. Where the point is under
    or over an edge, or those above and below do not add up to none, the solid angles of all faces tell. If they are no
    whole number the body is open: then points are inside that have an odd number of faces above and below them.
    """
    corners = space.vertices[space.faces]
    a, b, c = (corners[:, k] for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    level = np.abs(area) > 1e-9
    # Faces above and below each point, with their signs and without.
    above, below = np.zeros((2, len(points)), int), np.zeros((2, len(points)), int)
    edged = np.zeros(len(points), bool)
    for p, q, r, size in zip(a[level], b[level], c[level], area[level], strict=True):
        near = np.flatnonzero(
            (points[:, :2] >= np.minimum(np.minimum(p, q), r)[:2]).all(axis=1)
            & (points[:, :2] <= np.maximum(np.maximum(p, q), r)[:2]).all(axis=1)
        )
        x, y = points[near, 0], points[near, 1]
        shares = [((v[0] - u[0]) * (y - u[1]) - (v[1] - u[1]) * (x - u[0])) / size for u, v in ((q, r), (r, p), (p, q))]
        least = np.minimum(np.minimum(shares[0], shares[1]), shares[2])
        inside = least > 0
        edged[near[np.abs(least) < ON_EDGE]] = True
        height = shares[0] * p[2] + shares[1] * q[2] + shares[2] * r[2]
        sign = 1 if size > 0 else -1
        for count, held in ((above, height > points[near, 2]), (below, height <= points[near, 2])):
            count[:, near[inside & held]] += np.array([[sign], [1]])
    held = above[0] != 0
    doubtful = np.flatnonzero(edged | (above[0] + below[0] != 0))
    winding = winding_numbers(points[doubtful], corners)
    if np.abs(winding - np.round(winding)).max(initial=0.0) < WHOLE:
        held[doubtful] = np.abs(winding) > 0.5
        return held
    return (above[1] % 2 == 1) & (below[1] % 2 == 1)


def room_prisms(space: Space, grid_m: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Upright prisms that fill a room from its floor up to where eyes may be, each over a rectangle of its own frame.

    Returns:
        For each prism its box, shape (2, 3), and its plan's corners, shape (4, 2) [grid steps], int64.
    """
    yaw = wall_yaw([(space.vertices, space.faces)], SNAPPED_DEG)
    level = Space(space.name, turned(space.vertices, -yaw), space.faces)
    found = []
    for bottom, top, xs, ys, mask in _slices(level):
        size, left = np.outer(np.diff(xs), np.diff(ys)), mask.copy()
        area = float(size[mask].sum())
        for _ in range(MOST_CELLS):
            i0, i1, j0, j1 = _largest(left, size * left)
            if i1 > i0 and min(xs[i1] - xs[i0], ys[j1] - ys[j0]) < THINNEST_M:
                # What is left is thin: a prism that reaches over it lies partly in others.
                i0, i1, j0, j1 = _largest(mask, size * (left + REACHED))
            if not left[i0:i1, j0:j1].any() or min(xs[i1] - xs[i0], ys[j1] - ys[j0]) < THINNEST_M:
                break
            left[i0:i1, j0:j1] = False
            found.append(_prism((xs[i0], ys[j0], bottom), (xs[i1], ys[j1], top), yaw, grid_m))
            if size[left].sum() <= (1 - ENOUGH) * area:
                break
    return [prism for prism in found if prism is not None]


def _prism(low: tuple, high: tuple, yaw_deg: float, grid_m: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Box and plan of a box of a turned frame [m]; None if nothing is left of it on the grid."""
    box = np.array([low, high], float)
    corners = np.round(turned_plan(box_corners(box), yaw_deg) / grid_m).astype(np.int64)
    heights = np.round(box[:, 2] / grid_m).astype(np.int64)
    if heights[0] >= heights[1] or not are_convex(corners):
        return None
    return np.column_stack([plan_bounds(corners), heights]), corners


def _slices(level: Space) -> list[tuple[float, float, np.ndarray, np.ndarray, np.ndarray]]:
    """Slices of a room from its floor up: bottom, top, raster lines on x and y, and which raster cells it fills."""
    low, high = level.vertices.min(axis=0), level.vertices.max(axis=0)
    top = min(low[2] + HIGHEST_EYE_M, high[2])
    heights = _heights(level, float(low[2]), float(top))
    oblique = _bends(level)
    xs, ys = (_lines(level.vertices[:, axis], oblique) for axis in (0, 1))
    found: list[tuple[float, float, np.ndarray, np.ndarray, np.ndarray]] = []
    # Beside the middle, where a diagonal of two triangles may run.
    x, y = (0.497 * lines[1:] + 0.503 * lines[:-1] for lines in (xs, ys))
    for bottom, upper in pairwise(heights):
        # Where the room is to be filled, it reaches from just above the bottom to just below the top.
        mask = np.ones((len(x), len(y)), bool)
        for z in (bottom + 0.02 * (upper - bottom), upper - 0.02 * (upper - bottom)):
            points = np.stack(np.meshgrid(x, y, [z], indexing="ij"), axis=-1).reshape(-1, 3)
            mask &= in_room(level, points).reshape(mask.shape)
        if found and np.array_equal(found[-1][4], mask):
            found[-1] = (found[-1][0], upper, xs, ys, mask)
        elif mask.any():
            found.append((bottom, upper, xs, ys, mask))
    return found


def _heights(level: Space, low: float, top: float) -> np.ndarray:
    """Heights between which a room is one prism, or nearly so where it has slopes."""
    normals, size = _face_normals(level)
    upright = np.abs(normals[:, 2]) <= UPRIGHT * size
    flat = np.abs(normals[:, :2]).max(axis=1) <= UPRIGHT * size
    own = np.unique(np.round(level.vertices[:, 2], 3))
    lowest = level.vertices[level.faces][:, :, 2].min(axis=1)
    sloped = ((lowest < top - 0.01) & ~upright & ~flat & (size > 0)).any()
    steps = np.linspace(low, top, max(2, round((top - low) / SLICE_M) + 1)) if sloped else np.array([low, top])
    inner = own[(own > low + 0.01) & (own < top - 0.01)]
    heights = np.unique(np.concatenate([steps, inner[:MOST_BENDS]]))
    return heights[np.append(True, np.diff(heights) > 0.01)]


def _face_normals(level: Space) -> tuple[np.ndarray, np.ndarray]:
    """Normals of a room's faces, shape (faces, 3), and their lengths: twice the faces' areas."""
    corners = level.vertices[level.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return normals, np.linalg.norm(normals, axis=1)


def _bends(level: Space) -> bool:
    """Whether a room has upright faces off the axes of its frame, or sloped ones: its middle then says little."""
    normals, size = _face_normals(level)
    oblique = (np.abs(normals[:, 2]) <= UPRIGHT * size) & (np.abs(normals[:, :2]).min(axis=1) > OBLIQUE * size)
    sloped = (np.abs(normals[:, 2]) > UPRIGHT * size) & (np.abs(normals[:, :2]).max(axis=1) > OBLIQUE * size)
    return bool((oblique | sloped).any())


def _lines(coordinates: np.ndarray, oblique: bool) -> np.ndarray:
    """Raster lines of a room on one axis of its frame: where it bends, and evenly where that is not enough [m]."""
    own = np.unique(coordinates)
    own = own[np.append(True, np.diff(own) > LEAST_LINE_M)]
    own[-1] = coordinates.max()
    if len(own) <= MOST_BENDS and not oblique:
        return own
    count = max(1, int(np.ceil((own[-1] - own[0]) / RASTER_M)))
    return np.linspace(own[0], own[-1], count + 1)


def _largest(mask: np.ndarray, size: np.ndarray) -> tuple[int, int, int, int]:
    """The largest rectangle of true raster cells by area: i0, i1, j0, j1, past the end; all 0 if there is none."""
    best, found = 0.0, (0, 0, 0, 0)
    for i0 in range(len(mask)):
        run, area = np.ones(mask.shape[1], bool), np.zeros(mask.shape[1])
        for i1 in range(i0, len(mask)):
            run &= mask[i1]
            if not run.any():
                break
            area = area + size[i1]
            # Sums of runs: what came before the last gap is taken off.
            total = np.cumsum(np.where(run, area, 0.0))
            gap = np.maximum.accumulate(np.where(run, 0.0, total))
            value = np.where(run, total - gap, 0.0)
            j1 = int(value.argmax())
            if value[j1] > best:
                before = np.flatnonzero(~run[: j1 + 1])
                best, found = float(value[j1]), (i0, i1 + 1, int(before[-1]) + 1 if len(before) else 0, j1 + 1)
    return found
