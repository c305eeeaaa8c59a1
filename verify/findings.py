"""What a check of a bake found, and how its pairs are counted."""

import statistics
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..data.plural import counted
from .proofs.certified import Certified
from .rays.confidence import Confidence
from .rays.embree import Caster
from .rays.witness import Confirmed, visible_rows

if TYPE_CHECKING:
    from ..data.store.bake_folder import BakeFolder


@dataclass(frozen=True)
class Counts:
    """Pairs (inhabitable source, target) of one class of targets.

    Attributes:
        name: of the class.
        potential: pairs not proved hidden.
        seen: pairs with a stored witness.
        by_rays: potential pairs that this run's rays saw.
    """

    name: str
    potential: int
    seen: int
    by_rays: int

    @property
    def overestimate(self) -> float:
        """Potential pairs over seen pairs: an upper bound of the true ratio."""
        return self.potential / self.seen if self.seen else float("inf") if self.potential else 1.0

    @property
    def unknown_percent(self) -> float:
        """Share of the potential pairs that has no witness [%]."""
        return 100.0 * (self.potential - self.seen) / self.potential if self.potential else 0.0

    def columns(self) -> tuple[str, str, str, str]:
        """Potential, seen, overestimate and unknown as they are printed."""
        ratio = f"{self.overestimate:.3f}" if self.seen or not self.potential else "no witness"
        return f"{self.potential:,}", f"{self.seen:,}", ratio, f"{self.unknown_percent:.2f} %"


@dataclass
class VerifyResult:
    """What `verify` found.

    Attributes:
        rays: cast; every one is checked for the object that it hits.
        cell_rays: those that are also followed through the cells they cross.
        rays_per_second: while casting, following and judging; compiling and building excluded.
        embree_rates: rays per second of this check and of Embree alone, on the same rays and threads, one pair for each
            part of the run; none for a bare graph, which has no triangles.
        guided_rays: beyond these, that look where an omission is likeliest; none for a bare graph.
        random_rays: of the guided ones that are independent and random, for each inhabitable cell with a free point.
        wrong_hidden: hidden pairs that an exactly adjudicated sightline shows; the run stops at the first.
        case: the case file written for it.
        pair: that pair in words; empty if there is none.
        grazes: candidate rays that only touch an edge, a vertex or a boundary.
        leaks: candidate rays through gaps narrower than the bake's seal.
        blocked: candidate rays that the exact test stops: Embree had missed a triangle.
        dark_cells: inhabitable cells in which no point outside all solids was found, so no ray starts there.
        counts: table of pairs.
        cell_witnesses: outcome of every stored cell-to-cell witness.
        object_witnesses: the same for cell-to-object.
        certificates: outcome of every certificate; None for a bake without.
        seconds: by phase.
    """

    rays: int = 0
    cell_rays: int = 0
    rays_per_second: float = 0.0
    embree_rates: list[tuple[float, float]] = field(default_factory=list)
    guided_rays: int = 0
    random_rays: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    wrong_hidden: int = 0
    case: Path | None = None
    pair: str = ""
    grazes: int = 0
    leaks: int = 0
    blocked: int = 0
    dark_cells: int = 0
    counts: list[Counts] = field(default_factory=list)
    cell_witnesses: Confirmed = field(default_factory=Confirmed)
    object_witnesses: Confirmed = field(default_factory=Confirmed)
    certificates: Certified | None = None
    seconds: dict[str, float] = field(default_factory=dict)

    def __repr__(self) -> str:
        """What came of it, on a line."""
        found = f"{self.wrong_hidden:,} wrong-hidden" + (f" ({self.pair})" if self.pair else "")
        refuted = counted(self.refuted, "refuted witness", "refuted witnesses")
        return f"<VerifyResult {'ok' if self.ok else 'failed'}: {found}, {refuted}, {self.rays:,} rays>"

    @property
    def refuted(self) -> int:
        """Stored witnesses that do not hold."""
        return self.cell_witnesses.refuted + self.object_witnesses.refuted

    @property
    def ok(self) -> bool:
        """Nothing forbidden was found."""
        unproved = self.certificates.failed if self.certificates else 0
        return self.wrong_hidden == 0 and self.refuted == 0 and unproved == 0

    @property
    def rate_ratio(self) -> float:
        """Rays a second over Embree's own, the median over the run; 0 for a bare graph."""
        return statistics.median(ours / own for ours, own in self.embree_rates) if self.embree_rates else 0.0

    def table(self) -> str:
        """The result as two Markdown tables."""
        ratio = f" ({self.rate_ratio:.0%} of Embree's own)" if self.embree_rates else ""
        witnesses = [
            f"{found.confirmed:,} confirmed, {found.refuted:,} refuted"
            for found in (self.cell_witnesses, self.object_witnesses)
        ]
        confident = self.guided_rays and not self.wrong_hidden
        rows = [
            ("wrong-hidden", f"{self.wrong_hidden}" + (f" (case file {self.case}): {self.pair}" if self.case else "")),
            ("rays, for objects / for cells", f"{self.rays:,} / {self.cell_rays:,}"),
            *([("guided rays", f"{self.guided_rays:,}")] if self.guided_rays else []),
            ("rays per second", f"{self.rays_per_second:,.0f}{ratio}"),
            ("grazes", f"{self.grazes:,}"),
            ("leaks narrower than the seal", f"{self.leaks:,}"),
            ("candidate rays that the exact test stops", f"{self.blocked:,}"),
            ("inhabitable cells without a free point", f"{self.dark_cells:,}"),
            ("cell witnesses", witnesses[0]),
            ("object witnesses", witnesses[1]),
            *([("certificates", self.certificates.line())] if self.certificates else []),
            *([("confidence", Confidence(self.random_rays).line())] if confident else []),
            ("seconds", ", ".join(f"{name} {value:.1f}" for name, value in self.seconds.items())),
        ]
        lines = ["| check | result |", "|---|---|", *(f"| {name} | {value} |" for name, value in rows), ""]
        lines += ["| targets | potential | seen | overestimate | unknown | seen by rays |", "|---|---|---|---|---|---|"]
        for c in self.counts:
            lines.append(f"| {c.name} | {' | '.join(c.columns())} | {c.by_rays:,} |")
        refuted = [*self.cell_witnesses.examples, *self.object_witnesses.examples]
        refuted += self.certificates.examples if self.certificates else []
        return "\n".join([*lines, *(["", *(f"refuted: {line}" for line in refuted)] if refuted else [])])


