"""The certificates of a bake (data/certificates.py), checked exactly and without what made them.

A pair (view cell, object) is hidden if boxes around the object are, each of them by a proof: leaves that tile cell x
box, so that every segment from the cell to the box is in one, and an occluder for every leaf that all its segments
meet. `leaf_holds` says what a leaf claims; everything else here is the same claim for millions of leaves at once, in
int64 where the magnitudes of coordinates up to 2**24 allow it, and in Python integers and rationals where not.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import pairwise, product
from typing import TYPE_CHECKING

import numpy as np

from ..data.certificates import CORNERS, LEAVES, OCCLUDERS, PROOFS
from ..data.errors import InputError
from ..data.scene import GRID_LIMIT, Role
from ..data.scene_folder import read_table
from .exact import cross, dot, minus, sign
from .opaque_exact import OpaqueSurfaces, area_vector, bounds_disc, split

if TYPE_CHECKING:
    import pyarrow as pa

    from ..data.database import Bake

# Refuted claims that are told one by one.
EXAMPLES = 5
# Rows (leaf, edge) and (object, box) looked at together.
CHUNK = 1 << 16
PAIRS = 1 << 22
# Products of three 26-bit numbers are held as two parts, the lower one of so many bits.
LIMB = 26


@dataclass(frozen=True)
class Region:
    """Rectangles of an axial plane: low and high corners on the other two axes, shape (n, 2, 2), int64."""

    axis: int
    plane: int
    rectangles: np.ndarray


@dataclass(frozen=True)
class Disc:
    """Triangles, shape (n, 3, 3), int64, and the corners of their outline."""

    outline: list[list[int]]
    triangles: np.ndarray


Occluder = Region | Disc


@dataclass
class Certified:
    """What a check of certificates found.

    Attributes:
        leaves: claims that an occluder blocks a shaft.
        failed_leaves: those that do not hold.
        proofs: claims that a box is hidden from a view cell.
        failed_proofs: those whose leaves do not tile it, or do not all hold.
        failed_occluders: occluders that are no opaque surface of the model; their leaves fail.
        covered: hidden pairs (view cell, object) whose object lies in boxes of proofs that hold.
        uncovered: hidden pairs of which a part has no proof.
        examples: some of what failed, one line each.
    """

    leaves: int = 0
    failed_leaves: int = 0
    proofs: int = 0
    failed_proofs: int = 0
    failed_occluders: int = 0
    covered: int = 0
    uncovered: int = 0
    examples: list[str] = field(default_factory=list)

    @property
    def failed(self) -> int:
        """Claims that do not hold."""
        return self.failed_leaves + self.failed_proofs + self.failed_occluders + self.uncovered

    def line(self) -> str:
        """The outcome in one line."""
        held = self.leaves - self.failed_leaves
        failed = ((self.failed_proofs, "proofs fail"), (self.failed_occluders, "occluders are not real"))
        more = "".join(f", {count:,} {what}" for count, what in failed if count)
        return (
            f"{held:,} leaves of {self.proofs:,} proofs hold, {self.failed_leaves:,} fail{more}; "
            f"{self.covered:,} hidden pairs covered, {self.uncovered:,} not"
        )

    def tell(self, lines: Iterator[str]) -> None:
        """Keep some examples of one kind."""
        self.examples += [line for line, _ in zip(lines, range(EXAMPLES), strict=False)]


def has_certificates(bake: "Bake") -> bool:
    """Whether a bake claims to have them, or has some."""
    return bool(bake.manifest.get("settings", {}).get("certify")) or (bake.folder / "proofs.parquet").exists()


def check_certificates(bake: "Bake") -> Certified:
    """Check every certificate of a bake, and that everything it hides has one.

    Exact in every part: a leaf, an occluder, a proof or a pair is called good only if it is. What a bake of another
    maker certifies by partitions that no sequence of cuts makes, or by a disc that turns away from its own outline,
    fails although it may be true.

    Raises:
        InputError: tables are missing or lack a column, coordinates are off the grid, or ids repeat.
    """
    tables = _read(bake)
    found = Certified(len(tables.leaf_proof), proofs=len(tables.cell))
    holds = _check_leaves(bake, tables, found)
    found.failed_leaves = int((~holds).sum())
    found.tell(
        f"leaf {row}: occluder {tables.occluder_ids[tables.leaf_occluder[row]]} does not block all of proof "
        f"{tables.proof_ids[tables.leaf_proof[row]]}'s {_box_text(tables.leaf_boxes[row])}"
        for row in np.flatnonzero(~holds)
    )
    good = tiled(tables.cell_boxes, tables.boxes, tables.leaf_proof, tables.leaf_boxes)
    found.tell(
        f"proof {tables.proof_ids[row]}: leaves do not tile cell {tables.cell[row]} x {_box_text(tables.boxes[row])}"
        for row in np.flatnonzero(~good)
    )
    good[tables.leaf_proof[~holds]] = False
    found.failed_proofs = int((~good).sum())
    _check_pairs(bake, tables, good, found)
    return found


def leaf_holds(v: np.ndarray, x: np.ndarray, occluder: Occluder) -> bool:
    """Whether every segment from box v to box x meets an occluder: the slow reference of `leaves_hold`.

    Args:
        v: low and high corner [grid steps], shape (2, 3), integers.
        x: likewise.
        occluder: a real one.

    A segment from p to x = p + d crosses a plane k of axis i at p + t d, t = (k - p_i) / d_i. A coordinate of the
    crossing is monotonic in every coordinate of p and of x alone, so pairs of corners bound the crossings of all
    segments. For discs: the theorem at the top of data/patches.py; orient is affine in p and in x.
    """
    pairs = list(product(_corners(v), _corners(x)))
    if isinstance(occluder, Region):
        i, k = occluder.axis, occluder.plane
        if not (all(p[i] <= k < q[i] for p, q in pairs) or all(p[i] >= k > q[i] for p, q in pairs)):
            return False
        shares = [(p, q, Fraction(k - p[i], q[i] - p[i])) for p, q in pairs]
        crossings = [[p[j] + t * (q[j] - p[j]) for j in range(3) if j != i] for p, q, t in shares]
        return _in_union([(min(column), max(column)) for column in zip(*crossings, strict=True)], occluder.rectangles)
    edges = [(occluder.outline[e - 1], b) for e, b in enumerate(occluder.outline)]
    turns = {sign(dot(minus(q, p), cross(minus(a, p), minus(b, p)))) for p, q in pairs for a, b in edges}
    n = area_vector(occluder.outline)
    surface = [dot(n, p) for triangle in occluder.triangles.tolist() for p in triangle]
    eye, far = ([dot(n, p) for p in _corners(box)] for box in (v, x))
    ahead = max(eye) <= min(surface) and max(surface) < min(far)
    back = min(eye) >= max(surface) and min(surface) > max(far)
    return any(n) and bool((v[0] < v[1]).all()) and (ahead or back) and not {1, -1} <= turns


def _corners(box: np.ndarray) -> list[list[int]]:
    return [list(corner) for corner in product(*np.asarray(box).T.tolist())]


def _in_union(span: list[tuple[Fraction, Fraction]], rectangles: np.ndarray) -> bool:
    """Whether a closed rectangle, given by its extent on either axis, lies in the union of closed ones."""
    middles = []
    for c, (low, high) in enumerate(span):
        inner = {line for line in rectangles[:, :, c].ravel().tolist() if low < line < high}
        lines = sorted(inner | {low, high})
        middles.append([(a + b) * Fraction(1, 2) for a, b in pairwise(lines)] or lines)
    return all(
        any(u0 <= u <= u1 and v0 <= v <= v1 for (u0, v0), (u1, v1) in rectangles.tolist()) for u, v in product(*middles)
    )


def leaves_hold(boxes: np.ndarray, occluder: np.ndarray, occluders: list[Occluder]) -> np.ndarray:
    """Whether all segments of each leaf meet its occluder.

    Args:
        boxes: low and high corner of V, then of X [grid steps], shape (n, 4, 3), int32, |coordinate| <= 2**24.
        occluder: place of each leaf's among the occluders, shape (n,).
        occluders: real ones.

    Returns:
        Shape (n,), bool.
    """
    holds = np.zeros(len(boxes), bool)
    order = np.argsort(occluder, kind="stable")
    ends = np.searchsorted(occluder[order], np.arange(len(occluders) + 1))
    discs = [row for row, item in enumerate(occluders) if isinstance(item, Disc)]
    for row, item in enumerate(occluders):
        if isinstance(item, Region):
            own = order[ends[row] : ends[row + 1]]
            holds[own] = _region_blocks(boxes[own].astype(np.int64), item)
    if discs:
        place = np.full(len(occluders), -1)
        place[discs] = np.arange(len(discs))
        shapes = _DiscArrays([occluders[row] for row in discs])
        own = np.flatnonzero(place[occluder] >= 0)
        for begin in range(0, len(own), CHUNK // 8):
            part = own[begin : begin + CHUNK // 8]
            holds[part] = shapes.block(boxes[part].astype(np.int64), place[occluder[part]])
    return holds


def _region_blocks(boxes: np.ndarray, region: Region) -> np.ndarray:
    """Whether the crossings of each shaft with a plane lie in a union of rectangles, shape (n,), bool."""
    i, k = region.axis, region.plane
    v, x = boxes[:, :2], boxes[:, 2:]
    rows = np.flatnonzero(
        ((v[:, 1, i] <= k) & (x[:, 0, i] > k) | (v[:, 0, i] >= k) & (x[:, 1, i] < k)) & (len(region.rectangles) > 0)
    )
    v, x = v[rows], x[rows]
    before, after = np.sort(np.abs(v[:, :, i] - k), axis=1), np.sort(np.abs(x[:, :, i] - k), axis=1)
    lines, first, last = [], [], []
    for c, j in enumerate(j for j in range(3) if j != i):
        low, high = [], []
        # The share of the way is before / (before + after): least and greatest where they are so opposite.
        for n, f in ((before[:, 0], after[:, 1]), (before[:, 1], after[:, 0])):
            low.append((v[:, 0, j] * f + x[:, 0, j] * n) // (n + f))
            high.append(-(-(v[:, 1, j] * f + x[:, 1, j] * n) // (n + f)))
        # Rectangles have integer sides: what holds a crossing holds the grid steps on either side of it.
        lines.append(np.unique(region.rectangles[:, :, c]))
        first.append(np.searchsorted(lines[c], np.minimum(*low), side="right") - 1)
        last.append(np.searchsorted(lines[c], np.maximum(*high)))
    inside = (first[0] >= 0) & (first[1] >= 0) & (last[0] < len(lines[0])) & (last[1] < len(lines[1]))
    uncovered = np.zeros((len(lines[0]), len(lines[1])), np.int64)
    uncovered[1:, 1:] = 1
    for (u0, v0), (u1, v1) in region.rectangles:
        at = [np.searchsorted(lines[c], ends) for c, ends in enumerate(((u0, u1), (v0, v1)))]
        uncovered[at[0][0] + 1 : at[0][1] + 1, at[1][0] + 1 : at[1][1] + 1] = 0
    uncovered = uncovered.cumsum(axis=0).cumsum(axis=1)
    blocked = np.zeros(len(rows), bool)
    # All segments may cross on one line of the raster: then the raster cells on either side of it will do.
    for sides in product((0, 1), repeat=2):
        a, b = (first[c] - (side & (first[c] == last[c])) for c, side in enumerate(sides))
        c, d = (last[c] + ((1 - side) & (first[c] == last[c])) for c, side in enumerate(sides))
        fits = np.flatnonzero(inside & (a >= 0) & (b >= 0) & (c < len(lines[0])) & (d < len(lines[1])))
        a, b, c, d = a[fits], b[fits], c[fits], d[fits]
        blocked[fits] |= uncovered[c, d] - uncovered[a, d] - uncovered[c, b] + uncovered[a, b] == 0
    out = np.zeros(len(boxes), bool)
    out[rows] = blocked
    return out


class _DiscArrays:
    """Discs as arrays, for leaves of different discs at once."""

    def __init__(self, discs: list[Disc]) -> None:
        sizes = np.array([len(disc.outline) for disc in discs])
        self._starts = np.concatenate([[0], np.cumsum(sizes)])
        self._from = np.concatenate([np.array(disc.outline, np.int64) for disc in discs])
        self._to = np.concatenate([np.roll(np.array(disc.outline, np.int64), -1, axis=0) for disc in discs])
        vectors = [area_vector(disc.outline) for disc in discs]
        self._usable = np.array([any(n) and max(map(abs, n)) < 2**58 for n in vectors])
        self._normal = np.array([n if usable else [0] * 3 for n, usable in zip(vectors, self._usable, strict=True)])
        ends = []
        for disc, n in zip(discs, vectors, strict=True):
            points = disc.triangles.reshape(-1, 3).tolist()
            ends.append([min(points, key=lambda p: dot(n, p)), max(points, key=lambda p: dot(n, p))])
        self._ends = np.array(ends, np.int64)

    def block(self, boxes: np.ndarray, disc: np.ndarray) -> np.ndarray:
        """Whether each shaft, shape (n, 4, 3), int64, is blocked by the disc of its row."""
        v, x = boxes[:, :2], boxes[:, 2:]
        between = np.zeros(len(boxes), bool)
        for way in (1, -1):
            n = way * self._normal[disc]
            least, most = self._ends[disc, 0 if way > 0 else 1], self._ends[disc, 1 if way > 0 else 0]
            eye, far = _furthest(n, v), _furthest(-n, x)
            between |= (_sign_of_dot(n, eye - least) <= 0) & (_sign_of_dot(n, most - far) < 0)
        between &= self._usable[disc] & (v[:, 0] < v[:, 1]).all(axis=1)
        out = np.zeros(len(boxes), bool)
        rows = np.flatnonzero(between)
        if not len(rows):
            return out
        count = np.diff(self._starts)[disc[rows]]
        first = np.cumsum(count) - count
        edge = np.repeat(self._starts[disc[rows]] - first, count) + np.arange(count.sum())
        a, b = self._from[edge], self._to[edge]
        cell, box = np.repeat(v[rows], count, axis=0), np.repeat(x[rows], count, axis=0)
        left, right = np.ones(len(edge), bool), np.ones(len(edge), bool)
        for corner in product((0, 1), repeat=3):
            q = box[:, corner, range(3)]
            # orient(p, q, a, b) = (p - q) . n: its least and greatest value over p are at corners of the cell.
            n = _cross(a - q, b - q)
            left &= _sign_of_dot(n, _furthest(-n, cell) - q) >= 0
            right &= _sign_of_dot(n, _furthest(n, cell) - q) <= 0
        out[rows] = np.logical_and.reduceat(left, first) | np.logical_and.reduceat(right, first)
        return out


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products, exact in int64 for components below 2**31."""
    return a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]


