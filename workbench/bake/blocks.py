"""Visibility block by block: each finished block is kept until all are, so that an interrupted bake resumes."""

import hashlib
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from ...data.errors import InputError
from ...data.progress import Phase
from ...data.store.blocks import read_block, write_block
from ...data.view_cells import as_graph, octants, walkable

if TYPE_CHECKING:
    from ...kernels.launch import Device
    from ...solvers.visibility.engine import Engine, Part
    from .cells import Sources
    from .settings import CellSettings

Item, Answer = TypeVar("Item"), TypeVar("Answer")

# Sources per block, which an interrupted bake resumes from.
BLOCK = 24
# View cells per block: their sets are larger.
VIEW_BLOCK = 8
# Threads take blocks: a model of few sources is cut into so many, of no fewer sources than this.
BLOCKS, LEAST_BLOCK = 4, 3


class Store:
    """Finished blocks of an interrupted bake."""

    def __init__(self, folder: Path) -> None:
        """Blocks that are there already are taken.

        Raises:
            InputError: the folder cannot be written.
        """
        self._folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
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


@dataclass(frozen=True)
class Shortfall:
    """What a deadline left undone.

    Attributes:
        phase: what was being done: "preparing", "hiding", "witnesses" or "octree".
        cells: view cells that are not finished.
        pairs: pairs without a verdict from them: unknown, never hidden.
        needed_s: about how long visibility takes as a whole, from what was measured; None if nothing was.
        minute: view cells that another minute would finish; likewise.
    """

    phase: str
    cells: int
    pairs: int
    needed_s: float | None
    minute: int | None


@dataclass
class Work:
    """Blocks of a bake, on the way.

    Attributes:
        engine: that computes them.
        device: where it does, and on how many threads.
        store: of finished ones.
        bar: how far it is, in cells.
        deadline: when no more is begun, of `time.perf_counter`.
        started: when it began, likewise.
        objects: of the model.
    """

    engine: "Engine"
    device: "Device"
    store: Store
    bar: Phase
    deadline: float = np.inf
    started: float = 0.0
    objects: int = 0

    def __post_init__(self) -> None:
        """Nothing is finished yet."""
        self._pairs = np.zeros(3, int)

    @property
    def width(self) -> int:
        """Blocks that are computed at a time."""
        from ...kernels.launch import lanes

        return lanes(self.device.threads, self.device)

    def finish(self, named: "tuple[int | str, np.ndarray]") -> "Part":
        """A block with a name as far as it goes, from the store if it is there."""
        name, block = named
        part = self.store.load(name)
        if part is None:
            part = self.engine.visible(block)
            self.store.save(name, part)
        return part

    def hide(self, block: np.ndarray) -> "Part":
        """What is hidden from a block of cells."""
        return self.engine.visible(block, aim=False)

    def finish_all(self, named: "list[tuple[int | str, np.ndarray]]") -> "list[Part]":
        """Blocks as far as they go, side by side; counts their cells, and tells what is kept of the model."""
        cells = [len(block) for _, block in named]

        def tell(place: int, part: "Part") -> None:
            self._pairs += cells[place] * self.objects, len(part.objects), int((~part.objects.seen).sum())
            every, kept, unknown = self._pairs.tolist()
            if kept:
                self.bar.note = f"{kept / every:.0%} of the objects kept, {unknown / kept:.1%} of that unknown"

        return self.each(self.finish, named, cells, tell)

    def each(
        self,
        do: "Callable[[Item], Answer]",
        work: "Sequence[Item]",
        cells: list[int],
        tell: "Callable[[int, Answer], None]" = lambda place, answer: None,
    ) -> "list[Answer]":
        """What `do` returns for each piece of work, side by side, in order.

        Args:
            do: what to do.
            work: pieces of it.
            cells: that each counts for when it is done.
            tell: what to say then, given its place and answer.
        """
        from ...kernels.launch import side_by_side

        found = {}
        for place, answer in side_by_side(do, work, self.device):
            found[place] = answer
            tell(place, answer)
            # Other lanes are somewhere within theirs: without them the first to end would double the time that is left.
            begun = range(min(len(work), len(found) + self.width - 1))
            self.bar.under_way = sum(cells[other] for other in begun if other not in found) / 2
            self.bar.update(cells[place])
        return [found[place] for place in range(len(work))]


