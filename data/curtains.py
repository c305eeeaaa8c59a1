"""Curtains: upright opaque rectangles at any angle, inside closed elements or on their faces.

A curtain stands on the segment between two grid points of the plan and blocks between two heights. Inside a closed
element any rectangle that no triangle of the element comes near is opaque to eyes outside solids, however it was found:
elements are cut in floating point, along the directions of their own faces, and every rectangle is then checked. A face
whose corners stand over two grid points is a curtain as it is.

The line search cannot use a curtain whole where the line passes close above or below it; so inside elements each comes
with its halves, their halves, and so on. Source of the idea of occluders at any angle: Chhugani et al. 2005, section
5.2; the ways past them are in kernels/curtains.py.
"""

from fractions import Fraction
from itertools import combinations

import numpy as np

from .blockers import Blockers, maximal_rectangles, paint
from .opaque import plane_rectangles
from .progress import track
from .ragged import starts_of
from .regions import section_rectangles
from .scene import turned
from .shapes import shape_key
from .solids import winding_numbers

# `Blockers.axis` of a curtain from the corner of its plan box with the least x and y to the opposite one, and of one
# from least x and greatest y.
RISING, FALLING = 3, 4
# Rectangles below this hide little.
LEAST_M2 = 0.25
# Halving a curtain ends here.
PIECE_M = 0.25
# Pairs of a rectangle and a triangle that are looked at together.
PAIRS = 100_000
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


def find_curtains(elements: list[np.ndarray], faces: np.ndarray, grid_m: float) -> Blockers:
    """Curtains of a model.

    Args:
        elements: triangles of each closed opaque element [grid steps], shape (m, 3, 3), int32.
        faces: triangles of opaque objects, shape (n, 3, 3), int32.
        grid_m: grid step [m].
    """
    least = LEAST_M2 / grid_m**2
    boxes, kinds = [np.zeros((0, 2, 3), np.int64)], [np.zeros(0, np.int64)]
    # Opaque is what no triangle of its element comes near: of elements that are alike, one tells.
    known: dict[bytes, tuple[np.ndarray, list[np.ndarray]]] = {}
    for triangles in track(elements, "curtains", "element"):
        key, corner = shape_key(triangles), triangles.min(axis=(0, 1))
        if key not in known:
            known[key] = corner, _of_element(triangles, least, grid_m)
        first, parts = known[key]
        for part in parts:
            _add(boxes, kinds, part + (corner - first))
    _add(boxes, kinds, _upright_faces(faces, least))
    joined = np.concatenate(boxes).astype(np.int32)
    return Blockers(joined, np.concatenate(kinds).astype(np.int32))


def _of_element(triangles: np.ndarray, least: float, grid_m: float) -> list[np.ndarray]:
    """Curtains inside one closed element, in lots: (A, B) x (x, y, z), shape (n, 2, 3), int64."""
    quads = _sections(triangles, least, THIN_M / grid_m)
    if not len(quads):
        return []
    quads = quads[inside(quads, triangles)]
    return [*_pieces(quads, PIECE_M / grid_m), *_tips(quads, triangles)]


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
    edges = (triangles[:, 1:] - triangles[:, :1]).astype(float)
    normals = np.cross(edges[:, 0], edges[:, 1])
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


def _sections(triangles: np.ndarray, least: float, thin: float) -> np.ndarray:
    """Rectangles in sections of one element along its oblique faces: (A, B) x (x, y, z), shape (n, 2, 3), int64."""
    quads = [np.zeros((0, 2, 3), np.int64)]
    for yaw, depths in _directions(triangles, least):
        level = np.round(turned(triangles.astype(float), -yaw)).astype(np.int64)
        low, high = level[:, :, 0].min(axis=1), level[:, :, 0].max(axis=1)
        for depth in cuts_inside(depths, int(low.min()), int(high.max()), thin):
            # Where the element's own coordinates are rounded into this frame a section may touch its border.
            largest = largest_sections(level[(low < depth) & (high >= depth)], 0, depth, (ENDS, 0), least)
            corners = np.concatenate([np.full((len(largest), 2, 1), depth), largest], axis=2)
            quads.append(np.round(turned(corners.astype(float), yaw)).astype(np.int64))
    found = np.concatenate(quads)
    # A has the least x, and of two the least y.
    swap = (found[:, 0, 0] > found[:, 1, 0]) | ((found[:, 0, 0] == found[:, 1, 0]) & (found[:, 0, 1] > found[:, 1, 1]))
    found[swap, :, :2] = found[swap, ::-1, :2]
    return np.unique(found, axis=0)


