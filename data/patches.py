"""Occluders in any direction: discs of opaque triangles with a convex outline, planar or nearly so.

Theorem. Let P be a disc of opaque triangles, glued one after the other along shared edges (it may cross itself in
space), with outline b_0 ... b_{n-1}, not all on one line; V a box with inside, X a box. If for all p in V and x in X

    orient(p, x, b_i, b_{i+1}) >= 0  for every edge i,  or  <= 0 for every edge i,                        (1)

and some direction n has max n.V <= min n.P and max n.P < min n.X, then every segment from V to X meets P.

Proof. Let p be inside V, (1) with >=, and look along px: the outline becomes a closed curve about the point o that is
px. Were all angles 0, (1) would be 0 at (p, x) and, being affine in p, for all p in V: every edge would lie on a line
through x, and all on one line. So some (p', x) as near as one likes has an angle above 0, none below: either the
curve meets o or it winds round o. A curve that winds round o bounds no disc that misses o, so the line px meets P; and
n orders p, P and x, so the meeting point lies on the segment. P is closed: what holds near p holds for p. QED.

orient is affine in p and in x, so the 64 pairs of vertices of V and X decide (1) for the boxes. Nothing is asked of P's
planarity: polygons that snapping has bent, groups of triangles with one average normal, and bulging surfaces are all
used as one occluder, and merging them is what makes occluders strong. That the outline is convex only makes (1) likely.
"""

from dataclasses import dataclass, field
from heapq import heappop, heappush

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from .errors import InputError
from .ragged import places_of, starts_of, take_lists

# Coordinates are below this [grid steps].
LIMIT = 2**24
# A corner may bend inwards by this much [grid steps]: snapping moves the three points that say so by up to 0.7 each.
SNAP = 2
# Triangles added at most to fill a notch of the outline, and notches tried for one patch: what a grid of triangles
# needs, whose outline is not convex until a row is complete.
NOTCH_FILL = 64
NOTCHES = 24
# Notches are filled where the surface is flat up to snapping; on a curved one it nearly always fails.
FLAT = 0.9998
# Triangles that share one edge: so many are compared to find the flattest continuation.
FAN = 6


@dataclass
class Patches:
    """Discs of triangles, each an occluder by the theorem above.

    Attributes:
        corners: outlines [grid steps], one after the other, shape (total, 3), int32.
        starts: outline i is corners[starts[i]:starts[i + 1]], shape (n + 1,), int64.
        boxes: bounds of all vertices of the disc [grid steps], shape (n, 2, 3), int32.
        normal: unit mean normal, weighted by area, shape (n, 3), float64; outlines turn counter-clockwise about it.
        depth: least and greatest normal . vertex of the disc, rounded outwards, shape (n, 2), float64.
        owner: object_id, shape (n,), int32.
        area: area seen along the normal, squared grid steps, shape (n,), float64.
        members: triangles of each disc, as places among its owner's in the order that they were given, int32; empty
            where outlines were not found as discs.
    """

    corners: np.ndarray
    starts: np.ndarray
    boxes: np.ndarray
    normal: np.ndarray
    depth: np.ndarray
    owner: np.ndarray
    area: np.ndarray
    members: list[np.ndarray] = field(default_factory=list)


