"""Cells that an eye may reach within a time, by a shortest path search over portals.

Every length is a lower bound: a way from portal to portal is at least as long as the distance between the two. So no
cell can be reached earlier than is said.

Source: Funkhouser et al. 1996, section 4.3.1 (range cells).
"""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from ...data.graph import CellGraph

# Portals of a cell between which all ways are measured; what is outside of a ragged building may have thousands.
PORTALS_MOST = 200


def box_distances(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Least distances between closed boxes, shapes (..., 2, 3) that broadcast; float64."""
    apart = np.maximum(np.maximum(a[..., 0, :] - b[..., 1, :], b[..., 0, :] - a[..., 1, :]), 0)
    return np.sqrt((apart * apart).sum(axis=-1))


def _grouped(boxes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Groups of boxes near each other, at most PORTALS_MOST: the group of each, and a box around each group."""
    middles, size = boxes.mean(axis=1), 1.0
    while True:
        _, group = np.unique(np.floor(middles / size), axis=0, return_inverse=True)
        group = group.ravel()
        if group.max() < PORTALS_MOST:
            break
        size *= 2
    around = np.stack([np.full((group.max() + 1, 3), np.inf), np.full((group.max() + 1, 3), -np.inf)], axis=1)
    np.minimum.at(around[:, 0], group, boxes[:, 0])
    np.maximum.at(around[:, 1], group, boxes[:, 1])
    return group, around


class RangeCells:
    """A graph prepared for searches from many eyes."""

    def __init__(self, graph: CellGraph, grid_m: float) -> None:
        """Measure the ways between portals of one cell; without portals, and to cells with a plan, it is bee-lines."""
        self._cells, self._tiles = graph.cells * grid_m, graph.tile_count if graph.portal_count else 0
        self._portals, count = graph.portals * grid_m, graph.portal_count
        starts, entries = graph.adjacency()
        self._starts, self._doors = starts.astype(np.int64), entries[:, 0].astype(np.int64)
        self._pairs = graph.portal_cells
        rows, columns, boxes = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], [self._portals]
        nodes = count
        for cell in range(self._tiles):
            own = self._doors[starts[cell] : starts[cell + 1]]
            if len(own) > PORTALS_MOST:
                # Groups of portals stand for them: between two of these no way is longer than between their portals.
                group, around = _grouped(self._portals[own])
                rows += [own, nodes + group]
                columns += [nodes + group, own]
                boxes.append(around)
                own = np.arange(nodes, nodes + len(around))
                nodes += len(around)
            rows.append(np.repeat(own, len(own)))
            columns.append(np.tile(own, len(own)))
        row, column, boxes = np.concatenate(rows), np.concatenate(columns), np.concatenate(boxes)
        # Two portals may belong to the same two cells: the pair counts once.
        pairs = np.unique((row * max(1, nodes) + column)[row != column])
        row, column = np.divmod(pairs, max(1, nodes))
        # Room for the eye's row: it may see as many portals as cells have that meet.
        room, size = np.zeros(count, np.int32), (nodes + 1, nodes + 1)
        length = np.concatenate([box_distances(boxes[row], boxes[column]), room])
        begins = np.append(np.searchsorted(row, np.arange(nodes + 1)), len(length)).astype(np.int32)
        self._ways = csr_array((length, np.concatenate([column.astype(np.int32), room]), begins), shape=size)
        self._begins, self._nodes = begins, nodes

    def near(self, eye: np.ndarray, holders: np.ndarray, reach_m: float) -> tuple[np.ndarray, np.ndarray]:
        """Cells that can be reached on a way of at most so long, and at least how long it is.

        Args:
            eye: [m], shape (3,), float64.
            holders: cells that hold it, shape (n,), int; none for an eye outside of all, which may go anywhere.
            reach_m: of the way [m].

        Returns:
            Cells, int64, and lengths [m], float64, never more than any way through portals; ascending by length, then
            by cell.
        """
        here = np.stack([eye, eye])
        if (holders < self._tiles).any():
            ways = self._through_portals(eye, holders[holders < self._tiles], reach_m)
            length = np.concatenate([ways, box_distances(self._cells[self._tiles :], here)])
        else:
            length = box_distances(self._cells, here)
        length[holders] = 0.0
        cells = np.flatnonzero(length <= reach_m)
        order = np.argsort(length[cells], kind="stable")
        return cells[order], length[cells][order]

    def _through_portals(self, eye: np.ndarray, holders: np.ndarray, reach_m: float) -> np.ndarray:
        """Length of the way to the first portal of each cell that tiles space; inf beyond reach."""
        out = np.full(self._tiles, np.inf)
        own = np.unique(np.concatenate([self._doors[self._starts[c] : self._starts[c + 1]] for c in holders.tolist()]))
        first = box_distances(self._portals[own], np.stack([eye, eye]))
        near = first <= reach_m
        if not near.any():
            return out
        # The eye is one more node, behind all portals; only its row changes.
        count, last = len(self._portals), self._begins[-2]
        own, first = own[near], first[near]
        self._ways.data[last : last + len(own)], self._ways.indices[last : last + len(own)] = first, own
        self._ways.indptr[-1] = last + len(own)
        found = dijkstra(self._ways, indices=self._nodes, limit=reach_m)[:count]
        reached = np.flatnonzero(found <= reach_m)
        for side in range(2):
            np.minimum.at(out, self._pairs[reached, side], found[reached])
        return out
