"""Visibility of a bare cell-and-portal graph: which cells a line through portals joins, all pairs exactly."""

import numpy as np
import warp as wp

from ...data.blockers import Blockers, find_blockers
from ...data.graph import CellGraph
from ...data.rows import Rows
from ...data.verdict import Verdict
from ...kernels import flood, line_tree, target, trace
from ...kernels.flood import FloodAnswers, launch_flood
from ...kernels.launch import CPU, Device
from ...kernels.target import TargetAnswers
from .cells import CellModel, certified_pairs, join_cell_rows, portal_rows, search_pairs
from .engine import Part, join_objects, unknown_rows
from .ledger import Ledger
from .search import segments

# A flood is tried on this many sources first; where more than a quarter run into the cap, sequences explode.
SAMPLE = 24
# Those that the cap cuts off may take so many times more, if that is enough for most of them.
AGAIN = 16
NO_OBJECTS = Rows.unseen(np.zeros(0, int), np.zeros(0, int))


class GraphEngine:
    """An `Engine` for a bare graph."""

    def __init__(self, graph: CellGraph, *, device: Device = CPU, seed: int = 0, certify: bool = False) -> None:
        """Copy the graph to the device.

        Args:
            graph: cells and portals.
            device: where to.
            seed: of moved sightlines.
            certify: call hidden only what has a certificate, and keep it.
        """
        self._certify = certify
        self.model = CellModel(graph, find_blockers(graph), None, seed, device)

    @property
    def proof_occluders(self) -> tuple[Blockers, None, None]:
        """As of `Engine`."""
        return self.model.blockers, None, None

    @property
    def opaque(self) -> None:
        """As of `Engine`: there are no triangles."""
        return None

    def begin(self, seconds: float = np.inf) -> bool:
        """As of `Engine`: all is made."""
        return True

    def look(self, seconds: float = np.inf) -> bool:
        """As of `Engine`: there are no objects."""
        return True

    def prepare(self, seconds: float = np.inf) -> bool:
        """As of `Engine`: all is made."""
        return True

    def compile(self) -> None:
        """As of `Engine`."""
        for module in (target, trace, flood, *([line_tree] if self._certify else [])):
            wp.load_module(module.__name__, device=self.model.device.name)

    def visible(self, block: np.ndarray, *, aim: bool = True) -> Part:
        """As of `Engine`, of all inhabitable cells at once; there is nothing to aim at."""
        if not self._certify:
            return Part(self._flood(block), NO_OBJECTS)
        ledger = Ledger()
        left = np.zeros((self.model.graph.cell_count,) * 2, bool)
        left[tuple(certified_pairs(self.model, block, ledger).T)] = True
        # What is hidden from the other end is hidden.
        left[:, block] &= left[block].T
        cells = self._search(block, np.argwhere(left), [], ledger)
        return Part(cells, NO_OBJECTS, ledger.close(np.zeros(0, bool)))

    def glance(self, block: np.ndarray, number: int) -> Rows:
        """As of `Engine`: there are no objects."""
        return NO_OBJECTS

    def coarse_steps(self) -> int:
        """As of `Engine`: there are no objects."""
        return 0

    def unknown(self, block: np.ndarray, objects: Rows | None = None) -> Part:
        """As of `Engine`."""
        return Part(unknown_rows(block, self.model.graph.cell_count), NO_OBJECTS)

    def join(self, parts: list[Part], *, share: bool = True) -> tuple[Rows, Rows]:
        """As of `Engine`; cells are made symmetric: A sees B exactly when B sees A."""
        return join_cell_rows(self.model, [part.cells for part in parts]), join_objects(parts)

    def _flood(self, sources: np.ndarray) -> Rows:
        """Portal sequences where they end soon, the target search for the rest."""
        model, count = self.model, self.model.graph.cell_count
        cap = 400 + count // 2
        # A line can be followed either way, so when every cell is a source, half the octants find every pair.
        octants = (0, 2, 4, 6) if len(sources) == count else tuple(range(8))
        if self._explode(sources, octants, cap):
            row, cell = np.divmod(np.arange(len(sources) * count), count)
            pairs = np.column_stack([sources[row], cell])
            return self._search(sources, pairs[pairs[:, 0] != pairs[:, 1]], [])
        found = launch_flood(model.device_graph, sources, octants, cap=cap, device=model.device)
        cut = np.flatnonzero(~found.complete)
        # A few that see far need more; searching for each of their targets takes longer still.
        if len(cut) and not self._explode(sources[cut], octants, AGAIN * cap):
            more = launch_flood(model.device_graph, sources[cut], octants, cap=AGAIN * cap, device=model.device)
            found = found.replaced(cut, more)
        pairs = np.column_stack([sources[found.pairs[:, 0]], found.pairs[:, 1]])
        answers = TargetAnswers(None, None, found.pairs[:, 2], found.line, found.offset)
        lines = self._lines(answers, np.arange(len(pairs)), pairs)
        return self._search(sources, self._left(found, sources, len(octants) == 4), [lines])

    def _explode(self, sources: np.ndarray, octants: tuple[int, ...], cap: int) -> bool:
        """Whether, of some of the sources, more than a quarter run into the cap."""
        sample, model = sources[:: max(1, len(sources) // SAMPLE)], self.model
        return launch_flood(model.device_graph, sample, octants, cap=cap, device=model.device).complete.mean() < 0.75

    def _left(self, found: FloodAnswers, sources: np.ndarray, halved: bool) -> np.ndarray:
        """(source, cell) pairs that a flood neither sees nor proves hidden, shape (n, 2), ordered.

        Args:
            found: by the flood.
            sources: that it started from.
            halved: it searched half the octants, from every cell.
        """
        count, row_of = self.model.graph.cell_count, self._row_of(sources)

        def keys(row: np.ndarray, cell: np.ndarray) -> np.ndarray:
            """Of pairs, and of those seen the other way, which are of other rows."""
            back = row_of[cell] >= 0
            there = np.asarray(row, np.int64) * count + cell
            return np.concatenate([there, row_of[cell[back]] * count + sources[row[back]]])

        cut, (row, cell) = np.flatnonzero(~found.complete), found.undecided.T
        left = np.concatenate([(cut[:, None] * count + np.arange(count)).ravel(), row.astype(np.int64) * count + cell])
        if halved:
            # Half the octants prove a pair hidden only together with the other end's half.
            left = keys(*np.divmod(left, count))
        if len(left):
            own = np.arange(len(sources)) * count + sources
            left = np.setdiff1d(left, np.concatenate([keys(found.pairs[:, 0], found.pairs[:, 1]), own]))
        row, cell = np.divmod(left, count)
        return np.column_stack([sources[row], cell])

    def _row_of(self, sources: np.ndarray) -> np.ndarray:
        """Place of each cell among the sources, -1 if it is none."""
        row_of = np.full(self.model.graph.cell_count, -1)
        row_of[sources] = np.arange(len(sources))
        return row_of

    def _search(self, sources: np.ndarray, pairs: np.ndarray, lines: list[Rows], ledger: Ledger | None = None) -> Rows:
        """Rows from some lines and a target search of the pairs that may have more."""
        row_of = self._row_of(sources)
        pairs = pairs[(row_of[pairs[:, 1]] < 0) | (pairs[:, 0] < pairs[:, 1])]
        answers = search_pairs(self.model, pairs, ledger)
        kept = np.flatnonzero(answers.verdict == Verdict.VISIBLE)
        doubtful = pairs[answers.verdict == Verdict.UNKNOWN]
        there = Rows.join([*lines, self._lines(answers, kept, pairs[kept]), Rows.unseen(*doubtful.T)])
        return portal_rows(self.model, sources, there)

    def _lines(self, answers: TargetAnswers, rows: np.ndarray, pairs: np.ndarray) -> Rows:
        """Pairs with the ends of their lines, which are not witnesses yet."""
        out, cells = Rows.unseen(*pairs.T), self.model.graph.cells
        out.origin, out.end = segments(answers, rows, cells[out.source], cells[out.target])
        return out
