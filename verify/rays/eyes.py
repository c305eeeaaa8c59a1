"""What random eyes in view cells see, against what the cells keep: what a culler of every frame could still gain.

An eye sees an object where a ray aimed at it arrives, through transparent objects. Rays that are aimed at what a cell
keeps find more than even ones: on the default office 8 rounds, 1,139 rays an eye, see 10 % more than 65,536 even rays.
"""

from dataclasses import dataclass

import numpy as np
from embreex.rtcore_scene import EmbreeScene

from ...data.graph import CellGraph
from ...data.kept import cell_volumes
from ...data.plans import NO_PLANS, Plans
from ...data.scene import OPAQUE, Role, Scene
from ...data.solids import SolidIndex
from ..exact.plan import inside_plans
from .embree import embree_scene, lattice_points

# Cells measured at most, and eyes in each.
CELLS_MOST, EYES = 32, 64
# Eyes are drawn so many times over, because some fall into solids.
DRAWN = 4
# Objects of a cell that are looked at; where it keeps more, a random part stands for all.
OBJECTS_MOST = 512
# Rounds of rays at what an eye has not seen yet: as many as RAYS_MOST in all allow, within these.
ROUNDS = (3, 8)
RAYS_MOST = 1_000_000
# From this round on objects that no eye has seen are tried every so many rounds only.
DOUBT, SELDOM = 4, 4
# A transparent object is seen unless something opaque stands before this share of the way to it.
ARRIVED = np.float32(1 - 1e-5)


@dataclass(frozen=True)
class EyeSample:
    """Kept objects over what an eye sees, in some view cells.

    Attributes:
        cells: measured, shape (n,), int; those in which no free point was found are left out.
        ratios: objects that the cell keeps over the mean number that an eye in it sees, shape (n,), float64.
        weights: how much of the inhabitable volume each cell stands for, shape (n,), float64.
        eyes: in each cell, at most.
    """

    cells: np.ndarray
    ratios: np.ndarray
    weights: np.ndarray
    eyes: int = EYES

    @property
    def median(self) -> float:
        """The ratio that half of the volume stays below; at least 1."""
        order = np.argsort(self.ratios, kind="stable")
        share = np.cumsum(self.weights[order])
        return float(self.ratios[order[np.searchsorted(share, share[-1] / 2)]])

    @property
    def worst(self) -> int:
        """Place in `cells` of the highest ratio."""
        return int(np.argmax(self.ratios))


