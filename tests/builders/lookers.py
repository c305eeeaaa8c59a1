"""Eyes in random buildings full of boxes, and the cameras they look through."""

import numpy as np
from viewcell.data.camera import CameraPath, Screen

from builders.random_buildings import SIZE, STEP

SQUARE = Screen(400, 400, 90.0)


def camera(eyes, yaw_deg, pitch_deg=0.0):
    """A path through eyes; yaw and pitch of each or of all."""
    eyes = np.atleast_2d(np.asarray(eyes, float))
    angles = [np.broadcast_to(np.asarray(angle, float), len(eyes)).copy() for angle in (yaw_deg, pitch_deg)]
    return CameraPath(eyes, *angles, np.arange(len(eyes), dtype=float))


def all_round(eye):
    """Six frames of `SQUARE` that see every direction."""
    return camera([eye] * 6, [0, 90, 180, 270, 0, 0], [0, 0, 0, 0, 90, -90])


def random_boxes(rng, count):
    """Boxes in the box of a random building [grid steps]; a third of them are flat, and lie on its coarse grid."""
    low = rng.integers(0, SIZE * STEP - 40, (count, 3))
    boxes = np.stack([low, low + rng.integers(1, 40, (count, 3))], axis=1)
    for number in range(0, count, 3):
        axis = rng.integers(0, 3)
        boxes[number, :, axis] = STEP * rng.integers(0, SIZE + 1)
    return boxes


def sets(answers, kind="objects"):
    """The set of each frame."""
    starts, ids = (answers.starts, answers.objects) if kind == "objects" else (answers.cell_starts, answers.cells)
    return [set(part.tolist()) for part in np.split(ids, starts[1:-1])]


def edge_eyes(graph, portal):
    """Middle, middles of two edges, and two corners of a portal."""
    low, high = graph.portals[portal].astype(float)
    middle = (low + high) / 2
    u, v = {0, 1, 2} - {int(graph.portal_axis[portal])}
    found = [middle, low, high]
    for axis in (u, v):
        eye = middle.copy()
        eye[axis] = low[axis]
        found.append(eye)
    return np.array(found)
