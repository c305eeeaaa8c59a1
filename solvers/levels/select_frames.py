"""Levels of detail along a camera path, frame after frame, with coherence between frames.

Two things keep levels from flickering. Hysteresis lowers the benefit of a change of level (`benefit.hysteresis_factor`)
and costs at most its strength of the value. Slack spends a share of the certified bound on what any choice could be
worth: all levels of the frame before are kept, and levels chosen for the objects that have come into view alone, if
that fits the budget and is worth 1 - slack of the bound; else strong hysteresis is tried, and taken on the same terms.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...data.errors import InputError
from ...kernels.select import launch_select
from .benefit import Candidates, Sightings, hysteresis_factor

# Hysteresis that slack is spent on, strongest first.
STRONG = (0.95, 0.6)
# More than the sum of a frame's benefits is rounded by.
ROUNDING = 2.0**-40
# benefits (1, levels), costs, starts, budget, level of each object in the last frame or -1 -> level of each object.
Chooser = Callable[[np.ndarray, np.ndarray, np.ndarray, int, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Coherence:
    """How much a level resists change.

    Attributes:
        hysteresis: strength, in [0, 1).
        slack: share of the certified bound that may be lost for keeping all levels, in [0, 1); 0 keeps none.
    """

    hysteresis: float = 0.0
    slack: float = 0.0


@dataclass(frozen=True)
class PathChoice:
    """What was chosen along a path.

    Attributes:
        chosen: candidate of each sighting of the frames that were asked for, shape (n,), int64; -1 for a sighting whose
            object was dropped.
        frames: that were asked for, shape (m,), int64.
        value: benefit without hysteresis, shape (m,), float64.
        cost: [ns], shape (m,), int64.
        switches: objects of both this frame and the one before whose tuple changed, shape (m,), int64.
        shown: objects in the frame, shape (m,), int64.
        kept: frames in which all levels of the frame before were kept, shape (m,), bool.
        dropped: objects that must be drawn and did not fit, shape (m,), int64.
        seconds: taken by choosing, shape (m,), float64.
    """

    chosen: np.ndarray
    frames: np.ndarray
    value: np.ndarray
    cost: np.ndarray
    switches: np.ndarray
    shown: np.ndarray
    kept: np.ndarray
    dropped: np.ndarray
    seconds: np.ndarray


@dataclass(frozen=True)
class Frame:
    """Problem of one frame.

    Attributes:
        sightings: numbers of its sightings, shape (g,).
        objects: their object ids, shape (g,).
        candidates: numbers of the tuples, shape (k,).
        starts: tuples of sighting s are starts[s] : starts[s + 1], shape (g + 1,).
    """

    sightings: np.ndarray
    objects: np.ndarray
    candidates: np.ndarray
    starts: np.ndarray

    def only(self, keep: np.ndarray) -> "Frame":
        """The problem with some of the tuples, shape (k,), bool; sightings without any leave it."""
        sizes = np.add.reduceat(keep, self.starts[:-1]) if len(self.sightings) else np.zeros(0, int)
        left = sizes > 0
        starts = np.append(0, np.cumsum(sizes[left]))
        return Frame(self.sightings[left], self.objects[left], self.candidates[keep], starts)


def frame_problem(sightings: Sightings, candidates: Candidates, frame: int) -> Frame:
    """Sightings and tuples of one frame."""
    first, last = sightings.starts[frame : frame + 2]
    begin, end = candidates.starts[first], candidates.starts[last]
    own = np.arange(first, last)
    return Frame(own, sightings.object_id[own], np.arange(begin, end), candidates.starts[first : last + 1] - begin)


def fitting(frame: Frame, benefit: np.ndarray, cost: np.ndarray, budget: int) -> tuple[Frame, int]:
    """The problem without what must be drawn and cannot be, and how many objects that is.

    Objects go in order of the benefit for a unit of cost of their cheapest tuple, least first, of equals the later.
    """
    if not len(frame.sightings):
        return frame, 0
    costs = cost[frame.candidates]
    owners = np.repeat(np.arange(len(frame.sightings)), np.diff(frame.starts))
    cheapest = frame.candidates[np.lexsort((-benefit[frame.candidates], costs, owners))[frame.starts[:-1]]]
    over = int(cost[cheapest].sum()) - budget
    if over <= 0:
        return frame, 0
    must = np.flatnonzero(cost[cheapest] > 0)
    worth = benefit[cheapest[must]] / cost[cheapest[must]]
    order = must[np.lexsort((-must, worth))]
    gone = order[: int(np.searchsorted(np.cumsum(cost[cheapest[order]]), over)) + 1]
    keep = ~np.isin(owners, gone)
    return frame.only(keep), len(gone)


def select_frames(
    sightings: Sightings,
    candidates: Candidates,
    cost: np.ndarray,
    budget: int,
    choose: Chooser,
    coherence: Coherence,
    frames: np.ndarray | None = None,
    progress: Callable[[], None] = lambda: None,
) -> PathChoice:
    """Choose the tuples of one frame after the other.

    Args:
        sightings: objects of the frames.
        candidates: their tuples.
        cost: of each candidate [ns], shape (k,), int64, >= 0.
        budget: of each frame [ns], >= 0.
        choose: solves one frame.
        coherence: how much levels resist change.
        frames: ascending; all by default. Others are passed over, and the frame before is the last one asked for.
        progress: called after each frame.

    Raises:
        InputError: a strength or slack out of its range, or as `launch_select`.
    """
    keeper = LevelKeeper(int(sightings.object_id.max(initial=-1)) + 1, choose, coherence)
    frames = np.arange(len(sightings.starts) - 1) if frames is None else np.asarray(frames)
    chosen, rows = np.full(len(sightings.object_id), -1), []
    for at in frames:
        whole = frame_problem(sightings, candidates, int(at))
        begun = time.perf_counter()
        found = keeper.choose(whole, candidates, cost, budget)
        spent = time.perf_counter() - begun
        chosen[found.sightings] = found.picked
        total = candidates.benefit[found.picked].sum(), cost[found.picked].sum()
        rows.append((*total, found.switches, len(whole.objects), found.kept, found.dropped, spent))
        progress()
    value, costs, switches, shown, kept, dropped, seconds = (
        np.array(column, kind)
        for column, kind in zip(
            zip(*rows, strict=True) if rows else [()] * 7, (float, int, int, int, bool, int, float), strict=True
        )
    )
    return PathChoice(chosen, frames, value, costs, switches, shown, kept, dropped, seconds)


@dataclass(frozen=True)
class FrameChoice:
    """What was chosen for one frame.

    Attributes:
        sightings: numbers of those that are drawn, shape (g,).
        picked: candidate of each, shape (g,), int64.
        switches: objects of both this frame and the one before whose tuple changed.
        kept: whether all levels of the frame before were kept.
        dropped: objects that must be drawn and did not fit.
    """

    sightings: np.ndarray
    picked: np.ndarray
    switches: int
    kept: bool
    dropped: int


class LevelKeeper:
    """Chooses levels for one frame after another, and knows those of the frame before."""

    def __init__(self, objects: int, choose: Chooser, coherence: Coherence) -> None:
        """For so many objects.

        Raises:
            InputError: a strength or slack out of its range.
        """
        if not (0 <= coherence.hysteresis < 1 and 0 <= coherence.slack < 1):
            raise InputError(f"coherence: expected hysteresis and slack from 0, below 1; found {coherence}")
        self._choose, self._coherence = choose, coherence
        # Rank of each object's tuple in the last frame.
        self._last = np.full(objects, -1)

    def choose(self, whole: Frame, candidates: Candidates, cost: np.ndarray, budget: int) -> FrameChoice:
        """The next frame; arguments as of `select_frames`.

        Raises:
            InputError: as `launch_select`.
        """
        problem, dropped = fitting(whole, candidates.benefit, cost, budget)
        picked, kept = _choose(problem, candidates, cost, budget, self._choose, self._coherence, self._last)
        rank, last = candidates.rank[picked], self._last
        changed = (last[problem.objects] >= 0) & (last[problem.objects] != rank)
        # What leaves the view and comes back is free to come back as anything.
        last[:] = -1
        last[problem.objects] = rank
        return FrameChoice(problem.sightings, picked, int(changed.sum()), kept, dropped)


def _choose(
    problem: Frame,
    candidates: Candidates,
    cost: np.ndarray,
    budget: int,
    choose: Chooser,
    coherence: Coherence,
    last: np.ndarray,
) -> tuple[np.ndarray, bool]:
    """Candidate of each sighting, and whether all levels of the frame before were kept."""
    if not len(problem.sightings):
        return np.zeros(0, np.int64), False
    if coherence.slack > 0 and (last[problem.objects] >= 0).any():
        enough = (1 - coherence.slack) * certified_bound(problem, candidates, cost, budget)
        # A level that may not be chosen any more cannot be kept.
        place = _place(candidates.rank[problem.candidates], problem.starts, last[problem.objects])
        before = np.repeat(np.where(place >= 0, last[problem.objects], -1), np.diff(problem.starts))
        tight = problem.only((before < 0) | (candidates.rank[problem.candidates] == before))
        if np.minimum.reduceat(cost[tight.candidates], tight.starts[:-1]).sum() <= budget:
            picked = _solve(tight, candidates, cost, budget, choose, 0.0, last)
            if candidates.benefit[picked].sum() >= enough:
                return picked, True
        for strength in STRONG:
            picked = _solve(problem, candidates, cost, budget, choose, strength, last)
            if candidates.benefit[picked].sum() >= enough:
                return picked, False
    return _solve(problem, candidates, cost, budget, choose, coherence.hysteresis, last), False


def certified_bound(problem: Frame, candidates: Candidates, cost: np.ndarray, budget: int) -> float:
    """No choice within the budget is worth more; see `kernels.select`."""
    if not len(problem.sightings):
        return 0.0
    ids = problem.candidates
    benefit = candidates.benefit[ids]
    best = best_of_all(benefit, cost[ids], problem.starts, budget)
    if best is not None:
        return float(benefit[problem.starts[:-1] + best].sum() * (1 + ROUNDING))
    return float(launch_select(benefit[None], cost[ids], problem.starts, budget).bound[0])


def best_of_all(benefit: np.ndarray, cost: np.ndarray, starts: np.ndarray, budget: int) -> np.ndarray | None:
    """The most beneficial level of each object, of equals the cheapest, then the first; None if they do not all fit.

    Args:
        benefit: of each level, shape (levels,), float64.
        cost: of each level, int64.
        starts: levels of object g are starts[g] : starts[g + 1], at least one.
        budget: that all may cost.

    Returns:
        Place of each among its object's levels, shape (objects,), int64: the optimum, for no choice is worth more.
    """
    owners = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    best = np.lexsort((cost, -benefit, owners))[starts[:-1]]
    return best - starts[:-1] if cost[best].sum() <= budget else None


def _solve(
    problem: Frame,
    candidates: Candidates,
    cost: np.ndarray,
    budget: int,
    choose: Chooser,
    strength: float,
    last: np.ndarray,
) -> np.ndarray:
    """Candidate of each sighting, with hysteresis."""
    ids, sizes = problem.candidates, np.diff(problem.starts)
    before = last[problem.objects]
    counts = np.diff(candidates.starts)[problem.sightings]
    factor = hysteresis_factor(candidates.rank[ids], *(np.repeat(x, sizes) for x in (before, counts)), strength)
    previous = _place(candidates.rank[ids], problem.starts, before)
    level = choose((candidates.benefit[ids] * factor)[None], cost[ids], problem.starts, budget, previous)
    return ids[problem.starts[:-1] + level]


def _place(rank: np.ndarray, starts: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Where each sighting's tuple of the last frame stands among those left; -1 where it does not."""
    owner = np.repeat(np.arange(len(before)), np.diff(starts))
    same = np.flatnonzero(rank == before[owner])
    place = np.full(len(before), -1)
    place[owner[same]] = same - starts[owner[same]]
    return place
