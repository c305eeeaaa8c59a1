"""Sets in storage: runs by the order of objects, and bytes by how they are coded, ours beside the published scheme."""

import argparse
import statistics
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...data.runs import decode, encode
from ...data.store.bake_folder import BakeFolder, read_bake
from ...data.store.walk_folder import column_bytes
from ...data.store.walk_tables import display_sets
from ...kernels.launch import Device
from ...solvers.tour import count_runs, curve_places, tour_order
from ..export.sets import model_of
from ..pack.run import RANDOM_SEED, pack
from ..summary import table
from .published import Sets, boundaries, changes, sampled_order, two_bit_bytes

REPEATS = 51
# Orders and codes that others ask for.
SAMPLED_ORDER, TOUR = "sampled tour of boundaries, as published", "tour of sets"
SCHEME = "changes at boundaries, sampled tour, two-bit code, as published"
AS_PACKED = "sets, tour, varints in Parquet, as packed"


@dataclass(frozen=True)
class Storage:
    """What storing the sets of a bake comes to.

    Attributes:
        view_cells: sets.
        objects: of the model.
        runs: over all sets, by order.
        sizes: bytes of all sets, by code.
        seconds: the tour.
        runs_us: decoding one set into runs, all at once; the median.
        ids_us: the same into ids.
    """

    view_cells: int
    objects: int
    runs: dict[str, int]
    sizes: dict[str, int]
    seconds: float
    runs_us: float
    ids_us: float

    def fewer(self, order: str) -> float:
        """By how much runs are fewer than in random order [%]."""
        return 100 * (1 - self.runs[order] / max(1, self.runs["random"]))

    def below(self, code: str) -> float:
        """How many times smaller a code is than bitmasks."""
        return self.sizes["bitmasks"] / max(1, self.sizes[code])

    def text(self) -> str:
        """Two tables."""
        orders = [(name, f"{runs:,}", f"{self.fewer(name):.1f}") for name, runs in self.runs.items()]
        codes = [
            (name, f"{size:,}", f"{size / max(1, self.view_cells):.0f}", f"{self.below(name):.1f}")
            for name, size in self.sizes.items()
        ]
        return "\n".join(
            [
                f"{self.view_cells:,} view cells, {self.objects:,} objects",
                table(("order of objects", "runs", "% below random"), orders),
                "",
                table(("code", "bytes", "a view cell", "x below bitmasks"), codes),
                "",
                f"tour {self.seconds:.2f} s; a set decoded into runs in {self.runs_us:.2f} us, into ids in "
                f"{self.ids_us:.2f} us (all at once, median of {REPEATS})",
            ]
        )


def measure_storage(bake: BakeFolder) -> Storage:
    """Store the sets of a bake every way.

    Raises:
        InputError: the bake is of a bare cell graph.
    """
    scene, graph = model_of(bake), bake.graph
    cells, count = np.flatnonzero(graph.inhabitable), len(scene.objects)
    told = display_sets(bake, cells, np.arange(count))
    sets, middles = Sets(told.starts, told.members, count), scene.object_bounds().sum(axis=1) / 2
    # What compiling takes, or loading, is not the tour's.
    tour_order(np.array([0, 1]), np.array([0]), np.zeros((2, 3)))
    begin = time.perf_counter()
    order = tour_order(sets.starts, sets.members, middles, Device.wanted("cpu"))
    seconds = time.perf_counter() - begin
    comes, goes = changes(sets, boundaries(graph, cells))
    both = Sets.of_rows([np.union1d(comes.of(row), goes.of(row)) for row in range(len(comes))], count)
    sampled = sampled_order(both)
    orders = {
        "random": np.random.default_rng(RANDOM_SEED).permutation(count),
        "as made": np.arange(count),
        "Hilbert curve of box middles": np.argsort(curve_places(middles), kind="stable"),
        SAMPLED_ORDER: sampled,
        TOUR: order,
    }
    known = {name: one for name, one in orders.items() if one is not None}
    runs = {name: count_runs(sets.starts, sets.members, one) for name, one in known.items()}
    mine = sets.ordered(order)
    codes = encode(mine.starts, mine.members)
    sizes = {"bitmasks": len(sets) * -(-count // 8)}
    if sampled is not None:
        parts = [two_bit_bytes(part.ordered(sampled)) for part in (comes, goes)]
        sizes[SCHEME] = sum(parts)
        sizes["sets, sampled tour, two-bit code"] = two_bit_bytes(sets.ordered(sampled))
    sizes["sets, tour, two-bit code"] = two_bit_bytes(mine)
    sizes["sets, tour, varints"] = sum(map(len, codes))
    with tempfile.TemporaryDirectory() as name:
        sizes[AS_PACKED] = column_bytes(pack(bake, Path(name) / "a.walk"), "potential")
    into_runs, into_ids = ([_microseconds(codes, count, ids) for _ in range(REPEATS)] for ids in (False, True))
    each = [statistics.median(times) for times in (into_runs, into_ids)]
    return Storage(len(sets), count, runs, sizes, seconds, *each)


def _microseconds(codes: list[bytes], count: int, ids: bool) -> float:
    """Time for one set when all are decoded."""
    begin = time.perf_counter()
    found = decode(codes, count)
    if ids:
        found.ids()
    return 1e6 * (time.perf_counter() - begin) / max(1, len(codes))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of `run`."""
    parser.add_argument("bakes", metavar="BAKE", nargs="+", help="bake folders of models")


def run(options: argparse.Namespace) -> int:
    """Print the tables of each bake. Returns the exit code."""
    for folder in options.bakes:
        print(f"{folder}: {measure_storage(read_bake(folder)).text()}\n")
    return 0
