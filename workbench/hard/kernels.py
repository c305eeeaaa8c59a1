"""What a hard case asks of each kernel, and whether the answer is right, withheld or wrong."""

import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from fractions import Fraction
from functools import reduce
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...data.blockers import Blockers
from ...data.camera import CameraPath, Screen
from ...data.graph import CellGraph
from ...data.hierarchy import build_hierarchy
from ...data.patches import Patches, find_patches, join_outlines
from ...data.prepared import PreparedModel
from ...data.ragged import starts_of
from ...data.readers import read
from ...data.scene import GRID_LIMIT, Definition, Instance, Mesh, Role, Scene
from ...data.solids import closed_elements
from ...data.verdict import Verdict
from ...kernels.backface import build_cones, launch_backface
from ...kernels.blockers import BlockerTree, blocker_tree
from ...kernels.coverage import CubeMaps, launch_coverage
from ...kernels.deviation import launch_deviation
from ...kernels.flood import launch_flood
from ...kernels.launch import Device
from ...kernels.line_tree import launch_line_trees
from ...kernels.occludee import launch_occludees
from ...kernels.raster import device_triangles as raster_triangles
from ...kernels.raster import launch_raster
from ...kernels.select import launch_select
from ...kernels.shaft import launch_shaft
from ...kernels.shields import device_shields
from ...kernels.shrink import launch_shrink
from ...kernels.sightline import aim_targets, device_triangles, launch_aim, launch_confirm
from ...kernels.stab_batch import launch_stab
from ...kernels.target import launch_target_search
from ...kernels.trace import launch_trace
from ...kernels.umbra import Umbras, launch_umbra
from ...solvers.projection_point import cluster_problems, solve_points
from ...solvers.visibility.graph_engine import GraphEngine
from ...solvers.visibility.projection import VlodSettings, vlod_hidden
from ...verify.arithmetic import box_corners, cross, dot, minus, rational
from ...verify.cases.hard_cases import GraphCase, HardCases, ModelCase, RegionCase, Shape, faces, fan
from ...verify.exact.deviation import deviation_squared
from ...verify.exact.raster import first_hit
from ...verify.proofs.line_tree import Blocker
from ...verify.proofs.line_tree import hides as line_tree_hides
from ..bake.run import bake
from ..bake.settings import Settings

if TYPE_CHECKING:
    from ...data.store.bake_folder import BakeFolder

# Halvings, and lines tried, before a kernel gives up a case.
CAP = 4000
# Pixels on the side of the cube maps that cases about regions are drawn into.
RESOLUTION = 64
# Quarterings of a triangle in rationals, and how near the bounds on a deviation should be to each other.
PIECES, TIGHT = 1, 0.02
# What a pixel shows is left to rounding where its centre is so near to an edge (squared), or two surfaces to another.
SURE = 1e-12
# Cell, target, and that the target is a surface.
TO_SURFACE = np.array([[0, 1, 1]])
# Names by which the mesh reader tells the roles.
KINDS = {Role.OCCLUDER: "IfcWall", Role.DETAIL: "IfcFurniture", Role.TRANSPARENT: "IfcWindow"}


class Outcome(IntEnum):
    """What a kernel did with a case."""

    RIGHT = 0
    WITHHELD = 1
    WRONG = 2


Outcomes = Iterator[tuple[str, Outcome]]


def _one_sided(claimed: bool, hidden: bool) -> Outcome:
    """Of a kernel that can prove hidden, and says nothing otherwise."""
    if claimed == hidden:
        return Outcome.RIGHT
    return Outcome.WRONG if claimed else Outcome.WITHHELD


def _two_sided(verdict: int, hidden: bool) -> Outcome:
    """Of a kernel that answers with a `Verdict`."""
    if verdict == Verdict.UNKNOWN:
        return Outcome.WITHHELD
    return Outcome.RIGHT if (verdict == Verdict.HIDDEN) == hidden else Outcome.WRONG


def _worst(outcomes: Iterable[Outcome]) -> Outcome:
    return max(outcomes, default=Outcome.RIGHT)


