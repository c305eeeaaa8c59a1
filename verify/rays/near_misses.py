"""Sightlines at which a certified bake was nearly wrong, for the falsifier to look near."""

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from ...data.curtains import RISING
from ...data.graph import OTHER_AXES
from ...data.store.certificates import BLOCKERS, CORNERS, FIRST_FENCE, LEAVES, NODE_STEP, OCCLUDERS, PROOFS, TREES
from ...data.store.scene_folder import read_table
from .guide import Hints

if TYPE_CHECKING:
    from ...data.store.bake_folder import BakeFolder

# Widths by which the crossing of a shaft is tried wider [grid steps, powers of 2].
WIDTHS = 2.0 ** np.arange(14)
# Leaves of one occluder that are looked at together.
CHUNK = 1 << 12
# Places of the corners of a box, of V' (first row) and of X', in all pairs.
ENDS = np.array(list(product(range(8), repeat=2))).T
SIDES = np.array(list(product((0, 1), repeat=3)))


def certificate_hints(bake: "BakeFolder", sources: np.ndarray, count: int = 4096) -> Hints:
    """Sightlines of the leaves, and of the line trees of one blocker, that are covered with the smallest margin.

    The margin of a leaf is how far its sightlines pass from where the occluder ends. Rectangles of one region that
    overlap make it too large, and it is told to a factor of 2 for regions; a hint is only a hint.

    Args:
        bake: with certificates (data/store/certificates.py).
        sources: cell_id of each row of the claim, shape (rows,).
        count: of hints at most.

    Returns:
        For the leaves and trees of these cells, by margin: a segment between corners of the leaf's boxes V' and X', or
        of cell and hidden box, that passes near the occluder's outline.

    Raises:
        InputError: a table is missing or lacks a column.
    """
    names = (("proofs", PROOFS), ("leaves", LEAVES), ("occluders", OCCLUDERS), ("blockers", BLOCKERS))
    proofs, leaves, table, blockers = (read_table(bake.folder / f"{name}.parquet", columns) for name, columns in names)
    row_of = np.full(bake.graph.cell_count, -1)
    row_of[sources] = np.arange(len(sources))
    places = {proof: place for place, proof in enumerate(proofs["proof_id"].to_pylist())}
    cells = proofs["cell_id"].to_numpy()
    alone = _alone(bake)
    occluders = [*table.to_pylist(), *(_as_region(row) for row in blockers.to_pylist())]
    of_leaf = np.array([places[proof] for proof in leaves["proof_id"].to_pylist()], np.int64)
    of_tree = np.array([places[proof] for proof in alone], np.int64)
    rows = row_of[cells[np.concatenate([of_leaf, of_tree])]]
    boxes = np.stack([leaves[name].to_numpy() for name in LEAVES[2:]], axis=1).reshape(-1, 2, 2, 3) / bake.grid_m
    targets = np.stack([proofs[name].to_numpy() for name in CORNERS], axis=1).reshape(-1, 2, 3)[of_tree] / bake.grid_m
    boxes = np.concatenate([boxes, np.stack([bake.graph.cells[cells[of_tree]], targets], axis=1)])
    owner = np.concatenate([leaves["occluder_id"].to_numpy(), -1 - np.array(list(alone.values()), np.int64)])
    margin = np.full(len(rows), np.inf)
    origins, ends = np.zeros((2, len(rows), 3))
    order = np.argsort(owner, kind="stable")
    order = order[rows[order] >= 0]
    for occluder in occluders:
        own = order[slice(*np.searchsorted(owner[order], [occluder["occluder_id"], occluder["occluder_id"] + 1]))]
        for first in range(0, len(own), CHUNK):
            part = own[first : first + CHUNK]
            # Corners of V' and X' in all pairs, each of shape (leaves, 64, 3).
            p, q = (corners_of(boxes[part, side])[:, ENDS[side]] for side in range(2))
            found, pair = (region_margin if occluder["kind"] == "region" else patch_margin)(p, q, occluder, bake.grid_m)
            margin[part], place = found, np.arange(len(part))
            origins[part], ends[part] = p[place, pair], q[place, pair]
    best = np.argsort(margin, kind="stable")[: min(count, len(order))]
    return Hints(rows[best], origins[best], ends[best])


