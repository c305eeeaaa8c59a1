"""Curtains: upright opaque rectangles at any angle, inside closed elements or on their faces.

A curtain stands on the segment between two grid points of the plan and blocks between two heights. Inside a closed
element any rectangle that no triangle of the element comes near is opaque to eyes outside solids, however it was found:
elements are cut in floating point, along the directions of their own faces, and every rectangle is then checked. A face
whose corners stand over two grid points is a curtain as it is.

The line search cannot use a curtain whole where the line passes close above or below it; so inside elements each comes
with its halves, their halves, and so on. Source of the idea of occluders at any angle: Chhugani et al. 2005, section
5.2; the ways past them are in kernels/curtains.py.
"""

import time
from collections.abc import Iterator
from fractions import Fraction
from itertools import combinations

import numpy as np

from .blockers import Blockers
from .outlines import outline, tiles
from .patience import OutOfTime, ask
from .progress import track
from .ragged import lots, places_of, starts_of
from .scene import GRID_LIMIT, turned
from .sections import largest_sections, over
from .shapes import copies, extents, first_alike
from .solids import rays_wind, winds_around

# `Blockers.axis` of a curtain from the corner of its plan box with the least x and y to the opposite one, and of one
# from least x and greatest y.
RISING, FALLING = 3, 4
# Rectangles below this hide little.
LEAST_M2 = 0.25
# Halving a curtain ends here.
PIECE_M = 0.25
# Pairs of a rectangle and a triangle that are looked at together, and triangles of elements that are cut together.
PAIRS = 100_000
TRIANGLES = 20_000
# Elements are cut so far inside their faces [grid steps], and through the middle where they are thinner than THIN_M.
RECESS, ENDS = 4, 2
THIN_M = 0.6
# Normals that rise by less than this are upright; those within NEAR_DEG stand alike.
UPRIGHT = 1e-3
NEAR_DEG = 0.2
# Round elements have a face for every direction: only so many are looked at.
MOST_DIRECTIONS = 8
# Corners of an element are joined to sections that end so near [grid steps].
TIP_STEPS = 400
# No triangle comes so near to a curtain inside an element [grid steps]: its pieces end on the grid beside it.
CLEAR_STEPS = 1.0


def find_curtains(elements: list[np.ndarray], faces: np.ndarray, grid_m: float, *, seconds: float = np.inf) -> Blockers:
    """Curtains of a model.

    Args:
        elements: triangles of each closed opaque element [grid steps], shape (m, 3, 3), int32.
        faces: triangles of opaque objects, shape (n, 3, 3), int32.
        grid_m: grid step [m].
        seconds: that it may take.

    Raises:
        OutOfTime: it would take longer, as the lots that are done took.
    """
    started = time.perf_counter()
    least = LEAST_M2 / grid_m**2
    boxes, kinds = [np.zeros((0, 2, 3), np.int64)], [np.zeros(0, np.int64)]
    # Opaque is what no triangle of its element comes near: of elements that are alike, one tells.
    firsts, shifts = _alike(elements)
    for done, lot in enumerate(track(every := lots_of(firsts), "curtains", "lot")):
        if (time.perf_counter() - started) * (len(every) / done if done else 1.0) > seconds:
            raise OutOfTime
        ask()
        mine, shifts = shifts[: len(lot)], shifts[len(lot) :]
        owner, quads = _sections(lot, least, THIN_M / grid_m)
        held = inside(quads, owner, lot)
        owner, quads = owner[held], quads[held]
        pieces = [(owner[row], part) for row, part in _pieces(quads, PIECE_M / grid_m)]
        for of, part in [*pieces, *_tips(quads, owner, lot)]:
            _add(boxes, kinds, _copied(part, of, mine))
    _add(boxes, kinds, _upright_faces(faces, least))
    joined = np.concatenate(boxes).astype(np.int32)
    return Blockers(joined, np.concatenate(kinds).astype(np.int32))


def _alike(elements: list[np.ndarray]) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """The first element of each shape, and how far it is to each of that shape, (n, 3), itself first."""
    starts = starts_of([len(triangles) for triangles in elements])
    every = np.concatenate([np.zeros((0, 3, 3), np.int32), *elements])
    groups = list(copies(starts, first_alike(every, starts)))
    corners = np.array([triangles.min(axis=(0, 1)) for triangles in elements])
    return [elements[first] for first, _ in groups], [corners[own] - corners[first] for first, own in groups]


