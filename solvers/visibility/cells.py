"""Cell-to-cell visibility of blocks of source cells: a verdict for every pair and a witness where there is one."""

from dataclasses import dataclass

import numpy as np

from ...data.blockers import Blockers
from ...data.graph import CellGraph
from ...data.hierarchy import build_levels
from ...data.ragged import places_of
from ...data.rows import Rows
from ...data.verdict import Verdict
from ...kernels.aim import launch_aim
from ...kernels.blockers import blocker_tree
from ...kernels.graph import device_graph
from ...kernels.launch import CPU, Device
from ...kernels.target import TargetAnswers, launch_target_search
from ...kernels.trace import launch_trace
from .aim import Sights, middles, seeds
from .ledger import Ledger, descend
from .search import on_witness_grid, search_rounds, segments

# Sightlines per round aimed at a pair that the axial model allows but whose own line the true triangles block.
AIM_ROUNDS = (16, 64, 256)
# A pair whose clear sightlines were refused is shot at so many times more in each round, anywhere.
REFUSED_AGAIN = 3
# Lines tried for a group of cells, and where the groups start: the root is visible from everywhere.
GROUP_CAP, FIRST_LEVEL = 40, 3
# Moves of a line that are tried together.
JITTERS = 64
# A cell sees itself if a sightline of this length fits into it [grid steps].
SHORT = np.array([1.0 / 1024.0, 0.0, 0.0])


@dataclass
class CellModel:
    """A cell-and-portal graph on a device.

    Attributes:
        graph: cells and portals.
        blockers: what no sightline between live cells crosses.
        sights: the model's true triangles and solids; None for a bare graph.
        seed: of the random sightlines.
        device: where to search.
    """

    graph: CellGraph
    blockers: Blockers
    sights: Sights | None = None
    seed: int = 0
    device: Device = CPU

    def __post_init__(self) -> None:
        """Copy the graph and its blockers to the device."""
        self.device_graph = device_graph(self.graph, self.device)
        self.tree = blocker_tree(self.blockers, self.device)


def certified_pairs(model: CellModel, sources: np.ndarray, ledger: Ledger) -> np.ndarray:
    """(source, other cell) pairs that no proof for a group of cells hides, shape (n, 2), int64."""
    cells = model.graph.cells

    def hide(source: np.ndarray, boxes: np.ndarray) -> np.ndarray:
        everything = np.concatenate([cells, boxes])
        rows = np.column_stack([source, len(cells) + np.arange(len(boxes)), np.zeros(len(boxes), int)])
        answers = launch_target_search(model.tree, everything, rows, cap=GROUP_CAP, device=model.device)
        ledger.add_lines(model.tree, everything, rows, answers, model.device)
        return answers.verdict == Verdict.HIDDEN

    pairs = np.column_stack(descend(cells, sources, *build_levels(cells), FIRST_LEVEL, hide))
    return pairs[pairs[:, 0] != pairs[:, 1]]


def search_outwards(model: CellModel, sources: np.ndarray) -> tuple[np.ndarray, TargetAnswers]:
    """Pairs with a cell that a portal joins to one that is not hidden, and the answers of the search; ordered.

    A line past all blockers leaves every cell through a portal, so what it reaches lies beside what it passed, which it
    reaches as well. All pairs that are left out are hidden.

    Returns:
        (source, other cell), shape (n, 2), int64, and their answers.
    """
    starts, entries = model.graph.adjacency()
    count, own = model.graph.cell_count, np.arange(len(sources))
    asked = np.zeros((len(sources), count), bool)
    asked[own, sources] = True
    row, cell = own, np.asarray(sources)
    found = []
    while len(row) or not found:
        sizes = (starts[1:] - starts[:-1])[cell]
        beside = entries[places_of(starts[cell], sizes), 1]
        row, cell = np.divmod(np.unique(np.repeat(row, sizes) * count + beside), count)
        fresh = ~asked[row, cell]
        row, cell = row[fresh], cell[fresh]
        asked[row, cell] = True
        pairs = np.column_stack([sources[row], cell])
        answers = search_pairs(model, pairs, None)
        found.append((row * count + cell, pairs, *vars(answers).values()))
        left = answers.verdict != Verdict.HIDDEN
        row, cell = row[left], cell[left]
    key, pairs, *columns = (np.concatenate(column) for column in zip(*found, strict=True))
    order = np.argsort(key)
    return pairs[order], TargetAnswers(*(column[order] for column in columns))


def search_pairs(model: CellModel, pairs: np.ndarray, ledger: Ledger | None) -> TargetAnswers:
    """Target search from cell to cell, row by row."""
    rows = np.column_stack([pairs, np.zeros(len(pairs), int)])
    answers = search_rounds(model.tree, model.graph.cells, rows, model.device)
    if ledger is not None:
        ledger.add_lines(model.tree, model.graph.cells, rows, answers, model.device)
    return answers


