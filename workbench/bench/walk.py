"""A walk measured: time of each part of a frame, and reads by the order of items in the file, against random order."""

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...data.store.ranges import ranges_of
from ...data.store.walk_folder import WalkFolder, read_walk
from ..pack.run import RANDOM_SEED
from ..summary import table
from ..walk.display import shelves_of
from ..walk.far import FarFaces
from ..walk.run import walk
from ..walk.settings import ALL, DEFAULT_POLICY, WalkSettings
from ..walk.tables import policies
from ..walk.tally import PolicyFrames, Walked
from .lines import NONE, Line

FRAMES = 9_000
# Of a triangle in the published display database: 349.5 MB, 2,217,792 polygons.
POLYGON_BYTES = 158
# Gaps that are read over [bytes]: none, and what a solid-state disk and a slower one read in the time of a seek.
GAPS = (0, 16 * 1024, 64 * 1024)
RANDOM, AS_MADE, PACKED = "random", "as made, object by object", "as packed: tour of sets, level by level"
# The steps of a frame's computing, and who takes them.
PARTS = {"visibility": "eye_s", "levels": "levels_s", "look-ahead and cache": "memory_s", "all": "compute_s"}


@dataclass(frozen=True)
class WalkBench:
    """What a walk took.

    Attributes:
        walked: the walk, by all policies.
        reads: ranges that the first policy asks for, and bytes between items in them, by order of items and gap.
    """

    walked: Walked
    reads: dict[tuple[str, int], tuple[int, int]]

    def fewer(self, gap: int) -> float:
        """By how much reads as packed are fewer than in random order [%]."""
        return 100 * (1 - self.reads[PACKED, gap][0] / max(1, self.reads[RANDOM, gap][0]))

    def ms(self, part: str) -> np.ndarray:
        """Median, 99 % and most of a part of the frames' computing [ms], by the first policy."""
        columns = self.walked.shown | self.walked.policies[0].columns
        return 1e3 * np.quantile(columns[PARTS[part]], (0.5, 0.99, 1.0))

    def text(self) -> str:
        """Three tables."""
        times = [(part, *(f"{value:.2f}" for value in self.ms(part))) for part in PARTS]
        rows = []
        for (order, gap), (count, waste) in self.reads.items():
            random = self.reads[RANDOM, gap][0]
            fewer = f"{100 * (1 - count / max(1, random)):.1f}"
            rows.append((order, f"{gap // 1024} kB", f"{count:,}", fewer, f"{waste / 1e6:,.1f}"))
        return "\n\n".join(
            [
                table(("computing of a frame", "ms, median", "99 %", "most"), times),
                policies(self.walked).text(),
                table(("order of items", "gaps read over", "reads", "% below random", "MB between"), rows),
            ]
        )


def measure_walk(database: WalkFolder, frames: int, settings: WalkSettings) -> WalkBench:
    """Walk through a database, and lay its items out anew.

    Raises:
        InputError: as `walk`.
    """
    # Orders are of levels of objects.
    walked = walk(database, frames=frames, settings=replace(settings, depth_meshes=False))
    shelves = shelves_of(database, FarFaces(database, False), settings.polygon_bytes)
    owner, lod = (database.items[name].to_numpy() for name in ("owner", "lod"))
    orders = {
        RANDOM: np.random.default_rng(RANDOM_SEED).permutation(len(owner)),
        AS_MADE: np.lexsort((lod, owner)),
        PACKED: np.arange(len(owner)),
    }
    one = walked.policies[0]
    reads = {
        (name, gap): _reads(one, order, shelves.sizes, gap) for name, order in orders.items() for gap in GAPS
    }  # fmt: skip
    return WalkBench(walked, reads)


def _reads(one: PolicyFrames, order: np.ndarray, sizes: np.ndarray, gap: int) -> tuple[int, int]:
    """Ranges in which a policy's items are read where they lie in an order, and bytes between them."""
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    lying = sizes[order]
    offsets = np.append(0, np.cumsum(lying)[:-1])
    found = [ranges_of(place[items], offsets, lying, gap) for items in one.asked]
    return sum(map(len, found)), sum(one.waste for ranges in found for one in ranges)


