"""What a view holds: a display database as a head in JSON and arrays in one block of bytes, for a browser to read.

Arrays are little-endian; display ids and rows of cells are those of the database (docs/reference/walk-folder.md).
"""

import base64
import gzip
import json
import re
from collections.abc import Iterable, Iterator

import numpy as np
import pyarrow as pa

from ...data.ragged import starts_of
from ...data.runs import encode
from ...data.scene import Role
from ...data.store.scene_tables import BOX_COLUMNS
from ...data.store.walk_folder import GEOMETRY, WalkFolder

KINDS = {"uint8": "u1", "uint16": "u2", "uint32": "u4", "int32": "i4", "float32": "f4"}
ROW = 12
# About so many chunks, but none smaller or larger than this [bytes].
CHUNKS = 256
CHUNK_BYTES = (4_096, 262_144)
STOOD_ON = re.compile(r"Ifc(Stair|Ramp|Slab|Roof|Covering|Plate|Site)", re.IGNORECASE)


def contents(walk: WalkFolder, *, streams: bool = False) -> str:
    """The script that hands the database to the viewer: the same for the same database.

    Args:
        walk: every file of it is read.
        streams: leave geometry out: chunks of it are scripts of their own.

    Raises:
        InputError: a table is unreadable, or geometry is cut short.
    """
    kinds, kind = np.unique(walk.objects["kind"].to_pylist(), return_inverse=True)
    arrays = {
        "kinds": kind.astype(np.uint16),
        **_objects(walk),
        **_items(walk),
        **_sets(walk),
        **_cells(walk),
        **_depth(walk),
    }
    if streams:
        del arrays["geometry"]
    head = {
        "names": walk.objects["name"].to_pylist(),
        "kinds": kinds.tolist(),
        "cellNames": [name or "" for name in walk.cells["name"].to_pylist()],
        "claimsCells": walk.claims_cells,
        "streams": streams,
        "grid": walk.grid_m,
        "bounds": _bounds(_boxes(walk.objects)),
    }
    return script("viewcellData", head, arrays)


def script(name: str, head: dict, arrays: dict[str, np.ndarray]) -> str:
    """A script that hands a page some arrays, under a name that is global there: the same for the same arrays.

    Args:
        name: such as viewcellData.
        head: what else it says.
        arrays: by name, of the dtypes in KINDS.
    """
    places, parts, begin = {}, [], 0
    for own, values in arrays.items():
        data = np.ascontiguousarray(values).tobytes()
        places[own] = [KINDS[str(values.dtype)], begin, values.size]
        parts.append(data)
        begin += len(data)
    # Without a time in it, the same bytes give the same text.
    packed = base64.b64encode(gzip.compress(b"".join(parts), compresslevel=9, mtime=0)).decode()
    text = json.dumps({"head": head, "arrays": places}, ensure_ascii=True, separators=(",", ":"))
    return f'globalThis.{name}={text[:-1]},"packed":"{packed}"}};\n'


def _boxes(table: pa.Table) -> np.ndarray:
    return np.column_stack([table[name].to_numpy() for name in BOX_COLUMNS]).astype(np.float32)


def _bounds(boxes: np.ndarray) -> list[float]:
    """Least and most of all boxes but empty ones [m]; a metre about nothing where there is none."""
    boxes = boxes[(boxes[:, :3] <= boxes[:, 3:]).all(axis=1)]
    if not len(boxes):
        return [-1.0, -1.0, -1.0, 1.0, 1.0, 1.0]
    return [*boxes[:, :3].min(axis=0).tolist(), *boxes[:, 3:].max(axis=0).tolist()]


def _objects(walk: WalkFolder) -> dict[str, np.ndarray]:
    table = walk.objects
    starts, items = walk.object_items
    matrices = np.array(table["transform"].to_pylist(), np.float64).reshape(-1, 16)[:, :ROW]
    boxes = walk.boxes
    colours = table["colour"].fill_null(0).to_numpy().astype(np.uint32)
    return {
        # In columns, low corners and then extents, they take three fifths of the bytes.
        "objectSteps": np.concatenate([boxes[:, 0].T, (boxes[:, 1] - boxes[:, 0]).T]).astype(np.int32),
        "transforms": matrices.astype(np.float32),
        "clear": np.array([role == Role.TRANSPARENT.value for role in table["role"].to_pylist()], np.uint8),
        "ground": np.array(_ground(table), np.uint8),
        "colours": np.where(colours == 0, _item_colours(walk)[items[starts[:-1]]], colours),
        "itemStarts": starts.astype(np.uint32),
        "items": items.astype(np.uint32),
    }


def _ground(table: pa.Table) -> list[bool]:
    """Which objects one stands on: what is built, not what is put there. Shelves are no stairs."""
    roles, kinds = (table[name].to_pylist() for name in ("role", "kind"))
    return [
        role == Role.OCCLUDER.value or STOOD_ON.match(kind) is not None for role, kind in zip(roles, kinds, strict=True)
    ]


def _item_colours(walk: WalkFolder) -> np.ndarray:
    """Colour of the most faces of each item, 0xRRGGBBAA, 0 for none, uint32."""
    found = []
    columns = (walk.items[name].to_pylist() for name in ("colour_starts", "colours", "faces"))
    for begins, colours, faces in zip(*columns, strict=True):
        sizes = np.diff([*begins, faces]) if begins else np.zeros(0, int)
        found.append(colours[int(np.argmax(sizes))] if len(sizes) else 0)
    return np.array(found, np.uint32)


