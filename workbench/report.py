"""Look at a bake: plans of its storeys, the sets of chosen cells, and the numbers, as Markdown and PNG."""

import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..data.errors import InputError
from ..data.scene import Role
from ..verify.findings import count_pairs
from ..verify.plans import Painter, Section, Storey, find_storeys, plan_of
from ..verify.witness import read_witnesses, visible_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..data.database import Bake

SIGHTLINES_MOST = 200
COUNTED = ("cells", "inhabitable cells", "portals", "objects", "opaque triangles")


def report(bake: "Bake", *, cells: "Sequence[int] | None" = None, out: str | Path | None = None) -> Path:
    """Write report.md and its pictures.

    Args:
        bake: the bake.
        cells: cells whose potentially visible sets are shown; by default three inhabitable ones: the median set, the
            worst overestimate and the largest set.
        out: folder to write, made if need be; by default `report` inside the bake folder.

    Returns:
        Path of report.md.

    Raises:
        InputError: a cell does not exist or is not inhabitable, or the folder cannot be written.
    """
    chosen = choose_cells(bake) if cells is None else {int(cell): "chosen" for cell in cells}
    for cell in chosen:
        if not (0 <= cell < bake.graph.cell_count and bake.graph.inhabitable[cell]):
            raise InputError(f"cells: expected ids of inhabitable cells, found {cell}")
    folder = Path(out) if out else Path(bake.folder) / "report"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            _write(bake, chosen, Path(scratch))
            for made in sorted(Path(scratch).iterdir()):
                shutil.move(made, folder / made.name)
    except OSError as error:
        raise InputError(f"{folder}: expected a folder to write the report to, found {error.strerror}") from None
    return folder / "report.md"


def choose_cells(bake: "Bake") -> dict[int, str]:
    """Three telling inhabitable cells and why; fewer where they coincide."""
    sources = np.flatnonzero(bake.graph.inhabitable)
    if not len(sources):
        return {}
    potential = bake.potential_cells[sources].sum(axis=1)
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


def _seen_counts(bake: "Bake") -> np.ndarray:
    """Number of witnessed cells of every cell, shape (cells,), int."""
    return np.bincount(visible_rows(bake.cell_to_cell)["cell_id"].to_numpy(), minlength=bake.graph.cell_count)


def _write(bake: "Bake", chosen: dict[int, str], folder: Path) -> None:
    painter, storeys = Painter(bake.graph, bake.scene, bake.grid_m), find_storeys(bake.graph, bake.grid_m)
    name = Path(str(bake.manifest.get("source", ""))).name or Path(bake.folder).name
    lines = [f"# {name}", "", *_numbers(bake), "", "## Storeys", ""]
    for number, storey in enumerate(storeys):
        title = f"Storey {number}: floor at {storey.floor * bake.grid_m:.2f} m, {len(storey.cells)} inhabitable cells"
        painter.storey(storey, f"{name}, {title[0].lower()}{title[1:]}", folder / f"storey-{number}.png")
        lines += [f"### {title}", "", f"![{title}](storey-{number}.png)", ""]
    lines += ["## Potentially visible sets", "", *_set_table(bake, chosen), ""]
    for cell, why in chosen.items():
        title = _draw_set(bake, painter, storeys, cell, folder / f"cell-{cell}.png")
        lines += [f"### Cell {cell}: {why}", "", f"![{title}](cell-{cell}.png)", ""]
    (folder / "report.md").write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")


def _draw_set(bake: "Bake", painter: Painter, storeys: list[Storey], cell: int, path: Path) -> str:
    """Draw one cell's set; returns the picture's title."""
    rows = visible_rows(bake.cell_to_cell)
    rows = rows.filter(rows["cell_id"].to_numpy() == cell)
    sights = read_witnesses(rows, "reached_cell_id", bake.grid_m)
    kinds = np.where(bake.potential_cells[cell], "unknown", "hidden")
    kinds[sights.targets] = "seen"
    kinds[cell] = "source"
    seen, unknown = int((kinds == "seen").sum()), int((kinds == "unknown").sum())
    lines = np.stack([sights.origins, sights.ends], axis=1)
    lines = lines[np.isfinite(lines).all(axis=(1, 2)) & (sights.targets != cell)]
    # Evenly thinned: every part of the set keeps some sightlines, and the picture stays readable.
    shown = lines[np.unique(np.linspace(0, len(lines) - 1, min(len(lines), SIGHTLINES_MOST)).astype(int))]
    storey = next(s for s in storeys if cell in s.cells)
    low, high = bake.graph.cells[cell, :, 2]
    section = plan_of(storey, bake.grid_m)
    if not low < section.level < high:
        section = Section(2, (int(low) + int(high)) // 2 + 0.5)
    name = str(bake.graph.cell_names[cell])
    title = f"Cell {cell}{f' ({name})' if name else ''} sees {seen} cells, {unknown} unknown"
    thinned = f"; {len(shown)} of {len(lines)} sightlines drawn" if len(shown) < len(lines) else ""
    painter.visible_set(cell, kinds, shown, section, title + thinned, path)
    return title


def _numbers(bake: "Bake") -> list[str]:
    """Tables of counts, overestimates and seconds."""
    triangles = 0
    if bake.scene is not None:
        opaque = bake.scene.object_mask(Role.OCCLUDER, Role.DETAIL)
        triangles = int(opaque[bake.scene.triangles()[1]].sum())
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
    seconds = {k: v for k, v in bake.manifest.get("seconds", {}).items() if isinstance(v, int | float)}
    if seconds:
        lines += ["", "| phase | seconds |", "|---|---|", *(f"| {k} | {v:.2f} |" for k, v in seconds.items())]
    skipped = bake.manifest.get("skipped", [])
    if skipped:
        lines += ["", f"{len(skipped)} parts of the model could not be read; they are listed in manifest.json."]
    return lines


def _set_table(bake: "Bake", chosen: dict[int, str]) -> list[str]:
    """One row for each chosen cell."""
    seen, lines = _seen_counts(bake), ["| cell | name | potential | seen | overestimate |", "|---|---|---|---|---|"]
    for cell in chosen:
        potential, known = int(bake.potential_cells[cell].sum()), int(seen[cell])
        ratio = f"{potential / known:.3f}" if known else "no witness"
        lines.append(f"| {cell} | {bake.graph.cell_names[cell]} | {potential:,} | {known:,} | {ratio} |")
    return lines
