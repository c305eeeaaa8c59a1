"""What a frame shows: eye-to-object visibility, then a level of detail for each object within the frame's time.

Source: Funkhouser et al. 1996, sections 4.2.1 and 4.2.2.
"""

import time
from dataclasses import dataclass, replace

import numpy as np

from ...data.camera import CameraPath, Screen
from ...data.errors import InputError
from ...data.graph import CellGraph
from ...data.ragged import owners_of, starts_of, take_lists
from ...data.store.walk_folder import WalkFolder
from ...kernels.eye import EyeAnswers, eye_model, launch_eye
from ...kernels.launch import CPU
from ...solvers.levels.benefit import (
    NOTHING,
    Candidates,
    candidates_of,
    importance_of,
    sightings_of,
    tuples_of,
)
from ...solvers.levels.pixel_error import PixelLimit, pixel_levels
from ...solvers.levels.select_frames import Frame, LevelKeeper, frame_problem
from ...solvers.walk.doorways import doorways
from ...solvers.walk.set_items import Shelves
from .far import NONE, FarFaces
from .level_choice import LevelChoice

NO_FACES = np.zeros(0, np.int64)
# A level that deviates by less than this on the screen is good enough.
PIXELS = 1.0


def part_of(path: CameraPath, frames: np.ndarray | slice) -> CameraPath:
    """Some frames of a path."""
    return replace(path, **{name: column[frames] for name, column in vars(path).items()})


def shelves_of(walk: WalkFolder, far: FarFaces, polygon_bytes: int | None = None) -> Shelves:
    """Levels and depth meshes as items, at their sizes in the file or at so many bytes a triangle."""
    faces, sizes = (walk.items[name].to_numpy().astype(np.int64) for name in ("faces", "size"))
    found = far.shelves(*walk.object_items, sizes, faces)
    return found if polygon_bytes is None else replace(found, sizes=polygon_bytes * found.faces)


def level_errors(walk: WalkFolder) -> np.ndarray:
    """Deviation of each level of each object in the scene's metres, in the order of `walk.object_items`.

    A transform stretches an item's `error_m` by at most the spectral norm of its linear part.
    """
    starts, items = walk.object_items
    if not len(items):
        return np.zeros(0)
    linear = np.stack(walk.objects["transform"].to_pylist()).reshape(-1, 4, 4)[:, :3, :3]
    stretch = np.linalg.norm(linear, ord=2, axis=(1, 2)) * (1 + 2.0**-40)
    return walk.items["error_m"].to_numpy()[items] * stretch[owners_of(starts)]


@dataclass(frozen=True)
class Known:
    """Sets of view cells and of doorways.

    Attributes:
        cells: with a set, view cells first, int64.
        starts: members of row r are members[starts[r]:starts[r + 1]].
        members: display ids, ascending in each set, int64.
        potential: objects and cells that may be seen from each cell, shapes (cells, objects) and (cells, cells), bool.
        has: whether each cell has a set, bool.
    """

    cells: np.ndarray
    starts: np.ndarray
    members: np.ndarray
    potential: tuple[np.ndarray, np.ndarray]
    has: np.ndarray

    @classmethod
    def of(cls, walk: WalkFolder) -> "Known":
        """Those of a database."""
        objects, cells = walk.matrices()
        between = doorways(walk.graph, walk.boxes, (objects, cells))
        objects[between.cells], cells[between.cells] = between.objects, between.reached
        rows = np.concatenate([walk.sets["cell_id"].to_numpy().astype(np.int64), between.cells])
        has = np.zeros(walk.graph.cell_count, bool)
        has[rows] = True
        starts = starts_of(objects[rows].sum(axis=1))
        return cls(rows, starts, np.nonzero(objects[rows])[1], (objects, cells), has)


@dataclass(frozen=True)
class Shown:
    """A frame.

    Attributes:
        objects: that the eye may see, ascending, int64; then faces of depth meshes.
        lods: level of each to be drawn, NOTHING for one that is left out, int64.
        pixels: that each covers, about, float64.
        cells: that the eye may see.
        limits: coarsest level of each that is good enough, int64.
        finest_ns: modelled time to draw all at their finest levels.
        chosen_ns: to draw what was chosen.
        switches: objects whose level changed since the frame before.
        dropped: objects for which the frame's time did not suffice.
        seconds: of computing: visibility, and levels.
        row: of the depth meshes that are drawn, or NONE.
        left: triangles at their finest of all that may be seen from the cells that hold the eye, and of what of it does
            not stand on depth meshes.
        mesh_triangles: of the depth meshes that are drawn.
    """

    objects: np.ndarray
    lods: np.ndarray
    pixels: np.ndarray
    cells: int
    limits: np.ndarray
    finest_ns: int
    chosen_ns: int
    switches: int
    dropped: int
    seconds: tuple[float, float]
    row: int
    left: tuple[int, int]
    mesh_triangles: int


