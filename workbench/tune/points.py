"""Tune projection points on a user's own scene: clusters, objectives, solvers and resolutions, time against error."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...data.errors import InputError
from ...data.plural import counted
from ...data.prepared import PreparedModel
from ...data.progress import phase, shown
from ...verify.rays.witness import witnessed_objects
from ..bake.blocks import BLOCK
from .candidates import Candidate, default_out, front_of, front_plot, write_tune

if TYPE_CHECKING:
    from ...data.store.bake_folder import BakeFolder
    from ...solvers.projection_point import Problem
    from ...solvers.result import Result
    from ...solvers.visibility.engine import Engine
    from ...solvers.visibility.projection import VlodSettings

# A setting that is faster is recommended if its overestimate is at most this much above the least.
SLACK = 0.02
CLUSTERS = (1, 6, 14, 26)
RESOLUTIONS = (128, 256, 1024)
# Of the search for the point that culls most: evaluations and starts a cluster.
EVALUATIONS, STARTS = 25, 1
AXES = "ms per view cell", "potential / seen"
# Programmes that every solver is given, and those of them whose gap is proved in rationals.
PROGRAMMES, PROVED = 200, 20


@dataclass(frozen=True)
class SolverRow:
    """One solver on the programmes of the view cells.

    Attributes:
        name: of the solver.
        programmes: given to it.
        micros: a programme, mean.
        statuses: how many ended how, in words.
        gap: largest proved distance from the optimum, relative, of those that are solved.
        violation_m: of the row violated most [m].
    """

    name: str
    programmes: int
    micros: float
    statuses: str
    gap: float
    violation_m: float


@dataclass(frozen=True)
class PointTuning:
    """What `tune_projection_point` found.

    Attributes:
        folder: with tune.json, tune.png and tune.html.
        candidates: of settings; error is potential / seen.
        solvers: on the same programmes.
        recommended: the candidate chosen, of the published method's.
        default: the candidate that is `bake`'s default method.
        says: what the file does, and what the default would give.
        wrong_hidden: pairs hidden although they are seen: 0, or a bug.
    """

    folder: Path
    candidates: list[Candidate]
    solvers: list[SolverRow]
    recommended: Candidate
    default: Candidate
    says: str
    wrong_hidden: int


def tune_projection_point(
    bake: "BakeFolder", *, cells: int = 8, seed: int = 0, out: str | Path | None = None, progress: bool = False
) -> PointTuning:
    """Try every way to choose projection points on some view cells of a bake.

    Error is potential / seen, where seen is what the bake has witnesses for: an upper bound of the true overestimate.

    Args:
        bake: of a model; its view cells and witnesses are used.
        cells: view cells, drawn at random.
        seed: of the draw, and of random points.
        out: folder to write; by default the bake's name with `.tune`, beside it.
        progress: show a progress bar.

    Raises:
        InputError: a bake without a model, without inhabitable cells or without occluders; the folder.
    """
    from ...solvers.visibility.projection import VlodSettings

    scene = bake.scene
    if scene is None:
        raise InputError(f"{bake.folder}: expected the bake of a model, found that of a bare graph")
    sources = np.flatnonzero(bake.graph.inhabitable)
    if not len(sources) or cells < 1:
        raise InputError(f"{bake.folder}: expected view cells to tune on, found none")
    chosen = np.sort(np.random.default_rng(seed).permutation(sources)[:cells])
    model = PreparedModel(scene)
    if not len(model.outlines.area):
        raise InputError(f"{bake.folder}: expected occluders to choose points for, found no opaque surface of 1 m2")
    bench = _Bench(bake, chosen, model, seed)
    plan: list[tuple[VlodSettings, str]] = [
        (VlodSettings(clusters, objective, seed=seed), "")
        for clusters in CLUSTERS
        for objective in ("centre", "random", "socp", "lp")
    ]
    plan += [
        (VlodSettings(clusters, "socp", seed=seed), solver)
        for clusters in CLUSTERS[:2]
        for solver in ("random feasible", "Clarabel", "SLSQP", "culled, by COBYLA")
    ]
    plan += [(VlodSettings(26, "socp", resolution, seed=seed), "") for resolution in RESOLUTIONS]
    candidates = []
    with shown(progress), phase("projection points", len(plan) + 1, "setting") as bar:
        bench.warm(plan[0][0])
        for settings, solver in plan:
            candidates.append(bench.run(settings, solver))
            bar.update()
        solvers = bench.solvers()
        bar.update()
    recommended = recommend([c for c in candidates if c.settings])
    default = bench.default()
    candidates.append(default)
    wrong = sum(int(c.numbers["wrong hidden"]) for c in candidates)
    folder = Path(out) if out else default_out(bake)
    counts = (len(chosen), "view cell"), (len(scene.objects), "object"), (len(model.outlines.area), "occluder")
    pixels = ", ".join(counted(*count) for count in counts)
    rule = (
        f"Recommended: {recommended.name}, the fastest of vLOD's settings that `bake` can use whose overestimate is "
        f"within {SLACK:.0%} of the least of them. `viewcell tune MODEL` tunes the default method instead."
    )
    says = _says(recommended, default, len(chosen))
    title = f"Projection points of {Path(bake.folder).name}: {pixels}"
    head = ("setting", *AXES, *candidates[0].numbers)
    rows = [(c.name, f"{c.time:,.2f}", f"{c.error:,.4f}", *map(str, c.numbers.values())) for c in candidates]
    listed = [
        {"name": c.name, AXES[0]: c.time, AXES[1]: c.error, **c.numbers, "settings": c.settings} for c in candidates
    ]
    content = {
        "says": says,
        "settings": recommended.settings,
        "recommended": recommended.name,
        "default": next(row for row in listed if row["name"] == default.name),
        "candidates": listed,
    }
    picture = front_plot(candidates, recommended, title, AXES)
    write_tune(
        folder, "projection-point", (title, head, rows, [rule, _note(wrong), _solver_table(solvers)]), picture, content
    )
    return PointTuning(folder, candidates, solvers, recommended, default, says, wrong)


def recommend(candidates: list[Candidate]) -> Candidate:
    """The fastest whose error is within SLACK of the least; of equals the first."""
    least = min(c.error for c in candidates)
    return min((c for c in candidates if c.error <= least * (1 + SLACK)), key=lambda c: c.time)


def _says(recommended: Candidate, default: Candidate, cells: int) -> str:
    """What the file does, beside the default."""
    return (
        f"Changes the method to vlod ({recommended.name}). On {counted(cells, 'view cell')} it takes "
        f"{recommended.time:,.1f} ms a cell and keeps {recommended.error:.3f} of what is seen; the default method "
        f"takes {default.time:,.1f} ms, witnesses included, and keeps {default.error:.3f}."
    )


def _note(wrong: int) -> str:
    return f"Hidden although seen: {wrong}." + ("" if wrong == 0 else " This is a bug: please report it.")


class _Bench:
    """View cells of a bake, what is seen from them, and how a setting does on them."""

    def __init__(self, bake: "BakeFolder", cells: np.ndarray, model: PreparedModel, seed: int) -> None:
        occludees = model.occludees
        self._boxes, self._outlines, self._seed = bake.graph.cells[cells], model.outlines, seed
        self._parts, self._owners, self._grid_m = occludees.pieces, occludees.owners, model.scene.grid_m
        self._triangles = model.scene.triangle_counts
        self._weights = (self._triangles / np.maximum(np.diff(occludees.starts), 1))[self._owners]
        self._seen = witnessed_objects(bake)[cells]
        self._bake, self._cells, self._model = bake, cells, model
        self._problems: list[Problem] = []

    def warm(self, settings: "VlodSettings") -> None:
        """Compile what is compiled on first use."""
        from ...solvers.visibility.projection import VlodSettings

        for objective in ("socp", "lp"):
            self._hidden(VlodSettings(settings.clusters, objective, 16), None, self._boxes[:1])
            self._hidden(VlodSettings(26, objective, 16), None, self._boxes)

    def run(self, settings: "VlodSettings", solver: str) -> Candidate:
        """Time and overestimate of one setting; of a solver that `bake` does not use if it is named."""
        chooser, solving = self._chooser(settings, solver), 0.0

        def timed(problems: "list[Problem]") -> np.ndarray:
            nonlocal solving
            begin = time.perf_counter()
            points = chooser(problems)
            solving += time.perf_counter() - begin
            return points

        begin = time.perf_counter()
        hidden, stats = self._hidden(settings, timed if solver else None, self._boxes)
        seconds = time.perf_counter() - begin
        if not solver:
            solving = stats.seconds.get("solve", 0.0)
        if not self._problems and settings.clusters == CLUSTERS[-1]:
            self._hidden(settings, self._keep, self._boxes)
        potential = ~hidden
        count = len(self._boxes)
        name = f"{counted(settings.clusters, 'cluster')}, {solver or settings.objective}, {settings.resolution} px"
        return Candidate(
            name,
            solver or settings.objective,
            1e3 * seconds / count,
            float(potential.sum() / max(1, self._seen.sum())),
            self._numbers(hidden, solving),
            None
            if solver
            else {
                "method": "vlod",
                "clusters": settings.clusters,
                "objective": settings.objective,
                "resolution": settings.resolution,
            },
        )

    def default(self) -> Candidate:
        """The method that `bake` uses by default, from the same view cells; sightlines are sought, too."""
        engine = self._default_engine()
        blocks = [self._cells[first : first + BLOCK] for first in range(0, len(self._cells), BLOCK)]
        # The first time makes, and compiles, what every time uses.
        for _ in range(2):
            begin = time.perf_counter()
            parts = [engine.visible(block) for block in blocks]
            seconds = time.perf_counter() - begin
        potential = np.zeros((self._bake.graph.cell_count, len(self._triangles)), bool)
        rows = engine.join(parts)[1]
        potential[rows.source, rows.target] = True
        hidden, count = ~potential[self._cells], len(self._cells)
        error = float((~hidden).sum() / max(1, self._seen.sum()))
        return Candidate(
            "the default method",
            "default",
            1e3 * seconds / count,
            error,
            self._numbers(hidden, None),
            {"method": "auto"},
        )

    def _default_engine(self) -> "Engine":
        """An engine that answers from the bake's view cells."""
        bake = self._bake
        if bake.claims_cells:
            from ...solvers.visibility.portal_engine import PortalEngine

            return PortalEngine(self._model, bake.graph, method="auto", seed=self._seed)
        from ...solvers.visibility.view_cell_engine import ViewCellEngine

        return ViewCellEngine(self._model, bake.graph.cells, plans=bake.graph.plans, seed=self._seed)

    def _numbers(self, hidden: np.ndarray, solving_s: float | None) -> dict[str, object]:
        """Other columns of the table, from what is hidden, shape (view cells, objects), bool."""
        count, sizes = len(hidden), self._triangles
        return {
            "solving, ms per cell": "-" if solving_s is None else round(1e3 * solving_s / count, 2),
            "culled triangles": f"{100 * (hidden @ sizes).sum() / (count * sizes.sum()):.1f} %",
            "wrong hidden": int((hidden & self._seen).sum()),
        }

    def solvers(self) -> list[SolverRow]:
        """Every solver on the same programmes, those of 26 clusters."""
        from ...solvers.projection_point import solve_points
        from ...solvers.referees import cone_point, feasible_point, gradient_point

        problems = [p for p in self._problems if len(p.normals)][:PROGRAMMES]
        if not problems:
            return []
        solve_points(problems)
        ways: dict[str, Callable[[list[Problem]], list[Result]]] = {
            "interior point, JAX float64, batched": lambda all_: [solve_points(all_)],
            "Clarabel": lambda all_: [cone_point(p) for p in all_],
            "NLopt SLSQP": lambda all_: [gradient_point(p) for p in all_],
            "random feasible point": lambda all_: [feasible_point(p, seed=self._seed + i) for i, p in enumerate(all_)],
        }
        return [self._solver_row(name, solve, problems) for name, solve in ways.items()]

    def _solver_row(
        self, name: str, solve: "Callable[[list[Problem]], list[Result]]", problems: "list[Problem]"
    ) -> SolverRow:
        from ...solvers.result import Status
        from ...verify.exact.projection_point import relative_gap

        begin = time.perf_counter()
        results = solve(problems)
        micros = 1e6 * (time.perf_counter() - begin) / len(problems)
        points = np.concatenate([r.point for r in results])
        status = np.concatenate([r.status for r in results])
        names, counts = np.unique(status, return_counts=True)
        proved = np.flatnonzero(status == Status.SOLVED)[:PROVED]
        gaps = np.array([0.0, *(relative_gap(problems[number], points[number]) for number in proved)])
        violation = max(
            float((p.bounds - p.rows @ point).max(initial=0.0)) for p, point in zip(problems, points, strict=True)
        )
        words = ", ".join(f"{count} {Status(code).name.lower()}" for code, count in zip(names, counts, strict=True))
        return SolverRow(name, len(problems), micros, words, float(np.nanmax(gaps)), max(0.0, violation) * self._grid_m)

    def _keep(self, problems: "list[Problem]") -> np.ndarray:
        self._problems = self._problems + problems
        return np.array([p.centre for p in problems])

    def _hidden(self, settings: "VlodSettings", chooser: Callable | None, boxes: np.ndarray) -> tuple:
        from ...solvers.visibility.projection import vlod_hidden

        count = len(self._triangles)
        return vlod_hidden(boxes, self._outlines, self._parts, self._owners, settings, objects=count, points=chooser)

    def _chooser(self, settings: "VlodSettings", solver: str) -> "Callable[[list[Problem]], np.ndarray] | None":
        """From programmes to points by the named solver, one after the other."""
        from ...solvers.referees import cone_point, feasible_point, gradient_point, searched_point
        from ...solvers.visibility.projection import culling_scores

        single = {
            "Clarabel": cone_point,
            "SLSQP": gradient_point,
            "random feasible": lambda problem: feasible_point(problem, seed=self._seed),
        }

        def by_search(problems: "list[Problem]") -> np.ndarray:
            points = np.array([p.centre for p in problems])
            for first in range(0, len(problems), settings.clusters):
                centre = problems[first].centre
                box = self._boxes[np.abs(self._boxes.mean(axis=1) - centre).max(axis=1).argmin()]
                scores = culling_scores(box, self._outlines, self._parts, self._weights, settings)
                for number, score in enumerate(scores):
                    problem = problems[first + number]
                    if len(problem.normals):
                        found = searched_point(problem, score, starts=STARTS, evaluations=EVALUATIONS, seed=self._seed)
                        points[first + number] = found.point[0]
            return points

        def one_by_one(problems: "list[Problem]") -> np.ndarray:
            return np.array([single[solver](p).point[0] if len(p.normals) else p.centre for p in problems])

        if not solver:
            return None
        return by_search if solver.startswith("culled") else one_by_one


def _solver_table(solvers: list[SolverRow]) -> str:
    from ..summary import table

    head = ("solver of the cone programme", "programmes", "us each", "ended", "proved gap", "violation m")
    rows = [
        (s.name, f"{s.programmes:,}", f"{s.micros:,.0f}", s.statuses, f"{s.gap:.1e}", f"{s.violation_m:.1e}")
        for s in solvers
    ]
    return table(head, rows)


def point_lines(found: PointTuning) -> str:
    """The tables for people."""
    from ..summary import table

    front = front_of(found.candidates)
    names = list(found.candidates[0].numbers)
    rows = [
        (
            c.name + (" *" if c in front else ""),
            f"{c.time:,.1f}",
            f"{c.error:.3f}",
            *(str(c.numbers[name]) for name in names),
        )
        for c in sorted(found.candidates, key=lambda c: c.time)
    ]
    return "\n".join(
        [
            table(("setting (* none is both faster and tighter)", "ms per cell", "potential / seen", *names), rows),
            "",
            _solver_table(found.solvers),
            "",
            f"recommended: {found.recommended.name}; written to {found.folder}",
            found.says,
        ]
    )