@dataclass
class Rate:
    """How long view cells take: how many were done, in how many seconds; and a guess where none was."""

    cells: int = 0
    seconds: float = 0.0
    guess: float = 0.0

    @property
    def each(self) -> float:
        """Seconds per view cell."""
        return self.seconds / self.cells if self.cells else self.guess

    def minute(self, most: int) -> int | None:
        """View cells of so many that a minute is enough for; None where nothing is known."""
        return min(most, int(60.0 / self.each)) if self.each else None

    def fits(self, cells: int, deadline: float) -> bool:
        """Whether so many more are done by a deadline, as far as is known."""
        return time.perf_counter() + cells * self.each <= deadline

    def room(self, deadline: float) -> int:
        """View cells that are done by a deadline; none where nothing is known."""
        return max(0, int((deadline - time.perf_counter()) / self.each)) if self.each else 0

    def take(self, cells: int, do: "Callable[[], Answer]") -> "Answer":
        """What `do` returns, timed."""
        start = time.perf_counter()
        found = do()
        self.cells += cells
        self.seconds += time.perf_counter() - start
        return found


def in_blocks(sources: "Sources") -> list[np.ndarray]:
    """Inhabitable cells in blocks; those of a bare graph are one.

    Cells of a block lie all over the model: blocks take about as long as each other, and the first tells of the rest.
    """
    cells = np.flatnonzero(sources.graph.inhabitable)
    size = VIEW_BLOCK if sources.view_cells else BLOCK if sources.model is not None else len(cells)
    count = max(-(-len(cells) // max(1, size)), min(BLOCKS, len(cells) // LEAST_BLOCK) if sources.model else 0)
    return [cells[place::count] for place in range(count)]


def refine(
    sources: "Sources", work: Work, parts: "list[Part]", settings: "CellSettings"
) -> "tuple[list[Part], Shortfall | None]":
    """Replace cells of an octree that may see too much, or know too little, by their octants, level by level.

    Returns:
        Parts of the cells that are left, which `sources` and the work's engine have then; and what the deadline left of
        a level, if anything.
    """
    model, engine = sources.model, work.engine
    sizes, cells = model.scene.triangle_counts, sources.graph.cells
    kept, leaves, short = [], [], None
    ready = engine.prepare(work.deadline - time.perf_counter())
    for level in range(1, settings.depth + 2):
        coarse = np.zeros(len(cells), bool)
        if level <= settings.depth:
            for part in parts:
                coarse |= _too_coarse(part, len(cells), sizes, settings)
        families = octants(cells[coarse]).reshape(-1, 8, 2, 3)
        alive = walkable(families.reshape(-1, 2, 3), model).reshape(-1, 8)
        parents = np.flatnonzero(coarse)
        work.engine = engine.from_cells(families[alive].astype(np.int32))
        fresh, count, rate = [], 0, Rate()
        work.bar.grow(int(alive.sum()))
        for begin in range(0, len(parents), work.width):
            sizes_now = alive[begin : begin + work.width].sum(axis=1)
            if not rate.fits(len(sizes_now), work.deadline) or not ready:
                # What is left of this level stays as it is: unrefined, never hidden.
                coarse[parents[begin:]] = False
                short = _unrefined(work, parts, parents[begin:], rate)
                break
            named = []
            for size in sizes_now[sizes_now > 0]:
                block = np.arange(count, count + size)
                count += int(size)
                # Which cells come to be refined may depend on the budget: a block is known by its cells, too.
                held = hashlib.sha256(work.engine.model.cells[block].tobytes()).hexdigest()[:16]
                named.append((f"{level}-{block[0]}-{held}", block))
            fresh += rate.take(len(named), lambda named=named: work.finish_all(named))
        place = np.cumsum(~coarse) - 1 + sum(map(len, leaves))
        kept += [part.relabelled(np.where(coarse, -1, place)) for part in parts]
        leaves.append(cells[~coarse])
        cells, parts = families[alive].astype(np.int32)[:count], fresh
        if not count:
            break
    sources.graph = as_graph(np.concatenate(leaves))
    work.engine = engine.from_cells(sources.graph.cells)
    return kept, short


def _unrefined(work: Work, parts: "list[Part]", parents: np.ndarray, rate: Rate) -> Shortfall:
    """What is left of a level, from the cells that should have been refined and the rate of those that were."""
    pairs = sum(int((~part.objects.seen & np.isin(part.objects.source, parents)).sum()) for part in parts)
    needed = time.perf_counter() - work.started + len(parents) * rate.each if rate.cells else None
    # What is refined is a parent.
    return Shortfall("octree", len(parents), pairs, needed, rate.minute(len(parents)))


def _too_coarse(part: "Part", count: int, sizes: np.ndarray, settings: "CellSettings") -> np.ndarray:
    """Cells of a part that should be refined, shape (count,), bool; sizes are triangles by object."""
    rows = part.objects
    potential, unknown = (np.bincount(chosen, minlength=count) for chosen in (rows.source, rows.source[~rows.seen]))
    triangles = np.bincount(rows.source, sizes[rows.target], minlength=count)
    return (triangles > settings.refine_triangles) | (unknown > settings.refine_gap * potential)
