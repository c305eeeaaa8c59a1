"""One HTML page of a whole bake, read and clicked through without a network: plans, every view cell's set, numbers.

The page holds one JSON document; its large arrays are little-endian, compressed with gzip and written in base64. Sets
are exact: for each view cell the rows of the bake's tables, targets as differences. What is only drawn is rounded:
cut surfaces to DRAWN_STEPS grid steps and more if there are too many, sightlines to a 65,535th of the model's extent.
"""

import base64
import gzip
import json
from importlib.resources import files
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pyarrow as pa
from markupsafe import Markup

from ...data.carving import find_faces
from ...data.ragged import starts_of
from ...data.scene import Role
from ...data.version import __version__
from ...verify.findings import count_pairs
from ...verify.rays.witness import read_witnesses
from ..bake.worth import told_worth
from ..pages import fill
from ..summary import face_rows, kept_rows
from .modules import join_modules
from .plans import Storey, find_storeys, plan_of, section_lines

if TYPE_CHECKING:
    from ...data.store.bake_folder import BakeFolder
    from ..curves.series import Curves

# Cut surfaces are drawn to about 8 mm, coarser only where a model has more segments than the page should hold.
DRAWN_STEPS = 8
SEGMENTS_MOST = 150_000
# Sightlines and crossed portals that the page holds at most; the smallest targets of a cell go without first.
SIGHTLINES_MOST = 250_000
CROSSINGS_MOST = 2_500_000
SKIPPED_MOST = 200
ROLES = (Role.OCCLUDER, Role.DETAIL, Role.TRANSPARENT)
UNKNOWN, SIGHTLINE, SEEN = 0, 1, 2


class Rows(NamedTuple):
    """Rows of one of the bake's tables, by source, then target.

    Attributes:
        starts: rows of cell c are starts[c] to starts[c + 1], shape (cells + 1,), int64.
        targets: shape (n,), int64.
        codes: UNKNOWN; SIGHTLINE where the page has it; SEEN where only the bake has it; shape (n,), uint8.
        lines: of the rows with SIGHTLINE, both ends [grid steps], shape (k, 2, 3), float64.
        crossings: how many portals each of these passes, shape (k,), int64.
        portals: which, one line after the other.
    """

    starts: np.ndarray
    targets: np.ndarray
    codes: np.ndarray
    lines: np.ndarray
    crossings: np.ndarray
    portals: np.ndarray


def page(
    bake: "BakeFolder",
    title: str,
    curves: "Curves | None" = None,
    told: tuple[dict | None, list[str]] | None = None,
    viewer: str | None = None,
) -> str:
    """The page, complete in itself.

    Args:
        bake: of a model with portals, of a bare cell graph, or of view cells that see objects only.
        title: the model's name.
        curves: of time against error, if there are any.
        told: as from `told_worth`, if it is known already.
        viewer: where a view of the bake is, from the page on, if there is one.
    """
    folder = files(__package__) / "page"
    parts = {"script": join_modules(folder, "main.mjs"), "own_style": (folder / "report.css").read_text("utf-8")}
    data = json.dumps(page_data(bake, title, curves, told), separators=(",", ":"), allow_nan=False)
    # In a script element only "<" could end or open anything.
    parts["data"] = data.replace("<", "\\u003c")
    return fill(
        folder, "report.html", title=title, viewer=viewer, **{name: Markup(text) for name, text in parts.items()}
    )


