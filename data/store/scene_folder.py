"""A bake-ready scene on disk: one folder of JSON and Parquet, whose tables the bake folder reuses.

`manifest.json`, `meshes.parquet`, `objects.parquet`, `spaces.parquet`, `openings.parquet`, and `rooms.parquet`, which
older folders lack and which says in words what `spaces.parquet` has as volumes, row by row. Vertices are stored as
float32, so a mesh must hold values that float32 holds exactly: the snapped model is then the same before and after.
"""

import json
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from ..errors import InputError
from ..scene import Scene
from .scene_tables import (
    TABLE_COLUMNS,
    meshes_table,
    objects_table,
    openings_table,
    rooms_table,
    scene_from_tables,
    spaces_table,
)

FORMAT = 1
# Of bakes with view cells that are prisms: who reads them as boxes would claim too much.
PLAN_FORMAT = 2
# A folder that is being written is .NAME.writing.XXXX beside it; the one that it replaces is that with .old after it.
WRITING, OLD = ".writing.", ".old"
MANIFEST_KEYS = ("format", "kind", "origin", "grid_m", "unit", "source", "sha256", "skipped", "counts", "complete")


def write_scene(scene: Scene, folder: str | Path) -> None:
    """Write a scene folder in one step: it is there whole, or what was there before still is.

    Args:
        scene: the scene; mesh vertices must be exact in float32.
        folder: where to; a scene folder already there is replaced.

    Raises:
        InputError: the folder holds something else, cannot be written, or a vertex is not exact in float32.
    """
    tables = {
        "meshes": meshes_table(scene),
        "objects": objects_table(scene),
        "spaces": spaces_table(scene.spaces),
        "openings": openings_table(scene.openings),
        "rooms": rooms_table(scene.spaces),
    }
    manifest = scene_manifest(scene) | {"kind": "scene", "complete": True}
    with new_folder(folder, "scene", tables) as temporary:
        for name, table in tables.items():
            pq.write_table(table, temporary / f"{name}.parquet", compression="zstd")
        (temporary / "manifest.json").write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")


def read_scene(folder: str | Path) -> Scene:
    """The scene that `write_scene` wrote.

    Raises:
        InputError: the folder is missing, incomplete, of another kind or format, or its tables contradict each other.
    """
    folder = Path(folder)
    manifest = read_manifest(folder, kind="scene")
    missing = [key for key in MANIFEST_KEYS if key not in manifest]
    if missing:
        raise InputError(f"{folder / 'manifest.json'}: expected the key {missing[0]!r}, found none")
    tables = {name: read_table(folder / f"{name}.parquet", columns) for name, columns in TABLE_COLUMNS.items()}
    if (folder / "rooms.parquet").exists():
        tables["rooms"] = read_table(folder / "rooms.parquet", ("room_id",))
    try:
        scene = scene_from_tables(manifest, **tables)
    except InputError as error:
        raise InputError(f"{folder}: {error}") from None
    except (ValueError, TypeError, IndexError, KeyError, AttributeError, pa.ArrowException) as error:
        raise InputError(f"{folder}: expected a readable scene, found {one_line(error)}") from None
    return scene


def scene_manifest(scene: Scene) -> dict[str, object]:
    """What a manifest says of the model; ready for JSON."""
    return {
        "format": FORMAT,
        "source": scene.source,
        "sha256": scene.sha256,
        "unit": scene.unit,
        "grid_m": scene.grid_m,
        "origin": [float(x) for x in scene.origin],
        "yaw_deg": scene.yaw_deg,
        "max_snap_m": scene.max_snap_m(),
        "counts": {
            "definitions": len(scene.definitions),
            "objects": len(scene.objects),
            "triangles": len(scene.triangles()[0]),
            "spaces": len(scene.spaces),
            "openings": len(scene.openings),
            "skipped": len(scene.skipped),
        },
        "skipped": scene.skipped,
        "notes": scene.notes,
    }


