"""Where to look for what a claimed potentially visible set leaves out; `falsify.Falsifier` casts the rays.

Every ray serves one strategy. What guides them is the claim and what earlier rays met, never the truth:

- uniform: origin uniform in the free part of the view cell, direction uniform on the sphere, both independent. Only
  these bound what is missed; `confidence.Confidence`.
- aim: from a free point at a point of a hidden target. A pair is as likely as the square of how many of the target's
  16 nearest targets the view cell claims to see, and less so the oftener it was tried.
- near: from where a ray has seen a claimed object, at a hidden target near that object. Seldom seen objects come first:
  they are seen through gaps.
- gap: a ray that a hidden target's blocker has stopped, moved to just past an edge of the blocker.
- mutate: a ray that has seen a seldom seen object, with both ends moved at random on all scales.
- hint: sightlines that a bake was unsure of, moved likewise.

Sources: Wonka et al. 2006, "Guided Visibility Sampling" (adaptive border sampling, reverse sampling); Bittner et al.
2009, "Adaptive Global Visibility Sampling" (mutation of rays).
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from .free_space import FreeSpace
from .targets import Targets, sharp_edges

wp.set_module_options({"enable_backward": False})

STRATEGIES = ("uniform", "aim", "near", "gap", "mutate", "hint")
# Strategies whose stopped rays are tried past the edges of their blockers.
RETRIED = ("aim", "near", "gap")
# Weight of a pair without claimed neighbours, and the tries after which a pair counts half.
FLOOR = 0.05
PATIENCE = 16
# Claimed pairs whose rays are remembered, and (claimed pair, hidden neighbour) kept for the strategy near.
REMEMBERED = 1 << 20
LINKS = 1 << 20
# Stopped rays of a batch that are kept.
BLOCKED = 1 << 14
# Edges of a blocker that are looked at for the one nearest to the ray.
EDGES = wp.constant(6)
# How far past an edge a ray goes [grid steps, powers of 10], and how far ends are moved, as shares of the view cell or
# of the ray's length.
PAST_EDGE = (-0.5, 2.3)
MOVES = (-4.0, 0.0)
# Origins that are not drawn afresh stay this share of the view cell inside it.
INSET = 1e-4
# A ray is stopped before its target if it goes less far than this.
SHORT = 0.999


@wp.struct
class EdgeTable:
    """Edges of objects: those of object k are first[k] to first[k + 1]."""

    first: wp.array[int]
    starts: wp.array[wp.vec3]
    ends: wp.array[wp.vec3]


@wp.kernel
def pass_edges(
    edges: EdgeTable,
    origins: wp.array[wp.vec3],
    ends: wp.array[wp.vec3],
    blockers: wp.array[int],
    steps: wp.array[float],
    seed: int,
    past_out: wp.array[wp.vec3],
):
    """A point to aim each ray at so that it just passes its blocker.

    `EDGES` random edges of the blocker are tried; from the point where the one nearest to the ray comes closest to it,
    `steps` grid steps on, away from the ray. A blocker without edges gives the ray's own end.
    """
    ray = wp.tid()
    first = edges.first[blockers[ray]]
    count = edges.first[blockers[ray] + 1] - first
    origin = origins[ray]
    along = wp.normalize(ends[ray] - origin)
    past = ends[ray]
    nearest = wp.float32(1.0e30)
    state = wp.rand_init(seed, ray)
    for _ in range(wp.where(count > 0, EDGES, 0)):
        edge = first + wp.randi(state, 0, count)
        start = edges.starts[edge]
        side = edges.ends[edge] - start
        # Both as seen along the ray.
        across = side - wp.dot(side, along) * along
        offset = start - origin
        offset -= wp.dot(offset, along) * along
        share = wp.clamp(-wp.dot(across, offset) / wp.max(wp.dot(across, across), 1.0e-6), 0.0, 1.0)
        away = offset + share * across
        distance = wp.length(away)
        if distance < nearest:
            nearest = distance
            past = start + share * side + steps[ray] * wp.normalize(away)
    past_out[ray] = past


def edge_table(opaque: tuple[np.ndarray, np.ndarray], objects: int) -> EdgeTable:
    """The edges that may be silhouettes; see `targets.sharp_edges`."""
    owners, starts, ends = sharp_edges(*opaque)
    table = EdgeTable()
    first = np.searchsorted(owners, np.arange(objects + 1)).astype(np.int32)
    table.first = wp.array(first, device="cpu", copy=False)
    table.starts, table.ends = (wp.array(points, dtype=wp.vec3, device="cpu", copy=False) for points in (starts, ends))
    return table


@dataclass(frozen=True)
class Hints:
    """Sightlines near to which a claim may be wrong.

    Attributes:
        rows: view cell of each, shape (n,), int.
        origins: [grid steps], shape (n, 3), float.
        ends: likewise.
    """

    rows: np.ndarray
    origins: np.ndarray
    ends: np.ndarray


@dataclass
class Aimed:
    """Rays of n view cells.

    Attributes:
        rows: view cell of each, shape (n,), int64.
        origins: [grid steps], shape (n, 3), float32.
        along: any length but 0, shape (n, 3), float32; to the target's point where there is one.
        targets: that they are aimed at, -1 for none, shape (n,), int64.
        fresh: independent and uniform, shape (n,), bool.
    """

    rows: np.ndarray
    origins: np.ndarray
    along: np.ndarray
    targets: np.ndarray
    fresh: np.ndarray


@dataclass
class Lesson:
    """What the rays of a batch met.

    Attributes:
        tried: pairs (row * targets + target) that the strategy aim looked at, each once.
        tries: how often.
        slots: remembered claimed pairs that were seen, each once.
        seen: how often.
        origins: from where last, shape (slots, 3), float32.
        ends: likewise.
        blocked: row, origin, point aimed at, target and blocking object of rays to hidden targets.
    """

    tried: np.ndarray
    tries: np.ndarray
    slots: np.ndarray
    seen: np.ndarray
    origins: np.ndarray
    ends: np.ndarray
    blocked: tuple[np.ndarray, ...]


class Guide:
    """Chooses rays by a claim and by what was learnt; changes only in `learn`, so that batches may run side by side.

    Attributes:
        hidden: pairs to refute, shape (rows, targets), bool.
    """

    def __init__(
        self,
        free: FreeSpace,
        targets: Targets,
        claimed: np.ndarray,
        opaque: tuple[np.ndarray, np.ndarray],
        hints: Hints | None,
        seed: int,
    ):
        """Weigh every hidden pair by how many near neighbours of its target are claimed.

        Args:
            free: view cells.
            targets: objects and cells.
            claimed: targets that each view cell may see, shape (rows, targets), bool.
            opaque: triangles [grid steps], shape (m, 3, 3), and their objects.
            hints: sightlines to look near.
            seed: of the choice of neighbours.
        """
        self._free, self._targets, self._hints = free, targets, hints
        self.hidden = ~claimed & targets.present & free.lit[:, None]
        self._lit = np.flatnonzero(free.lit)
        inset = INSET * (free.high - free.low)
        self._low, self._high = (free.low + inset).astype(np.float32), (free.high - inset).astype(np.float32)
        self._edge_table = edge_table(opaque, targets.objects)
        # Two threads would each compile it.
        wp.load_module(__name__, device="cpu")
        rng = np.random.default_rng([seed, 0])
        nearest = targets.neighbours(rng)
        self._prior = np.zeros(claimed.shape, np.uint8)
        for beside in nearest.T:
            self._prior += claimed[:, beside] & (beside >= 0)
        self._tries = np.zeros(claimed.size, np.float32)
        self._remember(claimed & targets.present & free.lit[:, None], nearest, rng)
        self._blocked: tuple[np.ndarray, ...] = ()

    def _remember(self, claimed: np.ndarray, nearest: np.ndarray, rng: np.random.Generator) -> None:
        """Make room for the rays that see claimed objects, and list the hidden neighbours of these."""
        objects = self._targets.objects
        rows, targets = np.nonzero(claimed[:, :objects])
        kept = np.sort(rng.permutation(len(rows))[:REMEMBERED])
        self._seen_rows, self._seen_targets = rows[kept], targets[kept]
        self._slot = np.full((len(claimed), objects), -1, np.int32)
        self._slot[self._seen_rows, self._seen_targets] = np.arange(len(kept))
        self._seen_counts = np.zeros(len(kept))
        self._seen_origins, self._seen_ends = (np.zeros((len(kept), 3), np.float32) for _ in range(2))
        beside = nearest[self._seen_targets]
        slots, places = np.nonzero((beside >= 0) & self.hidden[self._seen_rows[:, None], beside])
        kept = np.sort(rng.permutation(len(slots))[:LINKS])
        self._link_slots, self._link_targets = slots[kept], beside[slots[kept], places[kept]].astype(np.int64)

    def seen(self) -> np.ndarray:
        """Claimed pairs that a ray has seen, of those that are remembered, shape (rows, targets), bool."""
        found, known = np.zeros(self.hidden.shape, bool), self._seen_counts > 0
        found[self._seen_rows[known], self._seen_targets[known]] = True
        return found

    def weigh_pairs(self, settled: np.ndarray) -> None:
        """Weights of the hidden pairs by how often they were tried; `settled`, shape (rows * targets,), get none."""
        weights = np.square(self._prior, dtype=np.float32).ravel() + np.float32(FLOOR)
        weights /= 1 + self._tries / np.float32(PATIENCE)
        weights[~self.hidden.ravel() | settled] = 0
        self._pair_sums = np.cumsum(weights, dtype=np.float64)

    def weigh_seen(self) -> None:
        """Weights of what was seen, by how seldom it was; before batches are cast."""
        rare = 1 / (1 + self._seen_counts)
        rare[self._seen_counts == 0] = 0
        self._seen_sums = np.cumsum(rare)
        self._link_sums = np.cumsum(rare[self._link_slots])

    def rays(self, strategy: str, count: int, rng: np.random.Generator) -> Aimed:
        """Rays of one of `STRATEGIES`; one that has nothing to go by yet aims, and without aims they are uniform."""
        aimed = getattr(self, f"_{strategy}")(count, rng)
        return aimed or self._aim(count, rng) or self._uniform(count, rng)

    def lesson(
        self, strategies: np.ndarray, aimed: Aimed, directions: np.ndarray, reach: np.ndarray, objects: np.ndarray
    ) -> Lesson:
        """What rays have met.

        Args:
            strategies: place in `STRATEGIES` of each ray's, shape (n,).
            aimed: the rays.
            directions: of unit length, shape (n, 3), float32.
            reach: parameter of the first opaque hit, shape (n,), float32.
            objects: that are hit, -1 for none, shape (n,).
        """
        rows, targets, starts = aimed.rows, aimed.targets, aimed.origins
        met = np.flatnonzero(objects >= 0)
        slots = self._slot[rows[met], objects[met]]
        met, slots = met[slots >= 0], slots[slots >= 0]
        slots, last, seen = np.unique(slots[::-1], return_index=True, return_counts=True)
        met = met[::-1][last]
        tried = np.flatnonzero((strategies == STRATEGIES.index("aim")) & (targets >= 0))
        short = reach < SHORT * length(aimed.along)
        retried = np.isin(strategies, [STRATEGIES.index(name) for name in RETRIED])
        stopped = np.flatnonzero(short & (objects >= 0) & (targets >= 0) & retried)
        stopped = stopped[:: -(-len(stopped) // BLOCKED) or 1]
        return Lesson(
            *np.unique(rows[tried] * self._targets.count + targets[tried], return_counts=True),
            slots,
            seen,
            starts[met],
            starts[met] + reach[met, None] * directions[met],
            tuple(column[stopped] for column in (rows, starts, starts + aimed.along, targets, objects)),
        )

    def learn(self, lessons: list[Lesson]) -> None:
        """Take in what the batches of a round met, in their order."""
        for lesson in lessons:
            self._tries[lesson.tried] += lesson.tries
            self._seen_counts[lesson.slots] += lesson.seen
            self._seen_origins[lesson.slots], self._seen_ends[lesson.slots] = lesson.origins, lesson.ends
        self._blocked = tuple(np.concatenate(column) for column in zip(*(x.blocked for x in lessons), strict=True))

    def _uniform(self, count: int, rng: np.random.Generator) -> Aimed:
        rows = np.sort(self._lit[(np.arange(count) + rng.integers(len(self._lit))) % len(self._lit)])
        origins, fresh, mixed = self._free.draw(rows, rng)
        doubt = np.flatnonzero(fresh & mixed)
        fresh[doubt] = self._free.lines.outside_solids(origins[doubt].astype(np.float64))
        return Aimed(rows, origins, rng.standard_normal((count, 3), np.float32), np.full(count, -1), fresh)

    def _aim(self, count: int, rng: np.random.Generator) -> Aimed | None:
        pairs = _choose(self._pair_sums, count, rng)
        if pairs is None:
            return None
        rows, targets = np.divmod(pairs, self._targets.count)
        return self._toward(rows, self._free.draw(rows, rng)[0], targets, rng)

    def _near(self, count: int, rng: np.random.Generator) -> Aimed | None:
        links = _choose(self._link_sums, count, rng)
        if links is None:
            return None
        slots = self._link_slots[links]
        rows = self._seen_rows[slots]
        return self._toward(rows, self._moved(rows, self._seen_origins[slots], rng), self._link_targets[links], rng)

    def _mutate(self, count: int, rng: np.random.Generator) -> Aimed | None:
        slots = _choose(self._seen_sums, count, rng)
        if slots is None:
            return None
        return self._shaken(self._seen_rows[slots], self._seen_origins[slots], self._seen_ends[slots], rng)

    def _hint(self, count: int, rng: np.random.Generator) -> Aimed | None:
        if self._hints is None or not len(self._hints.rows):
            return None
        chosen = rng.integers(len(self._hints.rows), size=count)
        ends = (self._hints.origins[chosen].astype(np.float32), self._hints.ends[chosen].astype(np.float32))
        return self._shaken(np.asarray(self._hints.rows, np.int64)[chosen], *ends, rng)

    def _gap(self, count: int, rng: np.random.Generator) -> Aimed | None:
        """Rays that pass beside what blocked an earlier ray.

        The line through the target point of the earlier ray and a point just past an edge of its blocker is followed
        back into the view cell, and a random point of it there is the new origin. Where it misses the view cell, the
        old origin looks past the edge. The blocker's silhouette surrounds the earlier ray, so a step away from that ray
        beyond the nearest point of an edge is a step out of the silhouette.
        """
        if not self._blocked or not len(self._blocked[0]):
            return None
        chosen = rng.integers(len(self._blocked[0]), size=count)
        rows, origins, ends, targets, blockers = (column[chosen] for column in self._blocked)
        past = self._past_edge(origins, ends, blockers, rng)
        back = past - ends
        with np.errstate(divide="ignore", invalid="ignore"):
            enter, leave = slab(ends, back, self._low[rows], self._high[rows])
            enter = np.maximum(enter, 1)
            reached = leave > enter
            share = np.where(reached, enter + rng.random(count, np.float32) * (leave - enter), 0)
        origins = np.where(
            reached[:, None], np.clip(ends + share[:, None] * back, self._low[rows], self._high[rows]), origins
        )
        along = np.where(reached[:, None], ends - origins, past - origins)
        return Aimed(rows, origins, along, targets, np.zeros(count, bool))

    def _past_edge(
        self, origins: np.ndarray, ends: np.ndarray, blockers: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """A point a little outside the nearest to each ray of some random edges of its blocker."""
        out = np.empty_like(ends)
        steps = (10 ** rng.uniform(*PAST_EDGE, len(ends))).astype(np.float32)
        rays = [wp.array(points, dtype=wp.vec3, device="cpu", copy=False) for points in (origins, ends)]
        inputs = [self._edge_table, *rays, wp.array(blockers.astype(np.int32), device="cpu", copy=False)]
        inputs += [wp.array(steps, device="cpu", copy=False), int(rng.integers(2**31))]
        result = wp.array(out, dtype=wp.vec3, device="cpu", copy=False)
        wp.launch(pass_edges, len(ends), inputs=inputs, outputs=[result], device="cpu")
        return out

    def _toward(self, rows: np.ndarray, origins: np.ndarray, targets: np.ndarray, rng: np.random.Generator) -> Aimed:
        along = self._targets.points(targets, rng) - origins
        return Aimed(rows, origins, along, targets, np.zeros(len(rows), bool))

    def _moved(self, rows: np.ndarray, points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Points of view cells moved on all scales, inside."""
        low, high = self._low[rows], self._high[rows]
        size = (10 ** rng.uniform(*MOVES, (len(rows), 1))).astype(np.float32)
        return np.clip(points + size * rng.standard_normal(points.shape, np.float32) * (high - low), low, high)

    def _shaken(self, rows: np.ndarray, origins: np.ndarray, ends: np.ndarray, rng: np.random.Generator) -> Aimed:
        """Sightlines with both ends moved."""
        size = (10 ** rng.uniform(*MOVES, len(rows))).astype(np.float32) * length(ends - origins)
        ends = ends + size[:, None] * rng.standard_normal(ends.shape, np.float32)
        origins = self._moved(rows, origins, rng)
        return Aimed(rows, origins, ends - origins, np.full(len(rows), -1), np.zeros(len(rows), bool))


def slab(origins: np.ndarray, along: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Parameters at which lines enter and leave boxes, each of shape (n,); to be called with division errors off."""
    first, last = (low - origins) / along, (high - origins) / along
    near, far = np.fmin(first, last), np.fmax(first, last)
    return (
        np.maximum(np.maximum(near[:, 0], near[:, 1]), near[:, 2]),
        np.minimum(np.minimum(far[:, 0], far[:, 1]), far[:, 2]),
    )


def length(vectors: np.ndarray) -> np.ndarray:
    """Euclidean norms, shape (n,), several times as fast as `np.linalg.norm`."""
    return np.sqrt(dot(vectors, vectors))


def dot(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Scalar products of rows, shape (n,)."""
    return np.einsum("na,na->n", left, right)


def _choose(sums: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray | None:
    """Places drawn by running sums of weights, ascending; None if all weights are 0.

    Systematic sampling with a draw in each stratum: every weight gets its due share in every batch.
    """
    if not len(sums) or not sums[-1] > 0:
        return None
    places = (np.arange(count) + rng.random(count)) / max(count, 1) * sums[-1]
    return np.minimum(np.searchsorted(sums, places, "right"), np.searchsorted(sums, sums[-1]))
