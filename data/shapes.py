"""What is alike: the same snapped triangles but for a shift. What is found of one of them holds of all, shifted."""

from hashlib import sha256

import numpy as np


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
