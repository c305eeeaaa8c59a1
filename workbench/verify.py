"""Check a bake: rays that must see nothing hidden, and witnesses that must hold."""

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from tqdm import tqdm

from ..data.errors import InputError
from ..data.scene import Role
from ..verify.adjudicate import Judge, Judgement, sightline_end
from ..verify.casefile import WrongHidden, read_case, write_case
from ..verify.rays import ORIGINS_MOST, Candidates, Caster, aim_points, cell_origins
from ..verify.sightline import Sightlines
from ..verify.walk import contact_links, portal_links
from ..verify.witness import CHUNK, Confirmed, confirm_cells, confirm_objects, read_witnesses, visible_rows

if TYPE_CHECKING:
    from ..data.database import Bake

BATCH_RAYS = 100_000
# Points to aim at: fewest and most; many rays share one, from different origins.
AIMS = (1 << 14, 1 << 20)
THREADS = 2
KINDS = ("cell", "object")


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


@dataclass
class VerifyResult:
    """What `verify` found.

    Attributes:
        rays: cast.
        rays_per_second: while casting, walking and judging; compiling and building excluded.
        embree_rate: Embree alone on the same rays and threads; 0 for a bare graph, which has no triangles.
        wrong_hidden: hidden pairs that an exactly adjudicated sightline shows; the run stops at the first.
        case: the case file written for it.
        grazes: candidate rays that only touch an edge, a vertex or a boundary.
        leaks: candidate rays through gaps narrower than the bake's seal.
        blocked: candidate rays that the exact test stops: Embree had missed a triangle.
        dark_cells: inhabitable cells in which no point outside all solids was found, so no ray starts there.
        counts: table of pairs.
        cell_witnesses: outcome of every stored cell-to-cell witness.
        object_witnesses: the same for cell-to-object.
        seconds: by phase.
    """

    rays: int = 0
    rays_per_second: float = 0.0
    embree_rate: float = 0.0
    wrong_hidden: int = 0
    case: Path | None = None
    grazes: int = 0
    leaks: int = 0
    blocked: int = 0
    dark_cells: int = 0
    counts: list[Counts] = field(default_factory=list)
    cell_witnesses: Confirmed = field(default_factory=Confirmed)
    object_witnesses: Confirmed = field(default_factory=Confirmed)
    seconds: dict[str, float] = field(default_factory=dict)

    @property
    def refuted(self) -> int:
        """Stored witnesses that do not hold."""
        return self.cell_witnesses.refuted + self.object_witnesses.refuted

    @property
    def ok(self) -> bool:
        """Nothing forbidden was found."""
        return self.wrong_hidden == 0 and self.refuted == 0

    @property
    def rate_ratio(self) -> float:
        """Rays a second over Embree's own; 0 for a bare graph."""
        return self.rays_per_second / self.embree_rate if self.embree_rate else 0.0

    def table(self) -> str:
        """The result as two Markdown tables."""
        ratio = f" ({self.rate_ratio:.0%} of Embree's own)" if self.embree_rate else ""
        witnesses = [
            f"{found.confirmed:,} confirmed, {found.refuted:,} refuted"
            for found in (self.cell_witnesses, self.object_witnesses)
        ]
        rows = [
            ("wrong-hidden", f"{self.wrong_hidden}" + (f" (case file {self.case})" if self.case else "")),
            ("rays", f"{self.rays:,}"),
            ("rays a second", f"{self.rays_per_second:,.0f}{ratio}"),
            ("grazes", f"{self.grazes:,}"),
            ("leaks narrower than the seal", f"{self.leaks:,}"),
            ("candidate rays that the exact test stops", f"{self.blocked:,}"),
            ("inhabitable cells without a free point", f"{self.dark_cells:,}"),
            ("cell witnesses", witnesses[0]),
            ("object witnesses", witnesses[1]),
            ("seconds", ", ".join(f"{name} {value:.1f}" for name, value in self.seconds.items())),
        ]
        lines = ["| check | result |", "|---|---|", *(f"| {name} | {value} |" for name, value in rows), ""]
        lines += ["| targets | potential | seen | overestimate | unknown | seen by rays |", "|---|---|---|---|---|---|"]
        for c in self.counts:
            share = f"{c.overestimate:.3f} | {c.unknown_percent:.2f} %"
            lines.append(f"| {c.name} | {c.potential:,} | {c.seen:,} | {share} | {c.by_rays:,} |")
        refuted = [*self.cell_witnesses.examples, *self.object_witnesses.examples]
        return "\n".join([*lines, *(["", *(f"refuted: {line}" for line in refuted)] if refuted else [])])


