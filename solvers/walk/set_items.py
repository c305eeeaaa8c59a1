"""Items that view cells may need, and when: what may be seen from where, level by level from the coarsest.

Source: Funkhouser et al. 1996, section 4.3.1 (lookahead objects, up to the level at which they can be drawn).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...data.ragged import owners_of, places_of, starts_of


@dataclass(frozen=True)
class Shelves:
    """Levels of objects as items.

    Attributes:
        starts: levels of object o are items[starts[o]:starts[o + 1]], finest first, shape (objects + 1,), int64.
        items: int64; objects may share them.
        table: the same, level by level, shape (objects, most levels), int64; -1 where there is no such level.
        sizes: bytes of each item, int64.
        faces: of each item, int64.
        steps: of each item, levels from its object's coarsest, the fewest if objects share it, int64.
        owners: object of each item, -1 if several share it, or none has it, int64.
    """

    starts: np.ndarray
    items: np.ndarray
    table: np.ndarray
    sizes: np.ndarray
    faces: np.ndarray
    steps: np.ndarray
    owners: np.ndarray

    @classmethod
    def of(cls, starts: np.ndarray, items: np.ndarray, sizes: np.ndarray, faces: np.ndarray) -> "Shelves":
        """From lists of items."""
        counts = np.diff(starts)
        owner, level = owners_of(starts), places_of(0, counts)
        table = np.full((len(counts), max(1, int(counts.max(initial=1)))), -1)
        table[owner, level] = items
        steps = np.full(len(sizes), np.iinfo(np.int64).max)
        np.minimum.at(steps, items, counts[owner] - 1 - level)
        owners = np.full(len(sizes), -1)
        owners[items] = owner
        owners[np.bincount(items, minlength=len(sizes)) != 1] = -1
        return cls(starts, items, table, sizes, faces, steps, owners)

    @cached_property
    def counts(self) -> np.ndarray:
        """Levels of each object."""
        return np.diff(self.starts)

    @cached_property
    def coarsest(self) -> np.ndarray:
        """Item of the coarsest level of each object."""
        return self.items[self.starts[1:] - 1]


@dataclass(frozen=True)
class SetItems:
    """Items of view cells: those of row r are at starts[r]:starts[r + 1], an entry for each object and level.

    Attributes:
        starts: shape (rows + 1,), int64.
        objects: of each entry, int64.
        items: of each entry, int64.
        finest: whether the entry is the finest level that its view cell asks of the object, bool.
    """

    starts: np.ndarray
    objects: np.ndarray
    items: np.ndarray
    finest: np.ndarray

    @classmethod
    def of(cls, shelves: Shelves, starts: np.ndarray, members: np.ndarray, limits: np.ndarray) -> "SetItems":
        """From sets of objects and the coarsest level that does for each member; all coarser levels come with it."""
        counts = shelves.counts[members] - limits
        places = places_of(shelves.starts[members] + limits, counts)
        first = starts_of(counts)
        finest = np.zeros(len(places), bool)
        finest[first[:-1][counts > 0]] = True
        return cls(first[starts], np.repeat(members, counts), shelves.items[places], finest)

    def of_rows(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Entries of some rows, and the place in `rows` of each."""
        sizes = np.diff(self.starts)[rows]
        return places_of(self.starts[rows], sizes), np.repeat(np.arange(len(rows)), sizes)

    def row_bytes(self, shelves: Shelves) -> np.ndarray:
        """Bytes of the items of each row, shared ones once, int64."""
        width = max(1, len(shelves.sizes))
        pairs = np.unique(owners_of(self.starts) * width + self.items)
        row, item = np.divmod(pairs, width)
        return np.bincount(row, shelves.sizes[item], len(self.starts) - 1).astype(np.int64)


@dataclass(frozen=True)
class Motion:
    """How fast an eye may move and turn.

    Attributes:
        speed: [m/s], > 0.
        turn_deg: [degrees/s], > 0; 360 and more turns at will.
        ahead_s: time that is looked ahead [s], >= 0.
    """

    speed: float = 2.0
    turn_deg: float = 180.0
    ahead_s: float = 1.0


@dataclass(frozen=True)
class Balls:
    """Balls around boxes; an axis in each row, as sums over axes take a third of the time so.

    Attributes:
        middles: [m], shape (3, n), float64.
        halves: half the size of each box [m], shape (3, n).
        radii: [m], shape (n,).
    """

    middles: np.ndarray
    halves: np.ndarray
    radii: np.ndarray

    @classmethod
    def around(cls, boxes: np.ndarray) -> "Balls":
        """The smallest around boxes [m], shape (n, 2, 3), float64."""
        halves = (boxes[:, 1] - boxes[:, 0]).T / 2
        middles = np.ascontiguousarray(boxes.mean(axis=1).T)
        return cls(middles, np.ascontiguousarray(halves), np.linalg.norm(halves, axis=0))

    def take(self, ids: np.ndarray) -> "Balls":
        """Some of them."""
        return Balls(self.middles.take(ids, axis=1), self.halves.take(ids, axis=1), self.radii.take(ids))


def turn_seconds(balls: Balls, eye: np.ndarray, forward: np.ndarray, half_angle: float, motion: Motion) -> np.ndarray:
    """The time before boxes can come into view, of an eye that moves and turns as it may; a lower bound.

    A way of v t < d changes the direction in which a point at distance d is seen by at most asin(v t / d), which is at
    most pi v t / 2 d. So what is a beyond the view, d away, cannot be in it before a / (w + pi v / 2 d), unless the eye
    gets there, d / v.

    Args:
        balls: around n boxes.
        eye: [m], shape (3,).
        forward: direction of view, unit length, shape (3,).
        half_angle: from there to the corner of the screen [radians].
        motion: of the eye.

    Returns:
        [s], shape (n,), float64; 0 for what may be in view.
    """
    middle = balls.middles - eye[:, None]
    away = np.sqrt((middle * middle).sum(axis=0))
    far = np.maximum(away, 1e-9)
    angle = np.arccos(np.clip(forward @ middle / far, -1, 1))
    angle -= np.arcsin(np.minimum(balls.radii / far, 1.0))
    angle = np.where(away <= balls.radii, 0.0, np.maximum(angle - half_angle, 0.0))
    apart = np.maximum(np.abs(middle) - balls.halves, 0)
    distance = np.maximum(np.sqrt((apart * apart).sum(axis=0)), 1e-9)
    turning = angle / (np.radians(motion.turn_deg) + np.pi * motion.speed / (2 * distance))
    return np.minimum(turning, distance / motion.speed)
