"""Visibility of a model from the cells of its cell-and-portal graph: of cells and of objects."""

from functools import partial
from threading import Lock

import numpy as np
import warp as wp
from embreex.rtcore_scene import EmbreeScene

from ...data.blockers import Blockers
from ...data.graph import CellGraph
from ...data.incidence import populate
from ...data.patches import Patches
from ...data.prepared import PreparedModel
from ...data.progress import phase
from ...data.regions import Regions
from ...data.rows import Rows
from ...data.store.certificates import join_proofs
from ...kernels import aim, line_tree, shaft, sightline, target, trace
from ...kernels.clip import launch_clip
from ...kernels.launch import CPU, Device
from . import aim as aiming
from . import cells as cell_search
from .aim import Sights
from .cells import CellModel, cell_rows, join_cell_rows
from .coarse import left_by_nodes, narrowed, steps_below
from .engine import Part, join_objects, unknown_rows
from .glance import glance
from .ledger import Ledger
from .objects import object_rows
from .occluders import OccluderModel, hidden_boxes, refine_objects, seen_objects
from .shared import share_sightlines

# With "auto" the occluders are asked about cells of whose potential objects more than this share is unknown.
AUTO_UNKNOWN = 0.02
# What takes no longer is prepared without being put off.
AT_ONCE_S = 1.0
LEAST_UNKNOWN = {"portals": np.inf, "both": 0.0, "auto": AUTO_UNKNOWN}


