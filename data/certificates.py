"""Certificates of a bake: why what is absent from cell_to_object.parquet is hidden. Tables that a checker reads.

| table | columns |
|---|---|
| proofs.parquet | proof_id, cell_id, min_x ... max_z: whatever lies inside this box is hidden from the cell |
| leaves.parquet | proof_id, occluder_id, v_min_x ... v_max_z, x_min_x ... x_max_z: the occluder blocks all segments from box v to box x; the leaves of a proof tile (cell, box) |
| occluders.parquet | occluder_id, kind (region, patch), axis and coordinate of a region, its rectangles (list: min_u, min_v, max_u, max_v, ...), object_id of a patch, the corners of its outline (list: x, y, z, ...), and the triangles of its disc (list: places among those of the object, degenerate ones not counted) |

Metres, as in all tables of a bake.
"""  # noqa: E501 (a table row is one line)

import numpy as np
import pyarrow as pa

from .opaque import decompose
from .patches import Patches
from .regions import Regions

CORNERS = ("min_x", "min_y", "min_z", "max_x", "max_y", "max_z")
PROOFS = ("proof_id", "cell_id", *CORNERS)
LEAVES = ("proof_id", "occluder_id", *(f"v_{name}" for name in CORNERS), *(f"x_{name}" for name in CORNERS))
OCCLUDERS = ("occluder_id", "kind", "axis", "coordinate", "rectangles", "object_id", "corners", "triangles")


def certificate_tables(
    cell: np.ndarray,
    boxes: np.ndarray,
    starts: np.ndarray,
    leaves: np.ndarray,
    regions: Regions,
    patches: Patches,
    grid_m: float,
) -> dict[str, pa.Table]:
    """Tables of proofs, by name.

    Args:
        cell: view cell of each proof, shape (n,), int.
        boxes: hidden box of each [grid steps], shape (n, 2, 3).
        starts: leaves of proof i are leaves[starts[i]:starts[i + 1]], shape (n + 1,).
        leaves: (occluder, corners of V', corners of X') [grid steps], shape (m, 13), int32; occluder r is a region,
            -1 - p a patch.
        regions: of the model.
        patches: of the model.
        grid_m: grid step [m].
    """
    count = len(regions.axis)
    occluder = np.where(leaves[:, 0] >= 0, leaves[:, 0], count - 1 - leaves[:, 0]).astype(np.int32)
    corners = boxes.reshape(-1, 6) * grid_m
    proofs = {"proof_id": np.arange(len(cell), dtype=np.int32), "cell_id": cell.astype(np.int32)}
    proofs |= {name: corners[:, i] for i, name in enumerate(CORNERS)}
    owner = np.repeat(np.arange(len(cell), dtype=np.int32), np.diff(starts))
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
    return {"proofs": pa.table(proofs), "leaves": pa.table(parts), "occluders": pa.table(occluders)}


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
