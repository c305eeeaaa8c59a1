"""Axial stabbing of many box lists at once: a witness line or the cuts of a proof for each.

The functions are those of kernels/stab.py; here one thread decides one list from the widest level.
"""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import warp as wp

from ..data.errors import InputError
from ..data.scene import GRID_LIMIT
from ..data.verdict import Verdict
from .directions import EDGE_CAPACITY, POLYGON_SIZE
from .graph import reflect_high, reflect_low
from .launch import CPU, Device, Scratch, launch_slots
from .stab import (
    LEVEL_SIZE,
    LIST_CAPACITY,
    LISTS_SIZE,
    append_box,
    decide,
    direction,
    level_maxima,
    offsets,
    slot_size,
    start_level,
    vec6i,
)

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

SLOT_SIZE = wp.constant(slot_size(2))
# Every edge of the last polygon, and the cut that emptied it.
CUT_CAPACITY = wp.constant(EDGE_CAPACITY + 1)


@wp.struct
class BoxLists:
    """Box lists, padded to one length, and the octant of each; bit i is set when direction component i is negative."""

    lo: wp.array2d[wp.vec3i]
    hi: wp.array2d[wp.vec3i]
    lengths: wp.array[int]
    octants: wp.array[int]


@wp.struct
class Decisions:
    """Columns of `StabAnswers`."""

    verdict: wp.array[wp.uint8]
    w: wp.array[wp.vec3d]
    xi: wp.array[wp.vec3d]
    cuts: wp.array2d[int]


@wp.func
def report_slopes(work: wp.array[f64], level: int, cuts_out: wp.array2d[int], row: int):
    """Tags of the one or two slope bounds that leave no direction."""
    found = bool(False)
    for u in range(3):
        at = level + 6 * u
        if not found and work[at + 3] * work[at + 1] <= work[at] * work[at + 4]:
            found = True
            cuts_out[row, 0] = int(work[at + 5])
            # A high bound of 0 or less contradicts w > 0 by itself; so does one that allows no direction at all.
            if work[at + 4] != f64(0.0) and work[at + 3] > f64(0.0):
                cuts_out[row, 1] = int(work[at + 5])
                cuts_out[row, 0] = int(work[at + 2])


@wp.func
def report_polygon(work: wp.array[f64], failing: int, cuts_out: wp.array2d[int], row: int):
    """Tags of the last polygon's edges, then that of the cut that emptied it."""
    polygon = int(work[failing + 4])
    count = int(0)
    for k in range(int(work[polygon])):
        tag = int(work[polygon + 4 + 4 * k])
        if tag >= 0:
            cuts_out[row, count] = tag
            count += 1
    cuts_out[row, count] = int(work[failing + 3])


@wp.kernel
def _stab(
    lists_in: BoxLists,
    first: int,
    last: int,
    slots: int,
    work: wp.array[f64],
    answers_out: Decisions,
):
    slot = wp.tid()
    root = slot * SLOT_SIZE
    level = root + LEVEL_SIZE
    lists = root + 2 * LEVEL_SIZE
    spare = lists + LISTS_SIZE
    failing = spare + 2 * POLYGON_SIZE
    row = first + slot
    while row < last:
        octant = lists_in.octants[row]
        counts = vec6i()
        for k in range(lists_in.lengths[row]):
            lo = reflect_low(lists_in.lo[row, k], lists_in.hi[row, k], octant)
            hi = reflect_high(lists_in.lo[row, k], lists_in.hi[row, k], octant)
            counts = append_box(work, lists, counts, lo, hi, -1)
        start_level(work, root)
        verdict = decide(work, lists, root, level, spare, vec6i(), counts)
        answers_out.verdict[row] = wp.uint8(verdict)
        if verdict == Verdict.HIDDEN:
            if work[failing + 3] == f64(-2.0):
                report_slopes(work, level, answers_out.cuts, row)
            else:
                report_polygon(work, failing, answers_out.cuts, row)
        elif verdict == Verdict.VISIBLE:
            answers_out.w[row] = direction(work, level)
            answers_out.xi[row] = offsets(level_maxima(work, level))
        row += slots


