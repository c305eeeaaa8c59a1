"""The certificates of a bake (data/store/certificates.py), checked exactly and without what made them.

What is absent from the tables of a bake must lie in boxes that are proved hidden, each by a line tree (`hides`, here)
or by pieces of its shaft (verify/proofs/shaft.py), past blockers that the model or the cell graph itself shows to
be real. All arithmetic is that of Python integers.

The claim of a proof: the sightlines from the open cell to the box that pass every blocker are not an open set. So lines
on the border of what a row allows need not be looked at, and every row may be read as strict.
"""

import time
from collections.abc import Iterator
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from ...data.curtains import FALLING, RISING
from ...data.errors import InputError
from ...data.scene import OPAQUE
from ...data.store.certificates import BLOCKERS, CORNERS, NODE_STEP, PARTING, PROOFS, TABLES, TREES
from ...data.store.scene_folder import read_table
from .boxes import in_boxes
from .certified import EXAMPLES, Certified
from .curtain import is_opaque
from .opaque import OpaqueSurfaces
from .shaft import check_shafts
from .tables import box_text, corners_of, places_of, plans_of
from .ways import Blocker, End, partings, ways_of

if TYPE_CHECKING:
    from ...data.graph import CellGraph
    from ...data.store.bake_folder import BakeFolder

# Rows (i, j, a, b) are kept in a list for each ordered pair of axes; a cycle takes one row of each of its lists.
LISTS = ((0, 1), (1, 0), (1, 2), (2, 1), (0, 2), (2, 0))
CYCLES = ((0, 1), (2, 3), (4, 5), (0, 2, 5), (4, 3, 1))
TAG_BASE, CUT_STEP = 128, 1 << 24


def has_certificates(bake: "BakeFolder") -> bool:
    """Whether a bake claims to have them, or has some."""
    return bool(bake.manifest.get("settings", {}).get("certify")) or (bake.folder / "proofs.parquet").exists()


def check_certificates(bake: "BakeFolder") -> Certified:
    """Check every certificate of a bake, and that everything it hides has one.

    Exact: a blocker, a proof or a pair is called good only if it is. What another maker certifies by a partition that
    no sequence of cuts makes, or by a disc that turns away from its own outline, fails although it may be true.

    Raises:
        InputError: tables are missing or lack a column, coordinates are off the grid, or ids repeat.
    """
    start = time.perf_counter()
    paths = {name: bake.folder / f"{name}.parquet" for name in TABLES}
    proofs, trees = read_table(paths["proofs"], PROOFS), read_table(paths["trees"], TREES)
    ids = proofs["proof_id"].to_numpy()
    cell = places_of(proofs["cell_id"].to_numpy(), np.arange(bake.graph.cell_count), paths["proofs"], "cell_id")
    boxes = corners_of(proofs, CORNERS, bake.grid_m, paths["proofs"]).reshape(-1, 2, 3)
    places_of(ids, ids, paths["proofs"], "proof_id", once=True)
    plans = plans_of(proofs, bake.grid_m, paths["proofs"])
    ends = [End(box, plan) for box, plan in zip(boxes.tolist(), plans, strict=True)]
    sources = cell_ends(bake.graph)
    closed = proofs["closed"].to_numpy(zero_copy_only=False).astype(bool)
    found = Certified(len(ids), made_s=float(bake.manifest.get("certificate_s", 0.0)))
    found.bytes = sum(path.stat().st_size for path in paths.values() if path.exists())
    surfaces = _opaque_surfaces(bake)
    blockers = _read_blockers(bake, surfaces, found)
    good = check_shafts(bake, surfaces, ids, bake.graph.cells[cell], boxes, found)
    rows = places_of(trees["proof_id"].to_numpy(), ids, paths["trees"], "proof_id", once=True)
    for row, words in zip(rows.tolist(), trees["words"].to_pylist(), strict=True):
        good[row] = good[row] or hides(sources[cell[row]], ends[row], bool(closed[row]), words, blockers)
        found.leaves += sum(word < 0 for word in words)
    found.failed_proofs = int((~good).sum())
    found.tell(
        f"proof {ids[row]}: cell {bake.cell_text(cell[row])} x {box_text(boxes[row])}" for row in np.flatnonzero(~good)
    )
    _check_objects(bake, cell[good & closed], [ends[row] for row in np.flatnonzero(good & closed)], found)
    if bake.claims_cells:
        whole = good & np.array([plan is None for plan in plans], bool)
        _check_cells(bake, cell[whole], boxes[whole], found)
    found.checked_s = time.perf_counter() - start
    return found


def cell_ends(graph: "CellGraph") -> list[End]:
    """Cells of a graph, with their plans."""
    ends = [End(box) for box in graph.cells.tolist()]
    for row, plan in zip(graph.plans.rows.tolist(), graph.plans.corners.tolist(), strict=True):
        ends[row] = End(ends[row].box, plan)
    return ends


