"""Check the potentially visible sets of a compiled Quake map by its portals: exactly if it is axial, else by lines."""

import math
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...data.errors import InputError
from ...data.progress import phase, shown
from ...data.store.claims import read_claims
from ...data.store.quake import UNIT_STEPS, LeafPortals, axial_graph, check_belongs, is_axial, read_bsp, read_prt
from ...data.store.view_cells import ViewCells
from ...data.view_cells import as_graph
from ...verify.check_result import CheckResult, WrongPair
from ...verify.rays.confidence import LEVEL
from ...verify.rays.windings import WindingLines
from .graph import check_graph

# Lines followed from each leaf between two looks at what they found.
ROUND_LINES = 2_000


def check_map(
    model: Path,
    pvs: Sequence[object],
    cells: object = None,
    *,
    rays: int,
    seed: int = 0,
    targets: str | None = None,
    progress: bool = False,
) -> CheckResult:
    """Judge which leaves a map's sets hide from which.

    Args:
        model: the .bsp, or a .prt alone.
        pvs: the sets; those in the .bsp if empty, or another .bsp, or what `data.store.claims.read_claims` takes.
        cells: the .prt beside a .bsp; by default of the same name.
        rays: lines to follow if the map is oblique.
        seed: of the lines.
        targets: as for `read_claims`.
        progress: show a bar.

    Returns:
        The wrong-hidden pairs, leaves numbered from 0 as in the .prt (one less than in the .bsp); map units.

    Raises:
        InputError: a file is missing, truncated, or of another map, or the claims are unusable.
    """
    start = time.perf_counter()
    compiled = model.suffix.lower() == ".bsp"
    if not compiled and cells is not None:
        raise InputError(f"{model}: expected no other cells beside a .prt, found {cells}")
    prt = model if not compiled else Path(str(cells)) if cells is not None else model.with_suffix(".prt")
    portals = read_prt(prt)
    if not pvs and not compiled:
        raise InputError(f"{model}: expected claims beside a .prt, such as a .bsp, found none")
    claims, notes = [], []
    for source in pvs or [model]:
        if isinstance(source, str | Path) and Path(source).suffix.lower() == ".bsp":
            sets = read_bsp(source)
            check_belongs(portals, sets, str(prt))
            claims.append(sets.potential)
            if sets.without:
                notes.append(f"{sets.without:,} leaves have no set in {source}: from there everything is claimed")
        else:
            claims.append(source)
    targets = targets or "cells"
    result, why = None, "a winding is no axial rectangle"
    if is_axial(portals):
        try:
            result = check_graph(axial_graph(portals, str(prt)), claims, targets)
        except InputError as error:
            # Leaves of an axial map that are no boxes, as compilers with detail brushes make them.
            why = str(error)
            if "overlap" not in why:
                raise
    if result is None:
        notes.append(f"checked by sampled lines: {why}")
        result = _follow_lines(portals, claims, targets, rays, seed, progress)
    else:
        result.grid_m = 1 / UNIT_STEPS
    result.seconds["read"] = time.perf_counter() - start - sum(result.seconds.values())
    result.unit, result.notes = "units", notes
    judge = "portals" if result.exact else "windings"
    result.asked = {"model": str(prt.resolve()), "judge": judge}
    return result


def _follow_lines(
    portals: LeafPortals, claims: Sequence[object], targets: str, rays: int, seed: int, progress: bool
) -> CheckResult:
    """Sampled lines through the windings, and a rational second look at each suspect."""
    count = portals.leaf_count
    boxes = np.tile(np.array([[0], [1]], np.int32), (count, 1, 3))
    claimed = read_claims(
        claims, ViewCells(as_graph(boxes), np.arange(count), np.zeros(count, bool)), [], targets
    ).cells
    settled, each = claimed.copy(), -(-rays // count)
    # A leaf sees itself; lines begin where they leave it.
    seen = np.eye(count, dtype=bool)
    joined = np.zeros(count, bool)
    joined[portals.leaves.ravel()] = True
    result = CheckResult(np.arange(count), np.flatnonzero(joined), [], {"cell": claimed}, {"cell": seen})
    start = time.perf_counter()
    windings = WindingLines(portals)
    judging = 0.0
    with shown(progress), phase("lines", each * count, "line") as bar:
        for first in range(0, each, ROUND_LINES):
            lines = min(ROUND_LINES, each - first)
            # Five numbers in a row seed a launch.
            found, suspects = windings.sample(settled, lines, seed + 5 * (first // ROUND_LINES))
            seen |= found
            judged = time.perf_counter()
            for leaf, target, origin, direction, margin in suspects:
                path = windings.path(leaf, target, origin, direction)
                if path is None:
                    result.grazes += 1
                elif not settled[leaf, target]:
                    settled[leaf, target] = True
                    end = windings.beyond(path[-1], origin, direction)
                    result.wrong.append(WrongPair("cell", leaf, target, origin, end, tuple(path), margin))
            judging += time.perf_counter() - judged
            bar.update(lines * count)
    result.rays, result.boxes = each * count, boxes
    result.seconds = {"lines": time.perf_counter() - start - judging, "adjudicate": judging}
    share = -math.expm1(math.log(LEVEL / len(result.sources)) / each)
    result.statement = (
        f"with {100 * (1 - LEVEL):g} % confidence no leaf hides more than {100 * share:.2g} % of the lines that "
        f"leave it ({each:,} random lines from each)"
    )
    return result
