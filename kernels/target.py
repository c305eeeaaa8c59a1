"""Target search: is there a sightline from one box to another, past every blocker?

A branch-and-bound over lines instead of portal sequences. Take the middle line of what is still possible and look up
the blockers it crosses between source and target. None: VISIBLE, and the line is the witness. Else the line must pass
one of them in one of a few ways (kernels/blockers.py), each linear. Most children are empty at once; none left: HIDDEN.
Open space costs nothing however finely it was cut into cells, which is where portal sequences explode.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..data.plans import NO_PLANS, Plans
from ..data.verdict import Verdict
from .blockers import CLEAR, DOUBTFUL, BlockerTree, append_way, has_room, has_way, look_up, way_count
from .directions import POLYGON_SIZE
from .ends import Ends, Pairs, can_lead, ends_of, start_directions
from .launch import CPU, Device, Scratch, check_coordinates, launch_slots
from .stab import (
    AT_W,
    LEVEL_SIZE,
    LIST_CAPACITY,
    LISTS_SIZE,
    SLOPES_SIZE,
    SPARES_SIZE,
    append_box,
    append_entry,
    decide,
    direction,
    level_maxima,
    load_counts,
    offsets,
    slot_size,
    store_counts,
    vec6i,
)

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

MAX_BRANCHES = wp.constant(60)
# A slot, and the lists again for widening the witness.
SLOT_SIZE = wp.constant(slot_size(MAX_BRANCHES + 2) + LISTS_SIZE)
# A witness is first tried with this clearance [grid steps] from every edge it passes, then with a quarter of it, ...
WIDEST_CLEARANCE = wp.constant(wp.float64(1024.0))
# Integers per level: blocker, next way, order of its four sides, and six row counts.
FRAME = wp.constant(9)
AT_COUNTS = wp.constant(3)
STACK_SIZE = wp.constant((MAX_BRANCHES + 2) * FRAME)
# Answers beside the verdicts: every way of a node has been tried; the search of a pair has to end.
EXHAUSTED = wp.constant(3)
GIVEN_UP = wp.constant(4)


@wp.struct
class Answers:
    """Per pair: verdict, nodes spent, octant and line (w, xi) of a visible pair."""

    verdict: wp.array[wp.uint8]
    nodes: wp.array[int]
    octant: wp.array[int]
    line: wp.array[wp.vec3d]
    offset: wp.array[wp.vec3d]


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
    out.lists = out.levels + (MAX_BRANCHES + 2) * LEVEL_SIZE
    out.spare = out.lists + LISTS_SIZE
    out.stack = number * STACK_SIZE
    return out


@wp.func
def start_search(ends: Ends, slot: Slot, work: wp.array[f64], frames: wp.array[int]) -> int:
    """Decide the lines from source to target at level 1, blockers aside, and put their rows into frame 0."""
    counts = append_box(work, slot.lists, vec6i(), ends.s_lo, ends.s_hi, -1)
    counts = append_box(work, slot.lists, counts, ends.t_lo, ends.t_hi, -1)
    if start_directions(ends, work, slot.levels, slot.spare) == Verdict.HIDDEN:
        # As `decide` reports slopes that leave no direction; the level is the one that it would have written.
        for k in range(SLOPES_SIZE):
            work[slot.levels + LEVEL_SIZE + k] = work[slot.levels + k]
        work[slot.spare + 2 * POLYGON_SIZE + 3] = f64(-2.0)
        return Verdict.HIDDEN
    store_counts(frames, slot.stack + AT_COUNTS, counts)
    return decide(work, slot.lists, slot.levels, slot.levels + LEVEL_SIZE, slot.spare, vec6i(), counts)


@wp.func
def open_node(
    tree: BlockerTree, ends: Ends, depth: int, slot: Slot, work: wp.array[f64], frames: wp.array[int]
) -> wp.vec2i:
    """Look up what a decided node is about, as `look_up`, and put it into the node's frame."""
    level = slot.levels + (depth + 1) * LEVEL_SIZE
    hit = look_up(tree, ends, direction(work, level), offsets(level_maxima(work, level)))
    at = slot.stack + depth * FRAME
    frames[at] = hit[0]
    frames[at + 1] = 0
    frames[at + 2] = hit[1]
    return hit


