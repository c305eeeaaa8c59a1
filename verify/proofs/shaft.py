"""Leaves of shafts as certificates (data/store/certificates.py), checked exactly in Python integers.

A box is hidden from a cell if subshafts tile cell x box, so that every segment from the one to the other is in one, and
an occluder meets all segments of each subshaft. Oblique occluders need this; axial ones are left to line trees.
"""

from collections import defaultdict
from dataclasses import dataclass
from itertools import pairwise, product
from typing import TYPE_CHECKING

import numpy as np

from ...data.errors import InputError
from ...data.store.certificates import LEAVES, OCCLUDERS
from ...data.store.scene_folder import read_table
from ..arithmetic import cross, dot, minus
from .certified import EXAMPLES, Certified
from .opaque import OpaqueSurfaces, area_vector, bounds_disc
from .tables import box_text, corners_of, places_of, steps_of

if TYPE_CHECKING:
    from ...data.store.bake_folder import BakeFolder

Box = list[list[int]]
Point = list[int]


@dataclass(frozen=True)
class Region:
    """Rectangles of an axial plane: low and high corners on the other two axes."""

    axis: int
    plane: int
    rectangles: list[Box]


@dataclass(frozen=True)
class Disc:
    """Triangles, and the corners of their outline."""

    outline: list[Point]
    triangles: list[list[Point]]


Occluder = Region | Disc


def leaf_holds(v: Box, x: Box, occluder: Occluder) -> bool:
    """Whether every segment from box v to box x meets an occluder.

    Args:
        v: low and high corner [grid steps].
        x: likewise.
        occluder: a real one.
    """
    if isinstance(occluder, Region):
        return _region_blocks(v, x, occluder)
    return _disc_blocks(v, x, occluder)


