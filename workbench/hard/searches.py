"""Hard cases of stabbing lines and sightlines: each asks a kernel, and says whether it was right, withheld or wrong."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...data.blockers import Blockers
from ...data.graph import CellGraph
from ...data.scene import GRID_LIMIT
from ...data.verdict import Verdict
from ...kernels.aim import launch_aim
from ...kernels.blockers import BlockerTree, blocker_tree
from ...kernels.flood import launch_flood
from ...kernels.launch import Device
from ...kernels.line_tree import launch_line_trees
from ...kernels.sightline import device_triangles, launch_confirm
from ...kernels.stab_batch import launch_stab
from ...kernels.target import launch_target_search
from ...kernels.trace import launch_trace
from ...solvers.visibility.graph_engine import GraphEngine
from ...verify.cases.hard_cases import GraphCase, HardCases, RegionCase, faces
from ...verify.proofs.line_tree import Blocker
from ...verify.proofs.line_tree import hides as line_tree_hides
from ...verify.proofs.ways import End
from .oblique import oblique_questions
from .outcomes import Outcome, Outcomes, one_sided, two_sided, worst

# Halvings, and lines tried, before a kernel gives up a case.
CAP = 4000
# Cell, target, and that the target is a surface.
TO_SURFACE = np.array([[0, 1, 1]])


def stab(cases: HardCases, device: Device) -> Outcomes:
    """Lists of boxes."""
    most = max(len(case.boxes) for case in cases.stab)
    # A local origin is subtracted exactly, as the readers do: 100 km in millimetres is beyond the grid.
    boxes = [c.boxes - c.boxes[0, 0] if np.abs(c.boxes).max() > GRID_LIMIT else c.boxes for c in cases.stab]
    padded = np.stack([np.concatenate([b, np.repeat(b[:1], most - len(b), axis=0)]) for b in boxes])
    signs, lengths = np.array([c.signs for c in cases.stab]), np.array([len(b) for b in boxes])
    answers = launch_stab(padded, signs, lengths, device=device)
    for case, verdict in zip(cases.stab, answers.verdict, strict=True):
        yield case.name, two_sided(int(verdict), case.expected != "open")


def graph_of(case: GraphCase) -> CellGraph:
    """The cells and portals of a case, all inhabitable."""
    portals = np.array([rectangle for _, _, rectangle in case.portals], np.int32)
    axis = (portals[:, 0] == portals[:, 1]).argmax(axis=1).astype(np.int8)
    count = len(case.cells)
    ends = np.array([[a, b] for a, b, _ in case.portals], np.int32)
    return CellGraph(
        np.array(case.cells, np.int32), np.ones(count, bool), np.full(count, "", object), ends, axis, portals
    )


def _engine(case: GraphCase, device: Device) -> GraphEngine:
    return GraphEngine(graph_of(case), device=device)


def flood(cases: HardCases, device: Device) -> Outcomes:
    """All pairs of each graph."""
    for case in cases.graph:
        count = len(case.cells)
        found = launch_flood(_engine(case, device).model.device_graph, np.arange(count), cap=CAP, device=device)
        verdict = np.full((count, count), Verdict.HIDDEN)
        verdict[~found.complete] = verdict[tuple(found.undecided.T)] = Verdict.UNKNOWN
        verdict[found.pairs[:, 0], found.pairs[:, 1]] = Verdict.VISIBLE
        pairs = [(a, b) for a in range(count) for b in range(count) if a != b]
        hidden = {(a, b): (min(a, b), max(a, b)) not in case.seen for a, b in pairs}
        yield case.name, worst(two_sided(int(verdict[pair]), hidden[pair]) for pair in pairs)


def target_search(cases: HardCases, device: Device) -> Outcomes:
    """All pairs of each graph, and regions with axial occluders."""
    for case in cases.graph:
        model = _engine(case, device).model
        count = len(case.cells)
        rows = np.array([(a, b, 0) for a in range(count) for b in range(count) if a != b])
        answers = launch_target_search(model.tree, model.graph.cells, rows, cap=CAP, device=device)
        hidden = [(min(a, b), max(a, b)) not in case.seen for a, b, _ in rows.tolist()]
        yield case.name, worst(two_sided(int(v), h) for v, h in zip(answers.verdict, hidden, strict=True))
    for asked in _axial_regions(cases, device):
        hidden = asked.case.expected == "hidden"
        answers = launch_target_search(asked.tree, asked.ends, TO_SURFACE, cap=CAP, device=device)
        # What lies in the plane of one face of the target counts for no other: visible is no proof then.
        if asked.on_face:
            yield asked.case.name, one_sided(answers.verdict[0] == Verdict.HIDDEN, hidden)
        else:
            yield asked.case.name, two_sided(int(answers.verdict[0]), hidden)
    for asked in oblique_questions(cases, device):
        hidden = asked.case.expected == "hidden"
        answers = launch_target_search(asked.tree, asked.boxes, TO_SURFACE, plans=asked.plans, cap=CAP, device=device)
        # Plates are no blockers: visible is no proof beside them.
        if asked.partial:
            yield asked.case.name, one_sided(answers.verdict[0] == Verdict.HIDDEN, hidden)
        else:
            yield asked.case.name, two_sided(int(answers.verdict[0]), hidden)


def line_trees(cases: HardCases, device: Device) -> Outcomes:
    """A tree must hold, and there is none where something can be seen."""
    for asked in _axial_regions(cases, device):
        answers = launch_target_search(asked.tree, asked.ends, TO_SURFACE, cap=CAP, device=device)
        words = launch_line_trees(asked.tree, asked.ends, TO_SURFACE, answers.nodes, device=device).words.tolist()
        if words and not line_tree_hides(*map(End, asked.ends.tolist()), True, words, asked.blockers):
            yield asked.case.name, Outcome.WRONG
        else:
            yield asked.case.name, one_sided(bool(words), asked.case.expected == "hidden")
    for asked in oblique_questions(cases, device):
        work, options = (asked.tree, asked.boxes, TO_SURFACE), {"plans": asked.plans, "device": device}
        answers = launch_target_search(*work, cap=CAP, **options)
        words = launch_line_trees(*work, answers.nodes, **options).words.tolist()
        if words and not line_tree_hides(*asked.ends, True, words, asked.blockers):
            yield asked.case.name, Outcome.WRONG
        else:
            yield asked.case.name, one_sided(bool(words), asked.case.expected == "hidden")


@dataclass(frozen=True)
class _AxialRegion:
    """A case about a region whose occluders are axial rectangles, beside its blockers on a device.

    Attributes:
        ends: cell and target.
        on_face: a blocker lies in the plane of a face of the target.
    """

    case: RegionCase
    tree: BlockerTree
    blockers: dict[int, Blocker]
    ends: np.ndarray
    on_face: bool


def _axial_regions(cases: HardCases, device: Device) -> Iterator[_AxialRegion]:
    """Cases that a search of lines can be asked: axial, cell and target apart."""
    for case in cases.region:
        walls = [np.array(face, np.int32) for shape in case.occluders for face in faces(shape)]
        boxes = np.array([[wall.min(axis=0), wall.max(axis=0)] for wall in walls])
        axial = [set(map(tuple, wall.tolist())) == set(_rectangle(box)) for wall, box in zip(walls, boxes, strict=True)]
        apart = any(h <= low or high <= a for a, h, low, high in zip(*case.cell, *case.target, strict=True))
        if not (all(axial) and apart):
            continue
        flat = boxes[:, 0] == boxes[:, 1]
        axis = flat.argmax(axis=1).astype(np.int32)
        ends = np.array([case.cell, case.target], np.int32)
        yield _AxialRegion(
            case,
            blocker_tree(Blockers(boxes, axis), device),
            {number: Blocker(int(axis[number]), box.tolist()) for number, box in enumerate(boxes)},
            ends,
            bool((flat & ((boxes[:, 0] == ends[1, 0]) | (boxes[:, 0] == ends[1, 1]))).any()),
        )


def _rectangle(box: np.ndarray) -> list[tuple[int, ...]]:
    """Corners of an axial rectangle; none of a box that is flat on no axis, or on several."""
    try:
        found = faces(box.tolist())
    except ValueError:
        return []
    return [tuple(corner) for corner in found[0]] if len(found) == 1 else []


def trace(cases: HardCases, device: Device) -> Outcomes:
    """Sightlines of each graph."""
    for case in cases.graph:
        if not case.traces:
            continue
        ends = np.array([asked.segment for asked in case.traces])
        sources = np.array([asked.source for asked in case.traces])
        graph = _engine(case, device).model.device_graph
        reached = launch_trace(graph, sources, ends[:, 0], ends[:, 1], device=device)[0]
        outcomes = []
        for asked, cell in zip(case.traces, reached.tolist(), strict=True):
            outcomes.append(
                Outcome.RIGHT if cell == asked.reached else Outcome.WITHHELD if cell == -1 else Outcome.WRONG
            )
        yield case.name, worst(outcomes)


def confirm(cases: HardCases, device: Device) -> Outcomes:
    """Segments and what stops them."""
    for case in cases.sightline:
        triangles = np.array(case.triangles, np.int32)
        ends = np.array(case.segment)[:, None]
        if max(np.abs(ends).max(), np.abs(triangles).max()) > GRID_LIMIT:
            continue
        scene = device_triangles(triangles, np.arange(len(triangles)), device)
        clear = launch_confirm(scene, *ends, np.array([case.excepted]), device=device)[0]
        yield case.name, _clearance(bool(clear), case.expected)


def aim(cases: HardCases, device: Device) -> Outcomes:
    """Boxes without extent leave one line to aim along."""
    for case in cases.sightline:
        ends = np.array(case.segment)
        if case.excepted >= 0 or (ends != np.round(ends)).any() or np.abs(ends).max() > GRID_LIMIT:
            continue
        triangles = np.array(case.triangles, np.int32)
        scene = device_triangles(triangles, np.arange(len(triangles)), device)
        spots = np.repeat(ends[:, None, None], 2, axis=2).astype(np.int32)
        found, *_ = launch_aim(
            scene,
            *spots,
            ends[None],
            np.array([[-1, 0, 0]]),
            np.zeros(1, int),
            np.zeros(1, bool),
            tries=1,
            device=device,
        )
        yield case.name, _clearance(bool(found[0]), case.expected)


def _clearance(claimed: bool, expected: str) -> Outcome:
    if claimed:
        return Outcome.RIGHT if expected == "clear" else Outcome.WRONG
    return Outcome.WITHHELD if expected == "clear" else Outcome.RIGHT
