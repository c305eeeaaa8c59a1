"""Rays that look for what a potentially visible set leaves out: most where an omission is likeliest, some everywhere.

`guide.Guide` tells where; here the rays are cast, in rounds, and what they see of the hidden becomes candidates for
exact adjudication.
"""

import math
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from ...data.errors import InputError
from ...data.plans import NO_PLANS, Plans
from ..exact.sightline import Sightlines
from .crossing import Crossings
from .embree import Candidates, embree_scene, through_glass
from .free_space import FreeSpace, all_axes
from .guide import SHORT, STRATEGIES, Aimed, Guide, Hints, Lesson, length, slab
from .targets import Targets

SHARES = {"uniform": 0.25, "aim": 0.22, "near": 0.25, "gap": 0.2, "mutate": 0.08}
# Of all rays if there are hints; the others give way in proportion, the uniform ones excepted.
HINT_SHARE = 0.1
# Batches between two looks at what was learnt, for any number of threads; rays of the first and of the largest.
ROUND = 4
BATCH = (1 << 11, 1 << 16)
GROWTH = 1.5
THREADS = 2
# Candidates of one pair that are proposed: if the first ones only graze, a later one may not.
ATTEMPTS = 16
# Pairs of view cell and target above which their weights are brought up to date only after as many rays.
MANY_PAIRS = 1 << 18


@dataclass(frozen=True)
class Progress:
    """How far a search has come.

    Attributes:
        rays: cast so far.
        uniform_rays: independent uniform ones of each view cell, shape (rows,), int64.
        by_strategy: rays of each strategy.
    """

    rays: int
    uniform_rays: np.ndarray
    by_strategy: dict[str, int]