def _furthest(n: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """The corner of each box that lies furthest along n."""
    return np.where(n > 0, boxes[:, 1], boxes[:, 0])


def _sign_of_dot(n: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Sign of n . q for |n| < 2**58 and |q| <= 2**26, exactly: n = high 2**26 + low, and no sum reaches 2**63."""
    low = ((n & ((1 << LIMB) - 1)) * q).sum(axis=1)
    high = ((n >> LIMB) * q).sum(axis=1) + (low >> LIMB)
    return np.where(high != 0, np.sign(high), np.sign(low & ((1 << LIMB) - 1)))


def tiled(cells: np.ndarray, boxes: np.ndarray, proof: np.ndarray, leaves: np.ndarray) -> np.ndarray:
    """Whether the leaves of each proof are what a sequence of cuts across makes of cell x box.

    A cut is at a coordinate of one of the six axes that no leaf reaches over. Sides without length are never cut.

    Args:
        cells: view cell of each proof [grid steps], shape (n, 2, 3), int.
        boxes: its hidden box, likewise.
        proof: proof of each leaf, shape (m,), int.
        leaves: low and high corner of V, then of X, shape (m, 4, 3), int.

    Returns:
        Shape (n,), bool.
    """
    # Six axes: three of V, three of X.
    low, high = leaves[:, [0, 2]].reshape(-1, 6), leaves[:, [1, 3]].reshape(-1, 6)
    node_low = np.concatenate([cells[:, 0], boxes[:, 0]], axis=1).astype(np.int64)
    node_high = np.concatenate([cells[:, 1], boxes[:, 1]], axis=1).astype(np.int64)
    good = np.bincount(proof, minlength=len(cells)) > 0
    owner, rows, group = np.arange(len(cells)), np.arange(len(proof)), proof.astype(np.int64)
    while len(rows):
        alone = np.bincount(group, minlength=len(owner))[group] == 1
        one, of = rows[alone], group[alone]
        wrong = (low[one] != node_low[of]).any(axis=1) | (high[one] != node_high[of]).any(axis=1)
        good[owner[of[wrong]]] = False
        rows, group = rows[~alone], group[~alone]
        made = [(rows[:0], np.zeros((0, 6), np.int64), np.zeros((0, 6), np.int64), owner[:0], group[:0])]
        count = 0
        for axis in range(6):
            if not len(rows):
                break
            order, cut, found = _cuts(low[rows, axis], high[rows, axis], group, node_low[:, axis], node_high[:, axis])
            taken = order[found[group[order]]]
            if not len(taken):
                continue
            cut = cut[found[group[order]]]
            of = group[taken]
            start = np.flatnonzero(cut | np.append(True, of[1:] != of[:-1]))
            part_low, part_high = node_low[of[start]], node_high[of[start]]
            inner = cut[start]
            part_low[inner, axis] = low[rows[taken[start[inner]]], axis]
            part_high[:-1][inner[1:], axis] = part_low[1:][inner[1:], axis]
            sizes = np.diff(np.append(start, len(taken)))
            made.append(
                (rows[taken], part_low, part_high, owner[of[start]], count + np.repeat(np.arange(len(start)), sizes))
            )
            count += len(start)
            left = ~found[group]
            rows, group = rows[left], group[left]
        # No axis cuts what is left here.
        good[owner[group]] = False
        rows, node_low, node_high, owner, group = (np.concatenate(column) for column in zip(*made, strict=True))
    return good


def _cuts(
    low: np.ndarray, high: np.ndarray, group: np.ndarray, node_low: np.ndarray, node_high: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows ordered by group and low end, whether a cut lies before each, and whether each group has one."""
    shift = np.int64(2 * GRID_LIMIT)
    base = group * (2 * shift)
    order = np.argsort(base + low, kind="stable")
    group, low, base = group[order], low[order], base[order]
    # Groups come one after another, so the greatest so far is that of the row's own group.
    reached = np.maximum.accumulate(base + shift + high[order])
    cut = np.zeros(len(order), bool)
    cut[1:] = (group[1:] == group[:-1]) & (reached[:-1] <= base[1:] + shift + low[1:])
    cut &= (node_low[group] < low) & (low < node_high[group])
    found = np.zeros(len(node_low), bool)
    found[group[cut]] = True
    return order, cut, found


def in_boxes(triangles: np.ndarray, boxes: np.ndarray) -> bool:
    """Whether triangles lie in a union of closed boxes.

    Args:
        triangles: [grid steps], shape (n, 3, 3), int, not degenerate.
        boxes: shape (m, 2, 3), int.
    """
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    inside = np.zeros(len(triangles), bool)
    for box in boxes:
        inside |= (low >= box[0]).all(axis=1) & (high <= box[1]).all(axis=1)
    pieces = boxes.tolist()
    return all(_in_boxes([tuple(p) for p in triangle], pieces) for triangle in triangles[~inside].tolist())


def _in_boxes(polygon: list[tuple], boxes: list[list[list[int]]]) -> bool:
    """The same for a convex polygon with an area: what is outside the first box it meets must be in the others."""
    spans = [(min(column), max(column)) for column in zip(*polygon, strict=True)]
    while boxes:
        (low, high), *boxes = boxes
        sides = zip(spans, low, high, strict=True)
        if all((at <= a and b <= to) or max(a, at) < min(b, to) for (a, b), at, to in sides):
            break
    else:
        return False
    for axis, side, bound in ((axis, side, (low, high)[side][axis]) for axis in range(3) for side in (0, 1)):
        outward = [p[axis] - bound if side else bound - p[axis] for p in polygon]
        if max(outward) > 0:
            if min(outward) >= 0:
                return _in_boxes(polygon, boxes)
            polygon, outside = split(polygon, outward)
            if not _in_boxes(outside, boxes):
                return False
    return True


@dataclass
class _Tables:
    """Tables of a bake's certificates, in grid steps; ids replaced by places."""

    proof_ids: np.ndarray
    cell: np.ndarray
    cell_boxes: np.ndarray
    boxes: np.ndarray
    leaf_proof: np.ndarray
    leaf_occluder: np.ndarray
    leaf_boxes: np.ndarray
    occluder_ids: np.ndarray
    occluders: "pa.Table"


def _read(bake: "Bake") -> _Tables:
    folder, grid_m = bake.folder, bake.grid_m
    paths = [folder / f"{name}.parquet" for name in ("proofs", "leaves", "occluders")]
    proofs, leaves, occluders = (
        read_table(path, columns) for path, columns in zip(paths, (PROOFS, LEAVES, OCCLUDERS), strict=True)
    )
    proof_ids, occluder_ids = proofs["proof_id"].to_numpy(), occluders["occluder_id"].to_numpy()
    cell = proofs["cell_id"].to_numpy()
    for path, ids in ((paths[0], proof_ids), (paths[2], occluder_ids)):
        if len(np.unique(ids)) != len(ids):
            raise InputError(f"{path}: expected every id once, found one twice")
    if len(cell) and not (cell.min() >= 0 and cell.max() < bake.graph.cell_count):
        raise InputError(f"{paths[0]}: expected cell_id from 0 to {bake.graph.cell_count - 1}, found {cell.max()}")
    return _Tables(
        proof_ids,
        cell,
        bake.graph.cells[cell],
        _boxes(proofs, CORNERS, grid_m, paths[0]),
        _places(leaves["proof_id"].to_numpy(), proof_ids, paths[1], "proof_id"),
        _places(leaves["occluder_id"].to_numpy(), occluder_ids, paths[1], "occluder_id"),
        _boxes(leaves, LEAVES[2:], grid_m, paths[1]),
        occluder_ids,
        occluders,
    )


def _places(ids: np.ndarray, known: np.ndarray, path: object, column: str) -> np.ndarray:
    """Place of each id among the known ones."""
    order = np.argsort(known)
    at = np.searchsorted(known[order], ids)
    lost = np.flatnonzero(known[order][np.minimum(at, len(known) - 1)] != ids) if len(known) else np.arange(len(ids))
    if len(lost):
        raise InputError(f"{path}: expected {column} of a row of its own table, found {ids[lost[0]]}")
    return order[at]


def _boxes(table: "pa.Table", columns: tuple[str, ...], grid_m: float, path: object) -> np.ndarray:
    """Corners in grid steps, shape (n, corners, 3), int32."""
    out = np.empty((table.num_rows, len(columns)), np.int32)
    for i, name in enumerate(columns):
        out[:, i] = _steps(table[name].to_numpy(), grid_m, path)
    return out.reshape(len(out), -1, 3)


def _steps(metres: np.ndarray, grid_m: float, where: object) -> np.ndarray:
    """Grid steps of points that lie on the grid, int64.

    Raises:
        InputError: one does not, or is outside the grid's limits.
    """
    steps = np.round(metres / grid_m)
    wrong = ~((steps * grid_m == metres) & (np.abs(steps) <= GRID_LIMIT))
    if wrong.any():
        raise InputError(f"{where}: expected multiples of {grid_m} m within the grid, found {metres[wrong][0]}")
    return steps.astype(np.int64)


def _check_leaves(bake: "Bake", tables: _Tables, found: Certified) -> np.ndarray:
    """Whether each leaf holds and its occluder is real."""
    triangles, owners = bake.scene.triangles()
    opaque = bake.scene.object_mask(Role.OCCLUDER, Role.DETAIL)[owners]
    surfaces = OpaqueSurfaces(triangles[opaque], owners[opaque])
    occluders: list[Occluder] = []
    for row in tables.occluders.to_pylist():
        where = f"occluder {row['occluder_id']}"
        occluder, why = _occluder(row, surfaces, bake.grid_m, where)
        if why:
            found.failed_occluders += 1
            found.tell(iter([f"{where}: {why}"] if found.failed_occluders <= EXAMPLES else []))
        occluders.append(occluder)
    return leaves_hold(tables.leaf_boxes, tables.leaf_occluder, occluders)


def _occluder(row: dict, surfaces: OpaqueSurfaces, grid_m: float, where: str) -> tuple[Occluder, str]:
    """An occluder, and why it is not real, if so; it then blocks nothing."""
    nothing = Region(0, 0, np.zeros((0, 2, 2), np.int64))
    if row["kind"] == "region":
        if row["axis"] not in (0, 1, 2):
            raise InputError(f"{where}: expected an axis from 0 to 2, found {row['axis']}")
        plane = int(_steps(np.array([row["coordinate"]], float), grid_m, where)[0])
        rectangles = _points(row["rectangles"], 4, grid_m, where).reshape(-1, 2, 2)
        wrong = surfaces.open_rectangle(row["axis"], plane, rectangles)
        if wrong is None:
            return Region(row["axis"], plane, rectangles), ""
        return nothing, f"{_box_text(wrong)} of plane {plane} of axis {row['axis']} is not opaque throughout"
    if row["kind"] != "patch":
        raise InputError(f"{where}: expected the kind region or patch, found {row['kind']!r}")
    outline = _points(row["corners"], 3, grid_m, where).tolist()
    triangles = surfaces.disc(row["object_id"], row["triangles"] or [])
    if triangles is None:
        return nothing, f"object {row['object_id']} has no such opaque triangles"
    if not bounds_disc(triangles, outline):
        return nothing, "its outline does not bound its triangles"
    return Disc(outline, triangles), ""


def _points(metres: list[float] | None, width: int, grid_m: float, where: str) -> np.ndarray:
    """Numbers of a list in rows of some width [grid steps], int64."""
    if not metres or len(metres) % width:
        raise InputError(f"{where}: expected a list of {width} numbers a point or rectangle, found {metres}")
    return _steps(np.array(metres, float), grid_m, where).reshape(-1, width)


def _check_pairs(bake: "Bake", tables: _Tables, good: np.ndarray, found: Certified) -> None:
    """Count the hidden pairs that proofs which hold cover, and those that they do not."""
    triangles, owners = bake.scene.triangles()
    starts = np.searchsorted(owners, np.arange(len(bake.scene.objects) + 1))
    bounds, present = bake.scene.object_bounds(), np.diff(starts) > 0
    known: dict[tuple[int, bytes], bool] = {}
    for cell in np.flatnonzero(bake.graph.inhabitable):
        hidden = np.flatnonzero(~bake.potential_objects[cell] & present)
        boxes = np.unique(tables.boxes[good & (tables.cell == cell)].astype(np.int64), axis=0)
        left = hidden[~_in_one(bounds[hidden], boxes)]
        bad = []
        for target in left.tolist():
            meet = (boxes[:, 0] <= bounds[target, 1]).all(axis=1) & (boxes[:, 1] >= bounds[target, 0]).all(axis=1)
            key = target, boxes[meet].tobytes()
            if key not in known:
                known[key] = in_boxes(triangles[starts[target] : starts[target + 1]].astype(np.int64), boxes[meet])
            if not known[key]:
                bad.append(target)
        found.covered += len(hidden) - len(bad)
        found.uncovered += len(bad)
        if len(bad) and found.uncovered - len(bad) < EXAMPLES:
            found.tell(
                f"cell {cell}, object {target}: hidden, but not all of it by a proof that holds" for target in bad
            )


def _in_one(bounds: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Whether each of some boxes lies in one of others, shape (n,), bool."""
    out = np.zeros(len(bounds), bool)
    for begin in range(0, len(bounds), step := max(1, PAIRS // max(1, len(boxes)))):
        part = bounds[begin : begin + step, None]
        out[begin : begin + step] = (
            ((boxes[None, :, 0] <= part[:, :, 0]) & (boxes[None, :, 1] >= part[:, :, 1])).all(axis=2).any(axis=1)
        )
    return out


def _box_text(corners: np.ndarray) -> str:
    """Corners as they are told."""
    return " - ".join(str(tuple(corner)) for corner in corners.tolist())
