"""Lines through oblique portals: what the leaves of a compiled map see, sampled.

A line starts inside a random winding of its leaf and is followed from winding to winding for as long as it passes them
clearly, by MARGIN at least: leaves are convex, so such a line sees every leaf that it enters. Float64 proposes;
`passes` repeats the question in rationals. Sampling proves only what is visible.
"""

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np
import warp as wp

from ...data.store.quake import LeafPortals

wp.set_module_options({"enable_backward": False})

# A line that passes a winding nearer to an edge than this is given up [map units].
MARGIN = wp.constant(wp.float64(0.02))
STEPS = wp.constant(512)
# A line whose angle to a winding is smaller than this is given up (sine).
SLANT = wp.constant(wp.float64(1.0e-4))


@wp.struct
class Windings:
    """Windings on the device: planes that face the leaf behind, inward edge planes, and the windings of each leaf."""

    normals: wp.array[wp.vec3d]
    offsets: wp.array[wp.float64]
    edge_starts: wp.array[int]
    edge_normals: wp.array[wp.vec3d]
    edge_offsets: wp.array[wp.float64]
    corners: wp.array[wp.vec3d]
    leaf_starts: wp.array[int]
    leaf_windings: wp.array[int]
    leaves: wp.array2d[int]
    areas: wp.array[wp.float64]


@wp.func
def _clear_by(windings: Windings, winding: int, point: wp.vec3d):
    """Distance of a point in a winding's plane from its nearest edge, negative outside."""
    least = wp.float64(wp.inf)
    for k in range(windings.edge_starts[winding], windings.edge_starts[winding + 1]):
        least = wp.min(least, wp.dot(windings.edge_normals[k], point) - windings.edge_offsets[k])
    return least


@wp.func
def _random_unit(state: wp.uint32, more: wp.uint32):
    height = wp.float64(2.0) * wp.float64(wp.randf(state)) - wp.float64(1.0)
    angle = wp.float64(2.0 * wp.pi) * wp.float64(wp.randf(more))
    radius = wp.sqrt(wp.max(wp.float64(0.0), wp.float64(1.0) - height * height))
    return wp.vec3d(radius * wp.cos(angle), radius * wp.sin(angle), height)


@wp.struct
class Line:
    """A line from a winding of a leaf into the leaf behind it."""

    origin: wp.vec3d
    way: wp.vec3d
    # Distance from the nearest edge of every winding crossed so far.
    margin: wp.float64
    behind: int


@wp.func
def _draw_winding(windings: Windings, leaf: int, share: wp.float64) -> int:
    """A winding of the leaf, by area; share from 0 to 1."""
    first, last = windings.leaf_starts[leaf], windings.leaf_starts[leaf + 1]
    left = wp.float64(0.0)
    for k in range(first, last):
        left += windings.areas[windings.leaf_windings[k]]
    left *= share
    slot = int(first)
    while slot < last - 1 and left > windings.areas[windings.leaf_windings[slot]]:
        left -= windings.areas[windings.leaf_windings[slot]]
        slot += 1
    return windings.leaf_windings[slot]


@wp.func
def _draw_line(windings: Windings, leaf: int, seed: int, number: int) -> Line:
    """A random line out of the leaf; without margin if it is too slanted to follow."""
    state = wp.rand_init(seed, number)
    # `randf` advances its own copy of the state in a function, so each draw gets a state of its own.
    one, two = wp.rand_init(seed + 1, number), wp.rand_init(seed + 2, number)
    three, four = wp.rand_init(seed + 3, number), wp.rand_init(seed + 4, number)
    winding = _draw_winding(windings, leaf, wp.float64(wp.randf(state)))
    start = windings.edge_starts[winding]
    corners = windings.edge_starts[winding + 1] - start
    fan = wp.min(int(wp.randf(one) * float(corners - 2)), corners - 3)
    s, t = wp.sqrt(wp.float64(wp.randf(two))), wp.float64(wp.randf(three))
    line = Line()
    line.origin = windings.corners[start] * (wp.float64(1.0) - s)
    line.origin += windings.corners[start + fan + 1] * (s * (wp.float64(1.0) - t))
    line.origin += windings.corners[start + fan + 2] * (s * t)
    line.way = _random_unit(state, four)
    line.margin = _clear_by(windings, winding, line.origin)
    # The plane faces the first leaf; the line goes into the other one.
    facing = wp.float64(1.0)
    line.behind = windings.leaves[winding, 0]
    if line.behind == leaf:
        line.behind = windings.leaves[winding, 1]
        facing = wp.float64(-1.0)
    if wp.dot(windings.normals[winding], line.way) * facing < wp.float64(0.0):
        line.way = -line.way
    if wp.abs(wp.dot(windings.normals[winding], line.way)) < SLANT:
        line.margin = wp.float64(-1.0)
    return line


@wp.func
def _is_new(targets: wp.array2d[int], leaf: int, found: int, target: int) -> bool:
    """Whether the target is none of the first `found` of the leaf."""
    for k in range(found):
        if targets[leaf, k] == target:
            return False
    return True


