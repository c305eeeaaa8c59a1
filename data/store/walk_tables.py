"""What a display database is made of: objects in an order, their levels as items of one flat file, and sets in runs.

Source: Funkhouser et al. 1996, section 2.2: definitions, instances that share them, and geometry of an instance's own
for single levels, which here is an item of its own beside those that it shares. Levels lie in the file step by step
from the coarsest, each in the order of the objects, so that what is fetched together lies together (Chhugani et al.
2005, section 6.1).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256
from itertools import pairwise

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from ..lod import object_errors
from ..ragged import owners_of, places_of, starts_of
from ..runs import encode
from ..scene import Instance, Mesh, Scene
from ..sweep import still
from ..verdict import Verdict
from .bake_folder import BakeFolder
from .scene_tables import box_columns, colour_columns, list_column, look_columns

# Items begin at multiples of so many bytes.
ALIGNED = 16
# With more vertices than this, faces need four bytes a corner.
SHORT = 2**16


@dataclass(frozen=True)
class Items:
    """Levels of detail as they lie in the file.

    Attributes:
        meshes: of each item, in order.
        owners: definition_id of each, or object_id if it is an object's own copy.
        lods: level of each, 0 for the finest.
        starts: items of object o (by object_id) are of_objects[starts[o]:starts[o + 1]], finest first.
        of_objects: int64.
    """

    meshes: list[Mesh]
    owners: list[int]
    lods: list[int]
    starts: np.ndarray
    of_objects: np.ndarray

    @property
    def sizes(self) -> np.ndarray:
        """Bytes of each item, shape (items,), int64."""
        return item_size([len(mesh.vertices) for mesh in self.meshes], [len(mesh.faces) for mesh in self.meshes])

    @property
    def offsets(self) -> np.ndarray:
        """Where each item begins, and where the file ends [bytes], shape (items + 1,), int64."""
        return starts_of(-(-self.sizes // ALIGNED) * ALIGNED)


def item_size(vertices: np.ndarray | list[int], faces: np.ndarray | list[int]) -> np.ndarray:
    """Bytes of items of so many vertices and faces: three float32 a vertex, three uint16 or uint32 a face, int64."""
    vertices, faces = (np.asarray(counts, np.int64) for counts in (vertices, faces))
    return 12 * vertices + np.where(vertices <= SHORT, 6, 12) * faces


def item_bytes(mesh: Mesh) -> bytes:
    """A mesh as an item, with what fills it up: positions, then faces, little-endian."""
    faces = mesh.faces.astype("<u2" if len(mesh.vertices) <= SHORT else "<u4")
    data = mesh.vertices.astype("<f4").tobytes() + faces.tobytes()
    return data + bytes(-len(data) % ALIGNED)


def gather_items(scene: Scene, order: np.ndarray, flatten: bool) -> Items:
    """Items of all objects, which stand in an order.

    Args:
        scene: the model.
        order: object_ids, each once.
        flatten: whether every object has copies of its own, in the scene's frame, or in its definition's if it moves;
            else meshes of the same content are one item, and stay in their definition's frame.
    """
    levels = [_own_meshes(scene, o) if flatten else shape_of(scene, o) for o in range(len(scene.objects))]
    starts = starts_of([len(meshes) for meshes in levels])
    keys: dict[object, int] = {}
    of_objects = np.zeros(starts[-1], np.int64)
    found = Items([], [], [], starts, of_objects)
    names = {id(mesh): content_of(mesh) for shape in scene.definitions for mesh in shape.lods}
    for step in range(int(np.diff(starts).max(initial=0))):
        for object_id in order.tolist():
            lod = len(levels[object_id]) - 1 - step
            if lod < 0:
                continue
            mesh = levels[object_id][lod]
            key = (object_id, lod) if flatten else names[id(mesh)]
            if key not in keys:
                keys[key] = len(keys)
                found.meshes.append(mesh)
                found.owners.append(object_id if flatten else scene.objects[object_id].definition_id)
                found.lods.append(lod)
            of_objects[starts[object_id] + lod] = keys[key]
    return found


def shape_of(scene: Scene, object_id: int) -> tuple[Mesh, ...]:
    """Levels of an object's definition."""
    return scene.definitions[scene.objects[object_id].definition_id].lods


