"""A bounding volume hierarchy that kernels traverse without a stack.

Nodes are in depth-first order: a node's first child is the next node, and `skip` is where to go when the node is missed
or done. Every node is split where the surfaces of its halves, times what they hold, are least: lines meet a box as
often as its surface is large, and walls, slabs and panes of all sizes stand in one tree.

Source: Wald, "On fast construction of SAH-based bounding volume hierarchies" (2007).
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..data.ragged import starts_of
from ..data.shapes import copies, mostly_copies
from .launch import CPU, Scratch, launch_slots

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64
# All of a node in one place, which is what a line that looks at hundreds of them waits for; see `Hierarchy.nodes`.
Node = wp.types.vector(length=8, dtype=wp.int32)

# Bins along an axis, between which a node may be split, and their number again.
BINS = wp.constant(16)
SPAN = wp.constant(wp.float64(16.0))
# A bin: how many boxes it holds, low and high corner of what they fill.
BIN_SIZE = wp.constant(7)
# Bins of the three axes, one that grows, and what the upper bins cost.
AT_SUM = wp.constant(3 * 16 * 7)
AT_COST = wp.constant(AT_SUM + 7)
WORK_SIZE = wp.constant(AT_COST + 16)
# Integers per node that waits while the smaller half of another is cut up, one per halving: node, first, last.
WAITING = wp.constant(3)
STACK_SIZE = wp.constant(3 * 64)


@dataclass
class Hierarchy:
    """Nodes in depth-first order.

    Attributes:
        nodes: as kernels take them, shape (nodes, 8), int32: low corner, skip, high corner, item of a leaf or -1.
    """

    nodes: np.ndarray

    @property
    def boxes(self) -> np.ndarray:
        """Shape (nodes, 2, 3), int32."""
        return self.nodes.reshape(-1, 2, 4)[:, :, :3]

    @property
    def links(self) -> np.ndarray:
        """Skip, and item or -1, shape (nodes, 2), int32."""
        return self.nodes[:, [3, 7]]


@wp.func
def smaller(a: f64, b: f64) -> f64:
    """The smaller of two numbers: one instruction, where `wp.min` takes five to mind what is no number."""
    return wp.where(a < b, a, b)


@wp.func
def larger(a: f64, b: f64) -> f64:
    """The larger of two numbers, as `smaller`."""
    return wp.where(a > b, a, b)


@wp.func
def node_of(lo: wp.vec3i, hi: wp.vec3i, skip: int, item: int) -> Node:
    """A node from its parts."""
    return Node(lo[0], lo[1], lo[2], skip, hi[0], hi[1], hi[2], item)


@wp.func
def skip_of(node: Node) -> int:
    """Where to go when the node is missed or done."""
    return node[3]


@wp.func
def item_of(node: Node) -> int:
    """What a leaf holds, -1 for other nodes."""
    return node[7]


@wp.func
def low_of(node: Node) -> wp.vec3i:
    """Low corner of the node's box."""
    return wp.vec3i(node[0], node[1], node[2])


@wp.func
def high_of(node: Node) -> wp.vec3i:
    """High corner of the node's box."""
    return wp.vec3i(node[4], node[5], node[6])


@wp.func
def inverse(d: wp.vec3d) -> wp.vec3d:
    """One over each component of a segment's way, and a very large number for 0, as of `nears`."""
    out = wp.vec3d()
    for i in range(3):
        out[i] = f64(1.0e300)
        if d[i] != f64(0.0):
            out[i] = f64(1.0) / d[i]
    return out


@wp.func
def nears(p: wp.vec3d, back: wp.vec3d, node: Node, padding: f64) -> bool:
    """Whether a segment meets a node's box that is padded on all sides, in rounded arithmetic.

    Args:
        p: where it starts.
        back: the inverse of its way.
        node: with the box.
        padding: more than rounding, which is below 2**-50 of the coordinates.
    """
    first = f64(0.0)
    last = f64(1.0)
    for i in range(3):
        a = (f64(node[i]) - padding - p[i]) * back[i]
        b = (f64(node[4 + i]) + padding - p[i]) * back[i]
        first = larger(first, smaller(a, b))
        last = smaller(last, larger(a, b))
    return first <= last


@wp.func
def real(v: wp.vec3i) -> wp.vec3d:
    """Integer vector as float64."""
    return wp.vec3d(f64(v[0]), f64(v[1]), f64(v[2]))


