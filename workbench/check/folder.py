"""The folder of a check: every wrong-hidden pair with its sightline, every view cell's numbers; and its replay.

Metres (map units for a compiled map) in a frame that the manifest's `yaw_deg` and `origin` place; a sightline is
`origin_*` to `origin_* + direction_*`, as in a bake.
"""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ...data.errors import InputError
from ...data.ragged import starts_of
from ...data.scene import OPAQUE, Role
from ...data.store.bake_folder import WITNESS
from ...data.store.graph_folder import CELL_COLUMNS, numbers
from ...data.store.quake import axial_graph, read_prt
from ...data.store.scene_folder import FORMAT, new_folder, read_manifest, read_table
from ...data.version import __version__
from ...data.view_cells import as_graph
from ...verify.check_result import CheckResult
from ...verify.exact.sightline import Sightlines
from ...verify.exact.trace import contact_links
from ...verify.rays.adjudicate import Judge, Judgement
from ...verify.rays.windings import WindingLines
from ...verify.rays.witness import Witnesses, confirm_cells
from .run import open_model

WRONG = ("kind", "cell", "target", *WITNESS, "portals")


def write_check(result: CheckResult, folder: str | Path) -> None:
    """Write manifest.json, wrong_hidden.parquet and cells.parquet, all or nothing.

    Raises:
        InputError: the place is taken by something else, or not writable.
    """
    facts = {
        "format": FORMAT,
        "kind": "check",
        "version": __version__,
        "asked": result.asked,
        "unit": result.unit,
        "grid": result.grid_m,
        "origin": result.origin.tolist(),
        "yaw_deg": result.yaw_deg,
        "wrong_hidden": len(result.wrong),
        "confidence": result.confidence_line(),
        "rays": result.rays,
        "seconds": result.seconds,
        "notes": result.notes,
        "complete": True,
    }
    with new_folder(folder, "check", ("wrong_hidden", "cells")) as temporary:
        pq.write_table(_wrong_table(result), temporary / "wrong_hidden.parquet", compression="zstd")
        pq.write_table(_cells_table(result), temporary / "cells.parquet", compression="zstd")
        (temporary / "manifest.json").write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")


def _wrong_table(result: CheckResult) -> pa.Table:
    pairs, step = result.wrong, result.grid_m
    lines = np.array([np.concatenate([w.origin * step, w.end * step - w.origin * step]) for w in pairs]).reshape(-1, 6)
    names = [result.object_names[w.target] if w.kind == "object" else str(result.cell_ids[w.target]) for w in pairs]
    columns = {
        "kind": pa.array([w.kind for w in pairs], pa.string()),
        "cell": pa.array([w.cell for w in pairs], pa.int32()),
        "cell_id": pa.array([str(result.cell_ids[w.cell]) for w in pairs], pa.string()),
        "target": pa.array([w.target for w in pairs], pa.int32()),
        "target_name": pa.array(names, pa.string()),
        **{name: pa.array(lines[:, i]) for i, name in enumerate(WITNESS)},
        "margin": pa.array([w.margin * step if w.margin == w.margin else None for w in pairs], pa.float64()),
        "passes": pa.array([[result.object_names[k] for k, _ in w.nearest] for w in pairs], pa.list_(pa.string())),
        "clearances": pa.array([[d * step for _, d in w.nearest] for w in pairs], pa.list_(pa.float64())),
        "portals": pa.array([list(w.portals) for w in pairs], pa.list_(pa.int32())),
        "cell_text": pa.array([result.cell_text(w.cell) for w in pairs], pa.string()),
    }
    return pa.table(columns)


def _cells_table(result: CheckResult) -> pa.Table:
    corners = result.boxes.reshape(-1, 6) * result.grid_m
    columns = {"cell_id": pa.array([str(value) for value in result.cell_ids], pa.string())}
    columns |= {name: pa.array(corners[:, i]) for i, name in enumerate(CELL_COLUMNS[1:])}
    checked = np.zeros(len(result.cell_ids), bool)
    checked[result.sources] = True
    columns["checked"] = pa.array(checked)
    for kind in result.claimed:
        for name, values in zip(("claimed", "seen", "wrong_hidden"), result.by_cell(kind), strict=True):
            column = np.zeros(len(checked), np.int64)
            column[result.sources] = values
            columns[f"{name}_{kind}s"] = pa.array(column)
    if len(result.uniform):
        for name, values in (("random_rays", result.uniform), ("hole_sr", result.confidence.holes_sr)):
            column = np.zeros(len(checked), values.dtype)
            column[result.sources] = values
            columns[name] = pa.array(column)
    return pa.table(columns)