def page_data(
    bake: "BakeFolder",
    title: str,
    curves: "Curves | None" = None,
    told: tuple[dict | None, list[str]] | None = None,
) -> dict:
    """What the page shows, as JSON; arrays as `pack` makes them, coordinates in grid steps. Arguments as for `page`."""
    graph = bake.graph
    storeys = find_storeys(graph, bake.grid_m)
    of_cell = np.full(graph.cell_count, -1)
    for number, storey in enumerate(storeys):
        of_cell[storey.cells] = number
    return {
        "title": title,
        "facts": _facts(bake, told_worth(bake) if told is None else told),
        "cells": {
            "boxes": pack(graph.cells),
            "inhabitable": pack(graph.inhabitable.astype(np.uint8)),
            "storey": pack(of_cell),
            "names": pack_json([str(name) for name in graph.cell_names]),
            # View cells from this one on are prisms over four-sided plans.
            "firstPlan": graph.tile_count,
            "plans": pack(graph.plans.corners),
        },
        "portals": {
            "boxes": pack(graph.portals),
            "cells": pack(graph.portal_cells),
            "axis": pack(graph.portal_axis),
        },
        "objects": _objects(bake),
        "rooms": _rooms(bake),
        "storeys": _storeys(bake, storeys),
        "cellRows": _packed_rows(table_rows(bake, "cell")),
        "objectRows": _packed_rows(table_rows(bake, "object")),
        "curves": None if curves is None else curves.content(),
    }


def pack(values: np.ndarray) -> dict:
    """An array of whole numbers in the smallest type that holds them: dtype, shape, and gzip of its bytes in base64."""
    low, high = (int(values.min()), int(values.max())) if values.size else (0, 0)
    kinds = ("i1", "i2", "i4") if low < 0 else ("u1", "u2", "u4")
    kind = next(k for k in kinds if np.iinfo(k).min <= low and high <= np.iinfo(k).max)
    content = np.ascontiguousarray(values, dtype=f"<{kind}").tobytes()
    return {"dtype": kind, "shape": list(values.shape), "gzip": _zipped(content)}


def pack_json(value: object) -> dict:
    """A JSON value, compressed like an array."""
    return {"dtype": "json", "gzip": _zipped(json.dumps(value, separators=(",", ":")).encode())}


def _zipped(content: bytes) -> str:
    return base64.b64encode(gzip.compress(content, mtime=0)).decode()


def _facts(bake: "BakeFolder", told: tuple[dict | None, list[str]]) -> dict:
    """Numbers and words of the manifest."""
    found, skipped = bake.manifest, bake.manifest.get("skipped", [])
    kept, warnings = told
    return {
        "version": str(found.get("viewcell", __version__)),
        "source": str(found.get("source", "")),
        "sha256": str(found.get("sha256", "")),
        "gridMetres": bake.grid_m,
        "origin": [float(x) for x in bake.origin],
        "yawDegrees": float(found.get("yaw_deg", 0.0)),
        "snapMetres": found.get("max_snap_m"),
        "claimsCells": bool(bake.claims_cells),
        "because": str(found.get("inhabitable_because", "")),
        "counts": {k: v for k, v in found.get("counts", {}).items() if isinstance(v, int)},
        "seconds": {k: v for k, v in found.get("seconds", {}).items() if isinstance(v, int | float)},
        "settings": {k: _word(v) for k, v in found.get("settings", {}).items()},
        "skipped": [{"what": str(one.get("what")), "why": str(one.get("why"))} for one in skipped[:SKIPPED_MOST]],
        "skippedCount": len(skipped),
        "warnings": warnings,
        "kept": [] if kept is None else [list(row) for row in kept_rows(kept)],
        "faces": [] if bake.scene is None else [list(row) for row in face_rows(find_faces(bake.scene))],
        "classes": [[c.name, *c.columns()] for c in count_pairs(bake)],
    }


def _word(value: object) -> str:
    return ("no", "yes")[value] if isinstance(value, bool) else str(value)


def _objects(bake: "BakeFolder") -> dict:
    """Boxes, names, kinds and roles; an object without triangles has low > high."""
    objects = bake.scene.objects if bake.scene is not None else []
    kinds, kind = np.unique([o.kind for o in objects], return_inverse=True) if objects else ([], np.zeros(0, int))
    boxes = bake.scene.object_bounds() if bake.scene is not None else np.zeros((0, 2, 3), np.int64)
    return {
        "boxes": pack(boxes),
        "names": pack_json([o.name for o in objects]),
        "guids": pack_json([o.guid for o in objects]),
        "kinds": [str(k) for k in kinds],
        "kind": pack(kind),
        "role": pack(np.array([ROLES.index(o.role) for o in objects], np.int64)),
    }