def _stab(cases: HardCases, device: Device) -> Outcomes:
    most = max(len(case.boxes) for case in cases.stab)
    # A local origin is subtracted exactly, as the readers do: 100 km in millimetres is beyond the grid.
    boxes = [c.boxes - c.boxes[0, 0] if np.abs(c.boxes).max() > GRID_LIMIT else c.boxes for c in cases.stab]
    padded = np.stack([np.concatenate([b, np.repeat(b[:1], most - len(b), axis=0)]) for b in boxes])
    signs, lengths = np.array([c.signs for c in cases.stab]), np.array([len(b) for b in boxes])
    answers = launch_stab(padded, signs, lengths, device=device)
    for case, verdict in zip(cases.stab, answers.verdict, strict=True):
        yield case.name, _two_sided(int(verdict), case.expected != "open")


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


def _flood(cases: HardCases, device: Device) -> Outcomes:
    for case in cases.graph:
        count = len(case.cells)
        found = launch_flood(_engine(case, device).model.device_graph, np.arange(count), cap=CAP, device=device)
        verdict = np.where(found.undecided | ~found.complete[:, None], Verdict.UNKNOWN, Verdict.HIDDEN)
        verdict[found.pairs[:, 0], found.pairs[:, 1]] = Verdict.VISIBLE
        pairs = [(a, b) for a in range(count) for b in range(count) if a != b]
        hidden = {(a, b): (min(a, b), max(a, b)) not in case.seen for a, b in pairs}
        yield case.name, _worst(_two_sided(int(verdict[pair]), hidden[pair]) for pair in pairs)


def _target_search(cases: HardCases, device: Device) -> Outcomes:
    for case in cases.graph:
        model = _engine(case, device).model
        count = len(case.cells)
        rows = np.array([(a, b, 0) for a in range(count) for b in range(count) if a != b])
        answers = launch_target_search(model.tree, model.graph.cells, rows, cap=CAP, device=device)
        hidden = [(min(a, b), max(a, b)) not in case.seen for a, b, _ in rows.tolist()]
        yield case.name, _worst(_two_sided(int(v), h) for v, h in zip(answers.verdict, hidden, strict=True))
    for asked in _axial_regions(cases, device):
        hidden = asked.case.expected == "hidden"
        answers = launch_target_search(asked.tree, asked.ends, TO_SURFACE, cap=CAP, device=device)
        # What lies in the plane of one face of the target counts for no other: visible is no proof then.
        if asked.on_face:
            yield asked.case.name, _one_sided(answers.verdict[0] == Verdict.HIDDEN, hidden)
        else:
            yield asked.case.name, _two_sided(int(answers.verdict[0]), hidden)


def _line_trees(cases: HardCases, device: Device) -> Outcomes:
    """A tree must hold, and there is none where something can be seen."""
    for asked in _axial_regions(cases, device):
        answers = launch_target_search(asked.tree, asked.ends, TO_SURFACE, cap=CAP, device=device)
        words = launch_line_trees(asked.tree, asked.ends, TO_SURFACE, answers.nodes, device=device).words.tolist()
        if words and not line_tree_hides(*asked.ends.tolist(), True, words, asked.blockers):
            yield asked.case.name, Outcome.WRONG
        else:
            yield asked.case.name, _one_sided(bool(words), asked.case.expected == "hidden")


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
            blocker_tree(Blockers(boxes, axis, build_hierarchy(boxes)), device),
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


def _trace(cases: HardCases, device: Device) -> Outcomes:
    for case in cases.graph:
        if not case.walks:
            continue
        ends = np.array([walk.segment for walk in case.walks])
        sources = np.array([walk.source for walk in case.walks])
        graph = _engine(case, device).model.device_graph
        reached = launch_trace(graph, sources, ends[:, 0], ends[:, 1], device=device)[0]
        outcomes = []
        for walk, cell in zip(case.walks, reached.tolist(), strict=True):
            outcomes.append(
                Outcome.RIGHT if cell == walk.reached else Outcome.WITHHELD if cell == -1 else Outcome.WRONG
            )
        yield case.name, _worst(outcomes)


def _confirm(cases: HardCases, device: Device) -> Outcomes:
    for case in cases.sightline:
        triangles = np.array(case.triangles, np.int32)
        ends = np.array(case.segment)[:, None]
        if max(np.abs(ends).max(), np.abs(triangles).max()) > GRID_LIMIT:
            continue
        scene = device_triangles(triangles, np.arange(len(triangles)), device)
        clear = launch_confirm(scene, *ends, np.array([case.excepted]), device=device)[0]
        yield case.name, _clearance(bool(clear), case.expected)


