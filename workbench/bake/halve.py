"""Halving view cells that keep far more than any eye in them sees, such as long corridors, before they are baked.

What a cell keeps is not known before; the union of what random eyes in it see is a lower bound that says where halving
pays: a half keeps about what its own eyes see.
"""

import heapq
from dataclasses import dataclass

import numpy as np

from ...data.prepared import PreparedModel
from ...data.solids import SolidIndex
from ...verify.rays.eyes import Sight, draw_eyes

# A half is no narrower than this, and at most so many cells are added for each inhabitable one.
SMALLEST_M, MOST = 1.0, 0.5
# Halving must take this share off what a cell's eyes see together.
GAIN = 0.1
# Eyes in a cell, even rays around each, and rays at what they see.
EYES, AROUND, RAYS = 32, 512, 30_000


@dataclass(frozen=True)
class _Look:
    """A box, what eyes in it see, and what halving it would bring.

    Attributes:
        box: [grid steps], shape (2, 3).
        parent: cell that holds it.
        objects: that any of the eyes sees, ascending.
        ratio: their number over what one eye sees on average.
        axis: to halve it across; -1 where that brings too little.
        gain: objects that a half sees less, times the volume [cubic grid steps].
    """

    box: np.ndarray
    parent: int
    objects: np.ndarray
    ratio: float
    axis: int
    gain: float


def halved(
    model: PreparedModel, cells: np.ndarray, sources: np.ndarray, ratio: float, seed: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Cells of which those are halved, again and again, in which eyes see far more together than one of them does.

    Where that takes most objects off most volume comes first; at most half as many cells are added as are inhabitable.

    Args:
        model: the model.
        cells: [grid steps], shape (n, 2, 3), int32.
        sources: which are inhabitable; no others are halved; shape (n,), bool.
        ratio: of what eyes see together to what one sees, from which on a cell is halved.
        seed: of eyes and rays.

    Returns:
        Cells, shape (m, 2, 3), int32, in the order of the given ones, which they tile, and the given one that holds
        each, shape (m,), int.
    """
    rng, sight = np.random.default_rng(seed), Sight(model.scene)
    wanted = np.flatnonzero(sources)
    looker = _Looker(sight, SolidIndex(cells[wanted], model.closed), {int(c): k for k, c in enumerate(wanted)}, rng)
    smallest = SMALLEST_M / model.scene.grid_m
    leaves: dict[int, list[np.ndarray]] = {cell: [] for cell in range(len(cells))}
    queue: list[tuple[float, int, _Look]] = []
    count = 0

    def add(look: _Look) -> None:
        nonlocal count
        if look.axis >= 0 and look.ratio > ratio:
            # The counter keeps equal gains in order.
            heapq.heappush(queue, (-look.gain, count, look))
            count += 1
        else:
            leaves[look.parent].append(look.box)

    for cell in range(len(cells)):
        if sources[cell]:
            add(looker.look(cells[cell], cell, None, smallest))
        else:
            leaves[cell].append(cells[cell])
    left = int(MOST * len(wanted))
    while queue and left > 0:
        _, _, look = heapq.heappop(queue)
        left -= 1
        for half in halves(look.box, look.axis):
            add(looker.look(half, look.parent, look.objects, smallest))
    for _, _, look in queue:
        leaves[look.parent].append(look.box)
    boxes = [box for own in leaves.values() for box in sorted(own, key=lambda box: box.ravel().tolist())]
    parents = np.repeat(np.arange(len(cells)), [len(own) for own in leaves.values()])
    return np.array(boxes, np.int32).reshape(-1, 2, 3), parents


def halves(box: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """A box (2, 3) cut in two in the middle of an axis."""
    low, high = box.copy(), box.copy()
    low[1, axis] = high[0, axis] = (int(box[0, axis]) + int(box[1, axis])) // 2
    return low, high


@dataclass(frozen=True)
class _Looker:
    """Puts eyes into boxes of known cells."""

    sight: Sight
    index: SolidIndex
    places: dict[int, int]
    rng: np.random.Generator

    def look(self, box: np.ndarray, parent: int, objects: np.ndarray | None, smallest: float) -> _Look:
        """What eyes in a box see, of the given objects or all, and what halving it brings; see `halved`."""
        eyes = draw_eyes(box, self.index, self.places[parent], EYES, self.rng)
        if objects is None:
            objects = self.sight.around(eyes, AROUND)
        marks, _ = self.sight.marks(eyes, objects, RAYS, self.rng)
        together, one = int(marks.any(axis=0).sum()), float(marks.sum(axis=1).mean()) if len(eyes) else 0.0
        gain, axis = 0.0, -1
        for number in range(3):
            side = int(box[1, number]) - int(box[0, number])
            near = eyes[:, number] < (int(box[0, number]) + int(box[1, number])) // 2
            if side < 2 * smallest or not near.any() or near.all():
                continue
            less = together - sum(int(marks[part].any(axis=0).sum()) for part in (near, ~near)) / 2
            if less > max(gain, GAIN * together):
                gain, axis = less, number
        volume = float(np.prod((box[1] - box[0]).astype(np.float64)))
        return _Look(box, parent, objects[marks.any(axis=0)], together / max(one, 1.0), axis, volume * gain)
