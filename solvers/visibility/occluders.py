"""Which objects can be seen from view cells, proved with occluders alone: no rooms, no portals.

Top down over the hierarchy of objects: a node that is hidden from a view cell is done with. What is left is first shot
at, since most of it is visible; then its pieces are proved hidden one by one, by lines past axial rectangles
(kernels/target.py, exact for them together) and by halving (kernels/shaft.py, which also knows oblique occluders). The
middle of a piece that could not be proved is where the next sightlines are aimed.

An eye counts only outside every solid, so a view cell may overlap walls and furniture.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...data.blockers import Blockers, join_blockers, strong_blockers
from ...data.occludees import Occludees
from ...data.own_frames import find_own_frames
from ...data.plans import NO_PLANS, Plans
from ...data.prepared import no_patches
from ...data.ragged import places_of
from ...data.regions import no_regions
from ...data.rows import Rows
from ...data.store.certificates import Proofs
from ...data.verdict import Verdict
from ...kernels.blockers import BlockerTree, blocker_tree
from ...kernels.shaft import ShaftAnswers, launch_shaft, patches_met
from ...kernels.shields import Shields, device_shields
from ...kernels.target import TargetAnswers, launch_target_search
from .aim import AIM_ROUNDS, FIRST_TRIES, Sights, middles
from .ledger import Ledger, apart, descend
from .own_frames import FrameSearch
from .search import OPEN_ENOUGH, open_pieces, segments

# The root of the hierarchy is visible from everywhere: start where a level has some nodes.
FIRST_LEVEL = 3
# Lines tried for a node of the hierarchy, and for a piece.
NODE_CAP, PIECE_CAP = 40, 2000
# View cells and pieces are not halved below this, and a proof has at most so many subshafts.
SMALLEST_M = (0.0625, 0.0625)
SHAFT_CAP = 200
# Rectangles that are narrower hide little, and most of them are: lines that look at the others alone are several times
# as fast.
STRONG_M = 1.0
# Sightlines shot near each line that a frame lets pass, round by round.
FRAME_ROUNDS = AIM_ROUNDS[:2]


@dataclass
class OccluderModel:
    """What hides and what may be hidden, on a device.

    Attributes:
        sights: triangles and solids, and the view cells.
        occludees: objects and their pieces.
        tree: axial rectangles.
        shields: regions and patches.
        smallest: sides of view cells and of pieces that are not halved below this [grid steps].
        cap: halvings per piece.
        frames: of view cells at an angle, which hide there first; not with certificates, which know one frame only.
    """

    sights: Sights
    occludees: Occludees
    tree: BlockerTree
    shields: Shields
    smallest: tuple[int, int]
    cap: int = SHAFT_CAP
    frames: tuple[FrameSearch, ...] = ()

    @classmethod
    def of(
        cls,
        sights: Sights,
        *,
        blockers: Blockers | None = None,
        shadows: bool = True,
        certify: bool = False,
        rough: bool = False,
        bare: bool = False,
        shields: "Shields | None" = None,
    ) -> "OccluderModel":
        """Copy a prepared model's occluders to the device.

        Args:
            sights: of the model.
            blockers: of its portal graph, if they are to hide too; they serve the search of lines only.
            shadows: whether regions and patches are to hide.
            certify: hide only as certificates can say it: not in frames of view cells at an angle, and every face for
                itself, also where another element stands against it.
            rough: strong rectangles alone, where lines are to hide; curtains of a large model take most of the time.
            bare: no regions and patches beside them, where there is no time to make those.
            shields: regions and patches, if the same ones are on the device.
        """
        model, device = sights.model, sights.device
        regions = model.regions if shadows else no_regions()
        patches = model.patches if shadows and not bare else no_patches()
        walls = model.walls if shadows and not rough else regions.blockers
        if blockers is not None:
            walls = join_blockers([blockers, walls])
        if rough:
            walls = strong_blockers(walls, STRONG_M / model.scene.grid_m)
        smallest = tuple(round(size / model.scene.grid_m) for size in SMALLEST_M)
        if shields is None:
            shields = device_shields(*((no_regions(), no_patches()) if bare else (regions, patches)), device)
        wanted = shadows and not rough and not certify
        own = find_own_frames(model.scene, model.large_closed, sights.cells, sights.plans) if wanted else []
        searches = tuple(FrameSearch.of(frame, device) for frame in own)
        occludees = model.whole_occludees if certify else model.occludees
        return cls(sights, occludees, blocker_tree(walls, device), shields, smallest, frames=searches)

    @property
    def cells(self) -> np.ndarray:
        """View cells [grid steps], shape (cells, 2, 3), int32."""
        return self.sights.cells

    def from_cells(self, cells: np.ndarray) -> "OccluderModel":
        """The same for other view cells."""
        return replace(self, sights=self.sights.from_cells(cells), frames=())


def seen_objects(
    model: OccluderModel, block: np.ndarray, aim_rounds: tuple[int, ...] = AIM_ROUNDS, ledger: Ledger | None = None
) -> tuple[Rows, Proofs | None]:
    """Every object that is not proved hidden from some view cells.

    Args:
        model: occluders and occludees.
        block: view cells, shape (n,), int.
        aim_rounds: sightlines shot at what could not be hidden.
        ledger: where to enter certificates; then only what has one is hidden.

    Returns:
        Reached pairs, ordered. A pair that is left out is hidden from every point of the cell outside solids, exactly.
        And the certificates, with a ledger.
    """
    occludees, hide = model.occludees, partial(_hide_nodes, model, ledger)
    clear = partial(_clear, model, NO_PLANS)
    own = [frame.places(block) >= 0 for frame in model.frames]
    rest = block[~np.any([np.zeros(len(block), bool), *own], axis=0)]
    # A certificate of a node serves for all below it.
    way = {"clear": clear, "haste": ledger is None}
    found = [descend(model.cells, rest, occludees.levels, occludees.objects, FIRST_LEVEL, hide, **way)]
    found += [
        frame.left(block[mine], FIRST_LEVEL, NODE_CAP)
        for frame, mine in zip(model.frames, own, strict=True)
        if mine.any()
    ]
    rows = Rows.unseen(*(np.concatenate(column) for column in zip(*found, strict=True))).order()
    look_at_objects(model, rows, ())
    return refine_objects(model, _hide_in_frames(model, rows), aim_rounds, ledger)


def boxes_left(model: OccluderModel, source: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Rows whose box their view cell meets, or few lines do not hide from it, shape (n,), bool."""
    left = np.ones(len(source), bool)
    rows = np.flatnonzero(_clear(model, NO_PLANS, source, boxes))
    left[rows] = ~_hide_nodes(model, None, source[rows], boxes[rows])
    return left