def largest_sections(
    cut: np.ndarray, axis: int, k: int, ends: tuple[int, int], least: float, *, below: bool = True
) -> np.ndarray:
    """The largest rectangles inside the section of a closed surface by a plane, as `section_rectangles` takes it.

    Args:
        cut: its triangles that reach over the plane [grid steps], shape (m, 3, 3), int.
        axis: perpendicular to the plane.
        k: coordinate of the plane.
        ends: what each rectangle is cut short by, on both of its ends, along u and v [grid steps].
        least: smaller ones are left out [squared grid steps].
        below: section just below the plane, or just above it.

    Returns:
        Shape (n, 2, 2), int64, overlapping.
    """
    rectangles = section_rectangles(cut, axis, k, below=below) if len(cut) else np.zeros((0, 2, 2), np.int64)
    if not len(rectangles):
        return rectangles
    us, vs = np.unique(rectangles[:, :, 0]), np.unique(rectangles[:, :, 1])
    solid = paint(rectangles, us, vs)
    largest = maximal_rectangles(solid, solid, us, vs).astype(np.int64)
    largest += np.array([ends, ends]) * np.array([[1], [-1]])
    size = largest[:, 1] - largest[:, 0]
    return largest[(size > 0).all(axis=1) & (size.prod(axis=1) >= least)]


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


def _pieces(quads: np.ndarray, least: float) -> list[np.ndarray]:
    """Curtains with their halves and the halves of those, down to a length, in lots."""
    found = []
    length = np.hypot(*(quads[:, 1, :2] - quads[:, 0, :2]).T)
    times = np.maximum(0, np.floor(np.log2(np.maximum(length, 1.0) / least))).astype(int)
    for most in np.unique(times):
        mine = quads[times == most]
        for level in range(most + 1):
            parts = 2**level
            share = np.arange(parts + 1)[:, None] / parts
            a, b = mine[:, None, 0, :2], mine[:, None, 1, :2]
            points = np.round(a + share[None] * (b - a)).astype(np.int64)
            piece = np.empty((len(mine), parts, 2, 3), np.int64)
            piece[:, :, 0, :2], piece[:, :, 1, :2] = points[:, :-1], points[:, 1:]
            piece[:, :, :, 2] = mine[:, None, :, 2]
            found.append(piece.reshape(-1, 2, 3))
    return found


def inside(quads: np.ndarray, triangles: np.ndarray, margin: float = CLEAR_STEPS) -> np.ndarray:
    """Rectangles inside a closed surface none of whose triangles comes within a margin of them, shape (n,), bool.

    Arguments as of `meeting`.
    """
    held = np.abs(winding_numbers(quads.mean(axis=1), triangles)) > 0.5
    rows = np.flatnonzero(held)
    held[rows[meeting(quads[rows], triangles, margin)[0]]] = False
    return held


