"""Faults in a model's surfaces: what is open, turned inside out, or there twice; and the way its walls run.

Nothing is repaired here. Exact on the grid, but for areas, which are float64, and overlaps, which are looked for where
two objects lie in one axial plane or share a triangle.
"""

from collections import defaultdict
from dataclasses import dataclass, field

import numpy as np
import shapely

from ...data.graph import OTHER_AXES
from ...data.prepared import PreparedModel
from ...data.scene import OPAQUE, Role, Scene

# Models with more opaque triangles are not looked through for coplanar overlaps.
OVERLAP_TRIANGLES = 400_000
# Overlaps below this are where walls meet.
OVERLAP_M2 = 0.05
# A face is upright if its normal rises by no more than this share; directions are counted in steps of so many degrees,
# and belong to the dominant one within so many steps.
UPRIGHT, STEP_DEG, NEAR_STEPS = 0.02, 0.25, 2


@dataclass
class OpenObject:
    """An opaque object whose surface is not closed.

    Attributes:
        object_id: place in `Scene.objects`.
        area_m2: of its triangles.
        edges: directed edges without their opposite.
        turned: all of them are joined by triangles that face the wrong way: the surface is whole.
    """

    object_id: int
    area_m2: float
    edges: int
    turned: bool


@dataclass
class Surfaces:
    """What was found.

    Attributes:
        closed: number of closed opaque objects.
        inverted: ids of closed objects whose faces look inwards.
        open: opaque objects that are not closed, largest area first.
        repeated: triangles that an object has more than once.
        twins: groups of ids of objects with the same triangles.
        overlaps: (object a, object b, area [m2]) of coplanar faces that look the same way, largest first; None where
            the model is too large to look.
    """

    closed: int = 0
    inverted: list[int] = field(default_factory=list)
    open: list[OpenObject] = field(default_factory=list)
    repeated: int = 0
    twins: list[list[int]] = field(default_factory=list)
    overlaps: list[tuple[int, int, float]] | None = field(default_factory=list)


@dataclass(frozen=True)
class Directions:
    """Which way upright opaque faces look, as shares of their area.

    Attributes:
        axial: exactly along x or y.
        yaw_deg: from the x axis, 0 to 90, of the direction, or its right angle, that most of the others look in.
        yaw: within half a degree of that.
    """

    axial: float
    yaw_deg: float
    yaw: float

    @property
    def other(self) -> float:
        """In other directions."""
        return max(0.0, 1.0 - self.axial - self.yaw)


def find_surfaces(model: PreparedModel) -> Surfaces:
    """Look through the opaque objects of a model."""
    scene = model.scene
    found = Surfaces(closed=len(model.closed))
    found.inverted = [object_id for object_id, triangles in model.closed if _volume(triangles) < 0]
    triangles, _ = scene.triangles()
    starts, closed = scene.triangle_starts, {object_id for object_id, _ in model.closed}
    same = defaultdict(list)
    for object_id in range(len(scene.objects)):
        part = triangles[starts[object_id] : starts[object_id + 1]]
        if not len(part):
            continue
        sets = _as_sets(part)
        found.repeated += len(part) - len(sets)
        same[sets.tobytes()].append(object_id)
        if scene.objects[object_id].opaque and object_id not in closed:
            edges, turned = _unpaired(part)
            found.open.append(OpenObject(object_id, float(_areas(part, scene.grid_m).sum()), edges, turned))
    found.open.sort(key=lambda one: -one.area_m2)
    found.twins = [ids for ids in same.values() if len(ids) > 1]
    opaque = scene.triangles(*OPAQUE)
    found.overlaps = _overlaps(scene, *opaque) if len(opaque[0]) <= OVERLAP_TRIANGLES else None
    return found


