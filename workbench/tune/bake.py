"""Tune a bake on a user's own model: settings beside the default's, time against what is kept, in one run."""

import time
from collections.abc import Collection
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...data.errors import InputError
from ...data.kept import cell_volumes
from ...data.lod import split_components
from ...data.progress import Phase, phase, shown
from ...data.scene import Scene
from ..bake.blocks import in_blocks
from ..bake.cells import Sources
from ..bake.run import engine_of, open_model
from ..bake.settings import Settings, check_number
from .choice import AS_TIGHT, LOOSER, TIGHTER, Row, hopeful, recommended
from .neighbours import neighbours, words
from .safety import hidden_by_rays, hidden_of, holders
from .trial import Answer, Trial, run_trial, sources_of

if TYPE_CHECKING:
    from ...kernels.launch import Device

# Seconds that a tuning may take, about; rounds, and how many a recommended row needs at least.
BUDGET_S, ROUNDS, LEAST_ROUNDS = 300.0, 5, 3
# A budget is so many times what the default takes on the view cells that are tried; at least so many are.
BUDGET_TRIALS, LEAST_CELLS = 25, 8
# View cells that a first guess of the time is made with.
PROBED = 4
# A setting that takes so many times as long as the default is stopped.
STOP = 2.0
# Points that view cells of different cuts are compared at, and rays that each setting is tried with.
POINTS, RAYS = 4096, 200_000
# Means of samples may be off by so many standard errors.
DOUBT = 2.0


@dataclass(frozen=True)
class BakeTuning:
    """What `tune_bake` found.

    Attributes:
        rows: the default's first.
        chosen: the recommended one of them.
        base: settings of the default's row.
        settings: the recommended ones.
        model: what it is of, in words.
        tried, cells: view cells that were tried, and all of the default's.
        objects: of the model.
    """

    rows: list[Row]
    chosen: Row
    base: Settings
    settings: Settings
    model: str
    tried: int
    cells: int
    objects: int

    @property
    def wrong_hidden(self) -> int:
        """Pairs hidden although they are visible, of all rows: 0, or a bug."""
        return sum(row.hidden for row in self.rows)


def tune_bake(
    model: Scene | str | Path,
    *,
    settings: Settings | None = None,
    asked: Collection[str] = (),
    budget_s: float = BUDGET_S,
    threads: int | None = None,
    device: str = "cpu",
    progress: bool = False,
) -> BakeTuning:
    """Try settings beside a default on a model, or on a fair sample of its view cells, and recommend one.

    A recommended setting is never worse than the default: it hides nothing visible, it is as tight, and it is no slower
    in the median, nor by more than a tenth in any round. It gains, too: it is tighter, or faster by more than times
    vary. If there is none, the default is recommended.

    Args:
        model: as for `bake`, but no bare graph.
        settings: the default to compare with; that of `bake` if there are none.
        asked: names of settings that are not to be changed.
        budget_s: how long it may take, without reading the model, but for what has begun; where it is short fewer view
            cells are tried, and perhaps fewer settings.
        threads: as for `bake`.
        device: as for `bake`.
        progress: show a progress bar.

    Raises:
        InputError: the model or the settings are unusable.
    """
    base = settings or Settings()
    base.check()
    check_number("budget", budget_s, 1e-9)
    check_number("threads", 1 if threads is None else threads, 1)
    from ...kernels.launch import Device

    where = Device.wanted(device, threads)
    scene, folder = open_model(model, base)
    if scene is None:
        raise InputError(f"{folder}: expected a model to tune on, found a bare graph, whose answers are exact")
    if base.split:
        scene = split_components(scene)
    start = time.perf_counter()
    sources, _ = sources_of(scene, base)
    every = sources.graph.cells[sources.graph.inhabitable]
    sample = _sample(scene, base, sources, every, where, budget_s, time.perf_counter() - start)
    tried = [Row("the default")] + [Row(words(c), c) for c in neighbours(base, asked, sources)]
    with shown(progress), phase("settings", unit="run") as bar:
        rows = _Rounds(scene, base, where, sample, start + budget_s, bar).measure(tried)
    chosen = recommended(rows, LEAST_ROUNDS)
    name = Path(scene.source).name if scene.source else "scene"
    best = replace(base, **chosen.changes)
    return BakeTuning(rows, chosen, base, best, name, rows[0].cells, len(every), len(scene.objects))


