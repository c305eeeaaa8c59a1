"""Bake: model in, potentially visible sets out, with a proof on both sides."""

import shutil
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

import numpy as np
import pyarrow as pa

from ...data.errors import InputError
from ...data.graph import CellGraph
from ...data.kept import cell_volumes
from ...data.lod import object_errors, split_components
from ...data.plausible import warned
from ...data.prepared import PreparedModel
from ...data.progress import shown
from ...data.rooms import join_rooms
from ...data.rows import Rows
from ...data.scene import Scene
from ...data.store.bake_folder import CELL_LODS, leaks_table, portals_table, write_bake
from ...data.store.certificates import certificate_tables, join_proofs
from ...data.store.room_tables import room_tables
from ...data.store.scene_folder import held_manifest
from ...data.sweep import moving, still, with_moving
from ...solvers.levels.pixel_error import pixel_levels
from ..baked import Bake
from . import blocks
from .blocks import Shortfall, Store, Work, in_blocks, refine
from .budget import prepare_within, within_budget
from .cells import Sources, bare_sources, model_sources
from .manifest import Clock, bake_manifest, fingerprint, rewrite_manifest
from .place import alone, check_place, default_out, occupied, partial_folder, set_aside
from .settings import LevelSettings, Settings, SettingsWords, check_number, with_words
from .worth import worth

if TYPE_CHECKING:
    from ...kernels.launch import Device
    from ...solvers.visibility.engine import Engine


class Interrupted(KeyboardInterrupt):
    """A bake was interrupted, and the same one goes on from what it has finished."""


@dataclass
class _Run:
    """How one bake is run, beside its settings.

    Attributes:
        out: folder to write.
        device: where kernels run.
        budget_s: seconds that visibility may take, or None.
        known: fingerprint of the answer.
        clock: seconds by phase.
    """

    out: Path
    device: "Device"
    budget_s: float | None
    known: str
    clock: Clock


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
    **words: Unpack[SettingsWords],
) -> Bake:
    """Cut a model into cells and portals and compute what each inhabitable cell can see.

    Args:
        model: a scene, a model file, a scene folder, or a folder with only cells.parquet and portals.parquet.
        out: bake folder to write; by default `<model>.bake` in the current folder.
        settings: what the answer depends on; the default ones if there are none.
        budget_s: stop after so many seconds of visibility, preparing for it included; what is left is unknown, never
            hidden, and baking again goes on from there.
        threads: CPU threads; all cores by default. The answer does not depend on it.
        device: Warp device. The answer does not depend on it.
        overwrite: replace a bake at `out`, whatever it is of. Else one of the same model and settings is taken as it
            is, and any other is left alone. Files of others in that folder stay either way.
        progress: show how far it is on stderr.
        tuned: what `viewcell tune` has found for those who walk through the bake, by name; stored in the manifest.
        words: settings by name, such as `doors="closed"`, in place of those in `settings`.

    Returns:
        The bake. Absent rows are hidden, exactly; `unknown` rows are kept.

    Raises:
        InputError: the model, the settings or the place to write are unusable, or another bake is there, or is being
            written there; nothing is written or lost.
        Interrupted: Ctrl-C, when baking again goes on from finished blocks.
    """
    settings = with_words(settings, words)
    settings.check()
    if isinstance(model, Scene) and (told := [name for name in settings.reading if name in words]):
        raise InputError(f"{told[0]}: expected a model file beside it, found a scene; viewcell.read takes it")
    check_number("budget", 1.0 if budget_s is None else budget_s, 1e-9)
    check_number("threads", 1 if threads is None else threads, 1)
    from ...kernels.launch import Device

    where = Device.wanted(device, threads)
    out = Path(out) if out is not None else default_out(model)
    check_place(out, settings, overwrite)
    with shown(progress), Clock() as clock, alone(out):
        return _bake(model, settings, overwrite, tuned or {}, _Run(out, where, budget_s, "", clock))


