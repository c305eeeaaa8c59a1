"""Line trees: what the target search went through where it found nothing, for anybody to check again.

The search of kernels/target.py is walked once more for pairs that it called hidden, and written down: the blocker of
every node, and for every child without lines the cuts that contradict each other. There are at most three. What is
left of the triangle of directions is a convex polygon, whose edges are cuts; the last cut empties it. Its least value
over the polygon is at a corner, and there the two edges and the cut add up to something that is nowhere negative (the
dual of a linear programme in two variables). Every corner is tried with exact signs, so a tree that is written holds.

The words of a tree are explained in data/store/certificates.py.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..data.store import certificates
from .graph import reflect_high, reflect_low
from .launch import SlotSizes, run_sliced, triples, vectors
from .stab import (
    AT_M,
    AT_W,
    HIDDEN,
    LEVEL_SIZE,
    LISTS_SIZE,
    POLYGON_SIZE,
    STABBED,
    append_box,
    decide,
    det_sign,
    edge_cut,
    offsets,
    slope_cut,
    start_level,
    vec6d,
    vec6i,
)
from .target import (
    FRAME,
    MAX_BRANCHES,
    SLOT_SIZE,
    WAYS,
    BlockerTree,
    Pairs,
    append_way,
    has_room,
    has_way,
    possible_octant,
    scan,
)

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

# A leaf's first word is -1 - tag - CUT_STEP * (cuts that follow), the others are -1 - tag.
CUT_STEP = wp.constant(1 << 24)
# A node's word is NODE_STEP times its blocker plus the order of its sides.
NODE_STEP = wp.constant(certificates.NODE_STEP)
# Words of a node at most, with those of its leaves; and those of eight octants without a node.
NODE_WORDS, ROOT_WORDS = 1 + 6 * 3, 8 * 3
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
def polygon_leaf(work: wp.array(dtype=f64), failing: int) -> wp.vec3i:
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
def slopes_leaf(work: wp.array(dtype=f64), level: int) -> wp.vec3i:
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
def leaf_tags(work: wp.array(dtype=f64), level: int, failing: int) -> wp.vec3i:
    """Tags of the contradiction that `decide` met; it marks slopes by the tag -2."""
    if work[failing + 3] == f64(-2.0):
        return slopes_leaf(work, level)
    return polygon_leaf(work, failing)


@wp.func
def write_leaf(
    work: wp.array(dtype=f64), level: int, spare: int, words: wp.array(dtype=int), begin: wp.int64, size: int, room: int
) -> int:
    """Write the contradiction that `decide` met; words so far, or -1 if it cannot be told or has no room."""
    failing = spare + 2 * POLYGON_SIZE
    tags = leaf_tags(work, level, failing)
    count = int(0)
    for k in range(3):
        if tags[k] >= 0:
            count += 1
    if count == 0 or size + count > room:
        return -1
    for k in range(count):
        words[begin + wp.int64(size + k)] = -1 - tags[k]
    words[begin + wp.int64(size)] = -1 - tags[0] - CUT_STEP * (count - 1)
    return size + count


@wp.kernel
def _write(
    tree: BlockerTree,
    pairs: Pairs,
    first: int,
    last: int,
    work: wp.array(dtype=f64),
    frames: wp.array(dtype=int),
    starts: wp.array(dtype=wp.int64),
    words: wp.array(dtype=int),
    sizes: wp.array(dtype=int),
):
    slot = wp.tid()
    levels = slot * SLOT_SIZE
    lists = levels + (MAX_BRANCHES + 2) * LEVEL_SIZE
    spare = lists + LISTS_SIZE
    stack = slot * (MAX_BRANCHES + 2) * FRAME
    slots = work.shape[0] // SLOT_SIZE
    row = first + slot
    while row < last:
        pair = pairs.rows[row]
        begin = starts[row]
        room = int(starts[row + 1] - begin)
        size = int(0)
        octant = int(0)
        while octant < 8:
            if size >= 0 and possible_octant(
                pairs.lo[pair[0]], pairs.hi[pair[0]], pairs.lo[pair[1]], pairs.hi[pair[1]], octant
            ):
                s_lo = reflect_low(pairs.lo[pair[0]], pairs.hi[pair[0]], octant)
                s_hi = reflect_high(pairs.lo[pair[0]], pairs.hi[pair[0]], octant)
                t_lo = reflect_low(pairs.lo[pair[1]], pairs.hi[pair[1]], octant)
                t_hi = reflect_high(pairs.lo[pair[1]], pairs.hi[pair[1]], octant)
                grown = append_box(work, lists, vec6i(), s_lo, s_hi, -1)
                grown = append_box(work, lists, grown, t_lo, t_hi, -1)
                start_level(work, levels)
                # The level that was decided last is that of depth + 1, the root's at depth -1.
                answer = decide(work, lists, levels, levels + LEVEL_SIZE, spare, vec6i(), grown)
                depth = int(-1)
                searching = bool(True)
                while searching:
                    if answer == HIDDEN:
                        size = write_leaf(work, levels + (depth + 2) * LEVEL_SIZE, spare, words, begin, size, room)
                    elif answer == STABBED:
                        depth += 1
                        at = stack + depth * FRAME
                        level = levels + (depth + 1) * LEVEL_SIZE
                        w = wp.vec3d(work[level + AT_W], work[level + AT_W + 1], work[level + AT_W + 2])
                        m = vec6d()
                        for p in range(6):
                            m[p] = work[level + AT_M + p]
                            frames[at + 3 + p] = grown[p]
                        hit = scan(tree, w, offsets(m), octant, s_lo, s_hi, t_lo, t_hi, pair[2])
                        frames[at] = hit[0]
                        frames[at + 1] = 0
                        frames[at + 2] = hit[1]
                        if hit[0] < 0 or depth >= MAX_BRANCHES or size >= room or not has_room(grown):
                            size = -1
                        else:
                            words[begin + wp.int64(size)] = NODE_STEP * hit[0] + hit[1]
                            size += 1
                    else:
                        size = -1
                    # The next way that exists, of the deepest node that has one left.
                    searching = bool(False)
                    while size >= 0 and depth >= 0 and not searching:
                        at = stack + depth * FRAME
                        cursor = frames[at + 1]
                        if cursor == WAYS:
                            depth -= 1
                        else:
                            frames[at + 1] = cursor + 1
                            blocker = frames[at]
                            lo = reflect_low(tree.lo[blocker], tree.hi[blocker], octant)
                            hi = reflect_high(tree.lo[blocker], tree.hi[blocker], octant)
                            axis = tree.axis[blocker]
                            if has_way(cursor, lo[axis], axis, s_hi, t_lo, pair[2]):
                                counts = vec6i()
                                for p in range(6):
                                    counts[p] = frames[at + 3 + p]
                                grown = append_way(
                                    work, lists, counts, lo, hi, axis, frames[at + 2], cursor, s_hi, t_lo
                                )
                                level = levels + (depth + 1) * LEVEL_SIZE
                                answer = decide(work, lists, level, level + LEVEL_SIZE, spare, counts, grown)
                                searching = bool(True)
            octant += 1
        sizes[row] = size
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
    threads: int = 1,
    device: str = "cpu",
) -> LineTrees:
    """Certificates of pairs that the target search called hidden.

    Args:
        tree: the blockers that were searched.
        boxes: as of `launch_target_search`.
        rows: hidden rows of that search, shape (n, 3), int.
        nodes: lines that it tried for each of them, shape (n,), int.
        threads: CPU threads; ignored on a GPU.
        device: Warp device.

    Returns:
        A tree for every row. One without words could not be told: its pair has no certificate.

    Raises:
        InputError: a coordinate beyond the grid, where products of differences are no longer exact.
    """
    room = np.asarray(nodes, np.int64) * NODE_WORDS + ROOT_WORDS
    sizes, words = [np.zeros(0, np.int64)], [np.zeros(0, np.int32)]
    begin = 0
    while begin < len(rows):
        ends = np.cumsum(room[begin:])
        count = max(1, int(np.searchsorted(ends, MOST_WORDS, side="right")))
        part = _write_part(tree, boxes, rows[begin : begin + count], ends[:count], threads, device)
        sizes.append(part[0])
        words.append(part[1])
        begin += count
    return LineTrees(np.concatenate([[0], np.cumsum(np.concatenate(sizes))]), np.concatenate(words))


def _write_part(
    tree: BlockerTree, boxes: np.ndarray, rows: np.ndarray, ends: np.ndarray, threads: int, device: str
) -> tuple[np.ndarray, np.ndarray]:
    """Words of each row's tree, and all of them; row i may use those up to ends[i]."""
    work = Pairs()
    work.lo, work.hi = vectors(boxes[:, 0], device), vectors(boxes[:, 1], device)
    work.rows = triples(rows, device)
    starts = np.concatenate([[0], ends])
    places = wp.array(starts, dtype=wp.int64, device=device)
    words = wp.empty(int(ends[-1]), dtype=int, device=device)
    sizes = wp.zeros(len(rows), dtype=int, device=device)

    def launch(first: int, last: int, slots: int, scratch: wp.array, frames: wp.array) -> None:
        wp.launch(
            _write, dim=slots, inputs=[tree, work, first, last, scratch, frames, places, words, sizes], device=device
        )

    scratch = SlotSizes(int(SLOT_SIZE), (int(MAX_BRANCHES) + 2) * int(FRAME))
    run_sliced(launch, len(rows), scratch, module=__name__, threads=threads, device=device)
    used = np.maximum(sizes.numpy(), 0).astype(np.int64)
    at = np.repeat(starts[:-1] - np.cumsum(used) + used, used) + np.arange(used.sum())
    return used, words.numpy()[at]
