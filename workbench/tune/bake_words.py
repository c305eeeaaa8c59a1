"""What a tuning of a bake says: its table, the line that its file begins with, its picture and files."""

import statistics
from pathlib import Path

from ...data.plural import counted
from ..bake.settings import Settings
from ..summary import table
from .bake import BakeTuning, asked_settings
from .candidates import Candidate, front_plot, write_tune
from .choice import TIGHTER, Row, why_not

AXES = "seconds of a bake, about", "objects kept by a view cell [%]"
HEAD = ("setting", "x the default's time", "seconds", "view cells", "pairs kept: objects", "cells", "kept %")
HEAD += ("hidden wrongly", "")
# A tighter row is pointed out if it takes no more than so many times as long.
WORTH = 1.5


def tuning_text(found: BakeTuning) -> str:
    """Everything that is printed."""
    return "\n".join([table(HEAD, _rows(found)), "", *_notes(found), "", f"recommended: {says(found)}"])


def says(found: BakeTuning) -> str:
    """What the recommended settings do, beside the default's row, in a line."""
    asked = "" if found.base.method == Settings().method else f"Sets the method {found.base.method}, as asked. "
    return asked + _says(found)


def _says(found: BakeTuning) -> str:
    default, chosen = found.rows[0], found.chosen
    usual = f"{default.time:.3g} s, {_kept(default)}"
    where = f"{found.model}, {_tried(found)}"
    if chosen is default:
        method = f"method {found.base.method}"
        least = "faster and as tight, or tighter and as fast"
        none = f"nothing tried is {least}" if any(row.seconds for row in found.rows[1:]) else "nothing else was tried"
        return f"Keeps the default ({method}): {none}; it takes {usual} ({where})."
    change = f"Sets {chosen.name} in place of the default"
    if "method" in chosen.changes:
        change = f"Changes the method from {found.base.method} to {chosen.changes['method']} ({chosen.name})"
    ratio = f"{chosen.ratio:.2f} x the default's time ({_range(chosen.ratios)}, {counted(len(chosen.ratios), 'round')})"
    return f"{change}: {ratio}, {_kept(chosen)}; the default: {usual} ({where})."


def write_tuning(found: BakeTuning, folder: Path) -> Path:
    """Write tune-bake.json, .png and .html into a folder, made if need be; gives the path of the first.

    Raises:
        InputError: the folder cannot be written.
    """
    drawn = {id(row): Candidate(row.name, _kind(row), row.time, 100 * row.kept) for row in found.rows if _whole(row)}
    title = f"Settings of {found.model}: {_tried(found)}, {counted(found.objects, 'object')}"
    picture = front_plot(list(drawn.values()), drawn[id(found.chosen)], title, AXES)
    content = {
        "says": says(found),
        "settings": asked_settings(found.settings),
        "recommended": found.chosen.name,
        "default": _entry(found.rows[0]),
        "rows": [_entry(row) for row in found.rows[1:]],
        "view_cells": {"tried": found.tried, "all": found.cells},
    }
    return write_tune(folder, "bake", (title, HEAD, _rows(found), _notes(found)), picture, content)


def _rows(found: BakeTuning) -> list[tuple[str, ...]]:
    """The table, a row a setting."""
    out = []
    for row in found.rows:
        remark = "recommended" if row is found.chosen else why_not(row) if row.changes else ""
        times = kept = ()
        if row.seconds:
            more = "more than " if row.stopped else ""
            times = f"{more}{_median_range(row.ratios)}", f"{more}{row.time:.3g}"
        if _whole(row):
            cells = "-" if row.cell_pairs is None else f"{row.cell_pairs:,}"
            kept = f"{row.cells:,}", f"{row.pairs:,}", cells, f"{100 * row.kept:.2f}", f"{row.hidden:,}"
        out.append((row.name, *(times or ("-",) * 2), *(kept or ("-",) * 5), remark))
    return out


def _notes(found: BakeTuning) -> list[str]:
    notes = [
        "Times are of whole bakes, reading apart: median (least to most) of rounds in which every setting was measured "
        "beside the default. Kept: mean by volume of the default's view cells. Every row was tried with the sightlines "
        "of all rows, and with rays.",
    ]
    tighter = [row for row in found.rows[1:] if _whole(row) and row.tightness == TIGHTER and 1.0 < row.ratio <= WORTH]
    tighter = [row for row in tighter if not (row.hidden or row.unusable or row.uncovered)]
    if tighter:
        best = min(tighter, key=lambda row: row.kept)
        notes.append(f"If time matters less: {best.name}, {best.ratio:.2f} x the time, {_kept(best)}.")
    if found.wrong_hidden:
        notes.append(f"Hidden although seen: {found.wrong_hidden}. This is a bug: please report it.")
    return notes


def _whole(row: Row) -> bool:
    """Whether a row was measured to its end."""
    return row.pairs is not None


def _kind(row: Row) -> str:
    return row.name.split()[0] if row.changes else "default"


def _kept(row: Row) -> str:
    pairs = counted(row.pairs, "pair") + " of view cells and objects"
    return f"{pairs}, {100 * row.kept:.2f} % of the objects kept by a view cell"


def _tried(found: BakeTuning) -> str:
    every = counted(found.cells, "view cell")
    return every if found.tried == found.cells else f"{found.tried:,} of {every}"


def _range(values: list[float]) -> str:
    return f"{min(values):.2f} to {max(values):.2f}"


def _median_range(values: list[float]) -> str:
    return f"{statistics.median(values):.2f}" + (f" ({_range(values)})" if len(values) > 1 else "")


def _entry(row: Row) -> dict[str, object]:
    """A row as JSON has it; what was not measured is null."""
    whole = _whole(row)
    return {
        "name": row.name,
        "settings": row.changes,
        "seconds": [round(value, 3) for value in row.seconds],
        "ratios": [round(value, 4) for value in row.ratios],
        "stopped": row.stopped,
        "view_cells": row.cells if whole else None,
        "object_pairs": row.pairs,
        "cell_pairs": row.cell_pairs,
        "kept": round(row.kept, 6) if whole else None,
        "uncovered": round(row.uncovered, 6) if whole else None,
        "hidden_wrongly": row.hidden if whole else None,
        "not_recommended": why_not(row) if row.changes else "",
    }
