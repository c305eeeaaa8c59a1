"""Rooms of a model that no inhabitable cell covers: whoever stands there has no potentially visible set."""

import numpy as np

from .graph import CellGraph
from .scene import Scene
from .solids import winding_numbers

# Sample points along each axis of a room's box, and the share of those in the room that cells must hold.
SAMPLES = 6
COVERED_SHARE = 0.1


def uncovered_rooms(scene: Scene, graph: CellGraph) -> list[str]:
    """Names of the rooms of which inhabitable cells hold less than a tenth of the sample points, in the model's order.

    Args:
        scene: whose spaces are the rooms.
        graph: cells; they may overlap.

    Returns:
        A name for each such room, "room" where it has none; rooms of the same name each count.
    """
    boxes = graph.cells[graph.inhabitable].astype(float)
    steps = (np.arange(SAMPLES) + 0.5) / SAMPLES
    unit = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    found = []
    for space in scene.spaces:
        corners = space.vertices[space.faces] / scene.grid_m
        if not len(corners):
            continue
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        points = low + unit * (high - low)
        points = points[np.abs(winding_numbers(points, corners)) > 0.5]
        near = boxes[(boxes[:, 1] > low).all(axis=1) & (boxes[:, 0] < high).all(axis=1)]
        held = ((points[:, None] > near[:, 0]) & (points[:, None] < near[:, 1])).all(axis=2).any(axis=1)
        if len(points) and held.mean() < COVERED_SHARE:
            found.append(space.name or "room")
    return found
