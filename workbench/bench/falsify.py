"""Omissions planted in true potentially visible sets: how soon does each way of casting rays find them?

Usage: python -m viewcell.workbench.bench falsify [SCENE ...] [--bake FOLDER] [--rays N] [--seconds S] [--omissions N]

Pairs with an exactly confirmed witness are taken out of the claim, so many of each decade of solid angle: the mean over
free points of the view cell of the solid angle under which the object is seen. All are planted together; single ones
beside show whether the others helped. Found means confirmed by exact adjudication.
"""

import argparse
import math
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...data.buildings.office import make_office
from ...data.readers import read
from ...data.store.bake_folder import read_bake
from ...verify.rays.adjudicate import Judge, Judgement, sightline_end
from ...verify.rays.embree import Candidates, Caster
from ...verify.rays.falsify import SHARES, Falsifier
from ...verify.rays.solid_angles import SAMPLES, SolidAngles
from ...verify.rays.starts import ORIGINS_MOST, cell_origins
from ...verify.rays.witness import visible_rows
from ..bake.run import bake
from ..verify import make_caster, make_judge
from .timing import commit, print_head, print_row

if TYPE_CHECKING:
    from ...data.store.bake_folder import BakeFolder

# Decades of solid angle [powers of 10 sr]; the last is open.
DECADES = (-8, -7, -6, -5, -4, -3, -2)
# Pairs that are graded at most.
PAIRS = 8000
MARKS = (10**5, 10**6, 10**7)
WANTED = 0.9
THREADS = 2
# Rays of each view cell that the caster of `viewcell verify` casts in a batch.
RUN = 512


@dataclass(frozen=True)
class Setting:
    """A true bake, and what the searches share.

    Attributes:
        bake: whose claim is put to the test.
        judge: exact.
        sources: view cells with a free point.
        spots: free points of each.
    """

    bake: "BakeFolder"
    judge: Judge
    sources: np.ndarray
    spots: list[np.ndarray]


@dataclass(frozen=True)
class Omissions:
    """Pairs to plant: place among the sources, object, solid angle [sr]; each of shape (n,)."""

    rows: np.ndarray
    objects: np.ndarray
    solid_angles: np.ndarray

    def __getitem__(self, chosen: np.ndarray) -> "Omissions":
        return Omissions(self.rows[chosen], self.objects[chosen], self.solid_angles[chosen])


def prepare(made: "BakeFolder", seed: int) -> Setting:
    """The bake's view cells that have a free point."""
    judge, sources = make_judge(made), np.flatnonzero(made.graph.inhabitable)
    spots = cell_origins(made.graph, sources, ORIGINS_MOST, judge.lines, seed)
    lit = np.array([len(own) > 0 for own in spots], bool)
    return Setting(made, judge, sources[lit], [own for own in spots if len(own)])


def graded_pairs(setting: Setting, seed: int) -> tuple[Omissions, int]:
    """Opaque objects with a witness, their solid angles, and how many were dropped as too uncertain."""
    rng, lines = np.random.default_rng(seed), setting.judge.lines
    row_of = np.full(setting.bake.graph.cell_count, -1)
    row_of[setting.sources] = np.arange(len(setting.sources))
    table = visible_rows(setting.bake.cell_to_object)
    rows, objects = row_of[table["cell_id"].to_numpy()], table["object_id"].to_numpy().astype(np.int64)
    kept = np.flatnonzero((rows >= 0) & np.isin(objects, lines.owners))
    kept = np.sort(rng.permutation(kept)[:PAIRS])
    rows, objects = rows[kept], objects[kept]
    mean, error = SolidAngles(lines, len(setting.bake.scene.objects), setting.spots).graded(rows, objects, rng)
    sure = np.flatnonzero(error <= SAMPLES[-1][1])
    return Omissions(rows[sure], objects[sure], mean[sure]), len(rows) - len(sure)


def decade(solid_angles: np.ndarray) -> np.ndarray:
    """Place of each in `DECADES`, -1 below them."""
    return np.searchsorted(DECADES, np.log10(np.maximum(solid_angles, 1e-300)), "right") - 1


