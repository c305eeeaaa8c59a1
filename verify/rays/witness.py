"""Are the stored witnesses true? Every sightline of a bake's tables, checked exactly.

A witness is `origin` and `direction` in metres; origin + direction (rounded to float64) is the end of the sightline.
Shares no code with the engines that found it.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from ...data.graph import OTHER_AXES, CellGraph
from ..arithmetic import as_integers, sign
from ..exact.plan import inside_plans
from ..exact.sightline import Sight, Sightlines, sure_sign

# The object of a witness must be hit by the sightline prolonged by this factor.
PROLONGED = 1.001
CHUNK = 100_000

if TYPE_CHECKING:
    from ...data.store.bake_folder import BakeFolder

REASONS = (
    "confirmed",
    "no sightline stored",
    "starts outside its cell",
    "starts on or inside a solid",
    "ends outside the reached cell",
    "does not pass its portals in order",
    "is blocked",
    "grazes a triangle",
    "misses the object",
)
MISSING, START, SOLID, END, PORTALS, BLOCKED, GRAZES, MISSES = range(1, 9)


@dataclass
class Confirmed:
    """How many stored witnesses hold.

    Attributes:
        count: by reason of `REASONS`; the first is "confirmed".
        examples: up to five refuted rows, one line each.
    """

    count: np.ndarray = field(default_factory=lambda: np.zeros(len(REASONS), np.int64))
    examples: list[str] = field(default_factory=list)

    @property
    def confirmed(self) -> int:
        """Witnesses that hold."""
        return int(self.count[0])

    @property
    def refuted(self) -> int:
        """Witnesses that do not."""
        return int(self.count[1:].sum())

    def add(
        self,
        kind: str,
        cells: np.ndarray,
        targets: np.ndarray,
        reasons: np.ndarray,
        cell_text: Callable[[int], str] = str,
    ) -> None:
        """Count the outcomes of rows (cell, target) of one table; `cell_text` is what cells are called in examples."""
        self.count += np.bincount(reasons, minlength=len(REASONS))
        for row in np.flatnonzero(reasons)[: 5 - len(self.examples)]:
            target = cell_text(int(targets[row])) if kind == "cell" else targets[row]
            self.examples.append(f"cell {cell_text(int(cells[row]))} sees {kind} {target}: {REASONS[reasons[row]]}")


@dataclass(frozen=True)
class Witnesses:
    """Sightlines of some rows of a table, in grid steps.

    Attributes:
        cells: source cells, shape (n,), int64.
        targets: reached cells or objects, shape (n,), int64.
        origins: shape (n, 3), float64.
        ends: shape (n, 3), float64.
        portals: all portal lists one after the other, int64.
        starts: where each row's list starts, shape (n + 1,), int64.
    """

    cells: np.ndarray
    targets: np.ndarray
    origins: np.ndarray
    ends: np.ndarray
    portals: np.ndarray
    starts: np.ndarray


def visible_rows(table: pa.Table) -> pa.Table:
    """The rows whose verdict is visible."""
    return table.filter(pc.equal(pc.cast(table["verdict"], pa.string()), "visible"))


def witnessed_objects(bake: "BakeFolder") -> np.ndarray:
    """Objects with a witness, shape (cells, objects), bool."""
    rows, out = visible_rows(bake.cell_to_object), np.zeros_like(bake.potential_objects)
    out[rows["cell_id"].to_numpy(), rows["object_id"].to_numpy()] = True
    return out


def read_witnesses(table: pa.Table, target: str, grid_m: float) -> Witnesses:
    """Sightlines of a table's rows; `target` names the target column. NaN where none is stored."""

    def vectors(name: str) -> np.ndarray:
        columns = [table[f"{name}_{axis}"].cast(pa.float64()).to_numpy() for axis in "xyz"]
        return np.stack(columns, axis=1) if len(table) else np.zeros((0, 3))

    origins, ends = vectors("origin"), vectors("origin") + vectors("direction")
    starts, portals = np.zeros(len(table) + 1, np.int64), np.zeros(0, np.int64)
    if "portals" in table.column_names and len(table):
        lists = table["portals"].combine_chunks()
        lengths = pc.fill_null(pc.list_value_length(lists), 0).to_numpy(zero_copy_only=False)
        starts[1:] = np.cumsum(lengths)
        portals = pc.list_flatten(lists).to_numpy(zero_copy_only=False).astype(np.int64)
    cells, targets = (table[name].to_numpy().astype(np.int64) for name in ("cell_id", target))
    return Witnesses(cells, targets, origins / grid_m, ends / grid_m, portals, starts)


