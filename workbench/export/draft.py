"""The tileset as glTF: nodes that are visible while the camera is in a volume. A draft that no engine reads yet.

`KHR_node_visibility` is ratified; `EXT_node_visibility_volume` (CesiumGS, August 2026) and the shapes, files and
external assets of glTF 2.1 that it needs are drafts, and may change. A reader that knew the first only would hide all
that is marked so: both are required, and the asset says 2.1 at least, so that it refuses the file instead.

Source: github.com/CesiumGS/glTF, branch 3d-tiles-2.0, extensions/2.1/Vendor/EXT_node_visibility_volume.
"""

import numpy as np

from ...data.buildings.glb import Z_UP_TO_Y_UP
from ...data.version import __version__
from .volumes import TiledBake

EXTENSIONS = ["KHR_node_visibility", "EXT_node_visibility_volume"]
KIND = "model/gltf+json"
NAMES = ("draft.gltf", "draft_all.gltf")


def draft_files(parts: TiledBake) -> dict[str, dict]:
    """draft.gltf, and draft_all.gltf, which it shows outside of view cells."""
    groups = len(parts.groups.objects)
    whole = _Document()
    for group in range(groups):
        whole.add({"externalAsset": whole.asset(f"groups/{group}.gltf")})
    document = _Document()
    for cell, volume, chosen in zip(parts.cells.tolist(), parts.volumes, parts.groups.of_cells, strict=True):
        children = [{"externalAsset": document.asset(f"groups/{g}.gltf")} for g in chosen]
        document.add(document.shown_in(volume * parts.bake.grid_m) | {"extras": {"cell": cell}}, children)
    for volume in parts.outside * parts.bake.grid_m:
        everything = document.asset(NAMES[1])
        document.add(document.shown_in(volume) | {"externalAsset": everything})
    place = Z_UP_TO_Y_UP @ parts.place @ Z_UP_TO_Y_UP.T
    return {NAMES[0]: document.written(EXTENSIONS, place), NAMES[1]: whole.written([], np.eye(4))}


class _Document:
    """A glTF 2.1 document of external assets, as it grows."""

    def __init__(self) -> None:
        self._nodes: list[dict] = [{"children": []}]
        self._files: dict[str, int] = {}
        self._shapes: dict[tuple, int] = {}

    def asset(self, uri: str) -> int:
        """Number of an external asset."""
        if uri not in self._files:
            self._files[uri] = len(self._files)
        return self._files[uri]

    def add(self, node: dict, children: list[dict] | tuple = ()) -> None:
        """Put a node under the root, and others under it."""
        self._nodes[0]["children"].append(len(self._nodes))
        self._nodes.append(node)
        if children:
            node["children"] = list(range(len(self._nodes), len(self._nodes) + len(children)))
            self._nodes += children

    def shown_in(self, box: np.ndarray) -> dict:
        """Extensions of a node that is shown while the camera is in a box [m], Z up."""
        middle, size = box.mean(axis=0), box[1] - box[0]
        sides = tuple(size[[0, 2, 1]].tolist())
        shape = self._shapes.setdefault(sides, len(self._shapes))
        volume = {"shape": shape, "translation": [middle[0], middle[2], -middle[1]]}
        inner = {"extensions": {EXTENSIONS[1]: {"boundingVolume": volume}}}
        return {"extensions": {EXTENSIONS[0]: {"visible": False} | inner}}

    def written(self, extensions: list[str], place: np.ndarray) -> dict:
        """The document, its root at a place, shape (4, 4)."""
        self._nodes[0]["matrix"] = place.T.ravel().tolist()
        asset = {"version": "2.1", "minVersion": "2.1", "generator": f"viewcell {__version__}"}
        asset["extras"] = {"draft": "of glTF 2.1 and EXT_node_visibility_volume as of August 2026; both may change"}
        files = [{"uri": uri, "mimeType": KIND} for uri in self._files]
        shapes = [{"type": "box", "box": {"size": list(sides)}} for sides in self._shapes]
        used = {"extensionsUsed": extensions, "extensionsRequired": extensions} if extensions else {}
        external = [{"file": number} for number in range(len(files))]
        lists = {"files": files, "externalAssets": external, "shapes": shapes, "nodes": self._nodes}
        document = {"asset": asset} | used | {"scene": 0, "scenes": [{"nodes": [0]}]}
        return document | {name: rows for name, rows in lists.items() if rows}
