"""Certificates of a bake: why what is absent from its tables is hidden. Tables that a checker reads.

| table | columns |
|---|---|
| proofs.parquet | proof_id, cell_id, closed, min_x ... max_z, plan: no sightline leads from the cell into this box, or into the prism in it over a plan (x, y of four corners, counter-clockwise; null for none); `closed`: nor onto its faces, which is what hides objects |
| trees.parquet | proof_id, words (list<int32>): a line tree, see below |
| blockers.parquet | blocker_id, axis, coordinate, min_u, min_v, max_u, max_v, top: rectangles that line trees name. Axis 3 and 4 are curtains: upright over the segment from (min_u, min_v) to (max_u, max_v) of the plan, or for 4 from (min_u, max_v) to (max_u, min_v), from height `coordinate` to `top` |
| leaves.parquet | proof_id, occluder_id, v_min_x ... v_max_z, x_min_x ... x_max_z: the occluder blocks all segments from box v to box x; the leaves of a proof tile (cell, box) |
| occluders.parquet | occluder_id, kind (region, patch), axis and coordinate of a region, its rectangles (list: min_u, min_v, max_u, max_v, ...), object_id of a patch, the corners of its outline (list: x, y, z, ...), and the triangles of its disc (list: places among those of the object, degenerate ones not counted) |

A proof has either a tree or leaves. Metres, as in all tables of a bake; u and v are the other two axes in ascending
order.

**Line tree.** One for each octant of directions that can lead from the cell to the box, from octant 0 to 7 (bit i is
set where direction component i is negative), each written parent first. Mirror the axes on which the direction is
negative; then every component is positive, and a line crosses the plane x_i = a at the time w_i a - xi_i, w_i > 0. A row
(i, j, a, b) says that it crosses x_i = a before x_j = b: w_i a - w_j b < xi_i - xi_j. The rows at the root: the line enters
cell and box through every axis before it leaves them through any other (a = low_i, b = high_j).

- A word >= 0 is a node: 256 blocker_id + order. The children add the rows of the ways to miss the blocker, past whose
  plane x_k = c the line comes at one point. Ways 0 to 3: beyond the side (order >> 2 way) & 3, and short of the sides
  of the ways before; side 2 (u - 1) is the low edge of axis k + u modulo 3, the next one its high edge. Way 4: the line
  enters the box before the plane through the other two axes (k + 1, then k + 2); this way exists if c > low_k of the box,
  for a closed one also if c = low_k. Way 5: it leaves the cell after the plane through the other two; if c < high_k of the
  cell.
- A node about a curtain has these ways; A is its end with the least x, B the other one, and its plan box reaches from (x, y) to
  (u, v) after mirroring, its heights from z to t. Left of A and of B: y_A before x_A, y_B before x_B. Right of both: the same
  turned round. Then right of A and left of B, and one of: under (x and y before z), over (t before u and v), in the target
  before (low_0 before v, low_1 before u, low_2 before u and v), out of the source after (y before high_0, x before high_1,
  x and y before high_2). For a curtain that rises after mirroring the same four, left of A and right of B. The last two of
  four do not exist if the target's plan lies wholly on the far side of AB (for a closed one with at most one corner on
  it), or the source's on the near side, or where a row names one axis twice and cannot hold.
- A node of blocker 2**23 - 4 + m says that the line is left (m even) or right (m odd) of the plan of the source (m < 2) or the
  target. Its ways are past one of the plan's corners on the other side, and not past those before it; corners that
  another one is always passed with do not count.
- A node of blocker 2**23 - 4100 + n is about a piece of a side of a plan: n = p + 256 (entry + 2 e), e as in a tag 5 + 8 e. With m
  the greatest power of 2 up to p + 1, the piece reaches from (p + 1 - m) / m of the side to (p + 3 - m) / m. After mirroring, a line through the
  side out of the prism (into it, with entry) has one end of the piece on its left hand, A, and one on its right, B; where
  they are off the grid A is (x up, y down) and B (x down, y up). Ways: left of A; right of A and of B; right of A, left of B,
  and out: low_2 of the prism before the piece's plan box, rounded out, is left on either axis; in: the plan box entered on both
  axes before high_2.
- A word < 0 is a leaf: -1 - tag - 2**24 n, followed by n words -1 - tag. A tag names a cycle of rows: cycle + 8 (p + 128 (q
  + 128 r)). Cycles 0 to 4 run through the axes 0 1, 1 2, 0 2, 0 1 2 and 0 2 1; p, q, r count the rows of each pair of
  axes on the way from the root. Adding the rows of a cycle leaves g . w < 0, and these cuts contradict each other: with
  weights >= 0 they add up to a g that is nowhere negative. A tag 5 + 8 e names an edge instead, from corner e of the source's
  plan or e - 4 of the target's to the next one, that parts the two plans: of its normal n towards the target (after
  mirroring) the cut says n_y w_x + n_x w_y > 0, as past that edge a sightline goes that way.
"""  # noqa: E501 (a table row is one line)