def verify(bake: "Bake", *, rays: int = 1_000_000, seed: int = 0, progress: bool = False) -> VerifyResult:
    """Try to refute a bake; a bake of a bare cell graph is checked against its portals.

    Args:
        bake: the bake.
        rays: to cast at least, spread evenly over the inhabitable cells.
        seed: of origins and directions.
        progress: show a bar.

    Returns:
        The findings. At the first adjudicated wrong-hidden a case file is written beside the bake and no more is cast.

    Raises:
        InputError: `rays` is negative.
    """
    if rays < 0:
        raise InputError(f"rays: expected 0 or more, found {rays}")
    result, start = VerifyResult(), time.perf_counter()
    judge = make_judge(bake)
    sources = np.flatnonzero(bake.graph.inhabitable)
    caster, sources = _make_caster(bake, judge, sources, rays, seed, result)
    result.seconds["prepare"] = time.perf_counter() - start
    if rays and len(sources):
        _cast_all(bake, caster, judge, rays, progress, result)
    start = time.perf_counter()
    _confirm_all(bake, judge, progress, result)
    result.seconds["witnesses"] = time.perf_counter() - start
    result.counts = count_pairs(bake, caster if rays else None)
    return result


@dataclass(frozen=True)
class Replayed:
    """A case file tried again.

    Attributes:
        case: as read.
        hidden: the bake still hides the pair.
        judgement: what the exact test says of the sightline now.
    """

    case: WrongHidden
    hidden: bool
    judgement: Judgement

    @property
    def ok(self) -> bool:
        """The bake no longer hides a visible pair here."""
        return not (self.hidden and self.judgement is Judgement.VISIBLE)

    def line(self) -> str:
        """The outcome in one line."""
        verdict = "hidden" if self.hidden else "potential"
        pair = f"cell {self.case.cell}, {self.case.kind} {self.case.target}"
        state = "fixed" if self.ok else "wrong-hidden"
        return f"{state}: {pair}: bake says {verdict}, the sightline is {self.judgement.name.lower()}"


def replay(path: str | Path, bake: "Bake | None" = None) -> Replayed:
    """Judge the sightline of a case file again.

    Args:
        path: case file.
        bake: to judge it by; by default the bake that the file names.

    Raises:
        InputError: no case file, no bake, or ids that the bake does not have.
    """
    case = read_case(path)
    if bake is None:
        from ..data.database import load

        bake = load(case.bake)
    table = bake.potential_cells if case.kind == "cell" else bake.potential_objects
    if not (0 <= case.cell < table.shape[0] and 0 <= case.target < table.shape[1]):
        raise InputError(f"{path}: expected ids below {table.shape}, found cell {case.cell}, target {case.target}")
    origin, direction = np.array(case.origin), np.array(case.direction)
    judgement = make_judge(bake).judge(case.kind, case.cell, case.target, origin, origin + direction)
    return Replayed(case, not table[case.cell, case.target], judgement)


def make_judge(bake: "Bake") -> Judge:
    """The exact judge of a bake's sightlines."""
    links = portal_links(bake.graph)
    if bake.scene is None:
        nothing = Sightlines(np.zeros((0, 3, 3), np.int32))
        return Judge(bake.graph, None, nothing, links)
    triangles, owners = bake.scene.triangles()
    opaque = bake.scene.object_mask(Role.OCCLUDER, Role.DETAIL)[owners]
    lines, glass = (Sightlines(triangles[part], owners[part]) for part in (opaque, ~opaque))
    seal = float(bake.manifest.get("settings", {}).get("seal", 0.0) or 0.0)
    return Judge(bake.graph, lines, glass, links, seal / bake.grid_m)


