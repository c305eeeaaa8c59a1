"""Four-sided plans: boxes that stand at an angle, as upright prisms inside their axial boxes."""

from dataclasses import dataclass

import numpy as np

from .scene import turned


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
            corners[side] = box_corners(boxes[rows])
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


def box_corners(boxes: np.ndarray) -> np.ndarray:
    """Corners of boxes in plan, counter-clockwise from the low one: (..., 2, 2 or 3) gives (..., 4, 2)."""
    return np.stack([boxes[..., [0, 1, 1, 0], 0], boxes[..., [0, 0, 1, 1], 1]], axis=-1)


def plan_bounds(corners: np.ndarray) -> np.ndarray:
    """Rectangles around plans: (..., 4, 2) gives (..., 2, 2)."""
    return np.stack([corners.min(axis=-2), corners.max(axis=-2)], axis=-2)


def are_convex(corners: np.ndarray) -> np.ndarray:
    """Whether plans, shape (..., 4, 2), are convex and counter-clockwise, without a straight corner; shape (...,)."""
    along = np.roll(corners, -1, axis=-2) - corners
    bend = np.roll(along, -1, axis=-2)
    return (along[..., 0] * bend[..., 1] > along[..., 1] * bend[..., 0]).all(axis=-1)


def turned_plan(points: np.ndarray, yaw_deg: float) -> np.ndarray:
    """Points of a plan, shape (n, 2), turned counter-clockwise about the origin."""
    return turned(np.column_stack([points, np.zeros(len(points))]), yaw_deg)[:, :2]


def come_last(rows: np.ndarray, count: int) -> bool:
    """Whether ascending rows are the last ones of so many."""
    return np.array_equal(rows, np.arange(count - len(rows), count))
