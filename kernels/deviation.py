"""Deviation of one triangle mesh from another: bounds from both sides on the Hausdorff distance of their surfaces.

One direction is max over a in A of min over b in B of |a - b|. The distance to one triangle T of B is a convex function
of space, so over a piece s of a triangle of A it is greatest at a corner of s, and

    max over s of the distance to B  <=  min over T of max over the corners v of s of |v - T|       (upper)

for any choice of T; the triangles nearest to the corners and to the centroid of s are tried. Any point of s gives a
lower bound. A triangle n . x >= k for a unit vector n lies at least k - n . p from a point p (lower, for each T), and n
from p to its nearest point makes that sharp. Pieces whose upper bound is not yet close to the greatest lower bound are
cut in two: where the corners' nearest triangles change places along an edge, which is where distances to B have their
ridges, or in the middle of the longest edge. Every third round halves the longest edge, so pieces shrink to points.

Rounding: the nearest point of a triangle is a convex combination of its corners however badly its weights are rounded,
and a cut moves a point of the surface by at most 9 R u (u = 2**-53, R the greatest |coordinate|: 5 R u an axis). All
MAX_ROUNDS of them, the sums of a nearest point and the scalar products stay below 1000 R u; ROUNDING is twice that.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..data.errors import InputError
from .hierarchy import build_hierarchy
from .launch import CPU, Device, launch_rows

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

ROUNDING = 2.0**-42
MAX_ROUNDS = 64
# Pieces in a round beyond which the bounds are given as they are: valid, but further apart than asked.
MAX_PIECES = 2**20
# Bits of the integers in which the boxes of the hierarchy are rounded outwards.
BOX_BITS = 24
# A triangle flatter than a millionth of a millionth is as near as its edges.
FLAT = wp.constant(wp.float64(1.0e-24))
# Halvings that find where two triangles are equally near, and how near to a corner a cut may be.
CROSSING_STEPS = wp.constant(30)
CORNER = wp.constant(wp.float64(0.01))
FAR = wp.constant(wp.float64(np.inf))


@wp.struct
class TriangleTree:
    """Triangles (three corners each) and a hierarchy of boxes about them; links as of `kernels.hierarchy`."""

    lo: wp.array[wp.vec3d]
    hi: wp.array[wp.vec3d]
    links: wp.array[wp.vec2i]
    corners: wp.array[wp.vec3d]


@wp.func
def nearest_on_segment(p: wp.vec3d, a: wp.vec3d, d: wp.vec3d) -> wp.vec3d:
    """The point of the segment from a to a + d that is nearest to p."""
    t = f64(0.0)
    if wp.dot(d, d) > f64(0.0):
        t = wp.clamp(wp.dot(p - a, d) / wp.dot(d, d), f64(0.0), f64(1.0))
    return a + d * t


@wp.func
def nearest_on_triangle(p: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d) -> wp.vec3d:
    """The point of a triangle that is nearest to p; the triangle may be a segment or a point."""
    u = b - a
    v = c - a
    n = wp.cross(u, v)
    square = wp.dot(n, n)
    if square > FLAT * wp.dot(u, u) * wp.dot(v, v):
        s = wp.dot(wp.cross(p - a, v), n) / square
        t = wp.dot(wp.cross(u, p - a), n) / square
        if s >= f64(0.0) and t >= f64(0.0) and s + t <= f64(1.0):
            return a + u * s + v * t
    best = nearest_on_segment(p, a, u)
    other = nearest_on_segment(p, a, v)
    if wp.length_sq(other - p) < wp.length_sq(best - p):
        best = other
    other = nearest_on_segment(p, b, c - b)
    if wp.length_sq(other - p) < wp.length_sq(best - p):
        best = other
    return best


@wp.func
def triangle_square(tree: TriangleTree, item: int, p: wp.vec3d) -> wp.float64:
    """Squared distance of p from a triangle; never below the true one, but for rounding."""
    a = tree.corners[3 * item]
    return wp.length_sq(nearest_on_triangle(p, a, tree.corners[3 * item + 1], tree.corners[3 * item + 2]) - p)


@wp.func
def box_square(tree: TriangleTree, node: int, p: wp.vec3d) -> wp.float64:
    """Squared distance of p from a node's box."""
    sum = f64(0.0)
    for k in range(3):
        d = wp.max(wp.max(tree.lo[node][k] - p[k], p[k] - tree.hi[node][k]), f64(0.0))
        sum += d * d
    return sum


@wp.func
def support(p: wp.vec3d, q: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d) -> wp.float64:
    """Distance along q - p by which the whole triangle is away from p: never above its distance, but for rounding."""
    length = wp.length(q - p)
    if length == f64(0.0):
        return f64(0.0)
    n = (q - p) / length
    return wp.max(wp.min(wp.min(wp.dot(a - p, n), wp.dot(b - p, n)), wp.dot(c - p, n)), f64(0.0))