@dataclass
class StabAnswers:
    """Answers of a batch, one row a box list.

    Attributes:
        verdict: `Verdict`, uint8: HIDDEN and VISIBLE are exact, for lines through the insides.
        signs: direction octant as asked, shape (n, 3), int32.
        w: of a visible row's line, float64, shape (n, 3): component i of the direction is sign_i / w_i.
        xi: coordinate i of the line at time t is sign_i (t + xi_i) / w_i, float64, shape (n, 3).
        cuts: tags of a hidden row's cuts, -1 where there is no more, shape (n, 25), int32; the last one completes the
            proof, together with at most two others (see `verify.proofs.stab_cuts`).
    """

    verdict: np.ndarray
    signs: np.ndarray
    w: np.ndarray
    xi: np.ndarray
    cuts: np.ndarray

    def line(self, row: int) -> tuple[tuple[Fraction, ...], tuple[Fraction, ...]]:
        """Point [grid steps] and direction of a visible row's witness line, exactly."""
        w, xi = ([Fraction(float(c)) for c in column[row]] for column in (self.w, self.xi))
        signs = self.signs[row].tolist()
        point = tuple(s * x / c for s, x, c in zip(signs, xi, w, strict=True))
        return point, tuple(s / c for s, c in zip(signs, w, strict=True))


def launch_stab(
    boxes: np.ndarray,
    signs: np.ndarray,
    lengths: np.ndarray | None = None,
    *,
    device: Device = CPU,
) -> StabAnswers:
    """Whether a line of each octant passes through the inside of all boxes of each list.

    Args:
        boxes: (low, high corner) [grid steps], shape (n, k, 2, 3), int, |coordinate| <= 2**24; low == high on one axis
            is a portal.
        signs: direction octants, +1 and -1, shape (n, 3).
        lengths: boxes used of each list, 1 to k, shape (n,); all k by default. At most 96.
        device: where to.

    Returns:
        Answers. HIDDEN and VISIBLE are never wrong; UNKNOWN is neither.

    Raises:
        InputError: shapes, coordinates, signs or lengths out of range.
    """
    boxes, signs = np.asarray(boxes), np.asarray(signs)
    lengths = np.full(boxes.shape[:1], boxes.shape[1]) if lengths is None else np.asarray(lengths)
    _check(boxes, signs, lengths)
    count = len(boxes)
    # Warp has no array with an axis of length 0.
    padded = boxes if count else np.zeros((1, 1, 2, 3), int)
    octants = ((signs < 0) << np.arange(3)).sum(axis=1)
    work = device.struct(BoxLists, lo=padded[:, :, 0], hi=padded[:, :, 1], lengths=lengths, octants=octants)
    answers = device.struct(Decisions, verdict=count, w=count, xi=count, cuts=(count, int(CUT_CAPACITY)))
    answers.cuts.fill_(-1)
    launch_slots(_stab, count, [work], Scratch(int(SLOT_SIZE)), [answers], device)
    columns = (answers.verdict, answers.w, answers.xi, answers.cuts)
    verdict, w, xi, cuts = (column.numpy() for column in columns)
    return StabAnswers(verdict, signs.astype(np.int32), w, xi, cuts)


def _check(boxes: np.ndarray, signs: np.ndarray, lengths: np.ndarray) -> None:
    if boxes.ndim != 4 or boxes.shape[2:] != (2, 3) or boxes.dtype.kind not in "iu" or boxes.shape[1] == 0:
        raise InputError(f"boxes: expected integers of shape (n, k, 2, 3), k > 0; found {boxes.dtype} {boxes.shape}")
    if signs.shape != (len(boxes), 3) or not np.isin(signs, (1, -1)).all():
        raise InputError(f"signs: expected +1 and -1 of shape ({len(boxes)}, 3); found shape {signs.shape}")
    most = min(boxes.shape[1], int(LIST_CAPACITY))
    if lengths.shape != (len(boxes),) or (len(boxes) and not 1 <= lengths.min() <= lengths.max() <= most):
        raise InputError(f"lengths: expected {len(boxes)} numbers from 1 to {most}; found {lengths.tolist()[:4]}")
    if len(boxes) and max(int(boxes.max()), -int(boxes.min())) > GRID_LIMIT:
        raise InputError(f"boxes: expected coordinates within {GRID_LIMIT} steps; found {np.abs(boxes).max()}")
    if (boxes[:, :, 0] > boxes[:, :, 1]).any():
        row = int(np.argwhere((boxes[:, :, 0] > boxes[:, :, 1]).any(axis=2))[0, 0])
        raise InputError(f"boxes: expected low <= high; found otherwise in list {row}")