class Display:
    """Frames of one path after another."""

    def __init__(self, walk: WalkFolder, screen: Screen, levels: LevelChoice, target_ms: float, far: FarFaces) -> None:
        """Prepare a database.

        Raises:
            InputError: a target that an empty frame does not meet.
        """
        self.screen, self.cost, self._levels, self.far = screen, levels.cost, levels, far
        self._grid_m, self.boxes = walk.grid_m, walk.boxes * walk.grid_m
        self.known = Known.of(walk)
        graph = replace(walk.graph, inhabitable=self.known.has)
        self._eye = eye_model(graph, walk.boxes, walk.grid_m, self.known.potential, CPU)
        self._budget, self._pixels = levels.cost.budget_ns(target_ms), screen.width * screen.height
        kinds = walk.objects["kind"].to_pylist()
        self._benefit = levels.benefit_of(set(kinds))
        self._importance = importance_of(kinds, self._benefit)
        self._errors, (self._starts, items) = level_errors(walk), walk.object_items
        faces, errors = walk.items["faces"].to_numpy()[items], walk.items["error_m"].to_numpy()[items]
        pairs = list(zip(faces.tolist(), errors.tolist(), strict=True))
        shapes = [pairs[a:b] for a, b in zip(self._starts[:-1].tolist(), self._starts[1:].tolist(), strict=True)]
        self.tuples = tuples_of(shapes, list(enumerate(kinds)), self._benefit)
        self._factors = np.array([a.cost_factor for a in self._benefit.algorithms])[self.tuples.algorithm]
        self._keeper = self._new_keeper()
        finest = faces[self._starts[:-1]].astype(np.int64)
        self._set_triangles = np.zeros(len(self.known.has), np.int64)
        self._set_triangles[self.known.cells] = _sums(finest[self.known.members], self.known.starts)
        near_starts, near = far.index.near_lists
        self._near_triangles = _sums(finest[near], near_starts)

    def _new_keeper(self) -> LevelKeeper:
        return LevelKeeper(len(self.boxes), self._levels.choose, self._levels.coherence)

    def begin(self) -> None:
        """A new path: no frame was before its first."""
        self._keeper = self._new_keeper()

    def seen(self, path: CameraPath) -> EyeAnswers:
        """What all eyes of a path may see, at once."""
        return launch_eye(self._eye, path, self.screen)

    def frame(self, path: CameraPath, at: int, holders: np.ndarray) -> Shown:
        """The next frame of a path, whose eye some cells hold.

        Raises:
            InputError: an eye that is not finite.
        """
        begin = time.perf_counter()
        found = launch_eye(self._eye, part_of(path, slice(at, at + 1)), self.screen)
        looked = time.perf_counter()
        row = self.far.row(path.eyes[at], holders)
        shown = self._choose(path, at, self.far.near(row, found.objects.astype(np.int64))[0], row)
        spent = looked - begin, time.perf_counter() - looked
        left = [int(self._set_triangles[holders].max(initial=0))]
        left.append(left[0] if row == NONE else int(self._near_triangles[row]))
        return replace(shown, cells=len(found.cells), seconds=spent, left=tuple(left))

    def _choose(self, path: CameraPath, at: int, objects: np.ndarray, row: int) -> Shown:
        """Levels of the objects that an eye may see as geometry, beside depth meshes of a row."""
        before = min(at, 1)
        pair = part_of(path, slice(at - before, at + 1))
        sightings = sightings_of(self.boxes, pair, self.screen, np.full(len(objects), before), objects)
        objects, eye = sightings.object_id, path.eyes[at]
        candidates = candidates_of(self._importance, self.tuples, sightings, self.screen, self._benefit)
        which = candidates.tuple_id
        costs = self._levels.cost.object_ns(self.tuples.primitives[which], candidates.pixels, self._factors[which])
        limits, faces, far_ns = self.limits(eye, objects), NO_FACES, 0
        if row != NONE:
            limits = np.maximum(limits, self.far.near(row, objects)[1])
            faces = self.far.in_view(row, eye, path.axes()[at], self.screen)
            far_ns = int(
                self._levels.cost.object_ns(self.far.triangles(faces), self._pixels / max(1, len(faces))).sum()
            )
        problem = self._within(frame_problem(sightings, candidates, before), candidates, limits)
        found = self._keeper.choose(problem, candidates, costs, max(0, self._budget - far_ns))
        lods = np.full(len(objects), NOTHING)
        lods[found.sightings] = self.tuples.lod[which[found.picked]]
        own_ns = self._levels.cost.frame_s * (1 + self._levels.cost.margin) * 1e9 + far_ns
        finest = np.maximum.reduceat(costs, candidates.starts[:-1]) if len(objects) else costs
        shown = Shown(
            objects, lods, sightings.pixels, 0, limits, int(own_ns + finest.sum()),
            int(own_ns + costs[found.picked].sum()), found.switches, found.dropped, (0.0, 0.0), row, (0, 0), 0,
        )  # fmt: skip
        return self._with(shown, faces) if len(faces) else shown

    def _with(self, shown: Shown, faces: np.ndarray) -> Shown:
        """A frame with faces of depth meshes, which have one level, and the screen between them."""
        none = np.zeros(len(faces), np.int64)
        return replace(
            shown,
            objects=np.append(shown.objects, faces),
            lods=np.append(shown.lods, none),
            pixels=np.append(shown.pixels, np.full(len(faces), self._pixels / len(faces))),
            limits=np.append(shown.limits, none),
            mesh_triangles=int(self.far.triangles(faces).sum()),
        )

    def in_place(self, path: CameraPath, at: int, holders: np.ndarray, objects: np.ndarray) -> np.ndarray:
        """What is drawn for the objects that a frame's eye may see: near ones, then faces in view of depth meshes."""
        row = self.far.row(path.eyes[at], holders)
        if row == NONE:
            return objects
        faces = self.far.in_view(row, path.eyes[at], path.axes()[at], self.screen)
        return np.append(self.far.near(row, objects)[0], faces)

    def limits(self, eye: np.ndarray, objects: np.ndarray) -> np.ndarray:
        """The coarsest level of each object that is good enough for an eye [m], int64."""
        starts, places = take_lists(self._starts, objects)
        rows = np.column_stack([np.zeros(len(objects), np.int64), np.arange(len(objects))])
        limit = PixelLimit(PIXELS, self.screen)
        cell = np.stack([eye, eye])[None]
        return pixel_levels(cell, self.boxes[objects], self._errors[places], starts, rows, limit).astype(np.int64)

    def cell_limits(self, graph: CellGraph) -> np.ndarray:
        """The coarsest level that is good enough from anywhere in a cell, of each member of all known sets, int64."""
        known, limit = self.known, PixelLimit(PIXELS, self.screen)
        rows = np.column_stack([owners_of(known.starts), known.members])
        cells = graph.cells[known.cells] * self._grid_m
        return pixel_levels(cells, self.boxes, self._errors, self._starts, rows, limit).astype(np.int64)

    def _within(self, problem: Frame, candidates: Candidates, limits: np.ndarray) -> Frame:
        """The problem without levels that are finer than good enough."""
        if not len(problem.sightings):
            return problem
        which, sizes = candidates.tuple_id[problem.candidates], np.diff(problem.starts)
        lod, rank = self.tuples.lod[which], candidates.rank[problem.candidates]
        enough = np.where((lod != NOTHING) & (lod <= np.repeat(limits[problem.sightings], sizes)), rank, 0)
        first = np.maximum.reduceat(enough, problem.starts[:-1])
        return problem.only(rank >= np.repeat(first, sizes))


def _sums(values: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Of lists of values."""
    return np.diff(np.append(0, np.cumsum(values))[starts])


def check_path(walk: WalkFolder, path: CameraPath, holders: tuple[np.ndarray, np.ndarray]) -> None:
    """Refuse eyes that no cell holds.

    Raises:
        InputError: the first such eye.
    """
    lost = np.flatnonzero(np.diff(holders[0]) == 0)
    if len(lost):
        eye = walk.in_model(path.eyes[lost[0]])
        where = ", ".join(f"{c:.3f}" for c in eye)
        raise InputError(
            f"path: expected eyes in cells of the model, found frame {lost[0]} at ({where}) in none"
            f"{f', and {len(lost) - 1} more' if len(lost) > 1 else ''}"
        )
