"""What each command does: reads its options, calls the public functions, prints what they found.

Nothing heavy is imported before it is needed: an argument that is wrong is refused at once.
"""

import argparse
import sys
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING

from ..data.errors import InputError
from ..data.plural import counted
from .results import as_json, bake_result, check_result, verify_result
from .summary import summary, table
from .terminal import FAILED, INTERRUPTED, complain, say
from .walk.command import walk as walk

if TYPE_CHECKING:
    from ..data.scene import Scene
    from .baked import Bake


def make_office(options: argparse.Namespace) -> int:
    """Make an office, write it and print its levels of detail."""
    from ..data.buildings.office import make_office as build
    from ..data.buildings.statistics import level_statistics

    out, write = _scene_writer(options)
    size = {"floors": options.floors, "rooms_per_side": options.rooms_per_side}
    size = {name: value for name, value in size.items() if value is not None}
    if options.like and size:
        raise InputError(f"like: expected no other size beside {options.like}, found {', '.join(size)}")
    turn = {"yaw_deg": options.yaw, "wings": options.wings, "wing_angle_deg": options.wing_angle}
    scene = build(seed=options.seed, like=options.like, **size, **turn)
    write(scene, out)
    rows = [(r.level, r.objects, r.polygons, r.minimum, f"{r.mean:,.2f}", r.maximum) for r in level_statistics(scene)]
    say(table(("level of detail", "objects", "polygons", "min per object", "mean", "max"), rows))
    say(f"written to {out}")
    return 0


def make_other(options: argparse.Namespace) -> int:
    """Make a plant, a city, a rotunda or an arcade, write it and print its size."""
    from ..data.buildings.arcade import make_arcade
    from ..data.buildings.city import make_city
    from ..data.buildings.plant import make_plant
    from ..data.buildings.rotunda import make_rotunda
    from ..data.buildings.statistics import level_statistics

    out, write = _scene_writer(options)
    build = {"plant": make_plant, "city": make_city, "rotunda": make_rotunda, "arcade": make_arcade}[options.building]
    scene = build(seed=options.seed, **{count: getattr(options, count) for count in options.counts})
    write(scene, out)
    size = (level_statistics(scene)[-1].polygons, len(scene.objects), len(scene.definitions), len(scene.spaces))
    say(table(("triangles", "objects", "definitions", "spaces"), [size]))
    say(f"written to {out}")
    return 0


def _scene_writer(options: argparse.Namespace) -> tuple[Path, Callable[["Scene", Path], None]]:
    """Where to write a scene, and how, by the name's ending."""
    from ..data.buildings.glb import write_glb
    from ..data.store.scene_folder import write_scene

    writers = {".scene": write_scene, ".glb": write_glb}
    out = Path(options.out)
    if out.suffix not in writers:
        raise InputError(f"out: expected a name ending in {' or '.join(writers)}, found {options.out!r}")
    if out.exists() and not options.overwrite:
        raise InputError(f"{out}: expected a new name, found something there; --overwrite replaces it")
    return out, writers[out.suffix]


def inspect(options: argparse.Namespace) -> int:
    """Say whether a model is fit to bake; the exit code says so, too."""
    from .inspect.run import inspect as look

    if options.picture and Path(options.picture).suffix.lower() not in (".png", ".svg"):
        raise InputError(f"picture: expected a name ending in .png or .svg, found {options.picture!r}")
    found = look(options.model, referee=options.referee, estimate=not options.no_estimate, **_reading(options))
    code = 0 if found.ok else FAILED
    say(as_json("inspect", code, found.json()) if options.json else found.text())
    if options.picture:
        from .inspect.picture import draw

        draw(found, Path(options.picture))
    return code


def bake(options: argparse.Namespace) -> int:
    """Bake a model and print what came of it."""
    from .bake.place import check_place, default_out, leftovers
    from .bake.settings import Settings
    from .bake.settings_file import SettingsFile, read_settings

    model = Path(options.model)
    given = _given(options)
    file = read_settings(options.settings) if options.settings else SettingsFile({}, {})
    settings = Settings(**(file.settings | given))
    if file.line:
        say(f"{options.settings}: {file.line}")
    settings.check()
    out = Path(options.out) if options.out else default_out(model)
    for folder in [] if options.json else leftovers(out.absolute().parent, out.name):
        say(f"unfinished: {folder.name}; the bake that it is of goes on from there, viewcell clean removes it")
    check_place(out, settings, options.overwrite)
    # What fails above does so at once: the rest takes a second to import.
    from .bake.run import Interrupted
    from .bake.run import bake as compute

    before = _stamp(out)
    try:
        made = compute(
            _read(model, options, settings.reading | settings.frame),
            out,
            settings=settings,
            budget_s=options.budget,
            threads=options.threads,
            device=options.device,
            overwrite=options.overwrite,
            tuned=file.tuned,
        )
    except Interrupted:
        complain("interrupted; the same command goes on from there")
        return INTERRUPTED
    # A bake that is written anew is a new folder.
    fresh = _stamp(out) != before
    if options.json:
        say(as_json("bake", 0, bake_result(made, fresh)))
        return 0
    say(summary(made))
    say(f"written to {made.folder}" if fresh else f"{made.folder} was up to date; --overwrite bakes it again")
    return 0


