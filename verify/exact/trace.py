"""A ray through the portals that it crosses, cell by cell, in plain float64. Twin of `kernels/trace.py`.

Its links also serve the rays of `verify/rays`, which cross cells by contacts that no portal claims.
"""

from dataclasses import dataclass

import numpy as np

from ...data.graph import OTHER_AXES, CellGraph
from ...data.ragged import places_of


@dataclass(frozen=True)
class Links:
    """Ways out of each cell, by face.

    Attributes:
        starts: shape (6 cells + 1,), int32; the links of face 2 axis + (1 on the high side) of cell c are
            starts[6 c + face] to starts[6 c + face + 1].
        cells: cell behind each link, shape (links,), int32.
        rectangles: low u, high u, low v, high v [grid steps], shape (links, 4), int32; u, v: the other axes.
        portals: portal_id of each link, -1 for a bare contact, shape (links,), int32.
    """

    starts: np.ndarray
    cells: np.ndarray
    rectangles: np.ndarray
    portals: np.ndarray


def portal_links(graph: CellGraph) -> Links:
    """Links through the graph's portals alone."""
    low, high = graph.portal_cells.T
    axis = graph.portal_axis.astype(np.int64)
    u, v = OTHER_AXES[axis].T
    row = np.arange(graph.portal_count)
    box = graph.portals
    rectangles = np.column_stack([box[row, 0, u], box[row, 1, u], box[row, 0, v], box[row, 1, v]])
    return _table(graph.cell_count, low, high, axis, rectangles, row)


def contact_links(cells: np.ndarray, total: int | None = None) -> Links:
    """Links wherever two cells share part of a face, opaque or not: independent of the portals that are under test.

    Args:
        cells: boxes [grid steps], shape (cells, 2, 3), int32, that do not overlap.
        total: number of cells that the links are for; those beyond the boxes given have none.
    """
    found = [(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 4)))]
    for axis in range(3):
        order = np.argsort(cells[:, 0, axis], kind="stable")
        sorted_low = cells[order, 0, axis]
        first = np.searchsorted(sorted_low, cells[:, 1, axis], "left")
        count = np.searchsorted(sorted_low, cells[:, 1, axis], "right") - first
        a = np.repeat(np.arange(len(cells)), count)
        b = order[places_of(first, count)]
        low = np.maximum(cells[a, 0], cells[b, 0])[:, OTHER_AXES[axis]]
        high = np.minimum(cells[a, 1], cells[b, 1])[:, OTHER_AXES[axis]]
        met = (low < high).all(axis=1)
        rectangles = np.stack([low, high], axis=2)[met].reshape(-1, 4)
        found.append((a[met], b[met], np.full(met.sum(), axis), rectangles))
    low, high, axis, rectangles = (np.concatenate(column) for column in zip(*found, strict=True))
    return _table(total or len(cells), low, high, axis, rectangles, np.full(len(low), -1))


def _table(
    count: int, low: np.ndarray, high: np.ndarray, axis: np.ndarray, rectangles: np.ndarray, portals: np.ndarray
) -> Links:
    keys = np.concatenate([6 * low + 2 * axis + 1, 6 * high + 2 * axis])
    # The largest of a face's links first: most rays take it, and they are looked at one by one.
    area = np.prod(rectangles[:, 1::2].astype(np.float64) - rectangles[:, ::2], axis=1)
    order = np.lexsort([-np.tile(area, 2), keys])
    return Links(
        np.searchsorted(keys[order], np.arange(6 * count + 1)).astype(np.int32),
        np.concatenate([high, low])[order].astype(np.int32),
        np.ascontiguousarray(np.concatenate([rectangles, rectangles])[order].astype(np.int32)),
        np.concatenate([portals, portals])[order].astype(np.int32),
    )


def portal_path(
    links: Links, boxes: np.ndarray, cell: int, target: int, origin: np.ndarray, direction: np.ndarray
) -> list[int] | None:
    """Portals that a float64 ray crosses from one cell to another; None if it does not get there.

    Args:
        links: of `portal_links`.
        boxes: cells [grid steps], shape (cells, 2, 3).
        cell: start.
        target: cell to reach.
        origin: 3 float64 [grid steps].
        direction: 3 float64.
    """
    path = []
    while cell != target and len(path) < 4096:
        with np.errstate(divide="ignore", invalid="ignore"):
            exits = np.where(
                direction, (boxes[cell, (direction > 0).astype(int), range(3)] - origin) / direction, np.inf
            )
        axis = int(exits.argmin())
        face = 6 * cell + 2 * axis + int(direction[axis] > 0)
        u, v = (origin + exits[axis] * direction)[OTHER_AXES[axis]]
        for link in range(links.starts[face], links.starts[face + 1]):
            low_u, high_u, low_v, high_v = links.rectangles[link]
            if low_u < u < high_u and low_v < v < high_v:
                path.append(int(links.portals[link]))
                cell = int(links.cells[link])
                break
        else:
            return None
    return path if cell == target else None
