"""What is known of a model before it is baked."""

from collections import Counter
from dataclasses import asdict, dataclass, field

import numpy as np

from ...data.carving import Faces
from ...data.plural import counted
from ...data.scene import Scene
from .cells import Cells
from .surfaces import Directions, Surfaces


@dataclass(frozen=True)
class Warning:
    """What is wrong, what it costs, and what to do about it, in a sentence each."""

    what: str
    costs: str
    do: str


@dataclass
class Inspection:
    """What is known of a model.

    Attributes:
        scene: as read.
        unit_because: how its unit was found.
        size_m: extent of all triangles, float64 x 3.
        kinds: number of objects by (kind, role).
        told: number of transparent objects and doors by what they were taken for such.
        stray: names of parts far away from the others, and their distance [m].
        surfaces: faults of surfaces.
        directions: of upright faces; None if there are none.
        faces: of occluders, by how they stand to the axes.
        cells: what a bake would find.
        differences: what a second reader found otherwise, one line each; None where none was asked.
        warnings: what is wrong.
        lines: of the screen.
    """

    scene: Scene
    unit_because: str
    size_m: np.ndarray
    kinds: Counter
    told: Counter
    stray: list[tuple[str, float]]
    surfaces: Surfaces
    directions: Directions | None
    faces: Faces
    cells: Cells
    differences: list[str] | None = None
    warnings: list[Warning] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)

    def __repr__(self) -> str:
        """What it is of and how it is, on a line."""
        outcome = "fit to bake" if self.ok else "not fit to bake"
        return f"<Inspection {self.scene.source!r}: {outcome}, {counted(len(self.warnings), 'warning')}>"

    @property
    def ok(self) -> bool:
        """Whether no second reader disagrees, and there is somewhere to stand."""
        return not self.differences and (self.cells.graph is None or bool(self.cells.graph.inhabitable.any()))

    def text(self) -> str:
        """One screen."""
        return "\n".join(self.lines)

    def json(self) -> dict:
        """The same and more, as JSON takes it."""
        scene, cells = self.scene, self.cells
        count, inhabitable, portals = cells.counts
        return {
            "source": scene.source,
            "sha256": scene.sha256,
            "unit": scene.unit,
            "unit_because": self.unit_because,
            "origin": scene.origin.tolist(),
            "yaw_deg": scene.yaw_deg,
            "size_m": self.size_m.tolist(),
            "max_snap_m": scene.max_snap_m(),
            "triangles": int(scene.triangle_counts.sum()),
            "objects": [{"kind": k, "role": r.value, "count": n} for (k, r), n in sorted(self.kinds.items())],
            "taken_for_glass_or_door": [{"why": why, "count": n} for why, n in self.told.most_common()],
            "rooms": [space.name for space in scene.spaces],
            "directions": None
            if self.directions is None
            else asdict(self.directions) | {"other": self.directions.other},
            "faces": asdict(self.faces),
            "surfaces": self._surfaces(),
            "stray": [{"name": name, "distance_m": distance} for name, distance in self.stray],
            "cells": {"cells": count, "inhabitable": inhabitable, "portals": portals, "because": cells.because},
            "leak": [self._box(cell) for cell in cells.leak],
            "cracks": [asdict(crack) | {"box": crack.box.tolist()} for crack in cells.cracks],
            "bake_s": cells.bake_s,
            "skipped": scene.skipped,
            "notes": scene.notes,
            "differences": self.differences,
            "warnings": [asdict(warning) for warning in self.warnings],
            "ok": self.ok,
        }

    def _box(self, cell: int) -> list[list[float]]:
        return (self.cells.graph.cells[cell] * self.scene.grid_m).tolist()

    def _surfaces(self) -> dict:
        name, found = self.name, self.surfaces
        overlaps = found.overlaps
        return {
            "closed": found.closed,
            "inverted": [name(i) for i in found.inverted],
            "open": [asdict(one) | {"name": name(one.object_id)} for one in found.open],
            "repeated_triangles": found.repeated,
            "twins": [[name(i) for i in ids] for ids in found.twins],
            "overlaps": None if overlaps is None else [{"a": name(a), "b": name(b), "m2": m2} for a, b, m2 in overlaps],
        }

    def name(self, object_id: int) -> str:
        """Name of an object, and its GUID where it has one."""
        placed = self.scene.objects[object_id]
        return f"{placed.name} ({placed.guid})" if placed.guid else placed.name