@wp.func
def clear(work: wp.array[f64], at: int):
    """Empty a bin."""
    work[at] = f64(0.0)
    for i in range(3):
        work[at + 1 + i] = f64(1.0e300)
        work[at + 4 + i] = f64(-1.0e300)


@wp.func
def grow(work: wp.array[f64], at: int, lo: wp.vec3d, hi: wp.vec3d, count: f64):
    """Put so many boxes between two corners into a bin."""
    work[at] = work[at] + count
    for i in range(3):
        work[at + 1 + i] = smaller(work[at + 1 + i], lo[i])
        work[at + 4 + i] = larger(work[at + 4 + i], hi[i])


@wp.func
def corner(work: wp.array[f64], at: int) -> wp.vec3d:
    """Three values of scratch."""
    return wp.vec3d(work[at], work[at + 1], work[at + 2])


@wp.func
def cost(work: wp.array[f64], at: int) -> f64:
    """How many boxes a bin holds, times half the surface of what they fill."""
    if work[at] == f64(0.0):
        return f64(0.0)
    size = corner(work, at + 4) - corner(work, at + 1)
    return work[at] * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0])


@wp.func
def best_split(work: wp.array[f64], axis: int, count: f64) -> tuple[f64, int]:
    """Least cost of splitting between two bins of an axis, and the first bin of the upper half."""
    clear(work, AT_SUM)
    for step in range(BINS - 1):
        b = BINS - 1 - step
        at = BIN_SIZE * (BINS * axis + b)
        grow(work, AT_SUM, corner(work, at + 1), corner(work, at + 4), work[at])
        work[AT_COST + b] = cost(work, AT_SUM)
    best = f64(1.0e300)
    split = int(0)
    clear(work, AT_SUM)
    for b in range(BINS - 1):
        at = BIN_SIZE * (BINS * axis + b)
        grow(work, AT_SUM, corner(work, at + 1), corner(work, at + 4), work[at])
        both = cost(work, AT_SUM) + work[AT_COST + b + 1]
        if work[AT_SUM] > f64(0.0) and work[AT_SUM] < count and both < best:
            best = both
            split = int(b + 1)
    return best, split


@wp.func
def bin_of(lo: wp.vec3i, hi: wp.vec3i, axis: int, low: wp.vec3i, scale: wp.vec3d) -> int:
    """Bin of a box by its doubled centre, the least of which is given."""
    return int(f64(lo[axis] + hi[axis] - low[axis]) * scale[axis])


@wp.func
def halve(
    lo: wp.array[wp.vec3i],
    hi: wp.array[wp.vec3i],
    first: int,
    last: int,
    work: wp.array[f64],
    order: wp.array[int],
) -> int:
    """Part the boxes `first` to `last` of the order in two, in place; returns where the upper half begins."""
    low = lo[order[first]] + hi[order[first]]
    high = low
    for k in range(first, last):
        centre = lo[order[k]] + hi[order[k]]
        low = wp.min(low, centre)
        high = wp.max(high, centre)
    scale = wp.vec3d()
    for axis in range(3):
        # Below BINS for the largest centre as well.
        scale[axis] = SPAN / (f64(high[axis] - low[axis]) + f64(1.0))
        for b in range(BINS):
            clear(work, BIN_SIZE * (BINS * axis + b))
    for k in range(first, last):
        mine_lo = lo[order[k]]
        mine_hi = hi[order[k]]
        for axis in range(3):
            at = BIN_SIZE * (BINS * axis + bin_of(mine_lo, mine_hi, axis, low, scale))
            grow(work, at, real(mine_lo), real(mine_hi), f64(1.0))
    best = f64(1.0e300)
    best_axis = int(-1)
    best_bin = int(0)
    for axis in range(3):
        if high[axis] > low[axis]:
            both, split = best_split(work, axis, f64(last - first))
            if both < best:
                best = both
                best_axis = int(axis)
                best_bin = split
    if best_axis < 0:
        return (first + last) // 2
    begin = int(first)
    end = int(last)
    while begin < end:
        item = order[begin]
        if bin_of(lo[item], hi[item], best_axis, low, scale) < best_bin:
            begin += 1
        else:
            end -= 1
            order[begin] = order[end]
            order[end] = item
    return begin


