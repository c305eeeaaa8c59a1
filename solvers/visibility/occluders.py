"""Which objects can be seen from view cells, proved with occluders alone: no rooms, no portals.

Top down over the hierarchy of objects: a node that is hidden from a view cell is done with. What is left is first shot
at, since most of it is visible; then its pieces are proved hidden one by one, by lines past axial rectangles
(kernels/target.py, exact for them together) and by halving (kernels/shaft.py, which also knows oblique occluders). The
middle of a piece that could not be proved is where the next sightlines are aimed.

An eye counts only outside every solid, so a view cell may overlap walls and furniture.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from ...data.blockers import Blockers
from ...data.hierarchy import build_hierarchy
from ...data.occludees import Occludees
from ...data.patches import Patches
from ...data.regions import Regions
from ...data.solids import SolidIndex
from ...data.store.certificates import Proofs
from ...kernels.shaft import ShaftAnswers, Shields, device_shields, launch_shaft, patches_met
from ...kernels.sightline import AimTargets, Triangles
from ...kernels.target import BlockerTree, TargetAnswers, blocker_tree, launch_target_search
from .cells import segments
from .ledger import Ledger, apart, descend
from .objects import ObjectRows, aim_at_objects

# Sightlines aimed at each object that its box does not hide, then at those whose pieces are not hidden, round by round.
FIRST_TRIES = 12
AIM_ROUNDS = (32, 128, 512)
# The root of the hierarchy is visible from everywhere: start where a level has some nodes.
FIRST_LEVEL = 3
# Lines tried for a node of the hierarchy, and for a piece.
NODE_CAP, PIECE_CAP = 40, 2000
# An object with so many pieces that could not be hidden is not looked at further: they are enough to aim at.
OPEN_ENOUGH = 3


@dataclass
class Occlusion:
    """What hides and what may be hidden, on the device.

    Attributes:
        occludees: objects and their pieces.
        tree: axial rectangles.
        shields: regions and patches.
        triangles: opaque triangles.
        targets: triangles of all objects.
        ranges: first and past-the-last triangle of each object among the targets, shape (objects, 2).
        solids: closed elements by view cell.
        cells: view cells [grid steps], shape (cells, 2, 3), int32; they may overlap each other and solids.
        smallest: sides of view cells and of pieces that are not halved below this [grid steps].
        cap: halvings a piece.
    """

    occludees: Occludees
    tree: BlockerTree
    shields: Shields
    triangles: Triangles
    targets: AimTargets
    ranges: np.ndarray
    solids: SolidIndex
    cells: np.ndarray
    smallest: tuple[int, int]
    cap: int
    seed: int = 0
    threads: int = 1
    device: str = "cpu"


def device_occluders(
    regions: Regions, patches: Patches, blockers: Blockers | None, device: str
) -> tuple[BlockerTree, Shields]:
    """Occluders as the two searches want them; blockers of a portal graph serve the search of lines only."""
    boxes, axis, hierarchy = regions.boxes, regions.axis[regions.region], regions.hierarchy
    if blockers is not None:
        boxes, axis = np.concatenate([blockers.boxes, boxes]), np.concatenate([blockers.axis, axis])
        hierarchy = build_hierarchy(boxes)
    return blocker_tree(Blockers(boxes, axis, hierarchy), device), device_shields(regions, patches, device)


def seen_objects(
    model: Occlusion, block: np.ndarray, aim_rounds: tuple[int, ...] = AIM_ROUNDS, ledger: Ledger | None = None
) -> tuple[ObjectRows, Proofs | None]:
    """Every object that is not proved hidden from some view cells.

    Args:
        model: occluders and occludees.
        block: view cells, shape (n,), int.
        aim_rounds: sightlines shot at what could not be hidden.
        ledger: where to enter certificates; then only what has one is hidden.

    Returns:
        Reached pairs. A pair that is left out is hidden from every point of the cell outside solids, exactly. A `seen`
        pair's witness ends on the object, starts outside every solid, and clears all opaque triangles but the object's.
        And the certificates, with a ledger.
    """
    occludees = model.occludees
    hide = partial(_hide_nodes, model, ledger)
    source, target = descend(model.cells, block, occludees.levels, occludees.objects, FIRST_LEVEL, hide)
    rows = ObjectRows.unseen(source, target)
    look_at_objects(model, rows, ())
    return refine_objects(model, rows, aim_rounds, ledger)


def refine_objects(
    model: Occlusion, rows: ObjectRows, aim_rounds: tuple[int, ...] = AIM_ROUNDS, ledger: Ledger | None = None
) -> tuple[ObjectRows, Proofs | None]:
    """Hide, or find witnesses of, pairs that have neither; seen pairs stay as they are. As `seen_objects`."""
    pairs, pieces, hints = _prove_pieces(model, rows, ledger)
    potential = rows.seen.copy()
    potential[pairs] = True
    for number, tries in enumerate(aim_rounds):
        todo = np.flatnonzero(~rows.seen[pairs])
        boxes = model.occludees.pieces[pieces[todo]]
        aim_at_objects(
            model, model.cells, model.ranges, rows, pairs[todo], boxes, hints[todo], pieces[todo], tries, number + 1
        )
    kept = np.flatnonzero(potential)
    proofs = None if ledger is None else ledger.close(~potential)
    return ObjectRows(rows.source[kept], rows.target[kept], rows.seen[kept], rows.origin[kept], rows.end[kept]), proofs


def look_at_objects(model: Occlusion, rows: ObjectRows, aim_rounds: tuple[int, ...] = AIM_ROUNDS) -> None:
    """Shoot at the objects of rows, then at the pieces of those not seen; fills seen, origin and end in place."""
    bounds = model.occludees.bounds[rows.target]
    middles = np.stack([model.cells[rows.source].mean(axis=1), bounds.mean(axis=1)], axis=1)
    everything = np.arange(len(rows.source))
    aim_at_objects(model, model.cells, model.ranges, rows, everything, bounds, middles, rows.target, FIRST_TRIES, 0)
    starts = model.occludees.starts
    for number, tries in enumerate(aim_rounds):
        todo = np.flatnonzero(~rows.seen)
        sizes = np.minimum(starts[rows.target[todo] + 1] - starts[rows.target[todo]], OPEN_ENOUGH)
        pairs = np.repeat(todo, sizes)
        piece = np.arange(len(pairs)) - np.repeat(np.cumsum(sizes) - sizes - starts[rows.target[todo]], sizes)
        boxes = model.occludees.pieces[piece]
        lines = np.stack([model.cells[rows.source[pairs]].mean(axis=1), boxes.mean(axis=1)], axis=1)
        aim_at_objects(model, model.cells, model.ranges, rows, pairs, boxes, lines, piece, tries, number + 1)


def hidden_boxes(model: Occlusion, source: np.ndarray, boxes: np.ndarray, ledger: Ledger | None = None) -> np.ndarray:
    """Boxes that no sightline from the view cell of their row reaches, shape (n,), bool; false proves nothing."""
    hidden = np.zeros(len(source), bool)
    rows = apart(model.cells[source], boxes)
    hidden[rows] = _shaft(model, source[rows], boxes[rows], ledger).verdict == 0
    return hidden


def _hide_nodes(model: Occlusion, ledger: Ledger | None, source: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Which nodes of the hierarchy few lines hide, shape (n,), bool."""
    return _search(model, source, boxes, NODE_CAP, ledger).verdict == 0