from dataclasses import dataclass, replace

import numpy as np
import pyarrow as pa

from ..blockers import Blockers
from ..curtains import RISING
from ..graph import OTHER_AXES
from ..patches import Patches
from ..ragged import starts_of
from ..rasters import decompose
from ..regions import Regions
from .graph_folder import plan_column

TABLES = ("proofs", "trees", "blockers", "leaves", "occluders")
CORNERS = ("min_x", "min_y", "min_z", "max_x", "max_y", "max_z")
PROOFS = ("proof_id", "cell_id", "closed", *CORNERS)
TREES = ("proof_id", "words")
BLOCKERS = ("blocker_id", "axis", "coordinate", "min_u", "min_v", "max_u", "max_v")
LEAVES = ("proof_id", "occluder_id", *(f"v_{name}" for name in CORNERS), *(f"x_{name}" for name in CORNERS))
OCCLUDERS = ("occluder_id", "kind", "axis", "coordinate", "rectangles", "object_id", "corners", "triangles")
# A node of a line tree holds its blocker times this.
NODE_STEP = 256
# In place of a blocker: with it begin the numbers of the four ways to miss an end's plan.
FIRST_MISS = (1 << 23) - 4
# Before them: pieces of the sides of the ends' plans, at most so many for each of 16 sides and senses.
FENCES = 256
FIRST_FENCE = FIRST_MISS - 16 * FENCES
# In place of a cycle: the cut of an edge of a plan.
PARTING = 5


@dataclass
class Proofs:
    """Certificates of what is hidden.

    Attributes:
        cell: view cell of each proof, shape (n,), int64.
        boxes: what is hidden from it, whatever lies inside [grid steps], shape (n, 2, 3), int32.
        closed: whether sightlines that end on the box's faces are hidden too, shape (n,), bool.
        plan: corners of the prisms that are meant instead of boxes, shape (n, 4, 2), int32; all 0 for none.
        word_starts: words of proof i are words[word_starts[i]:word_starts[i + 1]], shape (n + 1,), int64.
        words: of line trees, int32.
        leaf_starts: likewise of leaves.
        leaves: as ShaftAnswers.certificate, shape (leaves, 13), int32.
        seconds: spent on writing line trees down, beyond finding them.
    """

    cell: np.ndarray
    boxes: np.ndarray
    closed: np.ndarray
    word_starts: np.ndarray
    words: np.ndarray
    leaf_starts: np.ndarray
    leaves: np.ndarray
    plan: np.ndarray
    seconds: float = 0.0

    def take(self, chosen: np.ndarray) -> "Proofs":
        """Some of them; `chosen` is bool."""
        sizes, leaves = np.diff(self.word_starts), np.diff(self.leaf_starts)
        return Proofs(
            self.cell[chosen],
            self.boxes[chosen],
            self.closed[chosen],
            starts_of(sizes[chosen]),
            self.words[np.repeat(chosen, sizes)],
            starts_of(leaves[chosen]),
            self.leaves[np.repeat(chosen, leaves)],
            self.plan[chosen],
            self.seconds,
        )

    def relabelled(self, places: np.ndarray) -> "Proofs":
        """The same with cell c called places[c], without those of cells whose place is -1."""
        kept = self.take(places[self.cell] >= 0)
        return replace(kept, cell=places[kept.cell])


def join_proofs(parts: list[Proofs]) -> Proofs:
    """All of some proofs, in order."""
    parts = [NO_PROOFS, *parts]
    return Proofs(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in ("cell", "boxes", "closed")),
        starts_of(np.concatenate([np.diff(part.word_starts) for part in parts])),
        np.concatenate([part.words for part in parts]),
        starts_of(np.concatenate([np.diff(part.leaf_starts) for part in parts])),
        np.concatenate([part.leaves for part in parts]),
        np.concatenate([part.plan for part in parts]),
        sum(part.seconds for part in parts),
    )


NO_PROOFS = Proofs(
    np.zeros(0, np.int64),
    np.zeros((0, 2, 3), np.int32),
    np.zeros(0, bool),
    np.zeros(1, np.int64),
    np.zeros(0, np.int32),
    np.zeros(1, np.int64),
    np.zeros((0, 13), np.int32),
    np.zeros((0, 4, 2), np.int32),
)


