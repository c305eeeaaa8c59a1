"""Cell-to-cell visibility of blocks of source cells: a verdict for every pair and a witness where there is one."""

from dataclasses import dataclass

import numpy as np

from ...data.blockers import Blockers
from ...data.graph import CellGraph
from ...data.hierarchy import build_levels
from ...data.solids import SolidIndex
from ...data.store.database import VisibleRows
from ...kernels.graph import device_graph
from ...kernels.sightline import AimTargets, Triangles, launch_aim, launch_confirm
from ...kernels.target import TargetAnswers, blocker_tree, launch_target_search
from ...kernels.trace import launch_walk
from .ledger import Ledger, descend

# Sightlines aimed at a pair that the axial model allows but whose own line the true triangles block, a round each.
AIM_ROUNDS = (16, 64, 256)
# A pair whose clear sightlines were refused is shot at so many times more a round, anywhere.
REFUSED_AGAIN = 3
# Lines tried for a pair, then again for what stayed undecided.
CAPS = (200, 20_000)
# Lines tried for a group of cells, and where the groups start: the root is visible from everywhere.
GROUP_CAP, FIRST_LEVEL = 40, 3


@dataclass
class Model:
    """What the visibility of a model needs on the device; triangles, targets and solids are None for a bare graph."""

    graph: CellGraph
    blockers: Blockers
    triangles: "Triangles | None"
    targets: "AimTargets | None"
    solids: SolidIndex | None
    device: str = "cpu"
    threads: int = 1
    seed: int = 0

    def __post_init__(self) -> None:
        """Copy the graph and its blockers to the device."""
        self.device_graph = device_graph(self.graph, self.device)
        self.tree = blocker_tree(self.blockers, self.device)


@dataclass
class CellRows:
    """Reached pairs of a block of sources, ordered by source, then target; columns as in data/store/database.py."""

    source: np.ndarray
    target: np.ndarray
    seen: np.ndarray
    origin: np.ndarray
    end: np.ndarray
    portal_counts: np.ndarray
    portals: np.ndarray