def _tips(quads: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rectangles from the ends of sections to upright edges of their element nearby: (A, B) x (x, y, z), (n, 2, 3).

    A section ends some steps short of the end of a wall. What it leaves open to the corner, where the next wall begins,
    they close: those from the near end. Those from the far end hide what stands behind the corner from eyes that look
    along the wall.
    """
    t = triangles.astype(np.int64)
    edges = np.concatenate([t[:, [k, (k + 1) % 3]] for k in range(3)])
    upright = (edges[:, 0, :2] == edges[:, 1, :2]).all(axis=1)
    edges = np.unique(np.sort(edges[upright], axis=1), axis=0)
    if not len(quads):
        return quads, quads
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
    return tuple(_opaque(part, triangles) for part in found)


def _opaque(quads: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Those of some rectangles that lie inside a closed surface, borders aside; exactly."""
    quads = quads[np.abs(winding_numbers(quads.mean(axis=1), triangles)) > 0.5]
    clear = np.ones(len(quads), bool)
    rows, near = meeting(quads, triangles, CLEAR_STEPS)
    doubtful = ~clearly_missed(quads[rows], triangles[near])
    for row, which in zip(rows[doubtful], near[doubtful], strict=True):
        clear[row] = clear[row] and not crossed(quads[row], triangles[which])
    return quads[clear]


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


def meeting(quads: np.ndarray, triangles: np.ndarray, margin: float) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of an upright rectangle and a triangle that may come within a margin of its inside.

    Separating axes in the frame of the rectangle, in float64; what lies near is on the side of "may".

    Args:
        quads: (A, B) x (x, y, z) [grid steps], shape (n, 2, 3).
        triangles: shape (m, 3, 3).
        margin: [grid steps], out of the plane of the rectangle and along it; up and down it is 0.

    Returns:
        Rows of both, shape (pairs,).
    """
    found = [np.zeros((2, 0), int)]
    step = max(1, PAIRS // max(1, len(triangles)))
    for begin in range(0, len(quads), step):
        rows, near = _meeting(quads[begin : begin + step].astype(float), triangles.astype(float), margin)
        found.append(np.stack([rows + begin, near]))
    return tuple(np.concatenate(found, axis=1))


def _meeting(quads: np.ndarray, triangles: np.ndarray, margin: float) -> tuple[np.ndarray, np.ndarray]:
    """As `meeting`, of few enough."""
    along = quads[:, 1, :2] - quads[:, 0, :2]
    length = np.hypot(along[:, 0], along[:, 1])
    along = along / length[:, None]
    x, y = (triangles[None, :, :, axis] - quads[:, 0, axis, None, None] for axis in (0, 1))
    ux, uy = along[:, 0, None, None], along[:, 1, None, None]
    # Along the rectangle, and out of its plane.
    u, d = x * ux + y * uy, y * ux - x * uy
    low, high = triangles[:, :, 2].min(axis=1), triangles[:, :, 2].max(axis=1)
    near = (d.min(axis=2) <= margin) & (d.max(axis=2) >= -margin)
    near &= (u.min(axis=2) <= length[:, None] + margin) & (u.max(axis=2) >= -margin)
    # Top and bottom are exact: what only touches them does not part the rectangle.
    near &= (low < quads[:, 1, None, 2]) & (high > quads[:, 0, None, 2])
    rows, which = np.nonzero(near)
    u, d, z = u[rows, which], d[rows, which], triangles[which, :, 2]
    # The part of each triangle within the margin of the plane, as the points that bound it.
    us, zs, used = [], [], []
    for k in range(3):
        j = (k + 1) % 3
        us.append(u[:, k])
        zs.append(z[:, k])
        used.append(np.abs(d[:, k]) <= margin)
        rise = d[:, j] - d[:, k]
        for level in (-margin, margin):
            share = np.divide(level - d[:, k], rise, out=np.full(len(rows), -1.0), where=rise != 0)
            us.append(u[:, k] + share * (u[:, j] - u[:, k]))
            zs.append(z[:, k] + share * (z[:, j] - z[:, k]))
            used.append((share >= 0) & (share <= 1))
    us, zs, used = np.stack(us), np.stack(zs), np.stack(used)
    # A polygon and a rectangle of a plane are apart if a line along a side of either parts them.
    right, bottom, top = length[rows] + margin, quads[rows, 0, 2], quads[rows, 1, 2]
    corners = [(side, level) for side in (np.full(len(rows), -margin), right) for level in (bottom, top)]
    one, none = np.ones(len(rows)), np.zeros(len(rows))
    axes = [(one, none), (none, one)]
    axes += [(z[:, k] - z[:, (k + 1) % 3], u[:, (k + 1) % 3] - u[:, k]) for k in range(3)]
    parted = ~used.any(axis=0)
    for a, b in axes:
        value, box = us * a + zs * b, np.stack([cu * a + cz * b for cu, cz in corners])
        least, most = np.where(used, value, np.inf).min(axis=0), np.where(used, value, -np.inf).max(axis=0)
        parted |= ((least >= box.max(axis=0)) | (most <= box.min(axis=0))) & ((a != 0) | (b != 0))
    return rows[~parted], which[~parted]


def _upright_faces(triangles: np.ndarray, least: float) -> np.ndarray:
    """Rectangles that triangles over two plan points make up: (A, B) x (x, y, z), shape (n, 2, 3), int64."""
    t = triangles.astype(np.int64)
    # Plan points as single numbers, in the order of x, then y.
    key = t[:, :, 0] * (1 << 32) + t[:, :, 1]
    order = np.sort(key, axis=1)
    two = (order[:, 0] != order[:, 2]) & ((order[:, 1] == order[:, 0]) | (order[:, 1] == order[:, 2]))
    extent = np.ptp(t, axis=1)
    two &= (extent[:, :2] > 0).all(axis=1) & (np.hypot(extent[:, 0], extent[:, 1]) * extent[:, 2] >= least / 4)
    t, key, order = t[two], key[two], order[two]
    ends, group, count = np.unique(order[:, [0, 2]], axis=0, return_inverse=True, return_counts=True)
    group, starts = group.ravel(), starts_of(count)
    rows = np.argsort(group, kind="stable")
    y = (ends + (1 << 31)) % (1 << 32) - (1 << 31)
    points = np.stack([(ends - y) >> 32, y], axis=2)
    # Over the first point 0, over the second one 1.
    flat = np.stack([key != ends[group][:, :1], t[:, :, 2]], axis=2)
    pairs = np.flatnonzero(count == 2)
    whole = fill_rectangle(flat[rows[starts[pairs][:, None] + [0, 1]]])
    of, heights = [pairs[whole]], [flat[rows[starts[pairs[whole]]]][:, :, 1]]
    heights[0] = np.stack([heights[0].min(axis=1), heights[0].max(axis=1)], axis=1)
    # A triangle alone fills none.
    several = count > 1
    several[pairs[whole]] = False
    for number in np.flatnonzero(several).tolist():
        found, _, _ = plane_rectangles(flat[rows[starts[number] : starts[number + 1]]].astype(np.int32), 1)
        found = found[(found[:, 0, 0] == 0) & (found[:, 1, 0] == 1)].astype(np.int64)
        of.append(np.full(len(found), number))
        heights.append(found[:, :, 1])
    of, heights = np.concatenate(of), np.concatenate(heights)
    large = np.hypot(*(points[of, 1] - points[of, 0]).T) * (heights[:, 1] - heights[:, 0]) >= least
    of, heights = of[large], heights[large]
    quads = np.concatenate([points[of], heights[:, :, None]], axis=2)
    return quads[np.argsort(of, kind="stable")]


def fill_rectangle(pairs: np.ndarray) -> np.ndarray:
    """Pairs of triangles (u, v) with u of 0 or 1 that are the halves of a rectangle, as most faces are; (n,), bool.

    Args:
        pairs: shape (n, 2, 3, 2), int; no triangle is a segment.
    """
    right = pairs[..., 0].sum(axis=2)
    # One has two corners at 0, the other two at 1, and each of them the rectangle's height there.
    halves = (right == 1) | (right == 2)
    halves = halves.all(axis=1) & (right.sum(axis=1) == 3)
    low, high = pairs[..., 1].min(axis=2), pairs[..., 1].max(axis=2)
    halves &= (low[:, 0] == low[:, 1]) & (high[:, 0] == high[:, 1])
    lone = (pairs[..., 0] == 1) == (right == 1)[:, :, None]
    apex = np.where(lone, pairs[..., 1], 0).sum(axis=2)
    base = np.where(lone, low[:, :, None], pairs[..., 1])
    halves &= (base.max(axis=2) == high).all(axis=1)
    base = np.where(lone, high[:, :, None], pairs[..., 1])
    halves &= (base.min(axis=2) == low).all(axis=1)
    # The diagonal is one and the same.
    return halves & (apex.sum(axis=1) == low[:, 0] + high[:, 0]) & (apex[:, 0] != apex[:, 1])
