"""What lies apart on one plane, as tops of tanks do in a plant: parts with gaps between them have rasters of their own.

A raster of a whole plane has as many nodes as all parts have lines along u, times those along v. In a city of a million
triangles that takes minutes, and most of it is empty.
"""

import numpy as np

from .patience import ask
from .rasters import FAR, Rasters

# Rasters with more nodes are worth taking apart.
LARGE = 1 << 18


def taken_apart(owner: np.ndarray, rectangles: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Parts of owners whose raster would be large, with gaps between them from side to side: no two of them touch.

    Args:
        owner: of each rectangle, shape (n,), int.
        rectangles: shape (n, 2, 2), int64.
        count: of owners.

    Returns:
        Part of each rectangle, shape (n,), and owner of each part, ascending, int64. Others are one part, if empty.
    """
    rasters = Rasters.of([[(np.repeat(owner, 2), rectangles[:, :, c].ravel())] for c in (0, 1)], count)
    large = np.diff(rasters.nodes) > LARGE
    rows = np.flatnonzero(large[owner])
    if not len(rows):
        return owner, np.arange(count)
    part, parts = owner[rows], 0
    while True:
        ask()
        for axis in (0, 1):
            order = np.lexsort((rectangles[rows, 0, axis], part))
            low, high = (rectangles[rows[order], side, axis] + 2 * FAR * part[order] for side in (0, 1))
            # What begins beyond all before it begins a part; so does the first one of a part.
            new = np.append(True, low[1:] > np.maximum.accumulate(high)[:-1])
            part[order] = np.cumsum(new) - 1
        if part.max() + 1 == parts:
            break
        parts = part.max() + 1
    # Numbered with the others, in the order of owners.
    mine = np.zeros(parts, np.int64)
    mine[part] = owner[rows]
    owners = np.concatenate([np.flatnonzero(~large), mine])
    order = np.argsort(owners, kind="stable")
    number = np.empty(len(owners), np.int64)
    number[order] = np.arange(len(owners))
    out = number[np.cumsum(~large)[owner] - 1]
    out[rows] = number[int((~large).sum()) + part]
    return out, owners[order]
