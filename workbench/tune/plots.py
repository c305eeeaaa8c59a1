"""Pictures of a tuning: time against error, switches, frame times; and a page that holds them and the table."""

import base64
import html
import io
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

if TYPE_CHECKING:
    from .lod import Tuning

# Colours that colour-blind readers tell apart (Okabe and Ito).
COLOURS = ("#0072b2", "#56b4e9", "#d55e00", "#cc79a7", "#555555")
MARKERS = ("o", "s", "^", "D", "P")
# What loses less [%] is drawn here: a logarithmic axis has no zero.
FLOOR_PERCENT = 1.0e-5
STYLE = (
    "body{font:15px/1.5 sans-serif;max-width:75em;margin:2em auto;padding:0 1em}img{max-width:100%}"
    "table{border-collapse:collapse;font-size:13px}td,th{border:1px solid #ccc;padding:.2em .6em;text-align:right}"
)


def lod_plot(tuning: "Tuning", name: str) -> bytes:
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
    out = io.BytesIO()
    figure.savefig(out, dpi=110, format="png")
    return out.getvalue()


def _with(coherent: bool) -> str:
    return " with coherence" if coherent else " without coherence"


def _scatter(axes: Axes, tuning: "Tuning", methods: list[str], budget: float) -> None:
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


def _switches(axes: Axes, tuning: "Tuning", methods: list[str]) -> None:
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
    axes.set_ylabel("objects a frame that change level")
    axes.set_title("flicker: without coherence (hollow) and with (filled)", fontsize=10)


def _frame_times(axes: Axes, tuning: "Tuning") -> None:
    """Modelled frame times along the path."""
    for (name, times), colour in zip(tuning.modelled_ms.items(), ("#999999", COLOURS[0]), strict=False):
        axes.plot(times, color=colour, linewidth=1.3, label=name)
    target = tuning.budgets_ms[len(tuning.budgets_ms) // 2]
    axes.axhline(target, color=COLOURS[2], linestyle="--", linewidth=1, label=f"target {target:.3g} ms")
    axes.set(xlabel="frame of the path", ylabel="modelled frame time [ms]", ylim=(0, None))
    axes.set_title(f"frame time, {tuning.cost.renderer}", fontsize=10)
    axes.legend(fontsize=8, frameon=False)


def lod_page(tuning: "Tuning", name: str, picture: bytes) -> str:
    """HTML in one file: reason, picture, table, and how the costs were found."""
    head, rows = tuning.rows()
    cells = "".join(f"<th>{html.escape(text)}</th>" for text in head)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(text)}</td>" for text in row) + "</tr>" for row in rows)
    said = "".join(f"<p>{html.escape(text)}</p>" for text in (tuning.cost.line(), *tuning.notes))
    title = html.escape(f"Choosing levels of detail in {name}")
    image = base64.b64encode(picture).decode()
    return (
        f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>{STYLE}</style>'
        f"</head><body><h1>{title}</h1><p>{html.escape(tuning.reason)}</p>"
        f'<img alt="time against error" src="data:image/png;base64,{image}">'
        f"<table><tr>{cells}</tr>{body}</table>{said}</body></html>\n"
    )
