"""Cases of the portal engine: stabbing, the search of cells, the target search."""

from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
from scipy.optimize import linprog

from ....data.errors import InputError
from ....data.graph import OTHER_AXES, CellGraph
from ....data.store.graph_folder import read_graph
from ....data.verdict import Verdict
from ....kernels import flood, stab_batch, target, trace
from ....kernels.flood import launch_flood
from ....kernels.launch import Device
from ....kernels.stab_batch import StabAnswers, launch_stab
from ....kernels.target import TargetAnswers, launch_target_search
from ....solvers.visibility.graph_engine import GraphEngine
from ....verify.exact.stab import stab
from ..suite import Case, Errors

BOXES, JUDGED_LISTS, LP_LISTS = 8, 200, 20
# How far beside its line a portal may begin [grid steps], so that about half of the lists are stabbed.
MISSES = 200
# Rooms of 4 m by 4 m by 3 m [grid steps].
ROOM = np.array([4096, 4096, 3072])
# Stabbing decisions per source and octant of the plain search: in halls it stops there, without all answers.
PLAIN_CAP = 200_000
JUDGED_SOURCES, PLAIN_SOURCES, PLAIN_OPEN_SOURCES = 2, 200, 4
# Portal sequences of the exact search from one source: some seconds.
STEPS = 2_000
OCTANTS = tuple(product((1, -1), repeat=3))
HALF = tuple(i for i in range(8) if i % 2 == 0)


def sequences(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Portals beside points of oblique lines in octant +++: boxes (count, BOXES, 2, 3) and signs (count, 3)."""
    rng = np.random.default_rng(seed)
    speed = rng.integers(200, 2000, (count, 1, 3))
    steps = np.cumsum(rng.integers(1, 8, (count, BOXES)), axis=1)
    touch = steps[:, :, None] * speed
    low = touch - rng.integers(-MISSES, 1000, (count, BOXES, 3))
    high = low + rng.integers(500, 2500, (count, BOXES, 3))
    axis = rng.integers(0, 3, (count, BOXES))[:, :, None] == np.arange(3)
    low, high = np.where(axis, touch, low), np.where(axis, touch, high)
    return np.stack([low, high], axis=2).astype(np.int32), np.ones((count, 3), np.int32)


def programme(boxes: np.ndarray) -> tuple[np.ndarray, list[tuple[float, float]]]:
    """Rows A x <= 0 and bounds: w_i lo_i - xi_i + t <= w_j hi_j - xi_j for all boxes and i != j, w >= 1, t <= 1."""
    rows = np.zeros((6 * len(boxes), 7))
    at = 0
    for low, high in boxes.astype(float):
        for i in range(3):
            for j in range(3):
                if i != j:
                    rows[at, [i, j, 3 + i, 3 + j, 6]] = low[i], -high[j], -1.0, 1.0, 1.0
                    at += 1
    return rows, [(1.0, np.inf)] * 3 + [(-np.inf, np.inf)] * 2 + [(0.0, 0.0), (-np.inf, 1.0)]


def margin_by_scipy(boxes: np.ndarray) -> float:
    """Largest t, by HiGHS through SciPy."""
    rows, bounds = programme(boxes)
    cost = np.array([0.0] * 6 + [-1.0])
    return -linprog(cost, A_ub=rows, b_ub=np.zeros(len(rows)), bounds=bounds, method="highs").fun


def stab_cases(n: int, device: Device) -> list[Case]:
    """One octant for n lists of boxes; the truth is the exact twin's."""
    boxes, signs = sequences(n, seed=BOXES)
    few = boxes[:LP_LISTS]
    return [
        Case(
            kernel="stab",
            scene=f"lists of {BOXES} ({min(n, JUDGED_LISTS)})",
            method="kernel",
            n=n,
            work=lambda: launch_stab(boxes, signs, device=device),
            judge=partial(judge_stabs, boxes[:JUDGED_LISTS]),
            baseline="HiGHS by SciPy",
            reference=lambda: [margin_by_scipy(one) for one in few],
            share=len(few) / n,
            modules=[stab_batch.__name__],
        )
    ]


def judge_stabs(boxes: np.ndarray, found: StabAnswers) -> Errors:
    """Verdicts of the first lists against exact ones."""
    truth = np.array([stab(one.astype(np.int64), (1, 1, 1)).verdict is Verdict.VISIBLE for one in boxes])
    verdict = found.verdict[: len(boxes)]
    return verdict_errors(verdict == Verdict.HIDDEN, verdict == Verdict.VISIBLE, truth)


def verdict_errors(hidden: np.ndarray, visible: np.ndarray, truth: np.ndarray) -> Errors:
    """Wrong verdicts of either kind, and what has none."""
    return Errors(
        wrong_hidden=int((hidden & truth).sum()),
        wrong_visible=int((visible & ~truth).sum()),
        unknown_pct=100.0 * float((~hidden & ~visible).mean()),
        overestimate=float((~hidden).sum() / max(truth.sum(), 1)),
    )


@dataclass(frozen=True)
class Plan:
    """Openings of random rooms.

    Attributes:
        share: of the walls with a door, on either axis, and of the slabs with a void.
        sides: least and most of an opening's sides [grid steps].
    """

    share: tuple[float, float, float]
    sides: tuple[int, int]


ROOMS = Plan((0.6, 0.6, 0.2), (512, 2048))
OPEN_PLAN = Plan((0.9, 0.9, 0.1), (2000, 3000))


def random_rooms(cells: int, seed: int, plan: Plan = ROOMS) -> CellGraph:
    """Rooms on a lattice of three storeys or fewer, joined by random doors and voids; every cell inhabitable.

    Args:
        cells: about how many.
        seed: of the openings.
        plan: how many openings, and how large.

    Returns:
        A graph of about `cells` cells.
    """
    random = np.random.default_rng(seed)
    storeys = 3 if cells >= 12 else 1
    wide = max(1, round((cells / storeys) ** 0.5))
    shape = np.array([wide, max(1, round(cells / storeys / wide)), storeys])
    place = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)
    boxes = np.stack([place, place + 1], axis=1) * ROOM
    pairs, axes, portals = [], [], []
    for axis in range(3):
        for low in np.flatnonzero((place[:, axis] + 1 < shape[axis]) & (random.random(len(place)) < plan.share[axis])):
            beyond = place[low] + np.eye(3, dtype=int)[axis]
            portal = boxes[low].copy()
            portal[0, axis] = portal[1, axis]
            for other in OTHER_AXES[axis]:
                side = random.integers(*plan.sides)
                portal[0, other] += random.integers(0, ROOM[other] - side)
                portal[1, other] = portal[0, other] + side
            pairs.append((low, np.ravel_multi_index(beyond, shape)))
            axes.append(axis)
            portals.append(portal)
    count = len(boxes)
    return CellGraph(
        boxes.astype(np.int32),
        np.ones(count, bool),
        np.full(count, ""),
        np.array(pairs, np.int32).reshape(-1, 2),
        np.array(axes, np.int8),
        np.array(portals, np.int32).reshape(-1, 2, 3),
    )