def _items(walk: WalkFolder) -> dict[str, np.ndarray]:
    names = {"itemOffsets": "offset", "itemVertices": "vertices", "itemFaces": "faces"}
    found = {name: walk.items[column].to_numpy().astype(np.uint32) for name, column in names.items()}
    found["itemErrors"] = walk.items["error_m"].to_numpy().astype(np.float32)
    ends = (walk.items["offset"].to_numpy() + walk.items["size"].to_numpy()).astype(np.int64)
    starts = chunk_starts(found["itemOffsets"].astype(np.int64), ends)
    found |= {"chunkStarts": starts.astype(np.uint32), "chunkEnds": ends[starts[1:] - 1].astype(np.uint32)}
    whole = np.fromfile(walk.folder / GEOMETRY, np.uint8, geometry_bytes(walk))
    return found | {"geometry": whole}


def geometry_bytes(walk: WalkFolder) -> int:
    """Of levels of detail; depth meshes come after them."""
    ends = walk.items["offset"].to_numpy() + walk.items["size"].to_numpy()
    return int(ends.max(initial=0))


def _depth(walk: WalkFolder) -> dict[str, np.ndarray]:
    """Which view cells have depth meshes, and what stands on them."""
    index = walk.depth_meshes
    rows = {int(cell): row for row, cell in enumerate(walk.cells["cell_id"].to_pylist())}
    return {
        "depthCells": np.array([rows[cell] for cell in index.cells.tolist()], np.int32),
        "depthMiddles": index.middles.astype(np.float32),
        "depthReaches": index.reaches.astype(np.float32),
        "depthErrors": index.errors.astype(np.float32),
        "depthFaces": index.faces.sum(axis=1).astype(np.uint32),
        **_codes("depthFar", encode(*index.far.ids())),
    }


def depth_scripts(walk: WalkFolder) -> Iterator[str]:
    """Scripts that hand the depth meshes of view cells to the viewer, in order."""
    index = walk.depth_meshes
    with (walk.folder / GEOMETRY).open("rb") as file:
        for row in range(len(index)):
            faces = []
            for offset, size in zip(index.offsets[row].tolist(), index.sizes[row].tolist(), strict=True):
                file.seek(offset)
                faces.append(base64.b64encode(file.read(size)).decode())
            yield f"viewcellDepth.set({row},{json.dumps(faces)});\n"


def chunks(walk: WalkFolder) -> Iterator[str]:
    """Scripts that hand the chunks of the geometry to the viewer, in order."""
    found = _items(walk)
    begins = found["itemOffsets"][found["chunkStarts"][:-1]]
    for chunk, (begin, end) in enumerate(zip(begins, found["chunkEnds"], strict=True)):
        packed = base64.b64encode(gzip.compress(found["geometry"][begin:end].tobytes(), compresslevel=6, mtime=0))
        yield f'viewcellChunks.set({chunk},"{packed.decode()}");\n'


def chunk_starts(offsets: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """First item of each chunk, and the count of items: what lies together in the file and is read together, int64.

    Args:
        offsets: first byte of each item, ascending, int64.
        ends: past the last byte of each, int64.
    """
    if not len(ends):
        return np.zeros(1, np.int64)
    size = int(np.clip(ends[-1] // CHUNKS, *CHUNK_BYTES))
    return np.append(np.unique(offsets // size, return_index=True)[1], len(offsets))


def _sets(walk: WalkFolder) -> dict[str, np.ndarray]:
    rows = {int(cell): row for row, cell in enumerate(walk.cells["cell_id"].to_pylist())}
    found = {"viewCells": np.array([rows[cell] for cell in walk.sets["cell_id"].to_pylist()], np.int32)}
    found |= {"limits": walk.limits, "memberStarts": walk.potential.ids()[0].astype(np.uint32)}
    for name, column in (("potential", "potential"), ("unknown", "unknown"), ("reached", "cells")):
        found |= _codes(name, (code or b"" for code in walk.sets[column].to_pylist()))
    return found


def _codes(name: str, codes: Iterable[bytes]) -> dict[str, np.ndarray]:
    codes = list(codes)
    starts = starts_of([len(code) for code in codes]).astype(np.uint32)
    return {name: np.frombuffer(b"".join(codes), np.uint8), f"{name}Starts": starts}


def _cells(walk: WalkFolder) -> dict[str, np.ndarray]:
    ids = walk.cells["cell_id"].to_numpy()
    plans = np.full((len(ids), 8), np.nan, np.float32)
    if "plan" in walk.cells.column_names:
        for row, plan in enumerate(walk.cells["plan"].to_pylist()):
            if plan is not None:
                plans[row] = np.array(plan, np.float64).ravel()
    order = np.argsort(ids)
    sides = [order[np.searchsorted(ids[order], walk.portals[name].to_numpy())] for name in ("cell_a", "cell_b")]
    openings = [walk.portals[name].to_numpy() for name in ("min_u", "max_u", "min_v", "max_v")]
    return {
        "cellIds": ids.astype(np.int32),
        "cellBoxes": _boxes(walk.cells),
        "cellPlans": plans,
        "inhabitable": walk.cells["inhabitable"].to_numpy(zero_copy_only=False).astype(np.uint8),
        "portalCells": np.stack(sides, axis=1).astype(np.int32) if len(sides[0]) else np.zeros((0, 2), np.int32),
        "portalAxes": walk.portals["axis"].to_numpy().astype(np.uint8),
        "portalCoordinates": walk.portals["coordinate"].to_numpy().astype(np.float32),
        "openings": np.stack(openings, axis=1).astype(np.float32),
    }