def _bake(model: Scene | str | Path, settings: Settings, overwrite: bool, tuned: dict[str, dict], run: _Run) -> Bake:
    """As `bake`, of checked settings into a place that may be written; finds the fingerprint of `run` first."""
    out, clock = run.out, run.clock
    clock.show("read")
    scene, graph_folder = open_model(model, settings)
    known = fingerprint(scene, graph_folder, settings, (blocks.BLOCK, blocks.VIEW_BLOCK, blocks.BLOCKS))
    if not overwrite and (done := held_manifest(out, "bake")) is not None:
        if done.get("fingerprint") != known:
            raise occupied(out, done, settings)
        if not done.get("budget_spent"):
            if any(done.get(name) != part for name, part in tuned.items()):
                # The tables do not depend on what has been tuned.
                done |= tuned
                rewrite_manifest(out, done)
            return Bake(out, done)
    run = replace(run, known=known)
    notes = {}
    if scene is None:
        sources = bare_sources(graph_folder, settings, clock)
    else:
        scene, notes = _detailed(scene, settings, run)
        sources = model_sources(PreparedModel(_without_motion(scene, settings)), settings, clock)
        # Of the model as it is, with what moves.
        notes["counts"] = sources.facts["counts"] | {"definitions": len(scene.definitions)}
    sources.facts |= notes
    if not sources.graph.inhabitable.any():
        raise InputError(f"{sources.facts['source']}: expected at least one inhabitable cell, found none")
    try:
        return _write(sources, scene, settings, run, tuned)
    except KeyboardInterrupt:
        if any(partial_folder(out, known).glob("*.arrow")):
            raise Interrupted from None
        raise


def _without_motion(scene: Scene, settings: Settings) -> Scene:
    """The model with boxes for what moves.

    Raises:
        InputError: a motion without bounds; or certificates are wanted, which are of shapes as they stand.
    """
    if settings.certify and len(moving(scene)):
        raise InputError(f"certify: expected a model in which nothing moves, found object {moving(scene)[0]} that does")
    return still(scene)


def open_model(model: Scene | str | Path, settings: Settings) -> tuple[Scene | None, Path | None]:
    """The model, as the settings want it read; or, of a bare graph, its folder.

    Raises:
        InputError: it is unreadable, or settings speak of what a folder has settled.
    """
    if isinstance(model, Scene):
        from ...data.frame import in_frame

        return warned(in_frame(model, settings.frame.get("yaw", 0.0))), None
    path = Path(model)
    bare = path.is_dir() and not (path / "manifest.json").exists()
    told = [*settings.reading, *(["yaw"] if bare and settings.yaw != "auto" else [])]
    if path.is_dir() and told:
        raise InputError(f"{path}: expected a model file beside {', '.join(told)}, found a folder")
    if bare:
        return None, path
    from ...data.readers import read

    return warned(read(path, **settings.reading, **settings.frame)), None


def _detailed(scene: Scene, settings: Settings, run: _Run) -> tuple[Scene, dict]:
    """The model with components as objects and chains of levels, as far as asked, and what the manifest says of it."""
    notes = {}
    if not (settings.split or settings.lods):
        return scene, notes
    run.clock.lap("read")
    if settings.split:
        scene = split_components(scene)
    if settings.lods:
        from ...solvers.levels.chain import with_lods

        scene, notes["lod_notes"] = with_lods(scene, device=run.device)
    run.clock.lap("levels of detail")
    return scene, notes


