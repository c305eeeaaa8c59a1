"""Plain portal-sequence search: every cell that a sightline reaches from a source cell, octant by octant.

Source: Funkhouser et al. 1996, section 3.2 (depth-first search over portal sequences). Beyond the paper: the octant is
fixed before the search, a child first tries its parent's direction (six comparisons), and a search that passes its cap
says so, so that what it did not reach is UNKNOWN, never HIDDEN.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..data.verdict import Verdict
from .graph import DeviceGraph, reflect_high, reflect_low
from .launch import CPU, Device, Scratch, run_sliced
from .stab import (
    AT_M,
    AT_W,
    LEVEL_SIZE,
    LISTS_SIZE,
    append_box,
    decide,
    direction,
    level_maxima,
    load_counts,
    offsets,
    raise_maxima,
    slot_size,
    start_level,
    store_counts,
    vec6i,
    worst_cycle,
)

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

# Portals in one sequence; deeper branches leave their source unfinished. A list holds a row per box of the sequence, so
# this is less than LIST_CAPACITY.
MAX_DEPTH = wp.constant(80)
SLOT_SIZE = wp.constant(slot_size(MAX_DEPTH + 1))
# Integers per level: cell, next entry of its adjacency, the level that was decided last, and six row counts.
FRAME = wp.constant(9)
AT_COUNTS = wp.constant(3)
OPEN = wp.constant(-1)
STACK_SIZE = wp.constant((MAX_DEPTH + 1) * FRAME)


@wp.struct
class Slot:
    """Where the levels, the lists and the spares of a slot begin in `work`, and its stack in `frames`."""

    levels: int
    lists: int
    spare: int
    stack: int


@wp.func
def slot_at(number: int) -> Slot:
    """Layout of a slot's scratch."""
    out = Slot()
    out.levels = number * SLOT_SIZE
    out.lists = out.levels + (MAX_DEPTH + 1) * LEVEL_SIZE
    out.spare = out.lists + LISTS_SIZE
    out.stack = number * STACK_SIZE
    return out


@wp.struct
class Found:
    """Where a search reports: a row for a pair that it saw for the first time, or that it first had to leave open.

    The octant of a pair that is left open is OPEN, and it has no line; `reached` says whether it is still so.
    """

    reached: wp.array2d[wp.uint8]

    count: wp.array[int]
    pair: wp.array[wp.vec3i]
    line: wp.array[wp.vec3d]
    offset: wp.array[wp.vec3d]


@wp.func
def start_source(graph: DeviceGraph, source: int, octant: int, slot: Slot, work: wp.array[f64], frames: wp.array[int]):
    """Level 0 and frame 0: the lines that leave a cell."""
    lo = reflect_low(graph.cell_lo[source], graph.cell_hi[source], octant)
    hi = reflect_high(graph.cell_lo[source], graph.cell_hi[source], octant)
    counts = append_box(work, slot.lists, vec6i(), lo, hi, -1)
    start_level(work, slot.levels)
    # The source box alone is met by every direction; any w will do until a portal says otherwise.
    decide(work, slot.lists, slot.levels, slot.levels + LEVEL_SIZE, slot.spare, vec6i(), counts)
    for k in range(LEVEL_SIZE):
        work[slot.levels + k] = work[slot.levels + LEVEL_SIZE + k]
    frames[slot.stack] = source
    frames[slot.stack + 1] = graph.starts[source]
    frames[slot.stack + 2] = 0
    store_counts(frames, slot.stack + AT_COUNTS, counts)


