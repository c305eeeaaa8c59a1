"""Error of each kernel as numbers get hard: far from the origin, nearly touching, long and thin, close to an edge.

Cases are built so that plain reasoning says what is visible (tests hold them against the exact twins), and put to the
kernels as the hard cases are. A kernel may withhold; it may refuse what its launcher calls out of range; anything wrong
is a bug. Beside them rays of Embree in float32 without an exact test, which is what most bakers trust.
"""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from fractions import Fraction
from pathlib import Path

import numpy as np

from ...data.errors import InputError
from ...data.progress import shown, track
from ...data.scene import GRID_LIMIT, GRID_M
from ...data.verdict import Verdict
from ...kernels.launch import Device
from ...kernels.stab_batch import launch_stab
from ...verify.cases.case_file import StabCase
from ...verify.cases.hard_cases import HardCases, RegionCase, Shape, SightlineCase
from ...verify.exact.stab import stab
from ...verify.rays.embree import embree_scene
from ..files import write_files
from ..pages import MARKERS, png
from ..summary import table
from .kernels import KERNELS
from .outcomes import Outcome

# Okabe and Ito's seven; the last one is for what is wrong.
PALETTE = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#000000", "#d55e00")
CASES = 40
REGION_KERNELS = ("launch_target_search", "launch_shaft", "launch_umbra", "vlod_hidden")
FLOAT32 = "Embree rays, float32, not judged"
# Offsets [grid steps], 0 to 128 km; gaps [grid steps]; sides of a wall over its height; distances from an edge [steps].
OFFSETS = (0, *(2**k for k in (10, 14, 17, 19, 21, 22, 23, 24, 25, 27)))
GAPS = (1, 2, 4, 8, 16, 64, 256)
ASPECTS = (1, 4, 16, 64, 256, 1024, 4096)
DISTANCES = tuple(2.0**-k for k in range(1, 31, 3))


@dataclass(frozen=True)
class Row:
    """One kernel at one value of a knob.

    Attributes:
        knob: what makes it hard, with its unit.
        value: of the knob.
        kernel: a launch function, or Embree in float32.
        cases: put to it.
        withheld: cases left open, or not proved.
        wrong: cases answered wrongly.
        refused: the launcher said that this is out of its range; then nothing was answered.
    """

    knob: str
    value: float
    kernel: str
    cases: int
    withheld: int
    wrong: int
    refused: bool


def measure_stability(
    *, cases: int | None = None, seed: int = 0, device: str = "cpu", progress: bool = False
) -> list[Row]:
    """Sweep every knob for every kernel that it concerns.

    Args:
        cases: a value of a knob, half of them visible; 40 by default.
        seed: of the cases.
        device: Warp device.
        progress: show a progress bar.

    Raises:
        InputError: an unknown device.
    """
    where = Device.wanted(device, 1)
    rows: list[Row] = []
    sweeps = list(_sweeps(cases or CASES, seed))
    with shown(progress):
        for knob, value, hard in track(sweeps, "stability", "value"):
            kernels = [*(["launch_stab"] if hard.stab else []), *(REGION_KERNELS if hard.region else [])]
            kernels += ["launch_confirm"] if hard.sightline else []
            rows += [_row(knob, value, kernel, hard, where) for kernel in kernels]
            if hard.sightline:
                rows.append(_by_float32(knob, value, hard.sightline))
    return rows


def _sweeps(cases: int, seed: int) -> Iterator[tuple[str, float, HardCases]]:
    """Every value of every knob, and its cases."""
    for value in OFFSETS:
        random = np.random.default_rng(seed)
        hard = HardCases(
            stab=[stab_case(random, 8, value, i) for i in range(cases)],
            region=[slit_case(random, 8, value, bool(i % 2)) for i in range(cases)],
            sightline=[edge_case(random, 1 / 64, value, bool(i % 2)) for i in range(cases)],
            **NOTHING,
        )
        yield "offset, m", value * GRID_M, hard
    for value in GAPS:
        random = np.random.default_rng(seed)
        stabs = [stab_case(random, value, 0, i) for i in range(cases)]
        regions = [slit_case(random, value, 0, bool(i % 2)) for i in range(cases)]
        yield "gap, grid steps", value, HardCases(stab=stabs, region=regions, sightline=[], **NOTHING)
    for value in ASPECTS:
        random = np.random.default_rng(seed)
        regions = [thin_case(random, value, bool(i % 2)) for i in range(cases)]
        yield "aspect ratio of the occluder", value, HardCases(stab=[], region=regions, sightline=[], **NOTHING)
    for value in DISTANCES:
        random = np.random.default_rng(seed)
        lines = [edge_case(random, value, 0, bool(i % 2)) for i in range(cases)]
        yield "distance from an edge, grid steps", value, HardCases(stab=[], region=[], sightline=lines, **NOTHING)


