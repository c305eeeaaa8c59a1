"""Faces of closed elements at an angle that nobody can see, because another element stands against them.

Walls that meet end to end hide each other's ends. A target that holds such an end begins at the very corner where its
neighbour ends, and lines past that corner cannot be told from lines to it. So the upright faces of such an element are
targets one by one, and those that are covered are none: an eye outside solids reaches a covered face only through the
inside of what covers it.

Only faces over the same two grid points are compared: their planes are equal, not nearly so.
"""

from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .curtains import inside
from .opaque import plane_rectangles
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

    @cached_property
    def bands(self) -> np.ndarray:
        """Heights between which it fills the whole segment, shape (n, 2), int64."""
        side = (self.corners[:, :, :2] == self.ends[1]).all(axis=2)
        flat = np.stack([side.astype(np.int64), self.corners[:, :, 2]], axis=2)
        bands, _, _ = plane_rectangles(flat.astype(np.int32), 1)
        return bands[(bands[:, 0, 0] == 0) & (bands[:, 1, 0] == 1)][:, :, 1].astype(np.int64)


def exposed_faces(closed: list[tuple[int, np.ndarray]]) -> dict[int, list[UprightFace]]:
    """Uncovered upright faces of each element that has covered ones, and whose other faces are all level.

    Args:
        closed: (object_id, triangles (m, 3, 3) int32) of closed opaque elements, as of `closed_elements`.
    """
    solids = dict(closed)
    faces = {object_id: found for object_id, triangles in closed if (found := _upright_faces(triangles)) is not None}
    behind = defaultdict(list)
    for object_id, found in faces.items():
        for face in found:
            behind[face.ends.tobytes()].append((object_id, face))

    def covered(owner: int, face: UprightFace) -> bool:
        against = [part for part in behind.get(face.ends[::-1].tobytes(), ()) if part[0] != owner]
        bands = [other.bands for number, other in against if _backed(other, solids[number])]
        return bool(bands) and _fills(bands, face) and _backed(face, solids[owner])

    exposed = {}
    for object_id, found in faces.items():
        hidden = [covered(object_id, face) for face in found]
        if any(hidden):
            exposed[object_id] = [face for face, gone in zip(found, hidden, strict=True) if not gone]
    return exposed


def _backed(face: UprightFace, solid: np.ndarray) -> bool:
    """Whether a closed solid holds what lies behind a face of its: it is neither inside out nor thinner than a step."""
    along, length = face.along
    short = min(SHORT, length / 4) * along
    quads = np.empty((len(face.bands), 2, 3))
    quads[:, :, :2] = face.ends + np.array([short, -short]) + BESIDE * np.array([-along[1], along[0]])
    quads[:, :, 2] = face.bands
    return bool(inside(quads, solid, BESIDE / 2).all())


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
