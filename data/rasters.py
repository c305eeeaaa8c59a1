"""Many rasters at once, each on ascending coordinates of its own: windings, covers, tilings, largest rectangles.

A model has thousands of small rasters, of planes and of sections of elements; one by one, most of the time would go to
the calls. Here a table of all rasters is one flat array: raster after raster, row after row, a value for each node
(i, j), u before v. A raster cell has the number of its lowest node, so the nodes of the last row and of the last column
are no cells; masks of cells are false there, which keeps the runs of one line apart from the next.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256

import numpy as np

from .patience import ask
from .ragged import owners_of, starts_of, take_lists

# No coordinate is so far out, searched ones included [grid steps].
FAR = 1 << 27
# Nodes that are worked on together: tables of a lot stay in fast memory.
LOT = 1 << 16


@dataclass(frozen=True)
class Rasters:
    """Coordinates of rasters.

    Attributes:
        coordinates: of the raster lines along u and along v, ascending within each raster, each int64.
        starts: where those of each raster start, each of shape (rasters + 1,), int64.
    """

    coordinates: tuple[np.ndarray, np.ndarray]
    starts: tuple[np.ndarray, np.ndarray]

    @classmethod
    def of(cls, points: list[list[tuple[np.ndarray, np.ndarray]]], count: int) -> "Rasters":
        """Rasters of distinct coordinates.

        Args:
            points: for u and for v, lots of rasters and coordinates in any order, each of shape (n,).
            count: of rasters.
        """
        coordinates, starts = [], []
        for lots in points:
            keys = np.unique(np.concatenate([_key(owner, at) for owner, at in lots]))
            owner, at = np.divmod(keys, 2 * FAR)
            coordinates.append(at - FAR)
            starts.append(starts_of(np.bincount(owner, minlength=count)))
        return cls(tuple(coordinates), tuple(starts))

    @classmethod
    def one(cls, us: np.ndarray, vs: np.ndarray) -> "Rasters":
        """A single raster of ascending coordinates."""
        return cls((us.astype(np.int64), vs.astype(np.int64)), (np.array([0, len(us)]), np.array([0, len(vs)])))

    def __len__(self) -> int:
        """How many."""
        return len(self.starts[0]) - 1

    @cached_property
    def sizes(self) -> tuple[np.ndarray, np.ndarray]:
        """Raster lines along u and along v of each."""
        return np.diff(self.starts[0]), np.diff(self.starts[1])

    @cached_property
    def nodes(self) -> np.ndarray:
        """First node of each raster, and past the last one, shape (rasters + 1,), int64."""
        return starts_of(self.sizes[0] * self.sizes[1])

    def lots(self) -> Iterator[tuple[int, "Rasters"]]:
        """Rasters in lots of about LOT nodes: number of the first, and the rasters of each lot.

        Raises:
            OutOfTime: there is no time for the next lot.
        """
        first = 0
        while first < len(self):
            ask()
            stop = int(np.searchsorted(self.nodes, self.nodes[first] + LOT, side="right")) - 1
            stop = min(max(stop, first + 1), len(self))
            ends = [starts[first : stop + 1] for starts in self.starts]
            cut = tuple(at[e[0] : e[-1]] for at, e in zip(self.coordinates, ends, strict=True))
            yield first, Rasters(cut, tuple(e - e[0] for e in ends))
            first = stop

    @cached_property
    def owner(self) -> np.ndarray:
        """Raster of each node."""
        return owners_of(self.nodes)

    @cached_property
    def lines(self) -> tuple[np.ndarray, np.ndarray]:
        """Numbers i and j of each node."""
        if self._single:
            u, v = self._shape
            return np.repeat(np.arange(u), v), np.tile(np.arange(v), u)
        return np.divmod(np.arange(self.nodes[-1]) - self.nodes[self.owner], self.sizes[1][self.owner])

    @property
    def _single(self) -> bool:
        """Whether there is one raster only, a plain table: large ones are worked on alone."""
        return len(self) == 1

    @property
    def _shape(self) -> tuple[int, int]:
        """Raster lines of a single raster."""
        return int(self.sizes[0][0]), int(self.sizes[1][0])

    @cached_property
    def _turned(self) -> np.ndarray:
        """Place of each node where columns come before rows."""
        i, j = self.lines
        return self.nodes[self.owner] + j * self.sizes[0][self.owner] + i

    def node(self, owner: np.ndarray, i: np.ndarray, j: np.ndarray) -> np.ndarray:
        """Nodes by raster and line numbers."""
        return self.nodes[owner] + i * self.sizes[1][owner] + j

    def find(self, axis: int, owner: np.ndarray, at: np.ndarray, side: str = "left") -> np.ndarray:
        """As `np.searchsorted` in the coordinates of each raster; `at` are whole numbers."""
        return np.searchsorted(self._keys[axis], _key(owner, at), side=side) - self.starts[axis][owner]

    def at(self, axis: int, owner: np.ndarray, line: np.ndarray) -> np.ndarray:
        """Coordinates of raster lines."""
        return self.coordinates[axis][self.starts[axis][owner] + line]

    @cached_property
    def _keys(self) -> tuple[np.ndarray, np.ndarray]:
        return tuple(_key(owners_of(s), at) for s, at in zip(self.starts, self.coordinates, strict=True))

    @cached_property
    def area(self) -> np.ndarray:
        """Of each raster cell, 0 at nodes that are no cells; whole numbers, float64."""
        sides = []
        for axis in (0, 1):
            side = np.zeros(len(self.coordinates[axis]))
            side[:-1] = np.diff(self.coordinates[axis])
            last = self.starts[axis][1:] - 1
            side[last[last >= 0]] = 0.0
            sides.append(side if self._single else side[self.starts[axis][self.owner] + self.lines[axis]])
        return np.outer(*sides).ravel() if self._single else sides[0] * sides[1]

    def sum_along(self, values: np.ndarray, axis: int) -> np.ndarray:
        """Cumulative sums along the raster lines of an axis, of a value per node."""
        if self._single:
            return values.reshape(self._shape).cumsum(axis=axis).ravel()
        ordered = self._ordered(values, axis)
        total = np.cumsum(ordered)
        place = self._turned if axis == 0 else np.arange(len(values))
        first = place - self.lines[axis]
        return total[place] - total[first] + ordered[first]

    def runs(self, mask: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
        """First and past-the-last line number of the run of true cells around each of them, along an axis; int32."""
        _, _, first, last = self.strips(mask, axis)
        around = np.zeros((2, len(mask)), np.int32)
        around[:, self._ordered(mask, axis)] = np.repeat(np.stack([first, last]), last - first, axis=1)
        if axis == 1:
            return tuple(around)
        if self._single:
            return tuple(part.reshape(self._shape[::-1]).T.ravel() for part in around)
        return tuple(around[:, self._turned])

    def mark(self, axis: int, owner: np.ndarray, line: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
        """Cells from `first` to before `last` along an axis, on a line of the other one; bool."""
        some = first < last
        owner, line, first, last = owner[some], line[some], first[some], last[some]
        change = np.zeros(self.nodes[-1], np.int32)
        for at, sign in ((first, 1), (last, -1)):
            np.add.at(change, self.node(owner, *((at, line) if axis == 0 else (line, at))), sign)
        return self.sum_along(change, axis) > 0

    def paint(self, owner: np.ndarray, rectangles: np.ndarray) -> np.ndarray:
        """Raster cells covered by any of the rectangles (n, 2, 2), whose corners are nodes; bool."""
        u = [self.find(0, owner, rectangles[:, k, 0]) for k in (0, 1)]
        v = [self.find(1, owner, rectangles[:, k, 1]) for k in (0, 1)]
        heights = np.zeros(self.nodes[-1], np.int32)
        for i, j, sign in ((0, 0, 1), (0, 1, -1), (1, 0, -1), (1, 1, 1)):
            np.add.at(heights, self.node(owner, u[i], v[j]), sign)
        return self.sum_along(self.sum_along(heights, 0), 1) > 0

    def tile(self, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Disjoint rectangles that tile the true cells, merged along rows or along columns, whichever is fewer.

        Returns:
            Raster of each, ascending, and low and high corners, shape (n, 2, 2), int32.
        """
        along, across = self._strips(mask, 1), self._strips(mask, 0)[:, [0, 3, 4, 1, 2]]
        counts = [np.bincount(strips[:, 0], minlength=len(self)) for strips in (along, across)]
        fewer = counts[0] <= counts[1]
        chosen = np.concatenate([along[fewer[along[:, 0]]], across[~fewer[across[:, 0]]]])
        return self._corners(chosen[np.argsort(chosen[:, 0], kind="stable")])

    def maximal(
        self, blocked: np.ndarray, wanted: np.ndarray, known: dict[bytes, np.ndarray] | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Rectangles of true cells of `blocked` that cannot grow and together cover `wanted`, which is part of it.

        Args:
            blocked: of each node, bool.
            wanted: likewise.
            known: what calls before found, which this one adds to: most rasters of a model are like others.

        Returns:
            As `tile`.
        """
        known = {} if known is None else known
        # Rasters that are blocked throughout, as most small ones are, hold one rectangle.
        full = self._count(blocked) == (self.sizes[0] - 1) * (self.sizes[1] - 1)
        sought = self._count(wanted) > 0
        whole, others = np.flatnonzero(full & sought), np.flatnonzero(~full & sought)
        # Which cells are in a rectangle does not depend on where they are, or how large.
        masks = [mask.tobytes() for mask in ((blocked,) if wanted is blocked else (blocked, wanted))]
        keys, fresh = [], {}
        for raster, step, begin, end in zip(
            others.tolist(),
            self.sizes[1][others].tolist(),
            self.nodes[others].tolist(),
            self.nodes[others + 1].tolist(),
            strict=True,
        ):
            key = sha256(step.to_bytes(8) + b"".join(mask[begin:end] for mask in masks)).digest()
            keys.append(key)
            if key not in known:
                fresh.setdefault(key, raster)
        chosen = np.array(list(fresh.values()), np.int64)
        _, nodes = take_lists(self.nodes, chosen)
        known |= zip(fresh, self._some(chosen)._grown(blocked[nodes], wanted[nodes]), strict=True)
        found = [known[key] for key in keys]
        none = np.zeros(len(whole), np.int64)
        whole = np.column_stack([whole, none, self.sizes[0][whole] - 1, none, self.sizes[1][whole] - 1])
        lines = np.concatenate([np.zeros((0, 4), np.int64), *found])
        rows = np.concatenate([whole, np.column_stack([np.repeat(others, [len(part) for part in found]), lines])])
        return self._corners(rows[np.argsort(rows[:, 0], kind="stable")])

    def _some(self, chosen: np.ndarray) -> "Rasters":
        """Some of the rasters."""
        kept = [take_lists(starts, chosen) for starts in self.starts]
        cut = tuple(at[places] for at, (_, places) in zip(self.coordinates, kept, strict=True))
        return Rasters(cut, tuple(starts for starts, _ in kept))

    def _grown(self, blocked: np.ndarray, wanted: np.ndarray) -> list[np.ndarray]:
        """Rectangles of each raster as of `maximal`, ordered: first and past-the-last line along u, and along v."""
        (u_first, u_last), (v_first, v_last) = (self.runs(blocked, axis) for axis in (0, 1))
        found: list[set[tuple[int, int, int, int]]] = [set() for _ in range(len(self))]
        # Bytes are searched for the next cell that is left as fast as memory is read.
        memory = bytearray(wanted.tobytes())
        left = np.frombuffer(memory, bool)
        starts, steps = self.nodes.tolist(), self.sizes[1].tolist()
        cell, owner = -1, 0
        while (cell := memory.find(1, cell + 1)) >= 0:
            while starts[owner + 1] <= cell:
                owner += 1
            i, j = divmod(cell - starts[owner], steps[owner])
            start, step = starts[owner], steps[owner]
            u0, u1, v0, v1 = int(u_first[cell]), int(u_last[cell]), int(v_first[cell]), int(v_last[cell])
            column = slice(start + u0 * step + j, start + u1 * step + j, step)
            row = slice(start + i * step + v0, start + i * step + v1)
            # Grown along u, then along v; and the other way round.
            tall = u0, u1, int(v_first[column].max()), int(v_last[column].min())
            wide = int(u_first[row].max()), int(u_last[row].min()), v0, v1
            for a, b, c, d in {tall, wide}:
                left[start + a * step : start + b * step].reshape(-1, step)[:, c:d] = False
            found[owner] |= {tall, wide}
        return [np.array(sorted(own), np.int64).reshape(-1, 4) for own in found]

    def _count(self, mask: np.ndarray) -> np.ndarray:
        """True cells of each raster."""
        total = np.append(0, np.cumsum(mask))
        return total[self.nodes[1:]] - total[self.nodes[:-1]]

    def _corners(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        owner, u0, u1, v0, v1 = rows.T
        low, high = (np.stack([self.at(0, owner, u), self.at(1, owner, v)], axis=1) for u, v in ((u0, v0), (u1, v1)))
        return owner, np.stack([low, high], axis=1).astype(np.int32)

    def strips(self, mask: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Every run of true cells along an axis, ordered: raster, line of the other axis, first and past-the-last."""
        ordered = self._ordered(mask, axis)
        before = _before(ordered)
        begin, end = np.flatnonzero(ordered & ~before), np.flatnonzero(before & ~ordered)
        owner = np.searchsorted(self.nodes, begin, side="right") - 1
        line, first = np.divmod(begin - self.nodes[owner], self.sizes[axis][owner])
        return owner, line, first, first + end - begin

    def _strips(self, mask: np.ndarray, axis: int) -> np.ndarray:
        """Runs along an axis, equal runs of consecutive lines merged: rows (raster, line, line, first, last)."""
        owner, line, first, last = self.strips(mask, axis)
        order = np.lexsort((line, last, first, owner))
        owner, line, first, last = owner[order], line[order], first[order], last[order]
        new = np.ones(len(owner), bool)
        new[1:] = (np.diff(line) != 1) | (np.diff(first) != 0) | (np.diff(last) != 0) | (np.diff(owner) != 0)
        starts = np.flatnonzero(new)
        ends = np.append(starts[1:], len(owner)) - 1
        if not len(owner):
            return np.zeros((0, 5), np.int64)
        return np.column_stack([owner[starts], line[starts], line[ends] + 1, first[starts], last[starts]])

    def _ordered(self, values: np.ndarray, axis: int) -> np.ndarray:
        """Values of nodes where the lines of an axis are whole."""
        if axis == 1:
            return values
        if self._single:
            return values.reshape(self._shape).T.ravel()
        ordered = np.empty_like(values)
        ordered[self._turned] = values
        return ordered


def decompose(mask: np.ndarray, us: np.ndarray, vs: np.ndarray) -> np.ndarray:
    """Disjoint rectangles that tile the true cells of one raster: `Rasters.tile`.

    Args:
        mask: shape (len(us) - 1, len(vs) - 1), bool.
        us: ascending coordinates of the raster.
        vs: likewise.

    Returns:
        Low and high corners, shape (n, 2, 2), int32.
    """
    return Rasters.one(us, vs).tile(np.pad(mask, (0, 1)).ravel())[1]


def _key(owner: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Raster and coordinate as one whole number, ascending."""
    return owner * (2 * FAR) + (at + FAR)


def _before(mask: np.ndarray) -> np.ndarray:
    """The value before each one."""
    return np.append(False, mask[:-1])
