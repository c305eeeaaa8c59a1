"""Tune the choice of levels of detail: candidates over the user's own scene, path and budgets; time against error."""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv

from ...data.camera import CameraPath, Screen
from ...data.errors import InputError
from ...data.plural import counted
from ...data.progress import phase, shown
from ...data.silence import silenced
from ...data.store.bake_folder import BakeFolder
from ...data.version import __version__
from ...kernels.select import launch_select
from ...solvers.levels.benefit import (
    BenefitSettings,
    Candidates,
    Sightings,
    Tuples,
    find_candidates,
    find_sightings,
    find_tuples,
)
from ...solvers.levels.choosers import branch_and_bound, incremental_greedy, literal_greedy
from ...solvers.levels.cost_model import CostModel, read_samples
from ...solvers.levels.select_frames import (
    Chooser,
    Coherence,
    PathChoice,
    certified_bound,
    fitting,
    frame_problem,
    select_frames,
)
from ..files import write_files
from ..pages import html_page
from ..walk.path import potential_on, read_path, walk
from ..walk.software_renderer import SAMPLE_FRAMES, SoftwareRenderer, fit_renderer, measure_samples
from .outcomes import Outcome, Tuning, percent

FRAMES = 300
# Budgets unless given: parts of the work in the 95th percentile of the frames at its finest, beside an empty frame.
SHARES = (0.3, 0.5, 0.7)
COHERENCE = Coherence(hysteresis=0.1, slack=0.02)
# HiGHS solves and the software renderer draws the same frames.
DRAWN_FRAMES = 20
# A setting is recommended only if so few frames miss their time, and so few of the objects shown change level a frame.
MISSES_MOST, SWITCHES_MOST = 0.01, 0.02
# Where the objects of a frame are few, so many times the fewest changes of any setting are allowed.
SWITCHES_FACTOR = 1.5
RULE = (
    f"least value lost, over all budgets, among the settings that miss at most {MISSES_MOST:.0%} of the modelled frame "
    f"times and change at most {SWITCHES_MOST:.0%} of the objects shown per frame, or at most {SWITCHES_FACTOR} times "
    f"as many as the setting that changes fewest; of those that lose equally little, the quickest"
)


def _kernel(improve: bool) -> Chooser:
    return lambda b, c, s, budget, _: launch_select(b, c, s, budget, improve=improve).choice[0]


def _incremental(b: np.ndarray, c: np.ndarray, s: np.ndarray, budget: int, previous: np.ndarray) -> np.ndarray:
    """From the levels of the last frame; what has come into view starts at its cheapest."""
    owners = np.repeat(np.arange(len(s) - 1), np.diff(s))
    cheapest = np.lexsort((c, owners))[s[:-1]] - s[:-1]
    return incremental_greedy(b, c, s, budget, np.where(previous < 0, cheapest, previous))[0]


def _highs(b: np.ndarray, c: np.ndarray, s: np.ndarray, budget: int, _: np.ndarray) -> np.ndarray:
    with silenced():
        return branch_and_bound(b, c, s, budget)[0]


KERNEL, HIGHS = "kernel", "HiGHS, default gap"
CHOOSERS: dict[str, Chooser] = {
    KERNEL: _kernel(improve=True),
    "kernel, not improved": _kernel(improve=False),
    "incremental greedy": _incremental,
    "literal greedy": lambda b, c, s, budget, _: literal_greedy(b, c, s, budget)[0],
    HIGHS: _highs,
}


# Method, coherence, frame time [ms], what was chosen, and the bound of each of its frames.
_Tried = tuple[str, Coherence, float, PathChoice, np.ndarray]


@dataclass(frozen=True)
class _Problem:
    """A scene's tuples along a path."""

    path: CameraPath
    screen: Screen
    tuples: Tuples
    sightings: Sightings
    candidates: Candidates


