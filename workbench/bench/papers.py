"""The tables of the four papers beside what this software measures: writes docs/papers.md.

Run `python -m viewcell.workbench.bench papers --out docs/papers.md` (some minutes), or `... papers --only carving`.
"""

import argparse
import tempfile
import time
from itertools import combinations
from pathlib import Path

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from ...data.buildings.arcade import make_arcade
from ...data.buildings.office import make_office
from ...data.buildings.plant import make_plant
from ...data.buildings.statistics import level_statistics
from ...data.camera import Screen
from ...data.carving import find_faces
from ...data.incidence import populate
from ...data.opaque import opaque_planes
from ...data.prepared import PreparedModel
from ...data.scene import OPAQUE, Role, Scene
from ...data.store.scene_folder import write_scene
from ...data.store.view_cells import write_view_cells
from ...data.store.walk_folder import read_walk
from ...data.walkways import EYE_M, walkway_cells
from ...kernels.launch import Device
from ...solvers.visibility.projection import (
    VlodSettings,
    VlodStats,
    split_cell,
    vlod_hidden,
)
from ..bake.cells import build_graph
from ..bake.manifest import Clock
from ..bake.run import bake
from ..bake.settings import Settings
from ..baked import Bake
from ..pack.run import pack
from ..walk.settings import ALL, WalkSettings
from .depth import CELLS, TRIANGLES, VIEWS, cell_lines, graph_lines, look_around, measure_cells, reduction_lines
from .lines import NONE, Line, mean_max
from .occlusion import sample_cells
from .storage import AS_PACKED, SAMPLED_ORDER, SCHEME, TOUR, measure_storage
from .timing import commit
from .walk import FRAMES, POLYGON_BYTES, measure_walk, walk_lines

SCREEN = Screen(1280, 1024, 60.0)
PLANT_TRIANGLES = 100_000
# View cells of the plant: cubes of 2 m about free places, in eight each of which is a view cell.
PLANT_CELLS = 6
# Eyes on each axis, and directions of each eye, of a sampled set.
EYES, DIRECTIONS = 5, 100_000
# Triangles of the plant with depth meshes.
MMR_TRIANGLES = 1_000_000
# Clusters by direction that vLOD's numbers are measured with.
CLUSTERS = 26


def megabytes(path: Path) -> float:
    """Size of a file, or of all in a folder [MB]."""
    files = [path] if path.is_file() else [file for file in path.rglob("*") if file.is_file()]
    return sum(file.stat().st_size for file in files) / 1e6


PUBLISHED_LEVELS = {
    "Low": (14_478, 240_149, 1, 16.59, 2_598),
    "MedLow": (3_954, 256_895, 16, 64.97, 810),
    "Medium": (2_497, 476_957, 29, 191.01, 2_707),
    "MedHigh": (949, 728_978, 97, 768.15, 4_211),
    "High": (437, 514_813, 157, 1_178.06, 1_977),
    "All": (14_478, 1_418_807, 1, 98.00, 4_211),
}


def berkeley(folder: Path) -> dict[str, list[Line]]:
    """Funkhouser et al. 1996, on a synthetic office with the published sizes."""
    scene = make_office(like="soda-hall")
    write_scene(scene, folder / "soda.scene")
    made = bake(scene, folder / "soda.bake")
    levels = []
    for row in level_statistics(scene):
        ours = (row.objects, row.polygons, row.minimum, round(row.mean, 2), row.maximum)
        published = PUBLISHED_LEVELS[row.level]
        levels.append(Line(f"{row.level}: objects, polygons, min, mean, max", *(_many(v) for v in (published, ours))))
    return {
        "Table 1: objects and polygons by level of detail": levels,
        "Section 2.4: the display database": _database(scene, made, folder),
        "Table 2: cells": _cells(scene, made),
        "Section 3.3: precomputation": _precomputation(made),
        **_walked(made, folder),
        "The sets of this office stored, beside vLOD's (2005, sections 6 and 7)": _storage(made),
    }


def _sizes(scene: Scene) -> list[list[int]]:
    """Triangles of each level of each object."""
    return [[len(mesh.faces) for mesh in scene.definitions[o.definition_id].lods] for o in scene.objects]


def _database(scene: Scene, made: Bake, folder: Path) -> list[Line]:
    shared, flat = (
        megabytes(pack(made, folder / f"{flatten}.walk", flatten=flatten).folder) for flatten in (False, True)
    )
    return [
        Line("polygons of all levels", "2,217,792", f"{sum(map(sum, _sizes(scene))):,}"),
        Line("object instances", "14,478", f"{len(scene.objects):,}"),
        Line("unique object descriptions", "8,037", f"{len(scene.definitions):,}", "our generator shares more"),
        Line("display database, shared definitions", "21.5 MB", f"{shared:.1f} MB", "`viewcell pack`, sets included"),
        Line("display database, flattened", "349.5 MB", f"{flat:.1f} MB", "`viewcell pack --flatten`, likewise"),
    ]


