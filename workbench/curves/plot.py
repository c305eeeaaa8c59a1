"""Curves for people: a table, and a picture."""

import json
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..files import write_files
from ..labels import Label, place_labels
from ..pages import COLOURS, MARKERS, png
from ..summary import table
from .series import LEVELS, SAMPLING, Curves, Point, Series

# Drawn instead of 0.
EXACT = 1e-4


def write_curves(curves: Curves, folder: Path) -> None:
    """Write curves.json and curves.png into a folder, both or none.

    Raises:
        InputError: the folder cannot be written.
    """
    text = json.dumps(curves.content(), indent=1) + "\n"
    write_files(folder, lambda: {"curves.png": curves_plot(curves), "curves.json": text.encode()})


def curve_lines(curves: Curves) -> str:
    """All points for people, those of the Pareto front marked."""
    front = curves.front
    rows = []
    for one in curves.series:
        for point in one.points:
            error = f"{100 * point.error:.1f} % drawn" if one.method == LEVELS else f"{point.error:.3f}"
            seconds = "" if np.isnan(point.seconds) else f"{point.seconds:.3f}"
            mark = " *" if any(point is other for other in front) else " (other view cells)" if one.apart else ""
            rows.append((f"{one.method}, {one.knob}{mark}", f"{point.value:g}", seconds, error, point.wrong_hidden))
    head = (
        f"{curves.scene} (* none of the same view cells is both faster and tighter)",
        "knob",
        "seconds",
        "potential / seen",
        "hidden wrongly",
    )
    return table(head, rows)


def curves_plot(curves: Curves) -> bytes:
    """PNG, each part in a panel, as far as there is any.

    Time against overestimate with the Pareto front; the same of other view cells, which is no part of that front; what
    sampling hides; triangles against pixels.
    """
    sampled, drawn = ([one for one in curves.series if one.method == name] for name in (SAMPLING, LEVELS))
    apart = [one for one in curves.safe if one.apart]
    shown = [True, bool(apart), bool(sampled), bool(drawn)]
    widths = [width for width, wanted in zip((5, 3, 2.5, 2.5), shown, strict=True) if wanted]
    figure = Figure(figsize=(1.25 * sum(widths) + 1.0, 6.4), layout="constrained")
    figure.suptitle(f"Time against error. {curves.scene}", fontsize=12)
    panels = iter(np.atleast_1d(figure.subplots(1, len(widths), width_ratios=widths)))
    methods = list(dict.fromkeys(one.method for one in curves.safe))
    written = [_draw_safe(next(panels), curves, methods)]
    figure.legend(loc="outside lower left", ncols=4, fontsize=9, frameon=False)
    for draw, series in (
        (partial(_draw_apart, methods=methods), apart),
        (_draw_sampled, sampled),
        (_draw_levels, drawn),
    ):
        if series:
            written.append(draw(next(panels), series, curves))
    for axes in figure.axes:
        axes.grid(True, which="major", alpha=0.3)
    for axes, labels in zip(figure.axes, written, strict=True):
        place_labels(axes, labels)
    return png(figure)


def _draw_safe(axes: Axes, curves: Curves, methods: list[str]) -> list[Label]:
    """Methods that hide nothing visible, of the same view cells, and their front; gives what is to be written."""
    labels = _draw_series(axes, curves.compared, methods)
    front = curves.front
    xs, ys = [p.seconds for p in front], [_above(p) for p in front]
    ring = {"marker": "o", "markersize": 12, "fillstyle": "none", "color": "black", "linewidth": 2}
    axes.step(xs, ys, where="post", label="Pareto front of this panel", **ring)
    axes.set(xscale="log", yscale="log", xlabel="seconds of visibility", ylabel="overestimate: potential / seen - 1")
    axes.set_title("the same view cells: nothing visible is hidden", fontsize=10)
    return labels


def _draw_apart(axes: Axes, series: list[Series], curves: Curves, methods: list[str]) -> list[Label]:
    """The same of other view cells, smaller or more: each line is to be read by itself."""
    labels = _draw_series(axes, series, methods, first=len(curves.compared))
    axes.set(xscale="log", yscale="log", xlabel="seconds of visibility")
    axes.set_title("other view cells: not to be compared\nwith those on the left", fontsize=10)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), fontsize=9, frameon=False)
    return labels


def _draw_series(axes: Axes, series: list[Series], methods: list[str], first: int = 0) -> list[Label]:
    """One colour per method, one marker per knob; the knob's values are to be written."""
    labels = []
    for number, one in enumerate(series, start=first):
        colour, marker = COLOURS[methods.index(one.method) % len(COLOURS)], MARKERS[number % len(MARKERS)]
        label = one.method if one.knob == "no knob" else f"{one.method}: {one.knob}"
        points = sorted(one.points, key=lambda p: p.value)
        xs, ys = [p.seconds for p in points], [_above(p) for p in points]
        axes.plot(xs, ys, marker=marker, color=colour, linewidth=1, alpha=0.85, label=label)
        if len(points) > 1:
            labels += [(x, y, f"{p.value:g}") for x, y, p in zip(xs, ys, points, strict=True)]
    return labels


def _draw_sampled(axes: Axes, series: list[Series], curves: Curves) -> list[Label]:
    """What rays alone hide; seconds are to be written."""
    labels = []
    for one in series:
        hidden = [100 * p.wrong_hidden / max(1, curves.pairs) for p in one.points]
        axes.plot([p.value for p in one.points], hidden, "X-", color=COLOURS[3])
        labels += [(p.value, y, f"{p.seconds:.1f} s") for p, y in zip(one.points, hidden, strict=True)]
        axes.set(xscale="log", xlabel=one.knob, ylabel="seen pairs that it hides [%]", ylim=(0, None))
    axes.set_title("sampling alone is not safe", fontsize=10)
    axes.margins(x=0.15)
    return labels


def _draw_levels(axes: Axes, series: list[Series], _curves: Curves) -> list[Label]:
    """Triangles against pixels."""
    for one in series:
        axes.plot([p.value for p in one.points], [100 * p.error for p in one.points], "o-", color=COLOURS[0])
    axes.set(
        xscale="log", xlabel="deviation allowed on the image [pixels]", ylabel="triangles drawn [%]", ylim=(0, None)
    )
    axes.set_title("levels of detail, 1920 x 1080", fontsize=10)
    return []


def _above(point: Point) -> float:
    """Overestimate beyond 1, for a logarithmic axis."""
    return max(point.error - 1, EXACT)