def tune_lod(
    bake: BakeFolder,
    *,
    frames: int = FRAMES,
    budgets_ms: Sequence[float] | None = None,
    screen: Screen | None = None,
    path: str | Path | None = None,
    samples: str | Path | None = None,
    benefit: BenefitSettings | None = None,
    coherence: Coherence = COHERENCE,
    seed: int = 0,
    progress: bool = False,
) -> Tuning:
    """Try ways to choose levels of detail on a bake, along a path.

    Args:
        bake: of a model, with or without levels.
        frames: of the walk, if no path is given.
        budgets_ms: frame times to aim at; by default parts of what the frames cost at their finest.
        screen: 640 x 480 pixels and 60 degrees by default.
        path: table of a recorded path, see `workbench.walk.path.read_path`.
        samples: table of frames measured with the user's renderer; without it the software renderer is measured.
        benefit: how benefits are weighted.
        coherence: tried beside none.
        seed: of the walk and of the sampled frames.
        progress: show a progress bar.

    Raises:
        InputError: the bake has no objects, or a file or number is unusable.
    """
    if bake.scene is None:
        raise InputError(f"{bake.folder}: expected the bake of a model, found one of a bare cell graph")
    screen, benefit = screen or Screen(), benefit or BenefitSettings()
    cost = None if samples is None else read_samples(samples)
    for budget in budgets_ms or ():
        if not (np.isfinite(budget) and budget > 0):
            raise InputError(f"budget: expected milliseconds above 0, found {budget}")
    walked = walk(bake, frames, seed) if path is None else read_path(path)
    problem, notes = _problem(bake, walked, screen, benefit)
    budget_count = len(budgets_ms or SHARES)
    runs = budget_count * (2 * (len(CHOOSERS) - 1) * len(walked) + min(DRAWN_FRAMES, len(walked)))
    with shown(progress), phase("levels of detail", SAMPLE_FRAMES + runs, "frame") as bar:
        renderer, measured = None, None
        if cost is None:
            renderer = SoftwareRenderer(bake.scene, problem.tuples, problem.sightings, screen)
            measured = measure_samples(
                renderer, walked, problem.sightings, problem.tuples, problem.candidates, seed, bar.update
            )
            cost = fit_renderer(measured)
        else:
            notes.append("Frames were not drawn: the costs are those of another renderer.")
        return _try_all(problem, cost, renderer, measured, budgets_ms, benefit, coherence, notes, bar.update)


def _problem(
    bake: BakeFolder, path: CameraPath, screen: Screen, benefit: BenefitSettings
) -> tuple[_Problem, list[str]]:
    """Tuples along the path, and what should be said of them."""
    kinds = {placed.kind for placed in bake.scene.objects}
    for kind in (*benefit.always, *benefit.importance):
        if kind not in kinds:
            raise InputError(f"kinds: expected {', '.join(sorted(kinds))}; found {kind!r}")
    sets, lost = potential_on(bake, path)
    tuples = find_tuples(bake.scene, benefit)
    sightings = find_sightings(bake.scene, path, screen, sets)
    candidates = find_candidates(bake.scene, tuples, sightings, screen, benefit)
    if not len(sightings.object_id):
        raise InputError(f"{bake.folder}: expected an object in view somewhere on the path, found none")
    levels = np.diff(tuples.starts)
    several = sum(len(shape.lods) > 1 for shape in bake.scene.definitions)
    notes = [
        f"{counted(len(path), 'frame')}, {screen.width} x {screen.height} pixels; on average "
        f"{len(sightings.object_id) / len(path):.0f} objects in view, {levels[sightings.object_id].mean():.1f} choices "
        f"each, drawing nothing among them"
    ]
    if not several:
        notes.append("No object has more than one level: all that can be chosen is whether it is drawn.")
    if lost.any():
        eyes = counted(int(lost.sum()), "eye")
        notes.append(f"In no inhabitable cell: {eyes}. Every object may be seen from there.")
    if tuples.faceless:
        notes.append(f"{counted(tuples.faceless, 'object')} without faces: never drawn.")
    if tuples.left_out:
        notes.append(f"{tuples.left_out} levels are left out: empty, or no cheaper than a finer one.")
    return _Problem(path, screen, tuples, sightings, candidates), notes


