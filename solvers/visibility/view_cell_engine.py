"""Visibility of a model from view cells of any kind: of objects, not of cells."""

from copy import copy
from dataclasses import replace
from threading import RLock

import numpy as np
import warp as wp
from embreex.rtcore_scene import EmbreeScene

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
from .coarse import left_by_nodes, narrowed, steps_below
from .engine import Part, join_objects, unknown_rows
from .glance import glance
from .ledger import Ledger
from .occluders import OccluderModel, look_at_objects, seen_objects
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
        self._sights = Sights.of(model, cells, seed, device, plans)
        self._options = {"blockers": blockers, "shadows": method != "portals" or certify, "certify": certify}
        # What stands at an angle takes most of the time of a large model, and is made when it is needed.
        self._making, self._ready = RLock(), False
        self._rough: OccluderModel | None = None
        self._complete: OccluderModel | None = None

    @property
    def model(self) -> OccluderModel:
        """All that hides, as far as it is made."""
        self.begin()
        return self._complete or self._rough

    @model.setter
    def model(self, model: OccluderModel) -> None:
        self._complete = model

    @property
    def proof_occluders(self) -> tuple[Blockers, Regions, Patches]:
        """As of `Engine`."""
        model = self._prepared
        # Where they were not made nothing was hidden, and no certificate names them.
        return model.walls if self._ready else model.regions.blockers, model.regions, model.patches

    def from_cells(self, cells: np.ndarray) -> "ViewCellEngine":
        """The same engine for other view cells [grid steps], shape (n, 2, 3), int32."""
        other = copy(self)
        other.model = self.model.from_cells(cells)
        other._sights = other.model.sights
        other._rough = replace(self._rough, sights=other.model.sights, frames=())
        return other

    @property
    def opaque(self) -> EmbreeScene | None:
        """As of `Engine`."""
        return self._sights.targets.opaque

    def begin(self, seconds: float = np.inf) -> bool:
        """As of `Engine`, by one thread for all."""
        with self._making:
            if self._rough is None:
                whole = self._certify or self._prepared.make_plainest(seconds)
                self._rough = OccluderModel.of(self._sights, **self._options, rough=True, bare=not whole)
            return self._prepared.whole

    def look(self, seconds: float = np.inf) -> bool:
        """As of `Engine`."""
        return self._sights.targets.make(seconds)

    def prepare(self, seconds: float = np.inf) -> bool:
        """As of `Engine`, by one thread for all."""
        with self._making:
            if self._ready or not (self.begin() and self.look(seconds)):
                return self._ready
            if not self._options["shadows"] or self._prepared.make_curtains(seconds):
                self.model = OccluderModel.of(self._sights, **self._options, shields=self._rough.shields)
                self._ready = True
            return self._ready

    def compile(self) -> None:
        """As of `Engine`."""
        for module in (target, shaft, sightline, aim, *([line_tree] if self._certify else [])):
            wp.load_module(module.__name__, device=self._sights.device.name)

    def visible(self, block: np.ndarray, *, aim: bool = True) -> Part:
        """As of `Engine`."""
        self.prepare()
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
        return glance(self._sights, block, number)

    def coarse_steps(self) -> int:
        """As of `Engine`; certificates speak of single cells, and vLOD's method hides by nothing else."""
        alone = self._certify or self._vlod is not None
        return 0 if alone else 1 + len(steps_below(self.model))

    def coarse(self, cells: np.ndarray, group: np.ndarray) -> Rows:
        """As of `Engine`."""
        return left_by_nodes(self._rough, cells, group)

    def narrow(self, rows: Rows, step: int) -> Rows:
        """As of `Engine`."""
        return narrowed(self._rough, self.model, rows, step)

    def unknown(self, block: np.ndarray, objects: Rows | None = None) -> Part:
        """As of `Engine`."""
        return Part(None, unknown_rows(block, self._objects) if objects is None else objects)

    def join(self, parts: list[Part], *, share: bool = True) -> tuple[None, Rows]:
        """As of `Engine`; nothing is claimed of cells."""
        objects = join_objects(parts)
        if share:
            share_sightlines(self._sights, objects)
        return None, objects
