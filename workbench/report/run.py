"""Look at a bake: plans of its storeys, sets of cells, and the numbers, as Markdown and PNG and as one HTML page."""

import os
import re
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...data.carving import find_faces
from ...data.errors import InputError
from ...data.plural import counted
from ...data.prepared import PreparedModel
from ...data.scene import OPAQUE
from ...data.store.bake_folder import read_bake
from ...verify.findings import count_pairs
from ...verify.rays.witness import read_witnesses, visible_rows
from ..bake.worth import told_worth
from ..curves.series import read_curves
from ..summary import face_rows, kept_rows
from .plans import Painter, Section, Storey, find_storeys, plan_of
from .web_page import page

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...data.store.bake_folder import BakeFolder

# Sightlines drawn, to the largest cells and objects that are seen.
SIGHTLINES_MOST = {"cell": 40, "object": 20}
UNKNOWN_LISTED = 20
STOREY_CAPTION = (
    "What can be walked into is cream; red strokes are the openings (portals) through which cells see each other, "
    "at the height of the cut, 1.2 m above the floor."
)
CALL = re.compile(r"make_(\w+)\((.*)\)")
COUNTED = ("cells", "inhabitable cells", "portals", "objects", "opaque triangles")


def report(
    bake: "BakeFolder | str | Path",
    *,
    cells: "Sequence[int] | None" = None,
    out: str | Path | None = None,
    curves: str | Path | None = None,
) -> Path:
    """Write report.md and its pictures, and report.html, which shows every cell and needs no other file.

    Args:
        bake: the bake, or its folder.
        cells: cells whose potentially visible sets are shown; by default three inhabitable ones: the median set, the
            worst overestimate and the largest set.
        out: folder to write, made if need be; by default `report` inside the bake folder.
        curves: curves of time against error for the page; by default curves.json in that folder, if there is one.

    Returns:
        Path of report.md.

    Raises:
        InputError: a cell does not exist or is not inhabitable, the curves are none, or the folder cannot be written.
    """
    bake = read_bake(bake) if isinstance(bake, str | Path) else bake
    chosen = choose_cells(bake) if cells is None else {int(cell): "chosen" for cell in cells}
    for cell in chosen:
        if not (0 <= cell < bake.graph.cell_count and bake.graph.inhabitable[cell]):
            raise InputError(f"cells: expected ids of inhabitable cells, found {cell}")
    folder = Path(out) if out else Path(bake.folder) / "report"
    if curves is None and (folder / "curves.json").exists():
        curves = folder / "curves.json"
    drawn = None if curves is None else read_curves(curves)
    told = told_worth(bake)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            viewer = _viewer(bake, folder)
            _write(bake, chosen, told, viewer, Path(scratch))
            html = page(bake, model_name(bake), drawn, told, viewer)
            (Path(scratch) / "report.html").write_text(html, encoding="utf-8")
            for made in sorted(Path(scratch).iterdir()):
                shutil.move(made, folder / made.name)
    except OSError as error:
        raise InputError(f"{folder}: expected a folder to write the report to, found {error.strerror}") from None
    return folder / "report.md"