def hides(source: End, target: End, closed: bool, words: list[int], blockers: dict[int, Blocker]) -> bool:
    """Whether a line tree proves that no sightline leads from a cell into a box.

    Args:
        source: the cell.
        target: the box.
        closed: whether a blocker on the box's near face leaves that face in sight.
        words: of the tree.
        blockers: by id, real ones.

    A tree says of every line through both that it meets a blocker after it left the cell and before it enters the box.
    So does every sightline along it, wherever it begins and ends; and if the boxes overlap, no tree can say so.
    """
    rest = iter(words)
    try:
        for octant in range(8):
            s, t = source.mirrored(octant), target.mirrored(octant)
            # A sightline leads forwards on every axis. Past an edge that parts the plans it goes towards the target.
            if all(t.box[1][i] > s.box[0][i] for i in range(3)):
                rows = [[(end.box[0][i], end.box[1][j]) for end in (s, t)] for i, j in LISTS]
                if not _excluded(rest, rows, (s, t, closed, octant), blockers, partings(s, t)):
                    return False
    except (StopIteration, LookupError, RecursionError):
        # The tree ends too early, or names rows or blockers that do not exist.
        return False
    return next(rest, None) is None


def _excluded(
    words: Iterator[int],
    rows: list[list[tuple[int, int]]],
    about: tuple[End, End, bool, int],
    blockers: dict[int, Blocker],
    given: dict[int, list[int]],
) -> bool:
    """Whether the next words show that rows exclude all lines of an octant past the blockers.

    Args:
        words: that are left.
        rows: so far.
        about: mirrored source and target, whether it is closed, and the octant.
        blockers: by id.
        given: cuts by tag that hold for all sightlines of the octant.
    """
    word = next(words)
    if word < 0:
        more, tag = divmod(-1 - word, CUT_STEP)
        return contradict([_cut(rows, tag, given), *[_cut(rows, -1 - next(words), given) for _ in range(more)]])
    number, order = divmod(word, NODE_STEP)
    for way in ways_of(number, [order >> 2 * n & 3 for n in range(4)], *about, blockers):
        for i, j, a, b in way:
            rows[LISTS.index((i, j))].append((a, b))
        done = _excluded(words, rows, about, blockers, given)
        for i, j, _, _ in way:
            rows[LISTS.index((i, j))].pop()
        if not done:
            return False
    return True


def _cut(rows: list[list[tuple[int, int]]], tag: int, given: dict[int, list[int]]) -> list[int]:
    """The cut g of a cycle that a tag names: the sum of its rows w_i a - w_j b < xi_i - xi_j is g . w < 0."""
    if tag % 8 == PARTING:
        return given[tag]
    cycle, places = CYCLES[tag % 8], tag // 8
    g = [0, 0, 0]
    for p in cycle:
        (i, j), (a, b) = LISTS[p], rows[p][places % TAG_BASE]
        g[i] += a
        g[j] -= b
        places //= TAG_BASE
    return g


