"""Cells that an eye may reach within a time, by a shortest path search over portals.

Every length is a lower bound: a way from portal to portal is at least as long as the distance between the two. So no
cell can be reached earlier than is said.

Source: Funkhouser et al. 1996, section 4.3.1 (range cells).
"""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from ...data.graph import CellGraph


def box_distances(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Least distances between closed boxes, shapes (..., 2, 3) that broadcast; float64."""
    apart = np.maximum(np.maximum(a[..., 0, :] - b[..., 1, :], b[..., 0, :] - a[..., 1, :]), 0)
    return np.sqrt((apart * apart).sum(axis=-1))


class RangeCells:
    """A graph prepared for searches from many eyes."""

    def __init__(self, graph: CellGraph, grid_m: float) -> None:
        """Measure the ways between portals of one cell; without portals, and to cells with a plan, it is bee-lines."""
        self._cells, self._tiles = graph.cells * grid_m, graph.tile_count if graph.portal_count else 0
        self._portals, count = graph.portals * grid_m, graph.portal_count
        starts, entries = graph.adjacency()
        self._starts, self._doors = starts.astype(np.int64), entries[:, 0].astype(np.int64)
        self._pairs = graph.portal_cells
        rows, columns = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
        for cell in range(self._tiles):
            own = self._doors[starts[cell] : starts[cell + 1]]
            rows.append(np.repeat(own, len(own)))
            columns.append(np.tile(own, len(own)))
        row, column = np.concatenate(rows), np.concatenate(columns)
        # Two portals may belong to the same two cells: the pair counts once.
        pairs = np.unique((row * max(1, count) + column)[row != column])
        row, column = np.divmod(pairs, max(1, count))
        # Room for the eye's row: it may see as many portals as cells have that meet.
        room, size = np.zeros(count, np.int32), (count + 1, count + 1)
        length = np.concatenate([box_distances(self._portals[row], self._portals[column]), room])
        begins = np.append(np.searchsorted(row, np.arange(count + 1)), len(length)).astype(np.int32)
        self._ways = csr_array((length, np.concatenate([column.astype(np.int32), room]), begins), shape=size)
        self._begins = begins

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
        found = dijkstra(self._ways, indices=count, limit=reach_m)[:count]
        reached = np.flatnonzero(found <= reach_m)
        for side in range(2):
            np.minimum.at(out, self._pairs[reached, side], found[reached])
        return out