def _cells(scene: Scene, made: Bake) -> list[Line]:
    graph = made.graph
    incidence, size = populate(scene, graph.cells), {"minlength": graph.cell_count}
    whole, partly = (np.bincount(incidence.cell[incidence.whole == flag], **size) for flag in (True, False))
    seen, objects = (sets[graph.inhabitable].sum(axis=1) for sets in (made.potential_cells, made.potential_objects))
    return [
        Line("portals per cell, mean / max", "3.10 / 63", mean_max(np.bincount(graph.portal_cells.ravel(), **size))),
        Line("objects completely inside", "4.16 / 86", mean_max(whole), "of one cell only"),
        Line("objects partially inside", "6.04 / 195", mean_max(partly)),
        Line("cells visible", "65.28 / 652", mean_max(seen), "from inhabitable cells"),
        Line("objects visible", "263.10 / 3,830", mean_max(objects), "likewise"),
    ]


def _precomputation(made: Bake) -> list[Line]:
    seconds, dead = made.manifest["seconds"], made.manifest.get("dead_cells", 0)
    cut = sum(seconds.get(name, 0.0) for name in ("subdivide", "portals"))
    stored = sum(megabytes(made.folder / f"{name}.parquet") for name in ("cells", "portals"))
    sets = sum(megabytes(made.folder / f"{name}.parquet") for name in ("cell_to_cell", "cell_to_object"))
    return [
        Line("cells", "5,060", f"{made.graph.cell_count + dead:,}", f"{dead:,} of them in dead space, removed"),
        Line("inhabitable cells", "1,889", f"{made.graph.inhabitable.sum():,}", "merged where no surface parts them"),
        Line("subdivision", "4 min 36 s", f"{cut:.1f} s", "33 MHz R3000 against two cores of today"),
        Line("visibility", "3 h 31 min", f"{seconds['flood']:.1f} s", "ours is exact and has witnesses"),
        Line("cells and portals stored", "6.9 MB", f"{stored:.2f} MB", "theirs with the objects of each cell"),
        Line("visibility stored", "9.4 MB", f"{sets:.1f} MB", "ours: every pair, a witness, a portal sequence"),
    ]


def _walked(made: Bake, folder: Path) -> dict[str, list[Line]]:
    """Tables 3 to 6: a walk through the flattened model, at the published size of a polygon."""
    flat = read_walk(folder / "True.walk")
    return walk_lines(measure_walk(flat, FRAMES, WalkSettings(policy=ALL, polygon_bytes=POLYGON_BYTES)))


def vlod(folder: Path) -> dict[str, list[Line]]:
    """Chhugani et al. 2005, on a synthetic process plant of another size."""
    scene = make_plant(triangles=PLANT_TRIANGLES)
    cells = plant_cells(scene)
    model = PreparedModel(scene)
    work = cells, model.outlines, model.occludees.pieces, model.occludees.owners

    def hidden(settings: VlodSettings) -> tuple[np.ndarray, VlodStats, float]:
        vlod_hidden(*work, settings, objects=len(scene.objects))
        begin = time.perf_counter()
        out, stats = vlod_hidden(*work, settings, objects=len(scene.objects))
        return out, stats, (time.perf_counter() - begin) / len(cells)

    best, stats, each = hidden(VlodSettings(CLUSTERS))
    one, random = (hidden(VlodSettings(1, objective))[0] for objective in ("socp", "random"))
    count = len(cells)
    made = bake(scene, folder / "plant.bake", settings=Settings(method="occluders", cells=_table(scene, cells, folder)))
    triangles = scene.triangle_counts
    sampled = sampled_sets(scene, cells)
    change = [
        triangles[made.potential_objects[a] != made.potential_objects[b]].sum() / triangles.sum()
        for first in range(0, count, 8)
        for a, b in combinations(range(first, first + 8), 2)
        if _share_a_face(cells[a], cells[b])
    ]
    gain = 100 * (1 - (~one).sum() / (~random).sum())
    looser = [(~best).sum() / sampled.sum(), made.potential_objects.sum() / sampled.sum()]
    phase = {name: 1e3 * value / count for name, value in stats.seconds.items()}
    query = phase["coverage"] + phase["occludees"]
    return {
        f"Sections 5 and 8: {count} view cells of 1 m in a plant of {triangles.sum():,} triangles": [
            Line("a projection point", "20 ms", f"{phase['solve'] / CLUSTERS:.2f} ms", "batched"),
            Line("visible set, optimised against random point", "5 to 10 % less", f"{gain:.1f} % less", "one cluster"),
            Line("a view cell", "0.4 to 2.2 s", f"{each:.2f} s", "26 clusters, 512 pixels"),
            Line("of it, shrinking the occluders", "0.16 s", f"{phase['shrink'] / 1e3:.3f} s"),
            Line("of it, rendering and queries", "0.2 to 2 s", f"{query / 1e3:.2f} s"),
            Line("visible set / union of 125 sample points", "2 to 10", f"{looser[0]:.2f}", "sampled by rays"),
            Line("likewise, our default method", NONE, f"{looser[1]:.2f}", "`bake --method occluders`"),
            Line(
                "geometry that changes between neighbours", "about 1 %", f"{100 * np.mean(change):.2f} %", "triangles"
            ),
        ],
        "Sections 6 and 7: storage": _storage(made),
    }


