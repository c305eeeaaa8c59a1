"""Back-face culling against a view cell: triangles that turn their backs on every point of it.

Each object has a binary hierarchy of triangle groups, split where positions or normals differ most, each with a box and
a cone of normals. A group's vectors from its points to the view cell's fill a box, too, and the largest scalar product
of a normal in the cone with a vector in that box is attained at one of its corners; where it is negative the whole
group is turned away. Groups that neither turn away nor face the cell's centre are split; leaves are tested exactly.

Source: Chhugani et al. 2005, section 5.1, with the box of vectors in place of eight visibility cones, which is sharper.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..data.errors import InputError
from ..data.ragged import owners_of, places_of, starts_of
from .launch import CPU, Device, launch_rows

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

LEAF_SIZE = 8
# Added to the sine of each cone's half angle: the rounding of unit normals and of scalar products with them.
SINE_MARGIN = 2.0**-44
# A cone that holds two normals at right angles or more says nothing; no scalar product reaches this sine.
NO_CONE = 4.0
# A volume is positive if it exceeds its terms' absolute sum times this, far above the rounding of that sum.
VOLUME_MARGIN = 1e-9
# Normals are split at this bit, so that their products with coordinates fit 64 bits.
LOW_BITS = wp.constant(26)
LOW_MASK = wp.constant(wp.int64(2**26 - 1))


@wp.struct
class ConeTree:
    """Nodes of all hierarchies, and the leaves' triangles; see `NormalCones`."""

    lo: wp.array[wp.vec3i]
    hi: wp.array[wp.vec3i]
    cones: wp.array[wp.vec4d]
    links: wp.array[wp.vec2i]
    ranges: wp.array[wp.vec2i]
    roots: wp.array[int]
    normals: wp.array[wp.vec3l]
    anchors: wp.array[wp.vec3i]


@wp.func
def corner(low: wp.vec3d, high: wp.vec3d, index: int) -> wp.vec3d:
    """One of the eight corners of a box."""
    out = low
    for c in range(3):
        if ((index >> c) & 1) == 1:
            out[c] = high[c]
    return out


@wp.func
def turned_away(cone: wp.vec4d, low: wp.vec3d, high: wp.vec3d) -> bool:
    """Whether every normal of the cone has a negative scalar product with every vector of the box."""
    axis = wp.vec3d(cone[0], cone[1], cone[2])
    for k in range(8):
        d = corner(low, high, k)
        if wp.dot(axis, d) + cone[3] * wp.length(d) >= f64(0.0):
            return False
    return True


@wp.func
def is_back_facing(normal: wp.vec3l, anchor: wp.vec3i, low: wp.vec3i, high: wp.vec3i) -> bool:
    """Whether normal . (p - anchor) <= 0 for every point p of the box; exact."""
    # The greatest product is top * 2^26 + bottom, both sums of three terms below 2^52.
    top = wp.int64(0)
    bottom = wp.int64(0)
    for c in range(3):
        d = low[c] - anchor[c]
        if normal[c] > wp.int64(0):
            d = high[c] - anchor[c]
        top += (normal[c] >> wp.int64(LOW_BITS)) * wp.int64(d)
        bottom += (normal[c] & LOW_MASK) * wp.int64(d)
    top += bottom >> wp.int64(LOW_BITS)
    return top < wp.int64(0) or (top == wp.int64(0) and (bottom & LOW_MASK) == wp.int64(0))


@wp.kernel
def _count(
    tree: ConeTree,
    boxes_low: wp.array[wp.vec3i],
    boxes_high: wp.array[wp.vec3i],
    rows: wp.array[wp.vec2i],
    first: int,
    removed_out: wp.array[int],
):
    row = first + wp.tid()
    low = boxes_low[rows[row][0]]
    high = boxes_high[rows[row][0]]
    near = wp.vec3d(f64(low[0]), f64(low[1]), f64(low[2]))
    far = wp.vec3d(f64(high[0]), f64(high[1]), f64(high[2]))
    centre = (near + far) * f64(0.5)
    removed = int(0)
    node = int(tree.roots[rows[row][1]])
    while node >= 0:
        lo = wp.vec3d(f64(tree.lo[node][0]), f64(tree.lo[node][1]), f64(tree.lo[node][2]))
        hi = wp.vec3d(f64(tree.hi[node][0]), f64(tree.hi[node][1]), f64(tree.hi[node][2]))
        cone = tree.cones[node]
        span = tree.ranges[node]
        after = tree.links[node][1]
        if turned_away(cone, near - hi, far - lo):
            removed += span[1] - span[0]
        # What faces the cell's centre is not turned away from all of it; a vector negated is a cone negated.
        elif not turned_away(cone, lo - centre, hi - centre):
            if tree.links[node][0] >= 0:
                after = tree.links[node][0]
            else:
                for k in range(span[0], span[1]):
                    if is_back_facing(tree.normals[k], tree.anchors[k], low, high):
                        removed += 1
        node = after
    removed_out[row] = removed


