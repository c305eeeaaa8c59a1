"""The display database that a walkthrough reads, format 1: X.walk, packed from a bake.

`manifest.json` says of which bake, and has a checksum of every other file. `objects.parquet` has a row for each object;
its row number is its display id, by which sets are stored. `items.parquet` says where levels of detail lie in
`geometry.bin`, and `cell_items.parquet` which of them do. `sets.parquet` has what may be visible from each view cell as
runs (data/runs.py); `cells` in it are rows of `cells.parquet`. `depth_meshes.parquet` has a row for each view cell with
depth meshes, whose faces lie in `geometry.bin` after the items. docs/reference/walk-folder.md has all columns.
"""

import hashlib
import json
import os
from collections.abc import Iterable
from functools import cached_property
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ..errors import InputError
from ..graph import CellGraph
from ..ragged import starts_of
from ..runs import RunSets, decode
from ..scene import Mesh
from .depth_items import FaceItem, decode_face
from .framed import FramedFolder
from .graph_folder import read_graph
from .scene_folder import new_folder, one_line, read_manifest, read_table
from .scene_tables import BOX_COLUMNS, colours_of, list_rows
from .walk_depth import DepthIndex
from .walk_tables import SHORT, item_size

__all__ = ["WalkFolder", "read_walk"]

FORMAT, KIND = 1, "walk"
GEOMETRY = "geometry.bin"
LOOKS = ("colour", "animation", "period_s")
COLUMNS = {
    "objects": ("object_id", "name", "kind", "role", "definition_id", "transform", *BOX_COLUMNS, *LOOKS, "items"),
    "items": ("owner", "lod", "offset", "size", "vertices", "faces", "error_m", "colour_starts", "colours"),
    "sets": ("cell_id", "potential", "unknown", "cells", "bytes"),
    "cell_items": ("cell_id", "limits"),
    "cells": ("cell_id", *BOX_COLUMNS, "inhabitable", "name"),
    "portals": ("portal_id", "cell_a", "cell_b", "axis", "coordinate", "min_u", "max_u", "min_v", "max_v"),
    "depth_meshes": (
        *("cell_id", "cull_box_m", "pixels", "near", "levels", "far", "middle", "reach_m", "texels", "error_texels"),
        *("skin_texels", "offsets", "sizes", "faces"),
    ),
}
# What is read before the first frame: all but the geometry.
INDEX_FILES = tuple(f"{name}.parquet" for name in COLUMNS)
MANIFEST_KEYS = ("bake", "grid_m", "origin", "yaw_deg", "flattened", "counts", "files")
# Tables of a bake that a pack is made of.
SOURCES = ("meshes", "objects", "cells", "portals", "cell_to_cell", "cell_to_object", "cell_lods")
# Sets take a third less in these encodings than in Parquet's own.
BINARY = ("potential", "unknown", "cells", "limits", "near", "levels", "far")


