"""Where rays start and what they are aimed at."""

import numpy as np

from ...data.graph import CellGraph
from ...data.ragged import places_of
from ..exact.plan import inside_plans
from ..exact.sightline import Sightlines
from ..exact.trace import Links

ORIGINS_MOST = 256


def cell_origins(graph: CellGraph, sources: np.ndarray, count: int, lines: Sightlines, seed: int) -> list[np.ndarray]:
    """Points strictly inside each source cell and outside every solid, spread evenly.

    Args:
        graph: cells.
        sources: cell ids, shape (rows,).
        count: points wanted a cell, at most 256; a cell that is mostly solid gets fewer, possibly none.
        lines: the opaque triangles, for the exact test.
        seed: of the random shift of each cell's lattice (Roberts' R3 sequence).

    Returns:
        For each source an array of shape (k, 3) [grid steps], float32 (exact as float64), k <= count.
    """
    rng = np.random.default_rng(seed)
    steps = np.array([0.8191725133961645, 0.6710436067037893, 0.5497004779019703])
    boxes = graph.cells[sources].astype(np.float64)
    result = [np.zeros((0, 3), np.float32) for _ in sources]
    for trial, wanted in ((0, count), (1, 8 * count)):
        rows = [row for row, found in enumerate(result) if not len(found)]
        if not rows or (trial and not lines.closed_owners.size and not len(graph.plans.rows)):
            break
        places = (rng.random((len(rows), 1, 3)) + np.arange(1, wanted + 1)[None, :, None] * steps) % 1.0
        points = (boxes[rows, None, 0] + places * (boxes[rows, None, 1] - boxes[rows, None, 0])).astype(np.float32)
        exact = points.astype(np.float64)
        good = ((exact > boxes[rows, None, 0]) & (exact < boxes[rows, None, 1])).all(axis=2)
        cells = np.repeat(sources[rows], wanted).reshape(good.shape)
        good[good] = inside_plans(graph.plans, cells[good], exact[good])
        good[good] = lines.outside_solids(exact[good])
        for row, own, keep in zip(rows, points, good, strict=True):
            result[row] = own[keep][:count]
    return result


def aim_points(triangles: np.ndarray, owners: np.ndarray, count: int, seed: int) -> np.ndarray:
    """Points on objects [grid steps], shape (count, 3), float32: every object as likely, by area within it.

    Args:
        triangles: corners [grid steps], shape (m, 3, 3).
        owners: object of each, shape (m,), ascending.
        count: of points; none if there are no triangles.
        seed: of the draw.
    """
    if not len(triangles):
        return np.zeros((0, 3), np.float32)
    rng = np.random.default_rng(seed)
    corners = triangles.astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    total = np.concatenate([[0.0], np.cumsum(area)])
    objects, start = np.unique(owners, return_index=True)
    bounds = np.concatenate([total[start], total[-1:]])
    drawn = rng.integers(0, len(objects), count)
    place = bounds[drawn] + rng.random(count) * (bounds[drawn + 1] - bounds[drawn])
    chosen = corners[np.clip(np.searchsorted(total, place, "right") - 1, 0, len(corners) - 1)]
    weights = rng.dirichlet((1.0, 1.0, 1.0), count)
    return np.einsum("nc,nca->na", weights, chosen).astype(np.float32)


def frontier_points(links: Links, boxes: np.ndarray, potential: np.ndarray, count: int, seed: int) -> np.ndarray:
    """Points in hidden cells beside potentially visible ones, where a wrong verdict is likeliest.

    Args:
        links: ways between the cells.
        boxes: cells [grid steps], shape (cells, 2, 3).
        potential: shape (rows, cells), bool.
        count: points per row.
        seed: of the draw.

    Returns:
        Shape (rows, count, 3) [grid steps], float32; in a random cell where a row has no such cell.
    """
    rng, cells = np.random.default_rng(seed), len(boxes)
    # Six sides a cell.
    starts, sizes = links.starts[::6], np.diff(links.starts[::6])
    chosen = rng.integers(0, cells, (len(potential), count))
    for row, own in enumerate(potential):
        here = np.flatnonzero(own)
        beside = links.cells[places_of(starts[here], sizes[here])]
        frontier = np.unique(beside[~own[beside]])
        if len(frontier):
            chosen[row] = rng.choice(frontier, count)
    low, high = boxes[chosen, 0].astype(np.float64), boxes[chosen, 1]
    return (low + rng.random(low.shape) * (high - low)).astype(np.float32)
