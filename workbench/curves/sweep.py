"""Sweeping every knob of every method over some view cells of a bake.

Error is potential / seen, where seen is what any of the runs has a witness for or any ray hits: the true overestimate
is at most that. Sampling alone is the exception that the picture is for: it is fast and hides what is visible, so its
ratio falls below 1.
"""

import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from itertools import chain, pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...data.errors import InputError
from ...data.plural import counted
from ...data.progress import phase, shown
from ...data.store.view_cells import write_view_cells
from ...verify.rays.witness import visible_rows, witnessed_objects
from ..bake.run import bake
from ..bake.settings import Settings
from ..verify import seen_by_rays
from .series import LEVELS, SAMPLING, Curves, Point, Series

if TYPE_CHECKING:
    from ...data.store.bake_folder import BakeFolder

THRESHOLDS_M2 = (0.0, 1.0, 4.0)
SPLITS = (1, 2)
SIDES_M = (0.25, 0.5, 1.0, 2.0, 4.0)
# Budgets as parts of what the whole bake took; not swept where that was more than so many seconds.
SHARES = (0.1, 0.2, 0.4, 0.7)
WHOLE_S = 60.0
RESOLUTIONS = (64, 128, 256, 512, 1024)
CLUSTERS = (1, 6, 14, 26)
RAYS = (1_000, 10_000, 100_000, 1_000_000)
GRAPH_RAYS = (10, 100, 1_000, 10_000)
PIXELS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)


@dataclass
class _Run:
    """What one setting came to, before the truth is known; of pairs of its own where `apart`."""

    method: str
    knob: str
    value: float
    seconds: float
    potential: np.ndarray
    seen: np.ndarray
    apart: bool = False


def sweep(bake_: "BakeFolder", *, cells: int = 8, seed: int = 0, progress: bool = False) -> Curves:
    """Sweep the knobs of portals, occluders, both, projection points and sampling over some view cells of a bake.

    Args:
        bake_: of a model or of a bare graph; of a graph all cells are taken, and only portals and sampling apply.
        cells: view cells, drawn at random among the inhabitable ones.
        seed: of the draw and of what the methods draw.
        progress: show a progress bar.

    Raises:
        InputError: no inhabitable cell.
    """
    sources = np.flatnonzero(bake_.graph.inhabitable)
    if not len(sources) or cells < 1:
        raise InputError(f"{bake_.folder}: expected view cells to sweep over, found none")
    with tempfile.TemporaryDirectory() as name, shown(progress), phase("curves") as bar:
        if bake_.manifest["counts"]["objects"]:
            chosen = np.sort(np.random.default_rng(seed).permutation(sources)[:cells])
            sweeper = _Sweeper(bake_, chosen, Path(name), seed)
            runs, drawn = chain(sweeper.runs(), sweeper.budgets(bake_)), sweeper.pixel_series()
            size = f"{counted(len(chosen), 'view cell')}, {counted(len(bake_.scene.objects), 'object')}"
        else:
            runs, drawn = _GraphSweeper(bake_, seed).runs(), None
            size = f"{len(sources):,} inhabitable of {counted(bake_.graph.cell_count, 'cell')}"
        found = []
        for run in runs:
            found.append(run)
            bar.note = f"{len(found)} runs"
            bar.beat()
    truth = np.logical_or.reduce([run.seen for run in found if not run.apart])
    series: dict[tuple[str, str], Series] = {}
    for run in found:
        one = series.setdefault((run.method, run.knob), Series(run.method, run.knob, [], run.apart))
        one.points.append(_point(run, run.seen if run.apart else truth))
    every = list(series.values())
    return Curves(f"{Path(bake_.folder).stem}: {size}", every + ([drawn] if drawn else []), int(truth.sum()))


def _point(run: _Run, truth: np.ndarray) -> Point:
    potential = int(run.potential.sum())
    unknown = 1 - (run.potential & truth).sum() / max(1, potential)
    error = potential / max(1, int(truth.sum()))
    return Point(run.value, run.seconds, float(error), float(unknown), int((truth & ~run.potential).sum()))


