"""Pictures of a bake: storey plans, and the potentially visible set of a cell in plan and elevation."""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon, Rectangle
from matplotlib.patheffects import withStroke

from ...data.graph import OTHER_AXES, CellGraph
from ...data.scene import Role, Scene

# Blue and orange stay apart for colour-blind readers and in print.
COLOURS = {
    "source": "#f28482",
    "seen": "#a9d6e5",
    "unknown": "#ffb703",
    "hidden": "#ffffff",
    "inhabitable": "#fdf0d5",
    "other": "#ffffff",
}
WALL, GLASS, PORTAL, OPENING, SIGHTLINE = "#222222", "#5fa8d3", "#d1495b", "#2a9d8f", "#023e8a"
OBJECT_COLOURS = {"seen": "#3a86c8", "unknown": "#fb8500", "hidden": "#b8bec5"}
SHRUNK = "#2b9348"
CELL_EDGE, NO_CELL = "#9aa5b1", "#d3d8de"
SECTION_HEIGHT_M = 1.2
# Storeys are at least so far apart, and have at least this share of the largest one's floor area.
STOREY_GAP_M = 2.0
SMALLEST_SHARE = 0.1
# A floor this much lower than its storey's still belongs to it.
STEP_M = 0.5
# Shown around the inhabitable cells.
MARGIN_M = 2.0
LABELS_MOST = 60
LABEL_POINTS = 6.5
# A letter is about so much wider than high, and lines are so far apart, in the font's size.
LETTER_WIDTH, LINE_HEIGHT = 0.62, 1.3
POINTS_AN_INCH = 72


@dataclass(frozen=True)
class Storey:
    """One level of a building.

    Attributes:
        floor: height of most of its inhabitable area [grid steps].
        cells: its inhabitable cells, shape (n,), int.
    """

    floor: int
    cells: np.ndarray


@dataclass(frozen=True)
class Section:
    """A cut through the model, perpendicular to an axis.

    Attributes:
        axis: 2 for a plan.
        level: where [grid steps]; half a step off the grid, so that it meets no vertex.
    """

    axis: int
    level: float

    @property
    def across(self) -> tuple[int, int]:
        """The axes drawn to the right and up."""
        u, v = OTHER_AXES[self.axis]
        return int(u), int(v)

    def cuts(self, boxes: np.ndarray) -> np.ndarray:
        """Boxes that the section meets, shape (n,), bool, for boxes of shape (n, 2, 3)."""
        return (boxes[:, 0, self.axis] < self.level) & (self.level < boxes[:, 1, self.axis])


def find_storeys(graph: CellGraph, grid_m: float) -> list[Storey]:
    """Inhabitable cells by storey, lowest first.

    The floors with the largest areas, at least 2 m apart, are the storeys'; a cell (a stair step, a landing) belongs to
    the highest storey whose floor is not above its own.
    """
    cells = np.flatnonzero(graph.inhabitable)
    size = np.diff(graph.cells[cells], axis=1)[:, 0].astype(np.float64)
    heights, slot = np.unique(graph.cells[cells, 0, 2], return_inverse=True)
    areas = np.bincount(slot, weights=size[:, 0] * size[:, 1], minlength=len(heights))
    floors: list[int] = []
    for place in np.argsort(-areas, kind="stable"):
        apart = all(abs(int(heights[place]) - floor) * grid_m >= STOREY_GAP_M for floor in floors)
        if apart and areas[place] >= SMALLEST_SHARE * areas.max():
            floors.append(int(heights[place]))
    floors.sort()
    level = np.searchsorted(np.array(floors), heights[slot] + STEP_M / grid_m, "right") - 1
    return [Storey(floor, cells[np.maximum(level, 0) == number]) for number, floor in enumerate(floors)]


def plan_of(storey: Storey, grid_m: float) -> Section:
    """The storey's plan: the section 1.2 m above its floor."""
    return Section(2, int(storey.floor + SECTION_HEIGHT_M / grid_m) + 0.5)


