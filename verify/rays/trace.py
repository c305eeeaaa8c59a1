"""Rays through the cells they cross: a Warp kernel that marks what each view cell's rays see.

The walk is float64 and only *proposes*: a mark outside the potentially visible set becomes a candidate, which exact
arithmetic judges. A ray that comes too near to an edge of a face is given up. Shares no code with `kernels/`.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from ...data.graph import OTHER_AXES, CellGraph

wp.set_module_options({"enable_backward": False})

# A ray this near to an edge of the face it leaves by is given up [grid steps].
EDGE_SLACK = wp.constant(wp.float64(1.0e-6))
# A cell counts as entered only clearly before the hit, whose distance is float32.
BEFORE_HIT = wp.constant(wp.float64(1.0 - 1.0e-6))
STEPS = wp.constant(4096)
# Rounds through a cell's origins after which the purposes of its rays repeat.
ROUNDS = wp.constant(5)
# Candidates kept of one (cell, target) pair: if the first ones only graze, a later one may not.
ATTEMPTS = wp.constant(8)


@dataclass(frozen=True)
class Links:
    """Ways out of each cell, by face.

    Attributes:
        starts: shape (6 cells + 1,), int32; the links of face 2 axis + (1 on the high side) of cell c are
            starts[6 c + face] to starts[6 c + face + 1].
        cells: cell behind each link, shape (links,), int32.
        rectangles: low u, high u, low v, high v [grid steps], shape (links, 4), int32; u, v: the other axes.
        portals: portal_id of each link, -1 for a bare contact, shape (links,), int32.
    """

    starts: np.ndarray
    cells: np.ndarray
    rectangles: np.ndarray
    portals: np.ndarray


def portal_links(graph: CellGraph) -> Links:
    """Links through the graph's portals alone."""
    low, high = graph.portal_cells.T
    axis = graph.portal_axis.astype(np.int64)
    u, v = OTHER_AXES[axis].T
    row = np.arange(graph.portal_count)
    box = graph.portals
    rectangles = np.column_stack([box[row, 0, u], box[row, 1, u], box[row, 0, v], box[row, 1, v]])
    return _table(graph.cell_count, low, high, axis, rectangles, row)


def contact_links(cells: np.ndarray) -> Links:
    """Links wherever two cells share part of a face, opaque or not: independent of the portals that are under test.

    Args:
        cells: boxes [grid steps], shape (cells, 2, 3), int32, that do not overlap.
    """
    found = [(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 4)))]
    for axis in range(3):
        order = np.argsort(cells[:, 0, axis], kind="stable")
        sorted_low = cells[order, 0, axis]
        first = np.searchsorted(sorted_low, cells[:, 1, axis], "left")
        count = np.searchsorted(sorted_low, cells[:, 1, axis], "right") - first
        a = np.repeat(np.arange(len(cells)), count)
        b = order[np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + np.repeat(first, count)]
        low = np.maximum(cells[a, 0], cells[b, 0])[:, OTHER_AXES[axis]]
        high = np.minimum(cells[a, 1], cells[b, 1])[:, OTHER_AXES[axis]]
        met = (low < high).all(axis=1)
        rectangles = np.stack([low, high], axis=2)[met].reshape(-1, 4)
        found.append((a[met], b[met], np.full(met.sum(), axis), rectangles))
    low, high, axis, rectangles = (np.concatenate(column) for column in zip(*found, strict=True))
    return _table(len(cells), low, high, axis, rectangles, np.full(len(low), -1))


def _table(
    count: int, low: np.ndarray, high: np.ndarray, axis: np.ndarray, rectangles: np.ndarray, portals: np.ndarray
) -> Links:
    keys = np.concatenate([6 * low + 2 * axis + 1, 6 * high + 2 * axis])
    # The largest of a face's links first: most rays take it, and the walk looks at them one by one.
    area = np.prod(rectangles[:, 1::2].astype(np.float64) - rectangles[:, ::2], axis=1)
    order = np.lexsort([-np.tile(area, 2), keys])
    return Links(
        np.searchsorted(keys[order], np.arange(6 * count + 1)).astype(np.int32),
        np.concatenate([high, low])[order].astype(np.int32),
        np.ascontiguousarray(np.concatenate([rectangles, rectangles])[order].astype(np.int32)),
        np.concatenate([portals, portals])[order].astype(np.int32),
    )


@wp.struct
class Maze:
    """Cells and links on the device; see `Links`."""

    boxes: wp.array2d[int]
    starts: wp.array[int]
    cells: wp.array[int]
    rectangles: wp.array2d[int]


@wp.struct
class Sightings:
    """Marks by row (source cell) and target, and the potentially visible set that must hold them."""

    cells: wp.array2d[wp.uint8]
    objects: wp.array2d[wp.uint8]
    potential_cells: wp.array2d[wp.bool]
    potential_objects: wp.array2d[wp.bool]


@wp.func
def _follow(maze: Maze, cell: int, face: int, u: wp.float64, v: wp.float64) -> int:
    """Cell behind the link of the face that surely holds the point (u, v), -1 if there is none."""
    slot = 6 * cell + face
    for link in range(maze.starts[slot], maze.starts[slot + 1]):
        if (
            u > wp.float64(maze.rectangles[link, 0]) + EDGE_SLACK
            and u < wp.float64(maze.rectangles[link, 1]) - EDGE_SLACK
            and v > wp.float64(maze.rectangles[link, 2]) + EDGE_SLACK
            and v < wp.float64(maze.rectangles[link, 3]) - EDGE_SLACK
        ):
            return maze.cells[link]
    return -1


