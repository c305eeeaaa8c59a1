"""Bake: model in, potentially visible sets out, with a proof on both sides."""

import hashlib
import json
import pickle
import shutil
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from tqdm import tqdm

from .. import __version__
from ..data.database import Bake, VisibleRows, write_bake
from ..data.errors import InputError
from ..data.graph import CellGraph
from ..data.graph_folder import read_graph
from ..data.inhabit import find_inhabitable
from ..data.opaque import OpaquePlanes, opaque_planes
from ..data.portals import find_portals
from ..data.scene import GRID_LIMIT, GRID_M, Role, Scene
from ..data.scene_folder import replaceable, scene_manifest
from ..data.solids import closed_elements, dead_cells
from ..data.subdivide import cut_rooms, merge, subdivide

if TYPE_CHECKING:
    from ..kernels.engine import Engine

MARGIN_M = 2.0
# Sources a block: a block is what an interrupted bake resumes from.
BLOCK = 24


@dataclass(frozen=True)
class Settings:
    """What a bake's answer depends on.

    Attributes:
        threshold_m2: opaque area below which a plane does not cut cells; larger is faster and looser.
        seed: of the random sightlines.
        seal: cracks narrower than this are closed [m]; 0 closes none.
        doors: "open", or "closed" if doors occlude.
    """

    threshold_m2: float = 0.0
    seed: int = 0
    seal: float = 0.0
    doors: str = "open"


@dataclass
class Clock:
    """Seconds by phase."""

    seconds: dict[str, float] = field(default_factory=dict)
    started: float = field(default_factory=time.perf_counter)

    def lap(self, phase: str) -> None:
        """Add the time since the last lap to a phase."""
        now = time.perf_counter()
        self.seconds[phase] = round(self.seconds.get(phase, 0.0) + now - self.started, 3)
        self.started = now


def bake(
    model: Scene | str | Path,
    out: str | Path | None = None,
    *,
    settings: Settings | None = None,
    budget_s: float | None = None,
    threads: int | None = None,
    device: str = "cpu",
    overwrite: bool = False,
    progress: bool = False,
) -> Bake:
    """Cut a model into cells and portals and compute what each inhabitable cell can see.

    Args:
        model: a scene, a model file, a scene folder, or a folder with only cells.parquet and portals.parquet.
        out: bake folder to write; by default `<model>.bake` in the current folder.
        settings: what the answer depends on.
        budget_s: stop after so many seconds of visibility; what is left is unknown, never hidden, and baking again
            goes on from there.
        threads: CPU threads; all cores by default. The answer does not depend on it.
        device: Warp device. The answer does not depend on it.
        overwrite: replace a finished bake at `out` even if it is up to date.
        progress: show a progress bar.

    Returns:
        The bake. Absent rows are hidden, exactly; `unknown` rows are kept.

    Raises:
        InputError: the model, the settings or the place to write are unusable; nothing is written or lost.
    """
    settings = settings or Settings()
    _check(settings, budget_s, threads, device)
    out = Path(out) if out is not None else default_out(model)
    clock = Clock()
    scene, graph_folder = _open(model, settings)
    if out.exists() and not replaceable(out, "bake"):
        raise InputError(f"{out}: expected a new name or a bake folder to replace, found something else there")
    print_ = _fingerprint(scene, graph_folder, settings)
    if not overwrite and (done := _finished(out, print_)) is not None:
        return done
    if scene is None:
        graph, snapped = read_graph(graph_folder)
        opaque = None
        clock.lap("read")
        facts = {"source": str(graph_folder), "sha256": "", "unit": "metre", "grid_m": GRID_M, "origin": [0.0] * 3}
        facts |= {"max_snap_m": snapped, "skipped": [], "counts": {"objects": 0}}
    else:
        facts = scene_manifest(scene)
        graph, opaque, notes = build_graph(scene, settings, clock)
        facts |= notes
    if not graph.inhabitable.any():
        raise InputError(f"{facts['source']}: expected at least one inhabitable cell, found none")
    cell_rows, object_rows, spent = _visibility(
        scene, graph, opaque, settings, out, print_, clock, budget_s, threads, device, progress
    )
    facts["budget_spent"] = spent

    def manifest() -> dict:
        return _manifest(facts, settings, print_, graph, cell_rows, object_rows, clock)

    made = write_bake(out, manifest, scene, graph, cell_rows, object_rows, facts["grid_m"])
    if not spent:
        shutil.rmtree(_partial(out), ignore_errors=True)
    return made


