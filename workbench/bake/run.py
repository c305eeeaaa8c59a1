"""Bake: model in, potentially visible sets out, with a proof on both sides."""

import hashlib
import json
import pickle
import shutil
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
from tqdm import tqdm

from ... import __version__
from ...data.errors import InputError
from ...data.graph import CellGraph
from ...data.inhabit import find_inhabitable
from ...data.lod import object_errors, split_components
from ...data.opaque import OpaquePlanes, opaque_planes
from ...data.portals import find_portals
from ...data.scene import GRID_LIMIT, GRID_M, Role, Scene
from ...data.solids import closed_elements, dead_cells
from ...data.store.certificates import certificate_tables, join_proofs
from ...data.store.database import Bake, VisibleRows, write_bake
from ...data.store.graph_folder import read_graph
from ...data.store.scene_folder import replaceable, scene_manifest
from ...data.subdivide import cut_rooms, merge, subdivide
from ...data.view_cells import as_graph, octants, octree_roots, read_view_cells, walkable
from ...solvers.levels.pixel_error import PixelLimit, pixel_levels

if TYPE_CHECKING:
    from ...solvers.visibility.engine import Engine, Part, ViewCellEngine
    from ...solvers.visibility.projection import VlodSettings

MARGIN_M = 2.0
# Sources a block: a block is what an interrupted bake resumes from.
BLOCK = 24
# Of view cells, whose sets are larger.
VIEW_BLOCK = 8
METHODS = ("auto", "portals", "occluders", "both", "vlod")
# Models with more triangles than this are not cut into portal cells unless asked.
PORTAL_TRIANGLES = 3_000_000
DEEPEST = 12


@dataclass(frozen=True)
class Settings:
    """What a bake's answer depends on.

    Attributes:
        threshold_m2: opaque area below which a plane does not cut cells; larger is faster and looser.
        seed: of the random sightlines.
        seal: cracks narrower than this are closed [m]; 0 closes none.
        doors: "open", or "closed" if doors occlude.
        method: "portals" (stabbing lines through a cell-and-portal graph), "occluders" (shadows of walls, furniture and
            oblique surfaces), "both", "vlod" (the method of Chhugani et al. 2005: projection points and shrunk
            occluders), or "auto": portals, and occluders for cells where portals leave much unknown, and for models too
            large to be cut into cells.
        cells: view cells: "portals" for those of the graph, "octree", or a table of boxes. By default the method's own.
        cell_size_m: of the octree's roots.
        depth: times that a cell of the octree may be refined.
        refine_triangles: a cell that may see more triangles is refined.
        refine_gap: a cell is refined if a larger share of what it may see is unknown.
        certify: store a certificate of everything that is hidden, and call nothing else hidden.
        clusters: of occluders by direction, for "vlod"; see `viewcell.solvers.visibility.projection.VlodSettings`.
        objective: of projection points, for "vlod".
        resolution: of cube maps, for "vlod".
        split: connected components become objects of their own.
        lods: simplify definitions that have a single level, and store which levels do from where.
        pixels: a level may deviate on the image by no more.
        image: width x height of the image that `pixels` are counted on.
        fov_deg: its vertical field of view.
    """

    threshold_m2: float = 0.0
    seed: int = 0
    seal: float = 0.0
    doors: str = "open"
    method: str = "auto"
    cells: str = ""
    cell_size_m: float = 4.0
    depth: int = 2
    refine_triangles: int = 100_000
    refine_gap: float = 0.25
    certify: bool = False
    clusters: int = 14
    objective: str = "socp"
    resolution: int = 512
    split: bool = False
    lods: bool = False
    pixels: float = 1.0
    image: str = "1920x1080"
    fov_deg: float = 60.0

    @property
    def pixel_limit(self) -> PixelLimit:
        """What levels are chosen for; raises InputError for a number out of range."""
        width, _, height = self.image.partition("x")
        if not (width.isdecimal() and height.isdecimal()):
            raise InputError(f"resolution: expected WIDTHxHEIGHT in pixels, found {self.image!r}")
        return PixelLimit(self.pixels, (int(width), int(height)), self.fov_deg)


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
    tuned: dict[str, dict] | None = None,
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
        tuned: what `viewcell tune` has found for those who walk through the bake, by name; stored in the manifest.

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
        return _with_tuned(done, tuned or {})
    notes = {}
    if settings.split or settings.lods:
        if scene is None:
            raise InputError(f"{graph_folder}: expected a model to split or to simplify, found a bare graph")
        scene, notes = _detailed(scene, settings, clock, threads, device, progress)
    prepared = _prepare(scene, graph_folder, settings, clock)
    prepared.facts |= notes
    graph, facts = prepared.graph, prepared.facts
    if not graph.inhabitable.any():
        raise InputError(f"{facts['source']}: expected at least one inhabitable cell, found none")
    cell_rows, object_rows, certificates, spent = _visibility(
        prepared, settings, out, print_, clock, budget_s, threads, device, progress
    )
    graph = prepared.graph
    facts |= {"budget_spent": spent, **(tuned or {})}
    if scene is not None and not spent:
        facts["counts"] = facts["counts"] | _triangle_counts(scene, graph, object_rows, threads, device)
        clock.lap("back faces")

    if scene is not None and settings.lods:
        certificates = certificates | {"cell_lods": _cell_lods(scene, graph, object_rows, settings)}
        clock.lap("levels of detail")

    def manifest() -> dict:
        return _manifest(facts, settings, print_, graph, cell_rows, object_rows, clock)

    made = write_bake(out, manifest, scene, graph, cell_rows, object_rows, facts["grid_m"], certificates)
    if not spent:
        shutil.rmtree(_partial(out), ignore_errors=True)
    return made


