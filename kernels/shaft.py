"""The shaft test: is every segment from one box to another blocked, proved subshaft by subshaft with one occluder each?

Where no single occluder (kernels/shields.py) blocks all of the shaft, the longest side of V or X is halved and both
halves must be blocked. Halving X joins the umbras of several occluders, halving V fuses occluders that are visible past
each other. The middle line of a subshaft steers: only what it crosses can block the subshaft, and if it crosses nothing
the search ends at once.

All decisions are exact for integer boxes.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..data.ragged import starts_of
from ..data.verdict import Verdict
from .launch import CPU, Device, Scratch, launch_rows, launch_slots
from .shields import Shaft, Shields, blocks, find_blocker, next_patch

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

# Subshafts that wait for their turn. A subshaft is taken before its sibling, so this is the deepest halving.
STACK = wp.constant(72)
# A subshaft: low and high corners of V and X.
SUBSHAFT = wp.constant(12)
# Occluders that blocked last, tried first.
RECENT = wp.constant(8)
SLOT_SIZE = wp.constant(STACK * SUBSHAFT + RECENT)


@wp.struct
class Shafts:
    """Boxes, and rows (view cell, occludee) of them."""

    lo: wp.array[wp.vec3i]
    hi: wp.array[wp.vec3i]
    rows: wp.array[wp.vec2i]


@wp.struct
class Answers:
    """Columns of `ShaftAnswers`."""

    verdict: wp.array[wp.uint8]
    nodes: wp.array[int]
    leaves: wp.array[int]
    middle: wp.array2d[wp.vec3d]


@wp.struct
class Stack:
    """Where a slot keeps its subshafts, and the occluders that blocked last: how many, and where the next one goes."""

    subshafts: int
    recent: int
    known: int
    newest: int


@wp.func
def corner_at(frames: wp.array[int], at: int) -> wp.vec3d:
    """A corner of a stored subshaft."""
    return wp.vec3d(f64(frames[at]), f64(frames[at + 1]), f64(frames[at + 2]))


@wp.func
def piece_at(frames: wp.array[int], at: int) -> Shaft:
    """A stored subshaft."""
    out = Shaft()
    out.v_lo = corner_at(frames, at)
    out.v_hi = corner_at(frames, at + 3)
    out.x_lo = corner_at(frames, at + 6)
    out.x_hi = corner_at(frames, at + 9)
    return out


@wp.func
def store_whole(work: Shafts, row: int, at: int, frames: wp.array[int]):
    """Store a row's shaft as the first subshaft."""
    pair = work.rows[row]
    for i in range(3):
        frames[at + i] = work.lo[pair[0]][i]
        frames[at + 3 + i] = work.hi[pair[0]][i]
        frames[at + 6 + i] = work.lo[pair[1]][i]
        frames[at + 9 + i] = work.hi[pair[1]][i]


@wp.func
def blocked_again(shields: Shields, shaft: Shaft, stack: Stack, frames: wp.array[int]) -> wp.vec2i:
    """(1, occluder) of those that blocked last, if one of them blocks the whole shaft; else (-1, 0)."""
    for r in range(stack.known):
        if blocks(shields, frames[stack.recent + r], shaft):
            return wp.vec2i(1, frames[stack.recent + r])
    return wp.vec2i(-1, 0)


@wp.func
def halve(smallest: wp.vec2i, at: int, frames: wp.array[int]) -> bool:
    """Put a subshaft's lower half above it and the upper one in its place; False if no side is long enough to halve.

    A subshaft is taken before its sibling.
    """
    widest = int(-1)
    length = int(0)
    for s in range(6):
        low = s
        least = smallest[0]
        if s >= 3:
            low = s + 3
            least = smallest[1]
        size = frames[at + low + 3] - frames[at + low]
        if size > length and size >= 2 * least:
            length = size
            widest = low
    if widest < 0:
        return False
    for i in range(12):
        frames[at + SUBSHAFT + i] = frames[at + i]
    halfway = (frames[at + widest] + frames[at + widest + 3]) // 2
    frames[at + widest] = halfway
    frames[at + SUBSHAFT + widest + 3] = halfway
    return True


@wp.func
def write_leaf(occluder: int, spot: wp.int64, at: int, frames: wp.array[int], certificate_out: wp.array2d[int]):
    """Write down a subshaft and what blocks it, if certificates are wanted."""
    if certificate_out.shape[0] > 0:
        certificate_out[int(spot), 0] = occluder
        for i in range(12):
            certificate_out[int(spot), 1 + i] = frames[at + i]


