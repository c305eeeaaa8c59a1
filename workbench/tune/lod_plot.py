"""Picture of a tuning of levels: time against error, switches, frame times."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..pages import COLOURS, MARKERS, png
from .outcomes import Tuning

# What loses less [%] is drawn here: a logarithmic axis has no zero.
FLOOR_PERCENT = 1.0e-5


def lod_plot(tuning: Tuning, name: str) -> bytes:
    """PNG: for each budget time against error; switches of all settings; frame times along the path."""
    count = len(tuning.budgets_ms)
    figure = Figure(figsize=(max(11.0, 4.4 * count), 9.0), layout="constrained")
    figure.suptitle(f"Choosing levels of detail in {name}: {tuning.best}{_with(tuning.best_coherent)} is recommended")
    top, bottom = figure.subfigures(2, 1)
    methods = list(dict.fromkeys(outcome.method for outcome in tuning.outcomes))
    panels = np.atleast_1d(top.subplots(1, count, sharex=True, sharey=True))
    for axes, budget in zip(panels, tuning.budgets_ms, strict=True):
        _scatter(axes, tuning, methods, budget)
    panels[0].set_ylabel("value lost against the certified bound [%],\nmean, and up to the worst frame")
    kinds = [
        Line2D([], [], marker=MARKERS[k], color=COLOURS[k], linestyle="", label=method)
        for k, method in enumerate(methods)
    ]
    kinds += [
        Line2D([], [], marker="o", color="black", linestyle="", label="with coherence"),
        Line2D([], [], marker="o", color="black", fillstyle="none", linestyle="", label="without"),
    ]
    top.legend(handles=kinds, loc="outside lower center", ncols=len(kinds), fontsize=8, frameon=False)
    left, right = bottom.subplots(1, 2)
    _switches(left, tuning, methods)
    _frame_times(right, tuning)
    return png(figure)


def _with(coherent: bool) -> str:
    return " with coherence" if coherent else " without coherence"


def _scatter(axes: Axes, tuning: Tuning, methods: list[str], budget: float) -> None:
    for o in tuning.outcomes:
        if o.budget_ms == budget:
            k = methods.index(o.method)
            mean, worst = (max(100 * x, FLOOR_PERCENT) for x in (o.lost_mean, o.lost_most))
            axes.plot([o.choose_ms] * 2, [mean, worst], color=COLOURS[k], linewidth=1, alpha=0.6)
            fill = "full" if o.coherent else "none"
            axes.plot(o.choose_ms, mean, MARKERS[k], color=COLOURS[k], fillstyle=fill, markersize=8)
    axes.set(xscale="log", yscale="log", xlabel="time to choose a frame's levels [ms], median")
    axes.set_title(f"frame time {budget:.3g} ms", fontsize=10)
    axes.grid(True, which="major", alpha=0.3)


def _switches(axes: Axes, tuning: Tuning, methods: list[str]) -> None:
    """Bars by method, means over the budgets."""
    shown = [m for m in methods if any(o.method == m and o.coherent for o in tuning.outcomes)]
    for shift, coherent in ((-0.2, False), (0.2, True)):
        mean = [
            np.mean([o.switches for o in tuning.outcomes if o.method == m and o.coherent == coherent]) for m in shown
        ]
        colours = [COLOURS[methods.index(m)] for m in shown]
        face = colours if coherent else "none"
        bars = axes.bar(np.arange(len(shown)) + shift, mean, 0.36, facecolor=face, edgecolor=colours, linewidth=1.5)
        axes.bar_label(bars, fmt="%.1f", fontsize=8)
    axes.set_xticks(np.arange(len(shown)), [m.replace(", ", ",\n").replace(" greedy", "\ngreedy") for m in shown])
    axes.set_ylabel("objects per frame that change level")
    axes.set_title("flicker: without coherence (hollow) and with (filled)", fontsize=10)


def _frame_times(axes: Axes, tuning: Tuning) -> None:
    """Modelled frame times along the path."""
    for (name, times), colour in zip(tuning.modelled_ms.items(), ("#999999", COLOURS[0]), strict=False):
        axes.plot(times, color=colour, linewidth=1.3, label=name)
    target = tuning.budgets_ms[len(tuning.budgets_ms) // 2]
    axes.axhline(target, color=COLOURS[1], linestyle="--", linewidth=1, label=f"target {target:.3g} ms")
    axes.set(xlabel="frame of the path", ylabel="modelled frame time [ms]", ylim=(0, None))
    axes.set_title(f"frame time, {tuning.cost.renderer}", fontsize=10)
    axes.legend(fontsize=8, frameon=False)