class PortalEngine:
    """An `Engine` for a model and its cell-and-portal graph."""

    def __init__(
        self,
        model: PreparedModel,
        graph: CellGraph,
        *,
        device: Device = CPU,
        seed: int = 0,
        method: str = "portals",
        certify: bool = False,
    ) -> None:
        """Copy what visibility needs to the device.

        Args:
            model: the model.
            graph: its cells and portals.
            device: where to.
            seed: of the random sightlines.
            method: "portals"; "both" to ask the occluders about every pair that portals leave unknown; "auto" to ask
                only where much is unknown.
            certify: call hidden only what has a certificate, and keep it. All methods then hide by the model's
                occluders, which can be checked against the model alone; "portals" leaves out oblique ones for cells.
        """
        self._occluders, self._rough, self._making = None, None, Lock()
        self._certify, self._least_unknown = certify, LEAST_UNKNOWN[method]
        self._objects = len(model.scene.objects)
        tiles = graph.tiles
        self._sights = Sights.of(model, graph.cells, seed, device, graph.plans)
        self._sights.targets.make()
        self._incidence = populate(model.scene, tiles.cells, partial(launch_clip, device=device))
        blockers = model.walls if certify else model.blockers(tiles)
        self.model = CellModel(tiles, blockers, self._sights, seed, device)

    @property
    def proof_occluders(self) -> tuple[Blockers, Regions, Patches]:
        """As of `Engine`."""
        return self.model.blockers, self._sights.model.regions, self._sights.model.patches

    @property
    def occluders(self) -> OccluderModel:
        """Occluders of the model, made when they are first asked, by one thread for all."""
        with self._making:
            if self._occluders is None:
                # Once for all blocks: what takes them no longer says nothing of the rest.
                with phase("occluders"):
                    wp.load_module(shaft.__name__, device=self.model.device.name)
                    self._occluders = OccluderModel.of(self._sights, certify=self._certify)
            return self._occluders

    @property
    def opaque(self) -> EmbreeScene | None:
        """As of `Engine`."""
        return self._sights.targets.opaque

    def begin(self, seconds: float = np.inf) -> bool:
        """As of `Engine`: of occluders; portals are made."""
        return self._hides_alone or self._sights.model.make_plainest(seconds)

    def look(self, seconds: float = np.inf) -> bool:
        """As of `Engine`: all is made."""
        return True

    def prepare(self, seconds: float = np.inf) -> bool:
        """As of `Engine`; without a limit occluders are made when they are first asked."""
        if seconds < np.inf and not self._hides_alone:
            if not (self._sights.model.whole and self._sights.model.make_curtains(max(seconds, AT_ONCE_S))):
                return False
            _ = self.occluders
        return True

    @property
    def _hides_alone(self) -> bool:
        """Whether portals hide, and occluders do not, or as certificates want it."""
        return self._certify or self._least_unknown == np.inf

    def compile(self) -> None:
        """As of `Engine`."""
        modules = [target, trace, sightline, aim]
        if self._least_unknown == 0.0 or self._certify:
            modules.append(shaft)
        if self._certify:
            modules.append(line_tree)
        for module in modules:
            wp.load_module(module.__name__, device=self.model.device.name)

    def visible(self, block: np.ndarray, *, aim: bool = True) -> Part:
        """As of `Engine`."""
        beside = block >= self.model.graph.cell_count
        if beside.any():
            # View cells with a plan are no part of the graph: occluders alone hide from them.
            part = self._from_tiles(block[~beside], aim=aim)
            ledger = Ledger() if self._certify else None
            objects, proofs = seen_objects(self.occluders, block[beside], aiming.AIM_ROUNDS if aim else (), ledger)
            joined = None if proofs is None else join_proofs([part.proofs, proofs])
            return Part(part.cells, Rows.join([part.objects, objects]), joined)
        return self._from_tiles(block, aim=aim)

    def _from_tiles(self, block: np.ndarray, *, aim: bool) -> Part:
        """What is visible from cells of the graph."""
        for_cells, for_objects = (cell_search.AIM_ROUNDS, aiming.AIM_ROUNDS) if aim else ((), ())
        ledger = Ledger() if self._certify else None
        cells = cell_rows(self.model, block, for_cells, ledger)
        if self._least_unknown == 0.0:
            cells = self._hide_cells(cells, ledger)
        if ledger is not None:
            return Part(cells, *seen_objects(self.occluders, block, for_objects, ledger))
        objects = object_rows(self.model, self._incidence, cells, for_objects, self._unknown_sources)
        doubtful = ~objects.seen & self._unknown_sources(objects)[objects.source]
        if doubtful.any():
            better, _ = refine_objects(self.occluders, objects.take(doubtful), for_objects)
            objects = Rows.join([objects.take(~doubtful), better]).order()
        return Part(cells, objects)

    def _unknown_sources(self, rows: Rows) -> np.ndarray:
        """Cells that occluders are asked about, as too much of what they may see is unknown, shape (cells,), bool."""
        count = self.model.graph.cell_count
        unknown = np.bincount(rows.source[~rows.seen], minlength=count)
        return unknown > np.minimum(self._least_unknown, 1.0) * np.bincount(rows.source, minlength=count)

    def _hide_cells(self, rows: Rows, ledger: Ledger | None) -> Rows:
        """Rows without the unknown cells that occluders hide."""
        todo = np.flatnonzero(~rows.seen & (rows.source != rows.target))
        kept = np.ones(len(rows), bool)
        boxes = self.model.graph.cells[rows.target[todo]]
        kept[todo] = ~hidden_boxes(self.occluders, rows.source[todo], boxes, ledger)
        return rows.take(kept)

    def glance(self, block: np.ndarray, number: int) -> Rows:
        """As of `Engine`."""
        return glance(self._sights, block, number)

    def coarse_steps(self) -> int:
        """As of `Engine`; certificates speak of single cells, and portals alone hide by nothing else."""
        if self._hides_alone:
            return 0
        bare = not self._sights.model.whole
        self._rough = OccluderModel.of(self._sights, rough=True, bare=bare)
        return 1 + len(steps_below(self._rough))

    def coarse(self, cells: np.ndarray, group: np.ndarray) -> Rows:
        """As of `Engine`."""
        return left_by_nodes(self._rough, cells, group)

    def narrow(self, rows: Rows, step: int) -> Rows:
        """As of `Engine`."""
        return narrowed(self._rough, self._occluders or self._rough, rows, step)

    def unknown(self, block: np.ndarray, objects: Rows | None = None) -> Part:
        """As of `Engine`."""
        count = self.model.graph.cell_count
        rows = unknown_rows(block, self._objects) if objects is None else objects
        return Part(unknown_rows(block[block < count], count), rows)

    def join(self, parts: list[Part], *, share: bool = True) -> tuple[Rows, Rows]:
        """As of `Engine`; cells are made symmetric: A sees B exactly when B sees A."""
        objects = join_objects(parts)
        if share:
            share_sightlines(self._sights, objects)
        return join_cell_rows(self.model, [part.cells for part in parts]), objects
