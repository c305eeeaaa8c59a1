"""Line trees: what the target search went through where it found nothing, for anybody to check again.

The search of kernels/target.py is repeated for pairs that it called hidden, and written down: the blocker of
every node, and for every child without lines the cuts that contradict each other. There are at most three. What is
left of the triangle of directions is a convex polygon, whose edges are cuts; the last cut empties it. Its least value
over the polygon is at a corner, and there the two edges and the cut add up to something that is nowhere negative (the
dual of a linear programme in two variables). Every corner is tried with exact signs, so a tree that is written holds.

The words of a tree are explained in data/store/certificates.py.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..data.plans import Plans
from ..data.ragged import places_of, starts_of
from ..data.store import certificates
from ..data.verdict import Verdict
from .blockers import BlockerTree, has_room
from .directions import POLYGON_SIZE, det_sign, edge_cut
from .ends import Ends, Pairs, can_lead, ends_of
from .launch import CPU, Device, Scratch, launch_slots
from .stab import LEVEL_SIZE, load_counts, slope_cut
from .target import (
    AT_COUNTS,
    EXHAUSTED,
    FRAME,
    MAX_BRANCHES,
    SLOT_SIZE,
    STACK_SIZE,
    Slot,
    device_pairs,
    next_way,
    open_node,
    slot_at,
    start_search,
)

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

# A leaf's first word is -1 - tag - CUT_STEP * (cuts that follow), the others are -1 - tag.
CUT_STEP = wp.constant(1 << 24)
# A node's word is NODE_STEP times its blocker plus the order of its sides.
NODE_STEP = wp.constant(certificates.NODE_STEP)
# Words of a node at most, with those of its leaves; and those of eight octants without a node.
NODE_WORDS, ROOT_WORDS = 1 + 10 * 3, 8 * 3
# Words that the trees of one launch may have, so that a long list of pairs needs no more memory than a short one.
MOST_WORDS = 1 << 26


@wp.func
def single_contradicts(g: wp.vec3d) -> bool:
    """Whether no w > 0 has g . w < 0."""
    return g[0] >= f64(0.0) and g[1] >= f64(0.0) and g[2] >= f64(0.0)


@wp.func
def pair_contradicts(g: wp.vec3d, h: wp.vec3d) -> bool:
    """Whether no w > 0 has g . w < 0 and h . w < 0; exact for integers below 2**26."""
    for axis in range(3):
        # The combination whose component on this axis vanishes; products of 52 bits are exact.
        a = -h[axis]
        b = g[axis]
        if a < f64(0.0) or b < f64(0.0):
            a = -a
            b = -b
        if a >= f64(0.0) and b >= f64(0.0) and a + b > f64(0.0):
            least = f64(0.0)
            for other in range(3):
                least = wp.min(least, a * g[other] + b * h[other])
            if least >= f64(0.0):
                return True
    return False


@wp.func
def triple_contradicts(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d) -> bool:
    """Whether no w > 0 is on the negative side of three cuts, none of which can be spared; exact."""
    for axis in range(3):
        i = (axis + 1) % 3
        j = (axis + 2) % 3
        # The combination whose components on two axes vanish.
        weights = wp.cross(wp.vec3d(a[i], b[i], c[i]), wp.vec3d(a[j], b[j], c[j]))
        rest = det_sign(wp.vec3d(a[axis], b[axis], c[axis]), weights)
        least = wp.min(weights[0], wp.min(weights[1], weights[2]))
        most = wp.max(weights[0], wp.max(weights[1], weights[2]))
        if least >= f64(0.0) and most > f64(0.0) and rest >= 0:
            return True
        if most <= f64(0.0) and least < f64(0.0) and rest <= 0:
            return True
    return False


@wp.func
def polygon_leaf(work: wp.array[f64], failing: int) -> wp.vec3i:
    """Tags of cuts that contradict each other, of a polygon and the cut that emptied it; -1 where there is no more."""
    polygon = int(work[failing + 4])
    count = int(work[polygon])
    tag = int(work[failing + 3])
    g = wp.vec3d(work[failing], work[failing + 1], work[failing + 2])
    if single_contradicts(g):
        return wp.vec3i(tag, -1, -1)
    # Edges of the whole triangle say w > 0 and have no tag: what they would add is not negative.
    for k in range(count):
        other = int(work[polygon + 4 + 4 * k])
        if other >= 0 and pair_contradicts(g, edge_cut(work, polygon, k)):
            return wp.vec3i(tag, other, -1)
    for k in range(count):
        following = (k + 1) % count
        first = int(work[polygon + 4 + 4 * k])
        second = int(work[polygon + 4 + 4 * following])
        if first >= 0 and second >= 0:
            if triple_contradicts(g, edge_cut(work, polygon, k), edge_cut(work, polygon, following)):
                return wp.vec3i(tag, first, second)
    return wp.vec3i(-1, -1, -1)


@wp.func
def slopes_leaf(work: wp.array[f64], level: int) -> wp.vec3i:
    """The same of two slope bounds that leave no direction."""
    for u in range(3):
        low = slope_cut(work, level, 2 * u)
        high = slope_cut(work, level, 2 * u + 1)
        g = wp.vec3d(low[0], low[1], low[2])
        h = wp.vec3d(high[0], high[1], high[2])
        if high[3] >= f64(0.0) and single_contradicts(h):
            return wp.vec3i(int(high[3]), -1, -1)
        if low[3] >= f64(0.0) and high[3] >= f64(0.0) and pair_contradicts(g, h):
            return wp.vec3i(int(low[3]), int(high[3]), -1)
    return wp.vec3i(-1, -1, -1)


@wp.func
def leaf_tags(work: wp.array[f64], level: int, failing: int) -> wp.vec3i:
    """Tags of the contradiction that `decide` met; it marks slopes by the tag -2."""
    if work[failing + 3] == f64(-2.0):
        return slopes_leaf(work, level)
    return polygon_leaf(work, failing)


@wp.func
def write_leaf(
    level: int, spare: int, begin: wp.int64, size: int, room: int, work: wp.array[f64], words_out: wp.array[int]
) -> int:
    """Write the contradiction that `decide` met; words so far, or -1 if it cannot be told or has no room."""
    tags = leaf_tags(work, level, spare + 2 * POLYGON_SIZE)
    count = int(0)
    for k in range(3):
        if tags[k] >= 0:
            count += 1
    if count == 0 or size + count > room:
        return -1
    for k in range(count):
        words_out[begin + wp.int64(size + k)] = -1 - tags[k]
    words_out[begin + wp.int64(size)] = -1 - tags[0] - CUT_STEP * (count - 1)
    return size + count


@wp.func
def write_octant(
    tree: BlockerTree,
    ends: Ends,
    begin: wp.int64,
    written: int,
    room: int,
    slot: Slot,
    work: wp.array[f64],
    frames: wp.array[int],
    words_out: wp.array[int],
) -> int:
    """Write the tree of one octant after what is written; words so far, or -1 if it cannot be told or has no room."""
    size = int(written)
    answer = start_search(ends, slot, work, frames)
    # The level that was decided last is that of depth + 2, the root's at depth -1.
    depth = int(-1)
    while answer != EXHAUSTED:
        if answer == Verdict.UNKNOWN:
            return -1
        if answer == Verdict.HIDDEN:
            level = slot.levels + (depth + 2) * LEVEL_SIZE
            size = write_leaf(level, slot.spare, begin, size, room, work, words_out)
            if size < 0:
                return -1
        else:
            depth += 1
            hit = open_node(tree, ends, depth, slot, work, frames)
            full = not has_room(load_counts(frames, slot.stack + depth * FRAME + AT_COUNTS))
            if hit[0] < 0 or depth >= MAX_BRANCHES or size >= room or full:
                return -1
            words_out[begin + wp.int64(size)] = NODE_STEP * hit[0] + hit[1]
            size += 1
        # The next way of the deepest node that has one left.
        answer = EXHAUSTED
        while depth >= 0 and answer == EXHAUSTED:
            answer = next_way(tree, ends, depth, slot, work, frames)
            if answer == EXHAUSTED:
                depth -= 1
    return size


@wp.kernel
def _write(
    tree: BlockerTree,
    pairs: Pairs,
    starts: wp.array[wp.int64],
    first: int,
    last: int,
    slots: int,
    work: wp.array[f64],
    frames: wp.array[int],
    words_out: wp.array[int],
    sizes_out: wp.array[int],
):
    slot = slot_at(wp.tid())
    row = first + wp.tid()
    while row < last:
        begin = starts[row]
        room = int(starts[row + 1] - begin)
        size = int(0)
        for octant in range(8):
            ends = ends_of(pairs, row, octant)
            if size >= 0 and can_lead(ends):
                size = write_octant(tree, ends, begin, size, room, slot, work, frames, words_out)
        sizes_out[row] = size
        row += slots


@dataclass
class LineTrees:
    """Trees of hidden pairs, one after another.

    Attributes:
        starts: words of tree i are words[starts[i]:starts[i + 1]], shape (n + 1,), int64; none where no tree was made.
        words: int32.
    """

    starts: np.ndarray
    words: np.ndarray


def launch_line_trees(
    tree: BlockerTree,
    boxes: np.ndarray,
    rows: np.ndarray,
    nodes: np.ndarray,
    *,
    plans: Plans | None = None,
    device: Device = CPU,
) -> LineTrees:
    """Certificates of pairs that the target search called hidden.

    Args:
        tree: the blockers that were searched.
        boxes: as of `launch_target_search`.
        rows: hidden rows of that search, shape (n, 3), int.
        nodes: lines that it tried for each of them, shape (n,), int.
        plans: as of that search.
        device: where to.

    Returns:
        A tree for every row. One without words could not be told: its pair has no certificate.

    Raises:
        InputError: a coordinate beyond the grid, where products of differences are no longer exact.
    """
    room = np.asarray(nodes, np.int64) * NODE_WORDS + ROOT_WORDS
    sizes, words = [np.zeros(0, np.int64)], [np.zeros(0, np.int32)]
    begin = 0
    while begin < len(rows):
        count = max(1, int(np.searchsorted(np.cumsum(room[begin:]), MOST_WORDS, side="right")))
        part = _write_part(tree, boxes, rows[begin : begin + count], room[begin : begin + count], plans, device)
        sizes.append(part[0])
        words.append(part[1])
        begin += count
    return LineTrees(starts_of(np.concatenate(sizes)), np.concatenate(words))


def _write_part(
    tree: BlockerTree, boxes: np.ndarray, rows: np.ndarray, room: np.ndarray, plans: Plans | None, device: Device
) -> tuple[np.ndarray, np.ndarray]:
    """Number of words of each row's tree, and all words; row i may use room[i]."""
    starts = starts_of(room)
    words = wp.empty(int(starts[-1]), dtype=int, device=device.name)
    sizes = device.zeros(len(rows), int)
    inputs = [tree, device_pairs(boxes, rows, device, plans), device.array(starts, wp.int64)]
    launch_slots(_write, len(rows), inputs, Scratch(int(SLOT_SIZE), int(STACK_SIZE)), [words, sizes], device)
    used = np.maximum(sizes.numpy(), 0).astype(np.int64)
    return used, words.numpy()[places_of(starts[:-1], used)]
