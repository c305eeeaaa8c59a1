"""Textured depth meshes of a bake's view cells: triangles, bytes, seconds and errors, and what they save on a walk.

Source: Aliaga et al. 1999, section 6.
"""

import argparse
import tempfile
import time
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from ...data.camera import CameraPath, Screen
from ...data.lod import object_errors
from ...data.store.bake_folder import BakeFolder, read_bake
from ...data.store.depth_items import encode_face
from ...kernels.launch import Device
from ...solvers.depth_meshes.balance import Balance, Balanced, Budget
from ...solvers.depth_meshes.mesh import depth_mesh
from ...solvers.levels.benefit import find_sightings
from ...verify.rays.far_side import FarCheck, check_far_side
from ..export.sets import model_of
from ..files import write_files
from ..pack.depth import ALL, DepthSettings
from ..pack.run import pack
from ..summary import table
from ..walk.run import walk
from ..walk.settings import WalkSettings
from ..walk.tally import Walked
from .lines import NONE, Line

# View cells that are measured, at most; texels and rays that judge each.
CELLS, TEXELS, RAYS = 24, 20_000, 20_000
VIEWS = 5
# Triangles of a mesh, as published.
PUBLISHED_TRIANGLES = 10_000
TRIANGLES = 80_000
# Frames in each view cell of a path that looks around in one after another; caches [bytes].
FRAMES = 12
CACHES = (1_000_000, 2_000_000, 4_000_000, 8_000_000, 16_000_000)
SCREEN = Screen()


@dataclass(frozen=True)
class CellMeasure:
    """Depth meshes of a view cell.

    Attributes:
        cell: its id.
        found: near geometry and meshes.
        cull_box_m: size of the cull box [m].
        bytes: of the six faces.
        seconds: of balance and meshes, and of the meshes alone, on one thread.
        check: by rays.
        coarse_texels: what the worst face would be off by with PUBLISHED_TRIANGLES as one mesh.
    """

    cell: int
    found: Balanced
    cull_box_m: float
    bytes: int
    seconds: tuple[float, float]
    check: FarCheck
    coarse_texels: float