def _region_blocks(v: Box, x: Box, region: Region) -> bool:
    """A segment from p to q crosses plane k of axis i at (p_j |q_i - k| + q_j |p_i - k|) / |q_i - p_i|.

    That is monotonic in every coordinate alone, so corners bound it.
    """
    i, k = region.axis, region.plane
    if not (v[1][i] <= k < x[0][i] or v[0][i] >= k > x[1][i]):
        return False
    ways = [(abs(p - k), abs(q - k)) for p, q in product((v[0][i], v[1][i]), (x[0][i], x[1][i]))]
    span = []
    for j in (j for j in range(3) if j != i):
        # Rectangles have integer sides: what holds a crossing holds the grid steps on either side of it.
        low = min((v[0][j] * after + x[0][j] * before) // (before + after) for before, after in ways)
        high = max(-(-(v[1][j] * after + x[1][j] * before) // (before + after)) for before, after in ways)
        span.append((low, high))
    return in_union(span, region.rectangles)


def in_union(span: list[tuple[int, int]], rectangles: list[Box]) -> bool:
    """Whether a closed rectangle, given by its extent on either axis, lies in the union of closed ones."""
    near = [r for r in rectangles if all(r[0][c] <= span[c][1] and r[1][c] >= span[c][0] for c in (0, 1))]
    # Twice the middles of what the sides of the rectangles cut it into.
    middles = []
    for c, (low, high) in enumerate(span):
        lines = sorted({low, high, *(side[c] for r in near for side in r if low < side[c] < high)})
        middles.append([a + b for a, b in pairwise(lines)] or [2 * low])
    return all(
        any(2 * r[0][0] <= a <= 2 * r[1][0] and 2 * r[0][1] <= b <= 2 * r[1][1] for r in near)
        for a, b in product(*middles)
    )


def _disc_blocks(v: Box, x: Box, disc: Disc) -> bool:
    """The theorem at the top of data/patches.py; every quantity is affine in either end, so corners decide."""
    n = area_vector(disc.outline)
    heights = [dot(n, p) for triangle in disc.triangles for p in triangle]
    (v_low, v_high), (x_low, x_high) = _range(n, v), _range(n, x)
    ahead = v_high <= min(heights) and max(heights) < x_low
    back = v_low >= max(heights) and min(heights) > x_high
    if not (any(n) and (ahead or back) and all(a < b for a, b in zip(*v, strict=True))):
        return False
    turns = set()
    for q in product(*zip(*x, strict=True)):
        for e, b in enumerate(disc.outline):
            # (p - q) . normal over all p of v: on which side of the edge the segments pass.
            normal = cross(minus(disc.outline[e - 1], q), minus(b, q))
            low, high = _range(normal, v)
            at = dot(normal, q)
            turns |= {side for side, reached in ((1, high > at), (-1, low < at)) if reached}
            if len(turns) == 2:
                return False
    return True


def _range(n: Point, box: Box) -> tuple[int, int]:
    """Least and greatest n . p over a box."""
    low, high = box
    ends = [(c * a, c * b) if c > 0 else (c * b, c * a) for c, a, b in zip(n, low, high, strict=True)]
    return sum(end[0] for end in ends), sum(end[1] for end in ends)


def tiled(low: list[int], high: list[int], leaves: list[Box]) -> bool:
    """Whether leaves are what a sequence of cuts across makes of a box of any dimension.

    A cut is at a coordinate of an axis that no leaf reaches over. Sides without length are never cut.
    """
    if len(leaves) == 1:
        return leaves[0] == [low, high]
    for axis in range(len(low)):
        ordered = sorted(leaves, key=lambda leaf: leaf[0][axis])
        reached, groups = low[axis], []
        for leaf in ordered:
            if not groups or (reached <= leaf[0][axis] and low[axis] < leaf[0][axis] < high[axis]):
                groups.append((leaf[0][axis], []))
            groups[-1][1].append(leaf)
            reached = max(reached, leaf[1][axis])
        if len(groups) > 1:
            cuts = [low[axis], *(at for at, _ in groups[1:]), high[axis]]
            return all(
                tiled([*low[:axis], a, *low[axis + 1 :]], [*high[:axis], b, *high[axis + 1 :]], group)
                for (a, b), (_, group) in zip(pairwise(cuts), groups, strict=True)
            )
    return False


def check_shafts(
    bake: "BakeFolder",
    surfaces: OpaqueSurfaces | None,
    ids: np.ndarray,
    cells: np.ndarray,
    boxes: np.ndarray,
    found: Certified,
) -> np.ndarray:
    """Which proofs hold by their leaves, shape (n,), bool.

    Args:
        bake: with certificates.
        surfaces: opaque triangles of the model; None for a bare graph, which has no leaves.
        ids: of the proofs, shape (n,).
        cells: view cell of each [grid steps], shape (n, 2, 3), integers.
        boxes: its hidden box, likewise.
        found: leaves are counted, and failures told here.

    Raises:
        InputError: tables are missing or lack a column, coordinates are off the grid, or ids repeat.
    """
    paths = [bake.folder / f"{name}.parquet" for name in ("leaves", "occluders")]
    leaves, table = (read_table(path, names) for path, names in zip(paths, (LEAVES, OCCLUDERS), strict=True))
    occluder_ids = table["occluder_id"].to_numpy()
    places_of(occluder_ids, occluder_ids, paths[1], "occluder_id", once=True)
    rows = places_of(leaves["proof_id"].to_numpy(), ids, paths[0], "proof_id").tolist()
    which = places_of(leaves["occluder_id"].to_numpy(), occluder_ids, paths[0], "occluder_id").tolist()
    corners = corners_of(leaves, LEAVES[2:], bake.grid_m, paths[0]).reshape(-1, 2, 2, 3).tolist()
    occluders = [_occluder(row, surfaces, bake.grid_m, found) for row in table.to_pylist()]
    subshafts: dict[int, list[Box]] = defaultdict(list)
    good = np.zeros(len(ids), bool)
    good[rows] = True
    for row, occluder, (v, x) in zip(rows, which, corners, strict=True):
        subshafts[row].append([v[0] + x[0], v[1] + x[1]])
        if good[row] and not (occluders[occluder] and leaf_holds(v, x, occluders[occluder])):
            good[row] = False
    for row, parts in subshafts.items():
        whole = np.concatenate([cells[row], boxes[row]], axis=1).tolist()
        good[row] = good[row] and tiled(*whole, parts)
    found.leaves += len(rows)
    return good


def _occluder(row: dict, surfaces: OpaqueSurfaces | None, grid_m: float, found: Certified) -> Occluder | None:
    """An occluder, or None if the model has none such."""
    where, why = f"occluder {row['occluder_id']}", "a bare graph has no occluders"
    if row["kind"] not in ("region", "patch"):
        raise InputError(f"{where}: expected the kind region or patch, found {row['kind']!r}")
    if row["kind"] == "region" and row["axis"] not in (0, 1, 2):
        raise InputError(f"{where}: expected an axis from 0 to 2, found {row['axis']}")
    if surfaces is not None and row["kind"] == "region":
        plane = int(steps_of(np.array([row["coordinate"]], float), grid_m, where)[0])
        rectangles = _points(row["rectangles"], 4, grid_m, where).reshape(-1, 2, 2)
        wrong = surfaces.open_rectangle(row["axis"], plane, rectangles)
        if wrong is None:
            return Region(row["axis"], plane, rectangles.tolist())
        why = f"{box_text(wrong)} of plane {plane} of axis {row['axis']} is not opaque throughout"
    elif surfaces is not None:
        outline = _points(row["corners"], 3, grid_m, where).tolist()
        triangles = surfaces.disc(row["object_id"], row["triangles"] or [])
        if triangles is not None and bounds_disc(triangles, outline):
            return Disc(outline, triangles.tolist())
        why = f"object {row['object_id']} has no such opaque triangles with this outline"
    found.failed_occluders += 1
    found.tell([f"{where}: {why}"] if found.failed_occluders <= EXAMPLES else [])
    return None


def _points(metres: list[float] | None, width: int, grid_m: float, where: str) -> np.ndarray:
    """Numbers of a list in rows of some width [grid steps], int64."""
    if not metres or len(metres) % width:
        raise InputError(f"{where}: expected a list of {width} numbers per point or rectangle, found {metres}")
    return steps_of(np.array(metres, float), grid_m, where).reshape(-1, width)