@wp.func
def _leave(windings: Windings, here: int, line: Line, entered: wp.float64) -> tuple[int, wp.float64, wp.float64]:
    """The winding by which a line surely leaves a leaf that it entered, -1 if there is none; the time and margin."""
    for k in range(windings.leaf_starts[here], windings.leaf_starts[here + 1]):
        winding = windings.leaf_windings[k]
        slope = wp.dot(windings.normals[winding], line.way)
        if wp.abs(slope) > SLANT:
            time = (windings.offsets[winding] - wp.dot(windings.normals[winding], line.origin)) / slope
            if time > entered + wp.float64(1.0e-6):
                margin = _clear_by(windings, winding, line.origin + line.way * time)
                if margin > MARGIN:
                    return winding, time, margin
    return -1, entered, line.margin


@wp.kernel
def follow_windings(
    windings: Windings,
    lines: int,
    seed: int,
    claimed: wp.array2d[wp.bool],
    seen_out: wp.array2d[wp.uint8],
    origins_out: wp.array2d[wp.vec3d],
    directions_out: wp.array2d[wp.vec3d],
    margins_out: wp.array2d[wp.float64],
    targets_out: wp.array2d[int],
):
    """Follow `lines` random lines from each leaf; of leaves that it sees but does not claim keep a few lines."""
    leaf = wp.tid()
    found = int(0)
    if windings.leaf_starts[leaf + 1] == windings.leaf_starts[leaf]:
        return
    for number in range(lines):
        line = _draw_line(windings, leaf, seed, leaf * lines + number)
        here, at = int(line.behind), wp.float64(0.0)
        for _ in range(STEPS):
            if here < 0 or here == leaf or line.margin < MARGIN:
                break
            if claimed[leaf, here]:
                seen_out[leaf, here] = wp.uint8(1)
            elif found < targets_out.shape[1] and _is_new(targets_out, leaf, found, here):
                targets_out[leaf, found] = here
                origins_out[leaf, found] = line.origin
                directions_out[leaf, found] = line.way
                margins_out[leaf, found] = line.margin
                found += 1
            winding, time, margin = _leave(windings, here, line, at)
            if winding < 0:
                here = -1
            else:
                here = windings.leaves[winding, 0] + windings.leaves[winding, 1] - here
                line.margin = wp.min(line.margin, margin)
                at = time


# Wrong-hidden leaves kept of one leaf in one launch.
KEPT = 64


