"""What the outside reaches that it should not: inhabitable cells behind cracks."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from .cracks import crack_portals
from .graph import CellGraph
from .inhabit import shut_portals
from .scene import Scene


def cells_behind_cracks(scene: Scene, graph: CellGraph, width_m: float) -> np.ndarray:
    """Inhabitable cells that only cracks join to the outside while doors, windows and voids are shut.

    Args:
        scene: whose openings are shut.
        graph: its cells and portals.
        width_m: what no square of this side fits into is a crack [m].

    Returns:
        Shape (cells,), bool. A balcony, or a room whose doors the model does not tell, is joined by more than cracks.
    """
    shut = shut_portals(scene, graph)
    leaky = _outside(graph, ~shut) & graph.inhabitable
    # Telling cracks from narrow parts of wide openings is slow, and cracks are narrow: most models end here.
    narrow = graph.portal_sides[:, 0] < width_m / scene.grid_m
    if not (leaky & ~_outside(graph, ~shut & ~narrow)).any():
        return np.zeros(graph.cell_count, bool)
    return leaky & ~_outside(graph, ~shut & ~crack_portals(graph, width_m / scene.grid_m))


def _outside(graph: CellGraph, passed: np.ndarray) -> np.ndarray:
    """Cells that the outermost cell reaches through some of the portals, shape (cells,), bool."""
    a, b = graph.portal_cells[passed].T
    links = coo_array((np.ones(len(a)), (a, b)), shape=(graph.cell_count, graph.cell_count))
    _, component = connected_components(links, directed=False)
    return component == component[int(np.argmin(graph.cells[:, 0].sum(axis=1)))]
