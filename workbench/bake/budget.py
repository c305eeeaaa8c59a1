"""A bake within a budget: something sound for every view cell first, then what tells most per second.

Preparing comes first, by half of the budget at most: what hides then is as much as was made. Where that was all, first
what is seen at a glance. Then small pieces of the first blocks tell how long a bake takes: where there is time
for all of it, that is done. Where there is none even to hide from all, occluders hide from every view cell, coarsely at
first (workbench/bake/coarse.py). What time is left hides as a bake does, then finds witnesses.
Everything that is not proved hidden by then is kept, and is unknown where it was not seen.
"""

import time
from typing import TYPE_CHECKING

import numpy as np

from ...data.rows import Rows
from .blocks import Rate, Shortfall, Work
from .coarse import Coarse

if TYPE_CHECKING:
    from ...solvers.visibility.engine import Engine, Part

# Looks around from every view cell before anything else: share of the time at most, number at most, and the share by
# which a look has to add to what is seen for there to be another.
GLANCE, GLANCES, GLANCE_LEAST = 0.05, 16, 0.02
# Looking for witnesses takes so many times as long as telling what is hidden, where it was not measured.
GUESSED = 2.0
# Whether there is time for all is measured, if by that guess there is so large a part of it.
HOPE = 4.0
# View cells of the first blocks that tell how long others take.
PROBE = 4
# Share of what time is left that preparing to hide as a bake does may take, and preparing for glances; and share of all
# that preparing what hides coarsely may take.
PREPARING, COARSELY = 0.25, 0.5


def prepare_within(engine: "Engine", seconds: float) -> None:
    """Make what an engine hides by and glances need, as much as a budget of so many seconds leaves time for."""
    started = time.perf_counter()
    engine.begin(COARSELY * seconds)
    engine.look(PREPARING * (started + seconds - time.perf_counter()))


def within_budget(
    work: Work, blocks: list[np.ndarray], boxes: np.ndarray, volumes: np.ndarray
) -> "tuple[list[Part], Shortfall | None]":
    """All blocks, and what the deadline left of them, if it ended them early: that is unknown, never hidden.

    Args:
        work: on its way.
        blocks: view cells.
        boxes: of all cells [grid steps], shape (cells, 2, 3), int32.
        volumes: of all cells, shape (cells,), float64.
    """
    glances, done = _glance(work, blocks) if work.engine.look(0.0) else Rows.join([]), {}
    for number, block in enumerate(blocks):
        part = work.store.load(number)
        if part is not None:
            done[number] = [part]
            work.bar.update(len(block))
    stored, hiding = set(done), Rate()
    left = _pieces([(number, block) for number, block in enumerate(blocks) if number not in stored], work.width)
    coarse = Coarse(work, glances, np.concatenate([np.zeros(0, int), *(cells for _, cells in left)]), boxes, volumes)
    full, begun = Rate(), 0.0
    ready = work.engine.begin() and work.engine.prepare(0.0)
    if left and hiding.fits(1, work.deadline):
        coarse.begin()
        begun = time.perf_counter() - work.started
        if coarse.first() and not ready and work.engine.begin():
            ready = work.engine.prepare(PREPARING * (work.deadline - time.perf_counter()))
        if ready:
            left = _finish_directly(work, blocks, left, (hiding, full), done)
    while left:
        if not ready or not hiding.fits(_cells(left), work.deadline):
            coarse.run(hiding)
        if not ready or not hiding.fits(_cells(now := left[: work.width]), work.deadline):
            break
        del left[: work.width]
        for (number, _), part in zip(now, _hide(work, hiding, [cells for _, cells in now]), strict=True):
            done.setdefault(number, []).append(part)
    # As much of the others as there is time for.
    cells = np.concatenate([np.zeros(0, int), *(cells for _, cells in left)])
    some = cells[: hiding.room(work.deadline)]
    rest = _hide(work, hiding, [some[k :: work.width] for k in range(min(work.width, len(some)))])
    for number, cells in left:
        alone = np.setdiff1d(cells, some)
        part = work.engine.unknown(alone, coarse.left(alone))
        done.setdefault(number, []).append(part)
    raw = {number for number, _ in left}
    rough = sorted(set(done) - stored - raw, key=lambda number: (-_unknown(done[number]), number))
    # Witnesses take as long again where none were looked for yet, or several times so.
    full.guess = GUESSED * hiding.each
    rough = [number for number, _ in _finish(work, full, [(number, blocks[number]) for number in rough], done)]
    parts = [part for number in range(len(blocks)) for part in done[number]] + rest
    for part in parts:
        part.objects.adopt(glances)
    unfinished = [*raw, *rough]
    if not unfinished:
        return parts, None
    count, needed = sum(len(blocks[number]) for number in unfinished), None
    if hiding.cells:
        # Given that, another bake finishes directly what this one has not.
        small = PROBE * work.width
        needed = begun + small * hiding.each + (small + count) * full.each
    pairs = sum(_unknown(done[number]) for number in unfinished) + _unknown(rest)
    phase = "witnesses" if not raw else "hiding" if ready else "preparing"
    return parts, Shortfall(phase, count, pairs, needed, full.minute(count))