class WindingLines:
    """Random lines through a map's windings."""

    def __init__(self, portals: LeafPortals):
        """Take the portals; their windings' planes are fitted, and windings without area left out."""
        self.portals = _oriented(portals)
        self._windings = _on_device(self.portals)

    def sample(self, claimed: np.ndarray, lines: int, seed: int) -> tuple[np.ndarray, list[tuple]]:
        """What random lines from each leaf see.

        Args:
            claimed: shape (leaves, leaves), bool.
            lines: from each leaf.
            seed: of the lines.

        Returns:
            Claimed pairs that a line joins, shape (leaves, leaves), bool, and suspects: (leaf, target, origin,
            direction, margin) of pairs that are not claimed, at most KEPT per leaf; map units, float64.
        """
        count = self.portals.leaf_count
        seen = np.zeros((count, count), np.uint8)
        origins, directions = np.zeros((count, KEPT, 3)), np.zeros((count, KEPT, 3))
        margins, targets = np.zeros((count, KEPT)), np.full((count, KEPT), -1, np.int32)
        out = [wp.array(seen, device="cpu", copy=False)]
        out += [wp.array(points, dtype=wp.vec3d, device="cpu", copy=False) for points in (origins, directions)]
        out += [wp.array(values, device="cpu", copy=False) for values in (margins, targets)]
        allowed = wp.array(np.ascontiguousarray(claimed), dtype=wp.bool, device="cpu")
        wp.launch(follow_windings, count, inputs=[self._windings, lines, seed, allowed], outputs=out, device="cpu")
        suspects = [
            (int(leaf), int(targets[leaf, k]), origins[leaf, k], directions[leaf, k], float(margins[leaf, k]))
            for leaf, k in np.argwhere(targets >= 0)
        ]
        return seen.astype(bool), suspects

    def path(self, leaf: int, target: int, origin: np.ndarray, direction: np.ndarray) -> list[int] | None:
        """Portals that a line passes on its way, found in rationals; None if it does not get there.

        The origin lies in a winding of the leaf, or so near that the line passes it.
        """
        o, d = ([Fraction(float(c)) for c in vector] for vector in (origin, direction))
        path, here = [], leaf
        while here != target and len(path) < int(STEPS):
            options = np.flatnonzero((self.portals.leaves == here).any(axis=1))
            passed = [int(k) for k in options if k not in path and self._leaves_by(int(k), here, o, d)]
            if len(passed) != 1:
                return None
            path.append(passed[0])
            here = int(self.portals.leaves[passed[0]].sum()) - here
        return path if here == target else None

    def beyond(self, portal: int, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """A point of a line a little behind a winding's plane, 3 float64."""
        corners = self.portals.corners[self.portals.starts[portal] : self.portals.starts[portal + 1]]
        normal = np.cross(corners - corners[0], np.roll(corners, -1, axis=0) - corners[0]).sum(axis=0)
        return origin + direction * (normal @ (corners[0] - origin) / (normal @ direction) + float(MARGIN))

    def _leaves_by(self, portal: int, leaf: int, origin: Sequence[Fraction], way: Sequence[Fraction]) -> bool:
        """Whether a line passes a winding's inside, on its way out of the leaf: all edges turn the same way about it.

        Windings face their first leaf, so a line that leaves it turns clockwise about the edges.
        """
        corners = self.portals.corners[self.portals.starts[portal] : self.portals.starts[portal + 1]]
        points = [[Fraction(float(c)) - o for c, o in zip(corner, origin, strict=True)] for corner in corners]
        turns = {_turn(points[k - 1], points[k], way) for k in range(len(points))}
        return turns == ({-1} if int(self.portals.leaves[portal, 0]) == leaf else {1})


def _turn(a: Sequence[Fraction], b: Sequence[Fraction], way: Sequence[Fraction]) -> int:
    """Sign of way . (a x b): on which side a line through the origin passes the edge from a to b."""
    value = (
        way[0] * (a[1] * b[2] - a[2] * b[1])
        + way[1] * (a[2] * b[0] - a[0] * b[2])
        + way[2] * (a[0] * b[1] - a[1] * b[0])
    )
    return (value > 0) - (value < 0)


def _oriented(portals: LeafPortals) -> LeafPortals:
    """The portals, each winding turned to face its first leaf: the side on which that leaf's other windings lie.

    Where both leaves lie in the winding's plane the file's own order stands, which is the compilers' convention.
    """
    starts, corners = portals.starts, portals.corners.copy()
    owner = np.repeat(np.arange(len(portals.leaves)), np.diff(starts))
    ends = portals.leaves[owner]
    middles = np.zeros((portals.leaf_count, 3))
    sizes = np.bincount(ends.ravel(), minlength=portals.leaf_count)
    np.add.at(middles, ends.ravel(), np.repeat(corners, 2, axis=0))
    middles /= np.maximum(sizes, 1)[:, None]
    for row, (first, second) in enumerate(portals.leaves):
        part = corners[starts[row] : starts[row + 1]]
        normal = np.cross(part - part[0], np.roll(part, -1, axis=0) - part[0]).sum(axis=0)
        if normal @ (middles[first] - middles[second]) < 0:
            corners[starts[row] : starts[row + 1]] = part[::-1]
    return replace(portals, corners=corners)


def _on_device(portals: LeafPortals) -> Windings:
    """Planes, edge planes and lists of windings by leaf."""
    count, starts = len(portals.leaves), portals.starts
    normals, offsets, areas = np.zeros((count, 3)), np.zeros(count), np.zeros(count)
    edges, edge_offsets = np.zeros((len(portals.corners), 3)), np.zeros(len(portals.corners))
    for row in range(count):
        corners = portals.corners[starts[row] : starts[row + 1]]
        following = np.roll(corners, -1, axis=0)
        twice = np.cross(corners - corners[0], following - corners[0]).sum(axis=0)
        areas[row] = np.linalg.norm(twice) / 2
        if not areas[row]:
            continue
        normals[row] = twice / (2 * areas[row])
        offsets[row] = normals[row] @ corners.mean(axis=0)
        inward = np.cross(normals[row], following - corners)
        size = np.linalg.norm(inward, axis=1, keepdims=True)
        inward = np.divide(inward, size, out=np.zeros_like(inward), where=size > 0)
        edges[starts[row] : starts[row + 1]] = inward
        edge_offsets[starts[row] : starts[row + 1]] = (inward * corners).sum(axis=1)
    used = np.flatnonzero(areas > 0)
    owner = portals.leaves[used].T.ravel()
    order = np.argsort(owner, kind="stable")
    windings = Windings()
    for name, points in (("normals", normals), ("edge_normals", edges), ("corners", portals.corners)):
        setattr(windings, name, wp.array(np.ascontiguousarray(points), dtype=wp.vec3d, device="cpu"))
    for name, values in (("offsets", offsets), ("edge_offsets", edge_offsets), ("areas", areas)):
        setattr(windings, name, wp.array(values, dtype=wp.float64, device="cpu"))
    bounds = np.searchsorted(owner[order], np.arange(portals.leaf_count + 1))
    lists = {"edge_starts": starts, "leaf_starts": bounds, "leaf_windings": np.tile(used, 2)[order]}
    for name, values in lists.items():
        setattr(windings, name, wp.array(values.astype(np.int32), dtype=int, device="cpu"))
    windings.leaves = wp.array(portals.leaves.astype(np.int32), dtype=int, device="cpu")
    return windings
