"""The bake folder: the display database that others read. Parquet (zstd) and JSON only.

Metres, relative to `origin`, Z up, right-handed. Rows exist for inhabitable cells; a row that is absent means HIDDEN.
A witness is the sightline from `origin_*` to `origin_* + direction_*`.

Format 2 has view cells with a `plan` (x, y of four corners, counter-clockwise) after all others in cells.parquet: such
a cell is the upright prism over its plan, not the box around it, and only its objects are claimed. A bake without such
cells is format 1.
"""

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ..errors import InputError
from ..graph import OTHER_AXES, CellGraph
from ..kept import kept_shares
from ..pair_sets import PairSets
from ..rows import Rows
from ..scene import Scene, turned
from . import certificates, room_tables
from .framed import FramedFolder
from .graph_folder import CELL_COLUMNS, PORTAL_COLUMNS, plan_column, read_graph
from .scene_folder import new_folder, read_manifest, read_table
from .scene_tables import meshes_table, objects_table, scene_from_tables

WITNESS = ("origin_x", "origin_y", "origin_z", "direction_x", "direction_y", "direction_z")
CELL_TO_CELL = ("cell_id", "reached_cell_id", "verdict", "portals", *WITNESS)
CELL_TO_OBJECT = ("cell_id", "object_id", "verdict", *WITNESS)
CELL_LODS = ("cell_id", "object_id", "lod")
# All that a bake folder may hold.
TABLES = (
    *("meshes", "objects", "cells", "portals", "cell_to_cell", "cell_to_object", "cell_lods", "cracks", "leaks"),
    *room_tables.TABLES,
    *certificates.TABLES,
)
LEAKS = ("cell_id", "reached_cell_id", "object_id")


