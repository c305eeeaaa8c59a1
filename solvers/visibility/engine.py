"""Visibility of a prepared model, a block of sources at a time."""

from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import warp as wp

from ...data.blockers import Blockers, find_blockers
from ...data.graph import CellGraph
from ...data.incidence import populate
from ...data.occludees import find_occludees
from ...data.opaque import OpaquePlanes, opaque_planes
from ...data.patches import Patches, find_patches
from ...data.regions import Regions, find_regions
from ...data.scene import Role, Scene
from ...data.solids import SolidIndex, closed_elements
from ...data.store.certificates import Proofs
from ...data.store.database import VisibleRows
from ...kernels import flood, line_tree, shaft, sightline, target
from ...kernels import trace as walk
from ...kernels.flood import launch_flood
from ...kernels.sightline import AimTargets, Triangles, aim_targets, device_triangles
from ...kernels.target import TargetAnswers
from . import cells as cell_visibility
from . import objects as object_visibility
from . import occluders as occlusion
from .cells import CellRows, Model, cell_rows, certified_pairs, join_rows, portal_rows, search_pairs, segments
from .ledger import Ledger
from .objects import ObjectModel, ObjectRows, object_rows
from .occluders import Occlusion, device_occluders, hidden_boxes, look_at_objects, refine_objects, seen_objects
from .projection import VlodSettings, join_outlines, rectangle_outlines, vlod_hidden

# A flood is tried on this many sources first; where more than a quarter run into the cap, sequences explode.
SAMPLE = 24
# Smaller pieces of furniture hide little and would fill the hierarchy of blockers.
BLOCKING_DETAIL_M2 = 0.1
# Oblique surfaces below this hide little, and are not made of triangles below the share.
PATCH_M2 = 1.0
PATCH_SHARE = 1 / 32
# View cells and pieces are not halved below this, and a proof has at most so many pieces.
SMALLEST_M = (0.0625, 0.0625)
SHAFT_CAP = 200
# With "auto" the occluders are asked about cells of whose potential objects more than this share is unknown.
AUTO_UNKNOWN = 0.02
NO_PLANES = OpaquePlanes([np.zeros((0, 2, 3), np.int32)] * 3, 0.0, 0.0)


@dataclass
class Part:
    """Rows of one block of sources."""

    cells: CellRows | None
    objects: ObjectRows
    proofs: Proofs | None = None

    @property
    def unknown_count(self) -> int:
        """Pairs without a witness."""
        cells = 0 if self.cells is None else int((~self.cells.seen).sum())
        return cells + int((~self.objects.seen).sum())


class Sights:
    """A model's triangles and solids, ready to be shot at."""

    def __init__(self, scene: Scene, opaque: OpaquePlanes, cells: np.ndarray, device: str) -> None:
        """Copy a model's triangles to the device.

        Args:
            scene: the model.
            opaque: opaque rectangles of its occluders.
            cells: that eyes are in [grid steps], shape (n, 2, 3), int32.
            device: Warp device.
        """
        corners, owners = scene.triangles()
        solid = scene.object_mask(Role.OCCLUDER, Role.DETAIL)[owners]
        self.opaque = with_details(scene, opaque)
        self.triangles: Triangles = device_triangles(corners[solid], owners[solid], device)
        self.targets: AimTargets = aim_targets(corners, device)
        self.solids = SolidIndex(cells, closed_elements(scene))
        starts = np.searchsorted(owners, np.arange(len(scene.objects) + 1))
        self.ranges = np.column_stack([starts[:-1], starts[1:]])

    def occlusion(
        self,
        scene: Scene,
        cells: np.ndarray,
        seed: int,
        threads: int,
        device: str,
        blockers: Blockers | None = None,
        shadows: bool = True,
    ) -> tuple[Occlusion, tuple[Regions, Patches]]:
        """The occluders and occludees of the model, and its occluders as they are on the host.

        Args:
            scene: the model.
            cells: view cells.
            seed: of the random sightlines.
            threads: CPU threads.
            device: Warp device.
            blockers: of the model's portal graph, if they are to hide too.
            shadows: whether occluders are to hide.
        """
        regions, patches = find_occluders(scene, self.opaque if shadows else NO_PLANES, shadows=shadows)
        tree, shields = device_occluders(regions, patches, blockers, device)
        model = Occlusion(
            find_occludees(scene),
            tree,
            shields,
            self.triangles,
            self.targets,
            self.ranges,
            self.solids,
            cells,
            tuple(round(size / scene.grid_m) for size in SMALLEST_M),
            SHAFT_CAP,
            seed,
            threads,
            device,
        )
        return model, (regions, patches)