def _detailed(
    scene: Scene, settings: Settings, clock: Clock, threads: int | None, device: str, progress: bool
) -> tuple[Scene, dict]:
    """The model with components as objects and chains of levels, as far as asked, and what the manifest says of it."""
    clock.lap("read")
    notes = {}
    if settings.split:
        scene = split_components(scene)
    if settings.lods:
        from ...solvers.levels.chain import with_lods

        scene, notes["lod_notes"] = with_lods(scene, threads=threads, device=device, progress=progress)
    clock.lap("levels of detail")
    return scene, notes


def _cell_lods(scene: Scene, graph: CellGraph, rows: VisibleRows, settings: Settings) -> pa.Table:
    """Rows of cell_lods.parquet: levels coarser than 0 that do from everywhere in a cell."""
    errors, starts = object_errors(scene)
    # Objects are drawn unsnapped, up to half a step beyond their snapped boxes.
    bounds = (scene.object_bounds() + np.array([[-0.5], [0.5]])) * scene.grid_m
    pairs = np.column_stack([rows.source, rows.target])
    levels = pixel_levels(graph.cells * scene.grid_m, bounds, errors, starts, pairs, settings.pixel_limit)
    coarser = levels > 0
    names = ("cell_id", "object_id", "lod")
    columns = rows.source[coarser], rows.target[coarser], levels[coarser]
    return pa.table({name: pa.array(x, pa.int32()) for name, x in zip(names, columns, strict=True)})


@dataclass
class _Prepared:
    """A model ready for visibility.

    Attributes:
        scene: None for a bare graph.
        graph: its cells; view cells have no portals.
        opaque: opaque rectangles of its occluders; None for a bare graph.
        facts: what the manifest says of it.
        view_cells: whether the cells are view cells, about which nothing but objects is claimed.
        method: what "auto" came to.
        portal_graph: the cell-and-portal graph beside view cells, if the method wants one.
    """

    scene: Scene | None
    graph: CellGraph
    opaque: OpaquePlanes | None
    facts: dict
    view_cells: bool
    method: str
    portal_graph: CellGraph | None = None


def _prepare(scene: Scene | None, graph_folder: Path | None, settings: Settings, clock: Clock) -> _Prepared:
    """Cells of a model, or of a bare graph."""
    if scene is None:
        if settings.method in ("occluders", "both", "vlod") or settings.cells not in ("", "portals"):
            raise InputError(f"{graph_folder}: expected a model for occluders and view cells, found a bare graph")
        graph, snapped = read_graph(graph_folder)
        clock.lap("read")
        facts = {"source": str(graph_folder), "sha256": "", "unit": "metre", "grid_m": GRID_M, "origin": [0.0] * 3}
        facts |= {"max_snap_m": snapped, "skipped": [], "counts": {"objects": 0}}
        return _Prepared(None, graph, None, facts, False, "portals")
    facts = scene_manifest(scene)
    if not closed_elements(scene):
        facts["warnings"] = ["no closed opaque solid: only surfaces occlude, and every point counts as outside"]
    clock.lap("read")
    cells, method = settings.cells, settings.method
    large = len(scene.triangles()[0]) > PORTAL_TRIANGLES
    if not cells:
        cells = "octree" if method in ("occluders", "vlod") or (method == "auto" and large) else "portals"
    if cells == "portals" and method == "vlod":
        raise InputError("cells: expected octree or a table for the method vlod, found portals")
    if cells == "portals":
        graph, opaque, notes = build_graph(scene, settings, clock)
        return _Prepared(scene, graph, opaque, facts | notes, False, method)
    if method == "auto":
        method = "occluders"
    # With certificates nothing is hidden by portals alone: the model is what a proof is checked against.
    wanted = method in ("portals", "both") and not settings.certify
    portal_graph = build_graph(scene, settings, clock)[0] if wanted else None
    opaque = opaque_rectangles(scene)
    if cells == "octree":
        roots = octree_roots(scene, settings.cell_size_m)
        graph = as_graph(roots[walkable(roots, scene, opaque)])
        notes = {"inhabitable_because": "octree"}
    else:
        graph = read_view_cells(cells, scene)
        notes = {"inhabitable_because": "given"}
    if portal_graph is not None:
        _check_inside(graph, portal_graph, method)
    clock.lap("view cells")
    return _Prepared(scene, graph, opaque, facts | notes, True, method, portal_graph)


