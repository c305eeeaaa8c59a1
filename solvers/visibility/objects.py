"""Cell-to-object visibility of blocks of source cells.

An object is potentially visible if some cell that is not hidden holds a part of it whose box, clipped to that cell by
the object's triangles, a sightline can reach. Source: Funkhouser et al. 1996, section 3.2; the clipped boxes are
sharper.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...data.incidence import Incidence
from ...kernels.sightline import launch_aim
from .cells import CellRows, Model, outside, search_rounds, seeds, segments

if TYPE_CHECKING:
    from .occluders import Occlusion

# Sightlines aimed at each object before anything is proved: most visible objects fall to the first few.
FIRST_TRIES = 12
AIM_ROUNDS = (32, 128, 512)


@dataclass
class ObjectRows:
    """Reached (cell, object) pairs of a block of sources, ordered; columns as in data/store/database.py."""

    source: np.ndarray
    target: np.ndarray
    seen: np.ndarray
    origin: np.ndarray
    end: np.ndarray

    @classmethod
    def unseen(cls, source: np.ndarray, target: np.ndarray) -> "ObjectRows":
        """Pairs without a witness."""
        return cls(source, target, np.zeros(len(source), bool), *np.zeros((2, len(source), 3)))


@dataclass
class ObjectModel:
    """Where objects lie: their incidence with the cells, and each one's rows among the aim targets."""

    incidence: Incidence
    ranges: np.ndarray


def object_rows(
    model: Model, objects: ObjectModel, reached: CellRows, aim_rounds: tuple[int, ...] = AIM_ROUNDS
) -> ObjectRows:
    """Every object that is not proved hidden from the sources of `reached`.

    Returns:
        Reached pairs. A pair that is left out is hidden, exactly. A `seen` pair's witness ends on the object, starts
        outside every solid, and clears all opaque triangles but the object's own.
    """
    incidence = objects.incidence
    sizes = np.diff(incidence.starts)[reached.target]
    parts = np.repeat(incidence.starts[reached.target], sizes) + _ramp(sizes)
    part_source = np.repeat(reached.source, sizes)
    keys, pair_of = np.unique(_key(part_source, incidence.object_id[parts], len(objects.ranges)), return_inverse=True)
    source, target = np.divmod(keys, len(objects.ranges))
    rows = ObjectRows.unseen(source, target)
    cells = model.graph.cells
    everything = np.arange(len(keys))
    aim_at_objects(
        model,
        cells,
        objects.ranges,
        rows,
        everything,
        cells[source],
        cells[np.stack([source, source], axis=1)].mean(axis=2),
        target,
        FIRST_TRIES,
        0,
    )
    potential, hints, kept_parts, hint_pair = _prove(model, objects, rows, parts, part_source, pair_of)
    for number, tries in enumerate(aim_rounds):
        todo = np.flatnonzero(~rows.seen[hint_pair])
        at = kept_parts[todo]
        boxes = incidence.boxes[at]
        aim_at_objects(model, cells, objects.ranges, rows, hint_pair[todo], boxes, hints[todo], at, tries, number + 1)
    kept = np.flatnonzero(potential | rows.seen)
    return ObjectRows(source[kept], target[kept], rows.seen[kept], rows.origin[kept], rows.end[kept])


def _key(source: np.ndarray, target: np.ndarray, count: int) -> np.ndarray:
    return source.astype(np.int64) * count + target


def _ramp(sizes: np.ndarray) -> np.ndarray:
    """0, 1, ..., n - 1 for each size n, concatenated."""
    ends = np.cumsum(sizes)
    return np.arange(ends[-1] if len(ends) else 0) - np.repeat(ends - sizes, sizes)


def _prove(
    model: Model,
    objects: ObjectModel,
    rows: ObjectRows,
    parts: np.ndarray,
    part_source: np.ndarray,
    pair_of: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Try to hide every part of the pairs that are not seen.

    Returns:
        Which pairs stay potential, bool; and for every part that could not be hidden the ends of a line to it, shape
        (n, 2, 3), its row in the incidence, and its pair.
    """
    incidence, cells = objects.incidence, model.graph.cells
    todo = np.flatnonzero(~rows.seen[pair_of])
    own = incidence.cell[parts[todo]] == part_source[todo]
    potential = np.zeros(len(rows.source), bool)
    potential[pair_of[todo[own]]] = True
    kept_own = todo[own]
    todo = todo[~own]
    todo = todo[~potential[pair_of[todo]]]
    boxes = np.concatenate([cells, incidence.boxes[parts[todo]]])
    work = np.column_stack([part_source[todo], len(cells) + np.arange(len(todo)), np.ones(len(todo), int)])
    answers = search_rounds(model, boxes, work)
    open_rows = np.flatnonzero(answers.verdict != 0)
    potential[pair_of[todo[open_rows]]] = True
    kept = np.concatenate([kept_own, todo[open_rows]])
    hints = np.stack([cells[part_source[kept]].mean(axis=1), incidence.boxes[parts[kept]].mean(axis=1)], axis=1)
    lined = np.flatnonzero(answers.verdict[open_rows] == 1)
    at = todo[open_rows[lined]]
    ends = segments(answers, open_rows[lined], cells[part_source[at]], incidence.boxes[parts[at]])
    hints[len(kept_own) + lined] = np.stack(ends, axis=1)
    return potential, hints, parts[kept], pair_of[kept]


def aim_at_objects(
    model: "Model | Occlusion",
    cells: np.ndarray,
    ranges: np.ndarray,
    rows: ObjectRows,
    pairs: np.ndarray,
    boxes: np.ndarray,
    hints: np.ndarray,
    streams: np.ndarray,
    tries: int,
    number: int,
) -> None:
    """Shoot at the objects of the pairs; fills seen, origin and end in place.

    Args:
        model: triangles, targets and solids, and how to launch.
        cells: that the pairs' sources number [grid steps], shape (cells, 2, 3), int32.
        ranges: first and past-the-last target of each object, shape (objects, 2).
        rows: all pairs.
        pairs: pair of each attempt; a pair may be attempted through several boxes.
        boxes: aim at the part of the object inside this box; ignored in round 0.
        hints: ends of a line that the axial model allows [grid steps], shape (n, 2, 3).
        streams: what tells the random streams of one source apart, shape (n,), int.
        tries: sightlines an attempt.
        number: of the round.
    """
    if not len(pairs):
        return
    source, target = rows.source[pairs], rows.target[pairs]
    found, origin, end = launch_aim(
        model.triangles,
        model.targets,
        cells[source],
        boxes,
        hints,
        target,
        ranges[target],
        seeds(model.seed + 101 * (number + 1), source, streams),
        np.full(len(pairs), number > 0),
        tries=tries,
        boxed=number > 0,
        threads=model.threads,
        device=model.device,
    )
    good = np.flatnonzero(found)
    good = good[outside(model, source[good], origin[good], np.ones(len(good), bool))]
    rows.seen[pairs[good]] = True
    rows.origin[pairs[good]], rows.end[pairs[good]] = origin[good], end[good]