def content_of(mesh: Mesh) -> bytes:
    """What tells meshes of different content apart."""
    colours = b"" if mesh.colours is None else mesh.colours.tobytes()
    shape = f"{len(mesh.vertices)} {len(mesh.faces)} {mesh.error_m!r} {len(colours)} ".encode()
    return sha256(shape + mesh.vertices.tobytes() + mesh.faces.tobytes() + colours).digest()


def _own_meshes(scene: Scene, object_id: int) -> list[Mesh]:
    """Levels of an object in the scene's frame: snapped, as the finest one is in every verdict, and turned outwards."""
    placed = scene.objects[object_id]
    if placed.animation is not None:
        return [*shape_of(scene, object_id)]
    errors, starts = object_errors(Scene(scene.definitions, [placed], grid_m=scene.grid_m))
    mirrored = np.linalg.det(placed.transform[:3, :3]) < 0
    out = []
    for lod, mesh in enumerate(shape_of(scene, object_id)):
        vertices = scene.world_vertices(object_id, lod) * scene.grid_m
        faces = mesh.faces[:, ::-1] if mirrored else mesh.faces
        # Both surfaces are snapped, each by half a step an axis.
        error = errors[starts[0] + lod] + (np.sqrt(3) * scene.grid_m if lod else 0.0)
        out.append(Mesh(vertices, faces, float(error), mesh.colours))
    return out


def objects_table(scene: Scene, order: np.ndarray, items: Items, flatten: bool) -> pa.Table:
    """`objects.parquet`: a row for each object in the order, whose row number is its display id.

    The box of what moves holds it at all times.
    """
    boxes = still(scene).object_bounds()[order]
    placed = [scene.objects[i] for i in order.tolist()]
    transforms = [_left_over(one, flatten) for one in placed]
    counts = np.diff(items.starts)[order]
    ids = items.of_objects[places_of(items.starts[order], counts)]
    return pa.table(
        {
            "object_id": pa.array(order, pa.int32()),
            "name": pa.array([one.name for one in placed], pa.string()),
            "kind": pa.array([one.kind for one in placed], pa.string()),
            "role": pa.array([one.role.value for one in placed], pa.string()),
            "definition_id": pa.array([one.definition_id for one in placed], pa.int32()),
            "transform": list_column(transforms, np.float64),
            **box_columns(boxes * scene.grid_m, empty=boxes[:, 0, 0] > boxes[:, 1, 0]),
            **look_columns(placed),
            "items": pa.ListArray.from_arrays(pa.array(starts_of(counts), pa.int32()), pa.array(ids, pa.int32())),
        }
    )


def _left_over(placed: Instance, flatten: bool) -> np.ndarray:
    """The transform that an object's items have yet to undergo."""
    return np.eye(4) if flatten and placed.animation is None else placed.transform


def items_table(items: Items) -> pa.Table:
    """`items.parquet`: a row for each item in the file's order."""
    return pa.table(
        {
            "owner": pa.array(items.owners, pa.int32()),
            "lod": pa.array(items.lods, pa.int32()),
            "offset": pa.array(items.offsets[:-1], pa.int64()),
            "size": pa.array(items.sizes, pa.int64()),
            "vertices": pa.array([len(mesh.vertices) for mesh in items.meshes], pa.int32()),
            "faces": pa.array([len(mesh.faces) for mesh in items.meshes], pa.int32()),
            "error_m": pa.array([mesh.error_m for mesh in items.meshes], pa.float64()),
            **colour_columns(items.meshes),
        }
    )