def _check_inside(graph: CellGraph, portal_graph: CellGraph, method: str) -> None:
    """The portal graph ends at its outermost faces, through which it knows no way: eyes beyond would see nothing.

    Raises:
        InputError: a view cell reaches out of it.
    """
    low, high = portal_graph.cells[:, 0].min(axis=0), portal_graph.cells[:, 1].max(axis=0)
    beyond = np.flatnonzero((graph.cells[:, 0] < low).any(axis=1) | (graph.cells[:, 1] > high).any(axis=1))
    if len(beyond):
        raise InputError(
            f"method {method}: expected view cells within {MARGIN_M:g} m of the model, found cell {beyond[0]} beyond; "
            "the method occluders takes them"
        )


def opaque_rectangles(scene: Scene) -> OpaquePlanes:
    """Opaque rectangles of a model's occluders."""
    triangles, owners = scene.triangles()
    return opaque_planes(triangles[scene.object_mask(Role.OCCLUDER)[owners]])


def _check(settings: Settings, budget_s: float | None, threads: int | None, device: str) -> None:
    for name, value, least in (
        ("threshold", settings.threshold_m2, 0.0),
        ("seal", settings.seal, 0.0),
        ("budget", budget_s if budget_s is not None else 1.0, 1e-9),
        ("threads", threads if threads is not None else 1, 1),
        ("cell size", settings.cell_size_m, 1e-3),
        ("refine-triangles", settings.refine_triangles, 1),
        ("refine-gap", settings.refine_gap, 0.0),
    ):
        if not (np.isfinite(value) and value >= least):
            raise InputError(f"{name}: expected a number {'above 0' if least else 'from 0'}, found {value}")
    if settings.seal > 0:
        raise InputError(f"seal: expected 0 (closing cracks is not built yet), found {settings.seal}")
    _ = settings.pixel_limit
    if settings.method not in METHODS:
        raise InputError(f"method: expected {', '.join(METHODS)}, found {settings.method!r}")
    if not 0 <= settings.depth <= DEEPEST:
        raise InputError(f"depth: expected a whole number from 0 to {DEEPEST}, found {settings.depth}")
    import warp as wp

    from ...kernels.launch import check_device

    # Warp greets whoever starts it, unless told not to before.
    wp.config.log_level = wp.LOG_WARNING
    _vlod_settings(settings)
    check_device(device)


def _vlod_settings(settings: Settings) -> "VlodSettings":
    """How the method "vlod" treats view cells.

    Raises:
        InputError: clusters, objective or resolution.
    """
    from ...solvers.visibility.projection import VlodSettings

    return VlodSettings(settings.clusters, settings.objective, settings.resolution, seed=settings.seed)


def _open(model: Scene | str | Path, settings: Settings) -> tuple[Scene | None, Path | None]:
    if isinstance(model, Scene):
        return model, None
    path = Path(model)
    if path.is_dir() and settings.doors != "open":
        raise InputError(f"{path}: expected a model file to close the doors of, found a folder")
    if path.is_dir() and not (path / "manifest.json").exists():
        return None, path
    from ...data.readers import read

    return read(path, doors=settings.doors), None


def default_out(model: Scene | str | Path) -> Path:
    """Where a bake goes that was not told where: named after its model, in the current folder."""
    # `resolve` gives "." and ".." a name.
    name = "scene" if isinstance(model, Scene) else Path(model).resolve().stem or "model"
    return Path(f"{name}.bake")


def _fingerprint(scene: Scene | None, graph_folder: Path | None, settings: Settings) -> str:
    """Hash of everything that the answer depends on."""
    digest = hashlib.sha256(f"{__version__} {settings} {BLOCK} {VIEW_BLOCK}".encode())
    if settings.cells not in ("", "portals", "octree"):
        digest.update(_contents(Path(settings.cells)))
    if scene is None:
        for name in ("cells.parquet", "portals.parquet"):
            digest.update(_contents(graph_folder / name))
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


