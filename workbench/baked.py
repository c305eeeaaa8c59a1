"""A finished bake in the hands of a user: what it holds (data/store/bake_folder.py), and what can be done with it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from ..data.plural import counted
from ..data.scene import CORNERS
from ..data.store.bake_folder import WITNESS, BakeFolder, read_bake
from ..data.store.scene_folder import read_table
from ..data.store.scene_tables import BOX_COLUMNS
from ..data.verdict import Verdict
from .places import Place, cell_at, cells_at, object_at

if TYPE_CHECKING:
    from ..data.store.walk_folder import WalkFolder
    from ..verify.findings import VerifyResult
    from .export.run import Kind
    from .view.run import View


@dataclass(frozen=True)
class Witness:
    """A sightline that shows an object, in the model's own metres.

    Attributes:
        cell: the view cell that it starts in.
        object_id: what it ends on.
        origin: its start, 3 float64.
        end: its end.
    """

    cell: int
    object_id: int
    origin: np.ndarray
    end: np.ndarray


class Bake(BakeFolder):
    """A finished bake: the model, its cells and portals, and what is visible from where.

    A place to look from is a cell's id, a name (a room's, its long name or GUID, or a cell's), or a point (x, y, z) in
    the model's own metres. What is seen from a room is what is seen from any of its view cells.
    """

    def __repr__(self) -> str:
        """What it is of, how large, and what it culls, on a line."""
        counts, kept = self.manifest["counts"], self.manifest.get("kept") or {}
        parts = [counted(counts["objects"], "object") if counts["objects"] else "a bare graph"]
        parts.append(f"{int(self.graph.inhabitable.sum()):,} of {counted(self.graph.cell_count, 'cell')} inhabitable")
        if "objects" in kept:
            parts.append(f"{100 * kept['objects']:.1f} % kept")
        return f"<Bake {str(self.folder)!r}: {', '.join(parts)}>"

    @property
    def objects(self) -> pa.Table:
        """All objects, by object_id: name, kind, role, GUID and what else the model says, and boxes around them.

        Boxes are in the model's own metres; null where nothing is left of an object on the grid.
        """
        table = read_table(self.folder / "objects.parquet", ())
        boxes = np.stack([table[name].to_numpy(zero_copy_only=False) for name in BOX_COLUMNS], axis=1).reshape(-1, 2, 3)
        corners = self.in_model(boxes[:, CORNERS, np.arange(3)])
        around = np.concatenate([corners.min(axis=1), corners.max(axis=1)], axis=1)
        lost = np.isnan(around).any(axis=1)
        table = table.drop_columns(["definition_id", "transform", *BOX_COLUMNS])
        for column, name in enumerate(BOX_COLUMNS):
            table = table.append_column(name, pa.array(around[:, column], mask=lost))
        return table

    def cell_at(self, point: Sequence[float]) -> int:
        """The inhabitable view cell that holds a point (x, y, z) of the model [m], the smallest if several do.

        Raises:
            InputError: no inhabitable view cell holds it.
        """
        return cell_at(self, point)

    def cells_of(self, place: Place) -> np.ndarray:
        """Ids of the inhabitable view cells of a place, ascending, at least one.

        Raises:
            InputError: there is no such place.
        """
        return cells_at(self, place)

    def potential(self, place: Place) -> np.ndarray:
        """Ids of the objects that may be visible from somewhere in a place, ascending: its PVS.

        Raises:
            InputError: there is no such place.
        """
        return self._union(place, (Verdict.VISIBLE, Verdict.UNKNOWN))

    def seen(self, place: Place) -> np.ndarray:
        """Ids of the objects that a stored witness shows to be visible from the place, ascending.

        Raises:
            InputError: there is no such place.
        """
        return self._union(place, (Verdict.VISIBLE,))

    def unknown(self, place: Place) -> np.ndarray:
        """Ids of the objects that are neither seen from the place nor proved hidden from it, ascending: kept.

        Raises:
            InputError: there is no such place.
        """
        return np.setdiff1d(self.potential(place), self.seen(place))

    def witness(self, place: Place, wanted: int | str) -> Witness | None:
        """A stored sightline from a place to an object; None where there is none.

        Args:
            place: where from.
            wanted: the object's id, its GUID, or its name if only one bears it.

        Raises:
            InputError: there is no such place or object.
        """
        cells, target = self.cells_of(place), object_at(self, wanted)
        table = self.cell_to_object
        rows = np.isin(table["cell_id"].to_numpy(), cells) & (table["object_id"].to_numpy() == target)
        for row in table.filter(pa.array(rows)).to_pylist():
            if row["verdict"] == Verdict.VISIBLE.word:
                origin, way = np.array([row[name] for name in WITNESS]).reshape(2, 3)
                return Witness(row["cell_id"], target, self.in_model(origin), self.in_model(origin + way))
        return None

    def _union(self, place: Place, verdicts: tuple[Verdict, ...]) -> np.ndarray:
        table, words = self.cell_to_object, [verdict.word for verdict in verdicts]
        rows = np.isin(table["cell_id"].to_numpy(), self.cells_of(place))
        rows &= np.isin(np.array(table["verdict"].to_pylist(), object), words)
        return np.unique(table["object_id"].to_numpy()[rows])

    def verify(self, *, rays: int = 1_000_000, seed: int = 0, progress: bool = False) -> "VerifyResult":
        """Try to refute it with rays, and check every witness exactly; as `workbench.verify.verify_bake`."""
        from .verify import verify_bake

        return verify_bake(self, rays=rays, seed=seed, progress=progress)

    def report(
        self,
        *,
        cells: Sequence[int] | None = None,
        out: str | Path | None = None,
        curves: str | Path | None = None,
    ) -> Path:
        """Write report.md with pictures, and report.html; as `viewcell.report`."""
        from .report.run import report

        return report(self, cells=cells, out=out, curves=curves)

    def view(self, out: str | Path | None = None, *, overwrite: bool = False) -> "View":
        """Write a folder in which one walks through the bake in a browser; as `viewcell.view`."""
        from .view.run import view

        return view(self, out, overwrite=overwrite)

    def pack(self, out: str | Path | None = None, *, flatten: bool = False, overwrite: bool = False) -> "WalkFolder":
        """Write the display database that a walkthrough reads; as `viewcell.pack`."""
        from .pack.run import pack

        return pack(self, out, flatten=flatten, overwrite=overwrite)

    def export(self, kind: "Kind", out: str | Path, *, overwrite: bool = False) -> Path:
        """Write it for engines and other tools; docs/guides/export.md says what each kind holds.

        Args:
            kind: "glb", "json", "bits" or "prt", a file each, or "3dtiles", a folder.
            out: where to.
            overwrite: whether what is there may be replaced.

        Returns:
            Where it is.

        Raises:
            InputError: there is no such kind, something is there already, it cannot be written, or the bake has
                nothing of that kind.
        """
        from .export.run import export

        return export(self, {kind: out}, overwrite=overwrite)[0]


def load(folder: str | Path) -> Bake:
    """Open a bake folder.

    Raises:
        InputError: it is no bake folder, of another format version, incomplete, or its tables contradict each other.
    """
    found = read_bake(folder)
    return Bake(found.folder, found.manifest)
