"""Sightlines shot from view cells: a model's triangles and solids on a device, ready to be aimed at."""

import time
from dataclasses import dataclass, replace
from functools import cached_property
from threading import Lock

import numpy as np
from embreex.rtcore_scene import EmbreeScene

from ...data.plans import NO_PLANS, Plans
from ...data.prepared import PreparedModel
from ...data.rows import Rows
from ...data.scene import OPAQUE
from ...data.solids import SolidIndex
from ...kernels.aim import launch_aim
from ...kernels.launch import Device
from ...kernels.sightline import Triangles, device_triangles, launch_confirm
from .finder import Finder
from .first_hits import FirstHits

# Sightlines aimed at each object before anything is proved: most visible objects fall to the first few; then at each
# that is left, round by round.
FIRST_TRIES = 12
AIM_ROUNDS = (32, 128, 1024)
# Triangles of the first objects that tell how long all take, of models that have more than LARGE.
TRIAL, LARGE = 100_000, 500_000


class Targets:
    """A model's triangles, as sightlines from all view cells meet them: made when the first one is shot.

    In a model of millions of triangles they take as long as the occluders, and hiding does without.

    Attributes:
        ranges: first and past-the-last triangle of each object, shape (objects, 2).
    """

    def __init__(self, model: PreparedModel, device: Device) -> None:
        """Nothing is made yet."""
        starts = model.scene.triangle_starts
        self.ranges = np.column_stack([starts[:-1], starts[1:]])
        self._model, self._device, self._making = model, device, Lock()
        self._made: tuple[Triangles, Finder] | None = None

    @property
    def made(self) -> tuple[Triangles, Finder]:
        """Triangles on the device, and on the CPU what finds sightlines that may be clear; made by one thread."""
        self.make()
        return self._made

    @property
    def opaque(self) -> EmbreeScene | None:
        """Opaque triangles in Embree, in their order, if they are made."""
        return None if self._made is None else self._made[1].scene

    def make(self, seconds: float = np.inf) -> bool:
        """Make them unless that should take longer, as the first objects tell; returns whether they are made."""
        with self._making:
            if self._made is None:
                started, count = time.perf_counter(), int(self.ranges[-1:, 1].sum())
                trial = int(np.searchsorted(self.ranges[:, 1], TRIAL)) + 1
                if seconds < np.inf and count > LARGE:
                    self._of_first(trial)
                    share = self.ranges[trial - 1, 1] / count
                    if (time.perf_counter() - started) / share > seconds:
                        return False
                self._made = self._of_first(len(self.ranges))
            return True

    def _of_first(self, count: int) -> tuple[Triangles, Finder]:
        """As `made`, of so many objects."""
        scene = self._model.scene
        last, models = int(self.ranges[:count, 1].max(initial=0)), scene.first_alike[:count]
        everything, owners = (column[:last] for column in scene.triangles())
        opaque = scene.object_mask(*OPAQUE)[owners]
        triangles = device_triangles(everything, owners, self._device, opaque=opaque, models=models)
        return triangles, Finder(everything, owners, opaque, self._device, models)