@wp.kernel
def _build(
    lo: wp.array[wp.vec3i],
    hi: wp.array[wp.vec3i],
    first: int,
    last: int,
    slots: int,
    work: wp.array[f64],
    frames: wp.array[int],
    nodes_out: wp.array[Node],
):
    count = lo.shape[0]
    # The order of the boxes, then the stack.
    for k in range(count):
        frames[k] = k
    frames[count] = 0
    frames[count + 1] = 0
    frames[count + 2] = count
    waiting = int(1)
    while waiting > 0:
        waiting -= 1
        top = count + WAITING * waiting
        node = frames[top]
        begin = frames[top + 1]
        end = frames[top + 2]
        bounds_lo = lo[frames[begin]]
        bounds_hi = hi[frames[begin]]
        for k in range(begin, end):
            bounds_lo = wp.min(bounds_lo, lo[frames[k]])
            bounds_hi = wp.max(bounds_hi, hi[frames[k]])
        # A tree with n leaves has 2 n - 1 nodes, so places are known before what is there.
        skip = node + 2 * (end - begin) - 1
        if end - begin == 1:
            nodes_out[node] = node_of(bounds_lo, bounds_hi, skip, frames[begin])
        else:
            nodes_out[node] = node_of(bounds_lo, bounds_hi, skip, -1)
            middle = halve(lo, hi, begin, end, work, frames)
            # The smaller half is cut up first: so few wait.
            lower = int(0)
            if middle - begin < end - middle:
                lower = WAITING
            upper = WAITING - lower
            frames[top + lower] = node + 1
            frames[top + lower + 1] = begin
            frames[top + lower + 2] = middle
            frames[top + upper] = node + 2 * (middle - begin)
            frames[top + upper + 1] = middle
            frames[top + upper + 2] = end
            waiting += 2


def build_hierarchy(boxes: np.ndarray) -> Hierarchy:
    """Hierarchy over boxes, one per leaf, with exact integer bounds; the same one whatever device it is for.

    Args:
        boxes: shape (n, 2, 3), integers below 2**29.
    """
    count = len(boxes)
    if not count:
        return Hierarchy(np.zeros((0, 8), np.int32))
    lo, hi = (CPU.array(boxes[:, side], wp.vec3i) for side in (0, 1))
    nodes = CPU.zeros(2 * count - 1, Node)
    launch_slots(_build, 1, [lo, hi], Scratch(int(WORK_SIZE), count + int(STACK_SIZE)), [nodes], CPU)
    return Hierarchy(nodes.numpy())


def build_of_copies(boxes: np.ndarray, starts: np.ndarray, models: np.ndarray) -> Hierarchy:
    """Hierarchy over groups of boxes, some of which are others shifted: as `build_hierarchy`, of many soon made.

    Where it pays, each group has a tree of its own under one of all groups, and those that are alike are cut up once.

    Args:
        boxes: as of `build_hierarchy`.
        starts: boxes of group g are starts[g]:starts[g + 1], shape (groups + 1,), int.
        models: of each group the first one that is the same but for a shift, shape (groups,), int.
    """
    if not mostly_copies(starts, models):
        return build_hierarchy(boxes)
    groups = np.flatnonzero(np.diff(starts))
    around = [least.reduceat(boxes[:, side], starts[groups]) for side, least in ((0, np.minimum), (1, np.maximum))]
    top = build_hierarchy(np.stack(around, axis=1)).nodes
    leaf = np.flatnonzero(top[:, 7] >= 0)
    group = groups[top[leaf, 7]]
    sizes = np.ones(len(top), np.int64)
    sizes[leaf] = 2 * np.diff(starts)[group] - 1
    # In place of a leaf of the upper tree stands the tree of its group.
    places = starts_of(sizes)
    nodes = np.empty((places[-1], 8), np.int32)
    top[:, 3] = places[top[:, 3]]
    nodes[places[:-1]] = top
    begins = np.empty(len(models), np.int64)
    begins[group] = places[leaf]
    for model, members in copies(starts, models):
        own = build_hierarchy(boxes[starts[model] : starts[model + 1]]).nodes
        shift = boxes[starts[members], 0] - boxes[starts[model], 0]
        moved = np.column_stack([shift, begins[members], shift, starts[members]]).astype(np.int32)
        made = own[None] + moved[:, None]
        made[:, own[:, 7] < 0, 7] = -1
        nodes[begins[members][:, None] + np.arange(len(own))] = made
    return Hierarchy(nodes)