def measure_cells(bake: BakeFolder, triangles: int, device: Device) -> list[CellMeasure]:
    """Measure some view cells of a bake, evenly drawn from those that have meshes."""
    scene, cells = model_of(bake), np.flatnonzero(bake.graph.inhabitable)
    chosen = cells[:: -(-len(cells) // CELLS)]
    starts, members = bake.object_sets.lists(chosen)
    balance, rng, out = Balance(scene, Budget(triangles, SCREEN), device=device), np.random.default_rng(0), []
    for row, cell in enumerate(chosen.tolist()):
        potential, box = members[starts[row] : starts[row + 1]], bake.graph.cells[cell]
        begin = time.perf_counter()
        found = balance.of(potential, box)
        whole = time.perf_counter() - begin
        if not len(found.side.far):
            continue
        begin = time.perf_counter()
        side = balance.sides.of(potential, box, found.cull_box)
        spent = whole, time.perf_counter() - begin
        size = sum(len(encode_face(side, face)) for face in range(len(side.meshes)))
        check = check_far_side(scene, side, box, rng, texels=TEXELS, rays=RAYS)
        coarse = [
            depth_mesh(side.parallax[face], side.ids[face] >= 0, 1e-3, most=PUBLISHED_TRIANGLES).error
            for face in range(len(side.meshes))
        ]
        out.append(CellMeasure(cell, found, found.cull_box * scene.grid_m, size, spent, check, max(coarse)))
    return out


def cell_lines(measured: list[CellMeasure], view_cells: int) -> list[Line]:
    """What they come to."""
    if not measured:
        return [Line("depth meshes", NONE, "none", f"they pay in none of {view_cells} view cells")]
    check = sum((one.check for one in measured[1:]), measured[0].check)
    sides = [one.found.side for one in measured]
    screen = [side.error / (side.ids.shape[1] / 2 - 1) * SCREEN.focal for side in sides]

    def spread(values: list, digits: int = 0) -> str:
        return f"{np.median(values):,.{digits}f} ({np.min(values):,.{digits}f} to {np.max(values):,.{digits}f})"

    rays = check.rays - check.nothing
    return [
        Line(
            "triangles of a view cell's meshes",
            "10,000",
            spread([side.triangles for side in sides]),
            f"{len(measured)} view cells; they stand for {np.median([one.found.stood_for for one in measured]):,.0f}",
        ),
        Line("kB of them", "161", spread([one.bytes / 1e3 for one in measured]), "six faces of 512 x 512"),
        Line("seconds, with balance", NONE, spread([one.seconds[0] for one in measured], 1), "one thread"),
        Line("of them, images and meshes", NONE, spread([one.seconds[1] for one in measured], 1)),
        Line("cull box [m]", NONE, spread([one.cull_box_m for one in measured])),
        Line("level threshold [pixels]", NONE, spread([one.found.pixels for one in measured], 1), "640 x 480"),
        Line(
            "proved error at a cell's corners [texels]",
            NONE,
            spread([side.error for side in sides], 2),
            f"at most {max(screen):.1f} pixels of 640 x 480; 0 at the cell's middle",
        ),
        Line("texels off by more", NONE, f"{check.over:,} of {check.texels:,}", f"worst at {check.worst:.0%} of it"),
        Line("longest skin [texels]", NONE, spread([side.skin for side in sides], 1), "at corners; none over layers"),
        Line(
            "rays that see far objects past every texel",
            NONE,
            f"{100 * check.uncovered / rays:.2f} %",
            f"of {rays:,}; half of the eyes at corners",
        ),
        Line("rays that meet a mesh elsewhere", NONE, f"{100 * check.misplaced / rays:.2f} %", "torn texels"),
        Line("rays to near geometry that meet a mesh before", NONE, f"{100 * check.near_lost / rays:.2f} %"),
        Line(
            "error of a face as one mesh of 10,000 triangles",
            NONE,
            f"{spread([one.coarse_texels for one in measured], 1)} texels",
            "the worst of six",
        ),
    ]


def reduction_lines(bake: BakeFolder, measured: list[CellMeasure]) -> list[Line]:
    """Table 1: what each technique takes from what the one before left, means of some views."""
    scene, chosen = model_of(bake), measured[:: max(1, len(measured) // VIEWS)][:VIEWS]
    triangles, boxes = scene.triangle_counts, scene.object_bounds()
    _, starts = object_errors(scene)
    levels = np.array([len(m.faces) for o in scene.objects for m in scene.definitions[o.definition_id].lods])
    left = [[float(triangles.sum())] for _ in chosen]
    for number, (one, counts) in enumerate(zip(chosen, left, strict=True)):
        side, half = one.found.side, one.found.cull_box / 2
        near = ((boxes[:, 0] <= side.middle + half) & (boxes[:, 1] >= side.middle - half)).all(axis=1)
        near[side.near] = True
        eyes = side.middle[None] * scene.grid_m
        path = CameraPath(eyes, np.array([72.0 * number]), np.zeros(1), np.zeros(1))
        view = np.zeros(len(boxes), bool)
        view[find_sightings(scene, path, SCREEN, np.ones((1, len(boxes)), bool)).object_id] = True
        counts.append(float(triangles[near].sum()))
        counts.append(float(triangles[near & view].sum()))
        kept = side.near[view[side.near]]
        counts.append(float(triangles[kept].sum()))
        counts.append(float(levels[starts[kept] + one.found.levels[view[side.near]]].sum()))
    shares = 1 - np.array([[b / max(a, 1) for a, b in pairwise(one)] for one in left])
    removed = [f"{100 * share:.0f} %" for share in shares.mean(axis=0)]
    last, meshes = np.mean([one[-1] for one in left]), np.mean([one.found.side.triangles for one in chosen])
    return [
        Line("textured depth meshes", "96 %", removed[0], "within the cull box, or on no texel"),
        Line("view frustum", "47 %", removed[1], "objects by their boxes"),
        Line("occlusion", "10 %", removed[2], "from-region sets"),
        Line("level of detail", "47 %", removed[3], "within the view cell's threshold"),
        Line("left as geometry", "0.9 %", f"{100 * last / triangles.sum():.2f} %", f"{last:,.0f} triangles"),
        Line("triangles of meshes beside it", "10,000", f"{meshes:,.0f}", "to all sides"),
    ]


@dataclass(frozen=True)
class LookAround:
    """Looks around in one view cell after another, prefetched as published.

    Attributes:
        plain: without depth meshes.
        warm: with them, and a cache that holds everything.
        by_cache: with smaller ones, by their size [bytes].
    """

    plain: Walked
    warm: Walked
    by_cache: dict[int, Walked]


def look_around(bake: BakeFolder, folder: Path, triangles: int) -> LookAround:
    """Pack a bake with depth meshes, and look around."""
    cells = np.flatnonzero(bake.graph.inhabitable)[:CELLS]
    middles = bake.graph.cells[cells].mean(axis=1) * bake.grid_m
    eyes = np.repeat(middles[np.argsort(middles[:, 0], kind="stable")], FRAMES, axis=0)
    count = len(eyes)
    path = CameraPath(eyes, np.arange(count) * 360 / FRAMES % 360, np.zeros(count), np.arange(count) / 10)
    database = pack(bake, folder / "depth.walk", depth=DepthSettings(ALL, triangles))
    settings = WalkSettings(policy="mmr", screen=SCREEN, target_ms=1000.0, cache_bytes=10**9)
    return LookAround(
        walk(database, path, settings=replace(settings, depth_meshes=False)),
        walk(database, path, settings=settings),
        {size: walk(database, path, settings=replace(settings, cache_bytes=size)) for size in CACHES},
    )


def graph_lines(look: LookAround) -> list[Line]:
    """Graphs 1 and 3 in numbers."""
    plain, warm = look.plain.shown, look.warm.shown
    out = [
        Line(
            "triangles of a frame, as geometry",
            NONE,
            f"{plain['chosen_polygons'].mean():,.0f}, {plain['chosen_polygons'].max():,} at most",
            "sets, view and a pixel's levels",
        ),
        Line(
            "likewise, with depth meshes",
            NONE,
            f"{warm['chosen_polygons'].mean():,.0f}, {warm['chosen_polygons'].max():,} at most",
        ),
        Line(
            "frames a second (Graph 1)",
            "10 to 30",
            f"{1e3 / warm['chosen_ms'].mean():.0f}",
            f"modelled, software renderer; {1e3 / plain['chosen_ms'].mean():.0f} as geometry",
        ),
    ]
    for size, walked in look.by_cache.items():
        columns = walked.policies[0].columns
        out.append(
            Line(
                f"MB read with a cache of {size / 1e6:g} MB (Graph 3)",
                "flat from 140 MB on" if size == CACHES[-1] else NONE,
                f"{columns['read_bytes'].sum() / 1e6:.1f}",
                f"something missing in {100 * (columns['missing'] > 0).mean():.1f} % of {len(walked.path)} frames",
            )
        )
    return out


def graph_figure(look: LookAround, measured: list[CellMeasure]) -> bytes:
    """Frame times, errors, bytes against cache size, and reads along the path, as a PNG."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from ..pages import COLOURS, png

    figure = Figure(figsize=(11.0, 7.5), layout="constrained")
    FigureCanvasAgg(figure)
    (times, errors), (caches, reads) = figure.subplots(2, 2)
    frames = np.arange(len(look.warm.path))
    for values, label, colour in (
        (look.plain.shown["finest_ms"], "sets, at the finest levels", "#bbbbbb"),
        (look.plain.shown["chosen_ms"], "sets, levels of a pixel", COLOURS[0]),
        (look.warm.shown["chosen_ms"], "depth meshes beyond cull boxes", COLOURS[1]),
    ):
        times.plot(frames, values, color=colour, linewidth=1, label=label)
    times.set(xlabel="frame", ylabel="ms, modelled", ylim=(0, None), title="Graph 1: time of a frame")
    times.legend(fontsize=8, frameon=False)
    tenths = np.sum([one.check.tenths for one in measured], axis=0)
    errors.bar(
        np.arange(11) * 0.1 + 0.05, 100 * tenths / tenths.sum(), width=0.09, color=[COLOURS[0]] * 10 + ["#b00020"]
    )
    errors.axvline(1.0, color="#777777", linestyle="--", linewidth=1)
    errors.set(
        xlabel="part of the proved bound", ylabel="% of texels", title="Texels off, from random eyes of their cell"
    )
    sizes = np.array([*look.by_cache]) / 1e6
    read = [walked.policies[0].columns["read_bytes"].sum() / 1e6 for walked in look.by_cache.values()]
    caches.plot(sizes, read, marker="o", color=COLOURS[0])
    caches.set(xlabel="cache [MB]", ylabel="MB read", ylim=(0, None), xlim=(0, None), title="Graph 3: bytes read")
    size = CACHES[len(CACHES) // 2]
    reads.bar(frames, look.by_cache[size].policies[0].columns["read_bytes"] / 1e3, width=1.0, color=COLOURS[0])
    reads.set(xlabel="frame", ylabel="kB", title=f"Graph 4: reads, with a cache of {size / 1e6:g} MB")
    for axes in (times, errors, caches, reads):
        axes.spines[["top", "right"]].set_visible(False)
    return png(figure)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of `run`."""
    parser.add_argument("bake", metavar="BAKE", help="of small view cells, such as --cells walkways, with --lods")
    parser.add_argument("--plot", metavar="PNG", help="also draw the paper's graphs there")
    parser.add_argument("--triangles", type=int, default=TRIANGLES, help=f"of a view cell; {TRIANGLES:,} by default")


def run(options: argparse.Namespace) -> int:
    """Measure a bake and print what it came to."""
    bake = read_bake(options.bake)
    measured = measure_cells(bake, options.triangles, Device())
    lines = cell_lines(measured, int(bake.graph.inhabitable.sum()))
    if measured:
        with tempfile.TemporaryDirectory() as folder:
            look = look_around(bake, Path(folder), options.triangles)
        lines += reduction_lines(bake, measured) + graph_lines(look)
        if options.plot:
            plot = Path(options.plot)
            write_files(plot.parent, lambda: {plot.name: graph_figure(look, measured)})
    print(table(("", "published", "ours", ""), [(row.what, row.published, row.ours, row.note) for row in lines]))
    return 0
