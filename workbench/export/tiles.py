"""A bake as a 3D Tiles 1.1 tileset that shows to an eye what it may see, and the same as a draft of glTF.

A tile for each view cell has it as `viewerRequestVolume`: inside, it shows what the cell may see. Tiles add up,
so that an eye in no view cell would see nothing: boxes that fill the rest of space show everything there. A viewer that
knows no `viewerRequestVolume` shows all of them: too much, never too little.
"""

import json
from pathlib import Path

import numpy as np

from ...data.store.bake_folder import BakeFolder
from ...data.store.scene_folder import new_folder
from ...data.version import __version__
from .draft import draft_files
from .glb import objects_as_gltf
from .place import FOLDER_KIND
from .volumes import TiledBake, tiled

FORMAT = 1
# What is shown is refined while the model covers more than a fraction of a pixel: this many times its size is the
# error of not refining it, and viewers refine what is wrong by about 16 pixels.
ERROR = 100.0


def write_tiles(bake: BakeFolder, folder: Path) -> None:
    """Write the tileset's folder, in one step; files of others that are in it stay.

    Raises:
        InputError: the bake is of a bare cell graph, or the folder cannot be written.
    """
    parts = tiled(bake)
    documents = _tilesets(parts) | draft_files(parts) | {"manifest.json": _manifest(parts)}
    with new_folder(folder, FOLDER_KIND, ()) as temporary:
        for name in ("cells", "groups", "shapes"):
            (temporary / name).mkdir()
        for name, document in documents.items():
            _write(temporary / name, document)
        written: set[str] = set()
        for number, members in enumerate(parts.groups.objects):
            document, shapes = objects_as_gltf(bake.scene, members, np.eye(4), "../")
            _write(temporary / "groups" / f"{number}.gltf", document)
            for name in shapes.keys() - written:
                (temporary / name).write_bytes(shapes[name])
            written |= shapes.keys()


def _write(file: Path, document: dict) -> None:
    text = json.dumps(document, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    file.write_text(text + "\n", encoding="utf-8")


def _manifest(parts: TiledBake) -> dict:
    counts = {"view_cells": len(parts.cells), "outside": len(parts.outside), "groups": len(parts.groups.objects)}
    return {
        "kind": FOLDER_KIND,
        "format": FORMAT,
        "viewcell": __version__,
        "source": parts.bake.manifest.get("model", {}).get("path", ""),
        "counts": counts | {"tilted_view_cells_where_all_is_shown": parts.tilted},
        "complete": True,
    }


def _tilesets(parts: TiledBake) -> dict[str, dict]:
    """tileset.json; all.json, which shows every group; and cells/ID.json, which show those of a cell."""
    groups, grid_m = parts.groups, parts.bake.grid_m
    whole = _around(groups.boxes)
    error = round(ERROR * float(np.linalg.norm((whole[1] - whole[0]) * grid_m)), 3)

    def tile(box: np.ndarray, **more: object) -> dict:
        return {"boundingVolume": _box(box, grid_m), "geometricError": error, **more}

    def tileset(chosen: list[int], box: np.ndarray, up: str) -> dict:
        leaves = [
            {
                "boundingVolume": _box(groups.boxes[group], grid_m),
                "geometricError": 0,
                "content": {"uri": f"{up}groups/{group}.gltf"},
            }
            for group in chosen
        ]
        return _tileset(tile(box, refine="ADD", **({"children": leaves} if leaves else {})))

    out, children = {"all.json": tileset(list(range(len(groups.boxes))), whole, "")}, []
    for cell, volume, chosen in zip(parts.cells.tolist(), parts.volumes, groups.of_cells, strict=True):
        box, name = _around(groups.boxes[chosen]), f"cells/{cell}.json"
        out[name] = tileset(chosen, box, "../")
        children.append(
            tile(box, viewerRequestVolume=_box(volume, grid_m), content={"uri": name}, extras={"cell": cell})
        )
    for volume in parts.outside:
        children.append(tile(whole, viewerRequestVolume=_box(volume, grid_m), content={"uri": "all.json"}))
    root = tile(whole, refine="ADD", transform=parts.place.T.ravel().tolist(), children=children)
    return out | {"tileset.json": _tileset(root)}


def _tileset(root: dict) -> dict:
    asset = {"version": "1.1", "generator": f"viewcell {__version__}"}
    return {"asset": asset, "geometricError": root["geometricError"], "root": root}


def _around(boxes: np.ndarray) -> np.ndarray:
    """The box around boxes; of none, a point."""
    if not len(boxes):
        return np.zeros((2, 3), np.int64)
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


def _box(box: np.ndarray, grid_m: float) -> dict:
    """A box as 3D Tiles has it: its middle, then half of each edge."""
    middle, half = (box[0] + box[1]) * grid_m / 2, (box[1] - box[0]) * grid_m / 2
    return {"box": [*middle.tolist(), half[0], 0, 0, 0, half[1], 0, 0, 0, half[2]]}