def read_manifest(folder: str | Path, kind: str) -> dict:
    """The manifest of a complete folder of this kind and format.

    Raises:
        InputError: it is missing, unreadable, unfinished, or of another kind or format.
    """
    path = Path(folder) / "manifest.json"
    try:
        manifest = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: expected a {kind} folder's manifest, found {error.strerror}") from None
    except ValueError as error:
        raise InputError(f"{path}: expected JSON, found {one_line(error)}") from None
    if not isinstance(manifest, dict):
        raise InputError(f"{path}: expected a JSON object, found {type(manifest).__name__}")
    formats = (FORMAT, PLAN_FORMAT) if kind == "bake" else (FORMAT,)
    for key, values in (("format", formats), ("kind", (kind,)), ("complete", (True,))):
        if manifest.get(key) not in values:
            raise InputError(f"{path}: expected {key} {' or '.join(map(repr, values))}, found {manifest.get(key)!r}")
    return manifest


def read_table(path: Path, columns: tuple[str, ...]) -> pa.Table:
    """A Parquet table that has these columns.

    Raises:
        InputError: it is missing, unreadable, or lacks a column.
    """
    if not path.is_file():
        raise InputError(f"{path}: expected a Parquet table, found nothing there")
    try:
        table = pq.read_table(path)
    except (OSError, pa.ArrowException) as error:
        raise InputError(f"{path}: expected a Parquet table, found {one_line(error)}") from None
    missing = [name for name in columns if name not in table.column_names]
    if missing:
        raise InputError(f"{path}: expected the column {missing[0]!r}, found {', '.join(table.column_names)}")
    return table


@contextmanager
def new_folder(folder: str | Path, kind: str, tables: Iterable[str]) -> Iterator[Path]:
    """A temporary folder beside `folder` that takes its place when the block ends well, and vanishes when it does not.

    Files and folders that were in `folder` and are none of this kind's own, such as notes of a user, stay in it.

    Args:
        folder: to make.
        kind: as its manifest says it.
        tables: names of all tables that a folder of this kind may hold.

    Raises:
        InputError: `folder` is there but no folder of this kind, or writing failed (a full disk, no permission).
    """
    folder = Path(folder)
    refuse_others(folder, kind)
    temporary = None
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=f".{folder.name}{WRITING}", dir=folder.parent))
        temporary.chmod(0o755)
        yield temporary
        if folder.exists():
            _keep_others(folder, temporary, {"manifest.json", *(f"{name}.parquet" for name in tables)})
        _replace(temporary, folder)
    except OSError as error:
        raise InputError(f"{folder}: expected to be able to write there, found {one_line(error)}") from None
    finally:
        if temporary is not None:
            shutil.rmtree(temporary, ignore_errors=True)


def _keep_others(old: Path, new: Path, own: set[str]) -> None:
    """Put what is in the old folder and not its own, nor made anew, into the new one too: nothing is lost meanwhile."""
    for part in old.iterdir():
        if part.name in own or (new / part.name).exists():
            continue
        if part.is_dir() and not part.is_symlink():
            shutil.copytree(part, new / part.name, symlinks=True)
        else:
            shutil.copy2(part, new / part.name, follow_symlinks=False)


def _replace(temporary: Path, folder: Path) -> None:
    if not folder.exists():
        os.rename(temporary, folder)
        return
    old = temporary.with_name(temporary.name + OLD)
    os.rename(folder, old)
    os.rename(temporary, folder)
    shutil.rmtree(old, ignore_errors=True)


def refuse_others(folder: str | Path, kind: str) -> None:
    """Refuse a place that is neither free, nor empty, nor a folder of a kind.

    Raises:
        InputError: something else is there.
    """
    place = Path(folder)
    if place.exists() and not (place.is_dir() and _replaceable(place, kind)):
        raise InputError(f"{folder}: expected a new name or a {kind} folder to replace, found something else there")


def _replaceable(folder: Path, kind: str) -> bool:
    manifest = _manifest_of(folder)
    return not any(folder.iterdir()) if manifest is None else manifest.get("kind") == kind


def held_manifest(folder: Path, kind: str) -> dict | None:
    """Manifest of a complete folder of a kind, of any format; None where there is none."""
    manifest = _manifest_of(folder) or {}
    return manifest if manifest.get("kind") == kind and manifest.get("complete") else None


def _manifest_of(folder: Path) -> dict | None:
    """What a folder's manifest says, whatever it is of; None where none can be read."""
    try:
        manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return manifest if isinstance(manifest, dict) else None


def one_line(error: Exception) -> str:
    """The first line of an error's message, or its type where it has none."""
    lines = str(error).strip().splitlines()
    return lines[0] if lines else type(error).__name__
