"""Is a pair that the bake hides really visible? Exact judgement of candidate rays."""

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from ...data.graph import CellGraph
from ..exact.plan import inside_plans
from ..exact.segment import BLOCKED as THROUGH
from ..exact.segment import crossing_time, meets_flat_box
from ..exact.sightline import Sightlines
from ..exact.trace import Links, portal_path
from .embree import Candidates
from .witness import Witnesses, passes_portals

# How far past a float32 hit the exact crossing is sought: float32 hits are good to about 1e-6.
OVERSHOOT = 1.0 + 1e-4


class Judgement(IntEnum):
    """What became of a candidate."""

    BLOCKED = 0
    GRAZE = 1
    LEAK = 2
    VISIBLE = 3


@dataclass(frozen=True)
class Judge:
    """Everything needed to decide whether a sightline is real.

    Attributes:
        graph: cells and portals.
        lines: opaque triangles; None for a bare graph, where passing portals is what visible means.
        glass: transparent triangles.
        links: portal links of a bare graph.
        cracks: closed openings, as flat boxes [grid steps], shape (n, 2, 3): what is seen through them is a leak.
    """

    graph: CellGraph
    lines: Sightlines | None
    glass: Sightlines
    links: Links
    cracks: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 3), np.int32))

    def judge(self, kind: str, cell: int, target: int, origin: np.ndarray, end: np.ndarray) -> Judgement:
        """Whether the sightline shows the target from the cell.

        Args:
            kind: "cell" or "object".
            cell: source cell_id.
            target: cell_id or object_id.
            origin: start [grid steps], 3 float64; anything but strictly inside the cell and outside every solid shows
                nothing.
            end: for a cell a point strictly inside it, for an object a point just behind its first surface.
        """
        low, high = self.graph.cells[cell]
        if not ((origin > low) & (origin < high)).all():
            return Judgement.BLOCKED
        if not inside_plans(self.graph.plans, np.array([cell]), origin[None])[0]:
            return Judgement.BLOCKED
        if self.lines is not None and not self.lines.outside_solids(origin[None])[0]:
            return Judgement.BLOCKED
        found = (
            self.sees_object(target, origin, end) if kind == "object" else self._sees_cell(cell, target, origin, end)
        )
        if found is Judgement.VISIBLE and meets_flat_box(origin, end, self.cracks):
            return Judgement.LEAK
        return found

    def judge_all(
        self, kind: str, cells: np.ndarray, targets: np.ndarray, origins: np.ndarray, ends: np.ndarray
    ) -> np.ndarray:
        """`judge` of many sightlines of one kind: values of `Judgement`, shape (n,), int8."""
        found = np.full(len(cells), Judgement.BLOCKED, np.int8)
        boxes = self.graph.cells[cells]
        rows = np.flatnonzero(((origins > boxes[:, 0]) & (origins < boxes[:, 1])).all(axis=1))
        rows = rows[inside_plans(self.graph.plans, cells[rows], origins[rows])]
        if self.lines is not None and len(rows):
            rows = rows[self.lines.outside_solids(origins[rows])]
        if self.lines is None or len(self.cracks):
            doubtful = np.ones(len(rows), bool)
        elif kind == "cell":
            doubtful = np.zeros(len(rows), bool)
            aims = self.graph.cells[targets[rows]]
            inside = ((ends[rows] > aims[:, 0]) & (ends[rows] < aims[:, 1])).all(axis=1)
            sights = self.lines.check(origins[rows], ends[rows])
            table = np.array([Judgement.VISIBLE, Judgement.GRAZE, Judgement.BLOCKED], np.int8)
            found[rows] = np.where(inside, table[sights], Judgement.GRAZE)
        else:
            own, doubtful = np.zeros(len(rows), bool), np.zeros(len(rows), bool)
            for triangles, opaque in ((self.lines, True), (self.glass, False)):
                segments, ids, kinds = triangles.hits(origins[rows], ends[rows])
                mine = triangles.owners[ids] == targets[rows[segments]]
                own[segments[mine & (kinds == THROUGH)]] = True
                # Where something else is met too, the order of the crossings has to be found.
                doubtful[segments[~mine & opaque]] = True
            found[rows] = np.where(own, Judgement.VISIBLE, Judgement.GRAZE)
        for row in rows[doubtful]:
            found[row] = self.judge(kind, int(cells[row]), int(targets[row]), origins[row], ends[row])
        return found

    def _sees_cell(self, cell: int, target: int, origin: np.ndarray, end: np.ndarray) -> Judgement:
        low, high = self.graph.cells[target]
        if not ((end > low) & (end < high)).all():
            return Judgement.GRAZE
        if self.lines is not None:
            sight = self.lines.check(origin[None], end[None])[0]
            return (Judgement.VISIBLE, Judgement.GRAZE, Judgement.BLOCKED)[sight]
        path = portal_path(self.links, self.graph.cells, cell, target, origin, end - origin)
        if path is None:
            return Judgement.GRAZE
        ids, starts = np.array(path, np.int64), np.array([0, len(path)])
        line = Witnesses(np.array([cell]), np.array([target]), origin[None], end[None], ids, starts)
        passed = passes_portals(line, self.graph, np.ones(1, bool))[0]
        return (Judgement.BLOCKED, Judgement.GRAZE, Judgement.VISIBLE)[passed + 1]

    def sees_object(self, target: int, origin: np.ndarray, end: np.ndarray) -> Judgement:
        """The object's first proper crossing must come before anything else opaque."""
        times: dict[bool, list] = {True: [], False: []}
        for triangles, opaque in ((self.lines, True), (self.glass, False)):
            _, ids, kinds = triangles.hits(origin[None], end[None])
            for triangle, kind in zip(ids, kinds, strict=True):
                own = bool(triangles.owners[triangle] == target)
                if own and kind == THROUGH:
                    times[True].append(crossing_time(origin, end, triangles.triangles[triangle]))
                elif opaque and not own:
                    # A coplanar triangle has no crossing time; it counts as met at once.
                    time = crossing_time(origin, end, triangles.triangles[triangle]) if kind == THROUGH else -1
                    times[False].append(time)
        if not times[True]:
            return Judgement.GRAZE
        first = min(times[True])
        if not times[False] or first < min(times[False]):
            return Judgement.VISIBLE
        return Judgement.GRAZE if min(times[False]) < 0 else Judgement.BLOCKED


def sightline_end(candidates: Candidates, number: int, cells: np.ndarray) -> np.ndarray:
    """End of a candidate's sightline [grid steps]: the middle of its way in the cell, or just behind the object.

    The end is origin + direction rounded to float64, so that a case file repeats it digit by digit.
    """
    origin, direction = candidates.origins[number], candidates.directions[number]
    reach = candidates.reach[number]
    if candidates.kinds[number] == 1:
        return origin + (origin + direction * min(reach, 2.0**26) * OVERSHOOT - origin)
    low, high = cells[candidates.targets[number]]
    with np.errstate(divide="ignore", invalid="ignore"):
        first, last = (low - origin) / direction, (high - origin) / direction
    enter, leave = np.fmin(first, last).max(), min(np.fmax(first, last).min(), reach)
    end = origin + direction * (enter + leave) / 2
    return origin + (end - origin)
