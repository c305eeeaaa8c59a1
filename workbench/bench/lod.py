"""Chains of levels of detail: seconds, triangles by level, and how tight their deviations are.

Run `python -m viewcell.workbench.bench.lod [MODEL...]`; without a model, the shapes of an office like Soda Hall.
Whatever levels a model comes with are left out.
"""

import argparse
import statistics
import sys
import time
from dataclasses import replace

import warp as wp

from ...data.buildings.office import make_office
from ...data.errors import InputError
from ...data.readers import read
from ...data.scene import Definition, Scene
from ...kernels import deviation
from ...kernels.launch import Device
from ...solvers.levels.chain import COARSEST, lod_chain, with_lods
from .timing import commit, print_head, print_row, quiet

HEAD = (
    "model",
    "shapes",
    f"above {COARSEST} triangles",
    "seconds",
    "threads",
    "triangles by level (shapes)",
    "deviation upper / lower, median",
    "worst where above a grid step",
    "most upper - lower below one, grid steps",
    "watertight",
    "not down to the coarsest",
    "commit",
)


def columns(name: str, scene: Scene) -> list[object]:
    """One row of the table; compile time excluded."""
    scene = replace(scene, definitions=[Definition(shape.name, shape.lods[:1]) for shape in scene.definitions])
    start = time.perf_counter()
    device = Device.wanted("cpu")
    made, _ = with_lods(scene, device=device)
    seconds = time.perf_counter() - start
    large = [shape for shape in scene.definitions if len(shape.lods[0].faces) > COARSEST]
    chains = [lod_chain(shape.lods[0]) for shape in large]
    depth = max((len(shape.lods) for shape in made.definitions), default=1)
    levels = [[shape.lods[k] for shape in made.definitions if len(shape.lods) > k] for k in range(depth)]
    # A bound before the maximum along the chain is what was measured.
    pairs = [
        (mesh.error_m, low)
        for chain in chains
        for mesh, low, before in zip(chain.levels[1:], chain.lower_m[1:], chain.levels, strict=False)
        if mesh.error_m > before.error_m
    ]
    ratios = [upper / low for upper, low in pairs if low > scene.grid_m]
    return [
        name,
        len(scene.definitions),
        len(large),
        f"{seconds:.2f}",
        device.threads,
        ", ".join(f"{sum(len(mesh.faces) for mesh in level):,} ({len(level)})" for level in levels),
        f"{statistics.median(ratios):.4f}" if ratios else "-",
        f"{max(ratios):.4f}" if ratios else "-",
        f"{max((upper - low for upper, low in pairs if low <= scene.grid_m), default=0) / scene.grid_m:.3f}",
        sum(chain.watertight for chain in chains),
        sum(bool(chain.ended) for chain in chains),
        commit(),
    ]


def main(argv: list[str] | None = None) -> int:
    """Print the table. Returns the exit code: 2 for a model that cannot be read."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("models", nargs="*", metavar="MODEL")
    options = parser.parse_args(argv)
    quiet()
    wp.load_module(deviation.__name__, device="cpu")
    print_head(HEAD)
    try:
        if not options.models:
            print_row(columns("office like soda-hall", make_office(like="soda-hall")))
        for model in options.models:
            print_row(columns(model, read(model)))
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