def _check(settings: Settings, budget_s: float | None, threads: int | None, device: str) -> None:
    for name, value, least in (
        ("threshold", settings.threshold_m2, 0.0),
        ("seal", settings.seal, 0.0),
        ("budget", budget_s if budget_s is not None else 1.0, 1e-9),
        ("threads", threads if threads is not None else 1, 1),
    ):
        if not (np.isfinite(value) and value >= least):
            raise InputError(f"{name}: expected a number {'above 0' if least else 'from 0'}, found {value}")
    if settings.seal > 0:
        raise InputError(f"seal: expected 0 (closing cracks is not built yet), found {settings.seal}")
    import warp as wp

    # Warp greets whoever starts it, unless told not to before.
    wp.config.log_level = wp.LOG_WARNING
    try:
        wp.get_device(device)
    except Exception as error:  # Warp raises several types for an unknown or absent device
        raise InputError(f"device: expected one that Warp knows, found {device!r} ({error})") from None


def _open(model: Scene | str | Path, settings: Settings) -> tuple[Scene | None, Path | None]:
    if isinstance(model, Scene):
        return model, None
    path = Path(model)
    if path.is_dir() and settings.doors != "open":
        raise InputError(f"{path}: expected a model file to close the doors of, found a folder")
    if path.is_dir() and not (path / "manifest.json").exists():
        return None, path
    from ..data.readers import read

    return read(path, doors=settings.doors), None


def default_out(model: Scene | str | Path) -> Path:
    """Where a bake goes that was not told where: named after its model, in the current folder."""
    # `resolve` gives "." and ".." a name.
    name = "scene" if isinstance(model, Scene) else Path(model).resolve().stem or "model"
    return Path(f"{name}.bake")


def _fingerprint(scene: Scene | None, graph_folder: Path | None, settings: Settings) -> str:
    """Hash of everything that the answer depends on."""
    digest = hashlib.sha256(f"{__version__} {settings} {BLOCK}".encode())
    if scene is None:
        for name in ("cells.parquet", "portals.parquet"):
            path = graph_folder / name
            digest.update(path.read_bytes() if path.is_file() else b"")
    else:
        for shape in scene.definitions:
            for mesh in shape.lods:
                digest.update(mesh.vertices.tobytes() + mesh.faces.tobytes() + repr(mesh.error_m).encode())
        for placed in scene.objects:
            digest.update(repr((placed.name, placed.kind, placed.definition_id, placed.role)).encode())
            digest.update(placed.transform.tobytes())
        for space in scene.spaces:
            digest.update(space.name.encode() + space.vertices.tobytes() + space.faces.tobytes())
        digest.update(np.ascontiguousarray(scene.openings).tobytes())
        digest.update(repr((scene.grid_m, scene.origin.tolist())).encode())
    return digest.hexdigest()


def _finished(out: Path, print_: str) -> Bake | None:
    """The bake at `out`, if it is complete and of the same input, settings and version."""
    try:
        manifest = json.loads((out / "manifest.json").read_text())
    except (OSError, ValueError):
        return None
    same = manifest.get("fingerprint") == print_ and manifest.get("complete") and not manifest.get("budget_spent")
    return Bake(out, manifest) if same else None


def build_graph(scene: Scene, settings: Settings, clock: Clock) -> tuple[CellGraph, OpaquePlanes, dict]:
    """Cells, portals and inhabitable cells of a model, its opaque rectangles, and what the manifest says of them."""
    triangles, owners = scene.triangles()
    clock.lap("read")
    occluders = scene.object_mask(Role.OCCLUDER)
    opaque = opaque_planes(triangles[occluders[owners]])
    margin = round(MARGIN_M / scene.grid_m)
    # The grid's own limit is where the kernels stop being exact.
    low = np.maximum(triangles.min(axis=(0, 1)).astype(np.int64) - margin, -GRID_LIMIT)
    high = np.minimum(triangles.max(axis=(0, 1)).astype(np.int64) + margin, GRID_LIMIT)
    leaves = subdivide(opaque, low, high, settings.threshold_m2 / scene.grid_m**2)
    rooms = [[s.vertices.min(axis=0), s.vertices.max(axis=0)] for s in scene.spaces]
    boxes = np.round(np.array(rooms).reshape(-1, 2, 3) / scene.grid_m).astype(np.int64)
    cells = cut_rooms(merge(leaves, opaque), boxes)
    dead = dead_cells(cells, closed_elements(scene, Role.OCCLUDER))
    clock.lap("subdivide")
    graph = find_portals(cells[~dead], opaque)
    inhabited = find_inhabitable(scene, graph)
    graph.inhabitable, graph.cell_names = inhabited.mask, inhabited.names
    clock.lap("portals")
    notes = {
        "inhabitable_because": inhabited.reason,
        "leak_cells": inhabited.leak,
        "dead_cells": int(dead.sum()),
        "axial_area_m2": round(opaque.axial_area * scene.grid_m**2, 3),
        "axial_area_lost_m2": round(opaque.lost_area * scene.grid_m**2, 3),
    }
    return graph, opaque, notes