def _rooms(bake: "BakeFolder") -> dict:
    """What each room is called, how much of it its view cells hold, and which these are: its set is their union."""
    rooms = bake.rooms.to_pylist()
    words = [
        {
            "name": room["name"] or "",
            "longName": room["long_name"] or "",
            "guid": room["guid"] or "",
            "storey": room["storey"] or "",
            "elevation": room["elevation_m"],
            "covered": room["covered"],
        }
        for room in rooms
    ]
    starts = starts_of([len(room["cells"]) for room in rooms])
    cells = np.array([cell for room in rooms for cell in room["cells"]], np.int64)
    return {"words": pack_json(words), "starts": pack(starts), "cells": pack(cells)}


def _storeys(bake: "BakeFolder", storeys: list[Storey]) -> list[dict]:
    """Floor and section of every storey [grid steps], and where the section cuts the model."""
    if bake.scene is None:
        triangles, owners = np.zeros((0, 3, 3), np.int32), np.zeros(0, np.int32)
    else:
        triangles, owners = bake.scene.triangles()
    found = []
    for storey in storeys:
        section = plan_of(storey, bake.grid_m)
        side = triangles[:, :, 2] > section.level
        cut = side.any(axis=1) & ~side.all(axis=1)
        found.append((storey, section, section_lines(triangles[cut], section), owners[cut]))
    step = DRAWN_STEPS
    drawn = [join_segments(lines, own, step) for _, _, lines, own in found]
    while sum(len(lines) for lines, _ in drawn) > SEGMENTS_MOST and step < 1 << 20:
        step *= 2
        drawn = [join_segments(lines, own, step) for _, _, lines, own in found]
    return [
        {"floor": int(s.floor), "level": section.level, "step": step, "lines": pack(lines), "owners": pack(own)}
        for (s, section, _, _), (lines, own) in zip(found, drawn, strict=True)
    ]


def join_segments(lines: np.ndarray, owners: np.ndarray, step: int) -> tuple[np.ndarray, np.ndarray]:
    """Segments rounded to a step; those of one owner that overlap on one axial line are one.

    Args:
        lines: ends, shape (n, 2, 2), float64.
        owners: shape (n,), int.
        step: in the unit of `lines`.

    Returns:
        (x, y, x, y) in steps, shape (m, 4), int64, and their owners; without repeats and points.
    """
    ends = np.round(lines / step).astype(np.int64).reshape(-1, 4)
    swap = (ends[:, 0] > ends[:, 2]) | ((ends[:, 0] == ends[:, 2]) & (ends[:, 1] > ends[:, 3]))
    ends[swap] = ends[swap][:, [2, 3, 0, 1]]
    rows = np.unique(np.column_stack([owners.astype(np.int64), ends]), axis=0)
    upright, level = rows[:, 1] == rows[:, 3], rows[:, 2] == rows[:, 4]
    joined = [rows[~upright & ~level]]
    for chosen, along in ((upright & ~level, 1), (level & ~upright, 0)):
        joined.append(_join_intervals(rows[chosen], 1 + along, 2 - along))
    rows = np.concatenate(joined)
    rows = rows[np.lexsort(rows.T[::-1])]
    return rows[:, 1:], rows[:, 0]


def _join_intervals(rows: np.ndarray, along: int, across: int) -> np.ndarray:
    """Rows (owner, x, y, x, y) that reach from column `along` to `along` + 2, joined where they touch."""
    if not len(rows):
        return rows
    rows = rows[np.lexsort([rows[:, along], rows[:, across], rows[:, 0]])]
    group = np.cumsum(np.r_[0, np.any(np.diff(rows[:, [0, across]], axis=0) != 0, axis=1)])
    low = rows[:, along].min()
    # Groups are shifted apart, so that one running maximum serves all.
    shift = group * (rows[:, along + 2].max() - low + 2) - low
    reach = np.maximum.accumulate(rows[:, along + 2] + shift)
    first = np.flatnonzero(np.r_[True, rows[1:, along] + shift[1:] > reach[:-1]])
    joined = rows[first]
    joined[:, along + 2] = np.maximum.reduceat(rows[:, along + 2], first)
    return joined