def pieces_left(model: OccluderModel, rows: Rows) -> np.ndarray:
    """Unseen rows of which pieces could not be hidden; some are named several times."""
    return _prove_pieces(model, rows, None)[0]


def refine_objects(
    model: OccluderModel, rows: Rows, aim_rounds: tuple[int, ...] = AIM_ROUNDS, ledger: Ledger | None = None
) -> tuple[Rows, Proofs | None]:
    """Hide, or find witnesses of, pairs that have neither; seen pairs stay as they are. As `seen_objects`."""
    pairs, pieces, hints = _prove_pieces(model, rows, ledger)
    potential = rows.seen
    potential[pairs] = True
    for number, tries in enumerate(aim_rounds):
        todo = np.flatnonzero(~rows.seen[pairs])
        boxes = model.occludees.pieces[pieces[todo]]
        model.sights.aim(rows, pairs[todo], boxes, hints[todo], pieces[todo], tries, number + 1)
    return rows.take(potential), None if ledger is None else ledger.close(~potential)


def look_at_objects(model: OccluderModel, rows: Rows, aim_rounds: tuple[int, ...] = AIM_ROUNDS) -> None:
    """Shoot at the objects of rows, then at the pieces of those not seen; shows what is hit, in place."""
    bounds, cells = model.occludees.bounds[rows.target], model.cells[rows.source]
    model.sights.aim(rows, np.arange(len(rows)), bounds, middles(cells, bounds), rows.target, FIRST_TRIES, 0)
    starts = model.occludees.starts
    for number, tries in enumerate(aim_rounds):
        todo = np.flatnonzero(~rows.seen)
        first, last = starts[rows.target[todo]], starts[rows.target[todo] + 1]
        sizes = np.minimum(last - first, OPEN_ENOUGH)
        pairs, piece = np.repeat(todo, sizes), places_of(first, sizes)
        boxes = model.occludees.pieces[piece]
        model.sights.aim(rows, pairs, boxes, middles(cells[pairs], boxes), piece, tries, number + 1)


