"""What may be hidden: a hierarchy over all objects, and each object as boxes around its pieces.

One proof for a node of the hierarchy hides everything below it. The pieces keep the empty corners of an L-shaped or
oblique object out of the question. Source: Chhugani et al. 2005, section 5.2, tests the polygons of an object; boxes
around them are conservative.
"""

from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np

from .exposed import UprightFace, face_pieces
from .frame import wall_yaw
from .hierarchy import build_levels
from .incidence import CHUNK, clip_bounds
from .patience import ask
from .plans import NO_PLANS, Plans, are_convex, box_corners, turned_plan
from .ragged import owners_of, places_of
from .scene import Scene, bounds_by_owner, turned

# Pieces are no smaller than this, and at most PIECES along an axis of their object.
PIECE_M = 1.0
PIECES = 4
# Objects that stand further off the axes than this [degrees] are cut in their own frame: nearer, pieces of 4 m lie a
# dozen steps off at most, where plans are no tighter and slower.
OBLIQUE_DEG = 0.2
# Snapping turns a short face by so much.
SNAPPED_DEG = 0.1
# Rounding into that frame and back moves a corner by no more [grid steps].
ROUNDING = 2
# Pieces in an object's own frame must hold it in so much less than pieces along the axes.
TIGHTER = 0.9
# Which of four corners to take from the object itself: all, all but one, ..., none.
FEWER_CORNERS = sorted(product((True, False), repeat=4), key=sum, reverse=True)


@dataclass
class Occludees:
    """Objects and their pieces, in grid steps.

    Attributes:
        bounds: of each object, shape (objects, 2, 3), int32; low > high for one without triangles.
        levels: node bounds of a perfect binary tree, one array (2**level, 2, 3), int32, a level; the last one's nodes
            are objects.
        objects: object of each node of the last level, -1 for none, int32.
        pieces: boxes that together hold all triangles of their object, shape (pieces, 2, 3), int32.
        plans: of pieces that stand at an angle; then it is these prisms that hold the triangles.
        starts: pieces of object o are starts[o]:starts[o + 1], shape (objects + 1,), int64.
    """

    bounds: np.ndarray
    levels: list[np.ndarray]
    objects: np.ndarray
    pieces: np.ndarray
    plans: Plans
    starts: np.ndarray

    @property
    def owners(self) -> np.ndarray:
        """Object of each piece, shape (pieces,), int64."""
        return owners_of(self.starts)


def find_occludees(scene: Scene, exposed: dict[int, list[UprightFace]] | None = None) -> Occludees:
    """Occludees of all objects of a scene, opaque or not.

    Args:
        scene: the model.
        exposed: of objects some of whose upright faces nobody can see, the others, as of `exposed_faces`: only these
            and the level ones are put into pieces, each face for itself. None by default.
    """
    bounds = scene.object_bounds()
    pieces, plans, owner = _pieces(scene, bounds)
    if exposed:
        pieces, plans, owner = _face_by_face(scene, exposed, pieces, plans, owner)
    return _occludees(bounds, pieces, plans, owner)


def box_occludees(scene: Scene) -> Occludees:
    """As `find_occludees`, with one piece for every object, the box around it: looser, and no work."""
    bounds = scene.object_bounds()
    present = _present(bounds)
    return _occludees(bounds, bounds[present].astype(np.int32), NO_PLANS, present)


def turned_occludees(scene: Scene, yaw_deg: float) -> Occludees:
    """Occludees of a scene in a frame that stands at an angle in its own, all in boxes, on that frame's grid.

    Boxes are rounded outwards: a line that meets the object meets its box. Triangles without area in the frame count.
    """
    triangles, owners = scene.triangles()
    level = np.round(turned(triangles.astype(float), -yaw_deg)).astype(np.int64)
    bounds, rounded = bounds_by_owner(level, owners, len(scene.objects)), np.array([[-1, -1, 0], [1, 1, 0]])
    pieces, owner = _cut(level, owners, bounds, round(PIECE_M / scene.grid_m))
    bounds[_present(bounds)] += rounded
    return _occludees(bounds, (pieces + rounded).astype(np.int32), NO_PLANS, owner)


def _present(bounds: np.ndarray) -> np.ndarray:
    """Objects that have triangles, ascending."""
    return np.flatnonzero((bounds[:, 0] <= bounds[:, 1]).all(axis=1))