@wp.func
def next_way(tree: BlockerTree, ends: Ends, depth: int, slot: Slot, work: wp.array[f64], frames: wp.array[int]) -> int:
    """Decide the next way that exists out of what a node is about, as its child: a verdict, or EXHAUSTED.

    The child's level is that of depth + 2, its rows are in the frame of depth + 1.
    """
    at = slot.stack + depth * FRAME
    level = slot.levels + (depth + 1) * LEVEL_SIZE
    item = frames[at]
    ways = way_count(tree, item)
    counts = load_counts(frames, at + AT_COUNTS)
    cursor = int(frames[at + 1])
    while cursor < ways and not has_way(tree, item, cursor, ends):
        cursor += 1
    frames[at + 1] = cursor + 1
    if cursor >= ways:
        return EXHAUSTED
    grown = append_way(work, slot.lists, counts, tree, item, frames[at + 2], cursor, ends)
    store_counts(frames, at + FRAME + AT_COUNTS, grown)
    return decide(work, slot.lists, level, level + LEVEL_SIZE, slot.spare, counts, grown)


@wp.func
def inset(lo: wp.vec3d, hi: wp.vec3d, clearance: f64) -> wp.vec3d:
    """How far to shrink a box on each axis: the clearance, but never more than a quarter of the box."""
    out = wp.vec3d()
    for i in range(3):
        out[i] = wp.floor(wp.min(clearance, f64(0.25) * (hi[i] - lo[i])))
    return out


@wp.func
def widen(ends: Ends, clearance: f64, counts: vec6i, slot: Slot, work: wp.array[f64]) -> int:
    """Decide the same rows again at level 1, each tightened by a clearance; VISIBLE if a line keeps that clear."""
    roomy = slot.spare + SPARES_SIZE
    s_in = inset(ends.s_lo, ends.s_hi, clearance)
    t_in = inset(ends.t_lo, ends.t_hi, clearance)
    done = append_box(work, roomy, vec6i(), ends.s_lo + s_in, ends.s_hi - s_in, -1)
    done = append_box(work, roomy, done, ends.t_lo + t_in, ends.t_hi - t_in, -1)
    for p in range(6):
        for k in range(2, counts[p]):
            at = slot.lists + (p * LIST_CAPACITY + k) * 2
            append_entry(work, roomy, p, k, work[at] + clearance, work[at + 1] - clearance)
    start_directions(ends, work, slot.levels, slot.spare)
    return decide(work, roomy, slot.levels, slot.levels + LEVEL_SIZE, slot.spare, vec6i(), counts)


@wp.func
def write_witness(
    tree: BlockerTree,
    ends: Ends,
    row: int,
    depth: int,
    slot: Slot,
    work: wp.array[f64],
    frames: wp.array[int],
    answers_out: Answers,
):
    """Write down the clear line of a node, moved to the widest clearance at which a line is clear."""
    level = slot.levels + (depth + 1) * LEVEL_SIZE
    w = direction(work, level)
    xi = offsets(level_maxima(work, level))
    counts = load_counts(frames, slot.stack + depth * FRAME + AT_COUNTS)
    clearance = WIDEST_CLEARANCE
    while clearance >= f64(1.0):
        if widen(ends, clearance, counts, slot, work) == Verdict.VISIBLE:
            wide = slot.levels + LEVEL_SIZE
            w_wide = direction(work, wide)
            xi_wide = offsets(level_maxima(work, wide))
            hit = look_up(tree, ends, w_wide, xi_wide)
            if hit[0] == CLEAR:
                w = w_wide
                xi = xi_wide
                clearance = f64(0.0)
        clearance *= f64(0.25)
    answers_out.octant[row] = ends.octant
    answers_out.line[row] = w
    answers_out.offset[row] = xi


@wp.func
def search_octant(
    tree: BlockerTree,
    ends: Ends,
    row: int,
    cap: int,
    slot: Slot,
    work: wp.array[f64],
    frames: wp.array[int],
    answers_out: Answers,
) -> int:
    """Verdict on the lines of one octant, GIVEN_UP where a limit was met; counts nodes and writes the witness."""
    answer = start_search(ends, slot, work, frames)
    if answer != Verdict.VISIBLE:
        return answer
    verdict = int(Verdict.HIDDEN)
    depth = int(0)
    fresh = bool(True)
    while depth >= 0:
        if fresh:
            fresh = False
            answers_out.nodes[row] = answers_out.nodes[row] + 1
            hit = open_node(tree, ends, depth, slot, work, frames)
            if hit[0] == DOUBTFUL:
                return GIVEN_UP
            if hit[0] == CLEAR:
                level = slot.levels + (depth + 1) * LEVEL_SIZE
                # An unrounded direction makes crossing times inexact: kept, but not called a witness.
                if work[level + AT_W] != wp.floor(work[level + AT_W]):
                    return int(Verdict.UNKNOWN)
                write_witness(tree, ends, row, depth, slot, work, frames, answers_out)
                return int(Verdict.VISIBLE)
            full = not has_room(load_counts(frames, slot.stack + depth * FRAME + AT_COUNTS))
            if answers_out.nodes[row] >= cap or depth == MAX_BRANCHES or full:
                return GIVEN_UP
        else:
            answer = next_way(tree, ends, depth, slot, work, frames)
            if answer == EXHAUSTED:
                depth -= 1
            if answer == Verdict.UNKNOWN:
                verdict = int(Verdict.UNKNOWN)
            if answer == Verdict.VISIBLE:
                depth += 1
                fresh = True
    return verdict


