"""Why something is seen, or not: sightlines of a bake and, where it has certificates, what stands in the way.

A script of its own, which the page loads when somebody asks.
"""

import numpy as np
import pyarrow as pa

from ...data.curtains import RISING
from ...data.graph import OTHER_AXES
from ...data.ragged import starts_of, take_lists
from ...data.store.bake_folder import WITNESS, BakeFolder
from ...data.store.certificates import (
    BLOCKERS,
    CORNERS,
    FIRST_FENCE,
    LEAVES,
    NODE_STEP,
    OCCLUDERS,
    PROOFS,
    TREES,
)
from ...data.store.scene_folder import read_table
from ...data.store.walk_folder import WalkFolder
from ...data.verdict import Verdict
from .contents import script


def reasons(bake: BakeFolder, walk: WalkFolder) -> str:
    """The script that hands a page sightlines and blockers of a bake; cells and objects as in its display database.

    Raises:
        InputError: a table is unreadable.
    """
    cells = _places(walk.cells["cell_id"].to_numpy())
    objects = _places(walk.objects["object_id"].to_numpy())
    arrays = _sightlines("object", bake.cell_to_object, "object_id", cells, objects)
    arrays |= _sightlines("cell", bake.cell_to_cell, "reached_cell_id", cells, cells)
    arrays |= _sequences(bake.cell_to_cell, walk.portals["portal_id"].to_numpy())
    certified = (bake.folder / "proofs.parquet").is_file()
    return script("viewcellReasons", {"certified": certified}, arrays | (_proofs(bake, cells) if certified else {}))


def _places(ids: np.ndarray) -> np.ndarray:
    """The row of each id."""
    out = np.zeros(int(ids.max(initial=-1)) + 1, np.int64)
    out[ids] = np.arange(len(ids))
    return out


def _seen(table: pa.Table) -> np.ndarray:
    return np.flatnonzero(np.array(table["verdict"].to_pylist()) == Verdict.VISIBLE.word)


def _sightlines(
    name: str, table: pa.Table, target: str, cells: np.ndarray, targets: np.ndarray
) -> dict[str, np.ndarray]:
    """Pairs of rows that a sightline joins, and its two ends [m]."""
    seen = _seen(table)
    pairs = np.stack([cells[table["cell_id"].to_numpy()], targets[table[target].to_numpy()]], axis=1)[seen]
    lines = np.column_stack([table[column].to_numpy(zero_copy_only=False)[seen] for column in WITNESS])
    lines[:, 3:] += lines[:, :3]
    return {f"{name}Pairs": pairs.astype(np.int32), f"{name}Lines": lines.astype(np.float32)}


def _sequences(table: pa.Table, portal_ids: np.ndarray) -> dict[str, np.ndarray]:
    """Portals, in order, by which each cell is reached that is seen."""
    ways = [table["portals"][int(row)].as_py() or [] for row in _seen(table)]
    ids = np.array([portal for way in ways for portal in way], np.int64)
    return {
        "sequenceStarts": starts_of([len(way) for way in ways]).astype(np.uint32),
        "sequences": (_places(portal_ids)[ids] if len(ids) else ids).astype(np.uint32),
    }


def _proofs(bake: BakeFolder, cells: np.ndarray) -> dict[str, np.ndarray]:
    """Boxes that are hidden from cells, and numbers of the occluders that each proof names, as rectangles."""
    tables = (
        ("proofs", PROOFS),
        ("trees", TREES),
        ("blockers", BLOCKERS),
        ("leaves", LEAVES),
        ("occluders", OCCLUDERS),
    )
    proofs, trees, blockers, leaves, occluders = (
        read_table(bake.folder / f"{name}.parquet", columns) for name, columns in tables
    )
    ids = proofs["proof_id"].to_numpy()
    words = trees["words"].combine_chunks()
    nodes = words.flatten().to_numpy()
    owners = np.repeat(trees["proof_id"].to_numpy(), np.diff(words.offsets.to_numpy()))
    named = nodes // NODE_STEP
    # Below zero are leaves; from FIRST_FENCE on stand sides of the cell's plan or the target's.
    real = (nodes >= 0) & (named < FIRST_FENCE)
    shapes = [rectangle(row) for row in blockers.to_pylist()]
    places = _places(blockers["blocker_id"].to_numpy())
    pairs = [np.stack([owners[real], places[named[real]]], axis=1)]
    if leaves.num_rows:
        others = len(shapes) + _places(occluders["occluder_id"].to_numpy())[leaves["occluder_id"].to_numpy()]
        pairs.append(np.stack([leaves["proof_id"].to_numpy(), others], axis=1))
        shapes += [_occluder(row) for row in occluders.to_pylist()]
    pairs = np.unique(np.concatenate(pairs), axis=0)
    order = np.argsort(cells[proofs["cell_id"].to_numpy()], kind="stable")
    lists, at = take_lists(starts_of(np.bincount(pairs[:, 0], minlength=int(ids.max(initial=-1)) + 1)), ids[order])
    return {
        "proofCells": cells[proofs["cell_id"].to_numpy()][order].astype(np.int32),
        "proofBoxes": np.column_stack([proofs[name].to_numpy() for name in CORNERS])[order].astype(np.float32),
        "proofStarts": lists.astype(np.uint32),
        "proofBlockers": pairs[at, 1].astype(np.uint32),
        "blockerStarts": starts_of([len(shape) // 12 for shape in shapes]).astype(np.uint32),
        "blockerCorners": np.array([x for shape in shapes for x in shape], np.float32),
    }


def rectangle(row: dict) -> list[float]:
    """Corners of a rectangle that a line tree names, or of a curtain, 12 numbers."""
    (a, b), (c, d), low = (row["min_u"], row["min_v"]), (row["max_u"], row["max_v"]), row["coordinate"]
    if row["axis"] >= RISING:
        (b, d), top = (b, d) if row["axis"] == RISING else (d, b), row["top"]
        return [a, b, low, c, d, low, c, d, top, a, b, top]
    return _on_plane(row["axis"], low, (a, b, c, d))


def _on_plane(axis: int, coordinate: float, rectangle: tuple[float, ...]) -> list[float]:
    a, b, c, d = rectangle
    corners = np.full((4, 3), coordinate)
    corners[:, OTHER_AXES[axis]] = [(a, b), (c, b), (c, d), (a, d)]
    return corners.ravel().tolist()


def _occluder(row: dict) -> list[float]:
    """Rectangles of a region, or the fan of a patch, 12 numbers each."""
    if row["kind"] == "region":
        parts = np.array(row["rectangles"]).reshape(-1, 4)
        return [x for part in parts for x in _on_plane(row["axis"], row["coordinate"], tuple(part))]
    loop = np.array(row["corners"]).reshape(-1, 3)
    # Two triangles of the fan at a time make a rectangle's place; the last corner stands twice where it is one.
    fans = [loop[[0, k, k + 1, min(k + 2, len(loop) - 1)]] for k in range(1, len(loop) - 1, 2)]
    return [float(x) for fan in fans for x in fan.ravel()]
