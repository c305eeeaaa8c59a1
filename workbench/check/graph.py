"""Check claims about a bare cell graph: lines through its portals decide every pair of cells, without rays."""

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from ...data.graph import CellGraph
from ...data.scene import GRID_M
from ...data.store.bake_folder import BakeFolder, cells_table, portals_table
from ...data.store.claims import read_claims
from ...data.store.view_cells import ViewCells
from ...verify.check_result import CheckResult, WrongPair
from ...verify.rays.witness import confirm_cells, read_witnesses, visible_rows
from ..bake.run import bake


def check_graph(graph: CellGraph, pvs: Sequence[object], targets: str | None = None) -> CheckResult:
    """Judge claims of cells that see cells by the portals between them.

    Args:
        graph: the cells and portals.
        pvs: the claims, as `data.store.claims.read_claims` takes them.
        targets: as for `read_claims`.

    Returns:
        Every wrong-hidden pair, with a stabbing line that exact arithmetic confirms. Lines that only touch a portal's
        edge show nothing.

    Raises:
        InputError: the claims are unusable, or speak of objects.
    """
    start = time.perf_counter()
    view = ViewCells(graph, np.arange(graph.cell_count), np.zeros(graph.cell_count, bool))
    claims = read_claims(pvs, view, [], targets)
    seconds = {"read": time.perf_counter() - start}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "graph"
        folder.mkdir()
        pq.write_table(cells_table(graph, GRID_M), folder / "cells.parquet")
        pq.write_table(portals_table(graph, GRID_M), folder / "portals.parquet")
        start = time.perf_counter()
        truth = bake(folder, Path(scratch) / "truth.bake")
        seconds["decide"] = time.perf_counter() - start
        return _compare(graph, claims.cells, truth, seconds)


def _compare(graph: CellGraph, claimed: np.ndarray, truth: BakeFolder, seconds: dict[str, float]) -> CheckResult:
    start = time.perf_counter()
    seen, potential = np.zeros_like(claimed), truth.potential_cells
    rows = visible_rows(truth.cell_to_cell)
    lines = read_witnesses(rows, "reached_cell_id", truth.grid_m)
    seen[lines.cells, lines.targets] = True
    missing = np.flatnonzero(~claimed[lines.cells, lines.targets])
    result = CheckResult(
        cell_ids=np.arange(graph.cell_count),
        sources=np.flatnonzero(graph.inhabitable),
        object_names=[],
        cell_rooms=[str(name) for name in graph.cell_names],
        claimed={"cell": claimed},
        seen={"cell": seen},
        exact=True,
        seconds=seconds,
        grid_m=truth.grid_m,
        boxes=graph.cells,
    )
    open_ = potential & ~seen & ~claimed
    if len(missing):
        chosen = read_witnesses(rows.take(missing), "reached_cell_id", truth.grid_m)
        for k, reason in enumerate(confirm_cells(chosen, graph, None)):
            portals = chosen.portals[chosen.starts[k] : chosen.starts[k + 1]]
            line = chosen.origins[k], chosen.ends[k]
            pair = int(chosen.cells[k]), int(chosen.targets[k])
            margin = _margin(*line, graph, portals)
            if reason:
                open_[pair] = True
            else:
                result.wrong.append(WrongPair("cell", *pair, *line, tuple(map(int, portals)), margin))
    left = f"; {open_.sum():,} pairs that the claims hide were left open" if open_.any() else ""
    result.statement = f"exact: every pair of cells was decided by its portals{left}"
    seconds["adjudicate"] = time.perf_counter() - start
    return result


def _margin(origin: np.ndarray, end: np.ndarray, graph: CellGraph, portals: np.ndarray) -> float:
    """Least distance, in the portals' planes, from where a line crosses them to their edges [grid steps]."""
    axis = graph.portal_axis[portals].astype(int)
    row, boxes = np.arange(len(portals)), graph.portals[portals].astype(np.float64)
    share = (boxes[row, 0, axis] - origin[axis]) / (end - origin)[axis]
    points = origin + share[:, None] * (end - origin)
    inside = np.minimum(points - boxes[:, 0], boxes[:, 1] - points)
    inside[row, axis] = np.inf
    return float(inside.min(initial=np.inf))
