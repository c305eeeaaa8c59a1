"""What an eye sees through portals, in rationals, by the definition. Twin of `kernels/eye.py`.

A ray passes a portal when the point where it crosses the portal's plane lies in the rectangle: four inequalities on
its direction. A box is seen when a point of one of its faces satisfies those of every portal on the way, so faces are
clipped by them; no cone is ever formed. Everything is closed. Rays along a portal's plane pass it only from within.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from ...data.graph import CellGraph
from ..arithmetic import clip

Point = list[Fraction]


@dataclass(frozen=True)
class Looker:
    """An eye in a building.

    Attributes:
        graph: cells and portals.
        boxes: of objects [grid steps], shape (m, 2, 3).
        eye: [grid steps].
        ways: the graph's adjacency.
        objects: seen so far.
        cells: likewise.
    """

    graph: CellGraph
    boxes: list[list[list[int]]]
    eye: Point
    ways: tuple[np.ndarray, np.ndarray]
    objects: set[int] = field(default_factory=set)
    cells: set[int] = field(default_factory=set)

    def look(self, cell: int, halfspaces: list[Point], before: tuple[int, ...]) -> None:
        """Note what a cell holds within halfspaces, and look on through its portals."""
        self.cells.add(cell)
        own = self.graph.cells[cell].tolist()
        for number, box in enumerate(self.boxes):
            shared = [[max(a, b) for a, b in zip(own[0], box[0], strict=True)]]
            shared.append([min(a, b) for a, b in zip(own[1], box[1], strict=True)])
            if number not in self.objects and self._meets(shared, halfspaces):
                self.objects.add(number)
        starts, entries = self.ways
        for portal, behind in entries[starts[cell] : starts[cell + 1]].tolist():
            if behind in before:
                continue
            rectangle = self.graph.portals[portal].tolist()
            narrower = self._passing(portal, behind, rectangle)
            if narrower is not None and self._meets(rectangle, [*halfspaces, *narrower]):
                self.look(behind, [*halfspaces, *narrower], (*before, behind))

    def _passing(self, portal: int, behind: int, rectangle: list[list[int]]) -> list[Point] | None:
        """Halfspaces of the rays that pass a portal; None if none does."""
        axis = int(self.graph.portal_axis[portal])
        sign = 1 if self.graph.portal_cells[portal, 1] == behind else -1
        low, high = ([c - e for c, e in zip(corner, self.eye, strict=True)] for corner in rectangle)
        ahead = low[axis]
        if sign * ahead < 0:
            return None
        onward = [Fraction(sign) if i == axis else Fraction(0) for i in range(3)]
        if ahead == 0:
            inside = all(a <= 0 <= b for a, b in zip(low, high, strict=True))
            return [onward] if inside else None
        found = [onward]
        for u in {0, 1, 2} - {axis}:
            for bound, way in ((low[u], sign), (high[u], -sign)):
                # At the plane, p_u ahead / p_axis is at least the low bound and at most the high one.
                row = [Fraction(0)] * 3
                row[u], row[axis] = way * ahead, -way * bound
                found.append(row)
        return found

    def _meets(self, box: list[list[int]], halfspaces: list[Point]) -> bool:
        """Whether a closed box holds the eye, or a face of it has a point within all halfspaces."""
        if any(a > b for a, b in zip(*box, strict=True)):
            return False
        low, high = ([c - e for c, e in zip(corner, self.eye, strict=True)] for corner in box)
        if all(a <= 0 <= b for a, b in zip(low, high, strict=True)):
            return True
        return any(clipped(face, halfspaces) for face in sides(low, high))


def sides(low: Point, high: Point) -> Iterator[list[Point]]:
    """Faces of a box, which may be flat: four corners each."""
    for axis in range(3):
        u, v = {0, 1, 2} - {axis}
        for place in {low[axis], high[axis]}:
            face = []
            for a, b in ((low, low), (high, low), (high, high), (low, high)):
                corner = [place] * 3
                corner[u], corner[v] = a[u], b[v]
                face.append(corner)
            yield face


def clipped(polygon: list[Point], halfspaces: list[Point]) -> list[Point]:
    """Corners of what of a convex polygon lies in all halfspaces; some may stand twice."""
    for n in halfspaces:
        polygon = clip(polygon, n)
    return polygon


def seen_by_eye(
    graph: CellGraph, boxes: np.ndarray, eye: np.ndarray, axes: np.ndarray, half: tuple[float, float]
) -> tuple[set[int], set[int]]:
    """Objects and cells that closed rays from an eye meet, within its screen and through portals.

    Args:
        graph: a small one: the search has no cap.
        boxes: of objects [grid steps], shape (m, 2, 3), int.
        eye: [grid steps], 3 float64, in some cell.
        axes: right, up and forward, shape (3, 3), float64.
        half: half the screen's width and height at distance 1.
    """
    right, up, forward = ([Fraction(float(c)) for c in axis] for axis in axes)
    screen = [forward]
    for along, size in ((right, half[0]), (up, half[1])):
        for sign in (1, -1):
            screen.append([sign * a + Fraction(float(size)) * f for a, f in zip(along, forward, strict=True)])
    looker = Looker(graph, boxes.tolist(), [Fraction(float(c)) for c in eye], graph.adjacency())
    low, high = graph.cells[:, 0], graph.cells[:, 1]
    for cell in np.flatnonzero(((low <= eye) & (eye <= high)).all(axis=1)).tolist():
        looker.look(cell, screen, (cell,))
    return looker.objects, looker.cells
