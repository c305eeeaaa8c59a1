"""Curves for people: a table, and a picture."""

import json
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..files import write_files
from ..pages import COLOURS, MARKERS, png
from ..summary import table
from .series import LEVELS, SAMPLING, Curves, Point

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
            name = f"{one.method}, {one.knob}" + (" *" if point in front else "")
            rows.append((name, f"{point.value:g}", seconds, error, point.wrong_hidden))
    head = (
        f"{curves.scene} (* none is both faster and tighter)",
        "knob",
        "seconds",
        "potential / seen",
        "hidden wrongly",
    )
    return table(head, rows)


def curves_plot(curves: Curves) -> bytes:
    """PNG: time against overestimate with the Pareto front, what sampling hides, and triangles against pixels."""
    sampled, drawn = ([one for one in curves.series if one.method == name] for name in (SAMPLING, LEVELS))
    figure = Figure(figsize=(15 if drawn else 12, 6.2), layout="constrained")
    figure.suptitle(f"Time against error. {curves.scene}", fontsize=12)
    panels = figure.subplots(1, 3 if drawn else 2, width_ratios=[2, 1, 1] if drawn else [2, 1])
    _draw_safe(panels[0], curves)
    for one in sampled:
        hidden = [100 * p.wrong_hidden / curves.pairs for p in one.points]
        panels[1].plot([p.value for p in one.points], hidden, "X-", color=COLOURS[3])
        for p, y in zip(one.points, hidden, strict=True):
            panels[1].annotate(f"{p.seconds:.1f} s", (p.value, y), (5, 5), textcoords="offset points", fontsize=8)
        panels[1].set(xscale="log", xlabel=one.knob, ylabel="seen pairs that it hides [%]", ylim=(0, None))
    panels[1].set_title("sampling alone is not safe", fontsize=10)
    panels[1].margins(x=0.15)
    for one in drawn:
        panels[2].plot([p.value for p in one.points], [100 * p.error for p in one.points], "o-", color=COLOURS[0])
        panels[2].set(xscale="log", xlabel="deviation allowed on the image [pixels]", ylabel="triangles drawn [%]")
        panels[2].set_title("levels of detail, 1920 x 1080", fontsize=10)
        panels[2].set_ylim(0, None)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower left", ncols=4, fontsize=9, frameon=False)
    for axes in panels:
        axes.grid(True, which="major", alpha=0.3)
    return png(figure)


def _draw_safe(axes: Axes, curves: Curves) -> None:
    """Methods that hide nothing visible: one colour per method, one marker per knob."""
    methods = list(dict.fromkeys(one.method for one in curves.safe))
    for number, one in enumerate(curves.safe):
        colour, marker = COLOURS[methods.index(one.method)], MARKERS[number % len(MARKERS)]
        label = one.method if one.knob == "no knob" else f"{one.method}: {one.knob}"
        points = sorted(one.points, key=lambda p: p.value)
        xs, ys = [p.seconds for p in points], [_above(p) for p in points]
        axes.plot(xs, ys, marker=marker, color=colour, linewidth=1, alpha=0.85, label=label)
        if len(points) > 1:
            for p in points:
                axes.annotate(f"{p.value:g}", (p.seconds, _above(p)), (5, 4), textcoords="offset points", fontsize=7)
    front = curves.front
    xs, ys = [p.seconds for p in front], [_above(p) for p in front]
    ring = {"marker": "o", "markersize": 12, "fillstyle": "none", "color": "black", "linewidth": 2}
    axes.step(xs, ys, where="post", label="Pareto front", **ring)
    axes.set(xscale="log", yscale="log", xlabel="seconds of visibility", ylabel="overestimate: potential / seen - 1")
    axes.set_title("nothing visible is hidden", fontsize=10)


def _above(point: Point) -> float:
    """Overestimate beyond 1, for a logarithmic axis."""
    return max(point.error - 1, EXACT)