@dataclass
class Sights:
    """What sightlines from some view cells meet.

    Attributes:
        model: the model.
        cells: view cells [grid steps], shape (cells, 2, 3), int32; they may overlap each other and solids.
        targets: triangles of all objects.
        plans: of view cells that stand at an angle: eyes are inside them.
        seed: of the random sightlines.
        device: that holds the triangles.
    """

    model: PreparedModel
    cells: np.ndarray
    targets: Targets
    plans: Plans
    seed: int
    device: Device

    @classmethod
    def of(
        cls, model: PreparedModel, cells: np.ndarray, seed: int, device: Device, plans: Plans = NO_PLANS
    ) -> "Sights":
        """Of a model, whose triangles are copied to the device when they are first asked."""
        return cls(model, cells, Targets(model, device), plans, seed, device)

    @property
    def triangles(self) -> Triangles:
        """Of all objects."""
        return self.targets.made[0]

    @property
    def finder(self) -> Finder:
        """Of sightlines that may be clear, on the CPU."""
        return self.targets.made[1]

    @property
    def ranges(self) -> np.ndarray:
        """First and past-the-last triangle of each object, shape (objects, 2)."""
        return self.targets.ranges

    @cached_property
    def solids(self) -> SolidIndex:
        """Closed elements by view cell."""
        return SolidIndex(self.cells, self.model.closed)

    def from_cells(self, cells: np.ndarray) -> "Sights":
        """The same from other view cells, which stand along the axes."""
        return replace(self, cells=cells, plans=NO_PLANS)

    def outside(self, source: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Points in their cells' boxes that are eyes: within the plan, certainly outside every solid, (n,), bool."""
        free = self.solids.outside(points, source)
        return free & self.plans.hold(source, points, len(self.cells))

    def clear(self, source: np.ndarray, origin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Segments that start outside every solid and certainly clear every opaque triangle, shape (n,), bool."""
        ok = launch_confirm(self.triangles, origin, end, np.full(len(origin), -1), device=self.device)
        rows = np.flatnonzero(ok)
        ok[rows] = self.outside(source[rows], origin[rows])
        return ok

    def aim(
        self,
        rows: Rows,
        pairs: np.ndarray,
        boxes: np.ndarray,
        hints: np.ndarray,
        streams: np.ndarray,
        tries: int,
        number: int,
    ) -> None:
        """Shoot at the objects of pairs; shows those that are hit, in place.

        A witness ends on the object, starts outside every solid, and clears all opaque triangles but the object's.

        Args:
            rows: all pairs.
            pairs: row of each attempt; a pair may be attempted through several boxes.
            boxes: aim at the part of the object inside this box; ignored in round 0.
            hints: ends of a line that the axial model allows [grid steps], shape (n, 2, 3).
            streams: what tells the random streams of one source apart, shape (n,), int.
            tries: sightlines per attempt.
            number: of the round.
        """
        if not len(pairs):
            return
        source, target = rows.source[pairs], rows.target[pairs]
        # A GPU confirms all as fast as they are found.
        guide = FirstHits(self.finder, rows, pairs, self.serve) if self.device.is_cpu else None
        found, origin, end = launch_aim(
            self.triangles,
            self.cells[source],
            boxes,
            hints,
            np.column_stack([target, self.ranges[target]]),
            seeds(self.seed + 101 * (number + 1), source, streams),
            np.full(len(pairs), number > 0),
            tries=tries,
            boxed=number > 0,
            plans=self.plans.take(source, len(self.cells)),
            guide=guide,
            device=self.device,
        )
        self._show(rows, pairs[found], origin[found], end[found])

    def _show(self, rows: Rows, pairs: np.ndarray, origin: np.ndarray, end: np.ndarray) -> None:
        """Show pairs by clear sightlines, those that start at an eye, in place."""
        good = np.flatnonzero(self.outside(rows.source[pairs], origin))
        rows.show(pairs[good], origin[good], end[good])

    def serve(self, rows: Rows, pairs: np.ndarray, triangle: np.ndarray, origin: np.ndarray, end: np.ndarray) -> None:
        """Show pairs by sightlines to triangles of their objects, where those are clear, in place."""
        options = {"ranges": triangle[:, None] + [0, 1], "device": self.device}
        good = launch_confirm(self.triangles, origin, end, rows.target[pairs], **options)
        self._show(rows, pairs[good], origin[good], end[good])


def seeds(seed: int | np.ndarray, source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """A random stream for each pair that depends on nothing else, shape (n,), int32."""
    mixed = source.astype(np.uint64) * 0x9E3779B1 + target.astype(np.uint64) * 0x85EBCA77
    mixed = (mixed + np.asarray(seed, np.uint64) * np.uint64(0xC2B2AE3D)) & np.uint64(0x7FFFFFFF)
    return mixed.astype(np.int32)


def middles(cells: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Line from the middle of each view cell to that of the box of its row, shape (n, 2, 3), float64."""
    return np.stack([cells.mean(axis=1), boxes.mean(axis=1)], axis=1)