def _occludees(bounds: np.ndarray, pieces: np.ndarray, plans: Plans, owner: np.ndarray) -> Occludees:
    """Occludees of bounds, and of pieces in the order of their objects."""
    present = _present(bounds)
    levels, objects = build_levels(bounds[present])
    # An empty node's -1 takes the last entry: -1.
    objects = np.append(present, -1)[objects].astype(np.int32)
    starts = np.searchsorted(owner, np.arange(len(bounds) + 1))
    return Occludees(bounds.astype(np.int32), levels, objects, pieces, plans, starts)


def _pieces(scene: Scene, bounds: np.ndarray) -> tuple[np.ndarray, Plans, np.ndarray]:
    """Pieces of all objects in object order, their plans, and the object of each."""
    triangles, owners = scene.triangles()
    models = scene.first_alike
    cut = models[owners] == owners
    triangles, owners = triangles[cut], owners[cut]
    yaw = _yaws(triangles, owners, len(bounds))
    least, plain = round(PIECE_M / scene.grid_m), yaw[owners] == 0
    boxes, owner = _cut(triangles, owners, bounds, least)
    corners, oblique = _cut_turned(triangles[~plain], owners[~plain], yaw, least)
    # Leaning objects fill no frame that is turned about the vertical: whichever holds them in less.
    size = (boxes[:, 1] - boxes[:, 0] + 1.0).prod(axis=1)
    across = corners[:, 2, :2] - corners[:, 0, :2], corners[:, 3, :2] - corners[:, 1, :2]
    area = np.abs(across[0][:, 0] * across[1][:, 1] - across[0][:, 1] * across[1][:, 0]) / 2
    turned_size = area * (corners[:, 2, 2] - corners[:, 0, 2] + 1.0)
    total = [np.bincount(o, s, minlength=len(bounds)) for o, s in ((owner, size), (oblique, turned_size))]
    tighter = (total[1] > 0) & (total[1] < TIGHTER * total[0])
    boxes, owner = boxes[~tighter[owner]], owner[~tighter[owner]]
    corners, oblique = corners[tighter[oblique]], oblique[tighter[oblique]]
    boxes, place, owner = _in_order(boxes, owner, corners, oblique)
    first = np.searchsorted(owner, np.arange(len(bounds) + 1))
    count = np.diff(first)[models]
    objects = np.repeat(np.arange(len(bounds)), count)
    row = places_of(first[models], count)
    shift = bounds[objects, 0] - bounds[models[objects], 0]
    rows = np.flatnonzero(place[row] >= 0)
    plans = corners[place[row[rows]], :, :2] + shift[rows, None, :2]
    return (boxes[row] + shift[:, None]).astype(np.int32), Plans(rows, plans.astype(np.int32)), objects