@wp.kernel
def _search(
    tree: BlockerTree,
    pairs: Pairs,
    cap: int,
    first: int,
    last: int,
    slots: int,
    work: wp.array[f64],
    frames: wp.array[int],
    answers_out: Answers,
):
    slot = slot_at(wp.tid())
    row = first + wp.tid()
    while row < last:
        verdict = int(Verdict.HIDDEN)
        octant = int(0)
        while octant < 8:
            ends = ends_of(pairs, row, octant)
            if can_lead(ends):
                answer = search_octant(tree, ends, row, cap, slot, work, frames, answers_out)
                if answer != Verdict.HIDDEN:
                    verdict = wp.min(answer, int(Verdict.UNKNOWN))
                if answer == Verdict.VISIBLE or answer == GIVEN_UP:
                    octant = 8
            octant += 1
        answers_out.verdict[row] = wp.uint8(verdict)
        row += slots


@dataclass
class TargetAnswers:
    """Answers of a target search, one row per pair.

    Attributes:
        verdict: `Verdict`, uint8.
        nodes: lines tried, int32.
        octant: of a visible pair's line, int32.
        line: its w, float64, shape (n, 3): component i of the direction is sign_i / w_i.
        offset: its xi: coordinate i at time t is sign_i (t + xi_i) / w_i.
    """

    verdict: np.ndarray
    nodes: np.ndarray
    octant: np.ndarray
    line: np.ndarray
    offset: np.ndarray


def device_pairs(boxes: np.ndarray, rows: np.ndarray, device: Device, plans: Plans | None = None) -> Pairs:
    """Boxes and rows, as of `launch_target_search`, on a device."""
    lo, hi = (device.corners(boxes[:, side]) for side in (0, 1))
    plans = plans or NO_PLANS
    check_coordinates(plans.corners)
    plan_of = plans.places(len(boxes))
    return device.struct(Pairs, lo=lo, hi=hi, plan_of=plan_of, plans=plans.corners, rows=rows)


def launch_target_search(
    tree: BlockerTree,
    boxes: np.ndarray,
    rows: np.ndarray,
    *,
    plans: Plans | None = None,
    cap: int = 2000,
    device: Device = CPU,
) -> TargetAnswers:
    """Whether an open set of sightlines leads from box to box past every blocker.

    Args:
        tree: blockers on the same device.
        boxes: [grid steps], shape (m, 2, 3), int32, |coordinate| <= 2**24.
        rows: (source box, target box, strict), shape (n, 3), int. Source and target must not overlap. With strict 1 a
            blocker that lies on the target's near face does not count (the target is a surface, not a cell).
        plans: of those boxes that stand for prisms inside them; lines count only if they meet the prisms' plans.
        cap: lines tried per pair before the answer is UNKNOWN.
        device: where to.

    Returns:
        Answers. HIDDEN is exact: no open set of lines passes. VISIBLE is exact for the blockers given, and its line
        keeps the widest clearance that was found (1024, 256, ... 1 grid steps, or whatever the first line had). UNKNOWN
        is neither: keep it.

    Raises:
        InputError: a coordinate beyond the grid, where products of differences are no longer exact.
    """
    count = len(rows)
    answers = device.struct(Answers, verdict=count, nodes=count, octant=count, line=count, offset=count)
    scratch = Scratch(int(SLOT_SIZE), int(STACK_SIZE))
    launch_slots(_search, count, [tree, device_pairs(boxes, rows, device, plans), cap], scratch, [answers], device)
    return TargetAnswers(*(getattr(answers, name).numpy() for name in TargetAnswers.__dataclass_fields__))
