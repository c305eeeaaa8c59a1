"""What a tuning leaves: candidates with time and error, their Pareto front, and the files that show and hold them."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ...data.version import __version__
from ..files import write_files
from ..labels import place_labels
from ..pages import COLOURS, MARKERS, html_page, pareto_front, png

if TYPE_CHECKING:
    from ...data.store.bake_folder import BakeFolder


@dataclass(frozen=True)
class Candidate:
    """A setting and how it did.

    Attributes:
        name: in words.
        kind: drawn in one colour.
        time: what is drawn to the right.
        error: what is drawn upwards; at most as good as it says.
        numbers: other columns.
        settings: of `bake`, or None if it cannot be asked to do so.
    """

    name: str
    kind: str
    time: float
    error: float
    numbers: dict[str, object] = field(default_factory=dict)
    settings: dict[str, object] | None = None


def default_out(bake: "BakeFolder") -> Path:
    """Where a tuning goes that was not told where: named after the bake, beside it."""
    folder = Path(bake.folder).resolve()
    return folder.with_name(f"{folder.name}.tune")


def front_of(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Their Pareto front."""
    return pareto_front(candidates, lambda c: (c.time, c.error))


def front_plot(candidates: Sequence[Candidate], chosen: Candidate | None, title: str, axes: tuple[str, str]) -> bytes:
    """PNG: error against time, one colour per kind, the Pareto front as a line, the chosen one in a ring."""
    figure = Figure(figsize=(11.5, 6.0), layout="constrained")
    ax = figure.subplots()
    kinds = list(dict.fromkeys(c.kind for c in candidates))
    for number, kind in enumerate(kinds):
        mine = [c for c in candidates if c.kind == kind]
        style = {"color": COLOURS[number % len(COLOURS)], "marker": MARKERS[number // len(COLOURS) % len(MARKERS)]}
        ax.plot([c.time for c in mine], [c.error for c in mine], linestyle="", markersize=8, label=kind, **style)
    front = front_of(candidates)
    ax.step([c.time for c in front], [c.error for c in front], where="post", color="black", linewidth=1, zorder=0)
    ax.plot([], [], color="black", linewidth=1, label="Pareto front")
    if chosen is not None:
        ring = {"marker": "o", "markersize": 17, "fillstyle": "none", "color": "black", "linestyle": ""}
        ax.plot([chosen.time], [chosen.error], label="recommended", **ring)
    ax.set(xscale="log", xlabel=axes[0], ylabel=axes[1])
    ax.grid(True, which="major", alpha=0.3)
    ax.set_title(title, fontsize=11)
    figure.legend(loc="outside lower center", ncols=min(5, len(kinds) + 2), fontsize=8, frameon=False)
    # Beside the picture, where no point can lie under it.
    listed = [Line2D([], [], linestyle="", label=f"{number}  {c.name}") for number, c in enumerate(front, start=1)]
    figure.legend(handles=listed, loc="outside right upper", fontsize=8, frameon=False, handlelength=0)
    place_labels(ax, [(c.time, c.error, str(number)) for number, c in enumerate(front, start=1)], weight="bold")
    return png(figure)


def write_tune(
    folder: Path,
    tuned: str,
    page: tuple[str, tuple[str, ...], list[tuple[str, ...]], Sequence[str]],
    picture: bytes,
    content: dict[str, object],
) -> Path:
    """Write tune-X.json, .png and .html; each file appears whole or not at all.

    Args:
        folder: made if need be.
        tuned: X, what was tuned.
        page: title, head and rows of the table, and paragraphs; one of several lines is shown as it is.
        picture: PNG.
        content: of the JSON file; what it `says` stands on its first line.

    Returns:
        Path of the JSON file, which `viewcell bake --settings` takes.

    Raises:
        InputError: the folder cannot be written.
    """
    title, head, rows, notes = page
    says = str(content["says"])
    text = json.dumps({"says": says, "tuned": tuned, "viewcell": __version__} | content, indent=1, ensure_ascii=False)
    files = {
        f"tune-{tuned}.png": picture,
        f"tune-{tuned}.html": html_page(title, picture, head, rows, notes, says).encode(),
        # Whoever opens the file reads first what it does.
        f"tune-{tuned}.json": (text.replace("{\n ", "{", 1) + "\n").encode(),
    }
    write_files(folder, lambda: files)
    return folder / f"tune-{tuned}.json"