def _contents(path: Path) -> bytes:
    """What is in a file; nothing if there is none."""
    return path.read_bytes() if path.is_file() else b""


def _finished(out: Path, print_: str) -> Bake | None:
    """The bake at `out`, if it is complete and of the same input, settings and version."""
    try:
        manifest = json.loads((out / "manifest.json").read_text())
    except (OSError, ValueError):
        return None
    same = manifest.get("fingerprint") == print_ and manifest.get("complete") and not manifest.get("budget_spent")
    return Bake(out, manifest) if same else None


def _with_tuned(done: Bake, tuned: dict[str, dict]) -> Bake:
    """A finished bake whose manifest says what has been tuned; the tables do not depend on it."""
    if all(done.manifest.get(name) == part for name, part in tuned.items()):
        return done
    manifest = done.manifest | tuned
    temporary = done.folder / ".manifest.writing"
    temporary.write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")
    temporary.rename(done.folder / "manifest.json")
    return Bake(done.folder, manifest)


def build_graph(scene: Scene, settings: Settings, clock: Clock) -> tuple[CellGraph, OpaquePlanes, dict]:
    """Cells, portals and inhabitable cells of a model, its opaque rectangles, and what the manifest says of them."""
    triangles, _ = scene.triangles()
    clock.lap("read")
    opaque = opaque_rectangles(scene)
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
    prepared: _Prepared,
    settings: Settings,
    out: Path,
    print_: str,
    clock: Clock,
    budget_s: float | None,
    threads: int | None,
    device: str,
    progress: bool,
) -> tuple[VisibleRows | None, VisibleRows, dict[str, pa.Table], bool]:
    """Visibility of all inhabitable cells, block by block, certificate tables, and whether the budget ended it early.

    Finished blocks are kept beside the target. Cells of an octree are refined on the way: `prepared` has them all then.
    """
    from ...kernels.launch import thread_count
    from ...solvers.visibility.engine import Engine, ViewCellEngine

    scene, graph = prepared.scene, prepared.graph
    options = {"seed": settings.seed, "threads": thread_count(threads), "device": device, "method": prepared.method}
    options["certify"] = settings.certify
    if prepared.view_cells:
        options["portal_graph"], options["vlod"] = prepared.portal_graph, _vlod_settings(settings)
        engine = ViewCellEngine(scene, graph, prepared.opaque, **options)
    else:
        engine = Engine(scene, graph, prepared.opaque, **options)
    clock.lap("prepare")
    engine.compile()
    clock.lap("compile")
    sources = np.flatnonzero(graph.inhabitable)
    size = VIEW_BLOCK if prepared.view_cells else BLOCK if scene is not None else len(sources)
    blocks = [sources[i : i + size] for i in range(0, len(sources), size)]
    store = _Store(_partial(out), print_)
    bar = tqdm(total=len(sources), unit="cell", desc="visibility", disable=not progress)
    deadline = np.inf if budget_s is None else time.perf_counter() + budget_s
    if budget_s is None:
        parts, spent = [_finish_block(engine, store, number, block, bar) for number, block in enumerate(blocks)], False
    else:
        parts, spent = _within(engine, store, blocks, deadline, bar)
    if prepared.view_cells and prepared.facts["inhabitable_because"] == "octree":
        parts, unrefined = _refine(prepared, engine, store, parts, settings, deadline, bar)
        spent |= unrefined
    bar.close()
    clock.lap("flood")
    tables = {}
    if settings.certify:
        proofs = join_proofs([part.proofs for part in parts if part.proofs is not None])
        tables = certificate_tables(proofs, *engine.occluders, prepared.facts["grid_m"])
        prepared.facts["counts"] = prepared.facts["counts"] | {"proofs": len(proofs.cell)}
        prepared.facts["certificate_s"] = round(proofs.seconds, 3)
        clock.lap("certificates")
    return *engine.join(parts), tables, spent


def _triangle_counts(
    scene: Scene, graph: CellGraph, rows: VisibleRows, threads: int | None, device: str
) -> dict[str, int]:
    """Triangles of all potential pairs, and those among them that face away from everywhere in their cell.

    The second is what a renderer may leave out beside the potentially visible set, which it does not change. Source:
    Chhugani et al. 2005, section 5.1.
    """
    from ...kernels.backface import build_cones, launch_backface
    from ...kernels.launch import thread_count

    sizes = np.bincount(scene.triangles()[1], minlength=len(scene.objects))
    pairs = np.column_stack([rows.source, rows.target])
    cones = build_cones(scene)
    removed, whole = launch_backface(cones, graph.cells, pairs, threads=thread_count(threads), device=device)
    return {"potential_triangles": int(sizes[rows.target].sum()), "back_facing_triangles": int(removed[~whole].sum())}


