"""The model as Arrow tables, and back: the tables that a scene folder and a bake folder share."""

import json
from itertools import pairwise

import numpy as np
import pyarrow as pa

from ..animation import Animation
from ..errors import InputError
from ..ragged import starts_of
from ..scene import Definition, Instance, Mesh, NamedStorey, Role, Scene, Space

STOREY_COLUMNS = ("storey", "elevation_m")
BOX_COLUMNS = ("min_x", "min_y", "min_z", "max_x", "max_y", "max_z")
TABLE_COLUMNS = {
    "meshes": ("definition_id", "lod", "error_m", "vertices", "faces"),
    "objects": ("object_id", "name", "kind", "definition_id", "transform", "opaque", "role", *BOX_COLUMNS),
    "spaces": ("name", "vertices", "faces"),
    "openings": BOX_COLUMNS,
}


def meshes_table(scene: Scene) -> pa.Table:
    """`meshes.parquet`: one row for each level of detail of each definition.

    Raises:
        InputError: a vertex is not exact in float32.
    """
    rows = [(i, lod, mesh) for i, shape in enumerate(scene.definitions) for lod, mesh in enumerate(shape.lods)]
    vertices = [mesh.vertices.astype(np.float32) for _, _, mesh in rows]
    for (i, lod, mesh), stored in zip(rows, vertices, strict=True):
        if not np.array_equal(stored.astype(np.float64), mesh.vertices):
            name = scene.definitions[i].name
            raise InputError(f"definition {i} {name!r} lod {lod}: expected vertices exact in float32, found others")
    return pa.table(
        {
            "definition_id": pa.array([i for i, _, _ in rows], pa.int32()),
            "lod": pa.array([lod for _, lod, _ in rows], pa.int32()),
            "error_m": pa.array([mesh.error_m for _, _, mesh in rows], pa.float64()),
            "vertices": list_column(vertices, np.float32),
            "faces": list_column([mesh.faces for _, _, mesh in rows], np.int32),
            **colour_columns([mesh for _, _, mesh in rows]),
        },
        metadata={"definition_names": json.dumps([shape.name for shape in scene.definitions])},
    )


def objects_table(scene: Scene) -> pa.Table:
    """`objects.parquet`: one row for each object; boxes in metres of the snapped model, null where nothing is left.

    `storey` and `elevation_m` are null where the file says none; `materials` is a list, empty where it says none.
    """
    boxes = scene.object_bounds()
    columns = {
        "object_id": pa.array(range(len(scene.objects)), pa.int32()),
        "name": pa.array([placed.name for placed in scene.objects], pa.string()),
        "kind": pa.array([placed.kind for placed in scene.objects], pa.string()),
        "definition_id": pa.array([placed.definition_id for placed in scene.objects], pa.int32()),
        "transform": list_column([placed.transform for placed in scene.objects], np.float64),
        "opaque": pa.array([placed.opaque for placed in scene.objects], pa.bool_()),
        "role": pa.array([placed.role.value for placed in scene.objects], pa.string()),
        "guid": pa.array([placed.guid or None for placed in scene.objects], pa.string()),
    }
    columns |= box_columns(boxes * scene.grid_m, empty=boxes[:, 0, 0] > boxes[:, 1, 0])
    columns |= storey_columns([placed.storey for placed in scene.objects])
    columns["materials"] = pa.array([placed.materials for placed in scene.objects], pa.list_(pa.string()))
    # Most models have none of these; their folders stay as they were before there were such.
    more = look_columns(scene.objects)
    return pa.table(columns | {name: column for name, column in more.items() if column.null_count < len(column)})


def look_columns(objects: list[Instance]) -> dict[str, pa.Array]:
    """Colours (0xRRGGBBAA), motions and their periods [s] of objects, null where there are none or no end."""
    moving = [placed.animation for placed in objects]
    periods = [None if one is None or one.period_s == np.inf else one.period_s for one in moving]
    colours = [None if placed.colour is None else int.from_bytes(placed.colour, "big") for placed in objects]
    return {
        "colour": pa.array(colours, pa.uint32()),
        "animation": pa.array([None if one is None else one.text for one in moving], pa.string()),
        "period_s": pa.array(periods, pa.float64()),
    }


