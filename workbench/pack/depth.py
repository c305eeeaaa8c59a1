"""Depth meshes of a display database: a row for each view cell that has them, and their faces as items of its geometry.

A view cell gets them where what may be seen from it has more triangles than the budget, and the meshes have far fewer
than what they stand for; or, if all are asked for, wherever anything lies beyond its cull box.

Source: Aliaga et al. 1999, section 4.2 (the cell graph). Its potential occluders are not needed: what they would hide
from all of a cell is not in its set.
"""

import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow as pa

from ...data.camera import Screen
from ...data.contents import cells_holding
from ...data.errors import InputError
from ...data.progress import phase
from ...data.ragged import starts_of
from ...data.runs import encode
from ...data.scene import Scene
from ...data.store.bake_folder import BakeFolder
from ...data.store.depth_items import encode_face
from ...data.store.scene_tables import list_column
from ...data.store.walk_tables import ALIGNED, DisplaySets
from ...kernels.launch import Device
from ...solvers.depth_meshes.balance import Balance, Balanced, Budget
from ..walk.path import read_path

AUTO, ALL = "auto", "all"
# What is written is held in memory up to this size.
SPOOLED = 2**26


@dataclass(frozen=True)
class DepthSettings:
    """Which view cells get depth meshes, and of what size.

    Attributes:
        cells: auto where they pay, all wherever there is something far.
        triangles: of near geometry and depth meshes of a view cell, to all sides.
        along: a camera path; only view cells that hold an eye of it get some. None for all.

    Raises:
        InputError: an unknown choice, or no triangles.
    """

    cells: str = AUTO
    triangles: int = 200_000
    along: str | Path | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be done."""
        if self.cells not in (AUTO, ALL):
            raise InputError(f"depth-meshes: expected {AUTO} or {ALL}, found {self.cells!r}")
        _ = self.budget

    @property
    def budget(self) -> Budget:
        """Of each view cell."""
        return Budget(self.triangles, Screen())

    @property
    def facts(self) -> dict:
        """What the manifest says of them."""
        return asdict(self) | {"along": None if self.along is None else str(self.along)}


class DepthItems:
    """Depth meshes as they are made: rows of a table, and bytes that come after the other items."""

    def __init__(self, first: int) -> None:
        """None yet.

        Args:
            first: byte of the file at which they begin, aligned.
        """
        self._at, self._rows = first, []
        self._file = tempfile.SpooledTemporaryFile(max_size=SPOOLED)

    def add(self, cell: int, found: Balanced, place: np.ndarray, grid_m: float) -> None:
        """Depth meshes of a view cell.

        Args:
            cell: its id.
            found: in object ids.
            place: display id of each object.
            grid_m: [m].
        """
        side, near = found.side, place[found.side.near]
        shown = replace(side, far=np.sort(place[side.far]), ids=np.where(side.ids < 0, -1, place[side.ids]))
        order, offsets, sizes = np.argsort(near), [], []
        for face in range(len(side.meshes)):
            data = encode_face(shown, face)
            offsets.append(self._at)
            sizes.append(len(data))
            data += bytes(-len(data) % ALIGNED)
            self._file.write(data)
            self._at += len(data)
        self._rows.append(
            {
                "cell_id": cell,
                "cull_box_m": found.cull_box * grid_m,
                "pixels": found.pixels,
                "near": near[order],
                "levels": found.levels[order].astype(np.uint8).tobytes(),
                "far": shown.far,
                "middle": side.middle * grid_m,
                "reach_m": side.reach * grid_m,
                "texels": side.ids.shape[1],
                "error_texels": side.error,
                "skin_texels": side.skin,
                "offsets": np.array(offsets),
                "sizes": np.array(sizes),
                "faces": np.array([sum(len(mesh.triangles) for mesh in face) for face in side.meshes]),
            }
        )

    @property
    def table(self) -> pa.Table:
        """`depth_meshes.parquet`."""
        rows = self._rows

        def codes(name: str) -> list[bytes]:
            lists = [row[name] for row in rows]
            return encode(starts_of([len(one) for one in lists]), np.concatenate([np.zeros(0, np.int64), *lists]))

        def column(name: str, kind: pa.DataType) -> pa.Array:
            return pa.array([row[name] for row in rows], kind)

        return pa.table(
            {
                "cell_id": column("cell_id", pa.int32()),
                "cull_box_m": column("cull_box_m", pa.float64()),
                "pixels": column("pixels", pa.float64()),
                "near": pa.array(codes("near"), pa.binary()),
                "levels": column("levels", pa.binary()),
                "far": pa.array(codes("far"), pa.binary()),
                "middle": list_column([row["middle"] for row in rows], np.float64),
                "reach_m": column("reach_m", pa.float64()),
                "texels": column("texels", pa.int32()),
                "error_texels": column("error_texels", pa.float64()),
                "skin_texels": column("skin_texels", pa.float64()),
                "offsets": list_column([row["offsets"] for row in rows], np.int64),
                "sizes": list_column([row["sizes"] for row in rows], np.int64),
                "faces": list_column([row["faces"] for row in rows], np.int64),
            }
        )

    def geometry(self) -> Iterator[bytes]:
        """All bytes."""
        self._file.seek(0)
        while data := self._file.read(2**20):
            yield data

    def close(self) -> None:
        """Forget the bytes."""
        self._file.close()


def make_depth_meshes(
    items: DepthItems, bake: BakeFolder, scene: Scene, sets: DisplaySets, order: np.ndarray, settings: DepthSettings
) -> None:
    """Depth meshes of the view cells that are to have some.

    Args:
        items: takes them.
        bake: its cells.
        scene: its model.
        sets: of the view cells, in display ids.
        order: object of each display id.
        settings: which, and of what size.

    Raises:
        InputError: a path that cannot be read or leaves the view cells.
    """
    chosen = np.arange(len(sets.cells))
    if settings.along is not None:
        chosen = np.flatnonzero(np.isin(sets.cells, _held(bake, settings.along)))
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    balance = Balance(scene, settings.budget, device=Device.wanted("cpu"))
    with phase("depth meshes", len(chosen), "view cell") as bar:
        for row in chosen.tolist():
            cell = int(sets.cells[row])
            potential = np.sort(order[sets.members[sets.starts[row] : sets.starts[row + 1]]])
            found = balance.of(potential, bake.graph.cells[cell])
            if len(found.side.far) and (found.pays or settings.cells == ALL):
                items.add(cell, found, place, bake.grid_m)
            bar.update()


def _held(bake: BakeFolder, along: str | Path) -> np.ndarray:
    """Cells that hold an eye of a path."""
    eyes = read_path(along).eyes
    starts, cells = cells_holding(bake.graph, eyes / bake.grid_m)
    lost = np.flatnonzero(np.diff(starts) == 0)
    if len(lost):
        raise InputError(f"{along}: expected eyes in cells of the bake, found frame {lost[0]} in none")
    return np.unique(cells)
