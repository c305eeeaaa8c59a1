"""What boxes leave over of space, as boxes: where an eye is in no view cell."""

import numpy as np


def boxes_outside(boxes: np.ndarray, room: np.ndarray) -> np.ndarray:
    """Boxes without common volume that together are all of a room but what the given boxes hold.

    A room is peeled down to the box around what it holds, then halved along a face that cuts as few as may be.

    Args:
        boxes: low and high corner, shape (n, 2, 3), int; they may overlap.
        room: low and high corner, shape (2, 3), int.

    Returns:
        Shape (m, 2, 3), int64.
    """
    out, stack = [], [(np.asarray(room, np.int64), np.asarray(boxes, np.int64))]
    while stack:
        room, held = stack.pop()
        held = np.stack([np.maximum(held[:, 0], room[0]), np.minimum(held[:, 1], room[1])], axis=1)
        held = held[(held[:, 0] < held[:, 1]).all(axis=1)]
        if not len(held):
            out.append(room)
            continue
        room = _peel(room, held, out)
        if (axis_at := _cut(room, held)) is not None:
            axis, at = axis_at
            for side in (0, 1):
                half = room.copy()
                half[1 - side, axis] = at
                stack.append((half, held))
    return np.array(out, np.int64).reshape(-1, 2, 3)


def _peel(room: np.ndarray, held: np.ndarray, out: list[np.ndarray]) -> np.ndarray:
    """The box around what a room holds; the slabs around it go to `out`."""
    room = room.copy()
    for axis in range(3):
        for side, face in ((0, held[:, 0, axis].min()), (1, held[:, 1, axis].max())):
            if room[side, axis] != face:
                slab = room.copy()
                slab[1 - side, axis] = room[side, axis] = face
                out.append(slab)
    return room


def _cut(room: np.ndarray, held: np.ndarray) -> tuple[int, int] | None:
    """Axis and coordinate of a face inside the room that cuts the fewest boxes, the most even of these; None if none.

    Where there is none, each box fills the room.
    """
    best = None
    for axis in range(3):
        low, high = np.sort(held[:, 0, axis]), np.sort(held[:, 1, axis])
        faces = np.unique(held[:, :, axis])
        faces = faces[(faces > room[0, axis]) & (faces < room[1, axis])]
        below = np.searchsorted(high, faces, side="right")
        above = len(held) - np.searchsorted(low, faces, side="left")
        cost = len(held) - below - above, np.maximum(below, above)
        for pick in np.lexsort(cost[::-1])[:1]:
            found = (cost[0][pick], cost[1][pick], axis, int(faces[pick]))
            best = found if best is None else min(best, found)
    return None if best is None else best[2:]
