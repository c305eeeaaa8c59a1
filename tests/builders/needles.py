"""Three slits of one grid step whose common lines leave a share j/q of a step, none, or miss by that: q near 2**24.

Lines through the slits y in (0, 1) at x = 0 and y in (p, p + 1) at x = q cross x = m at y in (t + j/q, t + 1 + j/q),
where p m = t q + j. So a third slit there, one step high, is met along j/q of it, touched, or missed by j/q.
"""

from dataclasses import dataclass
from math import gcd

import numpy as np
from viewcell.data.graph import CellGraph

LIMIT = 2**24
# Height of the slits along z.
HIGH = 4096


@dataclass
class Needle:
    """Slits as flat boxes in the order of x, shape (3, 2, 3), and whether an open set of lines passes them all."""

    slits: np.ndarray
    opens: bool


def needle(rng: np.random.Generator) -> Needle:
    # Now and then of as many steps, which leaves room for more directions.
    step = int(rng.choice([1, 1, 1, 2**8, 2**14]))
    most = LIMIT // step - 8
    q = int(rng.integers(most // 4, most))
    p = int(rng.integers(q // 8, most))
    if gcd(p, q) > 1:
        return needle(rng)
    j = int(rng.choice([0, 1, 1, 2, 5, 1000, q // 9, q // 2]))
    m = j * pow(p, -1, q) % q if j else 0
    if not j:
        # The first and the last slit alone meet no lattice point between; touch at a corner of a third one instead.
        p, q, m = 2 * (p // 2), 2 * (q // 2), q // 2
    t = p * m // q
    if not 0 < m < q:
        return needle(rng)
    kind = "met" if rng.random() < 0.6 else "missed"
    low = t + 1 if kind == "met" else t - 1
    places = [(0, 0), (m, low), (q, p)]
    middle = np.array([q // 2, p // 2])
    slits = [[[x, y, -HIGH], [x, y + step, HIGH]] for x, y in (step * (np.array(places) - middle)).tolist()]
    return Needle(np.array(slits), kind == "met" and j > 0)


def turned(rng: np.random.Generator, *groups: np.ndarray) -> list[np.ndarray]:
    """Boxes with axes permuted and mirrored, the same way for all groups."""
    order, signs = rng.permutation(3), rng.choice([-1, 1], 3)
    return [np.sort(group[..., order] * signs, axis=-2) for group in groups]


def ends(found: Needle) -> np.ndarray:
    """A box before the first slit and one behind the last one, as wide as the grid."""
    first, last = int(found.slits[0, 0, 0]), int(found.slits[-1, 0, 0])
    wide = [[-LIMIT, -LIMIT, -HIGH], [LIMIT, LIMIT, HIGH]]
    before, behind = np.array(wide), np.array(wide)
    before[:, 0], behind[:, 0] = (-LIMIT, first), (last, LIMIT)
    return np.stack([before, behind])


def graph_of(rng: np.random.Generator, found: Needle) -> CellGraph:
    """Slabs of the whole grid between the planes of the slits, which are their portals; turned at random."""
    before, behind = ends(found)
    planes = found.slits[:, 0, 0]
    cells = np.repeat(before[None], len(planes) + 1, axis=0)
    cells[1:, 0, 0], cells[:-1, 1, 0], cells[-1] = planes, planes, behind
    cells, slits = turned(rng, cells, found.slits)
    axis = int((slits[0, 0] == slits[0, 1]).argmax())
    pairs = np.stack([np.arange(len(planes)), np.arange(1, len(planes) + 1)], axis=1)
    if cells[0, 0, axis] > cells[-1, 0, axis]:
        pairs = pairs[:, ::-1]
    count, names = len(cells), np.full(len(cells), "", object)
    axes = np.full(len(planes), axis, np.int8)
    return CellGraph(
        cells.astype(np.int32), np.ones(count, bool), names, pairs.astype(np.int32), axes, slits.astype(np.int32)
    )


def walls_of(found: Needle) -> np.ndarray:
    """What leaves the slits open in their planes, shape (6, 2, 3)."""
    walls = []
    for (x, low, _), (_, high, _) in found.slits.tolist():
        walls += [[[x, -LIMIT, -LIMIT], [x, low, LIMIT]], [[x, high, -LIMIT], [x, LIMIT, LIMIT]]]
    return np.array(walls)
