"""From-region occlusion, method beside method: how much each leaves potential, against what is seen, and in what time.

Run `python -m viewcell.workbench.bench occlusion MODEL... [--cells N] [--rays N]`; a MODEL is anything that
`viewcell bake` takes, or `office`. View cells are N boxes of 1 m and N as large as a room, drawn at random where
somebody may stand under a ceiling. Seen is what a witness of the bake or one of the rays shows.
"""

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ...data.buildings.office import make_office
from ...data.errors import InputError
from ...data.prepared import PreparedModel
from ...data.readers import read
from ...data.scene import OPAQUE, Scene
from ...data.solids import triangles_meet_boxes
from ...data.store.view_cells import write_view_cells
from ...data.verdict import Verdict
from ...kernels.launch import CPU
from ...kernels.shaft import launch_shaft
from ...solvers.visibility.aim import Sights
from ...solvers.visibility.occluders import OccluderModel, seen_objects
from ...solvers.visibility.projection import VlodSettings, vlod_hidden
from ...verify.rays.witness import witnessed_objects
from ..bake.run import bake
from ..bake.settings import Settings
from ..verify import seen_by_rays
from .timing import commit, print_head, print_row

RAYS = 10_000_000
CELLS = 10
CELL_M = 1.0
ROOM_M = (8.0, 8.0, 3.0)
ROOM_STEP_M = 0.25
# No halving: one occluder for the whole cell and the whole box.
WHOLE = 2**25
HEAD = ("variant", "1 m: potential / seen", "ms", "room: potential / seen", "ms", "wrong hidden")

# From view cells to what each cannot see, shape (cells, objects), bool.
Variant = Callable[[np.ndarray], np.ndarray]