def _write(sources: Sources, scene: Scene | None, settings: Settings, run: _Run, tuned: dict[str, dict]) -> Bake:
    """Compute visibility of the model as it is, and all that follows from it, and write the folder."""
    cell_rows, object_rows, extra, short, engine = _visibility(sources, settings, run)
    graph, facts, clock = sources.graph, sources.facts, run.clock
    if scene is not None and len(ids := moving(scene)):
        object_rows = with_moving(object_rows, sources.model.scene, ids, graph.cells, graph.inhabitable)
    facts |= {"budget_spent": short is not None, **tuned}
    if short is not None:
        facts["budget"] = {"budget_s": run.budget_s, **asdict(short)}
    if sources.closed is not None:
        clock.show("leaks")
        extra |= _leaks(sources, (cell_rows, object_rows), settings, run)
        clock.lap("leaks")
    clock.show("eyes, back faces")
    facts |= _worth(sources, object_rows, settings.seed, engine, run.device, finished=short is None)
    clock.lap("eyes, back faces")
    if scene is not None and settings.lods:
        extra["cell_lods"] = _cell_lods(sources.model.scene, graph, object_rows, settings)
        clock.lap("levels of detail")

    if scene is not None and scene.spaces:
        of_cells = {"named": not sources.view_cells, "claims": cell_rows is not None}
        rooms = join_rooms(scene, graph, sources.model.room_points, **of_cells)
        extra |= room_tables(scene.spaces, rooms, (cell_rows, object_rows))
        clock.lap("rooms")
    clock.show("write")

    def manifest() -> dict:
        return bake_manifest(facts, settings, run.known, graph, (cell_rows, object_rows), clock)

    written = write_bake(run.out, manifest, scene, graph, (cell_rows, object_rows), facts["grid_m"], extra)
    set_aside(run.out / "report")
    if short is None:
        shutil.rmtree(partial_folder(run.out, run.known), ignore_errors=True)
    return Bake(run.out, written)


def _leaks(sources: Sources, rows: tuple[Rows, Rows], settings: Settings, run: _Run) -> dict[str, pa.Table]:
    """Tables of the cracks that are closed and of the pairs that nothing else hides."""
    graph, closed, scene = sources.graph, sources.closed, sources.model.scene
    fields = "portal_cells", "portal_axis", "portals"
    both = [np.concatenate([getattr(part, name) for part in (graph, closed)]) for name in fields]
    whole = CellGraph(graph.cells, graph.inhabitable, graph.cell_names, *both, graph.plans)
    engine = engine_of(replace(sources, graph=whole), settings, run.device)
    parts = [engine.visible(block, aim=False) for block in in_blocks(sources)]
    pairs = []
    for open_rows, kept, targets in zip(
        engine.join(parts, share=False), rows, (graph.cell_count, len(scene.objects)), strict=True
    ):
        keys = [part.source.astype(np.int64) * targets + part.target for part in (open_rows, kept)]
        pairs.append(np.column_stack(np.divmod(np.setdiff1d(*keys), targets)))
    counts = {
        "closed_cracks": closed.portal_count,
        "leak_cell_pairs": len(pairs[0]),
        "leak_object_pairs": len(pairs[1]),
    }
    sources.facts["counts"] = sources.facts["counts"] | counts
    return {"cracks": portals_table(closed, scene.grid_m), "leaks": leaks_table(*pairs)}


def engine_of(sources: Sources, settings: Settings, device: "Device") -> "Engine":
    """The engine that answers from these cells."""
    options = {"seed": settings.seed, "device": device, "certify": settings.certify}
    if sources.model is None:
        from ...solvers.visibility.graph_engine import GraphEngine

        return GraphEngine(sources.graph, **options)
    if sources.view_cells:
        from ...solvers.visibility.view_cell_engine import ViewCellEngine

        options |= {"method": sources.method, "portal_graph": sources.portal_graph, "vlod": settings.vlod}
        return ViewCellEngine(sources.model, sources.graph.cells, plans=sources.graph.plans, **options)
    from ...solvers.visibility.portal_engine import PortalEngine

    return PortalEngine(sources.model, sources.graph, method=sources.method, **options)


