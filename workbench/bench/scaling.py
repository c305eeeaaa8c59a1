"""Bakes by occluders of ever larger synthetic scenes: seconds by phase, cost of a view cell, memory, overestimate.

Run `python -m viewcell.workbench.bench scaling --scene plant --triangles 100000 1000000 --cells 1000 --budget 300
--threads 1 --out FOLDER`. View cells are boxes of 1 m to 2 m drawn at random in the scene's spaces. Each size runs in a
process of its own, so that its peak memory is its own. The table goes to standard output, and with the picture into
FOLDER, where the bakes stay, for `viewcell verify`; below it the exponents of growth.
"""

import argparse
import multiprocessing
import resource
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
from matplotlib.figure import Figure

from ...data.buildings.city import make_city
from ...data.buildings.plant import make_plant
from ...data.scene import Scene
from ...data.store.graph_folder import CELL_COLUMNS
from ..bake.run import bake
from ..bake.settings import Settings
from .growth import fit
from .timing import commit

SCENES = {"plant": make_plant, "city": make_city}
CELL_M = (1.0, 2.0)
# Phases of a bake that come before its first view cell.
BEFORE = ("read", "view cells", "prepare")
HEAD = (
    "scene",
    "triangles",
    "objects",
    "cells",
    "budget s",
    "make s",
    "seconds by phase",
    "ms per cell",
    "peak GB",
    "potential a cell",
    "seen a cell",
    "overestimate",
    "kept %",
    "cells reached",
    "commit",
)


@dataclass(frozen=True)
class Measured:
    """One bake.

    Attributes:
        phases: seconds by phase, of the bake alone.
        bounded: cells for which something was proved hidden.
        potential: pairs (cell, object) in the potentially visible sets of bounded cells.
        seen: those with a witness.
        kept: share of the objects that a cell keeps, mean by volume, cells that were not reached included.
        peak_gb: most memory of the process, making the scene included.
    """

    scene: str
    triangles: int
    objects: int
    cells: int
    budget_s: float
    make_s: float
    phases: dict[str, float]
    bounded: int
    potential: int
    seen: int
    kept: float
    peak_gb: float

    @property
    def before_s(self) -> float:
        """All that comes before the first cell [s]."""
        return sum(self.phases.get(phase, 0.0) for phase in BEFORE)

    @property
    def cell_ms(self) -> float:
        """Visibility of one cell that the budget reached [ms]."""
        return 1000 * self.phases["flood"] / max(1, self.bounded)

    @property
    def overestimate(self) -> float:
        """Potential over seen of bounded cells; not a number where nothing was seen."""
        return self.potential / self.seen if self.seen else np.nan

    def columns(self) -> list[str]:
        """One row of the table."""
        each = max(1, self.bounded)
        return [
            self.scene,
            f"{self.triangles:,}",
            f"{self.objects:,}",
            f"{self.cells:,}",
            f"{self.budget_s:g}",
            f"{self.make_s:.1f}",
            ", ".join(f"{phase} {seconds:.1f}" for phase, seconds in self.phases.items()),
            f"{self.cell_ms:,.0f}",
            f"{self.peak_gb:.2f}",
            f"{self.potential / each:,.0f}",
            f"{self.seen / each:,.0f}",
            f"{self.overestimate:.2f}" if self.seen else "-",
            f"{100 * self.kept:.2g}",
            f"{self.bounded:,}",
            commit(),
        ]


def cells_in_spaces(scene: Scene, count: int, seed: int = 0) -> np.ndarray:
    """Boxes with sides of 1 m to 2 m inside the spaces [m], shape (count, 2, 3); a larger space gets more of them."""
    rng = np.random.default_rng(seed)
    spaces = np.array([[s.vertices.min(axis=0), s.vertices.max(axis=0)] for s in scene.spaces])
    volume = np.prod(spaces[:, 1] - spaces[:, 0], axis=1)
    chosen = spaces[rng.choice(len(spaces), count, p=volume / volume.sum())]
    extent = np.minimum(rng.uniform(*CELL_M, (count, 3)), chosen[:, 1] - chosen[:, 0])
    low = chosen[:, 0] + rng.random((count, 3)) * (chosen[:, 1] - chosen[:, 0] - extent)
    return np.stack([low, low + extent], axis=1)