class _Sweeper:
    """Sweeps over view cells of a model: each is a bake of a table of these cells."""

    def __init__(self, bake_: "BakeFolder", chosen: np.ndarray, folder: Path, seed: int) -> None:
        # Boxes along the axes of the bake are not along those of a model that was turned back.
        self._scene, self._folder, self._seed, self._count = replace(bake_.scene, yaw_deg=0.0), folder, seed, 0
        self._boxes = bake_.graph.cells[chosen].astype(np.int64)

    def runs(self) -> Iterator[_Run]:
        """One by one."""
        # The first run compiles.
        self._bake(self._boxes[:1], Settings(method="both"))
        for area in THRESHOLDS_M2:
            yield self._run("portals alone", "cut planes from, m2", area, Settings(method="portals", threshold_m2=area))
        made = self._bake(self._boxes, Settings(method="occluders"))
        for parts in SPLITS:
            yield self._split("occluders alone", parts)
        middle = (self._boxes[:, 0] + self._boxes[:, 1]) // 2
        for side in SIDES_M:
            half = round(side / 2 / self._scene.grid_m)
            low, high = np.maximum(self._boxes[:, 0], middle - half), np.minimum(self._boxes[:, 1], middle + half)
            smaller = self._bake(np.stack([low, high], axis=1), Settings(method="occluders"))
            yield replace(_run(smaller, "occluders alone", "side of smaller cells, m", side), apart=True)
        yield self._run("both", "no knob", 1.0, Settings(method="both"))
        for resolution in RESOLUTIONS:
            settings = Settings(method="vlod", resolution=resolution)
            yield self._run("projection points", "resolution, pixels", resolution, settings)
        for clusters in CLUSTERS:
            yield self._run("projection points", "clusters", clusters, Settings(method="vlod", clusters=clusters))
        yield from _sampled(made, "rays per cell", RAYS, False, self._seed)

    def budgets(self, whole: "BakeFolder") -> Iterator[_Run]:
        """All inhabitable cells at once, stopped early."""
        if _seconds(whole) > WHOLE_S:
            return
        boxes = whole.graph.cells[whole.graph.inhabitable].astype(np.int64)
        made = self._bake(boxes, Settings(method="occluders"))
        seen, most = witnessed_objects(made), _seconds(made)
        prepare_s = made.manifest["seconds"]["prepare"]
        for share in SHARES:
            # A budget covers preparation, which is no part of what is drawn.
            early = self._bake(boxes, Settings(method="occluders"), max(share * most, 1e-3) + prepare_s)
            potential = early.potential_objects
            yield _Run("occluders, all cells", "budget, share", share, _seconds(early), potential, seen, apart=True)
        yield _Run("occluders, all cells", "budget, share", 1.0, most, made.potential_objects, seen, apart=True)

    def pixel_series(self) -> Series | None:
        """Share of the triangles that is drawn as the limit on the image's deviation grows."""
        from ...data.lod import object_errors
        from ...solvers.levels.pixel_error import PixelLimit, pixel_levels

        scene, points = self._scene, []
        shapes = [[len(mesh.faces) for mesh in scene.definitions[o.definition_id].lods] for o in scene.objects]
        if max(len(levels) for levels in shapes) == 1:
            return None
        errors, starts = object_errors(scene)
        counts = np.concatenate([np.array(levels) for levels in shapes])
        bounds = (scene.object_bounds() + np.array([[-0.5], [0.5]])) * scene.grid_m
        pairs = np.stack(np.meshgrid(np.arange(len(self._boxes)), np.arange(len(shapes)), indexing="ij"), -1)
        pairs = pairs.reshape(-1, 2)
        finest = counts[starts[:-1]][pairs[:, 1]].sum()
        for pixels in PIXELS:
            level = pixel_levels(self._boxes * scene.grid_m, bounds, errors, starts, pairs, PixelLimit(pixels))
            share = counts[starts[:-1][pairs[:, 1]] + level].sum() / finest
            points.append(Point(pixels, float("nan"), float(share), float("nan"), 0))
        return Series(LEVELS, "pixels", points)

    def _bake(self, boxes: np.ndarray, settings: Settings, budget_s: float | None = None) -> "BakeFolder":
        """A bake of view cells [grid steps], in a folder of its own."""
        self._count += 1
        table, scene = self._folder / f"{self._count}.csv", self._scene
        write_view_cells(boxes, scene, table)
        settings = Settings(**(asdict(settings) | {"cells": str(table), "seed": self._seed}))
        return bake(scene, self._folder / f"{self._count}.bake", settings=settings, budget_s=budget_s)

    def _run(self, method: str, knob: str, value: float, settings: Settings) -> _Run:
        return _run(self._bake(self._boxes, settings), method, knob, value)

    def _split(self, method: str, parts: int) -> _Run:
        """View cells cut in parts on each axis; a cell sees what a part sees."""
        from ...solvers.visibility.projection import split_cell

        boxes = [split_cell(box, parts) for box in self._boxes]
        made = self._bake(np.concatenate(boxes), Settings(method="occluders"))
        ends = np.cumsum([0, *map(len, boxes)])
        potential, seen = (
            np.array([rows[a:b].any(axis=0) for a, b in pairwise(ends)])
            for rows in (made.potential_objects, witnessed_objects(made))
        )
        return _Run(method, "parts on an axis", parts, _seconds(made), potential, seen)


class _GraphSweeper:
    """Sweeps over all cells of a bare graph, whose portals are decided exactly."""

    def __init__(self, bake_: "BakeFolder", seed: int) -> None:
        self._bake, self._seed = bake_, seed

    def runs(self) -> Iterator[_Run]:
        """One by one."""
        bake_ = self._bake
        seconds = _seconds(bake_)
        yield _Run("portals alone", "no knob", 1.0, seconds, bake_.potential_cells, _seen_cells(bake_))
        yield from _sampled(bake_, "rays per cell", GRAPH_RAYS, True, self._seed)


def _run(made: "BakeFolder", method: str, knob: str, value: float) -> _Run:
    return _Run(method, knob, value, _seconds(made), made.potential_objects, witnessed_objects(made))


def _seconds(made: "BakeFolder") -> float:
    """Visibility alone: reading, cutting cells and preparing occluders take as long for one cell as for all."""
    return made.manifest["seconds"]["flood"]


def _sampled(made: "BakeFolder", knob: str, counts: tuple[int, ...], cells: bool, seed: int) -> Iterator[_Run]:
    """What so many rays from each inhabitable cell show, as if nothing else were there."""
    stands = made.graph.inhabitable
    for rays in counts:
        begin = time.perf_counter()
        found = seen_by_rays(made, rays * int(stands.sum()), seed)[0 if cells else 1]
        found[~stands] = False
        yield _Run(SAMPLING, knob, rays, time.perf_counter() - begin, found, found)


def _seen_cells(made: "BakeFolder") -> np.ndarray:
    """Cells with a witness, shape (cells, cells), bool."""
    rows, out = visible_rows(made.cell_to_cell), np.zeros_like(made.potential_cells)
    out[rows["cell_id"].to_numpy(), rows["reached_cell_id"].to_numpy()] = True
    return out
