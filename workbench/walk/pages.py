"""A walk written down: walk.json, frames.csv, and as a page and a picture."""

import base64
import io
import json
import shutil
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv

from ...data.store.remote import is_remote
from ...data.version import __version__
from ..bake.place import alone
from ..files import SCRATCH, write_files
from ..pages import TEMPLATES, fill
from .tables import Table, arrival_table, notes, policies, tables, truth_table
from .tally import Walked


def default_out(place: str) -> Path:
    """Where a walk goes that was not told where: the database's name with .tour, beside it, or here if it is remote."""
    if is_remote(place):
        return Path(Path(place.rstrip("/")).name or "walk").with_suffix(".tour")
    folder = Path(place).resolve()
    return folder.with_name(f"{folder.stem}.tour")


def write_walk(walked: Walked, out: Path) -> list[str]:
    """Write a folder, each file whole or not at all; the picture only where matplotlib is.

    Returns:
        Names of its files.

    Raises:
        InputError: the folder cannot be written, or another walk is being written there.
    """
    made: dict[str, bytes] = {}

    def make() -> dict[str, bytes]:
        told = json.dumps(walk_json(walked), indent=1, ensure_ascii=False) + "\n"
        made["walk.json"], made["frames.csv"] = told.encode(), frames_csv(walked)
        picture = _picture(walked)
        if picture is not None:
            made["walk.png"] = picture
        image = "" if picture is None else base64.b64encode(picture).decode()
        page = fill(
            TEMPLATES, "walk.html", title=f"Walk through {Path(walked.place).name}",
            notes=notes(walked), tables=_all(walked), picture=image,
        )  # fmt: skip
        made["walk.html"] = page.encode()
        return made

    with alone(out, "walk"):
        # What a killed walk has left: nobody else writes there now.
        for left in out.glob(f"{SCRATCH}*"):
            shutil.rmtree(left, ignore_errors=True)
        write_files(out, make)
    return sorted(made)


def _all(walked: Walked) -> list[Table]:
    """What sums it up, then the papers' tables."""
    checked = [truth_table(walked), arrival_table(walked)] if walked.truths else []
    return [policies(walked), *checked, *tables(walked)[:-1]]


def _picture(walked: Walked) -> bytes | None:
    """The picture; None without matplotlib."""
    try:
        from .plot import walk_figure
    except ModuleNotFoundError:
        return None
    return walk_figure(walked)


def walk_json(walked: Walked) -> dict:
    """Settings, tables, notes and what checks found, for programs; times that were not measured are not in it."""
    return {
        "viewcell": __version__,
        "database": walked.place,
        "frames": len(walked.path),
        "index_bytes": walked.index_bytes,
        "settings": asdict(walked.settings),
        "cost": walked.model.cost,
        "tables": [{"title": one.title, "head": list(one.head), "rows": list(map(list, one.rows))} for one in
                   _all(walked)],
        "notes": notes(walked),
        "policies": {one.name: _sums(walked, one.columns) for one in walked.policies},
        "checked": [asdict(truth) | {"wrong": truth.wrong} for truth in walked.truths],
    }  # fmt: skip


def _measured(name: str) -> bool:
    """Whether a column has times of this machine."""
    return name in ("compute_s", "memory_s", "render_s", "late_s", "eye_s", "levels_s")


def _sums(walked: Walked, columns: dict[str, np.ndarray]) -> dict[str, dict[str, float]]:
    """Mean and most of each column."""
    known = {name: column for name, column in columns.items() if walked.settings.real_time or not _measured(name)}
    return {name: {"mean": float(column.mean()), "most": float(column.max())} for name, column in known.items()}


def frames_csv(walked: Walked) -> bytes:
    """A row for each frame: the path, which can be walked again, what was seen, and of each policy what was held."""
    path = walked.path
    columns = {"x": path.eyes[:, 0], "y": path.eyes[:, 1], "z": path.eyes[:, 2]}
    columns |= {"yaw": path.yaw_deg, "pitch": path.pitch_deg, "t": path.t}
    columns |= walked.shown
    for one in walked.policies:
        columns |= {f"{one.name}.{name}": column for name, column in one.columns.items()}
    kept = {
        name: column
        for name, column in columns.items()
        if walked.settings.real_time or not _measured(name.split(".")[-1])
    }
    out = io.BytesIO()
    pa.csv.write_csv(pa.table(kept), out)
    return out.getvalue()