def storey_columns(storeys: list[NamedStorey | None]) -> dict[str, pa.Array]:
    """Names and elevations [m] of storeys; both null for None, the latter also where the file states none."""
    found = [(None, None) if storey is None else (storey.name, storey.elevation_m) for storey in storeys]
    kinds = pa.string(), pa.float64()
    return {name: pa.array([pair[k] for pair in found], kinds[k]) for k, name in enumerate(STOREY_COLUMNS)}


def rooms_table(spaces: list[Space]) -> pa.Table:
    """`rooms.parquet`: one row for each room, by room_id, with what the model's file says of it in words.

    Nulls stand for what it does not say.
    """
    columns = {
        "room_id": pa.array(range(len(spaces)), pa.int32()),
        "name": pa.array([space.name for space in spaces], pa.string()),
        "long_name": pa.array([space.long_name or None for space in spaces], pa.string()),
        "guid": pa.array([space.guid or None for space in spaces], pa.string()),
    }
    return pa.table(columns | storey_columns([space.storey for space in spaces]))


def spaces_table(spaces: list[Space]) -> pa.Table:
    """`spaces.parquet`: one row for each room volume, metres, float64."""
    return pa.table(
        {
            "name": pa.array([space.name for space in spaces], pa.string()),
            "vertices": list_column([space.vertices for space in spaces], np.float64),
            "faces": list_column([space.faces for space in spaces], np.int32),
        }
    )


def openings_table(openings: np.ndarray) -> pa.Table:
    """`openings.parquet`: one row for each box of shape (n, 2, 3), metres."""
    return pa.table(box_columns(np.asarray(openings, np.float64).reshape(-1, 2, 3)))


def scene_from_tables(
    manifest: dict,
    meshes: pa.Table,
    objects: pa.Table,
    spaces: pa.Table | None = None,
    openings: pa.Table | None = None,
    rooms: pa.Table | None = None,
) -> Scene:
    """The scene that a manifest and its tables describe; all but `meshes` and `objects` may be left out.

    Raises:
        InputError: the tables contradict each other or the manifest.
    """
    scene = Scene(
        definitions=_definitions(meshes),
        objects=_objects(objects),
        spaces=_spaces(spaces, rooms) if spaces is not None else [],
        openings=_openings(openings) if openings is not None else np.zeros((0, 2, 3)),
        origin=np.array(manifest["origin"], np.float64),
        yaw_deg=float(manifest.get("yaw_deg", 0.0)),
        grid_m=float(manifest["grid_m"]),
        source=str(manifest.get("source", "")),
        sha256=str(manifest.get("sha256", "")),
        unit=str(manifest.get("unit", "metre")),
        skipped=list(manifest.get("skipped", [])),
        notes=list(manifest.get("notes", [])),
    )
    if scene.origin.shape != (3,) or not np.isfinite(scene.origin).all():
        raise InputError(f"manifest.json: expected origin to be 3 finite numbers, found {manifest['origin']}")
    if not 0 < scene.grid_m < np.inf:
        raise InputError(f"manifest.json: expected grid_m above 0, found {manifest['grid_m']}")
    _check_counts(scene, manifest.get("counts", {}))
    return scene


def _check_counts(scene: Scene, counts: dict) -> None:
    found = {"definitions": len(scene.definitions), "objects": len(scene.objects)}
    for what, count in found.items():
        if counts.get(what, count) != count:
            raise InputError(f"manifest.json: expected {counts[what]} {what}, found {count} in the tables")
    for object_id, placed in enumerate(scene.objects):
        if not 0 <= placed.definition_id < len(scene.definitions):
            raise InputError(
                f"objects.parquet: object {object_id}: expected a definition_id below {len(scene.definitions)}, "
                f"found {placed.definition_id}"
            )


