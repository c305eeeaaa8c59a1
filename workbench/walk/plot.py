"""Pictures of a walk: frame time, bytes held, reads and levels skipped along the path."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..pages import COLOURS, png
from .tally import Walked

# Frames that a point of a long path stands for, so that lines stay lines.
POINTS = 600


def walk_figure(walked: Walked) -> bytes:
    """Four pictures, one above the other, as a PNG."""
    figure = Figure(figsize=(11.0, 11.0), layout="constrained")
    FigureCanvasAgg(figure)
    times, held, reads, skipped = figure.subplots(4, 1, sharex=True)
    seconds = walked.path.t - walked.path.t[0]
    _frame_times(times, walked, seconds)
    limit = walked.settings.cache_bytes / 1e6
    held.axhline(limit, color="#777777", linestyle="--", linewidth=1, label=f"cache, {limit:g} MB")
    for number, one in enumerate(walked.policies):
        colour, columns = COLOURS[number % len(COLOURS)], one.columns
        _most(held, seconds, columns["claimed"] / 1e6, colour, one.name)
        _most(reads, seconds, columns["read_bytes"] / 1e6, colour, one.name)
        _most(skipped, seconds, columns["skipped"], colour, f"{one.name}, levels skipped")
        missing = np.flatnonzero(columns["missing"])
        if len(missing):
            label = f"{one.name}, objects missing"
            skipped.plot(seconds[missing], columns["missing"][missing], ".", color=colour, markersize=4, label=label)
    held.set(ylabel="MB held or asked for", ylim=(0, None))
    reads.set(ylabel="MB asked for in a frame", ylim=(0, None))
    skipped.set(ylabel="levels, objects", xlabel="time of the walk [s]", ylim=(0, None))
    titles = ("time of a frame", "memory", "reads", "what was not drawn as chosen")
    for axes, title in zip((times, held, reads, skipped), titles, strict=True):
        axes.set_title(title, fontsize=10, loc="left")
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(fontsize=8, frameon=False, loc="upper right", ncols=3)
        axes.margins(x=0)
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
    axes.axhline(settings.target_ms, color="#777777", linestyle="--", linewidth=1, label=f"{settings.target_ms:g} ms")
    axes.set(ylabel="ms", ylim=(0, None))


def _most(axes: Axes, seconds: np.ndarray, values: np.ndarray, colour: str, label: str) -> None:
    """A line through the most of every few frames: peaks are what matters, and would vanish in means."""
    step = max(1, len(values) // POINTS)
    starts = np.arange(0, len(values), step)
    axes.plot(seconds[starts], np.maximum.reduceat(values, starts), color=colour, linewidth=1.2, label=label)