def reached_cells(graph: CellGraph, source: int) -> tuple[np.ndarray, bool]:
    """Cells that an open stabbing line joins to the source, exactly; depth first in Python.

    Returns:
        Shape (cells,), bool; and whether those are all, or the search has stopped after STEPS sequences.
    """
    starts, entries = graph.adjacency()
    reached = np.zeros(graph.cell_count, bool)
    reached[source] = True
    stack = [(source, graph.cells[source][None].astype(np.int64), OCTANTS)]
    for _ in range(STEPS):
        if not stack:
            break
        cell, boxes, fitting = stack.pop()
        for portal, behind in entries[starts[cell] : starts[cell + 1]].tolist():
            axis, sense = graph.portal_axis[portal], 1 if graph.portal_cells[portal, 0] == cell else -1
            longer = np.concatenate([boxes, graph.portals[portal][None]])
            fits = tuple(o for o in fitting if o[axis] == sense and stab(longer, o).verdict is Verdict.VISIBLE)
            if fits:
                reached[behind] = True
                stack.append((behind, longer, fits))
    return reached, not stack


def judge_sources(graph: CellGraph, hidden: np.ndarray, visible: np.ndarray, sources: np.ndarray) -> Errors:
    """Verdicts of some sources, shape (sources, cells), against an exact search, if need be one cut short."""
    found = [reached_cells(graph, int(source)) for source in sources]
    truth = np.stack([reached for reached, _ in found])
    if all(complete for _, complete in found):
        return verdict_errors(hidden, visible, truth)
    return Errors(
        wrong_hidden=int((hidden & truth).sum()),
        unknown_pct=100.0 * float((~hidden & ~visible).mean()),
        overestimate=float((~hidden).sum() / (truth | visible).sum()),
    )