def find_patches(
    triangles: np.ndarray,
    owners: np.ndarray,
    *,
    least_area: float,
    most_corners: int = 8,
    cos_limit: float = 0.94,
    axial: bool = False,
) -> Patches:
    """Patches that together hold every triangle in a smooth surface of at least `least_area`; they may overlap.

    Each is grown from the largest triangle that no patch holds yet, largest neighbour first, over edges whose ends
    agree exactly, as long as its outline is convex.

    Args:
        triangles: opaque [grid steps], shape (m, 3, 3), int32, in any orientation.
        owners: object_id of each, shape (m,); a patch has one owner.
        least_area: of a patch, squared grid steps.
        most_corners: of an outline, where runs of exactly collinear points count as one side.
        cos_limit: least cosine between a triangle's normal and the mean normal of the patch that it joins.
        axial: keep triangles that are exactly perpendicular to an axis.

    Raises:
        InputError: most_corners is below 3, or cos_limit not in (0, 1].
    """
    if most_corners < 3 or not 0 < cos_limit <= 1:
        raise InputError(
            f"patches: expected most_corners >= 3 and 0 < cos_limit <= 1, found {most_corners}, {cos_limit}"
        )
    triangles = np.asarray(triangles, np.int64).reshape(-1, 3, 3)
    owners = np.asarray(owners)
    places = _places(owners)
    kept = area_vectors(triangles).any(axis=1)
    if not axial:
        kept &= (np.ptp(triangles, axis=1) > 0).all(axis=1)
    triangles, owners, places = triangles[kept], owners[kept], places[kept]
    vertex = _weld(triangles, owners)
    _, single = np.unique(np.sort(vertex, axis=1), axis=0, return_index=True)
    triangles, owners, vertex, places = triangles[single], owners[single], vertex[single], places[single]
    twice = area_vectors(triangles).astype(np.float64)
    partner = _partners(vertex, twice, 2 * cos_limit**2 - 1)
    # Most triangles of a detailed model belong to no surface that is large enough.
    large = _surface_areas(partner, twice)[0] >= least_area
    renumbered = np.where(large, np.cumsum(large) - 1, -1)
    partner = np.where(partner >= 0, 3 * renumbered[partner // 3] + partner % 3, -1)[np.repeat(large, 3)]
    mesh = _Mesh(triangles[large], vertex[large], twice[large], partner, most_corners, cos_limit)
    return _collect(mesh, triangles[large], owners[large], places[large], twice[large], least_area)


def area_vectors(triangles: np.ndarray) -> np.ndarray:
    """Twice the area times the normal of each triangle, exact, shape (m, 3), int64; zero where degenerate."""
    a, b = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return np.stack([a[:, i - 2] * b[:, i - 1] - a[:, i - 1] * b[:, i - 2] for i in range(3)], axis=1)


def _places(owners: np.ndarray) -> np.ndarray:
    """Place of each row among those of its owner, int32."""
    order = np.argsort(owners, kind="stable")
    ranked = owners[order]
    places = np.empty(len(owners), np.int32)
    places[order] = np.arange(len(owners)) - np.searchsorted(ranked, ranked)
    return places


def _weld(triangles: np.ndarray, owners: np.ndarray) -> np.ndarray:
    """One number a position and owner, shape (m, 3), int64."""
    points = triangles.reshape(-1, 3) + LIMIT
    flat = np.unique(points[:, 0] * (4 * LIMIT) + points[:, 1], return_inverse=True)[1].ravel()
    _, whose = np.unique(owners, return_inverse=True)
    upright = np.unique(np.repeat(whose.ravel(), 3) * (4 * LIMIT) + points[:, 2], return_inverse=True)[1].ravel()
    return np.unique(flat * (len(points) + 1) + upright, return_inverse=True)[1].reshape(-1, 3)


def _partners(vertex: np.ndarray, twice: np.ndarray, cos_limit: float) -> np.ndarray:
    """The half-edge across each half-edge 3 t + k (corner k to the next), -1 where no triangle is flat enough to it."""
    unit = twice / np.linalg.norm(twice, axis=1, keepdims=True)
    start, end = vertex.ravel(), np.roll(vertex, -1, axis=1).ravel()
    forward = start < end
    key = np.minimum(start, end) * (len(start) + 1) + np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    _, first, count = np.unique(key[order], return_index=True, return_counts=True)
    begin, size = np.repeat(first, count), np.repeat(count, count)
    place = np.arange(len(order)) - begin
    partner, best = np.full(len(order), -1), np.full(len(order), cos_limit)
    for step in range(1, min(FAN, int(count.max(initial=1)))):
        row = np.flatnonzero(size > step)
        here, there = order[row], order[begin[row] + (place[row] + step) % size[row]]
        cosine = (unit[here // 3] * unit[there // 3]).sum(axis=1) * np.where(forward[here] == forward[there], -1, 1)
        better = cosine >= best[here]
        partner[here[better]], best[here[better]] = there[better], cosine[better]
    return partner


def _surface_areas(partner: np.ndarray, twice: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Area of the smooth surface that each triangle belongs to, and of the triangle."""
    count = len(twice)
    area = np.linalg.norm(twice, axis=1) / 2
    here = np.flatnonzero(partner >= 0)
    links = coo_array((np.ones(len(here), np.int8), (here // 3, partner[here] // 3)), shape=(count, count))
    label = connected_components(links, directed=False)[1] if count else np.zeros(0, np.int64)
    return np.bincount(label, area, minlength=1)[label], area


def _collect(
    mesh: "_Mesh",
    triangles: np.ndarray,
    owners: np.ndarray,
    places: np.ndarray,
    twice: np.ndarray,
    least_area: float,
) -> Patches:
    """Grow patches from the largest uncovered triangles and measure them."""
    outlines, boxes, normals, depths, owner, areas, discs = [], [], [], [], [], [], []
    for seed in np.argsort(-(twice**2).sum(axis=1), kind="stable").tolist():
        if mesh.covered[seed]:
            continue
        patch = mesh.grow(seed)
        members = np.array(sorted(patch.inside))
        outline = mesh.positions[mesh.corners(patch.loop)]
        spread = (outline - outline[0]).astype(np.float64)
        vector = np.cross(spread, np.roll(spread, -1, axis=0)).sum(axis=0) / 2
        area = float(np.linalg.norm(vector))
        if area < least_area or area == 0.0:
            continue
        points = triangles[members].reshape(-1, 3)
        normal = vector / area
        height = points @ normal
        # Three products and two sums, each rounded once; none is if the normal is an axis.
        slack = 4 * np.finfo(np.float64).eps * np.abs(points).sum(axis=1).max() * (np.count_nonzero(normal) > 1)
        outlines.append(outline)
        boxes.append([points.min(axis=0), points.max(axis=0)])
        normals.append(normal)
        depths.append((height.min() - slack, height.max() + slack))
        owner.append(owners[seed])
        areas.append(area)
        discs.append(places[members])
    return Patches(
        np.concatenate([np.zeros((0, 3)), *outlines]).astype(np.int32),
        starts_of([len(outline) for outline in outlines]),
        np.array(boxes, np.int32).reshape(-1, 2, 3),
        np.array(normals).reshape(-1, 3),
        np.array(depths).reshape(-1, 2),
        np.array(owner, np.int32),
        np.array(areas, np.float64),
        discs,
    )


@dataclass
class _Patch:
    """A growing disc: its outline, the half-edge inside of each side, its triangles, and the sum of area vectors."""

    loop: list[int]
    halves: list[int]
    inside: set[int]
    vector: list[float]

    def copy(self) -> "_Patch":
        return _Patch(self.loop[:], self.halves[:], set(self.inside), self.vector[:])


class _Mesh:
    """Welded triangles as Python lists, which growing one triangle at a time reads much faster than arrays."""

    def __init__(
        self,
        triangles: np.ndarray,
        vertex: np.ndarray,
        twice: np.ndarray,
        partner: np.ndarray,
        most_corners: int,
        cos_limit: float,
    ) -> None:
        self.positions = np.zeros((int(vertex.max(initial=0)) + 1, 3), np.int64)
        self.positions[vertex.ravel()] = triangles.reshape(-1, 3)
        self.point = [column.tolist() for column in self.positions.T]
        self.vertex = vertex.ravel().tolist()
        self.partner = partner.tolist()
        self.vector = twice.tolist()
        self.norm = np.linalg.norm(twice, axis=1).tolist()
        self.most_corners, self.cos_limit = most_corners, cos_limit
        self.covered = [False] * len(self.norm)

    def grow(self, seed: int) -> _Patch:
        """The patch of a triangle: neighbours join, largest first, while the outline stays convex."""
        vector = self.vector[seed]
        self.axis = max(range(3), key=lambda i: abs(vector[i]))
        self.turn = 1 if vector[self.axis] > 0 else -1
        self.u, self.v = self.point[self.axis - 2], self.point[self.axis - 1]
        patch = _Patch(self.vertex[3 * seed : 3 * seed + 3], [3 * seed, 3 * seed + 1, 3 * seed + 2], {seed}, vector[:])
        self._extend(patch)
        tries = iter(range(NOTCHES))
        halves = iter(patch.halves[:])
        while (half := next(halves, None)) is not None and next(tries, None) is not None:
            filled = self._filled(patch, half)
            if filled is not None:
                patch = filled
                self._extend(patch)
                halves = iter(patch.halves[:])
        for triangle in patch.inside:
            self.covered[triangle] = True
        return patch

    def _extend(self, patch: _Patch) -> None:
        """Add single triangles until none keeps the outline convex."""
        queue: list[tuple[bool, float, int]] = []
        self._enqueue(queue, patch.halves)
        while queue:
            half = heappop(queue)[2]
            if half not in patch.halves:
                continue
            i = patch.halves.index(half)
            if not self._fits(patch, i, self.cos_limit) or not self._stays_convex(patch, i):
                continue
            self._add(patch, i)
            self._enqueue(queue, [*patch.halves[:3], *patch.halves[-2:]])

    def _enqueue(self, queue: list[tuple[bool, float, int]], halves: list[int]) -> None:
        """Put what lies across half-edges into the queue: first what no patch holds, then the largest."""
        for half in halves:
            across = self.partner[half] // 3
            if across >= 0:
                heappush(queue, (self.covered[across], -self.norm[across], half))

    def _stays_convex(self, patch: _Patch, i: int) -> bool:
        """Whether the outline is convex, and of few corners, with the triangle across side i."""
        loop, count = patch.loop, len(patch.loop)
        a, b, apex = loop[i], loop[(i + 1) % count], self.vertex[self._last(self.partner[patch.halves[i]])]
        before, after = loop[i - 1], loop[(i + 2) % count]
        if apex in (before, after):
            trial = patch.copy()
            self._add(trial, i)
            return self._convex(trial.loop)
        if self._bends(before, a, apex) or self._bends(apex, b, after):
            return False
        return self._few_corners([*loop[: i + 1], apex, *loop[i + 1 :]])

    def _few_corners(self, loop: list[int]) -> bool:
        return len(loop) <= self.most_corners or len(self.corners(loop)) <= self.most_corners

    def _filled(self, patch: _Patch, half: int) -> _Patch | None:
        """The patch with the triangle across `half` and those that fill the notches it makes, or None."""
        i = patch.halves.index(half)
        flat = max(FLAT, self.cos_limit)
        if not self._fits(patch, i, flat):
            return None
        trial = patch.copy()
        self._add(trial, i)
        for _ in range(min(NOTCH_FILL, 2 * len(patch.inside) + 2)):
            loop, count = trial.loop, len(trial.loop)
            bend = next((i for i in range(count) if self._bends(loop[i - 1], loop[i], loop[(i + 1) % count])), None)
            if bend is None:
                return trial if self._convex(loop) else None
            side = next((i for i in (bend, (bend - 1) % count) if self._fits(trial, i, flat)), None)
            if side is None:
                return None
            self._add(trial, side)
        return None

    def _fits(self, patch: _Patch, i: int, limit: float) -> bool:
        """Whether the triangle across side i is new to the patch and faces its way."""
        across = self.partner[patch.halves[i]]
        if across < 0 or across // 3 in patch.inside:
            return False
        facing, vector = self._facing(patch, i), patch.vector
        size = (vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2) ** 0.5 * self.norm[across // 3]
        cosine = facing[0] * vector[0] + facing[1] * vector[1] + facing[2] * vector[2]
        return facing[self.axis] * self.turn > 0 and cosine >= limit * size

    def _facing(self, patch: _Patch, i: int) -> list[float]:
        """Area vector of the triangle across side i, turned as the patch is."""
        across = self.partner[patch.halves[i]]
        vector = self.vector[across // 3]
        return vector if self.vertex[across] != patch.loop[i] else [-x for x in vector]

    @staticmethod
    def _last(half: int) -> int:
        """The half-edge that starts at the corner opposite to a half-edge."""
        return half - half % 3 + (half + 2) % 3

    def _add(self, patch: _Patch, i: int) -> None:
        """Glue the triangle across side i to the disc; the outline then starts with its sides."""
        across = self.partner[patch.halves[i]]
        last, following = self._last(across), across - across % 3 + (across + 1) % 3
        patch.vector = [s + t for s, t in zip(patch.vector, self._facing(patch, i), strict=True)]
        patch.inside.add(across // 3)
        # The half-edge across runs against the side, or along it where the model's orientation is mixed.
        sides = [following, last] if self.vertex[across] != patch.loop[i] else [last, following]
        apex = self.vertex[last]
        loop = [patch.loop[i], apex, *patch.loop[i + 1 :], *patch.loop[:i]]
        halves = [*sides, *patch.halves[i + 1 :], *patch.halves[:i]]
        # Two sides that run there and back are glued to each other.
        if len(loop) > 4 and loop[3] == apex:
            del loop[2:4], halves[1:3]
        if len(loop) > 4 and loop[-1] == apex:
            loop, halves = loop[1:-1], halves[1:-1]
        patch.loop, patch.halves = loop, halves

    def _bends(self, a: int, b: int, c: int) -> bool:
        """Whether the outline bends inwards at b by more than snapping does, or turns back on itself."""
        u, v = self.u, self.v
        x, y, s, t = u[b] - u[a], v[b] - v[a], u[c] - u[b], v[c] - v[b]
        cross = (x * t - y * s) * self.turn
        if cross > 0:
            return False
        if x * s + y * t <= 0:
            return True
        return cross * cross > SNAP * SNAP * ((x + s) ** 2 + (y + t) ** 2)

    def _convex(self, loop: list[int]) -> bool:
        """Whether the outline never bends inwards, turns once, and has few corners."""
        u, v, turn, count = self.u, self.v, self.turn, len(loop)
        if any(self._bends(loop[i - 1], loop[i], loop[(i + 1) % count]) for i in range(count)):
            return False
        ahead = [(u[loop[i]], v[loop[i]] * turn) > (u[loop[i - 1]], v[loop[i - 1]] * turn) for i in range(count)]
        swings = sum(ahead[i] != ahead[i - 1] for i in range(count))
        return swings == 2 and self._few_corners(loop)

    def corners(self, loop: list[int]) -> list[int]:
        """The outline without points between exactly collinear neighbours."""
        px, py, pz = self.point
        out, a = [], loop[-1]
        for b, c in zip(loop, loop[1:] + loop[:1], strict=True):
            x, y, z, r, s, t = px[b] - px[a], py[b] - py[a], pz[b] - pz[a], px[c] - px[b], py[c] - py[b], pz[c] - pz[b]
            if y * t != z * s or z * r != x * t or x * s != y * r or x * r + y * s + z * t <= 0:
                out.append(b)
            a = b
        return out


def copied_patches(patches: Patches, models: np.ndarray, corners: np.ndarray) -> Patches:
    """Patches of some objects, and of those that are alike: each after the patch that it is a copy of.

    Args:
        patches: of objects that are their own model.
        models: of each object the one whose triangles are its own but for a shift, -1 for none; shape (objects,), int.
        corners: low corner of each object's box [grid steps], shape (objects, 3), int.
    """
    order = np.argsort(models, kind="stable")
    first, last = (np.searchsorted(models[order], patches.owner, side=side) for side in ("left", "right"))
    of = np.repeat(np.arange(len(patches.owner)), last - first)
    owner = order[places_of(first, last - first)]
    shift = corners[owner] - corners[patches.owner[of]]
    starts, places = take_lists(patches.starts, of)
    normal = patches.normal[of]
    # As in `_collect`: three products and their sums, each rounded once, unless nothing is.
    along = (shift * normal).sum(axis=1)
    size = np.abs(shift).sum(axis=1) + np.abs(patches.depth[of]).max(axis=1)
    inexact = (np.count_nonzero(normal, axis=1) > 1) & shift.any(axis=1)
    slack = size * inexact * (4 * np.finfo(np.float64).eps)
    return Patches(
        patches.corners[places] + np.repeat(shift, np.diff(starts), axis=0).astype(np.int32),
        starts,
        patches.boxes[of] + shift[:, None].astype(np.int32),
        normal,
        patches.depth[of] + along[:, None] + np.column_stack([-slack, slack]),
        owner.astype(np.int32),
        patches.area[of],
        [patches.members[number] for number in of.tolist()],
    )


def rectangle_outlines(boxes: np.ndarray) -> Patches:
    """Flat axial boxes, shape (n, 2, 3), int32, as outlines: sections of solids serve eyes outside them."""
    count = len(boxes)
    axis = (boxes[:, 1] == boxes[:, 0]).argmax(axis=1)
    u, v = ((axis + step) % 3 for step in (1, 2))
    rows = np.arange(count)
    corners = np.repeat(boxes[:, :1], 4, axis=1)
    for corner, (at_u, at_v) in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
        corners[rows, corner, u] = boxes[rows, at_u, u]
        corners[rows, corner, v] = boxes[rows, at_v, v]
    normal = np.zeros((count, 3))
    normal[rows, axis] = 1
    size = (boxes[:, 1] - boxes[:, 0]).astype(float)
    return Patches(
        corners.reshape(-1, 3).astype(np.int32),
        np.arange(0, 4 * count + 1, 4, dtype=np.int64),
        boxes.astype(np.int32),
        normal,
        np.repeat(boxes[rows, 0, axis].astype(float)[:, None], 2, axis=1),
        np.full(count, -1, np.int32),
        size[rows, u] * size[rows, v],
    )


def join_outlines(first: Patches, second: Patches) -> Patches:
    """Both sets of outlines as one."""
    names = ("corners", "boxes", "normal", "depth", "owner", "area")
    joined = {name: np.concatenate([getattr(first, name), getattr(second, name)]) for name in names}
    return Patches(starts=np.concatenate([first.starts, first.starts[-1] + second.starts[1:]]), **joined)