def _make_caster(
    bake: "Bake", judge: Judge, sources: np.ndarray, rays: int, seed: int, result: VerifyResult
) -> tuple[Caster | None, np.ndarray]:
    """Caster of the inhabitable cells that hold a free point, and those cells."""
    none = Sightlines(np.zeros((0, 3, 3), np.int32))
    lines, glass = judge.lines or none, judge.glass
    share = -(-rays // max(len(sources), 1))
    wanted = int(np.clip(share // 32, 8, ORIGINS_MOST))
    spots = cell_origins(bake.graph, sources, wanted, lines, seed)
    lit = np.array([len(own) > 0 for own in spots], bool)
    result.dark_cells = int((~lit).sum())
    sources = sources[lit]
    if not len(sources):
        return None, sources
    links = judge.links if judge.lines is None else contact_links(bake.graph.cells)
    caster = Caster(
        sources=sources,
        spots=[own for own in spots if len(own)],
        aims=aim_points(lines.triangles, lines.owners, bake.graph.cells, int(np.clip(rays // 32, *AIMS)), seed),
        boxes=bake.graph.cells,
        links=links,
        potential_cells=bake.potential_cells[sources],
        potential_objects=bake.potential_objects[sources],
        opaque=(lines.triangles, lines.owners),
        glass=(glass.triangles, glass.owners),
        seed=seed,
    )
    return caster, sources


def _cast_all(bake: "Bake", caster: Caster, judge: Judge, rays: int, progress: bool, result: VerifyResult) -> None:
    """Cast in batches on two threads; judge candidates in order; stop at the first wrong-hidden."""
    rows = len(caster.sources)
    total, run = -(-rays // rows), max(1, BATCH_RAYS // rows)
    # The first batch is one ray a cell: it compiles the kernels, outside the clock and on one thread.
    start = time.perf_counter()
    if _judge_batch(bake, caster, judge, caster.cast(0, 1), result):
        result.rays = rows
        return
    result.seconds["compile"] = time.perf_counter() - start
    batches = [(first, min(run, total - first)) for first in range(1, total, run)]
    start, cast = time.perf_counter(), rows
    with ThreadPoolExecutor(THREADS) as pool, tqdm(total=rows * total, unit="ray", disable=not progress) as bar:
        for (_, count), found in zip(batches, pool.map(lambda batch: caster.cast(*batch), batches), strict=True):
            cast += rows * count
            bar.update(rows * count)
            if _judge_batch(bake, caster, judge, found, result):
                pool.shutdown(cancel_futures=True)
                break
    result.rays, result.seconds["rays"] = cast, time.perf_counter() - start
    result.rays_per_second = (cast - rows) / result.seconds["rays"]
    result.embree_rate = caster.raw_rate() if judge.lines is not None and len(judge.lines.triangles) else 0.0


def _judge_batch(bake: "Bake", caster: Caster, judge: Judge, found: Candidates, result: VerifyResult) -> bool:
    """Count a batch's candidates; write the case file of the first wrong-hidden and say True."""
    for number in range(len(found.rows)):
        cell, kind = int(caster.sources[found.rows[number]]), KINDS[found.kinds[number]]
        target, origin = int(found.targets[number]), found.origins[number]
        end = sightline_end(found, number, bake.graph.cells)
        outcome = judge.judge(kind, cell, target, origin, end)
        result.grazes += outcome is Judgement.GRAZE
        result.leaks += outcome is Judgement.LEAK
        result.blocked += outcome is Judgement.BLOCKED
        if outcome is Judgement.VISIBLE:
            result.wrong_hidden += 1
            model = str(bake.manifest.get("model", bake.manifest.get("path", "")))
            vectors = tuple(origin.tolist()), tuple((end - origin).tolist())
            result.case = write_case(WrongHidden(str(bake.folder), model, cell, kind, target, *vectors))
            return True
    return False


def _confirm_all(bake: "Bake", judge: Judge, progress: bool, result: VerifyResult) -> None:
    """Confirm every stored witness, a chunk of rows at a time."""
    tables = [("cell", "reached_cell_id", bake.cell_to_cell, result.cell_witnesses)]
    if judge.lines is not None:
        tables.append(("object", "object_id", bake.cell_to_object, result.object_witnesses))
    for kind, target, table, outcome in tables:
        rows = visible_rows(table)
        for first in tqdm(range(0, len(rows), CHUNK), desc=f"{kind} witnesses", disable=not progress):
            part = read_witnesses(rows.slice(first, CHUNK), target, bake.grid_m)
            if kind == "cell":
                reasons = confirm_cells(part, bake.graph, judge.lines)
            else:
                reasons = confirm_objects(part, bake.graph, judge.lines, judge.glass)
            outcome.add(kind, part.cells, part.targets, reasons)


def count_pairs(bake: "Bake", caster: Caster | None = None) -> list[Counts]:
    """Pairs by class of targets: inhabitable cells, all cells, objects; with what a caster's rays saw, if given."""
    inhabitable = bake.graph.inhabitable
    tables = [
        ("cells, inhabitable", bake.potential_cells[:, inhabitable], bake.cell_to_cell, "reached_cell_id", inhabitable),
        ("cells, all", bake.potential_cells, bake.cell_to_cell, "reached_cell_id", None),
        ("objects", bake.potential_objects, bake.cell_to_object, "object_id", None),
    ]
    counts = []
    for name, potential, table, target, chosen in tables:
        ids = visible_rows(table)[target].to_numpy()
        seen = len(ids) if chosen is None else int(chosen[ids].sum())
        by_rays = 0
        if caster is not None:
            marks = caster.seen_objects if target == "object_id" else caster.seen_cells
            own = caster.potential_objects if target == "object_id" else caster.potential_cells
            by_rays = int(((marks > 0) & own)[:, slice(None) if chosen is None else chosen].sum())
        counts.append(Counts(name, int(potential.sum()), seen, by_rays))
    return counts