def _storage(made: Bake) -> list[Line]:
    found = measure_storage(made)
    sampled, scheme = found.fewer(SAMPLED_ORDER), found.below(SCHEME)
    ours = found.below(AS_PACKED)
    return [
        Line(
            "runs saved by reordering, plant / city",
            "64 % / 52 %",
            f"{found.fewer(TOUR):.0f} %",
            f"their sampled tour, here: {sampled:.0f} %",
        ),
        Line(
            "compression (Table 2)",
            "34 x",
            f"{ours:.1f} x",
            f"of {found.view_cells} sets of {found.objects:,} objects; their scheme, here: {scheme:.1f} x",
        ),
        Line("decompression of one change", "31 us", f"{found.ids_us:.2f} us", "of one set, into ids"),
    ]


def plant_cells(scene: Scene) -> np.ndarray:
    """Cubes of 1 m, eight about each of some free places [grid steps], shape (n, 2, 3), int32."""
    small, _ = sample_cells(scene, PLANT_CELLS)
    half = (small[:, 1] - small[:, 0]) // 2
    grown = np.stack([small[:, 0] - half, small[:, 1] + half], axis=1)
    return np.concatenate([split_cell(box, 2) for box in grown]).astype(np.int32)


def _share_a_face(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two boxes touch along a face."""
    extent = np.minimum(a[1], b[1]) - np.maximum(a[0], b[0])
    return bool((extent >= 0).all() and (extent > 0).sum() == 2)


def _table(scene: Scene, cells: np.ndarray, folder: Path) -> str:
    """View cells as a table that `bake` reads."""
    path = folder / "cells.csv"
    write_view_cells(cells, scene, path)
    return str(path)


def sampled_sets(scene: Scene, cells: np.ndarray) -> np.ndarray:
    """Objects that rays from 125 points of each view cell hit, shape (cells, objects), bool."""
    corners, owners = scene.triangles(*OPAQUE)
    embree = EmbreeScene(robust=True)
    vertices = corners.reshape(-1, 3).astype(np.float32)
    TriangleMesh(embree, vertices, np.arange(len(vertices), dtype=np.int32).reshape(-1, 3))
    directions = np.random.default_rng(0).normal(size=(DIRECTIONS, 3)).astype(np.float32)
    out = np.zeros((len(cells), len(scene.objects)), bool)
    steps = np.stack(np.meshgrid(*[np.linspace(0.05, 0.95, EYES)] * 3), axis=-1).reshape(-1, 3)
    for row, (low, high) in enumerate(cells):
        for eye in low + steps * (high - low):
            hit = embree.run(np.broadcast_to(eye.astype(np.float32), directions.shape).copy(), directions)
            out[row, owners[hit[hit >= 0]]] = True
    return out


def carving(folder: Path) -> dict[str, list[Line]]:
    """Carving, section 5, on a storey with eight arched windows and, beyond the paper's, an octagonal passage."""
    scene = make_arcade(furnished=False)
    triangles, faces = scene.triangles(Role.OCCLUDER)[0], find_faces(scene)
    model = PreparedModel(scene)
    whole = opaque_planes(triangles)
    start = time.perf_counter()
    carved = model.planes
    carve_s = time.perf_counter() - start
    made = bake(scene, folder / "storey.bake")
    seconds, facts = made.manifest["seconds"], made.manifest
    # The same model with arches in what cuts cells.
    model.planes = whole
    stairs, _ = build_graph(model, Settings(), Clock())
    cut = seconds.get("subdivide", 0.0) + seconds.get("portals", 0.0)
    rectangles = [sum(map(len, planes.boxes)) for planes in (whole, carved)]
    axial, semi, oblique = faces.counts
    return {
        "Section 5: one storey with eight arched windows": [
            Line(
                "polygons", "3,104", f"{len(triangles):,}", f"triangles of occluders, of {axial + semi + oblique} faces"
            ),
            Line("non-axial clusters", "8", f"{faces.clusters}", "eight windows and the octagonal passage"),
            Line(
                "axial, BinA, non-axial polygons",
                "3,040, 24, 192",
                f"{axial}, {NONE}, {oblique}",
                "non-axial: 100 of the reveals, 192 and 8 triangles, and 18 faces with an arch or octagon in them",
            ),
            Line("carving", "less than 3 s", f"{carve_s:.2f} s", "with all rectangles of what cuts"),
            Line("opaque rectangles", NONE, f"{rectangles[1]:,}", f"{rectangles[0]:,} uncarved"),
            Line(
                "cells",
                "1,250",
                f"{made.graph.cell_count + facts.get('dead_cells', 0):,}",
                f"theirs leaves of a BSP tree; {facts.get('dead_cells', 0):,} of ours in walls, removed",
            ),
            Line("portals", NONE, f"{made.graph.portal_count:,}", f"{stairs.portal_count:,} uncarved"),
            Line("subdivision", "20 s", f"{cut:.2f} s"),
            Line("visibility", "1,900 s", f"{seconds['flood']:.2f} s", "SparcStation 10"),
        ]
    }


def mmr(folder: Path) -> dict[str, list[Line]]:
    """Aliaga et al. 1999, section 6: a way through a plant, cell after cell."""
    scene = make_plant(triangles=MMR_TRIANGLES)
    cells = walkway_cells(PreparedModel(scene))
    middles, centre = cells.mean(axis=1), scene.bounds().mean(axis=0)
    lowest = middles[:, 2] <= middles[:, 2].min() + EYE_M / scene.grid_m
    away = np.where(lowest, np.linalg.norm(middles - centre, axis=1), np.inf)
    settings = Settings(method="occluders", cells=_table(scene, cells[np.argsort(away)[:CELLS]], folder), lods=True)
    made = bake(scene, folder / "virtual.bake", settings=settings)
    measured = measure_cells(made, TRIANGLES, Device())
    if not measured:
        return {"Section 6": cell_lines(measured, CELLS)}
    triangles = f"a plant of {scene.triangle_counts.sum():,} triangles, budget of {TRIANGLES:,} a view cell"
    return {
        f"Table 1: reduction of polygons, means of {VIEWS} views in {triangles}": reduction_lines(made, measured),
        "Section 6: depth meshes": cell_lines(measured, CELLS),
        "Graphs 1 and 3, with the published prefetching": graph_lines(look_around(made, folder, TRIANGLES)),
    }


def _many(values: tuple) -> str:
    return ", ".join(f"{value:,.2f}" if isinstance(value, float) else f"{value:,}" for value in values)


HEAD = """# The papers' tables beside ours

Made by `python -m viewcell.workbench.bench papers` at commit {commit}. Scenes are synthetic stand-ins of the \
published ones (`viewcell make office --like soda-hall`, `viewcell make plant`, `viewcell make arcade`), \
machines up to thirty years apart: counts compare, seconds tell the distance only. A dash is what this \
software cannot measure, or a paper does not say.
"""


def section(paper: str, tables: dict[str, list[Line]]) -> str:
    """One paper's tables as Markdown."""
    lines = [f"## {paper}"]
    for title, rows in tables.items():
        lines += ["", f"### {title}", "", "| | published | ours | |", "|---|---|---|---|"]
        lines += [f"| {row.what} | {row.published} | {row.ours} | {row.note} |" for row in rows]
    return "\n".join(lines) + "\n"


PAPERS = {
    "walkthrough": ("The Berkeley walkthrough (Funkhouser et al. 1996)", berkeley),
    "vlod": ("vLOD (Chhugani et al. 2005)", vlod),
    "carving": ("Carving (Lei and Ouhyoung)", carving),
    "mmr": ("MMR (Aliaga et al. 1999)", mmr),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of `run`."""
    parser.add_argument("--out", default="docs/papers.md", help="file to write")
    parser.add_argument("--only", choices=PAPERS, help="print the tables of one paper, write nothing")


def run(options: argparse.Namespace) -> int:
    """Write the page, or print a part of it. Returns the exit code."""
    with tempfile.TemporaryDirectory() as name:
        if options.only:
            paper, tables = PAPERS[options.only]
            print(f"Made by `python -m viewcell.workbench.bench papers --only {options.only}` at commit {commit()}.\n")
            print(section(paper, tables(Path(name))), end="")
            return 0
        sections = [section(paper, tables(Path(name))) for paper, tables in PAPERS.values()]
    Path(options.out).write_text("\n".join([HEAD.format(commit=commit()), *sections]), encoding="utf-8")
    print(f"written to {options.out}")
    return 0
