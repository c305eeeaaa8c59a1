"""Cases of a walk's frames: what eyes see, the cells that they may reach, and the ranges that are read."""

import heapq
from dataclasses import replace
from functools import partial

import numpy as np

from ....data.camera import CameraPath, Screen
from ....data.graph import CellGraph
from ....data.store.ranges import Range, ranges_of
from ....kernels import eye as eye_kernels
from ....kernels.eye import EyeAnswers, eye_model, launch_eye
from ....kernels.launch import CPU, Device
from ....solvers.walk.range_cells import RangeCells, box_distances
from ....verify.exact.eye import seen_by_eye
from ..suite import Case, Errors
from .portals import random_rooms

CELLS, OBJECTS, SCREEN = 36, 200, Screen()
GRID_M = 1 / 1024
# Eyes that are judged exactly, or searched for by plain loops.
JUDGED, LOOPED = 3, 20
# What an eye may go [m], and items asked for together of how many.
REACH_M, ASKED, ITEMS, GAP = 6.0, 200, 20_000, 4_096


def building() -> tuple[CellGraph, np.ndarray]:
    """Random rooms, and boxes in them [grid steps]."""
    graph, random = random_rooms(CELLS, CELLS), np.random.default_rng(CELLS)
    low = random.integers(graph.cells[:, 0].min(axis=0), graph.cells[:, 1].max(axis=0) - 800, (OBJECTS, 3))
    return graph, np.stack([low, low + random.integers(50, 800, (OBJECTS, 3))], axis=1)


def eyes_in(graph: CellGraph, count: int) -> CameraPath:
    """Eyes anywhere in a building, looking anywhere."""
    random = np.random.default_rng(count)
    low, high = graph.cells[:, 0].min(axis=0), graph.cells[:, 1].max(axis=0)
    eyes = np.round(random.uniform(low + 1, high - 1, (count, 3))) * GRID_M
    return CameraPath(eyes, random.uniform(0, 360, count), random.uniform(-20, 20, count), np.arange(count) / 10.0)


def eye_cases(n: int, device: Device) -> list[Case]:
    """What n eyes see; the truth is the exact twin's, which takes no frustum's slack."""
    graph, boxes = building()
    model, path = eye_model(graph, boxes, GRID_M, device=device), eyes_in(graph, n)
    return [
        Case(
            kernel="eye",
            scene=f"rooms, {OBJECTS} objects ({min(n, JUDGED)} eyes)",
            method="wedge",
            n=n,
            work=lambda: launch_eye(model, path, SCREEN),
            judge=partial(judge_eyes, graph, boxes, path),
            baseline="in rationals",
            reference=lambda: exact_eye(graph, boxes, path, 0),
            share=1 / n,
            modules=[eye_kernels.__name__],
        )
    ]


def exact_eye(graph: CellGraph, boxes: np.ndarray, path: CameraPath, frame: int) -> set[int]:
    """Objects that an eye sees, exactly."""
    half = SCREEN.width / 2 / SCREEN.focal, SCREEN.height / 2 / SCREEN.focal
    return seen_by_eye(graph, boxes, path.eyes[frame] / GRID_M, path.axes()[frame], half)[0]


def judge_eyes(graph: CellGraph, boxes: np.ndarray, path: CameraPath, found: EyeAnswers) -> Errors:
    """Objects that an eye sees and that are left out, and how many more are kept."""
    wrong, kept, seen = 0, 0, 0
    for frame in range(min(JUDGED, len(path))):
        truth = exact_eye(graph, boxes, path, frame)
        own = set(found.objects[found.starts[frame] : found.starts[frame + 1]].tolist())
        wrong, kept, seen = wrong + len(truth - own), kept + len(own), seen + len(truth)
    return Errors(wrong_hidden=wrong, overestimate=kept / max(1, seen))


def lookahead_cases(n: int, device: Device) -> list[Case]:
    """Range cells of n eyes; error is the largest difference from plain loops [m], infinite if cells differ."""
    graph, path = building()[0], eyes_in(building()[0], n)
    ways = RangeCells(graph, GRID_M)
    return [
        Case(
            kernel="lookahead",
            scene=f"rooms, reach {REACH_M:g} m ({min(n, LOOPED)} eyes)",
            method="Dijkstra",
            n=n,
            work=lambda: [ways.near(eye, holding(graph, eye), REACH_M) for eye in path.eyes],
            judge=partial(judge_reached, graph, path),
            baseline="plain loops",
            reference=lambda: [plain_ways(graph, eye) for eye in path.eyes[:LOOPED]],
            share=min(n, LOOPED) / n,
            modules=[],
            device=CPU.name,
        )
    ]


