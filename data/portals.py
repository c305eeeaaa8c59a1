"""Portals: the open rectangles of the faces that two cells share, by exact rectangle arithmetic.

Source: Funkhouser et al. 1996, section 3.1 (portals are the transparent parts of shared boundaries).
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from .graph import OTHER_AXES, CellGraph, flat_boxes
from .opaque import OpaquePlanes
from .ragged import lots, places_of
from .rasters import Rasters

# Pairs of cells that are looked at together.
PAIRS = 1_000_000


def find_portals(cells: np.ndarray, opaque: OpaquePlanes) -> CellGraph:
    """Join cells by the open parts of their shared faces.

    Args:
        cells: disjoint boxes [grid steps], shape (n, 2, 3), int32.
        opaque: opaque rectangles; on a shared face portal area + opaque area = face area.

    Returns:
        The graph, with no cell marked inhabitable and empty names.
    """
    index = opaque.index
    ends, axes, boxes = [], [], []
    for axis in range(3):
        pairs, faces = shared_faces(cells, axis)
        planes = cells[pairs[:, 0], 1, axis]
        face, rectangles = open_rectangles(faces, planes, lambda k, axis=axis: index.rectangles(axis, k))
        ends.append(pairs[face])
        axes.append(np.full(len(face), axis))
        boxes.append(flat_boxes(rectangles, axis, planes[face]))
    return CellGraph(
        cells,
        np.zeros(len(cells), bool),
        np.full(len(cells), "", object),
        np.concatenate(ends).astype(np.int32),
        np.concatenate(axes).astype(np.int8),
        np.concatenate(boxes).astype(np.int32),
    )


def shared_faces(cells: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of cells that touch with positive area on an axis.

    Returns:
        The cell below and the cell above, shape (n, 2), ordered by their common plane; and the rectangle that they
        share, low and high corner in u and v, shape (n, 2, 2), int64.
    """
    uv = OTHER_AXES[axis]
    by_low, below = (np.argsort(cells[:, side, axis], kind="stable") for side in (0, 1))
    begin, end = (np.searchsorted(cells[by_low, 0, axis], cells[below, 1, axis], side) for side in ("left", "right"))
    pairs, faces = [np.zeros((0, 2), np.int64)], [np.zeros((0, 2, 2), np.int64)]
    # Cells of one storey make many pairs that touch in one plane, far apart.
    for first, stop in lots(end - begin, PAIRS):
        times = (end - begin)[first:stop]
        low, high = np.repeat(below[first:stop], times), by_low[places_of(begin[first:stop], times)]
        corner_low = np.maximum(cells[low, 0], cells[high, 0])[:, uv]
        corner_high = np.minimum(cells[low, 1], cells[high, 1])[:, uv]
        touch = (corner_high > corner_low).all(axis=1)
        pairs.append(np.column_stack([low, high])[touch])
        faces.append(np.stack([corner_low, corner_high], axis=1)[touch].astype(np.int64))
    return np.concatenate(pairs), np.concatenate(faces)


def open_rectangles(
    faces: np.ndarray, planes: np.ndarray, opaque: Callable[[int], np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Faces minus opaque rectangles, cut into disjoint rectangles.

    Args:
        faces: low and high corners (u, v), shape (n, 2, 2), int64.
        planes: coordinate of each, ascending, shape (n,).
        opaque: rectangles of a plane, shape (m, 2, 2).

    Returns:
        Face of each rectangle, ascending, shape (k,), and its corners, shape (k, 2, 2), int32.
    """
    face, covers = [np.zeros(0, np.int64)], [np.zeros((0, 2, 2), np.int64)]
    starts = np.append(np.flatnonzero(np.diff(planes, prepend=np.iinfo(np.int64).min)), len(planes))
    for begin, end in pairwise(starts.tolist()):
        rectangles = opaque(int(planes[begin]))
        step = max(1, PAIRS // max(1, len(rectangles)))
        for first in range(begin, end, step):
            mine = faces[first : min(first + step, end)]
            low = np.maximum(rectangles[None, :, 0], mine[:, None, 0])
            high = np.minimum(rectangles[None, :, 1], mine[:, None, 1])
            row, which = np.nonzero((high > low).all(axis=2))
            face.append(first + row)
            covers.append(np.stack([low[row, which], high[row, which]], axis=1))
    face, covers = np.concatenate(face), np.concatenate(covers)
    every = np.arange(len(faces))
    points = [
        [(np.repeat(every, 2), faces[:, :, c].ravel()), (np.repeat(face, 2), covers[:, :, c].ravel())] for c in (0, 1)
    ]
    owners, found = [np.zeros(0, np.int64)], [np.zeros((0, 2, 2), np.int32)]
    for first, rasters in Rasters.of(points, len(faces)).lots():
        a, b = np.searchsorted(face, [first, first + len(rasters)])
        solid = rasters.paint(face[a:b] - first, covers[a:b])
        owner, rectangles = rasters.tile(~solid & (rasters.area > 0))
        owners.append(owner + first)
        found.append(rectangles)
    return np.concatenate(owners), np.concatenate(found)