def asked_settings(settings: Settings) -> dict[str, object]:
    """Settings as a settings file has them: the method, and what differs from `bake`'s own."""
    plain = asdict(Settings())
    return {name: value for name, value in asdict(settings).items() if name == "method" or value != plain[name]}


def _sample(
    scene: Scene, base: Settings, sources: Sources, every: np.ndarray, device: "Device", budget_s: float, cut_s: float
) -> np.ndarray | None:
    """Boxes of view cells, drawn at random, that the budget is enough for; None if it is for all. It compiles, too."""
    order = np.random.default_rng(base.seed).permutation(len(every))
    probe, _ = sources_of(scene, base, every[order[:PROBED]])
    start = time.perf_counter()
    engine = engine_of(probe, base, device)
    prepared_s = cut_s + time.perf_counter() - start
    _compile(engine, device)
    blocks = in_blocks(probe)
    for block in blocks:
        engine.visible(block)
    start = time.perf_counter()
    for block in blocks:
        engine.visible(block)
    each_s = (time.perf_counter() - start) / sum(map(len, blocks))
    count = int((budget_s / BUDGET_TRIALS - prepared_s) / max(each_s, 1e-9))
    count = max(count, LEAST_CELLS)
    return None if count >= len(every) else every[np.sort(order[:count])]


def _compile(engine: object, device: "Device") -> None:
    """Load all kernels, those too that settings beside the default may use."""
    import warp as wp

    from ...kernels import shaft

    engine.compile()
    wp.load_module(shaft.__name__, device=device.name)


class _Rounds:
    """Rows measured in turn, round by round."""

    def __init__(
        self,
        scene: Scene,
        base: Settings,
        device: "Device",
        sample: np.ndarray | None,
        deadline: float,
        bar: Phase,
    ) -> None:
        self._scene, self._base, self._device, self._sample = scene, base, device, sample
        self._deadline, self._bar = deadline, bar

    def measure(self, rows: list[Row]) -> list[Row]:
        """Fill the rows, the default's first: all once, and again those that may be recommended."""
        answers = self._first(rows)
        self._judge(rows, answers)
        answers.clear()
        for number in range(1, ROUNDS):
            left = [rows[0], *filter(hopeful, rows[1:])]
            if len(left) == 1 or self._late:
                break
            # Forth and back, so that nobody is always measured first.
            trials = {id(row): self._try(row) for row in (left[::-1] if number % 2 else left)}
            for row in left:
                _enter(row, trials[id(row)], trials[id(left[0])])
        return rows

    def _first(self, rows: list[Row]) -> dict[int, Answer]:
        """The first round, with what each row that was not stopped answers, by its place."""
        answers = {}
        whole = self._try(rows[0])
        for place, row in enumerate(rows):
            if place and self._late:
                row.unusable = "not tried, for want of time"
                continue
            try:
                trial = self._try(row, STOP * whole.seconds) if place else whole
            except InputError as error:
                row.unusable = str(error).partition(": ")[2] or str(error)
                continue
            _enter(row, trial, whole)
            row.stopped = trial.answer is None
            if trial.answer is not None:
                answers[place] = trial.answer
        return answers

    def _judge(self, rows: list[Row], answers: dict[int, Answer]) -> None:
        """What each answer keeps, beside the default's, and whether it hides what is visible."""
        points = _points(answers[0].graph, self._base.seed)
        for place, answer in answers.items():
            row = rows[place]
            row.cells = int(answer.graph.inhabitable.sum())
            row.pairs, row.cell_pairs = len(answer.objects), answer.cell_pairs
            row.kept, row.tightness, row.uncovered = compared(answer, answers[0], points)
            if answers[0].cell_pairs is not None and answer.cell_pairs is None:
                row.unusable = "says nothing of cells"
            rays = hidden_by_rays(answer, RAYS, self._base.seed)
            row.hidden = max(rays, hidden_of(answer, list(answers.values())))

    @property
    def _late(self) -> bool:
        return time.perf_counter() > self._deadline

    def _try(self, row: Row, most_s: float = np.inf) -> Trial:
        trial = run_trial(self._scene, replace(self._base, **row.changes), self._device, self._sample, most_s)
        self._bar.update()
        return trial