def _definitions(meshes: pa.Table) -> list[Definition]:
    names = json.loads((meshes.schema.metadata or {}).get(b"definition_names", b"[]"))
    ids, lods = meshes["definition_id"].to_pylist(), meshes["lod"].to_pylist()
    errors = meshes["error_m"].to_pylist()
    vertices, faces = list_rows(meshes["vertices"], 3), list_rows(meshes["faces"], 3)
    colours = colours_of(meshes, faces)
    levels: list[list[Mesh]] = []
    for row, (definition_id, lod) in enumerate(zip(ids, lods, strict=True)):
        where = f"meshes.parquet: row {row}"
        if lod == 0 and definition_id == len(levels):
            levels.append([])
        if definition_id != len(levels) - 1 or lod != len(levels[-1]):
            raise InputError(f"{where}: expected rows in order of definition_id and lod, found {definition_id}, {lod}")
        _check_faces(faces[row], len(vertices[row]), where)
        points, corners = vertices[row].astype(np.float64), faces[row].astype(np.int32)
        levels[-1].append(Mesh(points, corners, float(errors[row]), colours[row]))
    names = names if len(names) == len(levels) else [f"definition {i}" for i in range(len(levels))]
    return [Definition(name, tuple(meshes)) for name, meshes in zip(names, levels, strict=True)]


def colour_columns(meshes: list[Mesh]) -> dict[str, pa.Array]:
    """Base colours by runs of faces: where each run begins, and its 0xRRGGBBAA; empty lists where none is known."""
    starts, colours = [], []
    for mesh in meshes:
        packed = np.zeros(0, np.uint32) if mesh.colours is None else mesh.colours.view(">u4")[:, 0].astype(np.uint32)
        begins = np.flatnonzero(np.append(np.ones(min(1, len(packed)), bool), packed[1:] != packed[:-1]))
        starts.append(begins)
        colours.append(packed[begins])
    return {"colour_starts": list_column(starts, np.int32), "colours": list_column(colours, np.uint32)}


def colours_of(meshes: pa.Table, faces: list[np.ndarray]) -> list[np.ndarray | None]:
    """Colours of the faces of each row, (m, 4), uint8, from the columns of `colour_columns`; None where there are none.

    Raises:
        InputError: runs that are none.
    """
    # Folders of before 0.2 have no colours.
    if "colours" not in meshes.column_names:
        return [None] * len(faces)
    found: list[np.ndarray | None] = []
    for row, (begins, packed) in enumerate(
        zip(list_rows(meshes["colour_starts"], 1), list_rows(meshes["colours"], 1), strict=True)
    ):
        lengths = np.diff(np.append(begins.ravel(), len(faces[row])))
        if len(begins) != len(packed) or (len(begins) and (begins[0, 0] != 0 or (lengths < 0).any())):
            where = f"meshes.parquet: row {row}"
            raise InputError(f"{where}: expected runs of coloured faces from 0 upwards, found {len(begins)} others")
        runs = packed.ravel().astype(">u4").view(np.uint8).reshape(-1, 4)
        found.append(np.repeat(runs, lengths, axis=0) if len(runs) else None)
    return found


def _objects(objects: pa.Table) -> list[Instance]:
    columns = ("object_id", "name", "kind", "definition_id", "role")
    # Older folders have no GUIDs, storeys and materials.
    words = optional(objects, "guid"), _storeys(objects), optional(objects, "materials"), _looks(objects)
    rows = zip(
        *(objects[name].to_pylist() for name in columns), list_rows(objects["transform"], 4), *words, strict=True
    )
    found = []
    for row, (object_id, name, kind, definition_id, role, transform, guid, storey, materials, look) in enumerate(rows):
        where = f"objects.parquet: row {row}"
        if object_id != row:
            raise InputError(f"{where}: expected object_id {row}, found {object_id}")
        if role not in list(Role):
            raise InputError(f"{where}: expected role occluder, detail or transparent, found {role!r}")
        if transform.shape != (4, 4) or not np.isfinite(transform).all():
            raise InputError(f"{where}: expected a transform of 16 finite numbers, found {transform.size}")
        more = {"storey": storey, "materials": tuple(materials or ()), **look}
        found.append(Instance(name, kind, definition_id, transform.astype(np.float64), Role(role), guid or "", **more))
    return found


