"""What second readers of mesh files share: names told apart, boxes and areas, all in plain Python."""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from .referee import Found

Point = Sequence[float]


def newell_area(corners: Sequence[Point]) -> float:
    """Area of a polygon by Newell's formula: of its shadow along its normal, if it is not flat."""
    a = corners[0]
    total = [0.0, 0.0, 0.0]
    for p, q in zip(corners, [*corners[1:], corners[0]], strict=True):
        u, v = [p[k] - a[k] for k in range(3)], [q[k] - a[k] for k in range(3)]
        total[0] += u[1] * v[2] - u[2] * v[1]
        total[1] += u[2] * v[0] - u[0] * v[2]
        total[2] += u[0] * v[1] - u[1] * v[0]
    return math.hypot(*total) / 2


def standing(point: Point, metres: float, up: str) -> tuple[float, float, float]:
    """A point of a file in metres, Z up."""
    x, y, z = (metres * value for value in point)
    return (x, -z, y) if up == "y" else (x, y, z)


def found_of(named: Iterable[tuple[str, list[list[Point]]]], metres: float, up: str) -> list[Found]:
    """What objects are, given their names, none twice told apart yet, and their polygons in the file's unit."""
    named = list(named)
    taken, seen, out = {name for name, _ in named}, {}, []
    for name, polygons in named:
        number = seen.get(name, 0) + 1
        key = name
        while number > 1 and (key := f"{name} #{number}") in taken:
            number += 1
        seen[name] = number
        taken.add(key)
        placed = [[standing(point, metres, up) for point in polygon] for polygon in polygons]
        points = [point for polygon in placed for point in polygon]
        box = [[pick(point[k] for point in points) for k in range(3)] for pick in (min, max)]
        out.append(Found(key, np.array(box, np.float64), math.fsum(newell_area(polygon) for polygon in placed)))
    return out
