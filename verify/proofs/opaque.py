"""Whether occluders are real, exactly: rectangles of axial planes that are opaque throughout, and discs of triangles.

A point of a plane counts as opaque if it lies on an opaque triangle in the plane, or if just below or just above the
plane it lies inside a closed opaque element (winding number not 0). Each of these covers is a closed chain of directed
edges in the plane, whose winding number tells where it covers: triangles of the plane all turned the same way, or the
limit of the sections of one element as they approach the plane. A convex polygon whose inside no edge of a chain
enters is covered wholly or not at all, so cutting along edges that enter decides every rectangle in rationals.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import pairwise

import numpy as np

from ..arithmetic import cross, dot, minus

Point = Sequence[int | Fraction]
Edge = tuple[Point, Point]


def split(polygon: list[Point], heights: list[int | Fraction]) -> tuple[list[Point], list[Point]]:
    """The parts of a convex polygon where an affine function, given at its corners, is at most 0 and at least 0."""
    parts = [], []
    for i, (p, h) in enumerate(zip(polygon, heights, strict=True)):
        q, g = polygon[i - 1], heights[i - 1]
        if h * g < 0:
            met = between(p, q, Fraction(h, h - g))
            parts[0].append(met)
            parts[1].append(met)
        if h <= 0:
            parts[0].append(p)
        if h >= 0:
            parts[1].append(p)
    return parts


def between(p: Point, q: Point, share: Fraction) -> tuple[int | Fraction, ...]:
    """The point at a share of the way from p to q; integers stay integers, which are far quicker."""
    met = [a if a == b else a + share * (b - a) for a, b in zip(p, q, strict=True)]
    return tuple(c if isinstance(c, int) or c.denominator > 1 else c.numerator for c in met)


def turn(a: Point, b: Point, p: Point) -> int | Fraction:
    """Positive where p lies left of ab, in the plane."""
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])


def enters(edge: Edge, polygon: list[Point]) -> bool:
    """Whether an edge meets the inside of a convex polygon, given counter-clockwise."""
    for c in (0, 1):
        low, high = min(edge[0][c], edge[1][c]), max(edge[0][c], edge[1][c])
        # Most edges are told apart by their bounds.
        if max(p[c] for p in polygon) <= low or min(p[c] for p in polygon) >= high:
            return False
    first, last = Fraction(0), Fraction(1)
    for i, p in enumerate(polygon):
        start, end = (turn(polygon[i - 1], p, q) for q in edge)
        if start <= 0 and end <= 0:
            return False
        if start < 0:
            first = max(first, Fraction(start, start - end))
        elif end < 0:
            last = min(last, Fraction(start, start - end))
    return first < last


class Cover:
    """A closed chain of edges, which covers the points that it winds round."""

    def __init__(self, edges: list[Edge]) -> None:
        self.edges = edges
        ends = np.array(edges, float).reshape(-1, 2, 2)
        # A step of padding is far more than the rounding of rational ends.
        self._low, self._high = ends.min(axis=1) - 1, ends.max(axis=1) + 1

    def near(self, low: np.ndarray, high: np.ndarray) -> list[Edge]:
        """Edges that may meet a box of the plane."""
        return [self.edges[i] for i in np.flatnonzero((self._low < high).all(axis=1) & (self._high > low).all(axis=1))]

    def holds(self, point: Point) -> bool:
        """Whether the winding number about a point off all edges is not 0."""
        v, total = float(point[1]), 0
        for i in np.flatnonzero((self._low[:, 1] < v) & (self._high[:, 1] > v)):
            a, b = self.edges[i]
            upward = a[1] <= point[1] < b[1]
            if upward or b[1] <= point[1] < a[1]:
                left = turn(a, b, point) > 0
                total += (upward and left) - (not upward and not left)
        return total != 0


def covered(polygon: list[Point], covers: list[tuple[Cover, list[Edge]]]) -> bool:
    """Whether a convex polygon lies in the union of covers, each with the edges of it that may enter the polygon."""
    middle = tuple(sum(p[i] for p in polygon) * Fraction(1, len(polygon)) for i in (0, 1))
    left = []
    for cover, edges in covers:
        cuts = [edge for edge in edges if enters(edge, polygon)]
        if cuts:
            left.append((cover, cuts))
        elif cover.holds(middle):
            return True
    if not left:
        return False
    cuts = min((cuts for _, cuts in left), key=len)
    a, b = cuts[len(cuts) // 2]
    return all(covered(part, left) for part in split(polygon, [turn(a, b, p) for p in polygon]))


class OpaqueSurfaces:
    """Opaque triangles of a model, object by object, and what they cover in axial planes."""

    def __init__(self, triangles: np.ndarray, owners: np.ndarray) -> None:
        """Sort opaque triangles by object.

        Args:
            triangles: [grid steps], shape (m, 3, 3), integers, not degenerate.
            owners: object of each, shape (m,).
        """
        order = np.argsort(owners, kind="stable")
        self._triangles = triangles[order].astype(np.int64)
        self.objects, first = np.unique(owners[order], return_index=True)
        self._parts = np.split(self._triangles, first[1:]) if len(first) else []
        self._boxes = np.array([[t.min(axis=(0, 1)), t.max(axis=(0, 1))] for t in self._parts], np.int64)
        self._boxes = self._boxes.reshape(-1, 2, 3)
        self._closed: dict[int, bool] = {}
        self._known: dict[tuple[int, ...], Cover] = {}

    def open_rectangle(self, axis: int, plane: int, rectangles: np.ndarray) -> np.ndarray | None:
        """The first rectangle that is not opaque throughout, or None.

        Args:
            axis: perpendicular to the plane.
            plane: its coordinate.
            rectangles: low and high corners on the other two axes, in ascending order, shape (n, 2, 2), integers.
        """
        return next((found for found in rectangles if not self._opaque(axis, plane, found)), None)

    def _opaque(self, axis: int, plane: int, rectangle: np.ndarray) -> bool:
        low, high = rectangle
        (u0, v0), (u1, v1) = rectangle.tolist()
        if u0 >= u1 or v0 >= v1:
            return False
        uv = [i for i in range(3) if i != axis]
        polygon = [(u0, v0), (u1, v0), (u1, v1), (u0, v1)]
        reaching = np.flatnonzero((self._boxes[:, 0, axis] <= plane) & (self._boxes[:, 1, axis] >= plane))
        boxes = self._boxes[reaching][:, :, uv]
        shared = np.minimum(boxes[:, 1], high) - np.maximum(boxes[:, 0], low)
        near = np.flatnonzero((shared > 0).all(axis=1))
        # What overlaps most is likeliest to cover the rectangle alone.
        likeliest = reaching[near[np.argsort(-shared[near].prod(axis=1), kind="stable")]]
        covers = []
        for cover in self._covers(axis, plane, likeliest.tolist()):
            edges = [edge for edge in cover.near(low, high) if enters(edge, polygon)]
            if edges:
                covers.append((cover, edges))
            elif covered(polygon, [(cover, edges)]):
                return True
        return covered(polygon, covers)

    def _covers(self, axis: int, plane: int, parts: list[int]) -> Iterator[Cover]:
        """The surface of a plane, then the sections of closed elements just below and just above it."""
        yield self._cover(-1, axis, plane, below=False)
        for part in parts:
            if self._closed.get(part) is None:
                self._closed[part] = closed(self._parts[part])
            # What is inside on one side only is on the surface: one section would do, but two are cut less.
            if self._closed[part]:
                yield self._cover(part, axis, plane, below=True)
                yield self._cover(part, axis, plane, below=False)

    def _cover(self, part: int, axis: int, plane: int, *, below: bool) -> Cover:
        key = part, axis, plane, below
        if key not in self._known:
            edges = section(self._parts[part], axis, plane, below=below) if part >= 0 else self._surface(axis, plane)
            self._known[key] = Cover(edges)
        return self._known[key]

    def _surface(self, axis: int, plane: int) -> list[Edge]:
        """Boundary of the triangles of a plane."""
        flat = self._triangles[(self._triangles[:, :, axis] == plane).all(axis=1)]
        return flat_boundary(np.delete(flat, axis, axis=2))

    def reaching(self, box: np.ndarray) -> list[np.ndarray]:
        """Triangles of each object that shares a point with a box, shape (2, 3)."""
        near = ((self._boxes[:, 0] <= box[1]) & (self._boxes[:, 1] >= box[0])).all(axis=1)
        return [self._parts[part] for part in np.flatnonzero(near)]

    def disc(self, object_id: int, places: list[int]) -> np.ndarray | None:
        """Triangles of an opaque object, shape (n, 3, 3), int64; None if it has not all of them, or repeats one."""
        part = int(np.searchsorted(self.objects, object_id))
        if part == len(self.objects) or self.objects[part] != object_id or not places:
            return None
        inside = 0 <= min(places) and max(places) < len(self._parts[part]) and len(set(places)) == len(places)
        return self._parts[part][places] if inside else None


def closed(triangles: np.ndarray) -> bool:
    """Whether every directed edge of a surface has its opposite, as often; triangles of shape (m, 3, 3), integers."""
    edges = np.concatenate([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 6)
    opposite = edges[:, [3, 4, 5, 0, 1, 2]]
    return bool((edges[np.lexsort(edges.T)] == opposite[np.lexsort(opposite.T)]).all())


def flat_boundary(triangles: np.ndarray) -> list[Edge]:
    """Boundary of triangles of a plane, all turned counter-clockwise, without edges that cancel; shape (n, 3, 2)."""
    chain: Counter[Edge] = Counter()
    for a, b, c in triangles.tolist():
        corners = [tuple(a), tuple(b), tuple(c)] if turn(a, b, c) > 0 else [tuple(a), tuple(c), tuple(b)]
        chain.update(zip(corners, corners[1:] + corners[:1], strict=True))
    return [(a, b) for (a, b), count in chain.items() for _ in range(count - chain.get((b, a), 0))]


def section(triangles: np.ndarray, axis: int, plane: int, *, below: bool) -> list[Edge]:
    """Directed edges of the section of a closed surface just below or just above an axial plane, in the limit.

    Args:
        triangles: [grid steps], shape (m, 3, 3), integers.
        axis: perpendicular to the plane.
        plane: its coordinate.
        below: which of the two sections.
    """
    heights = triangles[:, :, axis]
    above = heights >= plane if below else heights > plane
    cut = above.any(axis=1) & ~above.all(axis=1)
    edges = []
    for triangle, upper in zip(triangles[cut].tolist(), above[cut].tolist(), strict=True):
        # A triangle is left through one edge that goes down and entered through one that goes up.
        ends: list[Point] = [(), ()]
        for i in range(3):
            if upper[i - 1] != upper[i]:
                # From the lower end, so that both triangles of an edge find the same point.
                p, q = (triangle[i], triangle[i - 1]) if upper[i - 1] else (triangle[i - 1], triangle[i])
                met = between(p, q, Fraction(plane - p[axis], q[axis] - p[axis]))
                ends[upper[i]] = met[:axis] + met[axis + 1 :]
        if ends[0] != ends[1]:
            edges.append((ends[0], ends[1]))
    return edges


def bounds_disc(triangles: np.ndarray, outline: list[list[int]]) -> bool:
    """Whether the boundary of some triangles, all turned the outline's way, is the outline.

    An edge of the outline may be a chain of edges along it. Gluing is not looked at: a curve that bounds triangles
    which miss a line cannot wind round that line, however they hang together.

    Args:
        triangles: [grid steps], shape (n, 3, 3), integers.
        outline: corners.
    """
    about = area_vector(outline)
    chain: Counter[tuple[tuple[int, ...], tuple[int, ...]]] = Counter()
    for triangle in triangles.tolist():
        a, b, c = (tuple(p) for p in triangle)
        if dot(cross(minus(b, a), minus(c, a)), about) < 0:
            b, c = c, b
        for edge in ((a, b), (b, c), (c, a)):
            if chain[edge[::-1]]:
                chain[edge[::-1]] -= 1
            else:
                chain[edge] += 1
    following: dict[tuple[int, ...], list[tuple[int, ...]]] = {}
    for (a, b), count in chain.items():
        following.setdefault(a, []).extend([b] * count)
    for i, end in enumerate(outline):
        here = tuple(outline[i - 1])
        while here != tuple(end):
            ahead = [p for p in following.get(here, []) if _on_segment(p, here, end)]
            if not ahead:
                return False
            following[here].remove(ahead[0])
            here = ahead[0]
    return not any(following.values())


def area_vector(outline: list[list[int]]) -> list[int]:
    """Twice the area vector of a closed outline; 0 for one that lies on a line."""
    spokes = [minus(p, outline[0]) for p in outline]
    return [sum(column) for column in zip(*(cross(a, b) for a, b in pairwise(spokes)), strict=True)]


def _on_segment(p: Sequence[int], a: Sequence[int], b: Sequence[int]) -> bool:
    """Whether p lies on ab, behind a."""
    along, way = minus(b, a), minus(p, a)
    return not any(cross(along, way)) and 0 < dot(along, way) <= dot(along, along)
