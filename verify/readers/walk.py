"""A second reader of display databases, which knows their description only, and compares them with the bake.

It shares nothing with `data/store/walk_folder.py`, nor with the code of runs: plain loops over bytes.
"""

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from ...data.store.bake_folder import BakeFolder


def read_code(code: bytes) -> set[int]:
    """Ids of a set of runs."""
    numbers, value, bits = [], 0, 0
    for byte in code:
        value |= (byte & 127) << bits
        bits += 7
        if byte < 128:
            numbers.append(value)
            value, bits = 0, 0
    ids: set[int] = set()
    end = 0
    for k in range(0, len(numbers), 2):
        first = end + numbers[k] + (1 if k else 0)
        end = first + numbers[k + 1] + 1
        ids.update(range(first, end))
    return ids


def item_triangles(data: bytes, row: dict, transform: np.ndarray, grid_m: float) -> list:
    """World triangles of an item [grid steps], in an order of their own."""
    at, count = row["offset"], 12 * row["vertices"]
    points = np.frombuffer(data[at : at + count], "<f4").reshape(-1, 3).astype(float)
    corners = np.frombuffer(data[at + count : at + row["size"]], "<u2" if row["vertices"] <= 65536 else "<u4")
    return world_triangles(points, corners.reshape(-1, 3), transform, grid_m)


def world_triangles(points: np.ndarray, faces: np.ndarray, transform: np.ndarray, grid_m: float) -> list:
    """Triangles of a mesh where an object has it, each from its least corner on."""
    placed = np.round((points @ transform[:3, :3].T + transform[:3, 3]) / grid_m).astype(int)
    return sorted(least_first(*map(tuple, corners)) for corners in placed[faces].tolist())


def least_first(a: tuple, b: tuple, c: tuple) -> tuple:
    """The same triangle from its least corner on."""
    return min((a, b, c), (b, c, a), (c, a, b))


def turned(triangles: list) -> list:
    """Triangles that wind the other way."""
    return sorted(least_first(a, c, b) for a, b, c in triangles)


def differences(folder: str | Path, bake: BakeFolder) -> list[str]:
    """What of a display database is not as the bake has it, a line for each kind of fault in each row; none if all is.

    Sets, boxes, limits of levels, triangles of every level, and colours.
    """
    folder, found = Path(folder), []
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    tables = {name: pq.read_table(folder / f"{name}.parquet").to_pylist() for name in _tables(folder)}
    objects = tables["objects"]
    ids = [row["object_id"] for row in objects]
    if sorted(ids) != list(range(len(bake.scene.objects))):
        found.append("objects: not each once")
    found += _sets(tables, ids, bake)
    data = (folder / "geometry.bin").read_bytes()
    for row in objects:
        found += _shape(row, tables["items"], data, bake, manifest["flattened"])
    return found


def _tables(folder: Path) -> list[str]:
    return [path.stem for path in folder.glob("*.parquet")]


def _sets(tables: dict, ids: list[int], bake: BakeFolder) -> list[str]:
    """Faults of sets and of limits of levels."""
    found = []
    potential: dict[int, set[int]] = {c: set() for c in np.flatnonzero(bake.graph.inhabitable).tolist()}
    unknown: dict[int, set[int]] = {c: set() for c in potential}
    for row in bake.cell_to_object.to_pylist():
        potential[row["cell_id"]].add(row["object_id"])
        if row["verdict"] == "unknown":
            unknown[row["cell_id"]].add(row["object_id"])
    cells = [row["cell_id"] for row in tables["cells"]]
    limits = {(row["cell_id"], row["object_id"]): row["lod"] for row in bake.cell_lods.to_pylist()}
    told = {row["cell_id"]: row["limits"] for row in tables["cell_items"]}
    if [row["cell_id"] for row in tables["sets"]] != sorted(potential) or sorted(cells) != list(range(len(cells))):
        return ["sets: not a row for each view cell, or cells not each once"]
    for row in tables["sets"]:
        cell = row["cell_id"]
        display = sorted(read_code(row["potential"]))
        if {ids[k] for k in display} != potential[cell]:
            found.append(f"cell {cell}: another potential set")
        if {ids[k] for k in read_code(row["unknown"])} != unknown[cell]:
            found.append(f"cell {cell}: another unknown set")
        if list(told[cell]) != [limits.get((cell, ids[k]), 0) for k in display]:
            found.append(f"cell {cell}: other limits of levels")
        if (row["cells"] is None) == bake.claims_cells:
            found.append(f"cell {cell}: cells claimed or not claimed")
        elif row["cells"] is not None:
            reached = {cells[k] for k in read_code(row["cells"])}
            if reached != set(np.flatnonzero(bake.potential_cells[cell]).tolist()):
                found.append(f"cell {cell}: another set of cells")
    return found


def _shape(row: dict, items: list[dict], data: bytes, bake: BakeFolder, flattened: bool) -> list[str]:
    """Faults of an object: its box, and triangles and colours of its levels."""
    number, scene, found = row["object_id"], bake.scene, []
    placed = scene.objects[number]
    meshes = scene.definitions[placed.definition_id].lods
    if row["colour"] != (None if placed.colour is None else int.from_bytes(placed.colour, "big")):
        found.append(f"object {number}: another colour")
    if row["animation"] != (None if placed.animation is None else placed.animation.text):
        found.append(f"object {number}: another motion")
    if len(meshes) != len(row["items"]):
        return [f"object {number}: another number of levels"]
    transform = np.array(row["transform"]).reshape(4, 4)
    for lod, (item, mesh) in enumerate(zip(row["items"], meshes, strict=True)):
        here = item_triangles(data, items[item], transform, scene.grid_m)
        there = world_triangles(mesh.vertices, mesh.faces, placed.transform, scene.grid_m)
        if flattened and placed.animation is None and np.linalg.det(placed.transform[:3, :3]) < 0:
            there = turned(there)
        if here != there or items[item]["offset"] % 16:
            found.append(f"object {number}: other triangles at level {lod}")
        if _colours(items[item]) != ([] if mesh.colours is None else mesh.colours.tolist()):
            found.append(f"object {number}: other colours at level {lod}")
        if items[item]["error_m"] < mesh.error_m * (0.0 if flattened else 1.0):
            found.append(f"object {number}: a smaller error at level {lod}")
        if lod == 0 and row["animation"] is None:
            corners = np.array([t for t in here if len(_plane(t))]).reshape(-1, 3)
            found += _box(row, corners * scene.grid_m)
    return found


def _plane(triangle: tuple) -> list[int]:
    """Components of a triangle's normal that are not zero: none if it has no area."""
    a, b, c = (np.array(corner, object) for corner in triangle)
    u, v = b - a, c - a
    return [n for n in (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]) if n]


def _box(row: dict, corners: np.ndarray) -> list[str]:
    box = [row[f"{end}_{axis}"] for end in ("min", "max") for axis in "xyz"]
    want = [*corners.min(axis=0), *corners.max(axis=0)] if len(corners) else [None] * 6
    return [] if box == want else [f"object {row['object_id']}: another box"]


def _colours(item: dict) -> list[list[int]]:
    """Colour of each face: red, green, blue, opacity; none where none is told."""
    starts, packed = [*item["colour_starts"], item["faces"]], item["colours"]
    found: list[list[int]] = []
    for k, colour in enumerate(packed):
        found += [list(colour.to_bytes(4, "big"))] * (starts[k + 1] - starts[k])
    return found
