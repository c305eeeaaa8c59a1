"""The frame that a model is read into: turned about the vertical until most of its walls stand along the axes.

Cells are cut along the axes. The yaw is the mode of the walls' directions, not their mean: of three row houses that
stand 0, 0.008 and 0.018 degrees off, the mean would make every one oblique.
"""

from dataclasses import replace

import numpy as np

from .scene import Role, Scene, boxes_around, turned

# Directions are taken together within this angle [degrees]: what coordinates rounded to a millimetre make of one wall.
WINDOW_DEG = 0.001
# Below this a wall of 100 m is off by less than the grid moves its corners: nothing is turned.
LEAST_DEG = 1e-4
# Faces are upright if their normal rises by no more than this share.
UPRIGHT = 0.01
# Directions whose areas differ by no more than this share are as good as each other: the nearest to the axes is taken.
TIE = 1e-6


def wall_yaw(meshes: list[tuple[np.ndarray, np.ndarray]], window_deg: float = WINDOW_DEG) -> float:
    """How most of the upright faces of meshes stand about the vertical.

    Args:
        meshes: vertices [m], shape (n, 3), and faces, shape (m, 3), of each.
        window_deg: directions are taken together within this angle.

    Returns:
        The angle to the axes at which the largest area stands, counter-clockwise, in degrees from -45 to 45; 0 if
        nothing is upright, or as good as along the axes.
    """
    corners = [vertices[faces] for vertices, faces in meshes if len(faces)]
    if not corners:
        return 0.0
    triangles = np.concatenate(corners)
    with np.errstate(all="ignore"):  # what is not finite is refused elsewhere
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        length = np.linalg.norm(normals, axis=1)
        upright = np.isfinite(length) & (np.abs(normals[:, 2]) < UPRIGHT * length)
    if not upright.any():
        return 0.0
    angle = np.degrees(np.arctan2(normals[upright, 1], normals[upright, 0])) % 90.0
    order = np.argsort(angle, kind="stable")
    # Once more behind 90 degrees, where the directions begin again.
    angle, area = (
        np.concatenate([part, part + turn]) for part, turn in ((angle[order], 90.0), (length[upright][order], 0))
    )
    total = np.concatenate([[0.0], np.cumsum(area)])
    first = np.arange(len(order))
    last = np.searchsorted(angle, angle[first] + window_deg, side="right")
    held = total[last] - total[first]
    ties = np.flatnonzero(held >= (1.0 - TIE) * held.max())
    # Of a regular hexagon, whose walls stand at 0, 30 and 60 degrees alike, chance would choose.
    best = int(ties[np.abs((angle[ties] + 45.0) % 90.0 - 45.0).argmin()])
    inside = slice(best, last[best])
    # Rounded first: at 45 degrees the last digit must not decide for a quarter turn.
    yaw = round(float(np.average(angle[inside], weights=area[inside])) % 90.0, 7)
    yaw = round(yaw - 90.0, 7) if yaw > 45.0 else yaw
    return yaw if abs(yaw) > LEAST_DEG else 0.0


def in_frame(scene: Scene, yaw: str | float) -> Scene:
    """A scene as `read` takes a model file: turned back before it is snapped.

    Args:
        scene: as it stands; it stays as it is.
        yaw: what the model is turned back by in all [degrees], or "auto" for so much more that most of the walls stand
            along the axes; 0 leaves the scene as it is.

    Returns:
        The scene itself if there is nothing to turn. Openings become the boxes around the turned ones.
    """
    if yaw != "auto":
        return scene if yaw == 0.0 else _turned_back(scene, float(yaw) - scene.yaw_deg)
    shapes = [shape.lods[0] for shape in scene.definitions]
    walls = [placed for placed in scene.objects if placed.role is Role.OCCLUDER]
    meshes = [shapes[wall.definition_id] for wall in walls]
    more = wall_yaw(
        [(mesh.vertices @ wall.transform[:3, :3].T, mesh.faces) for mesh, wall in zip(meshes, walls, strict=True)]
    )
    if not more:
        return scene
    again = _turned_back(scene, more)
    again.notes.append(turn_note(more))
    return again


def turn_note(yaw_deg: float) -> dict[str, str]:
    """What `Scene.notes` says of a model that is turned back by so much though its file does not say so."""
    why = f"most of their area stands at {yaw_deg:g} degrees: the model is turned back by as much"
    return {"what": "walls", "why": why}


def _turned_back(scene: Scene, by_deg: float) -> Scene:
    """The scene, turned back about the vertical through its own origin."""
    if by_deg == 0.0:
        return scene
    back = np.eye(4)
    back[:3, :3] = turned(np.eye(3), -by_deg).T
    return replace(
        scene,
        objects=[replace(placed, transform=back @ placed.transform) for placed in scene.objects],
        spaces=[replace(space, vertices=turned(space.vertices, -by_deg)) for space in scene.spaces],
        openings=boxes_around(scene.openings, back),
        yaw_deg=scene.yaw_deg + by_deg,
        notes=list(scene.notes),
    )
