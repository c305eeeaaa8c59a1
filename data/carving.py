"""How the faces of occluders stand to the axes, and how near to them walls come that miss them.

Source: Lei and Ouhyoung, "Carving: a novel method of visibility preprocessing for un-restricted three-dimensional
environments". Section 1: a polygon is axial if its normal and edges are parallel to the axes; section 3: it is
semi-axial if it is not axial, but a rectangle with edges either parallel or perpendicular to the floor, and non-axial
otherwise; section 4.1: non-axial elements are non-axial polygons connected by edges that are not axial, non-axial
clusters those connected by any.

A face is what triangles of one object make that share edges and lie in one plane, within a step where they are not
axial: snapping bends what is oblique. Several rectangles that make one polygon with right angles count as one. The rest
is decided in integers.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from .scene import Role, Scene

AXIAL, SEMI_AXIAL, NON_AXIAL = range(3)
# How far a wall misses its axis [grid steps]: exactly along it, what snapping does, what exporters do, and the rest.
BANDS = (0, 3, 40)
# A wall whose normal leans off an axis by more than one in so many is not meant to stand along it.
MEANT = 100
# A face is upright if its normal rises by no more than one in so many.
UPRIGHT = 50


@dataclass(frozen=True)
class Faces:
    """Faces of a model's occluders by how they stand.

    Attributes:
        counts: axial, semi-axial and non-axial faces.
        areas_m2: of each.
        elements: non-axial elements.
        clusters: non-axial clusters.
        walls_m2: area of upright faces: exactly along an axis, up to 3 grid steps off it, up to 40, more, and those
            that are not meant to stand along one.
    """

    counts: tuple[int, int, int]
    areas_m2: tuple[float, float, float]
    elements: int
    clusters: int
    walls_m2: tuple[float, float, float, float, float]

    @property
    def shares(self) -> list[float]:
        """Of the area of all faces; zeros without any."""
        return [area / max(sum(self.areas_m2), 1e-30) for area in self.areas_m2]

    @property
    def wall_shares(self) -> list[float]:
        """Of the area of upright faces; zeros without any."""
        return [area / max(sum(self.walls_m2), 1e-30) for area in self.walls_m2]


def find_faces(scene: Scene) -> Faces:
    """Faces of the occluders of a model."""
    triangles, owners = scene.triangles(Role.OCCLUDER)
    if not len(triangles):
        return Faces((0, 0, 0), (0.0, 0.0, 0.0), 0, 0, (0.0,) * 5)
    triangles = triangles.astype(np.int64)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(normals.astype(float), axis=1) / 2 * scene.grid_m**2
    edges = _Edges(triangles, owners)
    face = _faces(triangles, normals, edges)
    kinds = face_kinds(triangles, normals, face, edges)
    elements, clusters = _groups(face, kinds, edges)
    areas = np.bincount(kinds[face], area, minlength=3)
    return Faces(
        tuple(np.bincount(kinds, minlength=3).tolist()),
        tuple(areas.tolist()),
        elements,
        clusters,
        _walls(triangles, normals, face, area),
    )


class _Edges:
    """Edges of triangles, in order of their place in space.

    Attributes:
        triangle: that each edge bounds, shape (3 m,), int64.
        vector: from one end to the other, shape (3 m, 3), int64.
        place: the same for edges of one object between the same corners, shape (3 m,), ascending.
    """

    def __init__(self, triangles: np.ndarray, owners: np.ndarray) -> None:
        count = len(triangles)
        keys = np.column_stack([np.repeat(owners, 3), triangles.reshape(-1, 3)])
        _, corner = np.unique(keys, axis=0, return_inverse=True)
        corner = corner.reshape(count, 3).astype(np.int64)
        start, end = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
        _, place = np.unique(np.minimum(start, end) * (corner.max() + 1) + np.maximum(start, end), return_inverse=True)
        order = np.argsort(place.ravel(), kind="stable")
        self.place, self.triangle = place.ravel()[order], order // 3
        self.vector = (np.roll(triangles, -1, axis=1) - triangles).reshape(-1, 3)[order]

    @property
    def axial(self) -> np.ndarray:
        """Whether each is parallel to an axis."""
        return (self.vector != 0).sum(axis=1) == 1

    def neighbours(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Triangles before and behind an edge, and the edge; of more than two all are joined in turn."""
        first = np.flatnonzero(self.place[:-1] == self.place[1:])
        return self.triangle[first], self.triangle[first + 1], first


def _label(count: int, a: np.ndarray, b: np.ndarray) -> tuple[int, np.ndarray]:
    return connected_components(coo_matrix((np.ones(len(a)), (a, b)), (count, count)), directed=False)


