"""Visibility of bare cell graphs: seconds on one and two threads, beside a plain portal-sequence search.

Run `python -m viewcell.workbench.bench flood FOLDER...` on folders with cells.parquet and portals.parquet.
"""

import argparse
import statistics
import time
from pathlib import Path

import numpy as np

from ...data.errors import InputError
from ...data.graph import CellGraph
from ...data.rows import Rows
from ...data.store.graph_folder import read_graph
from ...kernels.flood import launch_flood
from ...kernels.launch import Device
from ...solvers.visibility.graph_engine import GraphEngine
from .timing import commit, median_range, print_head, print_row

REPEATS = 7
THREADS = (1, 2)
# Stabbing decisions per source and octant of the plain search, and sources between looks at the clock.
BASELINE_CAP = 200_000
BASELINE_CHUNK = 8
HEAD = (
    "graph",
    "cells",
    "portals",
    "inhabitable",
    "mean visible",
    "ordered pairs",
    "unknown",
    "asymmetric pairs",
    "s, 1 thread, median of 7 (range)",
    "s, 2 threads",
    "1 thread / 2 threads",
    "plain search, 1 thread: s",
    "its sources, cut",
    "plain / ours, 1 thread",
    "commit",
)


def asymmetric(rows: Rows, graph: CellGraph) -> int:
    """Pairs of inhabitable cells of which just one sees the other."""
    potential = np.zeros((graph.cell_count, graph.cell_count), bool)
    potential[rows.source, rows.target] = True
    potential = potential[np.ix_(graph.inhabitable, graph.inhabitable)]
    return int((potential != potential.T).sum()) // 2


def timed_floods(graph: CellGraph, repeats: int) -> tuple[dict[int, list[float]], Rows]:
    """Seconds of the visibility phase by thread count, in turn, after one run to warm up; and the rows found."""
    engines = {t: GraphEngine(graph, device=Device(threads=t)) for t in THREADS}
    sources = np.flatnonzero(graph.inhabitable)
    spent: dict[int, list[float]] = {t: [] for t in THREADS}
    for engine in engines.values():
        engine.compile()
    part = engines[THREADS[0]].visible(sources)
    rows = part.cells
    for _ in range(repeats):
        for threads, engine in engines.items():
            start = time.perf_counter()
            again = engine.visible(sources).cells
            spent[threads].append(time.perf_counter() - start)
            if not (np.array_equal(again.source, rows.source) and np.array_equal(again.target, rows.target)):
                raise AssertionError(f"{threads} threads: the answer differs from that of {THREADS[0]}")
    # A witness found from one end serves both, once the rows are joined as a bake joins them.
    return spent, engines[THREADS[0]].join([part])[0]


def plain_search(graph: CellGraph, limit_s: float) -> tuple[float, int, int]:
    """Seconds of the portal-sequence search alone on one thread, the sources searched, and those cut by the cap."""
    device_graph = GraphEngine(graph).model.device_graph
    sources = np.flatnonzero(graph.inhabitable)
    # A line can be followed either way, so when every cell is a source, half the octants find every pair.
    octants = (0, 2, 4, 6) if len(sources) == graph.cell_count else tuple(range(8))
    launch_flood(device_graph, sources[:1], octants, cap=10)
    start, done, cut = time.perf_counter(), 0, 0
    while done < len(sources) and time.perf_counter() - start < limit_s:
        found = launch_flood(device_graph, sources[done : done + BASELINE_CHUNK], octants, cap=BASELINE_CAP)
        done += len(found.complete)
        cut += int((~found.complete).sum())
    return time.perf_counter() - start, done, cut


def bench(folder: Path, repeats: int, limit_s: float) -> list[object]:
    """One row of the table.

    Raises:
        InputError: the folder holds no usable graph.
    """
    graph, _ = read_graph(folder)
    sources = int(graph.inhabitable.sum())
    if not sources:
        raise InputError(f"{folder}: expected at least one inhabitable cell, found none")
    spent, rows = timed_floods(graph, repeats)
    one, two = (statistics.median(spent[t]) for t in THREADS)
    seconds, searched, cut = plain_search(graph, limit_s)
    pairs = len(rows)
    return [
        folder.resolve().name,
        graph.cell_count,
        graph.portal_count,
        sources,
        f"{pairs / sources:,.1f}",
        pairs,
        int((~rows.seen).sum()),
        asymmetric(rows, graph),
        *(median_range(spent[t]) for t in THREADS),
        f"{one / two:.2f}",
        f"{seconds:,.2f}",
        f"{searched:,} of {sources:,}, {cut:,} cut",
        f"{seconds / searched * sources / one:,.1f}" + ("" if searched == sources else " (scaled)"),
        commit(),
    ]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of `run`."""
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    parser.add_argument("--repeats", type=int, default=REPEATS)
    parser.add_argument("--limit", type=float, default=60.0, help="seconds of the plain search (default 60)")


def run(options: argparse.Namespace) -> int:
    """Print the table; compiling is excluded. Returns the exit code."""
    if options.repeats < 1:
        raise InputError(f"repeats: expected 1 or more, found {options.repeats}")
    print_head(HEAD)
    for folder in options.folders:
        print_row(bench(folder, options.repeats, options.limit))
    return 0