def certificate_tables(
    proofs: Proofs, blockers: Blockers, regions: Regions | None, patches: Patches | None, grid_m: float
) -> dict[str, pa.Table]:
    """Tables of proofs, by name.

    Args:
        proofs: trees name blockers; leaves name occluder r, a region, or -1 - p, a patch.
        blockers: that were searched.
        regions: of the model; None for a bare graph, whose proofs have no leaves.
        patches: of the model, likewise.
        grid_m: grid step [m].
    """
    ids = np.arange(len(proofs.cell), dtype=np.int32)
    corners = proofs.boxes.reshape(-1, 6) * grid_m
    columns = {"proof_id": ids, "cell_id": proofs.cell.astype(np.int32), "closed": proofs.closed}
    columns |= {name: corners[:, i] for i, name in enumerate(CORNERS)}
    if proofs.plan.any():
        columns["plan"] = plan_column(proofs.plan, proofs.plan.any(axis=(1, 2)), grid_m)
    sizes = np.diff(proofs.word_starts)
    words = pa.ListArray.from_arrays(pa.array(starts_of(sizes[sizes > 0]).astype(np.int32)), pa.array(proofs.words))
    nodes = proofs.words[proofs.words >= 0]
    owner = np.repeat(ids, np.diff(proofs.leaf_starts))
    return {
        "proofs": pa.table(columns),
        "trees": pa.table({"proof_id": ids[sizes > 0], "words": words}),
        "blockers": _blockers_table(np.unique(nodes // NODE_STEP), blockers, grid_m),
        **_leaf_tables(owner, proofs.leaves, regions, patches, grid_m),
    }


def _blockers_table(used: np.ndarray, blockers: Blockers, grid_m: float) -> pa.Table:
    used = used[used < len(blockers.axis)]
    kind = blockers.axis[used]
    axis = np.where(kind >= RISING, 2, kind)
    uv = OTHER_AXES[axis] if len(used) else np.zeros((0, 2), int)
    rows = np.arange(len(used))
    boxes = blockers.boxes[used] * grid_m
    values = [boxes[rows, 0, axis], *(boxes[rows, side, uv[:, c]] for side in (0, 1) for c in (0, 1))]
    columns = {"blocker_id": used.astype(np.int32), "axis": kind.astype(np.int8)}
    columns |= dict(zip(BLOCKERS[2:], values, strict=True))
    if (kind >= RISING).any():
        columns["top"] = boxes[rows, 1, axis]
    return pa.table(columns)


def _leaf_tables(
    owner: np.ndarray, leaves: np.ndarray, regions: Regions | None, patches: Patches | None, grid_m: float
) -> dict[str, pa.Table]:
    count = 0 if regions is None else len(regions.axis)
    occluder = np.where(leaves[:, 0] >= 0, leaves[:, 0], count - 1 - leaves[:, 0]).astype(np.int32)
    parts = {"proof_id": owner, "occluder_id": occluder}
    parts |= {name: leaves[:, 1 + i] * grid_m for i, name in enumerate(LEAVES[2:])}
    used = np.unique(occluder)
    rows = [
        _region_row(regions, int(k), grid_m) if k < count else _patch_row(patches, int(k) - count, grid_m) for k in used
    ]
    metres, places = pa.list_(pa.float64()), pa.list_(pa.int32())
    types = [pa.string(), pa.int8(), pa.float64(), metres, pa.int32(), metres, places]
    occluders = {"occluder_id": pa.array(used)}
    for i, (name, kind) in enumerate(zip(OCCLUDERS[1:], types, strict=True)):
        occluders[name] = pa.array([row[i] for row in rows], kind)
    return {"leaves": pa.table(parts), "occluders": pa.table(occluders)}


def _region_row(regions: Regions, region: int, grid_m: float) -> tuple:
    (u0, v0, t0), (u1, v1, t1) = regions.places[region], regions.places[region + 1]
    us, vs = regions.u[u0:u1], regions.v[v0:v1]
    before = regions.open_before[t0:t1].reshape(len(us), len(vs))
    uncovered = before[1:, 1:] - before[:-1, 1:] - before[1:, :-1] + before[:-1, :-1]
    rectangles = decompose(uncovered == 0, us, vs) * grid_m
    axis, coordinate = int(regions.axis[region]), float(regions.plane[region] * grid_m)
    return "region", axis, coordinate, rectangles.ravel(), None, None, None


def _patch_row(patches: Patches, patch: int, grid_m: float) -> tuple:
    loop = patches.corners[patches.starts[patch] : patches.starts[patch + 1]]
    return "patch", None, None, None, int(patches.owner[patch]), (loop * grid_m).ravel(), patches.members[patch]