def measure(
    name: str, triangles: int, cells: int, budget_s: float, device: str, threads: int | None, folder: Path
) -> Measured:
    """Make a scene and bake it into a folder; call it in a fresh process."""
    started = time.perf_counter()
    scene = SCENES[name](triangles=triangles)
    made_s = time.perf_counter() - started
    at = folder / f"{name}-{triangles}"
    at.mkdir(parents=True, exist_ok=True)
    boxes = cells_in_spaces(scene, cells).reshape(-1, 6).T
    pyarrow.csv.write_csv(pa.table(dict(zip(CELL_COLUMNS[1:], boxes, strict=True))), at / "cells.csv")
    settings = Settings(method="occluders", cells=str(at / "cells.csv"))
    run = {"budget_s": budget_s, "device": device, "threads": threads, "overwrite": True}
    made = bake(scene, at / "scene.bake", settings=settings, **run)
    source = made.cell_to_object["cell_id"].to_numpy()
    seen = np.array(made.cell_to_object["verdict"].to_pylist(), object) == "visible"
    sizes = np.bincount(source, minlength=cells)
    # A cell that the budget did not reach keeps every object.
    bounded = sizes < len(scene.objects)
    return Measured(
        scene=name,
        triangles=len(scene.triangles()[0]),
        objects=len(scene.objects),
        cells=cells,
        budget_s=budget_s,
        make_s=made_s,
        phases=made.manifest["seconds"],
        bounded=int(bounded.sum()),
        potential=int(sizes[bounded].sum()),
        seen=int(seen[bounded[source]].sum()),
        kept=made.manifest["kept"]["objects"],
        peak_gb=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
    )


def draw(rows: list[Measured], path: Path) -> None:
    """Cost of a cell, and of all that comes before the first one, against triangles."""
    figure = Figure(figsize=(7, 5), layout="constrained")
    axes = figure.subplots()
    for (name, colour), marker in zip((("plant", "#b5541c"), ("city", "#1c6fb5")), "os", strict=True):
        own = sorted((row for row in rows if row.scene == name), key=lambda row: row.triangles)
        if own:
            sizes = [row.triangles for row in own]
            axes.plot(
                sizes, [row.cell_ms / 1000 for row in own], f"{marker}-", color=colour, label=f"{name}: a view cell"
            )
            axes.plot(
                sizes,
                [row.before_s for row in own],
                f"{marker}--",
                color=colour,
                label=f"{name}: before the first cell",
            )
    axes.set(xscale="log", yscale="log", xlabel="triangles", ylabel="seconds")
    axes.grid(alpha=0.3, which="both")
    axes.legend()
    figure.savefig(path, dpi=120)


def exponents(rows: list[Measured]) -> list[str]:
    """Slopes of logarithms of costs over that of triangles by least squares, a line for each scene of several sizes.

    Sizes at which nothing was seen have no overestimate, and tell nothing of how it grows.
    """
    costs = {
        "before the first cell": lambda row: row.before_s,
        "a cell": lambda row: row.cell_ms,
        "memory": lambda row: row.peak_gb,
        "overestimate": lambda row: row.overestimate,
        "kept share": lambda row: row.kept,
    }
    lines = []
    for name in dict.fromkeys(row.scene for row in rows):
        slopes = []
        for cost, of in costs.items():
            own = [row for row in rows if row.scene == name and np.isfinite(of(row))]
            sizes = [row.triangles for row in own]
            if len(set(sizes)) > 1:
                slopes.append(f"{cost} {fit(sizes, [of(row) for row in own])[0]:.2f}")
        if slopes:
            lines.append(f"{name}, exponents in triangles: {', '.join(slopes)}")
    return lines


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of `run`."""
    parser.add_argument("--scene", nargs="+", choices=[*SCENES], default=["plant"])
    parser.add_argument("--triangles", nargs="+", type=int, default=[100_000, 1_000_000])
    parser.add_argument("--cells", type=int, default=1000)
    parser.add_argument("--budget", type=float, default=300.0, help="seconds of visibility for each bake")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, help="CPU threads; all cores by default")
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER")


def run(options: argparse.Namespace) -> int:
    """Print the table and write it and its picture. Returns the exit code."""
    options.out.mkdir(parents=True, exist_ok=True)
    lines = ["| " + " | ".join(HEAD) + " |", "|" + "---|" * len(HEAD)]
    print(*lines, sep="\n", flush=True)
    rows = []
    for name, triangles in product(options.scene, options.triangles):
        case = (name, triangles, options.cells, options.budget, options.device, options.threads, options.out)
        with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
            rows.append(pool.submit(measure, *case).result())
        lines.append("| " + " | ".join(rows[-1].columns()) + " |")
        print(lines[-1], flush=True)
        text = "\n".join([*lines, "", *exponents(rows)])
        (options.out / "scaling.md").write_text(text.rstrip() + "\n", encoding="utf-8")
        draw(rows, options.out / "scaling.png")
    print(*exponents(rows), sep="\n")
    return 0
