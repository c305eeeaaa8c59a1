"""Which cells an export lists, and in which order."""

import numpy as np
from shapely import Polygon
from viewcell.workbench.export.sets import view_sets


def test_inhabitable_cells_are_listed_once_and_the_smallest_first(house):
    sets, graph = view_sets(house), house.graph
    assert sorted(sets.cells) == np.flatnonzero(graph.inhabitable).tolist()
    sizes = (graph.cells[:, 1] - graph.cells[:, 0]).astype(float).prod(axis=1)
    assert (np.diff(sizes[sets.cells]) >= 0).all() and len(sets.cells) > 1
    for row, cell in enumerate(sets.cells):
        plan = Polygon(sets.plans[row])
        planned = np.flatnonzero(graph.plans.rows == cell)
        low, high = graph.cells[cell, :, :2] * house.grid_m
        area = Polygon(graph.plans.corners[planned[0]]).area * house.grid_m**2 if len(planned) else np.prod(high - low)
        assert abs(plan.area - area) < 1e-6
        assert sets.heights[row].tolist() == (graph.cells[cell, :, 2] * house.grid_m + house.origin[2]).tolist()
