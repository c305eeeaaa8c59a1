"""What to hold in memory on a walk: four policies, each an order of items to look ahead to.

Sources: Funkhouser et al. 1996, section 4.3 (as published); Chhugani et al. 2005, section 7 (neighbours of the cell);
Aliaga et al. 1999, section 5.2 (along the path, or in a spiral).
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...data.graph import CellGraph
from .range_cells import box_distances
from .set_items import Balls, Motion, SetItems, Shelves, turn_seconds

# Share of the cache that is looked ahead to; the rest holds what was needed before.
SHARE = 0.9
# MMR's caches of 60 MB for near geometry, and of 80 MB for what stands for the far one.
NEAR_SHARE = 60 / 140
# Aliaga et al. 1999 say neither how slow slow is, nor how wide the way: half a walk, and as far as one looks.
SLOW, WAY_DEG = 0.7, 45.0
TURNED_DEG = 30.0
# Rooms are next to each other if a door joins them: through cells that nobody can stand in, no deeper than this.
DOORWAY_M = 1.0


@dataclass(frozen=True)
class Now:
    """A frame as policies see it.

    Attributes:
        eye: [m], shape (3,).
        forward: direction of view, unit length, shape (3,).
        velocity: [m/s], shape (3,).
        holders: rows of view cells that hold the eye, int64.
        rows: rows of view cells that can be reached, the nearest first, int64.
        seconds: after which, at the earliest, shape as rows.
        shown: objects that the eye may see, int64.
        wanted: item of the level that each is to be drawn at, shape as shown.
        urgent: items of what is shown, the first to be read first, of `Stock.urgent`.
    """

    eye: np.ndarray
    forward: np.ndarray
    velocity: np.ndarray
    holders: np.ndarray
    rows: np.ndarray
    seconds: np.ndarray
    shown: np.ndarray
    wanted: np.ndarray
    urgent: np.ndarray


@dataclass(frozen=True)
class Stock:
    """What policies choose from.

    Attributes:
        shelves: levels as items.
        sets: items of view cells.
        balls: around objects [m].
        graph: cells [grid steps].
        cells: cell of each row of the sets, int64.
        grid_m: [m].
        half_angle: from the middle of the screen to its corners [radians].
        motion: how eyes move.
        capacity: of the cache, bytes.
        second: items that MMR's second cache is for: depth meshes, or, without any, coarsest levels; bool.
    """

    shelves: Shelves
    sets: SetItems
    balls: Balls
    graph: CellGraph
    cells: np.ndarray
    grid_m: float
    half_angle: float
    motion: Motion
    capacity: int
    second: np.ndarray

    def reached(self, rows: np.ndarray, seconds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Items of rows, ascending, and the time before which the eye cannot be where each may be seen from [s].

        Args:
            rows: of the sets, shape (n,), int.
            seconds: before which the eye cannot be there, ascending, shape (n,).
        """
        starts, items = self.sets.starts, self.sets.items
        soonest = np.full(len(self.shelves.sizes), np.inf)
        # The nearest last: the soonest stays.
        for row, time in zip(rows[::-1].tolist(), seconds[::-1].tolist(), strict=True):
            soonest[items[starts[row] : starts[row + 1]]] = time
        found = np.flatnonzero(soonest < np.inf)
        return found, soonest[found]

    def by_time(self, now: Now, items: np.ndarray, seconds: np.ndarray) -> np.ndarray:
        """Items by level from the coarsest, and in a level by the time before which each cannot be in view.

        Args:
            now: the frame.
            items: ascending, fewer than 2^23, with fewer than 2^15 levels, shape (n,), int64.
            seconds: of `reached`, shape (n,).
        """
        own = self.shelves.owners.take(items)
        listed = np.zeros(len(self.balls.radii), bool)
        listed[own[own >= 0]] = True
        ids, turning = np.flatnonzero(listed), np.zeros(len(listed) + 1)
        turning[ids] = turn_seconds(self.balls.take(ids), now.eye, now.forward, self.half_angle, self.motion)
        # What objects share is in place -1, at 0. Whole microseconds, and of equals the first: integers without equals
        # are sorted in a fifth of the time, and in the same way everywhere.
        micros = (1e6 * np.maximum(seconds, turning.take(own))).astype(np.int64)
        bits = len(items).bit_length()
        order = np.sort((micros << bits) | np.arange(len(items))) & ((1 << bits) - 1)
        steps = self.shelves.steps.take(items).take(order)
        return items.take(order.take(np.argsort(steps.astype(np.int16), kind="stable")))

    def urgent(self, shown: np.ndarray, wanted: np.ndarray, worth: np.ndarray) -> np.ndarray:
        """What a frame shows: coarsest and wanted levels of all objects, those with the most pixels a byte first.

        An object's coarsest level is the smaller one and comes no later.

        Args:
            shown: as of `Now`.
            wanted: likewise.
            worth: pixels that each covers, about, shape as shown.
        """
        items = np.concatenate([self.shelves.coarsest[shown], wanted])
        worth = np.concatenate([worth, worth])
        return first_of_each(items[np.argsort(-worth / np.maximum(self.shelves.sizes[items], 1), kind="stable")])

    def cut(self, items: np.ndarray, most: float) -> np.ndarray:
        """The first of the items that fit into so many bytes together."""
        return items[: int(np.searchsorted(np.cumsum(self.shelves.sizes[items]), most, "right"))]