def _faces(triangles: np.ndarray, normals: np.ndarray, edges: _Edges) -> np.ndarray:
    """Face of each triangle, numbered from 0."""
    a, b, _ = edges.neighbours()
    flat = (normals != 0).sum(axis=1) == 1
    same = (flat[a] == flat[b]) & ((normals[a].astype(float) * normals[b]).sum(axis=1) > 0)
    for one, other in ((a, b), (b, a)):
        # A step along each axis; in float64, whose rounding is far below it.
        off = np.abs(((triangles[other] - triangles[one, :1]) * normals[one, None].astype(float)).sum(axis=2)).max(
            axis=1
        )
        same &= off <= np.where(flat[one], 0.0, np.abs(normals[one]).sum(axis=1))
    return _label(len(triangles), a[same], b[same])[1]


def face_kinds(triangles: np.ndarray, normals: np.ndarray, face: np.ndarray, edges: _Edges) -> np.ndarray:
    """AXIAL, SEMI_AXIAL or NON_AXIAL of each face."""
    count = int(face.max()) + 1
    # Edges between triangles of one face are none of its own.
    keys, first, uses = np.unique(
        np.column_stack([face[edges.triangle], edges.place]), axis=0, return_index=True, return_counts=True
    )
    own, of = first[uses % 2 == 1], keys[uses % 2 == 1, 0]
    vector, axial_edge = edges.vector[own], edges.axial[own]

    def every(of_edge: np.ndarray) -> np.ndarray:
        return np.bincount(of[~of_edge], minlength=count) == 0

    def each(of_triangle: np.ndarray) -> np.ndarray:
        return np.bincount(face[~of_triangle], minlength=count) == 0

    axial = each((normals != 0).sum(axis=1) == 1) & every(axial_edge)
    level, upright = each((normals[:, :2] == 0).all(axis=1)), each(normals[:, 2] == 0)
    stands = every((vector[:, 2] == 0) | (vector[:, :2] == 0).all(axis=1))
    # The longest edge of a face says which way its right angles would lie; corners may be off by half a step.
    length = np.abs(vector).sum(axis=1)
    longest = np.zeros(count, np.int64)
    order = np.argsort(length, kind="stable")
    longest[of[order]] = order
    base = vector[longest[of]]
    along = np.abs(base[:, 0] * vector[:, 1] - base[:, 1] * vector[:, 0])
    across = np.abs((base[:, :2] * vector[:, :2]).sum(axis=1))
    squared = every(np.minimum(along, across) <= np.abs(base).sum(axis=1) + length + 2)
    semi = ~axial & ((upright & stands) | (level & squared))
    return np.where(axial, AXIAL, np.where(semi, SEMI_AXIAL, NON_AXIAL))


def _groups(face: np.ndarray, kinds: np.ndarray, edges: _Edges) -> tuple[int, int]:
    """Number of non-axial elements and clusters."""
    oblique = kinds == NON_AXIAL
    a, b, edge = edges.neighbours()
    a, b = face[a], face[b]
    both = oblique[a] & oblique[b] & (a != b)
    found = []
    for joined in (both & ~edges.axial[edge], both):
        _, group = _label(len(kinds), a[joined], b[joined])
        found.append(len(np.unique(group[oblique])))
    return found[0], found[1]


def _walls(triangles: np.ndarray, normals: np.ndarray, face: np.ndarray, area: np.ndarray) -> tuple[float, ...]:
    """Area of upright faces by how far they miss an axis."""
    count = int(face.max()) + 1
    rise, flat = np.abs(normals[:, 2]), np.abs(normals[:, :2])
    upright = UPRIGHT * rise <= np.linalg.norm(normals.astype(float), axis=1)
    axis = flat.argmax(axis=1)
    rows = np.arange(len(triangles))
    # How far a whole face reaches along the axis that it looks along, by the way its first triangle looks.
    first = np.zeros(count, np.int64)
    first[face[::-1]] = rows[::-1]
    along = triangles[rows, :, axis[first[face]]]
    low, high = np.full(count, along.max()), np.full(count, along.min())
    np.minimum.at(low, face, along.min(axis=1))
    np.maximum.at(high, face, along.max(axis=1))
    off = (high - low)[face]
    leans = MEANT * np.maximum(flat.min(axis=1), rise) > flat.max(axis=1)
    band = np.where(leans & (off > BANDS[1]), len(BANDS) + 1, np.searchsorted(BANDS, off))
    return tuple(np.bincount(band[upright], area[upright], minlength=len(BANDS) + 2).tolist())
