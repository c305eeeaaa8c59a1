"""Plain portal-sequence search: every cell that a sightline reaches from a source cell, octant by octant.

Source: Funkhouser et al. 1996, section 3.2 (depth-first search over portal sequences). Beyond the paper: the octant is
fixed before the search, a child first tries its parent's direction (six comparisons), and a search that passes its cap
says so, so that what it did not reach is UNKNOWN, never HIDDEN.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from .graph import DeviceGraph, reflect_high, reflect_low
from .launch import SlotSizes, run_sliced
from .stab import (
    AT_M,
    AT_W,
    HIDDEN,
    LEVEL_SIZE,
    LIST_CAPACITY,
    LISTS_SIZE,
    STABBED,
    UNDECIDED,
    append_box,
    decide,
    offsets,
    raise_maxima,
    start_level,
    vec6d,
    vec6i,
    worst_cycle,
)

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

# Portals in one sequence; deeper branches leave their source unfinished.
MAX_DEPTH = wp.constant(80)
# Levels + lists + two spare polygons + the failing cut.
SLOT_SIZE = wp.constant((80 + 1) * (27 + 1 + 4 * 24) + 6 * 96 * 2 + 2 * (1 + 4 * 24) + 8)
# Integers a level: cell, cursor, basis level, decided flag, six row counts.
FRAME = wp.constant(10)


@wp.func
def store_counts(frames: wp.array(dtype=int), at: int, counts: vec6i):
    """Save the row counts of a level."""
    for p in range(6):
        frames[at + 4 + p] = counts[p]


@wp.func
def load_counts(frames: wp.array(dtype=int), at: int) -> vec6i:
    """Row counts of a level."""
    counts = vec6i()
    for p in range(6):
        counts[p] = frames[at + 4 + p]
    return counts


@wp.struct
class Found:
    """Where a search reports: one row a pair it stabbed for the first time."""

    count: wp.array(dtype=int)
    pair: wp.array(dtype=wp.vec3i)
    line: wp.array(dtype=wp.vec3d)
    offset: wp.array(dtype=wp.vec3d)


@wp.kernel
def _flood(
    graph: DeviceGraph,
    sources: wp.array(dtype=int),
    first: int,
    last: int,
    octant: int,
    cap: int,
    work: wp.array(dtype=f64),
    frames: wp.array(dtype=int),
    reached_out: wp.array2d(dtype=wp.uint8),
    tests_out: wp.array2d(dtype=int),
    found: Found,
):
    slot = wp.tid()
    levels = slot * SLOT_SIZE
    lists = levels + (MAX_DEPTH + 1) * LEVEL_SIZE
    spare = lists + LISTS_SIZE
    stack = slot * (MAX_DEPTH + 1) * FRAME
    slots = work.shape[0] // SLOT_SIZE
    row = first + slot
    while row < last:
        source = sources[row]
        counts = append_box(
            work,
            lists,
            vec6i(),
            reflect_low(graph.cell_lo[source], graph.cell_hi[source], octant),
            reflect_high(graph.cell_lo[source], graph.cell_hi[source], octant),
            -1,
        )
        start_level(work, levels)
        # The source box alone is met by every direction; any w will do until a portal says otherwise.
        decide(work, lists, levels, levels + LEVEL_SIZE, spare, vec6i(), counts)
        for k in range(LEVEL_SIZE):
            work[levels + k] = work[levels + LEVEL_SIZE + k]
        frames[stack] = source
        frames[stack + 1] = graph.starts[source]
        frames[stack + 2] = 0
        store_counts(frames, stack, counts)
        depth = int(0)
        tests = int(0)
        while depth >= 0:
            at = stack + depth * FRAME
            cell = frames[at]
            cursor = frames[at + 1]
            if cursor == graph.starts[cell + 1]:
                depth -= 1
            elif tests >= cap:
                tests = -1
                depth = -1
            else:
                frames[at + 1] = cursor + 1
                entry = graph.entries[cursor]
                if ((entry[3] >> octant) & 1) == 1:
                    tests += 1
                    counts = load_counts(frames, at)
                    portal = entry[0]
                    lo = reflect_low(graph.portal_lo[portal], graph.portal_hi[portal], octant)
                    hi = reflect_high(graph.portal_lo[portal], graph.portal_hi[portal], octant)
                    level = levels + depth * LEVEL_SIZE
                    child = level + LEVEL_SIZE
                    w = wp.vec3d(work[level + AT_W], work[level + AT_W + 1], work[level + AT_W + 2])
                    m = vec6d()
                    for p in range(6):
                        m[p] = work[level + AT_M + p]
                    m = raise_maxima(m, w, lo, hi, entry[2])
                    grown = append_box(work, lists, counts, lo, hi, entry[2])
                    basis = frames[at + 2]
                    verdict = STABBED
                    # The slack below keeps the shortcut exact when w is one of the rare unrounded directions.
                    if worst_cycle(m) < f64(-0.5):
                        for c in range(3):
                            work[child + AT_W + c] = w[c]
                        for p in range(6):
                            work[child + AT_M + p] = m[p]
                    else:
                        verdict = decide(
                            work,
                            lists,
                            levels + basis * LEVEL_SIZE,
                            child,
                            spare,
                            load_counts(frames, stack + basis * FRAME),
                            grown,
                        )
                        basis = depth + 1
                    if verdict != HIDDEN:
                        behind = entry[1]
                        code = reached_out[row, behind]
                        if verdict == STABBED and code != wp.uint8(STABBED):
                            reached_out[row, behind] = wp.uint8(STABBED)
                            mm = vec6d()
                            for p in range(6):
                                mm[p] = work[child + AT_M + p]
                            spot = wp.atomic_add(found.count, 0, 1)
                            if spot < found.pair.shape[0]:
                                found.pair[spot] = wp.vec3i(row, behind, octant)
                                found.line[spot] = wp.vec3d(
                                    work[child + AT_W], work[child + AT_W + 1], work[child + AT_W + 2]
                                )
                                found.offset[spot] = offsets(mm)
                        if verdict == UNDECIDED and code == wp.uint8(0):
                            reached_out[row, behind] = wp.uint8(UNDECIDED)
                        if depth + 1 == MAX_DEPTH or grown[0] + 4 > LIST_CAPACITY:
                            tests = -1
                            depth = -1
                        else:
                            depth += 1
                            down = stack + depth * FRAME
                            frames[down] = behind
                            frames[down + 1] = graph.starts[behind]
                            frames[down + 2] = basis
                            store_counts(frames, down, grown)
        tests_out[row, octant] = tests
        row += slots


# Sources a CPU launch: what they find is collected after each, so a launch's room is this times the number of cells.
CHUNK = 64
# Pairs a GPU launch has room for, 60 bytes each.
GPU_ROOM = 2**25


@dataclass
class FloodAnswers:
    """What a flood found.

    Attributes:
        pairs: (row of the source, reached cell, octant), shape (n, 3), int32, sorted; one row for the first octant that
            stabbed the pair.
        line: w of each pair's line, float64, shape (n, 3), as in `TargetAnswers`.
        offset: its xi.
        undecided: (row, cell) pairs that only a line too thin to decide reaches, shape (sources, cells), bool.
        complete: rows of sources whose search ended before its cap: what they did not reach is hidden, exactly.
        tests: stabbing decisions.
    """

    pairs: np.ndarray
    line: np.ndarray
    offset: np.ndarray
    undecided: np.ndarray
    complete: np.ndarray
    tests: int


def found_room(size: int, device: str) -> Found:
    """Room for so many found pairs."""
    found = Found()
    found.count = wp.zeros(1, dtype=int, device=device)
    found.pair = wp.empty(size, dtype=wp.vec3i, device=device)
    found.line, found.offset = (wp.empty(size, dtype=wp.vec3d, device=device) for _ in range(2))
    return found


def launch_flood(
    graph: DeviceGraph,
    sources: np.ndarray,
    octants: tuple[int, ...] = tuple(range(8)),
    *,
    cap: int,
    threads: int = 1,
    device: str = "cpu",
) -> FloodAnswers:
    """Flood from every source, octant by octant.

    Args:
        graph: on the same device.
        sources: cells, shape (n,), int.
        octants: directions searched; four that all keep one sign suffice when every cell is a source, because a
            sightline can be followed either way.
        cap: stabbing decisions a source and octant.
        threads: CPU threads.
        device: Warp device.
    """
    count, cells = len(sources), graph.cell_lo.shape[0]
    source = wp.array(np.ascontiguousarray(sources, np.int32), dtype=int, device=device)
    reached = wp.zeros((count, cells), dtype=wp.uint8, device=device)
    tests = wp.zeros((count, 8), dtype=int, device=device)
    rooms: dict[int, Found] = {}
    chunk = CHUNK if wp.get_device(device).is_cpu else max(CHUNK, GPU_ROOM // cells)
    gathered: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []

    def launch(first: int, last: int, slots: int, scratch: wp.array, frames: wp.array) -> None:
        # Each thread brings its own scratch, and keeps its own room for what it finds.
        found = rooms.get(scratch.ptr)
        if found is None:
            found = rooms[scratch.ptr] = found_room(min(chunk, count) * cells, device)
        found.count.zero_()
        for octant in octants:
            inputs = [graph, source, first, last, octant, cap, scratch, frames, reached, tests, found]
            wp.launch(_flood, dim=slots, inputs=inputs, device=device)
        used = int(found.count.numpy()[0])
        gathered.append(tuple(x[:used].numpy().copy() for x in (found.pair, found.line, found.offset)))

    sizes = SlotSizes(int(SLOT_SIZE), (int(MAX_DEPTH) + 1) * int(FRAME))
    run_sliced(launch, count, sizes, module=__name__, threads=threads, device=device, chunk=chunk)
    pairs, line, offset = (np.concatenate(column) for column in zip(*gathered, strict=True))
    order = np.lexsort((pairs[:, 1], pairs[:, 0]))
    spent = tests.numpy()[:, list(octants)]
    return FloodAnswers(
        pairs[order],
        line[order],
        offset[order],
        reached.numpy() == int(UNDECIDED),
        (spent >= 0).all(axis=1),
        int(np.maximum(spent, 0).sum()),
    )