def _given(options: argparse.Namespace) -> dict[str, object]:
    """Settings that were given on the command line, by name."""
    from .bake.settings import Settings

    asked = {field.name: getattr(options, field.name, None) for field in fields(Settings)}
    return {name: value for name, value in asked.items() if value is not None}


def clean(options: argparse.Namespace) -> int:
    """Remove what killed commands have left in a folder, and say so."""
    from .bake.place import clean as sweep

    done = sweep(Path(options.folder))
    say("\n".join(f"{what} {path}" for what, path in done) or f"{options.folder}: nothing was left unfinished there")
    return 0


def _read(model: Path, options: argparse.Namespace, reading: dict[str, object]) -> object:
    """The model as `bake` takes it: a scene where options say how to read the numbers of the file, else its path."""
    if options.up is None and options.unit is None:
        return model
    if model.is_dir():
        raise InputError(f"{model}: expected a model file beside --up and --unit, found a folder")
    from ..data.readers import read

    return read(model, up=options.up, unit=_number_or_name(options.unit), **reading)


def _reading(options: argparse.Namespace) -> dict[str, object]:
    """Options of `read` that were given."""
    asked = {name: getattr(options, name) for name in ("up", "doors", "glass", "doors_by", "leave_out")}
    asked["unit"], asked["yaw"] = _number_or_name(options.unit), _number_or_name(options.yaw)
    return {name: value for name, value in asked.items() if value is not None}


def _number_or_name(text: str | None) -> str | float | None:
    """A unit's name or metres, a yaw's or degrees: what is a number is read as one."""
    try:
        return text if text is None else float(text)
    except ValueError:
        return text


def _stamp(out: Path) -> tuple[int, int] | None:
    """What tells a folder from another of the same name."""
    try:
        found = (out / "manifest.json").stat()
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns


def verify(options: argparse.Namespace) -> int:
    """Check a bake, or one case; the exit code says whether it stood."""
    from .baked import load

    if options.hard_cases:
        return _hard_cases(options)
    if options.device is not None:
        raise InputError(f"device: expected it beside --hard-cases only, found {options.device!r}")
    if options.bake is None and options.replay is None:
        raise InputError("verify: expected a bake folder or --replay CASE, found neither")
    if options.certificates and (options.bake is None or options.replay is not None):
        raise InputError("verify: expected a bake folder and no case beside --certificates")
    made = None if options.bake is None else load(options.bake)
    from .verify import replay

    if options.replay is not None:
        outcome = replay(options.replay, made)
        say(outcome.line())
        return 0 if outcome.ok else FAILED
    if options.certificates:
        from ..verify.proofs.line_tree import check_certificates

        found = check_certificates(made)
        say("\n".join([found.line(), *(f"refuted: {line}" for line in found.examples)]))
        return FAILED if found.failed else 0
    result = made.verify(rays=options.rays, seed=options.seed)
    code = 0 if result.ok else FAILED
    say(as_json("verify", code, verify_result(result)) if options.json else result.table())
    return code


def _hard_cases(options: argparse.Namespace) -> int:
    """Put the hard cases to every kernel; the exit code says whether one was wrong."""
    from .hard.run import hard_cases_table, run_hard_cases

    if options.bake is not None or options.replay is not None or options.certificates:
        raise InputError("verify: expected no bake, case or certificates beside --hard-cases")
    rows = run_hard_cases(None if options.device is None else [options.device])
    say(hard_cases_table(rows))
    return FAILED if any(row.wrong for row in rows) else 0