def choose_cells(bake: "BakeFolder") -> dict[int, str]:
    """Three telling inhabitable cells and why; fewer where they coincide."""
    sources = np.flatnonzero(bake.graph.inhabitable)
    if speaks_of_cells(bake):
        sources = sources[sources < bake.graph.tile_count]
    if not len(sources):
        return {}
    potential = _potential_counts(bake)[sources]
    seen = _seen_counts(bake)[sources]
    ratio = potential / np.maximum(seen, 1)
    by_size = np.argsort(potential, kind="stable")
    places = {
        "median set": by_size[len(by_size) // 2],
        "worst overestimate": ratio.argmax(),
        "largest set": by_size[-1],
    }
    chosen: dict[int, str] = {}
    for why, place in places.items():
        cell = int(sources[place])
        chosen[cell] = f"{chosen[cell]}, {why}" if cell in chosen else why
    return chosen


def speaks_of_cells(bake: "BakeFolder") -> bool:
    """Whether the bake claims what cells see of each other, from some inhabitable cell."""
    return bake.claims_cells and bool(bake.graph.inhabitable[: bake.graph.tile_count].any() or not bake.scene)


def _seen_counts(bake: "BakeFolder") -> np.ndarray:
    """Number of witnessed cells, or objects of a bake that claims nothing of cells, of every cell, shape (cells,)."""
    table = bake.cell_to_cell if speaks_of_cells(bake) else bake.cell_to_object
    return np.bincount(visible_rows(table)["cell_id"].to_numpy(), minlength=bake.graph.cell_count)


def _potential_counts(bake: "BakeFolder") -> np.ndarray:
    """Number of what `_seen_counts` counts that is potentially visible, shape (cells,)."""
    if not speaks_of_cells(bake):
        return bake.object_sets.sizes
    return bake.cell_sets.sizes - np.where(bake.graph.inhabitable, bake.graph.cell_count - bake.graph.tile_count, 0)


def _viewer(bake: "BakeFolder", folder: Path) -> str | None:
    """Address of the bake's view from a folder on, if `viewcell view` has written one beside the bake."""
    found = Path(bake.folder).with_suffix(".view") / "index.html"
    return Path(os.path.relpath(found, folder)).as_posix() if found.is_file() else None


def _write(
    bake: "BakeFolder",
    chosen: dict[int, str],
    told: tuple[dict | None, list[str]],
    viewer: str | None,
    folder: Path,
) -> None:
    painter = Painter(bake.graph, bake.scene, bake.grid_m, whole=not speaks_of_cells(bake))
    name = model_name(bake)
    walk = f"[Walk through it](<{viewer}>)" if viewer else f"`viewcell view {Path(bake.folder).name}` walks through it"
    lines = [f"# {name}", "", f"{walk} in a browser.", ""] if bake.scene else [f"# {name}", ""]
    kept, warnings = told
    for text in warnings:
        lines += [f"> **Warning:** {text}.", ""]
    lines += [*_numbers(bake, kept), ""]
    storeys = find_storeys(bake.graph, bake.grid_m) if speaks_of_cells(bake) else []
    lines += ["## Storeys", ""] if storeys else []
    for number, storey in enumerate(storeys):
        cells = counted(len(storey.cells), "inhabitable cell")
        title = f"Storey {number}: floor at {storey.floor * bake.grid_m:.2f} m, {cells}"
        painter.storey(storey, f"{name}, {title[0].lower()}{title[1:]}", folder / f"storey-{number}.png")
        lines += [f"### {title}", "", f"![{title}](storey-{number}.png)", "", STOREY_CAPTION, ""]
    lines += ["## Potentially visible sets", "", *_set_table(bake, chosen), ""]
    shadows = None if speaks_of_cells(bake) else _Shadows(bake)
    for cell, why in chosen.items():
        path = folder / f"cell-{cell}.png"
        if shadows is None:
            title, caption = _draw_set(bake, painter, storeys, cell, path)
        else:
            title, caption = _draw_objects(bake, painter, shadows, cell, path)
        lines += [f"### Cell {cell}: {why}", "", f"![{title}](cell-{cell}.png)", "", caption, ""]
        lines += _unknown_targets(bake, cell)
    (folder / "report.md").write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")


class _Shadows:
    """Occluders of a model, and how vLOD's method shrinks them for a view cell."""

    def __init__(self, bake: "BakeFolder") -> None:
        model = PreparedModel(bake.scene)
        self._outlines, self._pieces = model.outlines, model.occludees.pieces
        self._cells = bake.graph.cells

    def of(self, cell: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Projection points, corners and starts of the shrunk occluders of a cell."""
        from ...solvers.visibility.projection import VlodSettings, shrunk_occluders

        settings = VlodSettings(clusters=6, objective="socp")
        found = shrunk_occluders(self._cells[cell], self._outlines, self._pieces, settings)
        return found.points[np.unique(found.cluster)], found.corners, found.starts


def _draw_objects(bake: "BakeFolder", painter: Painter, shadows: _Shadows, cell: int, path: Path) -> tuple[str, str]:
    """Draw the objects that a view cell sees; returns the picture's title and caption."""
    seen, lines = _sights(bake, cell, "object")
    kinds = np.where(bake.object_sets[cell], "unknown", "hidden")
    kinds[seen] = "seen"
    unknown, hidden = (int((kinds == kind).sum()) for kind in ("unknown", "hidden"))
    title = f"View cell {cell}: {counted(len(seen), 'object')} seen, {unknown:,} unknown, {hidden:,} hidden"
    found = shadows.of(cell)
    painter.object_set(cell, kinds, found, lines, title, path)
    caption = (
        f"Objects cut by the two sections: blue ones are seen from the red view cell, orange ones ({unknown:,} in all) "
        f"may be, grey ones are proved hidden. Green are the occluders as vLOD's method shrinks them for projection "
        f"points (crosses, one for each of six directions), {len(found[2]) - 1:,} in all: what they cover from such a "
        f"point is hidden from the whole cell. The bake itself proves more, without projection points. "
        f"Of the sightlines {len(lines)} are drawn, to the largest objects seen."
    )
    return title, caption


def model_name(bake: "BakeFolder") -> str:
    """The model's file name, or what a synthetic model is in a few words."""
    source = str(bake.manifest.get("source", ""))
    call = CALL.fullmatch(source)
    if call is None:
        return Path(source).name or Path(bake.folder).name
    like = re.search(r"like='([^']+)'", call[2])
    counts = [f", {count[2]} {count[1]}" for count in re.finditer(r"\b(floors|wings|sides|windows)=(\d+)", call[2])]
    return f"Synthetic {call[1]}{f' like {like[1]}' if like else ''.join(counts)}"


def _draw_set(bake: "BakeFolder", painter: Painter, storeys: list[Storey], cell: int, path: Path) -> tuple[str, str]:
    """Draw one cell's set; returns the picture's title and caption."""
    seen_cells, cell_lines = _sights(bake, cell, "cell")
    _, object_lines = _sights(bake, cell, "object")
    kinds = np.where(bake.cell_sets[cell], "unknown", "hidden").astype(object)
    # Nothing is claimed of cells that stand at an angle.
    kinds[bake.graph.tile_count :] = "inhabitable"
    kinds[seen_cells] = "seen"
    kinds[cell] = "source"
    unknown, drawn = int((kinds == "unknown").sum()), np.concatenate([cell_lines, object_lines])
    potential = int(bake.cell_sets[cell][: bake.graph.tile_count].sum())
    storey = next(s for s in storeys if cell in s.cells)
    low, high = bake.graph.cells[cell, :, 2]
    section = plan_of(storey, bake.grid_m)
    if not low < section.level < high:
        section = Section(2, (int(low) + int(high)) // 2 + 0.5)
    name = str(bake.graph.cell_names[cell])
    named = f"Cell {cell}{f' ({name})' if name else ''}"
    title = f"{named}: {counted(potential - unknown, 'cell')} seen, itself included, {unknown:,} unknown"
    painter.visible_set(cell, kinds, drawn, section, title, path)
    caption = (
        f"From the red cell one can see into every blue cell, and perhaps into the yellow ones ({unknown:,} in all); "
        f"white cells are proved hidden. Of the sightlines {len(drawn)} are drawn, to the largest cells and objects "
        f"seen, whole, also where they run above or below the cut."
    )
    return title, caption


def _sights(bake: "BakeFolder", cell: int, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Targets that have a witness, and the witnesses of the largest, shape (n, 2, 3), in grid steps."""
    table, column = (bake.cell_to_cell, "reached_cell_id") if kind == "cell" else (bake.cell_to_object, "object_id")
    rows = visible_rows(table)
    sights = read_witnesses(rows.filter(rows["cell_id"].to_numpy() == cell), column, bake.grid_m)
    lines = np.stack([sights.origins, sights.ends], axis=1)
    good = np.flatnonzero(np.isfinite(lines).all(axis=(1, 2)) & ((sights.targets != cell) | (kind == "object")))
    size = _sizes(bake, kind)[sights.targets[good]]
    return sights.targets, lines[good[np.argsort(-size, kind="stable")[: SIGHTLINES_MOST[kind]]]]


def _sizes(bake: "BakeFolder", kind: str) -> np.ndarray:
    """Length of the diagonals of all cells' or objects' boxes [grid steps], float64; below 0 for empty objects."""
    boxes = bake.graph.cells if kind == "cell" else bake.scene.object_bounds() if bake.scene else np.zeros((0, 2, 3))
    extent = (boxes[:, 1].astype(np.float64) - boxes[:, 0]).min(axis=1, initial=np.inf)
    return np.where(extent < 0, -1.0, np.linalg.norm(boxes[:, 1].astype(np.float64) - boxes[:, 0], axis=1))


def _unknown_targets(bake: "BakeFolder", cell: int) -> list[str]:
    """Table of the largest targets that have neither witness nor proof."""
    rows = []
    kinds = [("cell", bake.cell_sets[cell][: bake.graph.tile_count])] if speaks_of_cells(bake) else []
    for kind, potential in (*kinds, ("object", bake.object_sets[cell])):
        unknown = potential.copy()
        unknown[_sights(bake, cell, kind)[0]] = False
        unknown[cell if kind == "cell" else []] = False
        ids, sizes = np.flatnonzero(unknown), _sizes(bake, kind)
        last = ~bake.graph.inhabitable[ids] if kind == "cell" else np.zeros(len(ids), bool)
        for target in ids[np.lexsort([-sizes[ids], last])[:UNKNOWN_LISTED]]:
            rows.append(f"| {_describe(bake, kind, int(target))} | {sizes[target] * bake.grid_m:.2f} |")
        if len(ids) > UNKNOWN_LISTED:
            rows.append(f"| and {len(ids) - UNKNOWN_LISTED:,} smaller {kind}s | | | |")
    if not rows:
        return []
    head = [
        "Unknown from here, inhabitable cells and the largest first:",
        "",
        "| target | kind | name | diagonal [m] |",
        "|---|---|---|---|",
    ]
    return [*head, *rows, ""]


def _describe(bake: "BakeFolder", kind: str, target: int) -> str:
    """Id, kind and name of a target, as three columns."""
    if kind == "cell":
        place = "inhabitable cell" if bake.graph.inhabitable[target] else "wall, sliver or exterior cell"
        return f"cell {target} | {place} | {bake.graph.cell_names[target]}"
    placed = bake.scene.objects[target]
    name = " ".join(placed.name.replace("|", "/").split())
    return f"object {target} | {placed.kind} ({placed.role.value}) | {name}"


def _numbers(bake: "BakeFolder", kept: dict | None) -> list[str]:
    """Tables of counts, overestimates, what is kept, and seconds."""
    triangles = 0
    if bake.scene is not None:
        triangles = len(bake.scene.triangles(*OPAQUE)[0])
    objects = len(bake.scene.objects) if bake.scene is not None else 0
    graph = bake.graph
    values = (graph.cell_count, int(graph.inhabitable.sum()), graph.portal_count, objects, triangles)
    lines = ["| model | |", "|---|---|"]
    lines += [f"| {name} | {value:,} |" for name, value in zip(COUNTED, values, strict=True)]
    lines += [
        "",
        "| targets, from inhabitable cells | potential | seen | overestimate | unknown |",
        "|---|---|---|---|---|",
    ]
    for c in count_pairs(bake):
        lines.append(f"| {c.name} | {' | '.join(c.columns())} |")
    if bake.scene is not None:
        found = face_rows(find_faces(bake.scene))
        lines += ["", "| faces of occluders | |", "|---|---|", *(f"| {name} | {value} |" for name, value in found)]
    if kept is not None:
        lines += ["", "| kept | |", "|---|---|", *(f"| {name} | {value} |" for name, value in kept_rows(kept))]
    seconds = {k: v for k, v in bake.manifest.get("seconds", {}).items() if isinstance(v, int | float)}
    if seconds:
        lines += ["", "| phase | seconds |", "|---|---|", *(f"| {k} | {v:.2f} |" for k, v in seconds.items())]
    skipped = bake.manifest.get("skipped", [])
    if skipped:
        lines += ["", f"{len(skipped)} parts of the model could not be read; they are listed in manifest.json."]
    return lines


def _set_table(bake: "BakeFolder", chosen: dict[int, str]) -> list[str]:
    """One row for each chosen cell."""
    seen = _seen_counts(bake)
    lines = [
        "Cells that a cell sees, itself included:" if speaks_of_cells(bake) else "Objects that a view cell sees:",
        "",
        "| cell | name | potential | seen | overestimate | unknown |",
    ]
    lines.append("|---|---|---|---|---|---|")
    for cell in chosen:
        potential, known = int(_potential_counts(bake)[cell]), int(seen[cell])
        ratio = f"{potential / known:.3f}" if known else "no witness"
        lines.append(
            f"| {cell} | {bake.graph.cell_names[cell]} | {potential:,} | {known:,} | {ratio} | {potential - known:,} |"
        )
    return lines