def _copied(quads: np.ndarray, owner: np.ndarray, shifts: list[np.ndarray]) -> np.ndarray:
    """Rectangles of the first element of each shape, in all elements of that shape."""
    starts = starts_of([len(own) for own in shifts])
    sizes = np.diff(starts)[owner]
    every = np.concatenate([np.zeros((0, 3), np.int64), *shifts])
    return np.repeat(quads, sizes, axis=0) + every[places_of(starts[:-1][owner], sizes)][:, None]


def lots_of(elements: list[np.ndarray]) -> list[list[np.ndarray]]:
    """Elements in lots of about TRIANGLES triangles, which are cut together."""
    return [elements[first:stop] for first, stop in lots([len(triangles) for triangles in elements], TRIANGLES)]


def _add(boxes: list[np.ndarray], kinds: list[np.ndarray], quads: np.ndarray) -> None:
    """Enter curtains (A, B) x (x, y, z), the z of A below that of B; one along an axis is a plain rectangle."""
    way = quads[:, 1] - quads[:, 0]
    kind = np.where(way[:, 0] * way[:, 1] > 0, RISING, FALLING)
    kind[way[:, 1] == 0] = 1
    kind[way[:, 0] == 0] = 0
    boxes.append(np.sort(quads, axis=1))
    kinds.append(kind)


