"""Hard cases of curtains and plates between boxes and prisms, as searches of lines and shafts are asked them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...data.blockers import Blockers
from ...data.curtains import FALLING, RISING
from ...data.plans import Plans
from ...kernels.blockers import BlockerTree, blocker_tree
from ...kernels.launch import Device
from ...verify.cases.hard_cases import HardCases, ObliqueCase, Shape
from ...verify.proofs.ways import Blocker, End


@dataclass(frozen=True)
class ObliqueQuestion:
    """A case beside its curtains on a device.

    Attributes:
        boxes: around cell and target.
        plans: of those that are prisms.
        ends: both, for the checker.
        partial: some occluders are no curtains, or one lies on the target: visible says nothing.
    """

    case: ObliqueCase
    tree: BlockerTree
    blockers: dict[int, Blocker]
    boxes: np.ndarray
    plans: Plans
    ends: tuple[End, End]
    partial: bool


def oblique_questions(cases: HardCases, device: Device) -> Iterator[ObliqueQuestion]:
    """Cases with a curtain, whose ends an axis or an edge of a plan parts."""
    for case in cases.oblique:
        walls = [curtain for shape in case.occluders if (curtain := _curtain(shape))]
        ends = _end(case.cell), _end(case.target)
        boxes = np.array([end.box for end in ends], np.int32)
        rows = [n for n, end in enumerate(ends) if end.plan]
        plans = Plans(np.array(rows, np.int64), np.array([ends[n].plan for n in rows], np.int32).reshape(-1, 4, 2))
        if walls:
            axis, around = np.array([wall.axis for wall in walls]), np.array([wall.box for wall in walls], np.int32)
            tree = blocker_tree(Blockers(around, axis.astype(np.int32)), device)
            partial = len(walls) < len(case.occluders) or _on_face(case)
            yield ObliqueQuestion(case, tree, dict(enumerate(walls)), boxes, plans, ends, partial)


def around_end(shape: Shape) -> list[list[int]]:
    """The box around a cell or target."""
    return [[f(column) for column in zip(*shape, strict=True)] for f in (min, max)]


def _end(shape: Shape) -> End:
    """As the checker takes it."""
    return End(around_end(shape), None if len(shape) == 2 else [corner[:2] for corner in shape[:4]])


def _curtain(shape: Shape) -> Blocker | None:
    """An upright rectangle; None for any other shape."""
    box = around_end(shape)
    feet = sorted({tuple(corner[:2]) for corner in shape})
    if len(shape) != 4 or len(feet) != 2 or len({corner[2] for corner in shape}) != 2:
        return None
    (x, y), (u, v) = feet
    return Blocker(0 if x == u else 1 if y == v else RISING if v > y else FALLING, box)


def _on_face(case: ObliqueCase) -> bool:
    """Whether an upright rectangle lies in the plane of an upright face of the target."""
    corners = case.target[:4] if len(case.target) > 2 else None
    (x, y, _), (u, v, _) = around_end(case.target)
    plan = [corner[:2] for corner in corners] if corners else [[x, y], [u, y], [u, v], [x, v]]
    for shape in case.occluders:
        (ax, ay), (bx, by) = min(c[:2] for c in shape), max(c[:2] for c in shape)
        off = [(bx - ax) * (q - ay) - (by - ay) * (p - ax) for p, q in plan]
        if any(off[k] == off[(k + 1) % 4] == 0 for k in range(4)):
            return True
    return False