def optional(table: pa.Table, name: str) -> list:
    """Values of a column that older folders lack: then all None."""
    return table[name].to_pylist() if name in table.column_names else [None] * table.num_rows


def _looks(table: pa.Table) -> list[dict]:
    """Colour and motion of each object, as `Instance` takes them."""
    columns = (optional(table, name) for name in ("colour", "animation", "period_s"))
    found = []
    for colour, text, period in zip(*columns, strict=True):
        shown = None if colour is None else tuple(colour.to_bytes(4, "big"))
        moving = None if text is None else Animation(text, np.inf if period is None else period)
        found.append({"colour": shown, "animation": moving})
    return found


def _storeys(table: pa.Table) -> list[NamedStorey | None]:
    pairs = zip(*(optional(table, name) for name in STOREY_COLUMNS), strict=True)
    return [None if name is None else NamedStorey(name, elevation) for name, elevation in pairs]


def _spaces(spaces: pa.Table, rooms: pa.Table | None) -> list[Space]:
    if rooms is None:
        rooms = pa.table({"room_id": pa.array(range(spaces.num_rows))})
    if rooms["room_id"].to_pylist() != list(range(spaces.num_rows)):
        raise InputError(f"rooms.parquet: expected a row for each of {spaces.num_rows} rooms in order, found others")
    vertices, faces = list_rows(spaces["vertices"], 3), list_rows(spaces["faces"], 3)
    for row in range(spaces.num_rows):
        _check_faces(faces[row], len(vertices[row]), f"spaces.parquet: row {row}")
    words = zip(*([text or "" for text in optional(rooms, name)] for name in ("long_name", "guid")), strict=True)
    rows = zip(spaces["name"].to_pylist(), vertices, faces, words, _storeys(rooms), strict=True)
    return [
        Space(name, points.astype(np.float64), corners.astype(np.int32), *said, storey)
        for name, points, corners, said, storey in rows
    ]


def _openings(openings: pa.Table) -> np.ndarray:
    columns = [openings[name].to_numpy().astype(np.float64) for name in BOX_COLUMNS]
    return np.stack(columns, axis=1).reshape(-1, 2, 3)


def _check_faces(faces: np.ndarray, vertex_count: int, where: str) -> None:
    if faces.size and not (0 <= faces.min() and faces.max() < vertex_count):
        raise InputError(f"{where}: expected vertex indices below {vertex_count}, found {faces.min()} to {faces.max()}")


def list_column(arrays: list[np.ndarray], dtype: type) -> pa.ListArray:
    """A list column from arrays of any shape, read row by row."""
    flat = [np.asarray(array, dtype).ravel() for array in arrays]
    offsets = starts_of([len(array) for array in flat]).astype(np.int32)
    values = np.concatenate([np.zeros(0, dtype), *flat])
    return pa.ListArray.from_arrays(pa.array(offsets), pa.array(values))


def list_rows(column: pa.ChunkedArray, width: int) -> list[np.ndarray]:
    """Rows of a list column, each of shape (n, width)."""
    column = column.combine_chunks()
    values, offsets = column.values.to_numpy(zero_copy_only=False), column.offsets.to_numpy()
    if (np.diff(offsets) % width).any():
        raise InputError(f"expected lists of a multiple of {width} numbers, found another length")
    return [values[a:b].reshape(-1, width) for a, b in pairwise(offsets)]


def box_columns(boxes: np.ndarray, empty: np.ndarray | None = None) -> dict[str, pa.Array]:
    """Columns of boxes of shape (n, 2, 3), null where a mask says so."""
    flat = boxes.reshape(-1, 6)
    return {name: pa.array(flat[:, i], pa.float64(), mask=empty) for i, name in enumerate(BOX_COLUMNS)}
