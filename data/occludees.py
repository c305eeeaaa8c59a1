"""What may be hidden: a hierarchy over all objects, and each object as boxes around its pieces.

One proof for a node of the hierarchy hides everything below it. The pieces keep the empty corners of an L-shaped or
oblique object out of the question. Source: Chhugani et al. 2005, section 5.2, tests the polygons of an object; boxes
around them are conservative.
"""

from dataclasses import dataclass
from hashlib import sha256

import numpy as np

from .hierarchy import build_levels
from .incidence import CHUNK, clip_bounds
from .ragged import owners_of, places_of
from .scene import Scene

# Pieces are no smaller than this, and at most PIECES along an axis of their object.
PIECE_M = 1.0
PIECES = 4


@dataclass
class Occludees:
    """Objects and their pieces, in grid steps.

    Attributes:
        bounds: of each object, shape (objects, 2, 3), int32; low > high for one without triangles.
        levels: node bounds of a perfect binary tree, one array (2**level, 2, 3), int32, a level; the last one's nodes
            are objects.
        objects: object of each node of the last level, -1 for none, int32.
        pieces: boxes that together hold all triangles of their object, shape (pieces, 2, 3), int32.
        starts: pieces of object o are starts[o]:starts[o + 1], shape (objects + 1,), int64.
    """

    bounds: np.ndarray
    levels: list[np.ndarray]
    objects: np.ndarray
    pieces: np.ndarray
    starts: np.ndarray

    @property
    def owners(self) -> np.ndarray:
        """Object of each piece, shape (pieces,), int64."""
        return owners_of(self.starts)


def find_occludees(scene: Scene) -> Occludees:
    """Occludees of all objects of a scene, opaque or not."""
    bounds = scene.object_bounds()
    present = np.flatnonzero((bounds[:, 0] <= bounds[:, 1]).all(axis=1))
    levels, objects = build_levels(bounds[present])
    # An empty node's -1 takes the last entry: -1.
    objects = np.append(present, -1)[objects].astype(np.int32)
    pieces, owner = _pieces(scene, bounds)
    return Occludees(
        bounds.astype(np.int32), levels, objects, pieces, np.searchsorted(owner, np.arange(len(bounds) + 1))
    )


def _pieces(scene: Scene, bounds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pieces of all objects in object order, and the object of each."""
    triangles, owners = scene.triangles()
    models = _models(triangles, owners, bounds)
    cut = models[owners] == owners
    boxes, owner = _cut(triangles[cut], owners[cut], bounds, round(PIECE_M / scene.grid_m))
    first = np.searchsorted(owner, np.arange(len(bounds) + 1))
    count = np.diff(first)[models]
    objects = np.repeat(np.arange(len(bounds)), count)
    row = places_of(first[models], count)
    shift = bounds[objects, 0] - bounds[models[objects], 0]
    return (boxes[row] + shift[:, None]).astype(np.int32), objects


def _models(triangles: np.ndarray, owners: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """The first object whose snapped triangles differ from an object's by a shift only, shape (objects,), int64."""
    starts = np.searchsorted(owners, np.arange(len(bounds) + 1))
    known: dict[bytes, int] = {}
    models = np.arange(len(bounds))
    for number in np.flatnonzero(np.diff(starts)):
        relative = triangles[starts[number] : starts[number + 1]] - bounds[number, 0].astype(np.int32)
        models[number] = known.setdefault(sha256(relative.tobytes()).digest(), int(number))
    return models


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