class Engine:
    """A model or a bare graph on a device, ready to answer from its portal cells."""

    def __init__(
        self,
        scene: Scene | None,
        graph: CellGraph,
        opaque: OpaquePlanes | None,
        *,
        seed: int,
        threads: int,
        device: str,
        method: str = "portals",
        certify: bool = False,
    ) -> None:
        """Copy what visibility needs to the device.

        Args:
            scene: the model; None for a bare graph.
            graph: its cells and portals.
            opaque: opaque rectangles of its occluders; None for a bare graph.
            seed: of the random sightlines.
            threads: CPU threads.
            device: Warp device.
            method: "portals"; "both" to ask the occluders about every pair that portals leave unknown; "auto" to ask
                only where much is unknown. Without effect on a bare graph.
            certify: call hidden only what has a certificate, and keep it. On a model all methods then hide by its
                occluders, which can be checked against the model alone; "portals" leaves out oblique ones for cells.
        """
        self._certify = certify
        self.occluders: tuple[Blockers, Regions | None, Patches | None] | None = None
        self.objects = None
        self.object_count = 0
        self._scene = scene
        self._least_unknown = {"portals": np.inf, "both": 0.0, "auto": AUTO_UNKNOWN}[method]
        self._sights = None
        if scene is None:
            blockers = find_blockers(graph)
            self.model = Model(graph, blockers, None, None, None, device, threads, seed)
            self.occluders = blockers, None, None
            return
        self._sights = sights = Sights(scene, opaque, graph.cells, device)
        self.object_count = len(scene.objects)
        self.objects = ObjectModel(populate(scene, graph.cells), sights.ranges)
        if certify:
            self.occlusion, shadows = sights.occlusion(scene, graph.cells, seed, threads, device)
            self.occluders = region_blockers(shadows[0]), *shadows
            blockers = self.occluders[0]
        else:
            blockers = find_blockers(graph, sights.opaque)
        self.model = Model(graph, blockers, sights.triangles, sights.targets, sights.solids, device, threads, seed)

    @cached_property
    def occlusion(self) -> Occlusion:
        """Occluders of the model, made when they are first asked."""
        model = self.model
        return self._sights.occlusion(self._scene, model.graph.cells, model.seed, model.threads, model.device)[0]

    def compile(self) -> None:
        """Load the kernels, so that their compilation is not counted as visibility."""
        modules = [target, walk, sightline] if self.objects is not None else [target, walk, flood]
        if self.objects is not None and self._least_unknown == 0.0:
            modules.append(shaft)
        if self._certify:
            modules += [line_tree] if self.objects is None else [line_tree, shaft]
        for module in modules:
            wp.load_module(module.__name__, device=self.model.device)

    def visible(self, block: np.ndarray, *, aim: bool = True) -> Part:
        """Rows of some inhabitable cells; of all of them at once for a bare graph.

        Args:
            block: the cells.
            aim: shoot at what the axial model allows but whose own line the true triangles stop. Without it the same
                pairs are hidden, in a fraction of the time, and more of the others stay unknown.
        """
        if self._certify:
            return self._certified(block, aim)
        if self.objects is None:
            return Part(self._flood(block), no_objects())
        rounds = (cell_visibility.AIM_ROUNDS, object_visibility.AIM_ROUNDS) if aim else ((), ())
        cells = cell_rows(self.model, block, rounds[0])
        if self._least_unknown == 0.0:
            cells = self._hide_cells(cells)
        objects = object_rows(self.model, self.objects, cells, rounds[1])
        doubtful = ~objects.seen & self._unknown_sources(objects)[objects.source]
        if doubtful.any():
            objects = self._refine(objects, doubtful, aim)
        return Part(cells, objects)

    def _certified(self, block: np.ndarray, aim: bool) -> Part:
        """As `visible`, with a certificate of all that is hidden."""
        ledger = Ledger()
        if self.objects is None:
            left = np.zeros((self.model.graph.cell_count,) * 2, bool)
            left[tuple(certified_pairs(self.model, block, ledger).T)] = True
            # What is hidden from the other end is hidden.
            left[:, block] &= left[block].T
            cells = self._search_cells(block, np.argwhere(left), [], ledger)
            return Part(cells, no_objects(), ledger.close(np.zeros(0, bool)))
        cells = cell_rows(self.model, block, cell_visibility.AIM_ROUNDS if aim else (), ledger)
        if self._least_unknown == 0.0:
            cells = self._hide_cells(cells, ledger)
        return Part(cells, *seen_objects(self.occlusion, block, occlusion.AIM_ROUNDS if aim else (), ledger))

    def _unknown_sources(self, rows: ObjectRows) -> np.ndarray:
        """Cells of whose potential objects so many are unknown that the occluders are asked, shape (cells,), bool."""
        count = self.model.graph.cell_count
        unknown = np.bincount(rows.source[~rows.seen], minlength=count)
        return unknown > np.minimum(self._least_unknown, 1.0) * np.bincount(rows.source, minlength=count)

    def _hide_cells(self, rows: CellRows, ledger: Ledger | None = None) -> CellRows:
        """Rows without the unknown cells that occluders hide."""
        todo = np.flatnonzero(~rows.seen & (rows.source != rows.target))
        hidden = np.zeros(len(rows.source), bool)
        boxes = self.model.graph.cells[rows.target[todo]]
        hidden[todo] = hidden_boxes(self.occlusion, rows.source[todo], boxes, ledger)
        # Only rows with a witness have portals.
        columns = [column[~hidden] for column in (rows.source, rows.target, rows.seen, rows.origin, rows.end)]
        return CellRows(*columns, rows.portal_counts[~hidden], rows.portals)

    def _refine(self, rows: ObjectRows, doubtful: np.ndarray, aim: bool) -> ObjectRows:
        """Rows with the doubtful ones decided by occluders, as far as they can."""

        def part(chosen: np.ndarray) -> list[np.ndarray]:
            return [column[chosen] for column in (rows.source, rows.target, rows.seen, rows.origin, rows.end)]

        better, _ = refine_objects(self.occlusion, ObjectRows(*part(doubtful)), occlusion.AIM_ROUNDS if aim else ())
        found = (better.source, better.target, better.seen, better.origin, better.end)
        joined = [np.concatenate(pair) for pair in zip(part(~doubtful), found, strict=True)]
        order = np.lexsort((joined[1], joined[0]))
        return ObjectRows(*(column[order] for column in joined))

    def unknown(self, block: np.ndarray) -> Part:
        """Rows that claim nothing: every cell and object stays potential."""
        count = self.model.graph.cell_count
        source, reached = np.repeat(block, count), np.tile(np.arange(count), len(block))
        places = np.zeros((len(source), 3))
        nothing = np.zeros(len(source), bool)
        cells = CellRows(source, reached, nothing, places, places, np.zeros(len(source), int), np.zeros(0, np.int32))
        return Part(cells, unknown_objects(block, self.object_count))

    def join(self, parts: list[Part]) -> tuple[VisibleRows | None, VisibleRows]:
        """Tables of all blocks, made symmetric: A sees B exactly when B sees A."""
        return join_rows(self.model, [part.cells for part in parts]), join_objects(parts)

    def _flood(self, sources: np.ndarray) -> CellRows:
        """Rows of a bare graph: portal sequences where they end soon, the target search for the rest."""
        model, count = self.model, self.model.graph.cell_count
        cap = 400 + count // 2
        options = {"cap": cap, "threads": model.threads, "device": model.device}
        # A line can be followed either way, so when every cell is a source, half the octants find every pair.
        octants = (0, 2, 4, 6) if len(sources) == count else tuple(range(8))
        sample = sources[:: max(1, len(sources) // SAMPLE)]
        explodes = launch_flood(model.device_graph, sample, octants, **options).complete.mean() < 0.75
        row_of = np.full(count, -1)
        row_of[sources] = np.arange(len(sources))
        # 0: not looked at, 1: has a line, 2: hidden.
        state = np.zeros((len(sources), count), np.uint8)
        state[np.arange(len(sources)), sources] = 1
        lines = []
        if not explodes:
            found = launch_flood(model.device_graph, sources, octants, **options)
            row, cell = found.pairs[:, 0], found.pairs[:, 1]
            lines.append(
                self._lines(TargetAnswers(None, None, found.pairs[:, 2], found.line, found.offset), sources[row], cell)
            )
            state[found.complete] = 2
            state[found.undecided] = 0
            state[row, cell] = 1
            both = row_of[cell] >= 0
            state[row_of[cell[both]], sources[row[both]]] = 1
            if len(octants) == 4:
                # Half the octants prove a pair hidden only together with the other end's half.
                state[(state == 2) & (state.T == 0)] = 0
        todo = np.argwhere(state == 0)
        return self._search_cells(sources, np.column_stack([sources[todo[:, 0]], todo[:, 1]]), lines)

    def _search_cells(
        self, sources: np.ndarray, pairs: np.ndarray, lines: list[tuple], ledger: Ledger | None = None
    ) -> CellRows:
        """Rows of a bare graph from some lines and a target search of the pairs that may have more."""
        row_of = np.full(self.model.graph.cell_count, -1)
        row_of[sources] = np.arange(len(sources))
        once = (row_of[pairs[:, 1]] < 0) | (pairs[:, 0] < pairs[:, 1])
        rows, answers = search_pairs(self.model, pairs[once], ledger)
        kept = np.flatnonzero(answers.verdict == 1)
        taken = TargetAnswers(None, None, answers.octant[kept], answers.line[kept], answers.offset[kept])
        lines = [*lines, self._lines(taken, rows[kept, 0], rows[kept, 1])]
        doubtful = np.flatnonzero(answers.verdict == 2)
        lines.append((rows[doubtful, 0], rows[doubtful, 1], np.zeros((len(doubtful), 3)), np.zeros((len(doubtful), 3))))
        source, reached, origin, end = (np.concatenate(column) for column in zip(*lines, strict=True))
        back = row_of[reached] >= 0
        source, reached = np.concatenate([source, reached[back]]), np.concatenate([reached, source[back]])
        origin, end = np.concatenate([origin, end[back]]), np.concatenate([end, origin[back]])
        return portal_rows(self.model, sources, source, reached, origin, end)

    def _lines(
        self, answers: TargetAnswers, source: np.ndarray, reached: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        cells = self.model.graph.cells
        origin, end = segments(answers, np.arange(len(source)), cells[source], cells[reached])
        return source, reached, origin, end


class ViewCellEngine:
    """A model on a device, ready to answer from view cells of any kind: about objects, not about cells."""

    def __init__(
        self,
        scene: Scene,
        graph: CellGraph,
        opaque: OpaquePlanes,
        *,
        seed: int,
        threads: int,
        device: str,
        method: str = "occluders",
        portal_graph: CellGraph | None = None,
        certify: bool = False,
        vlod: VlodSettings | None = None,
    ) -> None:
        """Copy what visibility needs to the device; arguments as of `Engine`, the graph without portals.

        Args:
            scene: the model.
            graph: view cells.
            opaque: opaque rectangles of the model's occluders.
            seed: of the random sightlines.
            threads: CPU threads.
            device: Warp device.
            method: "occluders"; "vlod" for those of solvers/visibility/projection.py; "portals", "both" to hide what no
                line between live cells of `portal_graph` reaches.
            portal_graph: cells and portals of the model.
            certify: call hidden only what has a certificate, and keep it; all methods then hide by occluders alone.
            vlod: how the method "vlod" treats view cells.
        """
        self._certify = certify
        self._vlod = vlod if method == "vlod" and not certify else None
        self.object_count = len(scene.objects)
        self._solids = closed_elements(scene)
        sights = Sights(scene, opaque, graph.cells, device)
        blockers = None if portal_graph is None or certify else find_blockers(portal_graph, sights.opaque)
        shadows = method != "portals" or certify
        self.model, found = sights.occlusion(scene, graph.cells, seed, threads, device, blockers, shadows)
        self.occluders = region_blockers(found[0]), *found

    def with_cells(self, cells: np.ndarray) -> "ViewCellEngine":
        """The same engine for other view cells [grid steps], shape (n, 2, 3), int32."""
        other = copy(self)
        other.model = replace(self.model, cells=cells, solids=SolidIndex(cells, self._solids))
        return other

    def compile(self) -> None:
        """Load the kernels, so that their compilation is not counted as visibility."""
        for module in (target, shaft, sightline, *([line_tree] if self._certify else [])):
            wp.load_module(module.__name__, device=self.model.device)

    def visible(self, block: np.ndarray, *, aim: bool = True) -> Part:
        """Rows of some view cells; without `aim` the same pairs are hidden and fewer of the others are seen."""
        if self._vlod is not None:
            return Part(None, self._by_projection_points(block, aim))
        ledger = Ledger() if self._certify else None
        rows, proofs = seen_objects(self.model, block, occlusion.AIM_ROUNDS if aim else (), ledger)
        return Part(None, rows, proofs)

    def _by_projection_points(self, block: np.ndarray, aim: bool) -> ObjectRows:
        """What shrunk occluders do not hide, with the witnesses that were found."""
        model, (_, regions, patches) = self.model, self.occluders
        outlines = join_outlines(rectangle_outlines(regions.boxes), patches)
        owners = np.repeat(np.arange(self.object_count), np.diff(model.occludees.starts))
        options = {"objects": self.object_count, "threads": model.threads, "device": model.device}
        hidden, _ = vlod_hidden(model.cells[block], outlines, model.occludees.pieces, owners, self._vlod, **options)
        rows, target = np.nonzero(~hidden)
        rows = ObjectRows.unseen(block[rows], target)
        look_at_objects(model, rows, occlusion.AIM_ROUNDS if aim else ())
        return rows

    def unknown(self, block: np.ndarray) -> Part:
        """Rows that claim nothing: every object stays potential."""
        return Part(None, unknown_objects(block, self.object_count))

    def join(self, parts: list[Part]) -> tuple[VisibleRows | None, VisibleRows]:
        """Tables of all blocks: none of cells, and objects."""
        return None, join_objects(parts)


def unknown_objects(block: np.ndarray, count: int) -> ObjectRows:
    """Every object from every cell of the block, without a witness."""
    return ObjectRows.unseen(np.repeat(block, count), np.tile(np.arange(count), len(block)))


def relabelled(part: Part, places: np.ndarray) -> Part:
    """Object rows and proofs with cell c called places[c], and without those of cells whose place is -1."""
    rows, proofs = part.objects, part.proofs
    kept = np.flatnonzero(places[rows.source] >= 0)
    columns = [column[kept] for column in (rows.target, rows.seen, rows.origin, rows.end)]
    proofs = None if proofs is None else proofs.relabelled(places)
    return Part(None, ObjectRows(places[rows.source[kept]], *columns), proofs)


def region_blockers(regions: Regions) -> Blockers:
    """Rectangles of regions as the target search wants them."""
    return Blockers(regions.boxes, regions.axis[regions.region], regions.hierarchy)


def join_objects(parts: list[Part]) -> VisibleRows:
    """Objects of all blocks as one table, ordered by source, then target."""
    columns = [
        np.concatenate([getattr(part.objects, name) for part in parts])
        for name in ("source", "target", "seen", "origin", "end")
    ]
    order = np.lexsort((columns[1], columns[0]))
    source, reached, seen, origin, end = (column[order] for column in columns)
    return VisibleRows(source.astype(np.int32), reached.astype(np.int32), seen, origin, end)


def find_occluders(scene: Scene, opaque: OpaquePlanes, *, shadows: bool = True) -> tuple[Regions, Patches]:
    """Axial regions and oblique patches of a model; none without `shadows`.

    Args:
        scene: the model.
        opaque: opaque rectangles of its occluders and furniture.
        shadows: whether there are to be any.
    """
    corners, owners = scene.triangles()
    least = PATCH_M2 / scene.grid_m**2
    solid = np.flatnonzero(scene.object_mask(Role.OCCLUDER, Role.DETAIL)[owners] & shadows)
    # The extent bounds the area, and most triangles of a large model are small ones of furniture and pipes.
    solid = solid[flat_area(np.ptp(corners[solid], axis=1)) >= PATCH_SHARE * least]
    edges = (corners[solid, 1:] - corners[solid, :1]).astype(float)
    solid = solid[np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) >= 2 * PATCH_SHARE * least]
    patches = find_patches(corners[solid], owners[solid], least_area=least)
    return find_regions(scene, opaque, sections=shadows), patches


def with_details(scene: Scene, opaque: OpaquePlanes) -> OpaquePlanes:
    """The occluders' opaque rectangles and the large ones of details (furniture)."""
    triangles, owners = scene.triangles()
    triangles = triangles[scene.object_mask(Role.DETAIL)[owners]]
    least = BLOCKING_DETAIL_M2 / scene.grid_m**2
    boxes = []
    # Half of a large rectangle is a large triangle; the fans that close round tops are not worth looking at.
    large = opaque_planes(triangles[flat_area(np.ptp(triangles, axis=1)) >= least], oblique_steps=1)
    for axis, (mine, others) in enumerate(zip(large.boxes, opaque.boxes, strict=True)):
        both = np.concatenate([others, mine[flat_area(mine[:, 1] - mine[:, 0]) >= least]])
        boxes.append(both[np.argsort(both[:, 0, axis], kind="stable")])
    return OpaquePlanes(boxes, opaque.axial_area, opaque.lost_area)


def flat_area(extent: np.ndarray) -> np.ndarray:
    """Area of the two longest sides of boxes with this extent, shape (n, 3), float64."""
    return np.sort(extent.astype(float), axis=1)[:, 1:].prod(axis=1)


def no_objects() -> ObjectRows:
    """Rows of a bare graph, which has no objects."""
    return ObjectRows.unseen(np.zeros(0, int), np.zeros(0, int))
