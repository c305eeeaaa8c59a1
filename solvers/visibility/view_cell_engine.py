"""Visibility of a model from view cells of any kind: of objects, not of cells."""

from copy import copy

import numpy as np
import warp as wp

from ...data.blockers import Blockers
from ...data.graph import CellGraph
from ...data.patches import Patches
from ...data.plans import NO_PLANS, Plans
from ...data.prepared import PreparedModel
from ...data.regions import Regions
from ...data.rows import Rows
from ...kernels import aim, line_tree, shaft, sightline, target
from ...kernels.launch import CPU, Device
from .aim import AIM_ROUNDS, Sights
from .engine import Part, join_objects, unknown_rows
from .glance import glance
from .ledger import Ledger
from .occluders import OccluderModel, left_by_groups, look_at_objects, seen_objects
from .projection import VlodSettings, vlod_hidden
from .shared import share_sightlines


class ViewCellEngine:
    """An `Engine` for a model and view cells, which may overlap each other and solids."""

    def __init__(
        self,
        model: PreparedModel,
        cells: np.ndarray,
        *,
        device: Device = CPU,
        seed: int = 0,
        method: str = "occluders",
        portal_graph: CellGraph | None = None,
        certify: bool = False,
        vlod: VlodSettings | None = None,
        plans: Plans = NO_PLANS,
    ) -> None:
        """Copy what visibility needs to the device.

        Args:
            model: the model.
            cells: view cells [grid steps], shape (n, 2, 3), int32.
            device: where to.
            seed: of the random sightlines.
            method: "occluders"; "vlod" for those of solvers/visibility/projection.py; "portals", "both" to hide what no
                line between live cells of `portal_graph` reaches.
            portal_graph: cells and portals of the model.
            certify: call hidden only what has a certificate, and keep it; all methods then hide by occluders alone.
            vlod: how the method "vlod" treats view cells.
            plans: of view cells that are prisms in their boxes.
        """
        self._certify, self._prepared = certify, model
        self._vlod = vlod if method == "vlod" and not certify else None
        self._objects = len(model.scene.objects)
        blockers = None if portal_graph is None or certify else model.blockers(portal_graph)
        sights = Sights.of(model, cells, seed, device, plans)
        shadows = method != "portals" or certify
        self.model = OccluderModel.of(sights, blockers=blockers, shadows=shadows, certify=certify)

    @property
    def proof_occluders(self) -> tuple[Blockers, Regions, Patches]:
        """As of `Engine`."""
        return self._prepared.walls, self._prepared.regions, self._prepared.patches

    def from_cells(self, cells: np.ndarray) -> "ViewCellEngine":
        """The same engine for other view cells [grid steps], shape (n, 2, 3), int32."""
        other = copy(self)
        other.model = self.model.from_cells(cells)
        return other

    def compile(self) -> None:
        """As of `Engine`."""
        for module in (target, shaft, sightline, aim, *([line_tree] if self._certify else [])):
            wp.load_module(module.__name__, device=self.model.sights.device.name)

    def visible(self, block: np.ndarray, *, aim: bool = True) -> Part:
        """As of `Engine`."""
        rounds = AIM_ROUNDS if aim else ()
        if self._vlod is not None:
            return Part(None, self._by_projection_points(block, rounds))
        return Part(None, *seen_objects(self.model, block, rounds, Ledger() if self._certify else None))

    def _by_projection_points(self, block: np.ndarray, aim_rounds: tuple[int, ...]) -> Rows:
        """What shrunk occluders do not hide, with the witnesses that were found."""
        model, parts = self.model, self.model.occludees
        outlines, options = self._prepared.outlines, {"objects": self._objects, "device": model.sights.device}
        hidden, _ = vlod_hidden(model.cells[block], outlines, parts.pieces, parts.owners, self._vlod, **options)
        rows, found = np.nonzero(~hidden)
        rows = Rows.unseen(block[rows], found)
        look_at_objects(model, rows, aim_rounds)
        return rows

    def glance(self, block: np.ndarray, number: int) -> Rows:
        """As of `Engine`."""
        return glance(self.model.sights, block, number)

    def coarse(self, cells: np.ndarray, group: np.ndarray, known: Rows) -> Rows | None:
        """As of `Engine`; certificates speak of single cells, and vLOD's method hides by nothing else."""
        whole = self._certify or self._vlod is not None
        return None if whole else left_by_groups(self.model, cells, group, known)

    def unknown(self, block: np.ndarray) -> Part:
        """As of `Engine`."""
        return Part(None, unknown_rows(block, self._objects))

    def join(self, parts: list[Part], *, share: bool = True) -> tuple[None, Rows]:
        """As of `Engine`; nothing is claimed of cells."""
        objects = join_objects(parts)
        if share:
            share_sightlines(self.model.sights, objects)
        return None, objects