def confirm_cells(witnesses: Witnesses, graph: CellGraph, lines: Sightlines | None) -> np.ndarray:
    """Reason code of each cell-to-cell witness, shape (n,), int; 0 is confirmed.

    Args:
        witnesses: the sightlines.
        graph: cells and portals.
        lines: the opaque triangles; None for a bare graph, whose sightline must pass the *inside* of the listed portals
            and end inside the reached cell. With triangles, the portals' edges and the cell's boundary may be touched.
    """
    reasons, ready = _starts_well(witnesses, graph, lines)
    low, high = graph.cells[witnesses.targets, 0], graph.cells[witnesses.targets, 1]
    ends = np.where(np.isfinite(witnesses.ends), witnesses.ends, 0)
    inside = (ends >= low) & (ends <= high) if lines is not None else (ends > low) & (ends < high)
    _settle(reasons, ready, ~inside.all(axis=1), END)
    passed = passes_portals(witnesses, graph, ready)
    if lines is None:
        _settle(reasons, ready, passed <= 0, PORTALS)
        return reasons
    listed = np.diff(witnesses.starts) > 0
    _settle(reasons, ready, listed & (passed < 0), PORTALS)
    rows = np.flatnonzero(ready)
    sights = lines.check(witnesses.origins[rows], witnesses.ends[rows])
    reasons[rows] = np.select([sights == Sight.BLOCKED, sights == Sight.GRAZE], [BLOCKED, GRAZES], 0)
    return reasons


def confirm_objects(witnesses: Witnesses, graph: CellGraph, lines: Sightlines, glass: Sightlines) -> np.ndarray:
    """Reason code of each cell-to-object witness, shape (n,), int; 0 is confirmed.

    The sightline must be clear of all other opaque objects, and meet the object when prolonged by 0.1 %.
    """
    reasons, ready = _starts_well(witnesses, graph, lines)
    rows = np.flatnonzero(ready)
    origins, ends, objects = witnesses.origins[rows], witnesses.ends[rows], witnesses.targets[rows]
    met, crowded = np.zeros(len(rows), bool), np.zeros(len(rows), bool)
    for triangles, opaque in ((lines, True), (glass, False)):
        segments, ids, _ = triangles.hits(origins, origins + PROLONGED * (ends - origins))
        own = triangles.owners[ids] == objects[segments]
        met[segments[own]] = True
        crowded[segments[~own & opaque]] = True
    reasons[rows[~met]] = MISSES
    # Another object within the last 0.1 % does no harm: look again without them.
    again = np.flatnonzero(met & crowded)
    segments, ids, kinds = lines.hits(origins[again], ends[again])
    other = lines.owners[ids] != objects[again][segments]
    worst = np.zeros(len(again), np.uint8)
    np.maximum.at(worst, segments[other], kinds[other])
    reasons[rows[again]] = np.select([worst == Sight.BLOCKED, worst == Sight.GRAZE], [BLOCKED, GRAZES], 0)
    return reasons


def _settle(reasons: np.ndarray, ready: np.ndarray, failed: np.ndarray, reason: int) -> None:
    """Give rows that are still ready and fail their reason, and take them out."""
    reasons[ready & failed] = reason
    ready &= ~failed