def _enter(row: Row, trial: Trial, default: Trial) -> None:
    row.seconds.append(trial.seconds)
    row.ratios.append(trial.seconds / default.seconds)


def compared(answer: Answer, default: Answer, points: np.ndarray) -> tuple[float, int, float]:
    """What an answer keeps, and how tight it is beside another one.

    Args:
        answer: of a setting.
        default: of the one to compare with.
        points: in its view cells, evenly by volume [grid steps], shape (n, 3), float64.

    Returns:
        Share of the objects that is kept at the points, mean; TIGHTER, AS_TIGHT or LOOSER; and the share of the points
        that no view cell holds. Where both have the same view cells they are compared pair for pair, else by what
        they keep at the same points: then a difference within the doubt of the sample counts as looser.
    """
    objects = max(1, len(answer.scene.objects))
    mine, theirs = (_kept_at(one, points) for one in (answer, default))
    held = ~np.isnan(mine)
    kept = float(mine[held].mean() / objects) if held.any() else float("nan")
    uncovered = float(1.0 - held.mean())
    if answer.same_cells(default):
        more = [len(answer.objects) - len(default.objects)]
        if answer.cell_pairs is not None and default.cell_pairs is not None:
            more.append(answer.cell_pairs - default.cell_pairs)
        tightness = LOOSER if max(more) > 0 else TIGHTER if min(more) < 0 else AS_TIGHT
        return kept, tightness, uncovered
    more = (mine - theirs)[held]
    if not len(more):
        return kept, LOOSER, uncovered
    sure = more.mean() + DOUBT * more.std() / np.sqrt(len(more))
    return kept, TIGHTER if sure < 0 else AS_TIGHT if not more.any() else LOOSER, uncovered


def _kept_at(answer: Answer, points: np.ndarray) -> np.ndarray:
    """Objects that are kept at each point, by the view cell there that keeps least; NaN where there is none."""
    counts = np.bincount(answer.objects.source, minlength=answer.graph.cell_count)
    out = np.full(len(points), np.inf)
    point, cell = holders(answer.graph, points)
    np.minimum.at(out, point, counts[cell])
    return np.where(np.isinf(out), np.nan, out)


def _points(graph: "object", seed: int) -> np.ndarray:
    """Points in the inhabitable cells, evenly by volume [grid steps], shape (n, 3), float64, n about POINTS."""
    rng = np.random.default_rng(seed)
    cells = np.flatnonzero(graph.inhabitable)
    volumes = cell_volumes(graph)[cells]
    drawn = np.sort(rng.choice(cells, POINTS, p=volumes / volumes.sum()))
    low, high = graph.cells[drawn, 0], graph.cells[drawn, 1]
    out = low + rng.random((POINTS, 3)) * (high - low)
    # Boxes of prisms are larger than they: what falls beside one is drawn again.
    for _ in range(64):
        beside = np.flatnonzero(~graph.plans.hold(drawn, out, graph.cell_count))
        if not len(beside):
            break
        out[beside] = low[beside] + rng.random((len(beside), 3)) * (high - low)[beside]
    return out[graph.plans.hold(drawn, out, graph.cell_count)]
