"""Depth meshes of a display database as its index tells of them: which view cells have some, and where they lie."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pyarrow as pa

from ..depth_meshes import FACES
from ..errors import InputError
from ..ragged import owners_of, places_of
from ..runs import RunSets, decode
from .scene_tables import list_rows


@dataclass(frozen=True)
class DepthIndex:
    """A row for each view cell that has depth meshes.

    Attributes:
        cells: ids, ascending, shape (n,), int64.
        cull_boxes: size of each [m], float64.
        pixels: level threshold; no near object is off by more at its level, from anywhere in the cell.
        near: display ids that are drawn as geometry.
        levels: of them, one list after another, int64.
        far: display ids that stand on the meshes; ranks of texels count in them.
        middles: of the cells [m], shape (n, 3).
        reaches: from there to the cells' corners [m].
        texels: along each face, int64.
        errors: texels that none is drawn off by more than, for any eye of the cell; proved.
        skins: the longest stretch between neighbouring texels [texels].
        offsets: first byte of each face, in the order of FACES, shape (n, 6), int64.
        sizes: bytes of each, likewise.
        faces: triangles of each, likewise.
    """

    cells: np.ndarray
    cull_boxes: np.ndarray
    pixels: np.ndarray
    near: RunSets
    levels: np.ndarray
    far: RunSets
    middles: np.ndarray
    reaches: np.ndarray
    texels: np.ndarray
    errors: np.ndarray
    skins: np.ndarray
    offsets: np.ndarray
    sizes: np.ndarray
    faces: np.ndarray

    @classmethod
    def of(cls, table: pa.Table, objects: int) -> "DepthIndex":
        """From its table and how many objects there are.

        Raises:
            InputError: codes of other ids, or other numbers of faces.
        """
        lists = {name: list_rows(table[name], 1) for name in ("middle", "offsets", "sizes", "faces")}
        wide = {"middle": 3} | dict.fromkeys(("offsets", "sizes", "faces"), len(FACES))
        for name, rows in lists.items():
            if any(row.size != wide[name] for row in rows):
                raise InputError(f"{name}: expected {wide[name]} numbers for each view cell, found others")
        found = {name: np.array([*rows]).reshape(-1, wide[name]) for name, rows in lists.items()}
        levels = np.frombuffer(b"".join(table["levels"].to_pylist()), np.uint8)
        plain = {name: table[name].to_numpy() for name in table.column_names if name not in lists and name != "levels"}
        return cls(
            plain["cell_id"].astype(np.int64),
            plain["cull_box_m"],
            plain["pixels"],
            decode(table["near"].to_pylist(), objects),
            levels.astype(np.int64),
            decode(table["far"].to_pylist(), objects),
            found["middle"].astype(np.float64),
            plain["reach_m"],
            plain["texels"].astype(np.int64),
            plain["error_texels"],
            plain["skin_texels"],
            *(found[name].astype(np.int64) for name in ("offsets", "sizes", "faces")),
        )

    def __len__(self) -> int:
        """View cells with depth meshes."""
        return len(self.cells)

    @cached_property
    def near_lists(self) -> tuple[np.ndarray, np.ndarray]:
        """Where the near objects of each row begin, and their display ids, ascending in each; `levels` are theirs."""
        return self.near.ids()

    def near_levels(self, row: int) -> tuple[np.ndarray, np.ndarray]:
        """Near objects of a row, ascending, and their levels."""
        starts, ids = self.near_lists
        own = slice(starts[row], starts[row + 1])
        return ids[own], self.levels[own]

    def check(self, sets: RunSets, set_cells: np.ndarray, levels: np.ndarray, file_size: int) -> None:
        """Whether every number names what there is, and every member of a view cell's set is near or far.

        Args:
            sets: of view cells.
            set_cells: id of each, ascending.
            levels: of each object.
            file_size: bytes of the geometry.

        Raises:
            InputError: the first thing that is not so.
        """
        (near_starts, near), (far_starts, far) = self.near_lists, self.far.ids()
        starts, members = sets.ids()
        rows = np.searchsorted(set_cells, self.cells)
        known = rows < len(set_cells)
        if not known.all() or (set_cells[rows] != self.cells).any() or (np.diff(self.cells) <= 0).any():
            raise InputError("expected a row for each of some view cells, found others")
        if len(self.levels) != len(near) or (self.levels >= levels[near]).any():
            raise InputError("expected a level that there is for each near object, found others")
        count = len(levels)
        both = np.sort(np.concatenate([owners_of(near_starts) * count + near, owners_of(far_starts) * count + far]))
        sizes = np.diff(starts)[rows]
        whole = np.repeat(np.arange(len(rows)) * count, sizes) + members[places_of(starts[rows], sizes)]
        if not np.array_equal(both, whole):
            raise InputError("expected every member of a view cell's set to be near or far, found others")
        if (self.offsets < 0).any() or (self.sizes < 0).any() or (self.offsets + self.sizes > file_size).any():
            raise InputError("expected faces within the geometry, found some beyond")
