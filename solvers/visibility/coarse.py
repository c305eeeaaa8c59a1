"""What view cells may see at worst, soon: whole nodes of the hierarchy of objects, then boxes of objects, then pieces.

Each step asks only about what the one before has left, and takes several times as long. Occluders alone hide here, and
nothing is shot at; what is hidden is hidden, exactly. Most levels of the hierarchy are passed over: of the nodes that
their parents leave few are hidden, and those that hide their halves as well.
"""

from dataclasses import replace

import numpy as np

from ...data.plans import NO_PLANS
from ...data.ragged import places_of
from ...data.rows import Rows
from .occluders import OccluderModel, boxes_left, pieces_left
from .search import open_pieces

# Level of the hierarchy whose nodes are asked about first, and how many levels further the next one is at least.
LEVEL, STEP = 6, 3
# Steps about pieces, beside levels: by strong rectangles, and by everything.
STRONGLY, WHOLLY = -1, -2


def left_by_nodes(model: OccluderModel, cells: np.ndarray, group: np.ndarray) -> Rows:
    """Every object in a node of one level that occluders do not hide from the box around each group of view cells.

    Args:
        model: occluders and occludees.
        cells: view cells, shape (n,), int.
        group: of each, from 0 up, none empty, shape (n,), int.

    Returns:
        Pairs of every cell and what its group may see, without witnesses, ordered.
    """
    count, order = int(group.max(initial=-1)) + 1, np.argsort(group, kind="stable")
    starts = np.searchsorted(group[order], np.arange(count + 1))
    around, source = model, cells[order[starts[:-1]]]
    if count < len(cells):
        boxes = model.cells[cells[order]]
        low, high = (least.reduceat(boxes[:, side], starts[:-1]) for side, least in ((0, np.minimum), (1, np.maximum)))
        # Nothing is shot from these boxes, so no solid has to be told from the eyes in them.
        sights = replace(model.sights, cells=np.stack([low, high], axis=1), plans=NO_PLANS)
        around, source = replace(model, sights=sights, frames=()), np.arange(count)
    levels, objects = model.occludees.levels, model.occludees.objects
    level = min(LEVEL, len(levels) - 1)
    present = np.flatnonzero((levels[level][:, 0] <= levels[level][:, 1]).all(axis=1))
    which, node = np.repeat(np.arange(count), len(present)), np.tile(present, count)
    left = boxes_left(around, source[which], levels[level][node])
    # All that is below the nodes, for all cells of the groups.
    below = objects.reshape(2**level, -1)
    which, target = np.repeat(which[left], below.shape[1]), below[node[left]].ravel()
    which, target = which[target >= 0], target[target >= 0]
    sizes = np.diff(starts)[which]
    members = order[places_of(starts[which], sizes)]
    return Rows.unseen(cells[members], np.repeat(target, sizes)).order()


def steps_below(model: OccluderModel) -> list[int]:
    """What is asked about then: levels of the hierarchy, the last of which is that of objects, and pieces."""
    depth = len(model.occludees.levels) - 1
    return [*range(LEVEL + STEP, depth - STEP, STEP), depth, STRONGLY, WHOLLY]


def narrowed(rough: OccluderModel, model: OccluderModel, rows: Rows, step: int) -> Rows:
    """Pairs of view cells and objects that occluders do not hide at one step; seen ones stay.

    Args:
        rough: strong occluders, which all steps but the last use.
        model: all occluders.
        rows: pairs that may be seen.
        step: place in `steps_below`.
    """
    left, level = rows.seen, steps_below(model)[step]
    todo = np.flatnonzero(~left)
    if level == WHOLLY:
        left[pieces_left(model, rows)] = True
    elif level == STRONGLY:
        left[todo] = _some_piece(rough, rows.source[todo], rows.target[todo])
    else:
        left[todo] = _at_level(rough, rows.source[todo], rows.target[todo], level)
    return rows.take(left)


def _some_piece(model: OccluderModel, source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Pairs of whose object few lines do not hide some piece, shape (n,), bool."""

    def prove(at: np.ndarray, piece: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        left = np.flatnonzero(boxes_left(model, source[at], model.occludees.pieces[piece]))
        return left, np.zeros((len(left), 2, 3))

    starts, left = model.occludees.starts, np.zeros(len(source), bool)
    left[open_pieces(starts[target], starts[target + 1], prove, enough=1)[0]] = True
    return left


def _at_level(model: OccluderModel, source: np.ndarray, target: np.ndarray, level: int) -> np.ndarray:
    """Pairs whose node of a level occluders do not hide, shape (n,), bool."""
    levels, objects = model.occludees.levels, model.occludees.objects
    places = np.full(len(model.occludees.bounds), -1)
    leaves = np.flatnonzero(objects >= 0)
    places[objects[leaves]] = leaves >> (len(levels) - 1 - level)
    node, count = places[target], len(levels[level])
    # An object without triangles is in no node, and is not seen.
    present = np.flatnonzero(node >= 0)
    asked, which = np.unique(source[present] * count + node[present], return_inverse=True)
    cell, node = np.divmod(asked, count)
    left = np.zeros(len(source), bool)
    left[present] = boxes_left(model, cell, levels[level][node])[which]
    return left
