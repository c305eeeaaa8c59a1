"""Check a bake: rays that must see nothing hidden, witnesses that must hold, and certificates if it has them."""

import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..data.errors import InputError
from ..data.progress import phase, shown, track
from ..data.scene import OPAQUE, Role
from ..verify.cases.case_file import WrongHidden, read_case, write_case
from ..verify.exact.sightline import Sightlines
from ..verify.exact.trace import contact_links, portal_links
from ..verify.findings import VerifyResult, count_pairs, pairs_by_rays
from ..verify.proofs.line_tree import check_certificates, has_certificates
from ..verify.rays.adjudicate import Judge, Judgement, sightline_end
from ..verify.rays.embree import Candidates, Caster
from ..verify.rays.falsify import Falsifier
from ..verify.rays.near_misses import certificate_hints
from ..verify.rays.starts import ORIGINS_MOST, aim_points, cell_origins, frontier_points
from ..verify.rays.witness import CHUNK, confirm_cells, confirm_objects, read_witnesses, visible_rows

if TYPE_CHECKING:
    from ..data.pair_sets import PairSets
    from ..data.store.bake_folder import BakeFolder

BATCH_RAYS = 100_000
# Rays of a cell at a time where nothing is judged in between.
RUN_MOST = 50_000
# Points to aim at: fewest and most; many rays share one, from different origins.
AIMS = (1 << 14, 1 << 20)
# The same in hidden cells beside the potentially visible ones, for each source.
FRONTIER = (64, 4096)
THREADS = 2
# One guided ray for so many even ones.
GUIDED = 4
# Embree's own rate is taken so many times in a run.
RATE_BLOCKS = 5
KINDS = ("cell", "object")
# Pairs of view cells and targets that are marked at a time, two bytes each.
MARKS_MOST = 1 << 28


def verify_bake(bake: "BakeFolder", *, rays: int = 1_000_000, seed: int = 0, progress: bool = False) -> VerifyResult:
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
    with shown(progress):
        judge, by_rays = _cast_lots(bake, rays, seed, result)
        start = time.perf_counter()
        _confirm_all(bake, judge, result)
        result.seconds["witnesses"] = time.perf_counter() - start
        if has_certificates(bake):
            start = time.perf_counter()
            with phase("certificates"):
                result.certificates = check_certificates(bake)
            result.seconds["certificates"] = time.perf_counter() - start
    result.counts = count_pairs(bake, by_rays)
    return result


