"""Faces of closed elements at an angle that nobody can see, because another element stands against them.

Walls that meet end to end hide each other's ends. A target that holds such an end begins at the very corner where its
neighbour ends, and lines past that corner cannot be told from lines to it. So the upright faces of such an element are
targets one by one, and those that are covered are none: an eye outside solids reaches a covered face only through the
inside of what covers it.

Only faces over the same two grid points are compared: their planes are equal, not nearly so.
"""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from .curtains import inside
from .outlines import outline, tiles
from .patience import ask
from .plans import are_convex

# A face at an angle is held by a prism that reaches so far into its element, and there ends so far short of its ends.
DEEP, SHORT = 2.0, 3.0
# Solids are looked for so far behind their faces [grid steps].
BESIDE = 0.5


@dataclass
class UprightFace:
    """All triangles of an element over one segment of the plan, on one side of it.

    Attributes:
        ends: of the segment [grid steps], the solid on its left hand, shape (2, 2), int64.
        corners: of the triangles, shape (n, 3, 3), int64.
    """

    ends: np.ndarray
    corners: np.ndarray

    @property
    def heights(self) -> tuple[int, int]:
        """Least and greatest height."""
        return int(self.corners[:, :, 2].min()), int(self.corners[:, :, 2].max())

    @property
    def along(self) -> tuple[np.ndarray, float]:
        """Its direction in plan, of length 1, and how long it is [grid steps]."""
        way = (self.ends[1] - self.ends[0]).astype(float)
        length = float(np.hypot(*way))
        return way / length, length


def exposed_faces(
    closed: list[tuple[int, np.ndarray]], models: np.ndarray | None = None
) -> dict[int, list[UprightFace]]:
    """Uncovered upright faces of each element that has covered ones, and whose other faces are all level.

    Args:
        closed: (object_id, triangles (m, 3, 3) int32) of closed opaque elements, as of `closed_elements`.
        models: of each object the first that is alike, as of `Scene.first_alike`: saves time.
    """
    solids, known, found = dict(closed), {}, {}
    for object_id, triangles in closed:
        ask()
        model = object_id if models is None else int(models[object_id])
        if model not in known:
            known[model] = _upright_faces(triangles), triangles[0, 0].astype(np.int64)
        faces, corner = known[model]
        if faces is not None:
            shift = triangles[0, 0] - corner
            found[object_id] = [UprightFace(face.ends + shift[:2], face.corners + shift) for face in faces]
    faces = [(object_id, face) for object_id, own in found.items() for face in own]
    behind = defaultdict(list)
    for place, (_, face) in enumerate(faces):
        behind[face.ends.tobytes()].append(place)
    against = [
        [other for other in behind.get(face.ends[::-1].tobytes(), ()) if faces[other][0] != object_id]
        for object_id, face in faces
    ]
    # Most faces have none against them, and are not asked what they are made of.
    asked = sorted({place for places in against for place in places})
    backed = _backed([faces[place] for place in asked], solids)
    whole = dict(zip(asked, backed, strict=True))

    def covered(place: int) -> bool:
        bands = [bands for other in against[place] if (bands := whole[other]) is not None]
        return bool(bands) and whole.get(place) is not None and _fills(bands, faces[place][1])

    gone = [covered(place) for place in range(len(faces))]
    touched = {object_id for (object_id, _), hidden in zip(faces, gone, strict=True) if hidden}
    exposed: dict[int, list[UprightFace]] = {object_id: [] for object_id in found if object_id in touched}
    for (object_id, face), hidden in zip(faces, gone, strict=True):
        if object_id in touched and not hidden:
            exposed[object_id].append(face)
    return exposed


