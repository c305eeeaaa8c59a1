"""Four-sided plans: boxes that stand at an angle, as upright prisms inside their axial boxes."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Plans:
    """Plans of some boxes of a list; the others are plain.

    Attributes:
        rows: places of these boxes in the list, ascending, shape (plans,), int64.
        corners: of each plan [grid steps], convex, counter-clockwise, within its box, which it touches on every side;
            shape (plans, 4, 2), int32.
    """

    rows: np.ndarray
    corners: np.ndarray

    def places(self, count: int) -> np.ndarray:
        """Place of each box's plan among the plans, -1 for none, shape (count,), int32."""
        out = np.full(count, -1, np.int32)
        out[self.rows] = np.arange(len(self.rows))
        return out

    def take(self, chosen: np.ndarray, count: int) -> "Plans":
        """Plans of chosen boxes (indices) of a list of so many."""
        place = self.places(count)[chosen]
        rows = np.flatnonzero(place >= 0)
        return Plans(rows, self.corners[place[rows]])

    def of(self, box: int) -> "Plans":
        """The plan of one box, as of a list of that box alone."""
        rows = self.rows == box
        return Plans(np.zeros(int(rows.sum()), np.int64), self.corners[rows])

    def filled(self, count: int, chosen: np.ndarray) -> np.ndarray:
        """Corners for each of chosen boxes (indices) of a list of so many, all 0 for plain ones, (n, 4, 2), int32."""
        out = np.zeros((count, 4, 2), np.int32)
        out[self.rows] = self.corners
        return out[chosen]

    def hold(self, boxes: np.ndarray, points: np.ndarray, count: int) -> np.ndarray:
        """Whether points lie strictly inside the plans of their boxes, if these have one; shape (n,), bool.

        Args:
            boxes: of a list of so many, shape (n,), int.
            points: [grid steps], shape (n, 2 or 3), float64, multiples of 2**-10 for an exact answer.
            count: of the list.
        """
        place = self.places(count)[boxes]
        held = np.ones(len(points), bool)
        rows = np.flatnonzero(place >= 0)
        plan = self.corners[place[rows]].astype(float)
        for k in range(4):
            a, along = plan[:, k], plan[:, (k + 1) % 4] - plan[:, k]
            rest = points[rows, :2] - a
            held[rows] &= along[:, 0] * rest[:, 1] - along[:, 1] * rest[:, 0] > 0
        return held

    def part(self, count: int, sources: np.ndarray, targets: np.ndarray, boxes: np.ndarray) -> np.ndarray:
        """Whether an edge of a source's plan, or of a target's, parts the two in plan, shape (n,), bool.

        Args:
            count: length of the list that the plans belong to.
            sources: box of the list of each row, shape (n,), int.
            targets: likewise.
            boxes: the list, shape (count, 2, 3), int.
        """
        place, corners = self.places(count), np.empty((2, len(sources), 4, 2), np.int64)
        for side, rows in enumerate((sources, targets)):
            low, high = boxes[rows, 0, :2].astype(np.int64), boxes[rows, 1, :2].astype(np.int64)
            x, y = (np.stack([low[:, axis], high[:, axis]], axis=1) for axis in (0, 1))
            corners[side] = np.stack([x[:, [0, 1, 1, 0]], y[:, [0, 0, 1, 1]]], axis=2)
            planned = np.flatnonzero(place[rows] >= 0)
            corners[side, planned] = self.corners[place[rows[planned]]]
        parted = np.zeros(len(sources), bool)
        for own, other in (corners, corners[::-1]):
            for k in range(4):
                a, along = own[:, k], own[:, (k + 1) % 4] - own[:, k]
                rest = other - a[:, None]
                turn = along[:, 0, None] * rest[:, :, 1] - along[:, 1, None] * rest[:, :, 0]
                parted |= (turn <= 0).all(axis=1) & (along != 0).any(axis=1)
        return parted

    @classmethod
    def join(cls, parts: "list[tuple[Plans, int]]") -> "Plans":
        """Plans of lists one after another, each given with its length."""
        ahead = np.cumsum([0, *(count for _, count in parts)])
        rows = [part.rows + first for (part, _), first in zip(parts, ahead, strict=False)]
        return cls(np.concatenate(rows), np.concatenate([part.corners for part, _ in parts]))


NO_PLANS = Plans(np.zeros(0, np.int64), np.zeros((0, 4, 2), np.int32))
