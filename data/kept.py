"""How much of a model view cells keep: potential objects and triangles as shares of all.

Potential / seen says how tight a proof is; it is 1 for one cell over everything, which culls nothing. This says it.
"""

import numpy as np

from .graph import CellGraph


def kept_shares(
    cells: int, source: np.ndarray, target: np.ndarray, triangle_counts: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Shares of the model's objects, and of its triangles, that each cell keeps.

    Args:
        cells: number of cells.
        source: cell of each potential pair, shape (n,), int.
        target: its object, shape (n,), int.
        triangle_counts: triangles of every object at its finest level, shape (objects,), int.

    Returns:
        Two arrays of shape (cells,), float64, from 0 to 1; 0 for cells without pairs, and in a model without objects.
    """
    objects = np.bincount(source, minlength=cells) / max(len(triangle_counts), 1)
    triangles = np.bincount(source, triangle_counts[target], minlength=cells) / max(int(triangle_counts.sum()), 1)
    return objects, triangles


def cell_volumes(graph: CellGraph) -> np.ndarray:
    """Volume of each cell, or of its prism [cubic grid steps], shape (cells,), float64."""
    size = (graph.cells[:, 1] - graph.cells[:, 0]).astype(np.float64)
    volumes = size.prod(axis=1)
    a, b = (np.diff(graph.plans.corners[:, ends].astype(np.float64), axis=1)[:, 0] for ends in ([0, 2], [1, 3]))
    volumes[graph.plans.rows] = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2 * size[graph.plans.rows, 2]
    return volumes


def mean_kept(graph: CellGraph, shares: np.ndarray) -> float:
    """Mean of a share over the inhabitable cells, weighted by their volume; 0 without such cells."""
    weights = np.where(graph.inhabitable, cell_volumes(graph), 0.0)
    return float((weights * shares).sum() / weights.sum()) if weights.any() else 0.0
