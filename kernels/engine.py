"""Visibility of a prepared model, a block of sources at a time."""

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..data.blockers import find_blockers
from ..data.database import VisibleRows
from ..data.graph import CellGraph
from ..data.incidence import populate
from ..data.opaque import OpaquePlanes, opaque_planes
from ..data.scene import Role, Scene
from ..data.solids import SolidIndex, closed_elements
from . import cell_visibility, flood, object_visibility, sightline, target, walk
from .cell_visibility import CellRows, Model, cell_rows, join_rows, portal_rows, search_rounds, segments
from .flood import launch_flood
from .object_visibility import ObjectModel, ObjectRows, object_rows
from .sightline import aim_targets, device_triangles
from .target import TargetAnswers

# A flood is tried on this many sources first; where more than a quarter run into the cap, sequences explode.
SAMPLE = 24
# Smaller pieces of furniture hide little and would fill the hierarchy of blockers.
BLOCKING_DETAIL_M2 = 0.1


@dataclass
class Part:
    """Rows of one block of sources."""

    cells: CellRows
    objects: ObjectRows

    @property
    def unknown_count(self) -> int:
        """Pairs without a witness."""
        return int((~self.cells.seen).sum() + (~self.objects.seen).sum())


class Engine:
    """A model or a bare graph on a device, ready to answer."""

    def __init__(
        self,
        scene: Scene | None,
        graph: CellGraph,
        opaque: OpaquePlanes | None,
        *,
        seed: int,
        threads: int,
        device: str,
    ) -> None:
        """Copy what visibility needs to the device.

        Args:
            scene: the model; None for a bare graph.
            graph: its cells and portals.
            opaque: opaque rectangles of its occluders; None for a bare graph.
            seed: of the random sightlines.
            threads: CPU threads.
            device: Warp device.
        """
        self.objects = None
        self.object_count = 0
        triangles = targets = solids = opaque_rectangles = None
        if scene is not None:
            corners, owners = scene.triangles()
            solid = scene.object_mask(Role.OCCLUDER, Role.DETAIL)[owners]
            opaque_rectangles = with_details(scene, opaque)
            triangles = device_triangles(corners[solid], owners[solid], device)
            targets = aim_targets(corners, device)
            solids = SolidIndex(graph.cells, closed_elements(scene))
            self.object_count = len(scene.objects)
            starts = np.searchsorted(owners, np.arange(self.object_count + 1))
            self.objects = ObjectModel(populate(scene, graph.cells), np.column_stack([starts[:-1], starts[1:]]))
        blockers = find_blockers(graph, opaque_rectangles)
        self.model = Model(graph, blockers, triangles, targets, solids, device, threads, seed)

    def compile(self) -> None:
        """Load the kernels, so that their compilation is not counted as visibility."""
        modules = [target, walk, sightline] if self.objects is not None else [target, walk, flood]
        for module in modules:
            wp.load_module(module.__name__, device=self.model.device)

    def visible(self, block: np.ndarray, *, aim: bool = True) -> Part:
        """Rows of some inhabitable cells; of all of them at once for a bare graph.

        Args:
            block: the cells.
            aim: shoot at what the axial model allows but whose own line the true triangles stop. Without it the same
                pairs are hidden, in a fraction of the time, and more of the others stay unknown.
        """
        if self.objects is None:
            return Part(self._flood(block), no_objects())
        rounds = (cell_visibility.AIM_ROUNDS, object_visibility.AIM_ROUNDS) if aim else ((), ())
        cells = cell_rows(self.model, block, rounds[0])
        return Part(cells, object_rows(self.model, self.objects, cells, rounds[1]))

    def unknown(self, block: np.ndarray) -> Part:
        """Rows that claim nothing: every cell and object stays potential."""
        count = self.model.graph.cell_count
        source, reached = np.repeat(block, count), np.tile(np.arange(count), len(block))
        places = np.zeros((len(source), 3))
        nothing = np.zeros(len(source), bool)
        cells = CellRows(source, reached, nothing, places, places, np.zeros(len(source), int), np.zeros(0, np.int32))
        source = np.repeat(block, self.object_count)
        objects = np.tile(np.arange(self.object_count), len(block))
        places = np.zeros((len(source), 3))
        return Part(cells, ObjectRows(source, objects, np.zeros(len(source), bool), places, places))

    def join(self, parts: list[Part]) -> tuple[VisibleRows, VisibleRows]:
        """Tables of all blocks, made symmetric: A sees B exactly when B sees A."""
        cells = join_rows(self.model, [part.cells for part in parts])
        columns = [
            np.concatenate([getattr(part.objects, name) for part in parts])
            for name in ("source", "target", "seen", "origin", "end")
        ]
        order = np.lexsort((columns[1], columns[0]))
        source, reached, seen, origin, end = (column[order] for column in columns)
        return cells, VisibleRows(source.astype(np.int32), reached.astype(np.int32), seen, origin, end)

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
        once = (row_of[todo[:, 1]] < 0) | (sources[todo[:, 0]] < todo[:, 1])
        todo = todo[once]
        rows = np.column_stack([sources[todo[:, 0]], todo[:, 1], np.zeros(len(todo), int)])
        answers = search_rounds(model, model.graph.cells, rows)
        kept = np.flatnonzero(answers.verdict == 1)
        taken = TargetAnswers(None, None, answers.octant[kept], answers.line[kept], answers.offset[kept])
        lines.append(self._lines(taken, rows[kept, 0], rows[kept, 1]))
        doubtful = np.flatnonzero(answers.verdict == 2)
        lines.append((rows[doubtful, 0], rows[doubtful, 1], np.zeros((len(doubtful), 3)), np.zeros((len(doubtful), 3))))
        source, reached, origin, end = (np.concatenate(column) for column in zip(*lines, strict=True))
        back = row_of[reached] >= 0
        source, reached = np.concatenate([source, reached[back]]), np.concatenate([reached, source[back]])
        origin, end = np.concatenate([origin, end[back]]), np.concatenate([end, origin[back]])
        return portal_rows(model, sources, source, reached, origin, end)

    def _lines(
        self, answers: TargetAnswers, source: np.ndarray, reached: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        cells = self.model.graph.cells
        origin, end = segments(answers, np.arange(len(source)), cells[source], cells[reached])
        return source, reached, origin, end


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
    none, places = np.zeros(0, int), np.zeros((0, 3))
    return ObjectRows(none, none, np.zeros(0, bool), places, places)
