"""Visibility block by block: each finished block is kept until all are, so that an interrupted bake resumes."""

import hashlib
import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from tqdm import tqdm

from ...data.errors import InputError
from ...data.store.blocks import read_block, write_block
from ...data.view_cells import as_graph, octants, walkable
from .cells import Sources
from .settings import CellSettings

if TYPE_CHECKING:
    from ...solvers.visibility.engine import Engine, Part

# Sources per block, which an interrupted bake resumes from.
BLOCK = 24
# View cells per block: their sets are larger.
VIEW_BLOCK = 8


def partial_folder(out: Path) -> Path:
    """Where unfinished work of a bake is kept: beside its folder."""
    return out.with_name(f".{out.name}.partial")


class Store:
    """Finished blocks of an interrupted bake."""

    def __init__(self, folder: Path, known: str) -> None:
        """Blocks of a bake with another fingerprint are removed.

        Raises:
            InputError: the folder cannot be written.
        """
        self._folder = folder
        mark = folder / "fingerprint"
        if folder.exists() and (not mark.exists() or mark.read_text() != known):
            shutil.rmtree(folder)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            mark.write_text(known)
        except OSError as error:
            raise InputError(f"{folder}: expected a place for unfinished work, found: {error.strerror}") from None

    def load(self, name: int | str) -> "Part | None":
        """A finished block; None if it is missing or damaged, and has to be computed."""
        from ...solvers.visibility.engine import Part

        arrays = read_block(self._folder / f"{name}.arrow")
        return None if arrays is None else Part.of_arrays(arrays)

    def save(self, name: int | str, part: "Part") -> None:
        """Keep a block.

        Raises:
            InputError: there is no room for it.
        """
        try:
            write_block(self._folder / f"{name}.arrow", part.arrays())
        except OSError as error:
            raise InputError(f"{self._folder}: expected room for unfinished work, found: {error.strerror}") from None


@dataclass
class Work:
    """Blocks of a bake, on the way.

    Attributes:
        engine: that computes them.
        store: of finished ones.
        bar: of progress, in cells.
        deadline: when no more is begun, of `time.perf_counter`.
    """

    engine: "Engine"
    store: Store
    bar: tqdm
    deadline: float = np.inf

    @property
    def late(self) -> bool:
        """Whether the deadline has passed."""
        return time.perf_counter() > self.deadline

    def finish(self, name: int | str, block: np.ndarray) -> "Part":
        """A block as far as it goes, from the store if it is there."""
        part = self.store.load(name)
        if part is None:
            part = self.engine.visible(block)
            self.store.save(name, part)
        self.bar.update(len(block))
        return part

    def all_parts(self, blocks: list[np.ndarray]) -> "tuple[list[Part], bool]":
        """All blocks, and whether the deadline ended them early: what is left is unknown, never hidden."""
        if np.isinf(self.deadline):
            return [self.finish(number, block) for number, block in enumerate(blocks)], False
        # First what is hidden from each, then witnesses where most is unknown.
        parts, rough = [], []
        for number, block in enumerate(blocks):
            part = self.store.load(number)
            if part is None:
                rough.append(number)
                part = self.engine.unknown(block) if self.late else self.engine.visible(block, aim=False)
            else:
                self.bar.update(len(block))
            parts.append(part)
        rough.sort(key=lambda number: -parts[number].unknown_count)
        while rough and not self.late:
            number = rough.pop(0)
            parts[number] = self.finish(number, blocks[number])
        return parts, bool(rough)


def in_blocks(sources: Sources) -> list[np.ndarray]:
    """Inhabitable cells in blocks; those of a bare graph are one."""
    cells = np.flatnonzero(sources.graph.inhabitable)
    size = VIEW_BLOCK if sources.view_cells else BLOCK if sources.model is not None else len(cells)
    return [cells[i : i + size] for i in range(0, len(cells), size)]


def refine(sources: Sources, work: Work, parts: "list[Part]", settings: CellSettings) -> "tuple[list[Part], bool]":
    """Replace cells of an octree that may see too much, or know too little, by their octants, level by level.

    Returns:
        Parts of the cells that are left, which `sources` has then; and whether the deadline ended it early.
    """
    model, engine = sources.model, work.engine
    sizes, cells = model.scene.triangle_counts, sources.graph.cells
    kept, leaves, spent = [], [], False
    for level in range(1, settings.depth + 2):
        coarse = np.zeros(len(cells), bool)
        if level <= settings.depth:
            for part in parts:
                coarse |= _too_coarse(part, len(cells), sizes, settings)
        families = octants(cells[coarse]).reshape(-1, 8, 2, 3)
        alive = walkable(families.reshape(-1, 2, 3), model).reshape(-1, 8)
        parents = np.flatnonzero(coarse)
        work.engine = engine.from_cells(families[alive].astype(np.int32))
        fresh, count = [], 0
        work.bar.total += int(alive.sum())
        work.bar.refresh()
        for number, size in enumerate(alive.sum(axis=1)):
            if work.late:
                # What is left of this level stays as it is: unrefined, never hidden.
                coarse[parents[number:]] = False
                spent = True
                break
            block = np.arange(count, count + size)
            count += int(size)
            if size:
                # Which cells come to be refined may depend on the budget: a block is known by its cells, too.
                held = hashlib.sha256(work.engine.model.cells[block].tobytes()).hexdigest()[:16]
                fresh.append(work.finish(f"{level}-{block[0]}-{held}", block))
        place = np.cumsum(~coarse) - 1 + sum(map(len, leaves))
        kept += [part.relabelled(np.where(coarse, -1, place)) for part in parts]
        leaves.append(cells[~coarse])
        cells, parts = families[alive].astype(np.int32)[:count], fresh
        if not count:
            break
    sources.graph = as_graph(np.concatenate(leaves))
    return kept, spent


def _too_coarse(part: "Part", count: int, sizes: np.ndarray, settings: CellSettings) -> np.ndarray:
    """Cells of a part that should be refined, shape (count,), bool; sizes are triangles by object."""
    rows = part.objects
    potential, unknown = (np.bincount(chosen, minlength=count) for chosen in (rows.source, rows.source[~rows.seen]))
    triangles = np.bincount(rows.source, sizes[rows.target], minlength=count)
    return (triangles > settings.refine_triangles) | (unknown > settings.refine_gap * potential)