def check(options: argparse.Namespace) -> int:
    """Check claims of any baker; the exit code says whether something visible was found hidden."""
    from ..data.store.scene_folder import refuse_others
    from .check.folder import replay, write_check
    from .check.run import check as look

    if options.replay is not None:
        left, lines = replay(options.replay, options.model)
        say("\n".join(lines))
        return FAILED if left else 0
    if options.model is None:
        raise InputError("check: expected a model or --replay FOLDER, found neither")
    if options.out:
        refuse_others(options.out, "check")
    result = look(
        options.model,
        options.pvs,
        options.cells,
        rays=options.rays,
        seed=options.seed,
        targets=options.targets,
        **_reading(options),
    )
    code = 0 if result.ok else FAILED
    say(as_json("check", code, check_result(result)) if options.json else result.table(options.shown))
    if options.out:
        write_check(result, options.out)
        if not options.json:
            say(f"written to {options.out}")
    return code


def tune_bake(options: argparse.Namespace) -> int:
    """Try settings beside the default's on a model, print what came of it and write it down."""
    from .bake.place import default_out
    from .bake.settings import Settings
    from .tune.bake import tune_bake as tune
    from .tune.bake_words import tuning_text, write_tuning

    model, given = Path(options.model), _given(options)
    settings = Settings(**given)
    out = Path(options.out) if options.out else default_out(model).with_suffix(".tune")
    found = tune(
        _read(model, options, settings.reading | settings.frame),
        settings=settings,
        asked=given,
        budget_s=options.budget,
        threads=options.threads,
        device=options.device,
    )
    say(tuning_text(found))
    file = write_tuning(found, out)
    say(f"written to {out}; viewcell bake {model} --settings {file} bakes with it")
    return FAILED if found.wrong_hidden else 0


def tune_points(options: argparse.Namespace) -> int:
    """Try ways to choose projection points, print what came of it and write it down."""
    from .baked import load
    from .tune.points import point_lines, tune_projection_point

    found = tune_projection_point(load(options.bake), cells=options.cells, seed=options.seed, out=options.out)
    say(point_lines(found))
    if found.wrong_hidden:
        print(f"viewcell: {counted(found.wrong_hidden, 'pair')} hidden although seen; this is a bug", file=sys.stderr)
    return FAILED if found.wrong_hidden else 0


def tune_lod(options: argparse.Namespace) -> int:
    """Try ways to choose levels of detail, print what came of it and write it down."""
    from ..data.camera import Screen
    from .baked import load

    screen = Screen(*options.image, options.fov)
    made = load(options.bake)
    from ..solvers.levels.benefit import BenefitSettings
    from .tune.candidates import default_out
    from .tune.lod import tune_lod as tune
    from .tune.lod import write_tuning

    benefit = BenefitSettings(always=tuple(options.always))
    result = tune(
        made,
        frames=options.frames,
        budgets_ms=options.budget_ms,
        screen=screen,
        path=options.path,
        samples=options.samples,
        benefit=benefit,
        seed=options.seed,
    )
    say(result.text())
    asked = {"frames": options.frames, "path": options.path, "samples": options.samples, "seed": options.seed}
    file = write_tuning(result, made, options.out or default_out(made), screen=screen, benefit=benefit, asked=asked)
    say(f"written to {file.parent}; bake MODEL --settings {file} bakes with it")
    return 0


def report(options: argparse.Namespace) -> int:
    """Write a report and say where it is."""
    from .baked import load

    made = load(options.bake)
    from .report.run import report as write

    text = write(made, cells=options.cells, out=options.out, curves=options.curves)
    paths = {"text": str(text), "page": str(text.with_suffix(".html"))}
    say(as_json("report", 0, paths) if options.json else "\n".join(paths.values()))
    return 0


def bench(options: argparse.Namespace) -> int:
    """Measure, print the table, write it down and compare it with an earlier run."""
    from .bench.against import compare, load_bench
    from .bench.run import bench as run
    from .bench.run import check_writable, write_bench

    old = load_bench(Path(options.against)) if options.against else None
    if options.json:
        check_writable(Path(options.json))
    result = run(
        suite=options.suite,
        device=options.device,
        only=options.only,
        graphs=options.graphs,
    )
    say(result.text())
    found, worse = result.json(), False
    if options.json:
        write_bench(found, Path(options.json))
        say(f"written to {options.json}")
    if old is not None:
        change = compare(old, found, only=options.only)
        say(change.text())
        worse = bool(change.wrong) or (options.strict and bool(change.slower or change.looser or change.missing))
    if result.wrong_hidden:
        print(f"viewcell: {result.wrong_hidden} wrongly hidden; this is a bug", file=sys.stderr)
    return FAILED if worse or result.wrong_hidden else 0


