"""What is alike: the same snapped triangles but for a shift. What is found of one of them holds of all, shifted."""

from collections.abc import Iterator
from hashlib import sha256

import numpy as np

# What is made of a shape takes as long again as so many of its triangles do, however few it has.
EACH = 64


def shape_key(triangles: np.ndarray) -> bytes:
    """The same for triangles (m, 3, 3), int32, of which one is the other shifted, in the same order; else not."""
    return sha256((triangles - triangles.min(axis=(0, 1))).tobytes()).digest()


def first_alike(triangles: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Of each object the first one that is alike, itself if there is none.

    Args:
        triangles: of all objects, shape (m, 3, 3), int32.
        starts: triangles of object o are starts[o]:starts[o + 1], shape (objects + 1,), int.

    Returns:
        Shape (objects,), int64.
    """
    known: dict[bytes, int] = {}
    models = np.arange(len(starts) - 1)
    for number in np.flatnonzero(np.diff(starts)).tolist():
        key = shape_key(triangles[starts[number] : starts[number + 1]])
        models[number] = known.setdefault(key, number)
    return models


def extents(triangles: np.ndarray) -> np.ndarray:
    """Sides of the box of each triangle, shape (m, 3), as integers of the same kind."""
    # Corner by corner: NumPy is many times slower along short axes.
    a, b, c = (triangles[:, k] for k in range(3))
    return np.maximum(np.maximum(a, b), c) - np.minimum(np.minimum(a, b), c)


def mostly_copies(starts: np.ndarray, models: np.ndarray) -> bool:
    """Whether to make something of each shape and to copy it takes half as long as to make it of every object.

    Args:
        starts: as of `first_alike`.
        models: its answer.
    """
    sizes = np.diff(starts)
    once = np.unique(models[sizes > 0])
    return 2 * (int(sizes[once].sum()) + EACH * len(once)) < int(sizes.sum())


def copies(starts: np.ndarray, models: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """The model of each shape that has triangles, and all objects of that shape, ascending; arguments as above."""
    present = np.flatnonzero(np.diff(starts))
    order = present[np.argsort(models[present], kind="stable")]
    for members in np.split(order, np.flatnonzero(np.diff(models[order])) + 1) if len(order) else []:
        yield int(models[members[0]]), members


def shared_corners(triangles: np.ndarray, starts: np.ndarray, models: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles as points and places among them; where many are copies, an object's triangles share their points.

    Args:
        triangles: as of `first_alike`.
        starts: likewise.
        models: its answer.

    Returns:
        Points, shape (n, 3), int32, and places, shape (m, 3), int32.
    """
    places = np.arange(3 * len(triangles), dtype=np.int32).reshape(-1, 3)
    if not mostly_copies(starts, models):
        return triangles.reshape(-1, 3), places
    points, count = [], 0
    for model, members in copies(starts, models):
        own = triangles[starts[model] : starts[model + 1]]
        corners, at = np.unique(own.reshape(-1, 3), axis=0, return_inverse=True)
        shift = triangles[starts[members], 0] - own[0, 0]
        points.append((corners[None] + shift[:, None]).reshape(-1, 3))
        rows = starts[members][:, None] + np.arange(len(own))
        first = count + len(corners) * np.arange(len(members), dtype=np.int32)
        places[rows] = at.reshape(1, -1, 3) + first[:, None, None]
        count += len(points[-1])
    return np.concatenate(points), places