def count_pairs(bake: "BakeFolder", by_rays: dict[str, int] | None = None) -> list[Counts]:
    """Pairs by class of targets: inhabitable cells, other cells, objects; with what rays saw of each, if given."""
    counts = []
    for name, chosen in _classes(bake).items():
        table, target, sets = bake.cell_to_cell, "reached_cell_id", bake.cell_sets
        if chosen is None:
            table, target, sets = bake.cell_to_object, "object_id", bake.object_sets
        # Members alone: what a row holds as nothing is claimed of it counts as nothing.
        potential, seen = (
            len(ids) if chosen is None else int(chosen[ids].sum())
            for ids in (sets.members, visible_rows(table)[target].to_numpy())
        )
        counts.append(Counts(name, potential, seen, (by_rays or {}).get(name, 0)))
    return counts


def pairs_by_rays(bake: "BakeFolder", caster: Caster) -> dict[str, int]:
    """Potential pairs of each class that a caster's rays saw."""
    found = {}
    for name, chosen in _classes(bake).items():
        if chosen is None:
            found[name] = int(((caster.seen_objects > 0) & caster.potential_objects).sum())
        else:
            rows = caster.sources < bake.graph.tile_count
            both = (caster.seen_cells[rows] > 0) & caster.potential_cells[rows]
            found[name] = int(np.count_nonzero(both, axis=0)[chosen].sum())
    return found


def _classes(bake: "BakeFolder") -> dict[str, np.ndarray | None]:
    """Which cells each class of targets has, shape (cells,), bool; None: objects.

    Nothing is claimed of cells from, or to, view cells with a plan.
    """
    tiles = np.arange(bake.graph.cell_count) < bake.graph.tile_count
    inhabitable = bake.graph.inhabitable & tiles
    cells = {"cells, inhabitable": inhabitable, "cells, wall, sliver and exterior": ~inhabitable & tiles}
    return (cells if bake.claims_cells else {}) | {"objects": None}
