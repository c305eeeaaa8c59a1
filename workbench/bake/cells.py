"""Where a bake looks from: cells and portals of a model, an octree, walkways, a table of boxes, or a bare graph."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...data.cracks import crack_portals
from ...data.errors import InputError
from ...data.graph import CellGraph
from ...data.inhabit import find_inhabitable
from ...data.plausible import implausible
from ...data.plural import counted
from ...data.portals import find_portals
from ...data.prepared import PreparedModel
from ...data.room_cells import add_room_cells
from ...data.scene import GRID_LIMIT, GRID_M, Role
from ...data.solids import dead_cells
from ...data.store.graph_folder import read_graph
from ...data.store.scene_folder import scene_manifest
from ...data.store.view_cells import read_view_cells
from ...data.subdivide import cut_large, cut_rooms, merge, subdivide
from ...data.view_cells import as_graph, octree_roots, walkable
from ...data.walkways import walkway_cells
from .halve import halved
from .manifest import Clock
from .settings import Settings

MARGIN_M = 2.0
# Models with more triangles than this are not cut into portal cells unless asked.
PORTAL_TRIANGLES = 3_000_000


@dataclass
class Sources:
    """A model and its cells, ready for visibility.

    Attributes:
        model: None for a bare graph.
        graph: its cells; view cells have no portals.
        facts: what the manifest says of it.
        view_cells: whether the cells are view cells, about which nothing but objects is claimed.
        method: what "auto" came to.
        portal_graph: the cell-and-portal graph beside view cells, if the method wants one.
        closed: portals that a seal took out of `graph`; None if there is no seal.
    """

    model: PreparedModel | None
    graph: CellGraph
    facts: dict
    view_cells: bool
    method: str
    portal_graph: CellGraph | None = None
    closed: CellGraph | None = None

    @property
    def objects(self) -> int:
        """Objects of the model."""
        return 0 if self.model is None else len(self.model.scene.objects)

    @property
    def octree(self) -> bool:
        """Whether cells may be refined."""
        return self.facts.get("inhabitable_because") == "octree"


def bare_sources(folder: Path, settings: Settings, clock: Clock) -> Sources:
    """Cells of a bare graph.

    Raises:
        InputError: it is unreadable, or the settings want a model.
    """
    if settings.seal:
        raise InputError(f"{folder}: expected a model to seal, found a bare graph")
    if settings.refine_kept or settings.largest_cell:
        raise InputError(f"{folder}: expected a model whose cells to cut, found a bare graph")
    if settings.split or settings.lods:
        raise InputError(f"{folder}: expected a model to split or to simplify, found a bare graph")
    if settings.method in ("occluders", "both", "vlod") or settings.cells not in ("", "portals"):
        raise InputError(f"{folder}: expected a model for occluders and view cells, found a bare graph")
    graph, snapped = read_graph(folder)
    clock.lap("read")
    facts = {"source": str(folder), "sha256": "", "unit": "metre", "grid_m": GRID_M, "origin": [0.0] * 3}
    facts |= {"max_snap_m": snapped, "skipped": [], "counts": {"objects": 0}}
    return Sources(None, graph, facts, False, "portals")


def model_sources(model: PreparedModel, settings: Settings, clock: Clock) -> Sources:
    """Cells of a model as the settings want them.

    Raises:
        InputError: a method that cannot be had from such cells, or an unusable table.
    """
    scene = model.scene
    facts = scene_manifest(scene)
    warnings = [fault.line() for fault in implausible(scene)]
    if not model.closed:
        warnings.append("no closed opaque solid: only surfaces occlude, and every point counts as outside")
    if warnings:
        facts["warnings"] = warnings
    clock.lap("read")
    cells, method = settings.cells, settings.method
    large = len(scene.triangles()[0]) > PORTAL_TRIANGLES
    if not cells:
        cells = "octree" if method in ("occluders", "vlod") or (method == "auto" and large) else "portals"
    if cells == "portals" and method in ("occluders", "vlod"):
        raise InputError(f"cells: expected octree, walkways or a table for the method {method}, found portals")
    if cells == "portals":
        graph, notes = build_graph(model, settings, clock)
        if settings.largest_cell:
            parts = cut_large(graph.cells, graph.inhabitable, settings.largest_cell / scene.grid_m)
            graph, notes = _cut_graph(model, graph, notes, *parts)
        if settings.refine_kept:
            parts = halved(model, graph.cells, graph.inhabitable, settings.refine_kept, settings.seed)
            graph, notes = _cut_graph(model, graph, notes, *parts)
            clock.lap("halve")
        graph, rooms = _with_rooms(model, graph)
        notes |= rooms
        clock.lap("portals")
        if not settings.seal:
            return Sources(model, graph, facts | notes, False, method)
        cracks = crack_portals(graph, settings.seal / scene.grid_m)
        closed, graph = graph.with_portals(cracks), graph.with_portals(~cracks)
        clock.lap("portals")
        return Sources(model, graph, facts | notes, False, method, closed=closed)
    if settings.seal:
        raise InputError("seal: expected a model that is cut into portal cells, found one too large; --cells portals")
    if settings.largest_cell:
        raise InputError(f"largest-cell: expected portal cells, found {cells}; --cell-size bounds those of an octree")
    if settings.refine_kept:
        raise InputError(f"refine-kept: expected portal cells, found {cells}; --refine-gap refines an octree")
    if method == "auto":
        method = "occluders"
    clock.show("view cells")
    # With certificates nothing is hidden by portals alone: the model is what a proof is checked against.
    wanted = method in ("portals", "both") and not settings.certify
    portal_graph = build_graph(model, settings, clock)[0] if wanted else None
    if cells == "octree":
        roots = octree_roots(scene, settings.cell_size_m)
        graph, because = as_graph(roots[walkable(roots, model)]), "octree"
    elif cells == "walkways":
        graph, because = as_graph(walkway_cells(model)), "walkways"
    else:
        graph, because = read_view_cells(cells, scene), "given"
    if portal_graph is not None:
        _check_inside(graph, portal_graph, method)
    clock.lap("view cells")
    return Sources(model, graph, facts | {"inhabitable_because": because}, True, method, portal_graph)


def _with_rooms(model: PreparedModel, graph: CellGraph) -> tuple[CellGraph, dict]:
    """The graph with view cells for rooms that its own do not cover, and what the manifest says of all rooms."""
    spaces, inhabitable = model.scene.spaces, graph.inhabitable
    bare = bool(spaces) and not (graph.cell_names[inhabitable] != "").any()
    if bare:
        # No cell along the axes lies in a room. Rooms have view cells of their own; only without any is it guessed.
        graph.inhabitable = np.zeros(graph.cell_count, bool)
    graph, covers = add_room_cells(model.scene, graph, model.room_points)
    notes = {"rooms": [cover.entry for cover in covers]}
    if bare and graph.inhabitable.any():
        notes["inhabitable_because"] = f"inside the model's {counted(len(spaces), 'room')}"
    elif bare:
        graph.inhabitable = inhabitable
    return graph, notes


def _cut_graph(
    model: PreparedModel, graph: CellGraph, notes: dict, boxes: np.ndarray, parents: np.ndarray
) -> tuple[CellGraph, dict]:
    """The graph with its cells cut into boxes; parts are inhabitable, and called, as their cell, their parent."""
    if len(boxes) == graph.cell_count:
        return graph, notes
    made = find_portals(boxes, model.planes)
    made.inhabitable, made.cell_names = graph.inhabitable[parents], graph.cell_names[parents]
    return made, notes | {"leak_cells": np.searchsorted(parents, notes["leak_cells"]).tolist()}


def _check_inside(graph: CellGraph, portal_graph: CellGraph, method: str) -> None:
    """The portal graph ends at its outermost faces, through which it knows no way: eyes beyond would see nothing.

    Raises:
        InputError: a view cell reaches out of it.
    """
    low, high = portal_graph.cells[:, 0].min(axis=0), portal_graph.cells[:, 1].max(axis=0)
    beyond = np.flatnonzero((graph.cells[:, 0] < low).any(axis=1) | (graph.cells[:, 1] > high).any(axis=1))
    if len(beyond):
        raise InputError(
            f"method {method}: expected view cells within {MARGIN_M:g} m of the model, found cell {beyond[0]} beyond; "
            "the method occluders takes them"
        )


def build_graph(model: PreparedModel, settings: Settings, clock: Clock) -> tuple[CellGraph, dict]:
    """Cells, portals and inhabitable cells of a model, and what the manifest says of them."""
    scene, opaque = model.scene, model.planes
    clock.lap("read")
    clock.show("subdivide")
    margin = round(MARGIN_M / scene.grid_m)
    # The grid's own limit is where the kernels stop being exact.
    low, high = np.clip(scene.bounds() + np.array([[-margin], [margin]]), -GRID_LIMIT, GRID_LIMIT)
    leaves = subdivide(opaque, low, high, settings.threshold_m2 / scene.grid_m**2)
    rooms = [[s.vertices.min(axis=0), s.vertices.max(axis=0)] for s in scene.spaces]
    boxes = np.round(np.array(rooms).reshape(-1, 2, 3) / scene.grid_m).astype(np.int64)
    cells = cut_rooms(merge(leaves, opaque), boxes)
    dead = dead_cells(cells, model.closed_of(Role.OCCLUDER))
    clock.lap("subdivide")
    clock.show("portals")
    graph = find_portals(cells[~dead], opaque)
    inhabited = find_inhabitable(scene, graph)
    graph.inhabitable, graph.cell_names = inhabited.mask, inhabited.names
    clock.lap("portals")
    notes = {
        "inhabitable_because": inhabited.reason,
        "leak_cells": inhabited.leak,
        "dead_cells": int(dead.sum()),
        "axial_area_m2": round(opaque.axial_area * scene.grid_m**2, 3),
        "axial_area_lost_m2": round(model.surfaces.lost_area * scene.grid_m**2, 3),
        "axial_area_carved_m2": round((opaque.lost_area - model.surfaces.lost_area) * scene.grid_m**2, 3),
    }
    return graph, notes
