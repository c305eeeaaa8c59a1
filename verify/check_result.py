"""What a check of somebody's potentially visible sets found."""

from dataclasses import dataclass, field

import numpy as np

from ..data.plural import counted
from ..data.scene import turned
from .rays.confidence import Confidence

SHOWN = 10
KINDS = ("object", "cell")


@dataclass(frozen=True)
class WrongPair:
    """A visible pair that is not claimed, and the sightline that shows it.

    Attributes:
        kind: "object" or "cell".
        cell: place of the view cell in its table.
        target: object_id, or place of the cell that is seen.
        origin: start of the sightline [grid steps], 3 float64.
        end: its end, just behind the first surface of an object, or inside the cell.
        portals: portals that it passes, in a bare cell graph; empty where there are triangles.
        margin: least distance to an opaque triangle that is not the target's [grid steps]; nan if not known.
        nearest: the objects that it passes nearest to, and how near [grid steps], the nearest first.
    """

    kind: str
    cell: int
    target: int
    origin: np.ndarray
    end: np.ndarray
    portals: tuple[int, ...] = ()
    margin: float = float("nan")
    nearest: tuple[tuple[int, float], ...] = ()


@dataclass
class CheckResult:
    """What `check` found.

    Attributes:
        cell_ids: of the view cells, as their table calls them, shape (cells,).
        sources: view cells that were checked, shape (sources,), int.
        cell_rooms: rooms, or names, of the view cells in words, empty where they have none; None if none has any.
        object_names: names of the model's objects.
        claimed: by kind of target, shape (cells, targets), bool.
        seen: the same of pairs that some sightline of this check joined.
        silent: view cells of which no pair of cells is claimed or judged, shape (cells,); see `Claims.silent`.
        wrong: wrong-hidden pairs.
        exact: whether every pair was decided by exact arithmetic, as in an axial cell graph, and not by sampling.
        statement: how sure the answer is, where `confidence` does not apply.
        rays: cast in all.
        uniform: independent random rays of each source, shape (sources,), int.
        grazes: suspects that only touch an edge, a vertex or a boundary.
        blocked: suspects that the exact test stops: Embree had missed a triangle.
        seconds: by phase.
        grid_m: grid step in `unit`.
        unit: of what is printed.
        origin: what to add, after turning by `yaw_deg`, to get the model's own place [m], 3 float64.
        yaw_deg: see `Scene.in_model`.
        snap_m: how far the model's vertices were moved at most [m].
        notes: what the reader of the result should know.
        asked: the model's path and how to read it; what a replay needs.
        boxes: of the view cells [grid steps], shape (cells, 2, 3).
    """

    cell_ids: np.ndarray
    sources: np.ndarray
    object_names: list[str]
    claimed: dict[str, np.ndarray]
    seen: dict[str, np.ndarray]
    cell_rooms: list[str] | None = None
    silent: np.ndarray | None = None
    wrong: list[WrongPair] = field(default_factory=list)
    exact: bool = False
    statement: str = ""
    rays: int = 0
    uniform: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    grazes: int = 0
    blocked: int = 0
    seconds: dict[str, float] = field(default_factory=dict)
    grid_m: float = 1.0
    unit: str = "m"
    origin: np.ndarray = field(default_factory=lambda: np.zeros(3))
    yaw_deg: float = 0.0
    snap_m: float = 0.0
    notes: list[str] = field(default_factory=list)
    asked: dict[str, object] = field(default_factory=dict)
    boxes: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 3), np.int32))

    def __repr__(self) -> str:
        """What came of it, on a line."""
        wrong = {kind: sum(w.kind == kind for w in self.wrong) for kind in self.claimed}
        found = ", ".join(counted(count, f"wrong-hidden {kind}") for kind, count in wrong.items())
        outcome, cells = "ok" if self.ok else "failed", counted(len(self.sources), "view cell")
        return f"<CheckResult {outcome}: {found} from {cells}, {self.rays:,} rays>"

    @property
    def ok(self) -> bool:
        """Nothing visible was found hidden."""
        return not self.wrong

    @property
    def confidence(self) -> Confidence:
        """What the random rays are worth."""
        return Confidence(self.uniform)

    def by_cell(self, kind: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Claimed pairs, claimed pairs that were seen, and wrong-hidden pairs of each source, each shape (sources,)."""
        claimed, seen = self.claimed[kind][self.sources], self.seen[kind][self.sources]
        if kind == "cell" and self.silent is not None:
            claimed = claimed & ~self.silent[self.sources, None] & ~self.silent
        wrong = np.bincount([w.cell for w in self.wrong if w.kind == kind], minlength=len(self.cell_ids))
        return claimed.sum(axis=1), (claimed & seen).sum(axis=1), wrong[self.sources]

    def confidence_line(self) -> str:
        """How sure the answer is, in a sentence; it speaks only of a check that found nothing."""
        if self.wrong:
            return "none: the claims are refuted"
        return self.statement or self.confidence.line()

    def adjudication_percent(self) -> float:
        """Share of the time that the exact judge took [%]."""
        total = sum(self.seconds.values())
        return 100.0 * self.seconds.get("adjudicate", 0.0) / total if total else 0.0

    def table(self, shown: int = SHOWN) -> str:
        """The result in Markdown: totals, wrong-hidden pairs, and the worst cells; at most `shown` lines of each."""
        found = {kind: sum(w.kind == kind for w in self.wrong) for kind in self.claimed}
        rows = [
            ("wrong-hidden", ", ".join(counted(count, kind) for kind, count in found.items())),
            ("confidence", self.confidence_line()),
            ("view cells", f"{len(self.sources):,}"),
        ]
        if not self.exact:
            rows += [
                ("rays", f"{self.rays:,}"),
                ("suspects that only graze / that the exact test stops", f"{self.grazes:,} / {self.blocked:,}"),
                ("adjudication", f"{self.adjudication_percent():.1f} % of the time"),
            ]
        rows.append(("seconds", ", ".join(f"{name} {value:.1f}" for name, value in self.seconds.items())))
        lines = ["| check | result |", "|---|---|", *(f"| {name} | {value} |" for name, value in rows)]
        lines += ["", *self._kinds(), *self._wrong(shown), *self._cells(shown)]
        return "\n".join([*lines, *(f"note: {note}" for note in self.notes)])

    def _kinds(self) -> list[str]:
        seen = "seen" if self.exact else "seen by rays"
        lines = [f"| targets | claimed | {seen} | overestimate | wrong-hidden |", "|---|---|---|---|---|"]
        for kind in self.claimed:
            claimed, seen_, wrong = (int(part.sum()) for part in self.by_cell(kind))
            lines.append(f"| {kind}s | {claimed:,} | {seen_:,} | {_ratio(claimed, seen_)} | {wrong:,} |")
        return lines

    def _wrong(self, shown: int) -> list[str]:
        if not self.wrong:
            return []
        widest = sorted(self.wrong, key=lambda w: -(w.margin if w.margin == w.margin else 0.0))
        lines = ["", "wrong-hidden, the clearest sightlines first:"]
        lines += [f"- {self.describe(pair)}" for pair in widest[:shown]]
        return lines + ([f"- and {len(widest) - shown:,} more"] if len(widest) > shown else [])

    def sightline(self, pair: WrongPair) -> tuple[np.ndarray, np.ndarray]:
        """Both ends of a pair's sightline in the model's own place [m], 3 float64 each."""
        start, end = (turned(end * self.grid_m, self.yaw_deg) + self.origin for end in (pair.origin, pair.end))
        return start, end

    def describe(self, pair: WrongPair) -> str:
        """A wrong-hidden pair and its sightline in a line, in the model's own metres."""
        start, stop = self.sightline(pair)
        way = stop - start
        length = float(np.linalg.norm(way))
        target = (
            f"object {pair.target} {self.object_names[pair.target]!r}"
            if pair.kind == "object"
            else f"cell {self.cell_text(pair.target)}"
        )
        line = (
            f"cell {self.cell_text(pair.cell)} sees {target}: from ({', '.join(f'{c:.4f}' for c in start)}) "
            f"along ({', '.join(f'{c:.6f}' for c in way / length)}) for {length:.3f} {self.unit}"
        )
        if pair.portals:
            line += f", through portals {', '.join(map(str, pair.portals))}"
        if pair.margin == pair.margin:
            line += f", clear of everything by {self._length(pair.margin)}"
            near = [f"{self.object_names[k]!r} {self._length(distance)}" for k, distance in pair.nearest]
            line += f" (nearest: {', '.join(near)})" if near else ""
        return line

    def cell_text(self, cell: int) -> str:
        """A view cell by its id and, in brackets, its rooms."""
        words = "" if self.cell_rooms is None else self.cell_rooms[cell]
        return f"{self.cell_ids[cell]} ({words})" if words else f"{self.cell_ids[cell]}"

    def _length(self, steps: float) -> str:
        """A length as it is printed, small ones in thousandths."""
        value = steps * self.grid_m
        return f"{value:.3f} {self.unit}" if value >= 0.1 or self.unit != "m" else f"{1e3 * value:.3g} mm"

    def _cells(self, shown: int) -> list[str]:
        lines = []
        for kind in self.claimed:
            claimed, seen, wrong = self.by_cell(kind)
            ratio = claimed / np.maximum(seen, 1)
            order = np.lexsort((-ratio, -wrong))[:shown]
            lines += ["", f"| worst cells for {kind}s | claimed | seen | overestimate | wrong-hidden |"]
            lines += ["|---|---|---|---|---|"]
            for row in order:
                numbers = f"{claimed[row]:,} | {seen[row]:,} | {_ratio(claimed[row], seen[row])} | {wrong[row]:,}"
                lines.append(f"| {self.cell_text(self.sources[row])} | {numbers} |")
        return lines


def _ratio(claimed: int, seen: int) -> str:
    return f"{claimed / seen:.3f}" if seen else "nothing seen" if claimed else "1.000"
