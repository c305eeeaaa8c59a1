"""Rays through the cells they cross: a Warp kernel that marks what each view cell's rays see.

The way is float64 and only *proposes*: a mark outside the potentially visible set becomes a candidate, which exact
arithmetic judges. A ray that comes too near to an edge of a face is given up. Shares no code with `kernels/`.
"""

import warp as wp

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


@wp.struct
class Maze:
    """Cells and links on the device; see `Links`."""

    boxes: wp.array2d[int]
    starts: wp.array[int]
    cells: wp.array[int]
    rectangles: wp.array2d[int]


@wp.struct
class Rays:
    """Rays in grid steps, the parameter of each hit, and its triangle or -1."""

    origins: wp.array[wp.vec3]
    directions: wp.array[wp.vec3]
    reach: wp.array[float]
    hits: wp.array[int]


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
    seen: wp.array2d[wp.uint8],
    potential: wp.array2d[wp.bool],
    row: int,
    target: int,
    ray: int,
    kind: int,
    candidates: wp.array2d[int],
    count: wp.array[int],
):
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
def _enter_cells(
    maze: Maze,
    row: int,
    cell: int,
    ray: int,
    o: wp.vec3d,
    d: wp.vec3d,
    end: wp.float64,
    sightings: Sightings,
    candidates_out: wp.array2d[int],
    count_out: wp.array[int],
):
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
def mark_sightings(
    maze: Maze,
    sources: wp.array[int],
    run: int,
    spot_counts: wp.array[int],
    first: int,
    crossing: int,
    rays: Rays,
    owners: wp.array[int],
    sightings: Sightings,
    candidates_out: wp.array2d[int],
    count_out: wp.array[int],
):
    """Mark the object that each ray hits and, in the `crossing` first rounds of five, the cells it enters before it.

    Rays come in equal runs, one per row: ray i belongs to row i // run, whose cell is sources[row]; the run's first is
    number `first` of that row. `owners` is the object of each triangle.
    """
    row = wp.tid()
    cell = sources[row]
    for ray in range(row * run, (row + 1) * run):
        end = wp.float64(wp.inf)
        if rays.hits[ray] >= 0:
            end = wp.float64(rays.reach[ray]) * BEFORE_HIT
            seen = owners[rays.hits[ray]]
            _mark(sightings.objects, sightings.potential_objects, row, seen, ray, 1, candidates_out, count_out)
        if ((first + ray - row * run) // spot_counts[row]) % ROUNDS < crossing:
            o = wp.vec3d(rays.origins[ray])
            d = wp.vec3d(rays.directions[ray])
            _enter_cells(maze, row, cell, ray, o, d, end, sightings, candidates_out, count_out)
