"""A plan of what is wrong: cracks that open into rooms, and the way by which the outside leaks in."""

from pathlib import Path

import numpy as np

from ...data.errors import InputError
from ..report.plans import Mark, Painter, find_storeys, plan_of
from .inspection import Inspection

CRACK, LEAK = "#d1495b", "#8338ec"


def draw(found: Inspection, path: Path) -> None:
    """Write a plan of the storey with the most cracks as PNG or SVG, by the path's suffix.

    Raises:
        InputError: the model is not cut into cells, or has no storey to draw.
    """
    graph, scene = found.cells.graph, found.scene
    if graph is None or not graph.inhabitable.any():
        raise InputError(f"{path}: expected cells to draw a plan of, found none to stand in")
    cracks = np.array([crack.box for crack in found.cells.cracks if crack.rooms]).reshape(-1, 2, 3)
    storeys = [plan_of(storey, scene.grid_m) for storey in find_storeys(graph, scene.grid_m)]
    heights = np.array([section.level * scene.grid_m for section in storeys])
    # A crack between wall and slab belongs to the storey whose cut is nearest.
    nearest = np.abs(cracks[:, :, 2].mean(axis=1)[:, None] - heights).argmin(axis=1)
    best = int(np.bincount(nearest, minlength=len(storeys)).argmax())
    middle = graph.cells[found.cells.leak].mean(axis=1) * scene.grid_m
    marks = [
        Mark("crack into a room", CRACK, list(cracks[nearest == best][:, :, :2])),
        Mark("leak", LEAK, [middle[:, :2]]),
    ]
    title = f"cracks and leaks, cut at z = {heights[best]:.2f} m"
    Painter(graph, scene, scene.grid_m, whole=True).marked(storeys[best], marks, title, path)