@dataclass
class NormalCones:
    """Hierarchies of the triangles that may be culled.

    Attributes:
        triangles: leaf after leaf [grid steps], shape (t, 3, 3), int32.
        owners: object of each triangle, shape (t,), int32.
        counts: triangles of each object, those that may not be culled included, shape (objects,), int.
        boxes: of each node [grid steps], shape (nodes, 2, 3), int32.
        cones: unit axis and sine of the half angle of each node, rounded up, shape (nodes, 4), float64; sine 4 where
            normals of a node differ by a right angle or more.
        links: first child of each node, or -1 for a leaf; and the node after its subtree, or -1; shape (nodes, 2).
        ranges: first and past-the-last triangle of each node, shape (nodes, 2), int32.
        roots: node of each object, or -1, shape (objects,), int32.
    """

    triangles: np.ndarray
    owners: np.ndarray
    counts: np.ndarray
    boxes: np.ndarray
    cones: np.ndarray
    links: np.ndarray
    ranges: np.ndarray
    roots: np.ndarray

    def tree(self, device: Device) -> ConeTree:
        """Copy to a device."""
        lo, hi = (device.corners(self.boxes[:, end]) for end in (0, 1))
        normals, anchors = integer_normals(self.triangles), device.corners(self.triangles[:, 0])
        nodes = {"lo": lo, "hi": hi, "cones": self.cones, "links": self.links, "ranges": self.ranges}
        return device.struct(ConeTree, **nodes, roots=self.roots, normals=normals, anchors=anchors)


def integer_normals(triangles: np.ndarray) -> np.ndarray:
    """Exact outward normals, not of unit length, shape (t, 3), int64, |component| < 2**52."""
    a, b = (triangles[:, k].astype(np.int64) - triangles[:, 0] for k in (1, 2))
    return np.cross(a, b)


def build_cones(
    elements: list[tuple[int, np.ndarray]], counts: np.ndarray, models: np.ndarray | None = None
) -> NormalCones:
    """Normal cones of the opaque shells that are closed and turned outwards; no other triangle may be culled.

    A shell (triangles joined by edges) of an element whose directed edges all pair off counts if its volume is
    positive. Seen from outside such a shell, a triangle's back is behind another triangle of it. A shell that passes
    through itself and turns inside out on the way is not recognised.

    Args:
        elements: (object_id, triangles (m, 3, 3) int32) of each closed opaque element, in object order.
        counts: triangles of each object, those that may not be culled included, shape (objects,), int.
        models: of each object the first that is alike (`Scene.first_alike`), shape (objects,), int: saves time.
    """
    ids = np.array([owner for owner, _ in elements], np.int64)
    # The first element of each shape stands for the others.
    _, first, same = np.unique(ids if models is None else models[ids], return_index=True, return_inverse=True)
    chosen = [elements[k] for k in np.sort(first)]
    owners = np.concatenate([np.full(len(part), owner, np.int32) for owner, part in chosen] or [np.zeros(0, np.int32)])
    triangles = np.concatenate([part for _, part in chosen] or [np.zeros((0, 3, 3), np.int32)])
    kept = _outward(triangles, owners)
    cones = _hierarchy(triangles[kept], owners[kept], counts)
    if len(chosen) == len(elements):
        return cones
    model = ids[first[same]]
    corners = np.array([part[0, 0] for _, part in elements])
    return _copied(cones, ids, model, corners - corners[first[same]])


