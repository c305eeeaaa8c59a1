"""What may be seen from cells that are no view cells, such as the depth of a doorway: of them a bake says nothing.

A ray from an eye in such a cell meets something that touches the cell, or leaves it through a portal, into another such
cell or into a view cell, inside of which it goes on as a ray of that cell's. So nothing else is seen than what touches
the connected cells of this kind, and what the view cells around them may see.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ...data.contents import contents
from ...data.graph import CellGraph

# Cells that hang together in larger numbers are no doorway but what is outside, around which stands everything.
CELLS_MOST = 8


@dataclass(frozen=True)
class Doorways:
    """Cells that are no view cells, and what may be seen from them.

    Attributes:
        cells: ascending, shape (n,), int64.
        objects: that may be seen from anywhere in each, shape (n, objects), bool.
        reached: cells likewise, shape (n, cells), bool.
    """

    cells: np.ndarray
    objects: np.ndarray
    reached: np.ndarray


def doorways(graph: CellGraph, boxes: np.ndarray, potential: tuple[np.ndarray, np.ndarray]) -> Doorways:
    """What may be seen from doorways; never too little, if the sets of view cells have not.

    Args:
        graph: cells in grid steps; without portals there are no doorways.
        boxes: of objects [grid steps], shape (objects, 2, 3), int; low above high for one that is nowhere.
        potential: objects and cells that may be seen from each inhabitable cell, shapes (cells, objects) and
            (cells, cells), bool.

    Source: the argument above; Funkhouser et al. 1996 have sets for inhabitable cells only, too (section 3.3).
    """
    dead = np.flatnonzero(~graph.inhabitable[: graph.tile_count])
    a, b = graph.portal_cells.T
    within = ~graph.inhabitable[a] & ~graph.inhabitable[b]
    size = graph.cell_count, graph.cell_count
    links = coo_array((np.ones(int(within.sum())), (a[within], b[within])), shape=size)
    label = connected_components(links, directed=False)[1]
    small = np.bincount(label[dead], minlength=graph.cell_count) <= CELLS_MOST
    reached_by_portal = np.zeros(graph.cell_count, bool)
    reached_by_portal[graph.portal_cells.ravel()] = True
    cells = dead[small[label[dead]] & reached_by_portal[dead]]
    starts, touching = contents(graph.cells[cells], boxes)
    row_of = np.full(graph.cell_count, -1)
    groups, place = np.unique(label[cells], return_inverse=True)
    row_of[cells] = place
    objects = np.zeros((len(groups), len(boxes)), bool)
    reached = np.zeros((len(groups), graph.cell_count), bool)
    objects[np.repeat(place, np.diff(starts)), touching] = True
    reached[place, cells] = True
    for here, there in ((a, b), (b, a)):
        doors = np.flatnonzero((row_of[here] >= 0) & graph.inhabitable[there])
        for group, view in np.unique(np.column_stack([row_of[here[doors]], there[doors]]), axis=0).tolist():
            objects[group] |= potential[0][view]
            reached[group] |= potential[1][view]
            reached[group, view] = True
    return Doorways(cells, objects[place], reached[place])