def replay(folder: str | Path, model: str | Path | None = None) -> tuple[int, list[str]]:
    """Judge every sightline of a check folder again.

    Args:
        folder: that `write_check` wrote.
        model: to judge by; by default the one that was checked.

    Returns:
        How many sightlines are still clear, and a line about each and about all.

    Raises:
        InputError: no check folder, or its model is gone or no longer has what the sightlines name.
    """
    folder = Path(folder)
    facts = read_manifest(folder, kind="check")
    rows = read_table(folder / "wrong_hidden.parquet", WRONG)
    cells = numbers(read_table(folder / "cells.parquet", CELL_COLUMNS), CELL_COLUMNS[1:], folder / "cells.parquet")
    asked = facts["asked"]
    path = model or asked.get("model")
    if path is None:
        raise InputError(f"{folder}: expected a model to judge by, found none named there")
    boxes = np.round(cells.reshape(-1, 2, 3) / facts["grid"]).astype(np.int64)
    columns = numbers(rows, WITNESS, folder / "wrong_hidden.parquet")
    origins, ends = columns[:, :3] / facts["grid"], (columns[:, :3] + columns[:, 3:]) / facts["grid"]
    if asked.get("judge") == "triangles":
        clear = _by_triangles(Path(path), asked, facts, rows, boxes, origins, ends)
    elif asked.get("judge") == "portals":
        clear = _by_portals(Path(path), rows, origins, ends)
    else:
        clear = _by_windings(Path(path), rows, origins, ends)
    lines = []
    for row, still in zip(rows.to_pylist(), clear, strict=True):
        state = "visible" if still else "no longer visible"
        # Checks of before 0.2 do not say in which room a cell lies.
        named = row.get("cell_text", row["cell_id"])
        lines.append(f"{state}: cell {named}, {row['kind']} {row['target']} {row['target_name']!r}")
    return int(clear.sum()), [*lines, f"{int(clear.sum()):,} of {len(clear):,} sightlines are clear"]


def _by_triangles(
    model: Path, asked: dict, facts: dict, rows: pa.Table, boxes: np.ndarray, origins: np.ndarray, ends: np.ndarray
) -> np.ndarray:
    """Which sightlines the triangles of a model leave clear, shape (n,), bool."""
    # Checks of before 0.2 name three options of `read` beside the others.
    before = {name: asked[name] for name in ("up", "unit", "doors") if asked.get(name)}
    opened = open_model(model, asked.get("reading", before))
    scene = opened[0] if isinstance(opened, tuple) else None
    if scene is None or not np.array_equal(scene.origin, facts["origin"]) or scene.grid_m != facts["grid"]:
        raise InputError(f"{model}: expected a model at {facts['origin']} m, found another")
    opaque, glass = scene.triangles(*OPAQUE), scene.triangles(Role.TRANSPARENT)
    judge = Judge(as_graph(boxes), Sightlines(*opaque), Sightlines(*glass), contact_links(boxes))
    clear = np.zeros(rows.num_rows, bool)
    kinds, sources, targets = (np.array(rows[name].to_pylist()) for name in ("kind", "cell", "target"))
    for kind, count in (("object", len(scene.objects)), ("cell", len(boxes))):
        part = np.flatnonzero(kinds == kind)
        if not len(part):
            continue
        if targets[part].max() >= count or sources[part].max() >= len(boxes):
            raise InputError(f"{model}: expected at least {targets[part].max() + 1} {kind}s, found {count}")
        found = judge.judge_all(kind, sources[part], targets[part], origins[part], ends[part])
        clear[part] = found == Judgement.VISIBLE
    return clear


def _by_portals(model: Path, rows: pa.Table, origins: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Which sightlines pass the portals of a cell graph, or of an axial map."""
    if model.suffix.lower() == ".prt":
        graph = axial_graph(read_prt(model), str(model))
    else:
        graph = open_model(model, {})
        if isinstance(graph, tuple):
            raise InputError(f"{model}: expected a cell graph, found a model with triangles")
    lists = rows["portals"].to_pylist()
    starts = starts_of([len(part) for part in lists])
    portals = np.array([k for part in lists for k in part], np.int64)
    sources, targets = (rows[name].to_numpy().astype(np.int64) for name in ("cell", "target"))
    if rows.num_rows and max(sources.max(), targets.max()) >= graph.cell_count:
        raise InputError(f"{model}: expected at least {max(sources.max(), targets.max()) + 1} cells, found fewer")
    return confirm_cells(Witnesses(sources, targets, origins, ends, portals, starts), graph, None) == 0


def _by_windings(model: Path, rows: pa.Table, origins: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Which sightlines pass the windings of an oblique map."""
    windings = WindingLines(read_prt(model))
    pairs = zip(rows["cell"].to_pylist(), rows["target"].to_pylist(), origins, ends, strict=True)
    found = [windings.path(leaf, target, origin, end - origin) is not None for leaf, target, origin, end in pairs]
    return np.array(found, bool)