def segments(
    answers: TargetAnswers, rows: np.ndarray, sources: np.ndarray, targets: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the found lines: a quarter into the source box and a quarter into the target box, on the witness grid.

    Args:
        answers: of a target search.
        rows: answers to take.
        sources: source box of each taken row [grid steps], shape (n, 2, 3).
        targets: likewise.

    Returns:
        Origins and ends [grid steps], shape (n, 3), float64, multiples of 2**-10.
    """
    w, xi = answers.line[rows], answers.offset[rows]
    sign = np.where((answers.octant[rows][:, None] >> np.arange(3)) & 1, -1.0, 1.0)

    def times(boxes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        ends = boxes.astype(float) * sign[:, None]
        ends = np.stack([ends.min(axis=1), ends.max(axis=1)], axis=1)
        low, high = w * ends[:, 0] - xi, w * ends[:, 1] - xi
        return np.maximum.reduce(low.T), np.minimum.reduce(high.T)

    def place(time: np.ndarray) -> np.ndarray:
        return np.round(sign * (time[:, None] + xi) / w * 1024.0) / 1024.0

    enter, leave = times(sources)
    first, last = times(targets)
    return place(leave - 0.25 * (leave - enter)), place(first + 0.25 * (last - first))


def search_rounds(model: Model, boxes: np.ndarray, rows: np.ndarray) -> TargetAnswers:
    """Target search with a small cap, then again with a larger one for the pairs that stayed undecided."""
    options = {"threads": model.threads, "device": model.device}
    answers = launch_target_search(model.tree, boxes, rows, cap=CAPS[0], **options)
    for cap in CAPS[1:]:
        again = np.flatnonzero(answers.verdict == 2)
        if len(again):
            better = launch_target_search(model.tree, boxes, rows[again], cap=cap, **options)
            for name in TargetAnswers.__dataclass_fields__:
                column = getattr(answers, name).copy()
                column[again] = getattr(better, name)
                setattr(answers, name, column)
    return answers


def certified_pairs(model: Model, sources: np.ndarray, ledger: Ledger) -> np.ndarray:
    """(source, other cell) pairs that no proof for a group of cells hides, shape (n, 2), int64."""
    cells, options = model.graph.cells, {"threads": model.threads, "device": model.device}

    def hide(source: np.ndarray, boxes: np.ndarray) -> np.ndarray:
        everything = np.concatenate([cells, boxes])
        rows = np.column_stack([source, len(cells) + np.arange(len(boxes)), np.zeros(len(boxes), int)])
        answers = launch_target_search(model.tree, everything, rows, cap=GROUP_CAP, **options)
        ledger.add_lines(model.tree, everything, rows, answers, **options)
        return answers.verdict == 0

    pairs = np.column_stack(descend(cells, sources, *build_levels(cells), FIRST_LEVEL, hide))
    return pairs[pairs[:, 0] != pairs[:, 1]]


def search_pairs(model: Model, pairs: np.ndarray, ledger: Ledger | None) -> tuple[np.ndarray, TargetAnswers]:
    """Rows of a target search between cells, and its answers."""
    rows = np.column_stack([pairs, np.zeros(len(pairs), int)])
    answers = search_rounds(model, model.graph.cells, rows)
    if ledger is not None:
        options = {"threads": model.threads, "device": model.device}
        ledger.add_lines(model.tree, model.graph.cells, rows, answers, **options)
    return rows, answers


def cell_rows(
    model: Model, sources: np.ndarray, aim_rounds: tuple[int, ...] = AIM_ROUNDS, ledger: Ledger | None = None
) -> CellRows:
    """Every cell that is not proved hidden from the sources, itself included.

    Args:
        model: the model.
        sources: cells, shape (n,), int.
        aim_rounds: sightlines shot at each pair that still lacks a witness, round by round.
        ledger: where to enter certificates; then only what has one is hidden.

    Returns:
        Reached pairs. A pair that is left out is hidden, exactly; `seen` pairs have a witness that clears every opaque
        triangle and starts outside every solid.
    """
    cells = model.graph.cells
    if ledger is None:
        pairs = np.stack(np.meshgrid(sources, np.arange(len(cells)), indexing="ij"), axis=-1).reshape(-1, 2)
        pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    else:
        pairs = certified_pairs(model, sources, ledger)
    rows, answers = search_pairs(model, pairs, ledger)
    kept = np.flatnonzero(answers.verdict != 0)
    source, target = rows[kept, 0], rows[kept, 1]
    origin, end = np.zeros((len(kept), 3)), np.zeros((len(kept), 3))
    lined = answers.verdict[kept] == 1
    origin[lined], end[lined] = segments(answers, kept[lined], cells[source[lined]], cells[target[lined]])
    seen = lined.copy()
    seen[lined] = accept(model, source[lined], target[lined], origin[lined], end[lined])
    if model.triangles is not None:
        _aim(model, source, target, origin, end, seen, aim_rounds)
    return _finish(model, sources, source, target, seen, origin, end)


def portal_rows(
    model: Model, sources: np.ndarray, source: np.ndarray, target: np.ndarray, origin: np.ndarray, end: np.ndarray
) -> CellRows:
    """Rows of a bare graph from its lines; a line that float64 cannot follow through the portals is no witness."""
    seen = accept(model, source, target, origin, end)
    _jitter(model, source, target, origin, end, seen)
    # A pair may have been found from both of its ends: the one with a witness stays.
    order = np.lexsort((~seen, target, source))
    key = (source.astype(np.int64) * model.graph.cell_count + target)[order]
    order = order[np.diff(key, prepend=-1) != 0]
    return _finish(model, sources, source[order], target[order], seen[order], origin[order], end[order])


def _jitter(
    model: Model, source: np.ndarray, target: np.ndarray, origin: np.ndarray, end: np.ndarray, seen: np.ndarray
) -> None:
    """Move lines that run along a seam between portals, less and less; fills origin, end and seen in place."""
    cells = model.graph.cells.astype(float)
    random = np.random.default_rng(model.seed)
    rows = np.flatnonzero(~seen)
    rows = rows[(origin[rows] != end[rows]).any(axis=1)]
    for power in np.repeat(np.arange(2, 14, 2), 8):
        rows = rows[~seen[rows]]
        if not len(rows):
            return
        moved = []
        for point, cell in ((origin[rows], cells[source[rows]]), (end[rows], cells[target[rows]])):
            reach = (cell[:, 1] - cell[:, 0]) * 0.5**power
            moved.append(np.round((point + random.uniform(-1.0, 1.0, point.shape) * reach) * 1024.0) / 1024.0)
        good = accept(model, source[rows], target[rows], *moved)
        origin[rows[good]], end[rows[good]], seen[rows[good]] = moved[0][good], moved[1][good], True


def _finish(model: Model, sources: np.ndarray, *columns: np.ndarray) -> CellRows:
    rows = _with_own(model, sources, *columns)
    source, _, seen, origin, end = rows
    return CellRows(*rows, *_portals(model, source, seen, origin, end))


def join_rows(model: Model, parts: list[CellRows]) -> VisibleRows:
    """All blocks as one table, made symmetric.

    A pair of inhabitable cells that one side proves hidden is hidden from the other side too, and a witness from one
    side serves the other if it also starts outside every solid when it is followed back.
    """
    names = ("source", "target", "seen", "origin", "end")
    source, target, seen, origin, end = (np.concatenate([getattr(part, name) for part in parts]) for name in names)
    count = model.graph.cell_count
    key, mirrored = source.astype(np.int64) * count + target, target.astype(np.int64) * count + source
    order = np.argsort(key)
    place = np.minimum(np.searchsorted(key[order], mirrored), len(key) - 1)
    other = order[place]
    paired = key[other] == mirrored
    keep = paired | ~model.graph.inhabitable[target]
    borrow = np.flatnonzero(keep & paired & ~seen & seen[other])
    start, stop = end[other[borrow]].copy(), origin[other[borrow]].copy()
    if model.solids is not None:
        free = outside(model, source[borrow], start, np.ones(len(borrow), bool))
        borrow, start, stop = borrow[free], start[free], stop[free]
    origin[borrow], end[borrow], seen[borrow] = start, stop, True
    rows = np.flatnonzero(keep)
    rows = rows[np.lexsort((target[rows], source[rows]))]
    source, target, seen, origin, end = (column[rows] for column in (source, target, seen, origin, end))
    counts, portals = _portals(model, source, seen, origin, end)
    starts = np.concatenate([[0], np.cumsum(counts)])
    return VisibleRows(source.astype(np.int32), target.astype(np.int32), seen, origin, end, starts, portals)


def accept(model: Model, source: np.ndarray, target: np.ndarray, origin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Segments that are witnesses: inside their cells, clear, from outside every solid, through portals all the way."""
    cells = model.graph.cells
    ok = strictly_inside(origin, cells[source]) & strictly_inside(end, cells[target])
    if model.triangles is not None:
        rows = np.flatnonzero(ok)
        none = np.full(len(rows), -1)
        options = {"threads": model.threads, "device": model.device}
        ok[rows] = launch_confirm(model.triangles, origin[rows], end[rows], none, **options)
        ok &= outside(model, source, origin, ok)
    rows = np.flatnonzero(ok)
    reached, _, _ = launch_walk(
        model.device_graph,
        source[rows],
        origin[rows],
        end[rows],
        record=False,
        threads=model.threads,
        device=model.device,
    )
    ok[rows] = reached == target[rows]
    return ok


def strictly_inside(points: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Whether each point lies in the open box of its row, shape (n,), bool."""
    inside = (points > boxes[:, 0]) & (points < boxes[:, 1])
    # Three columns: NumPy's reduction along so short an axis is many times slower.
    return inside[:, 0] & inside[:, 1] & inside[:, 2]


def outside(model: Model, source: np.ndarray, origin: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Wanted origins that lie outside every solid, shape (n,), bool."""
    free = np.zeros(len(source), bool)
    for cell in np.unique(source[wanted]):
        rows = np.flatnonzero(wanted & (source == cell))
        free[rows] = model.solids.outside(origin[rows], int(cell))
    return free


def _aim(
    model: Model,
    source: np.ndarray,
    target: np.ndarray,
    origin: np.ndarray,
    end: np.ndarray,
    seen: np.ndarray,
    aim_rounds: tuple[int, ...],
) -> None:
    """Shoot at pairs that have no witness yet; fills origin, end and seen in place."""
    cells = model.graph.cells
    refused = np.zeros(len(source), bool)
    for number, tries in enumerate(aim_rounds):
        rows = np.flatnonzero(~seen)
        # A line on a seam between portals is clear and still no witness, and so is everything near it.
        again = rows[refused[rows]]
        copy = np.repeat(np.arange(1 + REFUSED_AGAIN), [len(rows), *[len(again)] * REFUSED_AGAIN])
        rows = np.concatenate([rows, *[again] * REFUSED_AGAIN])
        hints = np.stack([origin[rows], end[rows]], axis=1)
        hintless = (hints == 0).all(axis=(1, 2))
        hints[hintless] = cells[np.stack([source[rows], target[rows]], axis=1)][hintless].mean(axis=2)
        found, first, last = launch_aim(
            model.triangles,
            model.targets,
            cells[source[rows]],
            cells[target[rows]],
            hints,
            np.full(len(rows), -1),
            np.zeros((len(rows), 2), int),
            seeds(model.seed + number + 1000 * copy, source[rows], target[rows]),
            ~refused[rows],
            tries=tries,
            threads=model.threads,
            device=model.device,
        )
        hit = np.flatnonzero(found)
        refused[rows[hit]] = True
        good = hit[accept(model, source[rows[hit]], target[rows[hit]], first[hit], last[hit])]
        origin[rows[good]], end[rows[good]], seen[rows[good]] = first[good], last[good], True


def seeds(seed: int | np.ndarray, source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """A random stream for each pair that depends on nothing else, shape (n,), int32."""
    mixed = source.astype(np.uint64) * 0x9E3779B1 + target.astype(np.uint64) * 0x85EBCA77
    mixed = (mixed + np.asarray(seed, np.uint64) * np.uint64(0xC2B2AE3D)) & np.uint64(0x7FFFFFFF)
    return mixed.astype(np.int32)


def _with_own(model: Model, sources: np.ndarray, *columns: np.ndarray) -> tuple[np.ndarray, ...]:
    """Add each source as its own target, seen if a free point was found in it, and sort the rows."""
    source, target, seen, origin, end = columns
    cells = model.graph.cells[sources].astype(float)
    start = np.round(cells.mean(axis=1) * 1024.0) / 1024.0
    stop = start + np.array([1.0 / 1024.0, 0.0, 0.0])
    own_seen = accept(model, sources, sources, start, stop)
    if model.triangles is not None:
        # A cell's middle may hold furniture; any free point will do.
        random = np.random.default_rng(model.seed)
        for row in np.flatnonzero(~own_seen):
            points = cells[row, 0] + random.uniform(0.05, 0.95, (64, 3)) * (cells[row, 1] - cells[row, 0])
            points = np.round(points * 1024.0) / 1024.0
            repeated = np.full(64, sources[row])
            free = np.flatnonzero(accept(model, repeated, repeated, points, points + (stop - start)[row]))
            if len(free):
                start[row], own_seen[row] = points[free[0]], True
                stop[row] = start[row] + np.array([1.0 / 1024.0, 0.0, 0.0])
    source, target = np.concatenate([source, sources]), np.concatenate([target, sources])
    seen = np.concatenate([seen, own_seen])
    origin, end = np.concatenate([origin, start]), np.concatenate([end, stop])
    order = np.lexsort((target, source))
    return source[order], target[order], seen[order], origin[order], end[order]


def _portals(
    model: Model, source: np.ndarray, seen: np.ndarray, origin: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Number of portals of each row, 0 where not seen, and the portals of all rows in order."""
    rows = np.flatnonzero(seen)
    _, starts, portals = launch_walk(
        model.device_graph, source[rows], origin[rows], end[rows], threads=model.threads, device=model.device
    )
    counts = np.zeros(len(source), np.int64)
    counts[rows] = np.diff(starts)
    return counts, portals