def _aim(cases: HardCases, device: Device) -> Outcomes:
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
            aim_targets(triangles, device),
            *spots,
            ends[None],
            np.array([-1]),
            np.zeros((1, 2), int),
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


@dataclass(frozen=True)
class _Question:
    """Is a box hidden from a cell by some shapes? Cases about umbras and about regions, as one."""

    name: str
    cell: Shape
    box: Shape
    shapes: list[Shape]
    hidden: bool


def _questions(cases: HardCases) -> list[_Question]:
    shadows = [_Question(c.name, c.cell, c.box, [c.outline], c.expected != "not") for c in cases.shadow]
    regions = [_Question(c.name, c.cell, c.target, c.occluders, c.expected == "hidden") for c in cases.region]
    return shadows + regions


def _triangles(shapes: list[Shape]) -> np.ndarray:
    """Triangles of shapes, shape (m, 3, 3), float64."""
    return np.array([t for shape in shapes for face in faces(shape) for t in fan(face)], float)


def _scene(shapes: list[Shape]) -> Scene:
    """One object of shapes; a grid of 1 m keeps them as they are, and makes none too small to be used."""
    corners = _triangles(shapes)
    mesh = Mesh(corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3))
    objects = [Instance("object", "", 0, np.eye(4), Role.OCCLUDER)]
    return Scene([Definition("shape", (mesh,))], objects, grid_m=1.0)


def _shaft(cases: HardCases, device: Device) -> Outcomes:
    for asked in _questions(cases):
        model = PreparedModel(_scene(asked.shapes))
        shields = device_shields(model.regions, model.patches, device)
        boxes = np.array([asked.cell, asked.box], np.int32)
        answers = launch_shaft(shields, boxes, np.array([[0, 1]]), smallest=(1, 1), cap=CAP, device=device)
        yield asked.name, _one_sided(bool(answers.verdict[0] == Verdict.HIDDEN), asked.hidden)


def _outlines(shapes: list[Shape]) -> Patches:
    """Each face of each shape as an outline, if it can be one."""
    found = []
    for face in (face for shape in shapes for face in faces(shape)):
        triangles = np.array(fan(face), np.int32)
        owners = np.zeros(len(triangles), int)
        found.append(find_patches(triangles, owners, least_area=0.0, most_corners=99, cos_limit=0.5, axial=True))
    return reduce(join_outlines, found)


@dataclass(frozen=True)
class _Shadows:
    """All questions at once: the pair of cell and outline of each umbra, and which question it belongs to."""

    questions: list[_Question]
    cells: np.ndarray
    outlines: Patches
    of: np.ndarray
    umbras: Umbras

    @staticmethod
    def of_cases(cases: HardCases, device: Device) -> "_Shadows":
        """The umbras of all questions, by one launch."""
        questions = _questions(cases)
        tables = [_outlines(asked.shapes) for asked in questions]
        of = np.repeat(np.arange(len(tables)), [len(t.area) for t in tables])
        cells, outlines = np.array([asked.cell for asked in questions], np.int32), reduce(join_outlines, tables)
        pairs = np.column_stack([of, np.arange(len(of))])
        return _Shadows(questions, cells, outlines, of, launch_umbra(cells, outlines, pairs, device=device))


def _umbra(cases: HardCases, device: Device) -> Outcomes:
    shadows = _Shadows.of_cases(cases, device)
    for number, asked in enumerate(shadows.questions):
        corners = np.array(box_corners(asked.box), float)
        claimed = any(shadows.umbras.contains(pair, corners).all() for pair in np.flatnonzero(shadows.of == number))
        yield asked.name, _one_sided(claimed, asked.hidden)


