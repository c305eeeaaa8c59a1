"""Whether triangles lie in a union of boxes, in rationals."""

import numpy as np

from .opaque import split


def in_boxes(triangles: np.ndarray, boxes: np.ndarray) -> bool:
    """Whether triangles lie in a union of closed boxes.

    Args:
        triangles: [grid steps], shape (n, 3, 3), int, not degenerate.
        boxes: shape (m, 2, 3), int.
    """
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    inside = np.zeros(len(triangles), bool)
    for box in boxes:
        inside |= (low >= box[0]).all(axis=1) & (high <= box[1]).all(axis=1)
    pieces = boxes.tolist()
    return all(_in_boxes([tuple(p) for p in triangle], pieces) for triangle in triangles[~inside].tolist())


def _in_boxes(polygon: list[tuple], boxes: list[list[list[int]]]) -> bool:
    """The same for a convex polygon with an area: what is outside the first box it meets must be in the others."""
    spans = [(min(column), max(column)) for column in zip(*polygon, strict=True)]
    while boxes:
        (low, high), *boxes = boxes
        sides = zip(spans, low, high, strict=True)
        if all((at <= a and b <= to) or max(a, at) < min(b, to) for (a, b), at, to in sides):
            break
    else:
        return False
    for axis, side, bound in ((axis, side, (low, high)[side][axis]) for axis in range(3) for side in (0, 1)):
        outward = [p[axis] - bound if side else bound - p[axis] for p in polygon]
        if max(outward) > 0:
            if min(outward) >= 0:
                return _in_boxes(polygon, boxes)
            polygon, outside = split(polygon, outward)
            if not _in_boxes(outside, boxes):
                return False
    return True