def choose(pairs: Omissions, most: int, seed: int) -> Omissions:
    """At most so many pairs of each decade."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(pairs.rows))
    own = decade(pairs.solid_angles[order])
    return pairs[np.concatenate([order[own == place][:most] for place in range(len(DECADES))])]


# Claim (sources, objects) and rays -> candidates and rays so far; what is prepared is so before the first is asked for.
Search = Callable[[np.ndarray, int], Iterator[tuple[Candidates, int]]]


def searches(setting: Setting, seed: int) -> dict[str, Search]:
    """Ways to cast rays, by title."""

    def guided(shares: dict[str, float]) -> Search:
        def search(claimed: np.ndarray, rays: int) -> Iterator[tuple[Candidates, int]]:
            falsifier = make_falsifier(setting, claimed, shares, seed)
            return ((found, progress.rays) for found, progress in falsifier.batches(rays))

        return search

    def verify_mix(claimed: np.ndarray, rays: int) -> Iterator[tuple[Candidates, int]]:
        planted = setting.bake.potential_objects.copy()
        planted[setting.sources] = claimed
        claims = setting.bake.potential_cells, planted
        caster, _ = make_caster(setting.bake, setting.judge, claims, rays, seed)
        caster.cast(0, 1)
        return in_turn(caster, len(caster.sources), rays)

    without = {f"without {name}": guided({**SHARES, name: 0.0}) for name in SHARES if name != "uniform"}
    return {"uniform": guided({"uniform": 1.0}), "verify": verify_mix, "falsifier": guided(SHARES), **without}


def in_turn(caster: Caster, rows: int, rays: int) -> Iterator[tuple[Candidates, int]]:
    """Batches of the caster of `viewcell verify` on two threads."""
    first = 1
    with ThreadPoolExecutor(THREADS) as pool:
        while first * rows < rays:
            for found in pool.map(lambda place: caster.cast(place, RUN), (first, first + RUN)):
                first += RUN
                yield found, first * rows


def make_falsifier(setting: Setting, claimed: np.ndarray, shares: dict[str, float], seed: int) -> Falsifier:
    """Falsifier of the objects that a bake hides."""
    judge = setting.judge
    return Falsifier(
        boxes=setting.bake.graph.cells[setting.sources],
        spots=setting.spots,
        claimed=claimed,
        opaque=(judge.lines.triangles, judge.lines.owners),
        glass=(judge.glass.triangles, judge.glass.owners),
        lines=judge.lines,
        shares=shares,
        seed=seed,
    )


@dataclass
class Outcome:
    """What a search found.

    Attributes:
        first: rays when each omission was confirmed, inf if it was not, shape (n,).
        seconds: likewise, from the first ray.
        rays: cast in all.
        spent: seconds in all.
        prepared: seconds before the first ray.
        others: confirmed sightlines of pairs that were not planted: faults of the bake.
    """

    first: np.ndarray
    seconds: np.ndarray
    rays: int = 0
    spent: float = 0.0
    prepared: float = 0.0
    others: int = 0


def look(setting: Setting, planted: Omissions, search: Search, rays: int, seconds: float) -> Outcome:
    """Search for the omissions until all are confirmed or the rays or the seconds are spent."""
    claimed = setting.bake.potential_objects[setting.sources].copy()
    claimed[planted.rows, planted.objects] = False
    place = np.full(claimed.shape, -1)
    place[planted.rows, planted.objects] = np.arange(len(planted.rows))
    out = Outcome(*np.full((2, len(planted.rows)), np.inf))
    start = time.perf_counter()
    batches = search(claimed, rays)
    out.prepared, start = time.perf_counter() - start, time.perf_counter()
    for found, done in batches:
        for number in np.flatnonzero(found.kinds == 1):
            row, target = int(found.rows[number]), int(found.targets[number])
            omission = place[row, target]
            if omission >= 0 and np.isfinite(out.first[omission]):
                continue
            end = sightline_end(found, number, setting.bake.graph.cells)
            cell = int(setting.sources[row])
            if setting.judge.judge("object", cell, target, found.origins[number], end) is not Judgement.VISIBLE:
                continue
            if omission < 0:
                out.others += 1
            else:
                out.first[omission], out.seconds[omission] = done, time.perf_counter() - start
        out.rays, out.spent = done, time.perf_counter() - start
        if np.isfinite(out.first).all() or out.spent > seconds:
            break
    return out


def expected_rays(planted: Omissions, rows: int, share: float) -> float:
    """Uniform rays over all view cells that find this share of the omissions on the mean, by their solid angles."""
    low, high = 0.0, 1e18
    while high > 1.001 * low + 1:
        middle = math.sqrt(max(low, 1.0) * high)
        found = -np.expm1(middle / rows * np.log1p(-np.minimum(planted.solid_angles, 12) / (4 * math.pi))).mean()
        low, high = (low, middle) if found >= share else (middle, high)
    return high


def rays_for(first: np.ndarray, share: float) -> float:
    """Rays after which this share was found; inf if it never was."""
    return float(np.sort(first)[math.ceil(share * len(first)) - 1]) if len(first) else math.inf


def parts_of(planted: Omissions) -> dict[str, np.ndarray]:
    """Omissions by decade of solid angle, and those of the goals, by title; bool, shape (n,)."""
    own = decade(planted.solid_angles)
    ends = [f"1e{low} to 1e{low + 1}" for low in DECADES[:-1]] + [f"above 1e{DECADES[-1]}"]
    return {
        **{title: own == place for place, title in enumerate(ends)},
        "above 1e-5": planted.solid_angles >= 1e-5,
        "all": np.ones(len(own), bool),
    }


def print_outcomes(planted: Omissions, outcomes: dict[str, Outcome], rows: int) -> None:
    """The table: a row for each part and way."""
    marks = [f"{mark:.0e} rays, %".replace("e+0", "e") for mark in MARKS]
    print_head(["solid angle, sr", "omissions", "rays by", *marks, "all, %", "rays for 90 %", "s for 90 %"])
    for title, own in parts_of(planted).items():
        if not own.any():
            continue
        count = int(own.sum())
        for name, outcome in outcomes.items():
            first = outcome.first[own]
            ends = [mark if mark <= outcome.rays or np.isfinite(outcome.first).all() else None for mark in MARKS]
            shares = [f"{np.mean(first <= end):.0%}" if end else "-" for end in (*ends, outcome.rays)]
            seconds = rays_for(outcome.seconds[own], WANTED)
            print_row([title, count, name, *shares, _number(rays_for(first, WANTED)), _number(seconds)])
        print_row(
            [title, count, "uniform, expected", *["-"] * 4, _number(expected_rays(planted[own], rows, WANTED)), "-"]
        )
    for name, outcome in outcomes.items():
        rate = outcome.rays / max(outcome.spent, 1e-9)
        print(
            f"{name}: {outcome.rays:.3g} rays, {outcome.spent:.1f} s ({rate:,.0f} a second) after "
            f"{outcome.prepared:.1f} s of preparation; {outcome.others} confirmed that were not planted"
        )


def _number(value: float) -> str:
    return f"{value:.2g}" if math.isfinite(value) else "not found"


def print_single(setting: Setting, planted: Omissions, together: Outcome, options: argparse.Namespace) -> None:
    """Some omissions planted alone, beside when they were found among the others."""
    rng = np.random.default_rng(options.seed)
    chosen = np.sort(rng.permutation(np.flatnonzero(np.isfinite(together.first)))[: options.single])
    print_head(["solid angle, sr", "rays, planted alone", "rays, planted together"])
    ratios = []
    for place in chosen:
        own = planted[np.array([place])]
        alone = look(setting, own, searches(setting, options.seed)["falsifier"], options.rays, options.seconds)
        ratios.append(alone.first[0] / together.first[place])
        print_row([f"{own.solid_angles[0]:.1e}", _number(alone.first[0]), _number(together.first[place])])
    if ratios:
        print(f"median of alone / together: {np.median(ratios):.2f}")


def compare(made: "BakeFolder", name: str, options: argparse.Namespace) -> None:
    """Grade, plant, search and print for one bake."""
    setting = prepare(made, options.seed)
    pairs, dropped = graded_pairs(setting, options.seed)
    planted = choose(pairs, options.omissions, options.seed)
    claimed = setting.bake.potential_objects[setting.sources]
    print(
        f"\n{name}, commit {commit()}: {len(setting.sources)} view cells, {claimed.shape[1]:,} objects, "
        f"{int((~claimed).sum()):,} hidden pairs; {len(planted.rows)} planted of {len(pairs.rows):,} graded, "
        f"{dropped} dropped as too uncertain\n",
        flush=True,
    )
    ways = searches(setting, options.seed)
    outcomes = {
        way: look(setting, planted, ways[way], options.rays, options.seconds) for way in options.ways.split(",")
    }
    print_outcomes(planted, outcomes, len(setting.sources))
    if options.single and "falsifier" in outcomes:
        print_single(setting, planted, outcomes["falsifier"], options)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of `run`."""
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="by default the office")
    parser.add_argument("--bake", action="append", default=[], metavar="FOLDER", help="use this bake")
    parser.add_argument("--rays", type=int, default=10**9, help="at most, for each way")
    parser.add_argument("--seconds", type=float, default=60.0, help="at most, for each way")
    parser.add_argument("--omissions", type=int, default=40, help="at most, of each decade")
    parser.add_argument("--single", type=int, default=0, help="of them planted alone as well")
    parser.add_argument("--ways", default="uniform,verify,falsifier", help="separated by commas; also 'without NAME'")
    parser.add_argument("--seed", type=int, default=0)


def run(options: argparse.Namespace) -> int:
    """Print the tables of each scene. Returns the exit code."""
    for folder in options.bake:
        compare(read_bake(folder), Path(folder).name, options)
    for scene in options.scenes or ([] if options.bake else ["office"]):
        with tempfile.TemporaryDirectory() as folder:
            model = make_office() if scene == "office" else read(scene)
            compare(bake(model, Path(folder) / "true.bake"), Path(scene).name, options)
    return 0