@wp.func
def nearest(tree: TriangleTree, p: wp.vec3d, guess: int) -> wp.vec2d:
    """A triangle that is as near to p as any, and a lower bound on the distance; `guess` only saves time."""
    item = int(guess)
    best = triangle_square(tree, guess, p)
    low = f64(wp.sqrt(best))
    node = int(0)
    while node >= 0 and node < tree.links.shape[0]:
        after = tree.links[node][0]
        # An equally near box is entered: the guess itself has no lower bound yet.
        if box_square(tree, node, p) <= best:
            leaf = tree.links[node][1]
            # Inner nodes and empty leaves hold no triangle; the next node is a first child, or the skip of a leaf.
            after = node + 1
            if leaf >= 0:
                a = tree.corners[3 * leaf]
                b = tree.corners[3 * leaf + 1]
                c = tree.corners[3 * leaf + 2]
                q = nearest_on_triangle(p, a, b, c)
                low = wp.min(low, support(p, q, a, b, c))
                if wp.length_sq(q - p) < best:
                    best = wp.length_sq(q - p)
                    item = leaf
        node = after
    return wp.vec2d(f64(item), low)


@wp.func
def piece_square(tree: TriangleTree, item: int, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d) -> wp.float64:
    """Squared distance from a triangle of the tree within which the whole piece abc is."""
    ends = wp.max(triangle_square(tree, item, a), triangle_square(tree, item, b))
    return wp.max(ends, triangle_square(tree, item, c))


@wp.func
def crossing(tree: TriangleTree, p: wp.vec3d, q: wp.vec3d, first: int, second: int) -> wp.float64:
    """Where between p (0) and q (1) the second triangle becomes the nearer one; -1 if it does not, or at a corner."""
    near = f64(0.0)
    far = f64(1.0)
    start = p + (q - p) * CORNER
    end = q + (p - q) * CORNER
    if triangle_square(tree, first, start) >= triangle_square(tree, second, start):
        return f64(-1.0)
    if triangle_square(tree, first, end) <= triangle_square(tree, second, end):
        return f64(-1.0)
    for _ in range(CROSSING_STEPS):
        middle = (near + far) * f64(0.5)
        x = p + (q - p) * middle
        if triangle_square(tree, first, x) <= triangle_square(tree, second, x):
            near = middle
        else:
            far = middle
    return near


@wp.kernel
def _nearest(
    tree: TriangleTree,
    points: wp.array[wp.vec3d],
    first: int,
    near_out: wp.array[int],
    low_out: wp.array[wp.float64],
):
    row = first + wp.tid()
    found = nearest(tree, points[row], 0)
    near_out[row] = int(found[0])
    low_out[row] = found[1]


@wp.kernel
def _bound(
    tree: TriangleTree,
    corners: wp.array[wp.vec3d],
    near: wp.array[wp.vec3i],
    enough: wp.float64,
    halve: int,
    first: int,
    upper_out: wp.array[wp.float64],
    low_out: wp.array[wp.float64],
    cut_out: wp.array[wp.vec2i],
    point_out: wp.array[wp.vec3d],
):
    row = first + wp.tid()
    a = corners[3 * row]
    b = corners[3 * row + 1]
    c = corners[3 * row + 2]
    found = nearest(tree, (a + b + c) / f64(3.0), near[row][0])
    low = f64(found[1])
    square = piece_square(tree, int(found[0]), a, b, c)
    for k in range(3):
        square = wp.min(square, piece_square(tree, near[row][k], a, b, c))
    upper = wp.sqrt(square)
    edge = int(0)
    if upper > enough:
        longest = f64(-1.0)
        at = f64(0.5)
        for k in range(3):
            p = corners[3 * row + k]
            q = corners[3 * row + (k + 1) % 3]
            if wp.length_sq(q - p) > longest:
                longest = wp.length_sq(q - p)
                edge = k
        longest = f64(-1.0)
        for k in range(3):
            p = corners[3 * row + k]
            q = corners[3 * row + (k + 1) % 3]
            one = near[row][k]
            two = near[row][(k + 1) % 3]
            if halve == 0 and one != two and wp.length_sq(q - p) > longest:
                t = crossing(tree, p, q, one, two)
                if t > f64(0.0) and t < f64(1.0):
                    longest = wp.length_sq(q - p)
                    edge = k
                    at = t
        p = corners[3 * row + edge]
        q = corners[3 * row + (edge + 1) % 3]
        x = p + (q - p) * at
        found = nearest(tree, x, near[row][edge])
        low = wp.max(low, found[1])
        point_out[row] = x
    upper_out[row] = upper
    low_out[row] = low
    cut_out[row] = wp.vec2i(edge, int(found[0]))


@dataclass(frozen=True)
class Deviation:
    """Bounds on the Hausdorff distance between two surfaces, in their unit.

    Attributes:
        lower: from A to B, and from B to A; shape (2,), float64.
        upper: likewise.
    """

    lower: np.ndarray
    upper: np.ndarray