def cell_rows(
    model: CellModel, sources: np.ndarray, aim_rounds: tuple[int, ...] = AIM_ROUNDS, ledger: Ledger | None = None
) -> Rows:
    """Every cell that is not proved hidden from the sources, itself included, ordered.

    Args:
        model: the graph.
        sources: cells, shape (n,), int.
        aim_rounds: sightlines shot at each pair that still lacks a witness, round by round.
        ledger: where to enter certificates; then only what has one is hidden.

    Returns:
        Reached pairs. A pair that is left out is hidden, exactly; witnesses clear every opaque triangle and start
        outside every solid.
    """
    cells = model.graph.cells
    if ledger is None:
        pairs, answers = search_outwards(model, sources)
    else:
        # Walls, whose proofs anybody can check, say nothing of portals.
        pairs = certified_pairs(model, sources, ledger)
        answers = search_pairs(model, pairs, ledger)
    kept = np.flatnonzero(answers.verdict != Verdict.HIDDEN)
    rows = Rows.unseen(*pairs[kept].T)
    lined = np.flatnonzero(answers.verdict[kept] == Verdict.VISIBLE)
    ends = segments(answers, kept[lined], cells[rows.source[lined]], cells[rows.target[lined]])
    # A line that is no witness still tells where to aim.
    rows.origin[lined], rows.end[lined] = ends
    good = lined[accept(model, rows.source[lined], rows.target[lined], *ends)]
    rows.show(good, rows.origin[good], rows.end[good])
    if model.sights is not None:
        _aim(model, rows, aim_rounds)
    return _with_own(model, sources, rows)


