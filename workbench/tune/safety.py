"""Whether settings hide what is visible: each against the sightlines of all, and against rays."""

import numpy as np

from ...data.graph import CellGraph
from ...verify.exact.plan import inside_plans
from ...verify.rays.adjudicate import Judgement, sightline_end
from ..verify import make_caster, make_judge
from .trial import Answer

# Points and cells are compared so many pairs at a time.
PAIRS_MOST = 1 << 22


def holders(graph: CellGraph, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which points [grid steps], shape (n, 3), float64, lie strictly inside which inhabitable cells, exactly.

    Returns:
        Point and cell of each such pair, shape (m,) each, int64; ordered by point.
    """
    cells = np.flatnonzero(graph.inhabitable)
    low, high = graph.cells[cells, 0], graph.cells[cells, 1]
    found = [np.zeros((2, 0), np.int64)]
    step = max(1, PAIRS_MOST // max(1, len(cells)))
    for first in range(0, len(points), step):
        part = points[first : first + step, None]
        point, place = np.nonzero(((part > low) & (part < high)).all(axis=2))
        found.append(np.stack([point + first, cells[place]]))
    point, cell = np.concatenate(found, axis=1)
    held = inside_plans(graph.plans, cell, points[point])
    return point[held], cell[held]


def hidden_of(answer: Answer, others: list[Answer]) -> int:
    """Pairs of a view cell and an object that an answer hides, though a sightline of another one shows them.

    Every sightline starts in a view cell, outside every solid, and was confirmed against the true triangles. A view
    cell that holds its start, however the model was cut into cells, sees what it shows.
    """
    wrong = np.zeros_like(answer.potential)
    for other in others:
        rows = other.objects.take(other.objects.seen)
        row, cell = holders(answer.graph, rows.origin)
        wrong[cell, rows.target[row]] = True
    return int((wrong & ~answer.potential).sum())


def hidden_by_rays(answer: Answer, rays: int, seed: int) -> int:
    """Pairs that an answer hides, though a ray shows them: found by Embree, judged in exact arithmetic.

    Args:
        answer: of a setting.
        rays: to cast at least, evenly from all view cells.
        seed: of origins and directions.
    """
    judge = make_judge(answer)
    everything = np.ones((answer.graph.cell_count, answer.graph.cell_count), bool)
    caster, _ = make_caster(answer, judge, (everything, answer.potential), rays, seed)
    if caster is None:
        return 0
    found, wrong = caster.cast(0, -(-rays // len(caster.sources))), set()
    for number in np.flatnonzero(found.kinds == 1):
        cell, target = int(caster.sources[found.rows[number]]), int(found.targets[number])
        end = sightline_end(found, number, answer.graph.cells)
        if judge.judge("object", cell, target, found.origins[number], end) is Judgement.VISIBLE:
            wrong.add((cell, target))
    return len(wrong)