def face_normals(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Normals of triangles, shape (n, 3), how long they are (twice the area), and which stand upright, bool."""
    # Coordinate by coordinate: NumPy is many times slower along short axes.
    u, v = ((triangles[:, k] - triangles[:, 0]).T.astype(float, order="C") for k in (1, 2))
    normals = np.stack([u[k - 2] * v[k - 1] - u[k - 1] * v[k - 2] for k in range(3)], axis=1)
    size = np.linalg.norm(normals, axis=1)
    return normals, size, np.abs(normals[:, 2]) <= UPRIGHT * size


def _directions(triangles: np.ndarray, least: float) -> list[tuple[float, np.ndarray]]:
    """Yaws of the larger upright faces that stand off the axes [degrees], and the depths of those faces along it."""
    normals, size, upright = face_normals(triangles)
    rows = np.flatnonzero(upright & (normals[:, :2] != 0).all(axis=1))
    if not len(rows):
        return []
    yaw = np.degrees(np.arctan2(normals[rows, 1], normals[rows, 0])) % 180.0
    area = size[rows] / 2
    found: list[tuple[float, np.ndarray]] = []
    left = np.ones(len(rows), bool)
    while left.any() and len(found) < MOST_DIRECTIONS:
        pick = np.flatnonzero(left)[area[left].argmax()]
        off = np.abs((yaw - yaw[pick] + 90.0) % 180.0 - 90.0)
        near = left & (off < NEAR_DEG)
        left &= ~near
        if area[near].sum() < least:
            continue
        n = np.radians(yaw[pick])
        depth = triangles[rows[near]].mean(axis=1)[:, :2] @ np.array([np.cos(n), np.sin(n)])
        found.append((float(yaw[pick]), np.sort(depth)))
    return found


def _sections(elements: list[np.ndarray], least: float, thin: float) -> tuple[np.ndarray, np.ndarray]:
    """Rectangles in sections of elements along their oblique faces.

    Returns:
        Element of each, ascending, shape (n,), and (A, B) x (x, y, z), shape (n, 2, 3), int64.
    """
    cuts, yaws, of = [], [], []
    for number, triangles in enumerate(elements):
        for yaw, depths in _directions(triangles, least):
            level = np.round(turned(triangles.astype(float), -yaw)).astype(np.int64)
            for depth in cuts_inside(depths, int(level[:, :, 0].min()), int(level[:, :, 0].max()), thin):
                cuts.append(over(level, 0, depth))
                yaws.append(yaw)
                of.append(number)
    # Where the element's own coordinates are rounded into its frame a section may touch its border.
    cut, largest = largest_sections(cuts, np.tile([ENDS, 0], (len(cuts), 1)), least)
    depth = np.array([section.plane for section in cuts], np.int64)[cut]
    level = np.concatenate([np.repeat(depth, 2).reshape(-1, 2, 1), largest], axis=2).astype(float)
    # Each is turned by its own angle.
    yaw, quads = np.array(yaws)[cut], np.empty(level.shape)
    for angle in np.unique(yaw):
        quads[yaw == angle] = turned(level[yaw == angle], angle)
    found = np.round(quads).astype(np.int64)
    # A has the least x, and of two the least y.
    swap = (found[:, 0, 0] > found[:, 1, 0]) | ((found[:, 0, 0] == found[:, 1, 0]) & (found[:, 0, 1] > found[:, 1, 1]))
    found[swap, :, :2] = found[swap, ::-1, :2]
    rows = np.unique(np.column_stack([np.array(of, np.int64)[cut], found.reshape(-1, 6)]), axis=0)
    return rows[:, 0], rows[:, 1:].reshape(-1, 2, 3)


def cuts_inside(depths: np.ndarray, low: int, high: int, thin: float, recess: int = RECESS) -> list[int]:
    """Where to cut an element whose faces lie at some depths: just inside of each, and midway where it is thin."""
    planes = np.unique(np.concatenate([[low], np.round(depths).astype(int), [high]]))
    planes = planes[np.append(True, np.diff(planes) > 2)]
    cuts = set()
    for a, b in zip(planes[:-1].tolist(), planes[1:].tolist(), strict=True):
        if b - a < thin:
            cuts.add((a + b) // 2)
        if b - a > 4 * recess:
            cuts |= {a + recess, b - recess}
    return sorted(cuts)


def _pieces(quads: np.ndarray, least: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Curtains with their halves and the halves of those, down to a length, in lots: curtain of each, and pieces."""
    found = []
    length = np.hypot(*(quads[:, 1, :2] - quads[:, 0, :2]).T)
    times = np.maximum(0, np.floor(np.log2(np.maximum(length, 1.0) / least))).astype(int)
    for most in np.unique(times):
        rows = np.flatnonzero(times == most)
        mine = quads[rows]
        for level in range(most + 1):
            parts = 2**level
            share = np.arange(parts + 1)[:, None] / parts
            a, b = mine[:, None, 0, :2], mine[:, None, 1, :2]
            points = np.round(a + share[None] * (b - a)).astype(np.int64)
            piece = np.empty((len(mine), parts, 2, 3), np.int64)
            piece[:, :, 0, :2], piece[:, :, 1, :2] = points[:, :-1], points[:, 1:]
            piece[:, :, :, 2] = mine[:, None, :, 2]
            found.append((np.repeat(rows, parts), piece.reshape(-1, 2, 3)))
    return found


def inside(quads: np.ndarray, owner: np.ndarray, elements: list[np.ndarray], margin: float = CLEAR_STEPS) -> np.ndarray:
    """Rectangles inside a closed surface of which no triangle comes within a margin of them.

    Args:
        quads: (A, B) x (x, y, z) [grid steps], shape (n, 2, 3).
        owner: element of each, ascending, shape (n,).
        elements: triangles of each closed surface, (m, 3, 3).
        margin: as of `meeting`.

    Returns:
        Shape (n,), bool.
    """
    held = np.zeros(len(quads), bool)
    for rows, row, triangles in _pairs(quads, owner, elements):
        held[rows] = winds_around(quads[rows].mean(axis=1), row, triangles)
    rows = np.flatnonzero(held)
    for part, row, triangles in _pairs(quads[rows], owner[rows], elements):
        near = meeting(quads[rows[part]], row, triangles, margin)
        held[rows[part][row[near]]] = False
    return held


def _pairs(
    quads: np.ndarray, owner: np.ndarray, elements: list[np.ndarray]
) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
    """Rectangles in lots with all triangles of their elements: which, row in the lot and triangle of each pair."""
    sizes = np.array([len(triangles) for triangles in elements], np.int64)
    starts = starts_of(sizes)
    every = np.concatenate([np.zeros((0, 3, 3), np.int32), *elements])
    for first, stop in lots(sizes[owner], PAIRS):
        mine = owner[first:stop]
        row = np.repeat(np.arange(stop - first), sizes[mine])
        yield slice(first, stop), row, every[places_of(starts[mine], sizes[mine])]


def _tips(quads: np.ndarray, owner: np.ndarray, elements: list[np.ndarray]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Rectangles from the ends of sections to upright edges of their element nearby: element, and (A, B) x (x, y, z).

    A section ends some steps short of the end of a wall. What it leaves open to the corner, where the next wall begins,
    they close: those from the near end. Those from the far end hide what stands behind the corner from eyes that look
    along the wall.
    """
    found: list[list[np.ndarray]] = [[], []]
    owners: list[list[np.ndarray]] = [[], []]
    starts = np.searchsorted(owner, np.arange(len(elements) + 1))
    for number, triangles in enumerate(elements):
        mine = quads[starts[number] : starts[number + 1]]
        for kind, part in enumerate(_to_corners(mine, triangles)) if len(mine) else ():
            found[kind].append(part)
            owners[kind].append(np.full(len(part), number))
    none = np.zeros((0, 2, 3), np.int64)
    return [
        _opaque(np.concatenate([none, *parts]), np.concatenate([none[:, 0, 0], *of]), elements)
        for parts, of in zip(found, owners, strict=True)
    ]


def _to_corners(quads: np.ndarray, triangles: np.ndarray) -> list[np.ndarray]:
    """Rectangles of one element from the near ends of its sections, and from their far ends."""
    t = triangles.astype(np.int64)
    edges = np.concatenate([t[:, [k, (k + 1) % 3]] for k in range(3)])
    upright = (edges[:, 0, :2] == edges[:, 1, :2]).all(axis=1)
    edges = np.unique(np.sort(edges[upright], axis=1), axis=0)
    end, other = quads[:, [0, 1], :2], quads[:, [1, 0], :2]
    low, high = edges[:, 0], edges[:, 1]
    # Shape (quads, ends, edges, 2).
    way = low[:, :2] - end[:, :, None]
    reach = np.abs(way).max(axis=3)
    near = (reach > 0) & (reach <= TIP_STEPS) & ((way * (end - other)[:, :, None]).sum(axis=3) >= 0)
    quad, side, edge = np.nonzero(near)
    z = np.stack([np.maximum(low[edge, 2], quads[quad, 0, 2]), np.minimum(high[edge, 2], quads[quad, 1, 2])], axis=1)
    found = []
    for begin in (end, other):
        part = np.stack([low[edge, :2], begin[quad, side]], axis=1)
        swap = np.lexsort(part.transpose(2, 0, 1)[::-1], axis=1)
        part = np.concatenate([np.take_along_axis(part, swap[:, :, None], axis=1), z[:, :, None]], axis=2)
        found.append(np.unique(part[z[:, 0] < z[:, 1]], axis=0))
    return found


def _opaque(quads: np.ndarray, owner: np.ndarray, elements: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Those of some rectangles that lie inside the surfaces that own them, borders aside, and their owners; exactly."""
    every = np.concatenate([np.zeros((0, 3, 3), np.int32), *elements])
    middle = quads.sum(axis=1)
    # All that is straight above the middle.
    up = np.stack([middle // 2, -(-middle // 2)], axis=1)
    up[:, 1, 2] = 2 * GRID_LIMIT
    row, which = _boxed(up, owner, elements)
    held = rays_wind(middle, row, every[which])
    rows = np.flatnonzero(held)
    row, which = _boxed(np.sort(quads[rows], axis=1), owner[rows], elements, int(2 * CLEAR_STEPS + 2))
    near = meeting(quads[rows], row, every[which], CLEAR_STEPS)
    row, which = rows[row[near]], which[near]
    for one in np.flatnonzero(~clearly_missed(quads[row], every[which])).tolist():
        if held[row[one]] and crossed(quads[row[one]], every[which[one]]):
            held[row[one]] = False
    return owner[held], quads[held]


def _boxed(
    boxes: np.ndarray, owner: np.ndarray, elements: list[np.ndarray], margin: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Boxes, and those triangles of their elements that their boxes meet or touch.

    Args:
        boxes: low and high corners, shape (n, 2, 3), int.
        owner: element of each, ascending, shape (n,).
        elements: triangles of each, (m, 3, 3), int32.
        margin: boxes are so much wider and longer.

    Returns:
        Box, ascending, and triangle among those of all elements, of each pair.
    """
    ends, starts = (
        starts_of([len(triangles) for triangles in elements]),
        np.searchsorted(owner, range(len(elements) + 1)),
    )
    found = [(np.zeros(0, np.int64), np.zeros(0, np.int64))]
    low, high = (boxes + margin * np.array([[-1, -1, 0], [1, 1, 0]])).astype(np.int32).transpose(1, 2, 0)
    for number in np.flatnonzero(np.diff(starts)).tolist():
        # Corner by corner, and coordinate by coordinate, in lots that stay in the cache.
        one, two, three = elements[number].transpose(1, 2, 0)
        least, most = np.minimum(np.minimum(one, two), three), np.maximum(np.maximum(one, two), three)
        step = max(1, PAIRS // len(elements[number]))
        for begin in range(starts[number], starts[number + 1], step):
            mine = slice(begin, min(begin + step, starts[number + 1]))
            meet = np.ones((mine.stop - begin, least.shape[1]), bool)
            for axis in range(3):
                meet &= least[axis] <= high[axis, mine, None]
                meet &= most[axis] >= low[axis, mine, None]
            row, triangle = np.nonzero(meet)
            found.append((begin + row, ends[number] + triangle))
    return tuple(np.concatenate(column) for column in zip(*found, strict=True))


def clearly_missed(quads: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Pairs, row by row, of which a few comparisons of whole numbers say that they are not `crossed`, shape (n,), bool.

    What a triangle has in the plane of the rectangle lies between its corners; where none of its edges crosses that
    plane inside, between those of its corners that lie in it.
    """
    a, way = quads[:, :1, :2].astype(np.int64), quads[:, 1, :2].astype(np.int64) - quads[:, 0, :2]
    off = triangles[:, :, :2].astype(np.int64) - a
    x, y = way[:, :1], way[:, 1:]
    u, d = off[:, :, 0] * x + off[:, :, 1] * y, off[:, :, 1] * x - off[:, :, 0] * y
    split = (d < 0).any(axis=1) & (d > 0).any(axis=1)
    inside = (d == 0) | split[:, None]
    missed = ~inside.any(axis=1)
    far = np.iinfo(np.int64).max
    for values, low, high in ((u, 0 * x[:, 0], (way**2).sum(axis=1)), (triangles[:, :, 2], *quads[:, :, 2].T)):
        missed |= np.where(inside, values, far).min(axis=1) >= high
        missed |= np.where(inside, values, -far).max(axis=1) <= low
    return missed


def crossed(quad: np.ndarray, triangle: np.ndarray) -> bool:
    """Whether a triangle meets the inside of an upright rectangle, exactly; what touches its border does not.

    Args:
        quad: (A, B) x (x, y, z), shape (2, 3), int64.
        triangle: shape (3, 3), int.
    """
    (ax, ay, low), (bx, by, high) = quad.tolist()
    x, y = bx - ax, by - ay
    # Along the rectangle, out of its plane, and up; in whole numbers.
    points = [((p - ax) * x + (q - ay) * y, (q - ay) * x - (p - ax) * y, r) for p, q, r in triangle.tolist()]
    return _cuts_through(points, x * x + y * y, low, high)


def _cuts_through(points: list[tuple[int, int, int]], length: int, low: int, high: int) -> bool:
    """Whether a triangle (u, d, z) meets the inside of the rectangle 0 < u < length, d = 0, low < z < high."""
    flat: list[tuple[Fraction, Fraction]] = []
    for k in range(3):
        (u, d, z), (v, e, y) = points[k], points[(k + 1) % 3]
        if d == 0:
            flat.append((Fraction(u), Fraction(z)))
        if d * e < 0:
            share = Fraction(d, d - e)
            flat.append((u + share * (v - u), z + share * (y - z)))
    if not flat:
        return False
    axes = [(1, 0), (0, 1)]
    axes += [(q[1] - p[1], p[0] - q[0]) for p, q in combinations(flat, 2)]
    corners = [(u, z) for u in (0, length) for z in (low, high)]
    for x, y in axes:
        if (x, y) != (0, 0):
            mine, box = ([u * x + z * y for u, z in part] for part in (flat, corners))
            if min(mine) >= max(box) or max(mine) <= min(box):
                return False
    return True


def meeting(quads: np.ndarray, row: np.ndarray, triangles: np.ndarray, margin: float) -> np.ndarray:
    """Pairs of an upright rectangle and a triangle that may come within a margin of its inside.

    Separating axes in the frame of the rectangle, in float64; what lies near is on the side of "may".

    Args:
        quads: (A, B) x (x, y, z) [grid steps], shape (n, 2, 3).
        row: rectangle of each pair, shape (pairs,).
        triangles: of each pair, shape (pairs, 3, 3).
        margin: [grid steps], out of the plane of the rectangle and along it; up and down it is 0.

    Returns:
        Which pairs, ascending.
    """
    # Boxes part most of them. Top and bottom are exact: what only touches them does not part the rectangle.
    low, high = quads.min(axis=1), quads.max(axis=1)
    around = np.array([2.0, 2.0, 0.0]) * (margin + 1.0)
    low, high = low - around, high + around
    one, two, three = triangles.transpose(1, 2, 0)
    outside = np.zeros(len(row), bool)
    for axis in range(3):
        outside |= np.minimum(np.minimum(one[axis], two[axis]), three[axis]) >= high[row, axis]
        outside |= np.maximum(np.maximum(one[axis], two[axis]), three[axis]) <= low[row, axis]
    which = np.flatnonzero(~outside)
    q, t = quads[row[which]].astype(float), triangles[which].astype(float)
    along = q[:, 1, :2] - q[:, 0, :2]
    length = np.hypot(along[:, 0], along[:, 1])
    along = along / length[:, None]
    x, y = (t[:, :, axis] - q[:, :1, axis] for axis in (0, 1))
    ux, uy = along[:, :1], along[:, 1:]
    # Along the rectangle, and out of its plane.
    u, d = x * ux + y * uy, y * ux - x * uy
    near = (d.min(axis=1) <= margin) & (d.max(axis=1) >= -margin)
    near &= (u.min(axis=1) <= length + margin) & (u.max(axis=1) >= -margin)
    which, u, d, z, q, length = which[near], u[near], d[near], t[near, :, 2], q[near], length[near]
    # The part of each triangle within the margin of the plane, as the points that bound it.
    us, zs, used = [], [], []
    for k in range(3):
        j = (k + 1) % 3
        us.append(u[:, k])
        zs.append(z[:, k])
        used.append(np.abs(d[:, k]) <= margin)
        rise = d[:, j] - d[:, k]
        for level in (-margin, margin):
            share = np.divide(level - d[:, k], rise, out=np.full(len(which), -1.0), where=rise != 0)
            us.append(u[:, k] + share * (u[:, j] - u[:, k]))
            zs.append(z[:, k] + share * (z[:, j] - z[:, k]))
            used.append((share >= 0) & (share <= 1))
    us, zs, used = np.stack(us), np.stack(zs), np.stack(used)
    # A polygon and a rectangle of a plane are apart if a line along a side of either parts them.
    right, bottom, top = length + margin, q[:, 0, 2], q[:, 1, 2]
    corners = [(side, level) for side in (np.full(len(which), -margin), right) for level in (bottom, top)]
    one, none = np.ones(len(which)), np.zeros(len(which))
    axes = [(one, none), (none, one)]
    axes += [(z[:, k] - z[:, (k + 1) % 3], u[:, (k + 1) % 3] - u[:, k]) for k in range(3)]
    parted = ~used.any(axis=0)
    for a, b in axes:
        value, box = us * a + zs * b, np.stack([cu * a + cz * b for cu, cz in corners])
        least, most = np.where(used, value, np.inf).min(axis=0), np.where(used, value, -np.inf).max(axis=0)
        parted |= ((least >= box.max(axis=0)) | (most <= box.min(axis=0))) & ((a != 0) | (b != 0))
    return which[~parted]


def _upright_faces(triangles: np.ndarray, least: float) -> np.ndarray:
    """Rectangles that triangles over two plan points make up: (A, B) x (x, y, z), shape (n, 2, 3), int64."""
    sides = extents(triangles)
    some = (sides[:, :2] > 0).all(axis=1) & (np.hypot(sides[:, 0], sides[:, 1]) * sides[:, 2] >= least / 4)
    t = triangles[some].astype(np.int64)
    # Plan points as single numbers, in the order of x, then y.
    key = t[:, :, 0] * (1 << 32) + t[:, :, 1]
    order = np.sort(key, axis=1)
    two = (order[:, 0] != order[:, 2]) & ((order[:, 1] == order[:, 0]) | (order[:, 1] == order[:, 2]))
    t, key, order = t[two], key[two], order[two]
    ends = order[:, [0, 2]]
    group, which = np.unique(ends, axis=0, return_inverse=True)
    which = which.ravel()
    # Over the first point 0, over the second one 1.
    side = (key != ends[:, :1]).astype(np.int64)
    face, flat = tiles(outline(np.stack([side, t[:, :, 2]], axis=2), which, len(group)), 1)
    whole = (flat[:, 0, 0] == 0) & (flat[:, 1, 0] == 1)
    face, flat = face[whole], flat[whole]
    points = np.empty((len(group), 2, 2), np.int64)
    points[which[:, None], side] = t[:, :, :2]
    quads = np.concatenate([points[face], flat[:, :, 1:]], axis=2)
    size = (flat[:, 1, 1] - flat[:, 0, 1]) * np.hypot(*(quads[:, 1, :2] - quads[:, 0, :2]).T)
    return quads[size >= least]