class BakeFolder(FramedFolder):
    """A finished bake: the model, its cells and portals, and what is visible from where."""

    def in_bake(self, points: np.ndarray) -> np.ndarray:
        """Points of the model's own coordinates [m] in those of the bake's tables: the inverse of `in_model`."""
        return turned(np.asarray(points, np.float64) - self.origin, -self.yaw_deg)

    @cached_property
    def graph(self) -> CellGraph:
        """Cells and portals [grid steps]; view cells have no portals and may overlap."""
        return read_graph(self.folder, self.grid_m, disjoint=self.claims_cells)[0]

    @property
    def claims_cells(self) -> bool:
        """Whether the bake says which cells see each other; a bake of view cells speaks of objects only."""
        return "cell_to_cell" in self.manifest.get("claims", ["cell_to_cell"])

    @cached_property
    def scene(self) -> Scene | None:
        """The snapped model; None for the bake of a bare cell graph."""
        if not self.manifest["counts"]["objects"]:
            return None
        meshes, objects = (read_table(self.folder / f"{name}.parquet", ()) for name in ("meshes", "objects"))
        return scene_from_tables(self.manifest, meshes, objects)

    @cached_property
    def cell_to_cell(self) -> pa.Table:
        """Reached cells: verdict, portal sequence and witness [m]; no rows in a bake that claims nothing of cells."""
        if not self.claims_cells:
            none = Rows.unseen(np.zeros(0), np.zeros(0)).with_portals(np.zeros(0, int), np.zeros(0, np.int32))
            return _cell_to_cell_table(none, self.grid_m)
        return read_table(self.folder / "cell_to_cell.parquet", CELL_TO_CELL)

    @cached_property
    def cell_to_object(self) -> pa.Table:
        """Reached objects: verdict and witness [m]."""
        return read_table(self.folder / "cell_to_object.parquet", CELL_TO_OBJECT)

    @cached_property
    def cell_lods(self) -> pa.Table:
        """Levels of detail above 0 that potentially visible objects may be drawn at from anywhere in a cell.

        What has no row is drawn at level 0; in a bake without levels of detail that is everything.
        """
        path = self.folder / "cell_lods.parquet"
        if not path.exists():
            return pa.table({name: pa.array([], pa.int32()) for name in CELL_LODS})
        return read_table(path, CELL_LODS)

    @cached_property
    def rooms(self) -> pa.Table:
        """Rooms that the model names, by room_id, one row each; none in a bake without rooms, and in older bakes.

        Columns: name, long_name, guid, storey and elevation_m [m] as the model's file says them, null where it does
        not; covered, the share of where eyes may be in it that its view cells hold, from 0 to 1; cells, its view cells,
        a list of int32; claims_rooms, false where `room_to_room` hides nothing from it or of it.

        Raises:
            InputError: the table is unreadable.
        """
        return room_tables.read_room_table(self.folder, "rooms")

    @cached_property
    def room_to_object(self) -> pa.Table:
        """What is seen from each room, the union over its view cells: room_id, object_id (int32) and verdict.

        "visible" if any of its cells sees the object, else "unknown"; an object that is absent is hidden from all of
        them, which says nothing of the part of the room that is not `covered`.

        Raises:
            InputError: the table is unreadable.
        """
        return room_tables.read_room_table(self.folder, "room_to_object")

    @cached_property
    def room_to_room(self) -> pa.Table:
        """Which rooms each room reaches: room_id, reached_room_id (int32) and verdict.

        "visible" if some of its cells sees some cell of the other, else "unknown"; absent is hidden, as above. Where
        `claims_rooms` is false for one of the two, all is "unknown" that no cell shows: view cells at an angle, and
        bakes of view cells, claim nothing of cells. A room that has cells sees itself.

        Raises:
            InputError: the table is unreadable.
        """
        return room_tables.read_room_table(self.folder, "room_to_room")

    @cached_property
    def rooms_of_cells(self) -> list[str]:
        """Rooms of each cell in words, such as "A101 Foyer, Level 1"; the cell's own name where it has no room."""
        return room_tables.words_of_cells(self.rooms, self.graph.cell_names)

    def cell_text(self, cell: int) -> str:
        """A cell's number and rooms, for messages: "12 (A101 Foyer, Level 1)"; the number alone where it has none."""
        words = self.rooms_of_cells[cell]
        return f"{cell} ({words})" if words else f"{cell}"

    @cached_property
    def cracks(self) -> np.ndarray:
        """Openings that a seal closed: flat boxes [grid steps], shape (n, 2, 3), int32; none in a bake without one."""
        if not (self.folder / "cracks.parquet").exists():
            return np.zeros((0, 2, 3), np.int32)
        return read_graph(self.folder, self.grid_m, disjoint=self.claims_cells, portals="cracks")[0].portals

    @cached_property
    def leaks(self) -> pa.Table:
        """Pairs that only a seal hides: cell_id, and the object_id or the reached_cell_id that is hidden."""
        path = self.folder / "leaks.parquet"
        if not path.exists():
            return leaks_table(np.zeros((0, 2), int), np.zeros((0, 2), int))
        return read_table(path, LEAKS)

    @cached_property
    def cell_sets(self) -> PairSets:
        """Potentially visible cells of each inhabitable cell.

        All of them in a bake that claims nothing of cells, and from or to view cells with a plan.
        """
        graph, table = self.graph, self.cell_to_cell
        pairs = table["cell_id"].to_numpy(), table["reached_cell_id"].to_numpy()
        beside = np.arange(graph.cell_count) >= (graph.tile_count if self.claims_cells else 0)
        found = PairSets.of(pairs, (graph.cell_count, graph.cell_count))
        return replace(found, whole=beside & graph.inhabitable, shared=beside, sharing=graph.inhabitable)

    @cached_property
    def object_sets(self) -> PairSets:
        """Potentially visible objects of each inhabitable cell."""
        table = self.cell_to_object
        pairs = table["cell_id"].to_numpy(), table["object_id"].to_numpy()
        return PairSets.of(pairs, (self.graph.cell_count, self.manifest["counts"]["objects"]))

    @cached_property
    def potential_cells(self) -> np.ndarray:
        """`cell_sets`, shape (cells, cells), bool: too much for tens of thousands of cells."""
        return self.cell_sets[np.arange(self.graph.cell_count)]

    @cached_property
    def potential_objects(self) -> np.ndarray:
        """`object_sets`, shape (cells, objects), bool."""
        return self.object_sets[np.arange(self.graph.cell_count)]

    def kept(self) -> tuple[np.ndarray, np.ndarray]:
        """Shares of the model's objects, and of its triangles at their finest, that each cell keeps.

        Returns:
            Two arrays of shape (cells,), float64, from 0 to 1; 0 where a cell is not inhabitable, and in a bare graph.
        """
        sizes = np.zeros(0, int) if self.scene is None else self.scene.triangle_counts
        table = self.cell_to_object
        return kept_shares(self.graph.cell_count, *(table[name].to_numpy() for name in CELL_TO_OBJECT[:2]), sizes)


