"""Engines: visibility of a prepared model or a bare graph, one block of sources at a time."""

from dataclasses import dataclass, fields
from typing import Protocol

import numpy as np
from embreex.rtcore_scene import EmbreeScene

from ...data.blockers import Blockers
from ...data.patches import Patches
from ...data.regions import Regions
from ...data.rows import Rows
from ...data.store.certificates import Proofs


@dataclass
class Part:
    """What is visible from one block of sources.

    Attributes:
        cells: cells that are not proved hidden; None from view cells, about which nothing but objects is claimed.
        objects: objects that are not proved hidden.
        proofs: certificates of what is hidden, if they are kept.
    """

    cells: Rows | None
    objects: Rows
    proofs: Proofs | None = None

    @property
    def unknown_count(self) -> int:
        """Pairs without a witness."""
        return sum(int((~rows.seen).sum()) for rows in (self.cells, self.objects) if rows is not None)

    def relabelled(self, places: np.ndarray) -> "Part":
        """The same from view cells c called places[c], without those whose place is -1."""
        proofs = None if self.proofs is None else self.proofs.relabelled(places)
        return Part(None, self.objects.relabelled(places), proofs)

    def arrays(self) -> dict[str, np.ndarray]:
        """As named arrays, for a file."""
        out = {}
        for part, table in vars(self).items():
            columns = {} if table is None else vars(table)
            out |= {f"{part}.{name}": np.asarray(values) for name, values in columns.items() if values is not None}
        return out

    @classmethod
    def of_arrays(cls, arrays: dict[str, np.ndarray]) -> "Part":
        """Back from named arrays."""
        tables = {}
        for part, kind in (("cells", Rows), ("objects", Rows), ("proofs", Proofs)):
            found = {f.name: arrays[f"{part}.{f.name}"] for f in fields(kind) if f"{part}.{f.name}" in arrays}
            tables[part] = kind(**{k: v if v.ndim else v.item() for k, v in found.items()}) if found else None
        return cls(**tables)


class Engine(Protocol):
    """Answers from the sources of a graph, on a device."""

    @property
    def proof_occluders(self) -> tuple[Blockers, Regions | None, Patches | None]:
        """What certificates name."""

    @property
    def opaque(self) -> EmbreeScene | None:
        """Opaque triangles of the model in Embree, in its order, if `look` has made them."""

    def begin(self, seconds: float = np.inf) -> bool:
        """Make what `coarse` and `narrow` hide by, as much as there is time for.

        Whoever does not call it has all of it made when it is first needed.

        Returns:
            Whether nothing had to be left out. Otherwise `prepare` makes nothing.
        """

    def look(self, seconds: float = np.inf) -> bool:
        """Make what `glance` needs, unless that should take longer; returns whether it is made."""

    def prepare(self, seconds: float = np.inf) -> bool:
        """Make what `visible` needs and `coarse` does not, unless that should take longer; returns whether it is made.

        Whoever does not call it has it made by the first `visible`.
        """

    def compile(self) -> None:
        """Load the kernels, so that their compilation is not counted as visibility."""

    def visible(self, block: np.ndarray, *, aim: bool = True) -> Part:
        """What some sources see.

        Args:
            block: sources.
            aim: shoot at what the axial model allows but whose own line the true triangles stop. Without it the same
                pairs are hidden, in a fraction of the time, and more of the others stay unknown.
        """

    def glance(self, block: np.ndarray, number: int) -> Rows:
        """Objects that some sources see at a glance, seen pairs only, ordered; others with each number."""

    def coarse_steps(self) -> int:
        """Of `coarse` and `narrow` together; asked before either; 0 from an engine that has no such thing."""

    def coarse(self, cells: np.ndarray, group: np.ndarray) -> Rows:
        """What groups of sources may see at worst, as of `left_by_nodes`."""

    def narrow(self, rows: Rows, step: int) -> Rows:
        """Those of some pairs that may be seen that are not hidden at a step, as of `narrowed`."""

    def unknown(self, block: np.ndarray, objects: Rows | None = None) -> Part:
        """Rows that claim nothing: everything stays potential, but of objects only those that are given, if any are."""

    def join(self, parts: list[Part], *, share: bool = True) -> tuple[Rows | None, Rows]:
        """Tables of all blocks: cells, if anything is claimed of them, and objects; ordered.

        Args:
            parts: of all blocks.
            share: let sightlines serve other sources than those that they were found from.
        """


def unknown_rows(block: np.ndarray, count: int) -> Rows:
    """Every target from every source of the block, without a witness."""
    return Rows.unseen(np.repeat(block, count), np.tile(np.arange(count), len(block)))


def join_objects(parts: list[Part]) -> Rows:
    """Objects of all blocks as one table, ordered."""
    return Rows.join([part.objects for part in parts]).order()
