"""Cracks: parts of openings that no square of a given width fits into.

An opening is all portals of one plane together: a plane that cuts cells a step from a doorway's edge leaves a narrow
portal there, and no crack.
"""

import numpy as np
import shapely

from .graph import OTHER_AXES, CellGraph

# Taken off a square's side [grid steps], so that an opening of just the width is none narrower.
SLACK = 2.0**-10


def crack_portals(graph: CellGraph, width: float) -> np.ndarray:
    """Portals that lie in cracks, whole.

    Args:
        graph: cells and portals.
        width: of the square [grid steps]; what it fits into is no crack.

    Returns:
        Shape (portals,), bool. A portal that a wide opening and a crack share is none.
    """
    found = np.zeros(graph.portal_count, bool)
    if not graph.portal_count or width <= SLACK:
        return found
    axis = graph.portal_axis.astype(int)
    planes = np.stack([axis, graph.portals[np.arange(len(axis)), 0, axis]], axis=1)
    _, group = np.unique(planes, axis=0, return_inverse=True)
    order = np.argsort(group.ravel(), kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(group.ravel()[order])) + 1):
        boxes = graph.portals[rows][:, :, OTHER_AXES[axis[rows[0]]]].astype(float)
        narrow = (boxes[:, 1] - boxes[:, 0]).min(axis=1) < width
        if narrow.any():
            found[rows[narrow]] = ~_meet_wide(boxes, np.flatnonzero(narrow), width - SLACK)
    return found


def _meet_wide(boxes: np.ndarray, chosen: np.ndarray, width: float) -> np.ndarray:
    """Which of the chosen rectangles (n, 2, 2) share area with a square of that width in the union of all."""
    faces = shapely.box(*boxes.reshape(-1, 4).T)
    centres = shapely.buffer(shapely.union_all(faces), -width / 2, join_style="mitre", mitre_limit=2.0)
    wide = shapely.buffer(centres, width / 2, join_style="mitre", mitre_limit=2.0)
    return shapely.area(shapely.intersection(faces[chosen], wide)) > SLACK
