"""Portals: the open rectangles of the faces that two cells share, by exact rectangle arithmetic.

Source: Funkhouser et al. 1996, section 3.1 (portals are the transparent parts of shared boundaries).
"""

import numpy as np

from .graph import OTHER_AXES, CellGraph
from .opaque import OpaquePlanes, decompose


def find_portals(cells: np.ndarray, opaque: OpaquePlanes) -> CellGraph:
    """Join cells by the open parts of their shared faces.

    Args:
        cells: disjoint boxes [grid steps], shape (n, 2, 3), int32.
        opaque: opaque rectangles; on a shared face portal area + opaque area = face area.

    Returns:
        The graph, with no cell marked inhabitable and empty names.
    """
    planes = opaque.index
    ends, axes, boxes = [], [], []
    for axis in range(3):
        u, v = OTHER_AXES[axis]
        for low, high, shared in shared_faces(cells, axis):
            k = int(cells[low, 1, axis])
            for rectangle in open_rectangles(shared, planes.rectangles(axis, k)):
                box = np.full((2, 3), k, np.int32)
                box[:, u], box[:, v] = rectangle[:, 0], rectangle[:, 1]
                ends.append((low, high))
                axes.append(axis)
                boxes.append(box)
    return CellGraph(
        cells,
        np.zeros(len(cells), bool),
        np.full(len(cells), "", object),
        np.array(ends, np.int32).reshape(-1, 2),
        np.array(axes, np.int8),
        np.array(boxes, np.int32).reshape(-1, 2, 3),
    )


def shared_faces(cells: np.ndarray, axis: int) -> list[tuple[int, int, np.ndarray]]:
    """Pairs (low cell, high cell, shared rectangle (2, 2) in u, v) that touch with positive area on an axis."""
    u, v = OTHER_AXES[axis]
    by_low = np.argsort(cells[:, 0, axis], kind="stable")
    lows = cells[by_low, 0, axis]
    found = []
    for k in np.unique(cells[:, 1, axis]):
        behind = by_low[np.searchsorted(lows, k) : np.searchsorted(lows, k, side="right")]
        for low in np.flatnonzero(cells[:, 1, axis] == k) if len(behind) else ():
            corner_low = np.maximum(cells[low, 0], cells[behind, 0])
            corner_high = np.minimum(cells[low, 1], cells[behind, 1])
            for n in np.flatnonzero((corner_high[:, u] > corner_low[:, u]) & (corner_high[:, v] > corner_low[:, v])):
                found.append(
                    (int(low), int(behind[n]), np.array([corner_low[n][[u, v]], corner_high[n][[u, v]]], np.int64))
                )
    return found


def open_rectangles(face: np.ndarray, opaque: np.ndarray) -> np.ndarray:
    """Face minus opaque rectangles, cut into disjoint rectangles; shape (n, 2, 2), int32.

    Args:
        face: low and high corner (u, v), shape (2, 2).
        opaque: rectangles of the same plane, shape (m, 2, 2).
    """
    low, high = np.maximum(opaque[:, 0], face[0]), np.minimum(opaque[:, 1], face[1])
    keep = (high > low).all(axis=1)
    low, high = low[keep], high[keep]
    if not len(low):
        return face[None].astype(np.int32)
    us = np.unique(np.concatenate([face[:, 0], low[:, 0], high[:, 0]]))
    vs = np.unique(np.concatenate([face[:, 1], low[:, 1], high[:, 1]]))
    mask = np.ones((len(us) - 1, len(vs) - 1), bool)
    for (u0, v0), (u1, v1) in zip(low, high, strict=True):
        mask[us.searchsorted(u0) : us.searchsorted(u1), vs.searchsorted(v0) : vs.searchsorted(v1)] = False
    return decompose(mask, us, vs)