class WalkFolder(FramedFolder):
    """A display database: objects, their levels of detail, and what may be visible from where."""

    def __repr__(self) -> str:
        """What it holds, on a line."""
        counts = self.manifest["counts"]
        return f"<WalkFolder {str(self.folder)!r}: {counts['objects']:,} objects, {counts['view_cells']:,} view cells>"

    def _table(self, name: str) -> pa.Table:
        return read_table(self.folder / f"{name}.parquet", COLUMNS[name])

    @cached_property
    def objects(self) -> pa.Table:
        """Objects by display id; `items` are those of its levels, the finest first. Boxes and transforms in metres."""
        return self._table("objects")

    @cached_property
    def items(self) -> pa.Table:
        """Levels of detail as they lie in `geometry.bin`; `owner` is a definition_id, if flattened an object_id."""
        return self._table("items")

    @cached_property
    def cells(self) -> pa.Table:
        """All cells, as in the bake, in an order in which sets of cells are few runs."""
        return self._table("cells")

    @cached_property
    def portals(self) -> pa.Table:
        """Portals, as in the bake."""
        return self._table("portals")

    @property
    def claims_cells(self) -> bool:
        """Whether the bake says which cells see each other; one of view cells, which may overlap, does not."""
        return not self.sets["cells"].null_count

    @cached_property
    def graph(self) -> CellGraph:
        """Cells by cell_id, and portals [grid steps].

        Raises:
            InputError: the tables contradict each other.
        """
        return read_graph(self.folder, self.grid_m, disjoint=self.claims_cells)[0]

    @cached_property
    def boxes(self) -> np.ndarray:
        """Boxes by display id [grid steps], shape (objects, 2, 3), int64; low above high for one that is nowhere."""
        metres = np.column_stack([self.objects[name].to_numpy() for name in BOX_COLUMNS]).reshape(-1, 2, 3)
        nowhere = np.isnan(metres).any(axis=(1, 2))
        steps = np.round(np.where(nowhere[:, None, None], 0.0, metres) / self.grid_m).astype(np.int64)
        steps[nowhere, 0] = 1
        return steps

    @cached_property
    def sets(self) -> pa.Table:
        """A row for each view cell, by cell_id: codes of its sets, and bytes of the items that it may need."""
        return self._table("sets")

    @cached_property
    def potential(self) -> RunSets:
        """Display ids that may be visible, a set for each row of `sets`."""
        return self._runs("potential", self.objects.num_rows)

    @cached_property
    def unknown(self) -> RunSets:
        """Those of them that no witness shows."""
        return self._runs("unknown", self.objects.num_rows)

    @cached_property
    def potential_cells(self) -> RunSets | None:
        """Rows of `cells` that may be visible, for each row of `sets`; None if the bake claims nothing of cells."""
        return self._runs("cells", self.cells.num_rows) if self.claims_cells else None

    def matrices(self) -> tuple[np.ndarray, np.ndarray]:
        """What may be seen from each cell, by its id: objects, shape (cells, objects), and cells, (cells, cells), bool.

        Rows of cells that are no view cells are empty. All cells where nothing is claimed of them.
        """
        graph, views = self.graph, self.sets["cell_id"].to_numpy()
        objects = np.zeros((graph.cell_count, self.objects.num_rows), bool)
        cells = np.zeros((graph.cell_count, graph.cell_count), bool)
        starts, ids = self.potential.ids()
        objects[np.repeat(views, np.diff(starts)), ids] = True
        if self.potential_cells is None:
            cells[views] = True
            return objects, cells
        starts, rows = self.potential_cells.ids()
        cells[np.repeat(views, np.diff(starts)), self.cells["cell_id"].to_numpy()[rows]] = True
        beside = np.arange(graph.cell_count) >= graph.tile_count
        cells[views[beside[views]]] = True
        cells[views[:, None], np.flatnonzero(beside)] = True
        return objects, cells

    @cached_property
    def limits(self) -> np.ndarray:
        """The coarsest level that does for each member of all sets of `potential`, uint8."""
        codes = self._table("cell_items")["limits"].to_pylist()
        return np.frombuffer(b"".join(codes), np.uint8)

    @cached_property
    def object_items(self) -> tuple[np.ndarray, np.ndarray]:
        """Items of display id d are the second of the two arrays at the first's [d]:[d + 1], finest first, int64."""
        rows = [row.ravel() for row in list_rows(self.objects["items"], 1)]
        return starts_of([len(row) for row in rows]), np.concatenate([np.zeros(0, np.int64), *rows]).astype(np.int64)

    @cached_property
    def depth_meshes(self) -> DepthIndex:
        """Which view cells have textured depth meshes, and where they lie.

        Raises:
            InputError: the table contradicts itself.
        """
        return self._depth_index(self._table("depth_meshes"))

    def without_depth_meshes(self) -> DepthIndex:
        """The same as if there were none."""
        return self._depth_index(self._table("depth_meshes").slice(0, 0))

    def _depth_index(self, table: pa.Table) -> DepthIndex:
        try:
            return DepthIndex.of(table, self.objects.num_rows)
        except InputError as error:
            raise InputError(f"{self.folder / 'depth_meshes.parquet'}: {error}") from None

    def depth_face(self, row: int, face: int) -> FaceItem:
        """A face of the depth meshes of a row of `depth_meshes`, read from the file.

        Raises:
            InputError: the file is cut short or altered.
        """
        index = self.depth_meshes
        data = self._read(int(index.offsets[row, face]), int(index.sizes[row, face]))
        return decode_face(data, f"{self.folder / GEOMETRY}: depth mesh {face} of cell {index.cells[row]}")

    def row_of(self, cell_id: int) -> int:
        """The row of a view cell's sets.

        Raises:
            InputError: there is no such view cell.
        """
        cells = self.sets["cell_id"].to_numpy()
        row = int(np.searchsorted(cells, cell_id))
        if row == len(cells) or cells[row] != cell_id:
            raise InputError(f"{self.folder}: expected a view cell, found {cell_id}")
        return row

    def mesh(self, item: int) -> Mesh:
        """An item read from the file: vertices [m] in its owner's frame, float64, and faces, int32.

        Raises:
            InputError: there is no such item, or the file is cut short.
        """
        if not 0 <= item < self.items.num_rows:
            raise InputError(f"{self.folder}: expected an item below {self.items.num_rows}, found {item}")
        row = self.items.slice(item, 1).to_pylist()[0]
        data = self._read(row["offset"], row["size"])
        vertices, faces = item_mesh(data, row["vertices"], f"{self.folder / GEOMETRY}: item {item}")
        colours = colours_of(self.items.slice(item, 1), [faces])[0]
        return Mesh(vertices, faces, row["error_m"], colours)

    def _read(self, offset: int, size: int) -> bytes:
        """Bytes of the geometry."""
        with (self.folder / GEOMETRY).open("rb") as file:
            file.seek(offset)
            data = file.read(size)
        if len(data) != size:
            raise InputError(f"{self.folder / GEOMETRY}: expected {size} bytes from {offset} on, found {len(data)}")
        return data

    def stale(self) -> str:
        """One line if the bake that it was packed from has changed since; empty if not, or if it is not there."""
        place = self.bake_place
        if not (place / "manifest.json").is_file() or bake_digest(place) == self.manifest["bake"]["sha256"]:
            return ""
        return f"{self.folder}: its bake {place} has changed since; viewcell pack packs it anew"

    @property
    def bake_place(self) -> Path:
        """Where the bake that it was packed from was then."""
        return Path(os.path.normpath(self.folder.absolute() / ".." / self.manifest["bake"]["path"]))

    def _runs(self, name: str, count: int) -> RunSets:
        try:
            return decode(self.sets[name].to_pylist(), count)
        except InputError as error:
            raise InputError(f"{self.folder / 'sets.parquet'}: {name}: {error}") from None