def _visibility(
    sources: Sources, settings: Settings, run: _Run
) -> "tuple[Rows | None, Rows, dict[str, pa.Table], Shortfall | None, Engine]":
    """Visibility of all inhabitable cells, certificate tables, and what the budget left of it, if it ended early.

    And the engine.

    Cells of an octree are refined on the way: `sources` has them all then.
    """
    clock = run.clock
    started = time.perf_counter()
    clock.show("prepare")
    engine = engine_of(sources, settings, run.device)
    if run.budget_s is None:
        engine.prepare()
    else:
        prepare_within(engine, run.budget_s - (time.perf_counter() - started))
    clock.lap("prepare")
    compiled = time.perf_counter()
    clock.show("compile")
    engine.compile()
    # Compiling happens once for a machine; preparing is part of every bake.
    started += time.perf_counter() - compiled
    clock.lap("compile")
    cut = in_blocks(sources)
    bar = clock.show("visibility", sum(map(len, cut)), "cell")
    deadline = np.inf if run.budget_s is None else started + run.budget_s
    work = Work(engine, run.device, Store(partial_folder(run.out, run.known)), bar, deadline, started, sources.objects)
    if run.budget_s is None:
        parts, short = work.finish_all(list(enumerate(cut))), None
    else:
        parts, short = within_budget(work, cut, sources.graph.cells, cell_volumes(sources.graph))
    if sources.octree:
        parts, unrefined = refine(sources, work, parts, settings)
        short = short or unrefined
    clock.lap("flood")
    tables = {}
    if settings.certify:
        proofs = join_proofs([part.proofs for part in parts if part.proofs is not None])
        tables = certificate_tables(proofs, *engine.proof_occluders, sources.facts["grid_m"])
        sources.facts["counts"] = sources.facts["counts"] | {"proofs": len(proofs.cell)}
        sources.facts["certificate_s"] = round(proofs.seconds, 3)
        clock.lap("certificates")
    # Where time ran out, most is unknown, and sharing would take as long again.
    return *work.engine.join(parts, share=short is None), tables, short, work.engine


def _worth(sources: Sources, rows: Rows, seed: int, engine: "Engine", device: "Device", *, finished: bool) -> dict:
    """What the manifest says of a bake's worth, and its counts, with triangles: side by side, as each is one thread."""
    from ...kernels.launch import side_by_side

    graph, facts, model = sources.graph, sources.facts, sources.model
    # What a budget left no time for in preparing it leaves none for here.
    sight = {"eyes": finished or engine.look(0.0), "opaque": engine.opaque}
    work = [lambda: worth(model, graph, (rows.source, rows.target), facts, seed, **sight)]
    if model is not None and finished:
        work.append(lambda: {"counts": facts["counts"] | _triangle_counts(model, graph, rows, device)})
    found = {}
    for _, part in sorted(side_by_side(lambda do: do(), work, device)):
        found |= part
    return found


def _triangle_counts(model: PreparedModel, graph: CellGraph, rows: Rows, device: "Device") -> dict[str, int]:
    """Triangles of all potential pairs, and those among them that face away from everywhere in their cell.

    The second is what a renderer may leave out beside the potentially visible set, which it does not change. Source:
    Chhugani et al. 2005, section 5.1.
    """
    from ...kernels.backface import build_cones, launch_backface

    sizes, pairs = model.scene.triangle_counts, np.column_stack([rows.source, rows.target])
    cones = build_cones(model.closed, sizes, model.scene.first_alike)
    removed, whole = launch_backface(cones, graph.cells, pairs, device=device)
    return {"potential_triangles": int(sizes[rows.target].sum()), "back_facing_triangles": int(removed[~whole].sum())}


def _cell_lods(scene: Scene, graph: CellGraph, rows: Rows, settings: LevelSettings) -> pa.Table:
    """Rows of cell_lods.parquet: levels coarser than 0 that an object may be drawn at from anywhere in a cell."""
    errors, starts = object_errors(scene)
    # Objects are drawn unsnapped, up to half a step beyond their snapped boxes.
    bounds = (scene.object_bounds() + np.array([[-0.5], [0.5]])) * scene.grid_m
    pairs = np.column_stack([rows.source, rows.target])
    levels = pixel_levels(graph.cells * scene.grid_m, bounds, errors, starts, pairs, settings.pixel_limit)
    coarser = levels > 0
    columns = rows.source[coarser], rows.target[coarser], levels[coarser]
    return pa.table({name: pa.array(x, pa.int32()) for name, x in zip(CELL_LODS, columns, strict=True)})