@wp.func
def cross_portal(
    graph: DeviceGraph,
    entry: wp.vec4i,
    octant: int,
    depth: int,
    slot: Slot,
    work: wp.array[f64],
    frames: wp.array[int],
) -> int:
    """Verdict on the lines of a sequence that go on through a portal; the cell behind it gets the next frame."""
    at = slot.stack + depth * FRAME
    level = slot.levels + depth * LEVEL_SIZE
    child = level + LEVEL_SIZE
    lo = reflect_low(graph.portal_lo[entry[0]], graph.portal_hi[entry[0]], octant)
    hi = reflect_high(graph.portal_lo[entry[0]], graph.portal_hi[entry[0]], octant)
    w = direction(work, level)
    m = raise_maxima(level_maxima(work, level), w, lo, hi, entry[2])
    grown = append_box(work, slot.lists, load_counts(frames, at + AT_COUNTS), lo, hi, entry[2])
    decided = frames[at + 2]
    verdict = int(Verdict.VISIBLE)
    # The slack below keeps the shortcut exact when w is one of the rare unrounded directions.
    if worst_cycle(m) < f64(-0.5):
        for c in range(3):
            work[child + AT_W + c] = w[c]
        for p in range(6):
            work[child + AT_M + p] = m[p]
    else:
        inherited = slot.levels + decided * LEVEL_SIZE
        before = load_counts(frames, slot.stack + decided * FRAME + AT_COUNTS)
        verdict = decide(work, slot.lists, inherited, child, slot.spare, before, grown)
        decided = depth + 1
    frames[at + FRAME] = entry[1]
    frames[at + FRAME + 1] = graph.starts[entry[1]]
    frames[at + FRAME + 2] = decided
    store_counts(frames, at + FRAME + AT_COUNTS, grown)
    return verdict


@wp.func
def report_reached(
    verdict: int,
    row: int,
    behind: int,
    octant: int,
    child: int,
    work: wp.array[f64],
    found_out: Found,
):
    """Mark a cell as reached, and write down the line of the first sequence that surely reaches it."""
    code = found_out.reached[row, behind]
    if verdict == Verdict.VISIBLE and code != wp.uint8(Verdict.VISIBLE):
        found_out.reached[row, behind] = wp.uint8(Verdict.VISIBLE)
        spot = wp.atomic_add(found_out.count, 0, 1)
        if spot < found_out.pair.shape[0]:
            found_out.pair[spot] = wp.vec3i(row, behind, octant)
            found_out.line[spot] = direction(work, child)
            found_out.offset[spot] = offsets(level_maxima(work, child))
    if verdict == Verdict.UNKNOWN and code == wp.uint8(Verdict.HIDDEN):
        found_out.reached[row, behind] = wp.uint8(Verdict.UNKNOWN)
        spot = wp.atomic_add(found_out.count, 0, 1)
        if spot < found_out.pair.shape[0]:
            found_out.pair[spot] = wp.vec3i(row, behind, OPEN)


@wp.kernel
def _flood(
    graph: DeviceGraph,
    sources: wp.array[int],
    octant: int,
    cap: int,
    first: int,
    last: int,
    slots: int,
    work: wp.array[f64],
    frames: wp.array[int],
    tests_out: wp.array2d[int],
    found_out: Found,
):
    slot = slot_at(wp.tid())
    row = first + wp.tid()
    while row < last:
        start_source(graph, sources[row], octant, slot, work, frames)
        depth = int(0)
        tests = int(0)
        while depth >= 0:
            at = slot.stack + depth * FRAME
            cursor = frames[at + 1]
            if cursor == graph.starts[frames[at] + 1]:
                depth -= 1
            elif tests >= cap:
                tests = -1
                depth = -1
            else:
                frames[at + 1] = cursor + 1
                entry = graph.entries[cursor]
                if ((entry[3] >> octant) & 1) == 1:
                    tests += 1
                    verdict = cross_portal(graph, entry, octant, depth, slot, work, frames)
                    if verdict != Verdict.HIDDEN:
                        child = slot.levels + (depth + 1) * LEVEL_SIZE
                        report_reached(verdict, row - first, entry[1], octant, child, work, found_out)
                        depth += 1
                        if depth == MAX_DEPTH:
                            tests = -1
                            depth = -1
        tests_out[row, octant] = tests
        row += slots


# Sources per CPU launch: what they find is collected after each.
CHUNK = 64
# Pairs that a CPU launch has room for at first, 60 bytes each; one that finds more is repeated with more room.
ROOM = 2**16
# Pairs that a GPU launch has room for.
GPU_ROOM = 2**25


