"""What random eyes miss of what a bake has a witness for: unions of eyes as others take them for the truth, measured.

Every pair that counts has a sightline that passed the exact test, so what eyes miss is missed for certain. What eyes
see beyond that is counted, and judged exactly where the bake hides it.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from ...data.errors import InputError
from ...data.plural import counted
from ...data.progress import phase, shown
from ...data.solids import closed_elements
from ...verify.findings import VerifyResult
from ...verify.rays.adjudicate import Judge, Judgement, sightline_end
from ...verify.rays.embree import Candidates
from ...verify.rays.solid_angles import SAMPLES, SolidAngles
from ...verify.rays.unions import EYES, FRAME_EYES, FRAME_PIXELS, Eyes, Views, eyes_for, frame_errors
from ...verify.rays.witness import witnessed_objects
from ..files import write_files
from ..pages import COLOURS, MARKERS, png
from ..summary import table
from ..verify import judge_batch, make_judge

if TYPE_CHECKING:
    from ...data.store.bake_folder import BakeFolder

# Pixels on a side of the cube maps' faces: about 100,000 rays an eye.
PIXELS = (128,)
# Decades of solid angle that are told apart [powers of 10 sr]; the last is open.
DECADES = (-6, -5, -4, -3, -2, -1)
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Union:
    """Unions of so many eyes a cell at one resolution; all shares are from 0 to 1.

    Attributes:
        eyes: in the union.
        pixels: on a side of a face of their cube maps.
        missed: share of the seen pairs that the union misses, the mean over unions of these eyes.
        pixels_missed: share of the pixels of other eyes' frames that show what the union misses, the mean.
        frames_lacking: share of those frames in which that is any pixel.
        worst_frame: share of the pixels that one frame in a hundred exceeds.
        seconds: of rays, a cell.
    """

    eyes: int
    pixels: int
    missed: float
    pixels_missed: float
    frames_lacking: float
    worst_frame: float
    seconds: float


@dataclass(frozen=True)
class Grade:
    """Seen pairs whose mean solid angle lies in one decade.

    Attributes:
        low: power of 10 [sr] that it begins at; None for those below all decades, or too small to be measured.
        pairs: that it has.
        missed: share of them that unions miss, by the number of eyes, at the first resolution.
    """

    low: int | None
    pairs: int
    missed: dict[int, float]


@dataclass(frozen=True)
class EyesMissed:
    """What random eyes miss in some view cells of a bake.

    Attributes:
        scene: its name and size.
        cells: looked from.
        dark: cells left out, because too few free points were found in them.
        pairs: seen pairs of these cells.
        unions: by resolution, then by the number of eyes.
        grades: of the opaque ones among the pairs, by solid angle, the smallest first.
        beyond: pairs that some eye saw and that have no witness.
        confirmed: those among them that are potential and that an exact test shows to be visible.
        grazes: hidden ones whose sightline only touches something, or is stopped by it exactly, or passes a leak.
        wrong_hidden: hidden ones that are visible; the search for more stops at the first.
        case: its case file.
        pair: that pair in words.
    """

    scene: str
    cells: list[int]
    dark: int
    pairs: int
    unions: list[Union]
    grades: list[Grade]
    beyond: int
    confirmed: int
    grazes: int
    wrong_hidden: int
    case: str = ""
    pair: str = ""

    def content(self) -> dict:
        """As JSON holds it."""
        return asdict(self)


def eyes_missed(
    bake: "BakeFolder",
    *,
    cells: int = 8,
    pixels: Sequence[int] = PIXELS,
    seed: int = 0,
    progress: bool = False,
) -> EyesMissed:
    """Measure unions of random eyes against what a bake has witnesses for.

    Args:
        bake: of a model.
        cells: view cells, drawn at random among the inhabitable ones.
        pixels: on a side of the cube maps' faces; from more pixels fewer eyes look, 1 at least.
        seed: of the draw of cells and eyes.
        progress: show a progress bar.

    Returns:
        The shares, the same for the same arguments but for the seconds. Embree may let a ray through at an edge, so
        that a little too little is missed.

    Raises:
        InputError: a bare graph, no inhabitable cell with free points, nothing seen, or no resolution.
    """
    if bake.scene is None:
        raise InputError(f"{bake.folder}: expected the bake of a model for eyes to look at, found a bare graph")
    if not pixels:
        raise InputError("pixels: expected a resolution, found none")
    # What is wrong with one of them is said before the first takes its time.
    for size in pixels:
        eyes_for(size)
    rng, sources = np.random.default_rng(seed), np.flatnonzero(bake.graph.inhabitable)
    chosen = np.sort(rng.permutation(sources)[:cells])
    with shown(progress), phase("eyes"):
        with phase("prepare"):
            judge = make_judge(bake)
            eyes = Eyes(bake.scene, closed_elements(bake.scene), bake.graph, chosen, seed)
        seen = witnessed_objects(bake)[eyes.cells]
        if not seen.any():
            raise InputError(f"{bake.folder}: expected view cells that see something from a free point, found none")
        views = [eyes.views(size, seen) for size in pixels]
        frames = eyes.frames()
        unions = [_union(view, count, seen, frames) for view in views for count in EYES if count <= view.eyes]
        with phase("solid angles"):
            grades = _grades(judge, eyes, views[0], seen, rng)
        result, confirmed, beyond = _judged(bake, judge, eyes.cells, views)
    name = f"{Path(bake.folder).stem}: {len(eyes.cells):,} of {counted(len(sources), 'view cell')}"
    return EyesMissed(
        scene=f"{name}, {counted(len(bake.scene.objects), 'object')}",
        cells=eyes.cells.tolist(),
        dark=len(chosen) - len(eyes.cells),
        pairs=int(seen.sum()),
        unions=unions,
        grades=grades,
        beyond=beyond,
        confirmed=confirmed,
        grazes=result.grazes + result.blocked + result.leaks,
        wrong_hidden=result.wrong_hidden,
        case=str(result.case or ""),
        pair=result.pair,
    )


def _union(views: Views, eyes: int, seen: np.ndarray, frames: np.ndarray) -> Union:
    errors = frame_errors(frames, views, eyes)
    missed = float(views.missed(eyes)[seen].mean())
    seconds = views.seconds * eyes / views.eyes / len(seen)
    return Union(eyes, views.pixels, missed, errors.pixels, errors.frames, errors.worst, seconds)


def _grades(judge: Judge, eyes: Eyes, views: Views, seen: np.ndarray, rng: np.random.Generator) -> list[Grade]:
    """Seen pairs of opaque objects by decade; those that are seen too seldom to be measured are below all."""
    opaque = np.zeros(seen.shape[1], bool)
    opaque[judge.lines.owners] = True
    rows, objects = np.nonzero(seen & opaque)
    mean, error = SolidAngles(judge.lines, seen.shape[1], list(eyes.spots)).graded(rows, objects, rng)
    place = np.searchsorted(DECADES, np.log10(np.maximum(mean, 1e-300)), "right") - 1
    place[~(error <= SAMPLES[-1][1])] = -1
    grades = []
    for number in range(-1, len(DECADES)):
        own = place == number
        if own.any():
            missed = {count: float(views.missed(count)[rows, objects][own].mean()) for count in _sizes(views)}
            grades.append(Grade(None if number < 0 else DECADES[number], int(own.sum()), missed))
    return grades


def _sizes(views: Views) -> list[int]:
    return [count for count in EYES if count <= views.eyes]


def _judged(
    bake: "BakeFolder", judge: Judge, cells: np.ndarray, views: Sequence[Views]
) -> tuple[VerifyResult, int, int]:
    """What became of hidden pairs that eyes saw; unknown pairs that are visible; pairs beyond the witnesses in all."""
    result, found = VerifyResult(), _together([one.odd for one in views])
    hidden = ~bake.potential_objects[cells[found.rows], found.targets]
    unknown = _chosen(found, ~hidden)
    confirmed = 0
    if len(unknown.rows):
        ends = np.array([sightline_end(unknown, number, bake.graph.cells) for number in range(len(unknown.rows))])
        verdicts = judge.judge_all("object", cells[unknown.rows], unknown.targets, unknown.origins, ends)
        confirmed = int((verdicts == Judgement.VISIBLE).sum())
    judge_batch(bake, cells, judge, _chosen(found, hidden), result)
    pairs = np.unique(np.stack([found.rows, found.targets]), axis=1).shape[1]
    return result, confirmed, pairs


def _together(found: Sequence[Candidates]) -> Candidates:
    """The first ray to each pair, whatever the resolution."""
    every = Candidates(*(np.concatenate(column) for column in zip(*(vars(one).values() for one in found), strict=True)))
    once = np.unique(np.stack([every.rows, every.targets]), axis=1, return_index=True)[1]
    return _chosen(every, np.sort(once))


def _chosen(found: Candidates, which: np.ndarray) -> Candidates:
    return Candidates(*(column[which] for column in vars(found).values()))


def write_eyes(found: EyesMissed, folder: Path) -> None:
    """Write eyes.json and eyes.png into a folder, both or none.

    Raises:
        InputError: the folder cannot be written.
    """
    text = json.dumps(found.content(), indent=1) + "\n"
    write_files(folder, lambda: {"eyes.png": eyes_plot(found), "eyes.json": text.encode()})


def eyes_lines(found: EyesMissed) -> str:
    """All of it for people: by number of eyes, by solid angle, and what eyes saw beyond the witnesses."""
    head = (
        found.scene,
        "faces, pixels",
        "of seen pairs missed",
        "of pixels missed",
        "frames that lack something",
        "seconds a cell",
    )
    rows = [
        (
            f"union of {counted(one.eyes, 'random eye')}",
            f"{one.pixels}²",
            f"{100 * one.missed:.1f} %",
            f"{100 * one.pixels_missed:.2g} %",
            f"{100 * one.frames_lacking:.1f} %",
            f"{one.seconds:.2f}",
        )
        for one in found.unions
    ]
    lines = [table(head, rows), ""]
    if found.grades:
        sizes = list(found.grades[0].missed)
        head = (f"solid angle, sr (opaque, {found.unions[0].pixels}²)", "seen pairs", *(f"{n} eyes" for n in sizes))
        grades = [
            (decade_text(one.low), one.pairs, *(f"{100 * one.missed[n]:.1f} %" for n in sizes)) for one in found.grades
        ]
        lines += [table(head, grades), ""]
    lines.append(
        f"eyes saw {counted(found.beyond, 'pair')} without a witness: "
        f"{found.wrong_hidden} hidden wrongly, {found.confirmed} unknown that are visible by an exact test, "
        f"{found.beyond - found.wrong_hidden - found.confirmed} that an exact test does not show"
    )
    if found.dark:
        lines.append(f"{counted(found.dark, 'cell')} left out, with too few points outside solids")
    return "\n".join(lines)


def decade_text(low: int | None) -> str:
    """A decade of solid angle in words; None for what is below all, or too small to be measured."""
    if low is None:
        return f"below {_power(DECADES[0])} or not measured"
    return f"above {_power(low)}" if low == DECADES[-1] else f"{_power(low)} to {_power(low + 1)}"


def _power(exponent: int) -> str:
    return f"10{str(exponent).translate(RAISED)}"


def eyes_plot(found: EyesMissed) -> bytes:
    """PNG: pairs that unions miss, by eyes and resolution; the same by solid angle; what frames lack."""
    figure = Figure(figsize=(16.5, 5.6), layout="constrained")
    figure.suptitle(f"What random eyes miss. {found.scene}, {found.pairs:,} seen pairs", fontsize=12)
    pairs, graded, frames = figure.subplots(1, 3)
    sizes = sorted({one.eyes for one in found.unions})
    for number, pixels in enumerate(dict.fromkeys(one.pixels for one in found.unions)):
        own = [one for one in found.unions if one.pixels == pixels]
        style = {"marker": MARKERS[number % len(MARKERS)], "color": COLOURS[number % len(COLOURS)]}
        pairs.plot([one.eyes for one in own], [100 * one.missed for one in own], label=f"{pixels}² a face", **style)
    pairs.set(xlabel="random eyes in a view cell", ylabel="seen pairs that their union misses [%]", ylim=(0, None))
    pairs.set_title("every pair counts the same", fontsize=10)
    first = found.unions[0].pixels
    own = [one for one in found.unions if one.pixels == first]
    for values, label, number in (
        ([one.frames_lacking for one in own], "frames that lack something", 3),
        ([one.worst_frame for one in own], "pixels missed in the worst frame of 100", 1),
        ([one.pixels_missed for one in own], "pixels missed, the mean", 2),
    ):
        shown_values = [100 * value if value > 0 else math.nan for value in values]
        frames.plot([one.eyes for one in own], shown_values, "o-", color=COLOURS[number], label=label)
    frames.set(xlabel="random eyes in a view cell", ylabel="[%] (logarithmic; 0 is not drawn)", yscale="log")
    frames.yaxis.set_major_formatter("{x:g}")
    frames.set_title(
        f"what {FRAME_EYES} other eyes lack, frames of {FRAME_PIXELS}² pixels ({first}² a face)", fontsize=10
    )
    for axes in (pairs, frames):
        axes.set_xscale("log")
        axes.set_xticks(sizes, [str(count) for count in sizes], minor=False)
        axes.set_xticks([], minor=True)
    places = np.arange(len(found.grades))
    for number, count in enumerate(found.grades[0].missed if found.grades else ()):
        missed = [100 * one.missed[count] for one in found.grades]
        style = {"marker": MARKERS[number % len(MARKERS)], "color": COLOURS[number % len(COLOURS)]}
        graded.plot(places, missed, label=counted(count, "eye"), **style)
    words = [decade_text(one.low).replace(" or ", "\nor ").replace(" to ", "\nto ") for one in found.grades]
    words = [f"{text}\n{counted(one.pairs, 'pair')}" for text, one in zip(words, found.grades, strict=True)]
    graded.set_xticks(places, words, fontsize=8)
    graded.set(xlabel="solid angle of the pair, mean over the cell [sr]", ylabel="missed [%]", ylim=(0, None))
    graded.set_title(f"by solid angle, opaque objects ({first}² a face)", fontsize=10)
    for axes in figure.axes:
        axes.grid(True, which="major", alpha=0.3)
        axes.legend(fontsize=9)
    return png(figure)