def _refine(
    prepared: _Prepared,
    engine: "ViewCellEngine",
    store: "_Store",
    parts: list["Part"],
    settings: Settings,
    deadline: float,
    bar: tqdm,
) -> tuple[list["Part"], bool]:
    """Replace cells of an octree that may see too much, or know too little, by their octants, level by level."""
    from ...solvers.visibility.engine import relabelled

    scene = prepared.scene
    sizes = np.bincount(scene.triangles()[1], minlength=len(scene.objects))
    cells, kept, leaves, spent = prepared.graph.cells, [], [], False
    for level in range(1, settings.depth + 2):
        coarse = np.zeros(len(cells), bool)
        if level <= settings.depth:
            for part in parts:
                coarse |= _too_coarse(part, len(cells), sizes, settings)
        families = octants(cells[coarse]).reshape(-1, 8, 2, 3)
        alive = walkable(families.reshape(-1, 2, 3), scene, prepared.opaque).reshape(-1, 8)
        parents = np.flatnonzero(coarse)
        fresh, count = [], 0
        finer = engine.with_cells(families[alive].astype(np.int32))
        bar.total += int(alive.sum())
        bar.refresh()
        for number, size in enumerate(alive.sum(axis=1)):
            if time.perf_counter() > deadline:
                # What is left of this level stays as it is: unrefined, never hidden.
                coarse[parents[number:]] = False
                spent = True
                break
            block = np.arange(count, count + size)
            count += int(size)
            if size:
                # Which cells come to be refined may depend on the budget: a block is known by its cells, too.
                held = hashlib.sha256(finer.model.cells[block].tobytes()).hexdigest()[:16]
                fresh.append(_finish_block(finer, store, f"{level}-{block[0]}-{held}", block, bar))
        place = np.cumsum(~coarse) - 1 + sum(map(len, leaves))
        kept += [relabelled(part, np.where(coarse, -1, place)) for part in parts]
        leaves.append(cells[~coarse])
        cells, parts = families[alive].astype(np.int32)[:count], fresh
        if not count:
            break
    prepared.graph = as_graph(np.concatenate(leaves))
    return kept, spent


def _too_coarse(part: "Part", count: int, sizes: np.ndarray, settings: Settings) -> np.ndarray:
    """Cells of a part that should be refined, shape (count,), bool; sizes are triangles by object."""
    rows = part.objects
    potential, unknown = (np.bincount(chosen, minlength=count) for chosen in (rows.source, rows.source[~rows.seen]))
    triangles = np.bincount(rows.source, sizes[rows.target], minlength=count)
    return (triangles > settings.refine_triangles) | (unknown > settings.refine_gap * potential)


def _finish_block(engine: "Engine", store: "_Store", number: int | str, block: np.ndarray, bar: tqdm) -> object:
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

    def load(self, number: int | str) -> object | None:
        """A finished block, or None."""
        try:
            return pickle.loads((self._folder / f"{number}.block").read_bytes())
        except Exception:  # pickle raises many types for a damaged file; the block is then computed again
            return None

    def save(self, number: int | str, part: object) -> None:
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
    cell_rows: VisibleRows | None,
    object_rows: VisibleRows,
    clock: Clock,
) -> dict:
    counts = facts.get("counts", {}) | {
        "cells": graph.cell_count,
        "inhabitable": int(graph.inhabitable.sum()),
        "portals": graph.portal_count,
    }
    if cell_rows is not None:
        counts |= {"cell_pairs": len(cell_rows.source), "cell_pairs_seen": int(cell_rows.seen.sum())}
    counts |= {
        "object_pairs": len(object_rows.source),
        "object_pairs_seen": int(object_rows.seen.sum()),
    }
    clock.lap("write")
    return facts | {
        "format": 1,
        "kind": "bake",
        "viewcell": __version__,
        "model": {"path": facts["source"], "sha256": facts["sha256"]},
        "settings": asdict(settings),
        # A folder of view cells says nothing about what cells see of each other, and has no cell_to_cell.parquet.
        "claims": ["cell_to_object"] if cell_rows is None else ["cell_to_cell", "cell_to_object"],
        "fingerprint": print_,
        "counts": counts,
        "seconds": clock.seconds,
        "complete": True,
    }