def _shrink(cases: HardCases, device: Device) -> Outcomes:
    """Seen from several projection points, with and without a limit of depth, no visible box may be behind."""
    shadows = _Shadows.of_cases(cases, device)
    rows = np.arange(len(shadows.of))
    claimed = np.zeros(len(shadows.questions), bool)
    for share in (0.5, 0.0, 1.0):
        points = (shadows.cells[:, 0] + share * (shadows.cells[:, 1] - shadows.cells[:, 0]))[shadows.of]
        for limited in (False, True):
            depths = np.array([_depth(shadows, row) for row in rows]) if limited else None
            polygons = launch_shrink(shadows.umbras, rows, points, depths, device=device)
            for row in np.flatnonzero(np.diff(polygons.starts)):
                outline = polygons.corners[polygons.starts[row] : polygons.starts[row + 1]]
                box = shadows.questions[shadows.of[row]].box
                normal, far = shadows.umbras.normal[row], shadows.umbras.far[row]
                claimed[shadows.of[row]] |= _behind(points[row], outline, normal, far, box)
    for asked, claim in zip(shadows.questions, claimed, strict=True):
        yield asked.name, _one_sided(bool(claim), asked.hidden)


def _depth(shadows: _Shadows, row: int) -> float:
    """How far the question's box reaches beyond the occluder of an umbra, and a step more."""
    corners = np.array(box_corners(shadows.questions[shadows.of[row]].box), float)
    return float((corners @ shadows.umbras.normal[row]).max() - shadows.umbras.far[row]) + 1.0 + 1e-6


def _behind(eye: np.ndarray, outline: np.ndarray, normal: np.ndarray, far: float, box: Shape) -> bool:
    """Whether a box is behind a convex polygon as seen from the eye, exactly for the float64 corners given."""
    (viewpoint, n), corners = rational([eye.tolist(), normal.tolist()]), rational(outline.tolist())
    points = box_corners(box)
    if any(dot(n, x) < Fraction(float(far)) for x in points):
        return False
    sides = zip(corners, corners[1:] + corners[:1], strict=True)
    planes = [cross(minus(a, viewpoint), minus(b, viewpoint)) for a, b in sides]
    return all(dot(m, minus(x, viewpoint)) >= 0 for m in planes for x in points)


def _maps(cases: HardCases, device: Device) -> Iterator[CubeMaps]:
    for case in cases.coverage:
        polygons = [face for shape in case.polygons for face in faces(shape)]
        starts = starts_of([len(p) for p in polygons])
        corners = np.array([corner for polygon in polygons for corner in polygon], float)
        owners = np.zeros(len(polygons), int)
        yield launch_coverage(np.array([case.viewpoint]), corners, starts, owners, resolution=case.size, device=device)


def _coverage(cases: HardCases, device: Device) -> Outcomes:
    for case, maps in zip(cases.coverage, _maps(cases, device), strict=True):
        found = {tuple(pixel) for pixel in np.argwhere(np.isfinite(maps.depth(0))).tolist()}
        outcome = Outcome.RIGHT if found == case.pixels else Outcome.WITHHELD
        yield case.name, Outcome.WRONG if found - case.pixels else outcome


def _occludees(cases: HardCases, device: Device) -> Outcomes:
    for case, maps in zip(cases.coverage, _maps(cases, device), strict=True):
        verdict = launch_occludees(maps, np.array([case.box]), np.array([[0, 0]]))[0]
        yield case.name, _one_sided(bool(verdict == Verdict.HIDDEN), case.expected == "hidden")
    shadows = _Shadows.of_cases(cases, device)
    yield from _projected(shadows, shadows.cells.mean(axis=1), device)


def _projected(shadows: _Shadows, points: np.ndarray, device: Device) -> Outcomes:
    """Questions by shrunk occluders in cube maps, one projection point each."""
    polygons = launch_shrink(shadows.umbras, np.arange(len(shadows.of)), points[shadows.of], device=device)
    sizes = np.diff(polygons.starts)
    starts = starts_of(sizes[sizes > 0])
    owners = shadows.of[sizes > 0]
    maps = launch_coverage(points, polygons.corners, starts, owners, resolution=RESOLUTION, device=device)
    boxes = np.array([asked.box for asked in shadows.questions], np.int32)
    verdicts = launch_occludees(maps, boxes, np.repeat(np.arange(len(boxes))[:, None], 2, axis=1))
    for asked, claim in zip(shadows.questions, verdicts == Verdict.HIDDEN, strict=True):
        yield asked.name, _one_sided(bool(claim), asked.hidden)