def section_lines(triangles: np.ndarray, section: Section) -> np.ndarray:
    """Where triangles meet the section [grid steps], shape (n, 2, 2), float64: ends of segments in drawn axes."""
    side = triangles[:, :, section.axis] > section.level
    cut = side.any(axis=1) & ~side.all(axis=1)
    corners, side = triangles[cut].astype(np.float64), side[cut]
    # The corner that is alone on its side starts both edges that cross.
    lone = np.where(side.sum(axis=1) == 1, side.argmax(axis=1), (~side).argmax(axis=1))
    row = np.arange(len(corners))
    apex = corners[row, lone]
    ends = []
    for step in (1, 2):
        other = corners[row, (lone + step) % 3]
        share = (section.level - apex[:, section.axis]) / (other - apex)[:, section.axis]
        ends.append((apex + share[:, None] * (other - apex))[:, section.across])
    return np.stack(ends, axis=1) if len(corners) else np.zeros((0, 2, 2))


@dataclass(frozen=True)
class Mark:
    """Lines drawn over a plan [m], each of shape (n, 2), under one label."""

    label: str
    colour: str
    lines: list[np.ndarray]


class Painter:
    """Draws sections of one bake's graph and scene, in metres."""

    def __init__(self, graph: CellGraph, scene: Scene | None, grid_m: float, *, whole: bool = False):
        """Take the graph, the scene (None: cells alone) and the grid step [m]; `whole` shows all of the model."""
        self.graph, self.grid_m, self._whole = graph, grid_m, whole
        triangles, owners = scene.triangles() if scene else (np.zeros((0, 3, 3), np.int32), np.zeros(0, np.int32))
        glass = scene.object_mask(Role.TRANSPARENT)[owners] if scene else np.zeros(0, bool)
        self._opaque, self._glass = triangles[~glass], triangles[glass]
        self._triangles, self._owners = triangles, owners

    def storey(self, storey: Storey, title: str, path: Path) -> None:
        """Plan with cells and portals, written as PNG."""
        section = plan_of(storey, self.grid_m)
        figure, (axes,) = self._figure([section])
        kinds = np.where(self.graph.inhabitable, "inhabitable", "other")
        self._draw(axes, section, kinds)
        self._portals(axes, section)
        self._labels(axes, storey, section)
        axes.set_title(title)
        handles = [Patch(facecolor=COLOURS["inhabitable"], edgecolor=CELL_EDGE, label="inhabitable cell")]
        handles += [Patch(facecolor="white", edgecolor=CELL_EDGE, label="other cell"), *self._geometry_handles()]
        handles += [Line2D([], [], color=PORTAL, lw=2.2, label="portal")]
        handles += [
            Patch(facecolor="none", edgecolor=OPENING, hatch="////", label="portal in a room's floor or ceiling")
        ]
        _finish(figure, handles, path)

    def marked(self, section: Section, marks: "list[Mark]", title: str, path: Path) -> None:
        """Plan with lines drawn over it, written as PNG or SVG."""
        figure, (axes,) = self._figure([section])
        self._draw(axes, section, np.where(self.graph.inhabitable, "inhabitable", "other"))
        handles = [Patch(facecolor=COLOURS["inhabitable"], edgecolor=CELL_EDGE, label="inhabitable cell")]
        handles += self._geometry_handles()
        for mark in marks:
            style = {"colors": mark.colour, "linewidths": 2.2, "capstyle": "round", "zorder": 6}
            axes.add_collection(LineCollection(mark.lines, **style))
            handles.append(Line2D([], [], color=mark.colour, lw=2.2, label=f"{mark.label} ({len(mark.lines):,})"))
        axes.set_title(title)
        _finish(figure, handles, path)

    def visible_set(
        self, cell: int, kinds: np.ndarray, sightlines: np.ndarray, section: Section, title: str, path: Path
    ) -> None:
        """Plan and side elevation of a cell's potentially visible set, written as PNG.

        Args:
            cell: the source.
            kinds: key of COLOURS for each cell, shape (cells,), str.
            sightlines: witnesses [grid steps], shape (n, 2, 3), float64.
            section: the plan.
            title: of the picture.
            path: of the PNG.
        """
        centre = self.graph.cells[cell].mean(axis=0)
        size = np.ptp(self.graph.cells.reshape(-1, 3), axis=0)
        looking = 1 if size[0] >= size[1] else 0
        elevation = Section(looking, np.floor(centre[looking]) + 0.5)
        figure, panels = self._figure([section, elevation])
        names = "xyz"
        for axes, cut in zip(panels, (section, elevation), strict=True):
            self._draw(axes, cut, kinds)
            lines = sightlines[:, :, cut.across] * self.grid_m
            faint = 0.9 if len(lines) < 30 else 0.45
            axes.add_collection(LineCollection(lines, colors=SIGHTLINE, linewidths=0.7, alpha=faint, zorder=4))
            axes.plot(*lines[:, 0].T, ".", color=SIGHTLINE, markersize=1.5, zorder=5)
            height = cut.level * self.grid_m
            axes.set_title(f"{'plan' if cut.axis == 2 else 'elevation'}, cut at {names[cut.axis]} = {height:.2f} m")
        figure.suptitle(title)
        words = {"source": "view cell", "seen": "seen (witness)", "unknown": "unknown (potential)", "hidden": "hidden"}
        handles = [Patch(facecolor=COLOURS[k], edgecolor=CELL_EDGE, label=word) for k, word in words.items()]
        handles += [
            *self._geometry_handles(),
            Line2D([], [], color=SIGHTLINE, lw=1, label="witness sightline, projected"),
        ]
        _finish(figure, handles, path)

    def object_set(
        self,
        cell: int,
        kinds: np.ndarray,
        shadows: tuple[np.ndarray, np.ndarray, np.ndarray],
        sightlines: np.ndarray,
        title: str,
        path: Path,
    ) -> None:
        """Plan and elevation of what a view cell sees, and of the shrunk occluders that hide the rest, written as PNG.

        Args:
            cell: the view cell.
            kinds: "seen", "unknown" or "hidden" for each object, shape (objects,), str.
            shadows: projection points [grid steps], shape (k, 3); corners of the shrunk occluders, one after the other,
                shape (total, 3); and where each begins, shape (n + 1,).
            sightlines: witnesses [grid steps], shape (n, 2, 3), float64.
            title: of the picture.
            path: of the PNG.
        """
        box = self.graph.cells[cell]
        middle = np.floor(box.mean(axis=0)) + 0.5
        span = np.ptp(self._triangles, axis=(0, 1))
        sections = [
            Section(2, middle[2]),
            Section(1 if span[0] >= span[1] else 0, middle[1 if span[0] >= span[1] else 0]),
        ]
        figure, panels = self._figure(sections)
        points, corners, starts = shadows
        for axes, section in zip(panels, sections, strict=True):
            axes.set_facecolor("white")
            for kind, width in (("hidden", 0.6), ("seen", 1.6), ("unknown", 1.6)):
                own = self._triangles[(kinds == kind)[self._owners]]
                lines = section_lines(own, section) * self.grid_m
                axes.add_collection(LineCollection(lines, colors=OBJECT_COLOURS[kind], linewidths=width, zorder=3))
            fans = [
                np.stack([corners[first], corners[i], corners[i + 1]])
                for first, last in pairwise(starts)
                for i in range(first + 1, last - 1)
            ]
            lines = section_lines(np.array(fans).reshape(-1, 3, 3), section) * self.grid_m
            axes.add_collection(LineCollection(lines, colors=SHRUNK, linewidths=2.2, alpha=0.8, zorder=4))
            lines = sightlines[:, :, section.across] * self.grid_m
            axes.add_collection(LineCollection(lines, colors=SIGHTLINE, linewidths=0.5, alpha=0.5, zorder=5))
            axes.add_patch(self._rectangle(box, section)).set(facecolor=COLOURS["source"], edgecolor=WALL, zorder=6)
            axes.plot(*(points[:, section.across] * self.grid_m).T, "x", color=WALL, markersize=5, zorder=7)
            height = section.level * self.grid_m
            axes.set_title(
                f"{'plan' if section.axis == 2 else 'elevation'}, cut at {'xyz'[section.axis]} = {height:.2f} m"
            )
        figure.suptitle(title)
        words = {"seen": "object seen (witness)", "unknown": "object unknown (potential)", "hidden": "object hidden"}
        handles = [Patch(facecolor=COLOURS["source"], edgecolor=WALL, label="view cell")]
        handles += [Line2D([], [], color=OBJECT_COLOURS[k], lw=1.6, label=word) for k, word in words.items()]
        handles += [Line2D([], [], color=SHRUNK, lw=2.2, label="shrunk occluder")]
        handles += [Line2D([], [], color=WALL, marker="x", lw=0, label="projection point of a cluster")]
        handles += [Line2D([], [], color=SIGHTLINE, lw=1, label="witness sightline, projected")]
        _finish(figure, handles, path)

    def _geometry_handles(self) -> list:
        handles = [Patch(facecolor=NO_CELL, label="no cell")]
        handles += [Line2D([], [], color=WALL, lw=1.4, label="opaque surface")] if len(self._opaque) else []
        return handles + ([Line2D([], [], color=GLASS, lw=1.4, label="transparent")] if len(self._glass) else [])

    def _figure(self, sections: list[Section]) -> tuple[Figure, list[Axes]]:
        """A figure with panels in the model's proportions: stacked if it is wide, side by side if it is deep."""
        shown = self.graph.cells[self.graph.inhabitable] if self.graph.inhabitable.any() else self.graph.cells
        if self._whole:
            shown = np.concatenate([shown, [[self._triangles.min(axis=(0, 1)), self._triangles.max(axis=(0, 1))]]])
        low = shown[:, 0].min(axis=0) * self.grid_m - MARGIN_M
        high = shown[:, 1].max(axis=0) * self.grid_m + MARGIN_M
        spans = np.array([(high - low)[list(section.across)] for section in sections])
        deep = spans[0, 1] > 1.2 * spans[0, 0]
        whole = (spans[:, 0].sum(), spans[:, 1].max()) if deep else (spans[:, 0].max(), spans[:, 1].sum())
        scale = min(14.0 / whole[0], 12.0 / whole[1])
        figure = Figure(
            figsize=(max(whole[0] * scale, 6.0) + 1.0, max(whole[1] * scale, 3.0) + 1.5), layout="constrained"
        )
        if deep:
            panels = figure.subplots(1, len(sections), squeeze=False, width_ratios=spans[:, 0])[0]
        else:
            panels = figure.subplots(len(sections), 1, squeeze=False, height_ratios=spans[:, 1])[:, 0]
        for axes, section in zip(panels, sections, strict=True):
            u, v = section.across
            axes.set_facecolor(NO_CELL)
            axes.set(xlim=(low[u], high[u]), ylim=(low[v], high[v]))
            axes.set(aspect="equal", xlabel=f"{'xyz'[u]} [m]", ylabel=f"{'xyz'[v]} [m]")
        return figure, list(panels)

    def _draw(self, axes: Axes, section: Section, kinds: np.ndarray) -> None:
        """Cells coloured by kind, then the model's cut surfaces."""
        cut = section.cuts(self.graph.cells)
        for kind in ("other", "hidden", "inhabitable", "unknown", "seen", "source"):
            chosen = np.flatnonzero(cut & (kinds == kind))
            edge = "#c9d1d9" if kind in ("other", "hidden") else CELL_EDGE
            rectangles = [self._outline(int(cell), section) for cell in chosen]
            style = {"facecolor": COLOURS[kind], "edgecolor": edge, "linewidth": 0.4, "zorder": 1}
            axes.add_collection(PatchCollection(rectangles, match_original=False, **style))
        for triangles, colour in ((self._glass, GLASS), (self._opaque, WALL)):
            lines = section_lines(triangles, section) * self.grid_m
            axes.add_collection(LineCollection(lines, colors=colour, linewidths=0.9, zorder=3))

    def _outline(self, cell: int, section: Section) -> Polygon | Rectangle:
        """A cell as it is cut: its plan from above, else the box around it."""
        if section.axis == 2 and cell >= self.graph.tile_count:
            return Polygon(self.graph.plans.corners[cell - self.graph.tile_count] * self.grid_m)
        return self._rectangle(self.graph.cells[cell], section)

    def _rectangle(self, box: np.ndarray, section: Section) -> Rectangle:
        u, v = section.across
        low, high = box[0] * self.grid_m, box[1] * self.grid_m
        return Rectangle((low[u], low[v]), high[u] - low[u], high[v] - low[v])

    def _portals(self, axes: Axes, section: Section) -> None:
        """Portals in walls as strokes, those in floors and ceilings of inhabitable cells as hatched rectangles."""
        boxes, upright = self.graph.portals, self.graph.portal_axis != section.axis
        u, v = section.across
        cut = boxes[upright & section.cuts(boxes)] * self.grid_m
        strokes = LineCollection(cut[:, :, [u, v]], colors=PORTAL, linewidths=1.8, zorder=5, capstyle="butt")
        axes.add_collection(strokes)
        rooms = section.cuts(self.graph.cells) & self.graph.inhabitable
        shown = rooms[self.graph.portal_cells].any(axis=1) & ~upright
        flat = [self._rectangle(box, section) for box in boxes[shown]]
        style = {"facecolor": "none", "edgecolor": OPENING, "hatch": "////", "linewidth": 0.5, "alpha": 0.45}
        axes.add_collection(PatchCollection(flat, match_original=False, zorder=2, **style))

    def _labels(self, axes: Axes, storey: Storey, section: Section) -> None:
        """Names or ids of the largest inhabitable cells."""
        cells = storey.cells[section.cuts(self.graph.cells[storey.cells])]
        size = np.diff(self.graph.cells[cells], axis=1)[:, 0].astype(np.float64)
        largest = cells[np.argsort(-size[:, 0] * size[:, 1], kind="stable")[:LABELS_MOST]]
        # The figure has half an inch of margin on either side of its panels.
        figure = axes.get_figure()
        scale = POINTS_AN_INCH * (figure.get_figwidth() - 1.0) / np.ptp(axes.get_xlim())
        halo = [withStroke(linewidth=2.5, foreground="white")]
        for cell in largest:
            box = self.graph.cells[cell] * self.grid_m
            room = (box[1] - box[0])[:2] * scale / LABEL_POINTS
            text = _label(int(cell), str(self.graph.cell_names[cell]), room)
            style = {"ha": "center", "va": "center", "fontsize": LABEL_POINTS, "color": "#212529", "clip_on": True}
            behind = {"facecolor": COLOURS["inhabitable"], "edgecolor": "none", "pad": 1.0, "alpha": 0.85}
            axes.text(*box.mean(axis=0)[:2], text, zorder=6, path_effects=halo, bbox=behind if text else None, **style)


def _label(cell: int, name: str, room: np.ndarray) -> str:
    """The id and name if there is room for them (in font sizes, x and y), else the id, else nothing."""
    for lines in ([str(cell), name] if name else [str(cell)], [str(cell)]):
        if max(map(len, lines)) * LETTER_WIDTH <= room[0] and len(lines) * LINE_HEIGHT <= room[1]:
            return "\n".join(lines)
    return ""


def _finish(figure: Figure, handles: list, path: Path) -> None:
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=4 if len(handles) > 6 else len(handles),
        frameon=False,
        fontsize=9,
    )
    # The layout leaves no room around; to look for it draws everything twice.
    figure.savefig(path, dpi=110)