def find_directions(scene: Scene) -> Directions | None:
    """Which way the upright faces of occluders look; None if there are none."""
    triangles, _ = scene.triangles(Role.OCCLUDER)
    edges = (triangles[:, 1:] - triangles[:, :1]).astype(np.int64)
    normals = np.cross(edges[:, 0], edges[:, 1])
    length = np.linalg.norm(normals.astype(float), axis=1)
    upright = np.abs(normals[:, 2]) <= UPRIGHT * length
    normals, length = normals[upright], length[upright]
    if not len(length):
        return None
    axial = (normals[:, 2] == 0) & ((normals[:, 0] == 0) | (normals[:, 1] == 0))
    degrees = np.degrees(np.arctan2(normals[:, 1].astype(float), normals[:, 0])) % 90.0
    bins = round(90.0 / STEP_DEG)
    slot = np.round(degrees / STEP_DEG).astype(int) % bins
    weight = np.bincount(slot[~axial], length[~axial], minlength=bins)
    near = sum(np.roll(weight, shift) for shift in range(-NEAR_STEPS, NEAR_STEPS + 1))
    best = int(near.argmax())
    total = length.sum()
    return Directions(float(length[axial].sum() / total), best * STEP_DEG, float(near[best] / total))


def _volume(triangles: np.ndarray) -> float:
    a, b, c = (triangles[:, i].astype(float) for i in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def _areas(triangles: np.ndarray, grid_m: float) -> np.ndarray:
    edges = (triangles[:, 1:] - triangles[:, :1]).astype(float) * grid_m
    return np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2


def _as_sets(triangles: np.ndarray) -> np.ndarray:
    """Each triangle once, whichever way round it was written, in an order that depends on nothing else."""
    order = np.lexsort(triangles.transpose(2, 0, 1)[::-1], axis=-1)
    flat = np.take_along_axis(triangles, order[:, :, None], axis=1).reshape(-1, 9)
    return np.unique(flat, axis=0)


def _unpaired(triangles: np.ndarray) -> tuple[int, bool]:
    """Directed edges without their opposite, and whether each of them is joined to a triangle that faces otherwise."""
    _, corner = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    corner = corner.reshape(-1, 3).astype(np.int64)
    start, end = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    _, place = np.unique(low * (corner.max() + 1) + high, return_inverse=True)
    balance, uses = np.zeros(place.max() + 1, int), np.bincount(place)
    np.add.at(balance, place, np.where(start < end, 1, -1))
    return int(np.abs(balance).sum()), bool((uses % 2 == 0).all())


def _overlaps(scene: Scene, triangles: np.ndarray, owners: np.ndarray) -> list[tuple[int, int, float]]:
    """Pairs of objects with faces in one axial plane that look the same way and overlap."""
    found: dict[tuple[int, int], float] = defaultdict(float)
    edges = (triangles[:, 1:] - triangles[:, :1]).astype(np.int64)
    normals = np.cross(edges[:, 0], edges[:, 1])
    for axis in range(3):
        u, v = OTHER_AXES[axis]
        flat = np.flatnonzero((normals[:, u] == 0) & (normals[:, v] == 0))
        planes = np.stack([triangles[flat, 0, axis], np.sign(normals[flat, axis])], axis=1)
        _, group = np.unique(planes, axis=0, return_inverse=True)
        order = np.argsort(group.ravel(), kind="stable")
        for rows in np.split(flat[order], np.flatnonzero(np.diff(group.ravel()[order])) + 1):
            _plane_overlaps(triangles[rows][:, :, [u, v]], owners[rows], found)
    pairs = [(a, b, area * scene.grid_m**2) for (a, b), area in found.items()]
    return sorted((pair for pair in pairs if pair[2] >= OVERLAP_M2), key=lambda pair: (-pair[2], pair[:2]))


def _plane_overlaps(triangles: np.ndarray, owners: np.ndarray, found: dict[tuple[int, int], float]) -> None:
    """Add the area that faces of two objects share, for triangles (m, 3, 2) of one plane."""
    mine, first = np.unique(owners, return_index=True)
    if len(mine) < 2:
        return
    shapes = shapely.polygons(triangles.astype(float))
    faces = [shapely.union_all(shapes[owners == owner]) for owner in mine[np.argsort(first)]]
    ids = mine[np.argsort(first)]
    tree = shapely.STRtree(faces)
    a, b = tree.query(faces, predicate="intersects")
    a, b = a[a < b], b[a < b]
    areas = shapely.area(shapely.intersection(np.array(faces)[a], np.array(faces)[b]))
    for i, j, area in zip(ids[a].tolist(), ids[b].tolist(), areas.tolist(), strict=True):
        found[min(i, j), max(i, j)] += area