def table_rows(bake: "BakeFolder", kind: str) -> Rows:
    """What view cells see, of cells ("cell") or objects ("object"), with the sightlines that the page holds."""
    table, column = (bake.cell_to_cell, "reached_cell_id") if kind == "cell" else (bake.cell_to_object, "object_id")
    sources, targets = (table[name].to_numpy().astype(np.int64) for name in ("cell_id", column))
    order = np.lexsort([targets, sources])
    table, sources, targets = table.take(pa.array(order)), sources[order], targets[order]
    sights = read_witnesses(table, column, bake.grid_m)
    seen = table["verdict"].cast(pa.string()).to_numpy(zero_copy_only=False) == "visible"
    lines = np.stack([sights.origins, sights.ends], axis=1)
    crossed = np.diff(sights.starts)
    here = np.flatnonzero(seen & np.isfinite(lines).all(axis=(1, 2)))
    here = _largest(bake, kind, here, sources, targets, crossed)
    codes = np.where(seen, SEEN, UNKNOWN).astype(np.uint8)
    codes[here] = SIGHTLINE
    first = np.cumsum(crossed[here]) - crossed[here]
    places = np.repeat(sights.starts[here] - first, crossed[here]) + np.arange(crossed[here].sum())
    starts = np.searchsorted(sources, np.arange(bake.graph.cell_count + 1))
    return Rows(starts, targets, codes, lines[here], crossed[here], sights.portals[places])


def _largest(
    bake: "BakeFolder", kind: str, rows: np.ndarray, sources: np.ndarray, targets: np.ndarray, crossed: np.ndarray
) -> np.ndarray:
    """As many rows as the page may hold, ascending: of each source those to view cells and large targets first."""
    if len(rows) <= SIGHTLINES_MOST and crossed[rows].sum() <= CROSSINGS_MOST:
        return rows
    if kind == "cell":
        boxes, better = bake.graph.cells, bake.graph.inhabitable
    else:
        boxes = bake.scene.object_bounds()
        better = np.zeros(len(boxes), bool)
    size = np.linalg.norm(boxes[:, 1].astype(np.float64) - boxes[:, 0], axis=1)
    rows = rows[np.lexsort([-size[targets[rows]], ~better[targets[rows]], sources[rows]])]
    begins = np.searchsorted(sources[rows], sources[rows])
    rows = rows[np.argsort(np.arange(len(rows)) - begins, kind="stable")]
    fits = np.searchsorted(np.cumsum(crossed[rows]), CROSSINGS_MOST, "right")
    return np.sort(rows[: min(fits, SIGHTLINES_MOST)])


def _packed_rows(rows: Rows) -> dict:
    """Targets as differences to the row before, of a cell's first row to 0; ends of sightlines in 65,535ths."""
    before = np.r_[0, rows.targets[:-1]] if len(rows.targets) else rows.targets
    gaps = rows.targets - before
    firsts = rows.starts[:-1][np.diff(rows.starts) > 0]
    gaps[firsts] = rows.targets[firsts]
    points = rows.lines.reshape(-1, 3)
    low = points.min(axis=0) if len(points) else np.zeros(3)
    unit = np.maximum((points.max(axis=0) if len(points) else np.ones(3)) - low, 1.0) / 65535
    return {
        "starts": pack(rows.starts),
        "gaps": pack(gaps),
        "codes": pack(rows.codes),
        "low": low.tolist(),
        "unit": unit.tolist(),
        "lines": pack(np.round((rows.lines - low) / unit).astype(np.int64)),
        "crossings": pack(rows.crossings),
        "portals": pack(rows.portals),
    }
