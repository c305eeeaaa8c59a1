"""One setting tried once: what a bake would compute from some of its view cells, and the time that takes."""

import tempfile
import time
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...data.errors import InputError
from ...data.graph import CellGraph
from ...data.prepared import PreparedModel
from ...data.progress import phase
from ...data.rows import Rows
from ...data.scene import Scene
from ...data.view_cells import as_graph
from ..bake.blocks import Store, Work, in_blocks, refine
from ..bake.cells import Sources, model_sources
from ..bake.manifest import Clock
from ..bake.run import engine_of
from ..bake.settings import Settings

if TYPE_CHECKING:
    from ...kernels.launch import Device

# So many view cells of a sample are timed apart.
FIRST = 2


@dataclass(frozen=True)
class Answer:
    """What a setting says of the view cells that were tried; it is the same at every try.

    Attributes:
        scene: the model.
        graph: its cells; those that were tried are inhabitable.
        cracks: openings that a seal closed, flat boxes [grid steps], shape (n, 2, 3), int32.
        objects: objects that are not proved hidden from them.
        cell_pairs: how many cells are not; None where nothing is claimed of cells.
    """

    scene: Scene
    graph: CellGraph
    cracks: np.ndarray
    objects: Rows
    cell_pairs: int | None

    @cached_property
    def potential(self) -> np.ndarray:
        """Potentially visible objects, shape (cells, objects), bool."""
        out = np.zeros((self.graph.cell_count, len(self.scene.objects)), bool)
        out[self.objects.source, self.objects.target] = True
        return out

    def same_cells(self, other: "Answer") -> bool:
        """Whether both speak of the same view cells, under the same numbers."""
        names = "cells", "inhabitable"
        mine, others = self.graph.plans.corners, other.graph.plans.corners
        return np.array_equal(mine, others) and all(
            np.array_equal(getattr(self.graph, name), getattr(other.graph, name)) for name in names
        )


@dataclass(frozen=True)
class Trial:
    """A setting tried once.

    Attributes:
        seconds: about what all its view cells take, without reading the model and compiling; at least, if it was
            stopped.
        answer: None if it was stopped, because it took too long.
    """

    seconds: float
    answer: Answer | None


def sources_of(scene: Scene, settings: Settings, sample: np.ndarray | None = None) -> tuple[Sources, int]:
    """Cells of a model, of which those are inhabitable that are to be tried, and how many of all are left out.

    Args:
        scene: the model; nothing that was prepared of it before is used.
        settings: of a bake.
        sample: boxes to look from [grid steps], shape (n, 2, 3); view cells that share space with one are tried. All
            if it is None.

    Raises:
        InputError: cells that cannot be had of this model, or none to look from.
    """
    sources = model_sources(PreparedModel(scene), settings, Clock())
    every = sources.graph.inhabitable
    chosen = every & (True if sample is None else _overlap(sources.graph.cells, sample))
    if not chosen.any():
        raise InputError(f"{scene.source or 'scene'}: expected at least one inhabitable cell, found none")
    # Cells of an octree are refined into lists of their own, which leave nothing out.
    graph = sources.graph
    sources.graph = as_graph(graph.cells[chosen]) if sources.octree else replace(graph, inhabitable=chosen)
    return sources, int(every.sum() - chosen.sum())


def run_trial(
    scene: Scene, settings: Settings, device: "Device", sample: np.ndarray | None = None, most_s: float = np.inf
) -> Trial:
    """Try a setting as a bake would, from the model on.

    Args:
        scene: the model.
        settings: of a bake.
        device: where to.
        sample: as of `sources_of`.
        most_s: stop it when all view cells would take longer than this.

    Raises:
        InputError: as of `sources_of`.
    """
    start = time.perf_counter()
    sources, left = sources_of(scene, settings, sample)
    engine = engine_of(sources, settings, device)
    prepared_s = time.perf_counter() - start
    engine.compile()
    clock = _Clock(most_s - prepared_s, left)
    parts = []
    for block in _blocks(sources, left):
        parts.append(engine.visible(block))
        clock.add(len(block))
        if clock.late:
            return Trial(prepared_s + clock.all_s, None)
    if sources.octree:
        with tempfile.TemporaryDirectory() as scratch, phase("octree", 0, "cell") as bar:
            work = Work(engine, device, Store(Path(scratch)), bar, clock.deadline, clock.start, sources.objects)
            parts, short = refine(sources, work, parts, settings)
            engine = work.engine
        clock.add(0)
        if short is not None:
            return Trial(prepared_s + clock.all_s, None)
    cells, objects = engine.join(parts)
    clock.add(0)
    cracks = np.zeros((0, 2, 3), np.int32) if sources.closed is None else sources.closed.portals
    answer = Answer(scene, sources.graph, cracks, objects, None if cells is None else len(cells))
    return Trial(prepared_s + clock.all_s, answer)


def _blocks(sources: Sources, left: int) -> list[np.ndarray]:
    """View cells as a bake takes them; where some are left out, the first few are apart."""
    blocks = in_blocks(sources)
    if not left or len(blocks[0]) <= FIRST:
        return blocks
    return [blocks[0][:FIRST], blocks[0][FIRST:], *blocks[1:]]


class _Clock:
    """What view cells that are tried take, and from it what all of them would.

    What is made when it is first needed is paid by the first few: those that are left out take as long as later ones.
    """

    def __init__(self, most_s: float, left: int) -> None:
        self.start = time.perf_counter()
        self._most_s, self._left, self._first_s = most_s, left, 0.0
        self._spent_s, self._cells, self._first = 0.0, 0, 0

    def add(self, cells: int) -> None:
        """So many more are done."""
        self._spent_s = time.perf_counter() - self.start
        self._cells += cells
        if not self._first:
            self._first_s, self._first = self._spent_s, cells

    @property
    def all_s(self) -> float:
        """For all view cells."""
        later = self._cells - self._first
        each_s = (self._spent_s - self._first_s) / later if later else self._spent_s / max(1, self._cells)
        return self._spent_s + self._left * each_s

    @property
    def late(self) -> bool:
        """Whether later cells have shown that all would take too long."""
        return self._cells > self._first and self.all_s > self._most_s

    @property
    def deadline(self) -> float:
        """When those that are tried have taken too long, of `time.perf_counter`."""
        return self.start + self._most_s * self._cells / (self._cells + self._left)


def _overlap(boxes: np.ndarray, sample: np.ndarray) -> np.ndarray:
    """Boxes that share space with one of the sample, shape (n,), bool."""
    out = np.zeros(len(boxes), bool)
    for low, high in sample:
        out |= ((boxes[:, 0] < high) & (boxes[:, 1] > low)).all(axis=1)
    return out