def _search(
    model: Occlusion,
    source: np.ndarray,
    boxes: np.ndarray,
    cap: int,
    ledger: Ledger | None = None,
    pair: np.ndarray | None = None,
) -> TargetAnswers:
    """Target search from view cells to boxes, row by row; `pair` as of `Ledger.add_lines`."""
    rows = np.column_stack([source, len(model.cells) + np.arange(len(boxes)), np.ones(len(boxes), int)])
    everything = np.concatenate([model.cells, boxes])
    options = {"threads": model.threads, "device": model.device}
    answers = launch_target_search(model.tree, everything, rows, cap=cap, **options)
    if ledger is not None:
        ledger.add_lines(model.tree, everything, rows, answers, pair, **options)
    return answers


def _shaft(
    model: Occlusion,
    source: np.ndarray,
    boxes: np.ndarray,
    ledger: Ledger | None = None,
    pair: np.ndarray | None = None,
) -> ShaftAnswers:
    """Shaft test from view cells to boxes, row by row."""
    rows = np.column_stack([source, len(model.cells) + np.arange(len(boxes))])
    everything = np.concatenate([model.cells, boxes])
    options = {"certify": ledger is not None, "threads": model.threads, "device": model.device}
    answers = launch_shaft(model.shields, everything, rows, smallest=model.smallest, cap=model.cap, **options)
    if ledger is not None:
        ledger.add_shafts(source, boxes, answers, pair)
    return answers


def _prove_pieces(
    model: Occlusion, rows: ObjectRows, ledger: Ledger | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Try to hide the pieces of the pairs that are not seen, a few at a time, until some of a pair are not hidden.

    Returns:
        Of every piece that could not be hidden: its pair, its row among the pieces, and a line to it, shape (n, 2, 3).
    """
    starts = model.occludees.starts
    pairs = np.flatnonzero(~rows.seen)
    first, last = starts[rows.target[pairs]], starts[rows.target[pairs] + 1]
    open_pieces = np.zeros(len(pairs), int)
    found: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    step = 1
    while True:
        active = np.flatnonzero((first < last) & (open_pieces < OPEN_ENOUGH))
        if not len(active):
            break
        sizes = np.minimum(step, last[active] - first[active])
        at = np.repeat(active, sizes)
        ends = np.cumsum(sizes)
        piece = first[at] + np.arange(len(at)) - np.repeat(ends - sizes, sizes)
        left, hints = _prove_boxes(model, rows.source[pairs[at]], model.occludees.pieces[piece], ledger, pairs[at])
        found.append((pairs[at[left]], piece[left], hints[left]))
        np.add.at(open_pieces, at[left], 1)
        first[active] += sizes
        step *= 2
    if not found:
        return np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2, 3))
    return tuple(np.concatenate(column) for column in zip(*found, strict=True))


def _prove_boxes(
    model: Occlusion, source: np.ndarray, boxes: np.ndarray, ledger: Ledger | None, pair: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Which boxes could not be hidden from the view cell of their row, bool, and a line to each, shape (n, 2, 3)."""
    hints = np.stack([model.cells[source].mean(axis=1), boxes.mean(axis=1)], axis=1)
    left = np.ones(len(source), bool)
    rows = apart(model.cells[source], boxes)
    answers = _search(model, source[rows], boxes[rows], PIECE_CAP, ledger, pair[rows])
    left[rows[answers.verdict == 0]] = False
    lined = np.flatnonzero(answers.verdict == 1)
    at = rows[lined]
    hints[at] = np.stack(segments(answers, lined, model.cells[source[at]], boxes[at]), axis=1)
    # A line past all rectangles that meets no oblique occluder either: there is nothing to prove.
    at = rows[answers.verdict != 0]
    options = {"threads": model.threads, "device": model.device}
    at = at[patches_met(model.shields, hints[at, 0], hints[at, 1], **options)]
    proofs = _shaft(model, source[at], boxes[at], ledger, pair[at])
    left[at[proofs.verdict == 0]] = False
    failed = proofs.verdict != 0
    hints[at[failed]] = proofs.middle[failed]
    return left, hints