def portal_rows(model: CellModel, sources: np.ndarray, rows: Rows) -> Rows:
    """Rows of a bare graph from lines found from one end or both; what a source sees, and is one itself, sees it.

    A line that float64 cannot follow through the portals is no witness. It can be followed either way, so one witness
    serves both ends.
    """
    count, chosen = model.graph.cell_count, np.zeros(model.graph.cell_count, bool)
    chosen[sources] = True
    turned = chosen[rows.target] & (rows.source > rows.target)
    rows.source[turned], rows.target[turned] = rows.target[turned], rows.source[turned]
    rows.origin[turned], rows.end[turned] = rows.end[turned], rows.origin[turned]
    good = np.flatnonzero(accept(model, rows.source, rows.target, rows.origin, rows.end))
    rows.show(good, rows.origin[good], rows.end[good])
    # A pair may have been found from both of its ends: one with a witness stays.
    key = 2 * (rows.source * count + rows.target) + ~rows.seen
    order = np.argsort(key)
    first = np.diff(key[order] // 2, prepend=-1) != 0
    best, pair = order[first], np.cumsum(first) - 1
    open_ = np.flatnonzero(~rows.seen[best][pair])
    _jitter(model, rows, order[open_])
    open_ = open_[rows.seen[order[open_]]]
    best[pair[open_]] = order[open_]
    there = rows.take(best)
    both = there.take(chosen[there.target])
    back = Rows(both.target, both.source, both.verdict, both.end, both.origin)
    return _with_own(model, sources, Rows.join([there, back]))


def _jitter(model: CellModel, rows: Rows, todo: np.ndarray) -> None:
    """Move those lines of some rows that run along a seam between portals, less and less; shows them, in place."""
    cells = model.graph.cells.astype(float)
    random = np.random.default_rng(model.seed)
    todo = todo[(rows.origin[todo] != rows.end[todo]).any(axis=1)]
    for power in range(2, 14, 2):
        todo = todo[~rows.seen[todo]]
        if not len(todo):
            return
        tried = np.tile(todo, JITTERS)
        source, target = rows.source[tried], rows.target[tried]
        moved = []
        for point, cell in ((rows.origin[tried], cells[source]), (rows.end[tried], cells[target])):
            reach = (cell[:, 1] - cell[:, 0]) * 0.5**power
            moved.append(on_witness_grid(point + random.uniform(-1.0, 1.0, point.shape) * reach))
        good = np.flatnonzero(accept(model, source, target, *moved))
        rows.show(tried[good], moved[0][good], moved[1][good])


def join_cell_rows(model: CellModel, parts: list[Rows]) -> Rows:
    """All blocks as one table with portals, made symmetric.

    A pair of inhabitable cells that one side proves hidden is hidden from the other side too, and a witness from one
    side serves the other if it also starts outside every solid when it is followed back, and is followed to its end.
    """
    rows, count = Rows.join(parts), model.graph.cell_count
    key, mirrored = rows.source * count + rows.target, rows.target * count + rows.source
    order = np.argsort(key)
    other = order[np.minimum(np.searchsorted(key[order], mirrored), len(key) - 1)]
    paired = key[other] == mirrored
    keep = paired | ~model.graph.inhabitable[rows.target]
    borrow = np.flatnonzero(keep & paired & ~rows.seen & rows.seen[other])
    start, stop = rows.end[other[borrow]].copy(), rows.origin[other[borrow]].copy()
    if model.sights is not None:
        free = model.sights.outside(rows.source[borrow], start)
        borrow, start, stop = borrow[free], start[free], stop[free]
    there = _reach(model, rows.source[borrow], rows.target[borrow], start, stop)
    rows.show(borrow[there], start[there], stop[there])
    rows = rows.take(keep).order()
    seen = np.flatnonzero(rows.seen)
    _, starts, portals = launch_trace(
        model.device_graph, rows.source[seen], rows.origin[seen], rows.end[seen], device=model.device
    )
    counts = np.zeros(len(rows), np.int64)
    counts[seen] = np.diff(starts)
    return rows.with_portals(counts, portals)


def accept(model: CellModel, source: np.ndarray, target: np.ndarray, origin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Segments that are witnesses: inside their cells, clear, from outside every solid, through portals all the way."""
    cells = model.graph.cells
    rows = np.flatnonzero(strictly_inside(origin, cells[source]) & strictly_inside(end, cells[target]))
    if model.sights is not None:
        rows = rows[model.sights.clear(source[rows], origin[rows], end[rows])]
    ok = np.zeros(len(source), bool)
    ok[rows] = _reach(model, source[rows], target[rows], origin[rows], end[rows])
    return ok


def _reach(model: CellModel, source: np.ndarray, target: np.ndarray, origin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Segments that float64 follows through portals from their source to their target, shape (n,), bool."""
    reached, _, _ = launch_trace(model.device_graph, source, origin, end, record=False, device=model.device)
    return reached == target


def strictly_inside(points: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Whether each point lies in the open box of its row, shape (n,), bool."""
    inside = (points > boxes[:, 0]) & (points < boxes[:, 1])
    # Three columns: NumPy's reduction along so short an axis is many times slower.
    return inside[:, 0] & inside[:, 1] & inside[:, 2]


def _aim(model: CellModel, rows: Rows, aim_rounds: tuple[int, ...]) -> None:
    """Shoot at pairs that have no witness yet; shows those that are reached, in place."""
    cells, sights = model.graph.cells, model.sights
    refused = np.zeros(len(rows), bool)
    for number, tries in enumerate(aim_rounds):
        todo = np.flatnonzero(~rows.seen)
        # A line on a seam between portals is clear and still no witness, and so is everything near it.
        again = todo[refused[todo]]
        copy = np.repeat(np.arange(1 + REFUSED_AGAIN), [len(todo), *[len(again)] * REFUSED_AGAIN])
        todo = np.concatenate([todo, *[again] * REFUSED_AGAIN])
        source, target = rows.source[todo], rows.target[todo]
        hints = np.stack([rows.origin[todo], rows.end[todo]], axis=1)
        hintless = (hints == 0).all(axis=(1, 2))
        hints[hintless] = middles(cells[source], cells[target])[hintless]
        found, first, last = launch_aim(
            sights.triangles,
            cells[source],
            cells[target],
            hints,
            np.tile([-1, 0, 0], (len(todo), 1)),
            seeds(model.seed + number + 1000 * copy, source, target),
            ~refused[todo],
            tries=tries,
            guide=sights.finder if model.device.is_cpu else None,
            device=model.device,
        )
        hit = np.flatnonzero(found)
        refused[todo[hit]] = True
        good = hit[accept(model, source[hit], target[hit], first[hit], last[hit])]
        rows.show(todo[good], first[good], last[good])


def _with_own(model: CellModel, sources: np.ndarray, rows: Rows) -> Rows:
    """Add each source as its own target, seen if a free point was found in it, and order the rows."""
    own = Rows.unseen(sources, sources)
    cells = model.graph.cells[sources].astype(float)
    start = on_witness_grid(cells.mean(axis=1))
    good = accept(model, sources, sources, start, start + SHORT)
    own.origin[:], own.end[:] = start, start + SHORT
    own.show(good, start[good], start[good] + SHORT)
    if model.sights is not None:
        # A cell's middle may hold furniture; any free point will do.
        random = np.random.default_rng(model.seed)
        for row in np.flatnonzero(~good):
            points = cells[row, 0] + random.uniform(0.05, 0.95, (64, 3)) * (cells[row, 1] - cells[row, 0])
            points = on_witness_grid(points)
            repeated = np.full(64, sources[row])
            free = np.flatnonzero(accept(model, repeated, repeated, points, points + SHORT))
            if len(free):
                own.show(row, points[free[0]], points[free[0]] + SHORT)
    return Rows.join([rows, own]).order()
