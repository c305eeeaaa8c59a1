"""What a bake would find to stand in, what leaks out of it, and how long it would take."""

import time
from dataclasses import dataclass, field

import numpy as np

from ...data.cracks import crack_portals
from ...data.graph import CellGraph
from ...data.prepared import PreparedModel
from ...data.scene import Scene
from ..bake.cells import PORTAL_TRIANGLES, build_graph
from ..bake.manifest import Clock
from ..bake.settings import Settings

# Openings no wider than this are cracks; the first of the pair is no wider than modelling is exact.
CRACKS_M = (0.01, 0.05)
# Cells that a bake is tried on, and how long it may take.
TRIED, TRIED_S = 6, 20.0
NEAREST = 2


@dataclass(frozen=True)
class Crack:
    """A narrow opening between two cells.

    Attributes:
        box: [m], in the scene's frame, shape (2, 3), float64.
        width_m, length_m: of its two sides.
        between: names of the opaque objects nearest to its middle.
        rooms: whether it leads into an inhabitable cell.
    """

    box: np.ndarray
    width_m: float
    length_m: float
    between: tuple[str, ...]
    rooms: bool


@dataclass
class Cells:
    """What the cell-and-portal graph says of a model.

    Attributes:
        graph: None where the model is too large to be cut; a bake then takes an octree.
        because: why cells are inhabitable.
        leak: cells on the way from the outside to the middle of the building, shut openings aside; empty if none.
        cracks: openings up to the larger of CRACKS_M, those into rooms first, then by length.
        seconds: of cutting the model.
        bake_s: what a bake would take on one core, from a few cells; None if it was not tried.
    """

    graph: CellGraph | None
    because: str = ""
    leak: list[int] = field(default_factory=list)
    cracks: list[Crack] = field(default_factory=list)
    seconds: float = 0.0
    bake_s: float | None = None

    @property
    def counts(self) -> tuple[int, int, int]:
        """Cells, inhabitable ones, portals."""
        if self.graph is None:
            return 0, 0, 0
        return self.graph.cell_count, int(self.graph.inhabitable.sum()), self.graph.portal_count


def find_cells(model: PreparedModel, *, tried: int = TRIED) -> Cells:
    """Cut a model as `bake` does, look for cracks, and try a few cells.

    Args:
        model: the model.
        tried: inhabitable cells to bake for the estimate; 0 for none.
    """
    if len(model.scene.triangles()[0]) > PORTAL_TRIANGLES:
        return Cells(None, "too many triangles to be cut into cells: an octree of view cells is used")
    start = time.perf_counter()
    graph, notes = build_graph(model, Settings(), Clock())
    found = Cells(graph, notes["inhabitable_because"], notes["leak_cells"], find_cracks(model.scene, graph))
    found.seconds = time.perf_counter() - start
    if tried and graph.inhabitable.any():
        found.bake_s = _estimate(model, graph, tried)
    return found


def find_cracks(scene: Scene, graph: CellGraph) -> list[Crack]:
    """Openings no wider than a crack, in pieces as cells cut them; those into rooms first, the longest first."""
    sides = graph.portal_sides * scene.grid_m
    narrow = np.flatnonzero(crack_portals(graph, CRACKS_M[-1] / scene.grid_m))
    rooms = graph.inhabitable[graph.portal_cells[narrow]].any(axis=1)
    order = np.lexsort([narrow, -sides[narrow, 1], ~rooms])
    boxes, opaque = scene.object_bounds(), np.flatnonzero([placed.opaque for placed in scene.objects])
    cracks = []
    for place in order:
        portal = narrow[place]
        box = graph.portals[portal]
        apart = np.maximum(boxes[opaque, 0] - box[1], box[0] - boxes[opaque, 1])
        # Of those that touch it, what runs along it.
        along = np.minimum(boxes[opaque, 1], box[1]) - np.maximum(boxes[opaque, 0], box[0])
        near = opaque[np.lexsort([-np.maximum(along, 0).sum(axis=1), apart.max(axis=1)])[:NEAREST]]
        names = tuple(scene.objects[i].name for i in near)
        low, high = sides[portal]
        cracks.append(Crack(box * scene.grid_m, float(low), float(high), names, bool(rooms[place])))
    return cracks


def _estimate(model: PreparedModel, graph: CellGraph, tried: int) -> float:
    """Seconds that all inhabitable cells would take, from some that are spread over them."""
    from ...solvers.visibility.portal_engine import PortalEngine

    engine = PortalEngine(model, graph, method="auto")
    engine.compile()
    rooms = np.flatnonzero(graph.inhabitable)
    chosen = rooms[np.unique(np.linspace(0, len(rooms) - 1, min(tried, len(rooms))).astype(int))]
    engine.visible(chosen[:1])
    start, done = time.perf_counter(), 0
    for cell in chosen:
        engine.visible(np.array([cell]))
        done += 1
        if time.perf_counter() - start > TRIED_S:
            break
    return (time.perf_counter() - start) / done * len(rooms)
