"""Hiding objects from view cells at an angle in a frame of their own: data/own_frames.py tells why that is right."""

from dataclasses import dataclass

import numpy as np

from ...data.own_frames import OwnFrame
from ...data.ragged import places_of
from ...data.verdict import Verdict
from ...kernels.blockers import BlockerTree, blocker_tree
from ...kernels.launch import Device
from ...kernels.target import launch_target_search
from .ledger import apart, descend


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
            return self._hidden(source, boxes, cap)

        place, target = descend(
            self.frame.boxes, self.places(block), occludees.levels, occludees.objects, first_level, hide
        )
        return self.frame.cells[place], target

    def hides(self, cells: np.ndarray, objects: np.ndarray, cap: int) -> np.ndarray:
        """Whether every piece of the object is hidden from the view cell of its row, shape (n,), bool."""
        occludees, place = self.frame.occludees, self.places(cells)
        first, last = occludees.starts[objects], occludees.starts[objects + 1]
        hidden, step = first < last, 1
        while len(active := np.flatnonzero(hidden & (first < last))):
            sizes = np.minimum(step, last[active] - first[active])
            at = np.repeat(active, sizes)
            boxes = occludees.pieces[places_of(first[active], sizes)]
            hidden[at[~self._hidden(place[at], boxes, cap)]] = False
            first[active] += sizes
            step *= 2
        return hidden

    def _hidden(self, place: np.ndarray, boxes: np.ndarray, cap: int) -> np.ndarray:
        """Boxes that no line reaches from the view cell of their row, shape (n,), bool; false proves nothing."""
        hidden, own = np.zeros(len(place), bool), self.frame.boxes
        rows = np.flatnonzero(apart(own[place], boxes))
        pairs = np.column_stack([place[rows], len(own) + np.arange(len(rows)), np.ones(len(rows), int)])
        everything = np.concatenate([own, boxes[rows]])
        answers = launch_target_search(self.tree, everything, pairs, cap=cap, device=self.device)
        hidden[rows] = answers.verdict == Verdict.HIDDEN
        return hidden