def _copied(cones: NormalCones, ids: np.ndarray, models: np.ndarray, shift: np.ndarray) -> NormalCones:
    """Cones of objects, each those of its model shifted [grid steps], shape (objects, 3)."""
    # Triangles of each object are together as it is; now its nodes are, too.
    node_owner = cones.owners[cones.ranges[:, 0]] if len(cones.ranges) else np.zeros(0, np.int32)
    order = np.argsort(node_owner, kind="stable")
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    nodes = [np.searchsorted(node_owner[order], models, side=side) for side in ("left", "right")]
    places = [np.searchsorted(cones.owners, models, side=side) for side in ("left", "right")]
    node_starts, starts = (starts_of(high - low) for low, high in (nodes, places))
    node, triangle = (places_of(low, high - low) for low, high in (nodes, places))
    by_node, by_triangle = owners_of(node_starts), owners_of(starts)
    links = cones.links[order[node]]
    links = np.where(links >= 0, rank[links] + (node_starts[:-1] - nodes[0])[by_node, None], -1)
    ranges = cones.ranges[order[node]] + (starts[:-1] - places[0])[by_node, None]
    roots = np.full(len(cones.counts), -1, np.int32)
    some = np.diff(node_starts) > 0
    roots[ids[some]] = node_starts[:-1][some]
    return NormalCones(
        (cones.triangles[triangle] + shift[by_triangle, None]).astype(np.int32),
        ids[by_triangle].astype(np.int32),
        cones.counts,
        (cones.boxes[order[node]] + shift[by_node, None]).astype(np.int32),
        cones.cones[order[node]],
        links.astype(np.int32),
        ranges.astype(np.int32),
        roots,
    )


def _corner_numbers(triangles: np.ndarray, owners: np.ndarray) -> np.ndarray:
    """A number for each corner, the same for equal points of one owner only, shape (t, 3), int."""
    # Coordinates are below 2**24 in size: two fit into one key, and sorting two keys is ten times faster than rows.
    x, y, z = (triangles.reshape(-1, 3).astype(np.int64) + 2**24).T
    first, second = x << 25 | y, np.repeat(owners, 3).astype(np.int64) << 25 | z
    order = np.lexsort((first, second))
    new = (np.diff(first[order], prepend=-1) != 0) | (np.diff(second[order], prepend=-1) != 0)
    numbers = np.empty(len(order), np.int64)
    numbers[order] = np.cumsum(new) - 1
    return numbers.reshape(-1, 3)


def _outward(triangles: np.ndarray, owners: np.ndarray) -> np.ndarray:
    """Triangles of closed elements that belong to a shell of positive volume, shape (t,), bool."""
    if not len(triangles):
        return np.zeros(0, bool)
    corners = _corner_numbers(triangles, owners)
    ends = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    joined = np.flatnonzero((ends[order][1:] == ends[order][:-1]).all(axis=1))
    pairs = order[joined] // 3, order[joined + 1] // 3
    links = coo_array((np.ones(len(joined)), pairs), shape=(len(triangles), len(triangles)))
    count, shell = connected_components(links, directed=False)
    start = np.zeros((count, 3))
    start[shell] = triangles[:, 0]
    a, b, c = (triangles[:, k] - start[shell] for k in range(3))
    terms = (a * np.cross(b, c)).sum(axis=1)
    # A bound on the absolute sum of the six products that make each term.
    size = np.sqrt((a * a).sum(axis=1) * (b * b).sum(axis=1) * (c * c).sum(axis=1)) * 6
    volume, total = (np.bincount(shell, weights, count) for weights in (terms, size))
    return (volume > VOLUME_MARGIN * total)[shell]


def _hierarchy(triangles: np.ndarray, owners: np.ndarray, counts: np.ndarray) -> NormalCones:
    """Halve every object's triangles, level by level, until LEAF_SIZE or fewer are left; owners ascend."""
    normals = integer_normals(triangles).astype(np.float64)
    normals /= np.sqrt((normals * normals).sum(axis=1, keepdims=True))
    centres = triangles.astype(np.float64).mean(axis=1)
    order = np.arange(len(triangles))
    objects, starts = np.unique(owners, return_index=True)
    roots = np.full(len(counts), -1, np.int32)
    roots[objects] = np.arange(len(objects))
    ranges = np.column_stack([starts, np.append(starts, len(triangles))[1:]])
    # A difference of positions as long as the object counts as much as the greatest difference of normals.
    size = _reduce(np.maximum, centres, order, ranges) - _reduce(np.minimum, centres, order, ranges)
    features = centres * (2 / np.maximum(size.max(axis=1, initial=1), 1))[np.searchsorted(objects, owners)][:, None]
    features = np.column_stack([features, normals])
    skip, levels, count = np.full(len(ranges), -1), [], len(ranges)
    while len(ranges):
        split = ranges[:, 1] - ranges[:, 0] > LEAF_SIZE
        children = np.full(len(ranges), -1)
        children[split] = count + 2 * np.arange(split.sum())
        low = _reduce(np.minimum, triangles.min(axis=1), order, ranges)
        high = _reduce(np.maximum, triangles.max(axis=1), order, ranges)
        levels.append((np.stack([low, high], axis=1), _cones(normals, order, ranges), children, skip, ranges))
        parents = ranges[split]
        _sort(order, features, parents)
        middle = parents.sum(axis=1) // 2
        ranges = np.stack([parents[:, 0], middle, middle, parents[:, 1]], axis=1).reshape(-1, 2)
        skip = np.stack([children[split] + 1, skip[split]], axis=1).ravel()
        count += len(ranges)
    none = (np.zeros((0, 2, 3)), np.zeros((0, 4)), np.zeros(0), np.zeros(0), np.zeros((0, 2)))
    boxes, cones, children, skip, ranges = (np.concatenate(column) for column in zip(*(levels or [none]), strict=True))
    links = np.column_stack([children, skip]).astype(np.int32)
    owners = owners[order].astype(np.int32)
    return NormalCones(
        triangles[order], owners, counts, boxes.astype(np.int32), cones, links, ranges.astype(np.int32), roots
    )


