"""Models whose walls stand oblique to the axes, along which cells are cut."""

import numpy as np

from ..scene import Role
from .assemble import Model

# Walls within this angle of an axis count as along it, as far as the grid tells.
ALONG_RAD = np.radians(0.05)
# Less than this share of the wall area along the axes is worth a note.
ALONG_SHARE = 0.5
BINS = 1800


def note_turned(model: Model) -> None:
    """Note it where most of the wall area stands oblique to the axes, and the angle that most of it stands at."""
    found = wall_yaw([(part.placed(), part.faces) for part in model.parts if part.role is Role.OCCLUDER])
    if found is None:
        return
    along, yaw = found
    if along < ALONG_SHARE:
        angle_deg = np.degrees(yaw)
        model.note(
            "walls",
            f"{1 - along:.0%} of their area stands oblique to the axes, most of it turned by {angle_deg:.2f} degrees: "
            "cells, which are cut along the axes, are coarser; an export along the building's own axes is read better",
        )


def wall_yaw(meshes: list[tuple[np.ndarray, np.ndarray]]) -> tuple[float, float] | None:
    """How the upright faces of meshes stand about the vertical.

    Args:
        meshes: vertices [m], shape (n, 3), and faces, shape (m, 3), of each.

    Returns:
        Share of their area that stands along the axes, and the angle to the axes that most of it stands at, in radians
        from -pi/4 to pi/4, weighted by area; None if nothing is upright.
    """
    corners = [vertices[faces] for vertices, faces in meshes if len(faces)]
    if not corners:
        return None
    triangles = np.concatenate(corners)
    with np.errstate(all="ignore"):  # what is not finite is refused elsewhere
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        length = np.linalg.norm(normals, axis=1)
        upright = np.isfinite(length) & (np.abs(normals[:, 2]) < 0.01 * length)
    if not upright.any():
        return None
    angle = np.arctan2(normals[upright, 1], normals[upright, 0])
    angle = (angle + np.pi / 4) % (np.pi / 2) - np.pi / 4
    area = length[upright]
    along = float(area[np.abs(angle) <= ALONG_RAD].sum() / area.sum())
    place = np.minimum(((angle + np.pi / 4) / (np.pi / 2) * BINS).astype(int), BINS - 1)
    most = place == np.bincount(place, area, BINS).argmax()
    return along, float(np.average(angle[most], weights=area[most]))