@wp.func
def _side(component: wp.float64) -> int:
    """1 where a ray leaves by the high face, 0 by the low one."""
    if component < wp.float64(0.0):
        return 0
    return 1


@wp.func
def _mark(
    seen: wp.array2d[wp.uint8], potential: wp.array2d[wp.bool], row: int, target: int, ray: int, kind: int,
    candidates: wp.array2d[int], count: wp.array[int],
):  # fmt: skip
    """Mark a target with 1; if it ought to be hidden count its rays in the mark and append (row, kind, target, ray)."""
    mark = int(seen[row, target])
    # Nearly all marks are there already: one look is all they cost.
    if mark == 1 or mark > ATTEMPTS:
        return
    if potential[row, target]:
        seen[row, target] = wp.uint8(1)
        return
    seen[row, target] = wp.uint8(wp.max(mark, 1) + 1)
    slot = wp.atomic_add(count, 0, 1)
    if slot < candidates.shape[0]:
        candidates[slot, 0] = row
        candidates[slot, 1] = kind
        candidates[slot, 2] = target
        candidates[slot, 3] = ray


@wp.func
def _walk(
    maze: Maze, row: int, cell: int, ray: int, o: wp.vec3d, d: wp.vec3d, end: wp.float64, sightings: Sightings,
    candidates_out: wp.array2d[int], count_out: wp.array[int],
):  # fmt: skip
    """Mark the cells that a ray from a cell enters before the parameter `end`."""
    # A component of 0 gives infinite times: that axis' faces are never reached.
    pace = wp.vec3d(wp.float64(1.0) / d[0], wp.float64(1.0) / d[1], wp.float64(1.0) / d[2])
    sx, sy, sz = _side(d[0]), _side(d[1]), _side(d[2])
    for _ in range(STEPS):
        tx = (wp.float64(maze.boxes[cell, 3 * sx]) - o[0]) * pace[0]
        ty = (wp.float64(maze.boxes[cell, 3 * sy + 1]) - o[1]) * pace[1]
        tz = (wp.float64(maze.boxes[cell, 3 * sz + 2]) - o[2]) * pace[2]
        t = wp.min(tx, wp.min(ty, tz))
        if t >= end:
            return
        # The face left by and the place on it, chosen without a branch: it could not be predicted.
        face = wp.where(t == tx, sx, wp.where(t == ty, 2 + sy, 4 + sz))
        u = wp.where(t == tx, o[1] + t * d[1], o[0] + t * d[0])
        v = wp.where(face >= 4, o[1] + t * d[1], o[2] + t * d[2])
        cell = _follow(maze, cell, face, u, v)
        if cell < 0:
            return
        _mark(sightings.cells, sightings.potential_cells, row, cell, ray, 0, candidates_out, count_out)


@wp.kernel
def walk_rays(
    maze: Maze, sources: wp.array[int], run: int, spot_counts: wp.array[int], first: int, walked: int,
    origins: wp.array[wp.vec3], directions: wp.array[wp.vec3], reach: wp.array[float], owners: wp.array[int],
    hits: wp.array[int], sightings: Sightings, candidates_out: wp.array2d[int], count_out: wp.array[int],
):  # fmt: skip
    """Mark the object that each ray hits and, in the `walked` first rounds of five, the cells it enters before its hit.

    Rays come in equal runs, one a row: ray i belongs to row i // run, whose cell is sources[row]; the run's first is
    number `first` of that row. `reach` is the hit's parameter, `hits` its triangle or -1, `owners` the object of each
    triangle.
    """
    row = wp.tid()
    cell = sources[row]
    for ray in range(row * run, (row + 1) * run):
        end = wp.float64(wp.inf)
        if hits[ray] >= 0:
            end = wp.float64(reach[ray]) * BEFORE_HIT
            seen = owners[hits[ray]]
            _mark(sightings.objects, sightings.potential_objects, row, seen, ray, 1, candidates_out, count_out)
        if ((first + ray - row * run) // spot_counts[row]) % ROUNDS < walked:
            o = wp.vec3d(origins[ray])
            d = wp.vec3d(directions[ray])
            _walk(maze, row, cell, ray, o, d, end, sightings, candidates_out, count_out)


def portal_path(
    links: Links, boxes: np.ndarray, cell: int, target: int, origin: np.ndarray, direction: np.ndarray
) -> list[int] | None:
    """Portals that a float64 ray crosses from one cell to another; None if it does not get there.

    Args:
        links: of `portal_links`.
        boxes: cells [grid steps], shape (cells, 2, 3).
        cell: start.
        target: cell to reach.
        origin: 3 float64 [grid steps].
        direction: 3 float64.
    """
    path = []
    while cell != target and len(path) < 4096:
        with np.errstate(divide="ignore", invalid="ignore"):
            exits = np.where(
                direction, (boxes[cell, (direction > 0).astype(int), range(3)] - origin) / direction, np.inf
            )
        axis = int(exits.argmin())
        face = 6 * cell + 2 * axis + int(direction[axis] > 0)
        u, v = (origin + exits[axis] * direction)[OTHER_AXES[axis]]
        for link in range(links.starts[face], links.starts[face + 1]):
            low_u, high_u, low_v, high_v = links.rectangles[link]
            if low_u < u < high_u and low_v < v < high_v:
                path.append(int(links.portals[link]))
                cell = int(links.cells[link])
                break
        else:
            return None
    return path if cell == target else None