def kept_by_eye(
    scene: Scene,
    solids: list[tuple[int, np.ndarray]],
    graph: CellGraph,
    pairs: tuple[np.ndarray, np.ndarray],
    seed: int = 0,
    opaque: EmbreeScene | None = None,
) -> EyeSample | None:
    """Kept objects over those that random eyes see, for at most 32 view cells, drawn by volume.

    The ratio may be too high, as too few rays see too little: it is about 5 % above that of four times as many rounds
    (measured on the default office, Duplex and AC11 Institute), and more where a cell keeps thousands of objects.
    It counts an object that an eye sees any part of; a renderer with pixels may see fewer.

    Args:
        scene: the model.
        solids: its closed opaque elements, as from `closed_elements`; eyes stand outside all of them.
        graph: cells; the inhabitable ones are measured.
        pairs: cell and object of each potential pair, shape (n,) each, int.
        seed: of cells, eyes and rays.
        opaque: all opaque triangles in Embree, in the model's order, if somebody has them there.

    Returns:
        The ratios; None where no cell keeps anything, or has a free point. The same for the same arguments.
    """
    rng = np.random.default_rng(seed)
    cells, weights = _drawn_cells(graph, rng)
    sight = Sight(scene, opaque)
    index = SolidIndex(graph.cells[cells], solids)
    source, target = pairs
    wanted = np.isin(source, cells)
    source, target = source[wanted], target[wanted]
    kept = [target[source == cell] for cell in cells]
    kept = [sight.aimable(own) for own in kept]
    found, left = {}, RAYS_MOST
    # Small sets leave rays to large ones.
    for done, place in enumerate(np.argsort([len(own) for own in kept], kind="stable")):
        eyes = draw_eyes(graph.cells[cells[place]], index, int(place), EYES, rng, graph.plans.of(cells[place]))
        objects = rng.permutation(kept[place])[:OBJECTS_MOST]
        if not len(eyes) or not len(objects):
            continue
        marks, spent = sight.marks(eyes, np.sort(objects), left // (len(kept) - done), rng)
        left -= spent
        # No eye of a cell may see any of what it keeps: then all of it, to one object, is too much.
        found[int(place)] = len(objects) / max(float(marks.sum(axis=1).mean()), 1.0)
    if not found:
        return None
    places = np.array(sorted(found))
    return EyeSample(cells[places], np.array([found[place] for place in places]), weights[places])


def _drawn_cells(graph: CellGraph, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """At most CELLS_MOST inhabitable cells, evenly by volume, and how much volume each stands for."""
    cells = np.flatnonzero(graph.inhabitable)
    volumes = cell_volumes(graph)[cells]
    if len(cells) <= CELLS_MOST:
        return cells, volumes
    ends = np.cumsum(volumes)
    marks = (np.arange(CELLS_MOST) + rng.random()) / CELLS_MOST * ends[-1]
    places, times = np.unique(np.minimum(np.searchsorted(ends, marks), len(cells) - 1), return_counts=True)
    return cells[places], times * ends[-1] / CELLS_MOST


def draw_eyes(
    box: np.ndarray, index: SolidIndex, place: int, count: int, rng: np.random.Generator, plan: Plans = NO_PLANS
) -> np.ndarray:
    """At most so many random points of a box outside every solid [grid steps], shape (n, 3), float32.

    Args:
        box: shape (2, 3).
        index: of the solids by cell.
        place: of the cell in it that holds the box.
        count: points wanted.
        rng: source of randomness.
        plan: of the prism in the box that is meant.
    """
    share = rng.random((DRAWN * count, 3))
    points = (box[0] + share * (box[1] - box[0])).astype(np.float32)
    inside = ((points > box[0]) & (points < box[1])).all(axis=1)
    points = points[inside]
    points = points[inside_plans(plan, np.zeros(len(points), int), points.astype(np.float64))]
    return points[index.outside(points.astype(np.float64), place)][:count]


class Sight:
    """Rays through a model, from eyes to objects."""

    def __init__(self, scene: Scene, opaque: EmbreeScene | None = None) -> None:
        """Build Embree's scenes, of opaque triangles unless they are given."""
        triangles, self._owners = scene.triangles(*OPAQUE)
        glass, self._glass_owners = scene.triangles(Role.TRANSPARENT)
        self._opaque, self._glass = opaque or embree_scene(triangles), embree_scene(glass)
        self._corners, self._starts = scene.triangles()[0], scene.triangle_starts
        self._clear = scene.object_mask(Role.TRANSPARENT)
        edges = (self._corners[:, 1:] - self._corners[:, :1]).astype(np.float64)
        # A little more than nothing, so that every object has somewhere to be aimed at.
        self._areas = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.cross(*edges.swapaxes(0, 1)), axis=1) + 1.0)])

    def aimable(self, objects: np.ndarray) -> np.ndarray:
        """Those of the objects that have triangles."""
        return objects[self._starts[objects + 1] > self._starts[objects]]

    def around(self, eyes: np.ndarray, count: int) -> np.ndarray:
        """Ids, ascending, of the objects that so many even rays from each eye meet first, or through glass."""
        # Every eye has directions of its own.
        origins, along = np.repeat(eyes, count, axis=0), lattice_points(0, len(eyes) * count)
        reach, found = np.full(len(along), 1e30, np.float32), []
        if self._opaque is not None and len(along):
            hits = self._opaque.run(origins, along, output=1)
            hit = hits["primID"] >= 0
            reach[hit] = hits["tfar"][hit]
            found.append(self._owners[hits["primID"][hit]])
        if self._glass is not None and len(along):
            hits = self._glass.run(origins, along, dists=reach)
            found.append(self._glass_owners[hits[hits >= 0]])
        return np.unique(np.concatenate([np.zeros(0, np.int64), *found]))

    def marks(
        self, eyes: np.ndarray, objects: np.ndarray, rays: int, rng: np.random.Generator
    ) -> tuple[np.ndarray, int]:
        """Which of the objects (ascending) each eye sees, shape (eyes, objects), bool, and how many rays that took.

        No more rounds than the given number of rays allows, but at least three.
        """
        marks = np.zeros((len(eyes), len(objects)), bool)
        # Where rays have met an object last: half of the rounds aim there, because other eyes may see that part, too.
        met = np.full((len(objects), 3), np.nan, np.float32)
        spent, least, most = 0, *ROUNDS
        for turn in range(most):
            wanted = ~marks
            if turn >= DOUBT and turn % SELDOM:
                wanted &= ~np.isnan(met[:, 0])
            eye, aim = np.nonzero(wanted)
            if turn >= least and spent + len(eye) > rays:
                break
            ends = self._points(objects[aim], rng)
            if turn % 2:
                ends = np.where(np.isnan(met[aim]), ends, met[aim])
            self._shoot((eyes, eye), (objects, aim), ends, marks, met)
            spent += len(eye)
        return marks, spent

    def _points(self, objects: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """A random point on each object, by area [grid steps], shape (n, 3), float32."""
        low, high = self._areas[self._starts[objects]], self._areas[self._starts[objects + 1]]
        triangle = np.searchsorted(self._areas, low + rng.random(len(objects)) * (high - low), "right") - 1
        triangle = np.clip(triangle, self._starts[objects], self._starts[objects + 1] - 1)
        # Square roots make pairs of uniform numbers even over a triangle.
        root, other = np.sqrt(rng.random(len(objects))), rng.random(len(objects))
        weights = np.stack([1 - root, root * (1 - other), root * other], axis=1)
        return np.einsum("nc,nca->na", weights, self._corners[triangle].astype(np.float64)).astype(np.float32)

    def _shoot(
        self,
        eyes: tuple[np.ndarray, np.ndarray],
        objects: tuple[np.ndarray, np.ndarray],
        ends: np.ndarray,
        marks: np.ndarray,
        met: np.ndarray,
    ) -> None:
        """Cast a ray from each eye to each end; marks what they meet, whatever they were aimed at, and where."""
        (points, eye), (ids, aim) = eyes, objects
        origins, along = points[eye], ends - points[eye]
        length = np.linalg.norm(along, axis=1).astype(np.float32)
        along /= np.maximum(length, np.float32(1e-6))[:, None]
        reach, owner = np.full(len(eye), np.inf, np.float32), np.full(len(eye), -1)
        if self._opaque is not None and len(eye):
            hits = self._opaque.run(origins, along, output=1)
            hit = hits["primID"] >= 0
            reach[hit], owner[hit] = hits["tfar"][hit], self._owners[hits["primID"][hit]]
        place = np.minimum(np.searchsorted(ids, owner), len(ids) - 1)
        ours = ids[place] == owner
        marks[eye[ours], place[ours]] = True
        met[place[ours]] = (origins + along * reach[:, None])[ours]
        through = self._clear[ids[aim]] & (length * ARRIVED <= reach)
        marks[eye[through], aim[through]] = True
        met[aim[through]] = ends[through]