@dataclass(frozen=True)
class DisplaySets:
    """What view cells may see, in display ids.

    Attributes:
        cells: cell_ids of the view cells, ascending, int64.
        starts: set of row r is members[starts[r]:starts[r + 1]].
        members: display ids, ascending in each set, int64.
        unknown: members without a witness, shape of members, bool.
        limits: the coarsest level that does for each member from anywhere in the cell, uint8.
    """

    cells: np.ndarray
    starts: np.ndarray
    members: np.ndarray
    unknown: np.ndarray
    limits: np.ndarray


def display_sets(bake: BakeFolder, cells: np.ndarray, order: np.ndarray) -> DisplaySets:
    """The potentially visible sets of a bake's view cells, objects in an order."""
    table, count = bake.cell_to_object, len(order)
    rank, row_of = np.empty(count, np.int64), np.full(bake.graph.cell_count, -1)
    rank[order], row_of[cells] = np.arange(count), np.arange(len(cells))
    row = row_of[table["cell_id"].to_numpy()]
    members = rank[table["object_id"].to_numpy()]
    unknown = pc.equal(table["verdict"], Verdict.UNKNOWN.word).to_numpy()
    sorting = np.lexsort((members, row))
    row, members, unknown = row[sorting], members[sorting], unknown[sorting]
    limits, lods = np.zeros(len(row), np.uint8), bake.cell_lods
    keys = row_of[lods["cell_id"].to_numpy()] * count + rank[lods["object_id"].to_numpy()]
    limits[np.searchsorted(row * count + members, keys)] = lods["lod"].to_numpy()
    return DisplaySets(cells, starts_of(np.bincount(row, minlength=len(cells))), members, unknown, limits)


def sets_table(sets: DisplaySets, items: Items, order: np.ndarray, cell_sets: tuple | None) -> pa.Table:
    """`sets.parquet`: a row for each view cell; `cells` is null where a bake claims nothing of cells."""
    some = sets.unknown
    fewer = starts_of(np.bincount(owners_of(sets.starts)[some], minlength=len(sets.cells)))
    cells = [None] * len(sets.cells) if cell_sets is None else encode(*cell_sets)
    return pa.table(
        {
            "cell_id": pa.array(sets.cells, pa.int32()),
            "potential": pa.array(encode(sets.starts, sets.members), pa.binary()),
            "unknown": pa.array(encode(fewer, sets.members[some]), pa.binary()),
            "cells": pa.array(cells, pa.binary()),
            "bytes": pa.array(_bytes_of(sets, items, order), pa.int64()),
        }
    )


def _bytes_of(sets: DisplaySets, items: Items, order: np.ndarray) -> np.ndarray:
    """Bytes of all items that each view cell may need: levels of its members from the coarsest to what does."""
    members, rows = order[sets.members], owners_of(sets.starts)
    counts = np.diff(items.starts)[members] - sets.limits
    wanted = items.of_objects[places_of(items.starts[members] + sets.limits, counts)]
    pairs = np.unique(np.repeat(rows, counts) * max(1, len(items.meshes)) + wanted)
    row, item = np.divmod(pairs, max(1, len(items.meshes)))
    return np.bincount(row, items.sizes[item], minlength=len(sets.cells)).astype(np.int64)


def cell_items_table(sets: DisplaySets) -> pa.Table:
    """`cell_items.parquet`: a byte for each member of a view cell's set, in its order: its limit."""
    limits, ends = sets.limits.tobytes(), sets.starts.tolist()
    bytes_of = [limits[a:b] for a, b in pairwise(ends)]
    return pa.table({"cell_id": pa.array(sets.cells, pa.int32()), "limits": pa.array(bytes_of, pa.binary())})


def geometry(items: Items) -> Iterator[bytes]:
    """`geometry.bin`, item by item."""
    return map(item_bytes, items.meshes)