def curves(options: argparse.Namespace) -> int:
    """Sweep the knobs, draw the curves and say which settings are worth their time, and what random eyes miss."""
    from .baked import load

    if options.stability == (options.bake is not None):
        raise InputError("curves: expected a bake folder or --stability, found both or neither")
    if options.stability:
        return _stability(options)
    made = load(options.bake)
    folder, wrong = Path(options.out) if options.out else Path(made.folder) / "report", False
    if not options.eyes:
        from .curves.plot import curve_lines, write_curves
        from .curves.sweep import sweep

        found = sweep(made, cells=options.cells, seed=options.seed)
        write_curves(found, folder)
        say(curve_lines(found))
        wrong = any(p.wrong_hidden for one in found.safe for p in one.points)
    if options.eyes or made.scene is not None:
        wrong |= _eyes(made, folder, options)
    say(f"written to {folder}")
    return FAILED if wrong else 0


def _eyes(made: "Bake", folder: Path, options: argparse.Namespace) -> bool:
    """What random eyes miss; whether the bake hides something that they see."""
    from .curves.eyes import eyes_lines, eyes_missed, write_eyes

    found = eyes_missed(made, cells=options.cells, pixels=options.pixels, seed=options.seed)
    write_eyes(found, folder)
    say(eyes_lines(found))
    if found.wrong_hidden:
        print(f"viewcell: {found.pair} hidden although seen (case file {found.case}); this is a bug", file=sys.stderr)
    return bool(found.wrong_hidden)


def _stability(options: argparse.Namespace) -> int:
    """Error of the kernels as numbers get hard."""
    from .hard.stability import FLOAT32, measure_stability, stability_table, write_stability

    rows = measure_stability(seed=options.seed, device=options.device)
    folder = Path(options.out or "stability")
    write_stability(rows, folder)
    say(stability_table(rows))
    say(f"written to {folder}")
    return FAILED if any(row.wrong for row in rows if row.kernel != FLOAT32) else 0


def export(options: argparse.Namespace) -> int:
    """Write a bake for engines and other tools, and say where everything is."""
    from .baked import load
    from .export.run import KINDS
    from .export.run import export as write

    asked = {kind: getattr(options, kind) for kind in KINDS if getattr(options, kind) is not None}
    if not asked:
        raise InputError(f"export: expected at least one of --{', --'.join(KINDS)}, found none")
    made = load(options.bake)
    for out in write(made, asked, overwrite=options.overwrite):
        parts = [out] if out.is_file() else [part for part in out.rglob("*") if part.is_file()]
        say(f"written to {out}, {sum(part.stat().st_size for part in parts):,} bytes")
    if "prt" in asked:
        from ..data.store.quake import UNIT_STEPS

        graph, unit = made.graph, f"1 unit = {UNIT_STEPS * made.grid_m:g} m"
        say(f"{counted(graph.tile_count, 'leaf', 'leaves')}, {counted(graph.portal_count, 'portal')}, {unit}")
        say(f"viewcell check {options.prt} --pvs SETS judges the sets that another tool computes for it")
    return 0


def view(options: argparse.Namespace) -> int:
    """Write a view, say where it is, and open it where somebody sits at a terminal."""
    from .view.run import view as write

    made = write(options.source, options.out, overwrite=options.overwrite)
    say(str(made.page))
    if not options.no_open and sys.stdout.isatty():
        made.open()
    return 0


def pack(options: argparse.Namespace) -> int:
    """Write a display database and say how large it is, or check one."""
    from .pack.words import pack_text

    if options.check:
        from ..data.store.walk_folder import read_walk

        if options.out or options.flatten or options.overwrite or options.depth_meshes:
            raise InputError("pack: expected nothing to write beside --check")
        walk = read_walk(options.bake)
        say(pack_text(walk))
        if stale := walk.stale():
            complain(stale)
        return FAILED if stale else 0
    from ..data.store.bake_folder import read_bake
    from .pack.depth import DepthSettings
    from .pack.run import default_out
    from .pack.run import pack as write

    told = {name: getattr(options, name) for name in ("triangles", "along") if getattr(options, name) is not None}
    if told and not options.depth_meshes:
        raise InputError(f"pack: expected --depth-meshes beside --{next(iter(told))}")
    depth = DepthSettings(options.depth_meshes, **told) if options.depth_meshes else None
    made = read_bake(options.bake)
    out = Path(options.out) if options.out else default_out(made)
    before = _stamp(out)
    walk = write(made, out, flatten=options.flatten, depth=depth, overwrite=options.overwrite)
    say(pack_text(walk))
    say(f"written to {out}" if _stamp(out) != before else f"{out} was up to date; --overwrite packs it again")
    return 0