@wp.kernel
def _shaft(
    shields: Shields,
    work: Shafts,
    smallest: wp.vec2i,
    cap: int,
    spots: wp.array[wp.int64],
    first: int,
    last: int,
    slots: int,
    frames: wp.array[int],
    answers_out: Answers,
    certificate_out: wp.array2d[int],
):
    stack = Stack()
    stack.subshafts = wp.tid() * SLOT_SIZE
    stack.recent = stack.subshafts + STACK * SUBSHAFT
    row = first + wp.tid()
    while row < last:
        store_whole(work, row, stack.subshafts, frames)
        stack.known = 0
        stack.newest = 0
        nodes = int(0)
        leaves = int(0)
        top = int(0)
        verdict = int(Verdict.HIDDEN)
        while top >= 0:
            at = stack.subshafts + top * SUBSHAFT
            shaft = piece_at(frames, at)
            nodes += 1
            found = blocked_again(shields, shaft, stack, frames)
            if found[0] < 1:
                found = find_blocker(shields, shaft)
                if found[0] == 1:
                    frames[stack.recent + stack.newest] = found[1]
                    stack.newest = (stack.newest + 1) % RECENT
                    stack.known = wp.min(stack.known + 1, RECENT)
            if found[0] == 1:
                write_leaf(found[1], spots[row] + wp.int64(leaves), at, frames, certificate_out)
                leaves += 1
                top -= 1
            elif found[0] == 0 and nodes < cap and top + 2 <= STACK and halve(smallest, at, frames):
                top += 1
            else:
                verdict = int(Verdict.UNKNOWN)
                top = -1
                answers_out.middle[row, 0] = (shaft.v_lo + shaft.v_hi) * f64(0.5)
                answers_out.middle[row, 1] = (shaft.x_lo + shaft.x_hi) * f64(0.5)
        answers_out.verdict[row] = wp.uint8(verdict)
        answers_out.nodes[row] = nodes
        answers_out.leaves[row] = leaves
        row += slots


@wp.kernel
def _meets(
    shields: Shields,
    origins: wp.array[wp.vec3d],
    ends: wp.array[wp.vec3d],
    first: int,
    meets_out: wp.array[wp.uint8],
):
    row = first + wp.tid()
    node = next_patch(shields, 0, origins[row], ends[row] - origins[row])
    meets_out[row] = wp.uint8(node < shields.patch_nodes.shape[0])


def patches_met(shields: Shields, origins: np.ndarray, ends: np.ndarray, *, device: Device = CPU) -> np.ndarray:
    """Whether each segment may meet an oblique occluder: where it does not, no shaft around it can be blocked by one.

    Args:
        shields: occluders on the same device.
        origins: [grid steps], shape (n, 3), float64.
        ends: likewise.
        device: where to.

    Returns:
        Shape (n,), bool; in rounded arithmetic, for steering only.
    """
    lines = [device.array(points, wp.vec3d) for points in (origins, ends)]
    meets = device.zeros(len(origins), wp.uint8)
    launch_rows(_meets, len(origins), [shields, *lines], [meets], device)
    return meets.numpy().astype(bool)


@dataclass
class ShaftAnswers:
    """Answers of the shaft test, one row per pair.

    Attributes:
        verdict: `Verdict`, HIDDEN or UNKNOWN, uint8.
        nodes: subshafts looked at, int32.
        leaves: subshafts proved, int32.
        middle: ends of the middle line of the subshaft that was not proved [grid steps], shape (n, 2, 3), float64; a
            direction to look for a witness in.
        certificate: of the hidden rows, if asked for: (occluder, low and high corner of V', low and high corner of X')
            per leaf, shape (sum of leaves, 13), int32. Occluder r is a region, -1 - p a patch. Empty otherwise.
        starts: leaves of row r are starts[r]:starts[r + 1], shape (n + 1,), int64.
    """

    verdict: np.ndarray
    nodes: np.ndarray
    leaves: np.ndarray
    middle: np.ndarray
    certificate: np.ndarray
    starts: np.ndarray


def launch_shaft(
    shields: Shields,
    boxes: np.ndarray,
    rows: np.ndarray,
    *,
    smallest: tuple[int, int],
    cap: int = 2000,
    certify: bool = False,
    device: Device = CPU,
) -> ShaftAnswers:
    """Prove that no segment leads from one box to another.

    Args:
        shields: occluders on the same device.
        boxes: [grid steps], shape (m, 2, 3), int32, |coordinate| <= 2**24.
        rows: (view cell, occludee) boxes, shape (n, 2), int.
        smallest: sides of V and of X that are not halved below this [grid steps].
        cap: subshafts looked at per pair before the answer is UNKNOWN.
        certify: list the leaves of every proof.
        device: where to.

    Returns:
        Answers. HIDDEN is exact for eyes outside every solid. UNKNOWN says nothing: the box may be hidden or not.

    Raises:
        InputError: a coordinate beyond the grid, where products of differences are no longer exact.
    """
    low, high = (device.corners(boxes[:, side]) for side in (0, 1))

    def run(rows: np.ndarray, spots: np.ndarray, leaves: int) -> tuple[Answers, np.ndarray]:
        count, work = len(rows), device.struct(Shafts, lo=low, hi=high, rows=rows)
        answers = device.struct(Answers, verdict=count, nodes=count, leaves=count, middle=(count, 2))
        certificate = device.zeros((leaves, 13), int)
        inputs = [shields, work, wp.vec2i(*smallest), cap, device.array(spots, wp.int64)]
        launch_slots(_shaft, count, inputs, Scratch(0, int(SLOT_SIZE)), [answers, certificate], device)
        return answers, certificate.numpy()

    answers, certificate = run(rows, np.zeros(len(rows), np.int64), 0)
    verdict, nodes, leaves, middle = (
        getattr(answers, name).numpy() for name in ("verdict", "nodes", "leaves", "middle")
    )
    proved = np.flatnonzero(verdict == Verdict.HIDDEN)
    starts = starts_of(np.where(verdict == Verdict.HIDDEN, leaves, 0) if certify else np.zeros(len(rows), int))
    if certify:
        # The leaves are counted first and written by a second run: nothing is shared between threads.
        certificate = run(rows[proved], starts[proved], int(starts[-1]))[1]
    return ShaftAnswers(verdict, nodes, leaves, middle, certificate, starts)