def _members(ranges: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places in all ranges (none empty), the range of each, and where each range begins among them."""
    sizes = ranges[:, 1] - ranges[:, 0]
    begins = np.cumsum(sizes) - sizes
    group = np.repeat(np.arange(len(ranges)), sizes)
    return np.arange(len(group)) - begins[group] + ranges[group, 0], group, begins


def _reduce(what: np.ufunc, values: np.ndarray, order: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """Reduce values[order] over each range."""
    places, _, begins = _members(ranges)
    return what.reduceat(values[order[places]], begins, axis=0) if len(ranges) else values[:0]


def _sort(order: np.ndarray, features: np.ndarray, ranges: np.ndarray) -> None:
    """Sort each range of `order`, in place, by the feature that differs most in it."""
    widest = (_reduce(np.maximum, features, order, ranges) - _reduce(np.minimum, features, order, ranges)).argmax(
        axis=1
    )
    places, group, _ = _members(ranges)
    order[places] = order[places][np.lexsort((features[order[places], widest[group]], group))]


def _cones(normals: np.ndarray, order: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """Axis and sine of a cone that holds the unit normals of each range, shape (ranges, 4), float64."""
    places, group, begins = _members(ranges)
    middle = _reduce(np.maximum, normals, order, ranges) + _reduce(np.minimum, normals, order, ranges)
    length = np.sqrt((middle * middle).sum(axis=1, keepdims=True))
    axis = middle / np.where(length > 0, length, 1)
    own, axes = normals[order[places]], axis[group]
    sine = np.maximum.reduceat(np.sqrt((np.cross(own, axes) ** 2).sum(axis=1)), begins) + SINE_MARGIN
    acute = np.minimum.reduceat((own * axes).sum(axis=1), begins) > SINE_MARGIN
    return np.column_stack([axis, np.where(acute, sine, NO_CONE)])


def launch_backface(
    cones: NormalCones, boxes: np.ndarray, rows: np.ndarray, *, device: Device = CPU
) -> tuple[np.ndarray, np.ndarray]:
    """Count the triangles of objects that are back-facing from everywhere in a view cell.

    Args:
        cones: from `build_cones`.
        boxes: view cells [grid steps], shape (cells, 2, 3), int32, |coordinate| < 2**24.
        rows: (cell, object), shape (n, 2), int.
        device: where to.

    Returns:
        Triangles removed, shape (n,), int32: exactly those of closed outward shells whose planes have the closed cell
        behind or on them; no eye in the cell and outside the shell sees one. And whether that is every triangle of the
        object, shape (n,), bool: then the cell lies inside it, and nothing should be culled.

    Raises:
        InputError: a shape, or a row that names no cell or no object.
    """
    boxes, rows = np.asarray(boxes), np.ascontiguousarray(rows, np.int32)
    if boxes.shape[1:] != (2, 3) or rows.ndim != 2 or rows.shape[1] != 2:
        raise InputError(f"boxes, rows: expected shapes (n, 2, 3) and (m, 2), found {boxes.shape} and {rows.shape}")
    limits = (len(boxes), len(cones.roots))
    if len(rows) and ((rows < 0).any() or (rows.max(axis=0) >= limits).any()):
        raise InputError(f"rows: expected pairs below {limits}, found {rows.min(axis=0)} to {rows.max(axis=0)}")
    low, high = (device.corners(boxes[:, end]) for end in (0, 1))
    removed = device.zeros(len(rows), int)
    launch_rows(_count, len(rows), [cones.tree(device), low, high, device.array(rows, wp.vec2i)], [removed], device)
    counts = removed.numpy()
    return counts, (counts > 0) & (counts == cones.counts[rows[:, 1]])