def spread(count: int, cells: int) -> np.ndarray:
    """So many cells, evenly over all, ascending."""
    return np.unique(np.linspace(0, cells - 1, count + 2).astype(int)[1:-1])


def flood_cases(n: int, device: Device) -> list[Case]:
    """All cells from all cells of random rooms, and of rooms with openings nearly as large as their walls."""
    return [
        flood_case(random_rooms(n, seed=n), "rooms", device),
        flood_case(random_rooms(n, seed=n, plan=OPEN_PLAN), "open plan", device, PLAIN_OPEN_SOURCES),
    ]


def graph_cases(folder: Path, device: Device) -> list[Case]:
    """The same for graphs in folders: FOLDER itself, or those in it.

    Raises:
        InputError: there is none, or one cannot be read.
    """
    found = sorted(path.parent for path in [*folder.glob("portals.parquet"), *folder.glob("*/portals.parquet")])
    if not found:
        raise InputError(f"{folder}: expected cells.parquet and portals.parquet in it or in its folders, found none")
    cases = []
    for path in found:
        graph, _ = read_graph(path)
        graph.inhabitable[:] = True
        cases.append(flood_case(graph, path.resolve().name, device, PLAIN_OPEN_SOURCES))
    return cases


def flood_case(graph: CellGraph, scene: str, device: Device, plain_sources: int = PLAIN_SOURCES) -> Case:
    """The engine on a bare graph whose cells are all inhabitable, beside the plain kernel.

    The truth is an exact search from some cells.
    """
    engine = GraphEngine(graph, device=device)
    sources = np.arange(graph.cell_count)
    plain = GraphEngine(graph).model.device_graph
    judged, few = spread(JUDGED_SOURCES, graph.cell_count), spread(plain_sources, graph.cell_count)

    def judge(found: tuple[np.ndarray, np.ndarray]) -> Errors:
        potential, seen = found
        return judge_sources(graph, ~potential[judged], seen[judged], judged)

    def work() -> tuple[np.ndarray, np.ndarray]:
        rows, _ = engine.join([engine.visible(sources)])
        potential, seen = np.zeros((2, graph.cell_count, graph.cell_count), bool)
        potential[rows.source, rows.target] = True
        seen[rows.source[rows.seen], rows.target[rows.seen]] = True
        return potential, seen

    return Case(
        kernel="flood",
        scene=f"{scene} ({JUDGED_SOURCES} sources)",
        method="engine",
        n=graph.cell_count,
        work=work,
        judge=judge,
        baseline="plain search",
        reference=lambda: launch_flood(plain, few, HALF, cap=PLAIN_CAP),
        share=len(few) / graph.cell_count,
        modules=[target.__name__, flood.__name__, trace.__name__],
    )


def target_cases(n: int, device: Device) -> list[Case]:
    """The target search on the same rooms, from every cell to every other."""
    graph = random_rooms(n, seed=n)
    model = GraphEngine(graph, device=device).model
    plain = GraphEngine(graph).model.device_graph
    cells, few = np.arange(graph.cell_count), spread(PLAIN_SOURCES, graph.cell_count)
    pairs = np.stack(np.meshgrid(cells, cells, indexing="ij"), axis=-1).reshape(-1, 2)
    rows = np.column_stack([pairs, np.zeros(len(pairs), int)])[pairs[:, 0] != pairs[:, 1]]

    def judge(found: TargetAnswers) -> Errors:
        sources = spread(JUDGED_SOURCES, graph.cell_count)
        judged = np.flatnonzero(np.isin(rows[:, 0], sources))
        hidden, visible = np.zeros((2, len(sources), graph.cell_count), bool)
        visible[np.arange(len(sources)), sources] = True
        at = np.searchsorted(sources, rows[judged, 0]), rows[judged, 1]
        verdict = found.verdict[judged]
        hidden[at], visible[at] = verdict == Verdict.HIDDEN, verdict == Verdict.VISIBLE
        return judge_sources(graph, hidden, visible, sources)

    return [
        Case(
            kernel="target",
            scene=f"rooms ({JUDGED_SOURCES} sources)",
            method="kernel",
            n=graph.cell_count,
            work=lambda: launch_target_search(model.tree, graph.cells, rows, device=device),
            judge=judge,
            baseline="plain search",
            reference=lambda: launch_flood(plain, few, HALF, cap=PLAIN_CAP),
            share=len(few) / graph.cell_count,
            modules=[target.__name__],
        )
    ]