def read_bake(folder: str | Path) -> BakeFolder:
    """Open a bake folder.

    Raises:
        InputError: it is no bake folder, of another format version, incomplete, or its tables contradict each other.
    """
    folder = Path(folder)
    manifest = read_manifest(folder, kind="bake")
    missing = [name for name in ("grid_m", "origin", "counts", "settings") if name not in manifest]
    if missing:
        raise InputError(f"{folder / 'manifest.json'}: expected the key {missing[0]!r}, found none")
    bake = BakeFolder(folder, manifest)
    _check_ids(bake)
    return bake


def _check_ids(bake: BakeFolder) -> None:
    """Every id in the visibility tables names a row of its own table; every source is inhabitable."""
    limits = {"cell_id": bake.graph.cell_count, "reached_cell_id": bake.graph.cell_count}
    limits["object_id"] = int(bake.manifest["counts"]["objects"])
    for name, table, columns in (
        ("cell_to_cell", bake.cell_to_cell, ("cell_id", "reached_cell_id")),
        ("cell_to_object", bake.cell_to_object, ("cell_id", "object_id")),
    ):
        for column in columns:
            ids = table[column].to_numpy()
            if len(ids) and (ids.min() < 0 or ids.max() >= limits[column]):
                bad = ids[(ids < 0) | (ids >= limits[column])][0]
                where = bake.folder / f"{name}.parquet"
                raise InputError(f"{where}: expected {column} from 0 to {limits[column] - 1}, found {bad}")
        sources = table["cell_id"].to_numpy()
        if not bake.graph.inhabitable[sources].all():
            bad = sources[~bake.graph.inhabitable[sources]][0]
            where = bake.folder / f"{name}.parquet"
            raise InputError(f"{where}: expected rows of inhabitable cells only, found cell {bad}")
    tables = {name: getattr(bake, name) for name in room_tables.TABLES}
    room_tables.check_rooms(bake.folder, tables, bake.graph.inhabitable, limits["object_id"])


def write_bake(
    folder: Path,
    manifest: Callable[[], dict],
    scene: Scene | None,
    graph: CellGraph,
    rows: tuple[Rows | None, Rows],
    grid_m: float,
    more: dict[str, pa.Table] | None = None,
) -> dict:
    """Write a bake folder atomically: a temporary folder beside the target, then a rename.

    Args:
        folder: to write.
        manifest: asked for when the tables are written, so that it can tell how long that took.
        scene: the model; None for a bare graph.
        graph: its cells and portals.
        rows: what is seen: cells with their portals, or None where nothing is claimed of them, and objects.
        grid_m: grid step [m].
        more: tables beyond the format's own, by name.

    Returns:
        The manifest.

    Raises:
        InputError: the disk is full or the place is not writable; what was there before is untouched.
    """
    cell_rows, object_rows = rows
    empty = Scene([], [])
    tables = {
        "meshes": meshes_table(scene or empty),
        "objects": objects_table(scene or empty),
        "cells": cells_table(graph, grid_m),
        "portals": portals_table(graph, grid_m),
        "cell_to_object": _cell_to_object_table(object_rows, grid_m),
    }
    if cell_rows is not None:
        tables["cell_to_cell"] = _cell_to_cell_table(cell_rows, grid_m)
    tables |= more or {}

    with new_folder(folder, "bake", TABLES) as temporary:
        for name, table in tables.items():
            pq.write_table(table, temporary / f"{name}.parquet", compression="zstd")
        final = manifest()
        (temporary / "manifest.json").write_text(json.dumps(final, indent=1) + "\n", encoding="utf-8")
    return final


