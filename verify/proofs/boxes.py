"""Whether triangles lie in a union of boxes, in rationals; boxes may be prisms over plans that stand at an angle."""

import numpy as np

from .opaque import split, turn
from .ways import End


def in_boxes(triangles: np.ndarray, boxes: list[End]) -> bool:
    """Whether triangles lie in a union of closed boxes and prisms.

    Args:
        triangles: [grid steps], shape (n, 3, 3), int, not degenerate.
        boxes: that may hold them.
    """
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    inside = np.zeros(len(triangles), bool)
    for end in boxes:
        if end.plan is None:
            inside |= (low >= end.box[0]).all(axis=1) & (high <= end.box[1]).all(axis=1)
    return all(_in_boxes([tuple(p) for p in triangle], boxes) for triangle in triangles[~inside].tolist())


def _in_boxes(polygon: list[tuple], boxes: list[End]) -> bool:
    """The same for a convex polygon with an area: what is outside the first box it meets must be in the others."""
    spans = [(min(column), max(column)) for column in zip(*polygon, strict=True)]
    while boxes:
        end, *boxes = boxes
        sides = zip(spans, *end.box, strict=True)
        if all((at <= a and b <= to) or max(a, at) < min(b, to) for (a, b), at, to in sides):
            break
    else:
        return False
    for side in range(10):
        outward = _outward(polygon, end, side)
        if outward and max(outward) > 0:
            if min(outward) >= 0:
                return _in_boxes(polygon, boxes)
            polygon, outside = split(polygon, outward)
            if not _in_boxes(outside, boxes):
                return False
    return True


def _outward(polygon: list[tuple], end: End, side: int) -> list:
    """How far corners lie outside one side of a box, or of its plan, by some measure; empty where it has no such."""
    if side < 6:
        axis, upper = side // 2, side % 2
        bound = end.box[upper][axis]
        return [p[axis] - bound if upper else bound - p[axis] for p in polygon]
    if end.plan is None:
        return []
    a, b = end.plan[side - 6], end.plan[(side - 5) % 4]
    return [-turn(a, b, p) for p in polygon]
