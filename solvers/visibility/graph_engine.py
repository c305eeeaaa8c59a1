"""Visibility of a bare cell-and-portal graph: which cells a line through portals joins, all pairs exactly."""

import numpy as np
import warp as wp

from ...data.blockers import Blockers, find_blockers
from ...data.graph import CellGraph
from ...data.rows import Rows
from ...data.verdict import Verdict
from ...kernels import flood, line_tree, target, trace
from ...kernels.flood import launch_flood
from ...kernels.launch import CPU, Device
from ...kernels.target import TargetAnswers
from .cells import CellModel, certified_pairs, join_cell_rows, portal_rows, search_pairs
from .engine import Part, join_objects, unknown_rows
from .ledger import Ledger
from .search import segments

# A flood is tried on this many sources first; where more than a quarter run into the cap, sequences explode.
SAMPLE = 24
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

    def coarse(self, cells: np.ndarray, group: np.ndarray, known: Rows) -> None:
        """As of `Engine`: there are no objects."""

    def unknown(self, block: np.ndarray) -> Part:
        """As of `Engine`."""
        return Part(unknown_rows(block, self.model.graph.cell_count), NO_OBJECTS)

    def join(self, parts: list[Part], *, share: bool = True) -> tuple[Rows, Rows]:
        """As of `Engine`; cells are made symmetric: A sees B exactly when B sees A."""
        return join_cell_rows(self.model, [part.cells for part in parts]), join_objects(parts)

    def _flood(self, sources: np.ndarray) -> Rows:
        """Portal sequences where they end soon, the target search for the rest."""
        model, count = self.model, self.model.graph.cell_count
        options = {"cap": 400 + count // 2, "device": model.device}
        # A line can be followed either way, so when every cell is a source, half the octants find every pair.
        octants = (0, 2, 4, 6) if len(sources) == count else tuple(range(8))
        sample = sources[:: max(1, len(sources) // SAMPLE)]
        explodes = launch_flood(model.device_graph, sample, octants, **options).complete.mean() < 0.75
        verdict = np.full((len(sources), count), Verdict.UNKNOWN, np.uint8)
        verdict[np.arange(len(sources)), sources] = Verdict.VISIBLE
        lines = []
        if not explodes:
            found = launch_flood(model.device_graph, sources, octants, **options)
            row, cell = found.pairs[:, 0], found.pairs[:, 1]
            answers = TargetAnswers(None, None, found.pairs[:, 2], found.line, found.offset)
            lines.append(self._lines(answers, np.arange(len(row)), np.column_stack([sources[row], cell])))
            verdict[found.complete] = Verdict.HIDDEN
            verdict[found.undecided] = Verdict.UNKNOWN
            verdict[row, cell] = Verdict.VISIBLE
            row_of = self._row_of(sources)
            both = row_of[cell] >= 0
            verdict[row_of[cell[both]], sources[row[both]]] = Verdict.VISIBLE
            if len(octants) == 4:
                # Half the octants prove a pair hidden only together with the other end's half.
                verdict[(verdict == Verdict.HIDDEN) & (verdict.T == Verdict.UNKNOWN)] = Verdict.UNKNOWN
        todo = np.argwhere(verdict == Verdict.UNKNOWN)
        return self._search(sources, np.column_stack([sources[todo[:, 0]], todo[:, 1]]), lines)

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
        both = there.take(row_of[there.target] >= 0)
        back = Rows(both.target, both.source, both.verdict, both.end, both.origin)
        return portal_rows(self.model, sources, Rows.join([there, back]))

    def _lines(self, answers: TargetAnswers, rows: np.ndarray, pairs: np.ndarray) -> Rows:
        """Pairs with the ends of their lines, which are not witnesses yet."""
        out, cells = Rows.unseen(*pairs.T), self.model.graph.cells
        out.origin, out.end = segments(answers, rows, cells[out.source], cells[out.target])
        return out