def contradict(cuts: list[list[int]]) -> bool:
    """Whether no w > 0 has g . w < 0 for all of one to three cuts g.

    It has none if weights >= 0, not all 0, add the cuts up to something nowhere negative. Weights of the three cuts can
    be taken from the extreme rays of their cone, where as many conditions are tight as there are cuts, less one.
    """
    rows = list(zip(*cuts, strict=True))
    if len(cuts) == 1:
        rays = [(1,)]
    elif len(cuts) == 2:
        rays = [(-b, a) for a, b in rows]
    elif len(cuts) == 3:
        rays = [
            (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
            for a, b in combinations(rows, 2)
        ]
    else:
        return False
    return any(
        min(ray) >= 0 and any(ray) and all(sum(x * y for x, y in zip(row, ray, strict=True)) >= 0 for row in rows)
        for ray in (*rays, *(tuple(-x for x in ray) for ray in rays))
    )


def _opaque_surfaces(bake: "BakeFolder") -> OpaqueSurfaces | None:
    """Opaque triangles of the model; None for a bare graph."""
    if bake.scene is None:
        return None
    return OpaqueSurfaces(*bake.scene.triangles(*OPAQUE))


def _read_blockers(bake: "BakeFolder", surfaces: OpaqueSurfaces | None, found: Certified) -> dict[int, Blocker]:
    """Blockers by id, without those that are not real."""
    path = bake.folder / "blockers.parquet"
    table = read_table(path, BLOCKERS)
    corners = corners_of(table, BLOCKERS[2:], bake.grid_m, path)
    # Curtains reach from their coordinate, which is a height, to this one.
    tops = corners_of(table, ("top",), bake.grid_m, path)[:, 0] if "top" in table.column_names else corners[:, 0]
    ids, axes = table["blocker_id"].to_numpy(), table["axis"].to_numpy()
    places_of(ids, ids, path, "blocker_id", once=True)
    blockers: dict[int, Blocker] = {}
    rows = zip(ids.tolist(), axes.tolist(), corners.tolist(), tops.tolist(), strict=True)
    for number, k, (c, u0, v0, u1, v1), top in rows:
        if k not in (0, 1, 2, RISING, FALLING):
            raise InputError(f"{path}: expected an axis from 0 to 2 or a curtain's {RISING} or {FALLING}, found {k}")
        if k < RISING:
            blocker = Blocker(k, [[*p[:k], c, *p[k:]] for p in ([u0, v0], [u1, v1])])
        else:
            blocker = Blocker(k, [[u0, v0, c], [u1, v1, top]])
        if _is_real(blocker, bake, surfaces):
            blockers[number] = blocker
        else:
            found.failed_occluders += 1
            told = (
                f"blocker {number}: {box_text(blocker.box)}, {('x', 'y', 'z', 'rising', 'falling')[k]}, does not block"
            )
            found.tell([told] if found.failed_occluders <= EXAMPLES else [])
    return blockers


def _is_real(blocker: Blocker, bake: "BakeFolder", surfaces: OpaqueSurfaces | None) -> bool:
    """Whether a blocker is in the model, or in a bare graph."""
    k, (low, high) = blocker.axis, blocker.box
    if k >= RISING:
        a, b = ([low[0], low[1]], [high[0], high[1]]) if k == RISING else ([low[0], high[1]], [high[0], low[1]])
        return surfaces is not None and is_opaque(surfaces, [a, b], low[2], high[2])
    rectangle = np.array([[*corner[:k], *corner[k + 1 :]] for corner in (low, high)])
    if surfaces is None:
        return graph_blocks(bake.graph, k, low[k], rectangle)
    return surfaces.open_rectangle(k, low[k], rectangle[None]) is None


def graph_blocks(graph: "CellGraph", axis: int, plane: int, rectangle: np.ndarray) -> bool:
    """Whether no sightline that stays in the cells and passes portals crosses a plane inside a rectangle.

    Where it crosses the plane it is either inside a cell that reaches over it, or leaves one cell for another, which it
    may only do through a portal on the plane. So neither may meet the inside of the rectangle.
    """
    uv = [i for i in range(3) if i != axis]
    over = (graph.cells[:, 0, axis] < plane) & (graph.cells[:, 1, axis] > plane)
    on = (graph.portal_axis == axis) & (graph.portals[:, 0, axis] == plane)
    gaps = np.concatenate([graph.cells[over], graph.portals[on]])[:, :, uv]
    return not ((gaps[:, 0] < rectangle[1]) & (gaps[:, 1] > rectangle[0])).all(axis=1).any()


def _check_cells(bake: "BakeFolder", cell: np.ndarray, boxes: np.ndarray, found: Certified) -> None:
    """Count the hidden pairs of cells that proofs cover: a sightline can be followed either way."""
    cells, inhabitable = bake.graph.cells, bake.graph.inhabitable
    proved = np.zeros((len(cells), len(cells)), bool)
    for source, (low, high) in zip(cell, boxes, strict=True):
        proved[source] |= (cells[:, 0] >= low).all(axis=1) & (cells[:, 1] <= high).all(axis=1)
    hidden = ~bake.potential_cells & inhabitable[:, None]
    bad = np.argwhere(hidden & ~(proved | proved.T))
    found.covered += int(hidden.sum()) - len(bad)
    found.uncovered += len(bad)
    named = bake.cell_text
    found.tell(f"cell {named(a)}, cell {named(b)}: hidden, but in no box of a proof that holds" for a, b in bad)


def _check_objects(bake: "BakeFolder", cell: np.ndarray, ends: list[End], found: Certified) -> None:
    """Count the hidden pairs (cell, object) whose triangles lie in boxes, or prisms, of proofs."""
    if bake.scene is None:
        return
    triangles, starts = bake.scene.triangles()[0], bake.scene.triangle_starts
    bounds, present = bake.scene.object_bounds(), np.diff(starts) > 0
    boxes = np.array([end.box for end in ends], np.int64).reshape(-1, 2, 3)
    whole = np.array([end.plan is None for end in ends], bool)
    known: dict[tuple[int, tuple[int, ...]], bool] = {}
    bad = []
    names = {end: n for n, end in enumerate({_name(end): end for end in ends})}
    numbers = np.array([names[_name(end)] for end in ends], np.int64)
    for source in np.flatnonzero(bake.graph.inhabitable):
        hidden = np.flatnonzero(~bake.object_sets[source] & present)
        mine = np.flatnonzero(cell == source)
        for target in hidden.tolist():
            low, high = bounds[target]
            holds = (boxes[mine, 0] <= low).all(axis=1) & (boxes[mine, 1] >= high).all(axis=1)
            if (holds & whole[mine]).any():
                continue
            near = mine[((boxes[mine, 0] <= high) & (boxes[mine, 1] >= low)).all(axis=1)]
            key = target, tuple(sorted(set(numbers[near].tolist())))
            if key not in known:
                own = triangles[starts[target] : starts[target + 1]].astype(np.int64)
                known[key] = in_boxes(own, [ends[row] for row in near])
            if not known[key]:
                bad.append((source, target))
        found.covered += len(hidden)
    found.covered -= len(bad)
    found.uncovered += len(bad)
    why = "hidden, but not all of it in boxes of proofs that hold"
    found.tell(f"cell {bake.cell_text(a)}, object {b}: {why}" for a, b in bad)


def _name(end: End) -> str:
    """What tells two ends apart."""
    return f"{end.box} {end.plan}"
