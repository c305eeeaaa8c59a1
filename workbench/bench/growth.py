"""How cost grows: times of one kernel over two orders of magnitude of a size, and the exponent that fits them."""

import statistics
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from ...data.buildings.office import make_office
from ...kernels.launch import Device
from ...kernels.select import launch_select
from ...kernels.shaft import launch_shaft
from ...kernels.shields import device_shields
from ...solvers.visibility.aim import Sights
from ...solvers.visibility.graph_engine import GraphEngine
from ...solvers.visibility.occluders import OccluderModel, seen_objects
from .rows.objects import PIECES, SMALLEST, boxes_in_spaces, prepared
from .rows.portals import random_rooms
from .rows.solvers import knapsacks
from .suite import clock

RUNS = 3
CELLS = (36, 108, 324, 1_080, 3_600)
# Floors and rooms on each side of the corridor.
OFFICES = ((1, 1), (1, 4), (2, 6), (4, 10), (8, 16))
PAIRS = 3_000
VIEW_CELLS = 4
OBJECTS = (1_000, 3_162, 10_000, 31_623, 100_000)


@dataclass(frozen=True)
class Growth:
    """Times of a kernel against a size; the fields are those in JSON.

    Attributes:
        kernel: whose work.
        scene: what is worked on.
        against: what the sizes count.
        sizes: ascending.
        ms: median of some runs at each.
        exponent: slope of log ms over log size, by least squares.
        standard_error: of the exponent; None for fewer than three sizes.
    """

    kernel: str
    scene: str
    against: str
    sizes: list[int]
    ms: list[float]
    exponent: float
    standard_error: float | None


def fit(sizes: list[int], ms: list[float]) -> tuple[float, float | None]:
    """Slope of log ms over log size by least squares, and its standard error; at least two different sizes."""
    x, y = np.log(np.array(sizes, float)), np.log(np.array(ms))
    dx = x - x.mean()
    slope = float(dx @ (y - y.mean()) / (dx @ dx))
    left = y - y.mean() - slope * dx
    free = len(x) - 2
    return slope, float(np.sqrt(left @ left / free / (dx @ dx))) if free > 0 else None


def grown(kernel: str, scene: str, counts: dict[str, list[int]], ms: list[float]) -> list[Growth]:
    """The same times against each of several sizes."""
    return [Growth(kernel, scene, name, sizes, ms, *fit(sizes, ms)) for name, sizes in counts.items()]


def run_growth(device: Device, advance: Callable[[], None]) -> Iterator[list[Growth]]:
    """All curves; `advance` is called after every size."""
    for curve in CURVES:
        yield curve(device, advance)


def median_ms(work: Callable[[], object], device: Device) -> float:
    """Median of RUNS runs after one to warm up."""
    work()
    return statistics.median(clock(work, device)[0] for _ in range(RUNS))


def flood_growth(device: Device, advance: Callable[[], None]) -> list[Growth]:
    """All cells from all cells of random rooms, against cells and portals."""
    counts, ms = {"cells": [], "portals": []}, []
    for cells in CELLS:
        graph = random_rooms(cells, seed=cells)
        engine = GraphEngine(graph, device=device)
        ms.append(median_ms(partial(engine.visible, np.arange(graph.cell_count)), device))
        counts["cells"].append(graph.cell_count)
        counts["portals"].append(graph.portal_count)
        advance()
    return grown("flood", "random rooms, all pairs", counts, ms)


def shaft_growth(device: Device, advance: Callable[[], None]) -> list[Growth]:
    """A fixed number of pairs in ever larger offices, against rectangles that occlude."""
    counts, ms = {"occluders": []}, []
    for floors, rooms in OFFICES:
        scene = make_office(floors=floors, rooms_per_side=rooms, seed=4)
        model = prepared(scene)
        shields = device_shields(model.regions, model.patches, device)
        random = np.random.default_rng(0)
        boxes = [boxes_in_spaces(random, PAIRS, sides, scene) for sides in ((0.5, 1.5), (0.1, 0.6))]
        rows = np.arange(2 * PAIRS).reshape(2, PAIRS).T
        work = partial(launch_shaft, shields, np.concatenate(boxes), rows, smallest=SMALLEST, cap=PIECES, device=device)
        ms.append(median_ms(work, device))
        counts["occluders"].append(len(model.regions.boxes) + len(model.patches.area))
        advance()
    return grown("shaft", f"offices, {PAIRS:,} pairs", counts, ms)


def occlusion_growth(device: Device, advance: Callable[[], None]) -> list[Growth]:
    """What a few view cells of ever larger offices see, against objects and triangles."""
    counts, ms = {"objects": [], "triangles": []}, []
    for floors, rooms in OFFICES:
        scene = make_office(floors=floors, rooms_per_side=rooms, seed=4)
        cells = boxes_in_spaces(np.random.default_rng(0), VIEW_CELLS, (1.0, 2.0), scene)
        model = OccluderModel.of(Sights.of(prepared(scene), cells, 0, device))
        ms.append(median_ms(partial(seen_objects, model, np.arange(VIEW_CELLS)), device))
        counts["objects"].append(len(scene.objects))
        counts["triangles"].append(len(scene.triangles()[0]))
        advance()
    return grown("occlusion", f"offices, {VIEW_CELLS} cells", counts, ms)


def select_growth(device: Device, advance: Callable[[], None]) -> list[Growth]:
    """One frame's selection, against objects."""
    ms = []
    for objects in OBJECTS:
        asked = knapsacks(objects, 1, 0.3, seed=objects)
        ms.append(median_ms(partial(launch_select, *asked, device=device), device))
        advance()
    return grown("select", "one frame", {"objects": [*OBJECTS]}, ms)


CURVES = (flood_growth, shaft_growth, occlusion_growth, select_growth)


def growth_steps() -> int:
    """How often `run_growth` calls `advance`."""
    return len(CELLS) + 2 * len(OFFICES) + len(OBJECTS)