def first_of_each(items: np.ndarray) -> np.ndarray:
    """Each item once, where it first stands."""
    at = np.arange(len(items))
    place = np.empty(items.max(initial=-1) + 1, np.int64)
    # The first last: it stays.
    place[items[::-1]] = at[::-1]
    return items[place[items] == at]


class Policy:
    """An order of items to look ahead to.

    Attributes:
        name: as users type it.
        bounded: whether the cache may never be exceeded.
        near_share: share of the cache for all but `Stock.second`, which has the rest; None for one cache.
    """

    name = ""
    bounded = True
    near_share: float | None = None

    def __init__(self, stock: Stock) -> None:
        """Nothing was seen yet."""
        self.stock = stock

    def ahead(self, now: Now, held: np.ndarray) -> np.ndarray:
        """Items to look ahead to, each once, the most wanted first, int64.

        Args:
            now: the frame.
            held: whether each item is there or asked for, shape (items,), bool: among those the order is free.
        """
        raise NotImplementedError


class AsPublished(Policy):
    """Berkeley: all levels of all that range cells may see, cell by cell, until the memory is claimed.

    The first cell is looked at before the memory is: where it alone may see more than the cache holds, that overflows.
    """

    name, bounded = "as-published", False

    def ahead(self, now: Now, held: np.ndarray) -> np.ndarray:
        """By level from the coarsest, then by time."""
        stock, steps = self.stock, self.stock.shelves.steps
        claimed, left = np.zeros(len(steps), bool), stock.capacity
        count = 0
        for row in now.rows.tolist():
            if left <= 0:
                break
            own = stock.sets.items[stock.sets.starts[row] : stock.sets.starts[row + 1]]
            fresh = np.unique(own[~claimed[own]])
            claimed[fresh] = True
            left -= int(stock.shelves.sizes[fresh].sum())
            count += 1
        found, seconds = stock.reached(now.rows[:count], now.seconds[:count])
        items = np.concatenate([now.urgent, stock.by_time(now, found, seconds)])
        return first_of_each(items[np.argsort(steps[items], kind="stable")])


class CoarseFirst(Policy):
    """What is shown now, most pixels a byte first; then all that range cells may see, the coarsest levels first.

    As far as 90 % of the cache reach.
    """

    name = "coarse-first"

    def ahead(self, now: Now, held: np.ndarray) -> np.ndarray:
        """By level from the coarsest, then by time."""
        stock, sizes, most = self.stock, self.stock.shelves.sizes, SHARE * self.stock.capacity
        found, seconds = stock.reached(now.rows, now.seconds)
        shown = np.zeros(len(sizes), bool)
        shown[now.urgent] = True
        late = ~shown[found]
        found, seconds = found[late], seconds[late]
        steps = stock.shelves.steps[found]
        ends = sizes[now.urgent].sum() + np.cumsum(np.bincount(steps, sizes[found]))
        # Levels that fit whole: of those only what is to be read needs an order.
        whole = int(np.searchsorted(ends, most, "right"))
        free = (steps < whole) & held[found]
        moving = (steps <= whole) & ~free
        ordered = stock.by_time(now, found[moving], seconds[moving])
        first = stock.cut(np.concatenate([now.urgent, ordered]), most - sizes[found[free]].sum())
        return np.concatenate([first, found[free]])