def launch_deviation(
    a: np.ndarray,
    b: np.ndarray,
    *,
    relative: float = 0.01,
    absolute: float = 2.0**-15,
    device: Device = CPU,
) -> Deviation:
    """How far two surfaces are from each other at most, and at least, in each direction.

    Args:
        a: triangles, shape (n, 3, 3), float64, finite; a triangle may be a segment or a point.
        b: likewise, shape (m, 3, 3), in the same frame and unit.
        relative: search ends where upper <= lower * (1 + relative) ...
        absolute: ... or upper <= lower + absolute, above 0.
        device: where to.

    Returns:
        Bounds with lower <= true distance <= upper, rounding included. Should MAX_PIECES be reached, upper is above
        what was asked for, never below the distance.

    Raises:
        InputError: a surface has no triangle, a coordinate is not finite, or a tolerance is out of range.

    Source: the convexity argument of Guthe, Borodin and Klein 2005, "Fast and accurate Hausdorff distance calculation
    between meshes"; lower bounds by supporting planes.
    """
    a, b = (np.ascontiguousarray(x, np.float64) for x in (a, b))
    for name, x in (("a", a), ("b", b)):
        if x.ndim != 3 or x.shape[1:] != (3, 3) or not len(x):
            raise InputError(f"{name}: expected triangles of shape (n, 3, 3) with n above 0, found {x.shape}")
        if not np.isfinite(x).all():
            raise InputError(f"{name}: expected finite coordinates, found {x[~np.isfinite(x)][0]}")
    if not (absolute > 0 and 0 <= relative < np.inf):
        raise InputError(f"relative, absolute: expected at least 0 and above 0, found {relative} and {absolute}")
    margin = ROUNDING * max(np.abs(a).max(), np.abs(b).max())
    search = _Search(relative, absolute, margin, device)
    lower, upper = zip(search.directed(a, b), search.directed(b, a), strict=True)
    return Deviation(np.array(lower), np.array(upper))


@dataclass(frozen=True)
class _Search:
    """Branch and bound over pieces of one surface."""

    relative: float
    absolute: float
    margin: float
    device: Device

    def directed(self, a: np.ndarray, b: np.ndarray) -> tuple[float, float]:
        """Lower and upper bound on the greatest distance from a to b."""
        tree = self._tree(b)
        points, corner = np.unique(a.reshape(-1, 3), axis=0, return_inverse=True)
        near, low = self._nearest(tree, points)
        near = near[corner].reshape(-1, 3)
        lower, upper, above = low.max(), 0.0, np.full(len(a), np.inf)
        for number in range(MAX_ROUNDS):
            bound, low, cut, point = self._bound(tree, a, near, self._enough(lower), number % 3 == 2)
            lower = max(lower, low.max())
            above = np.minimum(above, bound)
            left = above > self._enough(lower)
            upper = max(upper, above[~left].max(initial=0.0))
            if not left.any():
                break
            if number == MAX_ROUNDS - 1 or 2 * left.sum() > MAX_PIECES:
                upper = max(upper, above.max())
                break
            a, near = _halves(a[left], near[left], cut[left], point[left])
            above = np.concatenate([above[left]] * 2)
        return max(0.0, lower - self.margin), upper + self.margin

    def _enough(self, lower: float) -> float:
        return max(lower * (1 + self.relative), lower + self.absolute)

    def _tree(self, triangles: np.ndarray) -> TriangleTree:
        # A power of two, so that only the integers of the boxes are rounded, and those outwards.
        scale = 2.0 ** (BOX_BITS - 1 - np.ceil(np.log2(max(np.abs(triangles).max(), 2.0**-900))))
        low, high = triangles.min(axis=1) * scale, triangles.max(axis=1) * scale
        hierarchy = build_hierarchy(np.stack([np.floor(low), np.ceil(high)], axis=1).astype(np.int32))
        lo, hi = (hierarchy.boxes[:, end] / scale for end in (0, 1))
        return self.device.struct(TriangleTree, lo=lo, hi=hi, links=hierarchy.links, corners=triangles.reshape(-1, 3))

    def _nearest(self, tree: TriangleTree, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        near, low = self.device.zeros(len(points), int), self.device.zeros(len(points), f64)
        launch_rows(_nearest, len(points), [tree, self.device.array(points, wp.vec3d)], [near, low], self.device)
        return near.numpy(), low.numpy()

    def _bound(
        self, tree: TriangleTree, a: np.ndarray, near: np.ndarray, enough: float, halve: bool
    ) -> tuple[np.ndarray, ...]:
        """Of each piece: upper bound, lower bound, (cut edge, triangle nearest to the cut), and the cut."""
        corners, nearby = self.device.array(a.reshape(-1, 3), wp.vec3d), self.device.array(near, wp.vec3i)
        out = [self.device.zeros(len(a), kind) for kind in (f64, f64, wp.vec2i, wp.vec3d)]
        launch_rows(_bound, len(a), [tree, corners, nearby, f64(enough), int(halve)], out, self.device)
        return tuple(column.numpy() for column in out)


def _halves(a: np.ndarray, near: np.ndarray, cut: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both halves of each piece: an end of the cut edge moves to the cut."""
    rows = np.arange(len(a))
    halves, nearby = np.stack([a, a]), np.stack([near, near])
    for half in (0, 1):
        end = (cut[:, 0] + half) % 3
        halves[half, rows, end], nearby[half, rows, end] = point, cut[:, 1]
    return halves.reshape(-1, 3, 3), nearby.reshape(-1, 3)