def _cast_lots(bake: "BakeFolder", rays: int, seed: int, result: VerifyResult) -> tuple[Judge, dict[str, int]]:
    """Cast from lots of the inhabitable cells, whose sets fit into memory as matrices, until one shows an omission.

    Returns:
        The judge, and potential pairs that rays saw, by class.
    """
    sources, start = np.flatnonzero(bake.graph.inhabitable), time.perf_counter()
    with phase("prepare"):
        judge = make_judge(bake)
    result.seconds["prepare"] = time.perf_counter() - start
    size = max(1, MARKS_MOST // max(1, bake.graph.cell_count + bake.object_sets.count))
    caster, found, spent, timed = None, Counter(), 0.0, 0
    for first in range(0, len(sources), size):
        lot, start = sources[first : first + size], time.perf_counter()
        share = -(-rays * len(lot) // len(sources))
        claims = bake.cell_sets, bake.object_sets
        caster, dark = make_caster(bake, judge, claims, share, seed, sources=lot, like=caster)
        result.dark_cells += len(dark)
        result.seconds["prepare"] += time.perf_counter() - start
        if caster is None or not rays:
            continue
        before = result.rays + len(caster.sources)
        spent += _cast_all(bake, caster, judge, share, result)
        timed += result.rays - before
        result.rays_per_second = timed / spent if spent else 0.0
        if bake.scene is not None and not result.wrong_hidden:
            _hunt(bake, caster, judge, share // GUIDED, result)
        found.update(pairs_by_rays(bake, caster))
        if result.wrong_hidden:
            break
    return judge, found


@dataclass(frozen=True)
class Replayed:
    """A case file tried again.

    Attributes:
        case: as read.
        hidden: the bake still hides the pair.
        judgement: what the exact test says of the sightline now.
        pair: the cell and what it sees, in words.
    """

    case: WrongHidden
    hidden: bool
    judgement: Judgement
    pair: str

    @property
    def ok(self) -> bool:
        """The bake no longer hides a visible pair here."""
        return not (self.hidden and self.judgement is Judgement.VISIBLE)

    def line(self) -> str:
        """The outcome in one line."""
        verdict = "hidden" if self.hidden else "potential"
        state = "fixed" if self.ok else "wrong-hidden"
        return f"{state}: {self.pair}: bake says {verdict}, the sightline is {self.judgement.name.lower()}"


def replay(path: str | Path, bake: "BakeFolder | None" = None) -> Replayed:
    """Judge the sightline of a case file again.

    Args:
        path: case file.
        bake: to judge it by; by default the bake that the file names.

    Raises:
        InputError: no case file, no bake, or ids that the bake does not have.
    """
    case = read_case(path)
    if bake is None:
        from ..data.store.bake_folder import read_bake

        bake = read_bake(case.bake)
    table = bake.cell_sets if case.kind == "cell" else bake.object_sets
    if not (0 <= case.cell < table.shape[0] and 0 <= case.target < table.shape[1]):
        raise InputError(f"{path}: expected ids below {table.shape}, found cell {case.cell}, target {case.target}")
    origin, direction = np.array(case.origin), np.array(case.direction)
    judgement = make_judge(bake).judge(case.kind, case.cell, case.target, origin, origin + direction)
    pair = _pair_text(bake, case.cell, case.kind, case.target)
    return Replayed(case, not table.has(case.cell, case.target), judgement, pair)


def _pair_text(bake: "BakeFolder", cell: int, kind: str, target: int) -> str:
    """A pair in words, with the rooms of cells."""
    return f"cell {bake.cell_text(cell)}, {kind} {bake.cell_text(target) if kind == 'cell' else target}"


def make_judge(bake: "BakeFolder") -> Judge:
    """The exact judge of a bake's sightlines."""
    links = portal_links(bake.graph)
    if bake.scene is None:
        nothing = Sightlines(np.zeros((0, 3, 3), np.int32))
        return Judge(bake.graph, None, nothing, links)
    lines, glass = (Sightlines(*bake.scene.triangles(*roles)) for roles in (OPAQUE, [Role.TRANSPARENT]))
    return Judge(bake.graph, lines, glass, links, bake.cracks)


def make_caster(
    bake: "BakeFolder",
    judge: Judge,
    claims: "tuple[np.ndarray | PairSets, np.ndarray | PairSets]",
    rays: int,
    seed: int,
    sources: np.ndarray | None = None,
    like: Caster | None = None,
) -> tuple[Caster | None, np.ndarray]:
    """Caster of the inhabitable cells that hold a free point, and the dark cells, which hold none.

    Args:
        bake: its model, or graph, and cells are used.
        judge: of its sightlines.
        claims: potentially visible cells and objects, shapes (cells, cells) and (cells, objects), bool.
        rays: that are to be cast.
        seed: of origins and directions.
        sources: inhabitable cells to cast from, ids; None for all.
        like: a caster of others of the same model, whose trees serve this one too.
    """
    sources = np.flatnonzero(bake.graph.inhabitable) if sources is None else sources
    none = Sightlines(np.zeros((0, 3, 3), np.int32))
    lines, glass = judge.lines or none, judge.glass
    share = -(-rays // max(len(sources), 1))
    wanted = int(np.clip(share // 32, 8, ORIGINS_MOST))
    spots = cell_origins(bake.graph, sources, wanted, lines, seed)
    lit = np.array([len(own) > 0 for own in spots], bool)
    dark, sources = sources[~lit], sources[lit]
    if not len(sources):
        return None, dark
    potential = claims[0][sources]
    if like is not None:
        links = like.links
    else:
        links = judge.links if judge.lines is None else contact_links(bake.graph.tiles.cells, bake.graph.cell_count)
    caster = Caster(
        sources=sources,
        spots=[own for own in spots if len(own)],
        aims=aim_points(lines.triangles, lines.owners, int(np.clip(rays // 32, *AIMS)), seed),
        frontier=frontier_points(links, bake.graph.cells, potential, int(np.clip(share // 8, *FRONTIER)), seed),
        boxes=bake.graph.cells,
        links=links,
        potential_cells=potential,
        potential_objects=claims[1][sources],
        opaque=(lines.triangles, lines.owners),
        glass=(glass.triangles, glass.owners),
        seed=seed,
        scenes=None if like is None else like.scenes,
    )
    return caster, dark


def seen_by_rays(bake: "BakeFolder", rays: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Cells that rays enter and objects that they hit, whatever the bake says of them; no exact test.

    Args:
        bake: its model, or graph, and cells are used.
        rays: over all inhabitable cells, even ones and aimed ones as `verify` casts them.
        seed: of origins and directions.

    Returns:
        Shapes (cells, cells) and (cells, objects), bool.
    """
    found = tuple(np.zeros(sets.shape, bool) for sets in (bake.cell_sets, bake.object_sets))
    everything = tuple(np.ones_like(claims) for claims in found)
    caster, _ = make_caster(bake, make_judge(bake), everything, rays, seed)
    if caster is not None:
        each = -(-rays // len(caster.sources))
        for first in range(0, each, RUN_MOST):
            caster.cast(first, min(RUN_MOST, each - first))
        found[0][caster.sources], found[1][caster.sources] = caster.seen_cells > 0, caster.seen_objects > 0
    return found


def _cast_all(bake: "BakeFolder", caster: Caster, judge: Judge, rays: int, result: VerifyResult) -> float:
    """Cast in batches on two threads; judge candidates in order; stop at the first wrong-hidden.

    Returns:
        Seconds for all rays but the first of each cell.
    """
    sources, rows = caster.sources, len(caster.sources)
    total = -(-rays // rows)
    # The first batch is one ray a cell: it compiles the kernels, outside the clock and on one thread.
    start = time.perf_counter()
    if judge_batch(bake, sources, judge, caster.cast(0, 1), result):
        result.rays, result.cell_rays = result.rays + rows, result.cell_rays + caster.cell_rays(1)
        return 0.0
    result.seconds["compile"] = result.seconds.get("compile", 0.0) + time.perf_counter() - start
    blocks, done, spent = _blocks(rows, total), 1, 0.0
    with ThreadPoolExecutor(THREADS) as pool, phase("rays", rows * total, "ray") as bar:
        for block in blocks:
            start, first = time.perf_counter(), done
            for (_, run), found in zip(block, pool.map(lambda batch: caster.cast(*batch), block), strict=True):
                done += run
                bar.update(rows * run)
                if judge_batch(bake, sources, judge, found, result):
                    pool.shutdown(cancel_futures=True)
                    break
            seconds = time.perf_counter() - start
            spent += seconds
            if result.wrong_hidden:
                break
            if judge.lines is not None and len(judge.lines.triangles):
                # Embree alone beside each block: when the machine is busy with something else, both suffer.
                rate = caster.raw_rate(first, block[0][1])
                result.embree_rates.append((rows * (done - first) / seconds, rate))
    result.rays, result.cell_rays = result.rays + rows * done, result.cell_rays + caster.cell_rays(done)
    result.seconds["rays"] = result.seconds.get("rays", 0.0) + spent
    return spent


def _blocks(rows: int, total: int) -> list[list[tuple[int, int]]]:
    """Batches (first ray, rays per row) of rays 1 to total - 1 in at most five blocks that keep all threads busy."""
    pieces = THREADS * RATE_BLOCKS
    pieces *= -(-(total - 1) * rows // (pieces * BATCH_RAYS))
    run = max(1, -(-(total - 1) // max(pieces, 1)))
    batches = [(first, min(run, total - first)) for first in range(1, total, run)]
    size = max(1, pieces // RATE_BLOCKS)
    return [batches[place : place + size] for place in range(0, len(batches), size)]


def _hunt(bake: "BakeFolder", caster: Caster, judge: Judge, rays: int, result: VerifyResult) -> None:
    """Rays that look where an omission is likeliest, and random ones that bound what is missed."""
    start, sources, before = time.perf_counter(), caster.sources, result.guided_rays
    falsifier = Falsifier(
        boxes=bake.graph.cells[sources],
        plans=bake.graph.plans.take(sources, bake.graph.cell_count),
        spots=caster.spots,
        claimed=caster.potential_objects,
        opaque=caster.opaque,
        glass=caster.glass,
        lines=judge.lines,
        hints=certificate_hints(bake, sources) if has_certificates(bake) else None,
        cells=(bake.graph.cells, caster.potential_cells) if bake.claims_cells else None,
        seed=caster.seed,
    )
    with phase("guided rays", rays, "ray") as bar:
        for found, state in falsifier.batches(rays):
            bar.reach(state.rays)
            result.guided_rays = before + state.rays
            if judge_batch(bake, sources, judge, found, result):
                break
    result.random_rays = np.concatenate([result.random_rays, falsifier.uniform_rays])
    result.seconds["guided rays"] = result.seconds.get("guided rays", 0.0) + time.perf_counter() - start


def judge_batch(bake: "BakeFolder", sources: np.ndarray, judge: Judge, found: Candidates, result: VerifyResult) -> bool:
    """Count a batch's candidates; write the case file of the first wrong-hidden and say True."""
    for number in range(len(found.rows)):
        cell, kind = int(sources[found.rows[number]]), KINDS[found.kinds[number]]
        target, origin = int(found.targets[number]), found.origins[number]
        end = sightline_end(found, number, bake.graph.cells)
        outcome = judge.judge(kind, cell, target, origin, end)
        result.grazes += outcome is Judgement.GRAZE
        result.leaks += outcome is Judgement.LEAK
        result.blocked += outcome is Judgement.BLOCKED
        if outcome is Judgement.VISIBLE:
            result.wrong_hidden += 1
            model = str(bake.manifest.get("source", ""))
            vectors = tuple(origin.tolist()), tuple((end - origin).tolist())
            line = bake.in_model(np.stack([origin, end]) * bake.grid_m)
            ends = tuple(tuple(point) for point in line.tolist())
            case = WrongHidden(str(Path(bake.folder).resolve()), model, cell, kind, target, *vectors, ends)
            result.case, result.pair = write_case(case), _pair_text(bake, cell, kind, target)
            return True
    return False


def _confirm_all(bake: "BakeFolder", judge: Judge, result: VerifyResult) -> None:
    """Confirm every stored witness, a chunk of rows at a time."""
    tables = [("cell", "reached_cell_id", bake.cell_to_cell, result.cell_witnesses)]
    if judge.lines is not None:
        tables.append(("object", "object_id", bake.cell_to_object, result.object_witnesses))
    for kind, target, table, outcome in tables:
        rows = visible_rows(table)
        for first in track(range(0, len(rows), CHUNK), f"{kind} witnesses", "chunk"):
            part = read_witnesses(rows.slice(first, CHUNK), target, bake.grid_m)
            if kind == "cell":
                reasons = confirm_cells(part, bake.graph, judge.lines)
            else:
                reasons = confirm_objects(part, bake.graph, judge.lines, judge.glass)
            outcome.add(kind, part.cells, part.targets, reasons, bake.cell_text)