class Neighbours(Policy):
    """vLOD: the whole set of the eye's cell, locked, and those of the cells beside it, each at its cell's own level."""

    name = "vlod"

    def __init__(self, stock: Stock) -> None:
        """Find out which view cells are beside which, through others that are none."""
        super().__init__(stock)
        adjacency = stock.graph.adjacency()
        self._beside = [_beside(stock, adjacency, int(cell)) for cell in stock.cells]
        self._rows, self._items = None, np.zeros(0, np.int64)

    def ahead(self, now: Now, held: np.ndarray) -> np.ndarray:
        """As they were when the eye entered its cell."""
        key = tuple(now.holders.tolist())
        if key and key != self._rows:
            beside = np.unique(np.concatenate([self._beside[row] for row in key]))
            order = np.concatenate([now.holders, np.setdiff1d(beside, now.holders)])
            entries, _ = self.stock.sets.of_rows(order)
            entries = entries[self.stock.sets.finest[entries]]
            whole = first_of_each(self.stock.sets.items[entries])
            self._rows, self._items = key, self.stock.cut(whole, self.stock.capacity)
        return self._items


class AlongThePath(Policy):
    """MMR: cells along the path of who is fast, about who is slow; coarsest levels first, from a queue that is kept."""

    name, near_share = "mmr", NEAR_SHARE

    def __init__(self, stock: Stock) -> None:
        """Measure the cells."""
        super().__init__(stock)
        self._cells = stock.graph.cells[stock.cells] * stock.grid_m
        self._key: tuple | None = None
        self._forward, self._items = np.zeros(3), np.zeros(0, np.int64)

    def ahead(self, now: Now, held: np.ndarray) -> np.ndarray:
        """The queue; a new one in a new cell, and where the view has turned by 30 degrees since the last frame."""
        key = tuple(now.holders.tolist()), bool(np.linalg.norm(now.velocity) >= SLOW)
        turned = float(now.forward @ self._forward) < np.cos(np.radians(TURNED_DEG))
        if key[0] and (key != self._key or turned):
            self._key, self._items = key, self._queue(now, key[1])
        self._forward = now.forward
        return self._items

    def _queue(self, now: Now, fast: bool) -> np.ndarray:
        """Items of the eye's cell, then coarsest ones of others, then those that do for them."""
        sets = self.stock.sets
        here = np.stack([self._cells[now.holders, 0].min(axis=0), self._cells[now.holders, 1].max(axis=0)])
        distance = box_distances(self._cells, here)
        if fast:
            to = np.clip(now.eye, self._cells[:, 0], self._cells[:, 1]) - now.eye
            ahead = to @ now.velocity >= np.cos(np.radians(WAY_DEG)) * np.linalg.norm(to, axis=1) * np.linalg.norm(
                now.velocity
            )
            distance = np.where(ahead, distance, np.inf)
        order = np.argsort(distance, kind="stable")
        order = order[np.isfinite(distance[order])]
        others = order[~np.isin(order, now.holders)]
        parts = []
        for rows in (now.holders, others):
            entries, _ = sets.of_rows(rows)
            objects = self.stock.sets.objects[entries[sets.finest[entries]]]
            parts += [self.stock.shelves.coarsest[objects], sets.items[entries[sets.finest[entries]]]]
        whole = first_of_each(np.concatenate(parts))
        far = self.stock.second[whole]
        near = self.stock.cut(whole[~far], NEAR_SHARE * self.stock.capacity)
        far = self.stock.cut(whole[far], (1 - NEAR_SHARE) * self.stock.capacity)
        kept = np.zeros(len(self.stock.shelves.sizes), bool)
        kept[near], kept[far] = True, True
        return whole[kept[whole]]


POLICIES: dict[str, Callable[[Stock], Policy]] = {
    policy.name: policy for policy in (CoarseFirst, AsPublished, Neighbours, AlongThePath)
}


def _beside(stock: Stock, adjacency: tuple[np.ndarray, np.ndarray], cell: int) -> np.ndarray:
    """Rows of the view cells next to one, through portals and cells that are no view cells; or those that touch it."""
    graph, row_of = stock.graph, np.full(stock.graph.cell_count, -1)
    row_of[stock.cells] = np.arange(len(stock.cells))
    away = box_distances(graph.cells[stock.cells].astype(float), graph.cells[cell].astype(float)) * stock.grid_m
    if not graph.portal_count or cell >= graph.tile_count:
        return np.flatnonzero((away == 0) & (stock.cells != cell))
    starts, entries = adjacency
    seen, found, queue = {cell}, [], deque([cell])
    while queue:
        at = queue.popleft()
        for behind in entries[starts[at] : starts[at + 1], 1].tolist():
            if behind not in seen:
                seen.add(behind)
                if row_of[behind] < 0:
                    queue.append(behind)
                elif away[row_of[behind]] <= DOORWAY_M:
                    found.append(row_of[behind])
    return np.array(sorted(found), np.int64)