def read_walk(folder: str | Path, *, geometry: bool = True) -> WalkFolder:
    """Open a display database: every file is as it was written, and all numbers name what there is.

    Args:
        folder: of `viewcell pack`.
        geometry: False if geometry.bin is elsewhere: everything else is checked.

    Raises:
        InputError: it is none, of another format version, unfinished, or a file is missing, cut short or altered.
    """
    folder = Path(folder)
    manifest = read_manifest(folder, kind=KIND)
    missing = [name for name in MANIFEST_KEYS if name not in manifest]
    if missing:
        raise InputError(f"{folder / 'manifest.json'}: expected the key {missing[0]!r}, found none")
    try:
        for name in (*INDEX_FILES, GEOMETRY):
            if name not in manifest["files"]:
                raise InputError(f"{folder / 'manifest.json'}: expected a checksum of {name}, found none")
            if geometry or name != GEOMETRY:
                _check_file(folder / name, manifest["files"][name])
        walk = WalkFolder(folder, manifest)
        _check_numbers(walk)
    except InputError:
        raise
    except (ValueError, TypeError, KeyError, pa.ArrowException) as error:
        raise InputError(f"{folder}: expected a readable display database, found {one_line(error)}") from None
    return walk


def item_mesh(data: bytes, vertex_count: int, where: str) -> tuple[np.ndarray, np.ndarray]:
    """Vertices [m], float64, and faces, int32, of an item's bytes.

    Raises:
        InputError: they are of other numbers of vertices and faces, or a face names no vertex.
    """
    split = 12 * vertex_count
    kind = np.dtype("<u2" if vertex_count <= SHORT else "<u4")
    if len(data) < split or (len(data) - split) % (3 * kind.itemsize):
        raise InputError(f"{where}: expected {vertex_count} vertices and whole faces, found {len(data)} bytes")
    vertices = np.frombuffer(data, "<f4", 3 * vertex_count).reshape(-1, 3).astype(np.float64)
    faces = np.frombuffer(data, kind, offset=split).reshape(-1, 3).astype(np.int32)
    if faces.size and faces.max() >= vertex_count:
        raise InputError(f"{where}: expected vertices below {vertex_count}, found {faces.max()}")
    if not np.isfinite(vertices).all():
        raise InputError(f"{where}: expected finite vertices, found others")
    return vertices, faces


def _check_file(path: Path, known: dict) -> None:
    try:
        size = path.stat().st_size
        if size != known["bytes"]:
            raise InputError(f"{path}: expected {known['bytes']} bytes, found {size}: it was cut short or altered")
        if file_digest(path) != known["sha256"]:
            raise InputError(f"{path}: expected the checksum of the manifest, found another: it was altered")
    except OSError as error:
        raise InputError(f"{path}: expected a file of the display database, found {error.strerror}") from None


