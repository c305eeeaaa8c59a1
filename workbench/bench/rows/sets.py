"""Cases of sets in storage: the order of objects beside the published way, decoding beside a plain loop."""

from functools import partial

import numpy as np

from ....data.ragged import starts_of
from ....data.runs import RunSets, decode, encode
from ....kernels import tour as tour_kernels
from ....kernels.launch import CPU, Device
from ....solvers.tour import count_runs, distinct_columns, tour_order
from ....verify.readers.walk import read_code
from ..published import Sets, sampled_order
from ..suite import Case, Errors

# Eyes in a unit cube that see so far, one for so many objects.
REACH, PER_EYE = 0.25, 25
# Sets that are decoded by the loop.
LOOPED = 4


def seen_within_reach(objects: int) -> tuple[Sets, np.ndarray]:
    """Objects at random in a cube, seen by eyes within reach; and their places."""
    random = np.random.default_rng(objects)
    places, eyes = random.random((objects, 3)), random.random((max(2, objects // PER_EYE), 3))
    rows = [np.flatnonzero(np.linalg.norm(places - eye, axis=1) < REACH) for eye in eyes]
    return Sets.of_rows(rows, objects), places


def tour_cases(n: int, device: Device) -> list[Case]:
    """The order of n objects; gap is how far half the tour, the runs, may be above the fewest, relative to it."""
    sets, places = seen_within_reach(n)
    return [
        Case(
            kernel="tour",
            scene=f"{len(sets)} eyes' sets (all)",
            method="kernel",
            n=n,
            work=lambda: tour_order(sets.starts, sets.members, places, device),
            judge=partial(judge_order, sets),
            baseline="sampled tour",
            reference=lambda: sampled_order(sets),
            share=1.0,
            modules=[tour_kernels.__name__],
        )
    ]


def judge_order(sets: Sets, order: np.ndarray) -> Errors:
    """A tour has two edges at each city, no shorter than those to the two nearest: half their sum bounds its length.

    Raises:
        ValueError: an object is left out.
    """
    if not np.array_equal(np.sort(order), np.arange(sets.count)):
        raise ValueError("expected each object once")
    columns = distinct_columns(sets.starts, sets.members, sets.count)[1].astype(np.float32)
    ones = columns.sum(axis=0)
    apart = np.sort(ones[:, None] + ones[None] - 2 * columns.T @ columns, axis=1)
    # The first is the city's distance from itself; half a tour's length are the runs.
    least = apart[:, 1:3].sum() / 4
    return Errors(gap=float(1 - least / count_runs(sets.starts, sets.members, order)))


def runs_cases(n: int, device: Device) -> list[Case]:
    """Decoding sets of n objects; error is the share of sets that a plain loop reads otherwise."""
    sets, places = seen_within_reach(n)
    mine = sets.ordered(tour_order(sets.starts, sets.members, places, device))
    codes = encode(mine.starts, mine.members)
    return [
        Case(
            kernel="runs",
            scene=f"{len(sets)} sets ({LOOPED} by loop)",
            method="numpy",
            n=n,
            work=lambda: decode(codes, n),
            judge=partial(judge_runs, mine),
            baseline="plain loop",
            reference=lambda: [read_code(code) for code in codes[:LOOPED]],
            share=sum(map(len, codes[:LOOPED])) / max(1, sum(map(len, codes))),
            modules=[],
            device=CPU.name,
        )
    ]


def judge_runs(sets: Sets, found: RunSets) -> Errors:
    """Sets that are not what they were."""
    codes = encode(*found.ids())
    wrong = sum(read_code(code) != set(sets.of(row).tolist()) for row, code in enumerate(codes))
    same = np.array_equal(starts_of([len(sets.of(row)) for row in range(len(sets))]), found.ids()[0])
    return Errors(error=wrong / max(1, len(codes)) if same else 1.0)
