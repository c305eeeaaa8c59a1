"""What view cells may see by occluders alone, from coarse to fine: something sound for every cell early in a budget.

First nodes of the hierarchy of objects, for every view cell, or for groups of neighbours where cells are too many; then
finer ones, then boxes of objects, then their pieces, step by step for all cells, those first that keep most.
"""

import time
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...data.hierarchy import leaves_of
from ...data.rows import Rows
from ...solvers.visibility.engine import unknown_rows
from .blocks import Rate, Work

# Share of the time left that each of the first steps may take; cells or groups that a thread does at a time, and those
# that tell how long a step takes; and how many times faster than hiding as a bake does a step has to be: walls alone
# are slow inside buildings.
FIRST_SHARE, TOGETHER, TIMED, FASTER = 0.3, 8, 4, 2.0
# The last steps are about pieces of objects.
PIECES = 2


@dataclass
class Coarse:
    """What some view cells may see by occluders alone; at first everything.

    Attributes:
        work: on its way.
        glances: pairs known to be seen, ordered.
        cells: view cells, shape (n,), int.
        boxes: of all cells.
        volumes: likewise.
        steps: that there are; none before `begin`, and none but those that are done once time has run out.
        step: the next one.
        kept: whether cells[i] may see object j, shape (n, objects), bool; None before the first step.
    """

    work: Work
    glances: Rows
    cells: np.ndarray
    boxes: np.ndarray
    volumes: np.ndarray
    steps: int = 0
    step: int = 0
    kept: np.ndarray | None = None

    def begin(self) -> None:
        """Make what all steps use, and hiding as a bake does as well."""
        self.steps = self.work.engine.coarse_steps()

    def first(self) -> bool:
        """Do all steps but those about pieces, where each is a small part of what time is left; whether that was so."""
        self._run(self.steps - PIECES, Rate(), all_of_it=True)
        return self.step >= self.steps - PIECES

    def run(self, hiding: Rate) -> None:
        """Hide as much as there is time for, step by step; steps have to be faster than hiding as a bake does."""
        self._run(self.steps, hiding, all_of_it=False)

    def left(self, cells: np.ndarray) -> Rows:
        """Every object that is not hidden from some cells, ordered as these are."""
        if self.kept is None:
            return unknown_rows(cells, self.work.objects)
        place, target = np.nonzero(self.kept[self._places[cells]])
        return Rows.unseen(cells[place], target)

    @cached_property
    def _places(self) -> np.ndarray:
        """Place of each of all cells among these."""
        places = np.full(len(self.boxes), -1)
        places[self.cells] = np.arange(len(self.cells))
        return places

    def _run(self, last: int, hiding: Rate, *, all_of_it: bool) -> None:
        """Steps up to before the last one, while there is time; with `all_of_it` those that take FIRST_SHARE of it."""
        every = np.arange(len(self.cells))
        while self.step < min(last, self.steps):
            if self.kept is None:
                self.kept = np.ones((len(every), self.work.objects), bool)
            group, some, rate = every, every[:: -(-len(every) // (TIMED * self.work.width))], Rate()
            self._ask(group, some, rate)
            now = time.perf_counter()
            fits = rate.fits(len(every), now + FIRST_SHARE * max(0.0, self.work.deadline - now))
            if self.step == 0 and not fits:
                # One answer serves all cells of a group.
                some, group = every[:0], self._grouped(FIRST_SHARE * rate.room(self.work.deadline))
            elif all_of_it and not fits:
                return
            slow = hiding.cells and FASTER * (group.max() + 1) * rate.each >= len(every) * hiding.each
            if slow or not self._finish(group, some, rate):
                self.steps = self.step
                return
            self.step += 1

    def _grouped(self, room: float) -> np.ndarray:
        """Group of each cell, of neighbours, about so many groups in all; shape (n,), int."""
        leaves = leaves_of(self.boxes[self.cells], int(np.log2(max(room, 1.0))))
        return np.unique(leaves, return_inverse=True)[1]

    def _finish(self, group: np.ndarray, some: np.ndarray, rate: Rate) -> bool:
        """Do the next step for all groups of cells but some, those first that keep most; whether there was time."""
        order = np.argsort(-np.bincount(group, self.kept.sum(axis=1) * self.volumes[self.cells]), kind="stable")
        order = order[~np.isin(order, some)]
        together = TOGETHER * self.work.width
        for begin in range(0, len(order), together):
            now = order[begin : begin + together]
            if not rate.fits(len(now), self.work.deadline):
                return False
            self._ask(group, now, rate)
        return True

    def _ask(self, group: np.ndarray, some: np.ndarray, rate: Rate) -> None:
        """Do the next step for some groups of cells, side by side, timed."""
        engine = self.work.engine

        def ask(mine: np.ndarray) -> Rows:
            rows = np.flatnonzero(np.isin(group, mine))
            if self.step == 0:
                return engine.coarse(self.cells[rows], np.unique(group[rows], return_inverse=True)[1])
            place, target = np.nonzero(self.kept[rows])
            asked = Rows.unseen(self.cells[rows[place]], target)
            asked.adopt(self.glances)
            return engine.narrow(asked, self.step - 1)

        shares = [some[k :: self.work.width] for k in range(min(self.work.width, len(some)))]
        found = Rows.join(rate.take(len(some), lambda: self.work.each(ask, shares, [0] * len(shares))))
        mine = np.flatnonzero(np.isin(group, some))
        left = np.zeros((len(mine), self.kept.shape[1]), bool)
        left[np.searchsorted(mine, self._places[found.source]), found.target] = True
        self.kept[mine] &= left
        self.work.bar.note = f"{self.kept.mean():.0%} of the objects kept"