def walk_lines(found: WalkBench) -> dict[str, list[Line]]:
    """Tables 3 to 6 of Funkhouser et al. 1996, and what the policies of the other papers come to on the same path."""
    walked = found.walked
    shown, model = walked.shown, walked.model
    by_name = {one.name: one.columns for one in walked.policies}
    published, ours = by_name["as-published"], by_name[DEFAULT_POLICY]

    def of(values: np.ndarray, digits: int) -> str:
        return f"{values.mean():,.{digits}f} / {values.max():,.{digits}f}"

    def ms(values: np.ndarray) -> str:
        return f"{1e3 * values.mean():.2f} / {1e3 * values.max():.1f} ms"

    def both(name: str, digits: int, scale: float = 1.0) -> str:
        return f"{of(published[name] * scale, digits)}; {of(ours[name] * scale, digits)}"

    polygons, chosen = shown["polygons"], shown["chosen_polygons"]
    display = [
        Line("cells, visibility", "19 / 70", of(shown["cells"], 0)),
        Line("objects, visibility", "105 / 469", of(shown["objects"], 0)),
        Line("polygons, visibility", "5,002 / 45,828", of(polygons, 0)),
        Line("of the model", "0.35 % / 3.23 %", f"{of(100 * polygons / model.polygons, 2)} %"),
        Line("objects, detail elision", "104 / 445", of(shown["chosen_objects"], 0)),
        Line("polygons, detail elision", "2,534 / 6,912", of(chosen, 0), "for 16 ms; theirs for 66 ms"),
        Line("compute time, visibility", "18 / 107 ms", ms(shown["eye_s"]), "one frame at a time"),
        Line("compute time, detail elision", "33 / 199 ms", ms(shown["eye_s"] + shown["levels_s"])),
        Line("render time, entire model", "15.4 / 17.4 s", f"{1e3 * model.render_s:.0f} ms", "modelled, software"),
        Line("render time, visibility", "61 / 557 ms", ms(shown["finest_ms"] / 1e3), "likewise"),
        Line("render time, detail elision", "32 / 83 ms", ms(shown["chosen_ms"] / 1e3), "likewise"),
    ]
    memory = [
        Line("compute time, memory management too", "40 / 244 ms", ms(ours["compute_s"]), "coarse first"),
        Line("swap time", "20 / 898 ms", ms(ours["swap_s"]), "0.8 MB in a frame's 100 ms"),
        Line("objects resident", "986 / 1,698", both("resident_objects", 0)),
        Line("MB resident", "14.5 / 18.1", both("claimed", 1, 1e-6), "or asked for"),
        Line("MB looked ahead to", "9.9 / 54.4", both("ahead_bytes", 1, 1e-6)),
        Line("MB rendered", "0.38 / 0.99", both("drawn_bytes", 2, 1e-6)),
        Line("MB read a frame", "0.024 / 0.795", both("read_bytes", 3, 1e-6)),
        Line("levels skipped", "1.43 / 35", both("skipped", 2)),
    ]
    others = []
    for name, source in ((DEFAULT_POLICY, ""), ("as-published", "Berkeley"), ("vlod", "vLOD"), ("mmr", "MMR")):
        columns = by_name[name]
        told = (
            f"{100 * (columns['missing'] > 0).mean():.2f} %, {columns['skipped'].mean():.2f} levels skipped, "
            f"{columns['read_bytes'].sum() / 1e6:,.0f} MB read, {columns['claimed'].max() / 1e6:.1f} MB at most"
        )
        others.append(Line(f"frames with something missing, {name}", NONE, told, source))
    layout = [
        Line("reads saved by the order of the file", "almost 60 %", f"{found.fewer(0):.0f} %", "vLOD, section 7"),
        Line("likewise, gaps below 16 kB read over", NONE, f"{found.fewer(GAPS[1]):.0f} %"),
    ]
    size = f"{walked.settings.cache_bytes / 1e6:g} MB of {model.bytes / 1e6:,.1f} MB"
    return {
        f"Tables 3 and 4: a walk of {len(walked.path):,} frames, doorways included": display,
        f"Tables 5 and 6: memory of {size}; ours as published; ours coarse first": memory,
        "All policies on this path": others + layout,
    }


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Databases, and how far to walk."""
    parser.add_argument("walks", nargs="+", type=Path, metavar="WALK", help="X.walk")
    parser.add_argument("--frames", type=int, default=FRAMES, help=f"of the walk; {FRAMES} by default")
    parser.add_argument(
        "--polygon-bytes", type=int, help="of a triangle in memory; as in the file by default, 158 as published"
    )


def run(options: argparse.Namespace) -> int:
    """Print the tables of each database."""
    settings = WalkSettings(policy=ALL)
    if options.polygon_bytes is not None:
        settings = replace(settings, polygon_bytes=options.polygon_bytes)
    for folder in options.walks:
        print(f"{folder}:\n{measure_walk(read_walk(folder), options.frames, settings).text()}\n")
    return 0