def _try_all(
    problem: _Problem,
    cost: CostModel,
    renderer: SoftwareRenderer | None,
    samples: dict[str, np.ndarray] | None,
    budgets_ms: Sequence[float] | None,
    benefit: BenefitSettings,
    coherence: Coherence,
    notes: list[str],
    step: Callable[[], None],
) -> Tuning:
    """Every chooser, with and without coherence, at every budget."""
    candidates, sightings = problem.candidates, problem.sightings
    factors = np.array([a.cost_factor for a in benefit.algorithms])[problem.tuples.algorithm[candidates.tuple_id]]
    costs = cost.object_ns(problem.tuples.primitives[candidates.tuple_id], candidates.pixels, factors)
    frames = np.arange(len(problem.path))
    sighting_of = np.repeat(np.arange(len(sightings.object_id)), np.diff(candidates.starts))
    empty_ms = cost.frame_s * (1 + cost.margin) * 1e3
    dearest, finest = np.zeros(len(sightings.object_id), np.int64), np.zeros(len(sightings.object_id))
    np.maximum.at(dearest, sighting_of, costs)
    np.maximum.at(finest, sighting_of, candidates.benefit)
    owner = np.repeat(frames, np.diff(sightings.starts))
    whole_ms = empty_ms + np.bincount(owner, dearest, len(frames)) / 1e6
    most = np.bincount(owner, finest, len(frames))
    if budgets_ms is None:
        most_ms = np.percentile(whole_ms, 95) - empty_ms
        budgets_ms = [float(f"{empty_ms + most_ms * share:.3g}") for share in SHARES]
    budgets_ms = sorted(set(map(float, budgets_ms)))
    tried, modelled = [], {"all finest": whole_ms}
    for budget_ms in budgets_ms:
        budget = cost.budget_ns(budget_ms)
        bounds = np.array([_bound(problem, costs, budget, frame) for frame in frames])
        for method, choose in CHOOSERS.items():
            some = frames if method != HIGHS else np.unique(np.linspace(0, frames[-1], DRAWN_FRAMES).astype(int))
            for how in (Coherence(),) if method == HIGHS else (Coherence(), coherence):
                found = select_frames(sightings, candidates, costs, budget, choose, how, some, step)
                tried.append((method, how, budget_ms, found, bounds[some]))
                if method == KERNEL and how == coherence and budget_ms == budgets_ms[len(budgets_ms) // 2]:
                    modelled[f"{KERNEL} with coherence, for {budget_ms:.3g} ms"] = empty_ms + found.cost / 1e6
    over = [None] * len(tried) if renderer is None else _drawn_misses(problem, renderer, tried)
    outcomes = [_outcome(*one, most, misses, empty_ms) for one, misses in zip(tried, over, strict=True)]
    best, coherent, reason = recommend(outcomes)
    dropped = sum(o.dropped for o in outcomes if (o.method, o.coherent) == (best, coherent))
    if dropped:
        notes.append(
            f"{dropped} times an object that must be drawn did not fit and was dropped, that of the least benefit for "
            f"its cost first."
        )
    return Tuning(cost, samples, outcomes, best, coherent, reason, modelled, budgets_ms, notes)


def _bound(problem: _Problem, costs: np.ndarray, budget: int, frame: int) -> float:
    """Certified bound of a frame, what must be drawn and cannot be left aside."""
    whole = frame_problem(problem.sightings, problem.candidates, int(frame))
    fits, _ = fitting(whole, problem.candidates.benefit, costs, budget)
    return certified_bound(fits, problem.candidates, costs, budget)


def _drawn_misses(problem: _Problem, renderer: SoftwareRenderer, tried: list[_Tried]) -> list[float]:
    """Share of some frames that the software renderer takes longer for than it should, of each candidate.

    Candidates take turns, so that what else the machine does falls on all alike.
    """
    frames = np.unique(np.linspace(0, len(problem.path) - 1, DRAWN_FRAMES).astype(int))
    over = np.zeros((len(tried), len(frames)))
    for place, frame in enumerate(frames):
        for row, (_, _, budget_ms, found, _) in enumerate(tried):
            chosen = found.chosen[slice(*problem.sightings.starts[frame : frame + 2])]
            which = problem.candidates.tuple_id[chosen[chosen >= 0]]
            seconds = renderer.draw(problem.path, int(frame), problem.tuples.owner[which], problem.tuples.lod[which])[1]
            over[row, place] = seconds * 1e3 > budget_ms
    return over.mean(axis=1).tolist()


def _outcome(
    method: str,
    how: Coherence,
    budget_ms: float,
    found: PathChoice,
    bounds: np.ndarray,
    most: np.ndarray,
    misses: float | None,
    empty_ms: float,
) -> Outcome:
    lost = np.divide(bounds - found.value, bounds, out=np.zeros(len(bounds)), where=bounds > 0)
    follow = len(found.frames) == len(most)
    return Outcome(
        method=method,
        coherent=how != Coherence(),
        budget_ms=budget_ms,
        frames=len(found.frames),
        lost_mean=float(lost.mean()),
        lost_most=float(lost.max()),
        kept_detail=float(found.value.sum() / most[found.frames].sum()) if most[found.frames].any() else 1.0,
        switches=float(found.switches.mean()) if follow else None,
        switch_share=float(found.switches.sum() / max(1, found.shown.sum())) if follow else None,
        modelled_misses=float((empty_ms + found.cost / 1e6 > budget_ms * (1 + 1e-12)).mean()),
        measured_misses=misses,
        choose_ms=float(np.median(found.seconds) * 1e3),
        dropped=int(found.dropped.sum()),
    )


def recommend(outcomes: Sequence[Outcome]) -> tuple[str, bool, str]:
    """Method, whether with coherence, and the reason, by RULE; what was tried on some frames only is for reference."""
    settings: dict[tuple[str, bool], list[Outcome]] = {}
    for outcome in outcomes:
        if outcome.method != HIGHS:
            settings.setdefault((outcome.method, outcome.coherent), []).append(outcome)

    def mean(name: str, setting: tuple[str, bool]) -> float:
        return float(np.mean([getattr(outcome, name) for outcome in settings[setting]]))

    def most(name: str, setting: tuple[str, bool]) -> float:
        return max(getattr(outcome, name) for outcome in settings[setting])

    punctual = [s for s in settings if most("modelled_misses", s) <= MISSES_MOST] or list(settings)
    limit = max(SWITCHES_MOST, SWITCHES_FACTOR * min(mean("switch_share", s) for s in punctual))
    calm = [s for s in punctual if mean("switch_share", s) <= limit]
    best = min(calm, key=lambda s: (round(mean("lost_mean", s), 6), mean("choose_ms", s)))
    plain = mean("switches", (best[0], False) if (best[0], False) in settings else best)
    reason = (
        f"recommended: {best[0]}, {'with' if best[1] else 'without'} coherence. Of all that change few levels it loses "
        f"least: {percent(mean('lost_mean', best))} % of the certified bound on average, "
        f"{percent(most('lost_most', best))} % at worst; {mean('switches', best):.2f} levels change per frame "
        f"({plain:.2f} without coherence); {100 * most('modelled_misses', best):.1f} % of the frames miss their "
        f"modelled time; {mean('choose_ms', best):.2f} ms to choose (rule: {RULE})"
    )
    return *best, reason


def write_tuning(
    tuning: Tuning,
    bake: BakeFolder,
    out: str | Path,
    *,
    screen: Screen,
    benefit: BenefitSettings,
    coherence: Coherence = COHERENCE,
    asked: dict | None = None,
) -> Path:
    """Write tune-lod.json, .png and .html, and the samples measured; each file appears whole or not at all.

    Returns:
        Path of tune-lod.json; docs/tune-file.md describes it.

    Raises:
        InputError: the folder cannot be written.
    """
    from .lod_plot import lod_plot

    folder, name = Path(out), Path(bake.folder).name

    def files() -> dict[str, bytes]:
        picture = lod_plot(tuning, name)
        head, rows = tuning.rows()
        title, notes = f"Choosing levels of detail in {name}", [tuning.cost.line(), *tuning.notes]
        page = html_page(title, picture, head, rows, notes, lead=tuning.reason)
        made = {"tune-lod.png": picture, "tune-lod.html": page.encode()}
        if tuning.samples is not None:
            samples = pa.BufferOutputStream()
            pyarrow.csv.write_csv(pa.table(tuning.samples), samples)
            made["samples.csv"] = samples.getvalue().to_pybytes()
        content = _content(tuning, bake, screen, benefit, coherence, asked or {})
        return made | {"tune-lod.json": (json.dumps(content, indent=1) + "\n").encode()}

    write_files(folder, files)
    return folder / "tune-lod.json"


def _content(
    tuning: Tuning, bake: BakeFolder, screen: Screen, benefit: BenefitSettings, coherence: Coherence, asked: dict
) -> dict:
    """Contents of tune-lod.json."""
    chosen = asdict(coherence if tuning.best_coherent else Coherence())
    return {
        "tuned": "lod",
        "viewcell": __version__,
        "bake": str(bake.folder),
        "settings": bake.manifest["settings"],
        "lod": {
            "method": tuning.best,
            **chosen,
            "budgets_ms": tuning.budgets_ms,
            "screen": asdict(screen),
            "benefit": asdict(benefit),
            "cost": _finite(asdict(tuning.cost)),
        },
        "asked": asked,
        "rule": RULE,
        "reason": tuning.reason,
        "notes": tuning.notes,
        "outcomes": [asdict(outcome) for outcome in tuning.outcomes],
    }


def _finite(values: dict) -> dict:
    """NaN is no JSON."""
    return {
        name: None if isinstance(value, float) and not np.isfinite(value) else value for name, value in values.items()
    }