def _partial(out: Path) -> Path:
    return out.with_name(f".{out.name}.partial")


def _visibility(
    scene: Scene | None,
    graph: CellGraph,
    opaque: OpaquePlanes | None,
    settings: Settings,
    out: Path,
    print_: str,
    clock: Clock,
    budget_s: float | None,
    threads: int | None,
    device: str,
    progress: bool,
) -> tuple[VisibleRows, VisibleRows, bool]:
    """Visibility of all inhabitable cells, block by block, and whether the budget ended it early.

    Finished blocks are kept beside the target.
    """
    from ..kernels.engine import Engine
    from ..kernels.launch import thread_count

    engine = Engine(scene, graph, opaque, seed=settings.seed, threads=thread_count(threads), device=device)
    clock.lap("prepare")
    engine.compile()
    clock.lap("compile")
    sources = np.flatnonzero(graph.inhabitable)
    blocks = [sources[i : i + BLOCK] for i in range(0, len(sources), BLOCK)] if scene is not None else [sources]
    store = _Store(_partial(out), print_)
    bar = tqdm(total=len(sources), unit="cell", desc="visibility", disable=not progress)
    if budget_s is None:
        parts, spent = [_finish_block(engine, store, number, block, bar) for number, block in enumerate(blocks)], False
    else:
        parts, spent = _within(engine, store, blocks, time.perf_counter() + budget_s, bar)
    bar.close()
    clock.lap("flood")
    return *engine.join(parts), spent


def _finish_block(engine: "Engine", store: "_Store", number: int, block: np.ndarray, bar: tqdm) -> object:
    """A block as far as it goes, from the store if it is there."""
    part = store.load(number)
    if part is None:
        part = engine.visible(block)
        store.save(number, part)
    bar.update(len(block))
    return part


def _within(
    engine: "Engine", store: "_Store", blocks: list[np.ndarray], deadline: float, bar: tqdm
) -> tuple[list[object], bool]:
    """All blocks before a deadline: first what is hidden from each, then witnesses where most is unknown."""
    parts, rough = [], []
    for number, block in enumerate(blocks):
        part = store.load(number)
        if part is None:
            rough.append(number)
            part = engine.visible(block, aim=False) if time.perf_counter() < deadline else engine.unknown(block)
        else:
            bar.update(len(block))
        parts.append(part)
    rough.sort(key=lambda number: -parts[number].unknown_count)
    while rough and time.perf_counter() < deadline:
        number = rough.pop(0)
        parts[number] = _finish_block(engine, store, number, blocks[number], bar)
    return parts, bool(rough)


class _Store:
    """Finished blocks of an interrupted bake, in a folder beside its target."""

    def __init__(self, folder: Path, print_: str) -> None:
        self._folder = folder
        mark = folder / "fingerprint"
        if folder.exists() and (not mark.exists() or mark.read_text() != print_):
            shutil.rmtree(folder)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            mark.write_text(print_)
        except OSError as error:
            raise InputError(f"{folder}: expected a place for unfinished work, found: {error.strerror}") from None

    def load(self, number: int) -> object | None:
        """A finished block, or None."""
        try:
            return pickle.loads((self._folder / f"{number}.block").read_bytes())
        except Exception:  # pickle raises many types for a damaged file; the block is then computed again
            return None

    def save(self, number: int, part: object) -> None:
        """Keep a block; a rename makes it appear whole or not at all."""
        try:
            temporary = self._folder / f"{number}.writing"
            temporary.write_bytes(pickle.dumps(part))
            temporary.rename(self._folder / f"{number}.block")
        except OSError as error:
            raise InputError(f"{self._folder}: expected room for unfinished work, found: {error.strerror}") from None


def _manifest(
    facts: dict,
    settings: Settings,
    print_: str,
    graph: CellGraph,
    cell_rows: VisibleRows,
    object_rows: VisibleRows,
    clock: Clock,
) -> dict:
    counts = facts.get("counts", {}) | {
        "cells": graph.cell_count,
        "inhabitable": int(graph.inhabitable.sum()),
        "portals": graph.portal_count,
        "cell_pairs": len(cell_rows.source),
        "cell_pairs_seen": int(cell_rows.seen.sum()),
        "object_pairs": len(object_rows.source),
        "object_pairs_seen": int(object_rows.seen.sum()),
    }
    clock.lap("write")
    return facts | {
        "format": 1,
        "kind": "bake",
        "viewcell": __version__,
        "model": {"path": facts["source"], "sha256": facts["sha256"]},
        "settings": {
            "threshold_m2": settings.threshold_m2,
            "seed": settings.seed,
            "seal": settings.seal,
            "doors": settings.doors,
        },
        "fingerprint": print_,
        "counts": counts,
        "seconds": clock.seconds,
        "complete": True,
    }