def hidden_boxes(
    model: OccluderModel, source: np.ndarray, boxes: np.ndarray, ledger: Ledger | None = None
) -> np.ndarray:
    """Boxes that no sightline from the view cell of their row reaches, shape (n,), bool; false proves nothing."""
    hidden = np.zeros(len(source), bool)
    rows = np.flatnonzero(apart(model.cells[source], boxes))
    hidden[rows] = _shaft(model, source[rows], boxes[rows], ledger).verdict == Verdict.HIDDEN
    return hidden


def _clear(model: OccluderModel, plans: Plans, source: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Rows whose view cell does not meet the box, or the prism over its plan, shape (n,), bool."""
    cells, own = model.cells, model.sights.plans
    clear = apart(cells[source], boxes)
    rows = np.flatnonzero(~clear)
    if len(rows) and len(own.rows) + len(plans.rows):
        both = Plans.join([(own, len(cells)), (plans, len(boxes))])
        everything = np.concatenate([cells, boxes])
        clear[rows] = both.part(len(everything), source[rows], len(cells) + rows, everything)
    return clear


def _hide_in_frames(model: OccluderModel, rows: Rows) -> Rows:
    """Rows without those that a frame of their view cell hides, or the model's own frame in one piece.

    Others are shot at along lines that pass all walls of the frame: those stand along it, and lines lead best there.
    """
    kept = np.ones(len(rows), bool)
    for frame in model.frames:
        mine = np.flatnonzero(~rows.seen & (frame.places(rows.source) >= 0))
        hidden, passing = frame.hides(rows.source[mine], rows.target[mine], PIECE_CAP)
        # As the descent over the hierarchy ends, for those that came here without it.
        left = np.flatnonzero(~hidden)
        bounds = model.occludees.bounds[rows.target[mine[left]]]
        clear = np.flatnonzero(_clear(model, NO_PLANS, rows.source[mine[left]], bounds))
        hidden[left[clear]] = _hide_nodes(model, None, rows.source[mine[left[clear]]], bounds[clear])
        kept[mine] = ~hidden
        passing = passing.take(~hidden[passing.row])
        pairs = mine[passing.row]
        for number, tries in enumerate(FRAME_ROUNDS):
            todo = np.flatnonzero(~rows.seen[pairs])
            at = pairs[todo]
            model.sights.aim(rows, at, passing.boxes[todo], passing.lines[todo], rows.target[at], tries, number + 1)
    return rows.take(kept)


def _hide_nodes(model: OccluderModel, ledger: Ledger | None, source: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Which nodes of the hierarchy few lines hide, shape (n,), bool."""
    return _search(model, source, boxes, NODE_CAP, ledger).verdict == Verdict.HIDDEN


def _search(
    model: OccluderModel,
    source: np.ndarray,
    boxes: np.ndarray,
    cap: int,
    ledger: Ledger | None = None,
    pair: np.ndarray | None = None,
    plans: Plans = NO_PLANS,
) -> TargetAnswers:
    """Target search from view cells to boxes, row by row; `pair` as of `Ledger.add_lines`, `plans` of the boxes."""
    rows = np.column_stack([source, len(model.cells) + np.arange(len(boxes)), np.ones(len(boxes), int)])
    everything, device = np.concatenate([model.cells, boxes]), model.sights.device
    both = Plans.join([(model.sights.plans, len(model.cells)), (plans, len(boxes))])
    answers = launch_target_search(model.tree, everything, rows, plans=both, cap=cap, device=device)
    if ledger is not None:
        ledger.add_lines(model.tree, everything, rows, answers, device, pair, both)
    return answers


def _shaft(
    model: OccluderModel,
    source: np.ndarray,
    boxes: np.ndarray,
    ledger: Ledger | None = None,
    pair: np.ndarray | None = None,
) -> ShaftAnswers:
    """Shaft test from view cells to boxes, row by row."""
    rows = np.column_stack([source, len(model.cells) + np.arange(len(boxes))])
    everything = np.concatenate([model.cells, boxes])
    options = {"smallest": model.smallest, "cap": model.cap, "certify": ledger is not None}
    answers = launch_shaft(model.shields, everything, rows, **options, device=model.sights.device)
    if ledger is not None:
        ledger.add_shafts(source, boxes, answers, pair)
    return answers


def _prove_pieces(model: OccluderModel, rows: Rows, ledger: Ledger | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Try to hide the pieces of the pairs that are not seen, a few at a time, until some of a pair are not hidden.

    Returns:
        Of every piece that could not be hidden: its pair, its row among the pieces, and a line to it, shape (n, 2, 3).
    """
    starts = model.occludees.starts
    pairs = np.flatnonzero(~rows.seen)

    def prove(at: np.ndarray, piece: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _prove_pieces_of(model, rows.source[pairs[at]], piece, ledger, pairs[at])

    at, piece, hints = open_pieces(starts[rows.target[pairs]], starts[rows.target[pairs] + 1], prove)
    return pairs[at], piece, hints


def _prove_pieces_of(
    model: OccluderModel, source: np.ndarray, piece: np.ndarray, ledger: Ledger | None, pair: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Which rows' pieces could not be hidden from their view cell, and a line to each of them, shape (n, 2, 3)."""
    boxes = model.occludees.pieces[piece]
    hints = middles(model.cells[source], boxes)
    left = np.ones(len(source), bool)
    plans = model.occludees.plans.take(piece, len(model.occludees.pieces))
    rows = np.flatnonzero(_clear(model, plans, source, boxes))
    own = plans.take(rows, len(piece))
    answers = _search(model, source[rows], boxes[rows], PIECE_CAP, ledger, pair[rows], own)
    left[rows[answers.verdict == Verdict.HIDDEN]] = False
    lined = np.flatnonzero(answers.verdict == Verdict.VISIBLE)
    at = rows[lined]
    prisms = model.sights.plans.take(source[at], len(model.cells))
    hints[at] = np.stack(segments(answers, lined, model.cells[source[at]], boxes[at], prisms), axis=1)
    at = rows[answers.verdict != Verdict.HIDDEN]
    # Shafts lead from box to box.
    at = at[apart(model.cells[source[at]], boxes[at])]
    # A line past all rectangles that meets no oblique occluder either: there is nothing to prove.
    at = at[patches_met(model.shields, hints[at, 0], hints[at, 1], device=model.sights.device)]
    proofs = _shaft(model, source[at], boxes[at], ledger, pair[at])
    hidden = proofs.verdict == Verdict.HIDDEN
    left[at[hidden]] = False
    hints[at[~hidden]] = proofs.middle[~hidden]
    left = np.flatnonzero(left)
    return left, hints[left]