def _in_order(
    boxes: np.ndarray, owner: np.ndarray, corners: np.ndarray, oblique: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Boxes and prisms, (n, 4, 3) each, as pieces in the order of their objects.

    Returns:
        Boxes, place of each piece among the prisms, -1 for a plain box, and the object of each.
    """
    around = np.stack([corners.min(axis=1), corners.max(axis=1)], axis=1)
    place = np.concatenate([np.full(len(boxes), -1), np.arange(len(corners))])
    boxes, owner = np.concatenate([boxes, around]), np.concatenate([owner, oblique])
    order = np.argsort(owner, kind="stable")
    return boxes[order], place[order], owner[order]


def _face_by_face(
    scene: Scene, exposed: dict[int, list[UprightFace]], pieces: np.ndarray, plans: Plans, owner: np.ndarray
) -> tuple[np.ndarray, Plans, np.ndarray]:
    """Pieces, plans and owners as of `_pieces`, with those of some objects replaced by pieces of their faces."""
    least, starts, triangles = round(PIECE_M / scene.grid_m), scene.triangle_starts, scene.triangles()[0]
    kept = ~np.isin(owner, list(exposed))
    planned = np.zeros(len(pieces), bool)
    planned[plans.rows] = True
    upright = np.concatenate([plans.corners, np.repeat(pieces[plans.rows][:, :, 2], 2, axis=1)[:, :, None]], axis=2)
    boxes, owners = [pieces[kept & ~planned]], [owner[kept & ~planned]]
    prisms, oblique = [upright[kept[plans.rows]]], [owner[kept & planned]]
    for object_id, faces in exposed.items():
        ask()
        own = triangles[starts[object_id] : starts[object_id + 1]]
        level = own[np.ptp(own[:, :, 2], axis=1) == 0]
        one = np.zeros(len(level), np.int64)
        yaw = _yaws(own, np.zeros(len(own), np.int64), 1)
        found = [face_pieces(face, 2 * least) for face in faces]
        if yaw[0]:
            found.append((np.zeros((0, 2, 3), np.int64), _cut_turned(level, one, yaw, least)[0]))
        else:
            around = np.array([[own.min(axis=(0, 1)), own.max(axis=(0, 1))]])
            found.append((_cut(level, one, around, least)[0], np.zeros((0, 4, 3), np.int64)))
        for parts, names, new in zip((boxes, prisms), (owners, oblique), zip(*found, strict=True), strict=True):
            parts += new
            names.append(np.full(sum(map(len, new)), object_id))
    joined = [np.concatenate(part) for part in (boxes, owners, prisms, oblique)]
    pieces, place, owner = _in_order(*joined)
    rows = np.flatnonzero(place >= 0)
    return pieces.astype(np.int32), Plans(rows, joined[2][place[rows], :, :2].astype(np.int32)), owner


def _yaws(triangles: np.ndarray, owners: np.ndarray, count: int) -> np.ndarray:
    """How each object stands off the axes [degrees], 0 where it hardly does, shape (count,)."""
    starts, yaw = np.searchsorted(owners, np.arange(count + 1)), np.zeros(count)
    for number in np.unique(owners):
        ask()
        own = triangles[starts[number] : starts[number + 1]].astype(float)
        own -= own.min(axis=(0, 1))
        yaw[number] = wall_yaw([(own.reshape(-1, 3), np.arange(3 * len(own)).reshape(-1, 3))], SNAPPED_DEG)
    return np.where(np.abs(yaw) < OBLIQUE_DEG, 0.0, yaw)


def _cut_turned(
    triangles: np.ndarray, owners: np.ndarray, yaw: np.ndarray, least: int
) -> tuple[np.ndarray, np.ndarray]:
    """Pieces of objects in their own frames: corners of each plan, z low and high in turn, shape (n, 4, 3); objects."""
    numbers = np.unique(owners)
    starts = np.searchsorted(owners, [*numbers.tolist(), len(yaw)])
    bases, levels = np.zeros((len(numbers), 3), np.int64), np.empty(triangles.shape, np.int64)
    for place, (first, stop) in enumerate(pairwise(starts.tolist())):
        own = triangles[first:stop].astype(np.int64)
        # Cut about its own corner, so that what is alike is cut alike.
        bases[place] = own.min(axis=(0, 1))
        levels[first:stop] = np.round(turned((own - bases[place]).astype(float), -yaw[numbers[place]]))
    places = np.repeat(np.arange(len(numbers)), np.diff(starts))
    boxes, place = _cut(levels, places, bounds_by_owner(levels, places, len(numbers)), least)
    ends = np.searchsorted(place, np.arange(len(numbers) + 1))
    corners = [np.zeros((0, 4, 3), np.int64)]
    for number in range(len(numbers)):
        ask()
        own = triangles[starts[number] : starts[number + 1]].astype(np.int64) - bases[number]
        mine = boxes[ends[number] : ends[number + 1]]
        corners.append(_tight_plans(own, mine, yaw[numbers[number]]) + bases[number])
    return np.concatenate(corners), numbers[place]


def _tight_plans(triangles: np.ndarray, boxes: np.ndarray, yaw_deg: float) -> np.ndarray:
    """Upright prisms that hold what lies of the triangles in boxes of a turned frame: corners, shape (n, 4, 3), int64.

    Their corners are those of the object where it has some there: what is a step larger sticks out of the wall that the
    object ends in.
    """
    frame = box_corners(boxes + np.array([[-ROUNDING], [ROUNDING]])).astype(float)
    wide = np.round(turned_plan(frame.reshape(-1, 2), yaw_deg)).astype(np.int64).reshape(-1, 4, 2)
    vertices = np.unique(triangles.reshape(-1, 3)[:, :2], axis=0)
    row, points = _plan_points(triangles, boxes[:, :, :2] + np.array([[-1], [1]]), yaw_deg)
    away = np.abs(vertices - wide[:, :, None]).max(axis=3)
    nearest = vertices[away.argmin(axis=2)]
    tight = away.min(axis=2) <= 2 * ROUNDING + 1
    plans, left = wide.copy(), np.ones(len(boxes), bool)
    for some in FEWER_CORNERS:
        plan = np.where((tight & np.array(some))[:, :, None], nearest, wide)
        held = are_convex(plan)
        along, rest = np.roll(plan, -1, axis=1) - plan, points[:, None] - plan[row]
        inward = along[row, :, 0] * rest[:, :, 1] - along[row, :, 1] * rest[:, :, 0]
        held[row[(inward < -1e-6 * np.abs(along).sum(axis=2)[row]).any(axis=1)]] = False
        plans[left & held] = plan[left & held]
        left &= ~held
        if not left.any():
            break
    heights = boxes[:, [0, 0, 1, 1], 2]
    return np.concatenate([plans, heights[:, :, None]], axis=2)


def _plan_points(triangles: np.ndarray, rectangles: np.ndarray, yaw_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """Points whose convex hulls hold the triangles' plan inside rectangles (n, 2, 2) of a turned frame.

    Returns:
        Rectangle of each point, shape (m,), and points in the model's own frame, shape (m, 2).
    """
    flat = turned(triangles.astype(float), -yaw_deg)[:, :, :2]
    near = (flat.min(axis=1) <= rectangles[:, None, 1]) & (flat.max(axis=1) >= rectangles[:, None, 0])
    row, which = np.nonzero(near.all(axis=2))
    flat, own = flat[which], triangles[which][:, :, :2].astype(float)
    low, high = rectangles[row].astype(float).transpose(1, 0, 2)
    inside = ((flat >= low[:, None]) & (flat <= high[:, None])).all(axis=2)
    rows, found, owners, crossings = [np.nonzero(inside)[0]], [own[inside]], [], []
    edges = np.roll(flat, -1, axis=1) - flat
    for axis in (0, 1):
        for border in (low[:, None, axis], high[:, None, axis]):
            rise = edges[:, :, axis]
            share = np.divide(border - flat[:, :, axis], rise, out=np.full(rise.shape, -1.0), where=rise != 0)
            point = flat + share[:, :, None] * edges
            held = (share >= 0) & (share <= 1)
            held &= ((point >= low[:, None] - 1) & (point <= high[:, None] + 1)).all(axis=2)
            crossings.append(point[held])
            owners.append(np.nonzero(held)[0])
    # Corners of the rectangle that a triangle lies under or over.
    corners = box_corners(np.stack([low, high], axis=1))
    rest = corners[:, :, None] - flat[:, None]
    turn = edges[:, None, :, 0] * rest[..., 1] - edges[:, None, :, 1] * rest[..., 0]
    over = (turn >= 0).all(axis=2) | (turn <= 0).all(axis=2)
    crossings.append(corners[over])
    owners.append(np.nonzero(over)[0])
    found.append(turned_plan(np.concatenate(crossings), yaw_deg))
    return row[np.concatenate(rows + owners)], np.concatenate(found)


def _cut(triangles: np.ndarray, owners: np.ndarray, bounds: np.ndarray, least: int) -> tuple[np.ndarray, np.ndarray]:
    """Pieces of the objects that own these triangles, and the object of each."""
    size = np.maximum(least, -(-(bounds[:, 1] - bounds[:, 0]) // PIECES))
    keys, boxes = [np.zeros((0, 4), np.int64)], [np.zeros((0, 2, 3), np.int64)]
    for begin in range(0, len(triangles), CHUNK):
        t, owner = triangles[begin : begin + CHUNK].astype(np.int64), owners[begin : begin + CHUNK]
        low, high = t.min(axis=1), t.max(axis=1)
        base, step = bounds[owner, 0], size[owner]
        first = (low - base) // step
        # A triangle that ends on a border between two places reaches into the lower one only.
        last = np.maximum(first, -(-(high - base) // step) - 1)
        first = np.minimum(first, last)
        span = last - first + 1
        count = span.prod(axis=1)
        row = np.repeat(np.arange(len(t)), count)
        rest = places_of(0, count)
        place = np.empty((len(row), 3), np.int64)
        for i in range(3):
            place[:, i] = first[row, i] + rest % span[row, i]
            rest = rest // span[row, i]
        box = np.stack([low[row], high[row]], axis=1)
        cut = np.flatnonzero(count[row] > 1)
        corner = base[row[cut]] + place[cut] * step[row[cut]]
        left, box[cut] = clip_bounds(t[row[cut]], np.stack([corner, corner + step[row[cut]]], axis=1))
        kept = np.ones(len(row), bool)
        kept[cut] = left
        key, box = _join(np.column_stack([owner[row], place])[kept], box[kept])
        keys.append(key)
        boxes.append(box)
    key, box = _join(np.concatenate(keys), np.concatenate(boxes))
    return box, key[:, 0]


def _join(keys: np.ndarray, boxes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Boxes of equal keys joined, ordered by key."""
    if not len(keys):
        return keys, boxes
    order = np.lexsort(keys.T[::-1])
    keys, boxes = keys[order], boxes[order]
    starts = np.flatnonzero(np.concatenate([[True], (keys[1:] != keys[:-1]).any(axis=1)]))
    low, high = np.minimum.reduceat(boxes[:, 0], starts), np.maximum.reduceat(boxes[:, 1], starts)
    return keys[starts], np.stack([low, high], axis=1)
