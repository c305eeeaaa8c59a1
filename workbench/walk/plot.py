"""Pictures of a walk: frame time, bytes held and read, levels skipped and objects missing along the path."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..pages import COLOURS, png
from .tally import Walked

# Frames that a point of a long path stands for, so that lines stay lines.
POINTS = 600


def walk_figure(walked: Walked) -> bytes:
    """Five pictures, one above the other, as a PNG."""
    figure = Figure(figsize=(11.0, 12.5), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(5, 1, sharex=True)
    times, held, read, skipped, missing = panels
    seconds = walked.path.t - walked.path.t[0]
    _frame_times(times, walked, seconds)
    for number, one in enumerate(walked.policies):
        colour, columns = COLOURS[number % len(COLOURS)], one.columns
        _most(held, seconds, columns["claimed"] / 1e6, colour, one.name)
        _most(read, seconds, np.cumsum(columns["read_bytes"]) / 1e6, colour)
        _most(skipped, seconds, columns["skipped"], colour)
        _most(missing, seconds, columns["missing"], colour)
    limit = walked.settings.cache_bytes / 1e6
    held.axhline(limit, color="#777777", linestyle="--", linewidth=1, label=f"cache, {limit:g} MB")
    held.set(ylabel="MB", ylim=(0, None))
    read.set(ylabel="MB", ylim=(0, None))
    skipped.set(ylabel="levels", ylim=(0, None))
    missing.set(ylabel="objects", xlabel="time of the walk [s]", ylim=(0, None))
    titles = (
        *("time of a frame", "in memory or asked for", "read so far", "levels between chosen and drawn ones, a frame"),
        "objects of which no level was there, a frame",
    )
    for axes, title in zip(panels, titles, strict=True):
        axes.set_title(title, fontsize=10, loc="left")
        axes.spines[["top", "right"]].set_visible(False)
        axes.margins(x=0)
    for axes in (times, held):
        # Beside the title: over the lines there is no room.
        anchor = {"loc": "lower right", "bbox_to_anchor": (1.0, 0.98), "borderaxespad": 0.0}
        axes.legend(fontsize=8, frameon=False, ncols=6, **anchor)
    return png(figure)


def _frame_times(axes: Axes, walked: Walked, seconds: np.ndarray) -> None:
    """Times of frames, modelled or measured, against the target."""
    settings, shown = walked.settings, walked.shown
    _most(axes, seconds, shown["finest_ms"], "#bbbbbb", "all at the finest levels, modelled")
    _most(axes, seconds, shown["chosen_ms"], "#333333", "levels chosen, modelled")
    if settings.real_time:
        for number, one in enumerate(walked.policies):
            measured = 1e3 * np.maximum(one.columns["compute_s"], one.columns["render_s"])
            _most(axes, seconds, measured, COLOURS[number % len(COLOURS)], f"{one.name}, measured")
    axes.axhline(
        settings.target_ms, color="#777777", linestyle="--", linewidth=1, label=f"target, {settings.target_ms:g} ms"
    )
    axes.set(ylabel="ms", ylim=(0, None))


def _most(axes: Axes, seconds: np.ndarray, values: np.ndarray, colour: str, label: str | None = None) -> None:
    """A line through the most of every few frames: peaks are what matters, and would vanish in means."""
    step = max(1, len(values) // POINTS)
    starts = np.arange(0, len(values), step)
    axes.plot(seconds[starts], np.maximum.reduceat(values, starts), color=colour, linewidth=1.2, label=label)