@dataclass
class FloodAnswers:
    """What a flood found.

    Attributes:
        pairs: (row of the source, reached cell, octant), shape (n, 3), int32, sorted; one row for the first octant that
            has a line for the pair.
        line: w of each pair's line, float64, shape (n, 3), as in `TargetAnswers`.
        offset: its xi.
        undecided: (row, cell) pairs that only a line too thin to decide reaches, shape (m, 2), int32, sorted.
        complete: rows of sources whose search ended before its cap: what they did not reach is hidden, exactly.
        tests: stabbing decisions.
    """

    pairs: np.ndarray
    line: np.ndarray
    offset: np.ndarray
    undecided: np.ndarray
    complete: np.ndarray
    tests: int

    def replaced(self, rows: np.ndarray, others: "FloodAnswers") -> "FloodAnswers":
        """The same with some rows, ascending, as others found them; their row k is rows[k] here."""
        kept, own = np.ones(len(self.complete), bool), self.complete.copy()
        kept[rows], own[rows] = False, others.complete
        old, open_ = kept[self.pairs[:, 0]], kept[self.undecided[:, 0]]
        pairs, left = others.pairs.copy(), others.undecided.copy()
        pairs[:, 0], left[:, 0] = rows[pairs[:, 0]], rows[left[:, 0]]
        pairs, left = np.concatenate([self.pairs[old], pairs]), np.concatenate([self.undecided[open_], left])
        order, places = (np.lexsort((found[:, 1], found[:, 0])) for found in (pairs, left))
        line, offset = (
            np.concatenate([mine[old], theirs])[order]
            for mine, theirs in ((self.line, others.line), (self.offset, others.offset))
        )
        return FloodAnswers(pairs[order], line, offset, left[places], own, self.tests + others.tests)


def launch_flood(
    graph: DeviceGraph,
    sources: np.ndarray,
    octants: tuple[int, ...] = tuple(range(8)),
    *,
    cap: int,
    device: Device = CPU,
) -> FloodAnswers:
    """Flood from every source, octant by octant; memory grows with what is found, not with sources times cells.

    Args:
        graph: on the same device.
        sources: cells, shape (n,), int.
        octants: directions searched; four that all keep one sign suffice when every cell is a source, because a
            sightline can be followed either way.
        cap: stabbing decisions per source and octant.
        device: where to.
    """
    count, cells = len(sources), graph.cell_lo.shape[0]
    source, tests = device.array(sources, int), device.zeros((count, 8), int)
    rooms: dict[int, Found] = {}
    chunk = CHUNK if device.is_cpu else max(CHUNK, GPU_ROOM // cells)
    rows = min(chunk, count)
    gathered: list[tuple[np.ndarray, ...]] = []

    def room(most: int) -> Found:
        return device.struct(Found, reached=(rows, cells), count=1, pair=most, line=most, offset=most)

    def launch(first: int, last: int, slots: int, work: wp.array, frames: wp.array) -> None:
        # Each thread brings its own scratch, and keeps its own room for what it finds.
        found = rooms.get(work.ptr)
        if found is None:
            found = rooms[work.ptr] = room(min(rows * cells, ROOM if device.is_cpu else GPU_ROOM))
        while True:
            found.count.zero_()
            found.reached.zero_()
            for octant in octants:
                inputs = [graph, source, octant, cap, first, last, slots, work, frames]
                wp.launch(_flood, dim=slots, inputs=inputs, outputs=[tests, found], device=device.name)
            used = int(found.count.numpy()[0])
            if used <= found.pair.shape[0]:
                break
            found = rooms[work.ptr] = room(2 * used)
        pairs, line, offset = (x[:used].numpy().copy() for x in (found.pair, found.line, found.offset))
        sure = pairs[:, 2] != OPEN
        left = pairs[~sure, :2]
        if len(left):
            left = left[found.reached.numpy()[left[:, 0], left[:, 1]] == Verdict.UNKNOWN]
        pairs[:, 0] += first
        left[:, 0] += first
        gathered.append((pairs[sure], line[sure], offset[sure], left))

    scratch = Scratch(int(SLOT_SIZE), int(STACK_SIZE))
    run_sliced(launch, count, _flood.module, device, scratch=scratch, chunk=chunk, gpu_chunk=chunk)
    pairs, line, offset, undecided = (np.concatenate(column) for column in zip(*gathered, strict=True))
    order, left = (np.argsort(found[:, 0].astype(np.int64) * cells + found[:, 1]) for found in (pairs, undecided))
    spent = tests.numpy()[:, list(octants)]
    return FloodAnswers(
        pairs[order],
        line[order],
        offset[order],
        undecided[left],
        (spent >= 0).all(axis=1),
        int(np.maximum(spent, 0).sum()),
    )