class Falsifier:
    """Searches the sightlines of view cells for targets that are claimed to be hidden.

    Attributes:
        lit: view cells that have a free point, shape (rows,), bool; no ray starts in the others.
        uniform_rays: independent uniform rays cast from each view cell, shape (rows,), int64.
        free: where rays start.
        targets: where they are aimed.
    """

    def __init__(
        self,
        *,
        boxes: np.ndarray,
        spots: list[np.ndarray],
        claimed: np.ndarray,
        opaque: tuple[np.ndarray, np.ndarray],
        glass: tuple[np.ndarray, np.ndarray],
        lines: Sightlines | None = None,
        cells: tuple[np.ndarray, np.ndarray] | None = None,
        plans: Plans = NO_PLANS,
        hints: Hints | None = None,
        shares: Mapping[str, float] | None = None,
        threads: int = THREADS,
        seed: int = 0,
    ):
        """Prepare the search; it needs about 40 bytes per pair of view cell and target.

        Args:
            boxes: view cells [grid steps], shape (rows, 2, 3), int32.
            spots: free points of each, ragged, float32 (`aims.cell_origins`); used where chance finds none.
            claimed: objects that each view cell may see, shape (rows, objects), bool.
            opaque: triangles [grid steps], shape (m, 3, 3), int32, |coordinate| < 2**24, none degenerate, and the
                object of each.
            glass: the same of transparent objects.
            lines: `Sightlines` of the opaque triangles, if they are there already.
            cells: boxes of cells [grid steps], shape (cells, 2, 3), int32, and those that each view cell may see, shape
                (rows, cells), bool; None if nothing is claimed of cells.
            plans: of view cells that are prisms in their boxes.
            hints: sightlines to look near.
            shares: of the rays, by strategy (`guide.STRATEGIES`); they are scaled to a sum of 1.
            threads: that cast; they do not change the answer.
            seed: of all rays.

        Raises:
            InputError: shapes that do not match, or shares that are no shares.
        """
        rows, objects = len(boxes), claimed.shape[-1]
        boxes_of_cells, claimed_cells = cells or (np.zeros((0, 2, 3), np.int32), np.zeros((rows, 0), bool))
        for name, found, expected in (
            ("claimed", claimed.shape, (rows, objects)),
            ("spots", (len(spots),), (rows,)),
            ("claimed_cells", claimed_cells.shape, (rows, len(boxes_of_cells))),
        ):
            if found != expected:
                raise InputError(f"{name}: expected shape {expected}, found {found}")
        self._shares = scaled_shares(SHARES if shares is None else shares, hints is not None and len(hints.rows) > 0)
        self._seed, self._threads = seed, threads
        self._owners = np.append(opaque[1], -1).astype(np.int64)
        self._scene = embree_scene(opaque[0])
        self.free = FreeSpace(boxes, spots, lines or Sightlines(*opaque), plans)
        triangles, owners = (np.concatenate(pair) for pair in zip(opaque, glass, strict=True))
        self.targets = Targets(triangles, owners, objects, boxes_of_cells)
        self._crossings = Crossings(self.targets.cells)
        self._guide = Guide(
            self.free, self.targets, np.concatenate([claimed, claimed_cells], axis=1), opaque, hints, seed
        )
        shown = self._guide.hidden[:, :objects].any(axis=0)[glass[1]]
        self._glass_owners = glass[1][shown].astype(np.int64)
        self._glass_scene = embree_scene(glass[0][shown])
        self._attempts = np.zeros(self._guide.hidden.size, np.uint8)
        self.lit, self.uniform_rays = self.free.lit, np.zeros(rows, np.int64)

    def seen(self) -> np.ndarray:
        """Claimed pairs that a ray has seen so far, shape (rows, objects + cells), bool; cells only if aimed at."""
        return self._guide.seen()

    def batches(self, rays: int) -> Iterator[tuple[Candidates, Progress]]:
        """Cast rays in rounds; stop whenever enough is known.

        Args:
            rays: to cast in all. Whole rounds are the same for any number.

        Yields:
            After each round the rays that saw what is claimed hidden, each starting strictly inside its view cell and
            outside every solid, for exact adjudication (`adjudicate.Judge`), and the progress. A pair is proposed at
            most 16 times. Nothing if no pair is hidden.

        Raises:
            InputError: `rays` is negative.
        """
        if rays < 0:
            raise InputError(f"rays: expected 0 or more, found {rays}")
        if not self._guide.hidden.any():
            return
        done, number, size, weighed = 0, 0, float(BATCH[0]), -math.inf
        spent = dict.fromkeys(self._shares, 0)
        with ThreadPoolExecutor(self._threads) as pool:
            while done < rays:
                if done - weighed >= self._guide.hidden.size or self._guide.hidden.size <= MANY_PAIRS:
                    self._guide.weigh_pairs(self._attempts >= ATTEMPTS)
                    weighed = done
                self._guide.weigh_seen()
                left = np.minimum(int(size), rays - done - int(size) * np.arange(ROUND))
                counts = left[left > 0].tolist()
                results = list(pool.map(self._cast, range(number + 1, number + 1 + len(counts)), counts))
                done, number, size = done + sum(counts), number + len(counts), min(size * GROWTH, BATCH[1])
                for result in results:
                    for name, count in result[3].items():
                        spent[name] += count
                yield self._merge(results), Progress(done, self.uniform_rays.copy(), dict(spent))

    def _cast(self, number: int, count: int) -> tuple[Candidates, Lesson, np.ndarray, dict[str, int]]:
        """Batch `number`: its candidates, what it teaches, the rows of its uniform rays, its rays by strategy."""
        rng = np.random.default_rng([self._seed, number])
        ends = np.round(np.cumsum(list(self._shares.values())) * count).astype(int)
        parts = dict(zip(self._shares, np.diff(ends, prepend=0).tolist(), strict=True))
        drawn = [vars(self._guide.rays(name, wanted, rng)) for name, wanted in parts.items()]
        aimed = Aimed(**{name: np.concatenate([part[name] for part in drawn]) for name in drawn[0]})
        aimed.along[length(aimed.along) == 0] = (1, 0, 0)
        directions = aimed.along / length(aimed.along)[:, None]
        reach, objects = self._first_hits(aimed.origins, directions)
        strategies = np.repeat(np.arange(len(parts)), list(parts.values()))
        names = np.array([STRATEGIES.index(name) for name in parts])
        lesson = self._guide.lesson(names[strategies], aimed, directions, reach, objects)
        candidates = self._candidates(aimed, directions, reach, objects)
        return candidates, lesson, aimed.rows[aimed.fresh], parts

    def _merge(self, results: list[tuple]) -> Candidates:
        """Learn from a round's batches, in order; their candidates, without those of pairs proposed often enough."""
        kept = []
        for own, _, fresh, _ in results:
            self.uniform_rays += np.bincount(fresh, minlength=len(self.uniform_rays))
            keys = own.rows * self.targets.count + own.targets + self.targets.objects * (own.kinds == 0)
            allowed = self._attempts[keys] < ATTEMPTS
            self._attempts[keys[allowed]] += 1
            kept.append([column[allowed] for column in vars(own).values()])
        self._guide.learn([result[1] for result in results])
        return Candidates(*(np.concatenate(column) for column in zip(*kept, strict=True)))

    def _first_hits(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Parameter and object of each ray's first opaque hit; infinity and -1 if there is none."""
        if self._scene is None:
            return np.full(len(origins), np.inf, np.float32), np.full(len(origins), -1)
        found = self._scene.run(origins, directions, output=1)
        return np.where(found["primID"] >= 0, found["tfar"], np.float32(np.inf)), self._owners[found["primID"]]

    def _candidates(self, aimed: Aimed, directions: np.ndarray, reach: np.ndarray, objects: np.ndarray) -> Candidates:
        """One ray for each hidden pair that the rays show."""
        hit = np.flatnonzero(objects >= 0)
        shown = [(hit, objects[hit], reach[hit]), *self._through_glass(aimed.origins, directions, reach)]
        for ray, target in (self._entered(aimed, directions, reach), self._crossed(aimed, directions, reach)):
            shown.append((ray, target, reach[ray]))
        ray, target, far = (np.concatenate(column) for column in zip(*shown, strict=True))
        keys = aimed.rows[ray] * self.targets.count + target
        wrong = np.flatnonzero(self._guide.hidden.ravel()[keys] & (self._attempts[keys] < ATTEMPTS))
        wrong = wrong[np.unique(keys[wrong], return_index=True)[1]]
        rows, starts = aimed.rows[ray[wrong]], aimed.origins[ray[wrong]].astype(np.float64)
        good = all_axes((starts > self.free.low[rows]) & (starts < self.free.high[rows]))
        good &= self.free.lines.outside_solids(starts)
        rows, starts, wrong = rows[good], starts[good], wrong[good]
        is_object = target[wrong] < self.targets.objects
        targets = np.where(is_object, target[wrong], target[wrong] - self.targets.objects)
        along = directions[ray[wrong]].astype(np.float64)
        return Candidates(rows, is_object.astype(np.int64), targets, starts, along, far[wrong].astype(np.float64))

    def _entered(self, aimed: Aimed, directions: np.ndarray, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The rays that enter the cell they are aimed at before they are stopped, and that cell."""
        rays = np.flatnonzero(aimed.targets >= self.targets.objects)
        low, high = self.targets.cells[aimed.targets[rays] - self.targets.objects].transpose(1, 0, 2)
        with np.errstate(divide="ignore", invalid="ignore"):
            enter, leave = slab(aimed.origins[rays], directions[rays], low, high)
        rays = rays[enter < np.float32(SHORT) * np.fmin(leave, reach[rays])]
        return rays, aimed.targets[rays]

    def _crossed(self, aimed: Aimed, directions: np.ndarray, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The uniform rays that pass through a hidden cell, wherever it is, and that cell."""
        objects, rays = self.targets.objects, np.flatnonzero(aimed.fresh)
        hidden = self._guide.hidden
        wanted = (hidden & (self._attempts.reshape(hidden.shape) < ATTEMPTS))[:, objects:]
        cells = self._crossings.crossed(aimed.origins[rays], directions[rays], reach[rays], aimed.rows[rays], wanted)
        return rays[cells >= 0], cells[cells >= 0].astype(np.int64) + objects

    def _through_glass(
        self, origins: np.ndarray, directions: np.ndarray, reach: np.ndarray
    ) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Rays, transparent objects that they pass before they are stopped, and where; one sheet after the other."""
        for rays, triangles, passed in through_glass(self._glass_scene, origins, directions, reach):
            yield rays, self._glass_owners[triangles], passed


def scaled_shares(shares: Mapping[str, float], hinted: bool) -> dict[str, float]:
    """Shares of the strategies that have any, with a sum of 1; a tenth for hints, if there are any and none is given.

    Raises:
        InputError: an unknown strategy, a negative share, or no share at all.
    """
    if unknown := [name for name in shares if name not in STRATEGIES]:
        raise InputError(f"shares: expected names among {STRATEGIES}, found {unknown[0]!r}")
    total = sum(shares.values())
    if total <= 0 or min(shares.values()) < 0:
        raise InputError(f"shares: expected shares of 0 or more and not all 0, found {dict(shares)}")
    scaled = {name: share / total for name, share in shares.items()}
    guided = 1 - scaled.get("uniform", 0.0)
    if not hinted:
        scaled["hint"] = 0.0
    elif "hint" not in shares and guided > 0:
        scaled = {name: s if name == "uniform" else s * (1 - HINT_SHARE / guided) for name, s in scaled.items()}
        scaled["hint"] = HINT_SHARE
    total = sum(scaled.values())
    return {name: share / total for name, share in scaled.items() if share > 0} if total else {"uniform": 1.0}
