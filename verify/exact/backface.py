"""Back-facing triangles of closed shells in integers of any size, one at a time.

Twin of `kernels/backface.py`; shares nothing with it.
"""

from collections import defaultdict
from itertools import product

import numpy as np

from ..arithmetic import cross, dot, minus

Triangle = list[list[int]]


def back_facing(triangles: np.ndarray, box: np.ndarray) -> list[bool]:
    """Whether every corner of the box, and so all of it, is behind each triangle's plane or on it.

    Args:
        triangles: counter-clockwise seen from outside, shape (t, 3, 3), int.
        box: view cell, shape (2, 3), int.
    """
    corners = [[int(box[end][axis]) for axis, end in enumerate(ends)] for ends in product((0, 1), repeat=3)]
    found = []
    for a, b, c in triangles.tolist():
        normal = cross(minus(b, a), minus(c, a))
        found.append(all(dot(normal, minus(p, a)) <= 0 for p in corners))
    return found


def outward_triangles(triangles: np.ndarray) -> list[bool]:
    """Whether each triangle is part of a closed shell of positive volume, shells being joined by edges.

    Args:
        triangles: of one object, shape (t, 3, 3), int; all are refused if any directed edge has no opposite.
    """
    corners = triangles.tolist()
    balance, sharing = defaultdict(int), defaultdict(list)
    for index, triangle in enumerate(corners):
        for k in range(3):
            p, q = tuple(triangle[k]), tuple(triangle[k - 2])
            balance[min(p, q), max(p, q)] += 1 if p < q else -1
            sharing[min(p, q), max(p, q)].append(index)
    if any(balance.values()):
        return [False] * len(corners)
    neighbours = defaultdict(set)
    for members in sharing.values():
        for index in members:
            neighbours[index].update(members)
    outward: dict[int, bool] = {}
    for start in range(len(corners)):
        if start in outward:
            continue
        shell, queue = {start}, [start]
        while queue:
            fresh = neighbours[queue.pop()] - shell
            shell |= fresh
            queue += fresh
        volume = sum(dot(corners[i][0], cross(corners[i][1], corners[i][2])) for i in shell)
        outward.update(dict.fromkeys(shell, volume > 0))
    return [outward[index] for index in range(len(corners))]