def holding(graph: CellGraph, eye: np.ndarray) -> np.ndarray:
    """Cells that hold a point [m]."""
    steps = eye / GRID_M
    return np.flatnonzero(((graph.cells[:, 0] <= steps) & (steps <= graph.cells[:, 1])).all(axis=1))


def plain_ways(graph: CellGraph, eye: np.ndarray) -> np.ndarray:
    """Length of the shortest way from an eye to each cell [m], by a queue; inf beyond reach."""
    portals, point = graph.portals * GRID_M, np.stack([eye, eye])
    starts, entries = graph.adjacency()
    out, held = np.full(graph.cell_count, np.inf), holding(graph, eye).tolist()
    out[held] = 0.0
    queue = [(float(box_distances(portals[p], point)), p) for c in held for p in entries[starts[c] : starts[c + 1], 0]]
    heapq.heapify(queue)
    done = set()
    while queue:
        length, portal = heapq.heappop(queue)
        if portal in done or length > REACH_M:
            continue
        done.add(portal)
        for cell in graph.portal_cells[portal].tolist():
            out[cell] = min(out[cell], length)
            for other in entries[starts[cell] : starts[cell + 1], 0].tolist():
                heapq.heappush(queue, (length + float(box_distances(portals[portal], portals[other])), other))
    return out


def judge_reached(graph: CellGraph, path: CameraPath, found: list[tuple[np.ndarray, np.ndarray]]) -> Errors:
    """The largest difference of a length."""
    worst = 0.0
    for eye, (cells, length) in zip(path.eyes[:LOOPED], found, strict=False):
        truth = plain_ways(graph, eye)
        if not np.array_equal(np.sort(cells), np.flatnonzero(np.isfinite(truth))):
            return Errors(error=np.inf)
        worst = max(worst, float(np.abs(truth[cells] - length).max(initial=0.0)))
    return Errors(error=worst)


def reads_cases(n: int, device: Device) -> list[Case]:
    """Ranges of n requests of 200 items; error is the share of ranges that a plain loop makes otherwise."""
    random = np.random.default_rng(n)
    sizes = random.integers(100, 2_000, ITEMS)
    offsets = np.append(0, np.cumsum(sizes)[:-1])
    # Things that are wanted together lie together, more or less.
    firsts = random.integers(0, ITEMS - 2 * ASKED, n)
    asked = [first + random.permutation(2 * ASKED)[:ASKED] for first in firsts]
    return [
        Case(
            kernel="reads",
            scene=f"{ASKED} items ({min(n, LOOPED)} by loop)",
            method="numpy",
            n=n,
            work=lambda: [ranges_of(items, offsets, sizes, GAP) for items in asked],
            judge=partial(judge_ranges, asked, offsets, sizes),
            baseline="plain loop",
            reference=lambda: [plain_ranges(items, offsets, sizes) for items in asked[:LOOPED]],
            share=min(n, LOOPED) / n,
            modules=[],
            device=CPU.name,
        )
    ]


def plain_ranges(items: np.ndarray, offsets: np.ndarray, sizes: np.ndarray) -> list[Range]:
    """As `ranges_of`, item by item."""
    rank = {item: place for place, item in enumerate(items.tolist())}
    found: list[Range] = []
    for item in sorted(rank):
        first, size = int(offsets[item]), int(sizes[item])
        if found and first - found[-1].first - found[-1].size <= GAP:
            last = found[-1]
            gap = first - last.first - last.size
            found[-1] = replace(last, size=last.size + gap + size, items=(*last.items, item), waste=last.waste + gap)
        else:
            found.append(Range(first, size, (item,), 0))
    return sorted(found, key=lambda one: min(rank[item] for item in one.items))


def judge_ranges(asked: list[np.ndarray], offsets: np.ndarray, sizes: np.ndarray, found: list[list[Range]]) -> Errors:
    """Requests whose ranges are not those of the loop."""
    some = asked[:LOOPED]
    wrong = sum(plain_ranges(items, offsets, sizes) != own for items, own in zip(some, found, strict=False))
    return Errors(error=wrong / len(some))