# No knob turns cases of the other kinds.
NOTHING: dict[str, list] = {
    field.name: [] for field in fields(HardCases) if field.name not in ("stab", "region", "sightline")
}


def stab_case(random: np.random.Generator, gap: int, offset: int, number: int) -> StabCase:
    """Four portals across x, of which two are slits of a width; the rational twin says whether a line passes."""
    planes = np.cumsum(random.integers(50, 900, 4))
    low = random.integers(0, 400, (4, 2))
    high = low + random.integers(200, 900, (4, 2))
    for slit in random.choice(4, 2, replace=False):
        high[slit, slit % 2] = low[slit, slit % 2] + gap
    boxes = (
        np.stack([np.column_stack([planes, low]), np.column_stack([planes, high])], axis=1).astype(np.int64) + offset
    )
    signs = (1, *(int(s) for s in random.choice([-1, 1], 2)))
    verdict = stab(boxes, signs).verdict
    return StabCase(f"stab {number}", "open" if verdict is Verdict.VISIBLE else "none", signs, boxes, "")


def slit_case(random: np.random.Generator, gap: int, offset: int, visible: bool) -> RegionCase:
    """Two walls in one plane between cell and target: a slit of the width is left, or they overlap by as much."""
    near, far = int(random.integers(100, 900)), int(random.integers(100, 900))
    size, depth = (int(x) for x in random.integers(100, 600, 2))
    cell = [[0, 0, 0], [depth, size, size]]
    plane = depth + near
    target = [[plane + far, 0, 0], [plane + far + depth, size, size]]
    edge = int(random.integers(size // 4, 3 * size // 4))
    other = edge + gap if visible else edge - gap
    walls = [
        [[plane, -3 * size, -3 * size], [plane, edge, 4 * size]],
        [[plane, other, -3 * size], [plane, 4 * size, 4 * size]],
    ]
    return _region("slit" if visible else "overlap", visible, cell, target, walls, offset)


def thin_case(random: np.random.Generator, aspect: int, visible: bool) -> RegionCase:
    """A long, low wall half-way between a low cell and a low target: it covers both, or lacks a step."""
    size, near = int(random.integers(4, 12)), int(random.integers(20, 60))
    length = size * aspect
    cell, target = [[0, 0, 0], [size, size, size]], [[size + 2 * near, 0, 0], [2 * size + 2 * near, size, size]]
    top = size - 1 if visible else size
    wall = [[size + near, -length, 0], [size + near, size + length, top]]
    return _region("short" if visible else "cover", visible, cell, target, [wall], 0)


def _region(name: str, visible: bool, cell: Shape, target: Shape, walls: list[Shape], offset: int) -> RegionCase:
    def moved(shape: Shape) -> Shape:
        return [[int(c) + offset for c in point] for point in shape]

    expected = "visible" if visible else "hidden"
    return RegionCase(name, expected, moved(cell), moved(target), [moved(wall) for wall in walls], "")


def edge_case(random: np.random.Generator, distance: float, offset: int, visible: bool) -> SightlineCase:
    """A segment beside the edge of a triangle, on one side or on the other, by less than a grid step."""
    length, reach = (int(x) for x in random.integers(100, 900, 2))
    triangle = [[offset, offset, offset], [offset + length, offset, offset], [offset, offset - length, offset]]
    along = offset + int(random.integers(length // 4, length // 2))
    side = distance if visible else -distance
    start, end = ([along, offset + side, offset + z] for z in (-reach, reach))
    # What float64 makes of the place is the place.
    beyond = Fraction(float(start[1])) - offset
    return SightlineCase(
        "edge", "clear" if beyond > 0 else "graze" if beyond == 0 else "blocked", [start, end], -1, [triangle], ""
    )


def _row(knob: str, value: float, kernel: str, hard: HardCases, device: Device) -> Row:
    try:
        outcomes = [outcome for _, outcome in (_by_stab if kernel == "launch_stab" else KERNELS[kernel])(hard, device)]
    except InputError:
        return Row(knob, float(value), kernel, 0, 0, 0, True)
    withheld, wrong = (outcomes.count(kind) for kind in (Outcome.WITHHELD, Outcome.WRONG))
    return Row(knob, float(value), kernel, len(outcomes), withheld, wrong, not outcomes)


def _by_stab(hard: HardCases, device: Device) -> Iterator[tuple[str, Outcome]]:
    """As the hard cases do it, but without moving far cases to an origin of their own."""
    boxes, signs = np.stack([case.boxes for case in hard.stab]), np.array([case.signs for case in hard.stab])
    for case, verdict in zip(hard.stab, launch_stab(boxes, signs, device=device).verdict.tolist(), strict=True):
        right = (verdict == Verdict.VISIBLE) == (case.expected == "open")
        withheld = verdict == Verdict.UNKNOWN
        yield case.name, Outcome.WITHHELD if withheld else Outcome.RIGHT if right else Outcome.WRONG


def _by_float32(knob: str, value: float, cases: list[SightlineCase]) -> Row:
    """What rays of Embree say of the same segments; what float32 cannot tell apart is wrong one way or the other."""
    wrong = 0
    for case in cases:
        scene = embree_scene(np.array(case.triangles))
        start, end = np.array(case.segment, np.float32)
        hit = scene.run(start[None], (end - start)[None])[0] >= 0
        wrong += hit == (case.expected != "blocked")
    return Row(knob, float(value), FLOAT32, len(cases), 0, int(wrong), False)


def stability_table(rows: list[Row]) -> str:
    """One line per kernel and knob: where it is wrong, withholds, refuses."""
    found = []
    for knob in dict.fromkeys(row.knob for row in rows):
        for kernel in dict.fromkeys(row.kernel for row in rows if row.knob == knob):
            mine = [row for row in rows if (row.knob, row.kernel) == (knob, kernel)]
            asked = sum(row.cases for row in mine)
            withheld, wrong = (sum(getattr(row, name) for row in mine) for name in ("withheld", "wrong"))
            refused = [row.value for row in mine if row.refused]
            line = (knob, kernel, asked, f"{100 * withheld / max(1, asked):.1f} %", wrong)
            found.append((*line, f"from {min(refused):,.0f}" if refused else ""))
    return table(("made hard by", "kernel", "cases", "withheld", "wrong", "refused"), found)


def write_stability(rows: list[Row], folder: Path) -> None:
    """Write stability.json and stability.png into a folder.

    Raises:
        InputError: the folder cannot be written.
    """
    text = json.dumps([asdict(row) for row in rows], indent=1) + "\n"
    write_files(folder, lambda: {"stability.json": text.encode(), "stability.png": stability_plot(rows)})


def stability_plot(rows: list[Row]) -> bytes:
    """PNG: for each knob what is withheld (lines) and wrong (crosses), in percent of the cases."""
    from matplotlib.figure import Figure

    knobs = list(dict.fromkeys(row.knob for row in rows))
    kernels = sorted({row.kernel for row in rows}, key=lambda kernel: (kernel == FLOAT32, kernel))
    figure = Figure(figsize=(4.6 * len(knobs), 5.2), layout="constrained")
    figure.suptitle("Withheld (lines) and wrong (crosses) as numbers get hard; no kernel may be wrong", fontsize=12)
    for axes, knob in zip(np.atleast_1d(figure.subplots(1, len(knobs), sharey=True)), knobs, strict=True):
        for number, kernel in enumerate(kernels):
            mine = [row for row in rows if (row.knob, row.kernel) == (knob, kernel)]
            if mine:
                _draw(axes, mine, PALETTE[number % len(PALETTE)], MARKERS[number % len(MARKERS)], kernel)
        least = min((row.value for row in rows if row.knob == knob and row.value), default=1.0)
        axes.set_xscale("symlog", linthresh=least)
        axes.set(xlabel=knob, ylim=(-4, 104))
        axes.grid(True, which="major", alpha=0.3)
        if knob.startswith("offset"):
            axes.axvline(GRID_LIMIT * GRID_M, color="black", linestyle=":", linewidth=1)
            axes.text(GRID_LIMIT * GRID_M, 50, " limit of the grid", fontsize=8, rotation=90, va="center", ha="right")
    figure.axes[0].set_ylabel("cases [%]")
    handles: dict[str, object] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=4, fontsize=9, frameon=False)
    return png(figure)


def _draw(axes: object, rows: list[Row], colour: str, marker: str, label: str) -> None:
    """Lines of one kernel in one panel."""
    answered = [row for row in rows if not row.refused]
    xs = [row.value for row in answered]
    if label != FLOAT32:
        withheld = [100 * row.withheld / max(1, row.cases) for row in answered]
        axes.plot(xs, withheld, marker=marker, color=colour, linewidth=1.2, markersize=5, alpha=0.85, label=label)
    wrong = [(row.value, 100 * row.wrong / row.cases) for row in answered if row.wrong]
    style = {"color": colour, "marker": "x", "markersize": 8, "markeredgewidth": 2}
    if label == FLOAT32:
        axes.plot(
            xs, [100 * row.wrong / row.cases for row in answered], linestyle="--", label=f"wrong: {label}", **style
        )
    elif wrong:
        axes.plot(*zip(*wrong, strict=True), linestyle="", label=f"wrong: {label}", **style)
