"""Which boxes may a segment meet? A bounding-volume hierarchy traversed by all segments at once in NumPy."""

import numpy as np

BRANCHING = 4
# Neighbours that stay together when a tree of so many boxes is built.
GROUP, LARGE = 16, 4**9
# Slack of the float64 slab test [grid steps]. Its rounding error is a few units in the last place of coordinates
# below 2**32, that is below 1e-5.
PAD = 1e-3
REACH = 2.0**32
# Shifts and masks that put two zero bits after each of 21.
SPREAD = (
    (32, 0x1F00000000FFFF),
    (16, 0x1F0000FF0000FF),
    (8, 0x100F00F00F00F00F),
    (4, 0x10C30C30C30C30C3),
    (2, 0x1249249249249249),
)
FAR_OFF = 1e30


class BoxTree:
    """Boxes in a complete tree of branching 4, halved at the median of their centres' longest extent.

    Of large sets only groups of 16 neighbours in Morton order are sorted so: it is six times as fast.

    Level l holds 4**l nodes; node k's children are 4k to 4k + 3. Missing boxes are empty (low > high).
    """

    def __init__(self, low: np.ndarray, high: np.ndarray):
        """Build the tree over boxes (low, high corner) [grid steps], each of shape (m, 3), |coordinate| <= 2**31."""
        count, depth = len(low), 0
        self.count = count
        while BRANCHING**depth < count:
            depth += 1
        size = BRANCHING**depth
        near = _morton_order(low, high)
        # Places after the last box are missing boxes.
        near = np.concatenate([near, np.arange(count, size)])
        centres = np.full((size, 3), np.inf)
        centres[:count] = (low[near[:count]].astype(np.float64) + high[near[:count]]) / 2
        group = GROUP if size >= LARGE else 1
        groups = _median_order(centres[::group])
        self.items = near[(groups[:, None] * group + np.arange(group)).ravel()]
        bounds = np.empty((2, 3, size))
        bounds[0], bounds[1] = np.inf, -np.inf
        filled = self.items < count
        bounds[0][:, filled] = low[self.items[filled]].T - PAD
        bounds[1][:, filled] = high[self.items[filled]].T + PAD
        self.levels = [bounds]
        while self.levels[0].shape[2] > 1:
            groups = self.levels[0].reshape(2, 3, -1, BRANCHING)
            self.levels.insert(0, np.stack([groups[0].min(axis=2), groups[1].max(axis=2)]))
        for level in self.levels:
            # An empty box becomes a point far off, so that the slab test needs no special case.
            level[:, np.isinf(level).any(axis=0)] = FAR_OFF

    def candidates(self, origins: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pairs (segment, box) that contain every pair whose closed box the closed segment meets.

        Args:
            origins: segment starts [grid steps], shape (n, 3), float64.
            ends: segment ends, likewise.
        """
        near = (np.abs(origins).max(axis=1, initial=0) < REACH) & (np.abs(ends).max(axis=1, initial=0) < REACH)
        segments = np.flatnonzero(near)
        with np.errstate(over="ignore", invalid="ignore"):
            delta = ends - origins
            # A component of 0 becomes tiny: its slab test then asks whether the origin lies in the padded slab.
            delta[np.abs(delta) < 1e-200] = 1e-200
            inverse = np.ascontiguousarray((1 / delta).T)
            offset = np.ascontiguousarray((origins / delta).T)
        nodes = np.zeros(len(segments), np.int64)
        for level in self.levels:
            if level.shape[2] > 1:
                nodes = (nodes[:, None] * BRANCHING + np.arange(BRANCHING)).ravel()
                segments = np.repeat(segments, BRANCHING)
            keep = _meets(level, nodes, inverse, offset, segments)
            nodes, segments = nodes[keep], segments[keep]
        far = np.flatnonzero(~near)
        # Beyond the range of the slab test's error bound every box is a candidate.
        segments = np.concatenate([segments, np.repeat(far, self.count)])
        return segments, np.concatenate([self.items[nodes], np.tile(np.arange(self.count), len(far))])


def _morton_order(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Order of the boxes' centres along a Morton curve of 2**21 steps per axis."""
    sums = low.astype(np.float64) + high
    start = sums.min(axis=0, initial=np.inf)
    width = max(float((sums - start).max(initial=0)), 1.0)
    steps = ((sums - start) * ((2**21 - 1) / width)).astype(np.uint64)
    for shift, mask in SPREAD:
        steps = (steps | (steps << np.uint64(shift))) & np.uint64(mask)
    return np.argsort(steps[:, 0] | (steps[:, 1] << np.uint64(1)) | (steps[:, 2] << np.uint64(2)), kind="stable")


def _median_order(centres: np.ndarray) -> np.ndarray:
    """Order of the points in which every aligned block of size 2**k is one side of a median split."""
    order = np.arange(len(centres))
    block = len(centres)
    while block > 1:
        blocks = order.reshape(-1, block)
        points = centres[blocks]
        real = np.isfinite(points)
        extent = np.where(real, points, -np.inf).max(axis=1) - np.where(real, points, np.inf).min(axis=1)
        axis = extent.argmax(axis=1)
        keys = np.take_along_axis(points, axis[:, None, None], axis=2)[:, :, 0]
        halves = np.argpartition(keys, block // 2 - 1, axis=1)
        order = np.take_along_axis(blocks, halves, axis=1).ravel()
        block //= 2
    return order


def _meets(
    level: np.ndarray, nodes: np.ndarray, inverse: np.ndarray, offset: np.ndarray, segments: np.ndarray
) -> np.ndarray:
    """Slab test of (segment, node) pairs against the padded boxes of one level."""
    enter, leave = np.zeros(len(nodes)), np.ones(len(nodes))
    for axis in range(3):
        scale, shift = inverse[axis].take(segments), offset[axis].take(segments)
        first = level[0, axis].take(nodes)
        first *= scale
        first -= shift
        second = level[1, axis].take(nodes)
        second *= scale
        second -= shift
        np.maximum(enter, np.minimum(first, second), out=enter)
        np.minimum(leave, np.maximum(first, second, out=second), out=leave)
    return enter <= leave
