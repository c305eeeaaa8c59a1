"""Hard cases of eyes: in portals, on their edges and corners, and where sightlines start."""

import numpy as np

from ...data.camera import CameraPath, Screen
from ...kernels.eye import MAX_SEQUENCES, EyeAnswers, eye_model, launch_eye
from ...kernels.launch import Device
from ...verify.cases.hard_cases import GraphCase, HardCases
from ...verify.exact.eye import seen_by_eye
from .outcomes import Outcome, Outcomes
from .searches import graph_of

# As wide as it is high, and so wide that its sides run along the grid.
SCREEN = Screen(100, 100, 90.0)
HALF = (1.0, 1.0)


def eyes_of(case: GraphCase) -> np.ndarray:
    """Where the first trace starts; and the middle, a corner, and the middle of an edge of the first portal."""
    low, high = np.array(case.portals[0][2], float)
    middle = (low + high) / 2
    edge = np.where(np.arange(3) == 2 - (low[2] == high[2]), low, middle)
    return np.stack([middle, low, edge, *(np.array(trace.segment[0], float) for trace in case.traces[:1])])


def boxes_of(case: GraphCase) -> np.ndarray:
    """Objects: the floor and the highest corner of each cell."""
    cells = np.array(case.cells)
    floors, corners = cells.copy(), cells.copy()
    floors[:, 1, 2] = floors[:, 0, 2]
    corners[:, 0] = corners[:, 1] - 1
    return np.concatenate([floors, corners])


def eye(cases: HardCases, device: Device) -> Outcomes:
    """Eyes in each graph that look along two axes: all that rays meet, by the wedge and by rectangles."""
    for case in cases.graph:
        graph, boxes, eyes = graph_of(case), boxes_of(case), eyes_of(case)
        yaw = np.tile([0.0, 90.0], len(eyes))
        path = CameraPath(np.repeat(eyes, 2, axis=0), yaw, np.zeros(len(yaw)), np.arange(len(yaw)) * 1.0)
        model = eye_model(graph, boxes, 1.0, device=device)
        wanted = [seen_by_eye(graph, boxes, *view, HALF) for view in zip(path.eyes, path.axes(), strict=True)]
        outcome = Outcome.RIGHT
        for limit in (MAX_SEQUENCES, 0):
            found = launch_eye(model, path, SCREEN, limit=limit)
            if any(not (few <= objects and fewer <= cells) for (few, fewer), objects, cells in _each(wanted, found)):
                outcome = Outcome.WRONG
        yield case.name, outcome


def _each(wanted: list[tuple[set[int], set[int]]], found: EyeAnswers) -> zip:
    """What each eye should keep, and the objects and cells that it does."""
    objects, cells = (
        [set(part.tolist()) for part in np.split(ids, starts[1:-1])]
        for starts, ids in ((found.starts, found.objects), (found.cell_starts, found.cells))
    )
    return zip(wanted, objects, cells, strict=True)
