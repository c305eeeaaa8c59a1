"""What a bake's manifest says, and how a finished or unfinished bake is known again."""

import hashlib
import json
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from ...data.graph import CellGraph
from ...data.progress import Phase, begin
from ...data.rows import Rows
from ...data.scene import Scene
from ...data.store.scene_folder import FORMAT, PLAN_FORMAT
from ...data.version import __version__
from .settings import Settings


@dataclass
class Clock:
    """Seconds by phase, and who watches told of each.

    Attributes:
        seconds: by name of the phase.
        started: when the phase began that goes on, of `time.perf_counter`.
        shown: that phase as it is shown.
    """

    seconds: dict[str, float] = field(default_factory=dict)
    started: float = field(default_factory=time.perf_counter)
    shown: Phase | None = None

    def __enter__(self) -> "Clock":
        """Itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """End what is shown, however the work has ended."""
        self._hide()

    def lap(self, phase: str) -> None:
        """Add the time since the last lap to a phase, and show it no more."""
        now = time.perf_counter()
        self.seconds[phase] = round(self.seconds.get(phase, 0.0) + now - self.started, 3)
        self.started = now
        self._hide()

    def show(self, phase: str, total: float | None = None, unit: str = "") -> Phase:
        """Show that a phase goes on from here; units as of `Phase`."""
        self._hide()
        self.shown = begin(phase, total, unit)
        return self.shown

    def _hide(self) -> None:
        if self.shown is not None:
            self.shown.end()
            self.shown = None


def fingerprint(scene: Scene | None, graph_folder: Path | None, settings: Settings, block_sizes: tuple) -> str:
    """Hash of everything that the answer depends on, and of how it is cut into blocks."""
    digest = hashlib.sha256(f"{__version__} {settings} {block_sizes}".encode())
    if settings.table is not None:
        digest.update(_contents(settings.table))
    if scene is None:
        for name in ("cells.parquet", "portals.parquet"):
            digest.update(_contents(graph_folder / name))
        return digest.hexdigest()
    for shape in scene.definitions:
        for mesh in shape.lods:
            digest.update(mesh.vertices.tobytes() + mesh.faces.tobytes() + repr(mesh.error_m).encode())
    for placed in scene.objects:
        digest.update(repr((placed.name, placed.kind, placed.definition_id, placed.role, placed.guid)).encode())
        digest.update(placed.transform.tobytes())
        digest.update(repr((placed.storey, placed.materials)).encode())
        if placed.colour or placed.animation:
            digest.update(repr((placed.colour, placed.animation)).encode())
    for space in scene.spaces:
        digest.update(space.name.encode() + space.vertices.tobytes() + space.faces.tobytes())
        digest.update(repr((space.long_name, space.guid, space.storey)).encode())
    digest.update(np.ascontiguousarray(scene.openings).tobytes())
    digest.update(repr((scene.grid_m, scene.origin.tolist(), scene.yaw_deg)).encode())
    return digest.hexdigest()


def _contents(path: Path) -> bytes:
    """What is in a file; nothing if there is none."""
    return path.read_bytes() if path.is_file() else b""


def rewrite_manifest(folder: Path, manifest: dict) -> None:
    """Put another manifest in the place of a finished bake's."""
    temporary = folder / ".manifest.writing"
    temporary.write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")
    temporary.rename(folder / "manifest.json")


def bake_manifest(
    facts: dict, settings: Settings, known: str, graph: CellGraph, tables: tuple[Rows | None, Rows], clock: Clock
) -> dict:
    """What the folder says of a bake that is being written.

    Args:
        facts: about the model and its cells.
        settings: of the bake.
        known: its fingerprint.
        graph: its cells.
        tables: rows of cells, if anything is claimed of them, and of objects.
        clock: seconds so far.
    """
    cell_rows, object_rows = tables
    counts = facts.get("counts", {}) | {
        "cells": graph.cell_count,
        "inhabitable": int(graph.inhabitable.sum()),
        "portals": graph.portal_count,
    }
    for name, rows in (("cell_pairs", cell_rows), ("object_pairs", object_rows)):
        if rows is not None:
            counts |= {name: len(rows), f"{name}_seen": int(rows.seen.sum())}
    clock.lap("write")
    return facts | {
        "format": PLAN_FORMAT if len(graph.plans.rows) else FORMAT,
        "kind": "bake",
        "viewcell": __version__,
        "model": {"path": facts["source"], "sha256": facts["sha256"]},
        "settings": asdict(settings),
        # A folder of view cells says nothing about what cells see of each other, and has no cell_to_cell.parquet.
        "claims": ["cell_to_object"] if cell_rows is None else ["cell_to_cell", "cell_to_object"],
        "fingerprint": known,
        "counts": counts,
        "seconds": clock.seconds,
        "complete": True,
    }