def _solve_points(cases: HardCases, device: Device) -> Outcomes:
    """All occluders of a question as one cluster."""
    shadows = _Shadows.of_cases(cases, device)
    for objective in ("socp", "lp"):
        cluster = np.zeros(len(shadows.of), int)
        options = {"objective": objective, "depth": 4096.0}
        problems = cluster_problems(shadows.umbras, shadows.cells, shadows.of, cluster, 1, **options)
        for name, outcome in _projected(shadows, solve_points(problems).point, device):
            yield f"{name}, {objective}", outcome


def _vlod(cases: HardCases, device: Device) -> Outcomes:
    settings = VlodSettings(clusters=6, objective="centre", resolution=RESOLUTION)
    for asked in _questions(cases):
        cells, boxes = np.array([asked.cell], np.int32), np.array([asked.box], np.int32)
        hidden, _ = vlod_hidden(cells, _outlines(asked.shapes), boxes, np.zeros(1, int), settings, device=device)
        yield asked.name, _one_sided(bool(hidden[0, 0]), asked.hidden)


def _backface(cases: HardCases, device: Device) -> Outcomes:
    for case in cases.backface:
        boxes, rows, scene = np.array([case.cell], np.int32), np.zeros((1, 2), int), _scene(case.surface)
        cones = build_cones(closed_elements(scene), scene.triangle_counts)
        removed = int(launch_backface(cones, boxes, rows, device=device)[0][0])
        outcome = Outcome.RIGHT if removed == case.expected else Outcome.WITHHELD
        yield case.name, Outcome.WRONG if removed > case.expected else outcome


def write_model(case: ModelCase, folder: Path) -> tuple[Path, Path]:
    """The case as a mesh file and a table of view cells, with the digits that give the same float64 back."""
    lines, count = [], 0
    for number, (role, shapes) in enumerate(case.objects):
        lines.append(f"o {number}|{KINDS[Role(role)]}|")
        for triangle in (t for shape in shapes for face in faces(shape) for t in fan(face)):
            lines += [f"v {' '.join(map(repr, corner))}" for corner in triangle]
            lines.append(f"f {count + 1} {count + 2} {count + 3}")
            count += 3
    model, cells = folder / "model.obj", folder / "cells.csv"
    model.write_text("\n".join(lines) + "\n", encoding="utf-8")
    rows = [",".join(map(repr, [*low, *high])) for low, high in case.cells]
    cells.write_text("\n".join(["min_x,min_y,min_z,max_x,max_y,max_z", *rows]) + "\n", encoding="utf-8")
    return model, cells


def _bake(method: str) -> Callable[[HardCases, Device], Outcomes]:
    def run(cases: HardCases, device: Device) -> Outcomes:
        for case in cases.model:
            with tempfile.TemporaryDirectory() as name:
                model, cells = write_model(case, Path(name))
                settings = Settings(method=method, cells=str(cells))
                made = bake(read(model), Path(name) / "out.bake", settings=settings, threads=1, device=device.name)
                yield case.name, _baked(case, made)

    return run


def _verdict(kept: bool, witnessed: bool) -> Verdict:
    return Verdict.VISIBLE if witnessed else Verdict.UNKNOWN if kept else Verdict.HIDDEN


def _baked(case: ModelCase, made: "BakeFolder") -> Outcome:
    outcomes = []
    for cell, row in enumerate(made.potential_objects):
        witnessed = set(made.seen(cell).tolist())
        for target, kept in enumerate(row.tolist()):
            if (cell, target) in case.seen:
                outcomes.append(_one_sided(not kept, hidden=False))
            else:
                outcomes.append(_two_sided(_verdict(kept, target in witnessed), hidden=True))
    return _worst(outcomes)


def _select(cases: HardCases, device: Device) -> Outcomes:
    """All whole numbers: values are exact. Less than the optimum is withheld, less than half of the gain wrong."""
    for case in cases.knapsack:
        levels = np.array([level for levels in case.objects for level in levels])
        starts = np.cumsum([0, *map(len, case.objects)])
        found = launch_select(levels[None, :, 0].astype(float), levels[:, 1], starts, case.budget, device=device)
        if case.expected is None or not found.feasible[0]:
            yield case.name, Outcome.RIGHT if (case.expected is None) != found.feasible[0] else Outcome.WRONG
            continue
        value, cost = levels[starts[:-1] + found.choice[0]].sum(axis=0).tolist()
        told = value == found.value[0] and cost == found.cost[0]
        base = sum(max(levels, key=lambda level: (-level[1], level[0]))[0] for levels in case.objects)
        half = case.expected - base <= 2 * (value - base)
        if told and half and cost <= case.budget and value <= case.expected <= found.bound[0]:
            yield case.name, Outcome.RIGHT if value == case.expected else Outcome.WITHHELD
        else:
            yield case.name, Outcome.WRONG


