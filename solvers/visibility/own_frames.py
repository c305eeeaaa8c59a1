"""Hiding objects from view cells at an angle in a frame of their own: data/own_frames.py tells why that is right."""

from dataclasses import dataclass

import numpy as np

from ...data.own_frames import OwnFrame
from ...data.ragged import places_of
from ...data.scene import CORNERS, turned
from ...data.verdict import Verdict
from ...kernels.blockers import BlockerTree, blocker_tree
from ...kernels.launch import Device
from ...kernels.target import launch_target_search
from .ledger import apart, descend
from .search import segments

# An object is not looked at further once so many of its pieces have not been hidden.
LINES_ENOUGH = 3


@dataclass(frozen=True)
class Passing:
    """Lines to pieces of objects that pass all rectangles of a frame.

    Attributes:
        row: of the view cell and object asked about, shape (n,), int64.
        boxes: around each piece, in the model's own frame [grid steps], shape (n, 2, 3), int64.
        lines: their ends there, in the cell and in the piece, shape (n, 2, 3), float64.
    """

    row: np.ndarray
    boxes: np.ndarray
    lines: np.ndarray

    def take(self, chosen: np.ndarray) -> "Passing":
        """Some of them (mask or indices)."""
        return Passing(self.row[chosen], self.boxes[chosen], self.lines[chosen])


@dataclass(frozen=True)
class FrameSearch:
    """The line search of one frame, on a device.

    Attributes:
        frame: what it searches in.
        tree: the frame's rectangles.
        device: that holds them.
    """

    frame: OwnFrame
    tree: BlockerTree
    device: Device

    @classmethod
    def of(cls, frame: OwnFrame, device: Device) -> "FrameSearch":
        """Copy a frame's rectangles to the device."""
        return cls(frame, blocker_tree(frame.walls, device), device)

    def places(self, cells: np.ndarray) -> np.ndarray:
        """Place of view cells among those of the frame, -1 for others, shape (n,), int64."""
        order = np.argsort(self.frame.cells)
        at = np.searchsorted(self.frame.cells[order], cells).clip(max=len(order) - 1)
        return np.where(self.frame.cells[order[at]] == cells, order[at], -1)

    def left(self, block: np.ndarray, first_level: int, cap: int) -> tuple[np.ndarray, np.ndarray]:
        """View cells of the frame, and objects that no node of their hierarchy hides from them; as of `descend`."""
        occludees = self.frame.occludees

        def hide(source: np.ndarray, boxes: np.ndarray) -> np.ndarray:
            return self._search(source, boxes, cap)[0]

        place, target = descend(
            self.frame.boxes, self.places(block), occludees.levels, occludees.objects, first_level, hide
        )
        return self.frame.cells[place], target

    def hides(self, cells: np.ndarray, objects: np.ndarray, cap: int) -> tuple[np.ndarray, Passing]:
        """Whether every piece of the object is hidden from the view cell of its row, shape (n,), bool.

        And lines to pieces of objects that are not hidden, until LINES_ENOUGH of each, or a few more, are found.
        """
        occludees, place = self.frame.occludees, self.places(cells)
        first, last = occludees.starts[objects], occludees.starts[objects + 1]
        hidden, open_pieces, step = first < last, np.zeros(len(cells), int), 1
        found = [(np.zeros(0, int), np.zeros((0, 2, 3)), np.zeros((0, 2, 3)))]
        while len(active := np.flatnonzero((first < last) & (open_pieces < LINES_ENOUGH))):
            sizes = np.minimum(step, last[active] - first[active])
            at = np.repeat(active, sizes)
            boxes = occludees.pieces[places_of(first[active], sizes)]
            out, lined, lines = self._search(place[at], boxes, cap)
            hidden[at[~out]] = False
            np.add.at(open_pieces, at[~out], 1)
            found.append((at[lined], boxes[lined], lines))
            first[active] += sizes
            step *= 2
        at, boxes, lines = (np.concatenate(column) for column in zip(*found, strict=True))
        corners = turned(boxes[:, CORNERS, np.arange(3)].astype(float), self.frame.yaw_deg)
        around = np.stack([np.floor(corners.min(axis=1)), np.ceil(corners.max(axis=1))], axis=1).astype(np.int64)
        return hidden, Passing(at, around, turned(lines, self.frame.yaw_deg))

    def _search(self, place: np.ndarray, boxes: np.ndarray, cap: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Which boxes no line reaches from the view cell of their row, shape (n,), bool; false proves nothing.

        And rows that a line was found for, with its ends in cell and box, shape (m, 2, 3), float64, in the frame.
        """
        hidden, own = np.zeros(len(place), bool), self.frame.boxes
        rows = np.flatnonzero(apart(own[place], boxes))
        pairs = np.column_stack([place[rows], len(own) + np.arange(len(rows)), np.ones(len(rows), int)])
        everything = np.concatenate([own, boxes[rows]])
        answers = launch_target_search(self.tree, everything, pairs, cap=cap, device=self.device)
        hidden[rows] = answers.verdict == Verdict.HIDDEN
        lined = np.flatnonzero(answers.verdict == Verdict.VISIBLE)
        at = rows[lined]
        return hidden, at, np.stack(segments(answers, lined, own[place[at]], boxes[at]), axis=1)
