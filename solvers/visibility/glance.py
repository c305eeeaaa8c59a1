"""What a glance from view cells shows: rays in all directions, or a few at each object; what they meet first is seen.

The quickest way to know much of what is seen, before anything is proved. Points and directions are those of
one even sequence, shifted at random for each view cell, so they depend on nothing but the cell. Source of the sequence:
Roberts 2018, "The unreasonable effectiveness of quasirandom sequences".
"""

import numpy as np

from ...data.rows import Rows
from .aim import Sights, middles, seeds
from .engine import unknown_rows
from .first_hits import cut_short, first_of_each
from .search import on_witness_grid

# Rays per view cell in one look, and at each object in the one glance that aims, which comes second.
RAYS, AIMED, SECOND = 256, 4, 1
# Steps of the sequence in three dimensions of the eye and two of its direction: powers of the root of x**6 = x + 1.
STEPS = (1.0 / 1.1347241384015194) ** np.arange(1, 6)
# Eyes keep off the faces of their cell by this share of its size.
RIM = 1.0 / 64.0


def glance(sights: Sights, cells: np.ndarray, number: int) -> Rows:
    """Objects that some view cells see, each with a witness; more with each glance.

    Args:
        sights: the model and the view cells.
        cells: view cells to look from, shape (n,), int.
        number: of the glance: the second aims at every object, the others look around, each by other rays.

    Returns:
        Seen pairs only, ordered.
    """
    if number != SECOND:
        return look_around(sights, cells, number)
    rows = unknown_rows(np.sort(cells), len(sights.ranges))
    home = sights.cells[rows.source]
    sights.aim(rows, np.arange(len(rows)), home, middles(home, home), rows.target, AIMED, 0)
    return rows.take(rows.seen)


def look_around(sights: Sights, cells: np.ndarray, number: int) -> Rows:
    """Objects that rays in all directions show; as `glance`."""
    cell = np.repeat(cells, RAYS)
    place = np.tile(number * RAYS + np.arange(RAYS), len(cells))
    shift = np.column_stack([seeds(sights.seed, cell, np.full(len(cell), stream)) for stream in range(5)]) * 0.5**31
    share = (shift + (place[:, None] + 1) * STEPS) % 1.0
    box = sights.cells[cell].astype(float)
    origin = on_witness_grid(box[:, 0] + (RIM + (1 - 2 * RIM) * share[:, :3]) * (box[:, 1] - box[:, 0]))
    height, angle = 2 * share[:, 3] - 1, 2 * np.pi * share[:, 4]
    level = np.sqrt(1 - height * height)
    low, high = sights.model.scene.bounds()
    # Twice across the model leads out of it from everywhere that a view cell is likely to be.
    way = np.column_stack([level * np.cos(angle), level * np.sin(angle), height]) * 2 * np.linalg.norm(high - low)
    triangle = sights.finder.first(origin, origin + way)
    hit = np.flatnonzero(triangle >= 0)
    count = len(sights.ranges)
    key = cell[hit] * count + sights.finder.owners[triangle[hit]]
    key, triangle, origin, end = first_of_each(key, triangle, origin, origin + way, hit)
    met, end = cut_short(sights.finder.triangles[triangle], origin, end)
    rows = Rows.unseen(*np.divmod(key[met], count))
    sights.serve(rows, np.arange(len(rows)), triangle[met], origin[met], end[met])
    return rows.take(rows.seen).once()