def _alone(bake: "BakeFolder") -> dict[int, int]:
    """Blocker by proof of the line trees that name a single one."""
    trees = read_table(bake.folder / "trees.parquet", TREES)
    # Nodes about the plan of an end name no blocker.
    last = FIRST_FENCE * NODE_STEP
    blockers = [{word // NODE_STEP for word in words if 0 <= word < last} for words in trees["words"].to_pylist()]
    proofs = trees["proof_id"].to_pylist()
    return {proof: min(named) for proof, named in zip(proofs, blockers, strict=True) if len(named) == 1}


def _as_region(row: dict) -> dict:
    """A row of blockers.parquet like one of occluders.parquet, a curtain as a patch; blocker b has the id -1 - b."""
    u0, v0, u1, v1 = rectangles = [row[name] for name in BLOCKERS[3:]]
    if row["axis"] > 2:
        low, high = row["coordinate"], row["top"]
        a, b = ((u0, v0), (u1, v1)) if row["axis"] == RISING else ((u0, v1), (u1, v0))
        corners = [*a, low, *b, low, *b, high, *a, high]
        return {"occluder_id": -1 - row["blocker_id"], "kind": "patch", "corners": corners}
    return {"occluder_id": -1 - row["blocker_id"], "kind": "region", "rectangles": rectangles} | {
        name: row[name] for name in ("axis", "coordinate")
    }


def corners_of(boxes: np.ndarray) -> np.ndarray:
    """The eight corners of boxes of shape (n, 2, 3), shape (n, 8, 3)."""
    return boxes[:, SIDES, np.arange(3)]


def region_margin(p: np.ndarray, q: np.ndarray, region: dict, grid_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Least width by which the crossings with the plane grow out of the rectangles, and a pair at their border.

    Args:
        p: [grid steps], shape (n, pairs, 3).
        q: likewise.
        region: row of occluders.parquet.
        grid_m: grid step [m].
    """
    axis, plane = region["axis"], region["coordinate"] / grid_m
    rectangles = np.array(region["rectangles"]).reshape(-1, 2, 2) / grid_m
    along = q[:, :, axis] - p[:, :, axis]
    share = (plane - p[:, :, axis]) / np.where(along == 0, 1, along)
    crossing = (p + share[:, :, None] * (q - p))[:, :, OTHER_AXES[axis]]
    low, high = crossing.min(axis=1), crossing.max(axis=1)
    margin = np.full(len(p), WIDTHS[-1] * 2)
    for width in WIDTHS[::-1]:
        wide = np.stack([low - width, high + width], axis=1)
        inner = np.minimum(wide[:, None, 1], rectangles[:, 1]) - np.maximum(wide[:, None, 0], rectangles[:, 0])
        covered = np.maximum(inner, 0).prod(axis=2).sum(axis=1)
        margin[covered < (1 - 1e-9) * (wide[:, 1] - wide[:, 0]).prod(axis=1)] = width
    # One of the four extreme crossings, in turn.
    extremes = np.concatenate([crossing.argmin(axis=1), crossing.argmax(axis=1)], axis=1)
    return margin, extremes[np.arange(len(p)), np.arange(len(p)) % 4]


def patch_margin(p: np.ndarray, q: np.ndarray, patch: dict, grid_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Least distance of the lines through pairs of corners from an edge's line, and the pair; as `region_margin`."""
    outline = np.array(patch["corners"]).reshape(-1, 3) / grid_m
    margin, pair = np.full(len(p), np.inf), np.zeros(len(p), np.int64)
    for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        across = np.cross(q - p, end - start)
        distance = np.abs(((start - p) * across).sum(axis=2)) / np.maximum(np.linalg.norm(across, axis=2), 1e-9)
        nearest = distance.argmin(axis=1)
        least = distance[np.arange(len(p)), nearest]
        pair = np.where(least < margin, nearest, pair)
        margin = np.minimum(margin, least)
    return margin, pair