def cells_table(graph: CellGraph, grid_m: float) -> pa.Table:
    """Rows of cells.parquet [m]."""
    values = graph.cells.reshape(-1, 6) * grid_m
    columns = {"cell_id": pa.array(np.arange(graph.cell_count, dtype=np.int32))}
    columns |= {name: pa.array(values[:, i]) for i, name in enumerate(CELL_COLUMNS[1:])}
    columns["inhabitable"] = pa.array(graph.inhabitable)
    columns["name"] = pa.array([str(name) for name in graph.cell_names], pa.string())
    if len(graph.plans.rows):
        beside = np.arange(graph.cell_count) >= graph.tile_count
        corners = graph.plans.filled(graph.cell_count, np.arange(graph.cell_count))
        columns["plan"] = plan_column(corners, beside, grid_m)
    return pa.table(columns)


def portals_table(graph: CellGraph, grid_m: float) -> pa.Table:
    """Rows of portals.parquet [m]."""
    rows = np.arange(graph.portal_count)
    uv = OTHER_AXES[graph.portal_axis] if graph.portal_count else np.zeros((0, 2), int)
    metres = graph.portals * grid_m
    values = [metres[rows, 0, graph.portal_axis]]
    values += [metres[rows, side, uv[:, c]] for c in (0, 1) for side in (0, 1)]
    columns = {
        "portal_id": pa.array(rows.astype(np.int32)),
        "cell_a": pa.array(graph.portal_cells[:, 0]),
        "cell_b": pa.array(graph.portal_cells[:, 1]),
        "axis": pa.array(graph.portal_axis),
    }
    return pa.table(columns | {name: pa.array(x) for name, x in zip(PORTAL_COLUMNS[4:], values, strict=True)})


def leaks_table(cells: np.ndarray, objects: np.ndarray) -> pa.Table:
    """Rows of leaks.parquet from pairs (source, cell) and (source, object); the other column is null."""
    pairs = np.concatenate([cells, objects]).astype(np.int32).reshape(-1, 2)
    is_cell = np.arange(len(pairs)) < len(cells)
    columns = pairs[:, 0], pairs[:, 1], pairs[:, 1]
    masks = None, ~is_cell, is_cell
    return pa.table({name: pa.array(x, mask=m) for name, x, m in zip(LEAKS, columns, masks, strict=True)})


def _witness_columns(rows: Rows, grid_m: float) -> dict[str, pa.Array]:
    # The grid step is a power of two, so metres hold the same points, and both ends are multiples of a 1024th of it.
    seen = rows.seen
    origin, end = (points[seen] * grid_m for points in (rows.origin, rows.end))
    values = np.concatenate([origin, end - origin], axis=1).T.copy()
    # Most rows of a bake that time ran out for have none.
    place = pa.array(np.cumsum(seen) - 1, mask=~seen)
    return {name: pa.array(column).take(place) for name, column in zip(WITNESS, values, strict=True)}


def _pair_columns(rows: Rows, target: str) -> dict[str, pa.Array]:
    source, reached = (pa.array(column.astype(np.int32)) for column in (rows.source, rows.target))
    return {"cell_id": source, target: reached, "verdict": room_tables.verdict_column(rows.verdict)}


def _cell_to_cell_table(rows: Rows, grid_m: float) -> pa.Table:
    starts, portals = rows.portal_starts.astype(np.int32), rows.portals.astype(np.int32)
    columns = {"portals": pa.ListArray.from_arrays(pa.array(starts), pa.array(portals))}
    return pa.table(_pair_columns(rows, "reached_cell_id") | columns | _witness_columns(rows, grid_m))


def _cell_to_object_table(rows: Rows, grid_m: float) -> pa.Table:
    return pa.table(_pair_columns(rows, "object_id") | _witness_columns(rows, grid_m))
