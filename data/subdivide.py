"""Spatial subdivision: boxes cut along the major opaque faces, merged where nothing separates them.

Source: Funkhouser et al. 1996, section 3.1 (k-D cells along axis-aligned opaque surfaces).
"""

import heapq

import numpy as np

from .graph import OTHER_AXES
from .opaque import OpaquePlanes


def subdivide(opaque: OpaquePlanes, low: np.ndarray, high: np.ndarray, threshold: float = 0.0) -> np.ndarray:
    """k-D leaves: at each node the plane whose opaque area is the largest share of the node's cross-section.

    Args:
        opaque: opaque rectangles.
        low: corner of the box to cut [grid steps], int64 x 3.
        high: the other corner.
        threshold: opaque area [squared grid steps] below which a plane does not cut. Larger is faster and looser.

    Returns:
        Disjoint boxes that tile the given one, shape (n, 2, 3), int32.
    """
    leaves = []
    todo = [(np.stack([low, high]).astype(np.int64), [boxes.astype(np.int64) for boxes in opaque.boxes])]
    while todo:
        box, inside = todo.pop()
        clipped, best = [], (0.0, -1, 0)
        for axis in range(3):
            rectangles = _clip(inside[axis], box, axis, opaque.sliver)
            clipped.append(rectangles)
            if len(rectangles):
                share, plane = _best_plane(rectangles, box, axis, threshold)
                best = max(best, (share, axis, plane))
        if best[1] < 0:
            leaves.append(box)
            continue
        _, axis, plane = best
        lower, upper = box.copy(), box.copy()
        lower[1, axis] = upper[0, axis] = plane
        todo += [(upper, clipped), (lower, clipped)]
    return np.array(leaves, np.int32)


def _clip(rectangles: np.ndarray, box: np.ndarray, axis: int, sliver: int = 0) -> np.ndarray:
    """Parts of flat boxes that lie strictly inside a box on their axis and reach further into it than a sliver."""
    k = rectangles[:, 0, axis]
    rectangles = rectangles[(k > box[0, axis]) & (k < box[1, axis])]
    low, high = np.maximum(rectangles[:, 0], box[0]), np.minimum(rectangles[:, 1], box[1])
    keep = (high - low)[:, OTHER_AXES[axis]].min(axis=1) > sliver if len(rectangles) else np.zeros(0, bool)
    return np.stack([low[keep], high[keep]], axis=1)


def _best_plane(rectangles: np.ndarray, box: np.ndarray, axis: int, threshold: float) -> tuple[float, int]:
    """Largest opaque share of the cross-section and its plane; share 0 if none passes the threshold."""
    u, v = OTHER_AXES[axis]
    sides = (rectangles[:, 1] - rectangles[:, 0]).astype(float)
    planes, where = np.unique(rectangles[:, 0, axis], return_inverse=True)
    area = np.bincount(where, sides[:, u] * sides[:, v])
    area[area <= threshold] = 0.0
    pick = int(area.argmax())
    size = (box[1] - box[0]).astype(float)
    return float(area[pick] / (size[u] * size[v])), int(planes[pick])


def cut_rooms(cells: np.ndarray, rooms: np.ndarray) -> np.ndarray:
    """Cut cells at the floors and ceilings of rooms that the model names but does not build.

    Args:
        cells: disjoint boxes, shape (n, 2, 3), int32.
        rooms: boxes of the rooms, shape (m, 2, 3), int.

    Returns:
        Boxes with the same union, shape (k, 2, 3), int32. Only cells that share more than half of their footprint with
        a room are cut by it: a view cell should not reach from a room into the ground under it.
    """
    for low, high in rooms:
        corner_low, corner_high = np.maximum(cells[:, 0, :2], low[:2]), np.minimum(cells[:, 1, :2], high[:2])
        shared = np.prod(np.maximum(corner_high - corner_low, 0).astype(float), axis=1)
        footprint = np.prod((cells[:, 1, :2] - cells[:, 0, :2]).astype(float), axis=1)
        for k in (low[2], high[2]):
            crossing = (shared > 0.5 * footprint) & (cells[:, 0, 2] < k) & (cells[:, 1, 2] > k)
            if crossing.any():
                upper = cells[crossing].copy()
                upper[:, 0, 2] = k
                cells = cells.copy()
                cells[crossing, 1, 2] = k
                cells = np.concatenate([cells, upper])
                shared, footprint = (np.concatenate([x, x[crossing]]) for x in (shared, footprint))
    return cells


def cut_large(cells: np.ndarray, chosen: np.ndarray, side: float) -> tuple[np.ndarray, np.ndarray]:
    """Cut chosen cells into equal parts, none of them longer or wider than a side.

    Args:
        cells: [grid steps], shape (n, 2, 3), int32.
        chosen: which to cut, shape (n,), bool.
        side: [grid steps].

    Returns:
        Boxes in the order of the cells, which they tile, shape (m, 2, 3), int32, and the cell of each, shape (m,).
    """
    boxes, parents = [], []
    for number, (low, high) in enumerate(cells.astype(np.int64)):
        parts = np.maximum(1, np.ceil((high - low)[:2] / side)).astype(int) if chosen[number] else np.ones(2, int)
        x, y = ((low[k] + (high[k] - low[k]) * np.arange(parts[k] + 1) // parts[k]) for k in (0, 1))
        for i in range(parts[0]):
            for j in range(parts[1]):
                boxes.append([[x[i], y[j], low[2]], [x[i + 1], y[j + 1], high[2]]])
        parents += [number] * int(parts.prod())
    return np.array(boxes, np.int32).reshape(-1, 2, 3), np.array(parents, np.int64)


def merge(leaves: np.ndarray, opaque: OpaquePlanes) -> np.ndarray:
    """Merge neighbours that share one identical, wholly open face, largest faces first.

    Args:
        leaves: disjoint boxes, shape (n, 2, 3), int32.
        opaque: opaque rectangles.

    Returns:
        Boxes with the same union, shape (m, 2, 3), int32.
    """
    planes = opaque.index
    boxes = [tuple(box) for box in leaves.reshape(-1, 6).tolist()]
    alive = [True] * len(boxes)
    faces: dict[tuple[int, ...], int] = {}
    heap: list[tuple[int, int, int, int]] = []

    def face(box: tuple[int, ...], axis: int, side: int) -> tuple[int, ...]:
        u, v = OTHER_AXES[axis]
        return (axis, side, box[axis + 3 * side], box[u], box[u + 3], box[v], box[v + 3])

    def offer(index: int) -> None:
        box = boxes[index]
        for axis in range(3):
            for side in (0, 1):
                key = face(box, axis, side)
                other = faces.get((axis, 1 - side, *key[2:]), -1)
                if other >= 0:
                    area = (key[4] - key[3]) * (key[6] - key[5])
                    low, high = (index, other) if side else (other, index)
                    heapq.heappush(heap, (-area, low, high, axis))
                faces[key] = index

    def forget(index: int) -> None:
        alive[index] = False
        for axis in range(3):
            for side in (0, 1):
                faces.pop(face(boxes[index], axis, side), None)

    for index in range(len(boxes)):
        offer(index)
    while heap:
        _, low, high, axis = heapq.heappop(heap)
        if alive[low] and alive[high] and planes.is_open(face(boxes[low], axis, 1)):
            forget(low)
            forget(high)
            joined = list(boxes[low])
            joined[axis + 3] = boxes[high][axis + 3]
            boxes.append(tuple(joined))
            alive.append(True)
            offer(len(boxes) - 1)
    return np.array([box for box, keep in zip(boxes, alive, strict=True) if keep], np.int32).reshape(-1, 2, 3)