def _deviation(cases: HardCases, device: Device) -> Outcomes:
    """From the occluders' surface to the target's and back: the bounds must not miss what rationals say."""
    for case in (c for c in cases.region if len(c.occluders) == 1):
        sides = [_triangles(shapes) for shapes in (case.occluders, [case.target])]
        found = launch_deviation(*sides, device=device)
        exact = [[tuple(tuple(Fraction(int(c)) for c in p) for p in t) for t in side.tolist()] for side in sides]
        outcomes = []
        for way, (a, b) in enumerate((exact, exact[::-1])):
            least, most = deviation_squared(a, b, PIECES)
            lower, upper = (Fraction(float(bound[way])) for bound in (found.lower, found.upper))
            if upper**2 < least or lower**2 > most:
                outcomes.append(Outcome.WRONG)
            else:
                outcomes.append(Outcome.RIGHT if upper <= lower * (1 + TIGHT) + 1 else Outcome.WITHHELD)
        yield case.name, _worst(outcomes)


def _raster(cases: HardCases, device: Device) -> Outcomes:
    """A small picture from the cell's middle towards the target's: what rationals tell surely must be shown."""
    screen = Screen(2, 2, 60.0)
    for case in cases.region:
        shapes = [*case.occluders, case.target]
        triangles = [_triangles([shape]) for shape in shapes]
        owners = np.repeat(np.arange(len(shapes)), [len(part) for part in triangles])
        corners = np.concatenate(triangles).astype(np.int32)
        eye, goal = (np.array(box, float).mean(axis=0) for box in (case.cell, case.target))
        way = goal - eye
        yaw, pitch = np.degrees([np.arctan2(way[1], way[0]), np.arctan2(way[2], np.hypot(way[0], way[1]))])
        axes = CameraPath(eye[None], np.array([yaw]), np.array([pitch]), np.zeros(1)).axes()
        calls = np.column_stack([np.arange(len(owners)), np.arange(len(owners)) + 1, owners])
        size = {"width": screen.width, "height": screen.height, "focal": screen.focal, "near": 1.0}
        scene = raster_triangles(corners, device)
        shown = launch_raster(scene, calls, np.array([0, len(calls)]), eye[None], axes, device=device, **size).ids[0]
        outcomes = []
        for row, column in np.ndindex(screen.height, screen.width):
            pixel = (column + 0.5 - screen.width / 2, screen.height / 2 - row - 0.5)
            hit = first_hit(corners, owners, eye, axes[0], pixel, screen.focal, 1.0)
            sure = (hit.clear is None or hit.clear > SURE) and (hit.lead is None or hit.lead > SURE)
            same = int(shown[row, column]) == hit.owner
            outcomes.append(Outcome.RIGHT if same else Outcome.WRONG if sure else Outcome.WITHHELD)
        yield case.name, _worst(outcomes)


KERNELS: dict[str, Callable[[HardCases, Device], Outcomes]] = {
    "launch_stab": _stab,
    "launch_flood": _flood,
    "launch_target_search": _target_search,
    "launch_line_trees": _line_trees,
    "launch_trace": _trace,
    "launch_confirm": _confirm,
    "launch_aim": _aim,
    "launch_shaft": _shaft,
    "launch_umbra": _umbra,
    "launch_shrink": _shrink,
    "launch_coverage": _coverage,
    "launch_occludees": _occludees,
    "launch_backface": _backface,
    "launch_select": _select,
    "launch_deviation": _deviation,
    "launch_raster": _raster,
    "vlod_hidden": _vlod,
    "solve_points": _solve_points,
    "bake portals": _bake("portals"),
    "bake occluders": _bake("occluders"),
    "bake both": _bake("both"),
    "bake vlod": _bake("vlod"),
}
