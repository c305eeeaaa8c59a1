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
    boxes = np.stack([low, high])[None].astype(np.int64)
    inside = [(np.zeros(len(part), np.int64), part.astype(np.int64)) for part in opaque.boxes]
    # All nodes of a depth at once, in the order of a walk that goes down the lower side first.
    while True:
        share, axis_of, plane_of = np.zeros(len(boxes)), np.full(len(boxes), -1), np.zeros(len(boxes), np.int64)
        for axis in range(3):
            inside[axis] = _clip(*inside[axis], boxes, axis, opaque.sliver)
            node, found, plane = _best_planes(*inside[axis], boxes, axis, threshold)
            better = (found > 0.0) & (found >= share[node])
            node = node[better]
            share[node], axis_of[node], plane_of[node] = found[better], axis, plane[better]
        cut = np.flatnonzero(axis_of >= 0)
        if not len(cut):
            return boxes.astype(np.int32)
        times = np.ones(len(boxes), np.int64)
        times[cut] = 2
        lower = np.cumsum(times) - times
        boxes = np.repeat(boxes, times, axis=0)
        boxes[lower[cut], 1, axis_of[cut]] = boxes[lower[cut] + 1, 0, axis_of[cut]] = plane_of[cut]
        for axis, (node, rectangles) in enumerate(inside):
            mine = np.flatnonzero(axis_of[node] >= 0)
            node = (lower[node[mine], None] + np.array([0, 1])).ravel()
            order = np.argsort(node, kind="stable")
            inside[axis] = node[order], np.repeat(rectangles[mine], 2, axis=0)[order]


def _clip(
    node: np.ndarray, rectangles: np.ndarray, boxes: np.ndarray, axis: int, sliver: int
) -> tuple[np.ndarray, np.ndarray]:
    """Parts of flat boxes that lie strictly inside their node on their axis and reach further into it than a sliver."""
    k = rectangles[:, 0, axis]
    rows = np.flatnonzero((k > boxes[node, 0, axis]) & (k < boxes[node, 1, axis]))
    node, rectangles = node[rows], rectangles[rows]
    low, high = np.maximum(rectangles[:, 0], boxes[node, 0]), np.minimum(rectangles[:, 1], boxes[node, 1])
    u, v = OTHER_AXES[axis]
    keep = np.minimum(high[:, u] - low[:, u], high[:, v] - low[:, v]) > sliver
    return node[keep], np.stack([low[keep], high[keep]], axis=1)


def _best_planes(
    node: np.ndarray, rectangles: np.ndarray, boxes: np.ndarray, axis: int, threshold: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes that hold rectangles; largest opaque share of the cross-section of each, 0 below the threshold; its plane.

    Args:
        node: of each rectangle, ascending.
        rectangles: flat boxes inside their nodes, those of a node by plane.
        boxes: of all nodes.
        axis: perpendicular to the planes.
        threshold: as of `subdivide`.
    """
    if not len(node):
        return node, np.zeros(0), node
    u, v = OTHER_AXES[axis]
    sides, k = (rectangles[:, 1] - rectangles[:, 0]).astype(float), rectangles[:, 0, axis]
    heads = np.flatnonzero(np.append(True, (np.diff(node) != 0) | (np.diff(k) != 0)))
    area = np.add.reduceat(sides[:, u] * sides[:, v], heads)
    area[area <= threshold] = 0.0
    of, k = node[heads], k[heads]
    starts = np.flatnonzero(np.append(True, np.diff(of) != 0))
    most = np.maximum.reduceat(area, starts)
    best = np.flatnonzero(area == np.repeat(most, np.diff(np.append(starts, len(of)))))
    best = best[np.flatnonzero(np.diff(of[best], prepend=-1))]
    size = (boxes[of[best], 1] - boxes[of[best], 0]).astype(float)
    return of[best], area[best] / (size[:, u] * size[:, v]), k[best]


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