def _finish(
    work: Work, rate: Rate, named: list[tuple[int, np.ndarray]], done: "dict[int, list[Part]]"
) -> list[tuple[int, np.ndarray]]:
    """Blocks that there is no time to finish; the others are done then."""
    while named and rate.fits(_cells(now := named[: work.width]), work.deadline):
        named = named[work.width :]
        for (number, _), part in zip(now, rate.take(_cells(now), lambda now=now: work.finish_all(now)), strict=True):
            done[number] = [part]
    return named


def _finish_directly(
    work: Work,
    blocks: list[np.ndarray],
    left: list[tuple[int, np.ndarray]],
    rates: tuple[Rate, Rate],
    done: "dict[int, list[Part]]",
) -> list[tuple[int, np.ndarray]]:
    """Where there may be time for everything, finish what can be finished without hiding first, which is done again.

    Args:
        work: on its way.
        blocks: view cells.
        left: pieces of blocks that are not done.
        rates: of hiding and of finishing, which a small piece of each of the first blocks tells here.
        done: parts of blocks.

    Returns:
        Pieces that are left.
    """
    hiding, full = rates
    pieces = [cells for _, cells in left[: work.width]]
    count, all_cells = sum(map(len, pieces)), _cells(left)
    _hide(work, hiding, pieces)
    if not Rate(guess=GUESSED * hiding.each / HOPE).fits(all_cells, work.deadline):
        return left
    full.take(count, lambda: work.each(work.engine.visible, pieces, [0] * len(pieces)))
    if not full.fits(all_cells, work.deadline):
        return left
    unfinished = {number for number, _ in _finish(work, full, [(k, blocks[k]) for k in dict(left)], done)}
    return [(number, cells) for number, cells in left if number in unfinished]


def _pieces(named: list[tuple[int, np.ndarray]], width: int) -> list[tuple[int, np.ndarray]]:
    """The blocks, the first few of them in two: a small piece soon tells how long all take."""
    first = [(number, block[:PROBE]) for number, block in named[:width]]
    second = [(number, block[PROBE:]) for number, block in named[:width] if len(block) > PROBE]
    return first + second + named[width:]


def _unknown(parts: "list[Part]") -> int:
    """Pairs without a witness."""
    return sum(part.unknown_count for part in parts)


def _hide(work: Work, rate: Rate, blocks: list[np.ndarray]) -> "list[Part]":
    """What is hidden from some blocks; timed, and not counted as done."""
    return rate.take(sum(map(len, blocks)), lambda: work.each(work.hide, blocks, [0] * len(blocks)))


def _cells(pieces: list[tuple[int, np.ndarray]]) -> int:
    """View cells of some pieces of blocks."""
    return sum(len(cells) for _, cells in pieces)


def _glance(work: Work, blocks: list[np.ndarray]) -> Rows:
    """Objects seen from the cells of all blocks in a few looks around, while a look shows enough more; ordered."""
    found, until = Rows.join([]), time.perf_counter() + GLANCE * (work.deadline - time.perf_counter())
    for number in range(GLANCES):
        fresh, left = [], blocks
        while left and time.perf_counter() <= until:
            now, left = left[: work.width], left[work.width :]
            fresh += work.each(lambda block, number=number: work.engine.glance(block, number), now, [0] * len(now))
        before, found = len(found), Rows.join([found, *fresh]).order().once()
        if left or len(found) - before <= GLANCE_LEAST * before:
            break
    return found