def _backed(faces: list[tuple[int, UprightFace]], solids: dict[int, np.ndarray]) -> list[np.ndarray | None]:
    """Heights between which each face fills its whole segment, shape (n, 2), int64, if its solid lies behind it there.

    A closed solid that is inside out, or thinner than a step, does not.
    """
    owner = np.repeat(np.arange(len(faces)), [len(face.corners) for _, face in faces])
    flat = [
        np.stack([(face.corners[:, :, :2] == face.ends[1]).all(axis=2).astype(np.int64), face.corners[:, :, 2]], axis=2)
        for _, face in faces
    ]
    face, bands = tiles(outline(np.concatenate([np.zeros((0, 3, 2), np.int64), *flat]), owner, len(faces)), 1)
    whole = (bands[:, 0, 0] == 0) & (bands[:, 1, 0] == 1)
    face, bands = face[whole], bands[whole][:, :, 1].astype(np.int64)
    quads = np.empty((len(face), 2, 3))
    quads[:, :, 2] = bands
    for row, place in enumerate(face.tolist()):
        along, length = faces[place][1].along
        short = min(SHORT, length / 4) * along
        quads[row, :, :2] = faces[place][1].ends + np.array([short, -short])
        quads[row, :, :2] += BESIDE * np.array([-along[1], along[0]])
    # Elements in the order in which faces name them.
    numbers, of = np.unique([object_id for object_id, _ in faces], return_inverse=True)
    order = np.argsort(of[face], kind="stable")
    held = np.zeros(len(face), bool)
    held[order] = inside(quads[order], of[face][order], [solids[number] for number in numbers.tolist()], BESIDE / 2)
    failed = np.zeros(len(faces), bool)
    failed[face[~held]] = True
    ends = np.searchsorted(face, np.arange(len(faces) + 1))
    return [None if failed[place] else bands[ends[place] : ends[place + 1]] for place in range(len(faces))]


def _fills(bands: list[np.ndarray], face: UprightFace) -> bool:
    """Whether bands of heights together reach from the foot of a face to its head."""
    reached, head = face.heights
    for low, high in sorted(np.concatenate(bands).tolist()):
        if low > reached:
            return False
        reached = max(reached, high)
    return reached >= head


def _upright_faces(triangles: np.ndarray) -> list[UprightFace] | None:
    """Upright faces of an element at an angle; None if it has none, or a triangle that is neither upright nor level.

    Only triangles over a segment of the plan count as upright.
    """
    t = triangles.astype(np.int64)
    upright, flat = np.ptp(t[:, :, 2], axis=1) > 0, t[:, :, :2]
    shared = [(flat[:, k] == flat[:, (k + 1) % 3]).all(axis=1) for k in range(3)]
    if (upright & ~np.any(shared, axis=0)).any() or not (np.ptp(flat[upright], axis=1) > 0).all(axis=1).any():
        return None
    groups: dict[tuple, list[np.ndarray]] = defaultdict(list)
    for corners in t[upright]:
        start, end = sorted({(x, y) for x, y, _ in corners.tolist()})
        a, b = corners[1] - corners[0], corners[2] - corners[0]
        # Outwards is on the right of a walk that has the solid on its left hand.
        out = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2]
        forward = (end[1] - start[1]) * out[0] - (end[0] - start[0]) * out[1] > 0
        groups[(start, end) if forward else (end, start)].append(corners)
    return [UprightFace(np.array(ends), np.array(corners)) for ends, corners in groups.items()]


def face_pieces(face: UprightFace, longest: int) -> tuple[np.ndarray, np.ndarray]:
    """Boxes, and upright prisms, that together hold a face.

    Args:
        face: of a closed element.
        longest: prisms are about no longer than this [grid steps].

    Returns:
        Boxes, shape (n, 2, 3), and corners of prisms, z low and high in turn, shape (m, 4, 3), int64. The outer corners
        of prisms are the face's own ends; between these they stand off it, as points of the grid seldom lie on it.
    """
    a, b = face.ends.astype(float)
    along, length = face.along
    inwards = np.array([-along[1], along[0]])
    count = max(1, round(length / longest))
    share = np.arange(count + 1)[:, None] / count
    between, last = (share > 0) & (share < 1), np.select([share == 0, share == 1], [SHORT, -SHORT], 0.0)
    outer = np.round(a + share * (b - a) - np.where(between, inwards, 0.0))
    inner = np.round(a + share * (b - a) + inwards * DEEP + along * last)
    plans = np.stack([outer[:-1], outer[1:], inner[1:], inner[:-1]], axis=1).astype(np.int64)
    if length < 4 * SHORT or (a == b).any() or not are_convex(plans).all():
        box = np.column_stack([np.sort(face.ends, axis=0), face.heights])
        return box[None], np.zeros((0, 4, 3), np.int64)
    heights = np.broadcast_to(np.repeat(face.heights, 2)[None, :, None], (len(plans), 4, 1))
    return np.zeros((0, 2, 3), np.int64), np.concatenate([plans, heights], axis=2)
