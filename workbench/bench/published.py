"""vLOD's way to store sets, as published: what changes at each boundary of view cells, a sampled tour, a two-bit code.

It is here to be compared, not to be used: `viewcell pack` stores sets themselves, in the order of a tour that knows
all distances. Source: Chhugani et al. 2005, section 6 and appendix A.
"""

from dataclasses import dataclass

import numpy as np

from ...data.graph import CellGraph
from ...data.ragged import owners_of, starts_of
from ...data.runs import find_runs
from ...kernels.tour import launch_tour
from ...solvers.tour import distinct_columns

# Near columns of each that are kept, and from which share of all columns they are sampled.
KEPT, SAMPLED = 700, 0.5
# Distances of all pairs are held: beyond, the scheme is not tried.
MOST_COLUMNS = 12_000
BLOCK = 512


@dataclass(frozen=True)
class Sets:
    """Sets of objects; set s is members[starts[s]:starts[s + 1]], ascending."""

    starts: np.ndarray
    members: np.ndarray
    count: int

    @classmethod
    def of_rows(cls, rows: list[np.ndarray], count: int) -> "Sets":
        """From ids of each set, below a count."""
        return cls(starts_of([len(row) for row in rows]), np.concatenate([np.zeros(0, np.int64), *rows]), count)

    def __len__(self) -> int:
        return len(self.starts) - 1

    def of(self, row: int) -> np.ndarray:
        """Members of a set."""
        return self.members[self.starts[row] : self.starts[row + 1]]

    def ordered(self, order: np.ndarray) -> "Sets":
        """The same sets, objects called by their places in an order."""
        rank = np.empty(self.count, np.int64)
        rank[order] = np.arange(self.count)
        there = rank[self.members]
        return Sets(self.starts, there[np.lexsort((there, owners_of(self.starts)))], self.count)


def boundaries(graph: CellGraph, cells: np.ndarray) -> np.ndarray:
    """Pairs of view cells that an eye goes from one to the other, as rows of `cells`, shape (n, 2), int64.

    They share a portal, or a doorway that is no view cell itself; without portals, a face.
    """
    row = np.full(graph.cell_count, -1)
    row[cells] = np.arange(len(cells))
    if not graph.portal_count:
        boxes = graph.cells[cells].astype(np.int64)
        pairs = [np.zeros((0, 2), np.int64)]
        for k in range(len(cells)):
            extent = np.minimum(boxes[k, 1], boxes[k + 1 :, 1]) - np.maximum(boxes[k, 0], boxes[k + 1 :, 0])
            beside = np.flatnonzero((extent >= 0).all(axis=1) & ((extent > 0).sum(axis=1) == 2))
            pairs.append(np.column_stack([np.full(len(beside), k), k + 1 + beside]))
        return np.concatenate(pairs)
    ends = row[graph.portal_cells]
    found = {tuple(sorted(pair)) for pair in ends[(ends >= 0).all(axis=1)].tolist()}
    around: dict[int, set[int]] = {}
    for (a, b), (at, to) in zip(graph.portal_cells.tolist(), ends.tolist(), strict=True):
        for doorway, beside, here in ((a, to, at), (b, at, to)):
            if here < 0 <= beside:
                around.setdefault(doorway, set()).add(beside)
    found |= {tuple(sorted(beside)) for beside in around.values() if len(beside) == 2}
    return np.array(sorted(found), np.int64).reshape(-1, 2)


def changes(sets: Sets, pairs: np.ndarray) -> tuple[Sets, Sets]:
    """What comes and what goes at each boundary, from the first of its view cells to the second."""
    rows = [(sets.of(a), sets.of(b)) for a, b in pairs.tolist()]
    comes, goes = ([np.setdiff1d(*pair) for pair in way] for way in ([(b, a) for a, b in rows], rows))
    return Sets.of_rows(comes, sets.count), Sets.of_rows(goes, sets.count)


def sampled_order(sets: Sets, seed: int = 0) -> np.ndarray | None:
    """Objects along a tour through columns whose near ones are the nearest of a random sample of each.

    The rows are those of the sets, boundaries' changes in the paper. Edges are flipped by the same kernel as in our own
    tour, which may do more than theirs. None where there are too many columns.
    """
    city, columns = distinct_columns(sets.starts, sets.members, sets.count)
    count = columns.shape[1]
    if count > MOST_COLUMNS or count < 2:
        return None
    rng, bits = np.random.default_rng(seed), columns.T.astype(np.float32)
    ones, kept = bits.sum(axis=1), min(KEPT, max(1, int(SAMPLED * count)))
    near = np.empty((count, kept), np.int32)
    for begin in range(0, count, BLOCK):
        part = bits[begin : begin + BLOCK]
        far = part.sum(axis=1)[:, None] + ones[None] - 2 * part @ bits.T
        far[rng.random(far.shape) >= SAMPLED] = np.inf
        far[np.arange(len(part)), begin + np.arange(len(part))] = np.inf
        nearest = np.argsort(far, axis=1, kind="stable")[:, :kept]
        held = np.isfinite(np.take_along_axis(far, nearest, axis=1))
        near[begin : begin + BLOCK] = np.where(held, nearest, -1)
    tour = launch_tour(columns, near, np.arange(count))
    rank = np.empty(count, np.int64)
    rank[tour] = np.arange(count)
    return np.argsort(rank[city], kind="stable")


def two_bit_code(number: int) -> str:
    """Bits of a number above 0 before the delimiter 11 that comes between numbers."""
    if number == 1:
        return "11"
    bits = f"{number:b}".replace("11", "110")
    return f"{bits[:-1]}11" if bits.endswith("01") else bits


def two_bit_bytes(sets: Sets) -> int:
    """Bytes of sets whose runs are pairs (offset, length) in the two-bit code, each set in whole bytes."""
    runs = find_runs(sets.starts, sets.members)
    total = 0
    for row in range(len(sets)):
        part = slice(runs.starts[row], runs.starts[row + 1])
        firsts, lengths = runs.first[part].tolist(), runs.length[part].tolist()
        numbers, end = [], -1
        for first, length in zip(firsts, lengths, strict=True):
            numbers += [first - end, length]
            end = first + length - 1
        bits = sum(len(two_bit_code(number)) for number in numbers) + 2 * max(0, len(numbers) - 1)
        total += -(-bits // 8)
    return total