def _check_numbers(walk: WalkFolder) -> None:
    """Every number names what there is, as far as tables tell."""
    items, file_size = walk.items, walk.manifest["files"][GEOMETRY]["bytes"]
    at, size, corners, faces = (items[name].to_numpy() for name in ("offset", "size", "vertices", "faces"))
    within = (at >= 0) & (at + size <= file_size) & (size == item_size(corners, faces))
    if not within.all():
        where = f"{walk.folder / 'items.parquet'}: expected item {np.argmin(within)} within {GEOMETRY}"
        raise InputError(f"{where}, found it beyond")
    ids, members = walk.object_items[1], walk.potential.ids()[1]
    if len(ids) and not (0 <= ids.min() and ids.max() < items.num_rows):
        raise InputError(f"{walk.folder / 'objects.parquet'}: expected items below {items.num_rows}, found others")
    where = walk.folder / "cell_items.parquet"
    if len(walk.limits) != len(members):
        raise InputError(f"{where}: expected {len(members)} limits of levels, found {len(walk.limits)}")
    if (walk.limits >= np.diff(walk.object_items[0])[members]).any():
        raise InputError(f"{where}: expected levels that there are, found others")
    _ = walk.unknown, walk.potential_cells
    try:
        cells, levels = walk.sets["cell_id"].to_numpy(), np.diff(walk.object_items[0])
        walk.depth_meshes.check(walk.potential, cells, levels, file_size)
    except InputError as error:
        where = walk.folder / "depth_meshes.parquet"
        raise InputError(f"{where}: {str(error).removeprefix(f'{where}: ')}") from None


def write_walk(folder: Path, facts: dict, tables: dict[str, pa.Table], geometry: Iterable[bytes]) -> dict:
    """Write a display database in one step: it is there whole, or what was there before still is.

    Args:
        folder: to write.
        facts: of the manifest, ready for JSON.
        tables: by name, as COLUMNS has them.
        geometry: bytes of all items, in order.

    Returns:
        The manifest.

    Raises:
        InputError: the folder holds something else, or cannot be written.
    """
    with new_folder(folder, KIND, COLUMNS) as temporary:
        for name, table in tables.items():
            _write_table(table, temporary / f"{name}.parquet")
        with (temporary / GEOMETRY).open("wb") as file:
            file.writelines(geometry)
        files = {
            path.name: {"bytes": path.stat().st_size, "sha256": file_digest(path)}
            for path in sorted(temporary.iterdir())
        }
        manifest = facts | {"files": files, "kind": KIND, "format": FORMAT, "complete": True}
        (temporary / "manifest.json").write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")
    return manifest


def _write_table(table: pa.Table, path: Path) -> None:
    """Bytes of sets as they are, one after the other with their lengths packed; else Parquet's own choice."""
    binary = [name for name in BINARY if name in table.column_names]
    others = [name for name in table.column_names if name not in binary]
    encoding = dict.fromkeys(binary, "DELTA_LENGTH_BYTE_ARRAY")
    pq.write_table(
        table,
        path,
        compression="zstd",
        compression_level=9,
        use_dictionary=others,
        column_encoding=encoding or None,
        write_statistics=others,
    )


def column_bytes(walk: WalkFolder, name: str) -> int:
    """Bytes that a column of `sets.parquet` takes in the file."""
    group = pq.ParquetFile(walk.folder / "sets.parquet").metadata.row_group(0)
    columns = [group.column(k) for k in range(group.num_columns)]
    return sum(column.total_compressed_size for column in columns if column.path_in_schema == name)


def file_digest(path: Path) -> str:
    """SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def bake_digest(folder: Path) -> str:
    """SHA-256 of what a pack takes from a bake: its tables, and the frame that they are in.

    Raises:
        InputError: a table cannot be read.
    """
    manifest = read_manifest(folder, kind="bake")
    digest = hashlib.sha256(repr([manifest[name] for name in ("format", "grid_m", "origin")]).encode())
    digest.update(repr(manifest.get("yaw_deg", 0.0)).encode())
    for name in SOURCES:
        path = folder / f"{name}.parquet"
        try:
            digest.update(f"{name} {file_digest(path) if path.exists() else 'none'} ".encode())
        except OSError as error:
            raise InputError(f"{path}: expected a table, found {error.strerror}") from None
    return digest.hexdigest()