def _starts_well(witnesses: Witnesses, graph: CellGraph, lines: Sightlines | None) -> tuple[np.ndarray, np.ndarray]:
    """Reason codes so far, and the rows whose sightline exists and starts in its cell, outside every solid."""
    reasons, ready = np.zeros(len(witnesses.cells), np.int64), np.ones(len(witnesses.cells), bool)
    finite = np.isfinite(witnesses.origins).all(axis=1) & np.isfinite(witnesses.ends).all(axis=1)
    _settle(reasons, ready, ~finite, MISSING)
    low, high = graph.cells[witnesses.cells, 0], graph.cells[witnesses.cells, 1]
    inside = (witnesses.origins > low) & (witnesses.origins < high)
    inside = inside.all(axis=1) & inside_plans(graph.plans, witnesses.cells, witnesses.origins)
    _settle(reasons, ready, ~inside, START)
    if lines is not None:
        rows = np.flatnonzero(ready)
        solid = np.zeros(len(ready), bool)
        solid[rows] = ~lines.outside_solids(witnesses.origins[rows])
        _settle(reasons, ready, solid, SOLID)
    return reasons, ready


def passes_portals(witnesses: Witnesses, graph: CellGraph, ready: np.ndarray) -> np.ndarray:
    """Whether each sightline passes its portals in order, from its cell to the target: 1 inside, 0 on an edge, -1 no.

    Exact. Cells are convex and a portal lies on the boundary of both its cells, so the line is in the right cells.

    Args:
        witnesses: the sightlines; an empty list stands for a cell that sees itself.
        graph: cells and portals.
        ready: rows to look at, shape (n,), bool; the others get -1.
    """
    result = np.where(ready, 1, -1).astype(np.int8)
    here, lengths = witnesses.cells.copy(), np.diff(witnesses.starts)
    for place in range(int(lengths.max(initial=0))):
        rows = np.flatnonzero((lengths > place) & (result >= 0))
        ids = witnesses.portals[witnesses.starts[rows] + place]
        known = (ids >= 0) & (ids < graph.portal_count)
        result[rows[~known]] = -1
        rows, ids = rows[known], ids[known]
        low, high = graph.portal_cells[ids].T
        forward = low == here[rows]
        result[rows[~forward & (high != here[rows])]] = -1
        here[rows] = np.where(forward, high, low)
        origins, ends = witnesses.origins[rows], witnesses.ends[rows]
        crossed = _crosses(origins, ends, graph.portals[ids], graph.portal_axis[ids].astype(int), forward)
        result[rows] = np.minimum(result[rows], crossed)
    result[ready & (here != witnesses.targets)] = -1
    return result


def _crosses(
    origins: np.ndarray, ends: np.ndarray, portals: np.ndarray, axis: np.ndarray, forward: np.ndarray
) -> np.ndarray:
    """Whether segments cross flat boxes in the given sense: 1 through the inside, 0 through an edge, -1 not."""
    row = np.arange(len(axis))
    plane = portals[row, 0, axis].astype(np.float64)
    start, stop = origins[row, axis], ends[row, axis]
    ordered = np.where(forward, (start < plane) & (plane < stop), (start > plane) & (plane > stop))
    result = np.where(ordered, 1, -1).astype(np.int8)
    for other in range(2):
        u = OTHER_AXES[axis, other]
        along, across = stop - start, ends[row, u] - origins[row, u]
        for corner, outward in ((0, -1), (1, 1)):
            left = (origins[row, u] - portals[row, corner, u]) * along
            right = across * (plane - start)
            side = -outward * sure_sign(left + right, np.abs(left) + np.abs(right))
            side = np.where(forward, side, -side).astype(np.int8)
            for doubt in np.flatnonzero((side == 0) & (result >= 0)):
                pair = portals[doubt, corner, u[doubt]], plane[doubt]
                exact = _exact_side(origins[doubt], ends[doubt], int(axis[doubt]), int(u[doubt]), *pair)
                side[doubt] = -outward * (exact if forward[doubt] else -exact)
            result = np.minimum(result, side)
    return result


def _exact_side(origin: np.ndarray, end: np.ndarray, axis: int, u: int, bound: int, plane: float) -> int:
    (o, e), scale = as_integers(origin, end)
    return sign((o[u] - int(bound) * scale) * (e[axis] - o[axis]) + (e[u] - o[u]) * (int(plane) * scale - o[axis]))