def sample_cells(scene: Scene, count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Free boxes of 1 m with a floor below and a ceiling above, and others grown to the size of their rooms.

    Returns:
        Both [grid steps], shape (count, 2, 3), int32.

    Raises:
        InputError: no such place was found.
    """
    solid, _ = scene.triangles(*OPAQUE)
    low, high = scene.bounds()
    side = round(CELL_M / scene.grid_m)
    random = np.random.default_rng(seed)
    bounds = np.stack([solid.min(axis=1), solid.max(axis=1)], axis=1)

    def free(box: np.ndarray) -> bool:
        near = np.flatnonzero(((bounds[:, 0] < box[1]) & (bounds[:, 1] > box[0])).all(axis=1))
        return not triangles_meet_boxes(solid[near], np.repeat(box[None], len(near), axis=0)).any()

    def column(box: np.ndarray) -> tuple[bool, bool]:
        middle = box.mean(axis=0)
        over = ((bounds[:, 0, :2] <= middle[:2]) & (bounds[:, 1, :2] >= middle[:2])).all(axis=1)
        return bool((over & (bounds[:, 0, 2] >= box[1, 2])).any()), bool((over & (bounds[:, 1, 2] <= box[0, 2])).any())

    found: list[np.ndarray] = []
    for _ in range(200 * count * 20):
        if len(found) == 2 * count:
            break
        corner = random.integers(low, np.maximum(high - side, low + 1))
        box = np.stack([corner, corner + side])
        if all(column(box)) and free(box):
            found.append(box)
    if len(found) < 2 * count:
        raise InputError(f"{scene.source}: expected {2 * count} free places of {CELL_M} m, found {len(found)}")
    rooms = [_grown(box, free, scene.grid_m) for box in found[count:]]
    return np.array(found[:count], np.int32), np.array(rooms, np.int32)


def _grown(box: np.ndarray, free: Callable[[np.ndarray], bool], grid_m: float) -> np.ndarray:
    """The box, each side moved outwards until something stands there."""
    step = round(ROOM_STEP_M / grid_m)
    moving = [(side, axis) for axis in range(3) for side in (0, 1)]
    while moving:
        for side, axis in list(moving):
            wider = box.copy()
            wider[side, axis] += step if side else -step
            if (wider[1, axis] - wider[0, axis]) * grid_m <= ROOM_M[axis] and free(wider):
                box = wider
            else:
                moving.remove((side, axis))
    return box


def variants(model: OccluderModel) -> dict[str, Variant]:
    """The methods to compare, by title."""
    scene, outlines = model.sights.model.scene, model.sights.model.outlines
    occludees, owners, count = model.occludees, model.occludees.owners, len(scene.objects)
    present = np.flatnonzero(np.diff(occludees.starts))

    def by_shaft(boxes: np.ndarray, of: np.ndarray, smallest: int, cap: int) -> Variant:
        def hidden(cells: np.ndarray) -> np.ndarray:
            out = np.zeros((len(cells), count), bool)
            out[:, present] = True
            for row, cell in enumerate(cells):
                meet = ((boxes[:, 0] < model.cells[cell, 1]) & (boxes[:, 1] > model.cells[cell, 0])).all(axis=1)
                out[row, of[meet]] = False
                everything = np.concatenate([model.cells[cell : cell + 1], boxes[~meet]])
                rows = np.column_stack([np.zeros((~meet).sum(), int), np.arange(1, len(everything))])
                verdict = launch_shaft(model.shields, everything, rows, smallest=(smallest, smallest), cap=cap).verdict
                out[row, of[~meet][verdict != Verdict.HIDDEN]] = False
            return out

        return hidden

    def by_map(clusters: int, objective: str = "centre", **settings: int) -> Variant:
        chosen = VlodSettings(clusters=clusters, objective=objective, **settings)

        def hidden(cells: np.ndarray) -> np.ndarray:
            return vlod_hidden(model.cells[cells], outlines, occludees.pieces, owners, chosen, objects=count)[0]

        return hidden

    def by_lines(cells: np.ndarray) -> np.ndarray:
        out = np.ones((len(cells), count), bool)
        rows, _ = seen_objects(model, cells)
        out[np.searchsorted(cells, rows.source), rows.target] = False
        return out

    quarter = round(0.25 / scene.grid_m)
    return {
        "A umbra of regions, whole box": by_shaft(occludees.bounds[present], present, WHOLE, 1),
        "A8 umbra of regions, pieces": by_shaft(occludees.pieces, owners, WHOLE, 1),
        "B one point (centre), 256": by_map(1, resolution=256),
        "B one point (centre), 512": by_map(1),
        "B one point (centre), 1024": by_map(1, resolution=1024),
        "B one point by (5), 512": by_map(1, objective="socp"),
        "B one point by (6), 512": by_map(1, objective="lp"),
        "B 512, depth-limited, 1 shell": by_map(1, shells=1),
        "B 512, 8 shells": by_map(1, shells=8),
        "C 6 clusters by (5), 512": by_map(6, objective="socp"),
        "C 14 clusters by (5), 512": by_map(14, objective="socp"),
        "C 26 clusters by (5), 512": by_map(26, objective="socp"),
        "C 26 clusters by (6), 512": by_map(26, objective="lp"),
        "D 26 clusters, centre, 512": by_map(26),
        "D 26 clusters, random point, 512": by_map(26, objective="random"),
        "E B centre 512, cell split in 8": by_map(1, split=2),
        "F shafts, halved to 0.25 m": by_shaft(occludees.pieces, owners, quarter, 2000),
        "G lines and shafts (default), with witnesses": by_lines,
    }


def compare(scene: Scene, name: str, count: int, rays: int, only: str) -> None:
    """Print the table of one model."""
    small, rooms = sample_cells(scene, count)
    cells = np.concatenate([small, rooms])
    prepared = PreparedModel(scene)
    model = OccluderModel.of(Sights.of(prepared, cells, 0, CPU))
    seen = np.zeros((len(cells), len(scene.objects)), bool)
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "cells.csv"
        write_view_cells(cells, scene, table)
        made = bake(scene, Path(folder) / "cells.bake", settings=Settings(method="occluders", cells=str(table)))
        result = made.verify(rays=rays)
        seen |= witnessed_objects(made)
        seen |= seen_by_rays(made, rays, 1)[1]
    regions, patches = prepared.regions, prepared.patches
    found = f"seen {seen[:count].sum():,} / {seen[count:].sum():,}"
    checked = f"{result.rays:,} rays, {result.wrong_hidden} wrong hidden, {result.refuted} refuted"
    print(
        f"\n{name}: {len(scene.objects):,} objects, {len(regions.boxes):,} rectangles of {len(regions.axis):,} "
        f"regions, {len(patches.area):,} oblique patches; {found}; verify: {checked}\n",
        flush=True,
    )
    print_head(HEAD)
    for title, hidden in variants(model).items():
        if only and not any(title.startswith(start) for start in only.split(",")):
            continue
        hidden(np.arange(1))
        columns: list[object] = [title]
        wrong = 0
        for part in (np.arange(count), np.arange(count, 2 * count)):
            # The projection points of several cells are solved together, as a bake would.
            groups = [part] if title[0] in "BCDE" else part[:, None]
            times, answers = [], []
            for group in groups:
                start = time.perf_counter()
                answers.append(hidden(group))
                times.append(1e3 * (time.perf_counter() - start) / len(group))
            out = np.concatenate(answers)
            wrong += int((out & seen[part]).sum())
            ratio = (~out).sum() / max(seen[part].sum(), 1)
            spread = f" ({min(times):,.0f}-{max(times):,.0f})" if len(times) > 1 else ""
            columns += [f"{ratio:.2f}", f"{statistics.median(times):,.0f}{spread}"]
        print_row([*columns, wrong])


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of `run`."""
    parser.add_argument("models", nargs="+", metavar="MODEL", help="or the word office")
    parser.add_argument("--cells", type=int, default=CELLS, help="of each size")
    parser.add_argument("--rays", type=int, default=RAYS, help="over all cells")
    parser.add_argument("--only", default="", help="letters of the variants, separated by commas")


def run(options: argparse.Namespace) -> int:
    """Print a table for each model. Returns the exit code."""
    print(f"commit {commit()}, one CPU thread; ms per cell: median (least-most), or mean of cells done together")
    for model in options.models:
        scene = make_office() if model == "office" else read(model)
        compare(scene, Path(model).name, options.cells, options.rays, options.only)
    return 0
